"""The estimate of a calibration against a table or another reference: values, covariance, budget, conditions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding, Status, settled
from inercal.foundation.inference.plausible import implausible
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.records.places import counted_names
from inercal.foundation.records.record import Record, recorded_temperature
from inercal.foundation.results.basis import Basis, Formula, conditions_of, studied
from inercal.foundation.results.budget import TypeB, combine
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import RAW
from inercal.systems.imu.aided.attitudes import AttitudeMotion
from inercal.systems.imu.aided.coefficients import (
    circumstances_of,
    coefficients,
    names_of,
    of_triad,
    standard_uncertainty,
    told,
    type_a,
    type_b,
)
from inercal.systems.imu.aided.diagnosis.examination import misfits
from inercal.systems.imu.aided.fit import AidedFit
from inercal.systems.imu.aided.judged import judged_table
from inercal.systems.imu.aided.table import TableMotion
from inercal.systems.imu.aided.verdict import findings, scatter, verdict
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
    by_one_axis: bool = False,
) -> Estimate:
    """Put the estimate together; of a table of one axis, ``by_one_axis``, only of values that it tells."""
    triads = tuple(fit.identified)
    names = (*names_of(fit, settings.g_sensitivity, settings.k2), *circumstances_of(fit))
    values, rows, own = coefficients(fit, names, lag)
    if by_one_axis:
        known = told(fit, rows, own)
        earlier = [
            *earlier,
            *_at_prior([name for name, is_told in zip(names, known, strict=True) if not is_told]),
        ]
        names = tuple(name for name, is_told in zip(names, known, strict=True) if is_told)
        values, rows, own = values[known], rows[known], own[known]
    of_imu = tuple(name for name in names if not name.startswith(("r_", "tau_")))
    sources_a = type_a(fit, rows, own, names)
    sources_b = type_b(fit, rows, names, values, settings.site, settings.time_base_u)
    noisy = _noisier(fit, motion)
    faulty = [] if noisy else misfits(fit, names, rows, motion, settings.site.gravity)
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
        TERMS[name].unit_for(symbols.get("gyro" if name.startswith(("D_", "S_", "T_", "G_")) else "acc", ""))
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
            *(
                noisy
                or judged_table(fit, names, values, plain.u, rows, motion, settings.site.gravity, faulty)
            ),
        ),
        statistics=_statistics(fit, rests),
        result={
            "method": "aided",
            "rests": rest_table(fit, motion, rests),
            "time_shift_s": {triad: _with_u(fit, f"time shift of {triad}", lag) for triad in triads},
            "lever_arm_m": _with_u(fit, "lever arm") if "acc" in triads else {},
            **({"mounting": motion.mounting.tolist()} if isinstance(motion, AttitudeMotion) else {}),
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
    full = {f"K0_{axis}": gravity * by_name[f"K1_{axis}"] for axis in "xyz" if f"K1_{axis}" in by_name}
    return implausible(names, values, u, about, angles, full)


def _noisier(fit: AidedFit, motion: TableMotion) -> list[Finding]:
    """A finding where a reference is noisier than the gyro, whose residuals then say nothing of the gyro."""
    if not isinstance(motion, AttitudeMotion) or "gyro" not in fit.identified:
        return []
    sensors = of_triad(fit, "gyro")
    length = float(np.median(sensors[0].side.blocks.length))
    gain = min(abs(fit.x[fit.unknowns.places["gain gyro"]].reshape(3, 3)[s.axis, s.axis]) for s in sensors)
    of_gyro = min(sensor.noise.resting for sensor in sensors) / gain / np.sqrt(length)
    if np.sqrt(2.0) * motion.noise / length <= LIMITS.noise_of_reference * of_gyro:
        return []
    return [
        Finding(
            "blind",
            f"The reference is noisier than the gyro ({np.degrees(motion.noise):.2g} deg): faults of the outputs are "
            "not looked for.",
            action="Take a less noisy reference, or turn for longer between rests.",
            harm=(),
        )
    ]


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
                f"{prefix}dof": float(
                    len(sensors) * (len(sensors[0].residual) - 1) - len(fit.identified[triad].names)
                ),
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
        row |= motion.place(0.5 * (start + end))
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
    blocks = fit.sensors[0].side.blocks
    ranges: dict[str, Any] = {
        "specific_force_along_an_axis_m_s2": [-g, g],
        "duration_s": float(blocks.nodes[-1, -1] - blocks.nodes[0, 0]),
        "rate_hz": blocks.triad.rate,
    }
    if "gyro" in fit.identified:
        rate = fit.references["gyro"].rate
        ranges["rate_about_an_axis_rad_s"] = [rate.min(axis=0).tolist(), rate.max(axis=0).tolist()]
    return conditions_of(settings, recorded_temperature(record), ranges, frame=FRAME)


def _at_prior(names: Sequence[str]) -> Iterator[Finding]:
    """Values of which turns about one axis say nothing."""
    coefficients = [name for name in names if not name.startswith(("r_", "tau_"))]
    if coefficients:
        yield Finding(
            "by_prior",
            f"One axis tells next to nothing of {counted_names(coefficients)}: they are left out.",
            action="Set the instrument up with another of its axes along that of the table, and calibrate that too.",
            harm=(),
        )
