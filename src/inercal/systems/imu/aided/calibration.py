"""Calibration of an IMU against a table's angles: a record and settings in, an estimate out."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.findings import Finding, Status
from inercal.foundation.records.column import Triad
from inercal.foundation.records.places import counted
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate, timed
from inercal.systems.imu.aided.blocks import Blocks, cut
from inercal.systems.imu.aided.coefficients import gain_names
from inercal.systems.imu.aided.diagnosis.fit_quality import knocks
from inercal.systems.imu.aided.diagnosis.gross import agreement, cures, expected, lag, tells, travel
from inercal.systems.imu.aided.fit import Fit, fit
from inercal.systems.imu.aided.model import side_of, unknowns
from inercal.systems.imu.aided.outcome import assemble, without_fit
from inercal.systems.imu.aided.table import Motion, motion_of, shifted, times, values_of
from inercal.systems.imu.aided.walk import whiten
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.settings import AidedSettings, ImuSettings


@short_repr
@dataclass(frozen=True, eq=False)
class AidedCalibration:
    """An ``estimate``, the table's ``motion`` and ``rests`` (k, 2) [s], and the ``fit`` if there is one."""

    estimate: Estimate
    motion: Motion
    rests: Array
    fit: Fit | None = None


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
    motion = motion_of(record, options.chain)
    rests = motion.rests()
    triads = [_centred(record, "acc")]
    findings = []
    if any(f"gyro_{axis}" in record for axis in "xyz"):
        triads.append(_centred(record, "gyro"))
    else:
        findings.append(
            Finding("gyro_missing", "the record has no gyro: only the accelerometers are calibrated")
        )
    blocks = [cut(triad, motion, rests) for triad in triads]
    late = lag(blocks[1], motion) if len(blocks) > 1 else 0.0
    if late != 0.0:
        motion, rests = shifted(motion, -late), rests - late
        blocks = [cut(triad, motion, rests) for triad in triads]
    scales: dict[str, float] = {}
    wrong = []
    for each in blocks:
        sensor, x = each.triad.sensor, expected(each, motion)
        scales[sensor] = 1.0 / each.triad.unit.factor
        if tells(sensor, x):
            match = agreement(each.y, x)
            if match.miss > LIMITS.agreement_miss:
                wrong.append(f"{sensor} leaves {100.0 * match.miss:.0f} %")
            scales[sensor] = match.scale / (settings.site.gravity if sensor == "acc" else 1.0)
    bad = None
    if travel(motion) < LIMITS.table_travel:
        said_of_it = (
            f"the table turns by {np.degrees(travel(motion)):.2g} deg only: turn each axis of the instrument up and "
            "down (and check whether the angles are in deg or rad)"
        )
        bad = Status.UNOBSERVABLE, said_of_it
    elif wrong:
        bad = Status.INCONSISTENT, _contradiction(wrong, blocks, motion)
    if bad is not None:
        estimate = without_fit(record, settings, *bad, earlier=(*findings, *motion.findings))
        return AidedCalibration(timed(estimate, clock), motion, rests)
    progress("fitting all sensors")
    layout = unknowns(
        settings.site, options, scales, values_of(motion, rests), settings.g_sensitivity, settings.k2
    )
    names = {
        each.triad.sensor: gain_names(each.triad.sensor, settings.g_sensitivity, settings.k2)
        for each in blocks
    }

    def fitted() -> Fit:
        sides = [side_of(each, motion, rests, layout) for each in blocks]
        return fit(sides, motion, layout, settings.site.gravity, names)

    done = fitted()
    knocked = knocks(done)
    if any(wrong.any() for wrong in knocked.values()):
        findings += [
            _knocked(each, knocked[each.triad.sensor]) for each in blocks if knocked[each.triad.sensor].any()
        ]
        blocks = [each.only(~knocked[each.triad.sensor]) for each in blocks]
        done = fitted()
    estimate = assemble(record, motion, rests, done, late, settings, findings)
    return AidedCalibration(timed(estimate, clock), motion, rests, done)


def _centred(record: Record, sensor: str) -> Triad:
    """A triad at the middles of its samples: what was gained since the row before is the rate half a sample earlier."""
    triad = record.triad(sensor)
    half = 0.5 / triad.rate if record[f"{sensor}_x"].increment and np.isfinite(triad.rate) else 0.0
    return replace(triad, t=triad.t - half) if half else triad


def _contradiction(wrong: list[str], blocks: list[Blocks], motion: Motion) -> str:
    """Outputs that do not follow the table, and what would make sense of them."""
    remedies = list(cures(blocks, motion))
    what = "check the order, signs and units of the angles and of the sensors' axes, and the mounting"
    if remedies:
        what = "all would fit if " + ", or if ".join(remedies)
    unexplained = f"{' and '.join(wrong)} of its variation unexplained"
    return f"the outputs do not follow the table's angles ({unexplained}): {what}"


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
