"""The task of the command: angles of attack from a record, by one method or by many."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from inercal.aoa.angles import Angles
from inercal.aoa.diagnosis.choice import decided_with, of_delay, of_vibration
from inercal.aoa.diagnosis.effect import of_flexure
from inercal.aoa.diagnosis.examination import diagnose, implausible
from inercal.aoa.diagnosis.rectification import of_rectification
from inercal.aoa.diagnosis.unseen import unseen
from inercal.aoa.fusion import filter_result, live_band, smoother
from inercal.aoa.fusion.band import fused_case
from inercal.aoa.fusion.filter_result import FilterResult
from inercal.aoa.fusion.problem import FilterProblem, problem
from inercal.aoa.paper.delay import Delay, relative_delay
from inercal.aoa.paper.methods import MEASURED, label, low_passed
from inercal.aoa.reading.clock import later
from inercal.aoa.reading.from_record import recording_of
from inercal.aoa.reading.recording import Recording
from inercal.aoa.reading.wind_off_zero import with_zero
from inercal.aoa.reference.sensor_fit import Verified, fit
from inercal.aoa.reference.static_fit import at_rests_alone, static_fit
from inercal.aoa.result.alarms import beyond_limits
from inercal.aoa.result.carry_over import corrected
from inercal.aoa.result.carry_over import load as load_posterior
from inercal.aoa.result.outcome import assemble, assemble_paper
from inercal.aoa.result.points import Point, points
from inercal.aoa.result.systematic import by_fusion, by_methods
from inercal.aoa.result.verification import Errors, errors, late_reference
from inercal.aoa.settings import AoaSettings, Methods
from inercal.arrays import short_repr
from inercal.errors import InputError, RecordError
from inercal.estimate.result import Estimate
from inercal.records.record import Record


@short_repr
@dataclass(frozen=True, eq=False)
class Measurement:
    """An ``estimate``, and the data behind it for files and pictures.

    ``settings`` are those of the study, corrected by an earlier result, with what the recording decides;
    ``angles`` of the chosen method; ``filtered`` of the fusion, None for the paper's methods; ``points`` at rest;
    ``delay`` of the gyro by the spectra; ``errors`` by method and ``verified`` sensors where there is a reference
    angle; ``compared`` angles of other methods, by name.
    """

    estimate: Estimate
    settings: AoaSettings
    problem: FilterProblem
    recording: Recording
    angles: Angles
    filtered: FilterResult | None
    points: tuple[Point, ...]
    delay: Delay | None
    errors: Mapping[str, Errors] = field(default_factory=dict)
    verified: Verified | None = None
    compared: Mapping[str, Angles] = field(default_factory=dict)


def in_order(measurement: Measurement) -> Measurement:
    """The measurement without the rows that are not later than those before them."""
    t = measurement.recording.t
    taken = later(t)
    if len(taken) == len(t):
        return measurement

    def rows(of: Any) -> Any:
        """A part of the measurement with only the later of all rows."""
        parts = {each.name: getattr(of, each.name) for each in fields(of)}
        columns = {name: x for name, x in parts.items() if isinstance(x, np.ndarray) and len(x) == len(t)}
        return replace(of, **{name: x[taken] for name, x in columns.items()})

    filtered = measurement.filtered
    if filtered is not None:
        starts = tuple(int(k) for k in np.searchsorted(taken, filtered.starts))
        filtered = replace(rows(filtered), starts=starts)
    return replace(
        measurement,
        recording=rows(measurement.recording),
        angles=rows(measurement.angles),
        filtered=filtered,
        compared={name: rows(other) for name, other in measurement.compared.items()},
    )


def load_kernels(settings: AoaSettings, methods: Methods | None = None, compare: bool = False) -> None:
    """Load, or compile, the kernels that `measure` uses, so that they do not count in its time."""
    if methods is not None and not compare:
        return
    of = problem(settings)
    live_band.load_kernels(of)
    if settings.estimator.smooth or compare:
        smoother.load_kernels(of)


def measure(
    record: Record,
    settings: AoaSettings,
    methods: Methods | None = None,
    compare: bool = False,
    progress: Callable[[str], None] = lambda _: None,
    known: tuple[Mapping[str, float], Mapping[tuple[str, str], float]] | None = None,
) -> Measurement:
    """Measure the angle of attack of a model from a record of ``t``, ``a1`` .. and ``gyro``.

    ``gyro_roll``, ``gyro_yaw``, ``point``, ``trigger`` and ``theta_ref`` are used where the record has them.
    ``methods`` are those of the paper, None for the fusion; with ``compare`` the angles are also found by the fusion of
    8 and 19 states, causal and smoothed, and by the paper's methods. ``progress`` is called with each step, in words.
    ``known`` coefficients, values by name and covariances by pairs of names, take the place of those of an earlier
    result.

    The status of the estimate says whether the angles can be used: nothing is raised for poor ones. `InputError` is
    raised where the record has not the channels of a model, the study does not fit it, or an earlier result cannot be
    used.
    """
    clock = time.perf_counter()
    prior = settings.estimator.prior
    posterior = None
    if prior is not None:
        posterior, settings = load_posterior(prior, settings), corrected(prior, settings)
    recording = recording_of(record, settings)
    if not recording.spatial:
        settings.attitude.check_pitch_shows()
    delay = relative_delay(recording, settings.layout)
    stated, settings = settings, decided_with(recording, settings, delay)
    findings = [*implausible(*fused_case(recording, settings)), *of_vibration(stated, settings)]
    zeroed = recording if settings.zero is None else with_zero(recording, settings)
    of = problem(settings, recording.spatial, posterior if known is None else known)
    filtered: FilterResult | None = None
    if methods is None:
        progress("smoothing" if settings.estimator.smooth else "filtering")
        filtered = filter_result.estimate(zeroed, of, settings.estimator.smooth)
        angles = by_fusion(zeroed, settings, of, filtered)
        progress("looking for faults")
        found = diagnose(*fused_case(zeroed, settings), findings, settings.band.every)
        findings += found
        named = any(each.harm and not each.code.endswith("_scatter") for each in findings)
        findings += [*of_delay(delay, of, filtered), *unseen(zeroed, of, settings, named)]
        findings += of_flexure(zeroed, of, filtered, settings)
        known_u = angles.u[np.isfinite(angles.u)]
        if len(known_u):
            findings += of_rectification(recording, settings, float(np.median(known_u)))
    else:
        progress(label(methods))
        angles = by_methods(recording, settings, methods)
    compared = _compared(zeroed, settings, angles, progress) if compare else {}
    findings = [*findings, *beyond_limits(angles, recording.t, settings)]
    progress("assembling")
    at_rest = points(recording, angles, settings)
    judged: dict[str, Errors] = {}
    verified = None
    if recording.reference is not None and np.isfinite(recording.reference).any():
        progress("fitting the sensors to the reference angle")
        judged = {each.method: errors(recording, each) for each in (angles, *compared.values())}
        verified = _fitted(recording, settings, at_rest)
        if filtered is not None:
            findings = [*findings, *late_reference(recording, angles)]
    behind = (findings, delay, at_rest, judged, compared, verified)
    if filtered is None:
        estimate = assemble_paper(recording, settings, angles, *behind)
    else:
        estimate = assemble(zeroed, settings, of, filtered, *behind, angles=angles)
    estimate = replace(estimate, timing={"solve": time.perf_counter() - clock})
    return Measurement(
        estimate, settings, of, recording, angles, filtered, at_rest, delay, judged, verified, compared
    )


def _fitted(recording: Recording, settings: AoaSettings, at_rest: tuple[Point, ...]) -> Verified | None:
    """The sensors fitted to the reference angle; None where there is too little of it."""
    try:
        if at_rests_alone(recording):
            return static_fit(recording, settings, [(each.start, each.stop) for each in at_rest])
        return fit(recording, settings)
    except RecordError:
        return None


def _compared(
    recording: Recording, settings: AoaSettings, done: Angles, progress: Callable[[str], None]
) -> dict[str, Angles]:
    """The angles of other methods by name: the fusion large and small, causal and smoothed, and the paper's ways."""
    others: dict[str, Angles] = {}
    for states in (8, 19):
        for smoothed in (False, True):
            estimator = replace(settings.estimator, states=states, smooth=smoothed, prior=None)
            chosen = replace(settings, estimator=estimator)
            name = f"{'smoothed' if smoothed else 'fusion'} {states}"
            if name != done.method:
                progress(name)
                of = problem(chosen, recording.spatial)
                filtered = filter_result.estimate(recording, of, smoothed)
                others[name] = by_fusion(recording, chosen, of, filtered)
    for methods in MEASURED:
        if label(methods) == done.method:
            continue
        progress(label(methods))
        try:
            others[label(methods)] = by_methods(recording, settings, methods)
        except InputError:  # two axes, or no gyro: not for every method
            continue
    if (paper := others.get(label(MEASURED[0]))) is not None:
        filtered_after = low_passed(paper, recording.t)
        others[filtered_after.method] = filtered_after
    return others
