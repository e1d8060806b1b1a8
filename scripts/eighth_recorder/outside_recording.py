"""Faults of recording that the vocabulary lacks."""

import numpy as np

from eighth_recorder.effect import Effect, either


class LostCounts(Effect):
    name = "lost_counts"

    def draw(self, rng, strength, finger, hand):
        return {"at": rng.uniform(0.3, 0.7), "counts": strength * either(rng) * rng.uniform(50, 120)}

    def log(self, p, run):
        run.rows["position"] = run.rows["position"] + p["counts"] * (run.true_time > p["at"] * run.length)


class EncoderGainDrift(Effect):
    name = "encoder_gain_drift"

    def draw(self, rng, strength, finger, hand):
        return {"change": strength * either(rng) * rng.uniform(0.012, 0.03)}

    def log(self, p, run):
        low = run.finger.counts[0]
        run.rows["position"] = low + (run.rows["position"] - low) * (1 + p["change"] * run.true_time / run.length)


class GainJump(Effect):
    name = "current_gain_jump"

    def draw(self, rng, strength, finger, hand):
        return {"at": rng.uniform(0.3, 0.7), "gain": 1 + strength * either(rng) * rng.uniform(0.15, 0.3)}

    def log(self, p, run):
        run.rows["current"] = run.rows["current"] * np.where(run.true_time > p["at"] * run.length, p["gain"], 1.0)


class DeadZone(Effect):
    name = "current_dead_zone"

    def draw(self, rng, strength, finger, hand):
        return {"below": strength * rng.uniform(18, 30)}

    def lines(self, p, run):
        current = run.rows["current"]
        run.rows["current"] = np.where(np.abs(current) < p["below"], 0.0, current)


class HeldCurrent(Effect):
    """The current register holds its last value for a while; position goes on."""

    name = "held_current"

    def draw(self, rng, strength, finger, hand):
        return {"rate": rng.uniform(0.3, 0.7), "seconds": strength * rng.uniform(0.12, 0.3)}

    def lines(self, p, run):
        for start in np.cumsum(run.rng.exponential(1 / p["rate"], 200)):
            inside = np.flatnonzero((run.true_time > start) & (run.true_time < start + p["seconds"]))
            if len(inside):
                run.rows["current"][inside] = run.rows["current"][inside[0]]


class WanderingLatency(Effect):
    """Rows are stamped on arrival, and the way to the logger is now longer, now shorter."""

    name = "wandering_latency"

    def draw(self, rng, strength, finger, hand):
        return {"seconds": strength * rng.uniform(0.02, 0.05), "wander": rng.uniform(0.8, 4.0)}

    def lines(self, p, run):
        nodes = np.arange(0, run.length + 3 * p["wander"], p["wander"])
        late = np.interp(run.stamp, nodes, run.rng.uniform(0, 2 * p["seconds"], len(nodes)))
        run.stamp = np.maximum.accumulate(run.stamp + late) + 1e-5 * np.arange(len(late))


class ClockJump(Effect):
    name = "clock_jump"

    def draw(self, rng, strength, finger, hand):
        return {"at": rng.uniform(0.3, 0.7), "seconds": strength * rng.uniform(0.05, 0.15)}

    def lines(self, p, run):
        run.stamp = run.stamp + p["seconds"] * (run.stamp > p["at"] * run.length)


class FramesLost(Effect):
    name = "frames_lost_without_trace"

    def draw(self, rng, strength, finger, hand):
        return {"times": int(rng.integers(3, 7)), "seconds": strength * rng.uniform(0.03, 0.1)}

    def labelled(self, p, run):
        keep = np.ones(len(run.points), bool)
        for start in run.rng.uniform(0.15, 0.9, p["times"]):
            begin = int(start * len(keep))
            keep[begin : begin + max(1, round(p["seconds"] * run.hand.mocap_rate))] = False
        run.points = run.points[keep]


class ScaleDrift(Effect):
    name = "camera_scale_drift"

    def draw(self, rng, strength, finger, hand):
        return {"change": strength * either(rng) * rng.uniform(0.012, 0.03)}

    def labelled(self, p, run):
        share = np.linspace(0, 1, len(run.points))[:, None, None]
        middle = np.nanmean(run.points, axis=(0, 1))
        run.points = middle + (run.points - middle) * (1 + p["change"] * share)


class SoftMount(Effect):
    """Proximal markers stand on skin and move along with the drive's pull."""

    name = "markers_bend_with_load"

    def draw(self, rng, strength, finger, hand):
        way = rng.normal(0, 1, 3)
        return {"move_mm": (strength * rng.uniform(0.8, 1.6) * way / np.linalg.norm(way)).tolist()}

    def local(self, p, run):
        pull = run.at(run.current, run.frame_time) / run.constants["Fc"]
        run.local[1][:, 1] += pull[:, None] * np.array(p["move_mm"])


class NoisyWhenFast(Effect):
    name = "noise_grows_with_speed"

    def draw(self, rng, strength, finger, hand):
        return {"factor": 1 + strength * rng.uniform(1.5, 3.0)}

    def log(self, p, run):
        speed = np.abs(run.at(run.v, run.true_time)) / 100
        run.noise["current"] = run.noise["current"] * (1 + (p["factor"] - 1) * np.clip(speed, 0, 1.2))


OUTSIDE_RECORDING = (
    LostCounts(),
    EncoderGainDrift(),
    GainJump(),
    DeadZone(),
    HeldCurrent(),
    WanderingLatency(),
    ClockJump(),
    FramesLost(),
    ScaleDrift(),
    SoftMount(),
    NoisyWhenFast(),
)
