"""How far the true law itself takes the held-out error: by regression in the band that was looked at, or by its own
simulation.

An analysis that knows the effect and its shape; the strengths it fits to the training recordings, states it takes from
the encoders.
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .law import Law
from .steps import Drive, one_joint

Array = NDArray[np.float64]
Log = dict[str, Array]
WIDE = 3.0  # states are filtered so much wider than the balance
# orders of the filters of states and of the balance: what they let through is part of what is attainable
STATES, WEIGHED = 4, 2
FRICTIONS = 3  # columns of declared friction at most: viscous, and dry of two levels; then constants
SLOW = 0.01  # of the greatest speed: below, friction is not known


def logs(folder: Path) -> list[tuple[Log, bool, Mapping[str, Any]]]:
    """Columns of every recording of a session, whether it validates, what it sets."""
    trials = tomllib.loads((folder / "session.toml").read_text())["trial"]
    out = []
    for trial in trials:
        path = folder / trial["log"]
        names = path.open().readline().strip().split(",")
        table = np.loadtxt(path, delimiter=",", skiprows=1)
        out.append((dict(zip(names, table.T, strict=True)), trial.get("purpose") == "validate", trial.get("set", {})))
    return out


def balance(folder: Path, answer: Mapping[str, Any], cutoff_hz: float) -> list[float]:
    """Held-out error over the declared model's with the best one of the hidden effects, and with both."""
    law = Law(**{k: tuple(v) if isinstance(v, list) else v for k, v in answer["law"].items()})
    effects, squares = answer["effects"], {}
    every = logs(folder)
    for joint in (0, 1) if answer["machine"] == "arm" else (0,):
        mine = [e for e in effects if answer["machine"] != "arm" or answer["extra"]["joint"] == joint]
        rows = [(_states(log, answer, joint, cutoff_hz), held, own) for log, held, own in every]
        for some in dict.fromkeys(((), *((e,) for e in effects), tuple(effects))):
            known = tuple(e for e in some if e in mine)
            squares.setdefault(some, []).append(_error(rows, answer["machine"], law, answer, known) ** 2)
    base = np.array(squares[()])
    ratios = {some: float(np.sqrt(np.mean(np.array(s) / base))) for some, s in squares.items()}
    return [min((ratios[(e,)] for e in effects), default=1.0), ratios[tuple(effects)]], {
        e: ratios[(e,)] for e in effects
    }


def _filtered(values: Array, rate: float, cutoff_hz: float, order: int) -> Array:
    """Values (n, ...) through a filter of that order, run both ways."""
    from scipy.signal import butter, sosfiltfilt

    return (
        values
        if cutoff_hz >= 0.45 * rate
        else sosfiltfilt(butter(order, cutoff_hz, fs=rate, output="sos"), values, axis=0)
    )


def _states(log: Log, answer: Mapping[str, Any], joint: int, cutoff_hz: float) -> dict[str, Any]:
    """Position, velocity, acceleration (n, joints), effort (n,) on an even grid, with its rate and the band of the
    balance."""
    t = log["time"] - log["time"][0]
    grid = np.linspace(0, t[-1], len(t))
    rate = (len(t) - 1) / t[-1]
    names = {"arm": ("shoulder_position", "elbow_position"), "stages": ("output_position",)}.get(
        answer["machine"], ("position",)
    )
    q = np.stack([_filtered(np.interp(grid, t, log[n]), rate, WIDE * cutoff_hz, STATES) for n in names], 1)
    v = np.gradient(q, 1 / rate, axis=0)
    effort = next(log[n] for n in (("shoulder_torque", "elbow_torque")[joint], "torque", "force") if n in log)
    if answer["machine"] == "stages":
        effort = effort + 0.9 * log["load_torque"]
    effort = np.interp(grid + answer["late_s"] * ("late_channel" in answer["effects"]), t, effort)
    late = np.interp(
        grid, t, next(log[n] for n in (("shoulder_torque", "elbow_torque")[joint], "torque", "force") if n in log)
    )
    return {
        "q": q,
        "v": v,
        "a": np.gradient(v, 1 / rate, axis=0),
        "effort": effort,
        "late": late,
        "rate": rate,
        "cutoff": cutoff_hz,
        "joint": joint,
        "load": np.interp(grid, t, log.get("load_torque", 0 * t)),
    }


def _declared(s: Mapping[str, Any], machine: str, own: Mapping[str, Any], levels: Sequence[float]) -> tuple[Array, int]:
    """Declared columns (n, p) and how many of them are loads."""
    q, v, a = (s[k][:, s["joint"]] for k in ("q", "v", "a"))
    sign = np.clip(v / (SLOW * np.abs(v).max()), -1, 1)
    friction = [v, sign]
    if machine == "arm":
        (q1, q2), (v1, v2), (a1, a2) = s["q"].T, s["v"].T, s["a"].T
        c, w = np.cos(q2), np.sin(q2)
        loads = [a1, a1 + a2, c * (2 * a1 + a2) - w * (2 * v1 * v2 + v2**2), np.sin(q1), np.sin(q1 + q2)]
        loads = loads if s["joint"] == 0 else [a1 + a2, c * a1 + w * v1**2, np.sin(q1 + q2), a2]
        return np.stack([*loads, *friction], 1), len(loads)
    if machine == "brake":
        level = float(own["joint:slide:frictionloss"])
        return np.stack([a, v, *(sign * (level == x) for x in levels)], 1), 1
    loads = {"hinge": [a, np.sin(q)], "slide": [a], "stages": [a]}[machine]
    more = [np.ones_like(q)] if machine == "slide" else []
    return np.stack([*loads, *friction, *more], 1), len(loads)


def _hidden(
    s: Mapping[str, Any],
    law: Law,
    effect: str,
    load: Array,
    answer: Mapping[str, Any],
    own: Mapping[str, Any],
    levels: Sequence[float],
) -> Array:
    """Columns (n, k) of a hidden effect at its true shape; load: what the joint carries."""
    q, v = (s[k][:, s["joint"]] for k in ("q", "v"))
    sign, slow = np.clip(v / (SLOW * np.abs(v).max()), -1, 1), np.exp(-((v / law.stribeck_speed) ** 2))
    if effect == "load_dependent_friction":
        side = {
            "joint": np.abs(load),
            "motor": np.abs(s["expected"]),
            "gear": 0.5 * (np.abs(load) + np.abs(s["expected"])),
        }[law.load_side]
        return np.stack([sign * side, sign * side * slow] if law.slow_load else [sign * side], 1)
    if effect == "elastoplastic_hysteresis":
        reach = answer["extra"].get("reach") or law.stop[1]
        state, out = 0.0, np.zeros(len(q))
        for k, (x, y) in enumerate(pairwise(q)):
            state = out[k + 1] = min(max(state + (y - x) / reach, -1.0), 1.0)
        return (
            np.stack([out * (float(own["joint:slide:frictionloss"]) == x) for x in levels], 1)
            if levels
            else out[:, None]
        )
    column = {
        "stribeck_friction": sign * slow,
        "asymmetric_viscous_friction": np.abs(v),
        "quadratic_damping": v * np.abs(v),
        "asymmetric_friction": np.ones_like(v),
        "position_dependent_friction": sign * np.exp(-0.5 * ((q - law.tight[0]) / law.tight[1]) ** 2),
        "detent_load": np.exp(-0.5 * ((q - law.spot[0]) / law.spot[1]) ** 2),
    }
    return column[effect][:, None] if effect in column else np.zeros((len(v), 0))


def _error(rows: list, machine: str, law: Law, answer: Mapping[str, Any], effects: Sequence[str]) -> float:
    """Held-out error of declared columns and those of some effects, fitted to the training recordings."""
    levels = sorted({float(own["joint:slide:frictionloss"]) for _, _, own in rows if own}) if machine == "brake" else []
    loads, load_theta, full = {}, None, None
    for _ in range(5 if "load_dependent_friction" in effects else 1):
        parts = []
        for k, (s, held, own) in enumerate(rows):
            x, count = _declared(s, machine, own, levels)
            loads[k] = 0 * x[:, 0] if load_theta is None else x[:, :count] @ load_theta
            loads[k] = loads[k] - s["load"] * 0.9
            s["expected"] = s["late"] if full is None else full[k]
            more = [_hidden(s, law, e, loads[k], answer, own, levels) for e in effects]
            x = np.concatenate([x, *more], 1)
            y = s["effort"] if "late_channel" in effects or "late_channel" not in answer["effects"] else s["late"]
            moving = np.abs(s["v"][:, s["joint"]]) > SLOW * np.abs(s["v"][:, s["joint"]]).max()
            end = min(int(s["rate"] / s["cutoff"]), len(y) // 20)
            moving[:end] = moving[len(y) - end :] = False
            parts.append(
                (
                    _filtered(x, s["rate"], s["cutoff"], WEIGHED)[moving],
                    _filtered(y, s["rate"], s["cutoff"], WEIGHED)[moving],
                    held,
                    x,
                )
            )
        x, y = (np.concatenate([p[i] for p in parts if not p[2]]) for i in (0, 1))
        theta = _fitted(x, y, count, _declared(rows[0][0], machine, rows[0][2], levels)[0].shape[1])
        load_theta, full = (
            theta[:count],
            [p[3] @ theta - s["load"] * 0.9 for p, (s, _, _) in zip(parts, rows, strict=True)],
        )
    left = np.concatenate([y - x @ theta for x, y, held, _ in parts if held])
    return float(np.sqrt(np.mean(left**2)))


def _fitted(x: Array, y: Array, loads: int, declared: int) -> Array:
    """Least squares with friction that is none below zero, nor an inertia alone at its joint (loads: so many columns
    first; declared: with those of declared friction)."""
    from scipy.optimize import lsq_linear

    size = np.abs(x).max(0) + 1e-300
    least = np.full(x.shape[1], -np.inf)
    least[loads : min(declared, loads + FRICTIONS)] = 0.0
    if loads <= 2:
        least[0] = 0.0
    root = np.linalg.qr(np.column_stack([x / size, y]), "r")
    return lsq_linear(root[:, :-1], root[:, -1], (least, np.inf), "bvls").x / size


def motion(folder: Path, answer: Mapping[str, Any]) -> float:
    """Position error [rad] of the true law, without its small imperfections, simulated in open loop from the true
    starts."""
    law = Law(
        **{k: tuple(v) if isinstance(v, list) else v for k, v in answer["law"].items()}
        | {"ripple": (0.0, 1.0, 0.0)}
        | {"grit": (0.0, 1.0), "slosh": (0.0, 1.0, 0.0)}
    )
    more, left = answer["extra"], []
    for (log, held, own), start in zip(logs(folder), more["starts"], strict=True):
        if not held:
            continue
        t = log["time"] - log["time"][0]
        drive = (
            Drive(0.0)
            if own or "voltage" not in log
            else Drive(more["gain"], more["back_emf"], answer["late_s"], 0.0, more["sag"])
        )
        volts = log.get("voltage", 0 * t)
        asked = volts[np.clip(np.searchsorted(t, np.arange(int(t[-1] * 1e3) + 2) * 1e-3, side="right") - 1, 0, None)]
        track = one_joint(
            law, drive, lambda k, q, v, u=asked: u[k], t[-1] + 1e-3, tuple(start), np.random.default_rng(0)
        )
        left.append(np.interp(t, track.time_s, track.position[:, 0]) - log["position"])
    return float(np.sqrt(np.mean(np.concatenate(left) ** 2)))
