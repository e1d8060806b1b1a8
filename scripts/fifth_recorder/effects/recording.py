"""Faults of the drive and of the log."""

import numpy as np

from fifth_recorder.effects.option import Context, Draw, Option, log_uniform, pick, set_dynamics
from fifth_recorder.plan import Plan, Rows, Signals
from fifth_recorder.stepper import lag


def drive_sag(rng: np.random.Generator, ctx: Context) -> Option:
    """The drive delivers less as it is loaded; a speed loop's integral would make up for all but the first form."""
    forms = ("speed_falls", "supply_dips", "limit_leaks")
    form, number = pick(rng, forms[:1] if ctx.lab.controller == "speed_loop" else forms)
    size = (rng.uniform(0.07, 0.2), rng.uniform(0.12, 0.3), rng.uniform(0.3, 0.7))[int(number)]
    scaled = {("sag_speed", "sag_gain", "sag_leak")[int(number)]: size}
    fixed = {"sag_from": rng.uniform(30, 50)} if number == 2 else {}
    return Option(form, lambda plan, strength: set_dynamics(plan, min(strength, 0.9 / size), scaled, fixed), drive=True)


def command_delay(rng: np.random.Generator, _: Context) -> Option:
    """The drive acts later than told."""
    form, _ = pick(rng, ("fixed", "jittered"))
    delay = rng.uniform(0.04, 0.12)

    def apply(plan: Plan, strength: float) -> dict:
        jitter = plan.lab.log_step if form == "jittered" else 0.0
        plan.delay.append(
            lambda trial: strength * (delay + trial.rng(31).uniform(-0.5, 0.5, len(trial.moves)) * jitter)
        )
        return {"delay_s": delay * strength, "jitter_s": jitter * strength}

    return Option(form, apply, drive=True)


def current_saturation(rng: np.random.Generator, ctx: Context) -> Option:
    """The current reading, or the drive, clips. The strength is the share that is cut of what exceeds the ceiling."""
    form, _ = pick(rng, ("reading_clips", "drive_clips", "reading_clips_softly"))
    motor = ctx.finger.motor
    top = motor.Fc + motor.tau0 + 100.0 * motor.k + 0.6 * motor.b * ctx.lab.full_speed
    ceiling = top * (rng.uniform(0.93, 0.99) if form == "drive_clips" else rng.uniform(0.72, 0.9))

    def apply(plan: Plan, strength: float) -> dict:
        level = ceiling / max(strength, 1.0) ** 0.25
        share = min(strength, 1.0)

        def clip(signals: Signals) -> None:
            if form == "reading_clips":
                cut = np.clip(signals.u, -level, level)
            else:
                over, width = np.abs(signals.u) - 0.8 * level, 0.2 * level
                cut = np.where(over > 0, np.sign(signals.u) * (0.8 * level + width * np.tanh(over / width)), signals.u)
            signals.u = signals.u + share * (cut - signals.u)

        if form == "drive_clips":
            plan.dyn.ceiling, plan.dyn.ceiling_share = level, share
        else:
            plan.signals.append(clip)
        return {"ceiling_raw": level, "share": share}

    return Option(form, apply, drive=form == "drive_clips")


def current_channel_delay(rng: np.random.Generator, _: Context) -> Option:
    """Current and position of one row are not of one instant."""
    form, _ = pick(rng, ("pure_delay", "low_pass", "position_late"))
    tau = log_uniform(rng, 0.03, 0.10)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(signals: Signals) -> None:
            if form == "low_pass":
                signals.u = lag(signals.u, tau * strength)
            elif form == "pure_delay":
                signals.u = np.interp(signals.t - tau * strength, signals.t, signals.u)
            else:
                signals.x = np.interp(signals.t - tau * strength, signals.t, signals.x)
                signals.late = tau * strength

        plan.signals.append(hook)
        return {"seconds": tau * strength}

    return Option(form, apply)


def command_as_measurement(rng: np.random.Generator, _: Context) -> Option:
    """A channel said to be measured is a command, or dead."""
    form, _ = pick(
        rng,
        (
            "current_is_controller",
            "current_is_setpoint_step",
            "current_is_dead",
            "position_is_setpoint",
            "position_is_reference",
        ),
    )
    level = float(rng.integers(0, 40))

    def apply(plan: Plan, strength: float) -> dict:
        def hook(rows: Rows) -> None:
            low, high = plan.finger.counts
            if form == "current_is_dead":
                rows.current = np.full(len(rows.current), level)
            elif form == "position_is_setpoint":
                rows.position = rows.setpoint.copy()
            elif form == "current_is_setpoint_step":
                towards = np.sign(rows.setpoint - 0.5 * (low + high))
                rows.current = towards * rows.speed * 100.0 / plan.lab.speed_full

        def signal(signals: Signals) -> None:
            if form == "current_is_controller":
                signals.u = 1.2 * np.clip(signals.setpoint - signals.x, -80.0, 80.0)
            elif form == "position_is_reference":
                signals.x = signals.xref.copy()

        plan.signals.append(signal)
        plan.rows.append(hook)
        return {"level": level, "share": strength}

    return Option(form, apply, capped=False)


def clock_drift(rng: np.random.Generator, _: Context) -> Option:
    """The log's clock runs at another rate."""
    rate = rng.choice([-1, 1]) * log_uniform(rng, 0.0008, 0.003)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(rows: Rows) -> None:
            rows.time = rows.time * (1.0 + rate * strength)

        plan.rows.append(hook)
        return {"rate": 1.0 + rate * strength}

    form, _ = pick(rng, ("this_finger", "both_fingers"))
    return Option(form, apply)


RECORDING: dict[str, Draw] = {
    "drive_sag": drive_sag,
    "command_delay": command_delay,
    "current_saturation": current_saturation,
    "current_channel_delay": current_channel_delay,
    "command_as_measurement": command_as_measurement,
    "clock_drift": clock_drift,
}
