"""Calibration of an IMU against a table's angles: a record and settings in, an estimate out.

The estimate of a calibration on a table: values, covariance, budget, tables, conditions.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.findings import Finding, Status, settled
from inercal.foundation.inference.plausible import implausible
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.records.column import Triad
from inercal.foundation.records.places import counted
from inercal.foundation.records.record import Record, recorded_temperature
from inercal.foundation.results.basis import Basis, Formula, conditions_of, studied
from inercal.foundation.results.budget import TypeB, combine
from inercal.foundation.results.result import Estimate, timed
from inercal.foundation.units import RAW
from inercal.systems.imu.aided.blocks import Blocks, cut
from inercal.systems.imu.aided.coefficients import (
    circumstances_of,
    coefficients,
    gain_names,
    names_of,
    of_triad,
    standard_uncertainty,
    type_a,
    type_b,
)
from inercal.systems.imu.aided.diagnosis.examination import misfits
from inercal.systems.imu.aided.diagnosis.fit_quality import knocks
from inercal.systems.imu.aided.diagnosis.gross import agreement, cures, expected, lag, tells, travel
from inercal.systems.imu.aided.fit import AidedFit, fit
from inercal.systems.imu.aided.judged import judged_table
from inercal.systems.imu.aided.model import side_of, unknowns
from inercal.systems.imu.aided.table import TableMotion, motion_of, shifted, times, values_of
from inercal.systems.imu.aided.verdict import findings, scatter, verdict
from inercal.systems.imu.aided.walk import whiten
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.settings import COMMAND, MASKED, AidedSettings, ImuSettings

MODEL = Formula(
    r"$y = S M x + b$, $S = \mathrm{diag}$(scale factor), $M = 1$ + misalignment ($M_{ij}$: response of sensor $i$ to "
    "the input along frame axis $j$), all of $M$; accelerometers: $K_1$, $M$, $K_0$, and $+ K_1 K_2 (M x)^2$ where "
    "$K_2$ is estimated; gyro: $S$, $T$, $D_F$, and $+ G f$ where g-sensitivity is estimated. The biases take random "
    "walks; $K_0$ and $D_F$ are their means over the test."
)

FRAME = "b, nominal axes of the instrument on the inner axis of the table"

REFERENCES = (
    "A. C. Harvey, Forecasting, structural time series models and the Kalman filter, Cambridge University Press (1989)",
    "S. J. Koopman, Disturbance smoother for state space models, Biometrika 80 (1993) 117",
    "H. D. Patterson, R. Thompson, Recovery of inter-block information when block sizes are unequal, Biometrika 58 "
    "(1971) 545",
    "T. S. Breusch, A. R. Pagan, The Lagrange multiplier test and its applications to model specification in "
    "econometrics, Review of Economic Studies 47 (1980) 239",
    "JCGM 100:2008, Guide to the expression of uncertainty in measurement",
)


def assemble(
    record: Record,
    motion: TableMotion,
    rests: Array,
    fit: AidedFit,
    lag: float,
    settings: ImuSettings,
    earlier: list[Finding],
) -> Estimate:
    """Put the estimate together."""
    triads = tuple(fit.identified)
    of_imu = names_of(triads, settings.g_sensitivity, settings.k2)
    names = (*of_imu, *circumstances_of(triads))
    values, rows, own = coefficients(fit, names, lag)
    sources_a = type_a(fit, rows, own, names)
    sources_b = type_b(fit, rows, names, values, settings.site, settings.time_base_u)
    faulty = misfits(fit, names, rows, motion, settings.site.gravity)
    tilt = scatter(fit, settings.site.gravity)
    if tilt > 0.0 and not faulty:
        crossed = np.array([name.startswith(("M_", "T_")) for name in names])
        sources_b.append(
            TypeB("shifts with each turn", tilt, "rad", np.eye(len(names))[:, crossed], redrawn=True)
        )
    plain = combine(names, [*sources_a, *sources_b])
    u = dict(zip(of_imu, plain.u.tolist(), strict=False))
    judged = verdict(fit, dict(zip(of_imu, values.tolist(), strict=False)), u, len(rests), faulty)
    sources_b += [
        TypeB(f"misfit ({each.finding.code})", 1.0, "1", each.shift, redrawn=True) for each in faulty
    ]
    symbols = {triad: of_triad(fit, triad)[0].side.blocks.triad.unit.symbol for triad in triads}
    units = [
        TERMS[name].unit_for(symbols["gyro" if name.startswith(("D_", "S_", "T_", "G_")) else "acc"])
        for name in names
    ]
    geometry = tuple(name for name in names if name.startswith(("r_", "tau_")))
    return Estimate.of(
        _basis(record, settings, _conditions(record, fit, settings)),
        names,
        units,
        values,
        combine(names, [*sources_a, *sources_b]),
        judged,
        findings=(
            *settled(record.findings, *MASKED),
            *earlier,
            *motion.findings,
            *findings(fit, lag, faulty, judged[0] is Status.OK, geometry),
            *_of_values(fit, names, values, plain.u, settings.site.gravity),
            *judged_table(fit, names, values, plain.u, rows, motion, settings.site.gravity, faulty),
        ),
        statistics=_statistics(fit, rests),
        result={
            "method": "aided",
            "rests": rest_table(fit, motion, rests),
            "time_shift_s": {triad: _with_u(fit, f"time shift of {triad}", lag) for triad in triads},
            "lever_arm_m": _with_u(fit, "lever arm"),
            "noise": {triad: _noise(fit, triad) for triad in triads},
            "unit": symbols,
        },
    )


def _of_values(
    fit: AidedFit, names: tuple[str, ...], values: Array, u: Array, gravity: float
) -> Iterator[Finding]:
    """Values that cannot be; of outputs in counts only what needs no unit."""
    about: dict[str, float] = {}
    for triad, letter in (("acc", "K1"), ("gyro", "S")):
        if triad in fit.identified:
            unit = of_triad(fit, triad)[0].side.blocks.triad.unit
            about |= {
                f"{letter}_{axis}": 0.0 if unit.dimension in RAW else 1.0 / unit.factor for axis in "xyz"
            }
    angles = [name for name in names if name.startswith(("M_", "T_"))]
    by_name = dict(zip(names, values.tolist(), strict=True))
    full = {f"K0_{axis}": gravity * by_name[f"K1_{axis}"] for axis in "xyz"}
    return implausible(names, values, u, about, angles, full)


def _basis(record: Record, settings: ImuSettings, conditions: Mapping[str, Any] | None = None) -> Basis:
    """The basis of the estimate."""
    method = settings.method
    tables = method.chain.sources if isinstance(method, AidedSettings) else ()
    return studied(COMMAND, settings, (*record.sources, *tables), MODEL, REFERENCES, conditions)


def without_fit(
    record: Record, settings: ImuSettings, status: Status, message: str, earlier: Sequence[Finding] = ()
) -> Estimate:
    """The estimate of a test that cannot be fitted: no parameters, but why."""
    return Estimate.without(
        _basis(record, settings),
        status,
        message,
        findings=(*settled(record.findings, *MASKED), *earlier),
        result={"method": "aided", "rests": []},
    )


def _statistics(fit: AidedFit, rests: Array) -> dict[str, float]:
    """Numbers about the fit."""
    statistics: dict[str, float] = {"rests": float(len(rests))}
    for triad, prefix in (("acc", ""), ("gyro", "gyro_")):
        if triad in fit.identified:
            sensors = of_triad(fit, triad)
            squares = [np.mean(sensor.residual**2) for sensor in sensors]
            statistics |= {
                f"{prefix}dof": float(3 * (len(sensors[0].residual) - 1) - len(fit.identified[triad].names)),
                f"{prefix}condition": fit.identified[triad].condition,
                f"{prefix}residual_rms": float(np.sqrt(np.mean(squares))),
            }
    return statistics


def _with_u(fit: AidedFit, group: str, offset: float = 0.0) -> dict[str, list[float]]:
    """A group of unknowns with its standard uncertainties."""
    values = fit.x[fit.unknowns.places[group]] + offset
    return {"value": values.tolist(), "u": standard_uncertainty(fit, group).tolist()}


def _noise(fit: AidedFit, triad: str) -> dict[str, list[float]]:
    """Levels of noise of the three sensors [output]."""
    levels = [sensor.noise for sensor in of_triad(fit, triad)]
    return {
        "white_at_rest": [level.resting for level in levels],
        "white_turning": [level.moving for level in levels],
        "walk": [level.walk for level in levels],
        "walk_turning": [level.walk_moving for level in levels],
    }


def rest_table(fit: AidedFit, motion: TableMotion, rests: Array) -> list[Mapping[str, Any]]:
    """One row for each rest: time, angles, and the mean residuals of the sensors."""
    rows: list[Mapping[str, Any]] = []
    for start, end in rests:
        row: dict[str, Any] = {"start_s": float(start), "end_s": float(end)}
        row["angles_rad"] = motion.at(np.array(0.5 * (start + end))).tolist()
        for triad in fit.identified:
            sensors = of_triad(fit, triad)
            blocks = sensors[0].side.blocks
            inside = (blocks.middle >= start) & (blocks.middle <= end)
            if inside.any():
                row[f"residual_{triad}"] = [float(np.mean(sensor.residual[inside])) for sensor in sensors]
        rows.append(row)
    return rows


def _conditions(record: Record, fit: AidedFit, settings: ImuSettings) -> dict[str, Any]:
    """Conditions and ranges over which the result is valid, as recorded."""
    g = settings.site.gravity
    blocks = of_triad(fit, "acc")[0].side.blocks
    ranges: dict[str, Any] = {
        "specific_force_along_an_axis_m_s2": [-g, g],
        "duration_s": float(blocks.nodes[-1, -1] - blocks.nodes[0, 0]),
        "rate_hz": blocks.triad.rate,
    }
    if "gyro" in fit.identified:
        rate = fit.references["gyro"].rate
        ranges["rate_about_an_axis_rad_s"] = [rate.min(axis=0).tolist(), rate.max(axis=0).tolist()]
    return conditions_of(settings, recorded_temperature(record), ranges, frame=FRAME)


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

    def fitted() -> AidedFit:
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


def _contradiction(wrong: list[str], blocks: list[Blocks], motion: TableMotion) -> str:
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
