"""A recording made ready: its triads, the initial static period, and the noise at rest."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array
from inercal.errors import RecordError, StudyError
from inercal.imu.limits import LIMITS
from inercal.instruments.triad import TriadModel
from inercal.noise.dwell_means import AllanFit
from inercal.noise.dwell_means import fit as fit_allan
from inercal.records.checks.values import saturated
from inercal.records.column import Triad
from inercal.records.dwells import Dwell, breaks, window_samples, windowed_variance
from inercal.records.record import Record


@dataclass(frozen=True)
class Recording:
    """The triads of a record, and their noise in its initial static period.

    ``restlessness`` holds, for each triad, the windowed variance over that of the initial static period, on
    the accelerometers' time axis; ``initial`` is that period, ``noise`` the Allan fit of each triad in it,
    ``resolution`` (3,) the step of those axes whose noise at rest is below half a step (0 for the others)
    [output].
    """

    accelerometer: Triad
    gyro: Triad | None
    initial: Dwell
    window: int
    cuts: NDArray[np.int64]
    restlessness: dict[str, Array]
    noise: dict[str, AllanFit]
    resolution: dict[str, Array]


def prepare(record: Record, static_start: float | None) -> Recording:
    """Look at the variance of a record, and at its noise at rest.

    Raises
    ------
    RecordError
        No accelerometer triad, hardly any samples, or no quiet start.
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
    if gyro is not None:
        own = windowed_variance(gyro.values, window_samples(gyro.rate))
        variances["gyro"] = own if gyro.t is t else on_other_clock(own, gyro.t, t)
    # a lost sample does no harm to the mean of a hold; half a window lost may hide a movement
    cuts = breaks(t, 0.5 * window / accelerometer.rate)
    initial = _initial(t, variances["acc"], window, cuts, static_start, where)
    noise, restlessness, resolution = {}, {}, {}
    for triad in (accelerometer, gyro):
        if triad is not None:
            rest = _at_rest(triad, t[initial.start], t[initial.stop - 1], static_start)
            size = float(np.linalg.norm(np.var(rest, axis=0, ddof=1)))
            restlessness[triad.sensor] = variances[triad.sensor] / max(size, 1e-300)
            noise[triad.sensor] = fit_allan(rest, 1.0 / triad.rate)
            resolution[triad.sensor] = coarse_steps(triad.values, rest)
    return Recording(accelerometer, gyro, initial, window, cuts, restlessness, noise, resolution)


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


def _at_rest(triad: Triad, begin: float, end: float, static_start: float | None) -> Array:
    """Finite samples of a triad in the initial static period; raises where nothing varies."""
    rest = triad.values[(triad.t >= begin) & (triad.t <= end)]
    rest = rest[np.isfinite(rest).all(axis=1)]
    if len(rest) < 16 or not np.any(np.var(rest, axis=0) > 0):
        length = "" if static_start is None else f" of {static_start:g} s"
        raise RecordError(
            triad.source.path,
            f"{triad.sensor} has no noise in the initial static period{length} ({len(rest)} samples), "
            "expected raw samples of an instrument at rest",
        )
    return rest


def coarse_steps(values: Array, rest: Array) -> Array:
    """The output's step on axes (3,) whose standard deviation at ``rest`` is below half of it, else 0."""
    steps = np.zeros(3)
    for i in range(3):
        moves = np.abs(np.diff(values[:, i]))
        least = np.min(moves, initial=np.inf, where=np.isfinite(moves) & (moves > 0))
        if np.std(rest[:, i]) < 0.5 * least < np.inf:
            steps[i] = least
    return steps


def _initial(
    t: Array,
    variance: Array,
    window: int,
    cuts: NDArray[np.int64],
    static_start: float | None,
    where: str,
) -> Dwell:
    """The initial static period: as stated and then checked, or up to the first movement."""
    finite = np.isfinite(variance)
    if np.count_nonzero(finite) < 2 * window:
        raise RecordError(
            where,
            f"found {len(t)} samples, expected a recording that starts with at least {LIMITS.initial_rest:g} s at rest",
        )
    first = int(np.argmax(finite))
    # the calmest twentieth of the record tells what rest looks like before anything else is known
    calm = float(np.quantile(variance[finite], 0.05))
    restless = np.flatnonzero(variance[first:] > LIMITS.moving_variance * max(calm, 1e-300)) + first
    moves = int(restless[0] - window // 2) if len(restless) else len(t)
    broken = int(next(iter(cuts[cuts > first]), len(t)))
    stop = max(min(moves, broken), 0)
    still = float(t[max(stop - 1, 0)] - t[0])
    event = "the instrument moves" if moves <= broken else "the time axis breaks"
    if static_start is None:
        if still < LIMITS.initial_rest:
            raise RecordError(
                where,
                f"{event} {still:.1f} s after the start, expected at least {LIMITS.initial_rest:g} s at rest",
            )
        return Dwell(0, stop)
    if t[-1] - t[0] < LIMITS.initial_rest:
        raise RecordError(
            where,
            f"lasts {t[-1] - t[0]:.1f} s, expected at least {LIMITS.initial_rest:g} s at rest and turns",
        )
    if not LIMITS.initial_rest <= static_start <= t[-1] - t[0]:
        raise StudyError(
            "imu.static_start",
            f"found {static_start:g} s, expected {LIMITS.initial_rest:g} s to the length of the record, "
            f"{t[-1] - t[0]:.1f} s",
        )
    end = int(np.argmax(t > t[0] + static_start)) or len(t)
    inside = variance[: max(end - window // 2, 0)]
    inside = inside[np.isfinite(inside)]
    if stop < end - window and (
        not len(inside) or np.max(inside) > LIMITS.moving_variance * np.median(inside)
    ):
        raise StudyError(
            "imu.static_start",
            f"found {static_start:g} s, expected a still period: {event} after {still:.1f} s",
        )
    return Dwell(0, end)


def clipped_rows(gyro: Triad) -> NDArray[np.bool_]:
    """Rows (n,) in which an axis saturates."""
    clipped = np.zeros(len(gyro.t), dtype=bool)
    for values in gyro.values.T:
        clipped[saturated(values)] = True
    return clipped


def unit_words(triad: Triad, model: TriadModel) -> str:
    """A wrong unit of physical outputs, in words, by scale factors far from nominal; empty if they are near."""
    if triad.unit.dimension in ("count", "voltage"):
        return ""
    nominal = 1.0 / triad.unit.factor
    ratio = float(np.median(model.scale) / nominal)
    if 0.5 < ratio < 2.0:
        return ""
    return (
        f"the scale factors of {triad.sensor} are {ratio:.3g} times those of outputs in {triad.unit.symbol}: check "
        f"the unit{' and the time stamps' if triad.sensor == 'gyro' else ''} in the map or header"
    )
