"""Slips of markers as findings."""

from __future__ import annotations

import numpy as np
import pytest

from hand_model.diagnose.markers import MarkerEffect
from hand_model.diagnose.slips import displacement


@pytest.mark.parametrize(("begin", "end"), [(10, 100), (10, 30), (None, None)])
def test_a_slip_is_as_large_as_it_is_while_it_lasts(begin: int | None, end: int | None) -> None:
    everywhere = np.zeros((100, 6, 3))  # of two markers, the second moves
    everywhere[:, 3:] = np.eye(3)
    slip = MarkerEffect("marker_slip", 1, "P1", begin, end, everywhere, 50.0, 100.0, np.array([1e-3, -2e-3, 2e-3]))
    assert displacement([slip], slip) == pytest.approx(3e-3)
