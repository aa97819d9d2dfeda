"""Ferraris calibration of an IMU: a recording and settings in, an estimate out.

Gravity carried from position to position through the gyro: a check of the sense of the turns.

The turns themselves cannot tell in which sense they were made.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.geometry.rotations import angle_between
from inercal.foundation.records.column import Triad
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate, timed
from inercal.systems.imu.ferraris.gravity_transfer import is_recorded
from inercal.systems.imu.ferraris.method import Matrices, matrices
from inercal.systems.imu.ferraris.names import POSITIONS
from inercal.systems.imu.ferraris.outcome import assemble, without_sections
from inercal.systems.imu.ferraris.readings import SectionReadings, read_sections
from inercal.systems.imu.ferraris.scatter import Scatter, judge
from inercal.systems.imu.ferraris.sections import Sections, find_sections
from inercal.systems.imu.ferraris.uncertainty import propagation
from inercal.systems.imu.ferraris.verdict import (
    contradictions,
    scatter_findings,
    sense_finding,
    unused_labels,
    wrong_axes,
)
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.recording import clipped_rows
from inercal.systems.imu.settings import FerrarisSettings, ImuSettings
from inercal.systems.imu.turns import carried, cut_turns


def misses(acc: Triad, gyro: Triad, sections: Sections, solution: Matrices) -> tuple[float, float] | None:
    """Root-mean-square angle [rad] between carried and measured verticals after the ways between the positions.

    Returns
    -------
    (as stated, with all turns in the other sense), or None where the ways were not recorded.
    """
    order = sorted(POSITIONS, key=lambda name: int(sections.acc[name][0]))
    f = np.array(
        [solution.accelerometer.correct(acc.values[sections.acc[name]].mean(axis=0)) for name in order]
    )
    verticals = f / np.linalg.norm(f, axis=1, keepdims=True)
    spans, clipped = [], clipped_rows(gyro)
    for k, (here, there) in enumerate(itertools.pairwise(order)):
        start, stop = int(sections.gyro[here][-1]), int(sections.gyro[there][0])
        if is_recorded(gyro, clipped, start, stop):
            spans.append((k, start, stop))
    if len(spans) < LIMITS.fewest_transitions:
        return None
    turns = cut_turns(gyro.t, gyro.values, np.zeros_like(gyro.values), spans)
    model, none = solution.gyro, np.zeros((3, 3))
    as_stated, reversed_ = (
        carried(turns, verticals, each, none) for each in (model, replace(model, scale=-model.scale))
    )
    ends = verticals[turns.last]
    return _rms(angle_between(as_stated, ends)), _rms(angle_between(reversed_, ends))


def _rms(angles: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(angles**2)))


@short_repr
@dataclass(frozen=True)
class FerrarisCalibration:
    """An ``estimate`` and the evidence behind it: the triads, the sections found, and where all nine were there the
    readings, the matrices of the method and the scatter of the positions."""

    estimate: Estimate
    accelerometer: Triad
    gyro: Triad
    sections: Sections
    readings: SectionReadings | None = None
    solution: Matrices | None = None
    scatter: Scatter | None = None


def calibrate_ferraris(
    record: Record,
    settings: ImuSettings,
    options: FerrarisSettings,
    progress: Callable[[str], None] = lambda _: None,
) -> FerrarisCalibration:
    """Calibrate accelerometers and gyro from six positions and three turns.

    Parameters
    ----------
    record : Record
        ``acc_x..z`` and ``gyro_x..z`` in any unit, counts included; perhaps labels.
    settings : ImuSettings
        Site, clock and what goes with the result; of earth rate the vertical part is taken off where the latitude is
        given, else it is part of the uncertainty.
    options : FerrarisSettings
        The turns, alignment and sections.
    progress : callable
        Takes the progress in words.

    Returns
    -------
    FerrarisCalibration
        Its estimate holds the 33 coefficients of `inercal.systems.imu.ferraris.method.NAMES`, in the frame of the
        positions: its axis x is the mean of the upward direction in x_p and the downward one in x_a. Turns are positive
        about the positive axis by the right-hand rule. The status says whether the values can be used.

    Raises
    ------
    InputError
        No accelerometer or gyro triad, a sensor that never changes, or sections that do not fit the record.
    """
    import scipy.optimize  # (loading it is not part of the computation)
    import scipy.special  # noqa: F401

    clock = time.perf_counter()
    acc, gyro = _stamped(record.triad("acc")), _stamped(record.triad("gyro"))
    if record["acc_x"].t is record["gyro_x"].t:
        gyro = replace(gyro, t=acc.t)
    _check(acc)
    _check(gyro)
    if options.turn == 0.0:
        raise StudyError("imu.ferraris.turn", "found 0, expected an angle other than 0")
    progress("finding the sections")
    sections = find_sections(record, acc, gyro, options)
    if sections.missing:
        estimate = without_sections(record, acc, sections, settings)
        return FerrarisCalibration(timed(estimate, clock), acc, gyro, sections)
    readings = read_sections(acc, gyro, sections, settings.site, options)
    wrong = list(wrong_axes(readings.inputs, readings.weights))
    if wrong:
        estimate = without_sections(record, acc, sections, settings, wrong)
        return FerrarisCalibration(timed(estimate, clock), acc, gyro, sections)
    solution = matrices(readings.inputs, readings.weights)
    carried = misses(acc, gyro, sections, solution)
    turns = sections.turns
    against = list(contradictions((acc, gyro), solution, carried, options))
    if turns is not None:
        against += turns.against
    progress("carrying the uncertainties")
    scatter = judge(readings, solution, settings.site, options)
    findings = [
        *against,
        *(() if turns is None else turns.findings),
        *readings.findings,
        *unused_labels(sections),
        *([] if against else sense_finding(solution, carried, options)),
        *scatter_findings(scatter, options),
    ]
    errors = propagation(readings, solution, scatter)
    estimate = assemble(record, (acc, gyro), sections, errors, settings, options, against, findings)
    return FerrarisCalibration(timed(estimate, clock), acc, gyro, sections, readings, solution, scatter)


def _stamped(triad: Triad) -> Triad:
    """The triad with no values in rows without a time stamp, which get one between their neighbours."""
    stamped = np.isfinite(triad.t)
    if stamped.all() or not stamped.any():
        return triad
    rows = np.arange(len(stamped))
    t = np.interp(rows, rows[stamped], triad.t[stamped])
    return replace(triad, t=t, values=np.where(stamped[:, None], triad.values, np.nan))


def _check(triad: Triad) -> None:
    """Raise where a triad cannot be one of a recording."""
    where = triad.source.path
    if not triad.rate > 0.0:
        raise RecordError(
            where,
            f"found {len(triad.t)} samples of {triad.sensor} without increasing time stamps, expected a recording",
        )
    for axis, values in zip("xyz", triad.values.T, strict=True):
        finite = values[np.isfinite(values)]
        if not finite.size or np.ptp(finite) == 0.0:
            raise RecordError(where, f"{triad.sensor}_{axis} never changes, expected a live sensor")
