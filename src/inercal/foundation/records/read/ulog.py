"""ULog files of PX4: topics of messages, each with a clock of its own.

Source: PX4, "ULog File Format"; units as the definitions of the messages (PX4-Autopilot, msg/*.msg) state them.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterator
from contextlib import contextmanager, redirect_stdout
from functools import partial
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from inercal.foundation.errors import MissingExtraError
from inercal.foundation.findings import Finding
from inercal.foundation.records.read.arrays import ArrayFormat, Contents, NamedArray

#: topics -> fields and their units, as PX4 defines them; all stamps are in microseconds
_UNITS = (
    (r"sensor_combined", r"gyro_rad.*", "rad/s"),
    (r"sensor_combined", r"accelerometer_m_s2.*", "m/s^2"),
    (r"sensor_accel", r"[xyz]", "m/s^2"),
    (r"sensor_gyro", r"[xyz]", "rad/s"),
    (r"sensor_(?:accel|gyro)", r"temperature", "degC"),
    (r"vehicle_acceleration", r"xyz.*", "m/s^2"),
    (r"vehicle_angular_velocity", r"xyz\[.*", "rad/s"),
    (r"vehicle_imu", r"delta_angle\[.*", "rad"),
    (r"vehicle_imu", r"delta_velocity\[.*", "m/s"),
    (r".*", r"timestamp(?:_sample)?", "us"),
)


def _library(_: Path) -> Any:
    """The class of pyulog that reads a file; raises `MissingExtraError`."""
    try:
        from pyulog import ULog
    except ImportError as error:
        raise MissingExtraError("Reading ULog files", "files") from error
    return ULog


@contextmanager
def _opened(path: Path) -> Iterator[Contents]:
    """The fields as ``"sensor_accel/x"``, of a further instance as ``"sensor_accel[1]/x"``."""
    ULog = _library(path)
    with redirect_stdout(io.StringIO()):  # what it says of damage becomes a finding
        log = ULog(str(path))
    arrays: dict[str, NamedArray] = {}
    for data in log.data_list:
        topic = data.name if data.multi_id == 0 else f"{data.name}[{data.multi_id}]"
        for field, values in data.data.items():
            if values.dtype.kind not in "fiub" or values.ndim != 1:
                continue
            clock = None if field == "timestamp" else f"{topic}/timestamp"
            arrays[f"{topic}/{field}"] = NamedArray(
                len(values), 1, partial(_column, values), False, _unit(data.name, field), clock
            )
    findings = []
    if log.file_corruption:
        findings.append(Finding("bad_row", "parts of the file are damaged, and were passed over"))
    if log.dropouts:
        lost = sum(dropout.duration for dropout in log.dropouts)
        findings.append(
            Finding("gap", f"the logger lost data {len(log.dropouts)} times, for {lost / 1000:.3g} s in all")
        )
    yield Contents(arrays, tuple(findings))


def _unit(topic: str, field: str) -> str | None:
    """The unit of a field, where PX4 defines it."""
    return next(
        (unit for name, title, unit in _UNITS if re.fullmatch(name, topic) and re.fullmatch(title, field)),
        None,
    )


def _column(values: NDArray[Any], _: int) -> NDArray[Any]:
    """The one column of an array."""
    return values


_FORMAT = ArrayFormat("a ULog file", _opened, _library)
read, header, peek = _FORMAT.read, _FORMAT.header, _FORMAT.peek
