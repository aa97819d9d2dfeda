"""Was the instrument at rest: pieces of a recording in which a channel is far more restless than in its calm ones."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.records.dwells import window_samples

RESTLESS = 30.0
"""Variance within a piece over that of calm pieces, from which it certainly is not noise alone."""

JUMP = 7.0
"""Difference of adjacent means in standard deviations (by the median), from which it certainly is not noise alone."""

CALM = 0.05
"""Share of the pieces, the calmest, that tells what noise alone looks like."""

MOST = 0.25
"""Share of restless pieces from which the channel counts as moving."""

LARGEST = 30.0
"""Factor on the Allan deviation by restless pieces from which the channel counts as moving."""

_MEDIAN_OF_A_SQUARE = 0.455  # of a standard normal variable


@dataclass(frozen=True)
class Unrest:
    """Disturbances of a channel.

    ``pieces`` of ``of`` pieces, each ``tau`` [s] long, are restless, the ``first`` and the last one from and to these
    times [s] from the start; ``factor`` is the deviation of adjacent means over ``tau`` with them, over that without.
    """

    pieces: int
    of: int
    tau: float
    first: float
    last: float
    factor: float

    @property
    def moving(self) -> bool:
        """True where the instrument moves, not only is knocked now and then."""
        return self.pieces > MOST * self.of or not self.factor <= LARGEST

    @property
    def felt(self) -> bool:
        """True where it changes the deviation, not only a few samples."""
        return not self.factor <= 1.05

    @property
    def words(self) -> str:
        """A sentence of it, without the channel."""
        effect = (
            f"; without them the deviation at {self.tau:.3g} s would be {self.factor:.2g} times smaller"
            if np.isfinite(self.factor) and self.felt
            else ""
        )
        return (
            f"{'moves' if self.moving else 'is disturbed'}: {self.pieces} of {self.of} pieces of {self.tau:.3g} s are "
            f"far more restless than the calm ones{effect}"
        )


def unrest(x: Array, interval: float) -> Unrest | None:
    """Pieces of samples ``x`` (n,) at equal intervals [s] (NaN: missing) that are not noise alone; None: none are.

    Pieces are of a second, of eleven samples at least. One is restless by the variance within it, or by a jump of
    its mean. The variance of calm pieces is taken for that of a uniform rounding error at least, so that a step now
    and then of a coarse output is no unrest.
    """
    window = window_samples(1.0 / interval)
    count = len(x) // window
    if count < 5:
        return None
    pieces = x[: count * window].reshape(count, window)
    mean = pieces.mean(axis=1)
    variance = np.mean((pieces - mean[:, None]) ** 2, axis=1)
    finite = np.isfinite(variance)  # a piece that lacks a sample says nothing
    if not finite.any():
        return None
    moves = np.abs(np.diff(x))
    step = float(np.min(moves, initial=np.inf, where=moves > 0))
    calm = max(float(np.quantile(variance[finite], CALM)), step**2 / 12.0)
    restless = finite & (variance > RESTLESS * calm)
    d, both = np.diff(mean) ** 2, finite[1:] & finite[:-1]
    usual = max(float(np.median(d[both])) / _MEDIAN_OF_A_SQUARE, calm / window) if both.any() else np.inf
    jump = both & (d > JUMP**2 * usual)
    restless[1:] |= jump
    restless[:-1] |= jump
    if not restless.any():
        return None
    quiet = both & ~restless[1:] & ~restless[:-1]
    factor = float(np.sqrt(d[both].mean() / d[quiet].mean())) if d[quiet].any() else np.inf
    first, last = np.flatnonzero(restless)[[0, -1]] * window * interval
    return Unrest(
        int(restless.sum()), int(finite.sum()), window * interval, first, last + window * interval, factor
    )
