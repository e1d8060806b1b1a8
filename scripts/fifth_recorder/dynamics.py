"""What drives and loads one motor: declared figures, controller, and the figures of every hidden load.

Units: position % of range, speed %/s, time s, loads in raw current units. An effect of amplitude 0 is absent.
"""

from dataclasses import dataclass


@dataclass
class Dynamics:
    """All numbers that stepper.c needs; the order of the fields is the order of its parameters."""

    # declared model: current = m a + b v + Fc sign(v) + k x + tau0
    m: float = 0.0125
    b: float = 0.145
    Fc: float = 34.0
    k: float = 0.23
    tau0: float = 9.3
    bristle: float = 60.0  # raw per %: stiffness before sliding, small enough to count as none
    # controller
    mode: float = 0.0  # 0 reference tracking, 1 speed loop with proportional position
    gain_p: float = 22.0  # raw per % (mode 0), 1/s (mode 1)
    gain_d: float = 2.5  # raw per %/s
    gain_i: float = 0.0
    dead: float = 0.6  # %, mode 1
    accel: float = 900.0  # %/s^2, mode 1
    sag_speed: float = 0.0  # share of speed lost at 60 raw
    sag_gain: float = 0.0  # share of current lost at 60 raw
    sag_leak: float = 0.0  # share lost of what exceeds sag_from
    sag_from: float = 50.0
    ceiling: float = 1e9
    ceiling_share: float = 0.0
    # friction
    st_amp: float = 0.0  # share of Fc added at standstill
    st_speed: float = 20.0
    st_form: float = 0.0
    asym_friction: float = 0.0
    asym_form: float = 0.0
    load_mu: float = 0.0
    load_form: float = 0.0
    spot_amp: float = 0.0
    spot_at: float = 50.0
    spot_width: float = 7.0
    spot_form: float = 0.0
    heat_power: float = 0.0
    heat_power_rise: float = 8.0
    heat_power_fall: float = 60.0
    soft_share: float = 0.0
    soft_distance: float = 4.0  # %
    soft_form: float = 0.0
    # loads
    visc_amp: float = 0.0
    visc_form: float = 0.0
    detent_amp: float = 0.0
    detent_at: float = 50.0
    detent_width: float = 6.0
    detent_form: float = 0.0
    spring_amp: float = 0.0
    spring_form: float = 0.0
    gravity: float = 0.0
    gravity_c: float = 0.0  # weight's lever along the open finger in this trial's pose
    gravity_s: float = 0.0
    gravity_lean: float = 0.0  # rad between finger and its centre of mass
    angle_full: float = 1.35  # rad
    ripple_amp: float = 0.0
    ripple_period: float = 5.0  # %
    ripple_phase: float = 0.0
    ripple_second: float = 0.0
    ripple_by_load: float = 0.0
    drag_amp: float = 0.0  # raw at 100 %/s
    drag_power: float = 2.0
    hyst_amp: float = 0.0
    hyst_distance: float = 10.0  # %
    hyst_form: float = 0.0
    relax_amp: float = 0.0  # raw per range
    relax_time: float = 1.0
    relax_time2: float = 10.0
    relax_second: float = 0.0
    stop_amp: float = 0.0  # raw at stop_depth beyond stop_at
    stop_at: float = 90.0
    stop_depth: float = 7.0
    stop_form: float = 0.0
    stop_low: float = 0.0
    touch_amp: float = 0.0
    touch_at: float = 60.0
    touch_depth: float = 30.0
