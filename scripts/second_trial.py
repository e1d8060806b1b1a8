"""A blind trial on sessions of a second recorder, a third, a fourth, a fifth, a sixth, a seventh or an eighth, that share
no code with each other, the twin or the diagnosis (`second_recorder/`, `third_recorder/`, `fourth_recorder/`,
`fifth_recorder/`, `sixth_recorder/`, `seventh_recorder/`, `eighth_recorder/`).

    python scripts/second_trial.py FOLDER [--recorder {second,third,fourth,fifth,sixth,seventh,eighth}] [--seed 1] [--single 36]
    [--none 4] [--pair 10] [--weak 10] [--messy 10] [--outside 10] [--anywhere]

FOLDER must be new. It gets sessions, answers.json (its SHA-256 is printed before any diagnosis starts), findings; the
score is printed, and, of the second and the fourth recorder's sessions, what was read of their parameters.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from eighth_recorder.compose import make_set as make_eighth
from eighth_recorder.simulate import CompilerError as EighthCompilerError
from fifth_recorder.compose import make_set as make_fifth
from fifth_recorder.stepper import CompilerError as FifthCompilerError
from fourth_recorder.compose import make_set as make_fourth
from fourth_recorder.motor import CompilerError as FourthCompilerError
from fourth_recorder.readings import truth as truth_of_fourth
from second_recorder.compose import make_set as make_second
from second_recorder.hand import COUNTS as RANGES
from seventh_recorder.compose import CompilerError as SeventhCompilerError
from seventh_recorder.compose import make_set as make_seventh
from sixth_recorder.compose import make_set as make_sixth
from sixth_recorder.plant import CompilerError as SixthCompilerError
from third_recorder.compose import make_set as make_third
from third_recorder.motor import CompilerError as ThirdCompilerError

from hand_model.blind_trial import judged

# What a finding should read of the recorder's settings s (all groups together) and of the motor m, where both have the
# figure.
READINGS: dict[str, Callable[[dict[str, Any], dict[str, float]], dict[str, float]]] = {
    "stribeck_friction": lambda s, m: {"static_ratio": s["Fs_ratio"], "stribeck_speed": s["vs"]},
    "asymmetric_viscous_friction": lambda s, m: {"viscous_flexion": m["b"] * s.get("b_flex_ratio", 1.0), "viscous_extension": m["b"] * s.get("b_ext_ratio", 1.0)},
    "asymmetric_friction": lambda s, m: {"half_difference": m["Fc"] * s["fc_asym"]},
    "load_dependent_friction": lambda s, m: {"load_coefficient": s["load_mu"]},
    "position_dependent_friction": lambda s, m: {"centre": s["pos_c"], "width": s["pos_w"], "ratio": s["pos_amp"]},
    "detent_load": lambda s, m: {"centre": s["detent_c"], "width": s["detent_w"], "load": s["detent_amp"]},
    "nonlinear_spring": lambda s, m: {"cubic_stiffness": m["k"] * s["spring_cubic"] / 1e4},
    "torque_ripple": lambda s, m: {"amplitude": s["ripple_amp"], "period": s["ripple_period"]},
    "quadratic_damping": lambda s, m: {"drag": s["quad"]},
    "elastoplastic_hysteresis": lambda s, m: {"yield_load": s["plastic_amp"], "reach": s["plastic_dist"]},
    "viscoelastic_spring": lambda s, m: {"stiffness": s["relax_k"], "relaxation_time": s["relax_tau"]},
    "presliding_friction": lambda s, m: {"bristle_length": m["Fc"] / s["bristle"]},
    "end_stop_contact": lambda s, m: {"begin": s["stop_x"], "stiffness": s["stop_k"]},
    "thermal_friction_drift": lambda s, m: {"cold_excess": m["Fc"] * s["thermal_amp"], "warm_up_time": s["thermal_tau"]},
    "external_contact": lambda s, m: {"begin": s["contact_x"], "stiffness": s["contact_k"]},
    "encoder_periodic_error": lambda s, m: {"period": 100 * s["encoder_period"] / m["counts"]},
    "command_delay": lambda s, m: {"delay": s["command_delay"]},
    "current_channel_delay": lambda s, m: {"delay": s["current_delay"]},
    "current_saturation": lambda s, m: {"limit": s.get("clip", s.get("limit"))},
    "clock_drift": lambda s, m: {"rate_minus_one": s["skew"] - 1},
    "joint_wobble": lambda s, m: {"amplitude": s["wobble_amp"]},
    "moving_centre": lambda s, m: {"travel": float(np.linalg.norm(s["travel"]))},
    "marker_slip": lambda s, m: {"distance": float(np.linalg.norm(s["slip"][3]))},
    "palm_marker_slip": lambda s, m: {"distance": float(np.linalg.norm(s["palm_slip"][2]))},
    "support_slip": lambda s, m: {"turn": float(np.linalg.norm(s["support"][2]))},
    "linkage_backlash": lambda s, m: {"segment_gap": float(np.rad2deg(2 * s["linkage_play"]))},
    "drive_backlash": lambda s, m: {"segment_gap": float(np.rad2deg(2 * s["drive_play"]))},
}  # fmt: skip
# recorders written after the second, and what each raises without a C compiler
MAKERS = {
    "third": make_third,
    "fourth": make_fourth,
    "fifth": make_fifth,
    "sixth": make_sixth,
    "seventh": make_seventh,
    "eighth": make_eighth,
}
COMPILER_ERRORS = (
    ThirdCompilerError,
    FourthCompilerError,
    FifthCompilerError,
    SixthCompilerError,
    SeventhCompilerError,
    EighthCompilerError,
)
COUNTS = {"single": 36, "none": 4, "pair": 10, "weak": 10, "messy": 10, "outside": 10}


def truth_of_second(hidden: dict[str, Any], answer: dict[str, Any]) -> dict[str, float]:
    """What a finding of an effect that the second recorder hid should read; empty where they share nothing."""
    if hidden["effect"] not in READINGS:
        return {}
    settings = {k: v for group in answer["settings_by_finger"][hidden["finger"]].values() for k, v in group.items()}
    open_counts, full_counts = RANGES[hidden["finger"]]
    motor = {**answer["motor"][hidden["finger"]], "counts": full_counts - open_counts}
    return READINGS[hidden["effect"]](settings, motor)


def parameters(
    folder: Path, made: list[dict[str, Any]], truth_of: Callable[[dict[str, Any], dict[str, Any]], dict[str, float]]
) -> list[tuple[str, float, float, list[float] | None]]:
    """Effect and name, truth, value and interval of every figure that recorder and finding both have; messy sessions
    left out."""
    out = []
    for answer in made:
        if answer["kind"] not in ("single", "weak", "pair"):
            continue
        findings = json.loads((folder / "findings" / answer["case"] / "findings.json").read_text())["findings"]
        for hidden in answer["effects"]:
            truth = truth_of(hidden, answer)
            for found in (
                f
                for f in findings
                if f["effect"] == hidden["effect"] and f["where"]["finger"] in (hidden["finger"], None)
            ):
                read = {name: found["parameters"][name] for name in truth if name in found["parameters"]}
                out += [
                    (f"{hidden['effect']}.{name}", float(truth[name]), entry["value"], entry.get("ci95"))
                    for name, entry in read.items()
                ]
    return out


def print_parameters(figures: list[tuple[str, float, float, list[float] | None]]) -> None:
    """How many figures were read well, and those that were not."""
    right = [
        abs(value - truth) <= 0.1 * abs(truth) or bool(ci and ci[0] <= truth <= ci[1])
        for _, truth, value, ci in figures
    ]
    print(f"parameters within 10 % or inside the interval: {sum(right)} of {len(right)}")
    for name, truth, value, ci in (f for f, good in zip(figures, right, strict=True) if not good):
        print(f"  {name}: {value:.4g} {'' if ci is None else [float(f'{c:.4g}') for c in ci]} for {truth:.4g}")


def options_of_command() -> argparse.Namespace:
    """The command line; ends the process where it makes no sense."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--recorder", choices=("second", *MAKERS), default="second")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2, help="sessions at a time")
    for kind, count in COUNTS.items():
        parser.add_argument(f"--{kind}", type=int, default=count, help=f"number of {kind} sessions")
    parser.add_argument(
        "--anywhere",
        action="store_true",
        help="each session in a laboratory of its own: rates, noise, speeds (second recorder; the third and the sixth always do so, the fourth and the fifth in half of their sessions)",
    )
    options = parser.parse_args()
    if options.anywhere and options.recorder != "second":
        sys.exit("--anywhere is an option of the second recorder alone")
    if options.folder.exists():
        sys.exit(f"{options.folder} exists; a new folder is needed")
    return options


def main() -> None:
    """Record, diagnose, score."""
    options = options_of_command()
    sessions = options.folder / "sessions"
    counts = {kind: getattr(options, kind) for kind in COUNTS}
    if options.recorder == "second":
        make_second(sessions, options.seed, counts, None, options.anywhere)
    else:
        try:
            MAKERS[options.recorder](sessions, options.seed, counts)
        except COMPILER_ERRORS as error:
            sys.exit(str(error))
    apart = sessions.with_name("sessions.answers")
    made = json.loads((apart / "answers.json").read_text())
    # "form" in an effect is the twin's, whose parameters the score knows; the fifth recorder's are others
    hidden = {a["case"]: [{"law" if k == "form" else k: v for k, v in e.items()} for e in a["effects"]] for a in made}
    answers = {a["case"]: {"case": a["kind"], "effects": hidden[a["case"]], "settings": a["settings"]} for a in made}
    shutil.rmtree(apart)
    trial = judged(options.folder, answers, options.workers)
    for row in trial.rows:
        if not row["right"]:
            print(
                f"{row['case']} {row['kind']}: {', '.join(row['truth'][:2])} -> {', '.join(row['named'][:4]) or row['verdict']}"
            )
    print(trial.table())
    truths = {"second": truth_of_second, "fourth": truth_of_fourth}
    if options.recorder in truths:
        print_parameters(parameters(options.folder, made, truths[options.recorder]))


if __name__ == "__main__":
    main()
