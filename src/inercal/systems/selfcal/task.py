"""A calibration of a record by a study of self-calibration, with one estimator or with all."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate
from inercal.foundation.results.shown import Table, rounded
from inercal.systems.selfcal.before import considered
from inercal.systems.selfcal.before.bounds import PathBounds, recorded_bounds
from inercal.systems.selfcal.diagnosis.examination import diagnose
from inercal.systems.selfcal.diagnosis.passed import pass_of
from inercal.systems.selfcal.estimators import KINDS, FilterKind
from inercal.systems.selfcal.filters import run as filtering
from inercal.systems.selfcal.filters import whitened
from inercal.systems.selfcal.filters.filter_result import FilterResult
from inercal.systems.selfcal.filters.gaps import taken_anew
from inercal.systems.selfcal.filters.problem import FilterProblem, problem
from inercal.systems.selfcal.find_base import heading, is_rough, relative, with_base
from inercal.systems.selfcal.platform.coefficients import BETA
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.reading import as_recorded, recording_of
from inercal.systems.selfcal.result.budget import bounds_of, stated_errors
from inercal.systems.selfcal.result.comparison import beside, differing, of_attitude, stated_variance
from inercal.systems.selfcal.result.outcome import assemble, verdict
from inercal.systems.selfcal.result.tables import of_attitudes, side_by_side
from inercal.systems.selfcal.settings import SelfcalSettings
from inercal.systems.selfcal.still_joints import still_joints, told_apart


@short_repr
@dataclass(frozen=True, eq=False)
class Calibration:
    """An ``estimate``, and the evidence behind it: ``settings`` of the study, results of other estimators that it was
    ``compared`` with, by kind, the variance (p,) that what is ``stated`` adds to each, and the ``truth`` (p,), product
    form, where the study states it."""

    estimate: Estimate
    problem: FilterProblem
    recording: Recording
    filtered: FilterResult
    bounds: PathBounds
    settings: SelfcalSettings
    compared: Mapping[FilterKind, FilterResult] = field(default_factory=dict)
    stated: Array = field(default_factory=lambda: np.zeros(0))
    truth: Array | None = None


def load_kernels(settings: SelfcalSettings, compare: bool = False) -> None:
    """Load, or compile, all kernels that `calibrate` uses, so that they do not count in its time."""
    of = problem(settings)
    kinds = {"error-state", of.filter.kind} | (set(KINDS) if compare else set())
    for kind in KINDS:
        if kind in kinds:
            filtering.load_kernels(kind, of)
    none = np.empty((0, 3))
    empty = Recording(np.empty(0), none, none, none)
    recorded_bounds(empty, of, np.empty((0, 4)), np.zeros(len(of.prior)), contributions=True)
    whitened.load_kernels(of)
    considered.load_kernels(of)


def calibrate(
    record: Record,
    settings: SelfcalSettings,
    compare: bool = False,
    progress: Callable[[str], None] = lambda _: None,
    courses: bool = True,
) -> Calibration:
    """Calibrate a platform from what it recorded while it turned; `recording_of` says which channels it has.

    ``compare`` runs all other estimators too; ``progress`` is told each step of the work, in words. Without ``courses``
    no coefficients are kept from row to row, as pages and histories show them. The status of the estimate says whether
    its values can be used: nothing is raised for a poor one.

    Raises InputError where the record has not the channels of a platform or the study does not fit it, or where it
    leaves a heading unknown that the record does not tell.
    """
    clock = time.perf_counter()
    stated_base, rough = settings.base, is_rough(settings)
    recording, settings = based(record, settings, progress)
    settings, left_out = told_apart(settings, still_joints(settings, recording.th), recording.th[0])
    of = problem(settings)
    progress(f"filtering ({of.filter.kind})")
    row_by_row = filtered = filtering.estimate(recording, of, courses=courses)
    progress("looking for faults")
    passed = pass_of(recording, of, filtered)
    if passed is not None and filtered.kind == "error-state":
        filtered = passed.final  # judged at its values
    bounds = _lost_bounds(recording, of, filtered) if passed is None else bounds_of(passed)
    faults = [
        *diagnose(recording, of, filtered, stated_errors(settings), passed),
        *taken_anew(recording, filtered),
        *left_out,
    ]
    compared: dict[FilterKind, FilterResult] = {}
    for kind in KINDS if compare else ():
        if kind != filtered.kind:
            progress(f"filtering ({kind})")
            compared[kind] = filtering.estimate(recording, of.for_kind(kind), kind)
    faults += differing(filtered, compared)
    progress("assembling")
    estimate = assemble(recording, settings, filtered, bounds, faults, passed)
    result, message = dict(estimate.result), estimate.message
    if rough and estimate.names:
        base, words = _base(settings, estimate)
        result, message = result | base, message + words
    stated = stated_variance(filtered, estimate.u) if estimate.names else np.zeros(len(of.prior))
    for name, other in compared.items():
        own = verdict(other, recording, settings, faults, passed)[0]
        result["compare"] |= {name: beside(other, own, stated, recording.reference)}
    result |= of_attitude(filtered, recording.reference)
    steps = {"step": filtered, **{f"step {name}": other for name, other in compared.items()}}
    timing = {
        "solve": time.perf_counter() - clock,
        **{key: 1e-6 * each.step_us for key, each in steps.items()},
    }
    timed = replace(estimate, result=result, message=message, timing=timing)
    truth = None if settings.true_values is None else settings.true_values[of.states.index]
    if truth is not None and rough:
        truth[BETA] = relative(truth[BETA], stated_base, settings.base)
    return Calibration(timed, of, recording, row_by_row, bounds, settings, compared, stated, truth)


def _lost_bounds(recording: Recording, of: FilterProblem, filtered: FilterResult) -> PathBounds:
    """Bounds where the values of a filter are lost: along its attitudes."""
    assert filtered.history is not None
    along = filtered.history.attitude, filtered.coefficients
    return recorded_bounds(recording, of, *along, contributions=True, restarts=filtered.restarts)


def based(
    record: Record, settings: SelfcalSettings, progress: Callable[[str], None] = lambda _: None
) -> tuple[Recording, SelfcalSettings]:
    """The recording in a record, and the study with its base: found from the recording where it is stated too roughly.

    Raises as `calibrate`.
    """
    settings = as_recorded(record, settings)
    recording = recording_of(record, settings)
    if not is_rough(settings):
        return recording, settings
    progress("looking for the heading" if settings.heading_unknown else "looking for the base")
    settings = with_base(recording, settings)
    return recording_of(record, settings), settings  # rates over gaps depend on it


def _base(settings: SelfcalSettings, estimate: Estimate) -> tuple[dict[str, Any], str]:
    """The base found [rad], to which beta is relative, and a heading that was unknown, corrected by beta; both also in
    words."""
    base = settings.base
    result: dict[str, Any] = {"base": {"heading": base.heading, "tilt": list(base.tilt)}}
    degrees = np.degrees([base.heading, *base.tilt]).tolist()
    words = "; beta is relative to the base found, heading {:.5f} deg, tilt {:.5f} and {:.5f} deg".format(
        *degrees
    )
    if settings.heading_unknown:
        value, u = heading(base, estimate.values[BETA], estimate.covariance[BETA, BETA])
        result["heading"] = {"value": value, "u": u}
        words = "; heading {} deg, u {} deg".format(*rounded(math.degrees(value), math.degrees(u))) + words
    return result, words


def compared(calibration: Calibration) -> list[Table]:
    """`side_by_side` of a calibration, the estimator that counts first; nothing where no other was run."""
    if not calibration.compared:
        return []
    estimate, first = calibration.estimate, calibration.filtered
    status = {kind: str(each["status"]) for kind, each in estimate.result.get("compare", {}).items()}
    filters = {first.kind: first} | dict(calibration.compared)
    interval = float(np.median(calibration.recording.dt))
    status |= {first.kind: estimate.status.value}
    tables = side_by_side(filters, calibration.stated, calibration.truth, interval, status)
    true = calibration.recording.reference
    return tables if true is None else [*tables, of_attitudes(filters, true)]
