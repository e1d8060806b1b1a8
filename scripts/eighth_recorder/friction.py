"""Effects of dry and viscous friction in the drive."""

from eighth_recorder.effect import Effect, either, law_of


class Stribeck(Effect):
    name = "stribeck_friction"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("exponential", 0.6), ("gaussian", 0.25), ("reciprocal", 0.15))
        ratio = 1 + strength * (rng.uniform(1.5, 2.0) - 1)
        speed = rng.uniform(14, 32) * {"exponential": 1.0, "gaussian": 1.4, "reciprocal": 0.6}[law]
        return {"law": law, "static_ratio": ratio, "stribeck_speed": speed}

    def motor(self, p, run):
        laws = {"exponential": 0.0, "gaussian": 1.0, "reciprocal": 2.0}
        run.constants.update(
            stri_amp=run.constants["Fc"] * (p["static_ratio"] - 1), stri_v=p["stribeck_speed"], stri_law=laws[p["law"]]
        )


class AsymmetricViscous(Effect):
    name = "asymmetric_viscous_friction"

    def draw(self, rng, strength, finger, hand):
        return {"law": "two slopes", "difference": strength * either(rng) * rng.uniform(0.45, 0.8)}

    def motor(self, p, run):
        run.constants["b_asym"] = p["difference"] * run.constants["b"]


class Asymmetric(Effect):
    name = "asymmetric_friction"

    def draw(self, rng, strength, finger, hand):
        return {"law": "two levels", "asymmetry": strength * either(rng) * rng.uniform(0.2, 0.4)}

    def motor(self, p, run):
        run.constants["asym"] = p["asymmetry"]


class LoadDependent(Effect):
    name = "load_dependent_friction"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("share of the load", 0.7), ("screw efficiency, forward and back", 0.3))
        forward = strength * rng.uniform(0.3, 0.6)
        return {
            "law": law,
            "coefficient": forward,
            "backward": forward * (1.0 if law == "share of the load" else rng.uniform(0.4, 0.7)),
        }

    def motor(self, p, run):
        run.constants.update(mu_flex=p["coefficient"], mu_extend=p["backward"])


class TightSpot(Effect):
    name = "position_dependent_friction"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("gaussian", 0.75), ("raised cosine", 0.25))
        return {
            "law": law,
            "amplitude": strength * rng.uniform(0.5, 1.0),
            "centre": rng.uniform(25, 75),
            "width": rng.uniform(4.5, 10),
        }

    def motor(self, p, run):
        run.constants.update(
            tight_amp=p["amplitude"] * run.constants["Fc"],
            tight_c=p["centre"],
            tight_w=p["width"],
            tight_law=float(p["law"] != "gaussian"),
        )


class Quadratic(Effect):
    name = "quadratic_damping"

    def draw(self, rng, strength, finger, hand):
        return {"law": "v|v|", "coefficient": strength * rng.uniform(0.0013, 0.0026)}

    def motor(self, p, run):
        run.constants["quad"] = p["coefficient"]


class Presliding(Effect):
    name = "presliding_friction"

    def draw(self, rng, strength, finger, hand):
        return {"law": "bristle", "give": finger.motor["bristle_x"] + strength * rng.uniform(0.8, 2.0)}

    def motor(self, p, run):
        run.constants["bristle_x"] = p["give"]


class Thermal(Effect):
    name = "thermal_friction_drift"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("power", 0.5), ("time", 0.5))
        rest = law_of(rng, ("kept between trials", 0.5), ("cold at each trial", 0.5))
        sign = -1 if rng.random() < 0.8 else 1
        return {
            "law": law,
            "rest": rest,
            "change": strength * sign * rng.uniform(0.25, 0.45),
            "time_constant": rng.uniform(18, 60),
            "power": rng.uniform(1500, 2200),
        }

    def motor(self, p, run):
        if p["rest"] != "kept between trials":
            run.state.heat = 0.0
        run.constants.update(
            thermal=p["change"], heat_tau=p["time_constant"], heat_law=float(p["law"] == "power"), heat_power=p["power"]
        )


class Hysteresis(Effect):
    name = "elastoplastic_hysteresis"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("dahl", 0.5), ("maxwell slip", 0.5))
        return {
            "law": law,
            "amplitude": strength * rng.uniform(0.35, 0.65),
            "distance": rng.uniform(4, 12) * (1.0 if law == "dahl" else 2.0),
        }

    def motor(self, p, run):
        run.constants.update(
            slip_amp=p["amplitude"] * run.constants["Fc"], slip_x=p["distance"], slip_law=float(p["law"] != "dahl")
        )


FRICTION = (
    Stribeck(),
    AsymmetricViscous(),
    Asymmetric(),
    LoadDependent(),
    TightSpot(),
    Quadratic(),
    Presliding(),
    Thermal(),
    Hysteresis(),
)
