"""Calibration of an IMU from sections of recordings: recordings and a study in, an estimate out."""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.linalg import LinAlgError

from inercal.foundation.arrays import short_repr
from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.findings import Finding, Status
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.records.column import Triad
from inercal.foundation.records.places import counted
from inercal.foundation.records.record import Record, recorded_temperature
from inercal.foundation.results.basis import Formula, conditions_of, studied
from inercal.foundation.results.budget import BudgetItem, Uncertainty
from inercal.foundation.results.result import Estimate, timed
from inercal.foundation.units import RAW, Quantity
from inercal.systems.imu.sections.calibration import SectionCalibration, calibrate_sections
from inercal.systems.imu.sections.clocks import two_clocks
from inercal.systems.imu.sections.cutting.between import SwingStretch
from inercal.systems.imu.sections.cutting.by_hand import by_hand
from inercal.systems.imu.sections.cutting.limits import LIMITS as CUTTING
from inercal.systems.imu.sections.cutting.proposal import Proposal
from inercal.systems.imu.sections.cutting.table import stated_rows
from inercal.systems.imu.sections.findings import findings_of, verdict
from inercal.systems.imu.sections.missing import missing
from inercal.systems.imu.sections.move_findings import findings_of_moves, of_channels
from inercal.systems.imu.sections.priors import Priors, Size
from inercal.systems.imu.sections.readings import side_by_side
from inercal.systems.imu.sections.recordings import by_file, findings_of_records, refuse_samples, unit_of
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
    budget_items,
    of_moves,
    of_poses,
    of_sections,
    of_turns,
    relative_alignment,
)
from inercal.systems.imu.sections.with_moves import calibrate_with_moves
from inercal.systems.imu.settings import COMMAND, ImuSettings, SectionsSettings

MODEL = Formula(
    r"Accelerometers $y = K_0 + K_1 (l + K_2 l^2)$, $l = M f$; gyro $y = D_F + S T \omega + G f$, mean outputs of "
    "sections of which directions, rates and angles are known or not, each within its u; $M$, $T$ of unit diagonal. "
    "Variances that nobody states by restricted likelihood."
)
REFERENCES = (
    "Patterson, Thompson, Recovery of inter-block information when block sizes are unequal, Biometrika 58 (1971) 545",
)
_OPEN = "not_stated"
"""The question of sections that do not count yet: the others are fitted. Where names are denied, nothing is."""

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
        found = of_proposal(proposal, [record], settings, temperature=temperature, progress=progress)
        found = _said(found, {"method": "multiposition", **_of_hand(found)})
    elif isinstance(options, SectionsSettings):
        refuse_samples(named)
        found = of_proposal(
            _proposal(named, options), records, settings, options, temperature=temperature, progress=progress
        )
    else:
        named = {name: alone(record, options) for name, record in named.items()}
        refuse_samples(named)
        proposal = proposal_of(named, options, settings.exclude)
        proposal = replace(proposal, notes=(*proposal.notes, *gyro_of_means(records, options)))
        kept = list(named.values())
        found = of_proposal(proposal, kept, settings, temperature=temperature, progress=progress)
        found = _said(found, {"method": word_of(options)})
    return replace(found, estimate=timed(found.estimate, clock))


def _said(calibration: CalibrationFromSections, more: Mapping[str, Any]) -> CalibrationFromSections:
    """The calibration with more in its result."""
    result = {**calibration.estimate.result, **more}
    return replace(calibration, estimate=replace(calibration.estimate, result=result))


def _of_hand(calibration: CalibrationFromSections) -> Mapping[str, Any]:
    """Tables of the poses and turns of a hand; none where there was no fit."""
    found, proposal = calibration.found, calibration.proposal
    if found is None or proposal is None:
        return {}
    return {"intervals": of_poses(found, proposal), "turns": of_turns(found)}


def of_proposal(
    proposal: Proposal,
    records: Sequence[Record],
    settings: ImuSettings,
    options: SectionsSettings = SectionsSettings(),  # noqa: B008  (frozen)
    *,
    backward: bool = False,
    temperature: Quantity | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> CalibrationFromSections:
    """Calibrate from proposed sections of records; ``backward`` is a gyro that counts against the right-hand rule,
    ``temperature`` that of the recording.

    Raises `InputError` for recordings in several units, and for a frame that no section tells.
    """
    units = {sensor: unit_of(sensor, records) for sensor in ("acc", "gyro")}
    sections = tuple(placed(section, options) for section in proposal.sections)
    findings = (*findings_of_records(records), *proposal.questions, *proposal.notes)
    sources = [source for record in records for source in record.sources]

    def without(status: Status, text: str) -> CalibrationFromSections:
        if proposal.questions:
            status, text = Status.INCONSISTENT, proposal.questions[0].message
        basis = studied(COMMAND, settings, sources, MODEL, REFERENCES)
        none: Mapping[str, Any] = {"method": "sections", "sections": []}
        return CalibrationFromSections(
            Estimate.without(basis, status, text, findings=findings, result=none), sections, None, proposal
        )

    if proposal.swings and not sections:  # a swing answers that nothing rests
        left = tuple(one for one in proposal.questions if one.code != "not_at_rest")
        proposal = replace(proposal, questions=left)
    if any(question.code != _OPEN for question in proposal.questions):
        return without(Status.INCONSISTENT, "")
    if not sections and proposal.swings:
        progress("fitting the swing")
        return CalibrationFromSections(
            _by_swing(proposal.swings[0], settings, records, units, findings), sections
        )
    if not sections:
        why = "; ".join(f"{name} {reason}" for name, reason in proposal.unused.items())
        text = why or "found no section that can be read: state them in a table, imu.sections"
        return without(Status.TOO_FEW_INTERVALS, text)
    priors = _priors(settings, units, backward=backward)
    if priors.frame == "case" and not side_by_side(sections).directed:
        raise StudyError(
            "imu.frame",
            "found case, but no section says a direction or axis, expected accelerometers, or none",
        )
    if proposal.numbered:  # a bias that wanders from pose to pose is more than noise
        priors = replace(priors, excess=frozenset({"gyro"}))
    # moves tell the scale of the gyro
    lacking = missing([replace(s, gyro=None) for s in sections] if proposal.moves else sections, priors)
    if lacking is not None:
        what = ", ".join(lacking.terms)
        return without(Status.UNOBSERVABLE, f"the sections leave {what} open: add {lacking.cure}")
    progress("fitting the sections")
    used = 0
    try:
        if proposal.moves:
            moved = calibrate_with_moves(sections, [one.move for one in proposal.moves], priors)
            found, asked = moved.calibration, of_channels(moved)
            findings = (
                *findings,
                *asked,
                *findings_of_moves(moved, proposal.moves, numbered=proposal.numbered),
            )
            proposal = replace(proposal, questions=(*proposal.questions, *asked))
            used = len(moved.used)
        else:
            found = calibrate_sections(sections, priors)
    except LinAlgError:
        text = "the sections leave some combination of coefficients open: add rests on all six sides"
        return without(Status.UNOBSERVABLE, text)
    findings = (*findings, *findings_of(found, priors), *two_clocks(found, by_file(records)))
    if proposal.numbered:
        found = replace(found, excess=found.excess - {"gyro"})
    if units["gyro"] is not None:
        steps = np.array(proposal.steps)
        found = with_resolution(found, steps)
        findings = (*findings, *resolution_finding(steps, units["gyro"].unit.symbol))
    estimate = _estimate(found, settings, records, units, proposal, findings, temperature, used)
    return CalibrationFromSections(estimate, sections, found, proposal)


def stated_priors(settings: ImuSettings, scales: Mapping[str, Size | None]) -> Priors:
    """Priors by what the study says of the site, the clock and the instrument; ``scales`` of the scale factors of
    ``acc`` and ``gyro``."""
    usual = Priors(settings.site)
    options = settings.method if isinstance(settings.method, SectionsSettings) else SectionsSettings()
    return replace(
        usual,
        clock_u=settings.time_base_u,
        mounting_u=options.mounting_u,
        frame=options.frame,
        acc_scale=scales["acc"],
        gyro_scale=scales["gyro"],
        misalignment=usual.misalignment if options.misalignment is None else options.misalignment,
        k2=math.inf if settings.k2 else settings.k2_u,
        g_sensitivity=settings.g_sensitivity_u,
    )


def _priors(settings: ImuSettings, units: Mapping[str, Triad | None], *, backward: bool = False) -> Priors:
    """Priors by the study and the units of the outputs."""
    acc, gyro = (_scale(units[sensor]) for sensor in ("acc", "gyro"))
    if backward:
        gyro = Size(-1.0, math.inf) if gyro is None else gyro._replace(median=-gyro.median)
    return stated_priors(settings, {"acc": acc, "gyro": gyro})


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


def _scale(triad: Triad | None) -> Size | None:
    """The scale factors of physical outputs beforehand; None in counts."""
    return None if triad is None or triad.unit.dimension in RAW else Size(1.0 / triad.unit.factor, 0.05)


def _proposal(named: Mapping[str, Record], options: SectionsSettings) -> Proposal:
    """The sections that the study states, or that recordings tell."""
    rows = stated_rows(options)
    return Proposal.by(rows, named) if rows else Proposal.of(named)


def placed(section: Section, options: SectionsSettings) -> Section:
    """The section with the placing and level of all where it states none."""
    turning = section.kind in ("rate", "turn")
    return replace(
        section,
        up_u=options.placing if section.up_u is None else section.up_u,
        axis_u=options.placing if section.axis_u is None else section.axis_u,
        level_u=options.level if turning and section.level_u is None else section.level_u,
    )


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
    known = readings.directed and found.problem.priors.frame != "accelerometers"
    own = _OWN if "acc" in triads else _OF_GYRO
    conditions = conditions_of(settings, temperature, ranges, frame=_KNOWN if known else own)
    sources = [source for record in records for source in record.sources]
    basis = studied(COMMAND, settings, sources, MODEL, REFERENCES, conditions)
    budget = tuple(
        item
        for source, shares in found.budget.items()
        for item in budget_items(
            found, source, {n: float(s) for n, s in zip(found.names, shares, strict=True) if s > 0.0}
        )
    )
    return Estimate.of(
        basis,
        found.names,
        [
            TERMS[name].unit_for(symbols["acc" if name.startswith(("K", "M")) else "gyro"])
            for name in found.names
        ],
        found.x,
        Uncertainty(found.covariance, found.dof, budget, found.common),
        _verdict(found, proposal, moves),
        findings=findings,
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
