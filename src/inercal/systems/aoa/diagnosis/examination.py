"""Faults of a recording or its study, found by trying all hypotheses in order, before and after filtering.

The first search (`implausible`) comes before any angle is believed. It looks for gross faults: wrong signs, units and
positions, exchanged sensors, clocks. The size of the contradiction tells them from the errors that the fusion allows
for: the liveliest stretch is filtered with all nuisances, and again without each fault
(`inercal.systems.aoa.diagnosis.gross`). A fault that alone makes the recording fit is named; where the motion is too
slow to tell several apart, all of them are. Faults that no sensor contradicts cannot be seen: at rest the gyro's sign
and unit, positions, and the sign of an accelerometer along the model.

The second search (`diagnose`) looks at noise on its own (`inercal.systems.aoa.diagnosis.noise_check`), then at a motion
that is too lively and a model that is too small, and, where innovations or coefficients exceed their noise and priors,
at constant errors that the model leaves out (`inercal.systems.aoa.diagnosis.small`).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.inference.hypotheses import Fitted, tried
from inercal.systems.aoa.diagnosis.effect import of_noise
from inercal.systems.aoa.diagnosis.fit_quality import Case, FitQuality, fit_quality, stretch
from inercal.systems.aoa.diagnosis.gross import OTHER_CHANNEL, gross_faults
from inercal.systems.aoa.diagnosis.noise_check import misstated
from inercal.systems.aoa.diagnosis.passed import heard, pass_of
from inercal.systems.aoa.diagnosis.small import small_errors
from inercal.systems.aoa.estimators import STATES
from inercal.systems.aoa.fusion.filter_result import estimate
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording, later
from inercal.systems.aoa.settings import AoaSettings

#: number of states -> errors that fewer states leave out
_BESIDE = {
    11: "errors of the lever arms",
    15: "flexure of the sting",
    19: "heights of the sensors or a gyro scale",
}


@dataclass(frozen=True, eq=False)
class _Explanation:
    """Faults taken out together, and the quality of the fit without them."""

    faults: tuple[Fitted[Case], ...]
    quality: FitQuality

    @property
    def misfit(self) -> float:
        """Misfit of the fit without these faults."""
        return self.quality.misfit

    @property
    def upright(self) -> bool:
        """True where the model does not lie on its back."""
        return _upright(self.quality) > LIMITS.upside_down_cosine

    @property
    def unlikely(self) -> bool:
        """True where any other explanation is likelier."""
        return self.faults[-1].hypothesis.name == OTHER_CHANNEL


def implausible(recording: Recording, settings: AoaSettings) -> list[Finding]:
    """Gross faults, each with the correction to write; empty for a sound recording.

    Codes are ``sign_suspect``, ``channel_swap``, ``unit_suspect`` and ``command_shift``; ``not_stated`` for a model on
    its back, which may be right. Raises `RecordError` for a clock that was set back.
    """
    part = stretch(recording)
    now = fit_quality(part, settings)
    if now.misfit <= LIMITS.sound_misfit:
        back = _on_its_back(recording, settings) if _upright(now) <= LIMITS.upside_down_cosine else []
        return [*_far_away(settings), *back]
    return [fault.finding for fault in _explaining((part, settings), now)]


def _explaining(
    case: Case, now: FitQuality, given: Sequence[tuple[Fitted[Case], ...]] = ((),)
) -> list[Fitted[Case]]:
    """Faults that make a case fit, with all equally good ones: one alone, then two together, beside ``given`` ones."""
    explanations = [each for before in given for each in _explanations(case, before)]
    most = (1.0 - LIMITS.explained_share) * now.misfit
    fitting = [each for each in explanations if each.misfit <= min(LIMITS.sound_misfit, most)]
    if any(not each.unlikely for each in fitting) or (fitting and _loud(case)):
        fitting = [each for each in fitting if not each.unlikely]
    if fitting:
        least = min(each.misfit for each in fitting)
        alike = [each for each in fitting if each.misfit <= least + LIMITS.gross_alike_misfit]
        # a model in a tunnel lies on its back only by intention
        alike = [each for each in alike if each.upright] or alike
        alike.sort(key=lambda each: each.misfit)
        *earlier, last = alike[0].faults
        others = tuple(each.faults[-1] for each in alike[1:] if each.faults[:-1] == alike[0].faults[:-1])
        return [*earlier, replace(last, alike=others)]
    if any(given) or now.misfit < LIMITS.two_faults_misfit:
        return []
    explanations.sort(key=lambda each: each.misfit)
    first = explanations[: LIMITS.first_faults]
    better = [each.faults for each in first if each.misfit < most and not each.unlikely]
    seconds = _without_gyro(case) or better
    return _explaining(case, now, seconds) if seconds else []


def _explanations(case: Case, before: tuple[Fitted[Case], ...] = ()) -> Iterator[_Explanation]:
    """Each fault taken out of a case, beside others that were taken out ``before``."""
    for each in before:
        case = each.hypothesis.without(case, each.values)
    for hypothesis in gross_faults(case):
        if not before or hypothesis.name != OTHER_CHANNEL:
            one = tried(hypothesis, case)
            yield _Explanation((*before, one), fit_quality(*one.case))


def _without_gyro(case: Case) -> list[tuple[Fitted[Case], ...]]:
    """Faults without which the accelerometers fit each other: the rest of the misfit is the gyro's."""
    part, settings = case
    blind = replace(part, gyro=np.full_like(part.gyro, np.nan))
    fitting = [each for each in _explanations((blind, settings)) if each.misfit <= LIMITS.sound_misfit]
    return [each.faults for each in sorted(fitting, key=lambda each: each.misfit)[: LIMITS.first_faults]]


def _loud(case: Case) -> bool:
    """True where noise above the stated noise explains all."""
    return fit_quality(case[0], misstated(*case)[1]).misfit <= LIMITS.sound_misfit


def _upright(quality: FitQuality) -> float:
    """Cosine of theta in all but one in a hundred rows or less; the largest is the most upright."""
    cosine = np.cos(quality.theta[np.isfinite(quality.theta)])
    return float(np.quantile(cosine, 0.99)) if cosine.size else 1.0


def _far_away(settings: AoaSettings) -> list[Finding]:
    """``unit_suspect``: an accelerometer further from the pivot than any model is long, which slow motion hides."""
    layout = settings.layout
    k = int(np.argmax(np.abs(layout.r)))
    arm = float(layout.r[k])
    if not abs(arm) > LIMITS.impossible_arm:
        return []
    text = (
        f"{layout.names[k]} is stated {abs(arm):g} m from the pivot, where arms of models are "
        f"shorter than {LIMITS.impossible_arm:g} m"
    )
    return [Finding("unit_suspect", text, harm=EVERYTHING, action="write r with its unit")]


def _on_its_back(recording: Recording, settings: AoaSettings) -> list[Finding]:
    """``not_stated``: a model that seems to fly on its back all the time, which no sensor contradicts."""
    now = fit_quality(recording.of(later(recording.t)), settings, 8)
    if _upright(now) > LIMITS.upside_down_cosine:
        return []
    middle = math.degrees(float(np.nanmedian(np.remainder(now.theta, 2.0 * math.pi))))
    text = f"theta is about {middle:.0f} deg, the model on its back"
    action = 'exchange or reverse the accelerometers across it, or state roll = "180 deg" under [model]'
    return [Finding("not_stated", text, harm=("theta",), action=action)]


def diagnose(
    recording: Recording,
    settings: AoaSettings,
    gross: Sequence[Finding] | None = None,
    every: int = 1,
) -> list[Finding]:
    """Name the faults of a recording; none for a sound one, nor for one with gross faults.

    ``gross`` are the findings of `implausible`, where they are known already; one of ``every`` rows of the sensors is
    a row of the recording, as after a band.

    Codes are ``excess_scatter``, ``low_scatter``, ``unmodelled``, ``site_suspect``, ``prior_suspect`` and, where no one
    error explains what the sensors say, ``contradiction``.
    """
    part = stretch(recording)
    noise, fair = misstated(part, settings, every)
    plain, other = (problem(each, part.spatial) for each in (settings, fair))
    noise = of_noise(part, plain, other, noise)
    now = fit_quality(part, fair)
    if now.misfit > LIMITS.sound_misfit and (implausible(recording, settings) if gross is None else gross):
        return []
    if now.fits:
        return [*noise, *_too_small(part, fair)]
    return [*noise, *(_too_fast(part, fair, now) or _errors(part, fair, now))]


def _too_fast(part: Recording, settings: AoaSettings, now: FitQuality) -> list[Finding]:
    """``unmodelled``: a motion livelier than the study's snap allows, seen by a sensor."""
    if now.white:
        return []
    for factor in (1e2, 1e4):
        snap = factor * settings.estimator.density
        then = fit_quality(part, _livelier(settings, snap))
        explained = then.misfit < (1.0 - LIMITS.explained_share) * now.misfit
        if explained and (then.fits or then.misfit <= LIMITS.sound_misfit):
            return [_of_snap(settings, snap)]
    return []


def _livelier(settings: AoaSettings, snap: float) -> AoaSettings:
    """A study with another snap."""
    return replace(settings, estimator=replace(settings.estimator, snap=snap))


def _of_snap(settings: AoaSettings, snap: float) -> Finding:
    """``unmodelled``: a larger snap makes a recording fit."""
    text = f"the model moves faster than a snap of {settings.estimator.density:.3g} rad^2/s^7 lets it"
    advice = f'write snap = "{snap:.3g} rad^2/s^7" or "auto" under [estimator]'
    return Finding("unmodelled", text, harm=EVERYTHING, action=advice)


def _too_small(part: Recording, settings: AoaSettings) -> list[Finding]:
    """``unmodelled``: the whole model fits, the study's smaller one does not."""
    chosen = settings.estimator.states
    larger = [states for states in STATES if states > chosen]
    if not larger or fit_quality(part, settings, chosen).fits:
        return []
    # more states go with more snap
    usual = replace(settings.estimator, states=19).density
    if fit_quality(part, _livelier(settings, usual), chosen).fits:
        return [_of_snap(settings, usual)]
    enough = next((states for states in larger if fit_quality(part, settings, states).fits), 19)
    at_least = "" if enough == 19 else f" ({enough} at least)"
    text = (
        f"the recording shows {_BESIDE[enough]}, which {chosen} states leave out, and the angle is wrong by more "
        "than it claims"
    )
    action = f"write states = 19{at_least} under [estimator]"
    return [Finding("unmodelled", text, harm=EVERYTHING, action=action)]


def _errors(part: Recording, settings: AoaSettings, now: FitQuality) -> list[Finding]:
    """Constant errors that make the recording fit; what the judge hears where none do, or a contradiction."""
    errors, left = small_errors((part, settings))
    then = fit_quality(*left)
    if then.fits or then.misfit <= LIMITS.sound_misfit:
        return [each.finding for each in errors]
    of = problem(replace(settings, estimator=replace(settings.estimator, states=19)), part.spatial)
    passed = pass_of(part, of, settings, estimate(part, of))
    said = None if passed is None else heard(passed)
    return [_contradiction(part, settings, now) if said is None or not said.harm else said]


def _contradiction(part: Recording, settings: AoaSettings, now: FitQuality) -> Finding:
    """``contradiction`` that no single error explains, with the accelerometer without which the others fit, if any."""
    names = settings.layout.names
    for k, name in enumerate(names):
        others = [i for i in range(len(names)) if i != k and np.isfinite(part.acc[:, i]).any()]
        if others and settings.layout.of(*others).spans:
            acc = part.acc.copy()
            acc[:, k] = np.nan
            if fit_quality(replace(part, acc=acc), settings).fits:
                text = f"{name} contradicts the others, which fit without it"
                action = "check its channel, axis and position"
                return Finding("contradiction", text, harm=EVERYTHING, action=action)
    worst = (*names, "gyro")[int(np.argmax(now.by_sensor))]
    motion = "" if part.spatial else ", or the model rolls or yaws, which only gyro_roll and gyro_yaw tell"
    text = f"the sensors contradict each other, {worst} most, and no single error explains it{motion}"
    action = "check the study's axes, positions and noise"
    return Finding("contradiction", text, harm=EVERYTHING, action=action)
