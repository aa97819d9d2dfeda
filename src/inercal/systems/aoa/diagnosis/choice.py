"""Choices of the recording where the study does not: the gyro's delay, the band of the sensors, the snap.

The delay is that of the spectra, and the filter may learn what is left of it. Band and snap are judged by the
innovations: taken is the widest band, and in it the smallest density of snap, under which innovations are nearly as
small as those of a still model with the study's noise, and a livelier model would not fit better than it does there.
So calm recordings keep all of their band and the usual snap. Lines come out before a larger snap is tried. A gyro's
scale that contradicts its usual prior has a wider one.
Under too small a snap a buffet is taken for errors of positions and scale; under too large a one noise is taken for
motion, and these errors are learned from it. Vibration that is no rotation fits under no snap: lines and what lies
above the model's motion are taken out of all sensors alike.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from itertools import islice, pairwise
from typing import NamedTuple, TypeVar

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import EVERYTHING, Finding
from inercal.foundation.units import STANDARD_GRAVITY
from inercal.systems.aoa.band import Band
from inercal.systems.aoa.diagnosis import gyro_scale
from inercal.systems.aoa.diagnosis.noise_check import misstated
from inercal.systems.aoa.diagnosis.spectrum import (
    highest_motion,
    lines,
    liveliest,
    part_of,
    white_noise,
    with_offsets,
)
from inercal.systems.aoa.fusion import band as limiting
from inercal.systems.aoa.fusion.filter_result import FusionResult
from inercal.systems.aoa.fusion.loop import OUTPUTS
from inercal.systems.aoa.fusion.problem import FusionProblem, problem
from inercal.systems.aoa.fusion.run import FusionState, advance, initial
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.paper.delay import Delay, relative_delay
from inercal.systems.aoa.reading.recording import Recording, in_time
from inercal.systems.aoa.settings import AoaSettings, Direction, Heave, Prior, Resonance

R = TypeVar("R", bound=Resonance)

DENSITIES = (1e9, 1e10, 1e11, 1e12)
"""Densities [rad^2/s^7] beyond the usual one."""

SHAKING = (0.03 * STANDARD_GRAVITY, 0.1 * STANDARD_GRAVITY)
"""Levels [m/s^2] of flexure in a wide band that are tried beyond the usual one, of a plunge before both directions."""

LOW_PASSES = (100.0, 70.0, 50.0, 35.0)
"""Corners [Hz] of the low passes that are tried, the widest first."""


def decided(recording: Recording, settings: AoaSettings) -> AoaSettings:
    """The study with the delay, band and snap that the recording shows, each where the study does not state it."""
    return decided_with(recording, settings, relative_delay(recording, settings.layout))


def decided_with(recording: Recording, settings: AoaSettings, delay: Delay | None) -> AoaSettings:
    """As `decided`, with the ``delay`` of the gyro that the spectra of the recording show.

    Where it states band and snap it is as it was: a stream, which cannot look ahead, gives the same digits.

    Looked at are the liveliest stretches of `Limits.snap_time`. Where no band fits there is none, and the usual snap.
    """
    settings = limiting.with_rate(settings, recording.t[in_time(recording.t)])
    stated = settings.band.low_pass is not None
    if stated and settings.estimator.snap is not None:
        return settings
    settings = _with_delay(delay, with_offsets(recording, settings))
    densities = _densities(settings)
    settings = _with_snap(settings, densities[0])
    plain = settings if stated else replace(settings, band=replace(settings.band, low_pass=math.inf))
    stretches = [part_of(recording, rows) for rows in liveliest(recording)]
    if not stretches:
        return plain
    fair, runs = _fair(stretches[0], settings), _StretchRuns(stretches)
    bands = (plain.band, *(() if stated else _bands(stretches[0], fair)))
    # lines first: a snap that is large enough may take pick-up for motion
    attempts = [(each, 1) for each in bands if not each.corner < math.inf]
    attempts += [(each, len(densities)) for each in bands]
    # flexure last: what a wide one allows for is much, and u with it
    for prior in (settings.prior, *_shaken(settings.prior)):
        for band, most in attempts:
            tried = replace(fair, band=band, prior=prior)
            if (density := _density(recording, runs, tried, densities, most)) is not None:
                fitting = _with_snap(replace(settings, band=band, prior=prior), density)
                states = [runs.of(number, fitting).state for number in range(len(stretches))]
                of = problem(fitting, recording.spatial)
                # under the liveliest model nothing is left to tell flexure by
                lively = density == DENSITIES[-1]
                fitting = fitting if lively else _calmer(runs, settings.prior, fitting)
                return gyro_scale.of_recording(stretches, states, of, fitting)
    return plain


def _densities(settings: AoaSettings) -> tuple[float, ...]:
    """Densities of snap that are tried, the smallest first: the stated one, or the usual one and larger ones.

    At low rates the usual one would leave the rate w so free from row to row, by q dt^5 / 20, that the square of this
    in r w^2 is more than noise, which no linear filter allows for: there they begin with a smaller one.
    """
    usual, arm = settings.estimator.density, float(np.abs(settings.layout.r).max())
    if settings.estimator.snap is not None:
        return (usual,)
    if not (settings.band.rate > 0.0 and arm > 0.0):
        return (usual, *DENSITIES)
    free = LIMITS.square_share * settings.noise.accelerometer / arm
    least = 20.0 * free * settings.band.rate**5
    if least >= usual:
        return (usual, *DENSITIES)
    steps = math.ceil(math.log10(DENSITIES[-1] / least))
    return tuple(least * 10.0**k for k in range(steps))


class _FilteredStretch(NamedTuple):
    """Results of the fusion of a stretch: the mean squared innovation ``nis`` after it has settled, each as far as the
    gate lets it through, infinite where the angle was lost; rms (3,) ``flexure`` along z and x [m/s^2] and of the
    angular acceleration [rad/s^2], infinite where none runs; and its ``state`` at the end."""

    nis: float
    flexure: Array
    state: FusionState


class _StretchRuns:
    """Runs of the fusion of stretches, each once."""

    def __init__(self, stretches: Sequence[Recording]) -> None:
        self.stretches = stretches
        self._known: dict[tuple[object, ...], _FilteredStretch] = {}

    def of(self, number: int, settings: AoaSettings) -> _FilteredStretch:
        """The run of a stretch under a study."""
        of = problem(settings, self.stretches[number].spatial)
        key = number, of.constants, of.band, of.covariance.tobytes(), of.mean.tobytes()
        if key not in self._known:
            self._known[key] = _filtered(of, self.stretches[number])
        return self._known[key]


def _filtered(of: FusionProblem, part: Recording) -> _FilteredStretch:
    """The fusion of a stretch."""
    part, of = limiting.fused(part, of)
    t, rows = part.t, part.rows
    kept = np.full((len(t), 2 * of.size), np.nan)
    state, trace = advance(initial(of), of, t, rows, kept, last=True)
    settled = t[: len(trace.out)] - t[:1] >= LIMITS.settling_time
    innovations = trace.out[settled, OUTPUTS:]
    finite = innovations[np.isfinite(innovations)]
    lost = np.isnan(trace.out[-1:, 0]).any() or len(trace.starts) > 1
    nis = np.inf if lost or not finite.size else float(np.minimum(finite**2, of.constants.gate).mean())
    flexure, at = np.full(3, np.inf), of.places.resonators
    if at >= 0:
        found = kept[: len(settled)][settled][:, [at + 1, at + 3, 2]]
        found = found[np.isfinite(found).all(axis=1)]
        flexure = np.sqrt(np.mean(np.square(found), axis=0)) if len(found) else flexure
    return _FilteredStretch(nis, flexure, state)


def _density(
    recording: Recording, runs: _StretchRuns, tried: AoaSettings, densities: Sequence[float], most: int
) -> float | None:
    """The smallest of the first ``most`` densities under which all stretches fit, and which a larger one does not
    better; None of none."""
    limit = LIMITS.snap_ratio * _still(recording, tried)

    @cache
    def largest(density: float) -> float:
        of, worst = _with_snap(tried, density), 0.0
        for number in range(len(runs.stretches)):
            worst = max(worst, runs.of(number, of).nis)
            if not worst < limit:  # the others would not make it better
                return math.inf
        return worst

    def excess(density: float) -> float:
        return largest(density) / _still(recording, _with_snap(tried, density)) - 1.0

    for density, livelier in islice(pairwise((*densities, None)), most):
        assert density is not None
        if not largest(density) < limit:
            continue
        if livelier is None or (own := excess(density)) < LIMITS.snap_excess:
            return density
        if own - excess(livelier) < LIMITS.snap_excess:
            return density
    return None


def _calmer(runs: _StretchRuns, stated: Prior, settings: AoaSettings) -> AoaSettings:
    """The study with less flexure in each direction in which the fusion finds a tenth of what is allowed at most, in
    all stretches, and again with what is allowed then, where the ``stated`` prior is the usual one: what is allowed for
    and is not there costs u, most at rest.

    The first time this asks that angular acceleration makes no more of unknown positions than the usual flexure, the
    second time a tenth of that: the filter needs room for its errors of second order, or its u is too small.
    """
    usual, prior = Prior(), settings.prior
    if not _usual_flexure(stated) or settings.estimator.states < 15:
        return settings
    found = [runs.of(number, settings).flexure for number in range(len(runs.stretches))]
    z, x, acceleration = np.max(found, axis=0).tolist()
    moved = math.hypot(prior.lever_common, prior.lever) * acceleration

    def calm(each: R, before: Resonance, rms: float) -> R:
        largest = before.level
        for _ in range(LIMITS.calm_steps if each == before else 0):
            if moved < largest and rms < LIMITS.calm_share * each.level:
                each = replace(each, level=LIMITS.calm_level * each.level)
            largest *= LIMITS.calm_share
        return each

    heave, axial = calm(prior.heave, usual.heave, z), calm(prior.axial, usual.axial, x)
    return replace(settings, prior=replace(prior, heave=heave, axial=axial))


def _usual_flexure(prior: Prior) -> bool:
    """True where the study does not state flexure."""
    usual = Prior()
    return (prior.heave, prior.axial) == (usual.heave, usual.axial)


def _shaken(prior: Prior) -> Iterator[Prior]:
    """Priors by which the support shakes the model more, in a wide band; none where flexure is stated.

    A plunge comes first: it changes the size of gravity and not its direction, and costs hardly any u.
    """
    if not _usual_flexure(prior):
        return
    directions: tuple[Direction, ...] = ("vertical", "z")
    for direction in directions:
        for level in SHAKING:
            wide = LIMITS.shaking_frequency, LIMITS.shaking_damping, level
            axial = prior.axial if direction == "vertical" else Resonance(*wide)
            yield replace(prior, heave=Heave(*wide, direction), axial=axial)


def of_vibration(settings: AoaSettings, decided: AoaSettings) -> list[Finding]:
    """``band_limited``, ``wide_flexure``, ``wide_gyro_scale``: a band, flexure of the sting and a prior of the gyro's
    scale that the recording decided, and what to write to keep them."""
    findings, band, flexure = [], decided.band, decided.prior.heave
    if settings.band.low_pass is None and len(band.sections) > len(settings.band.notch):
        text = (
            "the sensors feel vibration that is no motion of the model, and the fusion takes them without it"
        )
        action = f"to have the same band again write {band.words} under [band]"
        findings.append(Finding("band_limited", text, action=action))
    if left := band.left_out:
        text = (
            f"{', '.join(f'{each:.4g} Hz' for each in left)} under [band] is left out: of {band.rate:.4g} rows a "
            f"second a low pass is to be below {LIMITS.widest_corner:g}, a notch below half"
        )
        findings.append(Finding("band_limited", text))
    if flexure.frequency != settings.prior.heave.frequency:
        text = (
            f"the support {'plunges' if flexure.vertical else 'shakes the model beyond its usual flexure'}, and u "
            "allows for it"
        )
        action = (
            f'to have the same again write frequency = "{flexure.frequency:.3g} Hz", '
            f'damping = "{flexure.damping:.3g}", level = "{flexure.level / STANDARD_GRAVITY:.3g} g"'
            + (
                ', direction = "vertical" under [prior.heave]'
                if flexure.vertical
                else " under [prior.heave] and [prior.axial]"
            )
        )
        findings.append(Finding("wide_flexure", text, action=action))
    if decided.prior.gyro_scale != settings.prior.gyro_scale:
        text = (
            f"the recording contradicts a gyro whose scale is known to {100.0 * settings.prior.gyro_scale:g} %, and u "
            f"allows for {100.0 * decided.prior.gyro_scale:g} %"
        )
        action = f'calibrate it, or write gyro_scale = "{100.0 * decided.prior.gyro_scale:g} %" under [prior]'
        findings.append(Finding("wide_gyro_scale", text, action=action))
    return findings


def of_delay(delay: Delay | None, problem: FusionProblem, filtered: FusionResult) -> list[Finding]:
    """``command_shift``: a delay that costs more than u and that nobody stated. It is the gyro's, by the spectra, where
    the fusion does not learn it, for it may not go far from the study's; or that of the accelerometers, and so of the
    angle, where the gyro comes before them.
    """
    k = problem.places.delay
    known = np.isfinite(filtered.u) & np.isfinite(filtered.rate)
    if k < 0 or not known.any():
        return []
    rate, u = float(np.sqrt(np.mean(np.square(filtered.rate[known])))), float(np.median(filtered.u[known]))
    tau, constants = float(filtered.state.x[k]), problem.constants
    if delay is not None:
        off = abs(delay.value - tau)
        if off > LIMITS.delay_sigmas * delay.u and off * rate > u:
            side = "later" if delay.value > 0.0 else "earlier"
            text = (
                f"gyro comes {1e3 * abs(delay.value):.2g} ms {side} than the accelerometers by the spectra, which the "
                "fusion does not learn"
            )
            action = f'write gyro_delay = "{1e3 * delay.value:.3g} ms" under [timing]'
            return [Finding("command_shift", text, harm=EVERYTHING, action=action)]
    late = -tau - constants.common_delay
    late_u = math.hypot(math.sqrt(filtered.state.P[k, k]), constants.common_delay_u)
    if not (late > LIMITS.delay_sigmas * late_u and late * rate > u):
        return []
    text = (
        f"accelerometers come {-1e3 * tau:.2g} ms later than the gyro, and the angle with them, by "
        f"{math.degrees(late * rate):.2g} deg at these rates"
    )
    action = (
        f'write common_delay = "{-1e3 * tau:.3g} ms" under [timing], or gyro_delay = "{1e3 * tau:.3g} ms" there where '
        "the gyro is early"
    )
    return [Finding("command_shift", text, harm=EVERYTHING, action=action)]


def _fair(part: Recording, settings: AoaSettings) -> AoaSettings:
    """The study with noise as large as a stretch has it at all frequencies: more noise is no motion, vibration is."""
    _, loud = misstated(part, settings)
    noise, found = settings.noise, loud.noise
    of_acc, of_gyro = white_noise(part)
    noise = replace(
        noise,
        accelerometer=max(noise.accelerometer, min(found.accelerometer, of_acc)),
        gyro=max(noise.gyro, min(found.gyro, of_gyro)),
    )
    return replace(settings, noise=noise)


def _with_snap(settings: AoaSettings, density: float) -> AoaSettings:
    """The study with a density of snap, as it is where that is the usual one."""
    estimator = settings.estimator
    return (
        settings
        if density == estimator.density
        else replace(settings, estimator=replace(estimator, snap=density))
    )


def _with_delay(delay: Delay | None, settings: AoaSettings) -> AoaSettings:
    """The study with the delay that the spectra show, where it is estimated and as far as its prior goes.

    The filter alone may learn a delay from noise, or a far one that its series does not hold for.
    """
    prior = settings.prior
    if settings.timing.gyro_delay is not None:
        return settings
    if delay is None or abs(delay.value) > LIMITS.prior_sigmas * prior.gyro_delay:
        return settings
    u = max(LIMITS.spectral_delay_sigmas * delay.u, LIMITS.least_delay_u)
    if u > prior.gyro_delay:
        return settings
    return replace(
        settings,
        prior=replace(prior, gyro_delay=u),
        timing=replace(settings.timing, gyro_delay_about=delay.value),
    )


def _bands(part: Recording, settings: AoaSettings) -> Iterator[Band]:
    """Bands narrower than the whole: without the lines of the spectrum, then with low passes above the motion too."""
    motion, rate = highest_motion(part, settings), settings.band.rate
    stated = settings.band.notch
    least = max(LIMITS.corner_ratio * motion, LOW_PASSES[-1])
    for corner in (math.inf, *sorted({max(each, least) for each in LOW_PASSES}, reverse=True)):
        found = lines(part, motion, min(corner, rate))
        band = Band(corner, tuple(dict.fromkeys([*stated, *found])), rate)
        if len(band.sections) > len(stated):
            yield band


def _still(recording: Recording, settings: AoaSettings) -> float:
    """The same of a still model with the study's noise, sampled as the recording was by the sensors that it has."""
    step = recording.interval
    lasting = max(2.0 * LIMITS.settling_time, min(LIMITS.snap_time, LIMITS.still_rows * step))
    t = step * np.arange(round(lasting / step), dtype=float)
    layout, rng = settings.layout, np.random.default_rng(0)
    up = settings.site.gravity * settings.attitude.level
    acc = np.tile(-up * np.sin(layout.angle), (len(t), 1))
    acc += settings.noise.accelerometer * rng.standard_normal(acc.shape)
    gyro, *turns = settings.noise.gyro * rng.standard_normal((3, len(t)))
    acc[:, ~np.isfinite(recording.acc).any(axis=0)] = np.nan
    if not np.isfinite(recording.gyro).any():
        gyro[:] = np.nan
    none = np.full((len(t), 2), np.nan)
    still = Recording(t, acc, gyro, np.column_stack(turns) if recording.spatial else none, none)
    return _filtered(problem(settings, recording.spatial), still).nis
