"""Diagnose every rig session of a folder and write what was found as JSON and as a section for the README.

python scripts/real_machines.py FOLDER --output DIR [--only NAME ...]
"""

from __future__ import annotations

import argparse
import json
import os
import time
from pathlib import Path

from hand_model.errors import HandModelError
from hand_model.report.rig_findings import write_rig_findings
from hand_model.rig import Findings, diagnose_rig
from hand_model.session import read_session


def run(folder: Path, output: Path, only: list[str]) -> list[dict]:
    """One record per session: verdict, findings, held-out figures, seconds; or why it was refused."""
    records = []
    for path in sorted(p for p in folder.iterdir() if (p / "session.toml").is_file() and (not only or p.name in only)):
        session = read_session(path)
        if session.rig is None:
            continue
        began, used = time.perf_counter(), sum(os.times()[:4])  # own and children's
        try:
            findings = diagnose_rig(session, output / path.name)
        except HandModelError as error:
            records.append({"session": path.name, "refused": str(error)})
            continue
        records.append(record(path.name, findings, time.perf_counter() - began, sum(os.times()[:4]) - used))
        write_rig_findings(session, findings, output / path.name)
        print(
            (
                f"{path.name}: {findings.verdict}, {records[-1]['seconds']:.0f} s, "
                f"of a processor {records[-1]['cpu_s']:.0f} s"
            ),
            flush=True,
        )
    return records


def record(name: str, findings: Findings, seconds: float, cpu_s: float) -> dict:
    """What the table of the README needs of one diagnosis."""
    table = json.loads(findings.to_json())
    return {
        "session": name,
        "verdict": findings.verdict,
        "seconds": seconds,
        "cpu_s": cpu_s,
        "lack_of_fit": table["lack_of_fit"],
        "findings": [
            {k: f[k] for k in ("effect", "class", "probability", "statement", "fit")} for f in table["findings"]
        ],
        "unexplained": table["unexplained"],
    }


def section(records: list[dict]) -> str:
    """Markdown: for each session what is missing, how sure that is, and how much the held-out error falls."""
    lines = [
        "## What it found in real recordings",
        "",
        (
            "| recording | missing from its declared model (class) | probability | held-out error, "
            "declared to with all effects |"
        ),
        "| --- | --- | --- | --- |",
    ]
    for r in records:
        if "refused" in r:
            lines.append(f"| {r['session']} | refused: {r['refused']} | | |")
            continue
        named = "<br>".join(f"{' / '.join(f['class'])}" for f in r["findings"]) or "nothing that holds out"
        sure = "<br>".join(f"{f['probability']:.2f}" for f in r["findings"])
        lines.append(f"| {r['session']} | {named} | {sure} | {_figure(r['lack_of_fit'])} |")
    lines.append("")
    for r in records:
        lines += [f"**{r['session']}** ({r.get('verdict', 'refused')})", ""]
        lines += [f"- {f['statement']}" for f in r.get("findings", [])]
        lines += [
            (
                f"- Unexplained: {100 * u['share_of_mismatch']:.0f} % of the mismatch at "
                f"{u['where']['joint'] or 'the joint'}."
            )
            for u in r.get("unexplained", [])
        ]
        lines.append("")
    return "\n".join(lines)


def _figure(lack: dict) -> str:
    if lack.get("before") is None:
        return "not fitted"
    one, two, ratio = (lack[k] / lack["before"] for k in ("one_effect", "two_effects", "after"))
    steps = f"x {ratio:.2f} (one effect a joint x {one:.2f}, two x {two:.2f})"
    if lack["metric"] == "effort_rmse":
        told = lack.get("open_loop", {})
        if "ratio" not in told:
            return f"effort: {steps}"
        how = "whole trials" if told["horizon_s"] == "whole" else f"{told['horizon_s']:g} s"
        return f"effort: {steps}; position in open loop over {how}: x {told['ratio']:.2f}"
    return f"position in open loop: {lack['before']:.4f} to {lack['after']:.4f} {lack['unit']}, {steps}"


def main() -> None:
    """Run, print the section, write `real_machines.json` and `real_machines.md`."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--output", type=Path, required=True)
    parser.add_argument("--only", nargs="*", default=[])
    arguments = parser.parse_args()
    arguments.output.mkdir(parents=True, exist_ok=True)
    records = run(arguments.folder, arguments.output, arguments.only)
    (arguments.output / "real_machines.json").write_text(json.dumps(records, indent=2) + "\n")
    (arguments.output / "real_machines.md").write_text(section(records))
    print(section(records))


if __name__ == "__main__":
    main()
