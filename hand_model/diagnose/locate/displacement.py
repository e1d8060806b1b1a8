"""What a finger's markers may show beside rigid segments on hinges, as columns of marker displacements."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from .angles import Step
from .blocks import Blocks, across_axis, present_way, share_of_range, turning_rate, way_of_motion

Array = NDArray[np.float64]

BOTH = (True, False)
NO_HINGE = "no plain hinge"  # a joint whose markers leave the hinge in step with its angle, by none of the known ways
NOT_RIGID = "markers leave their rigid segments, by no effect known here"
CREEP = "creep"  # of a marker or support that moves all the time; a slip has a moment
# of a marker or support that moves on its segment as the finger moves: a soft mount, a plate that bends
YIELDING = "yielding"
WITH_FINGER = "moves on what carries it as the finger moves"  # after the marker's name
STRETCHED = "stretched"  # of what the cameras see: a calibration whose scale is not the same along all directions
UNNAMED = (NO_HINGE, CREEP, YIELDING, STRETCHED)  # what no table of effects names


@dataclass(frozen=True)
class Candidate:
    """base: (b, 3m, d) [m per unit], shared by several candidates. pick: which of its columns are this one's, None for
    all. shifts: which of them (c,) shift what a joint carries and do not turn it. step: it begins at some moment.
    lasting: a step that lasts for the session, or until the end of the recording (it was put right after). sides: it
    changes sides with the way of motion, and does not follow the angle."""

    effect: str
    body: int
    label: str | None
    base: Array
    step: bool
    lasting: bool = True
    shifts: tuple[bool, ...] = ()
    pick: tuple[int, ...] | None = None
    sides: bool = False

    @property
    def columns(self) -> Array:
        """(b, 3m, c) [m per unit]."""
        return self.base if self.pick is None else self.base[..., self.pick]


@dataclass(frozen=True)
class MarkerEffect:
    """A candidate that was chosen. everywhere: (b, 3m, c) unprojected, as if it acted always. begin, end: first block
    of a step and the one after its last, None where it acts always. coefficients: (c,) of the columns, covariance: (c,
    c). apart: whether no other form of the larger ones could stand for it."""

    effect: str
    body: int
    label: str | None
    begin: int | None
    end: int | None
    everywhere: Array
    evidence: float
    gain: float
    coefficients: Array = field(default_factory=lambda: np.zeros(0))
    covariance: Array = field(default_factory=lambda: np.zeros((0, 0)))
    shifts: tuple[bool, ...] = ()
    sides: bool = False
    apart: bool = False

    @property
    def columns(self) -> Array:
        """(b, 3m, c) where it acts, zero elsewhere."""
        if self.begin is None:
            return self.everywhere
        return self.everywhere * self.active[:, None, None]

    @property
    def active(self) -> NDArray[np.bool_]:
        """(b,) where a step acts."""
        index = np.arange(len(self.everywhere))
        return (index >= self.begin) & (index < self.end)

    def step(self, blocks: Blocks) -> Step:
        """When a step acts, in times of the recordings."""
        first, last = int(blocks.record[self.begin]), int(blocks.record[self.end - 1])
        return Step(first, float(blocks.time_s[self.begin]), last)

    def acts(self, blocks: Blocks, record: int, time_s: Array) -> Array:
        """(n,) one where it acts at times [s] of a record, else zero."""
        return np.ones(len(time_s)) if self.begin is None else self.step(blocks).acts(record, time_s)


def candidates_of(blocks: Blocks) -> list[Candidate]:
    """Slips of each marker and support, and each joint's ways of being no hinge."""
    b, m = blocks.weight.shape
    out = []
    for j, label in enumerate(blocks.labels):
        name = "palm_marker_slip" if blocks.body[j] == 0 else "marker_slip"
        for frame in _frames(blocks, int(blocks.body[j]), j):
            columns = np.zeros((b, m, 3, 3))
            columns[:, j] = frame
            flat = columns.reshape(b, 3 * m, 3)
            out += [Candidate(name, int(blocks.body[j]), label, flat, True, lasting) for lasting in BOTH]
        out += _yielding(blocks, j)
    for k in range(1, int(blocks.body.max()) + 1):
        own, fixed = _support_motions(blocks, k)
        out += [Candidate("support_slip", k, None, flat, True, lasting) for flat in (own, fixed) for lasting in BOTH]
        # a soft support leans as fast as it is carried
        out.append(Candidate(YIELDING, k, None, own * turning_rate(blocks, k - 1)[:, None, None], False))
        out += [*_no_hinge(blocks, k), *_any_motion(blocks, k)]
    return out


def creeping(blocks: Blocks, slip: Candidate) -> list[Candidate]:
    """What slips at a moment, moving evenly instead: over all recordings, or over each anew."""
    within = np.zeros(len(blocks.time_s))
    for record in np.unique(blocks.record):
        mine = blocks.record == record
        t = blocks.time_s[mine]
        within[mine] = (t - t[0]) / max(t[-1] - t[0], 1e-9)
    whole = np.arange(len(within)) / max(len(within) - 1, 1)
    return [Candidate(CREEP, slip.body, slip.label, slip.base * ramp[:, None, None], False) for ramp in (whole, within)]


def stretched(blocks: Blocks) -> Candidate:
    """The cameras' space, stretched and sheared evenly: a symmetric strain in their frame. Turns and shifts are the
    palm's pose."""
    b, m = blocks.weight.shape
    position = np.einsum("bij,bmj->bmi", blocks.palm, blocks.position)
    columns = np.zeros((b, m, 3, 6))
    for c, (i, j) in enumerate(zip(*np.triu_indices(3), strict=True)):
        columns[..., i, c] += position[..., j]
        columns[..., j, c] += position[..., i]
    return Candidate(STRETCHED, 0, None, np.einsum("bji,bmjc->bmic", blocks.palm, columns).reshape(b, 3 * m, 6), False)


def of_any_form(blocks: Blocks, slip: MarkerEffect) -> MarkerEffect:
    """A slip that need not stay as it is: it changes with each joint's angle and with time."""
    angles = [share_of_range(blocks, k) for k in range(int(blocks.body.max()))]
    since = np.linspace(0.0, 1.0, len(blocks.time_s))
    courses = [np.ones(len(since)), since, *angles, *(u**2 for u in angles)]
    columns = np.concatenate([slip.columns * course[:, None, None] for course in courses], axis=-1)
    return replace(slip, begin=None, end=None, everywhere=columns)


def _frames(blocks: Blocks, body: int, marker: int) -> list[Array]:
    """Frames (b, 3, 3) in which a slip may be constant: its segment's, or the palm's (a marker held back by a
    cable)."""
    b = len(blocks.residual)
    fixed = np.broadcast_to(np.eye(3), (b, 3, 3))
    return [fixed] if body == 0 else [blocks.rotation[:, marker], fixed]


def _support_motions(blocks: Blocks, k: int) -> list[Array]:
    """Shifts and turns (b, 3m, 6) of a segment's support about its middle, in each frame of `_frames`."""
    b, m = blocks.weight.shape
    mine = np.flatnonzero(blocks.body == k)
    arm = blocks.position[:, mine] - blocks.position[:, mine].mean(1, keepdims=True)
    out = []
    for frame in _frames(blocks, k, int(mine[0])):
        columns = np.zeros((b, m, 3, 6))
        columns[:, mine, :, :3] = frame[:, None]
        columns[:, mine, :, 3:] = np.stack([np.cross(frame[:, None, :, i], arm) for i in range(3)], axis=-1)
        out.append(columns.reshape(b, 3 * m, 6))
    return out


def _yielding(blocks: Blocks, marker: int) -> list[Candidate]:
    """A marker that moves on its segment with the speed of its joint, the first one for the palm's, or with the motor's
    pull: friction, which changes sides with the way of motion, and a spring, which grows with the angle."""
    body = int(blocks.body[marker])
    joint, own = max(body - 1, 0), _frames(blocks, body, marker)[0]
    courses = (turning_rate(blocks, joint), present_way(blocks, joint), share_of_range(blocks, joint))
    columns = np.zeros((*blocks.weight.shape, 3, 9))
    columns[:, marker] = np.concatenate([own * course[:, None, None] for course in courses], axis=-1)
    flat = columns.reshape(len(own), -1, 9)
    picks = ((0, 1, 2), (3, 4, 5), (3, 4, 5, 6, 7, 8))
    return [Candidate(YIELDING, body, blocks.labels[marker], flat, False, pick=pick) for pick in picks]


def _no_hinge(blocks: Blocks, k: int) -> list[Candidate]:
    """Wobble and moving centre of joint k - 1, each with a few forms over its angle. The other axis of a wobble meets
    the hinge where the centre is taken to be, or passes anywhere: then what it carries is shifted in step with the
    tilt. A pin with play changes sides with the way of motion; where friction tilts it, it comes back at rest."""
    b, m = blocks.weight.shape
    u = share_of_range(blocks, k - 1)[:, None]
    turns = [f(blocks, k - 1)[:, None] for f in (way_of_motion, present_way)]
    functions = [u, u**2, u**3, *_waves(u, 2), *_waves(u, 3), *_waves(u, 4), *turns]
    even, square, cube, *waves, last, present = range(len(functions))
    wave, sides = waves[:2], ([last], [present])
    forms = [[square], [square, cube], wave, [square, cube, *wave], [square, cube, *waves], *sides]
    moved = np.flatnonzero(blocks.body >= k)
    across = across_axis(blocks, k - 1)
    arm = blocks.position[:, moved] - blocks.centres[:, k - 1][:, None]
    ways = [np.cross(d[:, None], arm) for d in across] + [np.broadcast_to(d[:, None], arm.shape) for d in across]
    tilts, shifts = (0, 1), (2, 3)
    columns = np.zeros((b, m, 3, len(functions) * len(ways)))
    columns[:, moved] = np.stack([f[:, :, None] * way for f in functions for way in ways], axis=-1)
    base = columns.reshape(b, 3 * m, -1)

    def candidate(name: str, form: Sequence[int], which: Sequence[int]) -> Candidate:
        pick = tuple(len(ways) * f + way for f in form for way in which)
        shifted = tuple(way in shifts for _ in form for way in which)
        return Candidate(name, k, None, base, False, shifts=shifted, pick=pick, sides=form in sides)

    out = []
    for form in forms:
        out += [candidate("joint_wobble", form, tilts), candidate("joint_wobble", form, tilts + shifts)]
        out.append(candidate("moving_centre", form if form is wave or form in sides else [even, *form], shifts))
    return out


def _waves(u: Array, halves: int) -> tuple[Array, Array]:
    """Sine and cosine of that many half waves over a joint's range."""
    return np.sin(halves * np.pi * u), np.cos(halves * np.pi * u)


def _any_motion(blocks: Blocks, k: int) -> list[Candidate]:
    """Whatever a smooth function of joint k - 1's angle could be: any motion of what it carries as a rigid body, or of
    each marker of its segment (skin, a loose support)."""
    b, m = blocks.weight.shape
    u = share_of_range(blocks, k - 1)
    forms = [u, u**2, u**3, *_waves(u, 2)]
    moved, mine = np.flatnonzero(blocks.body >= k), np.flatnonzero(blocks.body == k)
    rigid = np.zeros((b, m, 3, 6))
    rigid[:, moved, :, :3] = np.eye(3)
    arm = blocks.position[:, moved] - blocks.centres[:, k - 1][:, None]
    rigid[:, moved, :, 3:] = np.stack([np.cross(np.eye(3)[i], arm) for i in range(3)], axis=-1)
    own = np.zeros((b, m, 3, 3 * len(mine)))
    for i, j in enumerate(mine):
        own[:, j, :, 3 * i : 3 * i + 3] = blocks.rotation[:, j]
    out = []
    for basis in (rigid, own):
        flat = basis.reshape(b, 3 * m, -1)
        columns = np.concatenate([flat * f[:, None, None] for f in forms], axis=-1)
        out.append(Candidate(NO_HINGE, k, None, columns, False))
    return out
