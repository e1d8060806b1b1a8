"""Marker station -> findings: what slipped or turned, and which joint is no hinge."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...identify.chain import propagate
from ...rotation import kabsch
from ..findings import UNWRITTEN, Finding, weighed
from .angles import FingerAngles, Step
from .blocks import BLOCK, Blocks
from .course_amount import course_amount
from .displacement import NO_HINGE, NOT_RIGID, STRETCHED, UNNAMED, WITH_FINGER, YIELDING, MarkerEffect
from .markers import ALPHA, SMALL, UNHINGED, MarkerNaming
from .stepwise import HINGE
from .swaps import swaps
from .wobble import side_to_side

Array = NDArray[np.float64]

CORRECTION = {
    "marker_slip": "the marker's displacement is taken out from the moment of the slip",
    "palm_marker_slip": "the palm marker's displacement is taken out from the moment of the slip",
    "support_slip": "the support's turn is taken out from the moment of the slip",
}
SPACE = "the cameras' space is stretched: their scale is not the same along all directions"
IN_STEP = "the markers leave the hinge's motion in step with the angle"
DRAWS = 60  # of coefficients, for an interval
ECHO = 0.2  # of the gain at a joint, below which the one beside it is no hinge for the form of the first one's law
BENDS = 0.1  # of the gain of all that is found: the share of palm markers from which the palm is known to bend


def marker_findings(angles: FingerAngles, naming: MarkerNaming) -> list[tuple[float, Finding]]:
    """Findings of one finger's markers, one per marker, support or joint, with their weight."""
    out = swaps(angles)
    if not naming.believed:
        return out
    groups: dict[tuple[str, int, str | None], list[MarkerEffect]] = {}
    for effect in (e for e in naming.found if not _turning(naming.found, e)):
        groups.setdefault((effect.effect, effect.body, effect.label), []).append(effect)
    least, bends = _least(naming), palm_bends(naming)
    for (name, body, label), members in groups.items():
        gain = sum(e.gain for e in members)
        if name in UNNAMED or gain < least and not any(e.apart for e in members):
            continue
        if name in HINGE and gain < ECHO * _of_neighbours(naming, name, body):
            continue
        if bends and name in HINGE and body == 1:  # it carries the first joint's axis with it
            continue
        readings = max(float(naming.blocks.weight.sum()) * 3 * naming.blocks.frames / BLOCK, 1.0)
        moved = float(np.sqrt(sum(e.gain for e in members) / readings))  # over the noise of one reading
        out.append((weighed(moved, _contrast(angles)), _finding(angles, naming, name, body, label, members)))
    return out


def _of_neighbours(naming: MarkerNaming, name: str, body: int) -> float:
    """Gain of the same way of being no hinge at the joints next to a body's own: by another law than is taken there it
    shows at these as well."""
    return sum(e.gain for e in naming.found if e.effect == name and abs(e.body - body) == 1)


def palm_bends(naming: MarkerNaming) -> bool:
    """Whether the palm is not rigid: its markers move on it as the finger does, by a share of all that is found."""
    yields = sum(e.gain for e in naming.found if e.effect == YIELDING and e.body == 0)
    return yields > BENDS * sum(e.gain for e in naming.found)


def _turning(found: Sequence[MarkerEffect], effect: MarkerEffect) -> bool:
    """Whether a step is small beside a joint that changes sides as the motion turns: it may do so a little later than is
    taken here."""
    return effect.begin is not None and any(e.sides and effect.gain < SMALL * e.gain for e in found)


def _least(naming: MarkerNaming) -> float:
    """Gain below which effects are no more than the form of a larger one being another."""
    return max([SMALL * sum(e.gain for e in naming.found), *(e.gain for e in naming.found if e.effect in UNNAMED)])


def _shape(effect: MarkerEffect) -> str:
    """What is said of an effect that no table names."""
    if effect.effect == NO_HINGE:
        return f"{NO_HINGE}: {IN_STEP}"
    if effect.effect == STRETCHED:
        return SPACE
    return f"{effect.label or 'a support'} {WITH_FINGER if effect.effect == YIELDING else 'moves all the time'}"


def _contrast(angles: FingerAngles) -> float:
    """Standard deviation of a coordinate of the finger's markers as the finger moves over that of its noise."""
    body = angles.records[0].data.body
    path = np.concatenate([propagate(angles.chain, body, r.pose.angle_rad)[0][:, body > 0] for r in angles.records])
    return float(np.sqrt(np.mean(np.nanvar(path, axis=0)))) / angles.noise_m


def unexplained(angles: FingerAngles, naming: MarkerNaming) -> list[dict[str, Any]]:
    """What the markers show that no finding explains: a joint that is no plain hinge, or a misfit of no known form."""

    def entry(joint: str | None, share: float, shape: str) -> dict[str, Any]:
        return {
            "where": {"finger": angles.finger.name, "joint": joint, "actuator": None, "signal": "markers"},
            "share_of_mismatch": share,
            "shape": shape,
        }

    if naming.believed:
        total, shares = sum(e.gain for e in naming.found), dict[tuple[str | None, str], float]()
        for e in naming.found:
            if e.effect in UNNAMED:
                place = angles.finger.segments[e.body - 1].name if e.body > 0 else None, _shape(e)
                shares[place] = shares.get(place, 0.0) + e.gain / total
        return [entry(joint, share, shape) for (joint, shape), share in shares.items()]
    if naming.p_before >= ALPHA:
        return []
    joints = [e.body - 1 for e in (*naming.found, naming.refused) if e is not None and e.effect in UNHINGED]
    if joints:
        return [entry(angles.finger.segments[joints[0]].name, 1.0, f"{NO_HINGE}: {IN_STEP}")]
    return [entry(None, 1.0, NOT_RIGID)]


def _finding(
    angles: FingerAngles, naming: MarkerNaming, name: str, body: int, label: str | None, members: list[MarkerEffect]
) -> Finding:
    blocks = naming.blocks
    joint = angles.finger.segments[body - 1].name if body > 0 else None
    main = max(members, key=lambda e: e.gain)
    others = [e for e in members if e is not main]
    parameters: dict[str, dict[str, Any]] = {}
    trials = [r.trial.name for r in angles.records]
    if main.begin is not None:
        record = angles.records[int(blocks.record[main.begin])]
        at = float(blocks.time_s[main.begin])
        trials = [record.trial.name]
        if name == "support_slip":
            size = displacement(members, main)
            seen, interval = _likely(lambda own: turn(blocks, [*others, own], own), main)
            parameters["turn"] = {"value": seen, "unit": "rad", "ci95": interval}
        else:
            size, interval = _likely(lambda own: displacement([*others, own], own), main)
            parameters["distance"] = {"value": size, "unit": "m", "ci95": interval}
        parameters["moment"] = {"value": at, "unit": "s"}
        text = f"{label or f'{angles.finger.name} {joint}'}: {name.replace('_', ' ')} of {1e3 * size:.2f} mm at {at:.1f} s of {record.trial.name}."
    elif name == "joint_wobble":
        tilt, interval = _amount(naming, main)
        parameters["amplitude"] = {"value": tilt, "unit": "rad", "ci95": interval}
        text = f"{angles.finger.name} {joint}: a second rotation of up to {np.rad2deg(tilt):.2f} deg across the axis, {_how(main)}."
    else:
        travel, interval = _amount(naming, main)
        parameters["travel"] = {"value": travel, "unit": "m", "ci95": interval}
        text = f"{angles.finger.name} {joint}: the centre of rotation travels by up to {1e3 * travel:.2f} mm, {_how(main)}."
    share = sum(e.gain for e in members) / max(sum(e.gain for e in naming.found), 1e-9)
    where = {
        "finger": angles.finger.name,
        "joint": joint,
        "actuator": None,
        "signal": "markers",
        "marker": label,
        "trials": trials,
        "region": None,
        "share_of_mismatch": share,
    }
    fit = {
        "metric": "marker_rmse",
        "unit": "m",
        **_proof(naming),
        "noise_floor": naming.sigma_m,
        "held_out": [],
        "engine": "chain fitted to the markers, in-sample",
    }
    correction = CORRECTION.get(name)
    model = None if correction else dict(UNWRITTEN)
    return Finding(
        name, (name,), float(1 - np.exp(-min(main.evidence, 700))), (), where, text, parameters, fit, model, correction
    )


def _how(effect: MarkerEffect) -> str:
    return "and back when the motion turns round" if effect.sides else "as the angle grows"


def displacement(members: Sequence[MarkerEffect], main: MarkerEffect) -> float:
    """Median over the time in which `main` acts of how far [m] its effects together move the marker that they move
    most."""
    return float(np.median(np.linalg.norm(_shift(members, main), axis=-1).max(1)))


def turn(blocks: Blocks, members: Sequence[MarkerEffect], main: MarkerEffect) -> float:
    """Median over the time in which `main` acts of the angle [rad] by which its effects together turn the segment's
    markers (Kabsch 1976)."""
    return float(np.median(np.linalg.norm(_turned(blocks, members, main), axis=1)))


def _turned(blocks: Blocks, members: Sequence[MarkerEffect], main: MarkerEffect) -> Array:
    """Rotation vectors (b, 3) [rad] of that turn."""
    from scipy.spatial.transform import Rotation

    mine = blocks.body == main.body
    arm = blocks.position[main.begin or 0 : main.end, mine]
    return Rotation.from_matrix(kabsch(arm, arm + _shift(members, main)[:, mine])[0]).as_rotvec()


def with_steps(
    found: Sequence[tuple[float, Finding]],
    angles: FingerAngles,
    naming: MarkerNaming,
    stepped_deg: Mapping[str, Mapping[str, tuple[float, float]]],
) -> tuple[tuple[float, Finding], ...]:
    """Findings with what supports turned about their joint's own axis, which markers alone cannot tell from motion, and
    what they share with slips too small to report. stepped_deg: joint -> declared coefficients of the balance of its
    angle, in which "step_i" [deg] belongs to the i-th of `steps`, and their standard deviations."""
    out = []
    for weight, finding in found:
        if "turn" in finding.parameters:
            body = 1 + next(k for k, s in enumerate(angles.finger.segments) if s.name == finding.where["joint"])
            seen = finding.parameters["turn"]
            whole, sd = _whole_turn(naming, body, stepped_deg.get(finding.where["joint"], {}))
            weight *= whole / max(seen["value"], 1e-3 * whole)
            half = float(np.hypot(np.ptp(seen["ci95"]) / 2, 1.96 * sd))
            turned = {"value": whole, "unit": "rad", "ci95": [whole - half, whole + half]}
            finding = replace(finding, parameters={**finding.parameters, "turn": turned})
        out.append((weight, finding))
    return tuple(out)


def _whole_turn(naming: MarkerNaming, body: int, stepped_deg: Mapping[str, tuple[float, float]]) -> tuple[float, float]:
    """A support's turn [rad], and the standard deviation of its part about the joint's axis."""
    blocks, least = naming.blocks, _least(naming)
    main = max((e for e in naming.found if e.effect == "support_slip" and e.body == body), key=lambda e: e.gain)
    acting = [
        e
        for e in naming.found
        if e.body == body and (e.effect == "support_slip" or e.effect == "marker_slip" and e.gain < least)
    ]
    told = [
        (stepped_deg.get(f"step_{i}", (0.0, 0.0)), e.active) for i, e in enumerate(_stepping(naming)) if e.body == body
    ]
    along = np.deg2rad(sum(step * active for (step, _), active in told))[:, None] * blocks.axes[:, body - 1]
    turned = np.linalg.norm(_turned(blocks, acting, main) + along[main.begin : main.end], axis=1)
    varying = sum((sd * active) ** 2 for (_, sd), active in told)[main.begin : main.end]
    return float(np.median(turned)), float(np.deg2rad(np.sqrt(np.median(varying))))


def _shift(members: Sequence[MarkerEffect], main: MarkerEffect) -> Array:
    """Displacement (b, m, 3) [m] of all markers by effects together, in the blocks in which `main` acts."""
    shift = sum((e.columns @ e.coefficients).reshape(len(e.columns), -1, 3) for e in members)
    return shift[main.begin or 0 : main.end]


def _amount(naming: MarkerNaming, effect: MarkerEffect) -> tuple[float, list[float]]:
    """Amplitude of a joint's second rotation [rad], or the largest travel of its centre [m], over the recorded angles,
    with its 95 % interval; a play changes sides (a centre travels from one to the other)."""
    if not effect.sides:
        return course_amount(naming, effect)
    blocks, shifts = naming.blocks, all(effect.shifts)

    def amount(own: MarkerEffect) -> float:
        moved = (own.columns @ own.coefficients).reshape(len(blocks.residual), -1, 3)
        return (1 + shifts) * side_to_side(blocks, own.body, moved, shifts)

    return _likely(amount, effect)


def _likely(amount: Callable[[MarkerEffect], float], effect: MarkerEffect) -> tuple[float, list[float]]:
    """An amount of an effect, and the 95 % interval that the fitted coefficients' covariance lets it have (parametric
    bootstrap, Efron & Tibshirani 1993, ch. 6)."""
    rng = np.random.default_rng(0)
    drawn = rng.multivariate_normal(effect.coefficients, effect.covariance, DRAWS, method="eigh")
    value, sd = amount(effect), float(np.std([amount(replace(effect, coefficients=c)) for c in drawn]))
    return value, [value - 1.96 * sd, value + 1.96 * sd]


def _proof(naming: MarkerNaming) -> dict[str, Any]:
    """Error per coordinate of block means [m] before and after, from the excess of the cell means."""
    count = max(naming.blocks.weight.size * 3, 1)
    before, after = (
        float(naming.sigma_m * np.sqrt(1 + e / count)) for e in (naming.excess_before, naming.excess_after)
    )
    return {"before": before, "after": after, "ci95_reduction": None}


def steps(naming: MarkerNaming) -> list[Step]:
    """Every slip: a support that turns about its joint's own axis steps the angle, which markers alone cannot tell from
    motion; encoder and linkage balances let the angle step there."""
    return [e.step(naming.blocks) for e in _stepping(naming)]


def _stepping(naming: MarkerNaming) -> list[MarkerEffect]:
    return [
        e
        for e in naming.found
        if naming.believed and e.begin is not None and e.effect in ("support_slip", "palm_marker_slip")
    ]
