"""A calibration of a record by a study of a strapdown unit."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.arrays import short_repr
from inercal.foundation.records.dwells import Dwell
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate, timed
from inercal.systems.strapdown.fit.batch import Fit, fit
from inercal.systems.strapdown.fit.error_state import filtered
from inercal.systems.strapdown.fit.restricted import with_noise_shown
from inercal.systems.strapdown.fit.rests import found_rests, mean_force, nodes_of
from inercal.systems.strapdown.limits import LIMITS
from inercal.systems.strapdown.model.samples import Samples
from inercal.systems.strapdown.reading import evened, samples_of
from inercal.systems.strapdown.result.outcome import assemble, failed, too_few, useless
from inercal.systems.strapdown.settings import StrapdownSettings


@short_repr
@dataclass(frozen=True, eq=False)
class StrapdownCalibration:
    """An ``estimate``, and the evidence behind it: samples, rests, and the fit, None where there is none."""

    estimate: Estimate
    samples: Samples
    rests: tuple[Dwell, ...]
    fit: Fit | None


def load_kernels(settings: StrapdownSettings) -> None:
    """Load, or compile, all kernels that `calibrate` uses, so that they do not count in its time."""
    still = np.tile([0.0, 0.0, settings.site.gravity], (60, 1))
    samples = Samples(np.zeros((60, 3)), still, 0.1)
    nodes = nodes_of(samples, (Dwell(0, 20), Dwell(40, 60)), 1.0)
    fit(samples, nodes, settings)
    if settings.filter == "error-state":
        filtered(samples, nodes, settings)


def calibrate(
    record: Record, settings: StrapdownSettings, progress: Callable[[str], None] = lambda _: None
) -> StrapdownCalibration:
    """Calibrate a strapdown unit from a recording of rests and turns.

    ``record`` has ``gyro_x..z`` and ``acc_x..z`` in physical units; ``progress`` is told each step of the work. The
    status of the estimate says whether its values can be used: nothing is raised for a poor one.

    Raises
    ------
    RecordError
        The record does not hold what is needed.
    StudyError
        The rests that the study lists do not fit it.
    """
    clock = time.perf_counter()
    record = evened(record)
    samples = samples_of(record)
    if record.rate_u and not settings.time_base_u:
        settings = replace(settings, time_base_u=record.rate_u)
    rests = found_rests(samples, settings.rests)
    if len(rests) < LIMITS.fewest_rests:
        estimate = too_few(record, samples, rests, settings)
        return StrapdownCalibration(timed(estimate, clock), samples, rests, None)
    progress("fitting")
    force = mean_force(samples, rests)
    plausible = abs(force / settings.site.gravity - 1.0) < LIMITS.off_gravity
    nodes = nodes_of(samples, rests, settings.rests.node)
    fitted = fit(samples, nodes, settings) if plausible else None
    if fitted is None:
        estimate = useless(record, samples, rests, settings, force)
        return StrapdownCalibration(timed(estimate, clock), samples, rests, None)
    progress("estimating noise")
    settings, fitted, still = with_noise_shown(samples, nodes, settings, fitted)
    by_filter = None
    if settings.filter == "error-state":
        progress("filtering")
        by_filter = filtered(samples, nodes, settings)
        if by_filter is None:
            estimate = failed(record, samples, rests, settings)
            return StrapdownCalibration(timed(estimate, clock), samples, rests, fitted)
    progress("assembling")
    estimate = assemble(
        record, samples, rests, fitted, settings, None if still is fitted else still, by_filter
    )
    return StrapdownCalibration(timed(estimate, clock), samples, rests, fitted)
