"""Pictures of what a filter saw and learned: lever arms, flexure of the sting, errors of the sensors, innovations."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from inercal.faces.report import courses as white_noise
from inercal.faces.report.courses import CoefficientCourse, converging, falling
from inercal.faces.report.html import Picture
from inercal.foundation.arrays import Array
from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.units import STANDARD_GRAVITY
from inercal.systems.aoa.figures import sensors
from inercal.systems.aoa.figures.panels import Marks, Signals, largest, middle, over_time, rms
from inercal.systems.aoa.layout import all_weights, centrifugal_arms, tangential_arms
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.recording import settled
from inercal.systems.aoa.result.outcome import term_of

if TYPE_CHECKING:
    from inercal.systems.aoa.fusion.filter_result import FusionResult
    from inercal.systems.aoa.settings import AoaSettings
    from inercal.systems.aoa.task import Measurement


_MG = 1e-3 * STANDARD_GRAVITY

_BLOCKS = 400
"""Pieces of a record whose mean squared innovations are drawn."""

_NO_FORCE = 1e-3
"""Specific force [mg] below which there is none."""


def lever_arms(seen: Measurement, settings: AoaSettings, marks: Marks) -> list[Picture]:
    """Parts of the readings that lever arms add."""
    t, filtered, layout = seen.recording.t, seen.filtered, settings.layout
    rate = seen.angles.rate if np.isfinite(seen.angles.rate).any() else seen.recording.gyro
    level = settings.attitude.level
    weights = all_weights(layout)
    if filtered is not None:
        acceleration = filtered.acceleration
    else:
        acceleration = np.full(len(t), np.nan) if weights is None else seen.recording.acc @ weights / level
    degrees, late = math.degrees(_MG / settings.site.gravity), settled(t)
    panels = []
    arms = zip(layout.names, centrifugal_arms(layout, level), tangential_arms(layout, level), strict=True)
    for name, q, p in arms:
        terms = {"centrifugal": -q * rate**2 / _MG, "tangential": p * acceleration / _MG}
        sizes = {word: largest(x[late]) for word, x in terms.items()}
        felt = {word: size for word, size in sizes.items() if size > _NO_FORCE}
        most = ", ".join(f"{word} {size:.3g} mg = {degrees * size:.2g}°" for word, size in felt.items())
        title = f"{name}, at most: {most}" if most else f"{name}: none"
        panels.append(Signals(f"{name} [mg]", terms, title, zero=True))
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


def flexure(seen: Measurement, filtered: FusionResult, settings: AoaSettings, marks: Marks) -> list[Picture]:
    """The sting's flexure as it was estimated; nothing where it is not."""
    names, prior = seen.problem.names, settings.prior
    if "flexure_z" not in names or len(filtered.kept_t) < 2:
        return []
    panels = []
    for axis, word, of in (
        ("z", "along the vertical with" if prior.heave.vertical else "across", prior.heave),
        ("x", "along", prior.axial),
    ):
        k = names.index(f"flexure_{axis}")
        value, u, level = filtered.states[:, k] / _MG, filtered.states_u[:, k] / _MG, 2.0 * of.level / _MG
        title = f"{word} the model: {rms(value):.2g} mg rms, u {middle(u):.2g} mg; prior {0.5 * level:.2g} mg"
        band = value - 2.0 * u, value + 2.0 * u
        panels.append(Signals(f"{axis} [mg]", {"": value}, title, band, {"": level, " ": -level}, zero=True))
    return [
        over_time(
            "Flexure of the sting",
            "Specific force of the model's vibration on its sting, as the fusion estimates it beside the pitch, with "
            "bands of ± two standard uncertainties; dashes: ± two standard deviations of the prior. Within its band "
            "there is none to be seen. Beyond the dashes the prior is too small, and so may be the uncertainty of "
            f"theta: the finding flexure says by how much.{marks.words}",
            filtered.kept_t,
            panels,
            marks,
        )
    ]


def coefficients(seen: Measurement, filtered: FusionResult) -> list[Picture]:
    """Biases, lever arms, heights and scale: at the end against their priors, and over time."""
    problem, t = seen.problem, filtered.kept_t
    if len(t) < 2:
        return []
    places, prior = [*problem.nuisances.values()], np.sqrt(np.diag(problem.covariance))
    units, factors = zip(*(shown_unit(term_of(name).unit) for name in problem.nuisances), strict=True)
    sizes = np.array(factors)
    finite = np.flatnonzero(np.isfinite(filtered.states_u[:, places]).all(axis=1))
    if not len(finite):
        return []
    courses = []
    for (name, k), unit, size in zip(problem.nuisances.items(), units, sizes, strict=True):
        value, u = filtered.states[:, k] / size, filtered.states_u[:, k] / size
        centre = float(problem.mean[k] / size)
        courses.append(CoefficientCourse(name, unit, value, u, float(prior[k] / size), centre=centre))
    last = filtered.states[finite[-1], places] / sizes, filtered.states_u[finite[-1], places] / sizes
    at_end = sensors.learned(
        tuple(problem.nuisances), units, *last, problem.mean[places] / sizes, prior[places] / sizes
    )
    if filtered.smoothed:
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


def consistency(
    t: Array, values: Array, names: Sequence[str], nis_mean: float, marks: Marks
) -> list[Picture]:
    """Innovations, ``values`` (n, k) of ``names`` over their standard deviations, NaN where not measured, over ``t``
    (n,) [s].

    ``nis_mean`` is the mean of their squares once settled. Nothing where there are none.
    """
    at = np.isfinite(values)
    if not at.any():
        return []
    starts = np.unique(np.linspace(0, len(t), min(_BLOCKS, len(t)), endpoint=False).astype(np.int64))
    squared = np.add.reduceat(np.where(at, values, 0.0) ** 2, starts, axis=0)
    count = np.add.reduceat(at.astype(float), starts, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        each, together = squared / count, squared.sum(axis=1) / count.sum(axis=1)
    limits = {"1, as stated": 1.0, f"{LIMITS.mean_nis:g}, inconsistent": LIMITS.mean_nis}
    by_sensor = dict(zip(names, each.T, strict=True))
    at_middle = 0.5 * (t[starts] + t[np.append(starts[1:], len(t)) - 1])
    nis = over_time(
        "Normalised innovations squared",
        "What the sensors tell beyond what the filter expected, squared and over its variance (NIS): means over pieces "
        f"of {(t[-1] - t[0]) / len(starts):.2g} s. Over the record, once settled, {nis_mean:.3g}. Below 1 is normal "
        "where the filter allows for a sting that bends: about 0.25 for a rigid model, the gyro near 1, accelerometers "
        "far below. Above 2 the model does not hold: the sensor that stands out is the one to look at. Peaks are "
        f"spikes, knocks, or lost rows.{marks.words}",
        at_middle,
        [
            Signals("all", {"": together}, "all sensors", levels=limits, scale="log"),
            Signals("each", by_sensor, "each sensor", levels={"": 1.0}, scale="log"),
        ],
        replace(marks, gaps=np.empty((0, 2))),
    )
    white = white_noise.innovations(t, values, names)
    return [
        nis,
        replace(
            white,
            caption="Left: reading less what the filter expected, over its standard deviation; least and greatest "
            "value of pieces of the record; strip: ± 2. Right: correlation with itself some rows later; strip: ± two "
            "standard deviations of white noise, red beyond. A filter that allows for flexure stays within the strip "
            "and leaves some correlation, also of a rigid model. Suspicious is what stays off zero (a bias beyond its "
            "prior) or swings with the motion (a lever arm, a sign, a delay).",
        ),
    ]
