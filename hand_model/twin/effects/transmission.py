"""Between encoder and finger tip: lost motion, give, stops, and a finger that leaves its one-way drive."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..influence import Draw, Influence, effect
from ..motor import DriveNow, DriveTerms, Motion
from .shapes import play, soft_play

Array = NDArray[np.float64]

FRICTION_BEHIND = 0.5  # share of the drive's friction that sits behind the elastic part


def carried_load(motion: Motion) -> Array:
    """Load (n,) [raw] that passes through the transmission, relative to the rest at the trial's start."""
    # Friction as it acts: bristles hold on while the drive creeps back, so its sign is not the velocity's.
    force = motion.load + FRICTION_BEHIND * (motion.friction + 0.145 * motion.velocity)
    width = 20  # 20 ms: the elastic part has its own small damping
    smooth = np.convolve(np.pad(force, (width - 1, 0), mode="edge"), np.full(width, 1.0 / width), mode="valid")
    return smooth - smooth[0]


def _give(force: Array, per_raw: float, form: str) -> Array:
    return per_raw * force / (1.0 + np.abs(force) / 60.0) * 1.3 if form == "hardening" else per_raw * force


@effect("drive_backlash", "transmission", "markers", ("play", "soft_play"), joint="proximal")
def drive_backlash(draw: Draw) -> Influence:
    """Lost motion between encoder and proximal segment."""
    gap = draw.size("gap_percent", 0.9, 1.8)
    operator = play if draw.form == "play" else soft_play
    return Influence(drive=lambda motion, percent: operator(percent, gap))


@effect("series_elasticity", "transmission", "markers", ("linear", "hardening"), joint="proximal")
def series_elasticity(draw: Draw) -> Influence:
    """Give between encoder and proximal segment in proportion to the transmitted load."""
    per_raw = draw.size("percent_per_raw", 0.03, 0.055)
    return Influence(drive=lambda motion, percent: percent - _give(carried_load(motion), per_raw, draw.form))


@effect("linkage_backlash", "transmission", "markers", ("play", "soft_play"), joint="distal")
def linkage_backlash(draw: Draw) -> Influence:
    """Lost motion between proximal and distal segment."""
    gap = draw.size("gap_rad", 0.014, 0.028)
    operator = play if draw.form == "play" else soft_play
    return Influence(linkage=lambda motion, angle: operator(angle, gap))


@effect("linkage_compliance", "transmission", "markers", ("linear", "hardening"), joint="distal")
def linkage_compliance(draw: Draw) -> Influence:
    """Give in the linkage in proportion to the load."""
    per_raw = draw.size("rad_per_raw", 5e-4, 9e-4)
    return Influence(linkage=lambda motion, angle: angle - _give(carried_load(motion), per_raw, draw.form))


@effect("coupling_deadband", "transmission", "markers", ("hard", "soft"), joint="distal")
def coupling_deadband(draw: Draw) -> Influence:
    """The distal segment does not move before the proximal one has turned by some angle."""
    dead = draw.size("deadband_rad", 0.07, 0.14)

    def linkage(motion: Motion, angle: Array) -> Array:
        if draw.form == "hard":
            return np.maximum(0.0, angle - dead)
        corner = max(0.15 * dead, 1e-9)
        return corner * (np.logaddexp(0.0, (angle - dead) / corner) - np.logaddexp(0.0, -dead / corner))

    return Influence(linkage=linkage)


@effect("distal_stop", "transmission", "markers", ("hard", "soft"), joint="distal")
def distal_stop(draw: Draw) -> Influence:
    """The distal segment stops before the proximal one does."""
    full = float(np.polynomial.polynomial.polyval(draw.finger.proximal_rad.sum(), draw.finger.distal_rad))
    stop = draw.note("stop_rad", full * (1.0 - draw.size("share_cut", 0.09, 0.15)))

    def distal(motion: Motion, angle: Array) -> Array:
        beyond = np.maximum(0.0, angle - stop)
        return np.minimum(angle, stop) + (0.15 * beyond if draw.form == "soft" else 0.0)

    return Influence(distal=distal)


@effect("spring_decoupling", "transmission", "markers", ("push", "hold"), joint="proximal")
def spring_decoupling(draw: Draw) -> Influence:
    """Somebody flexes the finger now and then: it leaves its one-way drive, which then carries no spring."""
    lift = draw.size("lift_rad", 0.06, 0.12)
    length = draw.uniform("length_s", 0.5, 0.8) * (1.6 if draw.form == "hold" else 1.0)
    windows = []
    for trial in (t for t in draw.schedule if t.kind == "flexion" and t.finger == draw.finger.name):
        shares = (0.15 + 0.7 * (np.arange(3) + 0.4 * draw.rng.uniform(size=3)) / 3.0).tolist()
        windows += [trial.start_s + share * trial.duration_s for share in shares]
    draw.where["trials"] = [t.name for t in draw.schedule if t.kind == "flexion" and t.finger == draw.finger.name]
    draw.where["windows_s"] = [[begin, begin + length] for begin in windows]

    def lifted(session_s: Array | float) -> Array:
        phase = (np.asarray(session_s)[..., None] - np.array(windows)) / length
        inside = (phase > 0) & (phase < 1)
        bell = (
            np.minimum(1.0, 2.5 * np.sin(np.pi * np.clip(phase, 0, 1)) ** 2)
            if draw.form == "hold"
            else np.sin(np.pi * phase) ** 2
        )
        return (inside * bell).sum(-1)

    def load(now: DriveNow) -> float:
        for begin in windows:
            if begin < now.session_s < begin + length:
                # The first tenth of the lift already takes the spring off the drive.
                return -min(1.0, 10.0 * float(lifted(now.session_s))) * min(1.0, draw.strength) * now.spring
        return 0.0

    return Influence(
        terms=DriveTerms(load=(load,)),
        proximal=lambda motion, angle: angle + lift * lifted(motion.session_start_s + motion.time_s),
    )
