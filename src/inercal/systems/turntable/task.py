"""The tasks of a turntable study: a calibration of a record, a simulated record."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from inercal.foundation.records.record import Record
from inercal.foundation.results.result import timed
from inercal.systems.turntable.positions.calibration import PositionCalibration, calibrate_positions
from inercal.systems.turntable.rate.calibration import RateCalibration, calibrate_rates
from inercal.systems.turntable.settings import TurntableSettings
from inercal.systems.turntable.simulate import simulate_positions, simulate_rate_test, simulate_step_test
from inercal.systems.turntable.step_test import StepCalibration, calibrate_steps


def calibrate(
    record: Record, settings: TurntableSettings, progress: Callable[[str], None] = lambda _: None
) -> PositionCalibration | RateCalibration | StepCalibration:
    """Calibrate an instrument that was taken through positions on a table, through rates, or by small steps.

    Parameters
    ----------
    record : Record
        Angles of the table and outputs of the instrument: a row for each position, or samples.
    settings : TurntableSettings
        Site, table with its errors, instrument; with a ``rate_test`` or a ``step_test``, the record is one.
    progress : callable
        Takes the progress in words.

    Returns
    -------
    PositionCalibration, or RateCalibration of a rate test, StepCalibration of one by small steps
        Its estimate's status says whether the values can be used; nothing is raised for a poor fit.

    Raises
    ------
    InputError
        The record has no angles or no outputs of the instrument, or the study does not fit it.
    """
    import scipy.special  # noqa: F401  (loading it is not part of the computation)

    clock = time.perf_counter()
    if settings.rate_test is not None:
        progress("fitting the rates")
        tested = calibrate_rates(record, settings)
        return replace(tested, estimate=timed(tested.estimate, clock))
    if settings.step_test is not None:
        progress("fitting the steps")
        stepped = calibrate_steps(record, settings)
        return replace(stepped, estimate=timed(stepped.estimate, clock))
    calibration = calibrate_positions(record, settings, progress)
    return replace(calibration, estimate=timed(calibration.estimate, clock))


def simulate(settings: TurntableSettings, rng: np.random.Generator) -> Record:
    """A simulated record of the study: its rate test or test by small steps if it has one, else its positions."""
    if settings.step_test is not None:
        return simulate_step_test(settings, rng)
    made = simulate_positions if settings.rate_test is None else simulate_rate_test
    return made(settings, rng)
