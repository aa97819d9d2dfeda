"""The estimate of a Ferraris calibration: covariance, budget, tables, conditions."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding, Status, settled
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.records.column import Triad
from inercal.foundation.records.record import Record, recorded_temperature
from inercal.foundation.results.basis import Basis, Formula, conditions_of, studied
from inercal.foundation.results.budget import combine
from inercal.foundation.results.result import Estimate
from inercal.systems.imu.ferraris.method import NAMES, coefficients
from inercal.systems.imu.ferraris.names import NAMES as SECTIONS
from inercal.systems.imu.ferraris.names import POSITIONS, TURNS, in_words
from inercal.systems.imu.ferraris.sections import Sections
from inercal.systems.imu.ferraris.uncertainty import (
    Propagation,
    doubtful_turns,
    mean_noise,
    noise_covariance,
    second_order,
    type_a,
    type_b,
)
from inercal.systems.imu.ferraris.verdict import too_few, verdict
from inercal.systems.imu.second_order import k2_finding, k2_size
from inercal.systems.imu.settings import COMMAND, MASKED, FerrarisSettings, ImuSettings

MODEL = Formula(
    r"$y = S M f + b$, $S = \mathrm{diag}(K_1)$, $M = 1$ + misalignment (full; $M_{ij}$: response of accelerometer $i$ "
    r"to specific force along $j$), $b = K_0$; gyro: $y = S T \omega + D_F + G f$ ($T_{ij}$: response of gyro $i$ to "
    "rate about $j$). Frame: its axis x the mean of the upward direction in $x_p$ and the downward one in $x_a$, y and "
    "z likewise; turns positive about the positive axis by the right-hand rule."
)

FRAME = "b, of the instrument: its axes the upward directions in the six positions, opposite ones averaged"

REFERENCES = (
    "F. Ferraris, U. Grimaldi, M. Parvis, Procedure for effortless in-field calibration of three-axial rate gyro and "
    "accelerometers, Sensors and Materials 7 (1995) 311-330",
    "JCGM 100:2008, Guide to the expression of uncertainty in measurement",
    "W. J. Riley, D. A. Howe, Handbook of frequency stability analysis, NIST SP 1065 (2008)",
)


def assemble(
    record: Record,
    triads: tuple[Triad, Triad],
    sections: Sections,
    errors: Propagation,
    settings: ImuSettings,
    options: FerrarisSettings,
    against: list[Finding],
    findings: list[Finding],
) -> Estimate:
    """Put the estimate together; ``against`` are the findings that contradict it."""
    readings, scatter = errors.readings, errors.scatter
    acc_unit, gyro_unit = (triad.unit.symbol for triad in triads)
    values = np.asarray(coefficients(readings.inputs, readings.weights), dtype=float)
    from_data = type_a(errors, acc_unit, gyro_unit)
    from_outside = type_b(errors, settings.site, settings.time_base_u, options, acc_unit, gyro_unit)
    if sections.turns is not None:
        from_outside += doubtful_turns(errors, sections.turns.doubt)
    size = k2_size(settings, mean_noise(errors))
    uncertainty = combine(NAMES, [*from_data, *from_outside, *second_order(errors, size)])
    residual = np.sum([source.covariance for source in from_data], axis=0)
    gain = np.abs(np.diag(errors.solution.force_gain))
    left = scatter.left["acc"] / gain
    return Estimate.of(
        _basis(record, settings, _conditions(record, triads, errors, settings, options)),
        NAMES,
        [_unit(name, acc_unit, gyro_unit) for name in NAMES],
        values,
        uncertainty,
        verdict(readings, scatter, against, options),
        findings=(
            *settled(record.findings, *MASKED),
            *findings,
            *k2_finding(NAMES, uncertainty, settings, size),
        ),
        statistics={
            "dof": float(scatter.fits["acc"].dof),
            "condition": scatter.fits["acc"].identifiability.condition,
            "residual_rms": float(np.sqrt(np.sum(left**2) / scatter.fits["acc"].dof)),
            "position_scatter_rad": scatter.tilt,
            "scatter_over_expected": scatter.over_expected["acc"],
            "gyro_scatter_over_expected": scatter.over_expected["gyro"],
            "intervals": float(len(POSITIONS)),
            "turns": float(len(TURNS)),
        },
        result={
            "method": "ferraris",
            "found_by": sections.found_by,
            "sections": _section_table(triads[0], sections),
            "positions": _position_table(left),
            "least_squares": _least_squares_table(values, uncertainty.u, errors),
            "u_residual": dict(zip(NAMES, np.sqrt(np.diag(residual)).tolist(), strict=True)),
            "u_noise": dict(zip(NAMES, np.sqrt(np.diag(noise_covariance(errors))).tolist(), strict=True)),
            "unit": {"acc": acc_unit, "gyro": gyro_unit},
        },
    )


def _basis(record: Record, settings: ImuSettings, conditions: Mapping[str, Any] | None = None) -> Basis:
    """The basis of the estimate."""
    return studied(COMMAND, settings, record.sources, MODEL, REFERENCES, conditions)


def _unit(name: str, acc_unit: str, gyro_unit: str) -> str:
    """Unit of a coefficient, from that of the output of its sensor."""
    return TERMS[name].unit_for(acc_unit if name.startswith(("K", "M")) else gyro_unit)


def _conditions(
    record: Record,
    triads: tuple[Triad, Triad],
    errors: Propagation,
    settings: ImuSettings,
    options: FerrarisSettings,
) -> dict[str, Any]:
    """Conditions and ranges over which the result is valid, as recorded."""
    acc, gyro = triads
    g = settings.site.gravity
    finite = gyro.values[np.isfinite(gyro.values).all(axis=1)]
    t = acc.t[np.isfinite(acc.t)]
    return conditions_of(
        settings,
        recorded_temperature(record),
        {
            "specific_force_along_an_axis_m_s2": [-g, g],
            "duration_s": float(t[-1] - t[0]),
            "rate_hz": acc.rate,
            "gyro_output": [finite.min(axis=0), finite.max(axis=0)],
            "rate_of_turn_rad_s": float(np.max(np.abs(options.turn / errors.readings.inputs.durations))),
        },
        frame=FRAME,
        turn_deg=math.degrees(options.turn),
    )


def _section_table(acc: Triad, sections: Sections) -> list[Mapping[str, Any]]:
    """One row for each section found."""
    return [
        {
            "section": name,
            "holds": in_words(name),
            "start_s": float(acc.t[rows[0]]),
            "end_s": float(acc.t[rows[-1]]),
            "samples": len(rows),
        }
        for name, rows in ((name, sections.acc[name]) for name in SECTIONS if name in sections.acc)
    ]


def _position_table(left: Array) -> list[Mapping[str, Any]]:
    """Residuals of the two positions of each axis on the other two [m/s^2]."""
    return [
        {"positions": f"{axis}_p, {axis}_a"}
        | {f"on_{i}_m_s2": float(value) for i, value in zip("xyz", row, strict=True)}
        for axis, row in zip("xyz", left, strict=True)
    ]


def _least_squares_table(values: Array, u: Array, errors: Propagation) -> list[Mapping[str, Any]]:
    """The biases of Ferraris' method beside those of all eighteen equations by generalised least squares.

    The gains and g-sensitivities hang on the differences of the positions, which are the same in both.
    """
    rows: list[Mapping[str, Any]] = []
    for sensor, symbol in (("acc", "K0"), ("gyro", "D_F")):
        for i, axis in enumerate("xyz"):
            k = NAMES.index(f"{symbol}_{axis}")
            other = float(errors.scatter.fits[sensor].beta[i])
            rows.append(
                {
                    "coefficient": NAMES[k],
                    "ferraris": float(values[k]),
                    "least_squares": other,
                    "difference_over_u": float((other - values[k]) / u[k]) if u[k] > 0.0 else 0.0,
                }
            )
    return rows


def without_sections(
    record: Record, acc: Triad, sections: Sections, settings: ImuSettings, wrong: Sequence[Finding] = ()
) -> Estimate:
    """The estimate of a recording that lacks a section, or whose sections are not what they are said to be (``wrong``):
    no parameters, but which it is, and what to do."""
    return Estimate.without(
        _basis(record, settings),
        Status.INCONSISTENT if wrong else Status.TOO_FEW_INTERVALS,
        wrong[0].message if wrong else too_few(sections),
        findings=(*settled(record.findings, *MASKED), *wrong),
        statistics={
            "intervals": float(sum(name in sections.acc for name in POSITIONS)),
            "turns": float(sum(name in sections.acc for name in TURNS)),
        },
        result={
            "method": "ferraris",
            "found_by": sections.found_by,
            "sections": _section_table(acc, sections),
        },
    )
