"""Several records of one platform in one fit, each on a base of its own: the exact joint likelihood of all.

The coefficients are the same in all records; beta and biases that walk are of each. A record k, what is its own taken
out by its own prior, says of the coefficients x about a value x0

    Lambda_k = P_k^-1 - N^-1,   lambda_k = P_k^-1 (x_k - x0),

x_k and P_k the estimate from a prior N about x0. Together, with the study's prior Pi about m,

    P = (Pi^-1 + sum Lambda_k)^-1,   x = x0 + P (sum lambda_k + Pi^-1 (m - x0)).

That is a step of Gauss-Newton on the sum of squares of all records; it is repeated about its end. Adding information is
exact for independent records (Y. Bar-Shalom, X. R. Li, T. Kirubarajan, Estimation with Applications to Tracking and
Navigation (2001), chapter 7).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.errors import StudyError
from inercal.foundation.findings import Finding, Status
from inercal.foundation.inference.identifiability import UNSEEN
from inercal.foundation.records.places import counted as so_many
from inercal.foundation.records.record import Record
from inercal.foundation.results.basis import studied
from inercal.foundation.results.budget import TypeA, TypeB, combine
from inercal.foundation.results.remarks import at_prior, exact_inputs, missed, reached
from inercal.foundation.results.result import Estimate
from inercal.systems.selfcal.before.bounds import PathBounds
from inercal.systems.selfcal.before.observability import Observability, observability
from inercal.systems.selfcal.diagnosis.passed import pass_of
from inercal.systems.selfcal.estimators import ESTIMATORS
from inercal.systems.selfcal.filters import run as filtering
from inercal.systems.selfcal.filters.problem import FilterProblem, problem
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.coefficients import NAMES, product_slope, to_product, units
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.states import ALL, KIND_OF, UNIT_OF, WALK
from inercal.systems.selfcal.result.budget import considered, systematic
from inercal.systems.selfcal.result.outcome import COMMAND, MODEL, REFERENCES
from inercal.systems.selfcal.result.unmodelled import Evidence, counted, evidence, of_all
from inercal.systems.selfcal.settings import SelfcalSettings
from inercal.systems.selfcal.still_joints import still_joints, told_apart
from inercal.systems.selfcal.task import Calibration, based, calibrate

_ROUNDS = 8
"""Steps of Gauss-Newton at most."""


_OF_ONE = ("at_prior", "goal_missed", "stated_exact", "considered")
"""Findings of a record alone that need not hold for all together."""


@short_repr
@dataclass(frozen=True, eq=False)
class Together:
    """An ``estimate`` from several records, and the calibration by ``each`` alone."""

    estimate: Estimate
    each: tuple[Calibration, ...]


@dataclass(frozen=True, eq=False)
class RecordPart:
    """A record: its name, its recording, and its problem, with the study's prior."""

    name: str
    recording: Recording
    settings: SelfcalSettings
    problem: FilterProblem


class _Said(NamedTuple):
    """Knowledge of the coefficients (q,): ``information`` (q, q), and ``vector`` (q,) about a value."""

    information: Array
    vector: Array


def calibrate_together(
    records: Sequence[Record],
    settings: SelfcalSettings,
    progress: Callable[[str], None] = lambda _: None,
) -> Together:
    """Calibrate a platform from several records, each with the base that the study states for its file.

    Raises as `inercal.systems.selfcal.task.calibrate`, and StudyError for a file that the study's records do not name.
    """
    studies = [placed(record, settings) for record in records]
    alone = list[Calibration]()
    for number, (record, study) in enumerate(zip(records, studies, strict=True), start=1):

        def say(text: str, number: int = number) -> None:
            progress(f"record {number} of {len(records)}: {text}")

        alone.append(calibrate(record, study, progress=say, courses=False))
    progress("fitting all records together")
    parts = parts_of(records, studies)
    return Together(_assembled(parts, alone, settings, fit(parts)), tuple(alone))


def placed(record: Record, settings: SelfcalSettings) -> SelfcalSettings:
    """The study with the base of a record."""
    path = record.sources[0].path
    found = [place for place in settings.placed if place.names(path)]
    if len(found) != 1:
        named = ", ".join(place.file for place in settings.placed)
        text = f"found {len(found) or 'no'} entries for {path} among {named}, expected one"
        raise StudyError("records", text)
    return found[0].of(settings)


def parts_of(records: Sequence[Record], studies: Sequence[SelfcalSettings]) -> list[RecordPart]:
    """The records, without states that none of them can tell from others."""
    read = [based(record, study) for record, study in zip(records, studies, strict=True)]
    still = set.intersection(*({*still_joints(study, recording.th)} for recording, study in read))
    parts = []
    for record, (recording, study) in zip(records, read, strict=True):
        own = told_apart(study, sorted(still), recording.th[0])[0]
        parts.append(RecordPart(record.sources[0].path, recording, own, problem(own)))
    return parts


class RecordFit(NamedTuple):
    """The coefficients ``x`` (q,) of some ``names``, linear form, with their ``covariance`` (q, q) and ``prior`` (q,);
    ``common`` (p,) true of them among the states; what each record ``said``; ``converged``; words where the records
    are ``apart``."""

    names: tuple[str, ...]
    common: NDArray[np.bool_]
    x: Array
    covariance: Array
    prior: Array
    said: tuple[_Said, ...]
    converged: bool
    apart: str


def fit(parts: Sequence[RecordPart]) -> RecordFit:
    """The coefficients from all records."""
    states = parts[0].problem.names
    common = np.array([KIND_OF[name] != "beta" and ALL.index(name) < WALK for name in states])
    mean, prior = parts[0].problem.mean[common], parts[0].problem.prior[common]
    x, width, size = mean, prior, math.inf
    for _ in range(_ROUNDS):
        said = tuple(_likelihood(part, common, x, width) for part in parts)
        information = np.diag(prior**-2) + sum(each.information for each in said)
        covariance = _inverse(information, prior)
        step = covariance @ (sum(each.vector for each in said) + (mean - x) / prior**2)
        u = np.sqrt(np.diag(covariance))
        size = float(np.max(np.abs(step) / u))
        about, x, width = x, x + step, np.minimum(prior, LIMITS.second_prior * u)
        if not size > LIMITS.last_step:
            break
    names = tuple(name for name, each in zip(states, common, strict=True) if each)
    found = RecordFit(names, common, x, covariance, prior, said, size <= LIMITS.last_step, "")
    return found._replace(apart=_contradiction(found, about, mean) if found.converged else "")


def _inverse(information: Array, scale: Array) -> Array:
    """Inverse of an information matrix, of parameters of some ``scale``."""
    inverse = np.linalg.inv(information * np.outer(scale, scale))
    return np.asarray(0.5 * (inverse + inverse.T) * np.outer(scale, scale))


def _likelihood(part: RecordPart, common: NDArray[np.bool_], about: Array, width: Array) -> _Said:
    """Knowledge from a record, linearised ``about`` coefficients, from a prior of some ``width``."""
    of = part.problem
    stated, narrow = of.states.stated.copy(), of.prior.copy()
    stated[of.states.index[common]], narrow[common] = about, width
    posed = replace(of, prior=narrow, vector=replace(of.states, stated=stated))
    found = filtering.estimate(part.recording, posed, history=False)
    gain = _inverse(found.covariance[np.ix_(common, common)], 1.0 / width)
    return _Said(gain - np.diag(width**-2), gain @ (found.coefficients[common] - about))


def _contradiction(fit: RecordFit, about: Array, mean: Array) -> str:
    """Words where the records contradict each other: the sum of squares by which they differ from their common fit,
    chi-square with at most as many degrees of freedom as there are coefficients, but for one record."""
    from scipy.special import chdtrc

    said, whole, shift = fit.said, np.diag(fit.prior**-2), (mean - about) / fit.prior**2
    total, vectors = 0.0, np.zeros(len(fit.x))
    of_each = []
    for each in said:
        vector = each.vector + shift
        own = _inverse(each.information + whole, fit.prior)
        total += float(vector @ own @ vector)
        of_each.append((own @ vector, np.sqrt(np.diag(own))))
        vectors = vectors + vector
    vectors = vectors - (len(said) - 1) * shift
    total -= float(vectors @ fit.covariance @ vectors) + (len(said) - 1) * float(
        shift @ (shift * fit.prior**2)
    )
    freedom = len(fit.x) * (len(said) - 1)
    if not float(chdtrc(freedom, max(total, 0.0))) < LIMITS.risk:
        return ""
    values, spread = (np.array(each) for each in zip(*of_each, strict=True))
    # differences from the first record that are largest over what both leave open
    off = np.abs(values[1:] - values[0]) / np.hypot(spread[1:], spread[0])
    name = fit.names[int(np.argmax(off.max(axis=0)))]
    return (
        f"the records contradict each other: a sum of squares of {total:.4g} for at most {freedom} degrees of freedom; "
        f"most in {name}, by {off.max():.2g} of its u"
    )


def _assembled(
    parts: Sequence[RecordPart],
    alone: Sequence[Calibration],
    settings: SelfcalSettings,
    fit: RecordFit,
) -> Estimate:
    """The estimate with its budget, verdict and findings."""
    slope, values = product_slope(fit.x), to_product(fit.x)
    by_records = slope @ fit.covariance @ slope.T
    u = np.sqrt(np.diag(by_records))
    dof = [max(each.estimate.statistics.get("dof", 1.0), 1.0) for each in alone]
    sources = list[TypeA | TypeB]()
    for part, said, own in zip(parts, fit.said, dof, strict=True):
        P = slope @ fit.covariance @ said.information @ fit.covariance @ slope.T
        sources.append(TypeA(f"noise of {part.name}", 1.0, "1", 0.5 * (P + P.T), own))
    sources.append(TypeB("prior", 1.0, "1", slope @ fit.covariance / fit.prior))
    stated, exact, left = _besides(parts, fit, u, slope)
    sources += stated
    findings = list[Finding]()
    if left:
        rest = counted(of_all(left), slope, fit.names, combine(fit.names, sources).u)
        sources.append(rest.source)
        exact = {kind: text for kind, text in exact.items() if kind not in rest.counted}
        findings += [rest.finding] if rest.finding else []
    uncertainty = combine(fit.names, sources)
    judged = observability(PathBounds(fit.names, by_records, fit.prior, np.empty((0, len(u)))), settings.goal)
    for part, each in zip(parts, alone, strict=True):
        told = (f for f in each.estimate.findings if f.code not in _OF_ONE)
        findings += [replace(f, headline=f"{part.name}: {f.headline}") for f in told]
    goal = reached(fit.names, uncertainty.u, settings.goal)
    findings += [*at_prior(judged.at_prior), *missed(goal, UNIT_OF)]
    findings += exact_inputs(exact, cure="State them with uncertainties, or as states.")
    basis = studied(
        COMMAND,
        settings,
        [source for part in parts for source in part.recording.sources],
        MODEL,
        (*REFERENCES, *ESTIMATORS[settings.filter.kind].publications),
        dict(alone[0].estimate.conditions),
    )
    result: dict[str, Any] = {
        "filter": settings.filter.kind,
        "states": list(dict.fromkeys(KIND_OF[name] for name in fit.names)),
        "bounds": dict(zip(fit.names, u.tolist(), strict=True)),
        "at_prior": list(judged.at_prior),
        "goal": goal,
        "records": [_entry(part, each) for part, each in zip(parts, alone, strict=True)],
        "compare": {},
    }
    return Estimate.of(
        basis,
        fit.names,
        units(fit.names),
        values,
        uncertainty,
        _verdict(parts, alone, judged, fit),
        findings=findings,
        statistics={
            "dof": float(sum(dof)),
            "condition": judged.learned.condition**2,
            "nis_mean": float(
                np.mean([each.estimate.statistics.get("nis_mean", math.nan) for each in alone])
            ),
        },
        result=result,
    )


def _besides(
    parts: Sequence[RecordPart], fit: RecordFit, u: Array, slope: Array
) -> tuple[list[TypeB], dict[str, str], list[Evidence]]:
    """Inputs of site, base and rig that are stated with an uncertainty: those of site and rig are the same in all
    records, heading and tilt another in each; in words, what is stated without one; and of each record what it says of
    errors of the rig that are no states."""
    whole = dict[str, tuple[TypeB, Array]]()
    exact, left = dict[str, str](), list[Evidence]()
    for part in parts:
        own = filtering.estimate(part.recording, part.problem, courses=False)
        known = np.sqrt(np.diag(own.covariance))
        known[fit.common] = u
        passed = pass_of(part.recording, part.problem, own)
        if passed is None:
            continue
        of_site, of_site_exact = systematic(passed, part.settings, known)
        of_rig, of_rig_exact = considered(passed, part.settings, known)
        exact |= {key: text for key, text in {**of_site_exact, **of_rig_exact}.items() if key not in exact}
        weight = fit.covariance @ _inverse(own.covariance[np.ix_(fit.common, fit.common)], 1.0 / fit.prior)
        back = np.linalg.inv(product_slope(own.coefficients))
        for each in (*of_site, *of_rig):
            of_base = each.source == "heading" or each.source.startswith("tilt")
            name = f"{each.source} of {part.name}" if of_base else each.source
            shift = slope @ weight @ (back @ each.sensitivity)[fit.common]
            before = whole[name][1] if name in whole else np.zeros(len(u))
            whole[name] = each, before + shift
        if (found := evidence(passed, part.settings)) is not None:
            left.append(found._replace(shift=weight @ found.shift[fit.common]))
    named = [replace(each, source=name, sensitivity=shift) for name, (each, shift) in whole.items()]
    return named, exact, left


def _entry(part: RecordPart, alone: Calibration) -> dict[str, Any]:
    """A record for JSON: its verdict by itself, the base, and what is its own."""
    estimate, base = alone.estimate, alone.settings.base
    of_record = {
        name: {"value": each.value, "u": each.u}
        for name, each in estimate.parameters.items()
        if KIND_OF[name] == "beta"
    }
    return {
        "file": part.name,
        "status": estimate.status.value,
        "message": estimate.message,
        "rows": len(part.recording.t) - 1,
        "nis_mean": estimate.statistics.get("nis_mean"),
        "base": {"heading": base.heading, "tilt": list(base.tilt)},
        "beta": of_record,
    }


def _verdict(
    parts: Sequence[RecordPart], alone: Sequence[Calibration], judged: Observability, fit: RecordFit
) -> tuple[Status, str]:
    """Status and sentence: those of a record that cannot be used, else of all together."""
    for part, each in zip(parts, alone, strict=True):
        if not each.estimate.status.done and each.estimate.status is not Status.UNOBSERVABLE:
            return each.estimate.status, f"{part.name}: {each.estimate.message}"
    if not fit.converged:
        return Status.NOT_CONVERGED, f"the fit of all records did not end in {_ROUNDS} steps"
    if fit.apart:
        return Status.INCONSISTENT, fit.apart
    ratio = judged.learned.ratio[: len(NAMES)]
    unseen = [name for name, left in zip(NAMES, ratio, strict=True) if left > UNSEEN]
    if unseen:
        left = f"{100 * float(ratio.max()):.0f} % of the prior is left"
        return Status.UNOBSERVABLE, f"the records say nothing about {', '.join(unseen)}: {left}"
    rows = sum(len(part.recording.t) - 1 for part in parts)
    return (
        Status.OK,
        f"{so_many(len(judged.learned.names), 'coefficient')} from {len(parts)} records, {rows} rows",
    )
