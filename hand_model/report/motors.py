"""Section about the motors that were identified: parameters with their intervals. From the hand alone."""

from __future__ import annotations

from collections.abc import Sequence

from ..hand import Estimate, Hand, Motor
from .page import Cell, Section, folded, heading, listing, note, table
from .words import count, listed

MAIN = ("inertia", "viscous", "coulomb", "stiffness", "preload")


def motors_section(hand: Hand) -> Section | None:
    """Parameters of every motor in the hand's raw units; None where no motor was identified."""
    if not hand.motors:
        return None
    body = [table(("motor", *MAIN, "current noise"), motor_rows(hand.motors), _units(hand.motors[0]))]
    body.append(
        note(
            "current = inertia a + viscous v + coulomb sign(v) + stiffness p + preload, p in percent of the encoder's "
            "range. Raw units stay raw: no scale of the current is known. In brackets: 95 % interval."
        )
    )
    others = [
        [m.actuator, name, _figures(e), e.unit, Cell(e.origin, "dim")]
        for m in hand.motors
        for name, e in m.parameters.items()
        if name not in MAIN
    ]
    if others:
        columns = ("motor", "parameter", "value", "unit", "from")
        body.append(folded("Controller, start of sliding and delays", table(columns, others, text_columns=2)))
    notes = [f"{m.actuator}: {text}" for m in hand.motors for text in m.notes]
    if notes:
        body += [heading("Notes"), listing(notes)]
    used = sum(len(m.trials) for m in hand.motors)
    widest = max(hand.motors, key=lambda m: _width(m.parameters.get("coulomb")))
    words = (
        f"{count(len(hand.motors), 'motor')} ({listed([m.actuator for m in hand.motors])}) identified from "
        f"{count(used, 'trial')}; Coulomb friction is known to "
        f"{100 * _width(widest.parameters.get('coulomb')):.1f} % or better (half of its 95 % interval)."
    )
    return Section("motors", "Motors", words, tuple(body))


def motor_rows(motors: Sequence[Motor]) -> list[list[str | Cell]]:
    """One row per motor: the five parameters with their intervals, noise of a current sample."""
    return [
        [m.actuator, *(_figures(m.parameters.get(name)) for name in MAIN), f"{m.current_noise_raw:.3g}"] for m in motors
    ]


def _units(motor: Motor) -> str:
    named = [f"{name} {motor.parameters[name].unit}" for name in MAIN if name in motor.parameters]
    return f"Units: {', '.join(named)}; noise raw"


def _figures(estimate: Estimate | None) -> str:
    if estimate is None:
        return "–"
    if estimate.ci95 is None:
        return f"{estimate.value:.4g}"
    return f"{estimate.value:.4g} ({estimate.ci95[0]:.4g} to {estimate.ci95[1]:.4g})"


def _width(estimate: Estimate | None) -> float:
    """Half of the interval over the value."""
    if estimate is None or estimate.ci95 is None or estimate.value == 0:
        return 0.0
    return abs((estimate.ci95[1] - estimate.ci95[0]) / 2 / estimate.value)
