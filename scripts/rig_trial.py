"""A blind trial on simulated siblings of real machines; their recorder (`rig_recorder/`) shares no code with the
diagnosis.

    python scripts/rig_trial.py FOLDER [--seed 1] [--cases 14]

FOLDER must be new. It gets sessions, answers.json (its SHA-256 is printed before any diagnosis starts) and findings;
the score is printed: what was named first, whether anything was named that is not there, and the held-out error over
the one that the true law reaches (by regression in the same band with the effect's true shape, or simulated from the
true start; see `rig_recorder/reach.py`).
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rig_recorder.compose import make_set
from rig_recorder.hide import names
from rig_recorder.reach import balance, motion

CLOSE = 1.05  # times the held-out error of the true law that still counts as reaching it
# What is truly in every machine, small: ripple, a zero that is not quite zero; a cable that gives a little, errors of a
# gear.
SMALL = {"torque_ripple", "asymmetric_friction", "gravity_load"}
BETWEEN = {"drive_backlash", "series_elasticity"}  # between two encoders: no part of the effort
SWUNG = ("servo", "swing")
# A torque that is held for a millisecond and logged at its end comes 0.65 ms late in every log of it (0.3 ms in one
# whose samples drift through
# the millisecond): a delay as short is there.
HELD_S = 1e-3


@dataclass(frozen=True)
class Row:
    """Score of one session. first: the first name (its class) is one of what is hidden; every: all that is hidden is
    named; false: names of what is not there; one, all_: held-out error over the true law's (None: not asked); seconds:
    by the clock."""

    name: str
    told: str
    named: str
    first: bool
    every: bool
    false: tuple[str, ...]
    one: float | None
    all_: float | None
    figures: str
    seconds: float


def diagnose(session: Path, output: Path) -> tuple[dict[str, Any], float]:
    """Findings of a session by a process that is told nothing else, and its seconds."""
    program = (
        "import sys; from hand_model.rig import diagnose_rig; from hand_model.session import read_session; "
        "diagnose_rig(read_session(sys.argv[1]), sys.argv[2])"
    )
    began = time.perf_counter()
    done = subprocess.run(
        [sys.executable, "-c", program, str(session), str(output)], check=False, capture_output=True, text=True
    )
    seconds = time.perf_counter() - began
    if done.returncode:
        return {
            "verdict": "failed: " + done.stderr.strip().splitlines()[-1],
            "findings": [],
            "lack_of_fit": {},
        }, seconds
    return json.loads((output / "findings.json").read_text()), seconds


def band(output: Path) -> float | None:
    """Cut-off [Hz] of the balance that the written file was held to."""
    from lxml import etree

    texts = etree.fromstring((output / "rig.xml").read_bytes()).iter("text") if (output / "rig.xml").is_file() else ()
    return next((r["cutoff_hz"] for t in texts for r in json.loads(t.get("data")) if "cutoff_hz" in r), None)


def score(root: Path, name: str, answer: dict[str, Any], findings: dict[str, Any], seconds: float) -> Row:
    """Names against what is hidden, and errors against what the true law reaches."""
    lack, found = findings["lack_of_fit"], findings["findings"]
    refused = [
        f for f in found if f["effect"] in ("command_as_measurement", "current_saturation") and f["model"] is None
    ]
    physics = [f for f in found if f not in refused]
    hidden = [names(e) for e in answer["effects"] if not e.startswith("outside")]
    classes = [set(f["class"]) for f in physics]
    small = SMALL | (BETWEEN if answer["machine"] == "stages" else set())
    false = tuple(
        f["effect"]
        for f, c in zip(physics, classes, strict=True)
        if not any(c & h for h in hidden) and f["effect"] not in small and not _held(f)
    )
    if answer["fault"]:
        kind = "current_saturation" if answer["fault"] == "clipped" else "command_as_measurement"
        first = every = any(f["effect"] == kind for f in refused)
    else:
        first = any(classes[0] & h for h in hidden) if hidden and classes else not hidden
        every = all(any(c & h for c in classes) for h in hidden)
        false += tuple(f["effect"] for f in refused)
    one, all_, figures = (
        _ratios(root, name, answer, lack) if lack.get("before") and not answer["fault"] else (None, None, "")
    )
    told = f"{answer['machine']}: {', '.join(answer['effects']) or answer['fault'] or 'nothing'}"
    named = ", ".join("/".join(dict.fromkeys(f["class"])) for f in found) or findings["verdict"]
    return Row(name, told, named, first, every, false, one, all_, figures, seconds)


def _held(finding: dict[str, Any]) -> bool:
    """Whether a finding is the delay that a held torque has in the log."""
    return finding["effect"] == "current_channel_delay" and 0 < finding["parameters"]["delay"]["value"] < HELD_S


def _ratios(
    root: Path, name: str, answer: dict[str, Any], lack: dict[str, Any]
) -> tuple[float | None, float | None, str]:
    """Held-out error over that of the true law, with one effect and with all (of what was hidden, at most two), and
    both as figures."""
    session, before = root / "sessions" / name, lack["before"]
    one, two = (lack[k] / before for k in ("one_effect", "two_effects"))
    if answer["machine"] in SWUNG:
        best = max(motion(session, answer), lack.get("noise_floor") or 0.0) / before
        mine = lack["after"] / before
        return None, mine / min(best, 1.0), f"{mine:.2f} ({best:.2f})"
    cutoff = band(root / "findings" / name)
    if cutoff is None or BETWEEN & set(answer["effects"]):
        return None, None, f"{one:.2f}, {two:.2f}"
    (best_one, best_two), _ = balance(session, answer, cutoff)
    if len(answer["effects"]) < 2:
        two, best_two = one, best_one
    return one / best_one, two / best_two, f"{one:.2f}, {two:.2f} ({best_one:.2f}, {best_two:.2f}) to {cutoff:g} Hz"


def table(rows: list[Row]) -> str:
    """Rows and sums as text."""
    lines = [f"{'session':8s} {'hidden -> named':100s} {'one':>5s} {'all':>5s}   tool (true law)"]
    for r in rows:
        marks = (
            ("" if r.first else " FIRST")
            + ("" if r.every else " MISSED")
            + (f" FALSE {', '.join(r.false)}" if r.false else "")
        )
        one, every = ("" if x is None else f"{x:.2f}" for x in (r.one, r.all_))
        lines.append(
            f"{r.name:8s} {r.told + ' -> ' + r.named:100s} {one:>5s} {every:>5s}   {r.figures}; "
            f"{r.seconds:.0f} s{marks}"
        )
    known = [[x for x in (r.one, r.all_) if x is not None] for r in rows]
    lines.append(
        f"first right {sum(r.first for r in rows)}, all found {sum(r.every for r in rows)}, "
        f"without a false name {sum(not r.false for r in rows)}, of {len(rows)}; "
        f"held-out error at most {CLOSE} of the true law's {sum(bool(k) and max(k) <= CLOSE for k in known)} of "
        f"{sum(map(bool, known))}; slowest {max(r.seconds for r in rows):.0f} s"
    )
    return "\n".join(lines)


def main() -> None:
    """Record, say the hash of the answers, diagnose, score."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--cases", type=int, default=14)
    options = parser.parse_args()
    if options.folder.exists():
        sys.exit(f"{options.folder} exists; a new folder is needed")
    made = make_set(options.folder / "sessions", options.seed, options.cases)
    text = json.dumps(made, indent=1)
    (options.folder / "answers.json").write_text(text)
    print(f"answers.json SHA-256 {hashlib.sha256(text.encode()).hexdigest()}", flush=True)
    told = {}
    for name in made:
        told[name] = diagnose(options.folder / "sessions" / name, options.folder / "findings" / name)
        print(f"{name}: {told[name][0]['verdict']}, {told[name][1]:.0f} s", flush=True)
    answers = json.loads((options.folder / "answers.json").read_text())
    print(table([score(options.folder, name, answers[name], *told[name]) for name in answers]))


if __name__ == "__main__":
    main()
