"""Layouts of the sensors of a model before it is built: what each can tell of the angle, and how good it must be.

Two bounds, along the motion of the study. Sample by sample, as the paper works, the readings of one row tell the angle
and the angular acceleration: with the covariance C of their errors (`inercal.systems.aoa.paper.residuals.error_terms`),
h their slopes by the angle and p by the angular acceleration (the arms),

    1 / u^2 = h C^-1 h - (h C^-1 p)^2 / (p C^-1 p)

which no unbiased estimate from one row betters. For the axes -z, +x, +z it holds that of the paper: the angular
acceleration is known to sqrt(2) dA / L, so that the base line L matters. With a filter: the covariance of the fusion
along the motion without noise, where it is linearised at the truth, which is the bound of Cramer and Rao for its model,
for the angle and for the errors of the sensors.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.foundation.findings import Finding
from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.results.shown import Table, heads, short
from inercal.foundation.units import STANDARD_GRAVITY
from inercal.systems.aoa.fusion.filter_result import FusionResult, estimate
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.layout import AXES, STATED, Layout, axes, tangential_arms
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.motion import course, duration
from inercal.systems.aoa.paper.residuals import error_terms
from inercal.systems.aoa.reading.recording import Recording
from inercal.systems.aoa.result.outcome import term_of
from inercal.systems.aoa.settings import AoaSettings
from inercal.systems.aoa.simulate import simulate

REFERENCES = (
    "Tan et al., Large angle-of-attack measurement architecture for wind-tunnel models based on inertial technology "
    "(2021)",
    "H. L. Van Trees, Detection, Estimation, and Modulation Theory, Part I, Wiley (1968), section 2.4",
)

_ROWS = 40
"""Instants of the motion at which the bound of a sample is taken."""

_LONGEST = 20.0
"""Time [s] of the motion along which the fusion's bound is computed."""

_NO_NOISE = 1e-9
"""Part of the noise that is left in a recording for the bound."""

_FACTORS = (1e-2, 1e2)
"""Accelerometers that are looked at: times the stated noise and bias, from the best to the worst."""

_CLOSE = 0.02
"""Relative error of the factor by which accelerometers may be worse."""


@dataclass(frozen=True, eq=False)
class Bound:
    """The least u that a layout by its ``name`` can have.

    ``sample`` and ``fusion`` [rad]: of the angle, rms over the motion from single samples, and by the fusion after it
    settled. ``sensors`` [SI]: of the errors of the sensors at the end of the motion, by name. ``factor``: largest
    factor on noise and bias of the accelerometers with which the fusion reaches the goal, 100 at most; NaN without a
    goal, or where a hundredth does not reach it.
    """

    name: str
    layout: Layout
    sample: float
    fusion: float
    sensors: dict[str, float]
    factor: float = math.nan


@dataclass(frozen=True, eq=False)
class ComparedLayouts:
    """The ``bounds`` of layouts side by side, that under [sensors] first."""

    bounds: tuple[Bound, ...]
    message: str
    result: dict[str, Any] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()

    def tables(self) -> list[Table]:
        """Layouts with u of the angle, and u of the errors of the sensors, a column for each layout."""
        goal = self.result["wanted"] is not None
        wanted = ("noise for the goal [ug]", "bias for the goal [ug]") if goal else ()
        columns = heads("layout", "accelerometers", "u, fusion [deg]", "u, one sample [deg]", *wanted)
        rows = [
            (bound.name, _words(bound.layout), _deg(bound.fusion), _deg(bound.sample))
            + ((_ug(told["accelerometer"]), _ug(told["accelerometer_bias"])) if goal else ())
            for bound, told in zip(self.bounds, self.result["layouts"], strict=True)
        ]
        caption = (
            "u of the angle along the motion, by the fusion and from single samples, with the stated sensors"
            + (
                "; noise and bias of the accelerometers with which the fusion reaches the goal."
                if goal
                else "."
            )
        )
        names = dict.fromkeys(name for bound in self.bounds for name in bound.sensors)
        of_sensors = [_row(name, [bound.sensors.get(name) for bound in self.bounds]) for name in names]
        return [
            Table("Layouts", caption, columns, tuple(rows), 2),
            Table(
                "Errors of the sensors",
                "Their u at the end of the motion, by the fusion.",
                heads("", "unit", *(bound.name for bound in self.bounds)),
                tuple(of_sensors),
                2,
            ),
        ]


def compare(settings: AoaSettings, progress: Callable[[str], None] = lambda _: None) -> ComparedLayouts:
    """The bounds of the layout that the study states, and of those beside it; raises `StudyError` without a motion."""
    if settings.motion is None:
        raise StudyError("motion", "missing, expected the motion to judge the layouts by")
    states, bounds = courses_of(settings), []
    for name, layout in {STATED: settings.layout, **settings.layouts}.items():
        progress(f"layout {name}")
        bounds.append(_bound(settings, name, layout, states))
    wanted, findings = settings.goal.theta, tuple[Finding, ...]()
    least = min(bounds, key=lambda bound: bound.fusion)
    message = f"u {_deg(bounds[0].fusion)} deg as stated"
    if least is not bounds[0]:
        message += f", {_deg(least.fusion)} deg by {least.name}"
    if wanted is not None:
        reaching = [bound.name for bound in bounds if bound.factor >= 1.0]
        message += f"; the wanted {_deg(wanted)} deg are reached by {', '.join(reaching) or 'none'}"
        if all(math.isnan(bound.factor) for bound in bounds):
            findings = (_missed(settings, least.layout, wanted),)
    noise = settings.noise
    result = {
        "wanted": wanted,
        "layouts": [
            {
                "name": bound.name,
                "sensors": _places(bound.layout),
                "u": _finite(bound.fusion),
                "u_sample": _finite(bound.sample),
                "predicted": bound.sensors,
                "accelerometer": _finite(noise.accelerometer * bound.factor),
                "accelerometer_bias": _finite(noise.accelerometer_bias * bound.factor),
            }
            for bound in bounds
        ],
    }
    return ComparedLayouts(tuple(bounds), message, result, findings)


def _bound(settings: AoaSettings, name: str, layout: Layout, states: tuple[Array, Array, Array]) -> Bound:
    """The bound of a layout."""
    recording = undisturbed(settings, layout)
    filtered = _fused(settings, layout, recording)
    nuisances = problem(replace(settings, layout=layout)).nuisances
    u = np.sqrt(np.diag(filtered.state.P))
    return Bound(
        name,
        layout,
        sample_bound(settings, layout, states),
        _settled(filtered, recording),
        {coefficient: float(u[k]) for coefficient, k in nuisances.items()},
        _factor(settings, layout, recording),
    )


def sample_bound(settings: AoaSettings, layout: Layout, states: tuple[Array, Array, Array]) -> float:
    """Rms u [rad] of the angle from single samples at angles, rates and accelerations (m,) each; inf where they do not
    show it."""
    theta, rate, acceleration = states
    level = settings.attitude.level
    terms = error_terms(settings, "dual", layout, level, rate, acceleration, np.ones(len(theta)), 1.0)
    C = sum(np.multiply.outer(np.broadcast_to(weight, theta.shape), matrix) for weight, matrix in terms)
    of_axes = axes(layout, level)
    h = settings.site.gravity * (
        np.outer(np.cos(theta), of_axes[:, 0]) - np.outer(np.sin(theta), of_axes[:, 1])
    )
    p = np.broadcast_to(tangential_arms(layout, level), h.shape)
    both = np.stack([h, p], axis=-1)
    information = both.transpose(0, 2, 1) @ np.linalg.solve(np.asarray(C), both)
    tt, ta, aa = information[:, 0, 0], information[:, 0, 1], information[:, 1, 1]
    with np.errstate(divide="ignore", invalid="ignore"):
        left = tt - np.where(aa > 0.0, ta**2 / aa, 0.0)
        u2 = np.where(left > _NO_NOISE * tt, 1.0 / left, np.inf)
    return math.sqrt(float(u2.mean()))


def undisturbed(settings: AoaSettings, layout: Layout) -> Recording:
    """The study's motion, of 20 s at most, as sensors without noise would record it."""
    assert settings.motion is not None
    lasting = min(duration(settings.motion), _LONGEST)
    motion = (
        settings.motion
        if settings.motion.kind == "pitch-pause"
        else replace(settings.motion, duration=lasting)
    )
    of = replace(settings, layout=layout, motion=motion)
    noise = settings.noise
    quiet = replace(noise, accelerometer=noise.accelerometer * _NO_NOISE, gyro=noise.gyro * _NO_NOISE)
    made = simulate(
        replace(of, noise=quiet, disturbances=type(of.disturbances)()), np.random.default_rng(0), {}
    )
    return made.recording


def settled_u(settings: AoaSettings, layout: Layout, recording: Recording) -> float:
    """Rms u [rad] of the angle by the fusion along a recording without noise, after it settled."""
    return _settled(_fused(settings, layout, recording), recording)


def _fused(settings: AoaSettings, layout: Layout, recording: Recording) -> FusionResult:
    """The fusion along a recording without noise."""
    # a bound holds nothing back
    of = replace(settings, layout=layout, estimator=replace(settings.estimator, gate=math.inf))
    return estimate(recording, problem(of), settings.estimator.smooth)


def _settled(filtered: FusionResult, recording: Recording) -> float:
    """Rms u [rad] of the angle after the fusion settled; inf where it has none."""
    u = filtered.u[(recording.t >= LIMITS.settling_time) & np.isfinite(filtered.u)]
    return math.sqrt(float(np.mean(np.square(u)))) if len(u) else math.inf


def courses_of(settings: AoaSettings) -> tuple[Array, Array, Array]:
    """Angles, rates and accelerations of the motion at some instants."""
    assert settings.motion is not None
    t = np.linspace(0.0, duration(settings.motion), _ROWS, endpoint=False)
    return course(settings.motion, np.random.default_rng(0))(t)


def _factor(settings: AoaSettings, layout: Layout, recording: Recording) -> float:
    """Largest factor on noise and bias of the accelerometers at which the fusion knows the angle as wanted; NaN where
    none does, or nothing is wanted."""
    from scipy.optimize import brentq

    wanted = settings.goal.theta
    if wanted is None:
        return math.nan

    def beyond(logarithm: float) -> float:
        """Logarithm of u over the wanted u, finite for a root."""
        u = settled_u(_times(settings, math.exp(logarithm)), layout, recording)
        return math.log(min(u, 1e9) / wanted)

    low, high = map(math.log, _FACTORS)
    if beyond(low) > 0.0:
        return math.nan
    if beyond(high) <= 0.0:
        return _FACTORS[1]
    return math.exp(brentq(beyond, low, high, xtol=_CLOSE))


def _times(settings: AoaSettings, factor: float) -> AoaSettings:
    """The study with accelerometers so many times worse."""
    noise = settings.noise
    worse = replace(
        noise,
        accelerometer=noise.accelerometer * factor,
        accelerometer_bias=noise.accelerometer_bias * factor,
    )
    return replace(settings, noise=worse)


def _missed(settings: AoaSettings, layout: Layout, wanted: float) -> Finding:
    """The finding on a goal that no accelerometers reach."""
    left = settled_u(_times(settings, _FACTORS[0]), layout, undisturbed(settings, layout))
    text = (
        f"no accelerometers reach the wanted {_deg(wanted)} deg: with perfect ones {_deg(left)} deg are left, of "
        "positions, gyro and motion"
    )
    return Finding("goal_missed", text, action="state these better under [prior] and [noise]")


def _places(layout: Layout) -> list[dict[str, Any]]:
    """The accelerometers of a layout, for a result."""
    columns = zip(layout.names, layout.angle.tolist(), layout.r.tolist(), layout.z.tolist(), strict=True)
    return [{"name": name, "angle_rad": angle, "r_m": r, "z_m": z} for name, angle, r, z in columns]


def _finite(value: float) -> float | None:
    """The value; None for one that is not known."""
    return value if math.isfinite(value) else None


def _row(name: str, values: list[float | None]) -> tuple[str, ...]:
    """An error of a sensor with its u [SI] in each layout, a dash where that has not this sensor."""
    unit, size = shown_unit(term_of(name).unit)
    return name, unit, *("–" if u is None else short(u / size) for u in values)


def _words(layout: Layout) -> str:
    """A layout in words: ``-z -250 mm, +x 0 mm``, heights where there are any."""
    places = zip(layout.angle.tolist(), layout.r.tolist(), layout.z.tolist(), strict=True)
    return ", ".join(
        f"{_axis(angle)} {1e3 * r:.4g} mm" + (f" z {1e3 * z:.4g} mm" if z else "") for angle, r, z in places
    )


def _axis(angle: float) -> str:
    """The name of an axis, or its angle."""
    for name, direction in AXES.items():
        if abs(math.remainder(angle - direction, 2.0 * math.pi)) < 1e-9:
            return name
    return f"{math.degrees(angle):.4g} deg"


def _deg(value: float) -> str:
    """An angle [rad] in degrees."""
    return short(math.degrees(value)) if math.isfinite(value) else "–"


def _ug(value: float | None) -> str:
    """An acceleration [m/s^2] in ug, a dash where there is none."""
    return "–" if value is None else f"{1e6 * value / STANDARD_GRAVITY:.3g}"
