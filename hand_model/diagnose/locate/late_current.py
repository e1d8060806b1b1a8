"""Late current: which drives' currents are logged late, by answers to commands, by simulation and by the balance."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np

from ...effects import catalogue
from ...effects.base import SURE_DELAY, UNSEEN_DELAY, DriveState
from ..name.balance import Balance, Fit
from ..name.evidence import gain
from ..name.shapes import polish, scan
from ..name.term import Term
from .answers import Lateness, lateness
from .command import BEYOND_CHANCE, EARLY, PLAINLY_LATE, CommandFacts, with_lateness
from .drive import with_gives
from .simulated import SimulatedDrive

# log likelihood that a shift of a drive's current must bring: less, and its drive tells none (two standard deviations)
DELAY_TOLD = 2.0
SEEN = 0.5  # the same of a shift that is told otherwise (one standard deviation)
ALIKE = 2.0  # standard deviations of answers within which they and what else is told say the same
SURELY = 3.0  # standard deviations by which a simulation and answers each say a current late, and it is
# standard deviations by which a simulation that explains the motion says alone that a current is not in time
PLAIN = 4.5
ANSWERED = 1.5  # standard deviations by which answers bear a simulated lateness out


def timed_drives(
    drives: dict[str, tuple[DriveState, ...]], facts: dict[str, CommandFacts], simulated: dict[str, SimulatedDrive]
) -> tuple[dict[str, tuple[DriveState, ...]], dict[str, bool]]:
    """The drives with what is known of their current's lateness, and whether each may be late."""
    explained = {a: s for a, s in simulated.items() if s.motions}
    untimely = {a: s.delay_s for a, s in explained.items() if abs(s.delay_s) > PLAIN * s.doubt_s}
    if 0 < len(untimely) < len(drives):  # else an early one that seems to give nothing makes the others' gives odd
        drives = with_gives(drives, [a for a in drives if a not in untimely], untimely)
    timed = with_lateness(drives, facts, simulated)
    late = _late(drives, timed, lateness({a: f.answers for a, f in facts.items()}), explained)
    in_time = [a for a in drives if not late[a]]
    if 0 < len(in_time) < len(drives):  # at a reversal a late current looks like a give, an early one like none
        known = {a: float(s[0].extra["late"][0]) for a, s in timed.items() if late[a] and _told(s)}
        timed = with_lateness(with_gives(drives, in_time, known), facts, simulated)
    return timed, late


def _late(
    drives: dict[str, tuple[DriveState, ...]],
    timed: dict[str, tuple[DriveState, ...]],
    answered: dict[str, Lateness],
    explained: Collection[str] = (),
) -> dict[str, bool]:
    """Whether each drive's current may be delayed: a delay that all drives of a session share is how the log is read.
    Answers to commands tell a late or an early current better than the balance does, and must bear it out. timed: the
    drives with what these answers, or simulations, tell, which says nothing yet to the balance. answered: by the answers
    alone. explained: the drives whose motion a simulation explains."""
    nearest, brought, seen_s = dict[str, float](), dict[str, float](), dict[str, tuple[float, float]]()
    for actuator, states in drives.items():
        balance = Balance(states)
        fit = scan(balance, _delay(), ())
        polished = None if fit is None else polish(balance, fit, 0)
        brought[actuator] = 0.0 if polished is None else gain(balance, polished, balance.fit())
        shape = {"form": 0.0, "delay": 0.0} if polished is None else polished.terms[0].shape
        nearest[actuator], seen_s[actuator] = shape["delay"], _delay().lateness(shape)
    best = {a: delay_s if brought[a] > DELAY_TOLD else 0.0 for a, delay_s in nearest.items()}
    step = {a: float(np.median(np.diff(s[0].time_s))) for a, s in drives.items()}
    # a lone drive cannot tell how the log is read from what its own channel does: twice as much is asked of it
    common, least = (min(best.values(), key=abs), UNSEEN_DELAY) if len(best) > 1 else (0.0, 2.0)
    late = {a: s[0].extra["late"] for a, s in timed.items() if "late" in s[0].extra}

    def borne_out(actuator: str) -> bool:
        x, bound = best[actuator] - common, least * step[actuator]
        if actuator not in late:
            return abs(x) > bound
        earliest, latest = seen_s[actuator]
        told, doubt = late[actuator].tolist()
        beyond_chance = brought[actuator] > BEYOND_CHANCE
        if actuator in explained and not _drive_late(answered.get(actuator)) and abs(told) > PLAIN * doubt:
            # it moves as its controller is taken for, and as soon
            return not _denied(answered.get(actuator), told, doubt, SURELY)
        # a controller that is another than simulated looks like a delay
        if _denied(answered.get(actuator), told, doubt):
            return beyond_chance and told * x > 0 and abs(x) > bound
        if _surely_late(answered.get(actuator), told, doubt, bound):
            return True
        if earliest < latest and beyond_chance and x > bound:
            # behind a filter answers tell little of how late it is: they must not deny it
            return earliest - ALIKE * doubt < told < latest + ALIKE * doubt
        plain = beyond_chance and abs(told - best[actuator]) < ALIKE * doubt
        # `least_delay` by the step that the bound is made of, so that no rounding decides
        if (told_to := min(UNSEEN_DELAY * step[actuator], SURE_DELAY * doubt)) < bound:
            # less than a sample: what a simulation says the balance, or answers, must see, if barely
            in_balance = told * nearest[actuator] > 0 and brought[actuator] > SEEN
            seen = abs(told) > bound or in_balance or _answers_so(answered.get(actuator), told)
            most = max(abs(told), abs(best[actuator]) if plain else 0.0)
            # and to the side to which the balance would shift it
            return seen and most > told_to and told * best[actuator] >= 0
        if plain and told * x > 0 and abs(x) > bound:
            return True
        # what answers alone may say by chance they say for sure where the balance would shift the current so, too
        early = ANSWERED if beyond_chance and nearest[actuator] < 0 else EARLY
        if told < -max(bound, early * doubt):
            return True
        if x >= -bound:
            return told > bound
        others = [float(np.sum(value)) for a, value in late.items() if a != actuator]
        return not others or max(others) - told > bound  # who is early answers before the others

    return {a: borne_out(a) for a in best}


def current_in_time(balance: Balance, fit: Fit) -> bool:
    """Whether a drive's balance plainly says that its current is not late, where answers to commands plainly say it is:
    what answers late is the drive then, and breaks loose sooner than the others. fit: what was named."""
    state = balance.states[0]
    late_s, doubt_s = state.extra.get("late", (0.0, 1.0))
    if late_s < max(ALIKE * float(np.median(np.diff(state.time_s))), PLAINLY_LATE * doubt_s):
        return False
    shifted = balance.fit((*fit.terms, Term(_delay(), {"form": 0.0, "delay": float(late_s)})))
    return gain(balance, shifted, fit) < -BEYOND_CHANCE


def _delay() -> Any:
    """The effect of a current that is late."""
    return next(e for e in catalogue("drive") if e.warps)


def _told(states: tuple[DriveState, ...]) -> bool:
    """Whether it is known for sure how late a current is."""
    late_s, doubt_s = states[0].extra.get("late", (0.0, 1.0))
    return bool(abs(late_s) > SURE_DELAY * doubt_s)


def _drive_late(answers: Lateness | None) -> bool:
    """Whether answers to commands say that the drive is late, not its current alone."""
    return answers is not None and len(answers.drive_s) > 0


def _denied(answers: Lateness | None, told_s: float, doubt_s: float, apart: float = ALIKE) -> bool:
    """Whether answers to commands say a current in time, and by `apart` standard deviations not as late, or early, as a
    simulation tells."""
    if answers is None or abs(answers.channel_s) > answers.doubt_s:
        return False
    return abs(told_s - answers.channel_s) > apart * float(np.hypot(answers.doubt_s, doubt_s))


def _surely_late(answers: Lateness | None, told_s: float, doubt_s: float, bound_s: float) -> bool:
    """Whether a simulation and answers to commands each surely say a current late by more than a bound, whatever a
    balance makes of it."""
    if answers is None:
        return False
    least_s = min(told_s - SURELY * doubt_s, answers.channel_s - SURELY * answers.doubt_s)
    return least_s > bound_s


def _answers_so(answers: Lateness | None, told_s: float) -> bool:
    """Whether answers to commands say a current late, or early, by what a simulation tells."""
    if answers is None:
        return False
    apart = abs(answers.channel_s - told_s) < ALIKE * answers.doubt_s
    return apart and answers.channel_s * told_s > 0 and abs(answers.channel_s) > ANSWERED * answers.doubt_s
