"""Gravity and roll, stated with uncertainties: the effect of their errors on the angle.

No estimator learns them here. The change of theta by a wrong one depends on how the method resolves the contradiction
between sensors that follows, for the fusion on all states that it may learn: so the method is run again with each
changed a little, and the change of theta, row by row, is the slope.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import principal
from inercal.foundation.results.files import load as load_estimate
from inercal.foundation.results.result import Estimate
from inercal.systems.aoa.angles import Angles, stated_roll
from inercal.systems.aoa.fusion.filter_result import FusionResult, estimate, of_fusion, tracked_roll
from inercal.systems.aoa.fusion.problem import FusionProblem
from inercal.systems.aoa.fusion.watch import watched
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.paper.methods import measure
from inercal.systems.aoa.reading.recording import Recording
from inercal.systems.aoa.reading.wind_off_zero import tare
from inercal.systems.aoa.reference.corrections import is_verified
from inercal.systems.aoa.settings import AoaSettings, Methods

ROLL_STEP = 1e-4
"""Change of the roll [rad] for a slope."""

GRAVITY_STEP = 1e-5
"""Relative change of gravity."""


class Lean(NamedTuple):
    """One systematic input, by ``name`` gravity or roll, moved by a ``step`` [m/s^2 or rad]; ``gravity`` and ``roll``
    are the moved values [m/s^2, rad]."""

    name: str
    step: float
    gravity: float
    roll: float


def leans(settings: AoaSettings, tracked: bool) -> tuple[Lean, ...]:
    """A change of each input that is stated with an uncertainty; a roll that gyros track is a state instead."""
    g, roll = settings.site.gravity, settings.attitude.roll
    level, inputs = 0.0 if roll is None else roll.value, []
    if gravity_u(settings) > LIMITS.sure_gravity * g:
        inputs.append(Lean("gravity", g * GRAVITY_STEP, g * (1.0 + GRAVITY_STEP), level))
    if uncertain_roll(settings, tracked):
        inputs.append(Lean("roll", ROLL_STEP, g, level + ROLL_STEP))
    return tuple(inputs)


def leaning(problem: FusionProblem, lean: Lean, settings: AoaSettings) -> FusionProblem:
    """The problem of the fusion under a change, which also moves the coefficients of an earlier run."""
    constants = problem.constants._replace(gravity=float(lean.gravity), roll_cosine=math.cos(lean.roll))
    mean = problem.mean.copy()
    prior = settings.estimator.prior
    if lean.name == "gravity" and prior is not None:
        for name, slope in carried(load_estimate(prior), settings).items():
            if name in problem.names:
                mean[problem.names.index(name)] += slope * lean.step
    return replace(problem, constants=constants, mean=mean)


def carried(earlier: Estimate, settings: AoaSettings) -> dict[str, float]:
    """Change of the coefficients [SI] of an earlier run of the fusion per change of gravity [m/s^2], by name.

    Empty where they were found with another gravity or another uncertainty of it than the study's, or from a reference
    angle.
    """
    gravity = earlier.result.get("gravity")
    if gravity is None or is_verified(earlier):
        return {}
    same = zip((gravity["value"], gravity["u"]), (settings.site.gravity, gravity_u(settings)), strict=True)
    return dict(gravity["slopes"]) if all(math.isclose(a, b, rel_tol=1e-9) for a, b in same) else {}


def by_fusion(
    recording: Recording, settings: AoaSettings, problem: FusionProblem, filtered: FusionResult
) -> Angles:
    """The angles of the fusion, with the roll where gyros track it; stated inputs count in their uncertainty."""
    nis = watched(recording.t, filtered.innovations, problem.constants.gate)
    angles = replace(of_fusion(filtered, settings.estimator.states), nis=nis)
    if (tracked := tracked_roll(recording, problem, filtered)) is not None:
        angles = replace(angles, roll=tracked[0], roll_u=tracked[1])

    def run(lean: Lean) -> Array:
        return estimate(recording, leaning(problem, lean, settings), filtered.smoothed).theta

    return _with_stated(angles, settings, run)


def by_methods(recording: Recording, settings: AoaSettings, methods: Methods) -> Angles:
    """The angles of the paper's methods, after a tare by the study's zero; stated inputs count in their uncertainty."""

    def angles(chosen: AoaSettings) -> Angles:
        return measure(tare(recording, chosen), chosen, methods)

    def run(lean: Lean) -> Array:
        attitude, site = settings.attitude, replace(settings.site, gravity=lean.gravity)
        if attitude.roll is not None:
            attitude = replace(attitude, roll=replace(attitude.roll, value=lean.roll))
        return angles(replace(settings, site=site, attitude=attitude)).theta

    return _with_stated(angles(settings), settings, run)


def _with_stated(angles: Angles, settings: AoaSettings, run: Callable[[Lean], Array]) -> Angles:
    """The angles with stated inputs in their uncertainty; ``run`` gives theta under a change."""
    changes = leans(settings, angles.roll is not None)
    if not changes:
        return angles
    with ThreadPoolExecutor() as pool:
        return widened(angles, settings, changes, list(pool.map(run, changes)))


def widened(
    angles: Angles, settings: AoaSettings, changes: Sequence[Lean], turned: Sequence[Array]
) -> Angles:
    """The angles with stated inputs in their uncertainty, from ``turned``, theta (n,) under each of the ``changes``.

    Rows without a changed theta keep their uncertainty.
    """
    for lean, theta in zip(changes, turned, strict=True):
        off = principal(theta - angles.theta)
        slope = np.where(np.isnan(off) & np.isfinite(angles.theta), 0.0, off) / lean.step
        if lean.name == "roll":
            angles = stated_roll(replace(angles, by_roll=slope), settings.attitude)
        else:
            angles = replace(angles, u=np.hypot(angles.u, slope * gravity_u(settings)))
    return angles


def gravity_u(settings: AoaSettings) -> float:
    """Standard uncertainty [m/s^2] of the gravity of the site."""
    return math.sqrt(sum((quantity.u * quantity.sensitivity) ** 2 for quantity in settings.site.inputs))


def uncertain_roll(settings: AoaSettings, tracked: bool) -> float:
    """Standard uncertainty [rad] of the stated roll; 0 where gyros track it, as the roll is a state then."""
    roll = settings.attitude.roll
    return 0.0 if roll is None or tracked else roll.u
