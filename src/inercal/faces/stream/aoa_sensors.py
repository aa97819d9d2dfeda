"""Sensors of a model on a stream: a row of the record to measured values, and what is said of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from inercal.faces.stream.lines import Lines, Sample
from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.records.column import Column
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.from_record import at_range, check_axes, check_unit, indication, of_sensors
from inercal.systems.aoa.result.alarms import beyond
from inercal.systems.aoa.settings import GYROS, AoaSettings


class Sensors:
    """The sensors of the columns of a stream, calibrated as the study states.

    ``remarks`` are findings on them, ``has_gyro`` tells of the gyro for pitch, ``spatial`` of those for roll and yaw.
    Raises `RecordError` where columns are missing, or volts or counts have no scale.
    """

    def __init__(self, lines: Lines, settings: AoaSettings) -> None:
        record, names = lines.record, settings.layout.names
        there = [name for name in names if name in record]
        check_axes(there, record.columns, settings.layout, lines.where)
        gyros = [name for name in GYROS if name in record]
        self.has_gyro = GYROS[0] in gyros
        self.spatial = all(name in gyros for name in GYROS[1:])
        if not self.spatial:
            settings.attitude.check_pitch_shows()
        self.remarks = of_sensors(there, gyros, record, settings)
        places = list(record.columns)
        used = [*there, *(GYROS if self.spatial else GYROS[:1])]
        self._settings, self._sensors = settings, list[tuple[int, int, Column]]()
        for k, name in enumerate((*names, *GYROS)):
            if name in record and name in used:
                check_unit(record[name], settings.calibration(name), lines.where)
                self._sensors.append((k, places.index(name), record[name]))
        self._temperature = places.index("temperature") if "temperature" in record else -1

    @property
    def settings(self) -> dict[str, str]:
        """Calibrations and columns, in the sense of `inercal.foundation.computing.checkpoint`."""
        names = (*self._settings.layout.names, *GYROS)
        return {
            "sensors": repr([(name, self._settings.calibration(name)) for name in names]),
            "columns": repr([(k, place, column.name) for k, place, column in self._sensors]),
        }

    def temperature(self, sample: Sample, last: float) -> float:
        """The temperature [degC] at a row, or the ``last`` known one."""
        known = self._temperature >= 0 and math.isfinite(sample.values[self._temperature])
        return sample.values[self._temperature] if known else last

    def measured(self, sample: Sample, temperature: float) -> tuple[Array, list[tuple[int, str]]]:
        """Measured values of a row, (N + 3,) in SI, gyros last, NaN where missing or saturated; and place and text of
        each sensor at its range. ``temperature`` [degC] is NaN where it is not known."""
        values = np.full(len(self._settings.layout.names) + len(GYROS), np.nan)
        saturated = []
        for k, place, column in self._sensors:
            how = self._settings.calibration(column.name)
            indicated = indication(column, np.array(sample.values[place]))
            measured = how.measured(indicated, None if math.isnan(temperature) else temperature)
            if at_range(indicated, measured, how):
                saturated.append((k, f"{column.name}: at its range, such samples are left out"))
            else:
                values[k] = measured
        return values, saturated


def watched_limits(
    settings: AoaSettings, t: float, row: Sequence[float], last: float, say: Callable[[Finding], None]
) -> float:
    """The last time [s] at which an angle was beyond the limits of the study, after a ``row`` of
    `inercal.systems.aoa.result.columns` at ``t`` [s]; said where it is the first for a while."""
    if not settings.alarm.stated or row[-1] not in (-1.0, 1.0):
        return last
    if not t - last <= LIMITS.watched_time:
        say(beyond(settings, row, t))
    return t
