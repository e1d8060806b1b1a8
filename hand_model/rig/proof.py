"""Held-out effort error before and after an effect: of the written files, in MuJoCo, with an interval of its fall.

Couplings between encoders have no effort; their angle error is that of the polynomial itself, and is said to be so.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .balance import Rows, declared_columns
from .declared import DeclaredFit
from .inverse import EffortResidual, effort_residuals, level_records, with_bodies
from .mjcf import write_effects
from .model import RigModel
from .name.problem import Term, design
from .overrides import body_records
from .patch import write_declared
from .states import noise_std

Array = NDArray[np.float64]
RESAMPLES = 500
PARTS = 24  # blocks that the held-out recordings of a joint are cut into


@dataclass(frozen=True, eq=False)
class Bench:
    """Measures fits. mujoco: efforts by inverse dynamics of the file that holds them (each file once); else angles of a
    coupling by the columns. floor: joint -> noise in its residual, where that is known; moved: what `open_loop` keeps
    of files; whole: rows by their id, which they keep while they are here, and the same with every column of bodies;
    written: files by the ids of what they were made of, and that."""

    rig: RigModel
    mujoco: bool = True
    floor: Mapping[str, float] = field(default_factory=dict)
    known: dict[bytes, tuple[EffortResidual, ...]] = field(default_factory=dict, repr=False)
    moved: dict[tuple[bytes, float, bool], Array] = field(default_factory=dict, repr=False)
    whole: dict[int, tuple[tuple[Rows, ...], tuple[Rows, ...]]] = field(default_factory=dict, repr=False)
    written: dict[tuple, tuple[tuple, bytes]] = field(default_factory=dict, repr=False)

    @property
    def engine(self) -> str:
        """What computed the figures."""
        return "mujoco" if self.mujoco else "regressor"

    def file(self, fit: DeclaredFit, terms: Sequence[Term], theta: Array) -> bytes:
        """The rig's MJCF with parameters theta (P + J,) of the declared columns and of the terms."""
        key = id(fit), tuple(id(t) for t in terms), theta.tobytes()
        if key not in self.written:
            self.written[key] = (fit, *terms), self._file(fit, terms, theta)
        return self.written[key][1]

    def _file(self, fit: DeclaredFit, terms: Sequence[Term], theta: Array) -> bytes:
        p = len(fit.columns)
        cutoffs = {r.cutoff_hz for r in fit.rows}
        analysis = [{"cutoff_hz": cutoffs.pop(), "rests": list(fit.kept)}] if len(cutoffs) == 1 else []
        records = [
            *analysis,
            *body_records(self.rig),
            *level_records(fit.columns, theta[:p]),
            *term_records(terms, theta[p:]),
        ]
        return write_effects(write_declared(self.rig, fit.columns, theta[:p]), records)

    def residuals(self, fit: DeclaredFit, terms: Sequence[Term], theta: Array, joint: str) -> list[tuple[str, Array]]:
        """Residual effort of the moving samples of every validation trial (training ones where none validates)."""
        if self.mujoco:
            xml = self.file(fit, terms, theta)
            if xml not in self.known:
                keep = frozenset((r.trial, r.joint) for r in fit.rows)
                self.known[xml] = effort_residuals(replace(self.rig, xml=xml), self._rows(fit, xml), keep)
            rows = [(r.trial, r.validate, r.error) for r in self.known[xml] if r.joint == joint and len(r.error) > 10]
        else:
            rows = [
                (r.trial, r.validate, (r.effort - design(r, terms) @ theta)[r.moving])
                for r in fit.rows
                if r.joint == joint and r.moving.sum() > 10
            ]
        chosen = [r for r in rows if r[1]] or rows
        return [(trial, error) for trial, _, error in chosen]

    def _rows(self, fit: DeclaredFit, xml: bytes) -> tuple[Rows, ...]:
        """Balances of a fit with all columns that a file declares."""
        asked = {c.label for c in declared_columns(replace(self.rig, xml=xml))}
        if asked <= {c.label for r in fit.rows[:1] for c in r.declared}:
            return fit.rows
        if id(fit.rows) not in self.whole:
            self.whole[id(fit.rows)] = fit.rows, with_bodies(self.rig, fit.rows)
        return self.whole[id(fit.rows)][1]

    def proof(
        self,
        joint: str,
        before: tuple[DeclaredFit, Sequence[Term], Array],
        after: tuple[DeclaredFit, Sequence[Term], Array],
    ) -> dict[str, Any]:
        """Error of a joint under two fits (fit, terms, theta), with an interval of its fall from resampled blocks."""
        a, b = (self.residuals(*side, joint) for side in (before, after))
        pieces = max(2, PARTS // max(len(a), 1))
        squares = np.array([[np.sum(p**2) for _, e in side for p in np.array_split(e, pieces)] for side in (a, b)])
        count = np.array([len(p) for _, e in a for p in np.array_split(e, pieces)])
        draw = np.random.default_rng(0).integers(0, len(count), (RESAMPLES, len(count)))
        rms = np.sqrt(squares[:, draw].sum(2) / count[draw].sum(1))
        fall = np.percentile(rms[0] - rms[1], [2.5, 97.5])
        whole = np.sqrt(squares.sum(1) / count.sum())
        metric, unit = (
            ("effort_rmse", self.rig.effort_unit(joint)) if self.mujoco else ("angle_rmse", self.rig.unit(joint))
        )
        return {
            "metric": metric,
            "unit": unit,
            "before": float(whole[0]),
            "after": float(whole[1]),
            "noise_floor": self._floor(before[0], joint),
            "ci95_reduction": [float(fall[0]), float(fall[1])],
            "held_out": [t for t, _ in a if t in {v.name for v in self.rig.select(True)}],
            "engine": self.engine,
        }

    def _floor(self, fit: DeclaredFit, joint: str) -> float:
        rows = [r for r in fit.rows if r.joint == joint]
        own = [noise_std(r.extra["effort"]) * np.sqrt(min(1.0, 2 * r.cutoff_hz / r.rate_hz)) for r in rows]
        return self.floor.get(joint, float(np.median(own)))

    def ratio(
        self, before: tuple[DeclaredFit, Sequence[Term], Array], after: tuple[DeclaredFit, Sequence[Term], Array]
    ) -> float:
        """Root mean over joints of the squared ratio of held-out errors."""
        ratios = []
        for joint in sorted({r.joint for r in before[0].rows}):
            a, b = (np.concatenate([e for _, e in self.residuals(*side, joint)]) for side in (before, after))
            ratios.append(np.sum(b**2) / max(np.sum(a**2), 1e-300))
        return float(np.sqrt(np.mean(ratios)))


def term_records(terms: Sequence[Term], amplitude: Array) -> list[dict[str, Any]]:
    """Effects as custom/text keeps them; amplitude (J,) of all terms in order."""
    out, at = [], 0
    for t in terms:
        names = [a[0] for a in t.candidate.amplitudes]
        values = amplitude[at : at + len(names)]
        at += len(names)
        out.append(
            {
                "effect": t.candidate.effect,
                "variant": t.candidate.variant,
                "joint": t.candidate.joint,
                "shape": {k: float(v) for k, v in t.shape.items()},
                "amplitude": {n: float(v) for n, v in zip(names, values, strict=True)},
            }
        )
    return out
