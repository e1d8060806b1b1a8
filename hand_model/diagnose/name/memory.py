"""What was computed last, within bounds."""

from __future__ import annotations

from collections import OrderedDict
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

MOST_LAST = 1e8  # bytes: grids ask for the same columns again


class Memory:
    """Arrays by key, the last ones asked for, as much as MOST_LAST bytes hold."""

    def __init__(self) -> None:
        self._items: OrderedDict[Any, Array] = OrderedDict()
        self._bytes = 0

    def get(self, key: Any) -> Array | None:
        """What is remembered under a key, None where nothing is."""
        if key in self._items:
            self._items.move_to_end(key)
        return self._items.get(key)

    def put(self, key: Any, value: Array) -> Array:
        """The value, remembered; what was not asked for longest is forgotten."""
        self._items[key] = value
        self._bytes += value.nbytes
        while self._bytes > MOST_LAST and len(self._items) > 1:
            self._bytes -= self._items.popitem(last=False)[1].nbytes
        return value
