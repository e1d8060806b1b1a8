"""One joint driven by a voltage or by nothing: what is missing, by the motion that MuJoCo simulates in open loop."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from ...background import Background
from ...session import Session
from ..declared import DeclaredFit
from ..findings import NOT_BORNE_OUT, NOT_TOLD, Finding, measured, whereabouts
from ..model import RigModel, load_rig
from ..replay import RigResiduals, replay_rig
from ..states import fill_gaps, noise_std
from ..words import alternatives, shares, statement
from .build import build_swing, last_step_s, search_step_s, thinned, windows_s
from .compete import LEAST_GAIN, Round, compete_swing, fit_apart, fit_stages
from .fit import Fitted, Task
from .free import swings_free
from .interval import intervals
from .patch import write_swing
from .simulation import INDEX, NEUTRAL, PARAMETERS, STEP_S, Swing, parameter_units, vector
from .start import freed, started_each
from .variants import Variant, all_free, begun, free_declared

RESAMPLES = 500
MOST_SEARCHES = 2
SMALL = 0.005  # of the declared squared error: less beside an earlier effect may be its form being another
HALVED = 0.5  # of the squared error before: what leaves less says more than that
Taken = tuple[Variant, Round]
Ends = Mapping[str, tuple[float, float]]


def diagnose_swing(rig: RigModel, session: Session, fit: DeclaredFit, say: Callable[[str], None]) -> tuple:
    """The same for one joint driven by a voltage or by nothing: MuJoCo's motion in open loop is what is compared."""
    windows, step = windows_s(rig), search_step_s(rig)
    stages = [thinned(build_swing(rig, fit, step, w)) for w in windows]
    free = free_declared(stages[0])
    declared = fit_stages(stages, [Task(free, vector(stages[0].initial), ())], 15)[0]
    if not stages[0].driven:
        stages = [freed(stages[-1], declared.theta)]
        declared = fit_stages(stages, [Task(free, declared.theta, ())], 15)[0]
    floor, held = _resolution(rig), bool(rig.select(True))  # without validation recordings the training ones measure
    whole = build_swing(rig, fit, step)
    # Last, as the replay has it: a free swing over whole recordings, for its phase is known well enough by now. Where it
    # is stepped, the last steps take back what a coarse step does to the period.
    if stages[0].driven:
        last_stages = [(STEP_S, windows[-1], 8)]
    elif swings_free(whole):
        last_stages = [(last_step_s(rig), np.inf, 20)]
    else:
        last_stages = [(2 * step, windows[-1], 8), (2 * step, np.inf, 12), (2 * STEP_S, np.inf, 3)]
    fine = [(build_swing(rig, fit, step_s, window_s), most) for step_s, window_s, most in last_stages]
    known: dict[tuple[str, ...], Link] = {}

    def links_of(sets: Sequence[Sequence[Taken]]) -> list[Link]:
        last = next((some[-1][1].fit.theta for some in reversed(sets) if some), declared.theta)
        return _links(rig, session, held, fine, declared.theta, sets, last, known)

    def chain_of(some: Sequence[Taken]) -> list[Link]:
        return links_of([some[:k] for k in range(len(some) + 1)])

    def ends_of(link: Link) -> Ends:
        return intervals(
            freed(build_swing(rig, fit, STEP_S if stages[0].driven else step, windows[-1]), link.fit.theta),
            link.free,
            link.fit.theta,
        )

    def search(kept: list[Taken], without: frozenset[str]) -> list[Taken]:
        taken = compete_swing(stages, kept[-1][1].fit if kept else declared, floor, whole, kept, without)
        say(f"{rig.name}: {', '.join(v.key for v, _ in taken) or 'nothing'}")
        return taken

    kept, chain, ends, rejected = _searched(search, chain_of, ends_of, links_of)
    figures = _figures(kept, chain, links_of)
    found = []
    for k, (variant, round_) in enumerate(kept):
        before, after = _sides(kept, chain, k, chain_of)
        proof = {"metric": "position_rmse", "unit": rig.unit(rig.joints[0]), "before": before.error, "after": after.error,
                 "noise_floor": floor, "ci95_reduction": _fall(before.replay, after.replay, held),
                 "held_out": [t.name for t in rig.select(True)], "engine": "mujoco"}  # fmt: skip
        found.append(_swing_finding(rig, variant, round_, ends, chain[-1], proof))
    means = [c.replay.figure("position_mae", held) for c in (chain[0], chain[-1])]
    lack = {"metric": "position_rmse", "unit": rig.unit(rig.joints[0]), "before": figures[0], "after": figures[-1],
            "one_effect": figures[min(1, len(figures) - 1)],
            "two_effects": figures[min(2, len(figures) - 1)], "engine": "mujoco", "mae_before": means[0], "mae_after": means[1],
            "noise_floor": floor, "diverged": {side: [r.trial for r in c.replay.joints if r.diverged]
                                               for side, c in (("before", chain[0]), ("after", chain[-1]))},
            "declared": {n: float(chain[0].fit.theta[INDEX[n]]) for n in free}}  # fmt: skip
    return shares(found, {rig.joints[0]: lack}), rejected, lack, chain[-1].xml, chain[0].xml


@dataclass(frozen=True)
class Link:
    """The declared model with some effects: free parameters, their fit, the file, its replay, and the held-out error of
    that; stayed: the same of the recordings that the simulation does not leave, of all where it leaves each."""

    free: tuple[str, ...]
    fit: Fitted
    xml: bytes
    replay: RigResiduals
    error: float
    stayed: float


def _searched(search: Callable[[list[Taken], frozenset[str]], list[Taken]], chain_of: Callable[[Sequence[Taken]], list[Link]],
              ends_of: Callable[[Link], Ends], links_of: Callable[[Sequence[Sequence[Taken]]], list[Link]],
              ) -> tuple[list[Taken], list[Link], Ends, list[dict[str, Any]]]:  # fmt: skip
    """What `_told` leaves of a search; an effect that came last and whose size cannot be told leaves its place to what
    came next to it, and so do forms of which none predicts what was held out. Where all that a search found predicts no
    better than what stood before one of its rounds, that stands."""
    kept: list[Taken] = []
    vague: frozenset[str] = frozenset()
    rejected: list[dict[str, Any]] = []
    for _ in range(MOST_SEARCHES):
        taken = search(kept, vague)
        kept, chain, ends, more = _told(taken, chain_of, ends_of)
        earlier = [[], *_states(taken)[:-1]]
        errors = [link.error for link in links_of(earlier)]
        if not chain[-1].error < (1.0 - LEAST_GAIN) * min(errors):
            gone = [v for v, _ in kept]
            kept, chain, ends, _ = _told(earlier[int(np.argmin(errors))], chain_of, ends_of)
            more += [{"effect": v.key, "reason": NOT_BORNE_OUT} for v in gone]
        rejected += [r for r in more if r not in rejected]
        told = vague | {v.effect for v, _ in taken if {"effect": v.key, "reason": NOT_TOLD} in more}
        told |= set() if kept else {v.key for v, _ in taken}  # in another form it may predict what this one does not
        if told == vague or kept != taken[: len(kept)]:
            break
        vague = told
    return kept, chain, ends, [r for r in rejected if r["effect"] not in {v.key for v, _ in kept}]


def _states(taken: Sequence[Taken]) -> list[list[Taken]]:
    """What stood after every round, in the variants of then: a later round may exchange them."""
    rounds = [r for _, r in taken]
    return [list(zip(r.taken, rounds, strict=False)) for r in rounds]


def _figures(
    kept: Sequence[Taken], chain: Sequence[Link], links_of: Callable[[Sequence[Sequence[Taken]]], list[Link]]
) -> list[float]:
    """Held-out error of the declared model and with one, two, ... of the effects, in the variants that suited them
    before the later ones came; in those of the last round, one after the other, where the search had others then."""
    figures, every = [c.error for c in chain], Counter(v.effect for v, _ in kept)
    own = {len(s): s for s in _states(kept) if len(s) < len(kept) and Counter(v.effect for v, _ in s) <= every}
    for count, link in zip(own, links_of(list(own.values())), strict=True):
        figures[count] = link.error
    return figures


def _told(kept: list[Taken], chain_of: Callable[[Sequence[Taken]], list[Link]],
          ends_of: Callable[[Link], Ends]) -> tuple[list[Taken], list[Link], Ends, list[dict[str, Any]]]:  # fmt: skip
    """`_standing`, and of those that stand the ones whose size is told from zero, with the interval of every
    parameter."""
    rejected: list[dict[str, Any]] = []
    while True:
        kept, chain, more = _standing(kept, chain_of)
        rejected, ends = [*rejected, *more], ends_of(chain[-1])
        vague = [
            k
            for k, (v, _) in enumerate(kept)
            if all(ends[n][0] <= 0.0 <= ends[n][1] for n in v.start if n not in NEUTRAL)
        ]
        if not vague:
            return kept, chain, ends, rejected
        rejected.append({"effect": kept[vague[-1]][0].key, "reason": NOT_TOLD})
        kept = [*kept[: vague[-1]], *kept[vague[-1] + 1 :]]


def _standing(
    kept: list[Taken], chain_of: Callable[[Sequence[Taken]], list[Link]]
) -> tuple[list[Taken], list[Link], list[dict[str, Any]]]:
    """Effects that stand, the chain of models with them, and those withdrawn: an effect falls when all that stand
    predict the recordings held out no worse without it. One that has to wait for a later one before it helps comes
    after it, where the others do without it so far."""
    needed: set[str] = set()
    rejected: list[dict[str, Any]] = []
    chain = chain_of(kept)
    while True:
        falls = _falls(chain)
        worse = next((k for k, fell in enumerate(falls) if not fell and kept[k][0].key not in needed), None)
        if worse is None:
            return kept, chain, rejected
        others = [*kept[:worse], *kept[worse + 1 :]]
        without, key = chain_of(others), kept[worse][0].key
        if not _better(chain[-1], without[-1], chain[0]):
            rejected.append({"effect": key, "reason": NOT_BORNE_OUT})
            kept, chain = others, without
            continue
        needed.add(key)
        if all(_falls(without)):
            kept, chain = [*others, kept[worse]], [*without, chain[-1]]


def _sides(
    kept: Sequence[Taken], chain: Sequence[Link], k: int, chain_of: Callable[[Sequence[Taken]], list[Link]]
) -> tuple[Link, Link]:
    """What an effect is held to: the chain before and after it; of one that helps the later ones, all without and with
    it."""
    if _falls(chain)[k]:
        return chain[k], chain[k + 1]
    return chain_of([*kept[:k], *kept[k + 1 :]])[-1], chain[-1]


def _falls(chain: Sequence[Link]) -> list[bool]:
    """Whether each effect of a chain lowers the held-out error by enough where it comes in."""
    return [_better(b, a, chain[0]) for a, b in pairwise(chain)]


def _better(one: Link, other: Link, declared: Link) -> bool:
    """Whether one model predicts the recordings held out better than another; beside earlier effects only what takes a
    share of the declared model's squared error, or most of what they left, is more than their form being another. How
    far off a simulation is that has left a recording says nothing."""
    least = 0.0 if other is declared or one.error**2 < HALVED * other.error**2 else SMALL * declared.stayed**2
    return one.error < (1.0 - LEAST_GAIN) * other.error and other.error**2 - one.error**2 >= least


def _links(rig: RigModel, session: Session, held: bool, stages: Sequence[tuple[Swing, int]], declared: np.ndarray,
           sets: Sequence[Sequence[Taken]], last: np.ndarray, known: dict[tuple[str, ...], Link]) -> list[Link]:  # fmt: skip
    """The declared model with every set of effects: fitted in one batch, written and replayed; stages: each with its
    most iterations;
    last: parameters that know all effects; known holds those that were before, by the effects in them."""
    keys = [tuple(v.key for v, _ in some) for some in sets]
    new = {key: some for key, some in zip(keys, sets, strict=True) if key not in known}
    free = [all_free(stages[0][0], [v for v, _ in some]) for some in new.values()]
    tries = [(k, start) for k, some in enumerate(new.values()) for start in _starts(free[k], some, declared, last)]
    for stage, most in stages if new else ():
        swing, stretches = started_each(stage, [start for _, start in tries])
        fits = fit_apart(
            swing, [Task(free[k], start, some, True) for (k, start), some in zip(tries, stretches, strict=True)], most
        )
        best = [
            min((f for (i, _), f in zip(tries, fits, strict=True) if i == k), key=lambda f: f.cost)
            for k in range(len(free))
        ]
        tries = [(k, f.theta) for k, f in enumerate(best)]
    files = [write_swing(rig, stages[0][0], theta) for _, theta in tries]
    replays = Background(_replayed, [(session, x, held) for x in files]).results() if files else ()
    for k, (key, x, r) in enumerate(zip(new, files, replays, strict=True)):
        stayed = RigResiduals(tuple(j for j in r.joints if j.followed)).figure("position_rmse", held)
        error = r.figure("position_rmse", held)
        known[key] = Link(free[k], best[k], x, r, error, stayed if np.isfinite(stayed) else error)
    return [known[key] for key in keys]


def _starts(free: Sequence[str], some: Sequence[Taken], declared: np.ndarray, last: np.ndarray) -> list[np.ndarray]:
    """Parameters to start a fit of some effects from: those of the last one's own round. Where a variant has since been
    exchanged for another, what that round does not know as the `last` one has it, which knew later effects; and, for
    that may lead astray, what the variants begin from beside the declared model."""
    neutral = vector({})
    if not some:
        return [declared]
    own, effects = some[-1][1].fit.theta, [v for v, _ in some]
    starts = [np.where(np.isin(PARAMETERS, free), np.where(own == neutral, last, own), neutral)]
    if any(own[INDEX[n]] == neutral[INDEX[n]] for v in effects for n in v.start):
        fresh = declared.copy()
        for v in effects:
            fresh = begun(fresh, v)
        starts.append(fresh)
    return starts


def _replayed(session: Session, xml: bytes, held: bool) -> RigResiduals:
    return replay_rig(session, load_rig(session, xml), efforts=False, validate=held)


def _resolution(rig: RigModel) -> float:
    """What a recording cannot tell from no error: encoder noise, and of a driven joint the way that it goes within one
    sample, for position and drive are read at some instant of it (uniform: step / sqrt(12))."""
    joint, floors = rig.joints[0], []
    for t in rig.trials:
        q = fill_gaps(t.time_s, t.position[joint])
        step = float(np.median(np.diff(t.time_s))) if rig.drive(joint) is not None else 0.0
        floors.append(np.hypot(noise_std(q, t.time_s), float(np.std(np.gradient(q, t.time_s))) * step / np.sqrt(12.0)))
    return float(np.median(floors))


def _fall(before: Any, after: Any, held: bool) -> list[float]:
    """95 % interval of the fall of the held-out rmse, recordings resampled."""
    a = np.array([r.position_rmse**2 for r in before.joints if r.validate == held])
    b = np.array([r.position_rmse**2 for r in after.joints if r.validate == held])
    draw = np.random.default_rng(0).integers(0, len(a), (RESAMPLES, len(a)))
    fall = np.sqrt(a[draw].mean(1)) - np.sqrt(b[draw].mean(1))
    return [float(x) for x in np.percentile(fall, [2.5, 97.5])]


def _swing_finding(rig: RigModel, variant: Variant, round_: Round, ends: Ends, link: Link,
                   proof: dict) -> Finding:  # fmt: skip
    """parameters: beside all effects that were kept (link), with their intervals (ends)."""
    joint = rig.joints[0]
    units = parameter_units(rig.unit(joint), rig.effort_unit(joint))
    parameters = {n: {"value": float(link.fit.theta[INDEX[n]]), "unit": units.get(n, "1"), "ci95": list(ends[n])}
                  for n in variant.start}  # fmt: skip
    fall = max(proof["before"] ** 2 - proof["after"] ** 2, 0.0)
    where = whereabouts(joint, rig.drive(joint), "position", measured(rig, proof), fall)
    native = set(variant.start) <= {"drag"}
    members = (variant.effect, *(e for e in round_.equals if e != variant.effect))
    return Finding(
        variant.effect, members, *alternatives(round_.rivals, variant.effect, round_.probability, len(members)), where,
        statement(variant.effect, variant.form, joint, parameters, proof), parameters, proof,
        {"native": native, "mjcf": f"joint[@name='{joint}']/@damping" if native else 'custom/text[@name="hand_model"]',
         "urdf": "not expressible: kept in rig.xml"},
    )  # fmt: skip
