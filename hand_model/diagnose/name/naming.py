"""What a balance says: the effects that were named there, each with its rivals, beside the declared model and the final
one."""

from __future__ import annotations

from dataclasses import dataclass

from .balance import Balance, Fit
from .lack_of_fit import LackOfFit
from .term import Term
from .wander import Wander

ALPHA = 0.003  # false alarms per channel: 5 % over some fifteen channels of a session
MANY = 5  # effects of one balance: where so many leave a plain mismatch, nothing known is missing
MOST_TERMS = 7  # effects of one balance that are looked for, while so many explain most of it
EXPLAINED_LEAST = 0.7  # of the explainable mismatch: below, the names are not believed
CLASS_WIDTH = 3.0  # log evidence within which two effects are one class: 20 to 1


@dataclass(frozen=True)
class Rival:
    """A candidate in the place of a finding: its log evidence relative to none, and its fit. kept_out: the part of that
    evidence that recordings kept out have given, relative to the likeliest of those that training cannot tell apart."""

    name: str
    evidence: float
    fit: Fit
    kept_out: float = 0.0


@dataclass(frozen=True)
class Named:
    """One finding of a balance. rivals: every candidate that was tried in its place (best first), the winner included.
    share: of the explainable residual variance. size: of what it adds beyond what declared coefficients could, over the
    noise of one reading (root mean squares). probability: against all rivals and none."""

    term: Term
    amplitudes: dict[str, float]
    rivals: tuple[Rival, ...]
    share: float
    size: float
    probability: float

    @property
    def own(self) -> Rival:
        """The effect in its own place."""
        return next(r for r in self.rivals if r.name == self.term.effect.name)

    @property
    def evidence(self) -> float:
        """Log evidence of the effect in its own place."""
        return self.own.evidence

    @property
    def members(self) -> tuple[str, ...]:
        """The class: every effect that these recordings cannot tell from this one."""
        near = [r for r in self.rivals if r.evidence > self.rivals[0].evidence - CLASS_WIDTH]
        return tuple(r.name for r in near if r.name == self.term.effect.name or r.fit.terms[-1].effect.listed)


@dataclass(frozen=True)
class Naming:
    """What a balance says. wander: what does not repeat beside the fit. before, after: lack of fit of the declared
    model and of the final one. rejected: tried and not kept, with the log evidence that it brought."""

    balance: Balance
    declared: Fit
    fit: Fit
    wander: Wander | None
    before: LackOfFit
    after: LackOfFit
    found: tuple[Named, ...]
    rejected: tuple[tuple[str, float], ...]

    @property
    def names(self) -> frozenset[str]:
        """The effects that were named, whether they stand or not."""
        return frozenset(f.term.effect.name for f in self.found)

    @property
    def consistent(self) -> bool:
        """True where nothing is missing beyond the noise."""
        return self.before.p >= ALPHA and not self.found

    @property
    def overwhelmed(self) -> bool:
        """Whether the effects are too many to go on."""
        return overwhelmed(len(self.found), self.before, self.after)


def overwhelmed(count: int, before: LackOfFit, after: LackOfFit) -> bool:
    """Whether many named effects leave a plain mismatch unexplained: whatever else is tried, nothing known is missing."""
    return count >= MANY and after.p < ALPHA and after.excess > (1 - EXPLAINED_LEAST) * before.excess
