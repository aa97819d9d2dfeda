"""Recordings that the tests of this room share."""

from __future__ import annotations

import numpy as np

from inercal.examples import EXAMPLES, FOLDER
from inercal.faces.studies.load import load_imu_study
from inercal.foundation.inputs import Source
from inercal.foundation.records.column import Column
from inercal.foundation.records.maps import read_map
from inercal.foundation.records.read import read
from inercal.foundation.records.record import Record
from inercal.foundation.units import parse_unit
from inercal.systems.imu.settings import ImuSettings


def shipped(name: str, *overrides: str) -> tuple[Record, ImuSettings]:
    """A shipped recording and its study."""
    example = EXAMPLES[name]
    record_map = read_map(FOLDER / example.map) if example.map else None
    record = read([FOLDER / file for file in example.records], record_map)
    return record, load_imu_study(FOLDER / example.study, overrides)


def record_of(t, acc, gyro=None, acc_unit="count", gyro_unit="count", gyro_t=None) -> Record:
    """A record of arrays (n,), (n, 3), (n, 3)."""
    source = Source("made", "")
    t = np.ascontiguousarray(t, dtype=float)
    columns = {}
    for sensor, values, unit, time in (
        ("acc", acc, acc_unit, t),
        ("gyro", gyro, gyro_unit, t if gyro_t is None else gyro_t),
    ):
        if values is not None:
            for i, axis in enumerate("xyz"):
                name = f"{sensor}_{axis}"
                columns[name] = Column(name, parse_unit(unit), np.array(values[:, i]), time, source)
    return Record(columns, (), (source,))


def arrays(record: Record) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, accelerometer and gyro outputs."""
    acc, gyro = record.triad("acc"), record.triad("gyro")
    return acc.t, acc.values.copy(), gyro.values.copy()
