"""Gravity and roll, which a study states with uncertainties: what their errors do to the angle.

No estimator learns them here. How a wrong one moves theta depends on how the method settles the contradiction between
sensors that follows, for the fusion on all that it may learn: so the method is run again with each a little off, and
the change of theta, row by row, is the slope.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from inercal.aoa import filtered as fusion
from inercal.aoa import model
from inercal.aoa.angles import Angles, of_fusion, stated_roll
from inercal.aoa.filtered import Filtered
from inercal.aoa.methods import measure
from inercal.aoa.problem import Problem
from inercal.aoa.recording import Recording
from inercal.aoa.roll import tracked
from inercal.aoa.settings import AoaSettings, Methods
from inercal.aoa.zero import tare

Array = NDArray[np.float64]

ROLL_STEP = 1e-4
"""Change of the roll [rad] for a slope."""

GRAVITY_STEP = 1e-5
"""Relative change of gravity."""

_KNOWN = 1e-6
"""Relative uncertainty of gravity, 0.00006 deg at most, from which it counts."""


def by_fusion(recording: Recording, settings: AoaSettings, problem: Problem, filtered: Filtered) -> Angles:
    """The angles of the fusion, with the roll where gyros track it, and with what is stated in their uncertainty."""
    angles, turned = of_fusion(filtered, settings.estimator.states), tracked(recording, problem, filtered)
    if turned is not None:
        angles = replace(angles, roll=turned[0], roll_u=turned[1])

    def run(gravity: float, roll: float) -> Array:
        constants = problem.constants.copy()
        constants[[model.GRAVITY, model.ROLL_COSINE]] = gravity, math.cos(roll)
        off = replace(problem, constants=constants)
        return fusion.estimate(recording, off, filtered.smoothed).theta

    return _with_stated(angles, settings, run)


def by_methods(recording: Recording, settings: AoaSettings, methods: Methods) -> Angles:
    """The angles of the paper's methods (`inercal.aoa.methods.measure`) less the biases that the study's zero shows,
    with what is stated in their uncertainty."""

    def found(chosen: AoaSettings) -> Angles:
        return measure(tare(recording, chosen), chosen, methods)

    def run(gravity: float, roll: float) -> Array:
        attitude, site = settings.attitude, replace(settings.site, gravity=gravity)
        if attitude.roll is not None:
            attitude = replace(attitude, roll=replace(attitude.roll, value=roll))
        return found(replace(settings, site=site, attitude=attitude)).theta

    return _with_stated(found(settings), settings, run)


def gravity_u(settings: AoaSettings) -> float:
    """Standard uncertainty [m/s^2] of the gravity of the site."""
    return math.sqrt(sum((each.u * each.sensitivity) ** 2 for each in settings.site.inputs))


def uncertain_roll(settings: AoaSettings, tracked: bool) -> float:
    """Standard uncertainty [rad] of the roll that is stated; 0 where gyros track it: then it is a state."""
    roll = settings.attitude.roll
    return 0.0 if roll is None or tracked else roll.u


def _with_stated(angles: Angles, settings: AoaSettings, run: Callable[[float, float], Array]) -> Angles:
    """The angles with the uncertainty of gravity and roll, where they have one; ``run`` gives theta under others."""
    g, of_gravity = settings.site.gravity, gravity_u(settings)
    roll = 0.0 if settings.attitude.roll is None else settings.attitude.roll.value
    steps: dict[str, tuple[float, float]] = {}
    if of_gravity > _KNOWN * g:
        steps["gravity"] = (g * GRAVITY_STEP, 0.0)
    if uncertain_roll(settings, angles.roll is not None):
        steps["roll"] = (0.0, ROLL_STEP)
    with ThreadPoolExecutor() as pool:
        found = dict(
            zip(steps, pool.map(lambda by: run(g + by[0], roll + by[1]), steps.values()), strict=True)
        )
    slopes = {}
    for name, theta in found.items():
        off = np.remainder(theta - angles.theta + math.pi, 2.0 * math.pi) - math.pi
        slopes[name] = np.where(np.isnan(off) & np.isfinite(angles.theta), 0.0, off) / sum(steps[name])
    if "gravity" in slopes:
        angles = replace(angles, u=np.hypot(angles.u, slopes["gravity"] * of_gravity))
    if "roll" in slopes:
        angles = stated_roll(replace(angles, by_roll=slopes["roll"]), settings.attitude)
    return angles
