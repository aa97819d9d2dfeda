"""Tolerances from a goal: the cheapest table and plan that reach the wanted uncertainties.

The variance of a wanted quantity is the sum of what noise, the site and each error of the table put into it, of which
the last go with the squares of the tolerances (`inercal.foundation.designs.tolerances`). Plans that compete are the
study's, the named ones, and one searched for these goals; each may be taken more than once where positions have a
price.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.designs.criteria import a_criterion
from inercal.foundation.designs.exchange import exchange
from inercal.foundation.designs.tolerances import Price, Ratios, cheapest, tightest, total
from inercal.foundation.errors import InputError, StudyError
from inercal.foundation.findings import Finding
from inercal.foundation.rigs.plans import Plan, named, within
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.model import TableModel, channels_of
from inercal.systems.turntable.positions.fit import choose_terms, stated_noise
from inercal.systems.turntable.positions.planning import (
    candidates_of,
    expected_coefficients,
    expected_model,
    samples_of,
)
from inercal.systems.turntable.positions.tolerance import sphere_rows
from inercal.systems.turntable.regression import solve
from inercal.systems.turntable.settings import DRIFT, TurntableSettings
from inercal.systems.turntable.weights import Samples, averaged, beside_inputs, least_noise, weights_of

REFERENCES = (
    "S. Boyd, S.-J. Kim, L. Vandenberghe, A. Hassibi, A tutorial on geometric programming, Optimization and "
    "Engineering 8 (2007) 67-127",
)


@dataclass(frozen=True, eq=False)
class Trial:
    """A plan that may be taken: its readings, and what errors and inputs do to them.

    ``rows``, ``slopes`` and ``samples`` as in `inercal.systems.turntable.regression.Regression`; ``beside`` (n, c, b)
    of the ``inputs`` beside the table. ``wanted`` rows T (r, p) by goal, over the goal: ``trace(T C T^T)`` is its
    ratio.
    """

    plan: Plan
    repeats: int
    model: TableModel
    rows: Array
    slopes: Array
    inputs: tuple[str, ...]
    beside: Array
    samples: Samples
    noise: Array
    wanted: tuple[Array, ...]

    @property
    def positions(self) -> int:
        """Positions taken, repeats counted."""
        return len(self.plan) * self.repeats

    @property
    def angles(self) -> Array:
        """Joint angles (n, joints) [rad] of the positions, repeats among them."""
        return np.tile(self.plan.angles, (self.repeats, 1))

    def parts(self, x: Array) -> tuple[Array, Array, Array]:
        """Ratios to the goals by noise (g,), by inputs beside the table (g, b), by errors at their present size (g, k).

        Of least squares weighted for factors ``x`` (k,) of the tolerances.
        """
        chain = self.model.chain
        none = np.zeros_like(self.noise)
        table = weights_of(chain, self.slopes, self.angles, self.beside, none, self.samples, chain.std * x)
        noise = np.maximum(self.noise, least_noise(table.within))
        weight = replace(table, within=table.within + np.diag(np.square(noise)))
        gain = solve(self.rows, np.zeros(self.rows.shape[:2]), weight).gain
        moved = averaged(chain, self.slopes, self.samples) * chain.std
        # positions of one value move together: 1 where position n has the value v of an error
        values = [np.eye(numbers.max() + 1)[:, numbers] for numbers in chain.groups(self.angles)]
        by_noise, by_input, by_error = [], [], []
        for wanted in self.wanted:
            own = np.einsum("rp,pnc->rnc", wanted, gain)
            by_noise.append(np.square(own * noise).sum())
            by_input.append(np.square(np.einsum("rnc,ncb->rb", own, self.beside)).sum(axis=0))
            each = np.einsum("rnc,nck->knr", own, moved)
            by_error.append([np.square(value @ one).sum() for value, one in zip(values, each, strict=True)])
        return np.array(by_noise), np.array(by_input), np.array(by_error)

    def ratios(self, x: Array) -> Ratios:
        """Variances over squared goals."""
        noise, inputs, errors = self.parts(x)
        return Ratios(noise + inputs.sum(axis=1), errors)


@dataclass(frozen=True, eq=False)
class Bought:
    """Tolerances for one plan: factors ``x`` (k,) on the present ones, None where goals are not reached; the cost."""

    test: Trial
    x: Array | None
    cost: float


@dataclass(frozen=True, eq=False)
class ToleranceDesign:
    """The cheapest tolerances and plan.

    ``best`` among ``tried``, one for each plan (at its cheapest number of repeats); ``present_cost`` of the
    tolerances as they are.
    """

    best: Bought
    tried: tuple[Bought, ...]
    prices: tuple[Price, ...]
    goal: Mapping[str, float]
    present_cost: float
    findings: tuple[Finding, ...]

    @property
    def x(self) -> Array:
        """Factors (k,) of the best."""
        assert self.best.x is not None
        return self.best.x

    @property
    def message(self) -> str:
        """The result in a sentence."""
        test = self.best.test
        times = "" if test.repeats == 1 else f", taken {test.repeats} times"
        return (
            f"tolerances for {len(self.goal)} goals at a cost of {self.best.cost:.4g} (positions included; present "
            f"tolerances alone: {self.present_cost:.4g}), with {test.plan.name}{times}"
        )


def design_tolerances(
    settings: TurntableSettings, progress: Callable[[str], None] = lambda _: None
) -> ToleranceDesign:
    """The cheapest tolerances of the table, and the plan, that reach the goals of the study.

    Parameters
    ----------
    settings : TurntableSettings
        With goals; the instrument with its expected coefficients and noise.
    progress : callable
        Takes the progress in words.

    Raises
    ------
    StudyError
        No goals, noise or errors, a goal for a term that is not fitted, or one that no tolerance reaches.
    """
    goal, prices = settings.tolerances.goal, settings.tolerances.prices
    if not goal:
        raise StudyError("goal", 'missing, expected wanted uncertainties such as DX_F = "0.01 deg/h"')
    model, findings = model_with_tolerances(settings)
    for symbol in goal:
        if symbol != DRIFT and symbol not in model.symbols:
            raise StudyError(f"goal.{symbol}", "found a term that is not fitted, expected one that is")
    own = tuple(prices[name] for name in settings.chain.factors)
    tried: list[Bought] = []
    for plan in _plans(settings, model):
        test = trial(plan, settings, model, goal)
        if test is not None:
            progress(f"tolerances for {plan.name}")
            tried.append(_bought(test, settings, own))
    size = np.ones(len(own))
    for _ in range(2):  # for the tolerances as they are, then for those found
        progress(f"searching {settings.design.positions} positions")
        found = searched(settings, model, size)
        test = None if found is None else trial(found, settings, model, goal)
        if test is None:
            break
        tried.append(_bought(test, settings, own))
        if tried[-1].x is None:
            break
        size = tried[-1].x
    if not tried:
        raise StudyError("positions", f"no plan identifies all of {', '.join(model.symbols)}")
    best = min(tried, key=lambda each: (each.cost, each.test.positions))
    if best.x is None:
        raise _unreachable(tried, goal, own)
    return ToleranceDesign(best, tuple(tried), own, goal, total(own, size * 0.0 + 1.0), tuple(findings))


def model_with_tolerances(settings: TurntableSettings) -> tuple[TableModel, list[Finding]]:
    """The terms that are to be identified, with remarks; raises `StudyError` without noise or errors of the table."""
    stated_noise(settings)
    if not settings.chain.errors:
        raise StudyError(
            "rig.errors", 'found none, expected present tolerances such as default = { uniform = "2 arcmin" }'
        )
    model, _, findings = expected_model(settings)
    return model, findings


def _plans(settings: TurntableSettings, model: TableModel) -> list[Plan]:
    """The study's plan, unless it is a grid to be analysed, and the named ones."""
    own = [] if len(settings.plan) == len(settings.design.candidates) else [settings.plan]
    return own + [named(name) for name in settings.design.compare if name not in [plan.name for plan in own]]


def trial(
    plan: Plan,
    settings: TurntableSettings,
    model: TableModel,
    goal: Mapping[str, float],
    repeats: int = 1,
) -> Trial | None:
    """The plan as a test with that goal; None where it does not identify all terms of the model."""
    used, seen, _ = choose_terms(settings, channels_of(settings), plan.angles)
    if used.symbols != model.symbols or any(each.words for each in seen):
        return None
    angles = np.tile(plan.angles, (repeats, 1))
    c = expected_coefficients(settings, used)
    return Trial(
        plan,
        repeats,
        used,
        used.rows(angles),
        used.by_errors(angles, c),
        tuple(each.source for each in used.beside(angles, c)[0]),
        beside_inputs(used, angles, c),
        samples_of(settings, angles),
        np.full(len(used.channels), settings.instrument.noise),
        _wanted(used, c, goal),
    )


def _wanted(model: TableModel, c: Array, goal: Mapping[str, float]) -> tuple[Array, ...]:
    """Rows (r, p) by goal that make its ratio of the linear coefficients."""
    slope = np.zeros((len(c), len(c)))
    for channel, block in zip(model.channels, model.blocks, strict=True):
        slope[block, block] = channel.terms(c[block])[1]
    sphere = sphere_rows(model).reshape(-1, len(c)) / np.sqrt(len(sphere_rows(model)) * len(model.channels))
    # as many rows as coefficients make the same sum of squares
    root = np.asarray(np.linalg.qr(sphere, mode="r"), dtype=float)
    return tuple(
        (root if symbol == DRIFT else slope[[model.symbols.index(symbol)]]) / wanted
        for symbol, wanted in goal.items()
    )


def _bought(test: Trial, settings: TurntableSettings, prices: Sequence[Price]) -> Bought:
    """The cheapest tolerances for a plan, taken as often as pays."""
    each = settings.tolerances.position * len(test.plan)
    best, repeats = Bought(test, None, math.inf), 1
    while True:
        now = (
            test
            if repeats == 1
            else trial(test.plan, settings, test.model, settings.tolerances.goal, repeats)
        )
        assert now is not None
        x = cheapest(prices, now.ratios)
        cost = math.inf if x is None else total(prices, x) + each * repeats
        if cost < best.cost:
            best = Bought(now, x, cost)
        elif best.x is not None:
            return best
        repeats += 1
        if each == 0.0 or repeats > LIMITS.most_repeats:
            return best


def searched(
    settings: TurntableSettings, model: TableModel, x: Array, allowed: NDArray[np.bool_] | None = None
) -> Plan | None:
    """The positions that are best for the goals with tolerances of factors ``x`` (k,), of the candidates that are
    ``allowed`` (m,), by the limits of the joints if absent; None where these are too few."""
    asked, chain = settings.design, settings.chain
    changed = chain.with_errors(
        *(
            replace(error, distribution=error.distribution.scaled(float(by)))
            for error, by in zip(chain.errors, x, strict=True)
        )
    )
    c = expected_coefficients(settings, model)
    candidates = candidates_of(replace(model, chain=changed), asked.candidates.angles, c, settings, True)
    criterion = a_criterion(np.vstack(_wanted(model, c, settings.tolerances.goal)))
    mask = (
        within(asked.candidates.angles, [settings.limits.get(joint) for joint in chain.joints])
        if allowed is None
        else allowed
    )
    rng = np.random.default_rng(asked.seed)
    try:
        choice = exchange(candidates, asked.positions, criterion, rng, allowed=mask)
    except InputError:
        return None
    name = f"{asked.positions} positions searched for the goals"
    return Plan(name, asked.candidates.angles[choice.chosen])


def _unreachable(tried: Sequence[Bought], goal: Mapping[str, float], prices: Sequence[Price]) -> StudyError:
    """The goal that the tightest tolerances miss by most, and what bounds it, with the plan that comes closest."""
    x = tightest(prices)

    def parts(each: Bought) -> tuple[float, int, Array]:
        noise, inputs, errors = each.test.parts(x)
        columns = np.column_stack([noise, inputs, errors * np.square(x)])
        whole = columns.sum(axis=1)
        return float(whole.max()), int(whole.argmax()), columns[whole.argmax()]

    closest = min(tried, key=lambda each: parts(each)[0])
    worst, k, columns = parts(closest)
    symbol, test = list(goal)[k], closest.test
    sources = ["the noise of the readings", *test.inputs, *test.model.chain.factors]
    largest = int(columns.argmax())
    share = columns[largest] / columns.sum()
    return StudyError(
        f"goal.{symbol}",
        f"no tolerances reach it: the tightest leave {math.sqrt(worst):.3g} times the goal in "
        f"{test.positions} positions, {100.0 * share:.0f} % of the variance by {sources[largest]}",
    )
