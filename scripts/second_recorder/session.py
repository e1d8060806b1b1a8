"""One session folder: the trials of two fingers, recorded."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from .effects import Settings
from .hand import PROBE, SEGMENTS, Array, Finger, Hand, finger_frame
from .kinematics import finger_markers
from .laboratory import Laboratory
from .motor import Trace, simulate
from .moves import EXCITATION, FLEXION_B_SPEEDS, FLEXION_SPEEDS, Move, Program, build, flexion
from .pose import draw_base, gravity_in_finger, palm_motion, probe_markers, to_world, turn_by
from .record import corrupt_markers, log_rows, write_c3d

PALM_LABELS = ["PO", "PM", "PL"]


@dataclass(frozen=True)
class TrialPlan:
    """One moving trial of a finger; `start` is the session time [s]."""

    kind: str
    suffix: str
    start: float
    moves: tuple[Move, ...]
    mocap: bool
    validate: bool


def plans(short: bool) -> list[TrialPlan]:
    """The trials of one finger; fewer and shorter in a short session."""
    long, second = (FLEXION_SPEEDS[:5], FLEXION_B_SPEEDS[:3]) if short else (FLEXION_SPEEDS, FLEXION_B_SPEEDS)
    out = [
        TrialPlan("flexion", "", 0.0, tuple(flexion(long)), True, False),
        TrialPlan("flexion", "_b", 120.0, tuple(flexion(second)), True, True),
    ]
    repeats = 2 if short else 3
    for i in range(repeats):
        out.append(TrialPlan("excitation", f"_{i + 1}", 180.0 + 45.0 * i, tuple(EXCITATION), False, i + 1 == repeats))
    return out


def manifest_head(hand: Hand) -> list[str]:
    """session.toml up to the trials."""
    probe = ", ".join(f"{label} = {list(place)}" for label, place in PROBE.items())
    lines = [
        'format = "hand-session/1"',
        "",
        "[hand]",
        'name = "bebionic"',
        f'side = "{hand.side}"',
        "",
        "[palm]",
        'markers = { origin = "PO", medial = "PM", lateral = "PL" }',
        "",
        "[world]",
        "gravity = [0.0, 0.0, -9.81]",
        "",
        "[probe]",
        f"markers = {{ {probe} }}",
    ]
    for finger in hand.fingers:
        lines += ["", "[[actuator]]", f'name = "{finger.name}"', "speed_full = 255", "current_full = 255"]
    for finger in hand.fingers:
        labels = finger.labels
        lines += ["", "[[finger]]", f'name = "{finger.name}"', f'actuator = "{finger.name}"', "segments = ["]
        for j, segment in enumerate(SEGMENTS):
            names = ", ".join(f'"{label}"' for label in labels[3 * j : 3 * j + 3])
            lines.append(f'  {{ name = "{segment}", markers = [{names}] }},')
        lines.append("]")
    return lines


def trial_lines(**entries: str) -> list[str]:
    """One [[trial]] table."""
    return ["", "[[trial]]"] + [f'{key} = "{value}"' for key, value in entries.items()]


def palm_points(hand: Hand, marker: dict[str, Any], times: Array, trace: Trace | None) -> Array:
    """Palm markers (n, 3, 3) in the palm frame."""
    points = np.repeat(hand.palm_markers[None], len(times), axis=0)
    if trace is not None and "palm_slip" in marker:
        index, moment, vector = marker["palm_slip"]
        points[np.arange(len(times)) >= moment * len(times), index] += np.array(vector)
    if trace is not None and "bend" in marker:
        index, vector = marker["bend"]
        load = np.interp(times, trace.time, trace.current) / 80.0
        points[:, index] += load[:, None] * np.array(vector)
    return points


class Recorder:
    """Writes one session; `settings` maps finger names to what is hidden in them."""

    def __init__(
        self,
        folder: Path,
        hand: Hand,
        settings: dict[str, Settings],
        rng: np.random.Generator,
        noise: float,
        short: bool,
        laboratory: Laboratory,
    ) -> None:
        """Make the folders and place the hand; `noise` scales all noise, `short` leaves out moves and trials."""
        self.folder, self.hand, self.settings, self.rng = folder, hand, settings, rng
        self.noise, self.short, self.laboratory = noise, short, laboratory
        self.base = draw_base(rng)
        self.lines = manifest_head(hand)
        self.busy: Array | None = None
        (folder / "mocap").mkdir(parents=True)
        (folder / "log").mkdir()

    def write(self) -> None:
        """All trials and the manifest."""
        self._probe_trials()
        for finger in self.hand.fingers:
            self._moving_trials(finger)
        (self.folder / "session.toml").write_text("\n".join(self.lines) + "\n")

    def _probe(self, name: str, tip: Array, frames: int) -> None:
        times = np.arange(frames) / self.laboratory.mocap_rate
        turns, places = palm_motion(self.rng, self.base, times)
        points = np.concatenate([palm_points(self.hand, {}, times, None), probe_markers(self.rng, tip, times)], axis=1)
        world = to_world(turns, places, points)
        labels = PALM_LABELS + list(PROBE)
        world = corrupt_markers(
            self.rng, labels, world, self._lens_only(), {}, self.noise, gaps=False, laboratory=self.laboratory
        )
        write_c3d(self.folder / "mocap" / name, labels, world, self.laboratory.mocap_rate)

    def _lens_only(self) -> dict[str, Any]:
        for settings in self.settings.values():
            rec = settings.get("rec", {})
            if "lens" in rec:
                return {"lens": rec["lens"], "lens_centre": rec["lens_centre"]}
        return {}

    def _probe_trials(self) -> None:
        for settings in self.settings.values():
            if "lens" in settings.get("rec", {}):
                settings["rec"]["lens_centre"] = (self.base[1] + self.rng.normal(0.0, 0.03, 3)).tolist()
        for name, place in self.hand.landmarks.items():
            self._probe(f"landmark_{name}.c3d", place + self.rng.normal(0.0, 0.0002, 3), 150)
            self.lines += trial_lines(kind="landmark", name=name, mocap=f"mocap/landmark_{name}.c3d")
        for finger in self.hand.fingers:
            for j, joint in enumerate(SEGMENTS):
                for side, along in (("medial", 0.007), ("lateral", -0.007)):
                    tip = finger.centres[j] + along * finger.axes[j] + self.rng.normal(0.0, 0.0005, 3)
                    name = f"joint_{finger.name}_{joint}_{side}.c3d"
                    self._probe(name, tip, 120)
                    self.lines += trial_lines(
                        kind="joint_probe", finger=finger.name, joint=joint, side=side, mocap=f"mocap/{name}"
                    )

    def _moving_trials(self, finger: Finger) -> None:
        settings = self.settings.get(finger.name, {})
        dyn, kin = settings.get("dyn", {}), settings.get("kin", {})
        marker, rec = settings.get("marker", {}), {**self._lens_only(), **settings.get("rec", {})}
        frame = finger_frame(finger.axes[0])
        for plan in plans(self.short):
            base = self.base
            if plan.suffix == "_b" and "turn_between_trials" in rec:
                base = (turn_by(np.array(rec["turn_between_trials"])) @ base[0], base[1])
            program = build(list(plan.moves), self.laboratory)
            trace = simulate(finger.motor, dyn, program, plan.start, gravity_in_finger(base[0], frame))
            stem = f"{plan.kind}_{finger.name}{plan.suffix}"
            entries = {"kind": plan.kind, "finger": finger.name, "log": f"log/{stem}.csv"}
            rows = log_rows(
                self.rng,
                finger,
                rec,
                program,
                trace,
                1000.0 + plan.start + self.rng.uniform(-3.0, 3.0),
                plan.start,
                self.noise,
                self._neighbour(finger, rec, program, plan),
                self.laboratory,
            )
            (self.folder / "log" / f"{stem}.csv").write_text("\n".join(rows) + "\n")
            if plan.mocap:
                entries["mocap"] = f"mocap/{stem}.c3d"
                self._film(finger, kin, marker, rec, base, program, trace, f"{stem}.c3d")
            if plan.validate:
                entries["purpose"] = "validate"
            self.lines += trial_lines(**entries)

    def _neighbour(self, finger: Finger, rec: dict[str, Any], program: Program, plan: TrialPlan) -> Array | None:
        """Current of the other motor, which runs its own flexions meanwhile (only where it leaks into this channel)."""
        if "crosstalk" not in rec:
            return None
        other = next(one for one in self.hand.fingers if one.name != finger.name)
        speeds = tuple(float(speed) for speed in self.rng.choice([0.8, 0.6, 0.35, 0.2], 12))
        return simulate(other.motor, {}, build(flexion(speeds), self.laboratory), plan.start, (0.0, 0.0)).current

    def _film(
        self,
        finger: Finger,
        kin: dict[str, Any],
        marker: dict[str, Any],
        rec: dict[str, Any],
        base: tuple[Array, Array],
        program: Program,
        trace: Trace,
        name: str,
    ) -> None:
        times = np.arange(round(program.duration * self.laboratory.mocap_rate)) / self.laboratory.mocap_rate
        turns, places = palm_motion(self.rng, base, times)
        points = np.concatenate(
            [palm_points(self.hand, marker, times, trace), finger_markers(finger, kin, marker, trace, times)], axis=1
        )
        labels = PALM_LABELS + finger.labels
        world = corrupt_markers(
            self.rng,
            labels,
            to_world(turns, places, points),
            rec,
            marker,
            self.noise,
            gaps=True,
            laboratory=self.laboratory,
        )
        write_c3d(self.folder / "mocap" / name, labels, world, self.laboratory.mocap_rate)
