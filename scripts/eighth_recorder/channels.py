"""Effects of encoder, drive electronics and log."""

import numpy as np

from eighth_recorder.effect import Effect, either, law_of
from eighth_recorder.simulate import GRID


class EncoderPeriodic(Effect):
    name = "encoder_periodic_error"
    part = "log"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("reading only", 0.5), ("inside the position loop", 0.5))
        period = rng.uniform(300, 1500)
        return {
            "law": law,
            "amplitude_counts": strength * rng.uniform(16, 38),
            "period_counts": period,
            "phase": rng.uniform(0, 2 * np.pi),
        }

    def motor(self, p, run):
        if p["law"] != "reading only":
            scale = 100 / (run.finger.counts[1] - run.finger.counts[0])
            run.constants.update(
                enc_amp=p["amplitude_counts"] * scale, enc_period=p["period_counts"] * scale, enc_phase=p["phase"]
            )

    def log(self, p, run):
        if p["law"] == "reading only":
            true = run.rows["position"] - run.finger.counts[0]
            run.rows["position"] = run.rows["position"] + p["amplitude_counts"] * np.sin(
                2 * np.pi * true / p["period_counts"] + p["phase"]
            )


class DriveSag(Effect):
    name = "drive_sag"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("load, with a time constant", 0.7), ("back-EMF", 0.3))
        return {"law": law, "loss": strength * rng.uniform(0.22, 0.4), "time_constant": rng.uniform(0.15, 2.5)}

    def motor(self, p, run):
        if p["law"] == "back-EMF":
            run.constants["emf"] = 0.7 * p["loss"]
        else:
            run.constants.update(sag=p["loss"], sag_tau=p["time_constant"])


class CommandDelay(Effect):
    name = "command_delay"
    part = "log"

    def draw(self, rng, strength, finger, hand):
        return {"law": "setpoints act later", "seconds": strength * rng.uniform(0.06, 0.16)}

    def motor(self, p, run):
        late = round(p["seconds"] / GRID)
        for name in ("target", "pace"):
            row = run.inputs[name]
            run.inputs[name] = np.concatenate([np.full(late, row[0]), row[: len(row) - late]])


class CurrentSaturation(Effect):
    name = "current_saturation"

    def draw(self, rng, strength, finger, hand):
        law = law_of(rng, ("reading clips", 0.75), ("drive clips", 0.25))
        motor = finger.motor
        still = motor["Fc"] + 97 * motor["k"] + motor["tau0"]
        most = still + 100 * motor["b"]
        level = (
            most * (1 - strength * rng.uniform(0.12, 0.26))
            if law == "reading clips"
            else most - strength * (most - still) * rng.uniform(0.6, 0.95)
        )
        return {"law": law, "level": level + 3 * finger.current_noise * (1 - strength) ** 2}

    def motor(self, p, run):
        if p["law"] == "drive clips":
            run.constants["limit"] = p["level"]

    def lines(self, p, run):
        if p["law"] == "reading clips":
            run.rows["current"] = np.clip(run.rows["current"], -round(p["level"]), round(p["level"]))


class CurrentDelay(Effect):
    name = "current_channel_delay"
    part = "log"

    def draw(self, rng, strength, finger, hand):
        sign = 1 if rng.random() < 0.8 else -1
        return {"law": "constant lag", "seconds": strength * sign * rng.uniform(0.03, 0.08)}

    def log(self, p, run):
        run.rows["current"] = run.at(run.current, run.true_time - p["seconds"])


class CommandAsMeasurement(Effect):
    name = "command_as_measurement"
    part = "log"
    alone = True
    clashes = ("encoder_periodic_error", "current_saturation", "current_channel_delay", "marker_swap")

    def draw(self, rng, strength, finger, hand):
        law = law_of(
            rng, ("position is the reference", 0.35), ("current is dead", 0.4), ("current is the signed limit", 0.25)
        )
        return {"law": law, "channel": law.split()[0], "value": float(rng.integers(-3, 12))}

    def log(self, p, run):
        channel = p["channel"]
        run.noise[channel] = np.zeros(len(run.true_time))
        if channel == "position":
            low, high = run.finger.counts
            run.rows["position"] = low + run.at(run.reference, run.true_time) * (high - low) / 100
        elif "dead" in p["law"]:
            run.rows["current"] = np.full(len(run.true_time), p["value"])
        else:
            moving = np.interp(run.true_time, run.time, run.inputs["target"] - run.reference)
            run.rows["current"] = np.where(np.abs(moving) > 1e-6, 100.0 * np.sign(moving), 0.0)


class ClockDrift(Effect):
    name = "clock_drift"
    part = "log"

    def draw(self, rng, strength, finger, hand):
        return {"law": "constant rate", "rate": 1 + strength * either(rng) * rng.uniform(0.0009, 0.0022)}

    def lines(self, p, run):
        run.stamp = run.stamp * p["rate"]


CHANNELS = (
    EncoderPeriodic(),
    DriveSag(),
    CommandDelay(),
    CurrentSaturation(),
    CurrentDelay(),
    CommandAsMeasurement(),
    ClockDrift(),
)
