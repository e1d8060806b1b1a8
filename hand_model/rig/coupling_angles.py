"""How far a rig's couplings, as its file has them, are from the encoders at both of their ends."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import DescriptionError
from .mjcf import read_couplings
from .model import Coupling, RigModel
from .name.candidate import Candidate
from .transmission import coupling_candidates, fit_coupling, own_zeros

Array = NDArray[np.float64]


@dataclass(frozen=True)
class CouplingAngle:
    """What a coupling leaves of its dependent joint's angle in one trial: root mean square [unit: rad or m] with its
    polynomial alone (plain_rmse) and with what the file keeps besides (angle_rmse), the encoders' zero of that
    recording taken out where zeros differ between recordings."""

    trial: str
    coupling: str
    joint: str
    validate: bool
    unit: str
    plain_rmse: float
    angle_rmse: float
    samples: int


def coupling_angles(rig: RigModel) -> tuple[CouplingAngle, ...]:
    """All couplings of a rig in all trials that recorded both ends. Raises DescriptionError for a record of its file
    that names no effect of its coupling."""
    return tuple(angle for c in rig.couplings for angle in _of_one(rig, c))


def _of_one(rig: RigModel, coupling: Coupling) -> list[CouplingAngle]:
    fit = fit_coupling(rig, coupling)  # for its balances; the polynomial stays the file's
    if fit is None:
        return []
    rivals, kept = coupling_candidates(fit, coupling), []
    for record in read_couplings(rig.xml):
        if record["coupling"] == coupling.name:
            found = _named(rivals, record)
            kept.append((found, record["shape"], np.array([record["amplitude"][a[0]] for a in found.amplitudes])))
    plain = [r.effort - np.polynomial.polynomial.polyval(r.position, coupling.polycoef) for r in fit.rows]
    whole = [
        left - sum((c.columns(r, shape) @ size for c, shape, size in kept), np.zeros(len(left)))
        for r, left in zip(fit.rows, plain, strict=True)
    ]
    errors = [_rmse([left[r.moving] for r, left in zip(fit.rows, side, strict=True)]) for side in (plain, whole)]
    return [
        CouplingAngle(
            r.trial,
            coupling.name,
            coupling.dependent,
            r.validate,
            rig.unit(coupling.dependent),
            *both,
            int(r.moving.sum()),
        )
        for r, *both in zip(fit.rows, *errors, strict=True)
    ]


def _named(rivals: Sequence[Candidate], record: dict) -> Candidate:
    for c in rivals:
        if (c.effect, c.variant, c.joint) == (record["effect"], record["variant"], record["joint"]):
            return c
    raise DescriptionError(
        f'custom/text "hand_model": no effect "{record["effect"]}" ({record["variant"] or "no variant"}) at coupling '
        f'"{record["coupling"]}"'
    )


def _rmse(left: Sequence[Array]) -> list[float]:
    zeros = own_zeros(left)
    return [float(np.sqrt(np.mean((e - z) ** 2))) for e, z in zip(left, zeros or [0.0] * len(left), strict=True)]


__all__ = ["CouplingAngle", "coupling_angles"]
