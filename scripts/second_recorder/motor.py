"""Forward simulation of one drive: position controller, LuGre friction, spring, and whatever is hidden in `dyn`."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .hand import Motor
from .moves import STEP, Program

Array = NDArray[np.float64]
KP, KD = 22.0, 3.0  # raw per %, raw per %/s
BRISTLE, BRISTLE_DAMPING = 60.0, 0.25


@dataclass(frozen=True)
class Trace:
    """Motion at every simulation step: position [%], speed [%/s], current of the drive [raw], reference [%]."""

    time: Array
    position: Array
    speed: Array
    current: Array
    reference: Array


def simulate(motor: Motor, dyn: dict[str, Any], program: Program, start: float, gravity: tuple[float, float]) -> Trace:
    """Run a program; `start` is the session time [s] of the trial, `gravity` its (x, z) direction in the finger
    frame."""
    dt, exp, sin, cos = STEP, math.exp, math.sin, math.cos
    m, b, Fc, k, tau0 = motor.m, motor.b, motor.Fc, motor.k, motor.tau0
    get = dyn.get
    rise, vs = Fc * (get("Fs_ratio", 1.0) - 1.0), get("vs", 20.0)
    b_flex, b_ext = b * get("b_flex_ratio", 1.0), b * get("b_ext_ratio", 1.0)
    asym, mu = get("fc_asym", 0.0), get("load_mu", 0.0)
    pos_amp, pos_c, pos_w = get("pos_amp", 0.0), get("pos_c", 50.0), get("pos_w", 8.0)
    detent, detent_c, detent_w = get("detent_amp", 0.0), get("detent_c", 50.0), get("detent_w", 8.0)
    stiffen = get("spring_cubic", 0.0)
    grav, g_x, g_z, g_full = get("gravity_amp", 0.0), gravity[0], gravity[1], 0.0135
    ripple, wave, phase = get("ripple_amp", 0.0), 2 * math.pi / get("ripple_period", 6.0), get("ripple_phase", 0.0)
    quad = get("quad", 0.0)
    plastic, plastic_d = get("plastic_amp", 0.0), get("plastic_dist", 8.0)
    relax_k, relax_tau = get("relax_k", 0.0), get("relax_tau", 1.0)
    s0, s1 = get("bristle", BRISTLE), BRISTLE_DAMPING
    stop_k, stop_x = get("stop_k", 0.0), get("stop_x", 85.0)
    heat, heat_tau = get("thermal_amp", 0.0), get("thermal_tau", 100.0)
    sag, limit = get("sag", 0.0), get("limit", 1e9)
    touch_k, touch_x = get("contact_k", 0.0), get("contact_x", 65.0)
    t_on, t_off = (f * program.duration for f in get("contact_window", (2.0, 2.0)))
    # outside the table
    accel_mu = get("accel_friction", 0.0)
    jump, jump_t = get("jump_ratio", 0.0), get("jump_at", 25.0) - start
    tooth, tooth_c, tooth_w = get("tooth_amp", 0.0), get("tooth_c", 50.0), get("tooth_w", 1.5)
    dwell, dwell_tau, dwell_d = get("dwell_amp", 0.0), get("dwell_tau", 0.4), get("dwell_dist", 3.0)
    fast_k, fast_x, fast_v = get("fast_spring_k", 0.0), get("fast_spring_x", 50.0), get("fast_spring_v", 60.0)
    shake, shake_w = get("shake_amp", 0.0), 2 * math.pi * get("shake_hz", 4.0)
    s_on, s_off = (f * program.duration for f in get("shake_window", (2.0, 2.0)))

    lag = round(get("command_delay", 0.0) / dt)
    reference = np.concatenate([np.zeros(lag), program.reference])[: len(program.reference)]
    rate = np.concatenate([np.zeros(lag), program.rate])[: len(program.rate)]
    x = v = z = a = smooth_a = w = f_relax = rested = t = 0.0
    passes, above, window = 0, False, get("fade", 0.3)
    out_x: list[float] = []
    out_v: list[float] = []
    out_i: list[float] = []
    for r, r_rate in zip(reference.tolist(), rate.tolist()):
        current = KP * (r - x) + KD * (r_rate - v)
        current = min(max(current, -limit), limit)
        drive = current * (1.0 - sag * min(abs(current), 150.0) / 100.0) if sag else current
        spring = k * x + tau0
        if stiffen:
            spring += k * x * stiffen * (x / 100.0) ** 2
        load = spring
        if grav:
            angle = g_full * x
            load += grav * (cos(angle) * g_z + sin(angle) * g_x)
        speed = abs(v)
        level = Fc
        if rise:
            level += rise * exp(-speed / vs)
        if asym:
            level *= 1.0 + asym if v > 0 else 1.0 - asym
        if mu:
            level += mu * abs(load)
        if pos_amp:
            level *= 1.0 + pos_amp * exp(-0.5 * ((x - pos_c) / pos_w) ** 2)
        if heat:
            level *= 1.0 + heat * exp(-(start + t) / heat_tau)
        if accel_mu:
            smooth_a += (a - smooth_a) * dt / 0.01
            level += accel_mu * min(abs(smooth_a), 1500.0)
        if jump and t > jump_t:
            level *= 1.0 + jump
        if dwell:
            rested += ((1.0 - rested) * dt / dwell_tau) if speed < 1.0 else -rested * speed * dt / dwell_d
            level += dwell * rested
        if detent:
            load += detent * exp(-0.5 * ((x - detent_c) / detent_w) ** 2)
        if ripple:
            load += ripple * sin(wave * x + phase)
        if quad:
            load += quad * v * speed
        if plastic:
            w += (v - speed * w / plastic_d) * dt
            load += plastic * w / plastic_d
        if relax_k:
            f_relax += (relax_k * v - f_relax / relax_tau) * dt
            load += f_relax
        if stop_k and x > stop_x:
            load += stop_k * (x - stop_x)
        if touch_k and x > touch_x and t_on < t < t_off:
            load += touch_k * (x - touch_x) * min(1.0, (t - t_on) / window, (t_off - t) / window)
        if tooth:
            if above and x < tooth_c - 4 * tooth_w or not above and x > tooth_c + 4 * tooth_w:
                above, passes = not above, passes + 1
            if passes % 3 == 0:
                load += tooth * exp(-0.5 * ((x - tooth_c) / tooth_w) ** 2) * min(max(v / 2.0, -1.0), 1.0)
        if fast_k and x > fast_x and speed > fast_v:
            load += fast_k * (x - fast_x) * min(1.0, (speed - fast_v) / 15.0)
        if shake and s_on < t < s_off:
            load += shake * sin(shake_w * t)
        z_rate = v - s0 * speed * z / level
        friction = s0 * z + s1 * z_rate
        a = (drive - (b_flex if v > 0 else b_ext) * v - friction - load) / m
        v += a * dt
        x += v * dt
        z += z_rate * dt
        t += dt
        out_x.append(x)
        out_v.append(v)
        out_i.append(current)
    time = (np.arange(len(out_x)) + 1) * dt
    return Trace(time, np.array(out_x), np.array(out_v), np.array(out_i), reference)
