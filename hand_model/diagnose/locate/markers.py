"""Marker station: markers against rigid segments on hinges; slips, supports that turn, hinges that are none.

Linear in everything small about the identified chain: per frame the palm pose and joint angles, shared the chain, and
the columns of a candidate. Frames are eliminated one by one (orthogonal projection), the chain by its Gram matrix, so
that a candidate's gain is what neither a pose nor another chain can explain; a step's moment is scanned by cumulative
sums.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...effects.outside.outsider import UNLIKELY
from .angles import FingerAngles, refitted
from .blocks import Blocks, blocks_of, project
from .displacement import NO_HINGE, MarkerEffect, candidates_of, creeping, of_any_form, stretched
from .lasting_noise import LastingNoise, lasting_noise
from .stepwise import HINGE, Stepwise
from .wobble import possible

Array = NDArray[np.float64]

EVIDENCE_LEAST = 15.0  # log evidence of a marker effect, beyond its parameters and the search over moments
SEEN = 9.0  # of a joint's, where the test sees that something is missing, and it leaves nothing of that
MOST = 10  # a slip that is put right between recordings is one a recording
SKIP_P = 0.3  # lack of fit above which no candidate is tried
ALPHA = 0.003  # false alarms per finger
SMALL = 0.03  # of what another brings: less may be no more than that one's form being another
EXPLAINED_LEAST = 0.9  # of the misfit: below, the names are not believed
SPELL = 12  # blocks, about a second, whose mean shows what stays correlated
UNHINGED = (*HINGE, NO_HINGE)  # of joints that are no hinges: in step with the angle
# of a turn that markers see, what it may have along the hinge, where nobody sees it: of one that follows a known way, and
# of what is left beside it
ALONG, LEFT = 0.25, 4.0
SLIPS = ("marker_slip", "palm_marker_slip", "support_slip")


@dataclass(frozen=True)
class MarkerNaming:
    """Outcome of the marker station. sigma_m: noise of one coordinate of a block mean. p_before, p_after: lack of fit.
    refused: the likeliest further effect, that did not bring enough."""

    blocks: Blocks
    found: tuple[MarkerEffect, ...]
    sigma_m: float
    p_before: float
    p_after: float
    excess_before: float
    excess_after: float
    refused: MarkerEffect | None = None

    @property
    def believed(self) -> bool:
        """Whether the names stand: what they leave is noise, or they take most of the misfit away."""
        return bool(self.found) and (
            self.p_after >= ALPHA or self.excess_after < (1 - EXPLAINED_LEAST) * self.excess_before
        )


def name_markers(angles: FingerAngles, drift: float = 0.0) -> MarkerNaming:
    """Name slips and hinges that are none in the flexion recordings of one finger, by forward selection. drift:
    `camera_drift` of the session."""
    return named_in(blocks_of(angles), drift)


def named_in(blocks: Blocks, drift: float = 0.0) -> MarkerNaming:
    """The same of its blocks of frames. drift: `camera_drift`."""
    y = project(blocks, blocks.residual.reshape(len(blocks.residual), -1, 1))
    shared = project(blocks, blocks.chain_columns)
    sigma = _noise(y, blocks)
    lasting = lasting_noise(blocks, y[..., 0], drift)
    p_before, excess_before = _lack(_solve(shared, y)[1], blocks, lasting)
    if p_before > SKIP_P:
        return MarkerNaming(blocks, (), sigma, p_before, p_before, excess_before, excess_before)
    candidates, before = candidates_of(blocks), (p_before, excess_before)
    search = Stepwise(blocks, candidates, y, shared, sigma, lasting)
    return _unstretched(search, _within_reach(search, before), before)


def _within_reach(search: Stepwise, before: tuple[float, float]) -> MarkerNaming:
    """The naming of a search. A way of a joint that no finger can go is what stays where nothing else explains the
    markers, or, what other things leave told beside them, explains them better."""
    naming = _named(search, before)
    beyond = {e.body for e in naming.found if e.effect == NO_HINGE}
    if not beyond:
        return naming
    candidates = [c for c in search.candidates if c.effect not in UNHINGED or c.body not in beyond]
    other = _named(Stepwise(search.blocks, candidates, search.y, search.shared, search.sigma, search.lasting), before)
    if other.found and other.p_after >= ALPHA and all(e.effect != NO_HINGE for e in other.found):
        return other
    known = [e for e in other.found if e.effect not in UNHINGED]
    if not known:
        return naming
    again = _named(search, before, known)
    return again if search.score(again.found) > search.score(naming.found) + UNLIKELY else naming


def _unstretched(search: Stepwise, naming: MarkerNaming, before: tuple[float, float]) -> MarkerNaming:
    """The naming, or the one beside cameras whose space is stretched, where that says clearly more."""
    if not naming.found and naming.p_before >= ALPHA:
        return naming
    strain = search.alone(stretched(search.blocks))
    if search.score([*naming.found, strain]) < search.score(naming.found) + UNLIKELY:
        return naming
    again = _named(search, before, [strain])
    return again if search.score(again.found) > search.score(naming.found) + UNLIKELY else naming


def _named(search: Stepwise, before: tuple[float, float], begin: Sequence[MarkerEffect] = ()) -> MarkerNaming:
    """The naming among the candidates of a search; slips of one place are a creep where an even motion says as much.
    before: lack of fit and excess without any. begin: effects from which it sets out."""
    blocks, candidates, y, shared, sigma = search.blocks, search.candidates, search.y, search.shared, search.sigma
    found, refused = _selected(search, begin)
    for place in dict.fromkeys((e.body, e.label) for e in found if e.begin is not None):
        others = [e for e in found if e.begin is None or (e.body, e.label) != place]
        slips = [c for c in candidates if c.step and c.lasting and (c.body, c.label) == place]
        creep = max((search.alone(c) for slip in slips for c in creeping(blocks, slip)), key=lambda c: c.gain)
        if search.score([*others, creep]) > search.score(found) + UNLIKELY:
            found = _pruned(search, [creep, *others])
    found = [replace(e, apart=_apart(search, found, e)) for e in found]
    every = np.concatenate([shared, *(project(blocks, e.columns) for e in found)], axis=-1)
    inverse, right = _chain_part(every, y)
    coefficients = inverse @ right
    residual = y - every @ coefficients[:, None]
    covariance = inverse * sigma**2 * _inflation(residual, blocks)
    p, excess = _lack(residual, blocks, search.lasting)
    start = blocks.chain_columns.shape[-1]
    done = []
    for effect in found:
        own = slice(start, start + effect.everywhere.shape[-1])
        effect = replace(effect, coefficients=coefficients[own], covariance=covariance[own, own])
        done.append(effect if _possible(blocks, effect) else replace(effect, effect=NO_HINGE))
        start = own.stop
    return MarkerNaming(blocks, tuple(done), sigma, before[0], p, before[1], excess, refused)


def _possible(blocks: Blocks, effect: MarkerEffect) -> bool:
    """Whether an effect is of a size that a finger's joint can have; what is farther is no way that is known."""
    if effect.effect not in HINGE:
        return True
    return possible(blocks, effect.body, (effect.columns @ effect.coefficients).reshape(len(blocks.residual), -1, 3))


def _selected(search: Stepwise, begin: Sequence[MarkerEffect] = ()) -> tuple[list[MarkerEffect], MarkerEffect | None]:
    """What stepwise selection finds from `begin` on, and the likeliest further effect, that did not bring enough."""
    found = list(begin)
    while len(found) < MOST:
        best = search.next(found)
        # what stays correlated beside the best candidate weighs all of them down
        best = replace(best, evidence=_borne(search, [*found, best], best.gain, best))
        if best.evidence < EVIDENCE_LEAST:
            if _within_noise(search, found):
                return found, best
            if not found and _all_that_is_seen(search, best):
                return [best], None
            larger = _ahead(search, found)
            return larger, best if larger is found else None
        found = search.settled([*found, best])
    return found, None


def _all_that_is_seen(search: Stepwise, effect: MarkerEffect) -> bool:
    """Whether a joint that is no hinge is all that is missing, plainly enough where the test says that something is."""
    return effect.effect in HINGE and effect.evidence >= SEEN and _within_noise(search, [effect])


def _within_noise(search: Stepwise, found: list[MarkerEffect]) -> bool:
    return _lack(search.residual(found), search.blocks, search.lasting)[0] >= ALPHA


def _ahead(search: Stepwise, found: list[MarkerEffect]) -> list[MarkerEffect]:
    """A larger set of effects, clearly likelier than `found`: several together may do what each of them alone, the
    others still hidden in what it leaves, does not. `found` where there is no such set."""
    larger = found
    while len(larger) < MOST and (best := search.next(larger)).evidence > 0:
        larger = search.settled([*larger, best])
    larger = _pruned(search, larger)
    return larger if search.score(larger) > search.score(found) + UNLIKELY else found


def _pruned(search: Stepwise, found: list[MarkerEffect]) -> list[MarkerEffect]:
    """What of the found effects brings enough beside all the others."""
    while found:
        least, weakest = min(
            ((_borne(search, found, gain, e), e) for gain, e in zip(search.without(found), found, strict=True)),
            key=lambda i: i[0],
        )
        if least >= EVIDENCE_LEAST:
            break
        found = [e for e in found if e is not weakest]
    return found


def _apart(search: Stepwise, found: list[MarkerEffect], effect: MarkerEffect) -> bool:
    """Whether a joint is no hinge, whatever form the much larger slips have: what is small beside one may else be no
    more than its form being another; beside another joint that is none, what is of second order in that."""
    larger = [e for e in found if effect.gain < SMALL * e.gain]
    if effect.effect not in HINGE or any(e.begin is None for e in larger):
        return False
    own = [e for e in found if e is not effect and effect.gain >= SMALL * e.gain]
    beside = [*(of_any_form(search.blocks, e) for e in larger), *own, effect]
    return _borne(search, beside, search.without(beside)[-1], effect) >= EVIDENCE_LEAST


def _borne(search: Stepwise, found: Sequence[MarkerEffect], gain: float, effect: MarkerEffect) -> float:
    """Log evidence of an effect that brings `gain`, as what `found` leaves correlated bears it out."""
    parameters = effect.everywhere.shape[-1] + (effect.begin is not None)
    return 0.5 * gain / _inflation(search.residual(found), search.blocks) - 0.5 * parameters * float(
        np.log(search.readings)
    )


def _inflation(residual: Array, blocks: Blocks) -> float:
    """Variance of means over SPELL blocks of the residual (b, 3m, 1) over what independent blocks would have, at least
    one."""
    z = residual[..., 0]
    same = blocks.record[1:] == blocks.record[:-1]
    white = 0.5 * float(np.sum(np.mean(np.diff(z, axis=0)[same] ** 2, axis=0)))
    spells = [
        z[i : i + SPELL].mean(0)
        for r in np.unique(blocks.record)
        for rows in [np.flatnonzero(blocks.record == r)]
        for i in range(rows[0], rows[-1] + 2 - SPELL, SPELL)
    ]
    if len(spells) < 4:
        return 1.0
    return max(SPELL * float(np.sum(np.mean(np.square(spells), axis=0))) / max(white, 1e-300), 1.0)


def _solve(shared: Array, y: Array) -> tuple[Array, Array]:
    """Shared coefficients and the residual (b, 3m, 1) that they leave."""
    inverse, right = _chain_part(shared, y)
    coefficients = inverse @ right
    return coefficients, y - shared @ coefficients[:, None]


def _noise(y: Array, blocks: Blocks) -> float:
    """Noise [m] of one coordinate: differences of neighbouring blocks, in which slow misfit cancels."""
    same = blocks.record[1:] == blocks.record[:-1]
    square = np.diff(y[..., 0], axis=0)[same] ** 2
    free = (blocks.weight > 0).sum(1) * 3 - blocks.pose_basis.shape[-1]
    return float(np.sqrt(0.5 * np.median(square.sum(1) / np.maximum(free[1:][same], 1)) / 0.965))


def _chain_part(shared: Array, y: Array) -> tuple[Array, Array]:
    """Pseudo-inverse of the shared columns' Gram matrix, and their products with y."""
    flat = shared.reshape(-1, shared.shape[-1])
    gram = flat.T @ flat
    size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    return np.linalg.pinv(gram / np.outer(size, size), rcond=1e-9, hermitian=True) / np.outer(
        size, size
    ), flat.T @ y.ravel()


def _lack(residual: Array, blocks: Blocks, lasting: LastingNoise) -> tuple[float, float]:
    """Chi-square of cell means of the projected residual, in segment frames, over time and over angle: p and excess."""
    b, m = blocks.weight.shape
    z = np.einsum("bmji,bmj->bmi", blocks.rotation, residual.reshape(b, m, 3)).reshape(b, -1)
    same = blocks.record[1:] == blocks.record[:-1]
    variance = 0.5 * np.mean(np.diff(z, axis=0)[same] ** 2, axis=0)
    time_cell = np.searchsorted(np.linspace(0, b, 25)[1:-1], np.arange(b), side="right")
    worst, excess = 1.0, 0.0
    angles = [_bins(blocks.angle[:, k], 12) for k in range(blocks.angle.shape[1])]
    for cell in (time_cell, *angles):
        statistic, degrees = 0.0, 0
        for c in np.unique(cell):
            mine = z[cell == c]
            statistic += float(np.sum(mine.mean(0) ** 2 * len(mine) / np.maximum(variance, 1e-300)))
            degrees += z.shape[1]
        worst = min(worst, lasting.chance(statistic, degrees) * (1 + len(angles)))
        excess = max(excess, statistic - lasting.inflation * degrees)
    return worst, excess


def _bins(values: Array, count: int) -> NDArray[np.int64]:
    return np.searchsorted(np.quantile(values, np.linspace(0, 1, count + 1)[1:-1]), values)


def tilt(naming: MarkerNaming) -> float:
    """By how much [deg, root mean square] angles may depart where joints are no plain hinges: what turns segments, or
    moves them, across the hinge, may do so along it, too. Of a known way a part, of what is left several times as much;
    of no known way all of it."""
    ways, unknown = [e for e in naming.found if e.effect in UNHINGED], naming.p_before < ALPHA and not naming.believed
    if not ways and not unknown:
        return 0.0
    blocks = naming.blocks
    apart = [
        np.linalg.norm(own - own.mean(1, keepdims=True), axis=-1).max()
        for own in (blocks.position[:, blocks.body == k] for k in np.unique(blocks.body[blocks.body > 0]))
    ]

    def turn_deg(excess: float) -> float:
        size_m = naming.sigma_m * np.sqrt(max(excess, 0.0) / (3 * blocks.weight.size))
        return float(np.rad2deg(size_m / np.median(apart)))

    if unknown:
        return turn_deg(naming.excess_before)
    whole = turn_deg(min(sum(e.gain for e in ways), naming.excess_before))
    share = 1.0 if any(e.effect == NO_HINGE for e in ways) else ALONG
    return max(share * whole, LEFT * turn_deg(naming.excess_after))


def corrected_angles(angles: FingerAngles, naming: MarkerNaming) -> FingerAngles:
    """The angles with the named effects' displacement taken out of the markers, chain and poses fitted anew."""
    if not naming.believed:
        return angles
    course = _least_course(naming) if any(e.effect in UNHINGED for e in naming.found) else None
    right = []
    for index, record in enumerate(angles.records):
        shift = shift_at_frames(naming, index, record.mocap.time_s, course)
        world = np.einsum("nij,nmj->nmi", record.pose.rotation, shift)
        right.append(replace(record.data, position_world=record.data.position_world - world))
    return refitted(angles, right)


def _least_course(naming: MarkerNaming) -> Array:
    """Displacement (b, 3m) [m] by all joints that are no hinges, without what another chain of hinges would explain as
    well: the least that leaves hinges. Their tilts are nearly another axis, and what is linear in both would else go
    far both ways."""
    blocks = naming.blocks
    course = np.zeros(blocks.residual.reshape(len(blocks.residual), -1).shape)
    for effect in (e for e in naming.found if e.effect in UNHINGED):
        course += effect.everywhere @ effect.coefficients
    chain, _ = _solve(project(blocks, blocks.chain_columns), project(blocks, course[..., None]))
    return course - blocks.chain_columns @ chain


def shift_at_frames(naming: MarkerNaming, record: int, time_s: Array, course: Array | None = None) -> Array:
    """Displacement (n, m, 3) [m], palm frame, of all named effects at the frames of one record. course: (b, 3m) [m] in
    the place of those of joints that are no hinges."""
    blocks = naming.blocks
    mine = np.flatnonzero(blocks.record == record)
    out = np.zeros((len(time_s), *blocks.weight.shape[1:], 3))
    if not len(mine):
        return out
    at = np.interp(time_s, blocks.time_s[mine], np.arange(len(mine)))
    low = np.minimum(at.astype(int), max(len(mine) - 2, 0))
    share = (at - low)[:, None]

    def between(blockwise: Array) -> Array:
        return (1 - share) * blockwise[low] + share * blockwise[np.minimum(low + 1, len(mine) - 1)]

    for effect in naming.found:
        if course is None or effect.effect not in UNHINGED:
            now = between(effect.everywhere[mine] @ effect.coefficients)
            out += (now * effect.acts(blocks, record, time_s)[:, None]).reshape(out.shape)
    return out if course is None else out + between(course[mine]).reshape(out.shape)
