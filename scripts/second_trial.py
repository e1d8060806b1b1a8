"""A blind trial on a second recorder's sessions, which shares no code with the twin nor with the diagnosis (`second_recorder/`).

    python scripts/second_trial.py FOLDER [--seed 1] [--single 36] [--none 4] [--pair 10] [--weak 10] [--messy 10] [--outside 10]

FOLDER must be new. It gets sessions, answers.json (its SHA-256 is printed before any diagnosis starts), findings; the score is printed.
"""

from __future__ import annotations

import argparse
import json
import shutil
import sys
from pathlib import Path

from second_recorder.compose import make_set

from hand_model.blind_trial import judged

COUNTS = {"single": 36, "none": 4, "pair": 10, "weak": 10, "messy": 10, "outside": 10}


def main() -> None:
    """Record, diagnose, score."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--workers", type=int, default=2, help="sessions at a time")
    for kind, count in COUNTS.items():
        parser.add_argument(f"--{kind}", type=int, default=count, help=f"number of {kind} sessions")
    options = parser.parse_args()
    if options.folder.exists():
        sys.exit(f"{options.folder} exists; a new folder is needed")
    sessions = options.folder / "sessions"
    make_set(sessions, options.seed, {kind: getattr(options, kind) for kind in COUNTS}, None)
    apart = sessions.with_name("sessions.answers")
    answers = {a["case"]: {"case": a["kind"], "effects": a["effects"], "settings": a["settings"]}
               for a in json.loads((apart / "answers.json").read_text())}
    shutil.rmtree(apart)
    trial = judged(options.folder, answers, options.workers)
    for row in trial.rows:
        if not row["right"]:
            print(f"{row['case']} {row['kind']}: {', '.join(row['truth'][:2])} -> {', '.join(row['named'][:4]) or row['verdict']}")
    print(trial.table())


if __name__ == "__main__":
    main()
