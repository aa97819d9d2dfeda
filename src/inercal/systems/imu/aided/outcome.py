"""The estimate of a calibration on a table: values, covariance, budget, tables, conditions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding, Status, settled
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.records.record import Record, recorded_temperature
from inercal.foundation.results.basis import Basis, conditions_of, studied
from inercal.foundation.results.budget import TypeB, combine
from inercal.foundation.results.formula import Formula
from inercal.foundation.results.result import Estimate
from inercal.systems.imu.aided.coefficients import (
    circumstances_of,
    coefficients,
    names_of,
    of_triad,
    standard_uncertainty,
    type_a,
    type_b,
)
from inercal.systems.imu.aided.diagnosis.examination import misfits
from inercal.systems.imu.aided.fit import Fit
from inercal.systems.imu.aided.table import Motion
from inercal.systems.imu.aided.verdict import findings, scatter, verdict
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
    motion: Motion,
    rests: Array,
    fit: Fit,
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


def _statistics(fit: Fit, rests: Array) -> dict[str, float]:
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


def _with_u(fit: Fit, group: str, offset: float = 0.0) -> dict[str, list[float]]:
    """A group of unknowns with its standard uncertainties."""
    values = fit.x[fit.unknowns.places[group]] + offset
    return {"value": values.tolist(), "u": standard_uncertainty(fit, group).tolist()}


def _noise(fit: Fit, triad: str) -> dict[str, list[float]]:
    """Levels of noise of the three sensors [output]."""
    levels = [sensor.noise for sensor in of_triad(fit, triad)]
    return {
        "white_at_rest": [level.resting for level in levels],
        "white_turning": [level.moving for level in levels],
        "walk": [level.walk for level in levels],
        "walk_turning": [level.walk_moving for level in levels],
    }


def rest_table(fit: Fit, motion: Motion, rests: Array) -> list[Mapping[str, Any]]:
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


def _conditions(record: Record, fit: Fit, settings: ImuSettings) -> dict[str, Any]:
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
