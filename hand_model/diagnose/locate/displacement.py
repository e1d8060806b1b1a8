"""What a finger's markers may show beside rigid segments on hinges, as columns of marker displacements."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from .blocks import Blocks, share_of_range

Array = NDArray[np.float64]

BOTH = (True, False)
NO_HINGE = "no plain hinge"  # a joint whose markers leave the hinge in step with its angle, by none of the known ways
NOT_RIGID = "markers leave their rigid segments, by no effect known here"
CREEP = "creep"  # of a marker or support that moves all the time; a slip has a moment
UNNAMED = (NO_HINGE, CREEP)  # what no table of effects names


@dataclass(frozen=True)
class Candidate:
    """columns: (b, 3m, c) [m per unit]. shifts: which of them (c,) shift what a joint carries and do not turn it. step: it begins at some moment. lasting: a step that lasts for the session, or until the
    end of the recording (it was put right after)."""

    effect: str
    body: int
    label: str | None
    columns: Array
    step: bool
    lasting: bool = True
    shifts: tuple[bool, ...] = ()


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
    for k in range(1, int(blocks.body.max()) + 1):
        mine = np.flatnonzero(blocks.body == k)
        arm = blocks.position[:, mine] - blocks.position[:, mine].mean(1, keepdims=True)
        for frame in _frames(blocks, k, int(mine[0])):
            turned = np.stack([np.cross(frame[:, None, :, i], arm) for i in range(3)], axis=-1)
            columns = np.zeros((b, m, 3, 6))
            columns[:, mine, :, :3] = frame[:, None]
            columns[:, mine, :, 3:] = turned
            flat = columns.reshape(b, 3 * m, 6)
            out += [Candidate("support_slip", k, None, flat, True, lasting) for lasting in BOTH]
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
    return [Candidate(CREEP, slip.body, slip.label, slip.columns * ramp[:, None, None], False) for ramp in (whole, within)]


def _frames(blocks: Blocks, body: int, marker: int) -> list[Array]:
    """Frames (b, 3, 3) in which a slip may be constant: its segment's, or the palm's (a marker held back by a cable)."""
    b = len(blocks.residual)
    fixed = np.broadcast_to(np.eye(3), (b, 3, 3))
    return [fixed] if body == 0 else [blocks.rotation[:, marker], fixed]


def _no_hinge(blocks: Blocks, k: int) -> list[Candidate]:
    """Wobble and moving centre of joint k - 1, each with a few forms over its angle. The other axis of a wobble meets the hinge
    where the centre is taken to be, or passes anywhere: then what it carries is shifted in step with the tilt."""
    b, m = blocks.weight.shape
    u = share_of_range(blocks, k - 1)[:, None]
    wave = [np.sin(2 * np.pi * u), np.cos(2 * np.pi * u)]
    forms: list[list[Array]] = [[u**2], [u**2, u**3], wave, [u**2, u**3, *wave]]
    moved = np.flatnonzero(blocks.body >= k)
    axis = blocks.axes[:, k - 1]
    helper = np.eye(3)[np.argmin(np.abs(axis.mean(0)))]
    first = np.cross(axis, helper)
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    across = (first, np.cross(axis, first))
    arm = blocks.position[:, moved] - blocks.centres[:, k - 1][:, None]
    shifts = [np.broadcast_to(d[:, None], arm.shape) for d in across]
    tilts = [np.cross(d[:, None], arm) for d in across]

    def candidate(name: str, functions: list[Array], ways: list[Array]) -> Candidate:
        columns = np.zeros((b, m, 3, len(functions) * len(ways)))
        columns[:, moved] = np.stack([f[:, :, None] * way for f in functions for way in ways], axis=-1)
        mask = tuple(any(way is s for s in shifts) for _ in functions for way in ways)
        return Candidate(name, k, None, columns.reshape(b, 3 * m, -1), False, shifts=mask)

    out = []
    for form in forms:
        out += [candidate("joint_wobble", form, tilts), candidate("joint_wobble", form, [*tilts, *shifts]),
                candidate("moving_centre", form if form is wave else [u, *form], shifts)]
    return out


def _any_motion(blocks: Blocks, k: int) -> list[Candidate]:
    """Whatever a smooth function of joint k - 1's angle could be: any motion of what it carries as a rigid body, or of each
    marker of its segment (skin, a loose support)."""
    b, m = blocks.weight.shape
    u = share_of_range(blocks, k - 1)
    forms = [u, u**2, u**3, np.sin(2 * np.pi * u), np.cos(2 * np.pi * u)]
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
