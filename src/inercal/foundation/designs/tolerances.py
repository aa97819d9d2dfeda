"""Cheapest tolerances that reach wanted uncertainties.

Tolerances are factors x (k,) on the present sizes of the errors. The variance of wanted quantity g, over the square of
its goal, is ``r_g = F_g + sum_k S_gk x_k^2`` for a given estimator. Least squares weighted for x is the best of them,
so that its F and S, kept for other tolerances, state too much there and never too little; and by the envelope theorem
its S are the derivatives of r by x^2. An error costs ``c x^-p``, or what a table says of the sizes there are.

With powers alone the problem is nearly a geometric program, smooth and convex in log x (Boyd et al. 2007, "A tutorial
on geometric programming"), and solved as such (SLSQP). With tables, each round chooses among the sizes
for given F and S by branch and bound, and ends at a cost that is lower, or stays.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeAlias

import numpy as np

from inercal.foundation.arrays import Array

TIGHTEST, LOOSEST = 1e-3, 10.0
"""Factors between which tolerances are searched for."""

STEPS = 41
"""Steps between these that stand for an error without a table, where others have one."""

GAP = 1e-6
"""Relative saving below which a choice from tables is no better than another."""

ROUNDS = 12
"""Rounds with tables; three or four do."""


@dataclass(frozen=True)
class Price:
    """The cost of a tolerance: ``cost x^-exponent``, or ``levels`` of (x, cost), tightest first, and no others."""

    cost: float = 1.0
    exponent: float = 1.0
    levels: tuple[tuple[float, float], ...] = ()

    def at(self, x: float) -> float:
        """The cost at a factor; with levels, that of the nearest one."""
        if self.levels:
            return min(self.levels, key=lambda level: abs(np.log(level[0] / x)))[1]
        return float(self.cost * x**-self.exponent)

    @property
    def ends(self) -> tuple[float, float]:
        """The tightest and the loosest factor."""
        return (self.levels[0][0], self.levels[-1][0]) if self.levels else (TIGHTEST, LOOSEST)

    def not_above(self, x: float) -> float:
        """The loosest factor that is not above x; the tightest where all are."""
        low, high = self.ends
        if not self.levels:
            return float(np.clip(x, low, high))
        return max((level for level, _ in self.levels if level <= x * (1.0 + 1e-12)), default=low)


class Ratios(NamedTuple):
    """Variances over squared goals: ``fixed`` (g,) beside the errors, ``by_error`` (g, k) of each as it is now."""

    fixed: Array
    by_error: Array

    def at(self, x: Array) -> Array:
        """(g,) for factors x (k,), with the same estimator."""
        return self.fixed + self.by_error @ np.square(x)


Model: TypeAlias = Callable[[Array], Ratios]
"""The ratios of the estimator that is best at factors x (k,)."""


def total(prices: Sequence[Price], x: Array) -> float:
    """Cost of all tolerances."""
    return float(sum(price.at(float(each)) for price, each in zip(prices, x, strict=True)))


def tightest(prices: Sequence[Price]) -> Array:
    """The tightest factors (k,) that can be had."""
    return np.array([price.ends[0] for price in prices])


def cheapest(prices: Sequence[Price], model: Model) -> Array | None:
    """Factors (k,) of least cost at which no ratio is above one; None where the tightest do not reach that."""

    def worst(x: Array) -> float:
        return float(model(x).at(x).max(initial=0.0))

    if worst(tightest(prices)) > 1.0:
        return None
    x = _even(prices, worst)
    free = np.array([not price.levels for price in prices])
    if free.all():
        return _smooth(prices, model, x, free)
    best = x
    for _ in range(ROUNDS):
        x = _smooth(prices, model, _chosen(prices, model(best), best), free)
        if total(prices, x) > total(prices, best) * (1.0 - 1e-9):
            break
        best = x
    return best


def _even(prices: Sequence[Price], worst: Callable[[Array], float]) -> Array:
    """Factors all the same, as far as tables allow, that just reach the goals."""

    def at(log: float) -> Array:
        return np.array([price.not_above(float(np.exp(log))) for price in prices])

    least = min(price.ends[0] for price in prices)
    low, high = np.log(least), np.log(max(price.ends[1] for price in prices))
    if worst(at(high)) <= 1.0:
        return at(high)
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if worst(at(middle)) <= 1.0 else (low, middle)
    return at(low)


def _smooth(prices: Sequence[Price], model: Model, x: Array, free: Array) -> Array:
    """The cheapest factors of the ``free`` errors, the others as they are, from a start x that reaches the goals."""
    from scipy.optimize import minimize

    if not free.any():
        return x
    c, p = (np.array([getattr(price, key) for price in prices])[free] for key in ("cost", "exponent"))
    last: dict[bytes, Ratios] = {}

    def whole(y: Array) -> Array:
        made = x.copy()
        made[free] = np.exp(y)
        return made

    def ratios(y: Array) -> Ratios:
        key = y.tobytes()
        if key not in last:
            last.clear()
            last[key] = model(whole(y))
        return last[key]

    def reach(y: Array) -> Array:
        return -np.log(ratios(y).at(whole(y)))

    def reach_slope(y: Array) -> Array:
        now, at = ratios(y), whole(y)
        return -2.0 * (now.by_error * np.square(at))[:, free] / now.at(at)[:, None]

    def cost(y: Array) -> float:
        return float(np.log(np.sum(c * np.exp(-p * y))))

    def cost_slope(y: Array) -> Array:
        each = c * np.exp(-p * y)
        return np.asarray(-p * each / each.sum())

    begin = np.log(x[free])
    reached: Any = {"type": "ineq", "fun": reach, "jac": reach_slope}
    done = minimize(
        cost,
        begin,
        jac=cost_slope,
        method="SLSQP",
        bounds=[(np.log(TIGHTEST), np.log(LOOSEST))] * len(begin),
        constraints=reached,
        options={"maxiter": 300, "ftol": 1e-12},
    )
    y = _back(np.asarray(done.x, dtype=float), begin, lambda each: bool(reach(each).min() >= -1e-9))
    return whole(y) if cost(y) < cost(begin) else x


def _back(y: Array, begin: Array, reached: Callable[[Array], bool]) -> Array:
    """The point nearest ``y``, on the way from a start that reaches the goals, that reaches them too."""
    if reached(y):
        return y
    low, high = 0.0, 1.0
    for _ in range(40):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if reached(begin + middle * (y - begin)) else (low, middle)
    return begin + low * (y - begin)


def _chosen(prices: Sequence[Price], ratios: Ratios, x: Array) -> Array:
    """The cheapest choice from tables, and from steps of the others, for given ratios; ``x`` reaches the goals."""
    steps = np.geomspace(TIGHTEST, LOOSEST, STEPS)
    factors = [
        np.array([level for level, _ in price.levels]) if price.levels else np.append(steps, own)
        for price, own in zip(prices, x, strict=True)
    ]
    costs = [
        np.array([price.at(float(each)) for each in own]) for price, own in zip(prices, factors, strict=True)
    ]
    variances = [ratios.by_error[:, [k]] * np.square(own) for k, own in enumerate(factors)]  # (g, levels)
    room = (1.0 - ratios.fixed) * (1.0 - 1e-12)
    begin = [int(np.argmin(np.abs(own - now))) for own, now in zip(factors, x, strict=True)]
    taken = _branched(costs, variances, room, begin)
    return np.array([own[k] for own, k in zip(factors, taken, strict=True)])


def _branched(
    costs: Sequence[Array], variances: Sequence[Array], room: Array, begin: Sequence[int]
) -> list[int]:
    """Levels of least cost whose variances (g, levels) sum up within ``room`` (g,), by branch and bound.

    The bound is that of Lagrange: with the multipliers of the relaxed problem every error by itself.
    """
    from scipy.optimize import linprog

    of_error = np.repeat(np.arange(len(costs)), [len(own) for own in costs])
    relaxed = linprog(
        np.concatenate(costs),
        A_ub=np.hstack(variances),
        b_ub=room,
        A_eq=(np.arange(len(costs))[:, None] == of_error).astype(float),
        b_eq=np.ones(len(costs)),
    )
    multipliers = -np.asarray(relaxed.ineqlin.marginals) if relaxed.status == 0 else np.zeros(len(room))
    whole = [own + multipliers @ each for own, each in zip(costs, variances, strict=True)]
    rest_cost = np.append(np.cumsum([own.min() for own in costs][::-1])[::-1], 0.0)
    rest_whole = np.append(np.cumsum([own.min() for own in whole][::-1])[::-1], 0.0) - multipliers @ room
    rest_variance = np.vstack(
        [np.cumsum([each.min(axis=1) for each in variances][::-1], axis=0)[::-1], 0.0 * room]
    )
    best, chosen, taken = (
        sum(float(own[k]) for own, k in zip(costs, begin, strict=True)),
        list(begin),
        [0] * len(costs),
    )

    def descend(k: int, cost: float, with_room: float, variance: Array) -> None:
        nonlocal best, chosen
        if k == len(costs):
            best, chosen = cost, list(taken)
            return
        for level in np.argsort(whole[k], kind="stable").tolist():
            if with_room + whole[k][level] + rest_whole[k + 1] >= best * (1.0 - GAP):
                break
            spent, used = cost + float(costs[k][level]), variance + variances[k][:, level]
            if spent + rest_cost[k + 1] < best * (1.0 - GAP) and np.all(used + rest_variance[k + 1] <= room):
                taken[k] = level
                descend(k + 1, spent, with_room + float(whole[k][level]), used)

    descend(0, 0.0, 0.0, 0.0 * room)
    return chosen
