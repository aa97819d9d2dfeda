"""Uncertainty budget of the coefficients: noise, prior, and the systematic inputs of site and base.

The covariance of a filter is split as that of the pass at its values is; systematic inputs (type B) act through their
columns in that pass.

Latitude, gravity, heading and tilt are such inputs, each with its uncertainty and its effect.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.results.budget import TypeA, TypeB
from inercal.foundation.units import parse_quantity, parse_unit
from inercal.systems.selfcal.before.bounds import SOURCES, PathBounds
from inercal.systems.selfcal.diagnosis.passed import PlatformPass
from inercal.systems.selfcal.filters.problem import FilterProblem, problem
from inercal.systems.selfcal.filters.whitened import whitened
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.coefficients import product_slope
from inercal.systems.selfcal.platform.states import ALL, KIND_OF, STATES, UNIT_OF, WALK, WAVE
from inercal.systems.selfcal.settings import Noise, SelfcalSettings

_LARGER = 1e-5
"""Part by which a variance is larger in a pass that shows what it does."""


@dataclass(frozen=True)
class SystematicInput:
    """One systematic input: its ``u`` (0 if exact), a ``step`` for the derivative, the study with it ``changed``, and
    the ``unit`` in which its errors are shown; ``of_rig``: a considered state."""

    name: str
    u: float
    step: float
    changed: Callable[[float], SelfcalSettings]
    unit: str
    of_rig: bool = False


def systematic_inputs(settings: SelfcalSettings) -> list[SystematicInput]:
    """The systematic inputs; beta, with its prior, takes the place of heading and tilt."""
    site, base = settings.site, settings.base

    def with_base(**change: Any) -> SelfcalSettings:
        return replace(settings, base=replace(base, **change))

    def with_gravity(by: float) -> SelfcalSettings:
        return replace(settings, site=replace(site, gravity=site.gravity + by))

    by_gravity = (each for each in site.inputs if each.source != "latitude")
    gravity_u = math.hypot(*(each.u * each.sensitivity for each in by_gravity))
    inputs = [
        SystematicInput("latitude", site.latitude_u, 1e-4, lambda by: _moved(settings, by), "deg"),
        SystematicInput("gravity", gravity_u, 1e-5 * site.gravity, with_gravity, "m/s^2"),
    ]
    if not settings.extended:
        (north, east), (north_u, east_u) = base.tilt, base.tilt_u
        inputs += [
            SystematicInput(
                "heading", base.heading_u, 1e-4, lambda by: with_base(heading=base.heading + by), "deg"
            ),
            SystematicInput(
                "tilt about north", north_u, 1e-6, lambda by: with_base(tilt=(north + by, east)), "arcsec"
            ),
            SystematicInput(
                "tilt about east", east_u, 1e-6, lambda by: with_base(tilt=(north, east + by)), "arcsec"
            ),
        ]
    return [*inputs, *_considered(settings)]


def _considered(settings: SelfcalSettings) -> list[SystematicInput]:
    """Errors of the rig that are stated with an uncertainty, but no states."""
    states, stated = settings.states.names, settings.model.stated

    def changed(name: str) -> Callable[[float], SelfcalSettings]:
        def by(change: float) -> SelfcalSettings:
            value, u = stated[name]
            model = replace(settings.model, stated={**stated, name: (value + change, u)})
            return replace(settings, model=model)

        return by

    return [
        SystematicInput(name, u, u, changed(name), UNIT_OF[name], of_rig=True)
        for name, (_, u) in stated.items()
        if name not in states and u > 0.0
    ]


def _moved(settings: SelfcalSettings, by: float) -> SelfcalSettings:
    """The study at another latitude, with gravity as it was computed from it, if it was.

    Beyond a pole the latitude falls again and north is the other way, so that earth rate goes on turning evenly.
    """
    site, base = settings.site, settings.base
    slope = sum(each.sensitivity for each in site.inputs if each.source == "latitude")
    latitude = math.remainder((site.latitude or 0.0) + by, 2.0 * math.pi)
    if abs(latitude) > 0.5 * math.pi:
        latitude = math.copysign(math.pi, latitude) - latitude
        base = replace(base, heading=base.heading + math.pi)
    return replace(
        settings, site=replace(site, latitude=latitude, gravity=site.gravity + slope * by), base=base
    )


def stated_errors(settings: SelfcalSettings) -> list[FilterProblem]:
    """The problem with each input that is stated with an uncertainty moved by that, one after the other."""
    return [problem(given.changed(given.u)) for given in systematic_inputs(settings) if given.u]


def bounds_of(passed: PlatformPass) -> PathBounds:
    """Bounds along the path of a calibration, with their parts by source: the part of a noise is the change of the
    covariance with its variance, passes with one that is larger by `_LARGER` give that; what is left of all is that of
    the encoders, of the prior where biases walk."""
    whole, of, result = passed.covariance, passed.problem, passed.result
    u, walking = np.sqrt(np.diag(result.covariance)), bool(of.states.walks.any())
    parts = dict[str, Array]()
    names = {"angle random walk": "angle_random_walk", "accelerometer": "accelerometer"}
    for source, name in (names | ({"encoder": "encoder"} if walking else {})).items():
        more = math.sqrt(1.0 + _LARGER) * getattr(of.noise, name)
        louder = replace(of, noise=replace(of.noise, **{name: more}))
        P = whitened(passed.recording, louder, result.coefficients, u, restarts=result.restarts).covariance
        parts[source] = (P - whole) / _LARGER
    prior = np.zeros_like(whole) if walking else whole / of.prior**2 @ whole
    last = whole - sum(parts.values()) - prior
    parts |= {"prior": last} if walking else {"encoder": last, "prior": prior}
    slope = product_slope(result.coefficients)
    split = {source: slope @ parts[source] @ slope.T for source in SOURCES}
    return PathBounds(of.names, slope @ whole @ slope.T, of.prior, np.empty((0, len(u))), split)


def within(covariance: Array, bounds: PathBounds, noise: Noise, dof: float) -> list[TypeA | TypeB]:
    """Noise and prior, whose covariances add up to that of the filter (p, p), product form.

    Bounds and filter differ by little; ``T`` with ``T P_bounds T^T = P_filter`` takes the parts of one to the other.
    """
    prior = bounds.prior
    roots = [np.linalg.cholesky(P / np.outer(prior, prior)) for P in (covariance, bounds.covariance)]
    to_filter = prior[:, None] * np.linalg.solve(roots[1].T, roots[0].T).T / prior
    levels = {
        "angle random walk": ("angle random walk", noise.angle_random_walk, "rad/sqrt(s)"),
        "accelerometer": ("accelerometer noise", noise.accelerometer, "m/s^2"),
        "encoder": ("encoder noise", noise.encoder, "rad"),
    }
    sources: list[TypeA | TypeB] = []
    for source, part in bounds.contributions.items():
        P = to_filter @ part @ to_filter.T
        P = 0.5 * (P + P.T)  # where hardly anything is known, rounding is not the same on both sides
        if source in levels:
            sources.append(TypeA(*levels[source], P, dof))
        else:
            # u in units of the prior standard deviations
            values, vectors = np.linalg.eigh(P / np.outer(prior, prior))
            root = prior[:, None] * vectors * np.sqrt(np.maximum(values, 0.0))
            sources.append(TypeB(source, 1.0, "1", root))
    return sources


def considered(
    passed: PlatformPass, settings: SelfcalSettings, u: Array
) -> tuple[list[TypeB], Mapping[str, str]]:
    """Errors of the rig that are no states: those stated with an uncertainty; and of each other kind the error, in
    words, that does as much as one of the standard uncertainties ``u`` (p,) by noise and prior."""
    of = passed.problem
    known = {*of.names, *settings.model.left_out}
    named = ALL[18 : WAVE + 2 * len(of.states.harmonics)]
    left = [name for name in named if name not in known and KIND_OF[name] != "beta"]
    left = [name for name in left if name in passed.errors]
    slopes = product_slope(passed.result.coefficients) @ passed.reach(passed.of_names(tuple(left)))
    sources, exact = list[TypeB](), dict[str, tuple[float, str]]()
    for name, slope in zip(left, slopes.T, strict=True):
        stated_u = settings.model.stated.get(name, (0.0, 0.0))[1]
        if stated_u > 0.0:
            sources.append(TypeB(name, stated_u, UNIT_OF[name], slope))
            continue
        worst, kind = int(np.argmax(np.abs(slope) / u)), KIND_OF[name]
        usual = parse_quantity(STATES[kind].prior, STATES[kind].dimension, kind).value
        shift = abs(slope[worst]) * usual / u[worst]
        if shift > exact.get(kind, (1.0, ""))[0]:
            unit, size = shown_unit(UNIT_OF[name])
            exact[kind] = shift, f"{usual / shift / size:.2g} {unit} of {name} ({of.names[worst]})"
    if not known & {*ALL[WALK:]}:
        exact |= _wandering(
            settings.noise, float(np.ptp(passed.recording.t)), dict(zip(of.names, u, strict=True))
        )
    return sources, {kind: text for kind, (_, text) in exact.items()}


def _wandering(noise: Noise, lasts: float, u: Mapping[str, float]) -> dict[str, tuple[float, str]]:
    """Biases that wander about their means, of which a recording that ``lasts`` [s] has another mean: the variance of
    the mean of an exponentially correlated process (A. Gelb, Applied Optimal Estimation, 1974, section 3.8)."""
    x = lasts / LIMITS.walk_time
    of_mean = math.sqrt(LIMITS.walk_time * (0.5 - x / 6.0 if x < 1e-3 else (1.0 + math.expm1(-x) / x) / x))
    walks = {"kg0": ("gyro_walk", noise.gyro_walk), "ka0": ("accelerometer_walk", noise.accelerometer_walk)}
    found = []
    for bias, (key, usual) in walks.items():
        name = min((f"{bias}_{i}" for i in "xyz"), key=lambda each: u[each])
        unit, size = shown_unit(UNIT_OF[name])
        least = u[name] / of_mean
        found.append((usual / least, f"{least / size:.2g} {unit}/sqrt(s) of {key} ({name})"))
    if max(found)[0] <= 1.0:
        return {}
    # whichever of both: where one may matter, nobody knows that the other is as usual
    return {"bias_walk": (max(found)[0], ", ".join(text for _, text in sorted(found, reverse=True)))}


def systematic(
    passed: PlatformPass, settings: SelfcalSettings, u: Array
) -> tuple[list[TypeB], Mapping[str, str]]:
    """Inputs of site and base stated with an uncertainty; and for each that is stated without one the error of it, in
    words, that does as much as one of the standard uncertainties ``u`` (p,) by noise and prior."""
    sources, exact = list[TypeB](), dict[str, str]()
    of = passed.problem
    for each in systematic_inputs(settings):
        if each.of_rig:
            continue
        ends = [passed.reach(passed.moved(problem(each.changed(by))))[:, 0] for by in (-each.step, each.step)]
        slope = product_slope(passed.result.coefficients) @ (ends[0] - ends[1]) / (2.0 * each.step)
        worst = int(np.argmax(np.abs(slope) / u))
        if each.name == "gravity" and each.u:
            sources += [
                TypeB(part.source, part.u, part.unit, part.sensitivity * slope)
                for part in settings.site.inputs
                if part.source != "latitude"
            ]
        elif each.u:
            sources.append(TypeB(each.name, each.u, "rad", slope))
        elif slope[worst] != 0.0:
            error = u[worst] / abs(slope[worst]) / parse_unit(each.unit).factor
            exact[each.name] = f"{error:.2g} {each.unit} of {each.name} ({of.names[worst]})"
    return sources, exact
