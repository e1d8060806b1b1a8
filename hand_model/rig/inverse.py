"""Effort of a rig's file at the recorded motion: mj_inverse, dry friction, and the effects that the file keeps.

mj_inverse runs without constraints: the sign of friction and the projection of coupled joints are taken from the
recording (virtual work), not from the solver. What MJCF has no attribute for stands in `custom/text` as records
{"effect", "variant", "joint", "shape", "amplitude"}: columns of the catalogue, evaluated here at the recorded motion.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..errors import DescriptionError
from .balance import Column, Rows, back_emf, declared_columns
from .declared import DeclaredFit
from .dynamics import INERTIAL, inertial_columns
from .mjcf import read_effects
from .model import RigModel, RigTrial
from .name.candidates import LOADED, TURNS, Candidate, beside, candidates
from .overrides import compile_model
from .trial_balance import trial_rows

Array = NDArray[np.float64]


@dataclass(frozen=True)
class EffortResidual:
    """Recorded effort minus the file's (m,) [N m or N], moving samples only, of one joint in one trial.

    row: its balance; expected: the file's effort at all samples of the thinned grid.
    """

    trial: str
    joint: str
    validate: bool
    error: Array
    row: Rows = field(repr=False)
    expected: Array = field(repr=False)


def effort_residuals(
    rig: RigModel, rows: Sequence[Rows] | None = None, keep: frozenset[tuple[str, str]] | None = None
) -> tuple[EffortResidual, ...]:
    """Effort residuals of every balance of the rig, whose xml may be patched.

    rows: balances of the same recordings made before (else made here, at the cut-off that the file keeps), with all that
    the file declares (`with_bodies`) where it has effects; keep: (trial, joint) to look at. An effect is evaluated at
    the load of the file's own parameters.
    """
    records = read_effects(rig.xml)
    columns = declared_columns(rig)
    levels = {(r["joint"], k): v for r in records for k, v in r.get("frictionloss_levels", {}).items()}
    theta = np.array([levels.get((c.name, c.part), c.value) for c in columns])
    if rows is None:
        how = next((r for r in records if "cutoff_hz" in r), {})
        rows = tuple(
            r for t in rig.trials for r in trial_rows(rig, t, columns, how.get("cutoff_hz"), kept=how.get("rests", ()))
        )
    rows = tuple(r for r in rows if keep is None or (r.trial, r.joint) in keep)
    fit = DeclaredFit(columns, theta, {}, _recolumned(rows, columns), 0.0, {})
    terms = _acting(rig, fit, [r for r in records if "effect" in r])
    trials = {t.name: t for t in rig.trials}
    by_trial = {t: [r for r in rows if r.trial == t] for t in dict.fromkeys(r.trial for r in rows)}
    out = []
    for name, mine in by_trial.items():
        own = joint_efforts(rig, trials[name], mine[0])
        for row in mine:
            full = sum(own[:, rig.joints.index(j)] * w for j, w in row.jacobian.items())
            full = full + beside([row], terms).get((name, row.joint), 0.0)
            delay = sum(
                shape["delay"] for candidate, shape, _ in terms if candidate.delays and candidate.joint == row.joint
            )
            expected = row.filtered(full, delay)
            out.append(
                EffortResidual(name, row.joint, row.validate, (row.effort - expected)[row.moving], row, expected)
            )
    return tuple(out)


def joint_efforts(rig: RigModel, trial: RigTrial, row: Rows) -> Array:
    """What each joint's drive has to give (n, joints) at the recorded states of a balance, by mj_inverse and
    friction."""
    import mujoco

    model = compile_model(rig, trial, bodies=False)  # the balance has taken the trial's own bodies from the effort
    apply_levels(model, rig, trial)
    data = mujoco.MjData(model)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    q, v, a = row.states
    out = np.empty_like(q)
    for k in range(len(q)):
        data.qpos[:], data.qvel[:], data.qacc[:] = q[k], v[k], a[k]
        mujoco.mj_inverse(model, data)
        out[k] = data.qfrc_inverse
    out += model.dof_frictionloss * row.directions
    for drive in rig.drives:
        if drive.joint in trial.live:
            i, j = model.actuator(drive.name).id, rig.joints.index(drive.joint)
            if drive.offset:
                out[:, j] -= model.actuator_gear[i, 0] * model.actuator_biasprm[i, 0]
            if drive.kind == "voltage" and drive.joint not in trial.effort:
                out[:, j] += back_emf(model, drive.name) * v[:, j]
    return out


def apply_levels(model: Any, rig: RigModel, trial: RigTrial) -> None:
    """Put the fitted Coulomb level in place of the starting one that the trial sets, where the file keeps such
    levels."""
    for record in read_effects(rig.xml):
        for level, value in record.get("frictionloss_levels", {}).items():
            start = trial.set.get(f"joint:{record['joint']}:frictionloss")
            if start is not None and repr(float(np.atleast_1d(start)[0])) == level:
                model.joint(record["joint"]).frictionloss[:] = value


def level_records(columns: Sequence[Column], theta: Array) -> list[dict[str, Any]]:
    """Fitted Coulomb levels of trials that set their own, as `apply_levels` reads them."""
    levels: dict[str, dict[str, float]] = {}
    for c, value in zip(columns, theta, strict=True):
        if c.kind == "frictionloss" and c.part:
            levels.setdefault(c.name, {})[c.part] = float(value)
    return [{"joint": joint, "frictionloss_levels": each} for joint, each in levels.items()]


def with_bodies(rig: RigModel, rows: Sequence[Rows]) -> tuple[Rows, ...]:
    """The rows with a full-rate column for every inertial parameter of every body, beside those that they have: a file
    with a centre of mass off its axis has products of inertia that the declared one has not."""
    every = [Column("inertial", name, part, 0.0) for name in _bodies(rig) for part in INERTIAL]
    trials, out = {t.name: t for t in rig.trials}, []
    for trial in dict.fromkeys(r.trial for r in rows):
        mine = [r for r in rows if r.trial == trial]
        model, (q, v, a) = compile_model(rig, trials[trial]), mine[0].states
        moved, still = (
            inertial_columns(model, q, v, x, np.array(model.opt.gravity)).reshape(*q.shape, -1)
            for x in (a, np.zeros_like(a))
        )
        for row in mine:
            other = [i for i, c in enumerate(row.declared) if c.kind != "inertial"]
            own, own_still = (
                sum(c[:, rig.joints.index(j)] * w[:, None] for j, w in row.jacobian.items()) for c in (moved, still)
            )
            out.append(
                replace(
                    row,
                    full_columns=np.concatenate([own, row.full_columns[:, other]], 1),
                    still_columns=np.concatenate([own_still, row.still_columns[:, other]], 1),
                    carried=np.append(np.ones(len(every), bool), row.carried[other]),
                    declared=(*every, *(row.declared[i] for i in other)),
                )
            )
    return tuple(out)


def _bodies(rig: RigModel) -> list[str]:
    """Bodies by name, without the world, in the order of their inertial columns."""
    model = compile_model(rig)
    return [model.body(b).name for b in range(1, model.nbody)]


def _recolumned(rows: Sequence[Rows], columns: Sequence[Column]) -> tuple[Rows, ...]:
    """The rows with the columns that the file declares: a parameter fitted to zero is none of its columns."""
    out = []
    for row in rows:
        if tuple(c.label for c in row.declared) == tuple(c.label for c in columns):
            out.append(row)
            continue
        at: Mapping[str, int] = {c.label: i for i, c in enumerate(row.declared)}
        pick = [at.get(c.label, -1) for c in columns]
        blank = np.concatenate([row.full_columns, np.zeros((len(row.full_columns), 1))], 1)
        carried = np.append(row.carried, False)
        still = np.concatenate([row.still_columns, np.zeros((len(row.still_columns), 1))], 1)
        out.append(
            replace(
                row,
                full_columns=blank[:, pick],
                still_columns=still[:, pick],
                carried=carried[pick],
                declared=tuple(columns),
            )
        )
    return tuple(out)


def _acting(
    rig: RigModel, fit: DeclaredFit, records: Sequence[Mapping[str, Any]]
) -> list[tuple[Candidate, Mapping, Array]]:
    """Candidates that the file's records name, with shapes and amplitudes, at the loads of the file's parameters and,
    by turns, of the effects themselves."""
    turns = TURNS if any(r["effect"] == LOADED for r in records) else 1
    acting: list[tuple[Candidate, Mapping, Array]] = []
    for turn in range(turns):
        at = replace(fit, beside=beside(fit.rows, acting))
        found = [
            _rebuilt(rig, at, r) if turn == 0 or r["effect"] == LOADED else acting[k][0] for k, r in enumerate(records)
        ]
        acting = [
            (c, r["shape"], np.array([r["amplitude"].get(a[0], 0.0) for a in c.amplitudes]))
            for c, r in zip(found, records, strict=True)
        ]
    return acting


def _rebuilt(rig: RigModel, fit: DeclaredFit, record: Mapping[str, Any]) -> Candidate:
    """The candidate that a record of the file names, at the loads of the file's parameters."""
    for c in candidates(rig, fit, record["joint"], every=True, only={record["effect"]}):
        if c.variant == record["variant"]:
            return c
    raise DescriptionError(f'custom/text "hand_model": no effect "{record["effect"]}" at joint "{record["joint"]}"')
