"""Pictures and the page of an angle of attack: the angle and its band, and the evidence for and against it."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from inercal.faces.report.coefficients import correlation
from inercal.faces.report.html import Picture, render
from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import principal
from inercal.foundation.units import STANDARD_GRAVITY
from inercal.systems.aoa.angles import gives_alpha
from inercal.systems.aoa.figures.learned import coefficients, consistency, flexure, lever_arms
from inercal.systems.aoa.figures.panels import (
    Flags,
    Marks,
    Signals,
    gaps,
    known,
    largest,
    measured,
    middle,
    of_angle,
    over_time,
    rms,
    span,
    stretches,
)
from inercal.systems.aoa.figures.sensors import fitted, points, side_by_side, side_view
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.reading.pauses import at_rest
from inercal.systems.aoa.reading.recording import settled
from inercal.systems.aoa.result.tables import answer, delays, displayed, on_page
from inercal.systems.aoa.task import in_order

if TYPE_CHECKING:
    from inercal.systems.aoa.reading.recording import Recording
    from inercal.systems.aoa.settings import AoaSettings
    from inercal.systems.aoa.task import Measurement


_MG = 1e-3 * STANDARD_GRAVITY

_CLOSE = 4.0
"""Time [s] of the close-up."""


def main(measurement: Measurement) -> Picture:
    """The picture that answers the question: the angle with its band; the sensors where there is no angle."""
    seen = in_order(measurement)
    return _angle(seen, _marks(seen)) if len(seen.recording.t) > 1 else _sensors(measurement)


def page(measurement: Measurement) -> str:
    """The report of a measurement as one self-contained HTML page, with or without other methods and a reference."""
    return render(
        displayed(measurement.estimate),
        pictures(measurement),
        "Angle of a wind-tunnel model",
        on_page(measurement.estimate),
        answer(measurement.estimate, measurement.points, measurement.settings),
    )


def pictures(measurement: Measurement) -> list[Picture]:
    """All pictures of a measurement of whatever method, status and length, the main one first."""
    settings, map_of_sensors, seen = measurement.settings, _sensors(measurement), in_order(measurement)
    recording, filtered = seen.recording, seen.filtered
    t = recording.t
    if len(t) < 2:
        return [map_of_sensors]
    names = (*settings.layout.names, "gyro")
    (missing, masked), marks = _lost(recording), _marks(seen)
    gallery = [_angle(seen, marks), *_close_up(seen), map_of_sensors]
    if missing.any() or len(marks.gaps):
        gallery.append(measured(t, names, missing, masked, marks))
    gallery += _in_the_stream(seen, settings, marks)
    gallery += _against_reference(seen, marks) + _fitted(seen) + _points(measurement) + _compared(seen, marks)
    gallery += lever_arms(seen, settings, marks)
    if filtered is not None:
        gallery += flexure(seen, filtered, settings, marks) + coefficients(seen, filtered)
        gallery += consistency(t, filtered.innovations, names, filtered.nis_mean, marks)
    reference = recording.reference
    gallery += of_angle(
        t,
        np.degrees(seen.angles.theta),
        None if reference is None else np.degrees(principal(seen.angles.theta - reference)),
        {} if filtered is None else dict(zip(names, filtered.innovations.T, strict=True)),
    )
    return gallery + ([correlation(measurement.estimate)] if len(measurement.estimate.names) > 1 else [])


def _sensors(measurement: Measurement) -> Picture:
    """Places of the sensors on the model."""
    layout, gyro = measurement.settings.layout, measurement.recording.gyro
    return side_view(layout.names, layout.angle, layout.r, layout.z, bool(np.isfinite(gyro).any()))


def _lost(recording: Recording) -> tuple[Flags, Flags]:
    """Samples (n, k) that are missing, and those that are saturated."""
    missing = np.isnan(np.column_stack([recording.acc, recording.gyro]))
    masked = recording.masked if recording.masked is not None else np.zeros(missing.shape, dtype=bool)
    return missing, np.asarray(masked)


def _marks(seen: Measurement) -> Marks:
    """Stretches that are saturated or empty, and where the filter started anew."""
    t, (_, masked) = seen.recording.t, _lost(seen.recording)
    restarts = np.empty(0) if seen.filtered is None else t[list(seen.filtered.starts[1:])]
    return Marks(
        stretches(t, np.asarray(masked.any(axis=1))),
        gaps(t),
        restarts=restarts,
        settling=LIMITS.settling_time,
    )


def _angle(seen: Measurement, marks: Marks) -> Picture:
    """Angle, its uncertainty, and its rate."""
    angles, t = seen.angles, seen.recording.t
    theta, u, rate = np.degrees(angles.theta), np.degrees(angles.u), np.degrees(angles.rate)
    falls = " It falls while the sensors are learned, and rises where they are saturated or silent."
    learning = "" if seen.filtered is None else falls
    title = f"u: median {middle(u):.2g}°, largest after the start {largest(u[settled(t)]):.2g}°"
    band = theta - 2.0 * u, theta + 2.0 * u
    panels = [
        Signals("theta [°]", {"": theta}, f"{angles.method}: {span(theta)}°", band),
        Signals("u of theta [°]", {"": u}, title, scale="log"),
    ]
    if np.isfinite(rate).any():
        panels.append(Signals("rate [°/s]", {"": rate}, f"rate: {span(rate)} °/s", zero=True))
    return over_time(
        "Angle, its uncertainty, and its rate",
        "Least and greatest value of pieces of the record, so that none is hidden. The band of ± two standard "
        "uncertainties about the angle is mostly thinner than its line; below, the standard uncertainty u on a scale "
        f"of its own.{learning}{marks.words} {delays(seen.estimate)}".rstrip(),
        t,
        panels,
        marks,
    )


def _close_up(seen: Measurement) -> list[Picture]:
    """A few seconds in which the model moves most; nothing of a short record."""
    t, angles = seen.recording.t, seen.angles
    if not t[-1] - t[0] > 4.0 * _CLOSE or not np.isfinite(angles.theta).any():
        return []
    place = np.floor((t - t[0] - LIMITS.settling_time) / _CLOSE)
    edges = np.flatnonzero((np.diff(place, prepend=-1.0) > 0.0) & (place >= 0.0))
    theta = np.degrees(angles.theta)
    spans = [float(np.ptp(known(theta[a:b]))) if len(known(theta[a:b])) else 0.0 for a, b in pairwise(edges)]
    if not spans:
        return []
    k = int(np.argmax(spans))
    part = slice(int(edges[k]), int(edges[k + 1]))
    lines = {"angle": theta[part]}
    if seen.recording.reference is not None:
        lines["reference"] = np.degrees(seen.recording.reference[part])
    panels = [
        Signals("theta [°]", lines),
        Signals("rate [°/s]", {"": np.degrees(angles.rate[part])}, zero=True),
    ]
    return [
        over_time(
            "Close-up",
            f"The {_CLOSE:g} seconds in which the angle moves most. Steps and needles that no model can follow are "
            "faults of sensors or of time stamps.",
            t[part],
            panels,
        )
    ]


def _against_reference(seen: Measurement, marks: Marks) -> list[Picture]:
    """The error against a reference angle with its band; nothing without a reference."""
    t, angles, reference = seen.recording.t, seen.angles, seen.recording.reference
    if reference is None or not np.isfinite(angles.theta - reference).any():
        return []
    finite = np.isfinite(reference)
    moving = np.zeros(len(t), dtype=bool)
    creep = np.full(int(finite.sum()), LIMITS.reference_creep)
    moving[finite] = ~at_rest(t[finite], np.unwrap(reference[finite]), creep)[0]
    error, half = np.degrees(principal(angles.theta - reference)), 2.0 * np.degrees(angles.u)
    late = settled(t) & np.isfinite(error) & np.isfinite(half)
    outside = 100.0 * float(np.mean(np.abs(error[late]) > half[late])) if late.any() else 0.0
    parts = ", ".join(
        f"{rms(error[late & chosen]):.2g}° rms {what}"
        for what, chosen in (("at rest", ~moving), ("moving", moving))
        if (late & chosen).any()
    )
    return [
        over_time(
            "Error against the reference",
            "Angle less the reference angle of the record, with the band of ± two standard uncertainties; yellow: the "
            f"reference moves. After the first 2 s {parts}; {outside:.2g} % of the rows lie outside the band, about "
            "5 % would by chance. An error that stays when the model stops is a bias or an axis that is off; one that "
            f"goes with the rate is a delay.{marks.words}",
            t,
            [Signals("error [°]", {"": error}, f"error: {span(error[late])}°", (-half, half), zero=True)],
            replace(marks, moving=stretches(t, moving)),
            1.5,
        )
    ]


def _in_the_stream(seen: Measurement, settings: AoaSettings, marks: Marks) -> list[Picture]:
    """Angle of attack and sideslip, where the study states how the model lies, and roll where it is tracked."""
    angles, panels = seen.angles, []
    if gives_alpha(settings.attitude):
        flow = angles.in_stream(settings.attitude)
        for name, value, u in (("alpha", flow.alpha, flow.u_alpha), ("beta", flow.beta, flow.u_beta)):
            panels.append(_banded(seen, name, np.degrees(value), np.degrees(u)))
    if angles.roll is not None and angles.roll_u is not None:
        panels.append(_banded(seen, "roll", np.degrees(angles.roll), np.degrees(angles.roll_u)))
    if not panels:
        return []
    return [
        over_time(
            "Alpha, beta and roll",
            "Angle of attack alpha and sideslip beta, the wind from the right, from pitch, roll, yaw and the flow "
            "angularity that the study states, where it does; the roll, right wing down, where gyros track it. Bands "
            f"of ± two standard uncertainties u.{marks.words}",
            seen.recording.t,
            panels,
            marks,
            0.75,
        )
    ]


def _banded(seen: Measurement, name: str, value: Array, u: Array) -> Signals:
    """An angle [deg] with its band."""
    late = u[settled(seen.recording.t)]
    title = f"{name}: {span(value)}°, u median {middle(u):.2g}°, largest after the start {largest(late):.2g}°"
    return Signals(f"{name} [°]", {"": value}, title, (value - 2.0 * u, value + 2.0 * u))


def _fitted(seen: Measurement) -> list[Picture]:
    """The sensors as fitted to the reference angle; nothing without a fit."""
    fit, names = seen.verified, seen.settings.layout.names
    if fit is None or not fit.converged:
        return []
    kinds = (("S", "scale − 1 [ppm]", 1e-6), ("b", "bias [mg]", _MG), ("dlambda", "axis [mrad]", 1e-3),
             ("dr", "position, forward [mm]", 1e-3), ("zo", "position, up [mm]", 1e-3))  # fmt: skip
    rows = [[fit[f"{kind}_{k + 1}"] for k in range(len(names))] for kind, *_ in kinds]
    sizes = np.array([[size] for *_, size in kinds])
    values = np.array([[each.value for each in row] for row in rows])
    values[0] -= 1.0
    u = np.array([[each.u for each in row] for row in rows])
    identified = np.array([[each.name not in fit.unseen for each in row] for row in rows])
    return [fitted(names, [words for _, words, _ in kinds], values / sizes, u / sizes, identified)]


def _points(measurement: Measurement) -> list[Picture]:
    """Means of the points at rest, and against the reference where there is one; nothing without any."""
    all_points, reference = measurement.points, measurement.recording.reference
    if not all_points:
        return []
    columns = np.array([[each.theta, each.u, each.u_scatter, each.scatter] for each in all_points]).T
    error = None
    if reference is not None:
        true = [known(reference[each.start : each.stop]) for each in all_points]
        means = np.array([float(x.mean()) if len(x) else math.nan for x in true])
        error = np.degrees(principal(columns[0] - means))
    theta, u, left, scatter = np.degrees(columns)
    return [points(theta, u, left, scatter, error)]


def _compared(seen: Measurement, marks: Marks) -> list[Picture]:
    """Errors of all methods against the reference, or their differences from the chosen one."""
    if not seen.compared:
        return []
    t, reference = seen.recording.t, seen.recording.reference
    true = reference is not None and bool(np.isfinite(reference).any())
    others = {name: each.theta for name, each in seen.compared.items()}
    shown = {seen.angles.method: seen.angles.theta} | others if true else others
    base = reference if true and reference is not None else seen.angles.theta
    what = "error against the reference" if true else f"difference from {seen.angles.method}"
    apart = {name: principal(theta - base) for name, theta in shown.items()}
    late = settled(t)
    sizes = np.array([[largest(x[late]), rms(x[late])] for x in apart.values()])
    panels = [Signals("[°]", {"": np.degrees(x)}, name, zero=True) for name, x in apart.items()]
    return [
        side_by_side(tuple(apart), sizes[:, 0], sizes[:, 1], what),
        over_time(
            "Methods over time",
            f"The {what}, a panel for each method, each on a scale of its own: that which it spans after the first "
            f"2 s. The scales are the news.{marks.words}",
            t,
            panels,
            marks,
            0.5,
        ),
    ]
