"""Layer 1: joints without a partner, limits, and the relations that tie one joint to another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from .align import Alignment
from .features import Features
from .joint_fit import Fit
from .pairing import Pairing
from .report import Finding
from .tree import Array, Coupling, Tree, half_units

LIMIT_TOLERANCE = 1e-5
"""[rad or m] half a unit of the sixth digit of the widest limits."""
ROUNDED_LIMIT = 0.01
"""[rad or m] the largest difference that is put down to writing a limit with fewer digits."""
COUPLING_TOLERANCE = 1e-5
"""[rad or m] of the follower."""

Limits = tuple[float, float] | None


def relation_findings(a: Tree, b: Tree, pairing: Pairing, f: Features, at: Alignment) -> list[Finding]:
    """Everything that differs before any geometry: partners, kinds, limits, couplings."""
    fits = {x: fit for (x, _), fit in zip(f.names, at.fits, strict=True)}
    joints = tuple(f.names)
    return [*_partners(a, b, pairing), *_limits(a, b, joints, fits), *_couplings(a, b, joints, fits)]


def _partners(a: Tree, b: Tree, pairing: Pairing) -> list[Finding]:
    out = []
    for tree, other, names in ((a, b, pairing.unpaired[0]), (b, a, pairing.unpaired[1])):
        if names:
            who = ", ".join(f'"{n}"' for n in names)
            text = f"{tree.path.name} has {len(names)} joint(s) that {other.path.name} does not have: {who}"
            if pairing.explicit:
                text = f"pair.toml leaves out {who} of {tree.path.name}: held at zero"
            out.append(Finding("missing_joint", 1, names, text, {"joints": float(len(names))}, not pairing.explicit))
    for x, y in pairing.joints:
        kinds = a.joint(x).kind, b.joint(y).kind
        if kinds[0] != kinds[1]:
            out.append(
                Finding(
                    "joint_type", 1, (x,), f'"{x}" is a {kinds[0]} in {a.path.name} and a {kinds[1]} in {b.path.name}'
                )
            )
    return out


def carried(limits: Limits, fit: Fit) -> Limits:
    """Limits of b in a's coordinate: sign * b - offset."""
    if limits is None:
        return None
    low, high = sorted(fit.sign * v - fit.offset for v in limits)
    return low, high


def _gap(one: Limits, other: Limits) -> float:
    if one is None or other is None:
        return 0.0 if one is other else np.inf
    return float(np.abs(np.subtract(one, other)).max())


def _limits(a: Tree, b: Tree, joints: Sequence[tuple[str, str]], fits: Mapping[str, Fit]) -> list[Finding]:
    of_a = {x: a.joint(x).limits for x, _ in joints}
    of_b = {x: b.joint(y).limits for x, y in joints}
    moved = {x: carried(of_b[x], fits[x]) for x, _ in joints}
    gap = {x: min(_gap(of_a[x], of_b[x]), _gap(of_a[x], moved[x])) for x, _ in joints}
    wrong = [x for x, _ in joints if gap[x] > LIMIT_TOLERANCE]
    out, done = [], set()
    partner = dict(joints)
    for cause, sentence, members in _misplaced(a, b, wrong, of_a, of_b, partner):
        done |= set(members)
        worst = max(gap[x] for x in members)
        out.append(Finding(cause, 1, tuple(members), sentence, {"largest_deg": float(np.degrees(worst))}))
    for x in wrong:
        if x not in done:
            out.append(_limit_finding(a, b, x, partner[x], fits[x], gap[x]))
    return out


def _misplaced(a: Tree, b: Tree, wrong: list[str], of_a, of_b, partner):
    """Limits that belong to another joint: two exchanged, or a run moved on by one, in the order of either file."""
    for i in list(wrong):
        mutual = (j for j in wrong if j != i and max(_gap(of_a[i], of_b[j]), _gap(of_a[j], of_b[i])) <= LIMIT_TOLERANCE)
        if i in wrong and (j := next(mutual, None)) is not None:
            wrong = [x for x in wrong if x not in (i, j)]
            yield "limits_exchanged", f'"{i}" and "{j}" have each other\'s limits', [i, j]
    orders = [[j.name for j in a.joints if j.name in of_a], sorted(of_a, key=lambda x: b.joint_node[partner[x]])]
    orders += [_depth_first(a, set(of_a)), sorted(of_a, key=lambda x: a.joint(x).line or 0)]
    orders.append(sorted(of_a, key=lambda x: b.joint(partner[x]).line or 0))
    best: tuple[list[str], int, list[str]] = ([], 0, [])
    for order in orders:
        for step in (1, -1):
            hit = []
            for x in wrong:
                at = order.index(x) + step
                ring = order[at % len(order)]
                if _gap(of_a[x], of_b[ring]) <= LIMIT_TOLERANCE:
                    hit.append(x)
            if len(hit) > len(best[0]):
                best = (hit, step, order)
    hit, step, order = best
    if hit and len(hit) >= max(1, len(wrong) - 1 - len(wrong) // 3) and (len(hit) > 1 or len(wrong) <= 2):
        ends = [x for x in wrong if x not in hit and _another(x, wrong, of_a, of_b)]
        k = order.index(hit[0])
        neighbour = order[(k + step) % len(order)]
        where = "next" if step > 0 else "previous"
        text = (
            f"limits shifted by one: {a.path.name} gives {len(hit) + len(ends)} joint(s) the limits that "
            f"{b.path.name} gives the "
            f'{where} one, first "{hit[0]}" those of "{partner[neighbour]}"'
        )
        yield "limits_shifted", text, hit + ends


def _another(x: str, wrong: list[str], of_a, of_b) -> bool:
    """The run's last joint has wrapped round to the first one's limits."""
    return any(_gap(of_a[x], of_b[y]) <= LIMIT_TOLERANCE for y in wrong if y != x)


def _depth_first(tree: Tree, wanted: set[str]) -> list[str]:
    children: dict[int, list[int]] = {}
    for i, node in enumerate(tree.nodes):
        children.setdefault(node.parent, []).append(i)
    out, stack = [], [0]
    while stack:
        i = stack.pop()
        if tree.nodes[i].joint and tree.nodes[i].joint.name in wanted:
            out.append(tree.nodes[i].joint.name)
        stack += reversed(children.get(i, []))
    return out


def _limit_finding(a: Tree, b: Tree, x: str, y: str, fit: Fit, gap: float) -> Finding:
    ja, jb = a.joint(x), b.joint(y)
    la, lb, moved = ja.limits, jb.limits, carried(jb.limits, fit)
    said = f'"{x}" [{_span(la)}] against [{_span(lb)}]'
    if la is None or lb is None:
        free = a if la is None else b
        return Finding("limits_differ", 1, (x,), f"{said}: {free.path.name} leaves the joint unlimited")
    degrees = 180 / np.pi
    for factor, way in (
        (degrees, f"{a.path.name} is in degrees where radians are read"),
        (1 / degrees, f"{b.path.name} is in degrees where radians are read"),
    ):
        if _gap(la, (lb[0] * factor, lb[1] * factor)) <= 2e-3 * max(map(abs, la)) + LIMIT_TOLERANCE:
            return Finding("limits_degrees", 1, (x,), f"{said}: {way} (factor {factor:.4g})", {"factor": factor})
    if _gap(la, (-lb[1], -lb[0])) <= LIMIT_TOLERANCE:
        return Finding(
            "limits_mirrored", 1, (x,), f"{said}: both signs are turned over", {"largest_deg": float(np.degrees(gap))}
        )
    figures = {"lower_deg": float(np.degrees(la[0] - lb[0])), "upper_deg": float(np.degrees(la[1] - lb[1]))}
    room = max(max(p, q) for p, q in zip(ja.limit_slack, jb.limit_slack, strict=True))
    if gap <= min(1.01 * room, ROUNDED_LIMIT):
        return Finding("numbers_rounded", 1, (x,), f"{said}: the same limits with fewer digits", figures, False)
    text = f"{said}: lower {figures['lower_deg']:+.3f} deg, upper {figures['upper_deg']:+.3f} deg"
    if abs(fit.offset) > 1e-6 or fit.sign < 0:
        rest = np.degrees(np.subtract(la, moved))
        text += f"; with the other zero taken into account lower {rest[0]:+.3f} deg, upper {rest[1]:+.3f} deg"
        figures |= {"lower_rest_deg": float(rest[0]), "upper_rest_deg": float(rest[1])}
    return Finding("limits_differ", 1, (x,), text, figures)


def _span(limits: Limits) -> str:
    return "unlimited" if limits is None else f"{limits[0]:.6g}, {limits[1]:.6g}"


def _couplings(a: Tree, b: Tree, joints: Sequence[tuple[str, str]], fits: Mapping[str, Fit]) -> list[Finding]:
    back = {y: x for x, y in joints}
    out: list[Finding] = []
    reversed_already: set[str] = set()
    for x, y in joints:
        ca, cb = a.joint(x).coupling, b.joint(y).coupling
        if ca is None and cb is None or x in reversed_already:
            continue
        turned = _reversed(a, b, x, y, back)
        if turned is not None:
            reversed_already |= set(turned.where)
            out.append(turned)
        elif ca is None or cb is None:
            other = _reversed_partner(a, b, x, y, back)
            if other is None:
                out.append(_missing(a, b, x, y))
        else:
            out += _law(a, b, x, y, back, fits)
    return out + _chains(a, b, joints, back)


def _reversed(a: Tree, b: Tree, x: str, y: str, back: Mapping[str, str]) -> Finding | None:
    """a: x follows d. b: d's partner follows x's partner. Either way round, told once, from a's follower."""
    ca = a.joint(x).coupling
    if (
        ca is None
        or ca.driver is None
        or b.joint(y).coupling is not None
        and back.get(b.joint(y).coupling.driver) == ca.driver
    ):
        return None
    partner = {v: k for k, v in back.items()}.get(ca.driver)
    cb = b.joint(partner).coupling if partner else None
    if cb is None or cb.driver != y:
        return None
    driver = _span_of(a, ca.driver, b, partner)
    loop = cb.follower(ca.follower(driver)) - driver
    same = float(np.degrees(np.abs(loop).max()))
    how = (
        "the law is the inverse one, so only the roles differ"
        if same < 1e-3
        else f"followed both ways round, {same:.3g} deg are lost"
    )
    text = (
        f'in {a.path.name} "{x}" follows "{ca.driver}", in {b.path.name} "{partner}" follows "{y}" (joint1 is '
        f"the follower): {how}"
    )
    return Finding("equality_reversed", 1, (x, ca.driver), text, {"loop_deg": same})


def _reversed_partner(a: Tree, b: Tree, x: str, y: str, back: Mapping[str, str]) -> str | None:
    """The other end of a reversed coupling of which only this end is coupled in b."""
    cb = b.joint(y).coupling
    driver = back.get(cb.driver) if cb and cb.driver else None
    ca = a.joint(driver).coupling if driver else None
    return driver if ca is not None and ca.driver == x else None


def _missing(a: Tree, b: Tree, x: str, y: str) -> Finding:
    has, lacks, name = (a, b, x) if a.joint(x).coupling else (b, a, y)
    coupling = has.joint(name).coupling
    law = " + ".join(
        f"{c:.6g} q^{i}" if i > 1 else f"{c:.6g}" + " q" * i for i, c in enumerate(coupling.coefficients) if c
    )
    text = f'in {has.path.name} "{name}" follows "{coupling.driver}" ({law}), in {lacks.path.name} it moves freely'
    return Finding("coupling_missing", 1, (x,), text)


def _span_of(a: Tree, x: str, b: Tree, y: str) -> Array:
    known = [limits for limits in (a.joint(x).limits, b.joint(y).limits) if limits is not None]
    low, high = (max(v[0] for v in known), min(v[1] for v in known)) if known else (-1.0, 1.0)
    return np.linspace(low, high, 401) if low < high else np.linspace(-1.0, 1.0, 401)


def resolved(tree: Tree, name: str) -> tuple[str | None, list[Coupling]]:
    """The free joint at the end of a chain of couplings, and the couplings from it to `name`."""
    chain: list[Coupling] = []
    at: str | None = name
    while at is not None and tree.joint(at).coupling is not None and len(chain) < len(tree.joint_node):
        chain.insert(0, tree.joint(at).coupling)
        at = chain[0].driver
    return at, chain


def _law(a: Tree, b: Tree, x: str, y: str, back: Mapping[str, str], fits: Mapping[str, Fit]) -> list[Finding]:
    (da, chain_a), (db, chain_b) = resolved(a, x), resolved(b, y)
    if da != (back.get(db, db) if db else None):
        text = f'"{x}" follows "{da}" in {a.path.name} and "{db}" in {b.path.name}'
        return [Finding("coupling_differs", 1, (x,), text)]
    q = np.zeros(1) if da is None else _span_of(a, da, b, db)
    follower_a, follower_b = q, q
    for coupling in chain_a:
        follower_a = coupling.follower(follower_a)
    for coupling in chain_b:
        follower_b = coupling.follower(follower_b)
    fit, start = fits[x], fits[da] if da else None
    mapped = q if start is None else start.sign * (q + start.offset)
    for coupling in chain_b:
        mapped = coupling.follower(mapped)
    apart = min((follower_a - follower_b, follower_a - (fit.sign * mapped - fit.offset)), key=lambda d: np.abs(d).max())
    worst = int(np.abs(apart).argmax())
    loss = float(np.abs(apart[worst]))
    if loss <= COUPLING_TOLERANCE:
        return []
    figures = {
        "largest_deg": float(np.degrees(loss)),
        "at_driver_deg": float(np.degrees(q[worst])),
        "rms_deg": float(np.degrees(np.sqrt((apart**2).mean()))),
    }
    degrees = [max((c.degree for c in chain), default=0) for chain in (chain_a, chain_b)]
    said = f'"{x}": {figures["largest_deg"]:.3g} deg apart where "{da}" is at {figures["at_driver_deg"]:.3g} deg'
    if min(degrees) <= 1 < max(degrees):
        linear, curved = (a, b) if degrees[0] <= 1 else (b, a)
        target = follower_b if degrees[0] <= 1 else follower_a
        least = float(np.degrees(np.abs(target - np.polyval(np.polyfit(q, target, 1), q)).max()))
        text = (
            f"{said}: {linear.path.name} holds a straight line for the polynomial of degree {max(degrees)} "
            f"in {curved.path.name}"
        )
        text += f" (the best line would still lose {least:.3g} deg)"
        return [Finding("linear_mimic", 1, (x,), text, {**figures, "best_line_deg": least})]
    if len(chain_a) == len(chain_b) == 1 and _rounded(chain_a[0], chain_b[0]):
        return [Finding("numbers_rounded", 1, (x,), f"{said}: the same law with fewer digits", figures)]
    return [Finding("coupling_differs", 1, (x,), f"{said}: the laws differ", figures)]


def _rounded(one: Coupling, other: Coupling) -> bool:
    size = max(len(one.coefficients), len(other.coefficients))
    p, q = (np.pad(c.coefficients, (0, size - len(c.coefficients))) for c in (one, other))

    def within(short: Array, full: Array) -> bool:
        return all(abs(s - t) <= 1.01 * half_units(repr(float(s)))[0] for s, t in zip(short, full, strict=True))

    return within(p, q) or within(q, p)


def _chains(a: Tree, b: Tree, joints: Sequence[tuple[str, str]], back: Mapping[str, str]) -> list[Finding]:
    out = []
    for x, y in joints:
        length_a, length_b = (len(resolved(tree, name)[1]) for tree, name in ((a, x), (b, y)))
        for tree, name, own, other in ((a, x, length_a, length_b), (b, y, length_b, length_a)):
            if own > 1 and (own != other or tree is a):
                driver = tree.joint(name).coupling.driver
                text = (
                    f'in {tree.path.name} "{name}" follows "{driver}", '
                    f'which follows "{tree.joint(driver).coupling.driver}" itself'
                )
                if tree.format == "urdf":
                    text += " (Pinocchio refuses such a chain and yourdfpy evaluates it wrongly)"
                out.append(
                    Finding("mimic_chain", 1, (x,), text, {"links": float(own)}, own != other and tree.format == "urdf")
                )
    return out
