"""A recording made ready: its triads, and the noise at rest."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.instruments.triad import TriadModel
from inercal.foundation.noise.dwell_means import AllanFit, fit_pooled
from inercal.foundation.records.checks.values import at_ends
from inercal.foundation.records.column import Triad
from inercal.foundation.records.dwells import Dwell, breaks, window_samples, windowed_variance
from inercal.foundation.records.record import Record
from inercal.foundation.units import RAW
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.rest import rest_of


@dataclass(frozen=True)
class Recording:
    """The triads of a record, and their noise at rest.

    ``rest`` is where that noise was taken: the initial static period or, where the start was restless, the quietest
    stretches of the recording. ``restlessness`` holds, for each triad, the windowed variance over that at rest, on
    the accelerometers' time axis; ``noise`` the Allan fit of each triad at rest, ``resolution`` (3,) the step of those
    axes whose noise at rest is below half a step (0 for the others) [output].
    """

    accelerometer: Triad
    gyro: Triad | None
    rest: tuple[Dwell, ...]
    window: int
    cuts: NDArray[np.int64]
    restlessness: dict[str, Array]
    noise: dict[str, AllanFit]
    resolution: dict[str, Array]
    findings: tuple[Finding, ...] = ()


def prepare(record: Record, static_start: float | None) -> Recording:
    """Look at the variance of a record, and at its noise at rest.

    Raises
    ------
    RecordError
        No accelerometer triad, hardly any samples, or no rest.
    StudyError
        ``static_start`` [s] does not fit the record, or the instrument moves in it.
    """
    accelerometer = record.triad("acc")
    gyro = record.triad("gyro") if any(f"gyro_{axis}" in record for axis in "xyz") else None
    accelerometer, gyro = _whole(accelerometer, gyro)
    t, where = accelerometer.t, accelerometer.source.path
    for triad in (accelerometer, gyro):
        if triad is not None:
            _plausible(triad)
    window = window_samples(accelerometer.rate)
    variances = {"acc": windowed_variance(accelerometer.values, window)}
    floors = {"acc": _least_variance(accelerometer)}
    if gyro is not None:
        own = windowed_variance(gyro.values, window_samples(gyro.rate))
        variances["gyro"] = own if gyro.t is t else on_other_clock(own, gyro.t, t)
        floors["gyro"] = _least_variance(gyro)
    # a lost sample does no harm to the mean of a hold; half a window lost may hide a movement
    cuts = breaks(t, 0.5 * window / accelerometer.rate)
    rest, findings = rest_of(t, variances, floors, window, cuts, static_start, where)
    noise, restlessness, resolution = {}, {}, {}
    for triad in (accelerometer, gyro):
        if triad is not None:
            stretches = _at_rest(triad, t, rest)
            dof = [len(each) - 1 for each in stretches]
            variance = np.average([np.var(each, axis=0, ddof=1) for each in stretches], axis=0, weights=dof)
            size = max(float(np.linalg.norm(variance)), floors[triad.sensor])
            restlessness[triad.sensor] = variances[triad.sensor] / size
            noise[triad.sensor] = fit_pooled(stretches, 1.0 / triad.rate)
            resolution[triad.sensor] = coarse_steps(triad.values, np.sqrt(variance))
    return Recording(accelerometer, gyro, rest, window, cuts, restlessness, noise, resolution, findings)


def _least_variance(triad: Triad) -> float:
    """Windowed variance below which nothing is told of rest: of rounding to the output's steps, and of arithmetic."""
    steps = coarse_steps(triad.values, np.zeros(3))
    return float(np.linalg.norm(np.maximum(steps**2 / 12.0, (1e-7 * np.ptp(triad.values, axis=0)) ** 2)))


def _plausible(triad: Triad) -> None:
    """Raise where a triad has no time axis, or values that no sensor gives."""
    if not np.isfinite(triad.rate):
        raise RecordError(
            triad.source.path,
            f"found {len(triad.t)} samples of {triad.sensor} without increasing time stamps, expected a recording",
        )
    for axis, values in zip("xyz", triad.values.T, strict=True):
        finite = values[np.isfinite(values)]
        if finite.size and np.ptp(finite) == 0.0:
            raise RecordError(
                triad.source.path,
                f"{triad.sensor}_{axis} never changes ({finite[0]:g}), expected a live sensor",
            )
    size = float(np.max(np.abs(triad.values), initial=0.0, where=np.isfinite(triad.values)))
    if size > 0.0 and not 1e-100 < size < 1e100:
        raise RecordError(
            triad.source.path, f"{triad.sensor} has values up to {size:.3g}, expected the output of a sensor"
        )


def _whole(accelerometer: Triad, gyro: Triad | None) -> tuple[Triad, Triad | None]:
    """The triads without rows that lack a stamp or a value (the gap then shows); one clock stays one."""
    if gyro is None:
        return _kept(accelerometer, _complete(accelerometer)), None
    if gyro.t is not accelerometer.t:
        return _kept(accelerometer, _complete(accelerometer)), _kept(gyro, _complete(gyro))
    both = _complete(accelerometer) & _complete(gyro)
    accelerometer = _kept(accelerometer, both)
    return accelerometer, replace(_kept(gyro, both), t=accelerometer.t)


def _complete(triad: Triad) -> NDArray[np.bool_]:
    """Rows (n,) with a stamp and three values."""
    return np.asarray(np.isfinite(triad.t) & np.isfinite(triad.values).all(axis=1))


def _kept(triad: Triad, rows: NDArray[np.bool_]) -> Triad:
    """A triad with these rows alone; the triad itself if these are all."""
    return triad if rows.all() else replace(triad, t=triad.t[rows], values=triad.values[rows])


def on_other_clock(values: Array, t: Array, other: Array) -> Array:
    """Values at the nearest sample of another time axis; infinite outside."""
    nearest = np.clip(np.searchsorted(t, other), 0, len(t) - 1)
    out = values[nearest]
    out[(other < t[0]) | (other > t[-1])] = np.inf
    return out


def _at_rest(triad: Triad, t: Array, rest: tuple[Dwell, ...]) -> list[Array]:
    """Samples of a triad in the stretches at rest, which are on the time axis ``t``; raises where there are none."""
    stretches = [triad.values[(triad.t >= t[d.start]) & (triad.t <= t[d.stop - 1])] for d in rest]
    stretches = [each for each in stretches if len(each) >= LIMITS.fewest_at_rest]
    if not stretches:
        raise RecordError(
            triad.source.path,
            f"{triad.sensor} has no samples where the instrument is at rest, expected raw samples",
        )
    return stretches


def coarse_steps(values: Array, deviation: Array) -> Array:
    """The output's step on axes (3,) whose standard ``deviation`` (3,) at rest is below half of it, else 0."""
    steps = np.zeros(3)
    for i in range(3):
        moves = np.abs(np.diff(values[:, i]))
        least = np.min(moves, initial=np.inf, where=np.isfinite(moves) & (moves > 0))
        if deviation[i] < 0.5 * least < np.inf:
            steps[i] = least
    return steps


def clipped_rows(gyro: Triad) -> NDArray[np.bool_]:
    """Rows (n,) in which an axis saturates."""
    return np.asarray(np.any([at_ends(values) for values in gyro.values.T], axis=0))


def unit_words(triad: Triad, model: TriadModel) -> str:
    """A wrong unit of physical outputs, in words, by scale factors far from nominal; empty if they are near."""
    if triad.unit.dimension in RAW:
        return ""
    nominal = 1.0 / triad.unit.factor
    ratio = float(np.median(model.scale) / nominal)
    if 0.5 < ratio < 2.0:
        return ""
    return (
        f"the scale factors of {triad.sensor} are {ratio:.3g} times those of outputs in {triad.unit.symbol}: check "
        f"the unit{' and the time stamps' if triad.sensor == 'gyro' else ''} in the map or header"
    )
