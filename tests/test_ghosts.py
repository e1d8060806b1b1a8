"""Labels that sit on something else for a while, against markers that slip."""

from __future__ import annotations

import numpy as np
import pytest

from hand_model.diagnose.locate.ghosts import ghosts
from hand_model.identify.chain import ChainData

TIME_S = np.arange(0, 40, 0.01)


def recording(move: np.ndarray, seed: int = 0) -> ChainData:
    """Three markers of the palm and three of a segment that turns; `move` (n,) [m] displaces the first one of the
    palm."""
    rng = np.random.default_rng(seed)
    angle = 0.7 * (1 - np.cos(2 * np.pi * TIME_S / 8))
    still = np.array([[0, 0, 0], [0.06, 0.02, 0], [0.06, -0.02, 0.01]])
    segment = 0.02 * np.array([[0, 0, 0], [0, 1, 0.2], [0.3, 0, 1]])
    turn = np.stack(
        [
            np.stack([np.cos(angle), 0 * angle, np.sin(angle)], -1),
            np.tile([0.0, 1, 0], (len(angle), 1)),
            np.stack([-np.sin(angle), 0 * angle, np.cos(angle)], -1),
        ],
        axis=1,
    )
    moving = np.einsum("nij,mj->nmi", turn, segment + [0.04, 0, 0]) + [0.06, 0, 0]
    position = np.concatenate([np.broadcast_to(still, (len(angle), 3, 3)), moving], axis=1) + rng.normal(
        0, 3e-4, (len(angle), 6, 3)
    )
    position[:, 0, 0] += move
    return ChainData(position, np.array([0, 0, 0, 1, 1, 1]), ("PO", "PM", "PL", "I1", "I2", "I3"))


@pytest.mark.parametrize(("begin", "end", "size_m"), [(15.4, 17.7, 3e-3), (20.0, 20.5, 12e-3), (9.0, 13.0, 2e-3)])
def test_a_label_that_comes_back_was_on_something_else(begin: float, end: float, size_m: float) -> None:
    there = (TIME_S > begin) & (TIME_S < end)
    found = ghosts(recording(size_m * there), TIME_S)
    assert found[there].mean() > 0.95
    assert found[(TIME_S < begin - 0.3) | (TIME_S > end + 0.3)].sum() == 0


@pytest.mark.parametrize(
    "move",
    [
        np.zeros_like(TIME_S),
        2e-3 * (TIME_S > 16.0),  # a slip
        2e-3 * np.clip((TIME_S - 16.0) / 2.5, 0, 1),  # a slow one
        2e-3 * (TIME_S > 37.0),  # one near the end
        2e-3 * (TIME_S < 2.0),  # one near the start
        2e-3 * (TIME_S > 12.0) * (1 - np.cos(2 * np.pi * TIME_S / 8)),  # one whose distance changes with the angle
        2e-3 * (TIME_S > 10.0) - 1e-3 * (TIME_S > 24.0),  # two
    ],
    ids=["none", "slip", "slow", "late", "early", "turning", "two"],
)
def test_what_stays_where_it_slipped_to_is_no_ghost(move: np.ndarray) -> None:
    assert not ghosts(recording(move), TIME_S).any()
