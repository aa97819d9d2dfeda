"""Calibration after Ferraris: six rests on sides and three turns by a known angle, as sections of one recording."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import pairwise

import numpy as np
from scipy.linalg import LinAlgError

from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.findings import EVERYTHING, Finding, Status, settled
from inercal.foundation.records.column import Triad
from inercal.foundation.records.places import counted_names
from inercal.foundation.records.record import Record, recorded_temperature
from inercal.foundation.results.basis import studied
from inercal.foundation.results.result import Estimate, timed
from inercal.systems.imu.ferraris.closed_form import imucal_coefficients
from inercal.systems.imu.ferraris.names import NAMES, POSITIONS, in_words
from inercal.systems.imu.ferraris.nine import NineSections, nine_sections
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.sections.cutting.between import with_moves_between
from inercal.systems.imu.sections.cutting.cut import Stretch
from inercal.systems.imu.sections.cutting.proposal import Proposal, RecordedTriads
from inercal.systems.imu.sections.cutting.sense import Sense, sense_of
from inercal.systems.imu.sections.outcome import (
    MODEL,
    REFERENCES,
    CalibrationFromSections,
    of_proposal,
)
from inercal.systems.imu.sections.recordings import by_file
from inercal.systems.imu.sections.section import Section
from inercal.systems.imu.settings import COMMAND, MASKED, FerrarisSettings, ImuSettings


def calibrate_ferraris(
    record: Record,
    settings: ImuSettings,
    options: FerrarisSettings,
    progress: Callable[[str], None] = lambda _: None,
) -> CalibrationFromSections:
    """Calibrate accelerometers and gyro from six rests on sides and three turns.

    Parameters
    ----------
    record : Record
        ``acc_x..z`` and ``gyro_x..z`` in any unit, counts included; perhaps labels.
    settings : ImuSettings
        Site, clock and what goes with the result.
    options : FerrarisSettings
        The turns, alignment and sections.
    progress : callable
        Takes the progress in words.

    Returns
    -------
    CalibrationFromSections
        In the frame of the sides. Turns are positive about the positive axis by the right-hand rule. The estimate's
        ``result`` has under ``imucal`` what that program makes of the same sections.

    Raises
    ------
    InputError
        No accelerometer or gyro triad, a sensor that never changes, or sections that do not fit the record.
    """
    clock = time.perf_counter()
    for sensor in ("acc", "gyro"):
        _check(record.triad(sensor))
    if options.turn == 0.0:
        raise StudyError("imu.ferraris.turn", "found 0, expected an angle other than 0")
    progress("finding the sections")
    (file,) = by_file([record])
    nine = nine_sections(record, file, options)
    if nine.missing:
        found = CalibrationFromSections(_without(record, nine, settings), ())
        return replace(found, estimate=timed(found.estimate, clock))
    if _run_into_each_other(nine, record):
        record = _with_a_clock_that_goes_on(record)
        nine = nine_sections(record, file, options)
    if options.sections:
        record = replace(record, labels=())  # the study names other rows
    proposal = Proposal.by(with_moves_between(nine.rows), {file: record})
    moves = [one.move for one in proposal.moves]
    sense = sense_of(proposal.sections, moves, 1.0 / record.triad("gyro").rate)
    if sense.backward:
        proposal = Proposal.by(nine.rows, {file: record}, backward=True)
    triads = RecordedTriads.of(file, record)
    stretches: dict[str, list[Stretch]] = {}
    for row in nine.rows:
        stretches.setdefault(row.section.split()[0], []).append(triads.stretch(row))
    questions = (
        *(one for one in nine.findings if one.harm),
        *_useless(proposal.notes),
        *_moving(stretches),
        *proposal.questions,
    )
    questions = questions or tuple(_against(sense, options))
    notes = [*(one for one in proposal.notes if one.code == "turn_cut"), *_unused_labels(nine)]
    notes += [one for one in nine.findings if not one.harm]
    notes += [] if questions else _backward(sense, options)
    sections = tuple(_by_hand(section) for section in proposal.sections)
    proposal = replace(proposal, sections=sections, questions=questions, notes=tuple(notes), moves=())
    if questions:
        found = CalibrationFromSections(_contradicted(record, questions, notes, settings), sections)
    else:
        temperature = recorded_temperature(record)
        found = of_proposal(
            proposal, [record], settings, backward=sense.backward, temperature=temperature, progress=progress
        )
    result = {**found.estimate.result, "found_by": nine.found_by}
    with suppress(LinAlgError, FloatingPointError), np.errstate(divide="raise", invalid="raise"):
        told = {name: tuple(parts) for name, parts in stretches.items()}
        result["imucal"] = imucal_coefficients(told, options.turn, settings.site.gravity)
    return replace(found, estimate=timed(replace(found.estimate, result=result), clock))


def _by_hand(section: Section) -> Section:
    """The section; of a turn without the accelerometers, for the rests beside it are those of a hand."""
    return section if section.kind == "rest" else replace(section, acc=None, acc_after=None, acc_var=None)


def _check(triad: Triad) -> None:
    """Raise where a triad cannot be one of a recording."""
    where = triad.source.path
    if not triad.rate > 0.0:
        raise RecordError(
            where,
            f"found {len(triad.t)} samples of {triad.sensor} without increasing time stamps, expected a recording",
        )
    for axis, values in zip("xyz", triad.values.T, strict=True):
        finite = values[np.isfinite(values)]
        if not finite.size or np.ptp(finite) == 0.0:
            raise RecordError(where, f"{triad.sensor}_{axis} never changes, expected a live sensor")


def _run_into_each_other(nine: NineSections, record: Record) -> bool:
    """True where sections share times because the clock was set back between them."""
    ends = sorted((row.begin or 0.0, row.end or 0.0) for row in nine.rows)
    over = any(begin < end for (_, end), (begin, _) in pairwise(ends))
    return over and bool(np.any(np.diff(record["acc_x"].t) < 0.0))


def _with_a_clock_that_goes_on(record: Record) -> Record:
    """The record with time stamps that never run backward: steps that do are of the usual length."""
    anew = {}
    for t in {id(column.t): column.t for column in record.columns.values()}.values():
        steps = np.diff(t)
        usual = float(np.median(steps[steps > 0.0]))
        anew[id(t)] = np.concatenate([t[:1], t[0] + np.cumsum(np.where(steps > 0.0, steps, usual))])
    columns = {name: replace(column, t=anew[id(column.t)]) for name, column in record.columns.items()}
    return replace(record, columns=columns)


def _without(record: Record, nine: NineSections, settings: ImuSettings) -> Estimate:
    """The estimate of a recording that lacks a section: no parameters, but which it is, and what to do."""
    wanted = ", ".join(f"{name} ({in_words(name)})" for name in nine.missing)
    how = {
        "labels": "label it in the recording",
        "study": "name it under imu.ferraris.sections",
        "detection": "record it, or name it under imu.ferraris.sections",
    }[nine.found_by]
    how = how if len(nine.missing) == 1 else how.replace(" it", " them")
    strange = f" (found the labels {counted_names(nine.strange)})" if nine.strange else ""
    there = len(NAMES) - len(nine.missing)
    text = f'found {there} of the nine sections, not {wanted}: {how}, or use method = "sections"{strange}'
    return Estimate.without(
        studied(COMMAND, settings, record.sources, MODEL, REFERENCES),
        Status.TOO_FEW_INTERVALS,
        text,
        findings=(*settled(record.findings, *MASKED), *nine.findings),
        statistics={"intervals": float(there)},
        result={
            "method": "sections",
            "found_by": nine.found_by,
            "sections": [
                {"section": row.section, "kind": row.kind, "where": f"{row.begin:.2f} s to {row.end:.2f} s"}
                for row in nine.rows
            ],
        },
    )


def _contradicted(
    record: Record, questions: Sequence[Finding], notes: Sequence[Finding], settings: ImuSettings
) -> Estimate:
    """The estimate of a recording whose sections are not what is said of them: no parameters."""
    return Estimate.without(
        studied(COMMAND, settings, record.sources, MODEL, REFERENCES),
        Status.INCONSISTENT,
        questions[0].message,
        findings=(*settled(record.findings, *MASKED), *questions, *notes),
        result={"method": "sections", "sections": []},
    )


def _useless(notes: Sequence[Finding]) -> Iterator[Finding]:
    """Sections of no use: without one of the nine there is no calibration."""
    yield from (replace(one, harm=EVERYTHING) for one in notes if one.code != "turn_cut")


def _moving(stretches: Mapping[str, Sequence[Stretch]]) -> Iterator[Finding]:
    """Sides on which the instrument was not still."""
    for sensor in ("acc", "gyro"):
        sizes = {
            name: max(
                float(np.linalg.norm(np.var(getattr(one, sensor).values, axis=0))) for one in stretches[name]
            )
            for name in POSITIONS
        }
        usual = float(np.median(list(sizes.values())))
        for name, size in sizes.items():
            if size > LIMITS.position_variance * usual > 0.0:
                text = (
                    f"The instrument moves in {name}: {sensor} varies {math.sqrt(size / usual):.0f} times as "
                )
                act = "Move its ends to where it rests, or record it again."
                yield Finding(
                    "poor_section", f"{text}much as on the other sides.", harm=EVERYTHING, action=act
                )


def _against(sense: Sense, options: FerrarisSettings) -> Iterator[Finding]:
    """Findings where the motion between the rests speaks against the turns as they are stated."""
    if sense.denied:
        yield Finding(
            "sign_suspect",
            "The motion between the rests shows that the turns were made against the stated sense.",
            harm=EVERYTHING,
            action=f'State imu.ferraris.turn = "{-math.degrees(options.turn):g} deg".',
        )
    elif sense.contradicted:
        yield Finding(
            "contradiction",
            f"Gyro and accelerometers contradict each other by {math.degrees(sense.stated):.0f} deg from rest to rest.",
            harm=EVERYTHING,
            action="Check the order and signs of the gyro's axes, and the angle of the turns.",
        )


def _backward(sense: Sense, options: FerrarisSettings) -> list[Finding]:
    """A gyro that runs against the stated sense on all axes; a negative sense of turns was stated on purpose."""
    if not sense.backward:
        return []
    told = sense.stated < LIMITS.vertical_miss
    act = "The gyro counts against the right-hand rule"
    other = "or the sign of imu.ferraris.turn is wrong: the motion between the rests, which would tell, is not there"
    return [
        Finding(
            "sign_suspect",
            "All three gyro axes run against the stated sense of the turns, so that S is negative.",
            harm=() if told or options.turn < 0.0 else ("gyro",),
            action=f"{act}." if told else f"{act}, {other}.",
        )
    ]


def _unused_labels(nine: NineSections) -> list[Finding]:
    """``unused_labels``: the record is labelled, but no label names a section, so that these were detected."""
    if nine.found_by != "detection" or not nine.strange:
        return []
    text = f"The labels {counted_names(nine.strange)} name no side or turn: sections were detected instead."
    return [
        Finding(
            "unused_labels", text, action='State them under imu.ferraris.sections, such as x_p = "LABEL".'
        )
    ]
