"""Overlapping Allan deviation of a record at rest, with confidence limits; gaps are allowed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError, RecordError
from inercal.foundation.instruments.noise import SYMBOLS
from inercal.foundation.noise.covariance import ALPHA, degrees_of_freedom, lag_one
from inercal.foundation.noise.kernels import mean_square, mean_square_with_gaps
from inercal.foundation.noise.limits import LIMITS

Integers = NDArray[np.int64]
Counts = NDArray[np.int32]

_WHITE_AND_STEPS = [SYMBOLS.index("N"), SYMBOLS.index("Q")]

_MOST = 1 << 14  # places that are enough to tell it


@dataclass(frozen=True, eq=False)
class AllanDeviation:
    """Overlapping Allan deviation of channels.

    ``tau`` (k,) averaging times [s]; ``deviation``, ``lower``, ``upper`` (k, channels) in the unit of the samples,
    the limits at confidence ``level`` (NaN where gaps leave no difference); ``dof`` (k, channels) equivalent degrees
    of freedom of the variance; ``alpha`` (k, channels) the exponent of the spectrum taken for them: 2 (quantisation),
    0 (white), -1 (flicker) or -2 (random walk);
    ``terms`` (k, channels) how many differences of adjacent means were there, and ``gain`` (k, channels, 5) the
    variance to be expected of those over that without gaps, of N, B, K, R and Q (1 without gaps). ``samples`` (with
    the missing ones) and ``interval`` [s] are those of the record.
    """

    tau: Array
    deviation: Array
    lower: Array
    upper: Array
    dof: Array
    alpha: Integers
    terms: Integers
    gain: Array
    level: float
    samples: int
    interval: float

    @property
    def lengths(self) -> Integers:
        """Samples in a mean (k,)."""
        return np.rint(self.tau / self.interval).astype(np.int64)


def allan_deviation(
    x: ArrayLike, interval: float, tau: ArrayLike | None = None, level: float = 0.683
) -> AllanDeviation:
    """Overlapping Allan deviation, with confidence limits.

    Parameters
    ----------
    x : (n,) or (n, channels)
        Samples at equal intervals, means over them; NaN where one is missing. n >= 3.
    interval : float
        Sample interval [s].
    tau : (k,), optional
        Averaging times [s], rounded to whole samples, up to half the record. By default eight a decade, from one
        sample to a third of the record, beyond which there are not even two degrees of freedom.
    level : float, optional
        Confidence of the limits.

    Raises
    ------
    InputError
        Too few samples, an interval that is not positive, or averaging times that the record does not have.

    Notes
    -----
    A mean with missing samples is that of the samples there, if they are `Limits.present_share` of it at least: to
    ask for all of them would leave nothing at long averaging times in a record that lost one sample in a thousand.
    White noise is then overstated by the share that is missing, drift hardly. Quantisation is overstated by far more:
    the errors at the ends of a gap within a mean no longer cancel, and add as white noise of 2 Q^2 a gap does. ``gain``
    says by how much, for the gaps that there are.

    The limits take the variance for chi-square with the equivalent degrees of freedom of one kind of noise (see
    `inercal.foundation.noise.covariance`): at each averaging time the kind whose differences of adjacent means have a
    lag 1 autocorrelation nearest to the one found, which is the method of Riley and Howe with the exact values for
    means (-2/3 quantisation, -1/2 white, -0.22 flicker, 1/4 random walk). The kinds come in this order as the averaging
    time grows, and below `Limits.kind_means` means the last one told is kept.
    Stable32 takes white samples for smoothed over a sample, and gives at one sample limits that are a twelfth closer.

    References
    ----------
    W. J. Riley and D. A. Howe, NIST SP 1065 (2008), sections 5.2.4, 5.4.1 and 5.5.6. C. A. Greenhall and W. J. Riley,
    35th PTTI (2003).
    """
    from scipy.special import gammaincinv

    values = np.asarray(x, dtype=float)
    values = values[:, None] if values.ndim == 1 else values
    n = len(values)
    if values.ndim != 2 or n < 3:
        raise InputError(
            "samples",
            f"found an array of shape {np.shape(x)}, expected three samples or more of each channel",
        )
    if not (np.isfinite(interval) and interval > 0 and 0 < level < 1):
        raise InputError(
            "interval",
            f"found {interval:g} s at level {level:g}, expected more than 0, and a level in (0, 1)",
        )
    lengths = _default_lengths(n) if tau is None else _stated_lengths(tau, interval, n)
    shape = (len(lengths), values.shape[1])
    squares, terms, alpha = np.zeros(shape), np.zeros(shape, np.int64), np.zeros(shape, np.int64)
    gain = np.ones((*shape, len(SYMBOLS)))
    for channel, samples in enumerate(values.T):
        sums, present = _running_sums(samples)
        runs = None if present is None else _runs(samples)
        for row, m in enumerate(lengths.tolist()):
            squares[row, channel], terms[row, channel], *of_noise = _mean_square(sums, present, runs, m)
            gain[row, channel, _WHITE_AND_STEPS] = of_noise
            last = int(alpha[row - 1, channel]) if row else max(ALPHA)
            alpha[row, channel] = _exponent(sums, present, m, last)
    if tau is None:
        there = terms.any(axis=1)
        lengths, squares, terms = lengths[there], squares[there], terms[there]
        alpha, gain = alpha[there], gain[there]
    deviation = np.sqrt(np.where(terms > 0, squares, np.nan) / 2.0) / lengths[:, None]
    dof = np.ones(alpha.shape)
    for row, channel in np.ndindex(*alpha.shape):
        dof[row, channel] = degrees_of_freedom(n, int(lengths[row]), int(alpha[row, channel]))
    dof = np.maximum(dof * terms / (n + 1.0 - 2.0 * lengths[:, None]), 1.0)
    lower, upper = (
        deviation * np.sqrt(0.5 * dof / gammaincinv(0.5 * dof, p))
        for p in (0.5 + 0.5 * level, 0.5 - 0.5 * level)
    )
    return AllanDeviation(
        np.asarray(lengths * interval, dtype=float),
        deviation,
        lower,
        upper,
        dof,
        alpha,
        terms,
        gain,
        level,
        n,
        float(interval),
    )


def regular(t: ArrayLike, x: ArrayLike, where: object = "t") -> tuple[float, Array]:
    """Samples ``x`` (n, ...) with time stamps ``t`` (n,) [s] on an even grid, without interpolation.

    Stamps increase, with jitter and gaps: steps of more than one and a half times the median. Returned are the sample
    interval [s], the mean of the other steps, so that stamps rounded to a clock's tick do no harm, and the samples
    (rows, ...) in their order, with a row of NaN for each one that a gap has room for.

    Raises `RecordError`, naming ``where``, for fewer than three stamps, stamps that do not increase, or more rows
    missing than ten times those there.
    """
    stamps, values = np.asarray(t, dtype=float), np.asarray(x, dtype=float)
    if stamps.ndim != 1 or len(stamps) < 3 or len(values) != len(stamps):
        raise RecordError(
            where, f"found {stamps.size} time stamps of {len(values)} samples, expected three or more"
        )
    steps = np.diff(stamps)
    if not np.all(steps > 0):  # also where a stamp is not a number
        row = int(np.argmin(steps > 0)) + 1
        raise RecordError(
            where, f"found {stamps[row]:g} s after {stamps[row - 1]:g} s, expected increasing times"
        )
    median = float(np.median(steps))
    interval = float(np.mean(steps[steps <= 1.5 * median]))
    apart = np.where(steps <= 1.5 * median, 1.0, np.maximum(np.rint(steps / interval), 1.0))
    rows = 1.0 + float(np.sum(apart))
    if rows > 11.0 * len(stamps):
        raise RecordError(
            where,
            f"found gaps of {rows - len(stamps):.0f} samples in all between {len(stamps)} that are there, expected a "
            "record without long interruptions",
        )
    grid = np.full((int(rows), *values.shape[1:]), np.nan)
    grid[np.concatenate([[0], np.cumsum(apart)]).astype(np.int64)] = values
    return interval, grid


def _default_lengths(n: int) -> Integers:
    """Eight averaging times a decade, from one sample to a third of ``n``."""
    decades = np.arange(0.0, 8.0 * np.log10(n / 3.0) + 1e-9) / 8.0
    return np.unique(np.rint(10.0**decades)).astype(np.int64)


def _stated_lengths(tau: ArrayLike, interval: float, n: int) -> Integers:
    """Averaging times in samples, each once."""
    times = np.atleast_1d(np.asarray(tau, dtype=float))
    lengths = np.unique(np.rint(times / interval)) if np.all(np.isfinite(times)) else np.zeros(1)
    if not (len(lengths) and lengths[0] >= 1 and lengths[-1] <= n // 2):
        raise InputError(
            "tau",
            f"found {_span(times)}, expected averaging times from {interval:g} s, one sample, to "
            f"{n // 2 * interval:g} s, half the record",
        )
    return lengths.astype(np.int64)


def _span(times: Array) -> str:
    """Averaging times for a message."""
    return f"{np.min(times):g} s to {np.max(times):g} s" if times.size else "none"


def _running_sums(samples: Array) -> tuple[Array, Counts | None]:
    """Running sums (n+1,) of samples less their mean and, where some are missing, of the number present."""
    there = np.isfinite(samples)
    if there.all():
        return np.concatenate([[0.0], np.cumsum(samples - samples.mean())]), None
    level = samples[there].mean() if there.any() else 0.0
    sums = np.concatenate([[0.0], np.cumsum(np.where(there, samples - level, 0.0))])
    return sums, _counted(there)


def _runs(samples: Array) -> Counts:
    """Running number (n+1,) of runs of present samples that have begun."""
    there = np.isfinite(samples)
    begun = there & ~np.concatenate([[False], there[:-1]])
    return _counted(begun)


def _counted(flags: NDArray[np.bool_]) -> Counts:
    """Cumulative count (n+1,) of true values."""
    counts = np.zeros(len(flags) + 1, np.int32)
    np.cumsum(flags, out=counts[1:])
    return counts


def _mean_square(
    sums: Array, present: Counts | None, runs: Counts | None, m: int
) -> tuple[float, int, float, float]:
    """Mean square of the second differences over ``m`` samples, their number, and the gain of N and of Q by gaps."""
    if present is None or runs is None:
        return mean_square(sums, m), len(sums) - 2 * m, 1.0, 1.0
    square, count, white, steps = mean_square_with_gaps(sums, present, runs, m, _least(m))
    return (square, count, white / (2.0 * m), steps / 6.0) if count else (square, count, 1.0, 1.0)


def _least(m: int) -> int:
    """Samples that a mean over ``m`` needs."""
    return int(np.ceil(LIMITS.present_share * m))


def _exponent(sums: Array, present: Counts | None, m: int, last: int) -> int:
    """Kind of noise of means over ``m`` samples, as an exponent that is not above ``last``; that where they are few."""
    n = len(sums) - 1
    if n // m < LIMITS.kind_means:
        return last
    at = np.arange(0, n - 3 * m + 1, max(1, m // 4, n // _MOST))
    first, second, third = (_means(sums, present, m, at + k * m) for k in range(3))
    before, after = second - first, third - second
    finite = np.isfinite(before) & np.isfinite(after)
    if np.count_nonzero(finite) < LIMITS.kind_means:
        return last
    before, after = (steps[finite] - steps[finite].mean() for steps in (before, after))  # without a ramp
    power = float(np.sum(before**2) + np.sum(after**2))
    if power == 0.0:
        return last
    away = np.abs(lag_one(m) - 2.0 * float(np.sum(before * after)) / power)
    return ALPHA[int(np.argmin(np.where(np.array(ALPHA) <= last, away, np.inf)))]


def _means(sums: Array, present: Counts | None, m: int, at: Integers) -> Array:
    """Means over ``m`` samples from ``at`` on; NaN where too many are missing."""
    total = sums[at + m] - sums[at]
    if present is None:
        return np.asarray(total / m)
    count = present[at + m] - present[at]
    return np.where(count >= _least(m), total / np.maximum(count, 1), np.nan)
