"""The task of the command: angles of attack from a record, by one estimator or side by side by all."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from inercal.foundation.arrays import short_repr
from inercal.foundation.errors import InputError, RecordError
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate
from inercal.systems.aoa.angles import Angles
from inercal.systems.aoa.diagnosis.choice import decided_with, of_vibration
from inercal.systems.aoa.diagnosis.examination import implausible
from inercal.systems.aoa.estimation import ESTIMATORS, PreparedRecording, estimator_of
from inercal.systems.aoa.fusion.band import fused_case
from inercal.systems.aoa.fusion.filter_result import FusionResult
from inercal.systems.aoa.fusion.problem import FusionProblem, problem
from inercal.systems.aoa.paper.delay import Delay, relative_delay
from inercal.systems.aoa.paper.methods import MEASURED, label, low_passed
from inercal.systems.aoa.reading.from_record import recording_of
from inercal.systems.aoa.reading.recording import Recording, later
from inercal.systems.aoa.reading.wind_off_zero import with_zero
from inercal.systems.aoa.reference.sensor_fit import Verified, fit
from inercal.systems.aoa.reference.static_fit import at_rests_alone, static_fit
from inercal.systems.aoa.result.carry_over import corrected
from inercal.systems.aoa.result.carry_over import load as load_posterior
from inercal.systems.aoa.result.columns import beyond_limits
from inercal.systems.aoa.result.outcome import assemble, assemble_angles
from inercal.systems.aoa.result.points import Point, points
from inercal.systems.aoa.result.verification import Errors, contradicting_reference, errors
from inercal.systems.aoa.settings import AoaSettings


@short_repr
@dataclass(frozen=True, eq=False)
class Measurement:
    """An ``estimate``, and the data behind it for files and pictures.

    ``settings`` are those of the study, corrected by an earlier result, with what the recording decides;
    ``angles`` of the chosen estimator; ``filtered`` of the fusion, None for the paper's methods; ``points`` at rest;
    ``delay`` of the gyro by the spectra; ``errors`` by method and ``verified`` sensors where there is a reference
    angle; ``compared`` angles of other methods, by name.
    """

    estimate: Estimate
    settings: AoaSettings
    problem: FusionProblem
    recording: Recording
    angles: Angles
    filtered: FusionResult | None
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

    def rows(table: Any) -> Any:
        """A dataclass of arrays by row with only the later rows."""
        values = {column.name: getattr(table, column.name) for column in fields(table)}
        columns = {name: x for name, x in values.items() if isinstance(x, np.ndarray) and len(x) == len(t)}
        return replace(table, **{name: x[taken] for name, x in columns.items()})

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


def load_kernels(settings: AoaSettings, compare: bool = False) -> None:
    """Load, or compile, the kernels that `measure` uses, so that they do not count in its time."""
    for chosen in (settings, *(_beside(settings) if compare else ())):
        estimator_of(chosen).load_kernels(chosen)


def measure(
    record: Record,
    settings: AoaSettings,
    compare: bool = False,
    progress: Callable[[str], None] = lambda _: None,
    known: tuple[Mapping[str, float], Mapping[tuple[str, str], float]] | None = None,
) -> Measurement:
    """Measure the angle of attack of a model from a record of ``t``, ``a1`` .. and ``gyro``.

    ``gyro_roll``, ``gyro_yaw``, ``point``, ``trigger`` and ``theta_ref`` are used where the record has them.
    With ``compare`` the angles are also found by the fusion of 8 and 19 states, causal and smoothed, and by the paper's
    methods. ``progress`` is called with each step, in words.
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
    found = estimator_of(settings).estimate(
        PreparedRecording(recording, zeroed, settings, of, delay, tuple(findings)), progress
    )
    angles, filtered = found.angles, found.filtered
    compared = _compared(zeroed, settings, angles, progress) if compare else {}
    findings = [*findings, *found.findings, *beyond_limits(angles, recording.t, settings)]
    progress("assembling")
    at_rest = points(recording, angles, settings)
    judged: dict[str, Errors] = {}
    verified = None
    if recording.reference is not None and np.isfinite(recording.reference).any():
        progress("fitting the sensors to the reference angle")
        judged = {found.method: errors(recording, found) for found in (angles, *compared.values())}
        verified = _fitted(recording, settings, at_rest)
        if filtered is not None:
            findings = [*findings, *contradicting_reference(recording, angles)]
    behind = (findings, delay, at_rest, judged, compared, verified)
    if filtered is None:
        estimate = assemble_angles(recording, settings, angles, *behind)
    else:
        estimate = assemble(zeroed, settings, of, filtered, *behind, angles=angles, passed=found.passed)
    estimate = replace(estimate, timing={"solve": time.perf_counter() - clock})
    return Measurement(
        estimate, settings, of, recording, angles, filtered, at_rest, delay, judged, verified, compared
    )


def _fitted(recording: Recording, settings: AoaSettings, at_rest: tuple[Point, ...]) -> Verified | None:
    """The sensors fitted to the reference angle; None where there is too little of it."""
    try:
        if at_rests_alone(recording):
            return static_fit(recording, settings, [(point.start, point.stop) for point in at_rest])
        return fit(recording, settings)
    except RecordError:
        return None


def _beside(settings: AoaSettings) -> list[AoaSettings]:
    """The settings that a comparison runs."""
    return [chosen for estimator in ESTIMATORS.values() for chosen in estimator.beside(settings)]


def _compared(
    recording: Recording, settings: AoaSettings, done: Angles, progress: Callable[[str], None]
) -> dict[str, Angles]:
    """The angles of other methods by name: the fusion large and small, causal and smoothed, and the paper's ways."""
    others: dict[str, Angles] = {}
    for chosen in _beside(settings):
        estimator = estimator_of(chosen)
        if (name := estimator.name(chosen)) == done.method:
            continue
        progress(name)
        try:
            others[name] = estimator.angles(recording, chosen)
        except InputError:  # two axes, or no gyro: not for every method
            continue
    if (paper := others.get(label(MEASURED[0]))) is not None:
        filtered_after = low_passed(paper, recording.t)
        others[filtered_after.method] = filtered_after
    return others
