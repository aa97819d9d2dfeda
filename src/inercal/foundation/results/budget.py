"""Uncertainty budgets: type A covariances and type B inputs combined, with shares (GUM, JCGM 100:2008)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from inercal.foundation.arrays import Array


@dataclass(frozen=True)
class TypeA:
    """A source evaluated from scatter in the data.

    ``u`` [``unit``] the standard deviation of one observation, ``covariance`` (p, p) what it does to the
    parameters, ``dof`` its degrees of freedom.
    """

    source: str
    u: float
    unit: str
    covariance: Array
    dof: float


@dataclass(frozen=True)
class TypeB:
    """A source known from elsewhere: gravity, table angle, latitude, fixture, time base.

    ``u`` [``unit``] its standard uncertainty, ``sensitivity`` (p,) the derivative of each parameter with
    respect to it; one value for the whole test, so that it is common to all observations. (p, q) stands for q
    independent components of equal u. It is the same in repeat runs, unless it is ``redrawn`` (set up anew by hand).
    """

    source: str
    u: float
    unit: str
    sensitivity: Array
    redrawn: bool = False

    @property
    def covariance(self) -> Array:
        """(p, p) what it does to the parameters."""
        shift = self.sensitivity.reshape(len(self.sensitivity), -1) * self.u
        return np.asarray(shift @ shift.T)


@dataclass(frozen=True)
class BudgetItem:
    """One line of a budget: a source, its u, and the share of each parameter's variance that it causes.

    ``redrawn`` as in `TypeB`.
    """

    source: str
    type: str
    u: float
    unit: str
    share: Mapping[str, float]
    redrawn: bool = False


class Uncertainty(NamedTuple):
    """Uncertainty of p parameters.

    ``covariance`` (p, p), degrees of freedom ``dof`` (p,), one item of the ``budget`` for each source, and of the
    covariance the part ``common`` (p, p) that is one and the same error in repeat runs; None where it is not told
    apart.
    """

    covariance: Array
    dof: Array
    budget: tuple[BudgetItem, ...] = ()
    common: Array | None = None

    @property
    def u(self) -> Array:
        """Standard uncertainties (p,); 0 for a variance that rounding made negative."""
        return np.sqrt(np.maximum(np.diag(self.covariance), 0.0))


def combine(names: Sequence[str], sources: Sequence[TypeA | TypeB]) -> Uncertainty:
    """Add up independent sources.

    The degrees of freedom are the effective ones of each parameter (Welch-Satterthwaite, GUM G.4), at least 1, and inf
    without type A. The budget is in the order of the sources; a parameter to which a source adds nothing has no share
    there. Repeat runs share the sources of type B that are not ``redrawn``.
    """
    p = len(names)
    total, common = np.zeros((p, p)), np.zeros((p, p))
    for source in sources:
        total += source.covariance
        if isinstance(source, TypeB) and not source.redrawn:
            common += source.covariance
    variance = np.diag(total)
    weight = np.zeros(p)
    with np.errstate(divide="ignore", invalid="ignore"):
        for source in sources:
            if isinstance(source, TypeA) and np.isfinite(source.dof):
                weight += np.square(np.diag(source.covariance) / variance) / source.dof
        dof = np.where(weight > 0, np.maximum(1.0 / weight, 1.0), np.inf)
    return Uncertainty(total, dof, tuple(_item(names, source, variance) for source in sources), common)


def _item(names: Sequence[str], source: TypeA | TypeB, variance: Array) -> BudgetItem:
    """A source's line of the budget."""
    own = np.diag(source.covariance)
    share = {
        name: float(part / whole)
        for name, part, whole in zip(names, own, variance, strict=True)
        if part > 0 and whole > 0
    }
    if isinstance(source, TypeA):
        return BudgetItem(source.source, "A", source.u, source.unit, share)
    return BudgetItem(source.source, "B", source.u, source.unit, share, source.redrawn)
