"""A gain of a channel."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Gain:
    """log_likelihood: of the truth over the best healthy model, expected, in nats; rise: share by which the healthy
    model's residuals are above the noise."""

    log_likelihood: float
    rise: float

    def above(self, other: Gain) -> Gain:
        """Without what a healthy finger gives already by the numerics."""
        return Gain(max(self.log_likelihood - other.log_likelihood, 0.0), max(self.rise - other.rise, 0.0))
