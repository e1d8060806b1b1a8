"""Independent random streams by name, so that hiding an effect never shifts the noise of anything else."""

from __future__ import annotations

import hashlib

import numpy as np


def stream(seed: int, *words: object) -> np.random.Generator:
    """Generator of the stream named by `words` under `seed`; the same name and seed give the same numbers."""
    digest = hashlib.sha256("/".join(str(word) for word in (seed, *words)).encode()).digest()
    return np.random.default_rng(int.from_bytes(digest[:16], "little"))
