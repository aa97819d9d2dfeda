"""Errors of a recording that contradicts the model: all hypotheses asked in order, each named with its place.

Units, signs and order were seen roughly when the recording was read (`gross`). Then come gross faults of accelerometers
and rows (`rows`), judged by what the error-state filter makes of the recording without each, single rows last; constant
errors that the model leaves out (`small`); and the size and whiteness of the innovations (`noise_check`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.inference.asked_pass import answers
from inercal.foundation.inference.hypotheses import Hypothesis, likeliest, sigmas
from inercal.foundation.inference.identifiability import UNSEEN
from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.results.shown import rounded
from inercal.systems.selfcal.diagnosis.fit_quality import (
    JUDGE,
    Case,
    filtered,
    forget,
    once,
    sound,
    sum_of_squares,
    white,
)
from inercal.systems.selfcal.diagnosis.gross import reordered_accelerometers
from inercal.systems.selfcal.diagnosis.judged import explaining, speaking
from inercal.systems.selfcal.diagnosis.noise_check import misstated, unsteady
from inercal.systems.selfcal.diagnosis.passed import PlatformPass, pass_of, periodic
from inercal.systems.selfcal.diagnosis.rig_errors import WANDERING
from inercal.systems.selfcal.diagnosis.rows import faults_of_rows, single_readings
from inercal.systems.selfcal.diagnosis.small import Stated, likely, small_errors
from inercal.systems.selfcal.filters.filter_result import FilterResult
from inercal.systems.selfcal.filters.problem import FilterProblem
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.states import UNIT_OF

_BEYOND = ("unit_suspect", "channel_swap", "sign_suspect")
"""Findings of the reading of a recording that end its diagnosis."""


def diagnose(
    recording: Recording,
    problem: FilterProblem,
    result: FilterResult,
    systematic: Stated = None,
    passed: PlatformPass | None = None,
) -> list[Finding]:
    """Name what is wrong with a recording; nothing for a sound one, nor where its reading found units or axes wrong.

    ``result`` is that of the study's estimator, ``passed`` the pass at its values, made if absent; the error-state
    filter judges the recording itself. No error within the uncertainties of ``systematic`` inputs is named.
    """
    if any(finding.code in _BEYOND for finding in recording.findings) or not result.dims.any():
        return []
    if passed is None and result.kind == "error-state":
        passed = pass_of(recording, problem, result)
    try:
        if passed is None or result.kind != "error-state":
            return _diagnosed(recording, problem, result, systematic)
        sums = passed.with_stated(_moved(passed, systematic))
        hits, limit = answers(sums, passed.questions)
        said = explaining(sums, passed.z, hits, limit, passed.constants)
        if said is not None and _fair(problem, problem, result) is problem:
            return [said]
        if not sound(passed.final):
            return _diagnosed(recording, problem, result, systematic)
        findings = _judged(passed, systematic, bool(hits))
        if not hits or any(finding.code != "contradiction" for finding in findings):
            return findings
        said = speaking(sums, hits, limit, passed.constants)
        return findings if said is None or misstated((recording, problem), passed.final) else [said]
    finally:
        forget()


def _moved(passed: PlatformPass, systematic: Stated) -> list[FilterProblem]:
    """The problem with each of the systematic inputs moved by its uncertainty."""
    if systematic is None:
        return []
    case = passed.recording, passed.problem
    sizes = systematic.prior * np.eye(len(systematic.parameters))
    return [systematic.without(case, size)[1] for size in sizes]


def _judged(passed: PlatformPass, systematic: Stated, hit: bool) -> list[Finding]:
    """`diagnose` of a recording whose innovations are of the stated size at the final values: nothing more is filtered
    unless a question was ``hit``, or a prior, or the size and whiteness of the innovations says that something is
    wrong."""
    case, problem = (passed.recording, passed.problem), passed.problem
    fair = _fair(problem, problem, passed.result)
    if not (hit or fair is not problem or periodic(passed) or misstated(case, passed.final)):
        return []
    if systematic is not None:
        of = likely(*case, systematic)
        fair = _fair(problem, of, filtered((passed.recording, of)))
    return _remaining(case, fair, systematic)


def _diagnosed(
    recording: Recording, problem: FilterProblem, result: FilterResult, systematic: Stated
) -> list[Finding]:
    """`diagnose` of a recording whose reading found it sound."""
    if systematic is None and result.kind == "error-state" and sound(result):
        repaired, fair, findings = recording, _fair(problem, problem, result), list[Finding]()
    else:
        repaired, fair, findings = _without_faults(recording, problem, systematic)
    if not findings or not sound(filtered((repaired, fair))):
        findings += _remaining((repaired, problem), fair, systematic)
    if findings or sound(result):
        return findings
    # systematic inputs that are wrong within their uncertainty give all estimators large innovations
    if not result.converged or sound(filtered((recording, problem))):
        text = f"The {result.kind} fails on this recording, in which the error-state filter finds no contradiction."
        action = "Take the error-state filter, by --filter error-state."
        findings.append(Finding("filter_fails", text, harm=EVERYTHING, action=action))
    return findings


@once
def _fair(problem: FilterProblem, moved: FilterProblem, result: FilterResult) -> FilterProblem:
    """The problem as it may be meant: systematic inputs ``moved`` to where the recording fits best, and priors widened
    that the coefficients of the filter then contradict."""
    if not result.converged:
        return problem
    u, prior = np.sqrt(np.diag(result.covariance)), problem.prior
    size = np.abs(result.coefficients - problem.mean)
    # values are distributed about their mean with this variance where the prior holds
    spread = np.sqrt(np.maximum(prior**2 - u**2, 0.0))
    far = (u < UNSEEN * prior) & ~(size < sigmas(LIMITS.risk, len(prior)) * spread)
    if not far.any():
        return moved
    return replace(
        moved,
        prior=np.where(far, LIMITS.widened_prior * np.maximum(size, prior), prior),
    )


@once
def _widened(problem: FilterProblem, fair: FilterProblem) -> FilterProblem:
    """The problem with the priors of another, itself where it has them."""
    return problem if fair.prior is problem.prior else replace(problem, prior=fair.prior)


def _remaining(case: Case, meant: FilterProblem, systematic: Stated) -> list[Finding]:
    """Errors that the model leaves out, priors that are too narrow, and misstated noise; ``meant`` as of `_fair`."""
    recording, problem = case
    fair = (recording, meant)
    errors, corrected = small_errors((recording, _widened(problem, meant)), systematic)
    now = filtered(corrected)
    # what is no constant error looks like many, none of which makes innovations white, or like biases that wander
    unexplained = bool(errors) and not white(corrected, now)
    wandering = any(each.hypothesis.name in WANDERING.values() for each in errors)
    walk = unsteady(fair, unexplained) if unexplained or wandering else None
    if walk is not None:
        return [walk]
    rest = misstated(corrected, now)
    if errors and any(finding.code == "contradiction" for finding in rest):
        return misstated(fair, filtered(fair))  # errors that leave a contradiction are none
    return [*(each.finding for each in errors), *_beyond_prior(now, problem), *rest]


def _beyond_prior(result: FilterResult, problem: FilterProblem) -> list[Finding]:
    """Coefficients further from their mean than their prior allows, found with a wider one."""
    if not result.converged:
        return []
    values, variance, prior = result.coefficients, np.diag(result.covariance), problem.prior
    findings, p = [], len(prior)
    far = ~(np.abs(values - problem.mean) <= sigmas(LIMITS.risk, p) * np.sqrt(prior**2 + variance))
    for i in np.flatnonzero(far):
        name = result.names[i]
        unit, size = shown_unit(UNIT_OF[name])
        value, u = rounded(values[i] / size, math.sqrt(variance[i]) / size)
        text = f"{name}: the recording says {value} +- {u} {unit}, its prior is {prior[i] / size:.3g}"
        findings.append(
            Finding("prior_suspect", f"{text} {unit}", harm=(name,), action="state a wider one under [prior]")
        )
    return findings


def _gross_faults(case: Case) -> Iterator[Hypothesis[Case]]:
    """Faults of the accelerometers' axes and of rows."""
    yield from reordered_accelerometers(case)
    yield from faults_of_rows(case)


def _without_faults(
    recording: Recording, problem: FilterProblem, systematic: Stated
) -> tuple[Recording, FilterProblem, list[Finding]]:
    """The recording without its gross faults, the problem as it may then be meant (`_fair`), and these faults."""
    findings = list[Finding]()
    of = likely(recording, problem, systematic)
    now = filtered((recording, of))
    while len(findings) < LIMITS.gross_faults and not sound(now):
        case, before = (recording, of), sum_of_squares(now)
        best = likeliest(case, _gross_faults(case), JUDGE, LIMITS.risk)
        then = now if best is None else filtered(best.case)
        if not sound(then) and not sum_of_squares(then) < LIMITS.plain_misfit_ratio * before:
            fair = _fair(problem, of, now)
            if sound(filtered((recording, fair))):
                break
            single = likeliest(case, single_readings(case, now), JUDGE, LIMITS.risk)
            if single is not None and sound(after := filtered(single.case)):
                best, then = single, after
            elif sound(filtered(small_errors((recording, _widened(problem, fair)), systematic)[1])):
                break
        # what explains less than half is not what happened
        if best is None or not sum_of_squares(then) < LIMITS.explained_ratio * before:
            break
        recording = best.case[0]
        of = likely(recording, problem, systematic)
        now = filtered((recording, of))
        findings.append(best.finding)
    return recording, _fair(problem, of, now), findings
