"""When a gain is evidence: chance among many rivals, and one loud block among many."""

from __future__ import annotations

import numpy as np

from hand_model.rig.evidence import weigh


def test_the_best_of_many_rivals_is_held_to_the_best_of_chance() -> None:
    """Of rivals that gain nothing one in twenty rounds names one, be they independent or all the same; a real gain that
    one of many alike has is as sure as alone."""
    random, blocks = np.random.default_rng(0), 30
    none, group = np.full(blocks, 10.0), np.arange(blocks)
    for alike in (False, True):
        hits = 0
        for _ in range(200):
            noise = random.standard_normal((1 if alike else 15, blocks))
            hits += weigh(none, none - np.repeat(noise, 15 if alike else 1, 0), [1] * 15, group) is not None
        assert hits < 25
    gain = 0.6 + random.standard_normal((1, blocks))
    alone = weigh(none, none - gain, [1], group)
    among = weigh(none, none - np.repeat(gain, 15, 0), [1] * 15, group)
    assert alone is not None and among is not None and among.probability == alone.probability


def test_the_loudest_block_does_not_speak_for_all() -> None:
    """What every block says counts, however loud one is; what that one says alone does not."""
    group, loud = np.arange(20), np.where(np.arange(20) == 3, 1e4, 1.0)
    assert weigh(loud, np.array([0.5 * loud]), [1], group) is not None
    alone = np.where(np.arange(20) == 3, 0.5, 1.0 + 0.01 * (-1.0) ** np.arange(20)) * loud
    assert weigh(loud, np.array([alone]), [1], group) is None
