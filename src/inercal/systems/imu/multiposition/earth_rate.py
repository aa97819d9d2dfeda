"""Earth rate in a hand-held calibration: its vertical part is known with the latitude, the rest is not.

The instrument's heading is unknown, so the horizontal part is a vector of known size and unknown direction,
fixed to the Earth. The turns tell how it lies in every pose relative to the first. Its two components (and the
error of the vertical one) are unknowns of the fit with a prior: a gyro too coarse to see them keeps the
prior, and its uncertainty; a fine one measures them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.earth import EARTH_RATE, Site
from inercal.foundation.instruments.triad import TriadModel
from inercal.systems.imu.turns import Turns, increments, whole_turns


@dataclass(frozen=True)
class EarthRate:
    """Earth rate at a site, with its uncertainty.

    The ``vertical`` part [rad/s] with its standard uncertainty ``vertical_u``, and the standard deviation
    ``horizontal_u`` of each horizontal component.
    """

    vertical: float = 0.0
    vertical_u: float = 0.0
    horizontal_u: float = 0.0


def earth_rate_at(site: Site) -> EarthRate:
    """Earth rate at a site, with its uncertainty."""
    return EarthRate(site.vertical_rate, site.vertical_rate_u, site.horizontal_rate_u)


@dataclass(frozen=True)
class UnknownRates:
    """Unknown parts of earth rate: one vertical, and two horizontal for each unbroken run of turns.

    ``verticals`` (n, 3) in the poses and ``vertical`` [rad/s] the known part; ``in_turns`` (3 m, q) [s] what a
    unit rate adds to the misses of the turns; ``at_rest`` (n, 3, q) its direction in the poses; ``sizes`` (q,)
    [rad/s] the prior standard deviations.
    """

    names: tuple[str, ...]
    verticals: Array
    vertical: float
    in_turns: Array
    at_rest: Array
    sizes: Array

    def rates(self, rates: Array) -> Array:
        """Earth rate in each pose (n, 3) [rad/s]."""
        return np.asarray(self.vertical * self.verticals + self.at_rest @ rates)

    def output(self, model: TriadModel, rates: Array) -> Array:
        """Output (n, 3) of the gyro in the poses that earth rate makes."""
        return np.asarray(self.rates(rates) @ model.gain.T)

    def output_sensitivity(self, model: TriadModel, rates: Array, parameters: int) -> Array:
        """(3 n, p): derivative of `output` with respect to the gyro's parameters in the order of the term table."""
        rate = self.rates(rates)
        out = np.zeros((len(rate), 3, parameters))
        column = 6
        for i in range(3):
            out[:, i, 3 + i] = rate @ model.misalignment[i]
            for j in range(3):
                if i != j:
                    out[:, i, column] = model.scale[i] * rate[:, j]
                    column += 1
        return out.reshape(-1, parameters)


def vertical_output(verticals: Array, model: TriadModel, earth: EarthRate) -> Array:
    """Output (n, 3) of the gyro in the poses that the vertical part of earth rate makes."""
    return np.asarray(earth.vertical * verticals @ model.gain.T)


def unknown_rates(
    turns: Turns, verticals: Array, model: TriadModel, drift: Array, earth: EarthRate
) -> UnknownRates:
    """Carry the verticals from the first pose through turns that connect, with an unknown rate of the Earth.

    Notes
    -----
    n is the vertical, tau the duration of a turn from attitude R. A rate h fixed to the Earth adds ``-h dt`` to every
    rotation vector, in the frame of the turn's start ``-h tau`` in all, and so moves the carried vertical
    by ``-tau R^T (n x h)``.
    """
    R = whole_turns(increments(turns, model, drift))
    runs = [k for k in range(len(turns)) if k == 0 or turns.first[k] != turns.last[k - 1]]
    q = 1 + 2 * len(runs)
    at_rest, in_turns = np.zeros((len(verticals), 3, q)), np.zeros((len(turns), 3, q))
    at_rest[:, :, 0] = verticals
    columns, axes = slice(1, 3), np.zeros((3, 2))
    for k in range(len(turns)):
        here, there = turns.first[k], turns.last[k]
        if k in runs:
            columns = slice(1 + 2 * runs.index(k), 3 + 2 * runs.index(k))
            axes = _horizontal(np.eye(3)[:, np.argmin(np.abs(verticals[here]))], verticals[here])
            at_rest[here, :, columns] = axes
        in_turns[k, :, columns] = -turns.durations[k] * R[k].T @ np.cross(verticals[here], axes.T).T
        axes = _horizontal(R[k].T @ axes[:, 0], verticals[there])
        at_rest[there, :, columns] = axes
    sizes = np.concatenate([[earth.vertical_u], np.full(q - 1, earth.horizontal_u)])
    names = np.array(["vertical earth rate", *(f"horizontal earth rate {i}" for i in range(1, q))])
    kept = sizes > 1e-6 * EARTH_RATE  # at the pole nothing is left of the horizontal part
    turned = in_turns.reshape(3 * len(turns), q)[:, kept]
    return UnknownRates(
        tuple(map(str, names[kept])), verticals, earth.vertical, turned, at_rest[:, :, kept], sizes[kept]
    )


def _horizontal(near: Array, up: Array) -> Array:
    """Two horizontal unit vectors (3, 2), the first as near as can be to a vector, the second up x first."""
    first = near - up * (up @ near)
    first /= np.linalg.norm(first)
    return np.column_stack([first, np.cross(up, first)])
