"""Section about the published identification of the motors beside this one. From a session's logs."""

from __future__ import annotations

from collections.abc import Sequence

from ..errors import HandModelError
from ..hand import Hand
from ..identify.motor.published import MODELS, PublishedFit, fit_published, smear_share
from ..identify.motor.recording import MotorTrial, motor_trials
from ..published import current_rmse_raw
from ..session import Session
from .page import Cell, Section, note, table

WAYS = (("published way", 2), ("both sides filtered alike", 2), ("thesis", 1))


def published_motors_section(hand: Hand, session: Session) -> Section | None:
    """RMSE of the four published models (tables 4.12 and 4.13) per motor, as published and with both sides filtered
    alike and a preload, beside the published figures; None where no motor of the hand has usable logs in the
    session."""
    rows, shares = [], []
    for motor in hand.motors:
        trials = _trials(session, motor.actuator)
        if not trials:
            continue
        fits, alike = fit_published(trials), fit_published(trials, both_sides=True)
        shares.append((motor.actuator, smear_share(fits, alike)))
        thesis = current_rmse_raw(hand.side, motor.actuator) or (None,) * len(MODELS)
        rows += [
            [
                motor.actuator if i == 0 else "",
                model,
                *_fit(fits[i]),
                *_fit(alike[i]),
                "–" if thesis[i] is None else f"{thesis[i]:.2f}",
            ]
            for i, model in enumerate(MODELS)
        ]
    if not rows:
        return None
    words = (
        "Of what the reciprocal term gains in explained variance, filtering one side alone accounts for "
        + ", ".join(f"{100 * share:.0f} % ({name})" for name, share in shares)
        + "."
    )
    columns = ("motor", "model", "rmse", "Coulomb", "rmse", "Coulomb", "rmse")
    body = (
        table(columns, rows, "Current, raw units; the form of tables 4.12 and 4.13", (("", 2), *WAYS), text_columns=2),
        note(
            "The published way filters the position at 6 Hz, forwards and backwards, and not the current, "
            "takes velocity and acceleration by differences, and drops samples below 5 %/s. Filtered alike, "
            "with a preload, what remains of the reciprocal term is friction that rises as speed falls. "
            "The thesis's figures are of its own hands."
        ),
    )
    return Section("published-motors", "Motors as published", words, body)


def _fit(fit: PublishedFit) -> tuple[str, str | Cell]:
    return f"{fit.rmse_raw:.2f}", f"{fit.parameters['coulomb']:.1f}" if "coulomb" in fit.parameters else Cell(
        "–", "dim"
    )


def _trials(session: Session, actuator: str) -> Sequence[MotorTrial]:
    """The trials from which a motor is identified; none where they cannot be used."""
    try:
        return motor_trials(session, actuator)[0]
    except HandModelError:
        return ()
