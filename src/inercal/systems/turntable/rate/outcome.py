"""The estimate of a rate test: terms with their covariance, budget, residual at each rate, and verdict."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from inercal.foundation.findings import Finding, Status
from inercal.foundation.inference.identifiability import WORST_BY_LENGTH, Identifiability
from inercal.foundation.records.places import counted
from inercal.foundation.records.record import Record
from inercal.foundation.results.basis import Basis, Formula
from inercal.foundation.results.budget import TypeA, TypeB, Uncertainty, combine
from inercal.foundation.results.remarks import ruled_by_site
from inercal.foundation.results.result import Estimate, coverage_factor
from inercal.systems.turntable.judged import implausible, misordered
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.positions.outcome import unit_of_term
from inercal.systems.turntable.rate.fit import GyroRateFit, approaches
from inercal.systems.turntable.rate.judged import judged_rates
from inercal.systems.turntable.rate.stays import Input, RateDwells
from inercal.systems.turntable.readings import basis_of
from inercal.systems.turntable.settings import TurntableSettings

MODEL = Formula(
    r"$y = D_F + S (x + S_{\mathrm{asym}} |x|/2 + S_2 x^2 + S_3 x^3)$, $x$ the rate about the gyro's axis: the table's "
    "rate times the cosine of the axes, and the mean of earth rate over the stay; $D_F$ holds what gravity does at "
    "this attitude; of a gyro $i$ across the turning axis $k$: $y = D_F + S (x + T_{ik} w_k)$, $S$ as stated"
)

REFERENCES = (
    "JCGM 100:2008, Guide to the expression of uncertainty in measurement",
    "IEEE Std 952, Specification format guide and test procedure for single-axis interferometric fiber optic gyros",
    "H. D. Patterson, R. Thompson, Recovery of inter-block information when block sizes are unequal, Biometrika 58 "
    "(1971) 545",
)


def assemble(
    record: Record,
    dwells: RateDwells,
    settings: TurntableSettings,
    findings: Sequence[Finding],
    inputs: tuple[Input, ...],
    fits: tuple[GyroRateFit, ...],
    full_scale: float,
    identified: Identifiability,
) -> Estimate:
    """Put the estimate together."""
    unit = dwells.unit.si
    names = tuple(name for fit in fits for name in fit.names)
    found_sources = sources(dwells, inputs, fits, unit)
    uncertainty = _bounded(names, combine(names, found_sources), fits)
    values = np.concatenate([fit.values for fit in fits])
    u = uncertainty.u
    status = Status.OK
    message = f"{counted(len(names), 'term')} from {counted(len(dwells.rate), 'stay')} at rates"
    for fit in (each for each in fits if f"S_{each.axis}" in names):
        k = names.index(f"S_{fit.axis}")
        if abs(values[k]) < LIMITS.scale_sigmas * u[k]:
            status = Status.INCONSISTENT
            message = f"the output of gyro_{fit.axis} does not follow the rate: check channel, axis and units"
    judged, excess = judged_rates(dwells, inputs, fits, u)
    wrong_order = misordered(judged)
    units = [unit_of_term(name, unit) for name in names]
    findings = [*findings, *judged, *([] if wrong_order else implausible(names, units, values, u, settings))]
    if status is Status.OK and (wrong_order or excess):
        status, message = wrong_order or (Status.INCONSISTENT, excess)
    if status is Status.OK and identified.condition > WORST_BY_LENGTH:
        status = Status.ILL_CONDITIONED
        weak = f"{identified.weakest()} only weakly (condition number {identified.condition:.0f})"
        message = f"the rates fix {weak}: spread them wider"
    return Estimate.of(
        _basis(record, dwells, settings),
        names,
        units,
        values,
        uncertainty,
        (status, message),
        findings=(*findings, *ruled_by_site(names, uncertainty.budget, ("latitude",), LIMITS.site_ratio)),
        statistics={
            "dof": float(min(fit.dof for fit in fits)),
            "condition": identified.condition,
            "residual_rms": float(
                np.sqrt(np.mean(np.square(np.concatenate([fit.residuals[fit.stays] for fit in fits]))))
            ),
            "chi2": float(sum(fit.chi2 for fit in fits)),
            "stays": float(len(dwells.rate)),
        },
        result={
            "rank": identified.rank,
            "null_vectors": [],
            "plan": _plan(dwells, settings, full_scale),
            "tolerance_shares": _shares(settings, names, found_sources),
            "instrument": settings.instrument.kind,
            "unit": {"gyro": unit},
            "linearity": [
                {"name": each.name, "observed": each.observed, "low": each.low, "high": each.high}
                for fit in fits
                for each in fit.left_over
            ],
            "rates": [
                row
                for given, fit in zip(inputs, fits, strict=True)
                for row in _rows(dwells, given, fit, full_scale)
            ],
        },
    )


def unobservable(
    record: Record,
    dwells: RateDwells,
    settings: TurntableSettings,
    findings: Sequence[Finding],
    rank: int,
    words: Sequence[str],
    message: str,
) -> Estimate:
    """An estimate without terms."""
    test = settings.rate_test
    assert test is not None
    return Estimate.without(
        _basis(record, dwells, settings),
        Status.UNOBSERVABLE,
        message,
        findings=findings,
        statistics={"stays": float(len(dwells.rate))},
        result={
            "rank": rank,
            "null_vectors": list(words),
            "plan": _plan(dwells, settings, test.full_scale or float(np.abs(dwells.rate).max(initial=0.0))),
            "tolerance_shares": {},
            "instrument": settings.instrument.kind,
            "linearity": [],
            "rates": [],
        },
    )


def sources(
    dwells: RateDwells, inputs: Sequence[Input], fits: Sequence[GyroRateFit], unit: str
) -> list[TypeA | TypeB]:
    """Everything the terms are uncertain by: noise of each gyro, errors of the table, its rate, the latitude.

    The table is common to the gyros: its errors make their terms correlated.
    """
    ends = np.cumsum([0, *(len(fit.names) for fit in fits)])
    made: list[TypeA | TypeB] = []
    for fit, begin in zip(fits, ends, strict=False):
        gain = np.zeros((ends[-1], len(dwells.rate)))
        gain[begin : begin + len(fit.names)] = fit.gain
        name = f"noise of gyro_{fit.axis}"
        if np.isinf(fit.noise_dof):
            made.append(TypeB(name, fit.noise, unit, gain, redrawn=True))
        else:
            made.append(TypeA(name, fit.noise, unit, fit.noise**2 * gain @ gain.T, fit.noise_dof))
    everything = {effect.source: effect for given in inputs for effect in given.effects}
    for source, effect in everything.items():
        own = [next((e.shift for e in given.effects if e.source == source), None) for given in inputs]
        shifts = np.zeros(
            (len(own), len(dwells.rate), max(each.shape[1] for each in own if each is not None))
        )
        for all_of, each in zip(shifts, own, strict=True):
            if each is not None:
                all_of[:, : each.shape[1]] = each
        blocks = []
        for shift, fit in zip(shifts, fits, strict=True):
            moved = fit.scale * shift / effect.u
            blocks.append(
                np.einsum("pn,nq->pnq", fit.gain, moved).reshape(len(fit.gain), -1)
                if effect.redrawn
                else fit.gain @ moved
            )
        sensitivity = np.vstack(blocks)
        if np.any(sensitivity):
            made.append(TypeB(source, effect.u, effect.unit, sensitivity, redrawn=effect.redrawn))
    return made


def _bounded(names: Sequence[str], linear: Uncertainty, fits: Sequence[GyroRateFit]) -> Uncertainty:
    """The uncertainty with U of each largest deviation as wide as its bounds; shares and correlations stay."""
    wider = np.ones(len(names))
    for each in (each for fit in fits for each in fit.left_over):
        k = names.index(each.name)
        expanded = coverage_factor(float(linear.dof[k])) * float(linear.u[k])
        if expanded > 0.0:
            wider[k] = each.half / expanded
    scale = np.outer(wider, wider)
    common = None if linear.common is None else linear.common * scale
    return linear._replace(covariance=linear.covariance * scale, common=common)


def _rows(dwells: RateDwells, given: Input, fit: GyroRateFit, full_scale: float) -> list[dict[str, Any]]:
    """Residual of the best straight line in each stay, with its standard uncertainty."""
    covariance = fit.noise**2 * fit.remainder @ fit.remainder.T
    for effect in given.effects:
        moved = fit.scale * effect.shift
        part = np.diag(np.square(moved).sum(axis=1)) if effect.redrawn else moved @ moved.T
        covariance = covariance + fit.remainder @ part @ fit.remainder.T
    ppm = 1e6 / (abs(fit.scale) * full_scale)
    u = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    output = dwells.y[:, dwells.channels.index(f"gyro_{fit.axis}")]
    way = {1: "below", -1: "above", 0: "rest"}
    return [
        {
            "channel": f"gyro_{fit.axis}",
            "rate_rad_s": float(dwells.rate[k]),
            "output": float(output[k]),
            "input_rad_s": float(given.x[k]),
            "residual": float(fit.residuals[k]),
            "u": float(u[k]),
            "residual_ppm_of_full_scale": float(fit.residuals[k] * ppm),
            "u_ppm_of_full_scale": float(u[k] * ppm),
            "reached_from": way[int(direction)],
        }
        for k, direction in zip(fit.stays, approaches(dwells.rate[fit.stays]), strict=True)
    ]


def _plan(dwells: RateDwells, settings: TurntableSettings, full_scale: float) -> dict[str, Any]:
    """The test in figures."""
    turning = [settings.chain.joints[k] for k in dict.fromkeys(dwells.joint.tolist())]
    joint = ", ".join(turning)
    return {
        "name": f"rates about {joint}",
        "positions": len(dwells.rate),
        "joint": joint,
        "full_scale_rad_s": full_scale,
        "turns": "assumed whole" if dwells.assumed else "from the angles",
    }


def _shares(
    settings: TurntableSettings, names: Sequence[str], components: Sequence[TypeA | TypeB]
) -> dict[str, dict[str, float]]:
    """Share of each error of the table, by itself, in the table's part of each term's variance."""
    of_table = {error.source for error in settings.chain.errors}
    own = [
        each
        for each in components
        if each.source.removesuffix(", at the ends") in of_table or each.source.startswith("cosine")
    ]
    parts = {each.source: np.diag(each.covariance) for each in own}
    whole = np.sum(list(parts.values()), axis=0) if parts else np.zeros(len(names))
    return {
        name: {source: float(part[k] / whole[k]) for source, part in parts.items()}
        for k, name in enumerate(names)
        if whole[k] > 0.0
    }


def _basis(record: Record, dwells: RateDwells, settings: TurntableSettings) -> Basis:
    """The basis of every estimate of a rate test."""
    ranges = {"rate_rad_s": [float(dwells.rate.min()), float(dwells.rate.max())]}
    return basis_of(record, settings, ranges, dwells.unit, MODEL, REFERENCES)
