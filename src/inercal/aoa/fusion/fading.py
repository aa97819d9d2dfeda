"""What the fusion knows of its constants fades, so that it does not grow surer than its model is right.

Linearised at a motion that is itself estimated, a row says a little too much of the constants, and always in the same
sense. Within a minute that is small beside u. But a direction that a motion hardly tells (of one sine the gyro's scale,
positions and heights together, which only harmonics part) is carried away, and the angle with it: in 600 s of 10 deg at
1 Hz by one standard deviation of the prior at 1 kHz, by eight at 100 Hz. So from `MEMORY` on what the data told of the
constants fades with that time constant, and what the prior told does not; in information, each `STEP`,

    P'^-1 = (1 - e) P^-1 + e P0^-1        P'^-1 x' = (1 - e) P^-1 x + e P0^-1 x0

with x0, P0 the prior. A constant that is well told stays as sure as `MEMORY` makes it, one that is badly told stays
at its prior, and a bias that wanders is followed.
"""

from __future__ import annotations

import math

import numpy as np

from inercal.aoa.fusion.problem import FilterProblem
from inercal.arrays import Array

MEMORY = 60.0
"""Time [s] from the first row on in which nothing fades, and the time constant after it."""

STEP = 10.0
"""Interval [s] at which constants fade."""

_FIRST = math.floor(MEMORY / STEP)


def due(before: float, t: float, since: float) -> int:
    """How many steps of fading come before the row at ``t`` [s], with ``before`` that of the row before it and
    ``since`` that of the row from which the filter has learned."""
    late, early = math.floor((t - since) / STEP), math.floor((before - since) / STEP)
    return max(late, _FIRST) - max(early, _FIRST)


def next_due(t: Array, at: int, since: float) -> int:
    """The first row after ``at`` of ``t`` (m,) [s], increasing, before which constants fade; m where none is."""
    passed = max(math.floor((t[at] - since) / STEP), _FIRST) + 1
    # rounding may have it a row earlier or later
    k = max(at + 1, int(np.searchsorted(t, since + passed * STEP)) - 1)
    while k < len(t) and not due(float(t[k - 1]), float(t[k]), since):
        k += 1
    return k


def fade(x: Array, P: Array, problem: FilterProblem, steps: int) -> Array:
    """Let the constants of the state ``x`` (n,), ``P`` (n, n) fade by so many steps, in place.

    Returns F (n, n) of x' = F x + what the prior tells. States that move stay as they are.
    """
    kept = math.exp(-STEP * steps / MEMORY)
    prior, F = problem.covariance, np.eye(len(x))
    at = np.array([k for k in problem.nuisances.values() if prior[k, k] > 0.0], dtype=int)
    if not len(at):
        return F
    scale, own = np.sqrt(np.diag(prior)[at]), np.ix_(at, at)
    units = np.outer(scale, scale)
    known, given = P[own] / units, prior[own] / units
    mixed = known @ np.linalg.pinv(kept * given + (1.0 - kept) * known, hermitian=True)
    F[own] -= (1.0 - kept) * mixed * np.outer(scale, 1.0 / scale)
    x[at] = problem.mean[at] + F[own] @ (x[at] - problem.mean[at])
    P[at] = F[own] @ P[at]
    P[:, at] = P[at].T
    faded = mixed @ given * units
    P[own] = 0.5 * (faded + faded.T)
    return F
