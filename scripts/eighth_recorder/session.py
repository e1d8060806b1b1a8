"""Record a whole session of a hand and write it in the form of session_format.md."""

from pathlib import Path

import numpy as np

from eighth_recorder import body
from eighth_recorder.effect import JOINTS
from eighth_recorder.files import write_log, write_markers
from eighth_recorder.run import Run
from eighth_recorder.simulate import State

PALM = ["PO", "PM", "PL"]
PROBE = {"T1": [0.0, 0.0, 0.085], "T2": [0.0, 0.0, 0.125], "T3": [0.034, 0.0, 0.11], "T4": [-0.026, 0.008, 0.118]}


def _toml(value) -> str:
    if isinstance(value, str):
        return f'"{value}"'
    return repr(value)


def manifest(hand, trials: list[dict]) -> str:
    """The text of session.toml."""
    probe = ", ".join(f"{name} = {where}" for name, where in PROBE.items())
    text = [
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
        "",
    ]
    for actuator in dict.fromkeys(f.actuator for f in hand.fingers):
        text += ["[[actuator]]", f'name = "{actuator}"', "speed_full = 255", "current_full = 255", ""]
    for finger in hand.fingers:
        text += ["[[finger]]", f'name = "{finger.name}"', f'actuator = "{finger.actuator}"', "segments = ["]
        for part, labels in (("proximal", finger.labels[:3]), ("distal", finger.labels[3:])):
            text.append(f'  {{ name = "{part}", markers = [{", ".join(_toml(label) for label in labels)}] }},')
        text += ["]", ""]
    for trial in trials:
        text += ["[[trial]]", *[f"{key} = {_toml(value)}" for key, value in trial.items()], ""]
    return "\n".join(text)


def probe_trial(hand, rng, pose, tip, seconds):
    """Palm and probe markers while the tip is held at a place of the palm."""
    time = np.arange(round(seconds * hand.mocap_rate)) / hand.mocap_rate
    turn, origin = body.palm_path(rng, pose, time)
    wide = np.array([0, 0, 1.0]) + rng.normal(0, 0.2, 3)
    start = body.rotation(np.cross([0, 0, 1.0], wide) + 1e-9, rng.uniform(0, 0.3))[0]
    swing = rng.uniform(0.05, 0.12) * np.sin(2 * np.pi * rng.uniform(0.4, 0.9) * time + rng.uniform(0, 6))
    tilt = body.rotation(np.array([*rng.normal(0, 1, 2), 0.2]), swing) @ start
    shaft = np.array(list(PROBE.values())) * 1000
    points = np.concatenate(
        [np.repeat(hand.palm_markers[None], len(time), axis=0), np.einsum("nij,kj->nki", tilt, shaft) + tip], axis=1
    )
    return body.spoil(rng, body.to_world(turn, origin, points), hand.marker_noise, hand.mocap_rate)


def record(hand, folder: Path, rng) -> None:
    """All trials of all fingers."""
    for part in ("mocap", "log"):
        (folder / part).mkdir(parents=True)
    pose = body.draw_pose(rng)
    trials = []

    def touch(file, tip, seconds, **entry):
        points = probe_trial(hand, rng, pose, tip + rng.normal(0, 0.25, 3), seconds)
        trials.append(
            {**entry, "mocap": write_markers(folder, file, hand.suffix, PALM + list(PROBE), points, hand.mocap_rate)}
        )

    for name, place in zip(("origin", "medial", "lateral"), hand.landmarks, strict=True):
        touch(f"landmark_{name}", place, 1.5, kind="landmark", name=name)
    for finger in hand.fingers:
        for j, joint in enumerate(JOINTS):
            half = rng.uniform(6.7, 7.6)
            for side, way in (("medial", half), ("lateral", -half)):
                tip = finger.centres[j] + way * finger.axes[j]
                touch(
                    f"joint_{finger.name}_{joint}_{side}",
                    tip,
                    1.2,
                    kind="joint_probe",
                    finger=finger.name,
                    joint=joint,
                    side=side,
                )
    for finger in hand.fingers:
        trials += record_finger(hand, finger, folder, rng, pose)
    (folder / "session.toml").write_text(manifest(hand, trials))


def record_finger(hand, finger, folder: Path, rng, pose) -> list[dict]:
    """Two flexions with markers, two or three excitations; the last of each kind is held out."""
    state, trials, clock = State(), [], 1000 + rng.uniform(-3, 3)
    excitations = 2 if hand.short else 3
    plan = [("flexion", 0), ("flexion", 1)] + [("excitation", j) for j in range(excitations)]
    turned = pose
    for kind, number in plan:
        run = Run(hand, finger, kind, number, rng, state)
        if hand.pose_matters and number > 0:
            turned = body.draw_pose(rng)
            turned = (turned[0] @ body.rotation(rng.normal(0, 1, 3), rng.uniform(0.6, 2.2))[0], turned[1])
        run.palm_turn = turned[0]
        run.simulate()
        name = (
            f"flexion_{finger.name}{'_b' if number else ''}"
            if kind == "flexion"
            else f"excitation_{finger.name}_{number + 1}"
        )
        rows = run.record_log()
        rows["time"] = rows["time"] + clock
        write_log(folder / "log" / f"{name}.csv", rows)
        entry = {"kind": kind, "finger": finger.name, "log": f"log/{name}.csv"}
        if kind == "flexion":
            time = np.arange(int(run.length * hand.mocap_rate)) / hand.mocap_rate
            markers = body.finger_markers(run, time)
            turn, origin = body.palm_path(rng, turned, time)
            run.points = body.spoil(rng, body.to_world(turn, origin, markers), hand.marker_noise, hand.mocap_rate)
            run.each("labelled")
            entry["mocap"] = write_markers(folder, name, hand.suffix, PALM + finger.labels, run.points, hand.mocap_rate)
        if number == (1 if kind == "flexion" else excitations - 1):
            entry["purpose"] = "validate"
        trials.append(entry)
        clock += run.length + rng.uniform(20, 68)
        state.heat *= np.exp(-30 / 40)
    return trials
