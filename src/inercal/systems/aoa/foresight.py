"""Sensors of a model before they are built in: u of the angle with better or worse ones."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.designs.foresight import Foresight, Lever
from inercal.foundation.errors import StudyError
from inercal.foundation.instruments.terms import sized
from inercal.systems.aoa.design import courses_of, sample_bound, settled_u, undisturbed
from inercal.systems.aoa.settings import AoaSettings

_LEVERS = (
    ("noise", "accelerometer", "m/s^2", "of a sample"),
    ("noise", "accelerometer_bias", "m/s^2", "the same in all samples"),
    ("noise", "gyro", "rad/s", "of a sample"),
    ("noise", "gyro_bias", "rad/s", "the same in all samples"),
    ("prior", "lever", "m", "of each position"),
    ("prior", "lever_common", "m", "of the pivot"),
)
"""Table and key of what is scaled, its SI unit, and what it says."""


def foresight(settings: AoaSettings) -> Foresight:
    """U of the angle, rms along the motion of the study, by the fusion and from single samples; the levers are noise,
    biases and places of the sensors. Raises `StudyError` without a motion."""
    if settings.motion is None:
        raise StudyError("motion", "missing, expected the motion that the angle goes through")
    recording, states = undisturbed(settings, settings.layout), courses_of(settings)

    def u(factors: Array) -> Array:
        told = settings
        for (table, key, *_), x in zip(_LEVERS, factors.tolist(), strict=True):
            of = getattr(told, table)
            told = replace(told, **{table: replace(of, **{key: getattr(of, key) * x})})
        return np.array([settled_u(told, told.layout, recording), sample_bound(told, told.layout, states)])

    levers = tuple(
        Lever(f"{table}.{key}", *sized(getattr(getattr(settings, table), key), si), says)
        for table, key, si, says in _LEVERS
    )
    size = np.full(2, math.radians(1.0))
    return Foresight(("theta, fusion", "theta, one sample"), ("deg", "deg"), size, levers, u)


def verticals(settings: AoaSettings) -> Array:
    """No directions (0, 3): a model in motion has no stops."""
    return np.zeros((0, 3))
