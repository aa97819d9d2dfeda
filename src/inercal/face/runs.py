"""A task run on the records of one or several runs, and what makes its results traceable."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

from inercal.errors import InputError
from inercal.estimate.result import Estimate, without_coefficients
from inercal.face.study import Study
from inercal.records.record import Record

Progress = Callable[[str], None]
"""Callback (text) that takes the progress in words."""

T = TypeVar("T")


def calibrations(
    records: Sequence[Record],
    study: Study,
    progress: Progress,
    calibrate: Callable[[Record, Any, Progress], T],
) -> list[T]:
    """The calibration of each record, its inputs with the files of the study."""
    calibrated = []
    with study.at_fault():
        for number, record in enumerate(records, start=1):
            of_run = f"run {number} of {len(records)}: " if len(records) > 1 else ""

            def say(text: str, of_run: str = of_run) -> None:
                progress(of_run + text)

            calibrated.append(_traced(calibrate(record, study.settings, say), record, study))
    return calibrated


def of_files(
    records: Sequence[Record],
    study: Study,
    progress: Progress,
    calibrate: Callable[[Sequence[Record], Any, Progress], T],
) -> T:
    """The one calibration of records in order, its inputs with the files of the study."""
    with study.at_fault():
        calibrated: T = _traced(calibrate(records, study.settings, progress), records[0], study)
    return calibrated


def one_run(records: Sequence[Record], instead: str) -> Record:
    """The record, where there is one; else a refusal that says what to do ``instead``. Raises `InputError`."""
    if len(records) > 1:
        second, first = records[1].sources, records[0].sources
        raise InputError(
            second[0].path if second else "records",
            f"has the channels of {first[0].path if first else 'the first'}, expected one run: {instead}",
        )
    return records[0]


def designed_by(
    command: str, study: Study, search: Callable[[], T], references: tuple[str, ...]
) -> tuple[T, Estimate]:
    """Outcome of a search, with ``message``, ``result`` and ``findings``, and the result of the command."""
    from inercal.records.read import source_of

    clock = time.perf_counter()
    with study.at_fault():
        designed: Any = search()
    timing, files = {"solve": time.perf_counter() - clock}, map(source_of, study.files)
    what = designed.message, designed.result, files, designed.findings, timing, study.keys
    return designed, without_coefficients(command, *what, references=references)


def _traced(calibration: Any, record: Record, study: Study) -> Any:
    """The calibration, its estimate with the span of the record and with the study among its inputs."""
    from inercal.records.read import source_of

    estimate = with_span(calibration.estimate, record)
    return replace(
        calibration, estimate=replace(estimate, inputs=(*estimate.inputs, *map(source_of, study.files)))
    )


def with_span(estimate: Estimate, record: Record) -> Estimate:
    """The estimate, saying what part of the recording it is of."""
    if not record.span:
        return estimate
    return replace(estimate, provenance={**estimate.provenance, "span": dict(record.span)})
