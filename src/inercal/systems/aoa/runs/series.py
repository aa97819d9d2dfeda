"""The task of several runs: each measured with the tare of the wind-offs about it, then summed up.

The tare: errors of the sensors as wind-off runs found them, interpolated to the runs between.

At a wind-off the fusion takes the known angle as measured, and learns the biases at it. Of two wind-offs with the
coefficients x_1, P_1 and x_2, P_2 a run at the part f of the time between has

    x = (1 - f) x_1 + f x_2        P = (1 - f) P_1 + f P_2 + f (1 - f) d d^T      d = x_2 - x_1

The first two terms are the largest that covariance can be, whatever the two wind-offs have in common (the angle, the
prior), for they exceed it by f (1 - f) cov(d); the third is the variance of a random walk that goes from x_1 to x_2,
whose variance in all that time is estimated by d d^T itself. Before the first wind-off and after the last the nearest
one holds, and the same walk goes on from it.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import TypeAlias

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError, RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.inputs import Source
from inercal.foundation.instruments.terms import shown_unit, term
from inercal.foundation.records.record import Record, record_of
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import parse_unit
from inercal.systems.aoa import task
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.result.carry_over import posterior_of
from inercal.systems.aoa.result.columns import points_record
from inercal.systems.aoa.runs.outcome import AtPoint, OscillationRuns, assemble, by_point, oscillations
from inercal.systems.aoa.runs.run_table import Run, RunTable
from inercal.systems.aoa.settings import GYROS, AoaSettings, Zero
from inercal.systems.aoa.task import Measurement

Posterior: TypeAlias = tuple[Mapping[str, float], Mapping[tuple[str, str], float]]
"""Values of coefficients by name, and their covariances by pairs of names."""


@dataclass(frozen=True, eq=False)
class WindOff:
    """Coefficients found at a wind-off ``at`` a time [s or rows]: ``names`` (p,), ``values`` (p,), ``covariance`` (p,
    p), and the ``label`` of its run."""

    at: float
    label: str
    names: tuple[str, ...]
    values: Array
    covariance: Array


def interpolated(tares: Sequence[WindOff], at: float) -> tuple[Posterior, str]:
    """The coefficients at a time, and in words from which wind-offs they are."""
    before = max((each for each in tares if each.at <= at), key=lambda each: each.at, default=None)
    after = min((each for each in tares if each.at > at), key=lambda each: each.at, default=None)
    if before is not None and after is not None:
        f = (at - before.at) / (after.at - before.at)
        d = after.values - before.values
        values = before.values + f * d
        covariance = (1.0 - f) * before.covariance + f * after.covariance + f * (1.0 - f) * np.outer(d, d)
        return _posterior(before.names, values, covariance), f"{before.label} and {after.label}"
    nearest = before if after is None else after
    assert nearest is not None
    covariance = nearest.covariance
    if len(tares) > 1:
        in_time = sorted(tares, key=lambda each: each.at)
        pair = (in_time[-2], in_time[-1]) if after is None else (in_time[0], in_time[1])
        d = pair[1].values - pair[0].values
        covariance = covariance + abs(at - nearest.at) / (pair[1].at - pair[0].at) * np.outer(d, d)
    return _posterior(nearest.names, nearest.values, covariance), nearest.label


def _posterior(names: Sequence[str], values: Array, covariance: Array) -> Posterior:
    """Coefficients as `inercal.systems.aoa.fusion.problem.problem` takes them."""
    by_pair = {(a, b): float(covariance[i, j]) for i, a in enumerate(names) for j, b in enumerate(names)}
    return dict(zip(names, values.tolist(), strict=True)), by_pair


def drifts(tares: Sequence[WindOff]) -> list[Finding]:
    """``bias_drift``: biases that moved between two wind-offs by more than their uncertainty; they are interpolated."""
    found = []
    for first, second in pairwise(tares):
        u = np.sqrt(np.diag(first.covariance) + np.diag(second.covariance))
        for k, name in enumerate(first.names):
            d = float(second.values[k] - first.values[k])
            if not name.startswith("b_") or not abs(d) > LIMITS.disagreeing_sigmas * u[k]:
                continue
            of = term(name)
            assert of is not None
            unit, size = shown_unit(of.unit)
            text = (
                f"{name}: {d / size:+.3g} {unit} from {first.label} to {second.label}: the tare is interpolated, and u "
                "has the walk between"
            )
            found.append(Finding("bias_drift", text, harm=()))
    return found


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """A ``run`` and its ``measurement``; ``tare`` says in words from which wind-offs its tare is, empty without."""

    run: Run
    measurement: Measurement
    tare: str


@dataclass(frozen=True, eq=False)
class Series:
    """All runs: ``estimate`` of the whole, ``measured`` ones with the wind-offs among them, what they say at each
    point, and of each oscillation."""

    estimate: Estimate
    measured: tuple[MeasuredRun, ...]
    at_points: tuple[AtPoint, ...]
    oscillating: tuple[OscillationRuns, ...]


def measure_runs(
    table: RunTable,
    read: Callable[[Run], Record],
    settings: AoaSettings,
    compare: bool = False,
    progress: Callable[[str], None] = lambda _: None,
) -> Series:
    """Measure all runs of a table; ``read`` gives the record of each. The others as of
    `inercal.systems.aoa.task.measure`.

    Wind-offs come first: each is measured with its known angle, over all of it. Raises `InputError`, naming the file,
    where a run cannot be measured, or the study states a zero beside wind-offs.
    """
    clock = time.perf_counter()
    if settings.zero is not None and any(run.role == "wind-off" for run in table.runs):
        raise InputError("zero", "found beside wind-offs in the table of runs, expected one of the two")
    records = {run: read(run) for run in table.runs}
    at = _times(table.runs, records)
    done: dict[Run, MeasuredRun] = {}
    tares: list[WindOff] = []
    for run in table.runs:
        if run.role != "wind-off":
            continue
        progress(f"{run.name}, wind-off")
        at_rest = _at_known_angle(settings, run, records[run])
        fused = replace(at_rest, estimator=replace(at_rest.estimator, kind="fusion"))
        found = _measured(run, records[run], fused, False, progress)
        if not found.estimate.status.done:
            raise RecordError(
                run.path,
                f"the wind-off ended {found.estimate.status.value} ({found.estimate.message}), expected one at rest",
            )
        values, covariances = posterior_of(found.estimate, settings)
        names = tuple(values)
        P = np.array([[covariances[a, b] for b in names] for a in names])
        tares.append(WindOff(at[run], run.name, names, np.array([*values.values()]), P))
        done[run] = MeasuredRun(run, found, "")
    for run in table.runs:
        if run.role == "wind-off":
            continue
        progress(run.name)
        known, words = interpolated(tares, at[run]) if tares else (None, "")
        chosen = settings
        if known is not None and settings.estimator.kind != "fusion":
            chosen, known = _without_biases(settings, known), None
        found = _measured(run, records[run], chosen, compare, progress, known)
        done[run] = MeasuredRun(run, found, words)
    measured = tuple(done[run] for run in table.runs)
    winds = [found for found in measured if found.run.role != "wind-off"]
    at_points = by_point([(found.run.role, found.measurement) for found in winds])
    oscillating = oscillations([(found.run, found.measurement) for found in winds])
    findings = [*drifts(sorted(tares, key=lambda tare: tare.at)), *_clipped(winds)]
    named = [(found.run, found.measurement.estimate, found.tare) for found in measured]
    estimate = assemble(table, named, at_points, oscillating, findings, settings)
    estimate = replace(estimate, timing={"solve": time.perf_counter() - clock})
    return Series(estimate, measured, at_points, oscillating)


def _measured(
    run: Run,
    record: Record,
    settings: AoaSettings,
    compare: bool,
    progress: Callable[[str], None],
    known: Posterior | None = None,
) -> Measurement:
    """One run; a refusal names its file."""
    try:
        return task.measure(record, settings, compare, progress, known)
    except RecordError as error:
        raise RecordError(run.path, str(error).removeprefix(f"{run.path}: ")) from error


def _times(runs: Sequence[Run], records: Mapping[Run, Record]) -> dict[Run, float]:
    """Middle of each run in time [s]; without times in the table rows are one apart."""
    if runs[0].begin is None:
        return {run: float(k) for k, run in enumerate(runs)}
    lasting = {}
    for run, record in records.items():
        t = next(iter(record.columns.values())).t
        lasting[run] = 0.5 * float(np.nanmax(t) - np.nanmin(t)) if len(t) else 0.0
    return {run: (run.begin or 0.0) + lasting[run] for run in runs}


def _at_known_angle(settings: AoaSettings, run: Run, record: Record) -> AoaSettings:
    """The study with a zero over all of a wind-off."""
    assert run.angle is not None
    names = [name for name in settings.layout.names if name in record]
    t = record[names[0]].t if names else next(iter(record.columns.values())).t
    t = t[np.isfinite(t)]
    if len(t) < 2:
        raise RecordError(run.path, "found no rows with a time, expected a wind-off at rest")
    return replace(settings, zero=Zero(float(t[0]), float(t[-1]), run.angle.value, run.angle.u))


def _without_biases(settings: AoaSettings, known: Posterior) -> AoaSettings:
    """The study with the sensors' biases of a tare taken off: for methods that have no prior."""
    values, _ = known
    names = {f"b_{k}": name for k, name in enumerate(settings.layout.names, start=1)} | {"b_g": GYROS[0]}
    sensors = dict(settings.sensors)
    for coefficient, name in names.items():
        of = settings.calibration(name)
        sensors[name] = replace(of, bias=of.bias + values.get(coefficient, 0.0))
    return replace(settings, sensors=sensors)


def _clipped(measured: Sequence[MeasuredRun]) -> list[Finding]:
    """``saturation``: points in which a sensor is clipped, by run."""
    found = []
    for done in measured:
        masked = done.measurement.recording.masked
        if masked is None:
            continue
        rows = np.asarray(masked.any(axis=1))
        worst = [(rows[p.start : p.stop].mean(), p.number) for p in done.measurement.points]
        worst = [(share, number) for share, number in worst if share > LIMITS.clipped_part]
        if worst:
            numbers = ", ".join(f"{number:g}" for _, number in worst[:8])
            many = f"{len(worst)} of {len(done.measurement.points)}: points {numbers}"
            text = (
                f"{done.run.name}: sensors are clipped in {100.0 * max(worst)[0]:.2g} % of the rows of a point "
                f"at most, more than {100.0 * LIMITS.clipped_part:g} % in {many}"
            )
            found.append(Finding("saturation", text, harm=()))
    return found


def points_of(series: Series, settings: AoaSettings) -> Record:
    """The points of all runs with the wind on, a row each: those of `inercal.systems.aoa.result.columns.points_record`,
    the number of the run in the table, and its sense, 1 up, -1 down, 0 neither."""
    parts = []
    for k, done in enumerate(series.measured, start=1):
        if done.run.role == "wind-off" or not done.measurement.points:
            continue
        of = points_record(done.measurement.points, done.measurement.recording, settings)
        sense = {"up": 1.0, "down": -1.0}.get(done.run.role, 0.0)
        count = len(done.measurement.points)
        numbers = [
            ("run", parse_unit("1"), np.full(count, float(k))),
            ("sense", parse_unit("1"), np.full(count, sense)),
        ]
        own = [(column.name, column.unit, column.values) for column in of.columns.values()]
        t = next(iter(of.columns.values())).t + (done.run.begin or 0.0)
        parts.append((t, numbers + own))
    if not parts:
        raise InputError("--out", "found no points in any run, expected pauses, or a column point")
    joined = [
        (parts[0][1][i][0], parts[0][1][i][1], np.concatenate([columns[i][2] for _, columns in parts]))
        for i in range(len(parts[0][1]))
    ]
    return record_of(joined, np.concatenate([t for t, _ in parts]), Source("points of all runs", ""))
