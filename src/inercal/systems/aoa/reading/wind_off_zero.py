"""Wind-off zero and tare: a stretch of the record at rest, at an angle known from elsewhere.

The fusion takes the angle as measured in every row of the stretch, each so uncertain that all of them together have the
stated uncertainty: the error of the angle is the same in all rows, while noise and flexure average out. Through it the
filter learns the biases at that angle. A slight buffet about it is averaged: the known angle is that of the mean, each
row is more uncertain by the root mean square of the buffet, and the mean by what cut periods leave. The paper's methods
learn nothing: the biases seen in the stretch are subtracted from their readings.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Finding
from inercal.systems.aoa.layout import axes
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording, later, mean_u
from inercal.systems.aoa.settings import AoaSettings, Zero

Indices = NDArray[np.int64]

_PARTS = 8
"""Parts of the stretch whose angles are compared."""


def with_zero(recording: Recording, settings: AoaSettings) -> Recording:
    """The recording with the angle of the study's zero; unchanged where the study has none.

    Raises `RecordError` where the stretch is not in the record, has no accelerometers, or the model moves in it.
    """
    if settings.zero is None:
        return recording
    rows, buffet, of_mean = _stretch(recording, settings, settings.zero)
    zero = replace(settings.zero, u=math.hypot(settings.zero.u, of_mean))
    taken = later(recording.t)
    before = np.full(len(recording.t), -np.inf)
    before[taken[1:]] = recording.t[taken[:-1]]
    zero_angle = recording.zero_angle.copy()
    zero_angle[rows] = [
        angle_at(zero, t, last)
        for t, last in zip(recording.t[rows].tolist(), before[rows].tolist(), strict=True)
    ]
    zero_angle[rows, 1] = np.hypot(zero_angle[rows, 1], buffet)
    findings = recording.findings
    if buffet:
        text = (
            f"the model shakes by {math.degrees(buffet):.2g} deg rms in the stretch of the zero, which is averaged: u "
            f"of its angle is {math.degrees(zero.u):.2g} deg in the place of {math.degrees(settings.zero.u):.2g} deg"
        )
        findings = (*findings, Finding("not_at_rest", text, harm=()))
    return replace(recording, zero_angle=zero_angle, findings=findings)


def angle_at(zero: Zero, t: float, before: float) -> tuple[float, float]:
    """The angle of a row at ``t`` [s] and its standard uncertainty [rad], NaN outside of the stretch.

    The time since the row ``before`` [s] is the row's share of the stretch, and of its information.
    """
    share = min(t - before, t - zero.start) / (zero.end - zero.start)
    if not (share > 0.0 and t <= zero.end):
        return math.nan, math.nan
    return zero.angle, zero.u / math.sqrt(share)


def tare(recording: Recording, settings: AoaSettings) -> Recording:
    """The recording less the biases of its sensors at the study's zero; refused and unchanged as by `with_zero`."""
    if settings.zero is None:
        return recording
    rows, *_ = _stretch(recording, settings, settings.zero)
    return replace(
        recording,
        acc=recording.acc - (_means(recording.acc[rows]) - at_rest(settings, settings.zero.angle)),
        gyro=recording.gyro - np.nan_to_num(_means(recording.gyro[rows, None])[0]),
        turns=recording.turns - np.nan_to_num(_means(recording.turns[rows])),
    )


def at_rest(settings: AoaSettings, theta: float) -> Array:
    """(N,) m/s^2: readings of perfect accelerometers at rest, at the stated roll."""
    direction = [math.sin(theta), math.cos(theta)]
    return np.asarray(settings.site.gravity * (axes(settings.layout, settings.attitude.level) @ direction))


def _stretch(recording: Recording, settings: AoaSettings, zero: Zero) -> tuple[Indices, float, float]:
    """Rows of the stretch with all accelerometers, the rms of a slight buffet in it and what that leaves in its mean
    [rad]; refuses one in which the model moves."""
    where = f"zero.start = {zero.start:g} s, zero.end = {zero.end:g} s"
    taken = later(recording.t)
    t = recording.t[taken]
    inside = taken[(t >= zero.start) & (t <= zero.end)]
    if len(t) == 0 or zero.start > t[-1] or zero.end < t[0]:
        span = f"from {t[0]:g} s to {t[-1]:g} s" if len(t) else "without rows"
        raise RecordError(where, f"found a record {span}, expected the stretch at rest within it")
    rows = inside[np.isfinite(recording.acc[inside]).all(axis=1)]
    if (count := len(rows)) < (least := LIMITS.zero_rows):
        text = f"found {count} rows with all accelerometers in the stretch at rest, expected {least} or more"
        raise RecordError(where, text)
    moved, allowed = _moved(recording, settings, rows, zero.u)
    if not moved <= allowed:
        raise RecordError(
            where,
            f"the angle changes by {math.degrees(moved):.2g} deg in the stretch, expected a model at rest within "
            f"{math.degrees(allowed):.2g} deg",
        )
    return rows, *_shaken(recording, settings, rows)


def _moved(recording: Recording, settings: AoaSettings, rows: Indices, u: float) -> tuple[float, float]:
    """Change of the angle over some rows, and the largest change by noise [rad]: the worse of two tests.

    One compares the accelerometers from part to part of the stretch; the other takes the gyro's angle about its line,
    which also shows motion to and fro. Three times the stated uncertainty and the observed noise are allowed.
    """
    level, parts = settings.attitude.level, np.array_split(rows, _PARTS)
    means = np.array([recording.acc[each].mean(axis=0) for each in parts])
    # forward and upward specific force, the latter as of a level model
    forward, up = np.linalg.lstsq(axes(settings.layout), means.T, rcond=None)[0]
    angles = np.unwrap(np.arctan2(forward, up / (level if abs(level) > LIMITS.level_cosine else 1.0)))
    noise = max(mean_u(column) for each in parts for column in recording.acc[each].T)
    g = settings.site.gravity * min(1.0, max(abs(level), LIMITS.level_cosine))
    looks = [(float(np.ptp(angles)), LIMITS.zero_sigmas * (u + 2.0 * noise / g))]
    swing, walk = _swing(recording, rows)
    if len(swing):
        allowed = max(LIMITS.zero_sigmas * math.hypot(u, walk), LIMITS.zero_buffet)
        looks.append((float(swing.std()), allowed))
    return max(looks, key=lambda look: look[0] / look[1] if look[1] > 0.0 else math.inf)


def _swing(recording: Recording, rows: Indices) -> tuple[Array, float]:
    """The gyro's angle [rad] about its line over some rows, and the standard deviation of that by its noise; nothing
    where the gyro is silent."""
    gyro, t = recording.gyro[rows], recording.t[rows]
    seen = np.isfinite(gyro)
    if seen.sum() < LIMITS.zero_rows:
        return np.empty(0), 0.0
    gyro, dt = gyro[seen], np.diff(t[seen], prepend=t[seen][0])
    # a random walk tied at its ends has the mean variance n/6 of its steps
    noise = float(np.diff(gyro).std()) / math.sqrt(2.0)
    return np.cumsum((gyro - gyro.mean()) * dt), noise * math.sqrt(float(dt @ dt) / 6.0)


def _shaken(recording: Recording, settings: AoaSettings, rows: Indices) -> tuple[float, float]:
    """Rms of the buffet in some rows, and the standard uncertainty of their mean by it [rad]; 0 where the gyro reads
    little more than its stated noise."""
    swing, _ = _swing(recording, rows)
    gyro, t = recording.gyro[rows], recording.t[rows]
    if not len(swing) or not np.nanstd(gyro) > LIMITS.shaken_gyro * settings.noise.gyro:
        return 0.0, 0.0
    dt = np.diff(t)
    walk = settings.noise.gyro * math.sqrt(float(dt @ dt) / 6.0)
    return math.sqrt(max(float(swing.var()) - walk**2, 0.0)), mean_u(swing)


def _means(x: Array) -> Array:
    """Means of the columns over the numbers in them; NaN without any."""
    finite = np.isfinite(x)
    count = finite.sum(axis=0)
    total = np.where(finite, x, 0.0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)
