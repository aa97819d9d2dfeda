"""Two calibrations, run to run: each difference over its uncertainty, and all differences together.

The difference is second minus first. Each is judged by the normalised error E_n = |d| / U(d) (ISO 13528), which is
at most 1 for 95.45 % of the coefficients that did not move. Among many coefficients some are beyond 1 by chance, so
the verdict is taken on all: with m coefficients one counts as moved where a difference as large has a probability
below 0.025/m (Bonferroni), and all together where their weighted sum of squares has one below 0.025. A verdict
"inconsistent" is thus wrong in at most 5 % of the cases in which nothing moved, whatever the correlations.

What acts alike in both calibrations cancels in the difference: see `inercal.foundation.results.common_sources`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError, QuantityError
from inercal.foundation.findings import EVERYTHING, Finding, Status
from inercal.foundation.inference.identifiability import in_words
from inercal.foundation.records.places import counted_names
from inercal.foundation.results.basis import Basis, Formula, provenance
from inercal.foundation.results.budget import Uncertainty
from inercal.foundation.results.common_sources import Taken, common_sources, other_instrument
from inercal.foundation.results.limits import LIMITS
from inercal.foundation.results.result import Estimate, Parameter
from inercal.foundation.units import parse_unit

COMMAND = "compare"

MODEL = Formula(
    r"$d$ = second - first; var($d$) = var(first) + var(second) less twice the covariance by common sources; "
    r"$E_n = |d| / U(d)$; jointly $\chi^2 = d^T V^{-1} d$ with $V$ the covariance of the differences"
)

REFERENCES = (
    "ISO 13528:2022, Statistical methods for use in proficiency testing by interlaboratory comparison",
    "JCGM 100:2008, Guide to the expression of uncertainty in measurement",
)

_SINGULAR = 1e-12
"""Eigenvalue of the correlation matrix, per coefficient, below which a combination has no uncertainty."""


@dataclass(frozen=True)
class Saved:
    """A calibration and the file it was read from."""

    estimate: Estimate
    where: str


def compare(first: Saved, second: Saved) -> Estimate:
    """Compare two calibrations of one instrument.

    The values are the differences second - first of the coefficients that both have, in the units of the first;
    ``result["coefficients"]`` has one row for each. Raises `InputError` for a file that is no calibration, no
    coefficient in common, or a coefficient whose units do not agree.
    """
    for saved in (first, second):
        _check(saved)
    names = [name for name in first.estimate.names if name in second.estimate.names]
    if not names:
        own = ", ".join(first.estimate.names[:4])
        raise InputError(
            second.where,
            f"no coefficient in common with {first.where}, expected some of its {len(first.estimate.names)} "
            f"({own}{', ...' if len(first.estimate.names) > 4 else ''})",
        )
    a = _taken(first.estimate, names, np.ones(len(names)))
    b = _taken(second.estimate, names, np.array([_factor(name, first, second) for name in names]))
    common = common_sources(first.estimate, second.estimate, a, b)
    shared = np.zeros((len(names), len(names)))
    for each in common.values():
        shared += np.outer(each[0], each[1])
    covariance = a.covariance + b.covariance - shared - shared.T
    covariance = 0.5 * (covariance + covariance.T)
    values = b.values - a.values
    dof = _degrees(a, b, np.diag(covariance))
    units = tuple(first.estimate[name].unit for name in names)
    differences = [
        Parameter(*row)
        for row in zip(
            names,
            values.tolist(),
            np.sqrt(np.maximum(np.diag(covariance), 0.0)).tolist(),
            dof.tolist(),
            units,
            strict=True,
        )
    ]
    rows = [_row(p, a, b, i, common, len(names)) for i, p in enumerate(differences)]
    joint = _joint(values, covariance, dof)
    basis = Basis(
        COMMAND,
        MODEL,
        {"first": _conditions(first.estimate), "second": _conditions(second.estimate)},
        {
            key: text
            for key, text in first.estimate.traceability.items()
            if second.estimate.traceability.get(key) == text
        },
        provenance=provenance({"first": first.where, "second": second.where}),
        references=REFERENCES,
    )
    return Estimate.of(
        basis,
        names,
        units,
        values,
        Uncertainty(covariance, dof),
        _verdict(rows, joint, names),
        findings=_findings(first, second, common),
        statistics={
            "chi2": joint.chi2,
            "dof": float(joint.rank),
            "probability": joint.probability,
            "largest_normalised_error": max(row["normalised_error"] for row in rows),
        },
        result={
            "coefficients": rows,
            "common_sources": list(common),
            "only_in_first": [name for name in first.estimate.names if name not in names],
            "only_in_second": [name for name in second.estimate.names if name not in names],
            "family_wise_probability": LIMITS.moved_risk,
        },
    )


def _check(saved: Saved) -> None:
    """Refuse a file that is no calibration."""
    estimate = saved.estimate
    if estimate.command == COMMAND:
        raise InputError(saved.where, "is a comparison itself, expected a calibration")
    if not estimate.names:
        raise InputError(
            saved.where, f"holds no coefficients ({estimate.status.value}), expected a calibration with some"
        )
    with np.errstate(invalid="ignore"):
        sound = (
            np.isfinite(estimate.values)
            & np.isfinite(estimate.covariance).all(axis=1)
            & (np.diag(estimate.covariance) >= 0)
            & (estimate.dof > 0)
        )
    if not sound.all():
        name = estimate.names[int(np.argmin(sound))]
        raise InputError(
            saved.where,
            f"{name} is without a finite value, covariance or degrees of freedom, expected all three",
        )


def _taken(estimate: Estimate, names: list[str], factor: Array) -> Taken:
    """The coefficients ``names`` of an estimate, each times its ``factor``."""
    at = [estimate.names.index(name) for name in names]
    covariance = estimate.covariance[np.ix_(at, at)] * np.outer(factor, factor)
    return Taken(names, estimate.values[at] * factor, covariance, estimate.dof[at])


def _factor(name: str, first: Saved, second: Saved) -> float:
    """The unit of a coefficient in the second file over that in the first; raises `InputError`."""
    unit, other_unit = first.estimate[name].unit, second.estimate[name].unit
    if unit == other_unit:
        return 1.0
    (mine, per), (other, per_other) = map(_output_and_rest, (unit, other_unit))
    try:
        units = parse_unit(mine), parse_unit(other)
    except QuantityError:
        units = None
    if units is None or per != per_other or units[0].dimension != units[1].dimension:
        raise InputError(
            second.where, f"{name} is in {other_unit}, expected a unit like {unit}, as in {first.where}"
        )
    return units[1].factor / units[0].factor


def _output_and_rest(unit: str) -> tuple[str, str]:
    """("deg/s", "/(m/s^2)") of ``(deg/s)/(m/s^2)``: the unit of the output, and what it is per."""
    head, slash, rest = unit.partition("/(")
    return head.removeprefix("(").removesuffix(")"), slash + rest


def _degrees(a: Taken, b: Taken, variance: Array) -> Array:
    """Effective degrees of freedom (p,) of the differences, at least 1 (Welch-Satterthwaite, GUM G.4)."""
    with np.errstate(divide="ignore", invalid="ignore"):
        weight = a.u**4 / a.dof + b.u**4 / b.dof
        return np.where(weight > 0, np.maximum(variance**2 / weight, 1.0), np.inf)


def _row(
    p: Parameter,
    a: Taken,
    b: Taken,
    i: int,
    common: Mapping[str, tuple[Array, Array]],
    coefficients: int,
) -> dict[str, Any]:
    """One coefficient: both values, their difference, and how likely one as large is by chance."""
    z = 0.0 if p.value == 0 else p.value / p.u if p.u > 0 else math.copysign(math.inf, p.value)
    probability = _two_sided(abs(z), p.dof)
    return {
        "name": p.name,
        "first": float(a.values[i]),
        "u_first": float(a.u[i]),
        "second": float(b.values[i]),
        "u_second": float(b.u[i]),
        "difference": p.value,
        "u": p.u,
        "U": p.U,
        "unit": p.unit,
        "z": z,
        "normalised_error": abs(z) / p.k,
        "probability": probability,
        "moved": probability * coefficients < LIMITS.moved_risk / 2.0,
        "common": [source for source, (by_a, _) in common.items() if by_a[i] != 0.0],
    }


def _two_sided(z: float, dof: float) -> float:
    """Probability of a larger |difference / u|."""
    from scipy.special import ndtr, stdtr

    return 2.0 * float(ndtr(-z) if math.isinf(dof) else stdtr(dof, -z))


@dataclass(frozen=True, eq=False)
class _Joint:
    """All differences together: ``chi2`` on ``rank`` degrees, its ``probability``, and the combination (p,) of
    differences over u that is most surprising."""

    chi2: float
    rank: int
    probability: float
    direction: Array


def _joint(d: Array, covariance: Array, dof: Array) -> _Joint:
    """The weighted sum of squares of the differences, over the combinations that are uncertain.

    Its distribution is F with the least degrees of freedom of any coefficient, which holds where all covariance is
    one matrix times a variance estimated with those degrees, and is on the safe side else.
    """
    from scipy.special import chdtrc, fdtrc

    u = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    uncertain = u > 0
    direction = np.zeros(len(d))
    if not uncertain.any():
        return _Joint(0.0, 0, 1.0, direction)
    z, scale = d[uncertain] / u[uncertain], np.outer(u[uncertain], u[uncertain])
    values, vectors = np.linalg.eigh(covariance[np.ix_(uncertain, uncertain)] / scale)
    kept = values > _SINGULAR * len(z)
    vectors = vectors[:, kept]
    direction[uncertain] = vectors @ (vectors.T @ z / values[kept])
    chi2, rank, nu = float(z @ direction[uncertain]), int(kept.sum()), float(dof[uncertain].min())
    probability = chdtrc(rank, chi2) if math.isinf(nu) else fdtrc(rank, nu, chi2 / rank)
    return _Joint(chi2, rank, float(probability), direction)


def _verdict(rows: list[dict[str, Any]], joint: _Joint, names: list[str]) -> tuple[Status, str]:
    """Status and its sentence."""
    moved = sorted((row for row in rows if row["moved"]), key=lambda row: row["probability"])
    if moved:
        shown = ", ".join(f"{row['name']} (E_n {row['normalised_error']:.2g})" for row in moved[:4])
        more = f" and {len(moved) - 4} more" if len(moved) > 4 else ""
        return Status.INCONSISTENT, (
            f"{shown}{more} moved by more than the uncertainties explain (all {len(names)} together: probability "
            f"{joint.probability:.2g})"
        )
    if joint.probability < LIMITS.moved_risk / 2.0:
        return Status.INCONSISTENT, (
            f"together the {len(names)} differences are larger than their covariance explains (probability "
            f"{joint.probability:.2g}), most in the combination {in_words(joint.direction, names)}, though none is "
            "so alone"
        )
    worst = max(rows, key=lambda row: float(row["normalised_error"]))
    beyond = sum(row["normalised_error"] > 1.0 for row in rows)
    by_chance = f", {beyond} of {len(rows)} beyond 1 as can be by chance" if beyond else ""
    return Status.OK, (
        f"the uncertainties explain the differences: largest E_n {worst['normalised_error']:.2g} ({worst['name']})"
        f"{by_chance}, all {len(names)} together with a probability of {joint.probability:.2g}"
    )


def _harmed(estimate: Estimate) -> tuple[str, ...]:
    """Coefficients of a calibration that its findings harm where it is suspect; everything where it ended worse."""
    names = (name for name in estimate.names if any(name in each.harm for each in estimate.findings))
    return tuple(names) if estimate.status is Status.SUSPECT else EVERYTHING


def _conditions(estimate: Estimate) -> dict[str, Any]:
    """Date and temperature of a calibration."""
    return {key: estimate.conditions.get(key) for key in ("date", "temperature")}


def _findings(first: Saved, second: Saved, common: Mapping[str, tuple[Array, Array]]) -> list[Finding]:
    """Findings that make the comparison doubtful."""
    a, b = first.estimate, second.estimate
    findings = [
        Finding(
            "bad_verdict",
            f"the calibration ended {each.estimate.status.value}: {each.estimate.message}",
            each.where,
            _harmed(each.estimate),
        )
        for each in (first, second)
        if each.estimate.status is not Status.OK
    ]
    ways = (
        ("command", a.command, b.command),
        ("model", a.model, b.model),
        ("frame", a.conditions.get("frame"), b.conditions.get("frame")),
        ("method", a.result.get("method"), b.result.get("method")),
    )
    differing = [word for word, one, other in ways if one != other]
    if other_instrument(a, b):
        differing.append("instrument")
    if differing:
        findings.append(
            Finding(
                "other_model",
                f"the calibrations differ in {', '.join(differing)}: coefficients of one name may not mean the same",
                f"{first.where}, {second.where}",
            )
        )
    recordings = {
        source.sha256 for source in b.inputs if not source.path.endswith(".toml")
    }  # no study, no map
    path = next((source.path for source in a.inputs if source.sha256 in recordings), None)
    if path is not None:
        findings.append(
            Finding(
                "same_recording",
                f"both rest on {path}: its noise is the same in both, and the uncertainties of the differences are too "
                "large",
                f"{first.where}, {second.where}",
            )
        )
    constant = [
        item.source
        for item in a.budget
        if item.type == "B"
        and item.source not in common
        and max(item.share.values(), default=0.0) > LIMITS.common_share
        and any((item.source, item.u) == (other.source, other.u) for other in b.budget)
    ]
    if constant:
        shown = counted_names(constant, 6)
        findings.append(
            Finding(
                "perhaps_common",
                f"{shown}: in both budgets, taken as independent; where they acted alike in both runs, the "
                "uncertainties of the differences are too large",
                f"{first.where}, {second.where}",
            )
        )
    return findings
