"""The estimate of a strapdown unit: coefficients in the stated form, covariance, budget and verdict."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding, Status
from inercal.foundation.geometry.rotations import conjugate, log, multiply
from inercal.foundation.inference.identifiability import HALF_SEEN, UNSEEN, Learned, learned
from inercal.foundation.inference.limits import LIMITS as INFERENCE
from inercal.foundation.inference.plausible import beyond_prior
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.records.dwells import Dwell
from inercal.foundation.records.places import counted, counted_names
from inercal.foundation.records.record import Record, recorded_temperature
from inercal.foundation.results.basis import Basis, Formula, conditions_of, studied
from inercal.foundation.results.budget import TypeB, combine
from inercal.foundation.results.remarks import at_prior_together, exact_gravity, singular
from inercal.foundation.results.result import Estimate
from inercal.systems.strapdown.fit.batch import Fit
from inercal.systems.strapdown.fit.error_state import Filtered
from inercal.systems.strapdown.fit.restricted import residuals
from inercal.systems.strapdown.fit.unmodelled import TestedEffect, considered, posed, tests
from inercal.systems.strapdown.limits import LIMITS
from inercal.systems.strapdown.model.coefficients import (
    ALWAYS,
    GRAVITY,
    LATITUDE,
    USUAL,
    group_of,
    names,
    slope,
    stated,
)
from inercal.systems.strapdown.model.samples import Samples, freed
from inercal.systems.strapdown.result.budget import excess, sources
from inercal.systems.strapdown.result.judged import drifting, judged_unit
from inercal.systems.strapdown.settings import TURN_NOISE, StrapdownSettings

COMMAND = "calibrate strapdown"

_FRAMES = {
    "upper": "b, of the instrument: z along the input axis of accelerometer z, y in the plane of those of y and z; "
    "origin at accelerometer z",
    "lower": "b, of the instrument: x along the input axis of accelerometer x, y in the plane of those of x and y; "
    "origin at accelerometer z",
}

MODEL = Formula(
    r"$y_a = K_1 (M f_s + K_2 f_s^2) + K_0$, $f_{s,i} = (f + W r_i)_i$ at the time $t - \tau_a$, "
    r"$W = [w' \times] + [w \times][w \times]$; $y_g = S (T w + S_{\mathrm{asym}}/2 |w|) + G f + D_F$; $f$ and $w$ are "
    "specific force and inertial rate at the origin of b, $M$ and $T$ have diagonals of 1, $r_z = 0$. At rest the "
    "velocity is zero, attitude and velocity are carried through all samples."
)

REFERENCES = (
    "P. G. Savage, Strapdown inertial navigation integration algorithm design, J. Guidance, Control, and Dynamics 21 "
    "(1998) 19 and 208",
    "D. H. Titterton, J. L. Weston, Strapdown inertial navigation technology, second edition, IEE 2004",
    "B. Triggs, P. McLauchlan, R. Hartley, A. Fitzgibbon, Bundle adjustment - a modern synthesis, LNCS 1883 (2000)",
    "JCGM 100:2008, Guide to the expression of uncertainty in measurement",
)


def assemble(
    record: Record,
    samples: Samples,
    rests: tuple[Dwell, ...],
    fit: Fit,
    settings: StrapdownSettings,
    still: Fit | None = None,
    by_filter: Filtered | None = None,
) -> Estimate:
    """Put the estimate together; of the filter, where there is one, in the place of the batch's coefficients: the
    residuals of turns and the budget stay those of the batch. ``still`` is the fit whose biases do not walk, where
    those of ``fit`` were found to."""
    batch = fit
    if by_filter is not None:
        fit = replace(fit, c=by_filter.c, passes=by_filter.passes, converged=by_filter.converged)
    terms, outputs = settings.terms, _outputs(record)
    found = names(terms, settings.frame)

    def in_words(free: Array) -> Array:
        c = fit.c.copy()
        c[fit.free] = free
        return stated(c, terms, settings.frame, outputs)

    values, J = in_words(fit.c[fit.free]), slope(in_words, fit.c[fit.free])
    prior_u = np.sqrt(np.sum(np.square(J * fit.prior), axis=1))
    parts = sources(fit, samples, settings, J)
    by_fit = np.sqrt(np.diag(J @ fit.covariance @ J.T))
    scales = np.array(
        [
            value if name.startswith("S_") and len(name) == 3 else 0.0
            for name, value in zip(found, values, strict=True)
        ]
    )
    if settings.time_base_u > 0.0:
        parts.append(TypeB("time base", settings.time_base_u, "1", scales))
    tested = tests(posed(fit, settings))
    fitted_u = combine(found, parts).u
    drifts = considered(tested, settings, J, found, fitted_u)
    uncertainty = combine(found, [*parts, drifts.source] if drifts else parts)
    left = dict(zip(found, (uncertainty.u / prior_u).tolist(), strict=True))
    judged = learned(J @ fit.covariance @ J.T, prior_u, found)
    at_prior = [name for name in found if left[name] > HALF_SEEN]
    findings = [*record.findings, *at_prior_together(at_prior)]
    findings += exact_gravity(settings.site, "its relative error goes into all K1")
    findings += _too_quiet(fit)
    misfit = excess(fit)
    findings += _left_out(tested, found, J, fitted_u)
    if fit.converged and fit.chi2 > INFERENCE.noiseless**2 * fit.dof:
        said = list(judged_unit(batch, samples, settings, found, J, fitted_u))
        if still is not None and not any(finding.code != "blind" for finding in said):
            said = [*drifting(still, samples, settings, found, J, fitted_u), *said]
        findings += said
    if 1.0 < misfit <= INFERENCE.gross:
        text = f"Residuals are {misfit:.2g} times what the stated noise explains, and u allows for it."
        findings.append(
            Finding("excess_scatter", text, harm=(), action="State the noise as it is under [noise].")
        )
    findings += [drifts.finding] if drifts and drifts.finding else []
    off = values - in_words(np.zeros(len(fit.free)))
    findings += beyond_prior(found, off, by_fit, misfit * prior_u, INFERENCE.value_risk)
    findings += _turn_noise(settings, left)
    at_rest, over_turns = residuals(fit)
    statistics = {
        "dof": float(fit.dof),
        "chi2": fit.chi2,
        "condition": judged.condition,
        "residual_rms": math.sqrt(fit.chi2 / fit.dof),
        "rest_residual_rms": at_rest,
        "turn_residual_rms": over_turns,
        "intervals": float(len(rests)),
    }
    return Estimate.of(
        _basis(record, settings, _conditions(record, samples, fit, settings)),
        found,
        [_unit(name, record) for name in found],
        values,
        uncertainty,
        _verdict(fit, left, judged, statistics, settings.filter),
        findings=findings,
        statistics=statistics,
        result={
            "estimator": settings.filter,
            "passes": fit.passes,
            **({} if by_filter is None else _of_filter(batch, by_filter, in_words, J, found)),
            "frame": settings.frame,
            "unit": {sensor: record[f"{sensor}_x"].unit.symbol for sensor in ("acc", "gyro")},
            "rests": _times(rests, samples),
            "turns": _turns(fit),
            "bounds": dict(zip(found, by_fit.tolist(), strict=True)),
            "at_prior": at_prior,
            "nuisances": _nuisances(fit),
            "turn_noise": {
                "attitude": settings.noise.turn_attitude,
                "velocity": settings.noise.turn_velocity,
            },
            "walks": {"gyro": settings.noise.gyro_walk, "accelerometer": settings.noise.accelerometer_walk},
            "drifts": {"usual": drifts.usual, "left": drifts.left} if drifts else None,
            "left_out": {
                each.candidate.name: {"chi2_drop": each.drop, "parameters": len(each.candidate.prior)}
                for each in tested
            },
        },
    )


def _of_filter(
    batch: Fit, by_filter: Filtered, in_words: Callable[[Array], Array], slope: Array, found: tuple[str, ...]
) -> dict[str, Any]:
    """Both estimators side by side, and u and the mean NIS of the filter after each rest."""

    def side(c: Array, covariance: Array) -> dict[str, Any]:
        u = np.sqrt(np.diag(slope @ covariance @ slope.T))
        rows = zip(found, in_words(c[batch.free]).tolist(), u.tolist(), strict=True)
        return {name: {"value": value, "u": each} for name, value, each in rows}

    history = [
        {"nis": nis, "u": dict(zip(found, np.sqrt(np.diag(slope @ P @ slope.T)).tolist(), strict=True))}
        for nis, P in zip(by_filter.nis.tolist(), by_filter.history, strict=True)
    ]
    compare = {
        "batch": side(batch.c, batch.covariance),
        "error-state": side(by_filter.c, by_filter.covariance),
    }
    return {"compare": compare, "history": history}


def failed(
    record: Record, samples: Samples, rests: tuple[Dwell, ...], settings: StrapdownSettings
) -> Estimate:
    """The estimate where the filter runs off."""
    text = 'the error-state filter ran off: take the batch (filter = "batch"), which holds where biases walk'
    return _without(record, samples, rests, settings, Status.NOT_CONVERGED, text)


def useless(
    record: Record, samples: Samples, rests: tuple[Dwell, ...], settings: StrapdownSettings, force: float
) -> Estimate:
    """The estimate of a recording that no solution fits; ``force`` [m/s^2] is the size read at rest."""
    text = (
        f"no solution was found; at rest the accelerometers read {force:.3g} m/s^2, expected about "
        f"{settings.site.gravity:.3g}: check units, signs and the order of axes"
    )
    return _without(record, samples, rests, settings, Status.NOT_CONVERGED, text)


def too_few(
    record: Record, samples: Samples, rests: tuple[Dwell, ...], settings: StrapdownSettings
) -> Estimate:
    """The estimate of a recording without enough rests."""
    text = (
        f"found {counted(len(rests), 'rest')} of {LIMITS.shortest_rest:g} s or more, expected {LIMITS.fewest_rests} or "
        "more: let the unit stand still between the turns, or list the rests (rests.list)"
    )
    return _without(record, samples, rests, settings, Status.TOO_FEW_INTERVALS, text)


def _without(
    record: Record,
    samples: Samples,
    rests: tuple[Dwell, ...],
    settings: StrapdownSettings,
    status: Status,
    message: str,
) -> Estimate:
    """The estimate of a recording without coefficients, and why there are none."""
    result = {"estimator": settings.filter, "rests": _times(rests, samples), "turns": []}
    return Estimate.without(
        _basis(record, settings), status, message, findings=record.findings, result=result
    )


def _basis(record: Record, settings: StrapdownSettings, conditions: Mapping[str, Any] | None = None) -> Basis:
    """The basis of the estimate."""
    return studied(COMMAND, settings, record.sources, MODEL, REFERENCES, conditions)


def _outputs(record: Record) -> tuple[float, float]:
    """Units of accelerometers and gyros in SI."""
    return record["acc_x"].unit.factor, record["gyro_x"].unit.factor


def _unit(name: str, record: Record) -> str:
    """Unit of a coefficient, from that of the output of its sensor."""
    sensor = "acc_x" if name.startswith("K") else "gyro_x"
    return TERMS[name].unit_for(record[sensor].unit.symbol)


def _times(rests: tuple[Dwell, ...], samples: Samples) -> list[list[float]]:
    """Begin and end of each rest [s] from the first sample on."""
    return [[each.start * samples.ts, each.stop * samples.ts] for each in rests]


def _turns(fit: Fit) -> list[dict[str, Any]]:
    """Angle [rad], axis in b, and standardised residual of each turn."""
    q, turns = fit.q_nb, fit.nodes.turns
    vectors = log(multiply(conjugate(q[turns]), q[turns + 1]))
    angles = np.linalg.norm(vectors, axis=1)
    z = np.sqrt(fit.squares[turns] / fit.redundancy[turns])
    axes = vectors / np.maximum(angles, 1e-12)[:, None]
    rows = zip(angles.tolist(), axes.tolist(), z.tolist(), strict=True)
    return [{"angle": angle, "axis": axis, "residual_z": each} for angle, axis, each in rows]


def _nuisances(fit: Fit) -> dict[str, dict[str, float]]:
    """Corrections of gravity and latitude, where they are uncertain."""
    called = {GRAVITY: "gravity", LATITUDE: "latitude"}
    return {
        called[place]: {
            "value": float(fit.c[place]),
            "u": float(np.sqrt(fit.covariance[k, k])),
            "prior": float(fit.prior[k]),
        }
        for k, place in enumerate(fit.free.tolist())
        if place in called
    }


def _conditions(record: Record, samples: Samples, fit: Fit, settings: StrapdownSettings) -> dict[str, Any]:
    """Conditions and ranges over which the result is valid; rates are those of the unit, about x, y, z of b."""
    rate = freed(samples, fit.c).w
    ranges = {
        "rate_about_an_axis_rad_s": [rate.min(axis=0).tolist(), rate.max(axis=0).tolist()],
        "specific_force_along_an_axis_m_s2": [float(samples.force.min()), float(samples.force.max())],
        "duration_s": len(samples.rate) * samples.ts,
        "rate_hz": 1.0 / samples.ts,
    }
    return conditions_of(settings, recorded_temperature(record), ranges, frame=_FRAMES[settings.frame])


def _too_quiet(fit: Fit) -> list[Finding]:
    """``low_scatter`` where the noise is stated too large, as of a simulation without any."""
    from scipy.special import chdtri

    if fit.chi2 >= chdtri(fit.dof, 1.0 - LIMITS.risk):
        return []
    text = (
        f"chi-square {fit.chi2:.4g} is far below the {fit.dof:.0f} expected: the noise is stated too large, and "
        "every u with it."
    )
    return [Finding("low_scatter", text, action="State the noise as it is under [noise].")]


def _turn_noise(settings: StrapdownSettings, left: Mapping[str, float]) -> list[Finding]:
    """``turn_noise`` where the noise of turns was found from the recording; it names places and delay that it hides."""
    noise, given = settings.noise, settings.given.get("noise", {})
    if not (noise.turn_velocity or noise.turn_attitude) or any(
        given.get(name, "estimate") != "estimate" for name in TURN_NOISE
    ):
        return []
    text = (
        f"turns close less well than white noise says, by {100.0 * noise.turn_velocity:.2g} cm/s and "
        f"{math.degrees(noise.turn_attitude):.2g} deg each, which u allows for: look for a range that was exceeded, "
        "filters of the unit, lost samples, stamps that were made up"
    )
    hidden = [name for name in left if group_of(name) in ("size", "delay") and left[name] > HALF_SEEN]
    if hidden:
        text += (
            f"; {counted_names(hidden, 6)} cannot be told beside it and stay at their prior. Of rests in 10 poses or "
            "more `inercal calibrate imu` with method multiposition tells the rest without velocities over turns"
        )
    return [Finding("turn_noise", text)]


def _left_out(tested: list[TestedEffect], found: tuple[str, ...], slope: Array, u: Array) -> list[Finding]:
    """Terms that usually are estimated and were left out, where they may shift a value by more than its u; none where
    the recording shows an effect outside the model."""
    if not tested or tested[0].significant:
        return []
    return [
        Finding(
            "unmodelled",
            f"terms leaves out {effect.candidate.words}, which may be as large as their prior.",
            action=f"{effect.candidate.advice}, or state a smaller prior.{effect.candidate.name}",
            harm=harm,
        )
        for effect in tested
        if effect.candidate.name in USUAL
        and (harm := _beyond(found, np.linalg.norm(slope @ effect.reach, axis=1), u))
    ]


def _beyond(found: tuple[str, ...], shift: Array, u: Array) -> tuple[str, ...]:
    """Names of values that are shifted by more than their u."""
    return tuple(name for name, by, each in zip(found, shift.tolist(), u.tolist(), strict=True) if by > each)


def _verdict(
    fit: Fit, left: Mapping[str, float], judged: Learned, statistics: Mapping[str, float], estimator: str
) -> tuple[Status, str]:
    """Status and sentence."""
    if not fit.converged and estimator == "error-state":
        return Status.NOT_CONVERGED, (
            f'after {fit.passes} passes of the filter the coefficients still move: take the batch (filter = "batch"), '
            "which holds where biases walk"
        )
    if not fit.converged:
        return Status.NOT_CONVERGED, (
            f"after {fit.passes} passes the coefficients still move: check units, signs and the order of axes, and "
            "that the prior allows for what the unit is"
        )
    if (misfit := excess(fit)) > INFERENCE.gross:
        return Status.INCONSISTENT, (
            f"the recording contradicts model or noise by {misfit:.2g} times: residuals are "
            f"{statistics['turn_residual_rms']:.2g} times the noise over turns and "
            f"{statistics['rest_residual_rms']:.2g} times within rests"
        )
    unseen = [name for name in left if group_of(name) in ALWAYS and left[name] > UNSEEN]
    if unseen:
        return Status.UNOBSERVABLE, (
            f"the turns say nothing about {counted_names(unseen, 6)}; the weakest combination is "
            f"{judged.weakest()[0]}: add turns about other axes, and at least two quadrants of each"
        )
    if weak := singular(judged, "add turns about other axes"):
        return weak
    return Status.OK, (
        f"{counted(len(left), 'coefficient')} from {counted(int(statistics['intervals']), 'rest')}, chi-square "
        f"{fit.chi2:.4g} with {fit.dof:.0f} degrees of freedom"
    )
