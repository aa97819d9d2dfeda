"""Constant errors that the fusion leaves out, fitted one at a time to what it cannot explain.

Innovations of a filter are white where its model holds, so that of a model with one more constant p they change by
J = d v / d p, and p = -J.v / J.J is its least-squares value (the score test; Willsky and Jones 1976). J is a difference
of two runs over the stretch that is judged.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np

from inercal.aoa.diagnosis.fit_quality import Judged, judge
from inercal.aoa.reading.recording import Recording
from inercal.aoa.settings import AoaSettings
from inercal.arrays import Array
from inercal.units import Quantity, parse_unit

_ROUNDS = 6
_CLOSE = 0.1
"""Change of p over its uncertainty at which the fit ends."""

_WILD = 30.0
"""Innovations over their median size that are left out of a fit."""


@dataclass(frozen=True, eq=False)
class Error:
    """A constant ``name`` of a sensor or of all: ``taken_out`` of a recording and its study for a value of it.

    ``step`` [SI] for the difference; ``most`` the largest value that is believed; ``least`` 0.0 where it cannot be
    negative.
    """

    name: str
    taken_out: Callable[[Recording, AoaSettings, float], tuple[Recording, AoaSettings]]
    step: float
    most: float
    least: float = -math.inf


@dataclass(frozen=True, eq=False)
class FittedError:
    """An error with its ``value``, its standard uncertainty ``u``, and what is ``judged`` without it."""

    error: Error
    value: float
    u: float
    judged: Judged


def candidates(recording: Recording, settings: AoaSettings, theta: Array) -> Iterator[Error]:
    """Errors that may be looked for; ``theta`` (n,) as the fusion has it with the study as it is."""
    layout = settings.layout
    there = [k for k in range(len(layout.names)) if np.isfinite(recording.acc[:, k]).any()]
    for k in there:
        yield Error(f"axis {layout.names[k]}", _axis(k), 1e-5, 0.7)
    for k in there:
        yield Error(f"scale {layout.names[k]}", _scale(k), 1e-5, 0.3)
    for k in there:
        yield Error(f"bias {layout.names[k]}", _bias(k), 1e-4, 5.0)
    for k in there:
        yield Error(f"position {layout.names[k]}", _position(k), 1e-4, 1.0)
    yield Error("pivot", _position(slice(None)), 1e-4, 1.0)
    yield Error("gravity", _gravity, 1e-4, 0.5)
    if not recording.spatial:
        yield Error("yaw", _yaw(theta), 1e-4, 100.0, 0.0)
        yield Error("roll", _roll, 1e-4, 1.0, 0.0)


def likeliest(errors: Iterable[Error], recording: Recording, settings: AoaSettings, most: int) -> list[Error]:
    """Those ``most`` errors of which a first step of the fit promises to take away most."""
    gated = _open(settings)
    now = judge(recording, gated).innovations
    ranked = [(_step(each, now, recording, gated, 0.0)[2], each) for each in errors]
    ranked.sort(key=lambda one: -one[0])
    return [each for gain, each in ranked[:most] if gain > 0.0]


def fitted(error: Error, recording: Recording, settings: AoaSettings) -> FittedError | None:
    """The error's most likely value; None where it has none, or one that is not believed."""
    gated = _open(settings)
    value, u = 0.0, math.inf
    for _ in range(_ROUNDS):
        now = judge(*error.taken_out(recording, gated, value)).innovations
        change, u, _ = _step(error, now, recording, gated, value)
        if not math.isfinite(change) or abs(value + change) > 2.0 * error.most:
            return None
        value += change
        if abs(change) < _CLOSE * u:
            break
    if not error.least <= value or abs(value) > error.most:
        return None
    return FittedError(error, value, u, judge(*error.taken_out(recording, settings, value)))


def _open(settings: AoaSettings) -> AoaSettings:
    """A study without a gate."""
    return replace(settings, estimator=replace(settings.estimator, gate=1e12))


def _step(
    error: Error, now: Array, recording: Recording, settings: AoaSettings, value: float
) -> tuple[float, float, float]:
    """Change of ``value`` that makes the innovations ``now`` least, its standard uncertainty, and how much it takes
    away of their sum of squares; NaN, infinite and 0 where they do not depend on it."""
    then = judge(*error.taken_out(recording, settings, value + error.step)).innovations
    with np.errstate(all="ignore"):
        size = np.array(
            [np.median(v[np.isfinite(v)]) if np.isfinite(v).any() else 0.0 for v in np.abs(now).T]
        )
        used = np.isfinite(now) & np.isfinite(then) & (np.abs(now) < _WILD * size)
        slope = np.where(used, then - now, 0.0) / error.step
        power = float(np.square(slope).sum())
        along = float((slope * np.where(used, now, 0.0)).sum())
    if not power > 0.0:
        return math.nan, math.inf, 0.0
    return -along / power, 1.0 / math.sqrt(power), along**2 / power


def _axis(k: int) -> Callable[[Recording, AoaSettings, float], tuple[Recording, AoaSettings]]:
    """An axis at lambda plus the value [rad]."""

    def taken_out(recording: Recording, settings: AoaSettings, value: float) -> tuple[Recording, AoaSettings]:
        angle = settings.layout.angle.copy()
        angle[k] += value
        return recording, replace(settings, layout=replace(settings.layout, angle=angle))

    return taken_out


def _scale(k: int) -> Callable[[Recording, AoaSettings, float], tuple[Recording, AoaSettings]]:
    """A sensor that reads 1 + value times what it should."""

    def taken_out(recording: Recording, settings: AoaSettings, value: float) -> tuple[Recording, AoaSettings]:
        acc = recording.acc.copy()
        acc[:, k] /= 1.0 + value
        return replace(recording, acc=acc), settings

    return taken_out


def _bias(k: int) -> Callable[[Recording, AoaSettings, float], tuple[Recording, AoaSettings]]:
    """A sensor that reads more by the value [m/s^2]."""

    def taken_out(recording: Recording, settings: AoaSettings, value: float) -> tuple[Recording, AoaSettings]:
        acc = recording.acc.copy()
        acc[:, k] -= value
        return replace(recording, acc=acc), settings

    return taken_out


def _position(k: int | slice) -> Callable[[Recording, AoaSettings, float], tuple[Recording, AoaSettings]]:
    """A sensor, or all of them, further ahead of the pivot by the value [m]."""

    def taken_out(recording: Recording, settings: AoaSettings, value: float) -> tuple[Recording, AoaSettings]:
        r = settings.layout.r.copy()
        r[k] += value
        return recording, replace(settings, layout=replace(settings.layout, r=r))

    return taken_out


def _gravity(recording: Recording, settings: AoaSettings, value: float) -> tuple[Recording, AoaSettings]:
    """Gravity larger by the value [m/s^2]."""
    site = replace(settings.site, gravity=settings.site.gravity + value)
    return recording, replace(settings, site=site)


def _yaw(theta: Array) -> Callable[[Recording, AoaSettings, float], tuple[Recording, AoaSettings]]:
    """Yaw about the vertical of the mean square rate ``value`` [rad^2/s^2]: f_x is less by r cos^2, f_z more by
    r sin cos of it."""

    def taken_out(recording: Recording, settings: AoaSettings, value: float) -> tuple[Recording, AoaSettings]:
        layout = settings.layout
        s, c = np.sin(theta)[:, None], np.cos(theta)[:, None]
        shown = -layout.r * value * (c * c * np.cos(layout.angle) + s * c * np.sin(layout.angle))
        return replace(recording, acc=recording.acc - shown), settings

    return taken_out


def _roll(recording: Recording, settings: AoaSettings, value: float) -> tuple[Recording, AoaSettings]:
    """Roll of the mean square ``value`` [rad^2], all the time or to and fro: f_z is less by its mean cosine."""
    stated = 0.0 if settings.attitude.roll is None else settings.attitude.roll.value
    turned = math.acos(math.cos(stated) * math.cos(math.sqrt(max(value, 0.0))))
    roll = Quantity(turned, 0.0, parse_unit("rad"), "")
    return recording, replace(settings, attitude=replace(settings.attitude, roll=roll))
