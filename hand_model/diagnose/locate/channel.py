"""How late a drive's current is logged beside its position, by the drive simulated from its commands."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from ...errors import HandModelError
from ...session import Session


@dataclass(frozen=True)
class ChannelDelay:
    """delay_s: by how much the current of `actuator` is late, negative where its position is; doubt_s: standard deviation."""

    actuator: str
    delay_s: float
    doubt_s: float


def channel_delay(session: Session, actuator: str) -> ChannelDelay | None:
    """The delay of one drive's current; None where no controller explains the drive's motion."""
    from ...identify.motor.channel import channel_delay as by_simulation
    from ...identify.motor.fit import BOUNDS, identify_motor

    try:
        motor = identify_motor(session, actuator)
    except HandModelError:
        return None
    if not motor.predictive or motor.output_error is None:
        return None
    return ChannelDelay(actuator, *by_simulation(motor.output_error, BOUNDS))


def apart(delays: Mapping[str, ChannelDelay]) -> dict[str, ChannelDelay]:
    """The delays beside the least one of the session: what all drives share is how the log is read."""
    common = min((d.delay_s for d in delays.values()), key=abs, default=0.0) if len(delays) > 1 else 0.0
    return {a: ChannelDelay(a, d.delay_s - common, d.doubt_s) for a, d in delays.items()}
