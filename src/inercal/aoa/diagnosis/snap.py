"""Snap by the data: how lively the model's motion is, from the innovations under several densities.

Under too small a snap a buffet is taken for errors of positions and scale; under too large a one noise is taken for
motion, and these errors are learned from it. The smallest density is taken under which innovations are nearly as small
as those of a still model with the study's noise; so calm recordings keep the usual one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from inercal.aoa.diagnosis.noise_check import misstated
from inercal.aoa.fusion.loop import OUTPUTS
from inercal.aoa.fusion.problem import FilterProblem, problem
from inercal.aoa.fusion.run import advance, initial
from inercal.aoa.limits import LIMITS
from inercal.aoa.paper.delay import Delay, relative_delay
from inercal.aoa.reading.clock import later
from inercal.aoa.reading.recording import Recording
from inercal.aoa.settings import AoaSettings
from inercal.arrays import Array

DENSITIES = (1e9, 1e10, 1e11, 1e12)
"""Densities [rad^2/s^7] beyond the usual one."""


def with_snap(recording: Recording, settings: AoaSettings) -> AoaSettings:
    """The study with the snap that the recording shows; as it is where it states one, or where none fits.

    Looked at are the liveliest stretches of `Limits.snap_time`; a noise larger than stated does not count as motion.
    """
    usual = settings.estimator.density
    if settings.estimator.snap is not None:
        return settings
    stretches = list(_liveliest(recording))
    if not stretches:
        return settings
    _, fair = misstated(_part(recording, stretches[0]), settings)
    limit = LIMITS.snap_ratio * _still(recording, fair)
    delay = None
    for density in (usual, *DENSITIES):
        of = problem(fair if density == usual else _lively(fair, density, delay), recording.spatial)
        if all(_nis(of, recording.t[rows], recording.rows[rows]) < limit for rows in stretches):
            return settings if density == usual else _lively(settings, density, delay)
        if density == usual and settings.timing.gyro_delay is None:
            delay = relative_delay(recording, settings.layout)
    return settings


def _lively(settings: AoaSettings, density: float, delay: Delay | None) -> AoaSettings:
    """A study that states a snap, and no wider a prior of the gyro's delay than the spectra show.

    Where the acceleration is free the filter may find a far delay that its series does not hold for.
    """
    prior = settings.prior
    if delay is not None:
        shown = max(abs(delay.value), LIMITS.delay_sigmas * delay.u)
        prior = replace(prior, gyro_delay=min(prior.gyro_delay, shown))
    return replace(settings, prior=prior, estimator=replace(settings.estimator, snap=density))


def _liveliest(recording: Recording) -> Iterator[NDArray[np.int64]]:
    """Rows of the stretches in which readings differ most from one row to the next, the liveliest first."""
    taken = later(recording.t)
    number = np.floor((recording.t[taken] - recording.t[taken[:1]]) / LIMITS.snap_time)
    stretches = [
        rows for rows in np.split(taken, np.flatnonzero(np.diff(number)) + 1) if _enough(recording, rows)
    ]
    sizes = [_restless(recording, rows) for rows in stretches]
    for k in np.argsort(sizes)[::-1][: LIMITS.snap_stretches]:
        yield stretches[k]


def _enough(recording: Recording, rows: NDArray[np.int64]) -> bool:
    """True for a stretch that goes on for twice the time in which a filter settles."""
    return bool(len(rows)) and bool(np.ptp(recording.t[rows]) > 2.0 * LIMITS.settling_time)


def _restless(recording: Recording, rows: NDArray[np.int64]) -> float:
    """Root mean square of the second differences of all readings of a stretch, without single wild ones."""
    second = np.abs(np.diff(np.column_stack([recording.acc[rows], recording.gyro[rows]]), 2, axis=0))
    finite = second[np.isfinite(second)]
    return float(np.sqrt(np.mean(np.minimum(finite, np.quantile(finite, 0.99)) ** 2))) if finite.size else 0.0


def _part(recording: Recording, rows: NDArray[np.int64]) -> Recording:
    """A stretch of a recording."""
    columns = {name: getattr(recording, name)[rows] for name in ("t", "acc", "gyro", "turns", "zero_angle")}
    return replace(recording, **columns, point=None, trigger=None, reference=None, masked=None)


def _nis(of: FilterProblem, t: Array, rows: Array) -> float:
    """Mean squared innovation after the filter has settled, each as far as the gate lets it through."""
    _, trace = advance(initial(of), of, t, rows, last=True)
    innovations = trace.out[t[: len(trace.out)] - t[0] >= LIMITS.settling_time, OUTPUTS:]
    finite = innovations[np.isfinite(innovations)]
    lost = np.isnan(trace.out[-1:, 0]).any() or len(trace.starts) > 1
    return np.inf if lost or not finite.size else float(np.minimum(finite**2, of.constants.gate).mean())


def _still(recording: Recording, settings: AoaSettings) -> float:
    """The same of a still model with the study's noise, sampled as the recording was by the sensors that it has."""
    step = float(np.median(np.diff(recording.t[later(recording.t)])))
    t = step * np.arange(round(2.0 * LIMITS.settling_time / step), dtype=float)
    layout, rng = settings.layout, np.random.default_rng(0)
    up = settings.site.gravity * settings.attitude.level
    acc = np.tile(-up * np.sin(layout.angle), (len(t), 1))
    acc += settings.noise.accelerometer * rng.standard_normal(acc.shape)
    gyro, *turns = settings.noise.gyro * rng.standard_normal((3, len(t)))
    acc[:, ~np.isfinite(recording.acc).any(axis=0)] = np.nan
    if not np.isfinite(recording.gyro).any():
        gyro[:] = np.nan
    none = np.full((len(t), 2), np.nan)
    still = Recording(t, acc, gyro, np.column_stack(turns) if recording.spatial else none, none)
    return _nis(problem(settings, recording.spatial), t, still.rows)
