"""Loads that the declared model lacks. Forms are numbered as in stepper.c; amplitudes in raw current units."""

import numpy as np

from fifth_recorder.dynamics import Dynamics
from fifth_recorder.effects.option import Context, Draw, Option, log_uniform, pick, set_dynamics
from fifth_recorder.plan import Motion, Plan, Trial
from fifth_recorder.stepper import Drive


def _dynamic(form: str, scaled: dict[str, float], fixed: dict[str, float]) -> Option:
    return Option(form, lambda plan, strength: set_dynamics(plan, strength, scaled, fixed))


def detent(rng: np.random.Generator, _: Context) -> Option:
    """A load tied to one part of the range."""
    form, number = pick(rng, ("gaussian", "raised_cosine", "smooth_box", "triangle", "dipole"))
    return _dynamic(
        form,
        {"detent_amp": rng.choice([-1, 1]) * log_uniform(rng, 9, 25)},
        {"detent_at": rng.uniform(25, 75), "detent_width": rng.uniform(4, 9), "detent_form": number},
    )


def nonlinear_spring(rng: np.random.Generator, _: Context) -> Option:
    """A return spring that stiffens or softens."""
    form, number = pick(rng, ("cubic", "quadratic", "exponential", "softening"))
    return _dynamic(form, {"spring_amp": log_uniform(rng, 22, 60)}, {"spring_form": number})


def gravity(rng: np.random.Generator, ctx: Context) -> Option:
    """Weight of the finger, or of a glove or marker support off its line, in whatever pose the hand is held."""
    form, glove = pick(rng, ("finger", "glove"))
    form += "_pose_per_trial" if ctx.poses_differ else "_one_pose"
    weight = log_uniform(rng, 10, 25) * (1.0 if ctx.poses_differ else 1.6)
    lean = glove * rng.uniform(0.3, 0.7)
    axis = ctx.finger.axes[0]
    along = ctx.finger.centres[1] - ctx.finger.centres[0]
    along = along - axis * (along @ axis)
    along /= np.linalg.norm(along)
    down = np.cross(axis, along)  # where the fingertip goes first in flexion

    def apply(plan: Plan, strength: float) -> dict:
        def hold(dyn: Dynamics, trial: Trial) -> None:
            pull = trial.pose.T @ np.array([0.0, 0.0, -1.0])
            dyn.gravity_c, dyn.gravity_s = -float(pull @ down), float(pull @ along)

        plan.per_trial.append(hold)
        return set_dynamics(plan, strength, {"gravity": weight}, {"gravity_lean": lean})

    return Option(form, apply)


def ripple(rng: np.random.Generator, _: Context) -> Option:
    """Load periodic in motor position."""
    form, number = pick(rng, ("sine", "second_harmonic", "grows_with_load"))
    return _dynamic(
        form,
        {"ripple_amp": log_uniform(rng, 4, 12)},
        {
            "ripple_period": log_uniform(rng, 4, 14),
            "ripple_phase": rng.uniform(0, 2 * np.pi),
            "ripple_second": rng.uniform(0.3, 0.7) if number == 1 else 0.0,
            "ripple_by_load": float(number == 2),
        },
    )


def hysteresis(rng: np.random.Generator, _: Context) -> Option:
    """Load that builds up over a distance after each reversal."""
    form, number = pick(rng, ("elastoplastic", "exponential", "bouc_wen"))
    return _dynamic(
        form, {"hyst_amp": log_uniform(rng, 10, 28)}, {"hyst_distance": rng.uniform(6, 25), "hyst_form": number}
    )


def viscoelastic(rng: np.random.Generator, _: Context) -> Option:
    """A spring that relaxes."""
    form, number = pick(rng, ("standard_linear_solid", "two_times", "slow_creep"))
    tau = rng.uniform(5, 15) if number == 2 else rng.uniform(0.4, 2.0)
    return _dynamic(
        form,
        {"relax_amp": log_uniform(rng, 15, 40)},
        {
            "relax_time": tau,
            "relax_time2": rng.uniform(5, 15),
            "relax_second": rng.uniform(0.3, 0.6) if number == 1 else 0.0,
        },
    )


def end_stop(rng: np.random.Generator, _: Context) -> Option:
    """An elastic stop within the range."""
    form, number = pick(rng, ("linear", "quadratic", "exponential"))
    low = rng.random() < 0.25
    return _dynamic(
        form,
        {"stop_amp": log_uniform(rng, 20, 50)},
        {
            "stop_at": rng.uniform(8, 14) if low else rng.uniform(80, 90),
            "stop_depth": rng.uniform(6, 9),
            "stop_form": number,
            "stop_low": float(low),
        },
    )


def external_contact(rng: np.random.Generator, _: Context) -> Option:
    """An obstacle: in the way of some strokes or trials, at the fingertip (which then yields) or further back."""
    form, number = pick(rng, ("some_trials_tip", "some_trials", "while_tip", "while"))
    at, amp = rng.uniform(35, 75), log_uniform(rng, 25, 60)
    which, share = int(rng.integers(2)), rng.uniform(0.25, 0.6, 2)
    tip = rng.uniform(0.004, 0.008) if form.endswith("tip") else 0.0  # rad per raw

    def there(drive: Drive, trial: Trial, t: np.ndarray) -> None:
        if form.startswith("some"):
            drive.contact += float(trial.index % 2 == which)
        else:
            begin = share[0] * trial.end
            drive.contact += np.clip((t - begin) / 0.3, 0, 1) * np.clip((begin + share[1] * trial.end - t) / 0.3, 0, 1)

    def apply(plan: Plan, strength: float) -> dict:
        def give(motion: Motion) -> None:
            motion.q2 = motion.q2 - tip * motion.contact

        plan.drive.append(there)
        if tip:
            plan.distal.append(give)
        figures = set_dynamics(plan, strength, {"touch_amp": amp}, {"touch_at": at, "touch_depth": 100.0 - at})
        return figures | {"tip_rad_per_raw": tip, "parity": which, "share": share.tolist()}

    return Option(form, apply)


LOADS: dict[str, Draw] = {
    "detent_load": detent,
    "nonlinear_spring": nonlinear_spring,
    "gravity_load": gravity,
    "torque_ripple": ripple,
    "elastoplastic_hysteresis": hysteresis,
    "viscoelastic_spring": viscoelastic,
    "end_stop_contact": end_stop,
    "external_contact": external_contact,
}
