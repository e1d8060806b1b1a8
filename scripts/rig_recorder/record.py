"""What a laboratory's log keeps of a motion: stamps, encoder steps, noisy, late and quantised channels, and faults of
them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
FAULTS = ("command", "dead", "unsigned", "clipped")


@dataclass(frozen=True)
class Logger:
    """rate_hz; jitter: of the interval between samples (share, known to the stamps); stamp_error: of the stamps (share,
    not known); start_s: where stamps begin; counts: encoder steps per unit; effort_noise, effort_step [effort];
    effort_late_s: how much later the effort channel is read."""

    rate_hz: float
    jitter: float
    stamp_error: float
    start_s: float
    counts: float
    effort_noise: float
    effort_step: float
    effort_late_s: float = 0.0

    def times(self, seconds: float, random: np.random.Generator) -> tuple[Array, Array]:
        """Instants of sampling and their stamps (n,), within the recording."""
        each = 1.0 / self.rate_hz
        true = np.cumsum(each * (1 + self.jitter * random.uniform(-1, 1, int(seconds / each / (1 + self.jitter)) - 2)))
        return true, self.start_s + true + self.stamp_error * each * random.uniform(-0.5, 0.5, len(true))

    def position(self, at: Array, time_s: Array, values: Array) -> Array:
        """Encoder reading."""
        return np.round(np.interp(at, time_s, values) * self.counts) / self.counts

    def effort(self, at: Array, time_s: Array, values: Array, random: np.random.Generator) -> Array:
        """Effort channel, read late, noisy, in steps."""
        late = np.interp(at - self.effort_late_s, time_s, values)
        return (
            np.round((late + self.effort_noise * random.standard_normal(len(at))) / self.effort_step) * self.effort_step
        )


def spoiled(fault: str, effort: Array, command: Array, at: Array, limit: float) -> Array:
    """An effort channel (n,) that is not what it is said to be."""
    if fault == "command":
        return command
    if fault == "dead":
        return np.full_like(effort, effort[0])
    if fault == "unsigned":
        return np.abs(effort)
    if fault == "clipped":
        return np.clip(effort, -limit, limit)
    return effort


def write_session(
    folder: Path,
    name: str,
    xml: str,
    signals: Mapping[str, str],
    logs: Sequence[tuple[Mapping[str, Array], bool, Mapping[str, Any]]],
) -> None:
    """A session of logs (columns, whether it validates, what the trial sets); file names say nothing."""
    (folder / "log").mkdir(parents=True)
    (folder / "rig.xml").write_text(xml)
    text = f'format = "hand-session/1"\n[hand]\nname = "{name}"\nside = "right"\n[rig]\nmodel = "rig.xml"\n[signals]\n'
    text += "".join(f'{c} = "{q}"\n' for c, q in signals.items())
    for k, (columns, validate, own) in enumerate(logs):
        table = np.stack(list(columns.values()), 1)
        np.savetxt(
            folder / f"log/run_{k:02d}.csv", table, delimiter=",", header=",".join(columns), comments="", fmt="%.11g"
        )
        text += f'\n[[trial]]\nkind = "motion"\nlog = "log/run_{k:02d}.csv"\n' + (
            'purpose = "validate"\n' if validate else ""
        )
        text += "".join(f'set = {{ "{key}" = {value} }}\n' for key, value in own.items())
    (folder / "session.toml").write_text(text)
