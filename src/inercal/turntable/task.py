"""The tasks of a turntable study: a calibration of a record, a simulated record, a design."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from inercal.errors import StudyError
from inercal.estimate.result import Estimate
from inercal.records.record import Record
from inercal.turntable.display import displayed
from inercal.turntable.positions.fit import Fitting, fit_readings
from inercal.turntable.positions.outcome import assemble
from inercal.turntable.positions.planning import design as design
from inercal.turntable.positions.simulate import simulate as simulate_positions
from inercal.turntable.rate.calibration import RateCalibration, calibrate_rates
from inercal.turntable.rate.simulate import simulate_rate_test
from inercal.turntable.readings import Readings, readings
from inercal.turntable.settings import TurntableSettings


@dataclass(frozen=True, eq=False)
class Calibration:
    """An ``estimate``, and the evidence behind it for pictures and tests."""

    estimate: Estimate
    readings: Readings
    fitting: Fitting

    @property
    def shown(self) -> Estimate:
        """The estimate in the units of the record, for people."""
        return displayed(self.estimate, self.readings.unit)


def calibrate(
    record: Record, settings: TurntableSettings, progress: Callable[[str], None] = lambda _: None
) -> Calibration | RateCalibration:
    """Calibrate an instrument that was taken through positions on a table, or gyros by a rate test.

    Parameters
    ----------
    record : Record
        Angles of the table and outputs of the instrument: a row for each position, or samples.
    settings : TurntableSettings
        Site, table with its errors, instrument; with a ``rate_test``, the record is one.
    progress : callable
        Told, in words, what is being done.

    Returns
    -------
    Calibration, or RateCalibration of a rate test
        Its estimate's status says whether the values can be used; nothing is raised for a poor fit.

    Raises
    ------
    InputError
        The record has no angles or no outputs of such an instrument, or the study does not fit it.
    """
    import scipy.special  # noqa: F401  (loading it is not part of the computation)

    clock = time.perf_counter()
    if settings.rate_test is not None:
        progress("fitting the rates")
        tested = calibrate_rates(record, settings)
        timing = {"solve": time.perf_counter() - clock}
        return replace(tested, estimate=replace(tested.estimate, timing=timing))
    progress("averaging over the positions")
    means = readings(record, settings.chain.joints, settings.instrument.kind)
    settings = _with_unit(settings, means)
    progress("fitting")
    fitting = fit_readings(means, settings)
    estimate = assemble(record, means, fitting, settings)
    timed = replace(estimate, timing={"solve": time.perf_counter() - clock})
    return Calibration(timed, means, fitting)


def simulate(settings: TurntableSettings, rng: np.random.Generator) -> Record:
    """A simulated record of the study: its rate test if it has one, else its positions."""
    made = simulate_positions if settings.rate_test is None else simulate_rate_test
    return made(settings, rng)


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
