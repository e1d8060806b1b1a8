"""Probed screw heads: where along its axis a joint sits, and how well a tip is placed by hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..session import Probe, Session
from .finger import FingerFit, axis_sd_deg
from .probe import ProbedPoint, probed_point

Array = NDArray[np.float64]

# Placement of a probe tip by hand, per coordinate [m], where the session has too few probed joints to tell.
PLACEMENT_M = 5e-4
# An axis known this well [deg] can tell how far off it a tip was held.
SURE_DEG = 1.0
# A tip this many standard deviations off its axis, or two heads whose distance is, were not held on the screw heads.
BLUNDER = 5.0


@dataclass(frozen=True)
class Screws:
    """Probed screw heads of all joints. points: (finger, joint) -> side -> point, in the frame of the palm markers.

    placement_m: standard deviation per coordinate [m] of placing a tip. span_m: usual signed distance from the lateral
    to the medial head along the axis, nan where no joint has both.
    """

    points: Mapping[tuple[str, str], Mapping[str, ProbedPoint]]
    placement_m: float
    span_m: float

    def middle(self, finger: str, joint: str, axis: Array, on_line: Array) -> tuple[Array | None, float, str]:
        """Middle (3,) [m] between a joint's screw heads, its standard deviation along the axis [m], and a remark or "".

        axis (3,), on_line (3,) [m]: the joint's axis in the frame of the palm markers. A head that was not hit is
        replaced by the other one and the usual span. None where nothing was probed.
        """
        points = self.points.get((finger, joint), {})
        if not points:
            remark = (
                "no joint_probe trial; the centre's place along the axis is that of the markers" if self.points else ""
            )
            return None, 0.01, remark
        off = {side: _across(p.position_palm, axis, on_line) for side, p in points.items()}
        sound = {side: points[side].position_palm for side in points if off[side] <= BLUNDER * self.placement_m}
        if len(sound) == len(points) and len(points) > 1:
            heads = list(sound.values())
            span = (points["medial"].position_palm - points["lateral"].position_palm) @ axis
            if np.isfinite(self.span_m) and abs(span - self.span_m) > max(
                BLUNDER * np.sqrt(2) * self.placement_m, 0.4 * abs(self.span_m)
            ):
                remark = (
                    f"the screw heads were probed {1e3 * abs(span):.1f} mm apart, "
                    f"elsewhere {1e3 * abs(self.span_m):.1f} mm"
                )
                return np.mean(heads, axis=0), abs(span - self.span_m) / 2, remark
            return np.mean(heads, axis=0), self.placement_m / np.sqrt(2), ""
        if not sound:
            return (
                np.mean([p.position_palm for p in points.values()], axis=0),
                max(off.values()),
                "the probe missed the axis on both sides",
            )
        side = next(iter(sound))
        remark = (
            ""
            if len(points) == 1
            else f"the probe missed the {next(s for s in points if s not in sound)} screw head; the other one was used"
        )
        if not np.isfinite(self.span_m):
            return sound[side], 0.01, remark or f"only the {side} screw head was probed; the centre lies there"
        towards = -1.0 if side == "medial" else 1.0
        return sound[side] + axis * towards * self.span_m / 2, 1.5 * self.placement_m, remark


def probe_screws(session: Session, probe: Probe | None, palm_shape: Array, fits: list[FingerFit]) -> Screws:
    """Read all joint_probe trials and tell from the well-determined axes how tips were placed."""
    points: dict[tuple[str, str], dict[str, ProbedPoint]] = {}
    if probe is not None:
        for trial in session.select("joint_probe", validate=False):
            found = probed_point(trial, session, probe, palm_shape)
            points.setdefault((str(trial.finger), str(trial.joint)), {})[str(trial.side)] = found
    off, spans = [], []
    for fit in fits:
        chain = fit.fit.chain
        for k, segment in enumerate(fit.finger.segments):
            heads = points.get((fit.finger.name, segment.name), {})
            if axis_sd_deg(fit.joint_covariance(k)) > SURE_DEG:
                continue
            off += [_across(p.position_palm, chain.axis_palm[k], chain.centre_palm[k]) for p in heads.values()]
            if {"medial", "lateral"} <= set(heads):
                spans.append((heads["medial"].position_palm - heads["lateral"].position_palm) @ chain.axis_palm[k])
    # The median survives a blunder; a length in the plane has median 1.177 standard deviations (Rayleigh).
    placement = float(np.median(off)) / 1.177 if len(off) >= 4 else PLACEMENT_M
    return Screws(points, placement, float(np.median(spans)) if spans else float("nan"))


def _across(point: Array, axis: Array, on_line: Array) -> float:
    arm = point - on_line
    return float(np.linalg.norm(arm - axis * (arm @ axis)))
