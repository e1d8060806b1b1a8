"""By how much an error falls on recordings that took no part, and how sure that is (block bootstrap; Künsch 1989)."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

RESAMPLES = 1000


def reduction(
    before: Sequence[Array], after: Sequence[Array], blocks: Sequence[NDArray[np.int64]], seed: int = 0
) -> dict[str, Any]:
    """Root mean square error before and after, and the 95 % interval of its reduction by a bootstrap over blocks.

    before, after: errors (n,) of each recording; blocks: (n,) numbers of its blocks.
    """
    count = np.cumsum([0, *(int(b.max()) + 1 if len(b) else 0 for b in blocks)])
    block = np.concatenate([b + c for b, c in zip(blocks, count, strict=False)])
    _, block = np.unique(block, return_inverse=True)
    r0, r1 = np.concatenate(before) ** 2, np.concatenate(after) ** 2
    n, s0, s1 = (np.bincount(block, v) for v in (np.ones(len(block)), r0, r1))
    pick = np.random.default_rng(seed).integers(0, len(n), (RESAMPLES, len(n)))
    size = n[pick].sum(1)
    gain = np.sqrt(s0[pick].sum(1) / size) - np.sqrt(s1[pick].sum(1) / size)
    return {
        "before": float(np.sqrt(r0.mean())),
        "after": float(np.sqrt(r1.mean())),
        "ci95_reduction": np.percentile(gain, [2.5, 97.5]).tolist(),
    }
