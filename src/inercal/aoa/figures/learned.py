"""Pictures of what lies between readings and angle: lever arms, flexure of the sting, and what was learned."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from inercal.aoa.arms import all_weights, centrifugal_arms, tangential_arms
from inercal.aoa.figures import sensors
from inercal.aoa.result.outcome import unit_of
from inercal.instruments.terms import shown_unit
from inercal.report.courses import Course, converging, falling
from inercal.report.html import Picture
from inercal.report.numbers import largest, middle, rms, settled
from inercal.report.over_time import Marks, Panel, over_time
from inercal.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from inercal.aoa.fusion.filter_result import FilterResult
    from inercal.aoa.settings import AoaSettings
    from inercal.aoa.task import Measurement


_MG = 1e-3 * STANDARD_GRAVITY

_NO_FORCE = 1e-3
"""Specific force [mg] that is none."""


def lever_arms(seen: Measurement, settings: AoaSettings, marks: Marks) -> list[Picture]:
    """What lever arms add to the reading of each accelerometer."""
    t, found, layout, roll = seen.recording.t, seen.filtered, settings.layout, settings.attitude.roll
    rate = seen.angles.rate if np.isfinite(seen.angles.rate).any() else seen.recording.gyro
    level = 1.0 if roll is None else math.cos(roll.value)
    weights = all_weights(layout)
    if found is not None:
        acceleration = found.acceleration
    else:
        acceleration = np.full(len(t), np.nan) if weights is None else seen.recording.acc @ weights / level
    degrees, late = math.degrees(_MG / settings.site.gravity), settled(t)
    panels = []
    for name, q, p in zip(
        layout.names, centrifugal_arms(layout, level), tangential_arms(layout, level), strict=True
    ):
        terms = {"centrifugal": -q * rate**2 / _MG, "tangential": p * acceleration / _MG}
        sizes = {word: largest(x[late]) for word, x in terms.items()}
        most = ", ".join(
            f"{word} {size:.3g} mg = {degrees * size:.2g}°"
            for word, size in sizes.items()
            if size > _NO_FORCE
        )
        title = f"{name}, at most: {most}" if most else f"{name}: none"
        panels.append(Panel(f"{name} [mg]", terms, title, zero=True))
    return [
        over_time(
            "What lever arms add to the readings",
            "Specific force that each accelerometer feels because it sits away from the pivot, by the positions that "
            "the study states: centrifugal with the square of the rate, tangential with the angular acceleration. "
            f"Taken for gravity, each mg costs {degrees:.2g}° or more. What is small against the biases needs no "
            f"compensation; what is large shows any error of a position.{marks.words}",
            t,
            panels,
            marks,
            0.75,
        )
    ]


def flexure(seen: Measurement, found: FilterResult, settings: AoaSettings, marks: Marks) -> list[Picture]:
    """The sting's flexure as it was estimated; nothing where it is not."""
    names, prior = seen.problem.names, settings.prior
    if "flexure_z" not in names or len(found.kept_t) < 2:
        return []
    panels = []
    for axis, word, of in (("z", "across", prior.heave), ("x", "along", prior.axial)):
        k = names.index(f"flexure_{axis}")
        value, u, level = found.states[:, k] / _MG, found.states_u[:, k] / _MG, 2.0 * of.level / _MG
        title = f"{word} the model: {rms(value):.2g} mg rms, u {middle(u):.2g} mg; prior {0.5 * level:.2g} mg"
        band = value - 2.0 * u, value + 2.0 * u
        panels.append(Panel(f"{axis} [mg]", {"": value}, title, band, {"": level, " ": -level}, zero=True))
    return [
        over_time(
            "Flexure of the sting",
            "Specific force of the model's vibration on its sting, as the fusion estimates it beside the pitch, with "
            "bands of ± two standard uncertainties; dashes: ± two standard deviations of the prior. Within its band "
            "there is none to be seen. Beyond the dashes the prior is too small, and so is the uncertainty of theta; "
            f"even where they hold it can be too small by some 20 % while the sting vibrates.{marks.words}",
            found.kept_t,
            panels,
            marks,
        )
    ]


def sensor_terms(seen: Measurement, found: FilterResult) -> list[Picture]:
    """Biases, lever arms, heights and scale: at the end against their priors, and over time."""
    problem, t = seen.problem, found.kept_t
    if len(t) < 2:
        return []
    places = [*problem.nuisances.values()]
    prior, sizes = (
        np.sqrt(np.diag(problem.covariance)),
        np.array([shown_unit(unit_of(name))[1] for name in problem.nuisances]),
    )
    units = [shown_unit(unit_of(name))[0] for name in problem.nuisances]
    told = np.flatnonzero(np.isfinite(found.states_u[:, places]).all(axis=1))
    if not len(told):
        return []
    courses = [
        Course(
            name,
            unit,
            found.states[:, k] / size,
            found.states_u[:, k] / size,
            float(prior[k] / size),
            centre=float(problem.mean[k] / size),
        )
        for (name, k), unit, size in zip(problem.nuisances.items(), units, sizes, strict=True)
    ]
    last = found.states[told[-1], places] / sizes, found.states_u[told[-1], places] / sizes
    at_end = sensors.learned(
        tuple(problem.nuisances), units, *last, problem.mean[places] / sizes, prior[places] / sizes
    )
    if found.smoothed:
        return [at_end]  # constants are the same all along
    return [
        at_end,
        converging(
            "What was learned, over time",
            "Biases b, lever arms dr, heights zo and scale k of the gyro as the record goes on, with bands of ± two "
            "standard uncertainties; above each its last value with its u. Bar at the start: the prior, ± two standard "
            "deviations. Each panel spans what the last 45 % of the time leave open. A value that keeps moving "
            "by more than its band is no constant: temperature, or an error of another kind.",
            t,
            courses,
        ),
        falling(
            "How the uncertainties fall",
            "Standard uncertainty of each over that of its prior. A line falls when the motion tells the coefficients "
            "apart, and stays level while it does not: biases need a sweep of the angle, lever arms fast motion.",
            t,
            courses,
        ),
    ]
