"""Choose an effect's strength so that it shows without drowning everything else."""

from dataclasses import dataclass

import numpy as np

from fifth_recorder.effects.option import Context, Option
from fifth_recorder.effects.table import INSIDE, OUTSIDE
from fifth_recorder.finger import Finger
from fifth_recorder.lab import Lab
from fifth_recorder.oracle import Gain, gain
from fifth_recorder.plan import Trial, healthy
from fifth_recorder.simulate import Happening

LEAST, MOST = 0.015, 0.5  # relative increase of the error of the channel that shows it most
NATS = 70.0  # at least, at full strength
LARGEST = 4.0  # strength beyond which no author would go
TRIES = 6  # forms drawn before one is taken that shows less than it should
TRACE_NATS = 4000.0  # at most, at full strength of what is hidden at a tenth
SURELY = 250.0  # enough whatever the increase
MAIN_NATS = 300.0  # at least, of what should outdo a background of tenths
WEAK_NATS = 14.0  # at least, at WEAK_SHARE of full strength
WEAK_SHARE = 0.4


@dataclass
class Hidden:
    """One effect hidden in one finger, at its final strength."""

    effect: str
    finger: str
    actuator: str | None
    option: Option
    size: float
    gain: Gain


@dataclass
class Bench:
    """Where strengths are tried: one finger with its trials, palm markers (m), and its healthy trials."""

    finger: Finger
    lab: Lab
    palm: np.ndarray
    trials: list[Trial]
    calm: list[Happening]

    def poses_differ(self) -> bool:
        """Whether the hand is held in another way in every trial."""
        return any(np.abs(t.pose - self.trials[0].pose).max() > 0.2 for t in self.trials)

    def gain(self, option: Option, size: float, every: int = 3) -> Gain:
        """What the option alone shows at a strength."""
        plan = healthy(self.finger, self.lab)
        option.apply(plan, size)
        shown = gain(plan, self.palm, self.trials, self.calm, option.drive, every)
        if option.beside:  # the little that shows while the bristles turn round is not to be counted on
            shown.beside, shown.current = option.beside(size), 0.0
        return shown


def draw_option(effect: str, bench: Bench, rng: np.random.Generator) -> Option:
    """A form of an effect, with everything drawn but its strength."""
    return (INSIDE | OUTSIDE)[effect](rng, Context(bench.finger, bench.lab, bench.poses_differ()))


def hidden(effect: str, bench: Bench, option: Option, size: float, shown: Gain) -> Hidden:
    """The record of an option at a strength."""
    return Hidden(effect, bench.finger.name, bench.finger.actuator if option.motor else None, option, size, shown)


def strength(
    option: Option, bench: Bench, nats: tuple[float, float] = (NATS, np.inf), every: int = 3
) -> tuple[float, Gain]:
    """Strength (1 is what an author would type) and what it shows: within `nats` if it can, by 1 of `every` frames."""
    size, most = 1.0, np.inf
    for _ in range(12):
        shown = bench.gain(option, size, every)
        excess = max(shown.error_increase() / MOST, shown.total / nats[1])
        if _too_small(shown, nats[0]):
            if size >= LARGEST:
                break
            size = min(size * 1.4, 0.5 * (size + most), LARGEST)
        elif option.capped and excess > 1.0:
            most = size
            size *= max(0.3, np.sqrt(0.8 / excess))
        else:
            break
    return size, shown


def draw_sized(
    effect: str, bench: Bench, rng: np.random.Generator, nats: tuple[float, float] = (NATS, np.inf), every: int = 3
) -> tuple[Option, float, Gain]:
    """A form of an effect that shows on this bench at a strength that an author would type."""
    best = None
    for _ in range(TRIES):
        option = draw_option(effect, bench, rng)
        size, shown = strength(option, bench, nats, every)
        if best is None or shown.total > best[2].total:
            best = option, size, shown
        if not _too_small(shown, nats[0]):
            return option, size, shown
    return best


def weak_strength(option: Option, bench: Bench, proper: float) -> tuple[float, Gain]:
    """WEAK_SHARE of a proper strength, or more where too little would remain."""
    size = WEAK_SHARE * proper
    for _ in range(8):
        shown = bench.gain(option, size)
        if shown.total >= WEAK_NATS:
            break
        size *= 1.3
    return size, shown


def _too_small(shown: Gain, least: float) -> bool:
    if shown.beside:
        return shown.beside < NATS
    return shown.total < least or (shown.error_increase() < LEAST and shown.total < SURELY)
