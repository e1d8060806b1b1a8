"""One balance of one finger, what was named there, and how far that is believed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..findings import Finding
from .balance import Balance
from .candidates import EVIDENCE_LEAST
from .evidence import evidence
from .interval import as_named, brought_held_out, parameter_intervals, sized, undisturbed, variance_ratio
from .naming import ALPHA, EXPLAINED_LEAST, MANY, Named, Naming
from .selection import SMALL
from .term import Term

# channels of a session, times names: what no test of a channel sees must stand against as many. Of motors there are few
# (in 140 healthy balances of currents the likeliest false name is at e^5, of angles, whose clocks err, at e^11)
CHANCES, CHANCES_OF_MOTORS = 20 * 25, 4 * 25
LIKELY = 3.0  # log odds of a motor's name against all of those
PART = 0.5  # of the size of a trace that is another effect's
ALIKE = 1 / 3  # of the size of a larger effect of the same family: below, no finding of its own
UNREST = 0.3  # of the noise: wander that every machine is granted; more is no explanation
# times the noise of recordings kept out, and the share of what is above it that true names take
KEPT_OUT, EXPLAINED_MOST = 1.05, 2 / 3
CHANCE = 2.0  # standard errors
IDLE = 0.02  # of what an effect does where it does most: less is nothing
BEFORE = 5  # samples, before and after which an effect shows what it does, for states are smooth
ELSEWHERE = 0.2  # of what a small effect does (squared), at least, where the large ones do nothing
SAME_PERIOD = 0.02  # by which a harmonic's may differ
PATCHES = 2  # periods beside the first that are none of its harmonics: more than a second gear
MAIN = 0.5  # of what names explain together: what one of them must hold where they do not do
PLAINLY = 1 / 3  # of the mean square of recordings kept out before, at most, is noise
# of a mismatch that the lack-of-fit test sees: below, they are not what is missing, whatever is left to see
EXPLAINED_SOME = 1 / 3
# of the mismatch that names must explain in a finger of which so many other things are known to be missing that more are
# to be expected than are looked for at once
EXPLAINED_PARTLY = 0.5


class Station:
    """One balance of one finger and what was named there. beside: reads its sizes again where more is known of the drive
    than its own balance tells; compared: names of which other drives tell the size; elsewhere: names that stand at other
    balances of its finger; at_ends: of what starts and stops alone tell, beside which sizes are read as named; tilt: root
    mean square, in the unit of the balance, below which a departure of an angle may be what a joint that is no plain
    hinge leaves in it; swaying: times the evidence of what no table names, and moments or levels of recordings tell, that
    cameras which drift for seconds may make."""

    def __init__(
        self, signal: str, finger: str | None, actuator: str | None, joint: str | None, naming: Naming
    ) -> None:
        self.signal, self.finger, self.actuator, self.joint, self.naming = signal, finger, actuator, joint, naming
        places = {id(f): naming.fit.terms.index(f.term) for f in naming.found}
        self.beside: Callable[[Station], Station] | None = None
        self.compared: tuple[str, ...] = ()
        self.elsewhere: frozenset[str] = frozenset()
        self.tilt, self.swaying = 0.0, 1.0
        unseen = naming.before.p >= ALPHA
        odds, chances = (LIKELY, CHANCES_OF_MOTORS) if signal == "current" else (EVIDENCE_LEAST, CHANCES)
        by_chance = np.log(chances) if unseen else 0.0
        least, plain = (odds if unseen else EVIDENCE_LEAST) + by_chance, 2 * EVIDENCE_LEAST + by_chance

        def must(f: Named) -> float:  # what one recording alone may have, it may have anywhere and at any time
            return plain if unseen and not f.term.effect.of_the_hand else least

        reading = undisturbed(naming)
        stand, at_ends = list[int](), list[int]()
        for f in naming.found:
            if _stands(naming, f, which := places[id(f)], must(f)):
                if sized(reading, which):
                    stand.append(which)
                elif _plain_at_ends(naming, f, which, plain):
                    at_ends.append(which)
        stand += at_ends
        self.at_ends = frozenset(naming.fit.terms[which].effect.name for which in at_ends)
        self.reading = as_named(naming) if at_ends else reading
        self.parameters = {which: parameter_intervals(self.reading, which) for which in stand}
        self.proven = tuple(f for f in naming.found if places[id(f)] in stand)
        # names that no table holds, where no test sees them, and that bring no more than an effect must
        self._faint = {
            f.term.effect.name
            for f in self.proven
            if unseen and not f.term.effect.listed and not _stands(naming, f, places[id(f)], plain)
        }

    def renamed(self, naming: Naming) -> Station:
        """The station of the same place with another naming."""
        return Station(self.signal, self.finger, self.actuator, self.joint, naming)

    def names(self, finding: Finding) -> bool:
        """Whether a finding was named here."""
        return (
            finding.effect in self.naming.names
            and finding.where.get("finger") == self.finger
            and (self.signal != "markers" or finding.where.get("joint") == self.joint)
        )

    @property
    def missing(self) -> bool:
        """Whether the lack-of-fit test says that something is missing, or an effect that it overlooked holds out: along
        the known effects mismatch shows earlier than in any grouping of cells. What no table names must be plain."""
        return self.naming.before.p < ALPHA or any(f.term.effect.name not in self._faint for f in self.proven)

    @property
    def many(self) -> bool:
        """Whether so many effects are named that more is to be expected."""
        return len(self.naming.found) >= MANY

    @property
    def wander(self) -> float:
        """Standard deviation of what does not repeat over that of the noise."""
        wander = self.naming.wander
        return 0.0 if wander is None else wander.deviation / self.naming.balance.sigma

    @property
    def explained(self) -> float:
        """Share of the explainable mismatch that the named effects take away."""
        before = max(self.naming.before.excess, 1e-9)
        return float(np.clip(1 - max(self.naming.after.excess, 0.0) / before, 0, 1))

    @property
    def claimed(self) -> float:
        """Share of the mismatch that the named effects hold together: all of what is only seen along them."""
        return self.explained if self.naming.before.p < ALPHA else 1.0

    @property
    def believed(self) -> bool:
        """Whether the names stand: the final model passes the test, or takes most of the mismatch away, or all that
        recordings kept out show. Names that take little of a plain mismatch away do not, however little is left to see,
        nor names of nothing where more than the noise does not repeat, nor many, none of them the main one, beside
        which the test fails, nor what is left beside something larger that does not stand, nor many periods that have
        nothing in common."""
        most = self.naming.after.p >= ALPHA or self.explained >= EXPLAINED_LEAST or self._predicted
        return self._tells and most and not self._short and not self._scattered

    @property
    def believed_in_part(self) -> bool:
        """Whether the names would stand but that many, or some that leave recordings kept out within their noise, leave
        something by the test, or many of recordings kept out (and make these no worse): in a finger of which much is
        missing that is to be expected."""
        before, after = self._kept_out
        fits = self.naming.balance.untouched and after <= KEPT_OUT**2 < before
        left_by_test = self.naming.after.p < ALPHA and (self.many or fits)
        left_kept_out = self.many and self._short and not self._worse
        return self._tells and (left_by_test or left_kept_out) and self.explained >= EXPLAINED_PARTLY

    @property
    def _tells(self) -> bool:
        """Whether what stands is no idle talk and no pieces of something else."""
        idle = self.explained < (EXPLAINED_SOME if self.naming.before.p < ALPHA else SMALL if self.wander > 1 else 0.0)
        return bool(self.proven) and not idle and not self._left_over and not self._patched

    @property
    def _scattered(self) -> bool:
        """Whether many names leave something that the test sees, and none of them holds the better part of what they
        explain: each describes a piece of what is something else."""
        return self.naming.after.p < ALPHA and self.many and max(f.share for f in self.naming.found) < MAIN

    @property
    def _left_over(self) -> bool:
        """Whether the better part of what the names explain is of some that do not stand: the others may describe what
        is left of it."""
        return sum(f.share for f in self.proven) < MAIN

    @property
    def _patched(self) -> bool:
        """Whether a periodic effect has more than two periods that are no harmonics of its longest: they describe a
        shape that repeats in none of them. A trifle of the explained does not count: it may be the form of a corner."""
        periodic = [f for f in self.proven if f.term.effect.repeats and "period" in f.term.shape]
        of = [f.term for f in periodic] if sum(f.share for f in periodic) >= SMALL else []
        for name in {t.effect.name for t in of}:
            periods = np.array([t.shape["period"] for t in of if t.effect.name == name])
            order = periods.max() / periods
            if np.sum(np.abs(order / np.round(order) - 1) > SAME_PERIOD) >= PATCHES:
                return True
        return False

    @property
    def _predicted(self) -> bool:
        """Whether recordings kept out, plainly above their noise before, are within it beside the names: the test asks
        what repeats at the same place, speed and direction, and not what changes over a recording."""
        before, after = self._kept_out
        return self.naming.balance.untouched and after <= KEPT_OUT**2 < PLAINLY * before

    @property
    def _short(self) -> bool:
        """Whether the names leave recordings kept out plainly above their noise, and more than a third of what was, or
        make them worse: something else is missing, whether or not the test of cells sees it. Of steady motion: what acts
        at starts and stops is not asked."""
        if any(f.term.effect.warps or f.term.effect.replaces for f in self.naming.found):
            return False
        before, after = self._kept_out
        floor = 1 + self.wander**2
        return self._worse or after > self._noisy * floor and before - after < EXPLAINED_MOST * (before - floor)

    @property
    def _noisy(self) -> float:
        """Mean square of recordings kept out, in that of the noise, which these may have and be within it: where no test
        of cells sees anything, by chance, too (all recordings together are too many for that)."""
        balance = self.naming.balance
        if self.naming.before.p < ALPHA or not balance.untouched:
            return KEPT_OUT**2
        count = np.count_nonzero(~balance.train & balance.steady) / balance.inflation
        return KEPT_OUT**2 * (1 + CHANCE * float(np.sqrt(2 / max(count, 2.0))))

    @property
    def _worse(self) -> bool:
        """Whether the names make recordings kept out worse, and leave them above their noise."""
        before, after = self._kept_out
        return after > max(before, self._noisy)

    @property
    def _kept_out(self) -> tuple[float, float]:
        """Mean square of recordings kept out, in that of the noise, without the names and with them."""
        declared, fit = (variance_ratio(self.naming, f) for f in (self.naming.declared, self.naming.fit))
        return declared, fit

    @property
    def kept(self) -> tuple[Named, ...]:
        """The effects that stand beside each other: one of a small share may be no more than the form of the large one
        being another, and is left to the unexplained part; so is what is smaller than something that no table names, or,
        where no test sees anything, holds less of it; of what one recording alone has, where it is not told apart."""
        strange = max((f.size for f in self._unlisted), default=0.0)
        lasting = max((f.size for f in self._unlisted if f.term.effect.of_the_hand), default=0.0)
        unseen = self.naming.before.p >= ALPHA
        held = max((f.share for f in self._unlisted), default=0.0) if unseen else 0.0
        covered = {name for f in self._unlisted for name in f.term.effect.covers}
        restless = self.wander if self.wander > UNREST else 0.0
        return tuple(
            f
            for f in self._beside
            if f.term.effect.listed
            and (f.size >= strange or f.size >= lasting and f in self._told_apart)
            and f.share >= held
            and f.term.effect.name not in covered
            and (f.size >= restless or not f.term.effect.drifting)
        )

    def steadily(self, named: Named) -> bool:
        """Whether steady motion holds the better part of what a name brings: else how starts and stops are read may."""
        balance, terms = self.naming.balance, self.naming.fit.terms
        rest = tuple(t for t in terms if t is not named.term)

        def brought(among: Balance) -> float:
            return among.fit(rest).rss - among.fit(terms).rss

        return brought(balance.settled()) > MAIN * brought(balance)

    def standing(self, name: str) -> Named | None:
        """What stands here by a name; None where nothing does."""
        return next((f for f in self.kept if f.term.effect.name == name), None) if self.believed else None

    def _part(self, outsider: Named) -> bool:
        """Whether an outsider is a trace of an effect that stands elsewhere, or beside it, no smaller than half of it."""
        if outsider.term.effect.part_of in self.elsewhere:
            return True
        whole = (f for f in self._beside if f.term.effect.name == outsider.term.effect.part_of)
        return any(f.size >= PART * outsider.size for f in whole)

    @property
    def outsiders(self) -> tuple[Named, ...]:
        """What stands beside them and no table of effects names, where a test sees it or it is plain: of all that a
        table could lack some may seem to be there by chance."""
        return tuple(f for f in self._unlisted if f.term.effect.name not in self._faint)

    @property
    def _unlisted(self) -> tuple[Named, ...]:
        unlisted = (f for f in self._beside if not f.term.effect.listed)
        return tuple(f for f in unlisted if f.evidence >= self.swaying * EVIDENCE_LEAST and not self._part(f))

    @property
    def _beside(self) -> tuple[Named, ...]:
        return tuple(
            f
            for f in self.proven
            if (f in self._large or any(_outgrows(f, g) for g in self._large) or f in self._told_elsewhere)
            and f not in self.forms
            and (f.size * self.naming.balance.sigma >= self.tilt or f.term.effect.signal == "log")
        )

    @property
    def _large(self) -> tuple[Named, ...]:
        return tuple(f for f in self.proven if f.share >= SMALL or f is self.proven[0])

    @cached_property
    def _told_elsewhere(self) -> tuple[Named, ...]:
        """Small effects that are told where none of the large ones acts, each by itself: there they are no form of theirs,
        nor of several which together describe one."""
        balance, fit = self.naming.balance, self.naming.fit
        terms = tuple(f.term for f in self._large)
        idle = self._idle(terms)
        if not (idle & balance.train).any():
            return ()
        there = balance.only(idle)
        rest = there.fit(terms)

        def told(small: Named) -> bool:
            # what acts nearly only where a large one does, and a little before, may be how that begins; and small names
            # beside large ones are many
            does = (fit.prediction - balance.removed(fit, fit.terms.index(small.term))) ** 2
            apart = float(does[idle].sum()) >= ELSEWHERE * float(does.sum())
            return apart and evidence(there, there.fit((*terms, small.term)), rest) >= 2 * EVIDENCE_LEAST

        return tuple(f for f in self.proven if f not in self._large and told(f))

    @cached_property
    def _told_apart(self) -> tuple[Named, ...]:
        """Effects that are plain where nothing acts that one recording alone has and no table names."""
        balance, passing = self.naming.balance, [f.term for f in self._unlisted if not f.term.effect.of_the_hand]
        idle = self._idle(passing)
        if not passing or not (idle & balance.train).any():
            return ()
        there, terms = balance.only(idle), tuple(t for t in self.naming.fit.terms if t not in passing)
        whole = there.fit(terms)

        def plain(named: Named) -> bool:
            rest = there.fit(tuple(t for t in terms if t is not named.term))
            return evidence(there, whole, rest, terms.index(named.term)) >= 2 * EVIDENCE_LEAST

        return tuple(f for f in self._beside if f.term.effect.listed and plain(f))

    def _idle(self, terms: Sequence[Term]) -> NDArray[np.bool_]:
        """Samples (n,) at which none of the terms does anything, nor a little before or after."""
        balance, fit = self.naming.balance, self.naming.fit
        idle = np.ones(len(balance.effort), bool)
        for term in terms:
            added = np.abs(fit.prediction - balance.removed(fit, fit.terms.index(term)))
            idle &= added < IDLE * added.max()
        return np.convolve(idle, np.ones(2 * BEFORE + 1), mode="same") >= 2 * BEFORE + 1

    @property
    def forms(self) -> tuple[Named, ...]:
        """What adds little beside another of its family: a play with a mass that floats in it gives a little, too; and
        what may be a part of one that explains more."""
        return tuple(
            f
            for f in self.proven
            for g in self.proven
            if _related(f, g) and (f.size < ALIKE * g.size or f.share < g.share and self._hides(g, f))
        )

    def _hides(self, whole: Named, other: Named) -> bool:
        """Whether what another does may be a part of what an effect does."""
        return whole.term.effect.hides(self.naming.balance.states, told(self, whole), told(self, other))

    @property
    def contrast(self) -> float:
        """Standard deviation of the effort over its noise."""
        balance = self.naming.balance
        return float(np.std(balance.effort[balance.train])) / balance.sigma

    @property
    def weight(self) -> float:
        """What the effects that stand add to the effort, over the noise (mean squares)."""
        return sum(f.size**2 for f in self.kept) if self.believed else 0.0

    def line(self, in_part: bool = False) -> str:
        """One line for a progress display. in_part: whether names that leave something stand all the same."""
        place = " ".join(x for x in (self.finger, self.joint, self.signal) if x)
        if not self.missing:
            return f"{place}: consistent (p {self.naming.before.p:.2g})"
        stands = self.kept if self.believed or in_part else ()
        names = ", ".join(f.term.effect.name for f in stands) or "unexplained"
        return f"{place}: {names} (p {self.naming.before.p:.2g} -> {self.naming.after.p:.2g})"


def told(station: Station, named: Named) -> dict[str, Any]:
    """name -> value of the parameters of what was named at a station."""
    figures = station.parameters[station.naming.fit.terms.index(named.term)]
    return {name: figure["value"] for name, figure in figures.items()}


def bring_together(stations: Sequence[Station]) -> None:
    """Let every station know what stands at the others of its finger: what it shows of that is no stranger."""
    standing = [frozenset(f.term.effect.name for f in s.kept) if s.believed else frozenset[str]() for s in stations]
    for station in stations:
        others = (
            names
            for other, names in zip(stations, standing, strict=True)
            if other is not station and other.finger == station.finger
        )
        station.elsewhere = frozenset().union(*others)


def _related(one: Named, other: Named) -> bool:
    """Whether both are of one family."""
    return one.term.effect.family is not None and one.term.effect.family == other.term.effect.family


def _outgrows(one: Named, other: Named) -> bool:
    """Whether one does more than another of its family: what either takes alone is little, for the other stands in."""
    return _related(one, other) and one.size > other.size


def _stands(naming: Naming, named: Named, which: int, least: float) -> bool:
    """Whether recordings that took no part are predicted better with the effect, or, of what something else than the
    balance says for sure, do not deny it, and all of them together bear it out."""
    brought = brought_held_out(naming, which)
    if brought is None:
        return named.evidence >= least
    told = named.term.effect.told_otherwise(naming.balance.states, named.term.shape)
    return brought > (-EVIDENCE_LEAST if told else 0.0) and named.evidence + brought >= least


def _plain_at_ends(naming: Naming, named: Named, which: int, least: float) -> bool:
    """Whether an effect is that plain that it needs no steady motion to be told from zero: some act where motion starts
    and stops, as a stop of the open hand. Many effects describe how these are read: it must explain no less than an even
    part. What no table names, or one recording alone has, and only starts and stops show may be how these are read."""
    kind, even = named.term.effect, 1 / len(naming.found)
    holds_most = named.share >= even and kind.listed and kind.of_the_hand
    return holds_most and _stands(naming, named, which, least)
