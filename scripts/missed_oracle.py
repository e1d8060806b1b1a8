"""Sessions whose main effect was not named: information that is missing, or method?

    python scripts/missed_oracle.py FOLDER [FOLDER ...] [--kind messy]

FOLDER: as `second_trial.py` or `hand-model blind-trial` left it. Missed is a messy session whose main effect is not
among the first three, and one of another kind (single, weak, pair) of which an effect is not named. Where it belongs to a balance
(a motor's current, an angle against another), the search of that balance is begun with it, and it is kept there until
no other effect comes or goes. Printed: the log evidence [nats] of that whole model over the one that was named,
coefficients unlike the hand's other motors paid for. Below zero, what was named is likelier than the truth: the
recordings do not tell. Of what was taken for healthy the truth must bring nine to be told from chance. A marker's effect
has no balance, and is passed over.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path
from typing import Any

from hand_model.background import Pair, single_threaded
from hand_model.diagnose.diagnosis import hear
from hand_model.diagnose.name.search import favour, search
from hand_model.diagnose.name.shapes import scan
from hand_model.diagnose.name.station import Station
from hand_model.diagnose.name.term import Term
from hand_model.effects import catalogue, outsiders
from hand_model.session import read_session

SIGNALS = {"current": "drive", "encoder": "encoder", "markers": "linkage"}


def forced(station: Station, name: str) -> tuple[float, tuple[str, ...]]:
    """Log evidence of the likeliest whole with an effect kept by force over what was named, and its effects."""
    balance, kind = station.naming.balance.learning(), SIGNALS[station.signal]
    effects = (*catalogue(kind), *outsiders(kind))
    effect = next(e for e in effects if e.name == name)
    every: dict[Any, list[dict[str, float]]] = {}
    for shape in balance.grid(effect).shapes:
        every.setdefault(shape.get("form"), []).append(shape)
    starts = [shapes[len(shapes) // 2] for shapes in every.values()]  # of every form
    alone = scan(balance, effect, ())
    starts += [] if alone is None else [alone.terms[-1].shape]
    named = balance.fit(station.naming.fit.terms)
    with Pair(balance) as pair:
        wholes = [search(pair, effects, None, (Term(effect, shape),), held=name)[0] for shape in starts]
    best = max(wholes, key=lambda whole: favour(balance, whole, named))
    return favour(balance, best, named), tuple(t.effect.name for t in best.terms)


def missed(folder: Path, kind: str) -> list[tuple[str, dict[str, Any], list[str]]]:
    """Effects of sessions of a kind in a set that are not named (messy: the main one, among the first three): case, effect,
    what was named."""
    out = []
    for case, hidden in sorted(json.loads((folder / "answers.json").read_text()).items()):
        path = folder / "findings" / case / "findings.json"
        if hidden["case"] != kind or not path.exists():
            continue
        findings = json.loads(path.read_text())["findings"]
        named = [(f["effect"], f["where"]["finger"]) for f in findings]
        asked, told = (hidden["effects"][:1], named[:3]) if kind == "messy" else (hidden["effects"], named)
        out += [(case, e, [n for n, _ in named]) for e in asked if (e["effect"], e["finger"]) not in told]
    return out


def main() -> None:
    """Print a line per missed session."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("folders", nargs="+", type=Path, metavar="FOLDER")
    parser.add_argument("--kind", default="messy", choices=("messy", "weak", "single", "pair"))
    given = parser.parse_args()
    for folder in given.folders:
        for case, effect, named in missed(folder, given.kind):
            name, own = effect["effect"], {e.name: s for s, k in SIGNALS.items() for e in catalogue(k)}
            line = f"{folder.name} {case}: {name}, named {', '.join(named[:4]) or 'nothing'}"
            if name not in own:
                print(f"{line}: no balance tells it", flush=True)
                continue
            with single_threaded():
                heard, _ = hear(read_session(folder / "sessions" / case), lambda _: None, lambda: None)
                told = [s for s in heard.stations if s.finger == effect["finger"]]
                for station in (s for s in told if s.signal == own[name]):
                    kept = [f.term.effect.name for f in station.naming.found]
                    if name in kept:
                        print(f"{line}: named there", flush=True)
                        continue
                    brought, whole = forced(station, name)
                    beside = ", ".join(n for n in whole if n != name)
                    print(f"{line}: kept by force {brought:+.1f} nats, beside {beside}", flush=True)


if __name__ == "__main__":
    main()
