"""Effects at the loads of their own fit: friction by load changes the load that it is reckoned from."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ..declared import DeclaredFit
from ..model import RigModel
from .candidates import LOADED, TURNS, beside, candidates
from .problem import Term, amplitudes, pose, solution

Array = NDArray[np.float64]


def settled(rig: RigModel, fit: DeclaredFit, terms: Sequence[Term]) -> tuple[list[Term], Array, DeclaredFit]:
    """Terms and solution (P + J,) whose loads are those of the solution itself, by turns, and the fit that says
    them."""
    terms, problem, at = list(terms), pose(fit), fit
    theta = solution(problem, terms)
    loaded = {t.candidate.joint for t in terms if t.candidate.effect == LOADED}
    for _ in range(TURNS if loaded else 0):
        at = at_loads(fit, terms, theta)
        known = {c.key: c for j in loaded for c in candidates(rig, at, j, only={LOADED})}
        terms = [replace(t, candidate=known.get(t.candidate.key, t.candidate)) for t in terms]
        theta = solution(problem, terms)
    return terms, theta, at


def at_loads(fit: DeclaredFit, terms: Sequence[Term], theta: Array) -> DeclaredFit:
    """The fit with the declared parameters of a solution theta (P + J,) and, beside them, the efforts of its terms."""
    count = len(fit.columns)
    sizes = amplitudes(fit, terms, theta)
    acting = [(t.candidate, t.shape, size) for t, size in zip(terms, sizes, strict=True)]
    return replace(fit, theta=theta[:count], beside=beside(fit.rows, acting))
