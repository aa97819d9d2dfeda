"""Calibration of an IMU against the angles of a table, or the attitude of a reference."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Finding, Status
from inercal.foundation.records.places import counted, counted_names
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate, timed
from inercal.foundation.units import RAW
from inercal.systems.imu.aided.agreement import expected, match
from inercal.systems.imu.aided.attitudes import AttitudeMotion, attitudes_of, mounted
from inercal.systems.imu.aided.blocks import Blocks, cut, triad_of
from inercal.systems.imu.aided.coefficients import (
    gain_names,
)
from inercal.systems.imu.aided.diagnosis.fit_quality import knocks
from inercal.systems.imu.aided.diagnosis.gross import cures, lag, tells
from inercal.systems.imu.aided.fit import AidedFit, fit
from inercal.systems.imu.aided.model import one_axis, side_of, unknowns
from inercal.systems.imu.aided.outcome import assemble, without_fit
from inercal.systems.imu.aided.table import TableMotion, motion_of, shifted, times, values_of
from inercal.systems.imu.aided.walk import whiten
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.settings import AidedSettings, ImuSettings


@short_repr
@dataclass(frozen=True, eq=False)
class AidedCalibration:
    """An ``estimate``, the table's ``motion`` and ``rests`` (k, 2) [s], and the ``fit`` if there is one."""

    estimate: Estimate
    motion: TableMotion
    rests: Array
    fit: AidedFit | None = None


def calibrate_aided(
    record: Record,
    settings: ImuSettings,
    options: AidedSettings,
    progress: Callable[[str], None] = lambda _: None,
) -> AidedCalibration:
    """Calibrate the accelerometers, and the gyro if the record has one, against the angles of a table.

    Parameters
    ----------
    record : Record
        ``acc_x..z`` and perhaps ``gyro_x..z``, in any unit, counts included, and the chain's joints ``phi1``,
        ``phi2`` (``phi3``), on the same or another clock.
    settings : ImuSettings
        Site and options.
    options : AidedSettings
        The table.
    progress : callable
        Takes the progress in words.

    Returns
    -------
    AidedCalibration
        Its estimate's status says whether the values can be used; nothing is raised for a poor fit.

    Raises
    ------
    RecordError
        The record has no accelerometers or no angles, or not of the same test.
    """
    _warm_up()
    clock = time.perf_counter()
    progress("comparing the sensors with the table's angles")
    if options.reference is None:
        motion = motion_of(record, options.chain)
    else:
        motion = attitudes_of(record, options.chain, options.reference)
    rests = motion.rests()
    triads = [triad for sensor in ("acc", "gyro") if (triad := triad_of(record, sensor)) is not None]
    if not triads:
        raise RecordError(motion.path, "found neither accelerometers nor gyros, expected one of the two")
    findings = list(_missing(record))
    # noise of an attitude is at the ends of a block
    least = LIMITS.block if options.reference is None else LIMITS.block_of_attitudes
    shortest = {"acc": LIMITS.block, "gyro": least}
    blocks = [cut(triad, motion, rests, shortest[triad.sensor]) for triad in triads]
    late = lag(blocks[-1], motion) if triads[-1].sensor == "gyro" else 0.0
    if late != 0.0:
        motion, rests = shifted(motion, -late), rests - late
        blocks = [cut(triad, motion, rests, shortest[triad.sensor]) for triad in triads]
    if isinstance(motion, AttitudeMotion):
        motion, sits = mounted(motion, blocks)
        findings += sits
    scales: dict[str, float] = {}
    wrong = []
    for each in blocks:
        sensor, x = each.triad.sensor, expected(each, motion)
        scales[sensor] = 1.0 / each.triad.unit.factor
        if tells(sensor, x[:, each.axes]):
            found = match(each, x)
            if found.miss > LIMITS.agreement_miss:
                wrong.append(f"{sensor} leaves {100.0 * found.miss:.0f} %")
            scales[sensor] = found.scale / (settings.site.gravity if sensor == "acc" else 1.0)
    bad = None
    if motion.travel < LIMITS.table_travel:
        what = "the table" if options.reference is None else "the reference"
        said_of_it = (
            f"{what} turns by {np.degrees(motion.travel):.2g} deg only: turn each axis of the instrument up and down "
            "(and check whether the angles are in deg or rad)"
        )
        bad = Status.UNOBSERVABLE, said_of_it
    elif wrong:
        bad = Status.INCONSISTENT, _contradiction(wrong, blocks, motion)
    if bad is not None:
        estimate = without_fit(record, settings, *bad, earlier=(*findings, *motion.findings))
        return AidedCalibration(timed(estimate, clock), motion, rests)
    progress("fitting all sensors")
    layout = unknowns(
        settings.site,
        options,
        scales,
        values_of(motion, rests),
        settings.g_sensitivity and "gyro" in scales,
        settings.k2 and "acc" in scales,
        frozenset(each.triad.sensor for each in blocks if each.triad.unit.dimension in RAW),
    )
    names = {
        each.triad.sensor: gain_names(each.triad.sensor, settings.g_sensitivity, settings.k2)
        for each in blocks
    }

    def fitted() -> AidedFit:
        sides = [side_of(each, motion, rests, layout) for each in blocks]
        return fit(sides, motion, layout, settings.site.gravity, names)

    done = fitted()
    if isinstance(motion, AttitudeMotion):  # the tilt is too large for first order
        for _ in range(2):
            places = [layout.places[name][0] for name in motion.chain.factors]
            tilt = done.x[places]
            motion = motion.tilted(tilt)
            mean = layout.mean.copy()
            mean[places] -= tilt
            layout = replace(layout, mean=mean)
            done = fitted()
    knocked = knocks(done)
    if any(wrong.any() for wrong in knocked.values()):
        findings += [
            _knocked(each, knocked[each.triad.sensor]) for each in blocks if knocked[each.triad.sensor].any()
        ]
        blocks = [each.only(~knocked[each.triad.sensor]) for each in blocks]
        done = fitted()
    estimate = assemble(record, motion, rests, done, late, settings, findings, one_axis(options.chain))
    return AidedCalibration(timed(estimate, clock), motion, rests, done)


def _missing(record: Record) -> Iterator[Finding]:
    """Channels of a triad that are not there."""
    there = {sensor: [axis for axis in "xyz" if f"{sensor}_{axis}" in record] for sensor in ("acc", "gyro")}
    if not there["gyro"]:
        yield Finding("gyro_missing", "the record has no gyro: only the accelerometers are calibrated")
    lost = [f"{sensor}_{axis}" for sensor, own in there.items() if own for axis in "xyz" if axis not in own]
    if lost:
        yield Finding(
            "axis_missing",
            f"The record has no {counted_names(lost)}: only the others are calibrated.",
            action="If it should have, name its column in a map.",
            harm=(),
        )


def _contradiction(wrong: list[str], blocks: list[Blocks], motion: TableMotion) -> str:
    """Outputs that do not follow the table, and what would make sense of them."""
    remedies = list(cures(blocks, motion))
    what = "check the order, signs and units of the angles and of the sensors' axes, and the mounting"
    if remedies:
        what = "all would fit if " + ", or if ".join(remedies)
    unexplained = f"{' and '.join(wrong)} of its variation unexplained"
    return f"the outputs do not follow {motion.words} ({unexplained}): {what}"


def _knocked(blocks: Blocks, wrong: NDArray[np.bool_]) -> Finding:
    """Blocks that were left out."""
    at = times(blocks.middle[wrong])
    return Finding(
        "outlier",
        f"{counted(int(wrong.sum()), 'block')} of {float(np.median(blocks.length)):.2g} s of {blocks.triad.sensor} far "
        f"from the fit, knocks or wrong readings, at t {at} s: left out",
        harm=(),
    )


def _warm_up() -> None:
    """Load or compile the kernels: no part of the computation."""
    t = np.arange(3.0)
    whiten(np.ones((3, 1)), t, np.ones(3), 1.0).information()
