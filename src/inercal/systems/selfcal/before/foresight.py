"""A path of a platform before it is taken: its bounds with better or worse instruments."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.designs.foresight import Foresight, Lever
from inercal.foundation.errors import StudyError
from inercal.foundation.geometry.rotations import elementary
from inercal.foundation.instruments.terms import sized
from inercal.systems.selfcal.before.bounds import bounds
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.platform.coefficients import shown_units
from inercal.systems.selfcal.platform.plan import PlatformPlan, motion
from inercal.systems.selfcal.settings import SelfcalSettings
from inercal.systems.selfcal.still_joints import without_fixed

_LEVERS = ("angle_random_walk", "accelerometer", "encoder")


def foresight(settings: SelfcalSettings) -> Foresight:
    """Bounds along the plan of a study; the levers are its noise. Raises `StudyError` without a plan."""
    settings = without_fixed(settings)[0]
    commanded = motion(_plan(settings), settings.world)
    temperature = settings.simulated_temperature(len(commanded.t))
    warm = None if temperature is None else settings.warm(temperature)
    noise = settings.noise

    def told(factors: Array) -> SelfcalSettings:
        changed = {name: getattr(noise, name) * float(x) for name, x in zip(_LEVERS, factors, strict=True)}
        return replace(settings, noise=replace(noise, **changed))

    def u(factors: Array) -> Array:
        return bounds(commanded, problem(told(factors)), warm=warm).u

    names = bounds(commanded, problem(settings), warm=warm).names
    units, sizes = shown_units(names)
    walk = noise.angle_random_walk / math.radians(1.0) * 60.0
    levers = (
        Lever("noise.angle_random_walk", walk, "deg/sqrt(h)", "of the gyros"),
        Lever("noise.accelerometer", *sized(noise.accelerometer, "m/s^2"), "of a sample"),
        Lever("noise.encoder", *sized(noise.encoder, "rad"), "of a sample"),
    )
    return Foresight(names, units, sizes, levers, u)


def verticals(settings: SelfcalSettings) -> Array:
    """Directions (r, 3) of the vertical on the instrument after each move, the start first. Raises `StudyError` without
    a plan."""
    plan, world = _plan(settings), settings.world
    ends = np.cumsum([0, *map(plan.steps, plan.moves)])
    signed = plan.angles()[ends] * world.signs
    up = np.broadcast_to(world.up / np.linalg.norm(world.up), (len(ends), 3))
    for k, axis in enumerate(world.axes.tolist()):
        up = np.einsum("nji,nj->ni", elementary("xyz"[axis], signed[:, k]), up)  # type: ignore[arg-type]
    return up


def _plan(settings: SelfcalSettings) -> PlatformPlan:
    """The plan; raises `StudyError` without one."""
    if settings.plan is None:
        raise StudyError("plan", 'missing, expected a path such as path = "best"')
    return settings.plan
