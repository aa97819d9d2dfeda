"""Motion of the sensors by a reference angle, and the part of it that a fit can use.

The reference angle is interpolated by a quintic spline, whose derivatives are rate, acceleration and jerk at any
time, also where stamps are uneven. Derivatives of a noisy reference are noisier by far; but the fit is linear in them,
and if reading and model are smoothed alike, noise that the smoothing removes does no harm and motion that it removes
leaves no bias, whatever its length. Both pass four moving averages of 50 ms, and each 50 ms one row is kept.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.errors import RecordError
from inercal.foundation.records.dwells import breaks
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording, later

Array: TypeAlias = NDArray[np.float64]

SPAN = 0.05
"""Length [s] of each moving average, and time between rows that are kept."""

OVERLAP = (2416.0 / 5040.0, 1191.0 / 5040.0, 120.0 / 5040.0, 1.0 / 5040.0, 0.0, 0.0)
"""Covariances of rows that are kept and lie 0, 1, 2.. apart, for white noise, over the variance of the mean of as many
samples as lie between two: the smoothing is a cubic B-spline, and these are the B-spline of order 7 at 0, 1, 2.."""

_EDGE = 10
"""Rows at breaks and ends at which the spline's derivatives are not to be trusted."""


@dataclass(frozen=True, eq=False)
class ReferenceMotion:
    """The reference motion of a recording.

    ``rows`` (n,) of the recording that are used, ``t`` (n,) [s] their times, ``whole`` (n,) False at breaks; ``span``
    rows make up a moving average. ``noise`` [rad] of the reference, from sample to sample; ``derivatives`` the spline
    and its first three derivatives, 0 where they are no more than that noise.
    """

    rows: NDArray[np.int64]
    t: Array
    whole: NDArray[np.bool_]
    span: int
    noise: float
    derivatives: tuple[Callable[[Array], Array], ...]

    @cached_property
    def kernel(self) -> Array:
        """Weights of the smoothing."""
        kernel = np.ones(1)
        for _ in range(4):
            kernel = np.convolve(kernel, np.full(self.span, 1.0 / self.span))
        return kernel

    def motion(self, delay: float) -> tuple[Array, Array, Array, Array, Array]:
        """Angle [rad], rate, its square, acceleration and jerk (n,) as seen by sensors that lag by ``delay`` [s].

        The mean contribution of noise to the square is taken off.
        """
        theta, w, al, jerk = (of(self.t - delay) for of in self.derivatives)
        step = float(np.median(np.diff(self.t)))
        return theta, w, w**2 - _gain(1, np.ones(1)) * (self.noise / step) ** 2, al, jerk

    def smoothed(self, x: Array) -> Array:
        """(k,) kept rows of ``x`` (n,), smoothed; NaN where a break or a missing value lies in the kernel."""
        x = np.where(self.whole, x, np.nan)
        windows = np.lib.stride_tricks.sliding_window_view(x, len(self.kernel))
        return np.asarray(windows[:: self.span] @ self.kernel)


def reference(recording: Recording) -> ReferenceMotion:
    """The reference motion of a recording; raises `RecordError` where there is none, or too little of it."""
    from scipy.interpolate import make_interp_spline

    if recording.reference is None:
        raise RecordError("theta_ref", "missing, expected a reference angle to fit the sensors to")
    rows = later(recording.t)
    rows = rows[np.isfinite(recording.reference[rows])]
    t = recording.t[rows]
    step = float(np.median(np.diff(t))) if len(t) > 1 else 1.0
    span = max(1, round(SPAN / step))
    if len(rows) < LIMITS.reference_spans * span:
        text = (
            f"found {len(rows)} rows with a reference angle, expected {LIMITS.reference_spans * span} or more"
        )
        raise RecordError("theta_ref", f"{text} to fit sensors to")
    theta = np.unwrap(recording.reference[rows])
    whole = np.ones(len(t), dtype=bool)
    for cut in [0, *breaks(t, LIMITS.reference_gap * step).tolist(), len(t)]:
        whole[max(cut - _EDGE, 0) : cut + _EDGE] = False
    # differences of the eighth order leave nothing of a motion; their noise is the root of 16! / 8!^2 times larger
    noise = float(np.median(np.abs(np.diff(theta, 8)))) / 0.6745 / np.sqrt(12870.0)
    spline = make_interp_spline(t, theta, k=5)
    measured = ReferenceMotion(
        rows, t, whole, span, noise, (spline, *(spline.derivative(k) for k in (1, 2, 3)))
    )
    shown = [measured.derivatives[0]]
    for order in (1, 2, 3):
        derivative = measured.smoothed(measured.derivatives[order](t))
        power = float(np.nanmean(derivative**2)) if np.isfinite(derivative).any() else 0.0
        of_noise = (noise / step**order) ** 2 * _gain(order, measured.kernel)
        moves = power > LIMITS.derivative_power * of_noise
        shown.append(measured.derivatives[order] if moves else np.zeros_like)
    return replace(measured, derivatives=tuple(shown))


def _gain(order: int, kernel: Array) -> float:
    """Variance of a derivative, smoothed, of a quintic spline through white noise of unit variance, one apart."""
    from scipy.interpolate import make_interp_spline

    at = np.arange(41.0)
    answer = make_interp_spline(at, at == 20.0, k=5).derivative(order)(at)
    return float(np.sum(np.convolve(answer, kernel) ** 2))
