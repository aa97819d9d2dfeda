"""Coefficients against temperature, from calibrations made at several temperatures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding, Status
from inercal.foundation.inputs import Source
from inercal.foundation.results.result import Estimate, coverage_factor
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.temperature.judged import judged_points
from inercal.systems.imu.temperature.model import REFERENCE, Curve, TemperatureModel, assemble, no_span
from inercal.systems.imu.temperature.polynomial import (
    HIGHEST_ORDER,
    TemperaturePolynomial,
    counted_in,
    fit_points,
)


def fit_calibrations(
    estimates: Sequence[Estimate],
    files: Sequence[Source],
    reference: float = REFERENCE,
    order: int | None = None,
) -> TemperatureModel:
    """Fit every coefficient of calibrations against the temperatures in their conditions.

    A cubic needs five temperatures; with fewer the polynomial is of the degree that leaves one of them over, and u is
    that of a fit with the next power, and by what this would move the coefficients counts as one more. Where
    temperature rose to some and fell to others (in the order given), the difference is a coefficient too, if
    degrees of freedom are left for it.

    Parameters
    ----------
    estimates : sequence of Estimate
        Results of one kind of calibration of one instrument, in the order of time.
    files : sequence of Source
        The files they are from, as many.
    reference : float
        T0 [degC].
    order : int, optional
        Highest power of temperature, 1 to 5, in place of the cubic.

    Raises
    ------
    InputError
        No such order, or fewer temperatures than it needs; too few calibrations, a status other than ok and suspect, a
        calibration without a temperature or a standard uncertainty, or one with other coefficients.
    """
    if len(estimates) < LIMITS.fewest_calibrations:
        raise InputError(
            files[0].path,
            f"found {len(estimates)}, expected at least {LIMITS.fewest_calibrations} calibrations",
        )
    for number, file in enumerate(files):
        if file.sha256 and file.sha256 in (other.sha256 for other in files[:number]):
            raise InputError(file.path, "holds the same as a file before it, expected each calibration once")
    first = estimates[0]
    for estimate, file in zip(estimates, files, strict=True):
        if not estimate.status.done:
            raise InputError(file.path, f"found the status {estimate.status.value}, expected ok")
        if (estimate.names, estimate.units) != (first.names, first.units):
            raise InputError(
                file.path, f"found other coefficients or units than in {files[0].path}, expected the same"
            )
        unsure = [n for n, u in zip(estimate.names, estimate.u, strict=True) if not 0.0 < u < np.inf]
        if unsure:
            raise InputError(
                file.path,
                f"{unsure[0]}: states no standard uncertainty above zero, expected that of the value",
            )
    T = np.array([_temperature(estimate, file) for estimate, file in zip(estimates, files, strict=True)])
    if np.ptp(T) < LIMITS.temperature_span:
        return TemperatureModel(no_span(float(T.min()), float(T.max()), files, ()))
    distinct = len(np.unique(np.round(T / 0.5)))
    if order is not None and not 1 <= order <= min(HIGHEST_ORDER, distinct - 2):
        raise InputError(
            "order",
            f"found {order}, expected 1 to {min(HIGHEST_ORDER, distinct - 2)} for {distinct} temperatures",
        )
    terms = min(4, distinct - 1) if order is None else order + 1
    step = np.diff(T)
    rising = 0.5 * np.sign(np.concatenate([step[:1], step]))
    both = bool(min(np.sum(rising > 0), np.sum(rising < 0)) >= 2 and len(T) > terms + 2)
    nothing = np.empty((len(T), 0))
    curves, judged = [], list[Finding]()
    for k, name in enumerate(first.names):
        y = np.array([estimate.values[k] for estimate in estimates])
        # what comes from elsewhere moves all alike: it belongs to the values, not to their change
        common = np.array([0.0 if e.common is None else e.common[k, k] for e in estimates])
        variances = np.array([e.covariance[k, k] for e in estimates])
        own = np.maximum(variances - common, 1e-12 * variances)
        fits = [
            fit_points(T, y, own, float(np.mean(common)), reference, more, terms)
            for more in ((nothing, rising[:, None]) if both else (nothing,))
        ]
        if terms < 4 and order is None:
            fits[0] = _with_neglected(fits[0], T, y, own, float(np.mean(common)))
        curves.append(
            Curve(
                name,
                first.units[k],
                T,
                y,
                rising,
                fits[0],
                fits[1] if both else None,
                *_apart(fits[-1], both),
                np.sqrt(variances),
            )
        )
        judged += judged_points(curves[-1], own, 1.0 / len(first.names))
    findings = [
        Finding(
            "bad_verdict",
            f"the calibration ended suspect: {estimate.message}",
            file.path,
            tuple({name: None for each in estimate.findings for name in each.harm}),
        )
        for estimate, file in zip(estimates, files, strict=True)
        if estimate.status is Status.SUSPECT
    ]
    findings += judged
    if terms < 4 and order is None:
        text = (
            f"{distinct} temperatures carry a polynomial of degree {terms - 1} only, expected 5 for a cubic: what the "
            f"power {terms} of temperature would change is in u, higher ones are not"
        )
        findings.append(Finding("few_degrees_of_freedom", text))
    what = f"{len(curves)} coefficients from {len(T)} calibrations"
    given = {"reference_degC": reference, "order": order}
    estimate = assemble(curves, reference, files, findings, given, what)
    result = {**estimate.result, "calibration": {"command": first.command, "result": _in_use(first)}}
    return TemperatureModel(replace(estimate, result=result), tuple(curves))


def _in_use(estimate: Estimate) -> dict[str, Any]:
    """The part of a calibration's result beside the coefficients that its use needs."""
    keys = ("unit", "instrument", "stated", "attitude", "gravity_m_s2")
    kept = {key: estimate.result[key] for key in keys if key in estimate.result}
    return {**kept, "rates": []} if "rates" in estimate.result else kept


def _with_neglected(
    fit: TemperaturePolynomial, T: Array, y: Array, variances: Array, common: float
) -> TemperaturePolynomial:
    """The fit with the next power counted in: the u of a fit that has it too, and by how much that one moves."""
    birge = max(1.0, float(np.sum(fit.residuals**2 / variances)) / (len(T) - fit.terms))
    nothing = np.empty((len(T), 0))
    return counted_in(fit, fit_points(T, y, birge * variances, common, fit.reference, nothing, fit.terms + 1))


def _apart(fit: TemperaturePolynomial, both: bool) -> tuple[float, bool]:
    """The difference between rising and falling, 0 where there are not both, and whether it is more than chance."""
    if not both:
        return 0.0, False
    difference, u = abs(float(fit.coefficients[-1])), float(np.sqrt(fit.covariance[-1, -1]))
    return difference, difference > coverage_factor(float(fit.dof[-1])) * u


def _temperature(estimate: Estimate, file: Source) -> float:
    """The temperature in the conditions of a calibration [degC]."""
    temperature = estimate.conditions.get("temperature")
    if not temperature:
        raise InputError(
            file.path,
            'conditions.temperature: missing, expected that of the instrument (temperature = "23 degC" under '
            "[conditions] in the study)",
        )
    return float(temperature["value"])
