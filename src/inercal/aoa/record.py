"""A recording of a wind-tunnel model as a record, in the units in which its sensors are recorded."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from inercal.aoa.recording import Recording
from inercal.aoa.settings import GYROS, AoaSettings
from inercal.records.record import Column, Record, Source
from inercal.units import parse_unit

Array = NDArray[np.float64]


def to_record(recording: Recording, settings: AoaSettings) -> Record:
    """A record as a file holds it, which read with the same study means the same.

    ``t``; ``a1``.. [g], ``gyro`` [deg/s], and ``gyro_roll``, ``gyro_yaw`` [deg/s] where the recording has them: or
    volts or counts of sensors that the study calibrates from these. ``point`` and ``trigger`` where they are known,
    ``theta_ref`` [deg] where there is a reference; ``temperature`` [degC], that of the study, where a sensor depends
    on it.
    """
    source = Source("simulated", "")
    made = {}
    for name, sensor, axis, symbol, values in _columns(recording, settings):
        unit = parse_unit(symbol)
        made[name] = Column(name, sensor, axis, unit, values / unit.factor, recording.t, source)
    return Record(made, (), (source,))


def _columns(recording: Recording, settings: AoaSettings) -> Iterator[tuple[str, str, str, str, Array]]:
    """Name, sensor, axis, unit and values [SI] of each column."""
    values = np.column_stack([recording.acc, recording.gyro, recording.turns])
    temperature = None if settings.temperature is None else settings.temperature.value
    thermal = False
    for k, name in enumerate((*settings.layout.names, *GYROS)):
        if name in GYROS and not np.isfinite(values[:, k]).any():
            continue
        of = settings.calibration(name)
        thermal = thermal or of.scale_slope != 0.0 or of.bias_slope != 0.0
        symbol = of.per if of.per != "1" else "deg/s" if name in GYROS else "g"
        sensor, _, axis = name.partition("_")
        yield name, sensor, axis, symbol, of.indicated(values[:, k], temperature)
    if thermal and temperature is not None:
        yield "temperature", "temperature", "", "degC", np.full(len(values), temperature)
    if recording.point is not None:
        yield "point", "point", "", "1", recording.point
    if recording.trigger is not None:
        yield "trigger", "trigger", "", "1", recording.trigger
    if recording.reference is not None:
        yield "theta_ref", "theta_ref", "", "deg", recording.reference
