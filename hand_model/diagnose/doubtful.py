"""What is named and stands on little: small beside something else, by a comparison of drives alone, or no more than two
healthy clocks differ by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from ..effects import catalogue
from ..effects.clock_drift import CRYSTALS
from .findings import Finding
from .locate.preload import COMPARISON
from .magnitude import SLIGHT

REFUSED = "command_as_measurement"  # a channel that tells nothing: no other finding is small beside it
TRIFLE = 0.01  # of the square of the heaviest weight
SURE = 0.99  # probability of what a comparison alone says
DOUBT = "only the hand's other motors speak for it, and it may be chance"
# what was there in a recording, and is no part of the hand
PASSING = frozenset(e.name for e in catalogue() if e.recorded and not e.of_the_hand)
HEALTHY = "the clocks of two healthy crystals differ by as much"  # and by how much


def trifles(ranked: list[tuple[float, Finding]], magnitudes: Mapping[int, float]) -> list[tuple[Finding, str]]:
    """Findings that are small for their kind and hardly show beside the heaviest one, each with the reason. Of the same
    finger they may be no more than its form being another; what markers alone show shapes no current, and the form of
    what a hand always has none of what one recording had. Of another finger
    they are what is left of all that could have been missing of a healthy one: of a thousand hands with one or two
    effects none had a second one as small."""

    def small(weight: float, finding: Finding, heaviest: float) -> bool:
        return weight**2 < TRIFLE * heaviest**2 and magnitudes[id(finding)] < SLIGHT

    others = [(w, f) for w, f in ranked if f.effect != REFUSED]
    out = []
    for weight, finding in ranked:
        beside = (
            (w, f)
            for w, f in others
            if f.where["finger"] == finding.where["finger"]
            and not (f.where["signal"] == "markers" and finding.where["signal"] == "current")
        )
        heaviest, main = next(beside, (0.0, finding))
        first, most = next(iter(others), (0.0, finding))
        if small(weight, finding, heaviest) and finding.effect not in PASSING:
            out.append(
                (finding, f"a trifle beside {main.effect.replace('_', ' ')}, whose form may be slightly another")
            )
        elif small(weight, finding, first) and finding.where["finger"] not in (None, most.where["finger"]):
            out.append(
                (finding, f"a trifle beside {most.effect.replace('_', ' ')} of the {most.where['finger']} finger")
            )
    return out


def compared(finding: Finding) -> bool:
    """Whether a comparison of the hand's drives alone says it."""
    return finding.fit.get("engine") == COMPARISON


def doubted(found: Sequence[Finding]) -> list[tuple[Finding, str]]:
    """What is no fault for sure, each with the reason: what a comparison alone says, and not surely, for there are more
    healthy drives than drives of which nothing else would show what they have; clocks that part as healthy ones do."""
    alone = [(f, DOUBT) for f in found if compared(f) and f.probability < SURE]
    rates = [(f, f.parameters["rate_minus_one"]["value"]) for f in found if f.effect == "clock_drift"]
    return alone + [(f, f"{HEALTHY}: {1e6 * rate:.0f} ppm") for f, rate in rates if abs(rate) <= CRYSTALS]
