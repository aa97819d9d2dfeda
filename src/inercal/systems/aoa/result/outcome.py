"""The estimate of an angle of attack: errors of the sensors, uncertainty of the angle, and the verdict."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding, Status
from inercal.foundation.geometry.rotations import principal
from inercal.foundation.instruments.terms import Term, term
from inercal.foundation.results.basis import Basis, Formula, conditions_of, studied
from inercal.foundation.results.budget import Uncertainty
from inercal.foundation.results.result import Estimate
from inercal.systems.aoa.angles import Angles
from inercal.systems.aoa.fusion.filter_result import FusionResult
from inercal.systems.aoa.fusion.problem import FusionProblem
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording, in_time
from inercal.systems.aoa.reference.corrections import as_stated, report_of
from inercal.systems.aoa.result import verdict
from inercal.systems.aoa.result.budget import ANGLE, parts
from inercal.systems.aoa.result.systematic import by_fusion, gravity_u
from inercal.systems.aoa.settings import GYROS, AoaSettings

if TYPE_CHECKING:
    from inercal.systems.aoa.diagnosis.passed import AnglePass
    from inercal.systems.aoa.paper.delay import Delay
    from inercal.systems.aoa.reference.sensor_fit import Verified
    from inercal.systems.aoa.result.points import Point
    from inercal.systems.aoa.result.verification import AngleError, Errors


COMMAND = "aoa"

FLAT = (
    "; theta is the angle of attack only without roll, yaw and flow angularity; gyros for roll and yaw are not used: "
    "1 deg of yaw at 8 Hz then costs 0.14 to 0.75 deg of theta, by whatever method"
)

MODEL = Formula(
    r"$A_i = f_x \cos\,\lambda_i - f_z \sin\,\lambda_i + b_i$, "
    r"$f_x = g \sin\,\theta - (r_i + \mathrm{dr}_i) w^2 - c (z_i + \mathrm{zo}_i) w' + s_x'$, "
    r"$f_z = c (g \cos\,\theta + (r_i + \mathrm{dr}_i) w') - c^2 (z_i + \mathrm{zo}_i) w^2 + s_z'$, "
    r"$G = c (1 + k_g) w(t - \tau_g) + b_g$; $w = \theta'$, $c$ the cosine of the roll, $s_x'$, $s_z'$ "
    "flexure of the sting"
)

SPATIAL = Formula(
    r"$A_i = f_x \cos\,\lambda_i - f_z \sin\,\lambda_i + b_i$, "
    r"$f_x = g \sin\,\theta - (r_i + \mathrm{dr}_i) (w^2 + y^2) - (z_i + \mathrm{zo}_i) (w' - p y) + s_x'$, "
    r"$f_z = g \cos\,\theta \cos\,\phi + (r_i + \mathrm{dr}_i) (w' + p y) - (z_i + \mathrm{zo}_i) (w^2 + p^2) "
    r"+ s_z'$, $G = (1 + k_g) w(t - \tau_g) + b_g$; $\theta' = w \cos\,\phi + y \sin\,\phi$, "
    r"$\phi' = p + (w \sin\,\phi - y \cos\,\phi) \tan\,\theta$; $p$, $y$ rates of roll and yaw less "
    r"$b_{\mathrm{roll}}$, $b_{\mathrm{yaw}}$"
)

REFERENCES = (
    "JCGM 100:2008, Guide to the expression of uncertainty in measurement",
    "Tan et al., Large angle-of-attack measurement architecture for wind-tunnel models based on inertial technology "
    "(2021)",
)

_OF_FUSION = (
    "G. J. Bierman, Factorization Methods for Discrete Sequential Estimation, Academic Press (1977), chapter 10",
)


def assemble(
    recording: Recording,
    settings: AoaSettings,
    problem: FusionProblem,
    filtered: FusionResult,
    findings: Sequence[Finding],
    delay: Delay | None,
    points: Iterable[Point] = (),
    errors: Mapping[str, Errors] | None = None,
    compared: Mapping[str, Angles] | None = None,
    verified: Verified | None = None,
    angles: Angles | None = None,
    passed: AnglePass | None = None,
) -> Estimate:
    """The estimate by the fusion: the coefficients of the sensors at the end of a recording, as it was filtered.

    ``findings`` are those of the diagnosis, beside those of the recording; ``delay`` that of the gyro by the spectra;
    ``errors`` against the reference angle, by method; ``compared`` the angles of other methods, by name; ``verified``
    the sensors as fitted to the reference angle; ``angles`` those of the fusion, and ``passed`` the pass of the judge,
    where they are there already.
    """
    angles = by_fusion(recording, settings, problem, filtered) if angles is None else angles
    names, at = tuple(problem.nuisances), list(problem.nuisances.values())
    values, P = filtered.state.x[at], filtered.state.P[np.ix_(at, at)]
    before = np.sqrt(np.diag(problem.covariance)[at])
    all_findings = _all_findings(recording, findings)
    result = _result(recording, settings, angles, delay, points, errors, compared)
    result |= _of_sensors(settings, verified) | {"nis_mean": filtered.nis_mean, "posterior": {}}
    model = SPATIAL if problem.spatial else MODEL + FLAT
    basis = _basis(recording, settings, angles, model, REFERENCES + _OF_FUSION)
    squares = [(np.isfinite(column).sum(), np.nansum(np.square(column))) for column in filtered.innovations.T]
    count, power = (float(sum(column)) for column in zip(*squares, strict=True))
    rms = math.sqrt(power / count) if count else math.nan
    dof = float(max(count - len(names), 1))
    statistics = _statistics(recording, angles) | {
        "dof": dof,
        "residual_rms": rms,
        "nis_mean": filtered.nis_mean,
        "starts": float(len(filtered.starts)),
        "snap": settings.estimator.density,
    }
    status, message = verdict.of_fusion(recording, filtered, angles, all_findings)
    if status is Status.NOT_CONVERGED:
        return Estimate.without(
            basis,
            status,
            message,
            findings=all_findings,
            statistics=statistics,
            result=result,
            beside=(ANGLE,),
        )
    answered = np.isfinite(filtered.theta)
    split = parts(recording, problem, settings, filtered.smoothed, answered, filtered, passed)
    covariance = P + split.common
    u = np.sqrt(np.diag(covariance))
    rows = zip(names, values.tolist(), u.tolist(), before.tolist(), strict=True)
    result["posterior"] = {name: {"value": x, "u": own, "prior": prior} for name, x, own, prior in rows}
    if split.by_gravity is not None:
        slopes = dict(zip(names, split.by_gravity.tolist(), strict=True))
        result["gravity"] = {"value": settings.site.gravity, "u": gravity_u(settings), "slopes": slopes}
    # numbers that are not to be used need no such finding
    ratio = np.sqrt(np.diag(P)) / before
    at_prior = verdict.left_at_prior(names, ratio, settings) if status is Status.OK else None
    return Estimate.of(
        basis,
        names,
        [term_of(name).unit for name in names],
        values,
        Uncertainty(covariance, np.full(len(names), dof), split.budget, split.common),
        (status, message),
        findings=all_findings if at_prior is None else (*all_findings, at_prior),
        statistics=statistics,
        result=result,
        beside=(ANGLE,),
    )


def assemble_angles(
    recording: Recording,
    settings: AoaSettings,
    angles: Angles,
    findings: Sequence[Finding],
    delay: Delay | None,
    points: Iterable[Point] = (),
    errors: Mapping[str, Errors] | None = None,
    compared: Mapping[str, Angles] | None = None,
    verified: Verified | None = None,
) -> Estimate:
    """The estimate by an estimator that finds angles without coefficients. Parameters as of `assemble`."""
    all_findings = _all_findings(recording, findings)
    result = _result(recording, settings, angles, delay, points, errors, compared)
    result |= _of_sensors(settings, verified) | {"nis_mean": None, "posterior": {}}
    status, message = verdict.of_method(angles, all_findings)
    model = f"{angles.method}; {FLAT.removeprefix('; ')}"
    return Estimate.without(
        _basis(recording, settings, angles, model, REFERENCES),
        status,
        message,
        findings=all_findings,
        statistics=_statistics(recording, angles),
        result=result,
        beside=(ANGLE,),
    )


def _all_findings(recording: Recording, findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """All findings, each once."""
    return tuple(dict.fromkeys([*recording.findings, *findings]))


def term_of(name: str) -> Term:
    """Term of a coefficient by its name: ``b_1``, ``dr_2``, ``tau_g``; `KeyError` for another."""
    of = term(name)
    if of is None:
        raise KeyError(name)
    return of


def geometry(settings: AoaSettings) -> dict[str, dict[str, float]]:
    """Sensors as the study states them, by name [SI]; the coefficients are errors of these."""
    settings = as_stated(settings)
    layout = settings.layout
    each = zip(layout.names, layout.angle.tolist(), layout.r.tolist(), layout.z.tolist(), strict=True)
    sensors = {name: {"angle_rad": angle, "r_m": r, "z_m": z} for name, angle, r, z in each}
    for name in (*layout.names, *GYROS):
        of = settings.calibration(name)
        if (of.scale, of.bias) != (1.0, 0.0):
            sensors[name] = sensors.get(name, {}) | {"scale": of.scale, "bias_si": of.bias}
    return sensors


def _of_sensors(settings: AoaSettings, verified: Verified | None) -> dict[str, Any]:
    """Corrections of the sensors, and their fit to the reference angle, where present."""
    changed = {name: {"scale": s, "angle_rad": by} for name, (s, by) in settings.corrections.items()}
    return {
        **({"corrections": changed} if changed else {}),
        **({} if verified is None else {"verified": report_of(verified)}),
    }


def _statistics(recording: Recording, angles: Angles) -> dict[str, float]:
    """Statistics of all methods."""
    return {
        "samples": float(len(recording.t)),
        "rate_hz": 1.0 / recording.interval,
        "angles": float(np.isfinite(angles.theta).sum()),
    }


def _basis(
    recording: Recording, settings: AoaSettings, angles: Angles, model: str, references: tuple[str, ...]
) -> Basis:
    """Basis of an estimate by any method."""
    t = recording.t[in_time(recording.t)]
    rate = angles.rate[np.isfinite(angles.rate)]
    ranges = {
        "duration_s": float(t[-1] - t[0]) if len(t) else 0.0,
        "theta_rad": _span(angles.theta[np.isfinite(angles.theta)]),
        "rate_rad_s": float(np.abs(rate).max()) if len(rate) else None,
    }
    conditions = conditions_of(settings, recording.temperature, ranges, sensors=geometry(settings))
    return studied(COMMAND, settings, recording.sources, model, references, conditions)


def _result(
    recording: Recording,
    settings: AoaSettings,
    angles: Angles,
    delay: Delay | None,
    points: Iterable[Point],
    errors: Mapping[str, Errors] | None,
    compared: Mapping[str, Angles] | None,
) -> dict[str, Any]:
    """The command's own part of a result, of any method."""
    judged = errors or {}
    u = angles.u[np.isfinite(angles.u) & _settled(recording)]
    return {
        "method": angles.method,
        "angle": {
            "range": _span(angles.theta[np.isfinite(angles.theta)]),
            "u": {"median": _of(np.median, u), "max": _of(np.max, u)},
        },
        **({"reference": _reference(judged[angles.method])} if angles.method in judged else {}),
        "timing": _timing(settings, angles, delay),
        "points": [asdict(point) for point in points],
        "compare": {
            name: _beside(other, angles, judged.get(name)) for name, other in (compared or {}).items()
        },
    }


def _timing(settings: AoaSettings, angles: Angles, delay: Delay | None) -> dict[str, Any]:
    """Delays [s], and the effect of a common one on the angle [rad]: its rate times the delay."""
    rate = np.abs(angles.rate[np.isfinite(angles.rate)])
    largest, rms = _of(np.max, rate), _of(_rms, rate)
    timing = settings.timing
    delays: dict[str, Any] = {
        "gyro_delay": {"stated": timing.gyro_delay, "spectra": None if delay is None else asdict(delay)},
        "common_delay": {"value": timing.common_delay, "u": timing.common_delay_u},
    }
    for name, by in (("cost", timing.common_delay), ("cost_u", timing.common_delay_u), ("cost_per_ms", 1e-3)):
        delays[name] = {
            "max": None if largest is None else abs(by) * largest,
            "rms": None if rms is None else abs(by) * rms,
        }
    return delays


def _beside(other: Angles, angles: Angles, judged: Errors | None) -> dict[str, Any]:
    """A method in a comparison: its difference from the chosen one, and its error."""
    apart = np.degrees(principal(other.theta - angles.theta))
    apart, u = apart[np.isfinite(apart)], np.degrees(other.u[np.isfinite(other.u)])
    return {
        "difference": {"max_abs_deg": _of(np.max, np.abs(apart)), "rms_deg": _of(_rms, apart)},
        "u_median_deg": _of(np.median, u),
        **({} if judged is None else {"reference": _reference(judged)}),
    }


def _reference(errors: Errors) -> dict[str, Any]:
    """Errors against the reference angle, in degrees."""
    return _error(errors.all) | {"static": _error(errors.static), "moving": _error(errors.moving)}


def _error(error: AngleError) -> dict[str, Any]:
    """Errors of some rows."""
    return {
        "max_abs_deg": math.degrees(error.max_abs),
        "rms_deg": math.degrees(error.rms),
        "mean_deg": math.degrees(error.mean),
        "rms_over_u": error.ratio,
        "rows": error.rows,
    }


def _settled(recording: Recording) -> NDArray[np.bool_]:
    """Rows after the first 2 s; all of a recording that is shorter."""
    later_rows = recording.t - recording.t[:1] >= LIMITS.settling_time
    return later_rows if later_rows.any() else np.ones(len(recording.t), dtype=np.bool_)


def _span(values: Array) -> list[float] | None:
    """Smallest and largest; None without any."""
    return [float(values.min()), float(values.max())] if len(values) else None


def _of(of: Any, values: Array) -> float | None:
    """A statistic of values; None without any."""
    return float(of(values)) if len(values) else None


def _rms(values: Array) -> float:
    """Root mean square."""
    return math.sqrt(float(np.mean(np.square(values))))
