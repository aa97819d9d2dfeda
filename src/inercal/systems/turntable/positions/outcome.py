"""The estimate of a calibration on a table: coefficients, covariance, budget, shares and verdict."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.designs.criteria import in_basis
from inercal.foundation.findings import Finding, Status
from inercal.foundation.inference.identifiability import WORST_BY_LENGTH
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.records.places import counted
from inercal.foundation.records.record import Record
from inercal.foundation.results.basis import Basis, Formula
from inercal.foundation.results.budget import TypeA, TypeB, combine
from inercal.foundation.results.remarks import ruled_by_site
from inercal.foundation.results.result import Estimate
from inercal.foundation.rigs.chain import Scope
from inercal.systems.turntable.judged import implausible, misordered
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.model import orthonormal
from inercal.systems.turntable.positions.application import in_use
from inercal.systems.turntable.positions.examination import examine
from inercal.systems.turntable.positions.fit import Fitting, earth_rate_of, fewest_positions
from inercal.systems.turntable.positions.judged import judged_positions
from inercal.systems.turntable.positions.shifts import Scale, doubts, findings_of, of_latitude, stated_exact
from inercal.systems.turntable.positions.tolerance import (
    alternatives,
    coefficient_shares,
    drift_shares,
    shifts,
)
from inercal.systems.turntable.readings import Readings, apart, basis_of
from inercal.systems.turntable.regression import Regression, worst_rank
from inercal.systems.turntable.settings import TurntableSettings

_MODELS = {
    "gyrowheel": Formula(
        r"$y = k_x w_x + k_y w_y + k_z w_z + \mathrm{DX}_F + \mathrm{DX}_X a_x + \mathrm{DX}_Y a_y$ "
        r"${}+ \mathrm{DX}_Z a_z + \mathrm{DX}_{XX} a_x^2 + \mathrm{DX}_{YY} a_y^2 + \mathrm{DX}_{XY} a_x a_y$ "
        r"${}+ \mathrm{DX}_{XZ} a_x a_z + \mathrm{DX}_{YZ} a_y a_z$ (axis Y: $\mathrm{kY}$, $\mathrm{DY}$); "
        r"$a = \begin{bmatrix}0 & 0 & -1\end{bmatrix} C_{nb}$, the gravity reference in units of the site's gravity "
        "(an accelerometer reads $-a$); $w$ the earth rate"
    ),
    "gyro": Formula(
        "$y_i = D_{F,i} + S_i (w_i + T_{ij} w_j + T_{ik} w_k) + G_{ij} f_j$ ($+ G_{ijk} f_j f_k$), $f$ the specific "
        "force (+g up at rest), $w$ the earth rate"
    ),
    "accelerometer": Formula(
        r"$y_i = K_0 + K_1 (f_i + M_{ip} f_p + M_{io} f_o + K_2 f_i^2 + K_3 f_i^3 + \mathrm{Koq} f_i |f_i|$ "
        r"${}+ \mathrm{Kip} f_i f_p + \mathrm{Kio} f_i f_o + \mathrm{Kpo} f_p f_o + \mathrm{Kpp} f_p^2 "
        r"+ \mathrm{Koo} f_o^2)$, $f$ the specific force (+g up at rest), $p$ and $o$ the axes after $i$"
    ),
}

REFERENCES = (
    "JCGM 100:2008, Guide to the expression of uncertainty in measurement",
    "Zhao et al., Error sensitivity analysis of a turntable-gyrowheel calibration system, Journal of Ordnance "
    "Equipment Engineering 44(1) (2023)",
    "H. D. Patterson, R. Thompson, Recovery of inter-block information when block sizes are unequal, Biometrika 58 "
    "(1971) 545",
)


@dataclass(frozen=True)
class Terms:
    """Terms as they are reported: ``values`` (p,) and the ``slope`` (p, p) by the linear coefficients."""

    values: Array
    slope: Array


def terms_of(fit: Regression) -> Terms:
    """Values of the terms of all channels."""
    values, slope = np.zeros(len(fit.c)), np.zeros((len(fit.c), len(fit.c)))
    for channel, block in zip(fit.model.channels, fit.model.blocks, strict=True):
        values[block], slope[block, block] = channel.terms(fit.c[block])
    return Terms(values, slope)


def sources(fit: Regression, terms: Terms, unit: str) -> list[TypeA | TypeB]:
    """Everything the terms are uncertain by: noise, each error of the table, the site, stated terms."""
    gain = np.einsum("pq,qnc->pnc", terms.slope, fit.gain)
    components: list[TypeA | TypeB] = []
    for k, channel in enumerate(fit.model.channels):
        sigma, dof = float(fit.noise[k]), float(fit.noise_dof[k])
        name = f"noise of {channel.channel}"
        if np.isinf(dof):
            components.append(TypeB(name, sigma, unit, gain[..., k], redrawn=True))
        else:
            components.append(
                TypeA(name, sigma, unit, sigma**2 * gain[..., k] @ gain[..., k].T, max(dof, 1.0))
            )
    for error, shift in zip(fit.model.chain.errors, shifts(fit), strict=True):
        std = error.distribution.std
        components.append(
            TypeB(
                error.source,
                std,
                "m" if error.is_offset else "rad",
                terms.slope @ shift / std,
                redrawn=error.scope in (Scope.POSITION, Scope.SAMPLE),
            )
        )
    if fit.second is not None:
        columns = terms.slope @ fit.second.shifts(fit.gain)[1]
        components.append(TypeB("second order of the table's errors", 1.0, "1", columns))
    beside, columns = fit.model.beside(fit.angles, fit.c)
    for each, column in zip(beside, np.moveaxis(columns, -1, 0), strict=True):
        # readings made with another value than taken: the fit takes the difference for coefficients
        by_value = np.einsum("pnc,nc->p", gain, column)
        components.append(TypeB(each.source, each.u, each.unit or unit_of_term(each.term, unit), by_value))
    return components


def assemble(record: Record, readings: Readings, fitting: Fitting, settings: TurntableSettings) -> Estimate:
    """Put the estimate together."""
    unit = readings.unit.si
    basis = _basis(record, readings, settings)
    findings = [*record.findings, *fitting.findings]
    rank, terms_asked = worst_rank(fitting.identified)
    result: dict[str, Any] = {
        "rank": rank,
        "terms": terms_asked,
        "null_vectors": list(dict.fromkeys(words for each in fitting.identified for words in each.words)),
        "plan": _plan(readings, fitting, settings),
        "instrument": settings.instrument.kind,
        "earth_rate": earth_rate_of(fitting.model),
    }

    def nothing(status: Status, message: str) -> Estimate:
        return Estimate.without(
            basis,
            status,
            message,
            findings=findings,
            statistics={"positions": float(len(readings.y))},
            result=result | {"tolerance_shares": {}},
        )

    if fitting.fit is None:
        return nothing(*_without_fit(readings, fitting, settings))
    fit, drift = fitting.fit, fitting.drift
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        terms = terms_of(fit)
        finite = np.isfinite(np.square(terms.values)) & np.isfinite(np.square(terms.slope)).all(axis=1)
    if not finite.all():
        return nothing(Status.UNOBSERVABLE, _dead(fit, finite))
    names = fit.model.symbols
    stated = [*sources(fit, terms, unit), *(drift.components(terms.slope) if drift else [])]
    bent, poorly_known = of_latitude(fit, settings.site, names, terms.slope, combine(names, stated).u)
    stated += bent
    uncertainty = combine(names, stated)
    findings += poorly_known
    findings += (large := _too_large(fit))
    if not large:  # cubes of the table's errors would be taken for faults
        examination = examine(readings, fit, [settings.instrument.noise] * len(readings.channels))
        scale = Scale(names, terms.slope, uncertainty.u)
        findings += stated_exact(fit, settings.site, scale)
        findings += findings_of(examination, fit, scale, readings.unit)
        uncertainty = combine(names, [*stated, *doubts(examination, fit, scale)])
        noise_stated = bool(np.isinf(fit.noise_dof).all())
        findings += judged_positions(readings, fit, scale, terms.values, examination, noise_stated)
    wrong_order, units = misordered(findings), [unit_of_term(name, unit) for name in names]
    if not wrong_order:
        findings += implausible(names, units, terms.values, uncertainty.u, settings)
    of_site = [each.source for each in fit.model.references]
    findings += ruled_by_site(names, uncertainty.budget, of_site, LIMITS.site_ratio)
    return Estimate.of(
        basis,
        names,
        units,
        terms.values,
        uncertainty,
        wrong_order or _verdict(readings, fitting),
        findings=findings,
        statistics=_statistics(readings, fitting, result["plan"]["condition"]),
        result=result
        | _shares(fit, terms)
        | {
            "table_errors": _table_errors(fit),
            "noise": _noise(readings, fit, unit),
            "second_order": fit.second is not None,
        }
        | ({"nuisances": drift.rows()} if drift else {})
        | in_use(fit, terms.slope, settings, unit),
    )


def _verdict(readings: Readings, fitting: Fitting) -> tuple[Status, str]:
    """Status and its sentence."""
    from scipy.special import chdtrc

    fit = fitting.fit
    assert fit is not None
    worst = max(fitting.identified, key=lambda each: each.identifiability.condition).identifiability
    if worst.condition > WORST_BY_LENGTH:
        return Status.ILL_CONDITIONED, (
            f"the {len(readings.y)} positions fix {worst.weakest()} only weakly (condition number "
            f"{worst.condition:.0f} of the scaled columns): add positions that change it"
        )
    noise_stated = np.isinf(fit.noise_dof).all()
    if noise_stated and fit.dof > 0 and chdtrc(fit.dof, fit.chi2) < LIMITS.misfit_probability:
        return Status.INCONSISTENT, (
            f"the readings miss the model by {np.sqrt(fit.chi2 / fit.dof):.2g} times what the stated noise and table "
            f"errors explain, most at {_farthest(readings, fit)}: check it, both of these, signs and units, or fit "
            "more terms"
        )
    return Status.OK, (
        f"{counted(len(fit.c), 'coefficient')} from {counted(len(readings.y), 'position')} of "
        f"{counted(len(readings.channels), 'channel')}"
    )


def _farthest(readings: Readings, fit: Regression) -> str:
    """The reading with the largest residual for its uncertainty."""
    std = fit.weights(fit.noise).std
    k, c = np.unravel_index(int(np.argmax(np.abs(fit.residuals) / std)), fit.residuals.shape)
    return f"position {k + 1} of {readings.channels[c]}"


def _too_large(fit: Regression) -> list[Finding]:
    """A finding where errors of the table bend the readings by more than their noise beyond the second order.

    Those that stay bend all readings at once, which has to move a coefficient as well, by what matters against its u:
    readings without noise show bends that do not.
    """
    if fit.second is None:
        return []
    chain, straight = fit.model.chain, fit.model.outputs(fit.angles, fit.c)
    within = fit.weights(fit.noise).within
    # where no noise is left, what is a thousand times below what changes from position to position does not matter
    limit = np.maximum(fit.noise, 1e-3 * np.sqrt(np.diagonal(within, axis1=1, axis2=2).mean(axis=0)))
    least = LIMITS.second_order * np.sqrt(np.diag(fit.covariance))
    bent = []
    for k, (error, std) in enumerate(zip(chain.errors, chain.std, strict=True)):
        step = std * np.eye(len(chain.errors))[k]
        plus, minus = (fit.model.outputs(fit.angles, fit.c, sign * step) for sign in (1.0, -1.0))
        even = 0.5 * (plus + minus) - straight - fit.second.squares[..., k]
        odd = 0.5 * (plus - minus) - fit.slopes[..., k] * std
        above = np.any(np.sqrt(np.mean(np.square(even) + np.square(odd), axis=0)) > limit)
        moved = np.linalg.norm(fit.shift(np.stack([even, odd], axis=-1)), axis=1)
        if above and (not error.scope.constant or np.any(moved > least)):
            bent.append(error.name)
    if not bent:
        return []
    text = (
        f"{', '.join(bent)} may be so large that even with their squares taken into account the readings bend by more "
        "than the noise: the uncertainties hold for smaller errors"
    )
    return [Finding("large_errors", text)]


def _dead(fit: Regression, identified: NDArray[np.bool_]) -> str:
    """A sentence: terms that are not ``identified`` (p,) are relative to a scale factor of zero."""
    lost = ", ".join(name for name, each in zip(fit.model.symbols, identified, strict=True) if not each)
    return f"{lost}: relative to a scale factor that is found as 0: does the output follow its input?"


def _without_fit(readings: Readings, fitting: Fitting, settings: TurntableSettings) -> tuple[Status, str]:
    """Status and sentence where nothing was fitted."""
    enough = len(readings.y) >= fewest_positions(fitting.model, settings)
    if enough and not any(each.words for each in fitting.identified):
        return Status.NOT_CONVERGED, (
            "the weights of the readings do not settle: the terms come out so large that errors of the table, which "
            "they multiply, drown the readings; fit fewer terms, or check units and noise"
        )
    return Status.UNOBSERVABLE, _unobservable(readings, fitting, settings)


def _unobservable(readings: Readings, fitting: Fitting, settings: TurntableSettings) -> str:
    """The reason why nothing was fitted, and the remedy."""
    words = [text for each in fitting.identified for text in each.words]
    fewest = fewest_positions(fitting.model, settings)
    if len(readings.y) < fewest:
        why = (
            ", of which one tells the noise, which is not stated" if settings.instrument.noise is None else ""
        )
        terms = max(len(channel.symbols) for channel in fitting.model.channels)
        return (
            f"found {counted(len(readings.y), 'position')} for {terms} terms, expected at least {fewest}{why}"
        )
    first = next(each for each in fitting.identified if each.words)
    rank, terms = first.identifiability.rank, len(first.identifiability.names)
    return (
        f"the {len(readings.y)} positions identify {rank} of {terms} terms: the readings do not change along "
        f"{'; '.join(dict.fromkeys(words))} (each term by the output it causes at full input); add positions, or leave "
        "terms out"
    )


def _statistics(readings: Readings, fitting: Fitting, condition: float) -> Mapping[str, float]:
    """Figures of the fit, and the condition number of its plan."""
    fit = fitting.fit
    assert fit is not None
    return {
        "dof": float(fit.dof),
        "condition": condition,
        "column_condition": max(each.identifiability.condition for each in fitting.identified),
        "residual_rms": float(np.sqrt(np.mean(np.square(fit.residuals)))),
        "chi2": fit.chi2,
        "positions": float(len(readings.y)),
    }


def _shares(fit: Regression, terms: Terms) -> dict[str, Any]:
    """Shares of the table's errors, and what the terms would be uncertain by were the table otherwise."""
    other = alternatives(fit, terms.slope)
    names = fit.model.symbols
    of_table = other.scopes["stated"]

    def named(values: Array) -> dict[str, float]:
        return dict(zip(names, values.tolist(), strict=True))

    return {
        "tolerance_shares": coefficient_shares(fit, terms.slope),
        "drift_shares": drift_shares(fit),
        "halved": {name: named(u / of_table) for name, u in other.halved.items()},
        "scopes": {scope: named(u) for scope, u in other.scopes.items()},
    }


def _table_errors(fit: Regression) -> list[dict[str, Any]]:
    """Constant errors of the table after the test; ``observed`` where u is below 0.9 of the prior."""
    errors = [fit.model.chain.errors[k] for k in fit.constant]
    return [
        {
            "factor": error.name,
            "scope": error.scope.value,
            "value_rad": float(value),
            "u_rad": float(u),
            "prior_rad": error.distribution.std,
            "observed": bool(u < 0.9 * error.distribution.std),
        }
        for error, value, u in zip(errors, fit.table, fit.table_u, strict=True)
        if not error.is_offset
    ]


def _noise(readings: Readings, fit: Regression, unit: str) -> list[dict[str, Any]]:
    """Noise of a reading by channel: as used, and as the scatter within the dwells would have it."""
    return [
        {
            "channel": channel,
            "noise": float(used),
            "within_dwells": float(within),
            "from": "stated" if np.isinf(dof) else "residuals",
            "unit": unit,
        }
        for channel, used, within, dof in zip(
            readings.channels, fit.noise, readings.u_mean, fit.noise_dof, strict=True
        )
    ]


def _basis(record: Record, readings: Readings, settings: TurntableSettings) -> Basis:
    """The basis of every estimate from positions, with the ranges over which it is valid."""
    low, high = readings.y.min(axis=0).tolist(), readings.y.max(axis=0).tolist()
    ends = zip(readings.channels, low, high, strict=True)
    ranges = {f"reading_of_{name}": list(both) for name, *both in ends}
    return basis_of(record, settings, ranges, readings.unit, _MODELS[settings.instrument.kind], REFERENCES)


def _plan(readings: Readings, fitting: Fitting, settings: TurntableSettings) -> dict[str, Any]:
    """The positions in figures, and their name where the record holds those of the study's plan."""
    plan, name = settings.plan.angles, "of the record"
    if plan.shape == readings.angles.shape:
        name = settings.plan.name if np.abs(apart(plan, readings.angles)).max() < 1e-3 else name
    condition, efficiency = in_basis(orthonormal(fitting.model, readings.angles))
    return {
        "name": name,
        "positions": len(readings.y),
        "condition": condition,
        "d_efficiency": efficiency,
    }


def unit_of_term(symbol: str, output: str) -> str:
    """SI unit of a term, for outputs of that unit."""
    text = TERMS[symbol].unit_for(output)
    return "1" if text in ("(rad/s)/(rad/s)", "(m/s^2)/(m/s^2)") else text
