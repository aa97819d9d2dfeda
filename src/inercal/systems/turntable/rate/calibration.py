"""Calibration of gyros by a rate test: readings, identifiability of the terms, and the fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import short_repr
from inercal.foundation.errors import StudyError
from inercal.foundation.findings import Finding
from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.foundation.inference.identifiability import Identifiability, in_words
from inercal.foundation.records.places import counted
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate
from inercal.systems.turntable.display import displayed
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.rate.ends import settled
from inercal.systems.turntable.rate.fit import GyroRateFit, fit_rates, separable
from inercal.systems.turntable.rate.linearity import SEED
from inercal.systems.turntable.rate.outcome import assemble, unobservable
from inercal.systems.turntable.rate.several_axes import (
    LegStays,
    axis_about,
    excess_across,
    fit_across,
    fit_axes,
    left_out,
    legs_of,
    unfit,
)
from inercal.systems.turntable.rate.stays import Input, RateDwells, gyro_input, rate_dwells, turning_axis
from inercal.systems.turntable.settings import TurntableSettings


@short_repr
@dataclass(frozen=True, eq=False)
class RateCalibration:
    """An ``estimate``, and the evidence behind it: stays, inputs and fits of the gyros that took part."""

    estimate: Estimate
    readings: RateDwells
    inputs: tuple[Input, ...] = ()
    fits: tuple[GyroRateFit, ...] = ()

    @property
    def shown(self) -> Estimate:
        """The estimate in the units of the record, for people."""
        return displayed(self.estimate, self.readings.unit)


def calibrate_rates(record: Record, settings: TurntableSettings) -> RateCalibration:
    """Calibrate gyros by a rate test, about one axis or about several in sequence.

    Parameters
    ----------
    record : Record
        As `inercal.systems.turntable.rate.stays.rate_dwells` reads it.
    settings : TurntableSettings
        With a ``rate_test``, and an instrument of kind gyro.

    Raises
    ------
    InputError
        The record is no rate test, or the study does not fit it.
    """
    test, chain, instrument = settings.rate_test, settings.chain, settings.instrument
    assert test is not None
    check_rate_test(settings)
    readings = rate_dwells(record, chain.joints, test.joint, instrument.dwell)
    unit = instrument.unit
    if instrument.noise is not None and unit.dimension != readings.unit.dimension:
        raise StudyError(
            "instrument.unit",
            f"noise is stated for outputs in {unit.symbol}, and the record's are in {readings.unit.symbol}, expected "
            "the same kind of unit",
        )
    legs = legs_of(readings, settings)
    if len({leg.joint for leg in legs}) > 1 or len({leg.about for leg in legs if leg.about}) > 1:
        return _several_axes(record, readings, settings, legs)
    if test.joint != legs[0].joint:  # a column of the record says so
        test = replace(test, joint=legs[0].joint)
        settings = replace(settings, rate_test=test)
    findings = [*record.findings]
    still = settled(chain, test.joint, readings.angles)
    along = turning_axis(still, test.joint, readings.angles)
    taken = [
        channel
        for channel in readings.channels
        if np.abs(along[:, "xyz".index(channel[-1])]).min() > LIMITS.turning_cosine
    ]
    about = axis_about(along)
    across = []
    for channel in (channel for channel in readings.channels if channel not in taken):
        S = f"S_{channel[-1]}"
        if not np.ptp(readings.y[:, readings.channels.index(channel)]):
            text = f"{channel} reads the same at all rates and is left out: is it dead?"
            findings.append(Finding("dead_channel", text, harm=()))
            continue
        wanted = [] if instrument.coefficients.get(S) else [f"{S} under [instrument.coefficients]"]
        if readings.assumed:
            wanted.append(f"the angle {test.joint} where each stay begins")
        if about and not wanted:
            across.append(channel)
            continue
        hint = f": with {' and '.join(wanted)} its T_{channel[-1]}{about} is found" if about else ""
        text = f"{channel} lies across the turning axis {test.joint} and is left out{hint}"
        findings.append(Finding("weak_term", text))

    def nothing(rank: int, text: str, words: Sequence[str] = ()) -> RateCalibration:
        return RateCalibration(
            unobservable(record, readings, settings, findings, rank, words, text), readings
        )

    if not taken:
        return nothing(0, f"no gyro of the record lies along the turning axis {test.joint}")
    axis, asymmetry = taken[0][-1], True
    identified = separable(readings.rate, axis, test.order, asymmetry)
    if identified.rank < len(identified.names):
        asymmetry = False
        identified = separable(readings.rate, axis, test.order, asymmetry)
        text = "the rates do not tell the asymmetry from the other terms"
        findings.append(Finding("weak_term", text, action="take two or more of either sign"))
    stays, terms = len(readings.rate), len(identified.names)
    if identified.rank < terms:
        words = [in_words(vector / identified.scale, identified.names) for vector in identified.null_vectors]
        return nothing(
            identified.rank,
            f"the rates of {counted(stays, 'stay')} identify {identified.rank} of {terms} terms: the readings do not "
            f"change along {'; '.join(words)} (by rad/s); add rates",
            words,
        )
    if stays == terms and instrument.noise is None:
        text = f"found {counted(stays, 'stay')} for {terms} terms and no stated noise, expected one stay more"
        return nothing(identified.rank, text)
    for channel in taken:
        if not np.ptp(readings.y[:, readings.channels.index(channel)]):
            return nothing(
                0, f"{channel} reads the same at all rates, expected it to follow them: is it dead?"
            )
    inputs = tuple(gyro_input(readings, settings, "xyz".index(channel[-1])) for channel in (*taken, *across))
    if readings.assumed:
        findings += _whole_turns(readings, inputs)
    full_scale = test.full_scale or float(np.abs(readings.rate).max())
    fits = tuple(
        fit_rates(
            channel[-1],
            readings.rate,
            readings.y[:, readings.channels.index(channel)],
            given,
            instrument.noise,
            test.order,
            asymmetry,
            full_scale,
            np.random.default_rng(SEED),
        )
        for channel, given in zip(taken, inputs, strict=False)
    )
    findings += [finding for fit in fits for finding in _excess(fit)]
    if across:
        others = tuple(fit_across(readings, settings, channel[-1], about) for channel in across)
        inputs = (*inputs[: len(taken)], *(given for given, _ in others))
        fits = (*fits, *(fit for _, fit in others))
        findings += [finding for _, fit in others for finding in excess_across(fit)]
    estimate = assemble(record, readings, settings, findings, inputs, fits, full_scale, identified)
    return RateCalibration(estimate, readings, inputs, fits)


def _several_axes(
    record: Record, readings: RateDwells, settings: TurntableSettings, legs: Sequence[LegStays]
) -> RateCalibration:
    """Calibrate gyros by a test in which several axes turn one after the other."""
    test, noise = settings.rate_test, settings.instrument.noise
    assert test is not None
    findings = [*record.findings]
    if wrong := unfit(legs, readings):
        findings += left_out(wrong)
        out = {leg.stays[0] for leg, _ in wrong}
        kept = [leg.stays for leg in legs if leg.stays[0] not in out]
        readings = readings.some(np.sort(np.concatenate(kept))) if kept else readings
        legs = legs_of(readings, settings) if kept else ()

    def nothing(text: str, rank: int = 0, words: Sequence[str] = ()) -> RateCalibration:
        return RateCalibration(
            unobservable(record, readings, settings, findings, rank, words, text), readings
        )

    own = {k: np.concatenate([leg.stays for leg in legs if leg.about == k]) for k in {e.about for e in legs}}
    taken = []
    for channel in readings.channels:
        dead = not np.ptp(readings.y[:, readings.channels.index(channel)])
        if not dead and channel[-1] in own:
            taken.append(channel[-1])
            continue
        why = "reads the same at all rates: is it dead?" if dead else "has no stays about its own axis"
        code = "dead_channel" if dead else "weak_term"
        findings.append(Finding(code, f"{channel} is left out: it {why}", harm=()))
    if not taken:
        return nothing("no axis turns along a gyro of the record at two rates or more")
    asymmetry = True
    identified = _weakest(readings, own, taken, test.order, asymmetry)
    if identified.rank < len(identified.names):
        asymmetry = False
        identified = _weakest(readings, own, taken, test.order, asymmetry)
        text = "the rates do not tell the asymmetry from the other terms"
        findings.append(Finding("weak_term", text, action="take two or more of either sign"))
    if identified.rank < len(identified.names):
        words = [in_words(vector / identified.scale, identified.names) for vector in identified.null_vectors]
        text = f"the rates about one axis do not change along {'; '.join(words)} (by rad/s); add rates"
        return nothing(text, identified.rank, words)
    terms = len(identified.names) + len(own) + len(legs) - 2
    if len(readings.rate) <= terms and noise is None:
        return nothing(
            f"found {counted(len(readings.rate), 'stay')} for {terms} terms and no stated noise, expected more",
            identified.rank,
        )
    full_scale = test.full_scale or float(np.abs(readings.rate).max())
    both = [fit_axes(readings, settings, legs, axis, asymmetry, full_scale) for axis in taken]
    inputs, fits = tuple(given for given, _ in both), tuple(fit for _, fit in both)
    findings += [replace(each, harm=fit.names) for fit in fits for each in _excess(fit)]
    estimate = assemble(record, readings, settings, findings, inputs, fits, full_scale, identified)
    return RateCalibration(estimate, readings, inputs, fits)


def _weakest(
    readings: RateDwells,
    own: Mapping[str, NDArray[np.int64]],
    taken: Sequence[str],
    order: int,
    asymmetry: bool,
) -> Identifiability:
    """Identifiability of the terms of the gyro whose rates tell least."""
    each = [separable(readings.rate[own[axis]], axis, order, asymmetry) for axis in taken]
    return max(each, key=lambda found: (len(found.names) - found.rank, found.condition))


def check_rate_test(settings: TurntableSettings) -> None:
    """Refuse a study that cannot be a rate test; raises StudyError."""
    if settings.instrument.kind != "gyro":
        raise StudyError(
            "instrument.kind", f'found "{settings.instrument.kind}", expected "gyro" for a rate test'
        )
    if settings.site.latitude is None:
        raise StudyError("site", 'no latitude, expected one such as latitude = "39.1 deg" for the earth rate')


def _excess(fit: GyroRateFit) -> list[Finding]:
    """A finding where the readings scatter about the fit by more than their stated noise."""
    from scipy.special import chdtrc

    if fit.dof < 1 or np.isfinite(fit.noise_dof) or chdtrc(fit.dof, fit.chi2) >= LIMITS.misfit_probability:
        return []
    text = (
        f"gyro_{fit.axis} misses the fit by {np.sqrt(fit.chi2 / fit.dof):.1f} times what the stated noise and the "
        "table explain: what S_nl and S_hyst say is the gyro's own, and the uncertainties are those of the terms over "
        "these rates"
    )
    return [Finding("excess_scatter", text, harm=())]


def _whole_turns(stays: RateDwells, inputs: Sequence[Input]) -> list[Finding]:
    """A finding where a gyro is oblique, so that earth rate across the turning axis must average out."""
    oblique = max(float(np.sqrt(1.0 - np.square(given.gain).min().clip(0.0, 1.0))) for given in inputs)
    if oblique < 1e-6:
        return []
    moving = np.abs(stays.rate[np.abs(stays.rate) > 0.0])
    worst = 1e6 * oblique * EARTH_RATE / float(moving.min()) if len(moving) else np.inf
    text = (
        "the record does not hold the angle of the turning axis: the earth rate across it is taken to average out over "
        f"whole turns; were they not whole, an input could be wrong by up to {worst:.0f} ppm"
    )
    return [Finding("whole_turns", text)]
