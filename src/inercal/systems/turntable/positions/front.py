"""The front of a test on a table: number of positions, u of the drift, and cost of the tolerances, none of which gets
better without another getting worse.

For some numbers of positions those are searched for that predict the drift best, with the table as it is; with each the
cheapest tolerances are found for some wanted u. The constraint of Zhao et al. 2023, positions of low sensitivity, is
set beside where the study states it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.designs.tolerances import cheapest, total
from inercal.foundation.errors import InputError, StudyError
from inercal.foundation.findings import Finding
from inercal.foundation.rigs.plans import Plan, within
from inercal.systems.turntable.model import TableModel
from inercal.systems.turntable.positions.planning import candidates_of, of_low_sensitivity
from inercal.systems.turntable.positions.tolerance_design import model_with_tolerances, searched, trial
from inercal.systems.turntable.settings import DRIFT, TurntableSettings

_NUMBERS = (0.5, 0.75, 1.0, 1.5, 2.0)
"""Numbers of positions, over that of the study."""

_LEVELS = (0.25, 0.35, 0.5, 0.7, 1.0, 1.4)
"""Wanted u of the drift, over that of the study's number of positions with the table as it is."""


@dataclass(frozen=True, eq=False)
class FrontPoint:
    """A test: its ``plan``, ``constrained`` to positions of low sensitivity or not; the u of the ``drift`` [SI], rms
    over all directions of gravity, at the ``cost`` of tolerances that are ``x`` (k,) times the present ones; ``best``
    where no other of its kind is at least as good in all three."""

    plan: Plan
    constrained: bool
    drift: float
    cost: float
    x: Array
    best: bool = False

    def beats(self, other: FrontPoint) -> bool:
        """True where it is nowhere worse than ``other``, and somewhere better."""
        mine, its = (
            (len(point.plan), point.drift, point.cost * (1.0 - 1e-9 * (point is self)))
            for point in (self, other)
        )
        return all(a <= b for a, b in zip(mine, its, strict=True)) and mine != its


@dataclass(frozen=True, eq=False)
class Front:
    """The ``points`` that were tried, by number of positions and u; ``result`` is the command's part of the JSON."""

    points: tuple[FrontPoint, ...]
    message: str
    findings: tuple[Finding, ...]
    result: dict[str, Any]


def front(settings: TurntableSettings, progress: Callable[[str], None] = lambda _: None) -> Front:
    """The tests among which a laboratory has to choose.

    Raises
    ------
    StudyError
        No noise or errors of the table are stated, or no number of positions identifies the coefficients.
    """
    model, findings = model_with_tolerances(settings)
    points: list[FrontPoint] = []
    usual = math.nan
    numbers = sorted({max(len(model.symbols), round(part * settings.design.positions)) for part in _NUMBERS})
    # the study's own first, whose u sets the levels
    numbers.sort(key=lambda number: number != settings.design.positions)
    for constrained in (False, True) if settings.design.constraint is not None else (False,):
        for number in numbers:
            progress(f"{number} positions{', of low sensitivity' if constrained else ''}")
            plan = _plan(settings, model, number, constrained)
            test = None if plan is None else trial(plan, settings, model, {DRIFT: 1.0})
            if plan is None or test is None:
                continue
            present = np.ones(len(settings.chain.factors))
            u = math.sqrt(float(test.ratios(present).at(present)[0]))
            usual = u if math.isnan(usual) else usual
            prices = tuple(settings.tolerances.prices[name] for name in settings.chain.factors)
            for level in _LEVELS:
                goal = level * usual
                wanted = replace(test, wanted=tuple(row / goal for row in test.wanted))
                x = cheapest(prices, wanted.ratios)
                if x is not None:
                    points.append(FrontPoint(plan, constrained, goal, total(prices, x), x))
    if not points:
        raise StudyError(
            "design.positions", "found none that identify all coefficients, expected more positions"
        )
    if settings.design.constraint is not None and not any(point.constrained for point in points):
        below = settings.design.constraint.below
        text = f"found {below:g}, which leaves too few positions, expected more"
        raise StudyError("design.sensitivity.below", text)
    kept = tuple(
        replace(
            point,
            best=not any(other.beats(point) for other in points if other.constrained == point.constrained),
        )
        for point in sorted(points, key=lambda of: (of.constrained, len(of.plan), -of.drift))
    )
    best = sum(point.best for point in kept)
    message = (
        f"{best} of {len(kept)} tests are on the front of positions, u of the drift and cost of tolerances"
    )
    return Front(kept, message, tuple(findings), {"front": [_row(point, settings) for point in kept]})


def _plan(settings: TurntableSettings, model: TableModel, number: int, constrained: bool) -> Plan | None:
    """The positions that predict the drift best; None where too few are allowed."""
    asked = replace(
        settings,
        design=replace(settings.design, positions=number),
        tolerances=replace(settings.tolerances, goal={DRIFT: 1.0}),
    )
    allowed = None
    if constrained:
        try:
            allowed = _insensitive(asked, model)
        except InputError:
            return None
    return searched(asked, model, np.ones(len(settings.chain.factors)), allowed)


def _insensitive(settings: TurntableSettings, model: TableModel) -> NDArray[np.bool_]:
    """Candidates (m,) that limits and constraint of the study leave."""
    angles = settings.design.candidates.angles
    mask = within(angles, [settings.limits.get(joint) for joint in model.chain.joints])
    candidates = candidates_of(model, angles, np.zeros(len(model.symbols)), settings, False)
    return of_low_sensitivity(settings, candidates, mask)


def _row(point: FrontPoint, settings: TurntableSettings) -> dict[str, Any]:
    """A point for JSON, in SI."""
    return {
        "positions": len(point.plan),
        "low_sensitivity": point.constrained,
        "drift": point.drift,
        "cost": point.cost,
        "best": point.best,
        "tolerances": dict(zip(settings.chain.factors, point.x.tolist(), strict=True)),
        "angles": point.plan.angles.tolist(),
    }
