"""A path of a platform before it is taken: its bounds with better or worse instruments, and the gimbals along it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from inercal.arrays import Array
from inercal.designs.foresight import Course, Foresight, Lever
from inercal.errors import StudyError
from inercal.geometry.rotations import elementary
from inercal.instruments.terms import sized
from inercal.selfcal.before.bounds import bounds
from inercal.selfcal.filters.problem import problem
from inercal.selfcal.platform.coefficients import shown_units
from inercal.selfcal.platform.plan import Plan, Rest, motion
from inercal.selfcal.settings import SelfcalSettings
from inercal.selfcal.still_joints import without_fixed

_LEVERS = ("angle_random_walk", "accelerometer", "encoder")
_MOMENTS = 240
"""Moments of a course, about."""


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


def course(settings: SelfcalSettings) -> Course:
    """The gimbals along the plan of a study. Raises `StudyError` without a plan."""
    plan = _plan(settings)
    angles, world = plan.angles(), settings.world
    ends = np.cumsum([0, *map(plan.steps, plan.moves)])
    every = max(1, len(angles) // _MOMENTS)
    rows = np.unique(np.concatenate([np.arange(0, len(angles), every), ends]))
    signed = angles[rows] * world.signs
    turned = [elementary("xyz"[axis], signed[:, k]) for k, axis in enumerate(world.axes.tolist())]  # type: ignore[arg-type]
    poses, whole = [], np.broadcast_to(_upright(world.up), (len(rows), 3, 3))
    for turn in turned:
        whole = whole @ turn
        poses.append(whole)
    move = np.searchsorted(ends[1:], rows, "left").clip(max=len(plan.moves) - 1)
    words = tuple(
        f"{row * plan.step:.4g} s, move {k + 1} "
        + ("rest" if isinstance(plan.moves[k], Rest) else plan.words().split("), (")[k].strip("()"))
        + f": x {a:.4g}, y {b:.4g}, z {c:.4g} deg"
        for row, k, (a, b, c) in zip(
            rows.tolist(), move.tolist(), np.degrees(angles[rows]).tolist(), strict=True
        )
    )
    return Course(
        words,
        np.stack(poses, axis=1),
        np.eye(3)[world.axes],
        np.searchsorted(rows, ends),
        np.zeros((0, 2, 3)),
    )


def _plan(settings: SelfcalSettings) -> Plan:
    """The plan; raises `StudyError` without one."""
    if settings.plan is None:
        raise StudyError("plan", 'missing, expected a path such as path = "best"')
    return settings.plan


def _upright(up: Array) -> Array:
    """Rotation (3, 3) from the axes of the base to some of which the third is ``up`` (3,)."""
    third = up / np.linalg.norm(up)
    first = np.cross(np.roll(np.eye(3)[int(np.argmax(np.abs(third)))], 1), third)
    first /= np.linalg.norm(first)
    return np.stack([first, np.cross(third, first), third])
