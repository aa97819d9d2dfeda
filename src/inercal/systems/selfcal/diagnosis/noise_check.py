"""The noise that sensors show in the innovations of the error-state filter, beside the stated one.

Walks of the gyros other than stated, and biases that walk, are tried by the error-state filter: that which leaves
innovations white is named; 1/f noise, which is no walk to the letter, by the walk that takes most of them away.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import EVERYTHING, Finding, with_alternatives
from inercal.foundation.inference.consistency import slow_power, whiteness
from inercal.foundation.inference.hypotheses import sigmas
from inercal.foundation.records.places import places
from inercal.foundation.units import parse_quantity
from inercal.systems.selfcal.diagnosis.fit_quality import filtered, regular, sound
from inercal.systems.selfcal.filters.filter_result import FilterResult
from inercal.systems.selfcal.filters.problem import FilterProblem
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.recording import Recording
from inercal.systems.selfcal.platform.states import ALL, BIAS_WALK, KIND_OF, STATES
from inercal.systems.selfcal.settings import Noise

#: kinds of states that are tried, and how they are named
_TRIED: Final[tuple[tuple[tuple[str, ...], str], ...]] = (
    (("accelerometer_walk",), "accelerometer biases that wander"),
    (("gyro_walk",), "gyro biases that wander"),
    (BIAS_WALK, "biases that wander"),
)

_FACTORS: Final = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0)
"""Of the walks that are stated."""


class Explained(NamedTuple):
    """An explanation of innovations: the ``finding``, and how ``white`` it leaves them, the probability by chance of
    their correlations."""

    finding: Finding
    white: float


def _walking_biases(recording: Recording, problem: FilterProblem, now: FilterResult) -> Explained | None:
    """Biases that walk, or walk more than stated, that leave innovations white, or most nearly so, if any do."""
    best, most, much = None, None, LIMITS.left_over * _off(recording, now) * _throughout(recording, now)
    for kinds, words in _TRIED:
        before = math.inf
        for factor in _FACTORS:
            wider = _with_states(problem, kinds, factor)
            known = len(wider.names) == len(problem.names)
            if known and (kinds != BIAS_WALK or factor == 1.0):
                continue
            then = filtered(recording, wider)
            white = whiteness(regular(recording, then.innovations)) if sound(then) else 0.0
            larger = f"{factor:g} times accelerometer_walk and gyro_walk under [noise]"
            advice = f"state {larger}" if known else "name bias_walk in states under [model]"
            if factor > 1.0 and not known:
                advice += f", with {larger}"
            if white > max(LIMITS.nearly_white, best.white if best else 0.0):
                text = f"{words} explain the innovations"
                best = Explained(Finding("unmodelled", text, harm=EVERYTHING, action=advice), white)
            if white > LIMITS.risk:
                return best
            left = _off(recording, then)
            if left < much:
                text = f"most of the innovations look like {words}, as with 1/f noise"
                found = Finding("unmodelled", text, harm=EVERYTHING, action=advice)
                most, much = Explained(found, white), 0.5 * left
            if left > before:
                break
            before = left
    return best or most


def _off(recording: Recording, now: FilterResult) -> float:
    """Distance of innovations from white ones of the stated size: the largest, over both sensors, of what their mean
    square is off and of their correlation from row to row."""
    z, off = regular(recording, now.innovations), 0.0
    for columns in (z[:, :3], z[:, 3:]):
        products, squares = columns[1:] * columns[:-1], np.square(columns)
        if np.isfinite(products).any():
            mean = float(np.nanmean(squares))
            alike = abs(float(np.nanmean(products))) / mean if mean > 0.0 else 0.0
            off = max(off, abs(mean - 1.0), alike)
    return off


def _throughout(recording: Recording, now: FilterResult) -> bool:
    """True where innovations are too large in most of the recording, as noise makes them, not in a part of it."""
    squares = np.square(regular(recording, now.innovations))
    if not np.isfinite(squares).any():
        return False
    parts = [part[np.isfinite(part)] for part in np.array_split(squares, LIMITS.even_parts)]
    usual = float(np.median([part.mean() for part in parts if len(part)]))
    return usual - 1.0 > 0.5 * (float(np.nanmean(squares)) - 1.0)


def _with_states(problem: FilterProblem, kinds: tuple[str, ...], factor: float) -> FilterProblem:
    """The problem with more kinds of states, with their usual priors, and walks larger by a factor."""
    prior = dict(zip(problem.names, problem.prior, strict=True))
    usual = {kind: parse_quantity(STATES[kind].prior, STATES[kind].dimension, kind).value for kind in kinds}
    noise: Noise = replace(
        problem.noise,
        gyro_walk=factor * problem.noise.gyro_walk,
        accelerometer_walk=factor * problem.noise.accelerometer_walk,
    )
    usual |= {"gyro_walk": noise.gyro_walk_sigma, "accelerometer_walk": noise.accelerometer_walk_sigma}
    names = tuple(name for name in ALL if name in prior or KIND_OF[name] in kinds)
    own = {name: size for name, size in prior.items() if KIND_OF[name] not in {*BIAS_WALK} & {*kinds}}
    sizes = np.array([own.get(name, usual.get(KIND_OF[name], 0.0)) for name in names])
    vector = replace(problem.states, names=names)
    return replace(problem, noise=noise, prior=sizes, vector=vector)


_SENSORS = ("accelerometers", "encoders")

_NOISE = "state the noise as it is under [noise]"


def misstated(recording: Recording, problem: FilterProblem, now: FilterResult) -> list[Finding]:
    """Innovations larger or smaller than the stated noise has them, or correlated in time."""
    if not now.converged:
        text = f"the error-state filter fails on this recording: {now.message}"
        return [Finding("contradiction", text, harm=EVERYTHING)]
    z = regular(recording, now.innovations)
    findings, wide = [], False
    for sensor, columns in zip(_SENSORS, (z[:, :3], z[:, 3:]), strict=True):
        finite = columns[np.isfinite(columns)]
        if len(finite) < LIMITS.scatter_scalars:
            continue
        mean, error = float(np.mean(np.square(finite))), math.sqrt(2.0 / len(finite))
        factor = math.sqrt(mean)
        if mean > 1.0 + LIMITS.nis_sigmas * error:
            wide = True
            if _even(columns, mean) and whiteness(columns) > LIMITS.risk:
                text = f"{sensor}: noise is {factor:.3g} times what is stated, evenly over the recording"
                findings.append(Finding("excess_scatter", text, harm=EVERYTHING, action=_NOISE))
        elif mean < 1.0 - LIMITS.nis_sigmas * error and factor * LIMITS.low_noise_ratio < 1.0:
            text = f"{sensor}: noise is only {factor:.2g} of what is stated, and u is too large"
            findings.append(Finding("low_scatter", text, action=_NOISE))
    if findings:
        return findings
    if not wide and problem.noise.unsteady:
        return []  # readings on a base that sways, or vibrates, are not independent
    if not wide and whiteness(z) > LIMITS.risk:
        return _wandering(recording, problem, z)
    if (swaying := _swaying(recording, problem, z)) is not None:
        return [swaying]
    return [unsteady(recording, problem, now) or _unexplained(z)]


def unsteady(recording: Recording, problem: FilterProblem, now: FilterResult) -> Finding | None:
    """A walk of the gyros other than stated, or biases that walk: that which leaves innovations whiter, if any, and the
    other as possible too. ``now`` is what the filter makes of the recording."""
    noise = _restless_gyros(recording, problem, now)
    found = [each for each in (noise, _walking_biases(recording, problem, now)) if each]
    if not found:
        return None
    best, *others = sorted(found, key=lambda each: -each.white)
    return with_alternatives(
        best.finding, (each.finding.headline for each in others if each.white > LIMITS.risk)
    )


def _wandering(recording: Recording, problem: FilterProblem, z: Array) -> list[Finding]:
    """Biases of accelerometers that wander and are no states, which slow power shows where nothing else does."""
    rows = LIMITS.slow_time / float(np.median(recording.dt))
    if problem.states.has("accelerometer_walk") or slow_power(z[:, :3], rows) > LIMITS.risk:
        return []
    text = "innovations of the accelerometers are correlated over seconds, as where their biases wander"
    action = "name bias_walk in states under [model]"
    return [Finding("unmodelled", text, harm=EVERYTHING, action=action)]


def _swaying(recording: Recording, problem: FilterProblem, z: Array) -> Finding | None:
    """One frequency in the innovations of the encoders, if any: Fisher's test of the largest ordinate of a periodogram
    (R. A. Fisher, Tests of significance in harmonic analysis, Proceedings of the Royal Society A 125 (1929) 54)."""
    n, dt = len(z), float(np.median(recording.dt))
    power = np.square(np.abs(np.fft.rfft(np.nan_to_num(z[:, 3:]), axis=0))).sum(axis=1)[1 : (n + 1) // 2]
    if n < LIMITS.scatter_scalars or not power.any():
        return None
    largest = int(np.argmax(power))
    rest = math.log1p(-min(float(power[largest] / power.sum()), 1.0 - 1e-9))
    # sums over three joints are more even than one
    if math.log(len(power)) + (len(power) - 1) * rest > math.log(LIMITS.risk):
        return None
    # turning joints spread it; two level axes sway alike
    wide = len(power) // LIMITS.sway_bands
    band = power[max(largest - wide, 0) : largest + wide + 1]
    amplitude = math.sqrt(2.0 * float(band.sum())) / n * problem.noise.encoder
    stated = replace(problem.noise, base_sway=amplitude, vibration=0.0).of_readings
    if not sound(filtered(recording, replace(problem, noise=stated))):
        return None
    hertz, seconds = (largest + 1) / (n * dt), math.degrees(amplitude) * 3600.0
    text = f"the encoders' readings swing with {hertz:.2g} Hz, by some {seconds:.2g} arcsec"
    action = "where the base sways, state base_sway under [noise]"
    return Finding("excess_scatter", text, harm=EVERYTHING, action=action)


def _even(columns: Array, mean: float) -> bool:
    """True where the mean square is the same over all parts of the recording."""
    limit = sigmas(LIMITS.risk, LIMITS.even_parts)
    for part in np.array_split(columns, LIMITS.even_parts):
        finite = part[np.isfinite(part)]
        off = abs(np.mean(np.square(finite)) / mean - 1.0) if len(finite) else 0.0
        if off > limit * math.sqrt(2.0 / max(len(finite), 1)):
            return False
    return True


def _restless_gyros(recording: Recording, problem: FilterProblem, now: FilterResult) -> Explained | None:
    """Gyro noise other than stated that explains the innovations, if any: half octaves are halved, by the correlation
    of the encoders' innovations from row to row, which a walk that is too small makes positive."""
    larger = _serial(regular(recording, now.innovations)) > 0.0
    octaves = np.arange(0.5, 10.1, 0.5) if larger else -np.arange(0.5, 3.1, 0.5)[::-1]
    fitting, low, high = dict[float, float](), 0, len(octaves) - 1
    while low <= high:
        k = (low + high) // 2
        factor = float(2.0 ** octaves[k])
        noise = replace(problem.noise, angle_random_walk=factor * problem.noise.angle_random_walk)
        then = filtered(recording, replace(problem, noise=noise))
        z = regular(recording, then.innovations)
        # half an octave too much makes squares of innovations half as large at most; a walk that is none, much smaller
        fits = sound(then) and float(np.nanmean(np.square(then.innovations[:, 3:]))) > LIMITS.walk_square
        if fits and (white := whiteness(z)) > LIMITS.risk:
            fitting[factor] = white
        low, high = (k + 1, high) if _serial(z) > 0.0 else (low, k - 1)
    if not fitting:
        return None
    least, most = min(fitting), max(fitting)
    text = f"the gyros' angle random walk looks about {_two_digits(math.sqrt(least * most))} times what is stated"
    more = f" ({_two_digits(least)} to {_two_digits(most)})" if len(fitting) > 1 else ""
    code, harm = ("excess_scatter", EVERYTHING) if larger else ("low_scatter", ())
    found = Finding(code, text + more, harm=harm, action="state angle_random_walk so under [noise]")
    return Explained(found, max(fitting.values()))


def _serial(z: Array) -> float:
    """Products of the encoders' innovations (n - 1, 3) with those of the next row, summed."""
    return float(np.nansum(z[1:, 3:] * z[:-1, 3:]))


def _two_digits(factor: float) -> str:
    """A number to two digits, without an exponent."""
    return f"{float(f'{factor:.2g}'):g}"


def _unexplained(z: Array) -> Finding:
    """Innovations that no known fault explains, with the part of the recording where they are largest."""
    parts = np.array_split(np.arange(len(z)), 20)
    squares = np.square(z)
    size = [float(np.nanmean(squares[part])) if np.isfinite(squares[part]).any() else 0.0 for part in parts]
    worst = parts[int(np.argmax(size))]
    text = (
        f"innovations contradict the model (mean square {max(size):.3g} at most, expected 1{_correlated(z)})"
    )
    text += ", and no fault that is looked for explains them"
    return Finding("contradiction", text, places("row", worst + 2), EVERYTHING)


def _correlated(z: Array) -> str:
    """Correlation from one row to the next of the sensors that have it, in words."""
    words = ""
    for sensor, columns in zip(_SENSORS, (z[:, :3], z[:, 3:]), strict=True):
        products = columns[1:] * columns[:-1]
        count = int(np.isfinite(products).sum())
        share = float(np.nanmean(products) / np.nanmean(np.square(columns))) if count else 0.0
        if abs(share) > LIMITS.nis_sigmas / math.sqrt(max(count, 1)):
            words += f"; {sensor}: correlated from row to row, by {share:.2g}"
    return words or ", or correlated in time"
