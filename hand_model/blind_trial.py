"""Blind trial: the twin hides effects in recordings, a process that is never told diagnoses them, then the score.

The answers are written first and their SHA-256 is said before any diagnosis starts; the diagnosing process gets session
folders only.
"""

from __future__ import annotations

import hashlib
import json
import subprocess
import sys
import tempfile
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from .textbook import readings

# times the noise floor, that the error after modelling may be; share of what could be removed that must be gone
NOISE, REMOVED = 1.05, 0.8
KIND_SHARE = ("single", "single", "single", "single", "weak", "weak", "none", "pair", "messy", "outside")


@dataclass(frozen=True)
class Trial:
    """Score of a blind trial. sha256: of the answers file. rows: one per case (kind, truth, named, right, ...).
    rates: name -> (hits, cases). confusion: (truth, named) -> count."""

    sha256: str
    rows: tuple[Mapping[str, Any], ...]
    rates: Mapping[str, tuple[int, int]]
    confusion: Mapping[tuple[str, str], int]

    def table(self) -> str:
        """The rates and the confusions as text."""
        lines = [f"{'what':34s} {'hits':>5s} {'of':>5s} {'rate':>6s}"]
        lines += [f"{k:34s} {h:5d} {n:5d} {h / n if n else 0:6.2f}" for k, (h, n) in self.rates.items()]
        wrong = [(t, g, c) for (t, g), c in sorted(self.confusion.items(), key=lambda i: -i[1]) if t != g]
        lines += ["", "confusions (hidden -> named):", *(f"  {c:3d}  {t} -> {g}" for t, g, c in wrong)]
        return "\n".join(lines)


def blind_trial(
    cases: int,
    seed: int,
    folder: str | Path | None = None,
    kinds: Sequence[str] = KIND_SHARE,
    effects: Sequence[str] | None = None,
    workers: int = 2,
    say: Callable[[str], None] = print,
) -> Trial:
    """Record `cases` twin sessions, say the hash of the answers, diagnose them in processes of their own, score.

    cases: number of sessions; seed: of everything. kinds: drawn in turn. effects: main effects drawn in turn for the
    kinds that take one, instead of at random. folder: where sessions, answers and findings go (a temporary one
    otherwise).
    """
    if folder is None:
        with tempfile.TemporaryDirectory() as temporary:
            return blind_trial(cases, seed, temporary, kinds, effects, workers, say)
    root = Path(folder)
    return judged(root, _record(cases, seed, root, kinds, effects, workers), workers, say)


def judged(root: str | Path, answers: Mapping[str, Any], workers: int = 2, say: Callable[[str], None] = print) -> Trial:
    """Write the answers, say their hash, diagnose the sessions in processes of their own, open the answers and score.

    root: folder with sessions/NAME; answers: NAME -> {"case": kind, "effects": [{"effect", "finger", ...}]}, as a
    recorder gives them.
    """
    root = Path(root)
    text = json.dumps(answers, indent=1)
    (root / "answers.json").write_text(text)
    digest = hashlib.sha256(text.encode()).hexdigest()
    say(f"answers.json SHA-256 {digest}")
    with ThreadPoolExecutor(workers) as pool:
        for done, line in enumerate(pool.map(lambda name: _diagnose(root, name), answers), start=1):
            say(f"{done}/{len(answers)} {line}")
    answers = json.loads((root / "answers.json").read_text())
    rows = [
        score_case(name, answer, json.loads((root / "findings" / name / "findings.json").read_text()))
        for name, answer in answers.items()
    ]
    return _summary(digest, rows)


def _record(
    cases: int, seed: int, root: Path, kinds: Sequence[str], effects: Sequence[str] | None, workers: int
) -> dict[str, Any]:
    """Sessions into `root`/sessions, one process per worker; returns their answers by session name."""
    jobs = []
    for i in range(cases):
        kind = kinds[i % len(kinds)]
        takes = kind in ("single", "weak", "pair", "messy")
        jobs.append(
            (seed * 100000 + i, kind, effects[i % len(effects)] if effects and takes else None, f"case_{i:03d}")
        )
    script = (
        "import sys, json; from hand_model.blind_trial import record_one; "
        "print(json.dumps(record_one(*json.loads(sys.argv[1]))))"
    )
    with ThreadPoolExecutor(workers) as pool:
        out = pool.map(
            lambda job: (
                subprocess.run(
                    [sys.executable, "-c", script, json.dumps([*job, str(root)])],
                    check=True,
                    capture_output=True,
                    text=True,
                ).stdout
            ),
            jobs,
        )
        return {job[3]: json.loads(text) for job, text in zip(jobs, out, strict=True)}


def record_one(seed: int, kind: str, effect: str | None, name: str, root: str) -> dict[str, Any]:
    """Draw and record one case under `root`/sessions/`name`; the answer goes back to the caller, not into the
    folder."""
    from .twin import draw_case

    target = Path(root) / "sessions" / name
    answer = draw_case(seed, kind, effect).record(target)
    for stray in target.rglob("answer*.json"):
        stray.unlink()
    return dict(answer.table)


def _diagnose(root: Path, name: str) -> str:
    done = subprocess.run(
        [sys.executable, "-m", "hand_model.diagnose", str(root / "sessions" / name), str(root / "findings" / name)],
        check=False,
        capture_output=True,
        text=True,
    )
    if done.returncode:
        (root / "findings" / name).mkdir(parents=True, exist_ok=True)
        (root / "findings" / name / "findings.json").write_text(json.dumps({"verdict": "failed", "findings": []}))
        (root / "findings" / name / "error.txt").write_text(done.stderr)
        return f"{name} failed: {done.stderr.strip().splitlines()[-1] if done.stderr else ''}"
    return done.stdout.strip()


def score_case(name: str, answer: Mapping[str, Any], findings: Mapping[str, Any]) -> dict[str, Any]:
    """One case: what was hidden, what was named, whether name and place agree and nothing else is named. What was
    hidden at no finger (a clock, a marker on the palm) agrees with every place."""
    hidden = [e for e in answer["effects"] if e["effect"] != "none"]
    truth = [e["effect"] for e in hidden]
    named = [f["effect"] for f in findings["findings"]]
    places = {f["effect"]: f["where"].get("finger") for f in findings["findings"]}
    classes = {f["effect"]: f.get("class", []) for f in findings["findings"]}
    kind = answer["case"]
    placed = all(
        e.get("finger") is None or places[e["effect"]] in (e["finger"], None) for e in hidden if e["effect"] in places
    )
    if kind == "none":
        right = findings["verdict"] == "consistent"
    elif kind == "outside":
        right = findings["verdict"] in ("unexplained", "consistent")
    elif kind == "messy":
        right = bool(named) and named[0] == truth[0]
    else:
        right = sorted(named) == sorted(truth) and placed
    return {
        "case": name,
        "kind": kind,
        "truth": truth,
        "named": named,
        "verdict": findings["verdict"],
        "right": right,
        "placed": placed,
        "in_three": bool(truth) and truth[0] in named[:3],
        "in_class": bool(truth) and any(truth[0] in c for c in classes.values()),
        "parameter_errors": _parameter_errors(hidden, findings["findings"]),
        "proofs": _proofs(truth, findings["findings"]),
        "settings": [e.get("parameters", e.get("settings")) for e in hidden][:2],
        "parameters": [f["parameters"] for f in findings["findings"]][:2],
    }


def _proofs(truth: Sequence[str], found: Sequence[Mapping[str, Any]]) -> list[dict[str, bool]]:
    """Of findings of what was hidden, as they say it themselves: whether the error that modelling leaves is within
    `NOISE` times the noise, and whether `REMOVED` of what could be removed is gone. Of a channel that is refused there
    is no error."""
    out = []
    for fit in (f.get("fit", {}) for f in found if f["effect"] in truth):
        before, after, floor = (fit.get(name) for name in ("before", "after", "noise_floor"))
        if None not in (before, after, floor):
            within = after <= NOISE * floor
            gone = within if before <= floor else before - after >= REMOVED * (before - floor)
            out.append({"within": within, "gone": gone})
    return out


def _parameter_errors(
    hidden: Sequence[Mapping[str, Any]], found: Sequence[Mapping[str, Any]]
) -> dict[str, dict[str, Any]]:
    """Per parameter of a finding that the answer knows (`textbook.readings`): relative error, and whether the interval
    (None where none is given) holds the truth. Of effects named at their place and not as one of a class."""
    out: dict[str, dict[str, Any]] = {}
    for finding in found:
        mine = [
            e
            for e in hidden
            if e["effect"] == finding["effect"] and finding["where"].get("finger") in (e.get("finger"), None)
        ]
        truth = readings(mine[0]) if mine and "form" in mine[0] else {}
        for name, wanted in truth.items():
            entry = finding["parameters"].get(name, {})
            if entry.get("value") is None or not wanted:
                continue
            ci = entry.get("ci95")
            out[f"{finding['effect']}.{name}"] = {
                "error": abs(entry["value"] - wanted) / abs(wanted),
                "covered": None if ci is None or None in ci else ci[0] <= wanted <= ci[1],
            }
    return out


def _summary(digest: str, rows: Sequence[Mapping[str, Any]]) -> Trial:
    def rate(kind: str, key: str = "right") -> tuple[int, int]:
        mine = [r for r in rows if r["kind"] == kind]
        return sum(bool(r[key]) for r in mine), len(mine)

    rates = {
        "single: name, place, nothing else": rate("single"),
        "weak: name, place, nothing else": rate("weak"),
        "none: consistent": rate("none"),
        "pair: both named": rate("pair"),
        "messy: main effect first": rate("messy"),
        "messy: main effect in three": rate("messy", "in_three"),
        "outside: no confident name": rate("outside"),
        "single: in a named class": rate("single", "in_class"),
    }
    errors = [e for r in rows for e in r["parameter_errors"].values()]
    rates["parameters: within 10 % or interval"] = (
        sum(e["error"] <= 0.1 or bool(e["covered"]) for e in errors),
        len(errors),
    )
    rates["parameters: interval holds truth"] = (
        sum(bool(e["covered"]) for e in errors),
        sum(e["covered"] is not None for e in errors),
    )
    proofs = [p for r in rows if r["kind"] == "single" and r["right"] for p in r["proofs"]]
    for what, key in (("error after within the noise", "within"), ("removable error gone", "gone")):
        rates[f"single: {what}"] = (sum(p[key] for p in proofs), len(proofs))
    confusion: Counter[tuple[str, str]] = Counter()
    for row in rows:
        if row["kind"] in ("single", "weak", "none", "outside"):
            main = row["truth"][0] if row["truth"] else "none"
            if row["right"]:
                confusion[main, main] += 1
            else:
                confusion[main, " + ".join(row["named"]) or row["verdict"]] += 1
    return Trial(digest, tuple(rows), rates, dict(confusion))
