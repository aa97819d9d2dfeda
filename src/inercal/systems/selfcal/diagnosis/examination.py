"""Errors of a recording that contradicts the model: each named with its place.

Units, signs and order were seen roughly when the recording was read (`gross`). Then come gross faults of accelerometers
and rows (`rows`), judged by what the error-state filter makes of the recording without each, single rows last; what one
pass shows at the values of the filter (`judged`); and the size and whiteness of the innovations (`noise_check`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.inference.hypotheses import sigmas
from inercal.foundation.inference.identifiability import UNSEEN
from inercal.foundation.inference.scores import PassSums
from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.results.shown import rounded
from inercal.systems.selfcal.diagnosis.fit_quality import filtered, sound, sum_of_squares
from inercal.systems.selfcal.diagnosis.gross import reordered_accelerometers
from inercal.systems.selfcal.diagnosis.judged import Spoken, most_explained, settled, spoken
from inercal.systems.selfcal.diagnosis.noise_check import misstated, unsteady
from inercal.systems.selfcal.diagnosis.passed import PlatformPass, pass_of, periodic
from inercal.systems.selfcal.diagnosis.rows import GrossFault, faults_of_rows, single_readings
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
    stated: Sequence[FilterProblem] = (),
    passed: PlatformPass | None = None,
) -> list[Finding]:
    """Name what is wrong with a recording; nothing for a sound one, nor where its reading found units or axes wrong.

    ``result`` is that of the study's estimator, ``passed`` the pass at its values, made if absent; the error-state
    filter judges the recording itself. ``stated`` are the problems with each input that is stated with an uncertainty
    moved by that: no error within them is named.
    """
    if any(finding.code in _BEYOND for finding in recording.findings) or not result.dims.any():
        return []
    own = result.kind == "error-state"
    if not own or passed is None:
        passed = pass_of(recording, problem, result if own else filtered(recording, problem))
    now = filtered(recording, problem) if passed is None else passed.final
    findings = list[Finding]()
    if passed is not None:
        passed, stated = _moved(passed, stated)
        said, all_of_it = _explained(passed, stated)
        if all_of_it and said.findings and not any(said.named):
            return [*said.findings, *_beyond_prior(passed, said.sums)]
    while len(findings) < LIMITS.gross_faults and not _adequate(now, passed, stated):
        fault = _gross(recording, problem, passed, stated)
        if fault is None:
            break
        findings.append(fault.finding)
        recording = fault.without
        of_filter = filtered(recording, problem)
        passed = pass_of(recording, problem, of_filter)
        now = of_filter if passed is None else passed.final
    if not findings or not _adequate(now, passed, stated):
        findings += misstated(recording, problem, now) if passed is None else _remaining(passed, stated)
    if not (findings or own or sound(result)) and (not result.converged or sound(now)):
        text = f"The {result.kind} fails on this recording, in which the error-state filter finds no contradiction."
        action = "Take the error-state filter, by --filter error-state."
        findings.append(Finding("filter_fails", text, harm=EVERYTHING, action=action))
    return findings


def with_stated(passed: PlatformPass, stated: Sequence[FilterProblem]) -> PassSums:
    """The sums with inputs that are stated with an uncertainty as constants; without them where one would have to move
    further than chance takes it, for then the recording contradicts the study."""
    if not stated:
        return passed.sums
    sums = passed.with_stated(list(stated))
    within = np.abs(sums.change[-len(stated) :]).max() <= sigmas(LIMITS.risk, len(stated))
    return sums if within else passed.sums


def _moved(
    passed: PlatformPass, stated: Sequence[FilterProblem]
) -> tuple[PlatformPass, Sequence[FilterProblem]]:
    """A pass, with the problems of what is stated, moved to where the recording has it, if that is elsewhere: where
    these uncertainties are large, products of them show."""
    from scipy.special import chdtri

    sums, here = with_stated(passed, stated), passed.problem
    if passed.sums.chi2 - sums.chi2 <= chdtri(max(len(stated), 1), LIMITS.risk):
        return passed, stated

    def by(problem: FilterProblem, other: FilterProblem, size: float) -> FilterProblem:
        a, b, c = problem.world, other.world, here.world
        world = a._replace(earth=a.earth + size * (b.earth - c.earth), up=a.up + size * (b.up - c.up))
        change = other.states.stated - here.states.stated
        vector = replace(problem.states, stated=problem.states.stated + size * change)
        return replace(problem, world=world, vector=vector)

    there = here
    for other, size in zip(stated, sums.change[-len(stated) :].tolist(), strict=True):
        there = by(there, other, size)
    again = pass_of(passed.recording, there, filtered(passed.recording, there))
    return (passed, stated) if again is None else (again, [by(there, other, 1.0) for other in stated])


def _adequate(now: FilterResult, passed: PlatformPass | None, stated: Sequence[FilterProblem]) -> bool:
    """True where a filter agrees with its recording, but for what is stated and for priors."""
    if sound(now):
        return True
    if passed is None or any(reordered_accelerometers(passed.recording, passed.problem)):
        return False
    return settled(passed.sums, Spoken((), (), _fair(passed, stated), False), passed.z)


def _gross(
    recording: Recording,
    problem: FilterProblem,
    passed: PlatformPass | None,
    stated: Sequence[FilterProblem],
) -> GrossFault | None:
    """The gross fault that explains most, unless what one pass shows explains all."""
    now = filtered(recording, problem)
    before = sum_of_squares(now)
    best, least = None, before
    for fault in _faults(recording, problem):
        left = sum_of_squares(filtered(fault.without, problem))
        if left + fault.chance < least:
            best, least = fault, left + fault.chance
    then = math.inf if best is None else least - best.chance
    if best is not None and then < LIMITS.plain_misfit_ratio * before:
        return best
    if best is not None and sound(filtered(best.without, problem)):
        return best
    if passed is not None:
        if _explained(passed, stated)[1]:
            return None
        single = single_readings(recording, problem, now)
        if single is not None and sound(filtered(single.without, problem)):
            return single
    # what explains less than half is not what happened
    return best if then < LIMITS.explained_ratio * before else None


def _faults(recording: Recording, problem: FilterProblem) -> Iterator[GrossFault]:
    """Faults of the accelerometers' axes and of rows."""
    yield from reordered_accelerometers(recording, problem)
    yield from faults_of_rows(recording, problem)


def _fair(passed: PlatformPass, stated: Sequence[FilterProblem]) -> PassSums:
    """The sums as they may be meant: with inputs as they are stated, and priors widened that values contradict."""
    sums, p = with_stated(passed, stated), len(passed.constants)
    size, u, prior = np.abs(_off_mean(passed, sums)), sums.u[:p], sums.prior[:p]
    # values are distributed about their mean with this variance where the prior holds
    spread = np.sqrt(np.maximum(prior**2 - u**2, 0.0))
    far = (u < UNSEEN * prior) & ~(size < sigmas(LIMITS.risk, p) * spread)
    if not far.any():
        return sums
    wide = np.where(far, LIMITS.widened_prior * np.maximum(size, prior), prior)
    return replace(sums, prior=np.append(wide, sums.prior[p:]))


def _off_mean(passed: PlatformPass, sums: PassSums) -> Array:
    """Values (p,) of the constants at the change of the sums, less their mean before the recording."""
    p = len(passed.constants)
    return np.asarray(sums.change[:p] - sums.off[:p])


def _explained(passed: PlatformPass, stated: Sequence[FilterProblem]) -> tuple[Spoken, bool]:
    """All that one pass shows, and True where that explains all."""
    sums = _fair(passed, stated)
    said = spoken(sums, passed.questions, passed.constants)
    return said, settled(sums, said, passed.z)


def _remaining(passed: PlatformPass, stated: Sequence[FilterProblem]) -> list[Finding]:
    """Errors that one pass shows, priors that are too narrow, and misstated noise."""
    said, all_of_it = _explained(passed, stated)
    if waves := periodic(passed):
        wider = pass_of(passed.recording, passed.problem, passed.result, tuple(waves))
        if wider is not None:
            passed = wider
            said, all_of_it = _explained(passed, stated)
    case = passed.recording, passed.problem
    beyond = _beyond_prior(passed, said.sums)
    if (all_of_it and beyond) or (said.findings and (all_of_it or most_explained(passed.sums, said))):
        return [*said.findings, *beyond]
    if said.findings:
        walk = unsteady(*case, passed.final)
        if walk is not None:
            return [walk]
    rest = misstated(*case, passed.final)
    if any(finding.code == "contradiction" for finding in rest):
        return rest  # errors that leave a contradiction are none
    return [*said.findings, *beyond, *rest]


def _beyond_prior(passed: PlatformPass, sums: PassSums) -> list[Finding]:
    """Coefficients further from their mean than their prior allows, found with a wider one."""
    problem, names = passed.problem, passed.constants
    prior = problem.prior[~problem.states.walks]
    p = len(names)
    size, u = _off_mean(passed, sums), sums.u[:p]
    mean = problem.mean[~problem.states.walks]
    findings = []
    far = ~(np.abs(size) <= sigmas(LIMITS.risk, p) * np.hypot(prior, u))
    for i in np.flatnonzero(far):
        unit, factor = shown_unit(UNIT_OF[names[i]])
        value, of_value = rounded((mean[i] + size[i]) / factor, u[i] / factor)
        text = f"{names[i]}: the recording says {value} +- {of_value} {unit}, its prior is {prior[i] / factor:.3g}"
        findings.append(
            Finding(
                "prior_suspect", f"{text} {unit}", harm=(names[i],), action="state a wider one under [prior]"
            )
        )
    return findings
