"""Effects that load the drive: springs, stops, contacts, weight, ripple."""

import numpy as np

from eighth_recorder.effect import Effect, either, law_of

POWER = {"linear": 1.0, "hunt-crossley": 1.5}


class Detent(Effect):
    name = "detent_load"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("bump", 0.7), ("notch", 0.3))
        return {
            "law": law,
            "amplitude": strength * either(rng) * rng.uniform(0.35, 0.7),
            "centre": rng.uniform(22, 78),
            "width": rng.uniform(4, 9),
        }

    def motor(self, p, run):
        run.constants.update(
            detent_amp=p["amplitude"] * run.constants["Fc"],
            detent_c=p["centre"],
            detent_w=p["width"],
            detent_law=float(p["law"] == "notch"),
        )


class NonlinearSpring(Effect):
    name = "nonlinear_spring"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("cubic", 0.65), ("quadratic", 0.35))
        sign = 1 if rng.random() < 0.75 else -1
        return {"law": law, "at_full_range": strength * sign * rng.uniform(0.5, 1.0)}

    def motor(self, p, run):
        run.constants["k3" if p["law"] == "cubic" else "k2"] = p["at_full_range"] * run.constants["Fc"] / 100


class Gravity(Effect):
    name = "gravity_load"

    def draw(self, rng, strength, finger, hand):
        if strength > 0.2:
            hand.pose_matters = True
        where = [rng.uniform(30, 45), 0.0, rng.uniform(8, 20)]
        return {
            "law": "mass on the proximal segment, palm pose per trial",
            "amplitude": strength * rng.uniform(0.3, 0.6),
            "centre_of_mass_mm": where,
        }

    def motor(self, p, run):
        """Moment about the first axis of a weight fixed to the proximal segment, as c cos + s sin of its angle."""
        axis = run.finger.axes[0]
        down = run.palm_turn.T @ np.array([0, 0, -1.0])
        arm = np.array(p["centre_of_mass_mm"])
        arm = arm / np.linalg.norm(arm)
        flat = arm - axis * (axis @ arm)
        peak = p["amplitude"] * run.constants["Fc"]
        run.inputs["gc"] += -peak * (np.cross(flat, down) @ axis)
        run.inputs["gs"] += -peak * (np.cross(np.cross(axis, flat), down) @ axis)


class Ripple(Effect):
    name = "torque_ripple"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("sine", 0.7), ("two harmonics", 0.3))
        return {
            "law": law,
            "amplitude": strength * rng.uniform(0.13, 0.27),
            "period": rng.uniform(3.5, 13),
            "phase": rng.uniform(0, 2 * np.pi),
            "second": 0.4 * (law != "sine"),
        }

    def motor(self, p, run):
        run.constants.update(
            ripple_amp=p["amplitude"] * run.constants["Fc"],
            ripple_period=p["period"],
            ripple_phase=p["phase"],
            ripple_second=p["second"],
        )


class Viscoelastic(Effect):
    name = "viscoelastic_spring"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("standard linear solid", 0.7), ("two branches", 0.3))
        return {
            "law": law,
            "stiffness": strength * rng.uniform(0.6, 1.1),
            "relaxation": rng.uniform(0.8, 4.5),
            "second_relaxation": rng.uniform(0.2, 0.6),
        }

    def motor(self, p, run):
        extra = p["stiffness"] * run.constants["k"]
        share = 1.0 if p["law"] == "standard linear solid" else 0.6
        run.constants.update(
            relax_ka=extra * share,
            relax_kb=extra * (1 - share),
            relax_ta=p["relaxation"],
            relax_tb=p["second_relaxation"],
        )


class EndStop(Effect):
    name = "end_stop_contact"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("linear", 0.6), ("hunt-crossley", 0.4))
        end = "flexion" if rng.random() < 0.8 else "extension"
        depth = rng.uniform(8, 16)
        return {
            "law": law,
            "end": end,
            "at": 97 - depth if end == "flexion" else 1 + depth,
            "stiffness": strength * rng.uniform(0.7, 1.3) / depth ** POWER[law],
            "damping": rng.uniform(0.0005, 0.003),
        }

    def motor(self, p, run):
        stiffness = p["stiffness"] * run.constants["Fc"]
        run.constants.update(stop_n=POWER[p["law"]], stop_c=p["damping"])
        run.constants.update(
            {"stop_at": p["at"], "stop_k": stiffness}
            if p["end"] == "flexion"
            else {"low_stop_at": p["at"], "low_stop_k": stiffness}
        )


class ExternalContact(Effect):
    name = "external_contact"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("linear", 0.4), ("hunt-crossley", 0.6))
        start, at = rng.uniform(0.1, 0.45), rng.uniform(45, 75)
        return {
            "law": law,
            "at": at,
            "stiffness": strength * rng.uniform(0.6, 1.1) / (97 - at) ** POWER[law],
            "damping": rng.uniform(0.0005, 0.003),
            "from": start,
            "until": start + rng.uniform(0.3, 0.5),
        }

    def motor(self, p, run):
        run.constants.update(
            touch_at=p["at"],
            touch_k=p["stiffness"] * run.constants["Fc"],
            touch_n=POWER[p["law"]],
            touch_c=p["damping"],
        )
        share = run.time / run.length
        run.inputs["gate"] = np.maximum(run.inputs["gate"], ((share > p["from"]) & (share < p["until"])).astype(float))


LOADS = (Detent(), NonlinearSpring(), Gravity(), Ripple(), Viscoelastic(), EndStop(), ExternalContact())
