"""Effects that no table lists: a diagnosis should not find a name for them. Forces and currents in raw units."""

from __future__ import annotations

import numpy as np

from ..geometry import RAD, log_uniform
from ..hand import Finger, Session
from ..hidden import Bend, Bursts, Lens, Ringing, Sine, Warming
from .draw import Drawn, clear_load, sign, visible_deg


def emi_bursts(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """Noise on the current in bursts."""
    spread = 3.5 * clear_load(session, rng)
    bursts = Bursts(finger.name, spread, log_uniform(rng, 0.15, 0.4), log_uniform(rng, 1.5, 4))
    session.faults.bursts = bursts
    return Drawn({"sd_raw": bursts.spread, "length_s": bursts.length_s, "every_s": bursts.pause_s})


def stroke_number_friction(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """More friction in every third stroke."""
    finger.motor.third_stroke = 2 * clear_load(session, rng)
    return Drawn({"every_third_stroke_raw": finger.motor.third_stroke})


def speed_dependent_spring(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A spring that is stiffer in fast motion."""
    motor = finger.motor
    motor.fast_spring = 6 * clear_load(session, rng)
    motor.fast_spring_speed = 0.35 * session.laboratory.top_speed
    return Drawn({"raw_over_range": motor.fast_spring, "speed_pct_s": motor.fast_spring_speed})


def camera_distortion(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """Cameras with a wrong lens model."""
    centre = rng.normal(size=3) * 40
    size = log_uniform(rng, 8, 14) * float(np.clip(session.laboratory.marker_noise / 0.15, 0.4, 1.5))
    session.faults.lens = Lens(centre, size, int(rng.integers(2)))
    return Drawn({"mm_at_100mm": size})


def motor_constant_warms(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """More current for the same force as the motor warms."""
    warming = Warming(log_uniform(rng, 0.14, 0.25), log_uniform(rng, 50, 100))
    finger.faults.current_gain = warming
    return Drawn({"gain_rise": warming.rise, "time_constant_s": warming.time_s})


def palm_bends_under_load(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A palm that turns with the motor's current."""
    axis = rng.normal(size=3)
    size = 1.2 * visible_deg(session) * log_uniform(rng, 1, 2) * RAD / 90
    finger.faults.palm_bend = Bend(axis / np.linalg.norm(axis), size)
    return Drawn({"deg_per_raw": size / RAD})


def current_sensor_wander(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A slow wave on the current's reading."""
    wander = Sine(1.1 * clear_load(session, rng), log_uniform(rng, 0.07, 0.25), rng.uniform(0, 6))
    finger.faults.wander = wander
    return Drawn({"amplitude_raw": wander.amplitude, "hz": wander.hz})


def support_tremor(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A load that trembles with time."""
    tremor = finger.faults.tremor = Sine(1.5 * clear_load(session, rng), log_uniform(rng, 1.6, 4.5))
    return Drawn({"amplitude_raw": tremor.amplitude, "hz": tremor.hz})


def marker_support_rings(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A marker support that rings after every jerk of its motor."""
    ringing = Ringing(log_uniform(rng, 1.2, 2.5), log_uniform(rng, 2.5, 5), 0.05, int(rng.integers(2)))
    finger.faults.ringing = ringing
    return Drawn({"peak_mm": ringing.peak_mm, "hz": ringing.hz})


def friction_ages_at_rest(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """Friction that grows while the motor rests and is worn off once it moves."""
    motor = finger.motor
    motor.ageing = 6 * clear_load(session, rng)
    motor.ageing_time = log_uniform(rng, 0.2, 0.5)
    motor.ageing_rest = log_uniform(rng, 0.3, 0.9)
    return Drawn({"extra_raw": motor.ageing, "decays_s": motor.ageing_time, "builds_s": motor.ageing_rest})


def log_clock_jumps(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """The log's clock jumps once in every flexion."""
    session.faults.clock_jump_s = log_uniform(rng, 0.08, 0.2) * sign(rng)
    return Drawn({"jump_s": session.faults.clock_jump_s})


def tendon_creep(session: Session, finger: Finger, strength: float, rng: np.random.Generator) -> Drawn:
    """A proximal joint that lags behind its motor for seconds."""
    size = visible_deg(session) * log_uniform(rng, 1.2, 2) * RAD
    finger.linkage.creep = size, log_uniform(rng, 2, 6)
    return Drawn({"deg": size / RAD, "time_constant_s": finger.linkage.creep[1]})
