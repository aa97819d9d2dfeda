"""Calibration of an instrument from positions of a table: a record and settings in, an estimate out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from inercal.foundation.arrays import short_repr
from inercal.foundation.errors import StudyError
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate
from inercal.systems.turntable.display import displayed
from inercal.systems.turntable.positions.fit import Fitting, fit_readings
from inercal.systems.turntable.positions.outcome import assemble
from inercal.systems.turntable.readings import Readings, readings
from inercal.systems.turntable.settings import TurntableSettings


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
