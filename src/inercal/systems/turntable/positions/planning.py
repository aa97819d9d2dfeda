"""Choosing the positions of a test: optimal plans beside the named ones, judged with and without table errors."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.computing.executors import Executor
from inercal.foundation.designs.criteria import (
    Candidates,
    Criterion,
    D,
    PlanFigures,
    a_criterion,
    i_criterion,
    insensitive,
    judge,
)
from inercal.foundation.designs.exchange import exchange
from inercal.foundation.designs.search import Designed
from inercal.foundation.errors import StudyError
from inercal.foundation.findings import Finding
from inercal.foundation.inference.questions import CELLS
from inercal.foundation.results.budget import combine
from inercal.foundation.rigs.outputs import table_outputs
from inercal.foundation.rigs.plans import Plan, named, within
from inercal.foundation.units import Unit
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.model import TableModel, channels_of, orthonormal, stated_values, table_model
from inercal.systems.turntable.positions.fit import choose_terms, earth_rate_of, rate_terms, stated_noise
from inercal.systems.turntable.positions.judged import planned_blindness
from inercal.systems.turntable.positions.outcome import sources, terms_of, unit_of_term
from inercal.systems.turntable.positions.tolerance import drift_shares, sphere_rows
from inercal.systems.turntable.regression import fit, full_inputs, identify_channels, worst_rank
from inercal.systems.turntable.settings import TurntableSettings
from inercal.systems.turntable.weights import least_noise, weights

REFERENCES = (
    "R. D. Cook, C. J. Nachtsheim, A comparison of algorithms for constructing exact D-optimal designs, Technometrics "
    "22 (1980) 315-324",
)
"""Publications behind the choice of positions."""


@dataclass(frozen=True, eq=False)
class JudgedPlan:
    """A plan and its figures of merit.

    ``figures`` with rank and null vectors of one channel; ``terms`` of it; ``model`` with the terms that ``figures.u``
    is of; ``drift_shares`` of the table's errors, as in `inercal.systems.turntable.positions.tolerance.drift_shares`;
    ``blind``: the share of the faults by order, place, reading and history that would shift a value by 2 u unseen.
    """

    plan: Plan
    figures: PlanFigures
    terms: int
    model: TableModel
    drift_shares: Mapping[str, float]
    blind: Mapping[str, float]

    @property
    def names(self) -> tuple[str, ...]:
        """Terms (p,) of ``figures.u``, without those of the earth rate where that is stated."""
        return self.model.symbols

    @property
    def earth_rate(self) -> str:
        """``fitted``, or ``stated`` where the plan does not identify the terms of the earth rate."""
        return earth_rate_of(self.model)


@short_repr
@dataclass(frozen=True, eq=False)
class DesignedPositions(Designed[JudgedPlan]):
    """Positions that were searched for, u in SI; SI ``units`` of each coefficient, and the ``unit`` of the outputs for
    people; ``result`` is the command's part of the JSON result."""

    units: Mapping[str, str]
    unit: Unit
    result: dict[str, Any]

    def table(self) -> str:
        """The positions chosen and the comparison, as aligned text."""
        positions = [
            f"{k:4d}  " + "  ".join(f"{angle:8.1f}" for angle in row)
            for k, row in enumerate(np.degrees(self.plan.angles), start=1)
        ]
        joints = self.plan.angles.shape[1]
        head = "   #  " + "  ".join(f"{f'phi{j} [deg]':>8}" for j in range(1, joints + 1))
        return "\n".join([head, *positions, "", *_comparison(self)])


def design(
    settings: TurntableSettings,
    progress: Callable[[str], None] = lambda _: None,
    executor: Executor | None = None,
) -> DesignedPositions:
    """Search for positions, and set the best beside other plans.

    Parameters
    ----------
    settings : TurntableSettings
        The instrument with its expected coefficients and noise; the effect of the table's errors depends on them.
    progress : callable
        Takes the progress in words.
    executor : Executor, optional
        Place in which the random starts are computed.

    Raises
    ------
    InputError
        No noise is stated, or no choice among the candidates that the limits leave identifies the terms.
    """
    asked = settings.design
    stated_noise(settings)
    model, c, findings = expected_model(settings)
    everywhere = candidates_of(model, asked.candidates.angles, c, settings, asked.table_errors)
    mask = within(asked.candidates.angles, [settings.limits.get(joint) for joint in model.chain.joints])
    of_noise = candidates_of(model, asked.candidates.angles, c, settings, False)
    plans = []
    searched = (
        f"{asked.criterion}-optimal, {'table errors and noise' if asked.table_errors else 'noise alone'}"
    )

    def search(name: str, candidates: Candidates, criterion: Criterion, allowed: NDArray[np.bool_]) -> None:
        progress(f"searching {asked.positions} positions: {name}")
        rng = np.random.default_rng(asked.seed)
        choice = exchange(candidates, asked.positions, criterion, rng, allowed=allowed, executor=executor)
        plans.append(Plan(name, asked.candidates.angles[choice.chosen]))

    criterion = _criterion(asked.criterion, model)
    if asked.constraint is not None:
        progress("computing the indices of the candidates")
        allowed = of_low_sensitivity(settings, everywhere, mask)
        search(f"{searched}, S below {asked.constraint.below:g}", everywhere, criterion, allowed)
    search(searched, everywhere, criterion, mask)
    if asked.table_errors or asked.criterion != "D":
        search("D-optimal, noise alone", of_noise, D, mask)
    if len(settings.plan) != len(asked.candidates):
        plans.append(settings.plan)
    plans += [named(name) for name in asked.compare if name != settings.plan.name]
    judged = tuple(_judged(plan, settings, model) for plan in plans)
    findings += _of_site(judged[0], settings)
    unit = settings.instrument.unit.si
    return DesignedPositions(
        compare=judged,
        units={symbol: unit_of_term(symbol, unit) for symbol in model.symbols},
        unit=settings.instrument.unit,
        message=f"{asked.positions} of {int(mask.sum())} candidates, {plans[0].name}",
        findings=tuple(findings),
        result={"positions": plans[0].angles.tolist()}
        | _entry(judged[0])
        | {
            "compare": [
                {"name": each.plan.name, "positions": len(each.plan)} | _entry(each) for each in judged
            ]
        },
    )


def _judged(plan: Plan, settings: TurntableSettings, model: TableModel) -> JudgedPlan:
    """Figures of a plan, with table errors; the earth rate as `calibrate` would treat it there."""
    channels = channels_of(settings)
    whole = (
        identify_channels(table_model(settings, channels), plan.angles)
        if rate_terms(model)
        else identify_channels(model, plan.angles)
    )
    used, seen, _ = choose_terms(settings, channels, plan.angles)
    c, (rank, terms) = expected_coefficients(settings, used), worst_rank(whole)
    figures = _figures(plan, settings, used)
    shares: Mapping[str, float] = {}
    hides: Mapping[str, float] = {}
    if not any(each.words for each in seen):
        noise, samples = [settings.instrument.noise] * len(channels), samples_of(settings, plan.angles)
        y = used.outputs(plan.angles, c)
        found = fit(used, plan.angles, y, noise, start=c, samples=samples)
        shares = drift_shares(found)
        of_found = terms_of(found)
        u = combine(used.symbols, sources(found, of_found, settings.instrument.unit.si)).u
        hides = planned_blindness(found, of_found.slope, u, of_found.values)
    return JudgedPlan(
        plan,
        replace(
            figures,
            rank=rank,
            unidentified=tuple(words for each in whole for words in each.words),
        ),
        terms,
        used,
        shares,
        hides,
    )


def _figures(plan: Plan, settings: TurntableSettings, used: TableModel) -> PlanFigures:
    """Figures of a plan for the terms ``used``, with table errors."""
    candidates = candidates_of(used, plan.angles, expected_coefficients(settings, used), settings, True)
    prediction = i_criterion(sphere_rows(used) / np.sqrt(len(used.channels)))
    return judge(plan.name, candidates, orthonormal(used, plan.angles), prediction)


def _of_site(judged: JudgedPlan, settings: TurntableSettings) -> list[Finding]:
    """A remark where it is the site, not the table or the noise, that rules what a plan is worth."""
    acting, _ = judged.model.beside(judged.plan.angles, expected_coefficients(settings, judged.model))
    rms = judged.figures.rms_prediction
    best = _figures(judged.plan, settings, replace(judged.model, references=())).rms_prediction
    if not LIMITS.site_ratio * best < rms < math.inf:
        return []
    unit = settings.instrument.unit
    text = (
        f"what [site] states is so uncertain ({', '.join(each.source for each in acting if not each.term)}) that the "
        f"rms u of the output is {rms / unit.factor:.3g} {unit.symbol}; with an exact site it would be "
        f"{best / unit.factor:.3g} {unit.symbol}: state the site better"
    )
    return [Finding("uncertain_site", text, "", ())]


def expected_model(settings: TurntableSettings) -> tuple[TableModel, Array, list[Finding]]:
    """The terms that are to be identified, their expected linear coefficients, and remarks."""
    model, what, free = choose_terms(settings, channels_of(settings), settings.design.candidates.angles)
    findings: list[Finding] = []
    if free:
        text = f"no choice of positions identifies the terms of the earth rate ({free} is free): they are as stated"
        findings.append(Finding("stated_earth_rate", text))
    lost = [words for each in what for words in each.words]
    if lost:
        raise StudyError(
            "design",
            f"no choice among the {len(settings.design.candidates)} candidates identifies {'; '.join(lost)}, expected "
            "more candidates or fewer terms",
        )
    if settings.design.table_errors and not settings.instrument.coefficients:
        text = (
            "what the table's errors do to readings cannot be foreseen without coefficients of the instrument"
        )
        action = "state those expected under [instrument.coefficients]"
        findings.append(Finding("no_coefficients", text, action=action))
    return model, expected_coefficients(settings, model), findings


def expected_coefficients(settings: TurntableSettings, model: TableModel) -> Array:
    """Linear coefficients (p,) that the study expects of the instrument."""
    return np.concatenate([channel.linear(stated_values(settings, channel)) for channel in model.channels])


def samples_of(settings: TurntableSettings, angles: Array) -> NDArray[np.int64]:
    """Rows (n,) behind each reading."""
    return np.full(len(angles), settings.instrument.samples)


def candidates_of(
    model: TableModel, angles: Array, c: Array, settings: TurntableSettings, table_errors: bool
) -> Candidates:
    """Candidates with their regressors and covariances, with the table's errors or without."""
    noise = np.full(len(model.channels), settings.instrument.noise)
    std = None if table_errors else np.zeros(len(model.chain.errors))
    table = weights(model, angles, c, np.zeros_like(noise), std, samples_of(settings, angles))
    within = table.within + np.diag(np.square(np.maximum(noise, least_noise(table.within))))
    return Candidates(model.symbols, model.rows(angles), within, table.common if table_errors else None)


def _criterion(name: str, model: TableModel) -> Criterion:
    """D, or A of the outputs that the terms cause at full input, or I over the sphere."""
    if name == "D":
        return D
    if name == "A":
        return a_criterion(
            np.diag(np.concatenate([full_inputs(model, channel) for channel in model.channels]))
        )
    return i_criterion(sphere_rows(model))


def of_low_sensitivity(
    settings: TurntableSettings, candidates: Candidates, mask: NDArray[np.bool_]
) -> NDArray[np.bool_]:
    """Candidates (m,) of the ``mask`` (m,) that the constraint of the study leaves; raises `InputError` where these are
    too few."""
    asked = settings.design
    assert asked.constraint is not None
    indices = np.where(mask, _largest_index(settings), np.nan)
    return np.asarray(mask & insensitive(candidates, indices, asked.constraint.below, asked.positions))


def _largest_index(settings: TurntableSettings) -> Array:
    """Largest first-order index (m,) of the constrained factors on the constrained outputs."""
    from inercal.foundation.sensitivities import exact

    constraint, site = settings.design.constraint, settings.site
    assert constraint is not None
    outputs = table_outputs(constraint.outputs, site.gravity, site.latitude)
    indices = exact.analyse(settings.chain, outputs, settings.design.candidates.angles)
    factors = [indices.factors.index(name) for name in constraint.factors]
    # an output without variance there is touched by no factor
    return np.asarray(np.nan_to_num(indices.first[..., factors]).max(axis=(0, 2)))


def _entry(judged: JudgedPlan) -> dict[str, Any]:
    """Figures of a plan for JSON; what it does not identify has no number."""
    figures = judged.figures
    return {
        "rank": figures.rank,
        "terms": judged.terms,
        "null_vectors": list(figures.unidentified),
        "earth_rate": judged.earth_rate,
        "condition": figures.condition,
        "d_efficiency": figures.d_efficiency,
        "rms_prediction": figures.rms_prediction,
        "predicted": dict(zip(judged.names, figures.u.tolist(), strict=True)),
        "drift_shares": dict(judged.drift_shares),
        "blind": dict(judged.blind),
    }


def _comparison(designed: DesignedPositions) -> list[str]:
    """Lines of the comparison table."""
    wide = max(len(each.plan.name) for each in designed.compare)
    unit = designed.unit
    lines = [
        f"{'plan':<{wide}}  positions     rank  condition  D-efficiency  earth rate  rms u of output [{unit.symbol}]"
    ]
    for each in designed.compare:
        figures = each.figures
        rank = f"{figures.rank}/{each.terms}"
        condition = f"{figures.condition:9.2f}" if np.isfinite(figures.condition) else "        –"
        rms = f"{figures.rms_prediction / unit.factor:.4g}" if np.isfinite(figures.rms_prediction) else "–"
        lines.append(
            f"{each.plan.name:<{wide}}  {len(each.plan):9d}  {rank:>7}  {condition}  {figures.d_efficiency:12.4f}  "
            f"{each.earth_rate:>10}  {rms}"
        )
    lines += ["", "faults that would shift a value by 2 u unseen, by:"]
    lines.append(f"{'plan':<{wide}}  {'order':>8}  {'place':>8}  {'reading':>8}  {'history':>8}")
    for plan in designed.compare:
        hides = (f"{100.0 * plan.blind[cell]:6.0f} %" if cell in plan.blind else "–" for cell in CELLS)
        lines.append(f"{plan.plan.name:<{wide}}  " + "  ".join(f"{text:>8}" for text in hides))
    if len({each.earth_rate for each in designed.compare}) > 1:
        lines.append(
            "where the earth rate is stated, its terms are taken as known: fewer coefficients to share the readings"
        )
    return lines
