"""Repeat runs of one calibration: the combined values, and what changes from run to run.

Each run's uncertainty has two parts. What comes from elsewhere (gravity, the clock: type B) is the same error in all
runs and does not average out. What comes from scatter (type A) is independent; if the runs differ by more than it
explains, the coefficient itself changes from run to run (turn-on, mounting, temperature), with a standard deviation
that is estimated for each coefficient by the rule of Mandel and Paule.

The combined value stands for the instrument over such runs, with k - 1 degrees of freedom where a change between k
runs is found. Intervals of 95 % from simulated runs then cover the truth in 92 to 97 % for three and more runs,
whatever the size of the change, and in 87 to 98 % for two.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding, Status
from inercal.foundation.inputs import Source
from inercal.foundation.records.places import counted
from inercal.foundation.results.basis import Basis
from inercal.foundation.results.budget import BudgetItem, Uncertainty
from inercal.foundation.results.files import plain_objects
from inercal.foundation.results.limits import LIMITS
from inercal.foundation.results.result import Estimate
from inercal.foundation.results.shown import rounded

REFERENCE = (
    "J. Mandel, R. C. Paule, Interlaboratory evaluation of a material with unequal numbers of replicates, Analytical "
    "Chemistry 42 (1970) 1194"
)


@dataclass(frozen=True)
class Combined:
    """One coefficient over runs: weights (k,) that add up to 1, and the ``between``-run variance."""

    weights: Array
    between: float
    probability: float


def mandel_paule(x: Array, variances: Array, dof: Array) -> Combined:
    """Weigh values (k,) with variances (k,) of ``dof`` (k,) that may also differ by a variance of unknown size.

    The between-run variance is the one with which the weighted sum of squares equals k - 1; 0 where it is less even
    without. ``probability`` is that of such a sum of squares by chance alone, by Welch's test (Biometrika 38 (1951)
    330), as the variances are estimates themselves.
    """
    from scipy.optimize import brentq

    k = len(x)
    size = max(float(np.ptp(x)), float(np.sqrt(np.max(variances)))) or 1.0
    apart, within = (x - np.mean(x)) / size, variances / size**2
    floor = 1e-15  # for variances of 0

    def surplus(between: float) -> float:
        weights = 1.0 / (within + between)
        mean = weights @ apart / weights.sum()
        return float(weights @ (apart - mean) ** 2) - (k - 1.0)

    first = surplus(floor)
    between = float(brentq(surplus, floor, float(k), xtol=1e-15, rtol=1e-12)) if first > 0.0 else 0.0
    weights = 1.0 / (within + max(between, floor))
    probability = _welch(1.0 / (within + floor), first + k - 1.0, dof)
    return Combined(weights / weights.sum(), between * size**2, probability)


def _welch(weights: Array, squares: float, dof: Array) -> float:
    """Probability of a weighted sum of squares of k values about their mean, with weights of ``dof`` (k,)."""
    from scipy.special import chdtrc, fdtrc

    k = len(weights)
    unsure = float(np.sum((1.0 - weights / weights.sum()) ** 2 / dof))
    if unsure == 0.0:
        return float(chdtrc(k - 1.0, squares))
    ratio = squares / (k - 1.0) / (1.0 + 2.0 * (k - 2.0) / (k**2 - 1.0) * unsure)
    return float(fdtrc(k - 1.0, (k**2 - 1.0) / (3.0 * unsure), ratio))


def combine_runs(runs: Sequence[Estimate]) -> Estimate:
    """Combine estimates of the same coefficients from independent runs, two at least.

    Runs whose status is neither ok nor suspect are left out and give the status of the whole. The ``result`` holds
    ``runs`` (files and status of each), by name ``by_run`` (values and u of the sound ones) and ``between`` (standard
    deviation from run to run and its probability by chance), and what is the same in the results of all. Raises
    `InputError` where runs have other coefficients or units than the first.
    """
    sound = [run for run in runs if run.status.done]
    bad = next((run for run in runs if not run.status.done), None)
    if len(sound) < 2:
        assert bad is not None
        return replace(
            sound[0] if sound and not bad.names else bad,
            status=bad.status,
            message=f"{_where(runs, bad)}: {bad.message}",
            findings=_findings(runs),
            inputs=_inputs(runs),
        )
    first = sound[0]
    for run in sound[1:]:
        if (run.names, run.units) != (first.names, first.units):
            raise InputError(
                _where(runs, run),
                f"found {_described(run)}, expected {_described(first)} as in {_where(runs, first)}",
            )
    x = np.array([run.values for run in sound])
    elsewhere = np.array(
        [np.zeros_like(run.covariance) if run.common is None else run.common for run in sound]
    )
    own = np.array([run.covariance for run in sound]) - elsewhere
    shared = np.mean(elsewhere, axis=0)
    spread = np.maximum(np.diagonal(own, axis1=1, axis2=2), 0.0)
    alone = _own_dof(sound, spread)
    parts = [mandel_paule(*each) for each in zip(x.T, spread.T, alone.T, strict=True)]
    weights = np.array([part.weights for part in parts]).T
    within = np.einsum("kp,kq,kpq->pq", weights, weights, own)
    between = np.array([part.between for part in parts]) * np.sum(weights**2, axis=0)
    covariance = shared + within + np.diag(between)
    dof = _dof(alone, weights, spread, np.diag(within) + between, np.diag(covariance))
    names = first.names
    findings = [*_findings(runs), *_changes(first, parts), *_of_several(names, x, parts)]
    status, message = Status.OK, f"{counted(len(names), 'coefficient')} from {counted(len(sound), 'run')}"
    if bad is not None:
        status = bad.status
        message += f"; {_where(runs, bad)} is left out: {bad.message}"
    basis = Basis(
        first.command,
        first.model,
        _same([run.conditions for run in sound]),
        first.traceability,
        _inputs(runs),
        first.provenance,
        (*first.references, *(() if REFERENCE in first.references else (REFERENCE,))),
    )
    combined = Estimate.of(
        basis,
        names,
        first.units,
        np.sum(weights * x, axis=0),
        Uncertainty(covariance, dof, _budget(sound, np.diag(within), between, np.diag(covariance)), shared),
        (status, message),
        findings=findings,
        statistics={"runs": float(len(sound)), "dof": float(len(sound) - 1)},
        result={
            **_same([run.result for run in sound]),
            "runs": [_row(run) for run in runs],
            "by_run": {
                name: {"values": [run.values[p] for run in sound], "u": [run.u[p] for run in sound]}
                for p, name in enumerate(names)
            },
            "between": {
                name: {"s": float(np.sqrt(part.between)), "probability": part.probability}
                for name, part in zip(names, parts, strict=True)
            },
        },
    )
    return replace(combined, timing={"solve": sum(run.timing.get("solve", 0.0) for run in runs)})


def _own_dof(runs: Sequence[Estimate], spread: Array) -> Array:
    """Degrees of freedom (k, p) of the variances ``spread`` (k, p) of the runs alone.

    Those of a run are of its whole variance; the part of it has fewer (Welch-Satterthwaite).
    """
    whole = np.array([np.diag(run.covariance) for run in runs])
    with np.errstate(divide="ignore", invalid="ignore"):
        dof = np.array([run.dof for run in runs]) * (spread / whole) ** 2
    return np.where(np.isfinite(dof) & (dof > 0), dof, np.inf)


def _dof(dof: Array, weights: Array, spread: Array, type_a: Array, total: Array) -> Array:
    """Degrees of freedom (p,): k - 1 where a change from run to run was found, else those of the runs together."""
    with np.errstate(divide="ignore", invalid="ignore"):
        pooled = type_a**2 / np.sum((weights**2 * spread) ** 2 / dof, axis=0)
        changed = type_a > 1.000001 * np.sum(weights**2 * spread, axis=0)
        combined = np.where(changed, len(dof) - 1.0, pooled) * (total / type_a) ** 2
    return np.where(np.isfinite(combined), np.maximum(combined, 1.0), np.inf)


def _changes(first: Estimate, parts: Sequence[Combined]) -> list[Finding]:
    """``between_runs``: coefficients that change from run to run beyond chance."""
    findings = []
    for name, part in zip(first.names, parts, strict=True):
        if part.probability < LIMITS.repeat_chance / len(parts):
            size = np.sqrt(part.between)
            text = f"{name} changes from run to run, standard deviation {rounded(size, size)[0]} {first[name].unit}"
            findings.append(Finding("between_runs", text))
    return findings


def _of_several(names: Sequence[str], x: Array, parts: Sequence[Combined]) -> list[Finding]:
    """``several_instruments``: runs (k, p) that change in scale and misalignment at once, as no instrument does.

    At least half of the scale factors change beyond chance by more than `Limits.same_scale`, and half of the
    misalignments by more than `Limits.same_angle`.
    """
    ruled_out = np.array([part.probability < LIMITS.repeat_chance / len(parts) for part in parts])
    size = np.sqrt([part.between for part in parts])
    scale = np.array([name.startswith(("K1_", "S_")) for name in names])
    angle = np.array([name.startswith(("M_", "T_")) for name in names])
    other_scale = ruled_out & scale & (size > LIMITS.same_scale * np.abs(np.mean(x, axis=0)))
    other_angle = ruled_out & angle & (size > LIMITS.same_angle)
    if not scale.any() or 2 * other_scale.sum() < scale.sum() or 2 * other_angle.sum() < angle.sum():
        return []
    text = (
        f"the {len(x)} runs look like {len(x)} different instruments, not like repeat runs of "
        "one: scale factors change by "
        f"up to {100.0 * float(np.max(size[scale] / np.abs(np.mean(x, axis=0)[scale]))):.2g} %, misalignments by up to "
        f"{1e3 * float(np.max(size[angle], initial=0.0)):.2g} mrad (standard deviations): calibrate each by itself"
    )
    return [Finding("several_instruments", text)]


def _budget(runs: Sequence[Estimate], within: Array, between: Array, total: Array) -> tuple[BudgetItem, ...]:
    """Scatter within and between the runs, and the sources that are one error in all."""
    names = runs[0].names

    def shares(variance: Array) -> dict[str, float]:
        return {
            name: float(part / whole)
            for name, part, whole in zip(names, variance, total, strict=True)
            if part > 0 and whole > 0
        }

    def variance(source: str) -> Array:
        """The effect of a source in the mean of the runs."""
        each = [
            (run.u**2, item.share)
            for run in runs
            for item in run.budget
            if item.source == source and item.type == "B"
        ]
        parts = [np.array([share.get(name, 0.0) for name in names]) * u2 for u2, share in each]
        return np.asarray(np.sum(parts, axis=0) / len(runs))

    # a source may be in some runs only, as a fault that another run excludes
    common = {
        item.source: item for run in runs for item in run.budget if item.type == "B" and not item.redrawn
    }
    elsewhere = (replace(item, share=shares(variance(source))) for source, item in common.items())
    # each coefficient has its own size of scatter, so that there is no one u to state
    return (
        BudgetItem("scatter within the runs", "A", math.nan, "", shares(within)),
        BudgetItem("changes between the runs", "A", math.nan, "", shares(between)),
        *elsewhere,
    )


def _same(tables: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The entries that are the same in all tables."""
    plain = [plain_objects(table) for table in tables]
    return {
        key: value
        for key, value in plain[0].items()
        if all(key in table and table[key] == value for table in plain)
    }


def _row(run: Estimate) -> dict[str, Any]:
    """A run in the result of all."""
    return {
        "files": ", ".join(source.path for source in run.inputs),
        "status": run.status.value,
        "message": run.message,
    }


def _findings(runs: Sequence[Estimate]) -> tuple[Finding, ...]:
    """The findings of all runs, each with its run; what every run says alike is said once."""
    runs_of: dict[Finding, list[int]] = {}
    for number, run in enumerate(runs, start=1):
        for finding in run.findings:
            runs_of.setdefault(finding, []).append(number)
    return tuple(
        finding
        if len(numbers) == len(runs)
        else replace(finding, where=", ".join([run_words(numbers), *filter(None, [finding.where])]))
        for finding, numbers in runs_of.items()
    )


def run_words(numbers: Sequence[int]) -> str:
    """Numbers of runs in words: ``run 2``, ``runs 1, 3``."""
    return f"run{'' if len(numbers) == 1 else 's'} {', '.join(map(str, numbers))}"


def _where(runs: Sequence[Estimate], run: Estimate) -> str:
    """A run by its number and first file."""
    number = next(k for k, other in enumerate(runs, start=1) if other is run)
    return run_words([number]) + (f" ({run.inputs[0].path})" if run.inputs else "")


def _described(run: Estimate) -> str:
    """The coefficients of a run in a few words."""
    return (
        f"{counted(len(run.names), 'coefficient')}, {run.names[0]} in {run.units[0]} to {run.names[-1]} in "
        f"{run.units[-1]}"
    )


def _inputs(runs: Sequence[Estimate]) -> tuple[Source, ...]:
    """The files of all runs, each once."""
    return tuple(dict.fromkeys(source for run in runs for source in run.inputs))
