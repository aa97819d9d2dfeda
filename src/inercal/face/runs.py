"""A task run on the records of one or several runs, and what makes its results traceable."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, TypeVar

from inercal.errors import InputError
from inercal.estimate.basis import Basis, provenance
from inercal.estimate.result import Estimate
from inercal.face.study import Study
from inercal.findings import Finding, Status
from inercal.records.record import Record

Progress = Callable[[str], None]
"""Told, in words, what is being done."""

T = TypeVar("T")


def calibrations(
    records: Sequence[Record],
    study: Study,
    progress: Progress,
    calibrate: Callable[[Record, Any, Progress], T],
) -> list[T]:
    """What ``calibrate`` finds in each record, its inputs with the files of the study."""
    found = []
    with study.at_fault():
        for number, record in enumerate(records, start=1):
            of_run = f"run {number} of {len(records)}: " if len(records) > 1 else ""

            def said(text: str, of_run: str = of_run) -> None:
                progress(of_run + text)

            found.append(_traced(calibrate(record, study.settings, said), record, study))
    return found


def one_run(records: Sequence[Record], instead: str) -> Record:
    """The record, where there is one; else a refusal that says what to do ``instead``. Raises `InputError`."""
    if len(records) > 1:
        second, first = records[1].sources, records[0].sources
        raise InputError(
            second[0].path if second else "records",
            f"has the channels of {first[0].path if first else 'the first'}, expected one run: {instead}",
        )
    return records[0]


def _traced(found: Any, record: Record, study: Study) -> Any:
    """The calibration, its estimate with the span of the record and with the study among its inputs."""
    from inercal.records.read import source_of

    estimate = with_span(found.estimate, record)
    return replace(found, estimate=replace(estimate, inputs=(*estimate.inputs, *map(source_of, study.files))))


def with_span(estimate: Estimate, record: Record) -> Estimate:
    """The estimate, saying what part of the recording it is of."""
    if not record.span:
        return estimate
    return replace(estimate, provenance={**estimate.provenance, "span": dict(record.span)})


def without_coefficients(
    command: str,
    message: str,
    result: dict[str, Any],
    study: Study,
    findings: Sequence[Finding] = (),
    timing: dict[str, float] | None = None,
    references: tuple[str, ...] = (),
) -> Estimate:
    """The result of a task on a study alone, which estimates no coefficients."""
    from inercal.records.read import source_of

    inputs = tuple(map(source_of, study.files))
    basis = Basis(command, inputs=inputs, provenance=provenance(study.keys), references=references)
    estimate = Estimate.without(basis, Status.OK, message, findings=findings, result=result)
    return replace(estimate, timing=timing or {})
