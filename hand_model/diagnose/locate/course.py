"""The course of a joint that is no plain hinge, fitted to the markers of the training recordings.

Chain, palm poses, angles and the quartics of the extra joints are fitted together (Gauss-Newton on blocks of frames,
each block's pose eliminated), so that a share of a course that another hinge explains goes to the hinge: a weak prior
on the extra joints settles what no recording tells. The station's names decide which joint gets what; nothing is named
here.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...hand import Course, ExtraJoint
from ...identify.chain import Chain, ChainData, Pose, jacobians, propagate
from ...identify.likelihood import free_directions
from ...rotation import perpendicular_basis
from .angles import FingerAngles
from .blocks import BLOCK
from .displacement import MarkerEffect
from .markers import HINGE, MarkerNaming, shift_at_frames

Array = NDArray[np.float64]

POWERS = 4  # MuJoCo's polycoef has five coefficients, and rest stays rest
STEPS, TRIES = 20, 6
SETTLED = 0.1  # of the log likelihood, twice: a smaller step is the last
PRIOR = {"hinge": 0.1, "slide": 5e-3}  # root mean square over the range [rad, m]: far more than a finger does
DIRECTIONS = 24  # of a lone second axis, tried before the best is refined
BOTH = ((1.0, 0.0), (0.0, 1.0))


@dataclass(frozen=True)
class Form:
    """The extra joints of joint k. kinds: of each; across: its direction (2,) in `perpendicular_basis` of the hinge's
    axis. turning: as in `Course`. scale [rad], mixing (POWERS, POWERS): its coordinate is [t, t^2, ...] @ mixing @ z, t
    = angle / scale, |z| its root mean square."""

    k: int
    kinds: tuple[str, ...]
    across: tuple[tuple[float, float], ...]
    turning: bool
    scale: float
    mixing: Array

    @property
    def size(self) -> int:
        """Number of unknowns z."""
        return POWERS * len(self.kinds)

    def course(self, axis: Array, z: Array) -> Course:
        """The course of unknowns z (size,) at a hinge of axis (3,)."""
        basis, scales = perpendicular_basis(axis), self.scale ** np.arange(1, POWERS + 1)
        made = [
            ExtraJoint(kind, np.asarray(d) @ basis, np.r_[0.0, self.mixing @ own / scales])
            for kind, d, own in zip(self.kinds, self.across, z.reshape(-1, POWERS), strict=True)
        ]
        return Course(tuple(made), self.turning)

    def columns(self, chain: Chain, body: NDArray[np.int64], angle: Array) -> Array:
        """Derivatives (b, m, 3, size) of the markers by z, extra joints taken as small."""
        x, rotations, joints = propagate(chain, body, angle)
        centre = joints[self.k][1]
        carrier = rotations[:, self.k + 1 if self.turning else self.k]
        moved = np.flatnonzero(body > self.k)
        t = angle[:, self.k] / self.scale
        functions = np.stack([t**p for p in range(1, POWERS + 1)], axis=-1) @ self.mixing
        out = np.zeros((*x.shape, self.size))
        for i, (kind, d) in enumerate(zip(self.kinds, self.across, strict=True)):
            direction = (carrier @ (np.asarray(d) @ perpendicular_basis(chain.axis_palm[self.k])))[:, None]
            way = (
                np.broadcast_to(direction, x[:, moved].shape)
                if kind == "slide"
                else np.cross(direction, x[:, moved] - centre[:, None])
            )
            out[:, moved, :, POWERS * i : POWERS * (i + 1)] = way[..., None] * functions[:, None, None]
        return out


@dataclass(frozen=True)
class FingerCourses:
    """A finger with joints that are no plain hinges. plain, coursed: chains fitted to the same training recordings.
    joints: which have a course. data: markers of each recording (session order), slips taken out, seen in `angles`."""

    angles: FingerAngles
    plain: Chain
    coursed: Chain
    joints: tuple[int, ...]
    data: tuple[ChainData, ...]

    @property
    def labels(self) -> tuple[str, ...]:
        """(m,) of its markers, those of the palm first."""
        return self.data[0].labels

    @property
    def body(self) -> NDArray[np.int64]:
        """(m,) segment of each marker, as in `ChainData`."""
        return self.data[0].body


@dataclass(frozen=True)
class _Observed:
    """Block means of training recordings: position (b, m, 3) [m] in the palm frame, nan where unseen; root (b, 3m, 1)
    of their weights; start: their angles (b, k); sigma [m]: noise of one coordinate."""

    position: Array
    root: Array
    start: Array
    body: NDArray[np.int64]
    sigma: float


@dataclass(frozen=True)
class _Solved:
    """chain; cost: twice the negative log posterior. gram, right, square: normal equations there, the unknowns of the
    forms last and in full, those of the chain as steps."""

    chain: Chain
    cost: float
    gram: Array
    right: Array
    square: float


def finger_courses(
    angles: FingerAngles, naming: MarkerNaming, named: Collection[tuple[str, str]]
) -> FingerCourses | None:
    """Courses of the joints that the marker station names as no plain hinge; None where it names none, or none that
    follows the angle. named: (effect, joint) of its findings."""
    segments = [s.name for s in angles.finger.segments]
    crooked = [e for e in naming.found if follows(e) and (e.effect, segments[e.body - 1]) in named]
    if not crooked:
        return None
    observed = _observed(angles, naming)
    forms: list[Form] = []
    for body in sorted({e.body for e in crooked}):
        mine = [e for e in crooked if e.body == body]
        tilts = any(e.effect == "joint_wobble" for e in mine)
        slides = any(e.effect == "moving_centre" or any(e.shifts) for e in mine)
        forms.append(_chosen(angles.chain, observed, forms, body - 1, tilts, slides))
    plain, coursed = (_solve(angles.chain, observed, f).chain for f in ([], forms))
    slips = replace(naming, found=tuple(e for e in naming.found if not follows(e)))
    data = []
    for index, record in enumerate(angles.records):
        shift = shift_at_frames(slips, index, record.mocap.time_s)
        world = np.einsum("nij,nmj->nmi", record.pose.rotation, shift)
        data.append(replace(record.data, position_world=record.data.position_world - world))
    return FingerCourses(angles, plain, coursed, tuple(f.k for f in forms), tuple(data))


def _observed(angles: FingerAngles, naming: MarkerNaming) -> _Observed:
    blocks = naming.blocks
    training = [i for i, r in enumerate(angles.records) if not r.trial.validate] or list(range(len(angles.records)))
    mine = np.isin(blocks.record, training)
    if not mine.any():
        mine[:] = True
    residual = blocks.residual - _slipped(naming)
    position = residual + propagate(angles.chain, blocks.body, blocks.angle)[0]
    weight = blocks.weight[mine]
    root = np.sqrt(np.repeat(weight / BLOCK, 3, axis=1))[..., None]
    return _Observed(
        np.where(weight[..., None] > 0, position[mine], np.nan), root, blocks.angle[mine], blocks.body, naming.sigma_m
    )


def follows(effect: MarkerEffect) -> bool:
    """Whether an effect is a joint's that is no hinge, and in step with its angle: a course holds no more."""
    return effect.effect in HINGE and not effect.sides


def _slipped(naming: MarkerNaming) -> Array:
    """Displacement (b, m, 3) [m] by what is named beside the hinges."""
    out = np.zeros_like(naming.blocks.residual)
    for effect in naming.found:
        if not follows(effect):
            out += (effect.columns @ effect.coefficients).reshape(out.shape)
    return out


def _chosen(chain: Chain, observed: _Observed, others: Sequence[Form], k: int, tilts: bool, slides: bool) -> Form:
    """The form of joint k that explains the markers best: with axes of the segment before it or of its own, and one
    second axis where two bring no more than they cost (Schwarz 1978)."""
    kinds = ("slide",) * (2 * slides) + ("hinge",) * (2 * tilts)
    across = BOTH * (slides + tilts)
    angle = observed.start[:, k]
    scale = float(np.quantile(np.abs(angle), 0.995))
    powers = np.stack([(angle / scale) ** p for p in range(1, POWERS + 1)], axis=-1)
    mixing = np.linalg.inv(np.linalg.qr(powers / np.sqrt(len(angle)))[1])
    tried = [Form(k, kinds, across, turning, scale, mixing) for turning in (False, True)]
    solved = [_solve(chain, observed, [*others, form]) for form in tried]
    best = int(np.argmin([s.cost for s in solved]))
    if not tilts:
        return tried[best]
    direction = _lone_direction(solved[best], tried[best])
    lone = replace(tried[best], kinds=kinds[:-1], across=(*across[:-2], direction))
    price = (POWERS - 1) * np.log(len(angle))
    return lone if _solve(chain, observed, [*others, lone]).cost < solved[best].cost + price else tried[best]


def _lone_direction(solved: _Solved, form: Form) -> tuple[float, float]:
    """The one direction (2,) across the axis of a second hinge that explains most, the last two extra joints of the
    last form being hinges."""
    from scipy.optimize import minimize_scalar

    kept = len(solved.gram) - 2 * POWERS

    def cost(turn: float) -> float:
        mix = np.zeros((len(solved.gram), kept + POWERS))
        mix[:kept, :kept] = np.eye(kept)
        mix[kept:, kept:] = np.concatenate([np.cos(turn) * np.eye(POWERS), np.sin(turn) * np.eye(POWERS)])
        right = mix.T @ solved.right
        return solved.square - float(right @ np.linalg.lstsq(mix.T @ solved.gram @ mix, right, rcond=1e-13)[0])

    grid = np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    start = grid[int(np.argmin([cost(t) for t in grid]))]
    step = np.pi / DIRECTIONS
    turn = float(minimize_scalar(cost, bounds=(start - step, start + step), method="bounded").x)
    return float(np.cos(turn)), float(np.sin(turn))


def _solve(start: Chain, observed: _Observed, forms: Sequence[Form]) -> _Solved:
    """Chain and unknowns of the forms that the blocks tell, every block's pose eliminated."""
    b = len(observed.position)
    pose = Pose(np.tile(np.eye(3), (b, 1, 1)), np.zeros((b, 3)), observed.start)
    z = np.zeros(sum(f.size for f in forms))
    chain = _with_courses(start, forms, z)
    variance = observed.sigma**2
    prior = np.concatenate(
        [np.zeros(0), *(np.repeat([variance / PRIOR[kind] ** 2 for kind in f.kinds], POWERS) for f in forms)]
    )
    cost, damping = np.inf, 1e-9
    for _ in range(STEPS):
        frame, shared, residual = _linearised(chain, observed, pose, forms)
        gram, right, _, free = _eliminated(chain, observed, frame, shared, residual)
        first = len(gram) - len(z)
        gram[first:, first:] += np.diag(prior)
        right[first:] -= prior * z
        cost = min(cost, float(np.sum(residual**2) + prior @ z**2))
        size = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        for _ in range(TRIES):
            scaled = gram / np.outer(size, size) + damping * np.eye(len(gram))
            step = free @ (np.linalg.lstsq(scaled, right / size, rcond=1e-12)[0] / size)
            split = len(step) - len(z)
            new_z, new_pose = z + step[split:], pose.moved(_frame_steps(frame, residual - shared @ step[:, None]))
            new_chain = _with_courses(chain.moved(step[:split]), forms, new_z)
            square = float(np.sum((_residual(new_chain, observed, new_pose) * observed.root) ** 2) + prior @ new_z**2)
            if square < cost:
                chain, pose, z, damping = new_chain, new_pose, new_z, max(damping / 30, 1e-12)
                break
            damping = max(100 * damping, 1e-8)
        else:
            break
        if square > cost - SETTLED * variance:
            break
    gram, right, square, _ = _eliminated(chain, observed, *_linearised(chain, observed, pose, forms))
    # of z in full, not of a further step: what the present z explains goes back into the residual
    first = len(gram) - len(z)
    square += 2 * float(right[first:] @ z) + float(z @ gram[first:, first:] @ z)
    right = right + gram[:, first:] @ z
    gram[first:, first:] += np.diag(prior)
    cost = square - 2 * float(right[first:] @ z) + float(z @ gram[first:, first:] @ z)
    return _Solved(chain, cost / variance, gram / variance, right / variance, square / variance)


def _linearised(chain: Chain, observed: _Observed, pose: Pose, forms: Sequence[Form]) -> tuple[Array, Array, Array]:
    """Weighted columns of every block's pose (b, 3m, f) and of what all share (b, 3m, s), and the weighted residual (b,
    3m, 1)."""
    b, m, _ = observed.position.shape
    _, by_frame, by_marker, by_joint = jacobians(chain, observed.body, pose.angle_rad)
    own = np.zeros((b, m, 3, 3 * m))
    for j in range(m):
        own[:, j, :, 3 * j : 3 * j + 3] = by_marker[:, j]
    extra = [f.columns(chain, observed.body, pose.angle_rad) for f in forms]
    shared = np.concatenate([own, by_joint, *extra], axis=-1)
    frame, shared = (v.reshape(b, 3 * m, -1) * observed.root for v in (by_frame, shared))
    return frame, shared, _residual(chain, observed, pose) * observed.root


def _residual(chain: Chain, observed: _Observed, pose: Pose) -> Array:
    """Observed minus modelled (b, 3m, 1) [m], zero where unseen."""
    left = pose.to_palm(observed.position) - propagate(chain, observed.body, pose.angle_rad)[0]
    return np.nan_to_num(left).reshape(len(left), -1, 1)


def _eliminated(
    chain: Chain, observed: _Observed, frame: Array, shared: Array, residual: Array
) -> tuple[Array, Array, float, Array]:
    """Normal equations beside the poses: Gram matrix and right side of the free steps, sum of squares, and the free
    steps (s, free)."""
    from scipy.linalg import block_diag

    basis = np.linalg.qr(frame)[0]
    shared, residual = (v - basis @ (np.swapaxes(basis, 1, 2) @ v) for v in (shared, residual))
    further = shared.shape[-1] - chain.size
    # steps that leave the chain's gauge alone, and all of the forms' unknowns
    free = free_directions(chain, observed.body)
    free = block_diag(free, np.eye(further)) if further else free
    flat = shared.reshape(-1, shared.shape[-1]) @ free
    return flat.T @ flat, flat.T @ residual.ravel(), float(np.sum(residual**2)), free


def _with_courses(chain: Chain, forms: Sequence[Form], z: Array) -> Chain:
    courses: list[Course | None] = [None] * len(chain.axis_palm)
    start = 0
    for form in forms:
        courses[form.k] = form.course(chain.axis_palm[form.k], z[start : start + form.size])
        start += form.size
    return replace(chain, courses=tuple(courses) if forms else ())


def _frame_steps(frame: Array, residual: Array) -> Array:
    """Steps (b, f) of every block's pose from its weighted columns (b, 3m, f) and residual (b, 3m, 1)."""
    turned = np.swapaxes(frame, 1, 2)
    block = turned @ frame
    block = block + np.eye(block.shape[-1]) * np.maximum(1e-9 * np.einsum("bii->b", block)[:, None, None], 1e-12)
    return np.linalg.solve(block, turned @ residual)[..., 0]
