"""Loads on the drive that are not friction."""

import numpy as np

from .effect import Effect, Law, Settings, bump, either, spread
from .plan import Plan

Rng = np.random.Generator


def _detent_bell(plan: Plan, s: float, rng: Rng) -> Settings:
    size, centre, width = s * either(rng) * spread(rng, 10, 30), rng.uniform(22, 78), rng.uniform(5, 11)
    plan.add_load(lambda q: size * bump(centre, width)(q))
    return {"raw": size, "centre": centre, "width": width}


def _detent_well(plan: Plan, s: float, rng: Rng) -> Settings:
    size, centre, width = s * spread(rng, 10, 28), rng.uniform(25, 75), rng.uniform(5, 11)
    plan.add_load(lambda q: size * 2.33 * (q - centre) / width * bump(centre, width)(q))
    return {"raw": size, "centre": centre, "width": width, "well": True}


def _spring_cubic(plan: Plan, s: float, rng: Rng) -> Settings:
    size = s * (spread(rng, 25, 65) if rng.random() < 0.7 else -spread(rng, 12, 22))
    plan.add_load(lambda q: size * (np.clip(q, 0, None) / 100) ** 3)
    return {"raw_at_full": size}


def _spring_knee(plan: Plan, s: float, rng: Rng) -> Settings:
    rate, knee = s * spread(rng, 0.35, 1.0), rng.uniform(45, 72)
    plan.add_load(lambda q: rate * np.clip(q - knee, 0, None))
    return {"rate": rate, "knee": knee}


def _weight(distal_share: float) -> Law:
    def law(plan: Plan, s: float, rng: Rng) -> Settings:
        size, finger = s * spread(rng, 25, 60), plan.finger
        up = plan.up_palm
        arm, axis = np.array([1.0, 0.0, 0.0]), finger.axes[0]
        side = np.cross(axis, arm)

        def lift(angle: np.ndarray) -> np.ndarray:
            along = np.cos(angle)[:, None] * arm + np.sin(angle)[:, None] * side
            return np.cross(along, np.broadcast_to(up, along.shape)) @ axis

        def load(q: np.ndarray) -> np.ndarray:
            x = np.clip(q / 100, 0, 1)
            near, far = lift(finger.angle_full[0] * x), lift((finger.angle_full[0] + finger.angle_full[1]) * x)
            return -size * ((1 - distal_share) * near + distal_share * far)

        plan.add_load(load)
        return {"raw": size, "distal_share": distal_share}

    return law


def _ripple(harmonic: float) -> Law:
    def law(plan: Plan, s: float, rng: Rng) -> Settings:
        size, period, phase = s * spread(rng, 4, 12), rng.uniform(4, 14), rng.uniform(0, 2 * np.pi)
        plan.add_load(
            lambda q: (
                size
                * (np.sin(2 * np.pi * q / period + phase) + harmonic * np.sin(4 * np.pi * q / period + 2.1 * phase))
            )
        )
        return {"raw": size, "period": period, "second_harmonic": harmonic}

    return law


def _relaxing(arms: int) -> Law:
    def law(plan: Plan, s: float, rng: Rng) -> Settings:
        size, tau = s * spread(rng, 0.3, 0.9), spread(rng, 0.4, 2.5)
        plan.add("arm1", size / arms)
        plan.drive["arm1_tau"] = tau
        if arms == 2:
            plan.add("arm2", size / 2)
            plan.drive["arm2_tau"] = 6 * tau
        return {"arm": size, "tau": tau, "arms": arms}

    return law


def _stop(loss: float) -> Law:
    def law(plan: Plan, s: float, rng: Rng) -> Settings:
        at, rate = rng.uniform(78, 90), s * spread(rng, 1.5, 5)
        plan.drive |= {"stop_at": at, "stop_k": rate, "stop_c": loss}
        return {"at": at, "rate": rate, "loss": loss}

    return law


def _touch(loss: float) -> Law:
    def law(plan: Plan, s: float, rng: Rng) -> Settings:
        start, at, rate = rng.uniform(0.15, 0.45), rng.uniform(45, 75), s * spread(rng, 0.3, 1.0)
        where = (plan.finger.name + ".", "_b", "_1") if rng.random() < 0.5 else ("flexion",)
        end = start + rng.uniform(0.25, 0.5)
        plan.drive |= {"touch_from": start, "touch_to": end, "touch_at": at, "touch_k": rate, "touch_c": s * loss}
        plan.touch_trials = where
        return {"at": at, "rate": rate, "from": start, "to": end, "trials": list(where)}

    return law


def _lags_spring(plan: Plan, s: float, rng: Rng) -> Settings:
    tau = s * spread(rng, 0.015, 0.04)
    plan.drive |= {"follow_tau": tau, "unload": 0.5 * s}
    return {"follow_tau": tau, "unload": 0.5 * s}


def _rests(plan: Plan, s: float, rng: Rng) -> Settings:
    at = s * spread(rng, 3, 8)
    plan.drive |= {"rest_at": at, "unload": 0.6}
    return {"rest_at": at, "unload": 0.6}


EFFECTS = (
    Effect("detent_load", "current", None, (_detent_bell, _detent_well)),
    Effect("nonlinear_spring", "current", None, (_spring_cubic, _spring_knee)),
    Effect("gravity_load", "current", None, (_weight(0.0), _weight(0.5))),
    Effect("torque_ripple", "current", None, (_ripple(0.0), _ripple(0.5))),
    Effect("viscoelastic_spring", "current", None, (_relaxing(1), _relaxing(2))),
    Effect("end_stop_contact", "current", None, (_stop(0.0), _stop(0.006))),
    Effect("external_contact", "current", None, (_touch(0.0), _touch(0.08))),
    Effect("spring_decoupling", "markers", "proximal", (_lags_spring, _rests)),
)
