"""The result of every command: values with covariance, units and a verdict."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import CalibrationError
from inercal.foundation.findings import EVERYTHING, Finding, Status
from inercal.foundation.inputs import Source
from inercal.foundation.instruments.terms import resting_on
from inercal.foundation.records.places import counted_names
from inercal.foundation.results.basis import Basis, provenance
from inercal.foundation.results.budget import BudgetItem, Uncertainty
from inercal.foundation.results.shown import (
    aligned,
    budget_shown,
    in_words,
    rounded,
    statistics_in_words,
    units_shown,
)


def judged(
    verdict: tuple[Status, str], findings: Iterable[Finding], names: tuple[str, ...]
) -> tuple[tuple[Finding, ...], tuple[Status, str]]:
    """Findings with their harm in the ``names`` of a result, and its verdict.

    Harm to everything is harm to all names, and harm to a channel is harm to what rests on it. The verdict is
    ``suspect`` where it would be ``ok`` and some finding does harm. A result without names cannot be harmed: its
    findings keep the names of channels.
    """
    if not names:
        return tuple(findings), verdict
    findings = tuple(replace(each, harm=harmed(each.harm, names)) for each in findings)
    doing_harm = [each for each in findings if each.harm]
    status, message = verdict
    if status is not Status.OK or not doing_harm:
        return findings, verdict
    codes = ", ".join(dict.fromkeys(each.code for each in doing_harm))
    doubtful = [name for name in names if any(name in each.harm for each in doing_harm)]
    what = "values" if len(doubtful) == len(names) > 1 else counted_names(doubtful, 4)
    whose = "its" if len(doubtful) == 1 else "their"
    text = f"{message}; but see {codes}: {what} may be off by more than {whose} u"
    return findings, (Status.SUSPECT, text)


def harmed(harm: tuple[str, ...], names: tuple[str, ...]) -> tuple[str, ...]:
    """Those of ``names`` that a finding harms, in their order."""
    affected = set[str]()
    for each in harm:
        if each in names:
            affected.add(each)
        else:
            affected.update(names if (each,) == EVERYTHING else resting_on(each, names))
    return tuple(name for name in names if name in affected)


COVERAGE = 0.9545
"""Probability of the expanded uncertainty U = k u, so that k is 2 at many degrees of freedom (GUM G.1)."""


@dataclass(frozen=True)
class Parameter:
    """One estimated coefficient: ``value``, standard uncertainty ``u`` and ``U = k u``, all in ``unit``."""

    name: str
    value: float
    u: float
    dof: float
    unit: str

    @property
    def k(self) -> float:
        """Coverage factor for 95.45 %."""
        return coverage_factor(self.dof)

    @property
    def U(self) -> float:
        """Expanded uncertainty for a coverage of 95.45 %."""
        return self.k * self.u

    def interval(self, level: float = 0.95) -> tuple[float, float]:
        """Coverage interval at ``level`` (Student t, the parameter's own degrees of freedom)."""
        half = coverage_factor(self.dof, level) * self.u
        return self.value - half, self.value + half


def coverage_factor(dof: float, level: float = COVERAGE) -> float:
    """Two-sided Student t factor k for a coverage ``level`` at ``dof`` degrees of freedom (inf: normal)."""
    from scipy.special import ndtri, stdtrit

    p = 0.5 * (1.0 + level)
    return float(ndtri(p) if math.isinf(dof) else stdtrit(dof, p))


@dataclass(frozen=True, eq=False, repr=False)
class Estimate:
    """Everything a calibration says; `of` and `without` make one.

    ``values`` (p,), ``covariance`` (p, p) and ``dof`` (p,) belong to ``names`` and ``units``. The other fields are the
    keys of the JSON result of the same names; ``result`` is the command's own part. ``common`` (p, p) is the part of
    the covariance that is one and the same error in repeat runs (gravity, the clock, a table); None where it was not
    told apart.
    """

    command: str
    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    covariance: Array
    dof: Array
    status: Status
    message: str
    findings: tuple[Finding, ...] = ()
    statistics: Mapping[str, float] = field(default_factory=dict)
    budget: tuple[BudgetItem, ...] = ()
    model: str = ""
    conditions: Mapping[str, Any] = field(default_factory=dict)
    traceability: Mapping[str, str] = field(default_factory=dict)
    inputs: tuple[Source, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    timing: Mapping[str, float] = field(default_factory=dict)
    result: Mapping[str, Any] = field(default_factory=dict)
    references: tuple[str, ...] = ()
    common: Array | None = None

    @classmethod
    def of(
        cls,
        basis: Basis,
        names: Sequence[str],
        units: Sequence[str],
        values: Array,
        uncertainty: Uncertainty,
        verdict: tuple[Status, str],
        *,
        findings: Iterable[Finding] = (),
        statistics: Mapping[str, float] | None = None,
        result: Mapping[str, Any] | None = None,
        beside: tuple[str, ...] = (),
    ) -> Estimate:
        """The estimate of p parameters.

        Parameters
        ----------
        basis : Basis
            Files, study and publications behind it.
        names, units : sequences of str, length p
        values : (p,)
        uncertainty : Uncertainty
            `inercal.foundation.results.budget.combine` makes it of all sources.
        verdict : Status and str
            Becomes ``suspect`` where it is ``ok`` and a finding does harm.
        findings : iterable of Finding
        statistics, result : mapping
        beside : tuple of str
            Results beside the parameters that findings may harm: ``theta``.
        """
        marked, (status, message) = judged(verdict, findings, (*names, *beside))
        return cls(
            names=tuple(names),
            units=tuple(units),
            values=values,
            **uncertainty._asdict(),
            status=status,
            message=message,
            findings=marked,
            statistics=statistics or {},
            result=result or {},
            **vars(basis),
        )

    @classmethod
    def without(
        cls,
        basis: Basis,
        status: Status,
        message: str,
        *,
        findings: Iterable[Finding] = (),
        statistics: Mapping[str, float] | None = None,
        result: Mapping[str, Any] | None = None,
        beside: tuple[str, ...] = (),
    ) -> Estimate:
        """An estimate without parameters: of a command that has none, or one that says why there are none."""
        nothing = Uncertainty(np.zeros((0, 0)), np.zeros(0))
        more: dict[str, Any] = {"statistics": statistics, "result": result, "beside": beside}
        return cls.of(basis, (), (), np.zeros(0), nothing, (status, message), findings=findings, **more)

    def __repr__(self) -> str:
        """Ten lines at most: the verdict, and the first coefficients in SI."""
        rows = self.table().splitlines() if self.names else []
        more = [f"  and {len(rows) - 7} coefficients more"] if len(rows) > 8 else []
        findings = ", ".join(dict.fromkeys(finding.code for finding in self.findings))
        head = f"Estimate by {self.command}, {self.status.value}: {self.message}"
        return "\n".join([head, *(rows[:7] if more else rows), *more, f"findings: {findings or 'none'}"])

    @property
    def u(self) -> Array:
        """Standard uncertainties (p,)."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def k(self) -> Array:
        """Coverage factors (p,) for 95.45 %."""
        return np.array([coverage_factor(each) for each in self.dof.tolist()])

    @cached_property
    def parameters(self) -> Mapping[str, Parameter]:
        """The coefficients by name, in order."""
        rows = zip(self.names, self.values, self.u, self.dof, self.units, strict=True)
        return {
            name: Parameter(name, float(value), float(u), float(dof), unit)
            for name, value, u, dof, unit in rows
        }

    def __getitem__(self, name: str) -> Parameter:
        """The coefficient of that name."""
        return self.parameters[name]

    @property
    def correlation(self) -> Array:
        """Correlation matrix (p, p); 0 beside a parameter without uncertainty."""
        u = self.u
        with np.errstate(divide="ignore", invalid="ignore"):
            matrix = self.covariance / np.outer(u, u)
        return np.where(np.isfinite(matrix), matrix, 0.0)

    def in_units(self, units: Sequence[tuple[str, float]]) -> Estimate:
        """The estimate with its coefficients in other ``units``: of each the name, and how many of the old it is."""
        size = np.array([many for _, many in units])
        square = np.outer(size, size)
        return replace(
            self,
            units=tuple(name for name, _ in units),
            values=self.values / size,
            covariance=self.covariance / square,
            common=None if self.common is None else self.common / square,
        )

    def shown(self) -> Estimate:
        """The estimate for people: coefficients and budget in units of the field, conditions and statistics in words.

        All of ``result`` stays as it is.
        """
        return replace(
            self.in_units(list(self.shown_units().values())),
            conditions=in_words(self.conditions),
            statistics=statistics_in_words(self.statistics, self.result, self.timing),
            budget=budget_shown(self.command, self.budget),
        )

    def shown_units(self) -> dict[str, tuple[str, float]]:
        """Name of a coefficient -> its unit for people, and how many of its own unit that is."""
        return dict(zip(self.names, units_shown(self.command, self.units), strict=True))

    def raise_for_status(self, *, suspect: bool = False) -> Estimate:
        """Return the estimate itself if its status is ok, else raise `CalibrationError` with the message.

        ``suspect``: that status is good enough too.
        """
        if self.status is Status.OK or (suspect and self.status is Status.SUSPECT):
            return self
        raise CalibrationError(f"{self.status.value}: {self.message}", self)

    def citations(self) -> str:
        """The publications and standards behind the methods used, one a line."""
        return "\n".join(self.references)

    def table(self) -> str:
        """The coefficients as aligned text, each value rounded to its uncertainty."""
        head = ("", "value", "u", "U", "k", "unit")
        rows = [head] + [
            (
                p.name,
                *rounded(p.value, p.u, p.U),
                "–" if math.isnan(p.u) else f"{p.k:.2f}",
                p.unit,
            )
            for p in self.parameters.values()
        ]
        return "\n".join(aligned(rows, (0, 5)))


def without_coefficients(
    command: str,
    message: str,
    result: Mapping[str, Any],
    inputs: Iterable[Source] = (),
    findings: Iterable[Finding] = (),
    timing: Mapping[str, float] | None = None,
    settings: Mapping[str, Any] | None = None,
    seed: int | None = None,
    references: tuple[str, ...] = (),
) -> Estimate:
    """The result of a command that estimates no coefficients and ended well.

    ``settings`` are the keys of a study as they were given, for `Estimate.provenance`.
    """
    origin = {} if settings is None else {**provenance(settings), "seed": seed}
    basis = Basis(command, inputs=tuple(inputs), provenance=origin, references=references)
    estimate = Estimate.without(basis, Status.OK, message, findings=findings, result=result)
    return replace(estimate, timing=timing or {})


def timed(estimate: Estimate, begun: float) -> Estimate:
    """The estimate with the time since ``begun`` (`time.perf_counter`) as that of its solution."""
    import time

    return replace(estimate, timing={"solve": time.perf_counter() - begun})
