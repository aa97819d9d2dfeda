"""Constant errors that the fusion leaves out: hypotheses with one parameter, and the fusion as their judge.

Innovations of a filter are white where its model holds, which makes them the residuals of the score test
(`inercal.foundation.inference.hypotheses`), over the stretch that is judged. The model is never exact enough for chance
alone to decide: the likeliest errors are fitted to the end, and the one that takes most of the misfit away is taken, if
it takes half. At one angle a bias, a scale, an axis and gravity look alike: equally good errors are named beside it.
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import EVERYTHING
from inercal.foundation.inference.hypotheses import Fits, Fitted, Hypothesis, search
from inercal.foundation.units import STANDARD_GRAVITY, Quantity, parse_unit
from inercal.systems.aoa.diagnosis.fit_quality import Case, fit_quality
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import Recording
from inercal.systems.aoa.settings import AoaSettings


class Fusion:
    """The fusion as a judge: innovations without a gate and without wild ones, and a misfit that these hardly move."""

    def residuals(self, case: Case) -> Array:
        """(m, N + 1) innovations over their standard deviations."""
        recording, settings = case
        gated = replace(settings, estimator=replace(settings.estimator, gate=1e12))
        innovations = fit_quality(recording, gated).innovations
        size = np.abs(innovations)
        measured = np.flatnonzero(np.isfinite(size).any(axis=0))
        usual = np.zeros(size.shape[1])
        usual[measured] = np.nanmedian(size[:, measured], axis=0)
        return np.where(size < LIMITS.wild_ratio * usual, innovations, np.nan)

    def misfit(self, case: Case) -> float:
        """Misfit in one number (`inercal.systems.aoa.diagnosis.fit_quality.FitQuality.misfit`)."""
        return fit_quality(*case).misfit


JUDGE = Fusion()


def small_errors(case: Case) -> tuple[Fits[Case], Case]:
    """Constant errors that explain the rest of the misfit, and the case without them."""
    return search(case, constant_errors, JUDGE, 1.0, LIMITS.small_errors, choose=_most_explaining)


def _most_explaining(case: Case, fits: Iterator[Fits[Case]]) -> Fits[Case] | None:
    """The fit with the least misfit; None where it takes too little away."""
    best = _least(fits, JUDGE.misfit, LIMITS.small_alike_misfit)
    most = (1.0 - LIMITS.explained_share) * JUDGE.misfit(case)
    return None if best is None or JUDGE.misfit(best[-1].case) > most else best


def _least(fits: Iterator[Fits[Case]], misfit: Callable[[Case], float], alike: float) -> Fits[Case] | None:
    """The fit with the least misfit, with others that have hardly more."""
    likeliest = enumerate(itertools.islice(fits, LIMITS.fitted_errors))
    by_misfit = sorted((misfit(fit[-1].case), k, fit) for k, fit in likeliest)
    if not by_misfit:
        return None
    least, _, best = by_misfit[0]
    others = tuple(fit[-1] for of_fit, _, fit in by_misfit[1:] if of_fit < least + alike)
    return [*best[:-1], replace(best[-1], alike=others)]


def constant_errors(case: Case) -> Iterator[Hypothesis[Case]]:
    """Hypotheses of constant errors; none where the case fits."""
    recording, settings = case
    if fit_quality(recording, settings).fits:
        return
    yield from _beside_the_gyro(case)
    if np.isfinite(recording.gyro).any():
        yield _gyro_bias()


def _beside_the_gyro(case: Case) -> Iterator[Hypothesis[Case]]:
    """Hypotheses of constant errors that are none of the gyro."""
    recording, settings = case
    there = [k for k in range(recording.acc.shape[1]) if np.isfinite(recording.acc[:, k]).any()]
    for error in (_axis, _scale, _bias, _position):
        for k in there:
            yield error(settings, k)
    yield _pivot()
    yield _gravity(settings)
    if not recording.spatial:
        yield _yaw(fit_quality(recording, settings).theta)
        yield _roll()


def _error(
    name: str,
    code: str,
    without: Callable[[Recording, AoaSettings, float], Case],
    says: Callable[[float], str],
    step: float,
    bound: float,
    least: float | None = None,
) -> Hypothesis[Case]:
    """An error of one constant [SI], from ``least``, or minus the ``bound``, to the ``bound``."""

    def corrected(case: Case, values: Array) -> Case:
        return without(*case, float(values[0]))

    def sentence(fit: Fitted[Case]) -> str:
        return says(float(fit.values[0]))

    bounds = (-bound if least is None else least, bound)
    return Hypothesis(name, code, sentence, corrected, (name,), step, bounds, harm=EVERYTHING)


def _axis(settings: AoaSettings, k: int) -> Hypothesis[Case]:
    """An axis at lambda plus the value [rad]."""
    name, nominal = settings.layout.names[k], float(settings.layout.angle[k])

    def without(recording: Recording, settings: AoaSettings, value: float) -> Case:
        return recording, with_axis(settings, k, value)

    def says(value: float) -> str:
        advice = f'write angle = "{math.degrees(nominal + value):.4g} deg" under [sensors.{name}]'
        return f"the axis of {name} looks turned by {math.degrees(value):.3g} deg: {advice}"

    return _error(f"axis {name}", "unmodelled", without, says, 1e-5, 0.7)


def with_axis(settings: AoaSettings, k: int, value: float) -> AoaSettings:
    """A study with the axis of a sensor turned by the value [rad]."""
    angle = settings.layout.angle.copy()
    angle[k] += value
    return replace(settings, layout=replace(settings.layout, angle=angle))


def _scale(settings: AoaSettings, k: int) -> Hypothesis[Case]:
    """A sensor whose readings are 1 + value times too large."""
    name = settings.layout.names[k]

    def says(value: float) -> str:
        what = f"{name} looks to read {1.0 + value:.5g} times what it should"
        return f"{what}: correct the scale under [sensors.{name}]"

    return _error(f"scale {name}", "unmodelled", lambda r, s, x: (_read(r, k, 1.0 + x), s), says, 1e-5, 0.3)


def _bias(settings: AoaSettings, k: int) -> Hypothesis[Case]:
    """A sensor whose readings are too large by the value [m/s^2]."""
    name = settings.layout.names[k]

    def says(value: float) -> str:
        what = f"the bias of {name} looks to be {1e3 * value / STANDARD_GRAVITY:.3g} mg"
        return f"{what}: state a bias under [sensors.{name}], or a larger accelerometer_bias"

    return _error(f"bias {name}", "prior_suspect", lambda r, s, x: (_read(r, k, bias=x), s), says, 1e-4, 5.0)


def _read(recording: Recording, k: int, scale: float = 1.0, bias: float = 0.0) -> Recording:
    """The recording with accelerometer ``k`` freed of a bias [m/s^2] and a scale."""
    acc = recording.acc.copy()
    acc[:, k] = (acc[:, k] - bias) / scale
    return replace(recording, acc=acc)


def _gyro_bias() -> Hypothesis[Case]:
    """A gyro whose readings are too large by the value [rad/s]."""

    def without(recording: Recording, settings: AoaSettings, value: float) -> Case:
        return replace(recording, gyro=recording.gyro - value), settings

    def says(value: float) -> str:
        size = 3600.0 * math.degrees(abs(value))
        what = f"the bias of the gyro looks to be {math.copysign(size, value):.4g} deg/h"
        return f'{what}: write gyro_bias = "{size:.4g} deg/h" under [noise], or take it off'

    return _error("bias gyro", "prior_suspect", without, says, 1e-6, 0.1)


def _position(settings: AoaSettings, k: int) -> Hypothesis[Case]:
    """A sensor further ahead of the pivot by the value [m]."""
    name, nominal = settings.layout.names[k], float(settings.layout.r[k])

    def says(value: float) -> str:
        what = f"{name} looks to sit {1e3 * value:.3g} mm further ahead than stated"
        return f'{what}: write r = "{nominal + value:.4g} m" under [sensors.{name}]'

    return _error(
        f"position {name}", "prior_suspect", lambda r, s, x: (r, further_ahead(s, k, x)), says, 1e-4, 1.0
    )


def _pivot() -> Hypothesis[Case]:
    """All sensors further ahead of the pivot by the value [m]."""

    def says(value: float) -> str:
        what = f"the pivot looks to be {1e3 * value:.3g} mm further back than stated"
        return f"{what}: correct the positions r of all sensors"

    every = slice(None)
    return _error("pivot", "prior_suspect", lambda r, s, x: (r, further_ahead(s, every, x)), says, 1e-4, 1.0)


def further_ahead(settings: AoaSettings, k: int | slice, value: float) -> AoaSettings:
    """A study with a sensor, or all of them, further ahead by the value [m]."""
    r = settings.layout.r.copy()
    r[k] += value
    return replace(settings, layout=replace(settings.layout, r=r))


def _gravity(settings: AoaSettings) -> Hypothesis[Case]:
    """Gravity larger by the value [m/s^2]."""
    nominal = settings.site.gravity

    def without(recording: Recording, settings: AoaSettings, value: float) -> Case:
        site = replace(settings.site, gravity=settings.site.gravity + value)
        return recording, replace(settings, site=site)

    def says(value: float) -> str:
        advice = f"stated are {nominal:.6g} m/s^2, correct gravity or latitude and height under [site]"
        return f"gravity looks to be {nominal + value:.5g} m/s^2: {advice}"

    return _error("gravity", "site_suspect", without, says, 1e-4, 0.5)


def _yaw(theta: Array) -> Hypothesis[Case]:
    """Yaw about the vertical of the mean square rate ``value`` [rad^2/s^2]: f_x is less by r cos^2, f_z more by
    r sin cos of it; ``theta`` (m,) [rad] as the fusion has it."""

    def without(recording: Recording, settings: AoaSettings, value: float) -> Case:
        layout = settings.layout
        s, c = np.sin(theta)[:, None], np.cos(theta)[:, None]
        shown = -layout.r * value * (c * c * np.cos(layout.angle) + s * c * np.sin(layout.angle))
        return replace(recording, acc=recording.acc - shown), settings

    def says(value: float) -> str:
        what = f"the model looks to yaw to and fro by {math.degrees(math.sqrt(value)):.2g} deg/s rms"
        return f"{what}: no sensor here sees that, record gyro_roll and gyro_yaw"

    return _error("yaw", "unmodelled", without, says, 1e-4, 100.0, least=0.0)


def _roll() -> Hypothesis[Case]:
    """Roll of the mean square ``value`` [rad^2], all the time or to and fro: f_z is less by its mean cosine."""

    def without(recording: Recording, settings: AoaSettings, value: float) -> Case:
        rolled = math.acos(settings.attitude.level * math.cos(math.sqrt(max(value, 0.0))))
        roll = Quantity(rolled, 0.0, parse_unit("rad"), "")
        return recording, replace(settings, attitude=replace(settings.attitude, roll=roll))

    def says(value: float) -> str:
        what = f"the model looks rolled by {math.degrees(math.sqrt(value)):.2g} deg, all the time or rms"
        return f"{what}: state roll under [model], or record gyro_roll and gyro_yaw where it changes"

    return _error("roll", "unmodelled", without, says, 1e-4, 1.0, least=0.0)
