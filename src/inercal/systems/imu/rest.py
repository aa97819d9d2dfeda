"""Rest of a recording: the initial static period or, where the start was restless, the quietest stretches anywhere."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.findings import Finding
from inercal.foundation.records.dwells import Dwell, static_intervals
from inercal.foundation.records.places import counted
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
