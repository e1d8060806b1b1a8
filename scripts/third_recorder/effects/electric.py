"""Effects of encoder, drive electronics and recording. Currents in raw units, positions in %, times in s."""

from __future__ import annotations

import numpy as np

from ..geometry import log_uniform
from ..hand import Finger, Session
from ..hidden import Clipping
from .draw import Drawn, clear_load, sign, visible_deg


def encoder_periodic_error(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """An encoder whose error is periodic in position."""
    motor = finger.motor
    motor.encoder_period = log_uniform(rng, 6, 16)
    degrees_per_pct = np.degrees(finger.linkage.full[0]) / 100
    motor.encoder_error = strength * 0.6 * visible_deg(session) * log_uniform(rng, 1, 2) / degrees_per_pct
    motor.encoder_phase = rng.uniform(0, 6.28)
    counts_per_pct = finger.encoder_range / 100
    return Drawn(
        {
            "amplitude_counts": motor.encoder_error * counts_per_pct,
            "period_counts": motor.encoder_period * counts_per_pct,
        }
    )


def drive_sag(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A drive that delivers ever less of a higher current."""
    motor = finger.motor
    top = motor.coulomb + motor.stiffness * 90 + motor.preload + motor.viscous * session.laboratory.top_speed * 0.7
    motor.sag = strength * min(7 * clear_load(session, rng) / top, 0.3) / top
    return Drawn({"fraction_lost_per_raw": motor.sag, "delivered_at_top_load": 1 / (1 + motor.sag * top)})


def command_delay(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A drive that obeys late."""
    finger.motor.command_delay = strength * log_uniform(rng, 0.10, 0.22)
    session.laboratory.setpoint_column = True
    return Drawn({"delay_s": finger.motor.command_delay})


def current_saturation(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A current that clips, in the drive or in its reading."""
    where = str(rng.choice(["reading", "drive"]))
    share = log_uniform(rng, 0.02, 0.06) * (1 if strength >= 1 else 0.6)
    finger.faults.clipping = Clipping(where, share)
    return Drawn({"clips": where, "share_clipped": share})


def current_channel_delay(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A current that is logged late, at times early, against the position."""
    direction = int(rng.choice([1, 1, -1]))
    delay = finger.faults.current_delay_s = strength * direction * log_uniform(rng, 0.035, 0.075)
    return Drawn({"current_late_s": delay})


def command_as_measurement(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A column of the log that was never measured."""
    finger.faults.faked = str(rng.choice(["position_is_reference", "current_dead", "current_is_command"]))
    session.laboratory.setpoint_column = True
    return Drawn({"variant": finger.faults.faked})


def clock_drift(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A log whose clock runs fast or slow against the cameras'."""
    direction = sign(rng)
    drift = strength * direction * log_uniform(rng, 1.2e-3, 2.8e-3)
    session.laboratory.log_rate = 1 + drift
    return Drawn({"log_rate": 1 + drift})
