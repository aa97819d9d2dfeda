"""Coefficients that a path cannot see: bounds against prior and goal, the worst combinations in words."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding, Status
from inercal.foundation.inference.identifiability import UNSEEN, Learned, learned
from inercal.foundation.results.remarks import ReachedGoal, at_prior, missed, reached
from inercal.foundation.results.shown import rounded
from inercal.systems.selfcal.before.bounds import PathBounds
from inercal.systems.selfcal.filters.filter_result import FilterResult
from inercal.systems.selfcal.platform.coefficients import shown_units
from inercal.systems.selfcal.platform.states import UNIT_OF


@dataclass(frozen=True, eq=False)
class Observability:
    """A path judged by its bounds, as ``learned`` against the prior and by each ``goal``."""

    bounds: PathBounds
    learned: Learned
    goal: Mapping[str, ReachedGoal]

    @property
    def to_goal(self) -> Mapping[str, float]:
        """u over the wanted u, by name."""
        return {name: goal["u"] / goal["wanted"] for name, goal in self.goal.items()}

    @property
    def rank(self) -> int:
        """Number of combinations of coefficients that the path sees."""
        return int(np.sum(self.learned.left <= UNSEEN))

    @property
    def at_prior(self) -> Mapping[str, float]:
        """Coefficients that the path leaves at their prior, and the part of it that is left."""
        return self.learned.at_prior()

    def findings(self) -> tuple[Finding, ...]:
        """A finding for each coefficient at its prior, or wider than wanted."""
        hints = {name: f"u = {size} {unit}" for name, size, unit in self._shown()}
        wide = {name: goal for name, goal in self.goal.items() if name not in self.at_prior}
        return (*at_prior(self.at_prior, hints), *missed(wide, UNIT_OF))

    def worst(self, count: int = 3) -> list[str]:
        """The worst-known combinations in words, with the share of its prior that is left of each."""
        weakest = zip(self.learned.weakest(count), self.learned.left, strict=False)
        return [f"{words}: {100 * left:.3g} %" for words, left in weakest]

    def table(self) -> str:
        """Bounds over prior and over goal, as aligned text."""
        lines = [f"{'':<7}  {'bound u':>9}  {'unit':<7} {'of prior':>9}  {'of goal':>8}"]
        for (name, u, unit), ratio in zip(self._shown(), self.learned.ratio, strict=True):
            goal = f"{self.to_goal[name]:8.3g}" if name in self.to_goal else "       –"
            lines.append(f"{name:<7}  {u:>9}  {unit:<7} {100 * ratio:7.3g} %  {goal}")
        return "\n".join(lines)

    def _shown(self) -> list[tuple[str, str, str]]:
        """Name, u and unit of each coefficient for people."""
        unit, size = shown_units(self.bounds.names)
        texts = (rounded(u, u)[1] for u in self.bounds.u / size)
        return list(zip(self.bounds.names, texts, unit, strict=True))


def observability(bounds: PathBounds, goal: Mapping[str, float]) -> Observability:
    """Judge a path; ``goal`` wanted standard uncertainty [SI] by name of coefficient."""
    goals = reached(bounds.names, bounds.u, goal)
    return Observability(bounds, learned(bounds.covariance, bounds.prior, bounds.names), goals)


def useless(filtered: FilterResult, bounds: PathBounds, by_filter: Array) -> tuple[Status, str] | None:
    """Status and sentence of numbers that must not be used, else None: ``by_filter`` (p, p), product form, and the
    bounds must be covariances."""
    if not filtered.converged:
        return Status.NOT_CONVERGED, filtered.message
    if not filtered.dims.any():
        return Status.UNOBSERVABLE, (
            "no row after the first has a measurement that is used: all are missing, or stopped by near-level gating"
        )
    return not_positive(bounds.prior, by_filter, bounds.covariance)


def not_positive(prior: Array, *covariances: Array) -> tuple[Status, str] | None:
    """Status and sentence where a covariance (p, p) over the ``prior`` (p,) is not positive within rounding."""
    scale = np.outer(prior, prior)
    if all(_positive(P / scale) for P in covariances):
        return None
    return Status.ILL_CONDITIONED, (
        "the covariance is numerically singular: noise and prior lie too many powers of ten apart for this path; "
        "check their units"
    )


def _positive(P: Array) -> bool:
    """True for a positive definite matrix."""
    try:
        return bool(np.isfinite(np.linalg.cholesky(P)).all())
    except np.linalg.LinAlgError:
        return False
