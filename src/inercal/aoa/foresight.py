"""Sensors of a model before they are built in: u of the angle with better or worse ones, and the model in motion."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from inercal.aoa.design import courses_of, sample_bound, settled_u, undisturbed
from inercal.aoa.motion import course as pitch_of
from inercal.aoa.motion import duration
from inercal.aoa.settings import AoaSettings
from inercal.arrays import Array
from inercal.designs.foresight import Course, Foresight, Lever
from inercal.errors import StudyError
from inercal.geometry.rotations import elementary
from inercal.instruments.terms import sized

_LEVERS = (
    ("noise", "accelerometer", "m/s^2", "of a sample"),
    ("noise", "accelerometer_bias", "m/s^2", "the same in all samples"),
    ("noise", "gyro", "rad/s", "of a sample"),
    ("noise", "gyro_bias", "rad/s", "the same in all samples"),
    ("prior", "lever", "m", "of each position"),
    ("prior", "lever_common", "m", "of the pivot"),
)
"""Table and key of what is scaled, its SI unit, and what it says."""

_MOMENTS = 240


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


def course(settings: AoaSettings) -> Course:
    """The model in the motion of the study, its sensors on it. Raises `StudyError` without a motion."""
    if settings.motion is None:
        raise StudyError("motion", "missing, expected the motion that the angle goes through")
    t = np.linspace(0.0, duration(settings.motion), _MOMENTS)
    theta = pitch_of(settings.motion, np.random.default_rng(0))(t)[0]
    layout = settings.layout
    places = np.column_stack([layout.r, np.zeros(len(layout.r)), layout.z])
    looks = np.column_stack([np.cos(layout.angle), np.zeros(len(layout.r)), -np.sin(layout.angle)])
    words = tuple(
        f"{time:.4g} s: theta {angle:.3g} deg"
        for time, angle in zip(t.tolist(), np.degrees(theta).tolist(), strict=True)
    )
    poses = np.asarray(elementary("y", -theta))[:, None]
    return Course(words, poses, np.zeros((1, 3)), np.zeros(0, dtype=int), np.stack([places, looks], axis=1))
