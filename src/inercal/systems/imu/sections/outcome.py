"""Calibration of an IMU from sections of recordings: recordings and a study in, an estimate out."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import PurePath
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError

from inercal.foundation.arrays import short_repr
from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Finding, Status
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.records.column import Triad
from inercal.foundation.records.places import counted
from inercal.foundation.records.record import Record, recorded_temperature
from inercal.foundation.results.basis import Formula, conditions_of, studied
from inercal.foundation.results.budget import BudgetItem, Uncertainty
from inercal.foundation.results.result import Estimate, timed
from inercal.foundation.units import RAW, Quantity
from inercal.systems.imu.limits import LIMITS as IMU_LIMITS
from inercal.systems.imu.rows import is_counted, rows_of
from inercal.systems.imu.sections.calibration import SectionCalibration, calibrate_sections
from inercal.systems.imu.sections.cutting.between import SwingStretch
from inercal.systems.imu.sections.cutting.by_hand import by_hand
from inercal.systems.imu.sections.cutting.limits import LIMITS as CUTTING
from inercal.systems.imu.sections.cutting.proposal import Proposal
from inercal.systems.imu.sections.cutting.table import SectionRow, of_tables, read_table
from inercal.systems.imu.sections.findings import findings_of, verdict
from inercal.systems.imu.sections.missing import missing
from inercal.systems.imu.sections.move_findings import findings_of_moves, of_channels
from inercal.systems.imu.sections.priors import Priors, Size
from inercal.systems.imu.sections.resolution import resolution_finding, with_resolution
from inercal.systems.imu.sections.section import Section
from inercal.systems.imu.sections.shorthands import (
    Shorthand,
    alone,
    gyro_of_means,
    proposal_of,
    word_of,
)
from inercal.systems.imu.sections.swung import calibrate_swing
from inercal.systems.imu.sections.tables import (
    budget_item,
    of_moves,
    of_poses,
    of_sections,
    of_turns,
    relative_alignment,
)
from inercal.systems.imu.sections.trend import trend_findings
from inercal.systems.imu.sections.with_moves import calibrate_with_moves
from inercal.systems.imu.settings import COMMAND, MASKED, ImuSettings, KnownRatesSettings, SectionsSettings

MODEL = Formula(
    r"Accelerometers $y = K_0 + K_1 (l + K_2 l^2)$, $l = M f$; gyro $y = D_F + S T \omega + G f$, mean outputs of "
    "sections of which directions, rates and angles are known or not, each within its u; $M$, $T$ of unit diagonal. "
    "Variances that nobody states by restricted likelihood."
)
REFERENCES = (
    "Patterson, Thompson, Recovery of inter-block information when block sizes are unequal, Biometrika 58 (1971) 545",
)
_KNOWN = "axes of the case, by the known directions and axes"
_OWN = "z along the input axis of accelerometer z, y in the plane of the input axes of accelerometers y and z"
_OF_GYRO = "z along the input axis of gyro z, y in the plane of the input axes of gyros y and z"


@short_repr
@dataclass(frozen=True, eq=False)
class CalibrationFromSections:
    """An ``estimate``, the ``sections`` that were read, and, where there was a fit, the calibration ``found`` and the
    ``proposal`` with the recordings."""

    estimate: Estimate
    sections: tuple[Section, ...]
    found: SectionCalibration | None = None
    proposal: Proposal | None = None


def calibrate_from_sections(
    records: Sequence[Record],
    settings: ImuSettings,
    options: SectionsSettings | Shorthand | None,
    progress: Callable[[str], None] = lambda _: None,
) -> CalibrationFromSections:
    """Calibrate from the sections that a study states, that names and recordings tell, or that a shorthand stands for;
    without ``options`` from the poses of one log in the hand and the moves between them.

    Raises
    ------
    InputError
        A recording without either triad, recordings in several units, or sections that do not fit them.
    """
    clock = time.perf_counter()
    progress("reading the sections")
    named, temperature = by_file(records), recorded_temperature(records[0])
    if options is None:
        ((name, record),) = named.items()
        proposal = by_hand(name, record, settings)
        sections, method, notes = proposal.sections, "multiposition", proposal.notes
    elif isinstance(options, SectionsSettings):
        refuse_samples(named)
        proposal = _proposal(named, options)
        sections = tuple(_placed(section, options) for section in proposal.sections)
        method, notes = "sections", proposal.notes
    else:
        named = {name: alone(record, options) for name, record in named.items()}
        refuse_samples(named)
        proposal = proposal_of(named, options, settings.exclude)
        sections, method = proposal.sections, word_of(options)
        notes = (*proposal.notes, *gyro_of_means(records, options))
    records = list(named.values())
    units = {sensor: _unit(sensor, records) for sensor in ("acc", "gyro")}
    findings = (*_of_records(records), *proposal.questions, *notes)
    sources = [source for record in records for source in record.sources]
    bases = studied(COMMAND, settings, sources, MODEL, REFERENCES)
    none: Mapping[str, Any] = {"method": method, "sections": []}
    if not sections and proposal.swings:
        progress("fitting the swing")
        return CalibrationFromSections(
            timed(_by_swing(proposal.swings[0], settings, records, units, findings), clock), sections
        )
    if not sections:
        why = "; ".join(f"{name} {reason}" for name, reason in proposal.unused.items())
        text = why or "found no section that can be read: state them in a table, imu.sections"
        estimate = Estimate.without(bases, Status.TOO_FEW_INTERVALS, text, findings=findings, result=none)
        return CalibrationFromSections(timed(estimate, clock), sections)
    priors = _priors(settings, units)
    if options is None:  # a bias that wanders from pose to pose is more than noise
        priors = replace(priors, excess=frozenset({"gyro"}))
    # moves tell the gyro's scale
    lacking = missing([replace(s, gyro=None) for s in sections] if proposal.moves else sections, priors)
    if lacking is not None:
        what = ", ".join(lacking.terms)
        text = f"the sections leave {what} open: add {lacking.cure}"
        estimate = Estimate.without(bases, Status.UNOBSERVABLE, text, findings=findings, result=none)
        return CalibrationFromSections(timed(estimate, clock), sections)
    progress("fitting the sections")
    used = 0
    try:
        if proposal.moves:
            moved = calibrate_with_moves(sections, [one.move for one in proposal.moves], priors)
            found, asked = moved.calibration, of_channels(moved)
            findings = (
                *findings,
                *asked,
                *findings_of_moves(moved, proposal.moves, numbered=options is None),
            )
            proposal = replace(proposal, questions=(*proposal.questions, *asked))
            used = len(moved.used)
        else:
            found = calibrate_sections(sections, priors)
    except LinAlgError:
        text = "the sections leave some combination of coefficients open: add rests on all six sides"
        estimate = Estimate.without(bases, Status.UNOBSERVABLE, text, findings=findings, result=none)
        return CalibrationFromSections(timed(estimate, clock), sections)
    if options is None:
        found = replace(found, excess=found.excess - {"gyro"})
    if units["gyro"] is not None:
        steps = np.array(proposal.steps)
        found = with_resolution(found, steps)
        findings = (*findings, *resolution_finding(steps, units["gyro"].unit.symbol))
    if isinstance(options, KnownRatesSettings):
        findings = (*findings, *trend_findings(found))
    estimate = _estimate(found, settings, records, units, proposal, findings, temperature, used)
    more: dict[str, Any] = {"method": method}
    if options is None:
        more |= {"intervals": of_poses(found, proposal), "turns": of_turns(found)}
    estimate = replace(estimate, result={**estimate.result, **more})
    return CalibrationFromSections(timed(estimate, clock), sections, found, proposal)


def _priors(settings: ImuSettings, units: Mapping[str, Triad | None]) -> Priors:
    """Priors by what the study says of the site, the clock and the instrument."""
    return Priors(
        settings.site,
        clock_u=settings.time_base_u,
        acc_scale=_scale(units["acc"]),
        gyro_scale=_scale(units["gyro"]),
        k2=math.inf if settings.k2 else settings.k2_u,
    )


def _by_swing(
    stretch: SwingStretch,
    settings: ImuSettings,
    records: Sequence[Record],
    units: Mapping[str, Triad | None],
    findings: Sequence[Finding],
) -> Estimate:
    """The estimate by a log in which nothing rests."""
    sources = [source for record in records for source in record.sources]
    bases = studied(COMMAND, settings, sources, MODEL, REFERENCES)
    result: dict[str, Any] = {"method": "sections", "sections": []}
    never = f"the instrument is never still for {CUTTING.shortest_hold:g} s, and as a swing it tells nothing"
    try:
        swung = calibrate_swing(stretch, _priors(settings, units))
    except RecordError as error:
        text = f"{never}: {error}"
        return Estimate.without(bases, Status.TOO_FEW_INTERVALS, text, findings=findings, result=result)
    if swung.acc.refusal:
        text = f"{never}: {swung.acc.refusal}"
        return Estimate.without(bases, Status.INCONSISTENT, text, findings=findings, result=result)
    g, symbols = settings.site.gravity, {s: t.unit.symbol for s, t in units.items() if t is not None}
    ranges: dict[str, Any] = {"specific_force_along_an_axis_m_s2": [-g, g]}
    conditions = conditions_of(settings, recorded_temperature(records[0]), ranges, frame=_OWN)
    basis = studied(COMMAND, settings, sources, MODEL, REFERENCES, conditions)
    names = swung.names
    share = dict.fromkeys(names, 1.0)
    item = BudgetItem("scatter of specific force in the swing", "A", swung.acc.scatter, "m/s^2", share, True)
    row = {"section": stretch.name, "kind": "swing", "where": stretch.where, "why": "nothing rests"}
    kept = [one for one in findings if one.code != "not_at_rest"]
    return Estimate.of(
        basis,
        names,
        [TERMS[name].unit_for(symbols["acc" if name.startswith(("K", "M")) else "gyro"]) for name in names],
        swung.x,
        Uncertainty(swung.covariance, np.full(len(names), swung.dof), (item,)),
        (Status.OK, f"{len(names)} coefficients from {swung.acc.windows} windows of a swing"),
        findings=(*kept, *swung.findings()),
        statistics={"intervals": float(swung.acc.windows)},
        result={
            **result,
            "sections": [row],
            "by_prior": list(swung.acc.by_prior),
            "scatter": {"acc": swung.acc.scatter},
            "unit": symbols,
        },
    )


def by_file(records: Sequence[Record]) -> dict[str, Record]:
    """The records by the names of their files."""
    named: dict[str, Record] = {}
    for record in records:
        name = PurePath(record.sources[0].path).name if record.sources else "recording"
        named[name if name not in named else f"{name} ({len(named) + 1})"] = record
    return named


def _unit(sensor: str, records: Sequence[Record]) -> Triad | None:
    """A triad of the records, which tells the unit of all; None where there is none."""
    triads = [
        record.triad(sensor) for record in records if all(f"{sensor}_{axis}" in record for axis in "xyz")
    ]
    symbols = {triad.unit.symbol for triad in triads}
    if len(symbols) > 1:
        raise RecordError(
            triads[-1].source.path,
            f"found {sensor} in {' and '.join(sorted(symbols))}, expected one unit in all files",
        )
    return triads[0] if triads else None


def refuse_samples(named: Mapping[str, Record]) -> None:
    """Refuse rows without times that are samples of a recording: most of many are like the one before.

    Raises `RecordError`.
    """
    for name, record in named.items():
        sensor = "acc" if "acc_x" in record else "gyro"
        if not is_counted(record) or f"{sensor}_z" not in record:
            continue
        values = record.triad(sensor).values
        size = max(float(np.nanmax(np.ptp(values, axis=0))), float(np.nanmax(np.abs(values))))
        alike = np.linalg.norm(np.diff(values, axis=0), axis=1) < 10.0 * IMU_LIMITS.same_pose * size
        if len(values) > IMU_LIMITS.most_poses and np.mean(alike) > 0.5:
            raise RecordError(
                name,
                f"found {len(values)} rows, most of them like the one before, expected one row for each pose, or of "
                'a recording a time column t and imu.method = "sections"',
            )


def _scale(triad: Triad | None) -> Size | None:
    """The scale factors of physical outputs beforehand; None in counts."""
    return None if triad is None or triad.unit.dimension in RAW else Size(1.0 / triad.unit.factor, 0.05)


def _proposal(named: Mapping[str, Record], options: SectionsSettings) -> Proposal:
    """The sections that the study states, or that recordings tell."""
    rows: tuple[SectionRow, ...] = ()
    if options.table is not None:
        rows = read_table(options.table)
    elif options.rows:
        rows = of_tables(options.rows)
    return Proposal.by(rows, named) if rows else Proposal.of(named)


def _placed(section: Section, options: SectionsSettings) -> Section:
    """The section with the placing and level of all where it states none."""
    turning = section.kind in ("rate", "turn")
    return replace(
        section,
        up_u=options.placing if section.up_u is None else section.up_u,
        axis_u=options.placing if section.axis_u is None else section.axis_u,
        level_u=options.level if turning and section.level_u is None else section.level_u,
    )


def _of_records(records: Sequence[Record]) -> tuple[Finding, ...]:
    """Findings about the recordings; those about time do not hold for rows of means."""
    found: dict[Finding, None] = {}
    for record in records:
        counted = is_counted(record)
        sensor = "acc" if "acc_x" in record else "gyro"
        for finding in rows_of(record, sensor)[2] if counted else record.findings:
            found[replace(finding, harm=()) if finding.code in MASKED else finding] = None
    return tuple(found)


def _estimate(
    found: SectionCalibration,
    settings: ImuSettings,
    records: Sequence[Record],
    units: Mapping[str, Triad | None],
    proposal: Proposal,
    findings: Sequence[Finding],
    temperature: Quantity | None,
    moves: int,
) -> Estimate:
    """Put the estimate together; so many ``moves`` were used."""
    triads = {sensor: triad for sensor, triad in units.items() if triad is not None}
    symbols = {sensor: triad.unit.symbol for sensor, triad in triads.items()}
    g, readings = settings.site.gravity, found.problem.readings
    ranges: dict[str, Any] = {"specific_force_along_an_axis_m_s2": [-g, g]}
    if np.any(readings.rate != 0.0):
        ranges["rate_of_turn_rad_s"] = float(np.max(np.abs(readings.rate)))
    known = bool(
        np.any(readings.know_up & readings.has_force) or np.any(readings.know_axis & (readings.rate != 0.0))
    )
    own = _OWN if "acc" in triads else _OF_GYRO
    conditions = conditions_of(settings, temperature, ranges, frame=_KNOWN if known else own)
    sources = [source for record in records for source in record.sources]
    basis = studied(COMMAND, settings, sources, MODEL, REFERENCES, conditions)
    budget = tuple(
        budget_item(found, source, {n: float(s) for n, s in zip(found.names, shares, strict=True) if s > 0.0})
        for source, shares in found.budget.items()
    )
    return Estimate.of(
        basis,
        found.names,
        [
            TERMS[name].unit_for(symbols["acc" if name.startswith(("K", "M")) else "gyro"])
            for name in found.names
        ],
        found.x,
        Uncertainty(found.covariance, found.dof, budget),
        _verdict(found, proposal, moves),
        findings=(*findings, *findings_of(found)),
        statistics={
            "dof": found.freedom,
            "chi2": found.chi2,
            "probability": found.probability,
            "intervals": float(len(readings.sections)),
            **({"turns": float(moves)} if moves else {}),
        },
        result={
            "method": "sections",
            "sections": [*of_sections(found), *of_moves(proposal)],
            "unused": dict(proposal.unused),
            "by_prior": list(found.by_prior),
            "scatter": dict(found.scatter),
            "relative_alignment": relative_alignment(found),
            "unit": symbols,
        },
    )


def _verdict(found: SectionCalibration, proposal: Proposal, moves: int) -> tuple[Status, str]:
    """Status and message, in which moves count as well."""
    status, message = verdict(found, proposal.questions)
    if status is not Status.OK or not proposal.moves:
        return status, message
    if not moves:
        return (
            Status.TOO_FEW_INTERVALS,
            f"{message}; no move between them can be used, so that the gyro is not calibrated: see the findings",
        )
    return status, f"{message} and {counted(moves, 'move')}"
