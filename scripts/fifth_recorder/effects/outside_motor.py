"""Things that no row of the table describes: in the drive and its load. Amplitudes raw."""

import numpy as np

from fifth_recorder.effects.option import Context, Draw, Option
from fifth_recorder.plan import Plan, Rows, Signals, Trial
from fifth_recorder.stepper import Drive


def _load(form: str, size: float, shape) -> Option:
    """A load `size` * shape(trial, t), whatever the motion."""

    def apply(plan: Plan, strength: float) -> dict:
        def hook(drive: Drive, trial: Trial, t: np.ndarray) -> None:
            drive.load += strength * size * shape(trial, t)

        plan.drive.append(hook)
        return {"raw": strength * size}

    return Option(form, apply)


def periodic_in_time(rng: np.random.Generator, _: Context) -> Option:
    """A load that beats in time: a pump or fan beside the rig."""
    f = rng.uniform(0.6, 3.5)
    return _load(f"{f:.2f} Hz", rng.uniform(5, 10), lambda trial, t: np.sin(2 * np.pi * f * (t + trial.at)))


def spring_hook_slips(rng: np.random.Generator, _: Context) -> Option:
    """The spring's preload steps in the middle of one trial, and stays so."""
    size, share, first = rng.choice([-1, 1]) * rng.uniform(7, 14), rng.uniform(0.3, 0.7), int(rng.integers(2))

    def shape(trial: Trial, t: np.ndarray) -> np.ndarray:
        return (
            np.where(t > share * trial.end, 1.0, 0.0)
            if trial.index == first
            else np.full(len(t), float(trial.index > first))
        )

    return _load("preload_step", size, shape)


def spring_strand_breaks(rng: np.random.Generator, _: Context) -> Option:
    """One strand of the return spring breaks: its rate falls from some trial on."""
    loss, first = rng.uniform(0.35, 0.6), int(rng.integers(1, 3))

    def apply(plan: Plan, strength: float) -> dict:
        def hook(drive: Drive, trial: Trial, _: np.ndarray) -> None:
            drive.spring += -strength * loss * plan.dyn.k * (trial.index >= first)

        plan.drive.append(hook)
        return {"share_lost": loss * strength, "from_trial": first}

    return Option("rate_step", apply)


def grit(rng: np.random.Generator, _: Context) -> Option:
    """Grit in the gear: short pulses of friction at random moments."""
    size, every, width = rng.uniform(25, 45), rng.uniform(1.2, 3.0), rng.uniform(0.05, 0.15)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(drive: Drive, trial: Trial, t: np.ndarray) -> None:
            r = trial.rng(41)
            for at in r.uniform(0, trial.end, r.poisson(trial.end / every)):
                drive.friction += strength * size * r.uniform(0.5, 1.5) * np.exp(-0.5 * ((t - at) / width) ** 2)

        plan.drive.append(hook)
        return {"raw": size * strength, "every_s": every, "width_s": width}

    return Option("random_pulses", apply)


def neighbour_knocks(rng: np.random.Generator, _: Context) -> Option:
    """Somebody knocks at the bench: short swinging loads of both signs at random moments."""
    f, decay, every = rng.uniform(3, 8), rng.uniform(0.15, 0.4), rng.uniform(2, 5)

    def shape(trial: Trial, t: np.ndarray) -> np.ndarray:
        r = trial.rng(42)
        out = np.zeros(len(t))
        for at in r.uniform(0, trial.end, r.poisson(trial.end / every) + 1):
            late = np.maximum(t - at, 0)
            out += r.choice([-1, 1]) * np.exp(-late / decay) * np.sin(2 * np.pi * f * late)
        return out

    return _load("ringing", rng.uniform(15, 30), shape)


def supply_wander(rng: np.random.Generator, _: Context) -> Option:
    """The current sensor's zero wanders slowly without regard to anything."""
    size, times = rng.uniform(3, 6), rng.uniform(4, 12)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(signals: Signals) -> None:
            r = signals.trial.rng(43)
            knots = np.arange(0, signals.t[-1] + times, times / 2)
            signals.u = signals.u + strength * size * np.interp(signals.t, knots, r.normal(0, 1, len(knots)))

        plan.signals.append(hook)
        return {"raw": size * strength, "times_s": times}

    return Option("zero_wanders", apply)


def current_hum(rng: np.random.Generator, _: Context) -> Option:
    """Mains hum in the current channel."""
    size, f, phase = rng.uniform(4, 8), rng.choice([50.0, 60.0]), rng.uniform(0, 6.28)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(signals: Signals) -> None:
            signals.u = signals.u + strength * size * np.sin(2 * np.pi * f * signals.t + phase)

        plan.signals.append(hook)
        return {"raw": size * strength, "hz": float(f)}

    return Option("hum", apply)


def current_dead_zone(rng: np.random.Generator, _: Context) -> Option:
    """The current sensor shows nothing below a threshold."""
    threshold = rng.uniform(10, 22)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(signals: Signals) -> None:
            small = np.abs(signals.u) < threshold * max(strength, 1.0)
            signals.u = np.where(small, signals.u * (1.0 - min(strength, 1.0)), signals.u)

        plan.signals.append(hook)
        return {"threshold_raw": threshold * max(strength, 1.0)}

    return Option("reads_zero", apply)


def frozen_rows(rng: np.random.Generator, _: Context) -> Option:
    """The current sensor holds its last value for some tenths of a second, now and then."""
    length, every = rng.uniform(0.2, 0.6), rng.uniform(2.0, 4.0)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(rows: Rows) -> None:
            r = rows.trial.rng(44)
            current = rows.current.copy()
            for at in r.uniform(0, rows.trial.end, r.poisson(rows.trial.end / every) + 1):
                span = np.flatnonzero((rows.time >= at) & (rows.time < at + length * strength))
                current[span] = current[span[0]] if len(span) else 0.0
            rows.current = current

        plan.rows.append(hook)
        return {"seconds": length * strength, "every_s": every}

    return Option("holds", apply)


def bus_bursts(rng: np.random.Generator, _: Context) -> Option:
    """Another motor on the bus shows in this one's current, in bursts of its own."""
    size, every, length = rng.uniform(10, 22), rng.uniform(3, 6), rng.uniform(0.4, 1.0)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(signals: Signals) -> None:
            r = signals.trial.rng(45)
            for at in r.uniform(0, signals.t[-1], r.poisson(signals.t[-1] / every) + 1):
                signals.u = signals.u + strength * size * ((signals.t >= at) & (signals.t < at + length))

        plan.signals.append(hook)
        return {"raw": size * strength, "every_s": every, "seconds": length}

    return Option("bursts", apply)


OUTSIDE_MOTOR: dict[str, Draw] = {
    "load_periodic_in_time": periodic_in_time,
    "spring_hook_slips": spring_hook_slips,
    "spring_strand_breaks": spring_strand_breaks,
    "grit_pulses": grit,
    "bench_knocks": neighbour_knocks,
    "current_zero_wanders": supply_wander,
    "mains_hum": current_hum,
    "current_dead_zone": current_dead_zone,
    "frozen_current": frozen_rows,
    "bus_bursts": bus_bursts,
}
