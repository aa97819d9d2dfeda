"""The mean outputs of a gyro in each orientation, at each known rate: rows of means, or steady stretches of a
recording."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.records.column import Triad
from inercal.foundation.records.dwells import (
    Dwell,
    breaks,
    static_intervals,
    window_samples,
    windowed_variance,
)
from inercal.foundation.records.record import Record
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.rows import is_counted, rows_of


@dataclass(frozen=True)
class Orientations:
    """The orientations of all files.

    ``outputs`` (n, 3) mean outputs, ``file`` (n,) the file of each from 0, ``places`` (n,) where it is: a row, or
    times; ``numbers`` (n,) count them from 1 through all files, those that a study leaves out too; ``left_out``
    stretches at rest in files in which the table turned.
    """

    outputs: Array
    file: NDArray[np.int64]
    places: tuple[str, ...]
    numbers: NDArray[np.int64]
    left_out: int
    findings: tuple[Finding, ...]

    def only(self, kept: NDArray[np.bool_]) -> Orientations:
        """A part of the orientations, a mask (n,)."""
        places = tuple(place for place, each in zip(self.places, kept, strict=True) if each)
        return replace(
            self, outputs=self.outputs[kept], file=self.file[kept], places=places, numbers=self.numbers[kept]
        )


def orientations(records: Sequence[Record], rates: Array) -> Orientations:
    """Find the orientations in files at ``rates`` (k,) [rad/s], one for each of ``records``.

    A file without times has a row for each orientation; any other is a recording, in which the output is steady while
    the table turns. Stretches of it that are nearer to the output at rest than to that in the turn are rests.

    Raises
    ------
    RecordError
        No gyro triad, other units than in the first file, or a file without a steady stretch.
    """
    outputs, file, places, findings = [], [], [], []
    first = records[0].triad("gyro")
    for k, record in enumerate(records):
        triad = record.triad("gyro")
        if triad.unit != first.unit:
            raise RecordError(
                triad.source.path,
                f"gyro in {triad.unit.symbol}, expected {first.unit.symbol} as in {first.source.path}",
            )
        if is_counted(record):
            means, numbers, of_rows = rows_of(record, "gyro")
            where = [f"{triad.source.path}, row {number}" for number in numbers]
        else:
            means, where = _steady(triad)
            of_rows = record.findings
        outputs.append(means)
        file.append(np.full(len(means), k))
        places += where
        findings += list(of_rows)
    stacked, of_file = np.concatenate(outputs), np.concatenate(file)
    turning = _turning(stacked, of_file, rates, [is_counted(record) for record in records])
    return Orientations(
        stacked[turning],
        of_file[turning],
        tuple(place for place, kept in zip(places, turning, strict=True) if kept),
        np.arange(1, int(np.count_nonzero(turning)) + 1),
        int(np.count_nonzero(~turning)),
        tuple(findings),
    )


def _steady(triad: Triad) -> tuple[Array, list[str]]:
    """Mean outputs of the steady stretches of a recording, and their times; rows without a time end none."""
    stamped = np.isfinite(triad.t)
    triad = replace(triad, t=triad.t[stamped], values=triad.values[stamped])
    window = window_samples(triad.rate)
    variance = windowed_variance(triad.values, window)
    calm = float(np.quantile(variance[np.isfinite(variance)], LIMITS.calm_quantile, method="lower")) if np.any(
        np.isfinite(variance)
    ) else 0.0  # fmt: skip
    still = variance <= LIMITS.hold_variance * calm
    shortest = int(LIMITS.shortest_steady * triad.rate)
    dwells: tuple[Dwell, ...] = static_intervals(still, breaks(triad.t, 0.5 * window / triad.rate), shortest)
    if not dwells:
        raise RecordError(
            triad.source.path,
            f"found no steady stretch of {LIMITS.shortest_steady:g} s in the output of the gyro, expected the table to "
            "turn at one rate in each orientation",
        )
    times = [f"{triad.source.path}, t {triad.t[d.start]:.2f} to {triad.t[d.stop - 1]:.2f} s" for d in dwells]
    return np.array([dwell.of(triad.values).mean(axis=0) for dwell in dwells]), times


def _turning(
    outputs: Array, file: NDArray[np.int64], rates: Array, counted: Sequence[bool]
) -> NDArray[np.bool_]:
    """Rows (n,) in which the table turned at the rate of their file; of files at rest, all."""
    turned = np.ones(len(outputs), dtype=bool)
    at_rest = rates[file] == 0.0
    for k, rate in enumerate(rates):
        own = file == k
        if rate == 0.0 or counted[k]:
            continue
        spread = outputs[own]
        centre = (
            outputs[at_rest].mean(axis=0)
            if np.any(at_rest)
            else 0.5 * (spread.min(axis=0) + spread.max(axis=0))
        )
        size = np.linalg.norm(spread - centre, axis=1)
        turned[own] = size > 0.5 * np.max(size)
    return turned
