"""A simulated recording of a wind-tunnel model on its sting, with the disturbances of real ones."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.foundation.records.record import Record, record_of
from inercal.foundation.units import STANDARD_GRAVITY, Unit, parse_unit
from inercal.systems.aoa.disturbances import Disturbances
from inercal.systems.aoa.motion import (
    SINES,
    Sines,
    course,
    duration,
    oscillation,
    point_numbers,
    shaking,
    tones,
)
from inercal.systems.aoa.reading.recording import Recording
from inercal.systems.aoa.settings import GYROS, AoaSettings, Noise

_MARGIN = 1.0
"""Time [s] before the first sample from which sensors of limited bandwidth follow."""


@dataclass(frozen=True, eq=False)
class Simulated:
    """A ``recording`` and its truth: the angle ``theta`` (n,) [rad], its ``rate`` [rad/s] and ``acceleration``
    [rad/s^2] at the stamps, and the ``errors`` of the sensors by name, as `inercal.systems.aoa.fusion.problem` names
    them."""

    recording: Recording
    theta: Array
    rate: Array
    acceleration: Array
    errors: Mapping[str, float]


def drawn_biases(noise: Noise, count: int, rng: np.random.Generator) -> dict[str, float]:
    """Biases of ``count`` accelerometers and of the gyros: half the variance of the former in common."""
    common, *own = math.sqrt(0.5) * noise.accelerometer_bias * rng.standard_normal(count + 1)
    biases = {f"b_{k}": float(common + each) for k, each in enumerate(own, start=1)}
    of_gyros = noise.gyro_bias * rng.standard_normal(3)
    return biases | dict(zip(("b_g", "b_roll", "b_yaw"), map(float, of_gyros), strict=True))


def simulate(
    settings: AoaSettings, rng: np.random.Generator, errors: Mapping[str, float] | None = None
) -> Simulated:
    """Move the model once as the study plans.

    ``errors`` of the sensors by name are drawn from the study's noise where they are not given; those of the study's
    disturbances (pivot, heights, gyro scale and delay) are added to them. Raises `StudyError` without a motion.
    """
    plan, other, layout = settings.motion, settings.disturbances, settings.layout
    if plan is None:
        raise StudyError("motion", "missing, expected the motion to be simulated")
    n = len(layout.names)
    truth = drawn_biases(settings.noise, n, rng) if errors is None else dict(errors)
    for k in range(n):
        truth[f"dr_{k + 1}"] = truth.get(f"dr_{k + 1}", 0.0) + other.pivot
        height = other.heights[k] if k < len(other.heights) else 0.0
        truth[f"zo_{k + 1}"] = truth.get(f"zo_{k + 1}", 0.0) + height
        axis = other.axis_errors[k] if k < len(other.axis_errors) else 0.0
        truth[f"dlambda_{k + 1}"] = truth.get(f"dlambda_{k + 1}", 0.0) + axis
    truth["k_g"] = truth.get("k_g", 0.0) + other.gyro_scale
    truth["tau_g"] = truth.get("tau_g", 0.0) + other.gyro_delay
    pitch = course(plan, rng)
    flexure = [shaking(each, rng) for each in (other.pitch, other.heave, other.axial)]
    tunnel = _tunnel(settings, rng)
    step = 1.0 / plan.sample_rate
    t = step * np.arange(round(duration(plan) / step), dtype=float)
    before = round(_MARGIN / step) if math.isfinite(other.bandwidth) else 0
    longer = step * np.arange(-before, len(t), dtype=float)

    def moved(at: Array) -> tuple[Array, Array, Array]:
        parts = (pitch(at), flexure[0](at), tunnel.buffet(at))
        theta, rate, acceleration = (a + b + c for a, b, c in zip(*parts, strict=True))
        return theta, rate, acceleration

    body = _Body(settings, truth)
    late = longer - other.common_delay
    if other.stamp_jitter > 0.0:
        late = late + other.stamp_jitter * rng.standard_normal(len(late))
    up, along = tunnel.up(late)[0] + flexure[1](late)[0], tunnel.along(late)[0] + flexure[2](late)[0]
    force = body.specific_force(late, *moved(late), up, along, tunnel.plunge(late)[0])
    force += np.column_stack([each(late)[0] for each in tunnel.local])
    read = body.accelerometers(force, late / t[-1] if len(t) > 1 else late)
    later = late - truth["tau_g"]
    values = np.column_stack([read, *body.gyros(later, *moved(later))])
    values += np.column_stack([each(late)[0] for each in tunnel.mains])
    values = _limited(values, other, step)[before:]
    noise = np.array([settings.noise.accelerometer] * n + [settings.noise.gyro] * 3)
    values += noise * rng.standard_normal(values.shape)
    walk = np.array([settings.noise.accelerometer_walk] * n + [settings.noise.gyro_walk] * 3)
    if walk.any():
        values += np.cumsum(walk * math.sqrt(step) * rng.standard_normal(values.shape), axis=0)
    values = _spoiled(values, settings, rng)
    theta, rate, acceleration = moved(t)
    spatial = other.roll is not None or other.yaw is not None
    turns = values[:, n + 1 :] if spatial else np.full((len(t), 2), np.nan)
    recording = Recording(
        t=t,
        acc=values[:, :n].copy(),
        gyro=values[:, n].copy(),
        turns=turns.copy(),
        zero_angle=np.full((len(t), 2), np.nan),
        point=point_numbers(plan, t),
        reference=theta,
    )
    return Simulated(recording, theta, rate, acceleration, truth)


@dataclass(frozen=True, eq=False)
class _Tunnel:
    """Random parts of a tunnel: ``buffet`` [rad], accelerations of the model ``up`` along z, ``along`` x and ``plunge``
    along the vertical, ``local`` ones of each accelerometer, and ``mains`` in each channel [m/s^2, rad/s]."""

    buffet: Sines
    plunge: Sines
    up: Sines
    along: Sines
    local: tuple[Sines, ...]
    mains: tuple[Sines, ...]


def _tunnel(settings: AoaSettings, rng: np.random.Generator) -> _Tunnel:
    """The tunnel of a study's disturbances; nothing is drawn for what is absent."""
    other, n = settings.disturbances, len(settings.layout.names)
    frequencies = [line.frequency for line in other.lines]
    plunge, mains = other.plunge, other.mains
    levels = () if mains is None else (mains.level,) * n + (mains.rate,) * len(GYROS)
    return _Tunnel(
        buffet=shaking(other.buffet, rng, SINES),
        plunge=tones([], [], rng) if plunge is None else tones([plunge.level], [plunge.frequency], rng),
        up=tones([line.level for line in other.lines], frequencies, rng),
        along=tones([line.axial for line in other.lines], frequencies, rng),
        local=tuple(shaking(other.local_vibration, rng) for _ in range(n)),
        mains=tuple(tones([level], [mains.frequency], rng) for level in levels)
        if mains is not None
        else (tones([], [], rng),) * (n + len(GYROS)),
    )


@dataclass(frozen=True, eq=False)
class _Body:
    """The rigid model with its sensors, as they truly are."""

    settings: AoaSettings
    errors: Mapping[str, float]

    def turning(self, t: Array, theta: Array, rate: Array, acceleration: Array) -> tuple[Array, ...]:
        """Roll phi, body rates about x, nose-up, and about z, and the nose-up acceleration.

        Yaw psi about the vertical first, then pitch, then roll:

            p = phi' + psi' sin theta
            w = theta' cos phi - psi' cos theta sin phi
            y = theta' sin phi + psi' cos theta cos phi
        """
        other, nominal = self.settings.disturbances, self.settings.attitude.roll
        phi, phi1, _ = oscillation(other.roll)(t)
        phi = phi + (0.0 if nominal is None else nominal.value)
        _, psi1, psi2 = oscillation(other.yaw)(t)
        s, c, sp, cp = np.sin(theta), np.cos(theta), np.sin(phi), np.cos(phi)
        p, w, y = phi1 + psi1 * s, rate * cp - psi1 * c * sp, rate * sp + psi1 * c * cp
        al = acceleration * cp - rate * sp * phi1 - psi2 * c * sp + psi1 * (s * rate * sp - c * cp * phi1)
        return phi, p, w, y, al

    def specific_force(
        self,
        t: Array,
        theta: Array,
        rate: Array,
        acceleration: Array,
        heave: Array,
        axial: Array,
        plunge: Array,
    ) -> Array:
        """(n, N) m/s^2 along the axes; ``heave`` and ``axial`` in the body's, ``plunge`` (n,) in the vertical."""
        layout, errors = self.settings.layout, self.errors
        phi, p, w, y, al = self.turning(t, theta, rate, acceleration)
        along = np.empty((len(t), len(layout.names)))
        g = self.settings.site.gravity + plunge
        for k, angle in enumerate(layout.angle):
            r, z = layout.r[k] + errors[f"dr_{k + 1}"], layout.z[k] + errors[f"zo_{k + 1}"]
            fx = g * np.sin(theta) - r * (w**2 + y**2) - z * (al - p * y) + axial
            fz = g * np.cos(theta) * np.cos(phi) + r * (al + p * y) - z * (w**2 + p**2) + heave
            turned = angle + errors[f"dlambda_{k + 1}"]
            along[:, k] = fx * math.cos(turned) - fz * math.sin(turned)
        return along

    def accelerometers(self, force: Array, part: Array) -> Array:
        """(n, N) m/s^2, without noise, of specific ``force`` (n, N); ``part`` (n,) of the record goes from 0 to 1."""
        other, count = self.settings.disturbances, force.shape[1]
        bias = np.array([self.errors.get(f"b_{k + 1}", 0.0) for k in range(count)])
        readings = force + other.rectification * force**2 + bias
        if other.bias_drift:
            readings += np.outer(part, other.bias_drift)
        return np.asarray(readings)

    def gyros(self, t: Array, theta: Array, rate: Array, acceleration: Array) -> tuple[Array, Array, Array]:
        """Nose-up, roll and yaw gyro, (n,) rad/s each, without noise."""
        _, p, w, y, _ = self.turning(t, theta, rate, acceleration)
        errors = self.errors
        nose_up = (1.0 + errors["k_g"]) * w + errors.get("b_g", 0.0)
        return nose_up, p + errors.get("b_roll", 0.0), y + errors.get("b_yaw", 0.0)


def _limited(values: Array, other: Disturbances, step: float) -> Array:
    """Readings (n, k) of sensors of limited bandwidth."""
    if math.isinf(other.bandwidth):
        return values
    from scipy.signal import lfilter

    decay = math.exp(-2.0 * math.pi * other.bandwidth * step)
    start = values[:1] * decay
    return np.asarray(lfilter([1.0 - decay], [1.0, -decay], values, axis=0, zi=start)[0])


def _spoiled(values: Array, settings: AoaSettings, rng: np.random.Generator) -> Array:
    """Spikes, limited ranges and lost rows; the columns are accelerometers and three gyros."""
    other, n = settings.disturbances, len(settings.layout.names)
    if other.spikes > 0.0:
        size = np.array([other.spike] * n + [other.spike / STANDARD_GRAVITY] * 3)
        hit = rng.random(values.shape) < other.spikes
        values = values + hit * size * rng.choice([-1.0, 1.0], values.shape)
    if other.clip:
        for k, name in enumerate((*settings.layout.names, *GYROS)):
            limit = settings.calibration(name).range
            if limit is not None:
                values[:, k] = np.clip(values[:, k], -limit, limit)
    if other.dropouts > 0.0:
        values[rng.random(len(values)) < other.dropouts] = np.nan
    return values


def to_record(recording: Recording, settings: AoaSettings) -> Record:
    """A record as a file holds it, which read with the same study means the same.

    ``t``; ``a1``.. [g], ``gyro`` [deg/s], and ``gyro_roll``, ``gyro_yaw`` [deg/s] where the recording has them, in
    volts or counts for sensors that the study calibrates from these. ``point`` and ``trigger`` where they are known,
    ``theta_ref`` [deg] where there is a reference; ``temperature`` [degC], that of the study, where a sensor depends
    on it. Sensors with a sample rate of their own under the study's disturbances have every so many-th row of it, on a
    clock of their own.
    """
    columns = ((name, unit, values / unit.factor) for name, unit, values in _columns(recording, settings))
    record = record_of(columns, recording.t)
    if settings.motion is None:
        return record
    clocks: dict[int, Array] = {1: recording.t}
    slower = dict(record.columns)
    for name, rate in settings.disturbances.sample_rates.items():
        if name in slower:
            every = round(settings.motion.sample_rate / rate)
            clock = clocks.setdefault(every, np.ascontiguousarray(recording.t[::every]))
            values = np.ascontiguousarray(slower[name].values[::every])
            slower[name] = replace(slower[name], t=clock, values=values)
    return replace(record, columns=slower)


def _columns(recording: Recording, settings: AoaSettings) -> Iterator[tuple[str, Unit, Array]]:
    """Name, unit and values [SI] of each column."""
    values = np.column_stack([recording.acc, recording.gyro, recording.turns])
    temperature = None if settings.temperature is None else settings.temperature.value
    thermal = False
    for k, name in enumerate((*settings.layout.names, *GYROS)):
        if name in GYROS and not np.isfinite(values[:, k]).any():
            continue
        of = settings.calibration(name)
        thermal = thermal or of.scale_slope != 0.0 or of.bias_slope != 0.0
        symbol = of.per if of.per != "1" else "deg/s" if name in GYROS else "g"
        yield name, parse_unit(symbol), of.indicated(values[:, k], temperature)
    if thermal and temperature is not None:
        yield "temperature", parse_unit("degC"), np.full(len(values), temperature)
    if recording.point is not None:
        yield "point", parse_unit("1"), recording.point
    if recording.trigger is not None:
        yield "trigger", parse_unit("1"), recording.trigger
    if recording.reference is not None:
        yield "theta_ref", parse_unit("deg"), recording.reference
