"""All estimators of self-calibration behind one function."""

from __future__ import annotations

import math
import time
from dataclasses import replace
from types import ModuleType

import numpy as np

from inercal.foundation.inference.sigma_point import NEGATIVE
from inercal.systems.selfcal.estimators import FilterKind
from inercal.systems.selfcal.filters import error_state, gimbal, quaternion
from inercal.systems.selfcal.filters.batch import estimate_map
from inercal.systems.selfcal.filters.filter_result import (
    FilterResult,
    FilterState,
    RowHistory,
    Trace,
    attitude_of,
    empty_estimates,
    estimate_of,
)
from inercal.systems.selfcal.filters.gaps import advance, initial, joined
from inercal.systems.selfcal.filters.problem import AttitudeStart, FilterProblem
from inercal.systems.selfcal.filters.second_pass import is_due, second_pass
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.recording import Recording, Steps

_LOADED = set[FilterKind]()
"""Recursive filters whose kernels this process has; their types do not depend on the problem."""


def recursive(kind: FilterKind) -> ModuleType | None:
    """The module of a recursive filter, with ``initial`` and ``advance``; None for ``map``."""
    return {"error-state": error_state, "svd-qukf": quaternion, "gimbal-ukf": gimbal, "map": None}[kind]


def estimate(
    recording: Recording,
    problem: FilterProblem,
    kind: FilterKind | None = None,
    start: AttitudeStart | None = None,
    history: bool = True,
    brief: bool = False,
    courses: bool = True,
) -> FilterResult:
    """Estimate the coefficients from a recording, by the estimator of the problem or another ``kind``.

    ``start`` of the attitude is the first encoder reading if absent; with ``history`` the estimates after each row are
    kept. Of more than the paper's coefficients a second pass gives the result (`second_pass`); history but its last
    row, innovations and NIS are those of the first pass. Without ``courses`` the history has attitudes alone, as has
    that of a ``brief`` estimate, for a judge of the innovations, which takes one pass.
    """
    kind = problem.filter.kind if kind is None else kind
    module = recursive(kind)
    if module is None:
        return estimate_map(recording, problem, start, history)
    load_kernels(kind, problem)
    began = time.perf_counter()
    state = initial(module, problem, recording.th[0], recording.rate[0], start)
    state, trace, rows = _passed(module, state, problem, recording, history, courses and not brief)
    if not brief and is_due(kind, problem):
        begun = initial(module, problem, recording.th[0], recording.rate[0], start)
        state = second_pass(begun, state, problem, recording.steps, recording.held, recording.walked)
        for name, row in vars(estimate_of(state, problem)).items() if rows is not None else ():
            getattr(rows, name)[-1:] = row
    seconds = time.perf_counter() - began
    size = len(problem.prior)
    result = FilterResult(
        kind=kind,
        names=problem.names,
        coefficients=state.coefficients,
        covariance=state.covariance[-size:, -size:],
        attitude=attitude_of(state, problem),
        nis=trace.estimates.nis,
        dims=trace.estimates.dims,
        innovations=trace.estimates.innovations,
        history=rows,
        seconds=seconds,
        lowest_eigenvalue=trace.lowest_eigenvalue,
        fallbacks=trace.fallbacks,
        gimbal_cosine=trace.gimbal_cosine,
        restarts=tuple(k + 1 for k in trace.restarts),
        state=state,
    )
    message = _fault(result)
    return replace(result, converged=False, message=message) if message else result


_CHUNK = 1 << 16
"""Steps whose estimates a filter hands over at once: of a long recording there is room for one copy."""


def _passed(
    module: ModuleType,
    state: FilterState,
    problem: FilterProblem,
    recording: Recording,
    history: bool,
    courses: bool,
) -> tuple[FilterState, Trace, RowHistory | None]:
    """The state after all steps, innovations and health, and estimates of the rows, without ``courses`` attitudes."""
    steps, m, p = recording.steps, len(recording.dt), len(problem.prior)
    seen = np.all(np.isfinite(steps.th), axis=1)
    out = empty_estimates(0, p, history)._replace(nis=np.empty(m), dims=np.empty(m, dtype=np.int64))
    rows = vars(estimate_of(state, problem)) if history else {}
    kept = [name for name in rows if name == "attitude" or courses]
    if history:
        out = out._replace(innovations=np.empty((m, 6)))
        more = {name: np.empty((m, rows[name].shape[1])) for name in kept}
        rows |= {name: np.concatenate([rows[name], each]) for name, each in more.items()}
    health, restarts, first = list[Trace](), list[int](), 0
    while first < m or not health:
        last = min(first + _CHUNK, m)
        while last < m and not seen[last - 1]:  # what is in doubt stays together
            last += 1
        held = [k - first for k in recording.held if first <= k < last]
        walked = None if recording.walked is None else recording.walked[first:last]
        part = steps.part(slice(first, last))
        state, trace = advance(module, state, problem, part, held, history, walked)
        for name in ("nis", "dims", *(["innovations"] if history else [])):
            getattr(out, name)[first:last] = getattr(trace.estimates, name)
        for name in kept:
            rows[name][first + 1 : last + 1] = getattr(trace.estimates, name)
        health.append(trace._replace(estimates=empty_estimates(0, p, history)))
        restarts += [first + k for k in trace.restarts]
        first = last
    trace = joined(health)._replace(estimates=out, restarts=tuple(restarts))
    return state, trace, RowHistory(**rows) if history else None


def load_kernels(kind: FilterKind, problem: FilterProblem) -> None:
    """Load, or compile, the kernels of a recursive filter; nothing to do for the others."""
    module = recursive(kind)
    if module is not None and kind not in _LOADED:
        none = np.empty((0, 3))
        module.advance(
            module.initial(problem, np.zeros(3)),
            problem,
            Steps(np.empty(0), none, none, none, none, np.empty(0)),
        )
        _LOADED.add(kind)


def _fault(result: FilterResult) -> str:
    """The reason why the numbers of a filter must not be used; empty if there is none."""
    variances = np.diag(result.covariance)
    numbers = (result.coefficients, result.covariance, result.attitude)
    if not all(np.isfinite(each).all() for each in numbers):
        at = " where the gimbals lock" if result.gimbal_cosine < LIMITS.singular_cosine else ""
        return f"the filter diverged{at}: coefficients or covariance are not finite"
    if not (variances > 0.0).all() or result.lowest_eigenvalue < NEGATIVE:
        return (
            "the covariance lost its positive sign (lowest eigenvalue of the correlation matrix "
            f"{result.lowest_eigenvalue:.1e}): use another filter or factor"
        )
    if result.kind == "gimbal-ukf" and result.gimbal_cosine < LIMITS.singular_cosine:
        angle = math.degrees(math.acos(result.gimbal_cosine))
        return (
            f"the inner gimbal came to {angle:.2f} deg, where outer and platform axis coincide and the gimbal-angle "
            "model does not hold: use a quaternion filter"
        )
    return ""
