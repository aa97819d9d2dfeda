"""Rests of a recording, and the nodes at which its velocity is known to be zero."""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.errors import StudyError
from inercal.foundation.records.dwells import Dwell, static_intervals
from inercal.systems.strapdown.limits import LIMITS
from inercal.systems.strapdown.model.samples import Samples
from inercal.systems.strapdown.settings import Rests


def found_rests(samples: Samples, settings: Rests) -> tuple[Dwell, ...]:
    """Rests of a recording, without the margin at both ends: as listed, or where rate and force say so.

    A sample is at rest where in a window of `LIMITS.window` about it the rate scatters little, its mean is near that of
    the quietest windows (a turn at constant rate does not scatter), and the force scatters little.
    """
    if settings.list:
        return _listed(samples, settings)
    window = max(3, round(LIMITS.window / samples.ts))
    rate, force = _moving(samples.rate, window), _moving(samples.force, window)
    quiet = rate[1] <= np.quantile(rate[1], LIMITS.quiet_share)
    mean = np.median(rate[0][quiet], axis=0)
    off = np.linalg.norm(rate[0] - mean, axis=1)
    still = (
        (rate[1] < max(LIMITS.restless_ratio * np.median(rate[1][quiet]), LIMITS.least_scatter))
        & (off < LIMITS.resting_rate)
        & (force[1] < max(LIMITS.restless_ratio * np.median(force[1][quiet]), LIMITS.least_shake))
    )
    margin, shortest = round(settings.margin / samples.ts), round(LIMITS.shortest_rest / samples.ts)
    whole = static_intervals(still, np.empty(0, dtype=np.int64), shortest + 2 * margin)
    return tuple(Dwell(each.start + margin, each.stop - margin) for each in whole)


def mean_force(samples: Samples, rests: tuple[Dwell, ...]) -> float:
    """Median over the ``rests`` of the size [m/s^2] of the mean force read in each."""
    with np.errstate(all="ignore"):
        means = [np.mean(samples.force[each.start : each.stop], axis=0) for each in rests]
        return float(np.median(np.linalg.norm(means, axis=1)))


def _moving(x: Array, window: int) -> tuple[Array, Array]:
    """Mean (n, 3) and standard deviation (n,), its three axes together, in a window about each sample."""
    middle = np.median(x, axis=0)
    padded = np.pad(x - middle, ((window // 2, window - 1 - window // 2), (0, 0)), mode="edge")
    sums, squares = (
        np.concatenate([np.zeros((1, 3)), np.cumsum(each, axis=0)]) for each in (padded, padded**2)
    )
    mean = (sums[window:] - sums[:-window]) / window
    variance = (squares[window:] - squares[:-window]) / window - mean**2
    return mean + middle, np.sqrt(np.maximum(variance.sum(axis=1), 0.0))


def _listed(samples: Samples, settings: Rests) -> tuple[Dwell, ...]:
    """The rests that a study lists [s from the first sample on]."""
    dwells = [Dwell(round(begin / samples.ts), round(end / samples.ts)) for begin, end in settings.list]
    last = len(samples.rate)
    for k, each in enumerate(dwells):
        after = dwells[k - 1].stop if k else 0
        if not after <= each.start < each.stop <= last:
            begin, end = settings.list[k]
            raise StudyError(
                "rests.list",
                f"found a rest from {begin:g} s to {end:g} s, expected rests one after the other within the "
                f"{last * samples.ts:.6g} s of the record",
            )
    return tuple(dwells)


@short_repr
@dataclass(frozen=True, eq=False)
class Nodes:
    """Nodes of a recording: the ``sample`` (k + 1,) before which each lies, and the number of its ``rest`` (k + 1,).

    Intervals between two nodes are integrated in blocks that begin at the samples ``cuts``, the block of each node by
    ``first`` (k + 1,).
    """

    sample: NDArray[np.int64]
    rest: NDArray[np.int64]
    cuts: NDArray[np.int64]
    first: NDArray[np.int64]

    @property
    def turns(self) -> NDArray[np.int64]:
        """Intervals between the rests."""
        return np.flatnonzero(np.diff(self.rest))


def nodes_of(samples: Samples, rests: tuple[Dwell, ...], every: float) -> Nodes:
    """Nodes at both ends of each rest, and between them ``every`` [s] or a little less."""
    sample, rest = list[int](), list[int]()
    for number, each in enumerate(rests):
        pieces = max(1, int(np.ceil((each.stop - each.start) * samples.ts / every - 1e-6)))
        sample += np.linspace(each.start, each.stop, pieces + 1).round().astype(int).tolist()
        rest += [number] * (pieces + 1)
    size = np.linalg.norm(samples.rate, axis=1) * samples.ts + 1e-12
    cuts, first = list[int](), list[int]()
    for begin, end in itertools.pairwise(sample):
        first.append(len(cuts))
        length = int(np.clip(LIMITS.block_angle / size[begin:end].max(), 1, LIMITS.block_samples))
        cuts += range(begin, end, length)
    return Nodes(
        np.array(sample), np.array(rest), np.array([*cuts, sample[-1]]), np.array([*first, len(cuts)])
    )
