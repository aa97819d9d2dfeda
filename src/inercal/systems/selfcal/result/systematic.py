"""Systematic inputs of site and base: latitude, gravity, heading, tilt, each with its uncertainty and its effect."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

from inercal.foundation.arrays import Array
from inercal.foundation.inference.hypotheses import Hypothesis
from inercal.systems.selfcal.diagnosis.fit_quality import Case
from inercal.systems.selfcal.platform.states import UNIT_OF
from inercal.systems.selfcal.settings import SelfcalSettings


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


def stated_errors(settings: SelfcalSettings) -> Hypothesis[Case] | None:
    """Errors of the inputs stated with an uncertainty, in units of that; None where all are exact.

    They are small enough for changes of earth rate and gravity to add up.
    """
    uncertain = [each for each in systematic_inputs(settings) if each.u]
    if not uncertain:
        return None
    here = settings.world

    def without(case: Case, values: Array) -> Case:
        recording, problem = case
        earth, up, stated = problem.world.earth, problem.world.up, problem.states.stated
        for each, value in zip(uncertain, values, strict=True):
            if value != 0.0:
                there = each.changed(float(value) * each.u)
                if each.of_rig:
                    stated = stated + there.states.stated - settings.states.stated
                else:
                    earth, up = earth + there.world.earth - here.earth, up + there.world.up - here.up
        vector = replace(problem.states, stated=stated)
        world = problem.world._replace(earth=earth, up=up)
        return recording, replace(problem, world=world, vector=vector)

    names = tuple(each.name for each in uncertain)
    return Hypothesis(
        "stated", "site_suspect", "what is stated of site and base", without, names, 0.1, prior=1.0
    )
