"""What is lost between encoder, proximal and distal segment. Distances in shares of the range or rad."""

import numpy as np

from fifth_recorder.effects.option import Context, Draw, Option, pick
from fifth_recorder.plan import Motion, Plan, Trial
from fifth_recorder.stepper import Drive, lag, memory, play


def soft_play(x: np.ndarray, width: float) -> np.ndarray:
    """Lost motion whose edges are soft: the mean of several plays from none to twice the width."""
    return np.mean([play(x, width * q) for q in np.linspace(0.1, 1.9, 7)], axis=0)


def _lost(kind: str, x: np.ndarray, width: float) -> np.ndarray:
    if kind == "sharp":
        return play(x, width)
    if kind == "soft":
        return soft_play(x, width)
    return x - 0.5 * width * memory(x, 3.0 * width)


def drive_backlash(rng: np.random.Generator, _: Context) -> Option:
    """Lost motion between encoder and proximal segment."""
    form, _ = pick(rng, ("sharp", "soft", "hysteresis_in_angle"))
    width = rng.uniform(0.008, 0.022)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(motion: Motion) -> None:
            if form == "hysteresis_in_angle":
                motion.s = motion.s - 0.5 * width * strength * memory(motion.s, 0.05)
            else:
                motion.s = _lost(form, motion.s, width * strength)

        plan.input.append(hook)
        return {"width_share": width * strength}

    return Option(form, apply, joint="proximal")


def _give(load: np.ndarray, form: str) -> np.ndarray:
    return 60.0 * np.tanh(load / 60.0) if form == "stiffening" else load


def series_elasticity(rng: np.random.Generator, _: Context) -> Option:
    """Give between encoder and proximal segment."""
    form, _ = pick(rng, ("linear", "stiffening"))
    give = rng.uniform(0.0003, 0.0009)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(motion: Motion) -> None:
            motion.q1 = motion.q1 - give * strength * _give(motion.load, form)

        plan.proximal.append(hook)
        return {"rad_per_raw": give * strength}

    return Option(form, apply, joint="proximal")


def linkage_backlash(rng: np.random.Generator, _: Context) -> Option:
    """Lost motion between proximal and distal segment."""
    form, _ = pick(rng, ("sharp_distal", "soft_distal", "sharp_in_linkage"))
    width = rng.uniform(0.014, 0.032)

    def apply(plan: Plan, strength: float) -> dict:
        def distal(motion: Motion) -> None:
            motion.q2 = _lost(form.split("_")[0], motion.q2, width * strength)

        def linkage(motion: Motion) -> None:
            motion.link = play(motion.link, width * strength)

        (plan.link if form == "sharp_in_linkage" else plan.distal).append(
            linkage if form == "sharp_in_linkage" else distal
        )
        return {"width_rad": width * strength}

    return Option(form, apply, joint="distal", motor=False)


def linkage_compliance(rng: np.random.Generator, _: Context) -> Option:
    """Give between proximal and distal segment."""
    form, _ = pick(rng, ("linear", "stiffening", "linear_late"))
    give = rng.uniform(0.0004, 0.0011)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(motion: Motion) -> None:
            load = _give(motion.load, form)
            motion.q2 = motion.q2 - give * strength * (lag(load, 0.15) if form == "linear_late" else load)

        plan.distal.append(hook)
        return {"rad_per_raw": give * strength}

    return Option(form, apply, joint="distal", motor=False)


def coupling_deadband(rng: np.random.Generator, ctx: Context) -> Option:
    """The distal segment waits at first."""
    form, _ = pick(rng, ("hard", "rounded", "hard_catching_up"))
    width, round_off = rng.uniform(0.10, 0.30), rng.uniform(0.02, 0.05)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(motion: Motion) -> None:
            q, band = motion.link, width * max(strength, 1.0)
            if form == "hard":
                late = np.maximum(q - band, 0.0)
            elif form == "rounded":
                late = round_off * np.logaddexp(0.0, (q - band) / round_off)
            else:
                late = np.maximum(q - band, 0.0) * ctx.finger.full[0] / (ctx.finger.full[0] - band)
            motion.link = q + min(strength, 1.0) * (late - q)

        plan.link.append(hook)
        return {"band_rad": width * max(strength, 1.0), "share": min(strength, 1.0)}

    return Option(form, apply, joint="distal", motor=False)


def distal_stop(rng: np.random.Generator, ctx: Context) -> Option:
    """The distal segment stops before the proximal one does."""
    form, _ = pick(rng, ("hard", "soft", "springy"))
    top = rng.uniform(0.8, 0.93)

    def apply(plan: Plan, strength: float) -> dict:
        def hook(motion: Motion) -> None:
            q, w, stop = motion.q2, 0.04, 1.0 - (1.0 - top) * max(strength, 1.0)
            stop *= ctx.finger.full[1]
            if form == "hard":
                held = np.minimum(q, stop)
            elif form == "soft":
                held = stop - w * np.logaddexp(0.0, (stop - q) / w)
            else:
                held = np.where(q > stop, stop + 0.15 * (q - stop), q)
            motion.q2 = q + min(strength, 1.0) * (held - q)

        plan.distal.append(hook)
        return {"stop_rad": ctx.finger.full[1] * (1.0 - (1.0 - top) * max(strength, 1.0)), "share": min(strength, 1.0)}

    return Option(form, apply, joint="distal", motor=False)


def spring_decoupling(rng: np.random.Generator, _: Context) -> Option:
    """The finger leaves its actuator in flexion: by weight past some angle, pushed for a while, or slow to return."""
    form, _ = pick(rng, ("weight", "pushed", "slow_return"))
    angle, at, spring = rng.uniform(0.04, 0.10), rng.uniform(0.3, 0.7), rng.uniform(0.2, 0.5)
    begin, tau = rng.uniform(0.2, 0.5, 2), rng.uniform(0.05, 0.12)

    def loose(trial: Trial, t: np.ndarray, s: np.ndarray) -> np.ndarray:
        if form == "weight":
            return np.clip((s - at) / 0.15, 0.0, 1.0)
        window = np.clip((t - begin[0] * trial.end) / 0.4, 0, 1) * np.clip(
            ((begin[0] + begin[1]) * trial.end - t) / 0.4, 0, 1
        )
        return window * np.clip((s - 0.15) / 0.2, 0.0, 1.0)

    def apply(plan: Plan, strength: float) -> dict:
        def leave(motion: Motion) -> None:
            if form == "slow_return":
                motion.s = motion.s + strength * np.maximum(lag(motion.s, tau) - motion.s, 0.0)
            else:
                motion.q1 = motion.q1 + strength * angle * loose(motion.trial, motion.t, motion.s)

        def unload(drive: Drive, trial: Trial, t: np.ndarray) -> None:
            drive.spring += -strength * spring * plan.dyn.k * loose(trial, t, drive.xref / 100.0)

        (plan.input if form == "slow_return" else plan.proximal).append(leave)
        if form == "pushed":
            plan.drive.append(unload)
        return {"rad": angle * strength, "at": at, "tau": tau * strength, "spring_share": spring * strength}

    return Option(form, apply, joint="proximal")


TRANSMISSION: dict[str, Draw] = {
    "drive_backlash": drive_backlash,
    "series_elasticity": series_elasticity,
    "linkage_backlash": linkage_backlash,
    "linkage_compliance": linkage_compliance,
    "coupling_deadband": coupling_deadband,
    "distal_stop": distal_stop,
    "spring_decoupling": spring_decoupling,
}
