"""Recordings whose accelerometers and gyro run on two clocks."""

from __future__ import annotations

from collections.abc import Iterator, Mapping

import numpy as np

from inercal.foundation.findings import Finding
from inercal.foundation.inference.clocks import lag_drift
from inercal.foundation.records.record import Record
from inercal.systems.imu.rows import is_counted
from inercal.systems.imu.sections.calibration import SectionCalibration
from inercal.systems.imu.sections.cutting.cut import TriadSamples
from inercal.systems.imu.sections.cutting.log import on_clock
from inercal.systems.imu.sections.unknowns import D_F, K0, K1, S


def two_clocks(found: SectionCalibration, named: Mapping[str, Record]) -> Iterator[Finding]:
    """Findings about records, by the names of their files, in which moves tell that one triad falls behind the other.

    It harms what moves tell of the gyro.
    """
    if not any(extra.rotates for extra in found.problem.extras):
        return
    x = found.point.x
    for file, record in named.items():
        if is_counted(record) or not all(
            f"{one}_{axis}" in record for one in ("acc", "gyro") for axis in "xyz"
        ):
            continue
        acc, gyro = record.triad("acc"), record.triad("gyro")
        rate = on_clock(TriadSamples(gyro.t, gyro.values, np.zeros(len(gyro.t), dtype=bool)), acc.t)
        lag = lag_drift(acc.t, (acc.values - x[K0]) / x[K1], (rate - x[D_F]) / x[S])
        if lag is not None:
            way = "fall behind" if lag.drift > 0.0 else "run ahead of"
            by = 1.0 + lag.drift / lag.duration
            yield Finding(
                "contradiction",
                f"The accelerometers {way} the gyro by {abs(lag.drift):.3g} s over {lag.duration:.4g} s.",
                file,
                tuple(name for name in found.names if name.startswith(("S_", "T_"))),
                action=f"Multiply the times of the gyro by {by:.5f}, or record both on one clock.",
            )
