"""Two encoders along one transmission: what one angle leaves of the other, as a balance in which effects compete."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..effects.path import jenkins
from .balance import Column, Rows
from .declared import DeclaredFit, _robust_fit
from .dynamics import inertial_columns, inertial_parameters
from .findings import CouplingResidual
from .model import Coupling, RigModel, RigTrial
from .name.candidate import Candidate
from .name.problem import Term, design, pose, solution
from .overrides import compile_model
from .states import choose_cutoff, differentiate, fill_gaps, low_pass, uniform_time, velocity_noise

Array = NDArray[np.float64]
RATE_HZ = 100.0
POWERS, FEWEST = 5, 50  # of a polynomial in MJCF; samples of a recording that it is asked of
ALIKE = 1.1  # of an error: polynomials that foretell about as well
TURNS = (0.05, 0.15, 0.3, 0.5, 0.7)  # of loads, above which one pushes a play to its other side


def coupling_columns(coupling: Coupling) -> tuple[Column, ...]:
    """The declared polynomial: as many powers as the format allows (quartic)."""
    return tuple(Column("polycoef", coupling.name, str(k), float(coupling.polycoef[k])) for k in range(POWERS))


def fit_coupling(rig: RigModel, coupling: Coupling) -> DeclaredFit | None:
    """The coupling's polynomial fitted to the training recordings; None where an encoder of the two is missing. Powers
    that foretell none of them from the others stay as they are declared."""
    columns = coupling_columns(coupling)
    rows = tuple(r for t in rig.trials if (r := _rows(rig, coupling, columns, t)) is not None)
    if not any(not r.validate for r in rows):
        return None
    told = _powers(rows, max(1, int(np.max(np.flatnonzero(coupling.polycoef), initial=0))))
    rows = tuple(replace(r, columns=r.columns * told, full_columns=r.full_columns * told) for r in rows)
    return _robust_fit(columns, rows, rows[0].cutoff_hz)


def _powers(rows: Sequence[Rows], declared: int) -> NDArray[np.bool_]:
    """Which powers (5,) of a polynomial to fit: up to the highest degree, at least the declared one, by which each
    training recording is foretold from the others about as well as by any; all where there is but one."""
    parts = [(r.columns[r.moving], r.effort[r.moving]) for r in rows if not r.validate and r.moving.sum() > FEWEST]
    if len(parts) < 2:
        return np.ones(POWERS, bool)
    errors = []
    for count in range(declared + 1, POWERS + 1):
        left = 0.0
        for k, (columns, angle) in enumerate(parts):
            others = [p for i, p in enumerate(parts) if i != k]
            known, told = np.concatenate([c[:, :count] for c, _ in others]), np.concatenate([a for _, a in others])
            scale = np.maximum(np.max(np.abs(known), axis=0), 1e-300)
            theta = np.linalg.lstsq(known / scale, told, rcond=1e-10)[0] / scale
            missed = angle - columns[:, :count] @ theta
            left += float(np.mean(np.abs(missed - np.median(missed))))  # each recording may have a zero of its own
        errors.append(left)
    return np.arange(POWERS) <= declared + int(np.flatnonzero(np.array(errors) <= ALIKE * min(errors))[-1])


def _rows(rig: RigModel, coupling: Coupling, columns: tuple[Column, ...], trial: RigTrial) -> Rows | None:
    if coupling.dependent not in trial.position or coupling.independent not in trial.position:
        return None
    grid = uniform_time(trial.time_s)
    rate = 1.0 / (grid[1] - grid[0])

    def even(values: Array) -> Array:
        return np.interp(grid, trial.time_s, fill_gaps(trial.time_s, values))

    raw = even(trial.position[coupling.independent])
    cutoff = min(choose_cutoff(raw, rate), 0.2 * RATE_HZ)
    q = low_pass(raw, rate, cutoff)
    v = differentiate(q, rate)
    rest = max(3 * velocity_noise(raw, rate, cutoff), 1e-3 * float(np.std(v)))
    out = low_pass(even(trial.position[coupling.dependent]), rate, cutoff)
    load = {f"effort:{j}": low_pass(even(e), rate, cutoff) for j, e in _loads(rig, trial).items()}
    if coupling.dependent not in trial.effort and (carried := _carried(rig, coupling, trial, even, cutoff)) is not None:
        load[f"effort:{coupling.dependent}"] = carried
    extra = {k: even(c) for k, c in trial.extra.items()} | load
    skip = max(1, int(rate / RATE_HZ))
    s = slice(None, None, skip)
    powers = np.stack([q[s] ** k for k in range(POWERS)], 1)
    a = differentiate(v, rate)
    moving = np.ones(len(q[s]), bool)
    moving[: int(0.5 * rate / skip)] = False  # the first half second: the transmission is not yet wound up
    return Rows(
        trial.name,
        coupling.dependent,
        trial.validate,
        grid[s],
        q[s],
        v[s],
        a[s],
        out[s],
        powers,
        moving,
        rest,
        cutoff,
        rate / skip,
        {"effort": out[s], **{k: c[s] for k, c in extra.items()}},
        powers,
        np.zeros(POWERS, bool),
        np.zeros(len(q[s])),
        1,
    )


def _loads(rig: RigModel, trial: RigTrial) -> dict[str, Array]:
    """Efforts (n,) by joint that are recorded, or that a servo on position gives by what it is told."""
    asked = {}
    for joint in (d.joint for d in rig.drives if d.kind == "position" and d.joint in trial.live):
        if joint in trial.setpoint and joint in trial.position:
            target, position = (fill_gaps(trial.time_s, x[joint]) for x in (trial.setpoint, trial.position))
            asked[joint] = trial.drives[joint].along(trial.time_s, target, position)
    return {**asked, **trial.effort}


def _carried(
    rig: RigModel, coupling: Coupling, trial: RigTrial, even: Callable[[Array], Array], cutoff_hz: float
) -> Array | None:
    """What moves a dependent joint's bodies (n,) as they are declared: what goes through its coupling, where no effort is
    recorded at the joint itself. None where another joint's angle is not recorded, or nothing hangs there."""
    if any(j not in trial.position for j in rig.joints):
        return None
    model, time_s = compile_model(rig, trial), even(trial.time_s)
    rate = (len(time_s) - 1) / (time_s[-1] - time_s[0])
    q = np.stack([low_pass(even(trial.position[j]), rate, cutoff_hz) for j in rig.joints], 1)
    v = differentiate(q, rate)
    columns = inertial_columns(model, q, v, differentiate(v, rate), np.array(model.opt.gravity))
    load = np.einsum("nbp,bp->n", columns[:, rig.joints.index(coupling.dependent)], inertial_parameters(model))
    return load if np.ptp(load) > 0 else None


def coupling_candidates(fit: DeclaredFit, coupling: Coupling) -> tuple[Candidate, ...]:
    """Lost motion (a play that is crossed at every reversal of the motion, or of a load) and stretch by each load."""
    joint = coupling.dependent
    train = [r for r in fit.rows if not r.validate]
    span = max(float(np.ptp(r.position)) for r in train)
    free = (-np.inf, np.inf)
    gaps = tuple({"gap": float(g)} for g in span * np.geomspace(0.003, 0.3, 8))
    out = [
        Candidate(
            "drive_backlash",
            "",
            joint,
            (("half_gap", "rad", *free),),
            gaps,
            lambda r, s: jenkins(r.position, s["gap"])[:, None],
        )
    ]
    for channel in sorted({k for r in train for k in r.extra if k.startswith("effort:")}):
        out += _by_load(joint, channel, train)
    apart = (("lag", "s", *free),)
    slope = np.polynomial.polynomial.polyder(coupling.polycoef)

    def moved(row: Rows, _: Mapping[str, float]) -> Array:
        return (row.velocity * np.polynomial.polynomial.polyval(row.position, slope))[:, None]

    out.append(Candidate("clock_drift", "channels sampled apart", joint, apart, ({},), moved))
    return tuple(out)


def _by_load(joint: str, channel: str, train: Sequence[Rows]) -> list[Candidate]:
    """What one load does to a dependent joint: it crosses a play, stretches, and does so less the larger it is."""
    free, name = (-np.inf, np.inf), channel.split(":")[1]
    loads = np.concatenate([np.abs(_load(r, channel)[r.moving]) for r in train])
    turns = tuple({"turns_at": float(t)} for t in np.unique(np.quantile(loads, TURNS)))
    return [
        Candidate(
            "drive_backlash",
            f"crossed by the load at {name}",
            joint,
            (("half_gap", "rad", *free),),
            turns,
            lambda r, s: last_pushed(_load(r, channel), s["turns_at"])[:, None],
        ),
        Candidate(
            "series_elasticity",
            f"load at {name}",
            joint,
            (("compliance", "rad/effort", *free),),
            ({},),
            lambda r, s: _load(r, channel)[:, None],
        ),
        Candidate(
            "series_elasticity",
            f"stiffening with load at {name}",
            joint,
            (("compliance", "rad/effort", *free), ("stiffening", "rad/effort^2", *free)),
            ({},),
            lambda r, s: np.stack([_load(r, channel), _load(r, channel) * np.abs(_load(r, channel))], 1),
        ),
    ]


def last_pushed(load: Array, turns_at: float) -> Array:
    """The side (n,), -1 or 1, to which a load (n,) last pushed by more than `turns_at`: there what has play lies, until
    it is pushed to the other. Before it was, the side to which it is pushed first."""
    side = np.where(np.abs(load) > turns_at, np.sign(load), 0.0)
    known = np.flatnonzero(side)
    if not len(known):
        return side
    last = np.searchsorted(known, np.arange(len(side)), side="right") - 1
    return side[known[np.maximum(last, 0)]]


def zero_shift(fit: DeclaredFit, theta: Array, terms: Sequence[Term]) -> DeclaredFit | None:
    """The coupling with each recording's own zero taken out, where zeros differ between recordings; else None."""
    zeros = own_zeros([(r.effort - design(r, terms) @ theta)[r.moving] for r in fit.rows])
    if zeros is None:
        return None
    rows = [
        replace(r, effort=r.effort - zero, extra={**r.extra, "effort": r.extra["effort"] - zero})
        for r, zero in zip(fit.rows, zeros, strict=True)
    ]
    return _robust_fit(fit.columns, tuple(rows), fit.cutoff_hz)


def own_zeros(left: Sequence[Array]) -> list[float] | None:
    """Mean of what is left of each recording, where they differ. An incremental encoder starts anywhere: what remains
    after all effects then differs from recording to recording far more than within one (by five times in variance)."""
    between, within = np.var([e.mean() for e in left]), np.mean([e.var() for e in left])
    return None if between < 5 * within else [float(e.mean()) for e in left]


def angle_residual(rig: RigModel, coupling: Coupling, fit: DeclaredFit, terms: Sequence[Term]) -> CouplingResidual:
    """Residual angle of the polynomial alone and with the terms, on the recordings held out (on all where none is)."""
    sides = [(t, solution(pose(fit), t)) for t in ((), terms)]
    rows = [r for r in fit.rows if r.validate] or list(fit.rows)
    before, after = ([(r.effort - design(r, t) @ theta)[r.moving] for r in rows] for t, theta in sides)
    channel = next(
        (f"effort:{t.candidate.variant.split()[-1]}" for t in terms if "load at" in t.candidate.variant), None
    )
    load = None if channel is None else np.concatenate([_load(r, channel)[r.moving] for r in rows])
    trial = np.concatenate([np.full(int(r.moving.sum()), r.trial) for r in rows])
    time_s, position, velocity = (
        np.concatenate([getattr(r, k)[r.moving] for r in rows]) for k in ("time_s", "position", "velocity")
    )
    return CouplingResidual(
        coupling.name,
        coupling.dependent,
        rig.unit(coupling.dependent),
        trial,
        time_s,
        position,
        velocity,
        load,
        np.concatenate(before),
        np.concatenate(after),
    )


def _load(row: Rows, channel: str) -> Array:
    return row.extra.get(channel, np.zeros(len(row.time_s)))


__all__ = ["angle_residual", "coupling_candidates", "coupling_columns", "fit_coupling", "own_zeros", "zero_shift"]
