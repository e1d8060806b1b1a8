"""Effects of a simulated joint compete by the motion of recordings that they were not fitted to.

Every candidate is fitted to all training recordings first; the best few are fitted again with recordings left out, and
only the error on those decides. All fits of a round run in one batch of lanes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...background import Background
from ..evidence import BEYOND_DOUBT, ONE_STANDARD_ERROR, weigh
from .fit import Fitted, Task, fit_together
from .free import free_errors, swings_free
from .simulation import INDEX, LOW_SPEED, PARAMETERS, Swing, errors, vector
from .start import freed, started
from .variants import ZERO, Variant, acts, all_free, asked, begun, variants

Array = NDArray[np.float64]
FOLDS, MOST_FOLDS, SHORTLIST, ALIKE = 4, 10, 6, 3
LEAST_GAIN, MOST_TERMS, MOST_OF_FEW = 0.025, 5, 3  # of few recordings what is left after so many goes by many names
BETTER = 1.01  # an exchange of variants has to pay
FEW_RUNS, FEW_FREE = 500, 60  # a run of half swings costs more than one that is stepped beside others
PROFILED = 5  # times the runs of another fit, of one that looks for a low speed everywhere
PARTS = 4  # a recording's error is resampled in so many parts


@dataclass(frozen=True)
class Round:
    """A round of the competition: the winner, its probability against "none" and what it takes away, rivals with
    probabilities; all that is taken after it, in the variants of then, and the fit of that."""

    variant: Variant
    probability: float
    gain: float
    rivals: tuple[tuple[str, float], ...]
    equals: tuple[str, ...]
    fit: Fitted | None = None
    taken: tuple[Variant, ...] = ()


@dataclass(frozen=True)
class _Rival:
    """A variant added to those taken, its fit and the errors (blocks,) of what is left out. instead: of those taken,
    where one is in another form."""

    variant: Variant
    fit: Fitted
    error: Array
    instead: tuple[Variant, ...] | None = None


def _blocks(swing: Swing, theta: Array, lanes: Sequence[int]) -> Array:
    """Root mean square error (runs, PARTS) of every part of every stretch lanes[k] from the start that theta[k] asks
    for, (runs, len(PARAMETERS)):
    one part in which the joint sticks when it should not would outweigh all others if squares were added."""
    own = started(replace(swing, lanes=tuple(swing.lanes[i] for i in lanes)), theta)
    run = free_errors if swings_free(own) else errors
    residual = run(own, theta, np.arange(len(lanes)))
    parts = [np.array_split(residual[: len(lane.position), run], PARTS) for run, lane in enumerate(own.lanes)]
    return np.array([[float(np.sqrt(np.mean(p**2))) for p in run] for run in parts])


def fit_apart(swing: Swing, tasks: Sequence[Task], iterations: int = 14) -> list[Fitted]:
    """`fit_together` in two halves, one a core: tasks that need low-speed friction together, since all runs of a batch
    pay for what one of them has (of free swings none does). Few runs stay together: a step costs them hardly less than
    many."""
    free = swings_free(swing)
    cost = [len(t.stretches) * (len(t.free) + 1) * (PROFILED if free and t.profiles else 1) for t in tasks]
    if sum(cost) < (FEW_FREE if free else FEW_RUNS) or len(tasks) < 2:
        return fit_together(swing, tasks, iterations)
    order = sorted(range(len(tasks)), key=lambda k: bool(set(LOW_SPEED) & set(tasks[k].free)))
    done = np.cumsum([cost[k] for k in order])
    half = min(int(np.searchsorted(done, 0.5 * done[-1])) + 1, len(order) - 1)
    halves = order[:half], order[half:]
    calls = Background(fit_together, [(swing, [tasks[k] for k in h], iterations) for h in halves])
    fits = {k: f for h, result in zip(halves, calls.results(), strict=True) for k, f in zip(h, result, strict=True)}
    return [fits[k] for k in range(len(tasks))]


def fit_stages(stages: Sequence[Swing], tasks: Sequence[Task], iterations: int = 10) -> list[Fitted]:
    """Every task on one stage after the other, each from where the last ended; stages differ in their stretches."""
    fits: list[Fitted] = []
    for k, swing in enumerate(stages):
        train = tuple(int(i) for i in swing.train())
        start = [t.start for t in tasks] if k == 0 else [f.theta for f in fits]
        fits = fit_apart(
            swing, [replace(t, start=s, stretches=train) for t, s in zip(tasks, start, strict=True)], iterations
        )
    return fits


def compete_swing(
    stages: Sequence[Swing],
    current: Fitted,
    floor: float = 0.0,
    whole: Swing | None = None,
    begin: Sequence[tuple[Variant, Round]] = (),
    without: frozenset[str] = frozenset(),
) -> list[tuple[Variant, Round]]:
    """Forward selection from the declared model (fitted as current), by pairs where no variant alone is better, while
    the error is above what the recordings can tell (floor [rad or m]); returns the variants and their rounds, each with
    the fit of all taken so far. whole: the recordings uncut; those left out whole are predicted so, as the ones that
    validate are. begin: what stands already (current has it);
    without: effects, or forms of one by their key, that are not asked."""
    train = tuple(int(i) for i in stages[-1].train())
    test, folds = _folds(stages[-1], train, whole)
    if swings_free(stages[-1]):
        current = fit_stages(stages, [Task(asked(stages[-1], [v for v, _ in begin]), current.theta, ())])[0]
    taken, rounds = tuple(v for v, _ in begin), [r for _, r in begin]
    most = MOST_TERMS if len({stages[-1].lanes[i].trial for i in train}) >= FOLDS else MOST_OF_FEW
    while len(taken) < most:
        stages = [freed(s, current.theta) for s in stages]
        current, none, rivals = _round(stages, taken, current, test, folds, without)
        # a wrong law may fit to within the noise; what it predicts shows it
        if max(current.cost, np.mean(none**2)) <= floor**2:
            break
        if len(taken) == 1 and stages[-1].driven:
            rivals = [*rivals, *_otherwise(stages, taken[0], current, test, folds, without)]
        found = _judged(current, none, rivals, test, folds, floor)
        # what one leaves may hide it, as a late drive hides friction: two at once
        if found is None and rivals and not taken:
            pairs = _pairs(stages, rivals, current, test, folds, without)
            both = _judged(current, none, [p.rival for p in pairs], test, folds, floor, BEYOND_DOUBT)
            if both is not None:
                first, second = pairs[both[0]].variants
                current, taken = pairs[both[0]].rival.fit, (first, second)
                alone, said = pairs[both[0]].alone, both[1]
                rounds = [
                    replace(said, variant=v, rivals=((v.key, said.probability),), equals=(v.effect,), fit=f, taken=some)
                    for v, f, some in ((first, alone, (first,)), (second, current, taken))
                ]
                continue
        if found is None:
            break
        won = rivals[found[0]]
        stand = taken if won.instead is None else won.instead
        taken, current = _exchanged(stages, (*stand, won.variant), won.fit)
        rounds.append(replace(found[1], fit=current, taken=taken))
    zero = None if ZERO in taken or not swings_free(stages[-1]) else _zero(stages, taken, current, test, folds, floor)
    if zero is not None:
        taken, rounds = (*taken, ZERO), [*rounds, zero]
    return list(zip(taken, rounds, strict=True))


def _zero(stages: Sequence[Swing], taken: tuple[Variant, ...], current: Fitted, test: Swing, folds: list,
          floor: float) -> Round | None:  # fmt: skip
    """Whether an encoder's zero that is off is borne out beside all that was taken (current: with it)."""
    train = tuple(int(i) for i in stages[-1].train())
    task = Task(all_free(stages[-1], taken), np.where(np.isin(PARAMETERS, list(ZERO.start)), 0.0, current.theta), train)
    without = fit_apart(freed(stages[-1], current.theta), [task], 10)[0]
    with_ = Task(asked(stages[-1], taken), current.theta, train)
    none, (error,) = _left_out(stages[-1], test, folds, (task, without), [(with_, current)])
    found = _judged(without, none, [_Rival(ZERO, current, error)], test, folds, floor)
    return None if found is None else replace(found[1], fit=current, taken=(*taken, ZERO))


def _round(stages: Sequence[Swing], taken: tuple[Variant, ...], current: Fitted, test: Swing, folds: list,
           without: frozenset[str] = frozenset()) -> tuple[Fitted, Array, list[_Rival]]:  # fmt: skip
    """The fit of all taken so far, its errors (blocks,) of what is left out, and the best of those that might be
    added."""
    swing, train = stages[-1], tuple(int(i) for i in stages[-1].train())
    free = asked(swing, taken)
    others = [v for v in variants(swing) if not set(v.start) <= set(free) and not {v.effect, v.key} & without]
    tasks = [Task(asked(swing, (*taken, v)), begun(current.theta, v), (), True) for v in others]
    fits = fit_stages(stages, tasks, 8)
    order = _shortlist(others, fits)
    # nothing more has the same starts as they have, or they would win by theirs
    same = Task(free, current.theta, train)
    current, *best = _several(swing, [same, *(Task(tasks[k].free, fits[k].theta, train) for k in order)])
    none, scores = _left_out(
        swing, test, folds, (same, current), [(tasks[k], f) for k, f in zip(order, best, strict=True)]
    )
    return current, none, [_Rival(others[k], f, s) for k, f, s in zip(order, best, scores, strict=True)]


def _otherwise(stages: Sequence[Swing], first: Variant, current: Fitted, test: Swing, folds: list,
               without: frozenset[str]) -> list[_Rival]:  # fmt: skip
    """The best of another form of the first effect, with no more parameters, and a second effect: alone the form came
    nearest that makes up for what is still missing."""
    swing = stages[-1]
    size, every = len(swing.train()), variants(swing)
    plain = np.where(np.isin(PARAMETERS, list(first.start)), vector({}), current.theta)
    forms = [v for v in every if v.effect == first.effect and len(v.start) <= len(first.start)]
    forms = [v for v in forms if v.key not in {first.key, *without}]
    alone = fit_stages(stages, [Task(asked(swing, (v,)), begun(plain, v), (), True) for v in forms], 8)
    near = sorted(range(len(forms)), key=lambda k: _bic(alone[k], size))[:ALIKE]
    pairs = [(k, v) for k in near for v in every if v.effect != first.effect and not {v.effect, v.key} & without]
    tasks = [Task(asked(swing, (forms[k], v)), begun(alone[k].theta, v), (), True) for k, v in pairs]
    if not tasks:
        return []
    best = _nearest(stages, swing, tasks, [v for _, v in pairs], (first,), current, test, folds)
    return [_Rival(pairs[k][1], fit, error, (forms[pairs[k][0]],)) for k, fit, error in best]


def _nearest(stages: Sequence[Swing], swing: Swing, tasks: Sequence[Task], added: Sequence[Variant],
             taken: tuple[Variant, ...], current: Fitted, test: Swing, folds: list,
             ) -> list[tuple[int, Fitted, Array]]:  # fmt: skip
    """Which of the tasks fit best, one after the other on stages (added: what each adds), their last fit to `swing` and
    the errors (blocks,) of what is left out, beside those taken (current: fit of them)."""
    train = tuple(int(i) for i in swing.train())
    fits = fit_stages(stages, tasks, 8)
    order = _shortlist(added, fits)
    best = _several(swing, [Task(tasks[k].free, fits[k].theta, train) for k in order])
    none = Task(asked(swing, taken), current.theta, train), current
    scores = _left_out(swing, test, folds, none, [(tasks[k], f) for k, f in zip(order, best, strict=True)])[1]
    return list(zip(order, best, scores, strict=True))


@dataclass(frozen=True)
class _Two:
    """Two variants added at once, as a rival of none; alone: the fit of the first."""

    variants: tuple[Variant, Variant]
    rival: _Rival
    alone: Fitted


def _pairs(stages: Sequence[Swing], rivals: Sequence[_Rival], current: Fitted, test: Swing, folds: list,
           without: frozenset[str] = frozenset()) -> list[_Two]:  # fmt: skip
    """The best pairs of those that came nearest alone, and of the nearest with any other."""
    swing = stages[-1]
    near = sorted(rivals, key=lambda r: float(r.error.sum()))
    found = [(a, b.variant) for k, a in enumerate(near) for b in near[k + 1 :]]
    found += [
        (near[0], v) for v in variants(swing) if not {v.effect, v.key} & without and v not in [r.variant for r in near]
    ]
    apart = [(a, v) for a, v in found if v.effect != a.variant.effect and not set(v.start) & set(a.variant.start)]
    tasks = [Task(asked(swing, (a.variant, v)), begun(a.fit.theta, v), (), True) for a, v in apart]
    together = [Variant(f"{a.variant.effect} and {v.effect}", f"{a.variant.key} and {v.key}", {**a.variant.start, **v.start})
                for a, v in apart]  # fmt: skip
    best = _nearest([freed(s, near[0].fit.theta) for s in stages], swing, tasks, together, (), current, test, folds)
    return [
        _Two((apart[k][0].variant, apart[k][1]), _Rival(together[k], fit, error), apart[k][0].fit)
        for k, fit, error in best
    ]


def _judged(current: Fitted, none: Array, rivals: Sequence[_Rival], test: Swing, folds: list, floor: float,
            least: float = ONE_STANDARD_ERROR) -> tuple[int, Round] | None:  # fmt: skip
    """Index of the winner and what the round says. Only those are asked that explain what they were fitted to: another
    may predict what is left out by chance. What is left out of a swing that dies away counts as shares of what "none"
    leaves there (not below the floor [rad or m]), or its first turns would speak for all."""
    trials = [test.lanes[i].trial for _, some in folds for i in some]
    stretches = len({i for kept, _ in folds for i in kept})
    able = [k for k, r in enumerate(rivals) if r.fit.cost < (1 - LEAST_GAIN) ** 2 * current.cost]
    if not able:
        return None
    some = [rivals[k] for k in able]
    scale = np.ones(len(none)) if test.driven else np.maximum(none, max(floor, 1e-300))
    said = _judge(
        none / scale,
        [r.error / scale for r in some],
        [r.variant for r in some],
        [r.fit for r in some],
        np.repeat(trials, PARTS),
        stretches,
        least,
    )
    return None if said is None else (able[said[0]], said[1])


def _shortlist(rivals: Sequence[Variant], fits: Sequence[Fitted]) -> list[int]:
    """The best by training error, of one effect not more than a few variants."""
    out: list[int] = []
    for k in sorted(range(len(rivals)), key=lambda k: fits[k].cost):
        if sum(rivals[i].effect == rivals[k].effect for i in out) < ALIKE and len(out) < SHORTLIST:
            out.append(k)
    return out


def _exchanged(
    stages: Sequence[Swing], taken: tuple[Variant, ...], current: Fitted
) -> tuple[tuple[Variant, ...], Fitted]:
    """Another variant of an effect that was taken before, where beside the later ones it fits better with no more
    parameters, or as well with fewer (by likelihood, `_bic`): what made up for a later effect goes."""
    swing = stages[-1]
    if len(taken) < 2:
        return taken, current
    sets = [(*taken[:k], other, *taken[k + 1 :]) for k, v in enumerate(taken) for other in variants(swing)
            if other.effect == v.effect and other.key != v.key and len(other.start) <= len(v.start)]  # fmt: skip
    if not sets:
        return taken, current
    tasks = []
    for group in sets:
        theta = current.theta.copy()
        for name in {n for v in taken for n in v.start} - {n for v in group for n in v.start}:
            theta[INDEX[name]] = vector({})[INDEX[name]]
        for v in group:
            theta = begun(theta, v) if v not in taken else theta
        tasks.append(Task(asked(swing, group), theta, (), True))
    fits = fit_stages(stages, tasks, 12)
    size = len(swing.train())
    # one that has shrunk to nothing is no other form of what was taken
    able = [k for k, group in enumerate(sets) if all(acts(v, fits[k].theta) for v in group)]
    if not able:
        return taken, current
    best = min(able, key=lambda k: _bic(fits[k], size))
    pays = _bic(fits[best], size) + size * np.log(BETTER) < _bic(replace(current, free=len(asked(swing, taken))), size)
    return (sets[best], fits[best]) if pays else (taken, current)


def _bic(fit: Fitted, stretches: int) -> float:
    """Of a fit, every stretch one sample (Schwarz 1978)."""
    return float(stretches * np.log(fit.cost) + fit.free * np.log(stretches))


def _several(swing: Swing, tasks: Sequence[Task], starts: int = 2, iterations: int = 8) -> list[Fitted]:
    """Every task from several starts around its own, in one batch; the best of each."""
    more, starts = [], 1 if swings_free(swing) else starts  # of these fits nothing hangs on the start
    for task in tasks:
        random = np.random.default_rng(2)
        free = [INDEX[n] for n in task.free]
        for k in range(starts):
            theta = task.start.copy()
            theta[free] *= np.exp(random.normal(0.0, 0.3, len(free))) if k else 1.0
            more.append(replace(task, start=theta))
    fits = fit_apart(swing, more, iterations)
    return [min(fits[k * starts : (k + 1) * starts], key=lambda f: f.cost) for k in range(len(tasks))]


def _folds(
    swing: Swing, train: Sequence[int], whole: Swing | None = None
) -> tuple[Swing, list[tuple[tuple[int, ...], tuple[int, ...]]]]:
    """The swing in which errors are measured, and (stretches kept, stretches of it left out): recordings are left out
    whole where there are several, as the validation trials are, each alone (two of a kind together would leave unknown
    what they alone show, a damping that is not the motor's, and the truest law at a loss) while they are not too many;
    else neighbouring stretches together: what is held out then lies elsewhere in the motion, and a term that fits only
    where it was fitted is told (blocked cross-validation, Roberts et al. 2017)."""
    trials = {name: k for k, name in enumerate(dict.fromkeys(swing.lanes[i].trial for i in train))}
    if len(trials) < FOLDS:
        count = min(FOLDS, len(train))
        fold = [k * count // len(train) for k in range(len(train))]
        return swing, [_parted(train, fold, train, fold, f) for f in range(count)]
    test, count = whole or swing, min(len(trials), MOST_FOLDS)
    fold, apart = (
        [trials[s.lanes[i].trial] % count for i in some] for s, some in ((swing, train), (test, test.train()))
    )
    return test, [_parted(train, fold, test.train(), apart, f) for f in range(count)]


def _parted(train: Sequence[int], fold: Sequence[int], test: Sequence[int], apart: Sequence[int], f: int) -> tuple:
    """Stretches of all folds but f to fit to, and those of fold f to measure on."""
    return tuple(i for i, g in zip(train, fold, strict=True) if g != f), tuple(
        i for i, g in zip(test, apart, strict=True) if g == f
    )


def _left_out(
    swing: Swing, test: Swing, folds: list, none: tuple[Task, Fitted], rivals: list[tuple[Task, Fitted]]
) -> tuple[Array, list[Array]]:
    """Block errors of "none" and of each rival on what is left out of `test`."""
    everyone = [none, *rivals]
    tasks = [replace(task, start=fit.theta, stretches=kept, wide=False) for task, fit in everyone for kept, _ in folds]
    fits = fit_apart(swing, tasks, 3)
    apart = [left for _ in everyone for _, left in folds]
    theta = np.concatenate([np.repeat(fit.theta[None], len(left), 0) for fit, left in zip(fits, apart, strict=True)])
    out = _blocks(test, theta, [i for left in apart for i in left]).reshape(len(everyone), -1)
    return out[0], list(out[1:])


def _judge(
    none: Array,
    scores: list[Array],
    rivals: Sequence[Variant],
    fits: Sequence[Fitted],
    group: Array,
    stretches: int,
    least: float = ONE_STANDARD_ERROR,
) -> tuple[int, Round] | None:
    """Index of the winner and what the round says, or None where nothing beats "none" (with probability `least`, by a
    standard error). Which effect it is, recordings left out decide; between what they leave within a standard error,
    and forms of one that they cannot tell apart, the likelihood: BIC with every stretch as one sample (Schwarz 1978).
    One that has more parameters has to predict what is left out better as well."""
    said = weigh(none, np.array(scores), [f.free for f in fits], group, least, worth=LEAST_GAIN)
    if said is None:
        return None
    same = tuple(dict.fromkeys(rivals[k].effect for k in said.close))
    wins = tuple((rivals[k].key, float(said.wins[k])) for k in np.argsort(-said.wins) if said.wins[k] > 0.005)
    first = said.chosen
    forms = [k for k in {*said.close, *said.tied, first} if k in said.tied or rivals[k].effect == rivals[first].effect
             and (fits[k].free <= fits[first].free or scores[k].sum() <= scores[first].sum())]  # fmt: skip
    best = min(forms, key=lambda k: _bic(fits[k], stretches))
    gain = float(1.0 - scores[best].sum() / max(none.sum(), 1e-300))
    return best, Round(rivals[best], said.probability, gain, wins, same)
