"""What an analysis comes to: a mismatch, nothing, or something that no effect known here explains."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from typing import Any

import numpy as np

from .declared import DeclaredFit
from .findings import Finding
from .standing import FITS

# of the rms of an effort: a machine whose law is known better is one that nobody calls unexplained, be its sensors
# ever so quiet (gauges, weights and levers are known to a percent or two)
ACCURATE = 0.02


def accurate(fit: DeclaredFit) -> dict[str, float]:
    """Joints of whose effort the declared model leaves so little in recordings kept out (all, where there are none),
    and how much: median of rms over rms."""
    held_out = {r.trial for r in fit.rows if r.validate} or {r.trial for r in fit.rows}
    shares = {
        joint: [share for (trial, own), share in fit.quality.items() if own == joint and trial in held_out]
        for joint in {own for _, own in fit.quality}
    }
    return {j: float(np.median(v)) for j, v in sorted(shares.items()) if v and np.median(v) < ACCURATE}


def verdict(found: Sequence[Finding], lack: Mapping[str, Any], well_known: Collection[str] = ()) -> str:
    """The verdict of an analysis. lack: its lack of fit; well_known: joints of `accurate`."""
    if found:
        return "mismatch"
    if lack.get("before") is None:
        return "unexplained"
    joints = lack.get("joints", {"": lack})
    beyond = any(_beyond_noise(p) for j, p in joints.items() if j not in well_known)
    return "unexplained" if beyond else "consistent"


def _beyond_noise(lack: Mapping[str, Any]) -> bool:
    """Whether the error left (at one joint, or of all) is more than its noise."""
    return lack["after"] > FITS * (lack.get("noise_floor") or 0.0)


def limit(lack: Mapping[str, Any]) -> float | None:
    """Error below which, all joints together, nothing more than noise is left, in the units of the lack of fit."""
    if lack.get("before") is None:
        return None
    joints = lack.get("joints", {"": lack}).values()
    floors = [(p["noise_floor"] or 0.0) / max(p["before"], 1e-300) for p in joints]
    return float(FITS * np.sqrt(np.mean(np.square(floors))) * lack["before"])


def unexplained(
    lack: Mapping[str, Any], found: Sequence[Finding], well_known: Collection[str] = ()
) -> tuple[Mapping[str, Any], ...]:
    """Entries of what stays unexplained, by joint. Arguments as in `verdict`."""
    out = []
    for joint, p in lack.get("joints", {} if lack.get("before") is None else {"": lack}).items():
        if not found and joint in well_known:
            continue
        floor = p.get("noise_floor") or 0.0
        excess, whole = p["after"] ** 2 - floor**2, p["before"] ** 2 - floor**2
        if whole > 0 and excess > 0.02 * whole and _beyond_noise(p):
            signal = "position" if lack.get("metric") == "position_rmse" else "effort"
            out.append(
                {
                    "where": {"finger": None, "joint": joint or None, "signal": signal},
                    "share_of_mismatch": float(min(excess / whole, 1.0)),
                    "shape": "what no effect known here lowers on recordings held out",
                }
            )
    return tuple(out)


def accuracy_notes(
    lack: Mapping[str, Any], found: Sequence[Finding], well_known: Mapping[str, float]
) -> tuple[str, ...]:
    """What is more than noise at joints that are known so well."""
    joints = lack.get("joints", {})
    return tuple(
        f"{joint}: the declared model leaves {100 * share:.1f} % of the effort, which is more than noise and less than "
        "machines are known to"
        for joint, share in well_known.items()
        if not found and joint in joints and _beyond_noise(joints[joint])
    )
