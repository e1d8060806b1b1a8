"""Loads on the drive that the declared model lacks."""

from __future__ import annotations

from typing import Any

import numpy as np

from sixth_recorder.effects.law import SHARE, Context, Law, bump
from sixth_recorder.machine import Machine
from sixth_recorder.plant import Q_GRID, Series
from sixth_recorder.vectors import turned_about


def _over_position(x: Context, shape: np.ndarray, parameters: dict[str, Any], start: float, most: float) -> Law:
    """A load over Q_GRID, the amplitude in units of the Coulomb friction."""

    def hide(machine: Machine, amplitude: float) -> None:
        machine.plant.load_q += amplitude * x.coulomb * shape

    return Law(parameters, hide, start, most)


def detent_load(x: Context) -> Law:
    """A load at one place that does not depend on the direction."""
    law = x.pick("gaussian", "raised_cosine", "box", "magnetic")
    centre, width, sign = x.uniform(18, 82), x.uniform(3, 9), x.sign()
    z = (Q_GRID - centre) / width
    shape = -z * np.exp(0.5 - 0.5 * z * z) if law == "magnetic" else bump(law, z)
    parameters = {"law": law, "centre": centre, "width": width, "sign": sign}
    return _over_position(x, sign * shape, parameters, 0.3, 0.85 if sign < 0 else 1.4)


def nonlinear_spring(x: Context) -> Law:
    """A spring that is not linear."""
    law = x.pick("cubic", "exponential", "piecewise", "softening", "s_shaped")
    knee, exponent = x.uniform(0.35, 0.7), x.uniform(2, 4)
    s = np.clip(SHARE, 0, None)
    shape = {
        "cubic": s**3,
        "exponential": (np.exp(exponent * s) - 1) / (np.exp(exponent) - 1),
        "piecewise": np.clip(SHARE - knee, 0, None) / (1 - knee),
        "softening": 4 * s * (1 - s) * 0.6,
        "s_shaped": np.tanh((SHARE - knee) * exponent * 1.5),
    }[law]
    return _over_position(x, shape, {"law": law, "knee": knee, "exponent": exponent}, 0.5, 1.4)


def torque_ripple(x: Context) -> Law:
    """A load that comes back with every turn of a wheel."""
    period, phase = x.uniform(4, 14), x.uniform(0, 6.28)
    law = x.pick("sine", "two_harmonics", "growing", "peaky")
    z = 2 * np.pi * Q_GRID / period + phase
    shape = {
        "sine": np.sin(z),
        "two_harmonics": 0.85 * np.sin(z) + 0.5 * np.sin(2 * z + 1),
        "growing": np.sin(z) * (0.5 + SHARE),
        "peaky": np.sin(z + 0.6 * np.sin(z)),
    }[law]
    return _over_position(x, shape, {"law": law, "period": period}, 0.15, 0.8)


def gravity_load(x: Context) -> Law:
    """Weight of the moving parts against the pose of the palm, from the finger's own geometry."""
    finger = x.finger
    law = x.pick("both_segments", "proximal_mass", "tip_mass")
    distal_share = {"both_segments": 0.45, "proximal_mass": 0.0, "tip_mass": 0.9}[law]

    def load(trial: dict[str, Any], amplitude: float) -> np.ndarray:
        down = x.lab.gravity_palm(trial)
        proximal = finger.proximal(np.clip(Q_GRID, 0, 100))
        turn = turned_about(finger.axes[0], proximal)
        bone = finger.centres[1] - finger.centres[0]
        turn_distal = turned_about(finger.axes[1], finger.distal(proximal))
        tip = np.einsum("nij,njk,k->ni", turn, turn_distal, 0.5 * bone)
        arm = (1 - distal_share) * 0.5 * (turn @ bone) + distal_share * (turn @ bone + tip)
        return -amplitude * x.coulomb * (np.cross(arm, down) @ finger.axes[0]) / np.linalg.norm(bone)

    def hide(machine: Machine, amplitude: float) -> None:
        machine.plant.per_trial.append(lambda trial, t: {"load_q": load(trial, amplitude)})

    return Law({"law": law}, hide, 0.4, 1.3)


def elastoplastic_hysteresis(x: Context) -> Law:
    """Load that depends on the way taken: sliders or Bouc-Wen."""
    law, distance = x.pick("jenkins", "iwan", "bouc_wen"), x.uniform(5, 16)
    exponent = x.pick(1.0, 1.0, 2.0)

    def hide(machine: Machine, amplitude: float) -> None:
        p = machine.plant.p
        if law == "bouc_wen":
            p.update(BWF=amplitude * x.coulomb, BWD=distance * 0.6, BWN=exponent)
        else:
            p.update(NIW=1 if law == "jenkins" else 8, IWK=amplitude * x.coulomb, IWD=distance)

    return Law({"law": law, "distance": distance}, hide, 0.4, 1.4)


def viscoelastic_spring(x: Context) -> Law:
    """Maxwell branches beside the spring."""
    law, tau = x.pick("one_branch", "three_branches", "two_branches"), x.log_uniform(0.4, 4)
    branches = {
        "one_branch": [(1, 1)],
        "two_branches": [(0.6, 0.5), (0.6, 3)],
        "three_branches": [(0.45, 0.25), (0.45, 1), (0.45, 4)],
    }[law]

    def hide(machine: Machine, amplitude: float) -> None:
        stiffness = amplitude * x.coulomb / 100
        for i, (share, times) in enumerate(branches, start=1):
            machine.plant.p[f"MX{i}"], machine.plant.p[f"MXT{i}"] = stiffness * share, tau * times

    return Law({"law": law, "relaxation_time": tau}, hide, 0.5, 1.7)


def end_stop_contact(x: Context) -> Law:
    """A soft stop before one end of the range."""
    law, side = x.pick("linear", "hertz", "linear_damped"), x.pick("flexed", "flexed", "open")
    width = x.uniform(4, 11)
    place, sign = (100 - width, 1) if side == "flexed" else (width, -1)
    depth = np.clip(sign * (Q_GRID - place), 0, None) / width

    def hide(machine: Machine, amplitude: float) -> None:
        machine.plant.load_q += amplitude * x.coulomb * sign * (depth**1.5 if law == "hertz" else depth)
        if law == "linear_damped":
            machine.plant.p.update(HCD=amplitude * x.coulomb / width * 0.004, HCQ=place, HCS=float(sign))

    return Law({"law": law, "side": side, "place": place}, hide, 0.8, 3.0)


def external_contact(x: Context) -> Law:
    """An obstacle that is there in a few moves only."""
    law, place, n = x.pick("linear", "hertz", "foam"), x.uniform(35, 75), x.pick(2, 3, 4)
    exponent, damping = {"linear": (1.0, 0.0), "hertz": (1.5, 0.0), "foam": (1.2, 0.004)}[law]
    first_two = {x.trials[0]["name"], x.trials[1]["name"]}
    crossing = [
        (trial["name"], i)
        for trial in x.trials
        for i, (_, target, _) in enumerate(trial["moves"])
        if target > place + 15 and (i == 0 or trial["moves"][i - 1][1] < place - 15) and trial["name"] in first_two
    ]
    touched: dict[str, list[int]] = {}
    for k in x.rng.permutation(len(crossing))[:n]:
        name, i = crossing[k]
        touched.setdefault(name, []).append(i)

    def present(trial: dict[str, Any], t: np.ndarray) -> Series:
        there = np.zeros(len(t))
        moves = trial["moves"]
        for i in touched.get(trial["name"], []):
            back = next((k for k in range(i + 1, len(moves)) if moves[k][1] < place - 10), None)
            end = moves[back + 1][0] if back is not None and back + 1 < len(moves) else trial["duration"]
            there[(t >= moves[i][0]) & (t < end)] = 1
        return {"contact": there}

    def hide(machine: Machine, amplitude: float) -> None:
        machine.plant.per_trial.append(present)
        stiffness = amplitude * x.coulomb / (100 - place) ** exponent
        machine.plant.p.update(CQ=place, CK=stiffness, CN=exponent, CD=damping)

    return Law({"law": law, "place": place, "moves": touched}, hide, 1.0, 2.6)
