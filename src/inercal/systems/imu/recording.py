"""A recording made ready: its triads, and the noise at rest.

Rest of a recording: the initial static period or, where the start was restless, the quietest stretches anywhere.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.findings import Finding
from inercal.foundation.instruments.triad import TriadModel
from inercal.foundation.noise.dwell_means import AllanFit, fit_pooled
from inercal.foundation.records.checks.values import at_ends
from inercal.foundation.records.column import Triad
from inercal.foundation.records.dwells import (
    Dwell,
    breaks,
    static_intervals,
    window_samples,
    windowed_variance,
)
from inercal.foundation.records.places import counted
from inercal.foundation.records.record import Record
from inercal.foundation.units import RAW
from inercal.systems.imu.limits import LIMITS


def rest_of(
    t: Array,
    variances: Mapping[str, Array],
    floors: Mapping[str, float],
    window: int,
    cuts: NDArray[np.int64],
    static_start: float | None,
    where: str,
) -> tuple[tuple[Dwell, ...], tuple[Finding, ...]]:
    """The rests of a recording that tell its noise, and a finding where that is not the start.

    Parameters
    ----------
    t : (n,)
        Time [s] of the accelerometers.
    variances, floors : mapping
        Of each triad the windowed variance (n,), and the one below which nothing is told of rest.
    window : int
        Samples in that window.
    cuts : (k,)
        Samples before which the time axis breaks.
    static_start : float or None
        Length [s] of the initial static period, where stated.
    where : str
        The file.

    Raises
    ------
    RecordError
        Hardly any samples, or no rest.
    StudyError
        ``static_start`` does not fit the record, or the instrument moves in it.
    """
    if np.count_nonzero(np.isfinite(variances["acc"])) < 2 * window:
        raise RecordError(
            where,
            f"found {len(t)} samples, expected a recording with rests of {LIMITS.initial_rest:g} s and turns",
        )
    calm = {
        sensor: max(float(np.quantile(_finite(variance), 0.05)), floors[sensor])
        for sensor, variance in variances.items()
        if np.isfinite(variance).any()
    }
    initial = _initial(t, variances["acc"], calm["acc"], window, cuts, static_start)
    still = np.all([variances[sensor] < LIMITS.calm_variance * size for sensor, size in calm.items()], axis=0)
    stretches = static_intervals(still, cuts, max(window, LIMITS.fewest_at_rest))
    if initial is not None:
        elsewhere = tuple(each for each in stretches if each.start >= initial.stop)
        if not elsewhere or not _restless(initial, elsewhere, variances, floors):
            return (initial,), ()
        stretches, why = elsewhere, "is more restless at the start than in later rests"
    else:
        why = f"is not at rest for {LIMITS.initial_rest:g} s at the start"
    if not stretches:
        raise RecordError(
            where,
            f"the instrument is nowhere at rest for {window * (t[-1] - t[0]) / max(len(t) - 1, 1):.1f} s, expected "
            f"rests and turns, and best {LIMITS.initial_rest:g} s at rest first",
        )
    total = sum(float(t[each.stop - 1] - t[each.start]) for each in stretches)
    words = (
        f"the instrument {why}: its noise is taken from {counted(len(stretches), 'quiet piece')} "
        f"elsewhere, {total:.1f} s in all"
    )
    return stretches, (Finding("restless_start", words),)


def _finite(values: Array) -> Array:
    """The numbers among values (n,)."""
    return np.asarray(values[np.isfinite(values)])


def _restless(
    initial: Dwell, elsewhere: tuple[Dwell, ...], variances: Mapping[str, Array], floors: Mapping[str, float]
) -> bool:
    """True where a triad is more restless in the initial period than in the quiet stretches elsewhere."""
    for sensor, variance in variances.items():
        usual = _finite(np.concatenate([each.of(variance) for each in elsewhere]))
        start = _finite(initial.of(variance))
        if len(usual) and len(start):
            size = max(float(np.median(usual)), floors[sensor])
            if float(np.median(start)) > LIMITS.restless_variance * size:
                return True
    return False


def _initial(
    t: Array,
    variance: Array,
    calm: float,
    window: int,
    cuts: NDArray[np.int64],
    static_start: float | None,
) -> Dwell | None:
    """The initial static period: as stated and then checked, or up to the first movement; None if that comes soon."""
    first = int(np.argmax(np.isfinite(variance)))
    restless = np.flatnonzero(variance[first:] > LIMITS.moving_variance * calm) + first
    moves = int(restless[0] - window // 2) if len(restless) else len(t)
    broken = int(next(iter(cuts[cuts > first]), len(t)))
    stop = max(min(moves, broken), 0)
    still = float(t[max(stop - 1, 0)] - t[0])
    if static_start is None:
        return Dwell(0, stop) if still >= LIMITS.initial_rest else None
    if not LIMITS.initial_rest <= static_start <= t[-1] - t[0]:
        raise StudyError(
            "imu.static_start",
            f"found {static_start:g} s, expected {LIMITS.initial_rest:g} s to the length of the record, "
            f"{t[-1] - t[0]:.1f} s",
        )
    end = int(np.argmax(t > t[0] + static_start)) or len(t)
    inside = _finite(variance[: max(end - window // 2, 0)])
    if stop < end - window and (
        not len(inside) or np.max(inside) > LIMITS.moving_variance * max(np.median(inside), calm)
    ):
        event = "the instrument moves" if moves <= broken else "the time axis breaks"
        raise StudyError(
            "imu.static_start",
            f"found {static_start:g} s, expected a still period: {event} after {still:.1f} s",
        )
    return Dwell(0, end)


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
