"""The tasks of an IMU study: a calibration by the method it asks for, a simulated recording."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from inercal.foundation.errors import StudyError
from inercal.foundation.findings import Finding
from inercal.foundation.records.record import Record
from inercal.foundation.results.remarks import exact_gravity
from inercal.foundation.results.result import judged
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.settings import (
    AidedSettings,
    FerrarisSettings,
    ImuSettings,
    KnownRatesSettings,
    KnownTurnsSettings,
    MeansSettings,
    SectionsSettings,
)

if TYPE_CHECKING:
    from inercal.systems.imu.aided.calibration import AidedCalibration
    from inercal.systems.imu.sections.outcome import CalibrationFromSections

    Calibrated = AidedCalibration | CalibrationFromSections


def in_order(settings: ImuSettings) -> bool:
    """True where a calibration is of several records together, one for each rate or turn, or some sections each: they
    are no repeat runs."""
    return isinstance(settings.method, KnownRatesSettings | KnownTurnsSettings | SectionsSettings)


def in_rows(settings: ImuSettings) -> bool:
    """True where rows of a file are means, which need no times."""
    return isinstance(settings.method, MeansSettings | KnownRatesSettings | SectionsSettings)


def calibrate(
    record: Record, settings: ImuSettings, progress: Callable[[str], None] = lambda _: None
) -> Calibrated:
    """Calibrate an IMU.

    Parameters
    ----------
    record : Record
        ``acc_x..z`` and perhaps ``gyro_x..z``, in any unit, counts included; what else it must hold depends on the
        method.
    settings : ImuSettings
        Site and options; ``settings.method`` are those of a method other than multi-position.
    progress : callable
        Takes the progress in words.

    Returns
    -------
    `inercal.systems.imu.sections.outcome.CalibrationFromSections`, or that of the method asked for
        An estimate and the evidence behind it; nothing is raised for a poor fit.

    Raises
    ------
    InputError
        The record does not hold what the method needs.
    """
    return calibrate_files([record], settings, progress)


def calibrate_files(
    records: Sequence[Record], settings: ImuSettings, progress: Callable[[str], None] = lambda _: None
) -> Calibrated:
    """Calibrate an IMU from records in order, one for each rate or turn of a method that is `in_order`, else from one.

    Parameters and errors are those of `calibrate`.
    """
    rate_u = max((record.rate_u for record in records if record.rate_u is not None), default=None)
    if rate_u and not settings.time_base_u:
        settings = replace(settings, time_base_u=rate_u)
    calibration = _by_method(records, settings, progress)
    if not rate_u and not settings.time_base_u and not in_rows(settings):
        calibration = _with_exact_clock(calibration, typed=rate_u is not None)
    exact = exact_gravity(settings.site, "the scale factors are too sure by what it is not")
    if in_order(settings) or not exact:
        return calibration
    findings = (*calibration.estimate.findings, *exact)
    return replace(calibration, estimate=replace(calibration.estimate, findings=findings))


def _by_method(
    records: Sequence[Record], settings: ImuSettings, progress: Callable[[str], None]
) -> Calibrated:
    """The calibration by the method of the settings; only its module is loaded."""
    record = records[0]
    match settings.method:
        case FerrarisSettings():
            from inercal.systems.imu.ferraris.calibration import calibrate_ferraris

            return calibrate_ferraris(record, settings, settings.method, progress)
        case AidedSettings():
            from inercal.systems.imu.aided.calibration import calibrate_aided

            return calibrate_aided(record, settings, settings.method, progress)
        case SectionsSettings() | MeansSettings() | KnownRatesSettings() | KnownTurnsSettings() | None:
            from inercal.systems.imu.sections.outcome import calibrate_from_sections

            return calibrate_from_sections(records, settings, settings.method, progress)


def _with_exact_clock(calibration: Calibrated, typed: bool) -> Calibrated:
    """The calibration, saying what an ordinary error of the clock would do: of a rate that was ``typed`` without an
    uncertainty in any case, of time stamps where it would matter."""
    estimate = calibration.estimate
    scales = [estimate[f"S_{axis}"] for axis in "xyz" if f"S_{axis}" in estimate.names]
    shifts = {p.name: LIMITS.ordinary_clock * abs(p.value) / p.u for p in scales if p.u > 0.0}
    if not shifts or (not typed and max(shifts.values()) < 1.0):
        return calibration
    what, cure = "time stamps are taken as exact", "imu.time_base"
    if typed:
        what, cure = "sample rate is typed without an uncertainty", 'rate = "100.00(1) Hz", or imu.time_base'
    text = (
        f"the {what}: an error of {1e6 * LIMITS.ordinary_clock:.0f} ppm, ordinary for a clock, shifts the scale "
        f"factors of the gyro by as much, {max(shifts.values()):.2g} of their u: state its uncertainty, "
        f"{'such as ' if typed else 'by '}{cure}"
    )
    harm = tuple(name for name, shift in shifts.items() if typed and shift > 1.0)
    findings, (status, message) = judged(
        (estimate.status, estimate.message),
        (*estimate.findings, Finding("rate_without_u", text, harm=harm)),
        estimate.names,
    )
    return replace(calibration, estimate=replace(estimate, findings=findings, status=status, message=message))


def simulate(settings: ImuSettings, rng: np.random.Generator) -> Record:
    """A simulated record of the study: an IMU in its sections, in one pose after the other, or as its method asks for.

    Coefficients that the study does not state are drawn.

    Raises
    ------
    StudyError
        A method of which there is no simulation, or no latitude for the earth rate.
    """
    if settings.site.latitude is None:
        raise StudyError("site", 'no latitude, expected one such as latitude = "39.1 deg" for the earth rate')
    match settings.method:
        case None:
            return _by_hand(settings, settings.site.latitude, rng)
        case SectionsSettings(table=None, rows=()):
            return _by_hand(settings, settings.site.latitude, rng)
        case SectionsSettings():
            from inercal.systems.imu.sections.simulate import simulate_sections

            return simulate_sections(settings, settings.method, settings.site.latitude, rng)[0]
        case FerrarisSettings():
            from inercal.systems.imu.ferraris.nine import as_sections
            from inercal.systems.imu.sections.simulate import simulate_sections

            return simulate_sections(settings, as_sections(settings.method), settings.site.latitude, rng)[0]
        case AidedSettings():
            from inercal.systems.imu.aided.simulate import simulate_study as simulate_table

            return simulate_table(settings, settings.method, rng)
    raise StudyError(
        "imu.method",
        'found another method, expected "sections", "multiposition", "ferraris" or "aided" for a simulation',
    )


def _by_hand(settings: ImuSettings, latitude: float, rng: np.random.Generator) -> Record:
    """A simulated record of poses held by hand."""
    from inercal.systems.imu.simulate import as_stated, draw_truth, hand_poses
    from inercal.systems.imu.simulate import simulate as simulate_poses

    of, site = settings.simulation, settings.site
    truth = as_stated(draw_truth(rng), of)
    record, _ = simulate_poses(
        truth,
        hand_poses(rng, of.poses),
        site.gravity,
        latitude,
        rng,
        rate=of.sample_rate,
        start=of.start,
        hold=of.hold,
        turn=of.turning,
        clock=1.0 + settings.disturbances.clock,
        disturbances=settings.disturbances,
    )
    return record
