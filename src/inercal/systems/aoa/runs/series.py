"""The task of several runs: each measured with the tare of the wind-offs about it, then summed up."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.errors import InputError, RecordError
from inercal.foundation.findings import Finding
from inercal.foundation.inputs import Source
from inercal.foundation.records.record import Record, record_of
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import parse_unit
from inercal.systems.aoa import task
from inercal.systems.aoa.result.carry_over import posterior_of
from inercal.systems.aoa.result.columns import points_record
from inercal.systems.aoa.runs.outcome import assemble
from inercal.systems.aoa.runs.run_table import Run, RunTable
from inercal.systems.aoa.runs.summary import AtPoint, Oscillation, by_point, oscillations
from inercal.systems.aoa.runs.tare import Posterior, WindOff, drifts, interpolated
from inercal.systems.aoa.settings import GYROS, AoaSettings, Zero
from inercal.systems.aoa.task import Measurement


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
    oscillating: tuple[Oscillation, ...]


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


_ALARM = 0.01
"""Part of the rows of a point from which clipped ones are told."""


def _clipped(measured: Sequence[MeasuredRun]) -> list[Finding]:
    """``saturation``: points in which a sensor is clipped, by run."""
    found = []
    for done in measured:
        masked = done.measurement.recording.masked
        if masked is None:
            continue
        rows = np.asarray(masked.any(axis=1))
        worst = [(rows[p.start : p.stop].mean(), p.number) for p in done.measurement.points]
        worst = [(share, number) for share, number in worst if share > _ALARM]
        if worst:
            numbers = ", ".join(f"{number:g}" for _, number in worst[:8])
            many = f"{len(worst)} of {len(done.measurement.points)}: points {numbers}"
            text = (
                f"{done.run.name}: sensors are clipped in {100.0 * max(worst)[0]:.2g} % of the rows of a point "
                f"at most, more than {100.0 * _ALARM:g} % in {many}"
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
