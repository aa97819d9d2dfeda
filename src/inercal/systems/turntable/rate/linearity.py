"""Non-linearity and hysteresis of a rate test: largest deviations, freed of what noise adds to a largest one.

The largest of many residuals is never zero, and lies above that of the curve itself: for a straight gyro it is some
two standard deviations of noise. With the errors e of the residuals drawn, the largest true one is bounded from both
sides at the probability P, whatever the curve is:

- it is above ``largest - q``, where P of the draws have ``max |e| < q``: a straight gyro has a lower bound above zero
  in 1 - P of tests;
- it is below ``largest + t``, where P of the draws have ``|e_i| < t`` for the least certain residual: the reading at
  the true peak is itself at most the largest.

Expected excess, by draws about residuals shrunk towards the line (James and Stein 1961), is taken off the value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.results.result import COVERAGE
from inercal.systems.turntable.rate.stays import Effect, shifts_of

_DRAWS = 4000
"""Draws of the errors: bounds of 95.45 % are then reached in 95.45(33) %."""

SEED = 20261122
"""Of the draws: a record gives the same bounds each time."""


@dataclass(frozen=True, eq=False)
class Deviations:
    """Deviations from a straight line: of each reading, or between the two ways to a rate.

    ``values`` (m,) [output], ``rows`` (m, n) how each reading enters each of them.
    """

    name: str
    values: Array
    rows: Array


@dataclass(frozen=True, eq=False)
class Largest:
    """The largest deviation over full scale.

    Attributes
    ----------
    name : str
    observed : float
        As the readings have it.
    value : float
        Less what noise is expected to add.
    low, high : float
        Bounds for a coverage of 95.45 %; ``low`` is 0 where a straight gyro would do.
    gain : (n,) change of the observed one with each reading
    """

    name: str
    observed: float
    value: float
    low: float
    high: float
    gain: Array

    @property
    def half(self) -> float:
        """Half width of the interval about ``value`` that holds both bounds."""
        return max(self.high - self.value, self.value - self.low)


def drawn_errors(
    effects: Sequence[Effect], scale: float, noise: float, noise_dof: float, n: int, rng: np.random.Generator
) -> Array:
    """Errors (draws, n) of the readings [output]: noise with its own uncertainty, and effects of the table.

    Parameters
    ----------
    effects : sequence of Effect
    scale : float
        Scale factor [output per rad/s].
    noise, noise_dof : float
        Standard deviation of a reading, and its degrees of freedom; inf where it is stated.
    n : int
    rng : Generator
    """
    dof = max(noise_dof, 1.0)  # as the budget counts them
    spread = np.ones(_DRAWS) if np.isinf(dof) else np.sqrt(rng.chisquare(dof, _DRAWS) / dof)
    redrawn, common = (scale * shifts for shifts in shifts_of(effects, n))
    drawn = noise * rng.standard_normal((_DRAWS, n)) / spread[:, None]
    drawn += np.linalg.norm(redrawn, axis=1) * rng.standard_normal((_DRAWS, n))
    return np.asarray(drawn + rng.standard_normal((_DRAWS, common.shape[1])) @ common.T)


def largest(of: Deviations, errors: Array, span: float) -> Largest:
    """The largest of the deviations, with bounds.

    Parameters
    ----------
    of : Deviations
    errors : (draws, n)
        As `drawn_errors` gives them.
    span : float
        Output of full scale.
    """
    scattered = errors @ of.rows.T
    k = int(np.argmax(np.abs(of.values)))
    observed = abs(float(of.values[k]))
    energy, noise_energy = float(of.values @ of.values), float(np.square(scattered).sum(axis=1).mean())
    likely = of.values * (max(0.0, 1.0 - noise_energy / energy) if energy > 0.0 else 0.0)
    excess = np.abs(likely + scattered).max(axis=1).mean() - np.abs(likely).max()
    above = np.quantile(np.abs(scattered).max(axis=1), COVERAGE)
    below = np.quantile(np.abs(scattered), COVERAGE, axis=0).max()
    return Largest(
        of.name,
        observed / span,
        max(0.0, observed - float(excess)) / span,
        max(0.0, observed - float(above)) / span,
        (observed + float(below)) / span,
        np.sign(of.values[k]) * of.rows[k] / span,
    )
