"""What is wrong with a recording whose sensors are of the right sign, unit and order: named, with what to write.

The liveliest stretch is filtered with all nuisances (`inercal.aoa.diagnosis.fit_quality`). Where innovations or
coefficients are beyond what noise and priors explain, constant errors that the model leaves out are fitted one at a
time (`inercal.aoa.diagnosis.small`), and the one that makes the recording fit is named, with others that do as well:
at one angle a bias, a scale, an axis and gravity look alike. Where the whole model fits and the study's smaller one
does not, that is said. Noise is looked at on its own (`inercal.aoa.diagnosis.noise_check`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from inercal.aoa.diagnosis.fit_quality import Judged, judge, stretch
from inercal.aoa.diagnosis.noise_check import misstated
from inercal.aoa.diagnosis.plausibility import SOUND, implausible
from inercal.aoa.diagnosis.small import FittedError, candidates, fitted, likeliest
from inercal.aoa.reading.recording import Recording
from inercal.aoa.settings import STATES, AoaSettings
from inercal.findings import EVERYTHING, Finding
from inercal.units import STANDARD_GRAVITY

_ALIKE = 0.5
"""Difference of misfits of two errors of which neither is likelier."""

_WORTH = 0.5
"""Part of a misfit that an error must take away to be named."""

_MOST = 3
"""Errors that are looked for, one after the other."""

_TRIED = 8
"""Errors that are fitted to the end each time."""

_SHOWN = 3

#: number of states -> what those with so many have beside the ones with fewer
_BESIDE = {
    11: "errors of the lever arms",
    15: "flexure of the sting",
    19: "heights of the sensors or a gyro scale",
}


def diagnose(
    recording: Recording, settings: AoaSettings, gross: Sequence[Finding] | None = None
) -> list[Finding]:
    """Name what is wrong with a recording; nothing for a sound one, nor where it is implausible as a whole.

    ``gross`` is what `inercal.aoa.diagnosis.plausibility.implausible` said, where it was asked already.

    Codes are ``excess_scatter``, ``low_scatter``, ``unmodelled``, ``site_suspect``, ``prior_suspect`` and, where no one
    error explains what the sensors say, ``contradiction``.
    """
    part = stretch(recording)
    noise, fair = misstated(part, settings)
    now = judge(part, fair)
    if now.misfit > SOUND and (implausible(recording, settings) if gross is None else gross):
        return []
    if now.fits:
        return [*noise, *_too_small(part, fair)]
    return [*noise, *(_too_fast(part, fair, now) or _errors(part, fair, now))]


def _too_fast(part: Recording, settings: AoaSettings, now: Judged) -> list[Finding]:
    """``unmodelled``: a motion livelier than the study's snap allows, which some sensor shows."""
    if now.white:
        return []
    for factor in (1e2, 1e4):
        snap = factor * settings.estimator.density
        then = judge(part, _livelier(settings, snap))
        if (then.fits or then.misfit <= SOUND) and then.misfit < (1.0 - _WORTH) * now.misfit:
            return [_of_snap(settings, snap)]
    return []


def _livelier(settings: AoaSettings, snap: float) -> AoaSettings:
    """A study with another snap."""
    return replace(settings, estimator=replace(settings.estimator, snap=snap))


def _of_snap(settings: AoaSettings, snap: float) -> Finding:
    """``unmodelled``: a larger snap makes a recording fit."""
    text = f"the model moves faster than a snap of {settings.estimator.density:.3g} rad^2/s^7 lets it"
    more = f'write snap = "{snap:.3g} rad^2/s^7" under [estimator]'
    return Finding("unmodelled", f"{text}: {more}", harm=EVERYTHING)


def _too_small(part: Recording, settings: AoaSettings) -> list[Finding]:
    """``unmodelled``: the whole model fits, the study's smaller one does not."""
    stated = settings.estimator.states
    larger = [states for states in STATES if states > stated]
    if not larger or judge(part, settings, stated).fits:
        return []
    # of more states more snap is usual
    usual = replace(settings.estimator, states=19).density
    if judge(part, _livelier(settings, usual), stated).fits:
        return [_of_snap(settings, usual)]
    enough = next((states for states in larger if judge(part, settings, states).fits), 19)
    at_least = "" if enough == 19 else f" ({enough} at least)"
    text = (
        f"the recording shows {_BESIDE[enough]}, which {stated} states leave out: their angle is wrong by more than it "
        f"claims, write states = 19{at_least} under [estimator]"
    )
    return [Finding("unmodelled", text, harm=EVERYTHING)]


def _errors(part: Recording, settings: AoaSettings, now: Judged) -> list[Finding]:
    """Constant errors that explain what is left over, one after the other."""
    findings: list[Finding] = []
    as_it_is = part, settings, now
    while not now.fits and len(findings) < _MOST:
        likely = likeliest(candidates(part, settings, now.theta), part, settings, _TRIED)
        tried = [fitted(each, part, settings) for each in likely]
        found = sorted((each for each in tried if each is not None), key=lambda each: each.judged.misfit)
        if not found or found[0].judged.misfit > (1.0 - _WORTH) * now.misfit:
            break
        best = found[0]
        alike = [each for each in found[1:] if each.judged.misfit < best.judged.misfit + _ALIKE]
        findings.append(_in_words(best, alike, settings))
        part, settings = best.error.taken_out(part, settings, best.value)
        now = best.judged
    # what does not make the recording fit is no advice
    return findings if now.fits or now.misfit <= SOUND else [_contradiction(*as_it_is)]


def _in_words(best: FittedError, alike: list[FittedError], settings: AoaSettings) -> Finding:
    """An error as a finding, with those that explain as much."""
    kind = best.error.name.split(" ")[0]
    code = {
        "gravity": "site_suspect",
        "bias": "prior_suspect",
        "position": "prior_suspect",
        "pivot": "prior_suspect",
    }
    others = "; ".join(_short(each, settings) for each in alike[:_SHOWN])
    also = f"; as well possible: {others}" if others else ""
    text = f"{_short(best, settings)}: {_advice(best, settings)}{also}"
    return Finding(code.get(kind, "unmodelled"), text, harm=EVERYTHING)


def _short(found: FittedError, settings: AoaSettings) -> str:
    """What looks wrong, and by how much."""
    kind, _, name = found.error.name.partition(" ")
    value = found.value
    match kind:
        case "axis":
            return f"the axis of {name} looks turned by {math.degrees(value):.3g} deg"
        case "scale":
            return f"{name} looks to read {1.0 + value:.5g} times what it should"
        case "bias":
            return f"the bias of {name} looks to be {1e3 * value / STANDARD_GRAVITY:.3g} mg"
        case "position":
            return f"{name} looks to sit {1e3 * value:.3g} mm further ahead than stated"
        case "pivot":
            return f"the pivot looks to be {1e3 * value:.3g} mm further back than stated"
        case "gravity":
            return f"gravity looks to be {settings.site.gravity + value:.5g} m/s^2"
        case "yaw":
            return f"the model looks to yaw to and fro by {math.degrees(math.sqrt(value)):.2g} deg/s rms"
        case _:
            return f"the model looks rolled by {math.degrees(math.sqrt(value)):.2g} deg, all the time or rms"


def _advice(found: FittedError, settings: AoaSettings) -> str:
    """What to write instead."""
    kind, _, name = found.error.name.partition(" ")
    layout = settings.layout
    k = layout.names.index(name) if name else 0
    match kind:
        case "axis":
            return f'write angle = "{math.degrees(layout.angle[k] + found.value):.4g} deg" under [sensors.{name}]'
        case "scale":
            return f"correct the scale under [sensors.{name}]"
        case "bias":
            return f"state a bias under [sensors.{name}], or a larger accelerometer_bias"
        case "position":
            return f'write r = "{layout.r[k] + found.value:.4g} m" under [sensors.{name}]'
        case "pivot":
            return "correct the positions r of all sensors"
        case "gravity":
            return f"stated are {settings.site.gravity:.6g} m/s^2, correct gravity or latitude and height under [site]"
        case "yaw":
            return "no sensor here sees that, record gyro_roll and gyro_yaw"
        case _:
            return "state roll under [model], or record gyro_roll and gyro_yaw where it changes"


def _contradiction(part: Recording, settings: AoaSettings, now: Judged) -> Finding:
    """What no one error explains: the accelerometer without which the rest fits, or no more than that."""
    names = settings.layout.names
    for k, name in enumerate(names):
        others = [i for i in range(len(names)) if i != k and np.isfinite(part.acc[:, i]).any()]
        if others and settings.layout.of(*others).spans:
            acc = part.acc.copy()
            acc[:, k] = np.nan
            if judge(replace(part, acc=acc), settings).fits:
                text = f"{name} contradicts the others, which fit without it: check its channel, axis and position"
                return Finding("contradiction", text, harm=EVERYTHING)
    worst = (*names, "gyro")[int(np.argmax(now.by_sensor))]
    motion = "" if part.spatial else ", or the model rolls or yaws, which only gyro_roll and gyro_yaw tell"
    text = (
        f"the sensors contradict each other, {worst} most, and no single error explains it: check the study's axes, "
        f"positions and noise{motion}"
    )
    return Finding("contradiction", text, harm=EVERYTHING)
