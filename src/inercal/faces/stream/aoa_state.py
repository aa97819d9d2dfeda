"""State of a stream of angles of attack between two rows, and its sensors: a row of the record to measured values."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from inercal.faces.stream.lines import Lines, Sample
from inercal.faces.stream.shell import Rows
from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.records.column import Column
from inercal.systems.aoa.band import Band
from inercal.systems.aoa.fusion.live_band import LimitedState
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.from_record import at_range, check_axes, check_unit, indication, of_sensors
from inercal.systems.aoa.result.columns import beyond
from inercal.systems.aoa.settings import GYROS, AoaSettings, Heave, Resonance


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
        """Calibrations and columns, in the sense of `inercal.faces.stream.checkpoint`."""
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


class Leaning(NamedTuple):
    """The fusion under a change of a stated input: its state, and theta [rad] of rows not yet answered without it."""

    live: LimitedState
    theta: Array


class AoaState(NamedTuple):
    """State after a row.

    ``live`` is the state of the fusion, ``beside`` those under changes of gravity and roll, by name; ``t`` [s] the
    latest stamp, ``begun`` [s] the first one (NaN before); ``temperature`` [degC] the last known one; ``heard`` [s] the
    last row with a number of the gyro, ``beyond`` [s] the last one with an angle beyond the limits (NaN before).
    ``watch`` is that of `inercal.systems.aoa.fusion.watch`; of all ``rows`` that were answered ``unanswered`` have no
    angle. ``head`` (N + 6 columns) are the first rows, time first, until all is decided and the zero is over;
    ``choice`` is that (`choice_of`), empty before, ``zeroed``: the zero was put in.
    """

    live: LimitedState
    beside: Mapping[str, Leaning]
    t: float
    begun: float
    temperature: float
    heard: float
    beyond: float
    watch: Array
    unanswered: int
    rows: int
    head: Rows
    choice: Array
    zeroed: bool


def choice_of(settings: AoaSettings, final: bool) -> Array:
    """All that was decided, as numbers of a state: 1 where ``final``, 0 for the rate alone; rate, low pass, snap (0 for
    the usual one), delay and the priors of its rest and of the gyro's scale, flexure in both directions, rectified
    vibration, notches."""
    band, snap = settings.band, settings.estimator.snap or 0.0
    low = math.nan if band.low_pass is None else band.low_pass
    gyro = settings.timing.gyro_delay_about, settings.prior.gyro_delay, settings.prior.gyro_scale
    shaken = [
        float(each)
        for of in (settings.prior.heave, settings.prior.axial)
        for each in (of.frequency, of.damping, of.level, of.vertical)
    ]
    rectified = settings.prior.rectified
    return np.array([float(final), band.rate, low, snap, *gyro, *shaken, rectified, *band.notch])


def chosen(settings: AoaSettings, choice: Array) -> AoaSettings:
    """The study with what was decided."""
    _, rate, low, snap, about, rest, scale, *numbers = choice.tolist()
    frequency, damping, level, vertical = numbers[:4]
    heave = Heave(frequency, damping, level, "vertical" if vertical else "z")
    axial = Resonance(*numbers[4:7])
    rectified, *notch = numbers[8:]
    prior = replace(
        settings.prior, gyro_delay=rest, gyro_scale=scale, rectified=rectified, heave=heave, axial=axial
    )
    return replace(
        settings,
        band=Band(None if math.isnan(low) else low, tuple(notch), rate),
        estimator=replace(settings.estimator, snap=snap or None),
        timing=replace(settings.timing, gyro_delay_about=about),
        prior=prior,
    )
