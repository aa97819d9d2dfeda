"""Figures 10 to 12 of Tan et al. 2021 by the runs of an entry: what each way of the paper leaves of one error term."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence

import numpy as np

from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Axis, Dots, Line, Mark, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.style import COLOURS, envelope
from inercal.foundation.geometry.rotations import principal
from inercal.systems.aoa.angles import Angles
from inercal.systems.aoa.paper.methods import label
from inercal.systems.aoa.runs.outcome import OscillationRuns, sine_of
from inercal.systems.aoa.runs.series import Series
from inercal.systems.aoa.settings import Methods
from inercal.systems.aoa.task import Measurement

_CENTRIFUGAL = {
    "low pass": Methods(centrifugal="low-pass"),
    "mechanical": Methods(),
    "decision": Methods(centrifugal="decision"),
}
_TANGENTIAL = {
    "none": Methods(tangential="none"),
    "differentiated": Methods(tangential="differentiated"),
    "dual": Methods(),
}
_STATIC = {
    "complementary": Methods(static="complementary", tangential="none"),
    "improved": Methods(tangential="none"),
    "segmented": Methods(static="segmented", tangential="none"),
}
"""Methods by what they differ in."""

_PERIODS = 2.0
"""Periods of an oscillation that are drawn."""


def pictures(series: Series) -> list[Picture]:
    """Figures 10 and 11 of runs that oscillate, and figure 12 of runs that were compared with a reference angle."""
    drawn = []
    if series.oscillating:
        drawn = [_centrifugal(series.oscillating), _tangential(series.oscillating)]
    return drawn + _static(series)


def _centrifugal(oscillating: Sequence[OscillationRuns]) -> Picture:
    """Figure 10: over the peak rate, which alone decides."""
    return _ways(
        "Centrifugal term, by amplitude and frequency",
        "Left of the centrifugal term by each way to take it off, in closed form for the stated noise and bias of the "
        "gyro. The low pass keeps the mean of the term, mechanical compensation errs with the gyro; decision takes "
        "the one that leaves less.",
        "centrifugal",
        _CENTRIFUGAL,
        oscillating,
        ("peak rate [°/s]", _peak_rate),
    )


def _tangential(oscillating: Sequence[OscillationRuns]) -> Picture:
    """Figure 11: over the peak of the angular acceleration."""
    return _ways(
        "Tangential term, by amplitude and frequency",
        "Left of the tangential term: untreated, with the gyro's first difference, and with two antiparallel "
        "accelerometers, in closed form for the stated noise and bias.",
        "tangential",
        _TANGENTIAL,
        oscillating,
        ("peak angular acceleration [rad/s²]", _acceleration),
    )


def _peak_rate(of: OscillationRuns) -> float:
    return 2.0 * math.pi * of.frequency * math.degrees(of.amplitude)


def _acceleration(of: OscillationRuns) -> float:
    return (2.0 * math.pi * of.frequency) ** 2 * of.amplitude


def _ways(
    title: str,
    caption: str,
    term: str,
    ways: Mapping[str, Methods],
    oscillating: Sequence[OscillationRuns],
    along: tuple[str, Callable[[OscillationRuns], float]],
) -> Picture:
    """A line for each way: what it leaves in closed form and, where a reference was recorded, its rms error."""
    axis, size = along
    ordered = sorted(oscillating, key=size)
    x = np.array([size(of) for of in ordered])
    words = [f"{math.degrees(of.amplitude):.3g}°, {of.frequency:.3g} Hz" for of in ordered]

    def panel(values: Mapping[str, list[float]], up: str) -> Panel:
        marks: list[Mark] = []
        for k, way in enumerate(ways):
            y = np.degrees(values[way])
            y = np.where(y > 0.0, y, np.nan)
            if np.isfinite(y).any():
                marks.append(Line(x, y, "", COLOURS[k], 0.9))
                marks.append(Dots(x, y, way, COLOURS[k], "osD"[k], size=4.0, words=words))
        return Panel(marks, Axis(axis, "log"), Axis(up, "log"), grid="both")

    left = {way: [of.terms.get(f"{term}, {way}", math.nan) for of in ordered] for way in ways}
    panels = [panel(left, "left of the term [°]")]
    judged = {
        way: [of.errors.get(label(methods), math.nan) for of in ordered] for way, methods in ways.items()
    }
    if np.isfinite([*judged.values()]).any():
        panels.append(panel(judged, "rms error of the angle [°]"))
        caption += " Right: rms error of the whole angle against theta_ref, by the methods that differ in this alone."
    return draw(title, f"{caption} Oscillations: {'; '.join(words)}.", [panels], 2.6, where="left")


def _static(series: Series) -> list[Picture]:
    """Figure 12: static ways without the dual pair, at rest and over time; nothing without a reference."""
    panels = []
    at_rest = _at_rest(series)
    if at_rest:
        panels.append(Panel(at_rest, Axis("angle [°]"), Axis("error at rest [°]"), grid="both"))
    over_time, words = _over_time(series)
    if over_time:
        panels.append(Panel(over_time, Axis(words), Axis("size of the error [°]"), grid="both"))
    if not panels:
        return []
    return [
        draw(
            "Static ways: complementary, improved, segmented",
            "Error against theta_ref by the ways to find the angle of a model at rest, without the dual pair, with "
            "which complementary and improved are one. Right: the oscillation of the least angular acceleration, "
            "the tangential term left in.",
            [panels],
            2.6,
            where="left",
            share_x=False,
        )
    ]


def _by_way(measured: Measurement) -> dict[str, Angles]:
    """Angles of a run by static way, of those that it was compared with."""
    found = {measured.angles.method: measured.angles, **measured.compared}
    return {way: found[label(methods)] for way, methods in _STATIC.items() if label(methods) in found}


def _compared(series: Series) -> list[Measurement]:
    """Runs with the wind on that have a reference and other methods."""
    return [
        done.measurement
        for done in series.measured
        if done.run.role != "wind-off"
        and done.measurement.recording.reference is not None
        and done.measurement.compared
    ]


def _at_rest(series: Series) -> list[Mark]:
    """Means of the error at each point, by static way."""
    places: dict[str, list[tuple[float, float]]] = {}
    for measured in _compared(series):
        reference = measured.recording.reference
        assert reference is not None
        for way, angles in _by_way(measured).items():
            for point in measured.points:
                rows = slice(point.start, point.stop)
                off = principal(angles.theta[rows] - reference[rows])
                if np.isfinite(off).any():
                    places.setdefault(way, []).append((point.theta, float(np.nanmean(off))))
    marks: list[Mark] = []
    for k, way in enumerate(_STATIC):
        if way in places:
            angle, off = np.degrees(sorted(places[way])).T
            marks.append(Dots(angle, off, way, COLOURS[k], "osD"[k], size=4.0, filled=k == 1))
    return marks


def _over_time(series: Series) -> tuple[list[Mark], str]:
    """Sizes of the errors of complementary and improved in some periods of a run that oscillates, and the axis."""
    chosen = []
    for measured in _compared(series):
        amplitude, frequency = sine_of(measured)
        if frequency > 0.0 and len(_by_way(measured)) > 1:
            chosen.append((amplitude * frequency**2, frequency, measured))
    if not chosen:
        return [], ""
    _, frequency, measured = min(chosen, key=lambda of: of[0])
    t, reference = measured.recording.t, measured.recording.reference
    assert reference is not None
    end = t[-1]
    rows = np.flatnonzero(t >= end - _PERIODS / frequency)
    marks: list[Mark] = []
    for k, (way, angles) in enumerate(_by_way(measured).items()):
        if way == "segmented":  # two lines over each other are enough
            continue
        size = np.degrees(np.abs(principal(angles.theta[rows] - reference[rows])))
        marks.append(Line(*envelope(t[rows], size, 600), way, COLOURS[k], 0.7))
    return marks, f"time [s], {frequency:.3g} Hz"
