"""What may be missing at a joint: every drive effect of the catalogue, and those that only a rig can show."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...effects import DriveState, catalogue, effect
from ..balance import Rows
from ..declared import DeclaredFit
from ..laws import (
    GEAR,
    GEAR_LOW,
    GEAR_MORE,
    LINE,
    LOW,
    MORE,
    MOTOR,
    MOTOR_LOW,
    MOTOR_MORE,
    PRELOAD,
    PRELOADED,
    UNDECLARED,
)
from ..model import RigModel
from ..warming import WARMS, warmth
from .candidate import Bound, Candidate
from .ripple import fine_periods
from .turning import knees, turning_round

Array = NDArray[np.float64]
# Those that rigs have in a form of their own, or that need a hand.
NOT_FOR_RIGS = frozenset(
    {
        "external_contact",
        "gravity_load",
        "spring_decoupling",
        "asymmetric_friction",
        "drive_sag",
        "command_delay",
        "current_channel_delay",
        "elastoplastic_hysteresis",
        "load_dependent_friction",
    }
)
RIPPLE = "torque_ripple"
STOP, OFFSET, LOADED = "elastoplastic_hysteresis", "asymmetric_friction", "load_dependent_friction"
TURN_ROUND = frozenset({STOP, LOADED, "stribeck_friction"})
SMOOTH = ("nonlinear_spring",)  # its knee belongs to fingers with a return spring; a joint has stops and detents
# what it damps at one end of a range is hardly told there from friction that differs by speed and way
UNDAMPED = ("end_stop_contact",)
LONGEST_DELAY_S, LONGEST_TARGET_S = 0.03, 0.1  # of a channel or a drive, and of a target on its way to one
# Samples. A drive that holds its torque from one control step to the next acts half a step late: less than a sample of
# a log.
DELAYS = (0.125, 0.25, 0.5, 1, 2, 3, 5, 8)
# of friction and the load that it is reckoned from: what one changes of the load, friction changes by a fraction of
TURNS = 4
SAME = 0.05  # of a column's variance
DRAG, DRY_AND_DRAG = "viscous", "dry and viscous"
WHOLE: Bound = ("whole", "1", 0.99, 1.01)  # of an effect that has no size beside its shape


def beside(
    rows: Sequence[Rows], acting: Sequence[tuple[Candidate, Mapping[str, float], Array]]
) -> dict[tuple[str, str], Array]:
    """Effort (n,) at full rate, of every (trial, joint), of effects with shape and amplitudes (j,); delays are left
    out."""
    out: dict[tuple[str, str], Array] = {}
    for row in rows:
        for candidate, shape, amplitude in acting:
            if candidate.joint == row.joint:
                values = candidate.columns(row, shape).reshape(len(row.time_s), -1) @ amplitude
                out[row.trial, row.joint] = out.get((row.trial, row.joint), 0.0) + values
    return out


def drive_state(rig: RigModel, row: Rows, theta: Array) -> DriveState:
    """The row as an effect of the catalogue reads it."""
    extra: dict[str, Array] = {"load": row.load(theta)}
    for channel, values in row.extra.items():
        extra[channel.split(":")[0] if channel == f"setpoint:{row.joint}" else channel] = values
    extra |= warmth(rig, row.trial, row.joint, row.time_s, row.extra)
    declared = np.stack([row.acceleration, row.velocity, row.direction], 1)
    effort = np.where(np.abs(row.velocity) > row.rest_speed, row.extra["effort"], np.nan)  # at rest friction is unknown
    return DriveState(
        row.trial,
        row.joint,
        row.time_s,
        row.position,
        row.velocity,
        row.acceleration,
        effort,
        declared,
        rig.unit(row.joint),
        rig.effort_unit(row.joint),
        extra,
        ("inertia", "viscous", "coulomb"),
        row.validate,
    )


def candidates(
    rig: RigModel, fit: DeclaredFit, joint: str, every: bool = False, only: Collection[str] | None = None
) -> tuple[Candidate, ...]:
    """All candidates at one joint, from the catalogue and from the rig itself; every: also those that its recordings
    could not tell from what is declared, as a file may name them; only: names of effects, where others are not
    asked for."""
    rows = [r for r in fit.rows if r.joint == joint and not r.validate]
    if not rows:
        return ()
    states = {r.trial: drive_state(rig, r, fit.theta) for r in fit.rows if r.joint == joint}
    train = tuple(states[r.trial] for r in rows)
    asked = [e for e in catalogue("drive") if _usable(e) and (only is None or e.name in only)]
    found = [_from_catalogue(e, joint, train, states) for e in asked]
    found = [_with_fine(c, fit, rows) if c.effect == RIPPLE and not every else c for c in found]
    bends, drive = [c for c in found if c.effect in SMOOTH], rig.drive(joint)
    preloaded = drive is None or not drive.offset
    if every:
        found += [x for c in bends for x in _with_line(c, preloaded)]
    elif bends and not _is_declared([r.filtered(r.position) for r in rows], rows):
        found = [c for c in found if c not in bends] + [x for c in bends for x in _with_line(c, preloaded)]
    found += [_thinning(c, variant) for c in found if c.effect == WARMS for variant in (DRAG, DRY_AND_DRAG)]
    if only is None or not NOT_FOR_RIGS.isdisjoint(only):
        found += _own(rig, fit, joint, rows, only)
    if only is None or not TURN_ROUND.isdisjoint(only):
        found += turning_round(_from_catalogue(effect(STOP), joint, train, states), rig, fit, joint, train, rows)
    return tuple(c for c in found if c.grid and (only is None or c.effect in only))


def _usable(found: Any) -> bool:
    return found.name not in NOT_FOR_RIGS and found.replaces is None and not found.clips


def _from_catalogue(
    found: Any, joint: str, train: tuple[DriveState, ...], states: Mapping[str, DriveState]
) -> Candidate:
    grid = [p for p in found.grid(train) if found.name not in UNDAMPED or not p["form"]]
    return Candidate(
        found.name,
        "",
        joint,
        tuple(found.amplitudes()),
        ({},) if found.name in SMOOTH else tuple(grid),
        lambda row, shape: np.asarray(found.columns(states[row.trial], shape), float),
        bool(found.warps),
        {s.name: s for s in found.shapes(train)},
    )


def _with_fine(ripple: Candidate, fit: DeclaredFit, rows: list[Rows]) -> Candidate:
    """A ripple with starts at the periods shorter than those of its grid that show in what the declared model leaves."""
    if not ripple.grid:
        return ripple
    periods = fine_periods(fit, rows, min(shape["period"] for shape in ripple.grid))
    shape = ripple.shapes["period"]
    wider = replace(shape, low=min([shape.low, *(0.9 * p for p in periods)]))
    fine = tuple({**ripple.grid[0], "period": p} for p in periods)
    return replace(ripple, grid=(*ripple.grid, *fine), shapes={**ripple.shapes, "period": wider})


def _thinning(dry: Candidate, variant: str) -> Candidate:
    """Friction of a lubricant that thins as it warms: its viscous part alone, or with its dry part."""
    drag = ("cold_viscous", "effort s/position", -np.inf, np.inf)

    def columns(row: Rows, shape: Mapping[str, float]) -> Array:
        rubbing = dry.columns(row, shape)
        dragged = rubbing * np.abs(row.velocity)[:, None]
        return dragged if variant == DRAG else np.column_stack([rubbing, dragged])

    return replace(
        dry, variant=variant, amplitudes=(drag,) if variant == DRAG else (*dry.amplitudes, drag), columns=columns
    )


def _is_declared(columns: Sequence[Array], rows: Sequence[Rows]) -> bool:
    """Whether a column (m,) of each row is, but for a small part of its variance, one of the declared ones or made of
    them:
    beside a weight of unknown size a spring cannot be told."""
    y = np.concatenate([c[r.moving] for c, r in zip(columns, rows, strict=True)])
    x = np.concatenate([r.columns[r.moving] for r in rows])
    x = np.column_stack([x[:, np.any(x != 0, 0)], np.ones(len(x))])
    x = x / np.linalg.norm(x, axis=0)
    return bool(np.var(y - x @ np.linalg.lstsq(x, y)[0]) < SAME * np.var(y))


def _with_line(bend: Candidate, preloaded: bool) -> list[Candidate]:
    """A spring's bend with the line that it bends from: no spring is declared, nor what could pass for one. preloaded:
    also one that is at rest anywhere, where no offset of the drive is declared, which would say so."""
    line = (LINE, "effort/position", -np.inf, np.inf)
    plain = replace(
        bend,
        variant=UNDECLARED,
        amplitudes=(line, *bend.amplitudes),
        columns=lambda r, s: np.column_stack([r.position, bend.columns(r, s)]),
    )
    if not preloaded:
        return [plain]
    anywhere = replace(
        plain,
        variant=PRELOADED,
        amplitudes=((PRELOAD, "effort", -np.inf, np.inf), *plain.amplitudes),
        columns=lambda r, s: np.column_stack([np.ones(len(r.position)), plain.columns(r, s)]),
    )
    return [plain, anywhere]


def _by_load(fit: DeclaredFit, joint: str, rows: list[Rows], driven: bool) -> list[Candidate]:
    """Friction by what the joint carries, by what its drive puts in, or by both sides of a gear at once: the mean of
    the drive's effort and of the bias that it works against (Duclusaud et al. 2024, model M3)."""
    mine = [r for r in fit.rows if r.joint == joint]
    load = {r.trial: np.abs(r.load(fit.theta)) for r in mine}
    slow = knees(rows, 6)

    def friction(variant: str, amplitude: str, by: Mapping[str, Array]) -> Candidate:
        return Candidate(
            "load_dependent_friction",
            variant,
            joint,
            ((amplitude, "1", 0.0, np.inf),),
            ({},),
            lambda r, s: (r.direction * by[r.trial])[:, None],
        )

    def at_low_speed(variant: str, by: Mapping[str, Array]) -> Candidate:
        return Candidate(
            "load_dependent_friction",
            variant,
            joint,
            (("per_load", "1", 0.0, np.inf),),
            slow,
            lambda r, s: (r.direction * by[r.trial] * np.exp(-((r.velocity / s["stribeck_speed"]) ** 2)))[:, None],
        )

    def more(variant: str, by: Mapping[str, Array]) -> Candidate:
        low = at_low_speed(variant, by)
        return replace(
            low,
            amplitudes=(*low.amplitudes, ("per_load_low", "1", 0.0, np.inf)),
            columns=lambda r, s: np.column_stack([r.direction * by[r.trial], low.columns(r, s)]),
        )

    found = [
        friction("", "per_load", load),
        at_low_speed(LOW, load),
        more(MORE, load),
        Candidate(
            "load_dependent_friction",
            "with speed",
            joint,
            (("per_load_speed", "s", 0.0, np.inf),),
            ({},),
            lambda r, s: (r.velocity * load[r.trial])[:, None],
        ),
    ]
    if driven:
        expected = {r.trial: fit.expected(r) for r in mine}
        motor = {t: np.abs(e) for t, e in expected.items()}
        gear = {r.trial: 0.5 * np.abs(expected[r.trial] + r.bias(fit.theta)) for r in mine}
        found += [
            friction(MOTOR, "per_effort", motor),
            friction(GEAR, "per_load", gear),
            at_low_speed(MOTOR_LOW, motor),
            at_low_speed(GEAR_LOW, gear),
            more(MOTOR_MORE, motor),
            more(GEAR_MORE, gear),
        ]
    return found


def _delays(sample_s: float, longest_s: float, signs: Sequence[float]) -> tuple[dict[str, float], ...]:
    """Delays to begin with, of that many samples and up to the longest [s]."""
    late = sorted({round(d, 6) for d in [k * sample_s for k in DELAYS] + [k * longest_s / 6 for k in range(1, 7)]})
    return tuple({"delay": sign * d} for d in late if d <= max(8 * sample_s, longest_s) for sign in signs)


def _late_target(rig: RigModel, joint: str, delays: tuple[dict[str, float], ...]) -> Candidate:
    """A servo on position of which the target comes late and the joint's own position does not: what it gave by the
    target of now was more by this than it gave."""
    drives = {t.name: t.drives[joint] for t in rig.trials if joint in t.drives}

    def columns(row: Rows, shape: Mapping[str, float]) -> Array:
        drive, target = drives.get(row.trial), row.extra.get(f"setpoint:{joint}")
        if drive is None or target is None:
            return np.zeros((len(row.time_s), 1))
        late = np.interp(row.time_s + shape["delay"], row.time_s, target)  # a target jumps: no spline
        now, then = (drive.answer(t, row.position, row.velocity) for t in (target, late))
        return (now - then)[:, None]

    return Candidate("command_delay", "its target alone", joint, (WHOLE,), delays, columns)


def _own(
    rig: RigModel, fit: DeclaredFit, joint: str, rows: list[Rows], only: Collection[str] | None
) -> list[Candidate]:
    """Friction by load of several kinds, offset, delay between the channels."""
    free = (-np.inf, np.inf)
    drive = rig.drive(joint)
    sample = max(float(np.median(np.diff(t.time_s))) for t in rig.trials)
    driven = drive is not None and any(np.any(r.effort) for r in rows)  # connected somewhere, its channel not refused
    own = _by_load(fit, joint, rows, driven) if only is None or LOADED in only else []
    if driven and drive.kind == "position" and not any(joint in t.effort for t in rig.trials):
        own.append(_late_target(rig, joint, _delays(sample, LONGEST_TARGET_S, (-1.0,))))
    if driven:
        measured = drive.kind == "force"
        # a drive can act later than told, not earlier
        delays = _delays(sample, LONGEST_DELAY_S, (-1.0, 1.0) if measured else (-1.0,))
        name = "current_channel_delay" if measured else "command_delay"
        own.append(Candidate(name, "", joint, (), delays, lambda r, s: np.zeros((len(r.time_s), 0)), True))
    if drive is None or not drive.offset:
        own.append(
            Candidate(
                OFFSET,
                "",
                joint,
                (("offset", rig.effort_unit(joint), *free),),
                ({},),
                lambda r, s: np.ones((len(r.time_s), 1)),
            )
        )
    return own
