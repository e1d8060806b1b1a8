"""Make a set of recordings with something hidden in them, and the answers beside it."""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from fifth_recorder.effects.table import EXCLUSIVE, INSIDE, OUTSIDE
from fifth_recorder.plan import Plan, healthy
from fifth_recorder.session import Session, draw_session, hold_differently, write_session
from fifth_recorder.simulate import happen
from fifth_recorder.sizing import MAIN_NATS, NATS, TRACE_NATS, Bench, Hidden, draw_sized, hidden, weak_strength
from fifth_recorder.stepper import library

KINDS = ("single", "none", "outside", "pair", "weak", "messy")
TRACE = 0.1


@dataclass
class Case:
    """What one recording is to hide."""

    kind: str
    effects: tuple[str, ...]
    seed: int


def make_set(out: Path, seed: int, counts: dict[str, int]) -> None:
    """Write `out/case_000/...` and `out.answers/answers.json`; counts by kind of KINDS.

    Raises ValueError for another kind, CompilerError where there is no C compiler."""
    unknown = set(counts) - set(KINDS)
    if unknown:
        raise ValueError(f"unknown kinds {sorted(unknown)}; known are {', '.join(KINDS)}")
    library()  # before anything is written
    rng = np.random.default_rng([seed, 5])
    cases = _cases(rng, counts)
    answers = []
    for number, case in enumerate(cases):
        folder = out / f"case_{number:03d}"
        answers.append({"case": folder.name, **make_case(folder, case)})
    place = out.with_name(out.name + ".answers")
    place.mkdir(parents=True, exist_ok=True)
    (place / "answers.json").write_text(json.dumps(answers, indent=1, default=_plain))


def _plain(value: object) -> object:
    return value.tolist() if isinstance(value, np.ndarray | np.generic) else str(value)


def _cases(rng: np.random.Generator, counts: dict[str, int]) -> list[Case]:
    inside, outside = list(INSIDE), list(OUTSIDE)
    messy = [e for e in inside if e not in EXCLUSIVE]

    def cycle(names: list[str], n: int) -> list[str]:
        order = [q for _ in range(n // len(names) + 1) for q in rng.permutation(names).tolist()]
        return order[:n]

    chosen: list[tuple[str, tuple[str, ...]]] = [("single", (e,)) for e in cycle(inside, counts.get("single", 0))]
    chosen += [("none", ())] * counts.get("none", 0)
    chosen += [("outside", (e,)) for e in cycle(outside, counts.get("outside", 0))]
    chosen += [("pair", tuple(rng.choice(messy, 2, replace=False).tolist())) for _ in range(counts.get("pair", 0))]
    chosen += [("weak", (e,)) for e in cycle(messy, counts.get("weak", 0))]
    chosen += [("messy", (e,)) for e in cycle(messy, counts.get("messy", 0))]
    order = rng.permutation(len(chosen))
    return [Case(*chosen[i], int(rng.integers(2**31))) for i in order]


def make_case(folder: Path, case: Case) -> dict:
    """Record one case; returns its answer."""
    rng = np.random.default_rng(case.seed)
    session = draw_session(rng, weak=case.kind == "weak")
    _prepare(session, case, rng)
    names = list(session.fingers)
    main = str(rng.choice(names))
    where = [main] * len(case.effects)
    if case.kind == "pair" and rng.random() < 0.4:
        where[1] = next(q for q in names if q != main)
    plans = {name: healthy(session.fingers[name], session.lab) for name in names}
    benches: dict[str, Bench] = {}
    effects, traces = [], []
    if "gravity_load" in case.effects and rng.random() < 0.67:
        hold_differently(session, where[case.effects.index("gravity_load")], rng)
    for effect, finger in zip(case.effects, where):
        bench = benches.setdefault(finger, _bench(session, finger))
        option, size, shown = draw_sized(effect, bench, rng, (MAIN_NATS if case.kind == "messy" else NATS, np.inf))
        if case.kind == "weak":
            size, shown = weak_strength(option, bench, size)
        effects.append(_enter(hidden(effect, bench, option, size, shown), plans))
    if case.kind == "messy":
        traces = [_enter(q, plans) for q in _traces(case.effects[0], benches[main], rng)]
    write_session(session, plans, folder, rng)
    return {"kind": case.kind, "seed": case.seed, "effects": effects, "settings": {"traces": traces, **_drawn(session)}}


def _bench(session: Session, finger: str) -> Bench:
    trials = session.trials[finger]
    calm = happen(healthy(session.fingers[finger], session.lab), trials)
    return Bench(session.fingers[finger], session.lab, session.palm, trials, calm)


def _prepare(session: Session, case: Case, rng: np.random.Generator) -> None:
    if "asymmetric_friction" in case.effects:  # can be known only if motors are alike in preload
        one, two = (f.motor for f in session.fingers.values())
        two.tau0 = min(one.tau0 * rng.uniform(0.9, 1.1), 0.8 * two.Fc)
        one.tau0 = min(one.tau0, two.tau0 * 1.12)


def _traces(main: str, bench: Bench, rng: np.random.Generator) -> list[Hidden]:
    """Every other effect at a tenth of the strength that it would have alone."""
    out = []
    for effect in INSIDE:
        if effect == main or effect in EXCLUSIVE:
            continue
        option, size, _ = draw_sized(effect, bench, rng, (NATS, TRACE_NATS), every=9)
        size *= TRACE
        out.append(hidden(effect, bench, option, size, bench.gain(option, size, every=9)))
    return out


def _enter(what: Hidden, plans: dict[str, Plan]) -> dict:
    figures = what.option.apply(plans[what.finger], what.size)
    if what.option.form == "both_fingers":
        for name, plan in plans.items():
            if name != what.finger:
                what.option.apply(plan, what.size)
    by_channel = {k: round(v, 2) for k, v in asdict(what.gain).items() if k not in ("rows", "frames")}
    return {
        "effect": what.effect,
        "finger": what.finger,
        "joint": what.option.joint,
        "actuator": what.actuator,
        "marker": what.option.marker,
        "form": what.option.form,
        "size": round(what.size, 4),
        "gain_nats": round(what.gain.total, 2),
        "figures": {**figures, "nats_by_channel": by_channel, "error_increase": round(what.gain.error_increase(), 4)},
    }


def _drawn(session: Session) -> dict:
    return {
        "lab": asdict(session.lab),
        "motors": {n: asdict(f.motor) for n, f in session.fingers.items()},
        "kinematics": {
            n: {"axes": f.axes, "centres": f.centres, "angle_full": f.full, "coef": f.coef}
            for n, f in session.fingers.items()
        },
    }
