"""What comes between the drive and the segments: play, give, and joints that are no hinges."""

from __future__ import annotations

import numpy as np

from sixth_recorder.effects.law import Context, Law
from sixth_recorder.finger import SEGMENTS
from sixth_recorder.machine import H, Machine, Truth
from sixth_recorder.plant import Q_GRID, lag, play
from sixth_recorder.vectors import across


def _lost_motion(law: str, x: np.ndarray, gap: float, worn: tuple[float, float]) -> np.ndarray:
    """A series after play; worn: middle and width of the part where there is more, if the law says so."""
    if law == "hard":
        return play(x, gap)
    if law == "elastic_ends":
        return 0.55 * play(x, 0.7 * gap) + 0.45 * play(x, 1.8 * gap)
    w = np.exp(-0.5 * ((x - worn[0]) / worn[1]) ** 2) + 0.25
    return x + w * (play(x, gap) - x)


def drive_backlash(x: Context) -> Law:
    """Play between drive and finger; the amplitude is the gap, %."""
    law, share = x.pick("hard", "elastic_ends", "worn_in_one_part"), x.pick(0.0, 0.0, 0.08)
    worn = x.uniform(30, 70), 25

    def hide(machine: Machine, amplitude: float) -> None:
        machine.drive_stages.append(lambda q, truth: _lost_motion(law, q, amplitude, worn))
        if share:
            machine.plant.p.update(BLG=amplitude, BLS=share)

    return Law({"law": law, "friction_lost_in_gap": share}, hide, 1.5, 6.0)


def linkage_backlash(x: Context) -> Law:
    """Play in the coupling of the distal joint; the amplitude is the gap, rad."""
    law, worn = x.pick("hard", "elastic_ends", "worn_in_one_part"), (x.uniform(0.3, 0.9), 0.35)

    def hide(machine: Machine, amplitude: float) -> None:
        machine.coupling_stages.append(lambda angle, truth: _lost_motion(law, angle, amplitude, worn))

    return Law({"law": law}, hide, 0.02, 0.09)


def _transmitted(truth: Truth, p: dict[str, float], friction_share: float, viscous_share: float) -> np.ndarray:
    """Load on the transmission: spring, joint friction (by side of a small play), viscous part; in units of Coulomb
    friction."""
    q = truth["q"]
    side = np.clip((q - play(q, 0.5)) / 0.25, -1, 1)
    spring = p["K_"] * q + p["TAU0"]
    return (spring + friction_share * p["FC"] * side + viscous_share * p["B_"] * truth["v"]) / p["FC"]


def _compliance(
    x: Context, stages: str, law: str, shares: tuple[float, float], tau: float, start: float, most: float
) -> Law:
    """Give in proportion to a power of the transmitted load; tau: lag (s) of the law with damping."""

    def hide(machine: Machine, amplitude: float) -> None:
        def give(y: np.ndarray, truth: Truth) -> np.ndarray:
            load = _transmitted(truth, x.p, *shares)
            match law:
                case "stiffening":
                    load = np.sign(load) * abs(load) ** 0.6
                case "softening":
                    load = np.sign(load) * abs(load) ** 1.5
                case "with_damping":
                    load = lag(load, H, tau, tau)
            return y - amplitude * load

        getattr(machine, stages).append(give)

    return Law({"law": law, "friction_share": shares[0], "viscous_share": shares[1]}, hide, start, most)


def series_elasticity(x: Context) -> Law:
    """Give between drive and finger; the amplitude in %."""
    law = x.pick("linear", "stiffening", "softening", "with_damping")
    return _compliance(x, "drive_stages", law, (x.uniform(0.5, 1), x.uniform(1, 3)), 0.04, 0.8, 5.0)


def linkage_compliance(x: Context) -> Law:
    """Give in the coupling of the distal joint; the amplitude in rad."""
    law = x.pick("linear", "stiffening", "with_damping")
    return _compliance(x, "distal_stages", law, (x.uniform(0.4, 0.9), x.uniform(1, 3)), 0.05, 0.015, 0.08)


def coupling_deadband(x: Context) -> Law:
    """The distal joint rests up to a proximal angle; the amplitude in rad."""
    law = x.pick("hard", "rounded")

    def hide(machine: Machine, amplitude: float) -> None:
        s = 0.12 * amplitude
        if law == "hard":
            machine.coupling_stages.append(lambda angle, truth: np.maximum(angle - amplitude, 0))
        else:
            machine.coupling_stages.append(lambda angle, truth: s * np.logaddexp(0, (angle - amplitude) / s))

    return Law({"law": law}, hide, 0.1, 0.5)


def distal_stop(x: Context) -> Law:
    """The distal joint stops early; the amplitude is what is missing, rad."""
    law, soft = x.pick("hard", "elastic", "rounded"), x.uniform(0.1, 0.3)
    slope = soft if law == "elastic" else 0.0

    def hide(machine: Machine, amplitude: float) -> None:
        top = x.finger.full[1] - amplitude

        def stop(angle: np.ndarray, truth: Truth) -> np.ndarray:
            over = angle - top
            if law == "rounded":
                return angle - 0.015 * np.logaddexp(0, over / 0.015)
            return np.where(over > 0, top + slope * over, angle)

        machine.distal_stages.append(stop)

    return Law({"law": law, "slope_beyond": slope}, hide, 0.12, 0.6)


def spring_decoupling(x: Context) -> Law:
    """The finger does not follow the opening drive: its weight holds it below an angle (the amplitude, rad), or the
    spring brings it back slowly (s), everywhere or where it is little stretched."""
    law = x.pick("weight_holds", "slow_return", "slow_return_free_part")
    x.uniform(0.02, 0.05)  # a draw that came to nothing, kept so that seeds mean what they meant
    free = x.uniform(0.35, 0.9)

    def hide(machine: Machine, amplitude: float) -> None:
        def held(angle: np.ndarray, truth: Truth) -> np.ndarray:
            return amplitude + 0.012 * np.logaddexp(0, (angle - amplitude) / 0.012)

        def slow(angle: np.ndarray, truth: Truth) -> np.ndarray:
            return lag(angle, H, 0, amplitude)

        def slow_below(angle: np.ndarray, truth: Truth) -> np.ndarray:
            return np.where(angle < free, lag(np.minimum(angle, free), H, 0, amplitude), angle)

        stages = {"weight_holds": held, "slow_return": slow, "slow_return_free_part": slow_below}
        machine.proximal_stages.append(stages[law])
        if law == "weight_holds":
            spring = x.p["K_"] * Q_GRID + x.p["TAU0"]
            above = 1 + np.exp(np.clip((x.finger.proximal(Q_GRID) - amplitude) / 0.02, -60, 60))
            machine.plant.load_q -= 0.3 * spring / above

    limits = {"weight_holds": (0.1, 0.45), "slow_return": (0.03, 0.25), "slow_return_free_part": (0.05, 0.4)}
    return Law({"law": law, "below_angle": free if law.endswith("part") else None}, hide, *limits[law])


def joint_wobble(x: Context) -> Law:
    """The axis of a joint tilts; the amplitude in rad."""
    law, s = x.pick("swing", "bow", "by_direction", "by_load"), x.pick(0, 1)
    tilt = across(x.rng.normal(size=3), x.finger.axes[s])
    waves, phase = x.uniform(0.8, 1.7), x.uniform(0, 6.28)

    def course(angle: np.ndarray, truth: Truth) -> np.ndarray:
        match law:
            case "swing":
                return np.sin(2 * np.pi * waves * angle / 1.2 + phase)
            case "bow":
                return 4 * (angle / 1.2) * (1 - angle / 1.2)
            case "by_direction":
                return truth["direction"]
        spring = 0.4 + 0.6 * np.clip(truth["q"], 0, 100) / 100
        return truth["direction"] * spring + 0.25 * truth["v"] / 60

    def hide(machine: Machine, amplitude: float) -> None:
        def pose(angle: np.ndarray, truth: Truth) -> tuple[np.ndarray, np.ndarray]:
            return amplitude * course(angle, truth)[:, None] * tilt, np.zeros((len(angle), 3))

        machine.pose[s].append(pose)

    return Law({"law": law, "joint": SEGMENTS[s], "axis": tilt.tolist()}, hide, 0.015, 0.09)


def moving_centre(x: Context) -> Law:
    """The centre of a joint moves; the amplitude in m."""
    law, s = x.pick("rolling", "cam", "worn_slot", "along_bone"), x.pick(0, 1)
    e1 = across(np.array([1, 0, 0.0]), x.finger.axes[s])
    e2 = np.cross(x.finger.axes[s], e1)
    phase = x.uniform(0, 6.28)

    def path(angle: np.ndarray, truth: Truth) -> np.ndarray:
        match law:
            case "rolling":
                return angle[:, None] * e1 + (1 - np.cos(1.5 * angle))[:, None] * e2
            case "cam":
                turned = 3.2 * angle + phase
                return np.cos(turned)[:, None] * e1 + 0.6 * np.sin(turned)[:, None] * e2
            case "worn_slot":
                return truth["direction"][:, None] * (np.cos(phase) * e1 + np.sin(phase) * e2)
        return (angle**2)[:, None] * e1

    def hide(machine: Machine, amplitude: float) -> None:
        def pose(angle: np.ndarray, truth: Truth) -> tuple[np.ndarray, np.ndarray]:
            return np.zeros((len(angle), 3)), amplitude * path(angle, truth)

        machine.pose[s].append(pose)

    return Law({"law": law, "joint": SEGMENTS[s]}, hide, 4e-4, 4e-3)
