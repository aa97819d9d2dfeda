"""Variances and means in short windows of a triad, and the valleys between rest and motion in their distribution."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.records.dwells import Dwell, static_intervals
from inercal.systems.imu.sections.cutting.limits import LIMITS

Bools = NDArray[np.bool_]
Places = NDArray[np.int64]


@dataclass(frozen=True, eq=False)
class PoseMeans:
    """Means (n, 3) of poses, less that of the recording, and their ``lengths`` (n,) in blocks."""

    means: Array
    lengths: Array

    @property
    def blocks(self) -> float:
        """Blocks of all."""
        return float(self.lengths.sum())


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows of a triad: variances (m,) summed over axes, infinite where a row is missing or time breaks.

    Means (m, 3) of windows and (m + 3, 3) of ``blocks`` are less the mean ``middle`` (3,) of the recording; ``breaks``
    are blocks before which time breaks.
    """

    variance: Array
    means: Array
    blocks: Array
    middle: Array
    breaks: Places

    @staticmethod
    def of(x: Array, block: int, cuts: Places) -> Windows:
        """The windows of outputs (n, 3), in blocks of so many rows."""
        count = len(x) // block
        finite = x[np.isfinite(x).all(axis=1)]
        middle = np.asarray(finite.mean(axis=0) if len(finite) else np.zeros(x.shape[1]))
        rows = (x[: count * block] - middle).reshape(count, block, -1)
        sums, squares = rows.sum(axis=1), np.einsum("ijk,ijk->i", rows, rows)
        total, power = (_sums_of_windows(values) for values in (sums, squares))
        size = LIMITS.blocks_of_window * block
        variance = np.maximum(power - (total**2).sum(axis=1) / size, 0.0) / (size - 1)
        begins = np.arange(len(variance)) * block
        inside = np.searchsorted(cuts, begins + size) > np.searchsorted(cuts, begins, side="right")
        variance[inside | ~np.isfinite(variance)] = np.inf
        return Windows(variance, total / size, sums / block, middle, cuts[cuts % block == 0] // block)

    @property
    def gravity(self) -> float:
        """Size of gravity [output]: half the largest range of an axis, or the mean output where it hardly turns."""
        known = np.isfinite(self.variance)
        if not known.any():
            return 0.0
        calm = self.means[self.variance <= np.median(self.variance[known])]
        half, whole = (
            0.5 * float(np.max(np.ptp(calm, axis=0))),
            float(np.linalg.norm(self.middle + calm.mean(axis=0))),
        )
        return half if half > LIMITS.drift_in_hold * whole else whole

    def levels(self, cap: float) -> list[float]:
        """Variances below which windows may be still: the valleys below ``cap``; of one hump that all are, or none."""
        below = [level for level in valleys(self.variance) if level < cap]
        return below or [cap if np.mean(self.variance < cap) > 0.5 else 0.0]

    def unrest(self) -> tuple[Array, Array]:
        """Variances (m,) of a gyro's windows, and squares (m,) of their means' distance from that at rest."""
        return self.variance, ((self.means - self.at_rest()) ** 2).sum(axis=1)

    def at_rest(self) -> Array:
        """Mean output (3,) at rest: of the calm windows, that to which the instrument comes back most often."""
        known = self.variance[np.isfinite(self.variance)]
        if not len(known):
            return np.zeros(self.means.shape[1])
        found = valleys(self.variance)
        calm = np.flatnonzero(self.variance <= (found[0] if found else np.median(known)))
        calm = calm[:: max(len(calm) // 600, 1)]
        means = self.means[calm]
        reach = 9.0 * float(np.median(self.variance[calm])) / len(self.means[0])
        near = ((means[:, None] - means[None]) ** 2).sum(axis=2) <= max(reach, np.finfo(float).tiny)
        visits = (near & ~np.roll(near, 1, axis=1)).sum(axis=1)
        best = int(np.lexsort((near.sum(axis=1), np.minimum(visits, 1000)))[-1])
        return np.asarray(means[near[best]].mean(axis=0))

    def stretches(self, still: Bools, shortest: int) -> list[Dwell]:
        """Runs of blocks, at least so many, that lie in windows which are still (m,)."""
        inside = np.zeros(len(self.blocks), dtype=bool)
        for k in range(LIMITS.blocks_of_window):
            inside[k : k + len(still)] |= still
        return list(static_intervals(inside, self.breaks, shortest))

    def poses(self, stretches: Sequence[Dwell]) -> PoseMeans:
        """Poses in stretches of blocks that do not drift: those in a row with one vertical are one."""
        if not stretches:
            return PoseMeans(np.zeros((0, 3)), np.zeros(0))
        sums = np.concatenate(
            [np.zeros((1, self.blocks.shape[1])), np.cumsum(np.nan_to_num(self.blocks), axis=0)]
        )
        starts, stops = (np.array([getattr(one, end) for one in stretches]) for end in ("start", "stop"))
        third = np.maximum((stops - starts) // 3, 1)
        first, last = (
            (sums[starts + third] - sums[starts]) / third[:, None],
            (sums[stops] - sums[stops - third]) / third[:, None],
        )
        steps = np.nan_to_num(np.sum(np.diff(self.blocks, axis=0) ** 2, axis=1))
        power = np.concatenate([[0.0], np.cumsum(steps)])
        noise = (power[stops - 1] - power[starts]) / (stops - starts - 1) / third
        limit = np.maximum((LIMITS.drift_in_hold * self.gravity) ** 2, LIMITS.drift_sigmas**2 * noise)
        sound = ((last - first) ** 2).sum(axis=1) <= limit
        whole, lengths = (sums[stops] - sums[starts])[sound], (stops - starts)[sound].astype(float)
        means = whole / lengths[:, None]
        moved = np.linalg.norm(np.diff(means, axis=0), axis=1) > LIMITS.same_pose * self.gravity
        pose, count = np.concatenate([[0], np.cumsum(moved)]), len(means)
        if not count:
            return PoseMeans(np.zeros((0, 3)), np.zeros(0))
        total = np.bincount(pose, lengths).astype(float)
        merged = np.stack([np.bincount(pose, x) for x in whole.T], axis=1)
        return PoseMeans(merged / total[:, None], total)


def _sums_of_windows(values: Array) -> Array:
    """Sums over each window of its blocks' values (k, ...)."""
    stop = len(values) - LIMITS.blocks_of_window + 1
    return np.asarray(sum(values[k : stop + k] for k in range(LIMITS.blocks_of_window)))


def valleys(sizes: Array) -> list[float]:
    """Sizes at the valleys between humps of the logarithm of ``sizes`` (m,), ascending."""
    known = np.log10(sizes[np.isfinite(sizes) & (sizes > 0.0)])
    if len(known) < 2 * LIMITS.hump_windows:
        return []
    width = 0.05
    counts, edges = np.histogram(known, bins=np.arange(known.min() - 1.0, known.max() + 1.0, width))
    places = np.arange(-8, 9)
    kernel = np.exp(-0.5 * (places / 3.0) ** 2)
    smooth = np.convolve(counts, kernel / kernel.max(), mode="same")
    found: list[tuple[int, int]] = []  # ends of the valleys: where the smoothed counts are lowest
    top, low, begin, end = 0.0, np.inf, 0, 0
    for k, height in enumerate(smooth):
        if height < low - 1e-9:
            low, begin, end = height, k, k
        elif height <= low + 1e-9:
            end = k
        hump = min(top, height)
        if hump >= LIMITS.hump_windows and low <= LIMITS.valley_depth * hump:
            found.append((begin, end))
            top, low = height, height
        if height > top:
            top, low = height, height
    # in a wide valley not far from rest: a slow motion begins in it
    reach = round(LIMITS.valley_reach / width)
    return [float(10.0 ** (0.5 * (edges[a] + edges[min(b, a + 2 * reach)] + width))) for a, b in found]
