"""The tasks of a turntable study: a calibration of a record, a simulated record."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.arrays import short_repr
from inercal.foundation.errors import StudyError
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate, timed
from inercal.systems.turntable.display import displayed
from inercal.systems.turntable.positions.fit import Fitting, fit_readings
from inercal.systems.turntable.positions.outcome import assemble
from inercal.systems.turntable.rate.calibration import RateCalibration, calibrate_rates
from inercal.systems.turntable.readings import Readings, readings
from inercal.systems.turntable.settings import TurntableSettings
from inercal.systems.turntable.simulate import simulate_positions, simulate_rate_test, simulate_step_test
from inercal.systems.turntable.step_test import StepCalibration, calibrate_steps


@short_repr
@dataclass(frozen=True, eq=False)
class PositionCalibration:
    """An ``estimate``, and the evidence behind it for pictures and tests."""

    estimate: Estimate
    readings: Readings
    fitting: Fitting

    @property
    def shown(self) -> Estimate:
        """The estimate in the units of the record, for people."""
        return displayed(self.estimate, self.readings.unit)


def calibrate_positions(
    record: Record, settings: TurntableSettings, progress: Callable[[str], None] = lambda _: None
) -> PositionCalibration:
    """Calibrate an instrument that was taken through positions on a table.

    Parameters
    ----------
    record : Record
        Angles of the table and outputs of the instrument: a row for each position, or samples.
    settings : TurntableSettings
        Site, table with its errors, instrument.
    progress : callable
        Takes the progress in words.

    Raises
    ------
    InputError
        The record has no angles or no outputs of the instrument, or the study does not fit it.
    """
    progress("averaging over the positions")
    means = readings(record, settings.chain.joints, settings.instrument.kind)
    settings = _with_unit(settings, means)
    progress("fitting")
    fitting = fit_readings(means, settings)
    return PositionCalibration(assemble(record, means, fitting, settings), means, fitting)


def _with_unit(settings: TurntableSettings, means: Readings) -> TurntableSettings:
    """The settings with the record's unit; refused where values were stated for another."""
    instrument = settings.instrument
    if instrument.unit.dimension != means.unit.dimension and (
        instrument.noise is not None or instrument.coefficients
    ):
        raise StudyError(
            "instrument.unit",
            f"noise or coefficients are stated for outputs in {instrument.unit.symbol}, and the record's are in "
            f"{means.unit.symbol}, expected the same kind of unit",
        )
    return replace(settings, instrument=replace(instrument, unit=means.unit))


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
