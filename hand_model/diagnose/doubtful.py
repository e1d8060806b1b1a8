"""What is named and stands on little: small beside something else, by a comparison of drives alone, no more than two
healthy clocks differ by, or against what recordings kept out say."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

from ..effects import catalogue
from ..effects.clock_drift import CRYSTALS
from .findings import Finding, Findings, of_one_whole, rejection
from .locate.preload import COMPARISON
from .magnitude import SLIGHT
from .name.station import KEPT_OUT

REFUSED = "command_as_measurement"  # a channel that tells nothing: no other finding is small beside it
TRIFLE = 0.01  # of the square of the heaviest weight
SURE = 0.99  # probability of what a comparison alone says
DOUBT = "only the hand's other motors speak for it, and it may be chance"
REFUTED = "with it recordings kept out are told worse"
# what was there in a recording, and is no part of the hand
PASSING = frozenset(e.name for e in catalogue() if e.recorded and not e.of_the_hand)
HEALTHY = "the clocks of two healthy crystals differ by as much"  # and by how much


def trifles(ranked: list[tuple[float, Finding]], magnitudes: Mapping[int, float]) -> list[tuple[Finding, str]]:
    """Findings that are small for their kind and hardly show beside the heaviest one, each with the reason. Of the same
    finger they may be no more than its form being another; what markers alone show shapes no current, and the form of
    what a hand always has none of what one recording had. Of another finger they are what is left of all that could have
    been missing of a healthy one: of a thousand hands with one or two effects none had a second one as small."""

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
    healthy drives than drives of which nothing else would show what they have; clocks that part as healthy ones do; what
    is refuted."""
    alone = [(f, DOUBT) for f in found if compared(f) and f.probability < SURE]
    rates = [(f, f.parameters["rate_minus_one"]["value"]) for f in found if f.effect == "clock_drift"]
    healthy = [(f, f"{HEALTHY}: {1e6 * rate:.0f} ppm") for f, rate in rates if abs(rate) <= CRYSTALS]
    return [*alone, *healthy, *((f, REFUTED) for f in found if refuted(f))]


def refuted(finding: Finding) -> bool:
    """Whether the error of recordings kept out surely rises with a finding, and beyond their noise."""
    before, after, fall, floor = (finding.fit.get(k) for k in ("before", "after", "ci95_reduction", "noise_floor"))
    if before is None or after is None or fall is None or None in fall or not finding.fit.get("held_out"):
        return False
    return after > before and fall[1] < 0 and after > KEPT_OUT * (floor or 0.0)


def without_refuted(findings: Findings) -> Findings:
    """The findings without those that their own compiled files refute: what they were to explain is unexplained."""
    wrong = [f for f in findings.findings if refuted(f)]
    left = [
        {
            "where": {k: f.where.get(k) for k in ("finger", "joint", "actuator", "signal")},
            "share_of_mismatch": f.where["share_of_mismatch"],
            "shape": f"no known effect, though much like {f.effect.replace('_', ' ')}: {REFUTED}",
        }
        for f in wrong
    ]
    said = (rejection(f.effect, f.where["finger"], REFUTED) for f in wrong)
    right = [f for f in findings.findings if not refuted(f)]
    kept, unexplained = of_one_whole(right, [*findings.unexplained, *left])
    return replace(
        findings,
        verdict="mismatch" if kept else "unexplained",
        findings=kept,
        unexplained=unexplained,
        rejected=(*findings.rejected, *said),
    )
