"""Turns of a strapdown unit before they are made: bounds with a better or worse unit."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.designs.foresight import Foresight, Lever
from inercal.foundation.errors import StudyError
from inercal.foundation.geometry.rotations import elementary
from inercal.systems.strapdown.before.bounds import Pieces, bounds
from inercal.systems.strapdown.before.design import unit_of
from inercal.systems.strapdown.settings import StrapdownSettings, TurnPlan
from inercal.systems.strapdown.simulate import AXES, start_attitude

_OF_NOISE = {
    "angle_random_walk": ("deg/sqrt(h)", math.radians(1.0) / 60.0),
    "velocity_random_walk": ("m/s/sqrt(s)", 1.0),
    "gyro_walk": ("deg/h/sqrt(s)", math.radians(1.0) / 3600.0),
    "accelerometer_walk": ("m/s^2/sqrt(s)", 1.0),
}
"""Sizes of the noise of a study with their units for people."""


def foresight(settings: StrapdownSettings) -> Foresight:
    """Bounds along the plan of a study; the levers are its noise, and the vibration of the stand. Raises `StudyError`
    without turns."""
    plan, noise = _plan(settings), settings.noise
    given = [name for name in _OF_NOISE if getattr(noise, name) > 0.0]

    def u(factors: Array) -> Array:
        x = factors.tolist()
        changed = {name: getattr(noise, name) * by for name, by in zip(given, x[:-1], strict=True)}
        rests = replace(settings.rests, velocity=settings.rests.velocity * x[-1])
        return bounds(Pieces(replace(settings, noise=replace(noise, **changed), rests=rests)), plan).u

    names = bounds(Pieces(settings), plan).names
    units, sizes = zip(*map(unit_of, names), strict=True)
    levers = [
        Lever(f"noise.{name}", getattr(noise, name) / _OF_NOISE[name][1], _OF_NOISE[name][0])
        for name in given
    ]
    stand = Lever("rests.velocity", settings.rests.velocity, "m/s", "vibration of the stand")
    return Foresight(names, units, np.array(sizes), (*levers, stand), u)


def verticals(settings: StrapdownSettings) -> Array:
    """Directions (r, 3) of the vertical on the unit in each rest. Raises `StudyError` without turns."""
    plan = _plan(settings)
    attitudes = [start_attitude(plan)]
    for axis, angle in plan.turns:
        attitudes.append(attitudes[-1] @ elementary(AXES[axis], angle))
    return np.stack(attitudes)[:, 2]


def _plan(settings: StrapdownSettings) -> TurnPlan:
    """The plan; raises `StudyError` without turns."""
    if settings.plan is None or not settings.plan.turns:
        raise StudyError("plan.turns", 'missing, expected turns such as [["y", "90 deg"]]')
    return settings.plan
