"""Residuals of a result, each with the time of the recording that it is of: a picture of plotly of its own."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from inercal.bench.workbench import interactive
from inercal.faces.report.marks import Axis, Dots, Level, Mark, Panel
from inercal.faces.report.style import ALARM, COLOURS
from inercal.foundation.instruments.terms import shown_unit


@dataclass(frozen=True)
class ResidualKind:
    """Residuals of one kind: what they are, their unit for people, and of each (label, begin, end [s], value)."""

    what: str
    unit: str
    rows: tuple[tuple[str, float, float, float], ...]


def parts_of(result: Mapping[str, Any]) -> tuple[ResidualKind, ...]:
    """The residuals in the command's part of a result (`inercal.foundation.results.result.Estimate`); none where it
    has none."""
    found = [*_poses(result), *_turns(result), *_rests(result), *_unit_turns(result), *_points(result)]
    return tuple(part for part in found if part.rows)


def spans_of(result: Mapping[str, Any]) -> tuple[tuple[float, float], ...]:
    """Stretches (begin, end) [s] that a result took as rests; empty where it does not say."""
    if "intervals" in result:
        return tuple((float(each["start_s"]), float(each["end_s"])) for each in result["intervals"])
    if "rests" in result:
        return tuple(_span(each) for each in result["rests"])
    return tuple((float(each["begin"]), float(each["end"])) for each in result.get("points") or ())


def _span(rest: Any) -> tuple[float, float]:
    """A rest as a pair of times, or as an object."""
    if isinstance(rest, Mapping):
        return float(rest["start_s"]), float(rest["end_s"])
    return float(rest[0]), float(rest[1])


def _poses(result: Mapping[str, Any]) -> Iterator[ResidualKind]:
    """Of |f| in the poses of an IMU moved by hand."""
    unit, size = shown_unit("m/s^2")
    yield ResidualKind(
        "|f| − g of poses",
        unit,
        tuple(
            (f"pose {each['pose']}", each["start_s"], each["end_s"], each["residual_m_s2"] / size)
            for each in result.get("intervals", ())
            if each.get("residual_m_s2") is not None
        ),
    )


def _turns(result: Mapping[str, Any]) -> Iterator[ResidualKind]:
    """Of the turns between poses."""
    unit, size = shown_unit("rad")
    yield ResidualKind(
        "miss of turns",
        unit,
        tuple(
            (
                f"turn from pose {each['from_pose']}",
                each["start_s"],
                each["start_s"] + each["duration_s"],
                each["miss_rad"] / size,
            )
            for each in result.get("turns", ())
            if each.get("miss_rad") is not None
        ),
    )


def _rests(result: Mapping[str, Any]) -> Iterator[ResidualKind]:
    """Of the rests of an IMU on a table, axis by axis, in the units of its outputs."""
    rests = [each for each in result.get("rests", ()) if isinstance(each, Mapping)]
    for sensor in ("acc", "gyro"):
        unit = str(result.get("unit", {}).get(sensor, "")) if rests else ""
        text, size = shown_unit(unit)
        for k, axis in enumerate("xyz"):
            rows = [
                (f"rest {n}", *_span(each), each[f"residual_{sensor}"][k] / size)
                for n, each in enumerate(rests, start=1)
                if each.get(f"residual_{sensor}")
            ]
            yield ResidualKind(f"{sensor}_{axis} at rest", text, tuple(rows))


def _unit_turns(result: Mapping[str, Any]) -> Iterator[ResidualKind]:
    """Of the turns of a strapdown unit, over their noise."""
    rests = [_span(each) for each in result.get("rests", ())]
    rows = [
        (f"turn {n}", before[1], after[0], each["residual_z"])
        for n, (each, before, after) in enumerate(
            zip(result.get("turns", ()), rests, rests[1:], strict=False), start=1
        )
        if each.get("residual_z") is not None
    ]
    yield ResidualKind("turns, over noise", "1", tuple(rows))


def _points(result: Mapping[str, Any]) -> Iterator[ResidualKind]:
    """Scatter of the angle within the points of a run in a tunnel."""
    rows = [
        (f"point {each['number']:g}", each["begin"], each["end"], math.degrees(each["scatter"]))
        for each in result.get("points") or ()
        if each.get("scatter") is not None and each.get("number") is not None
    ]
    yield ResidualKind("scatter of points", "deg", tuple(rows))


def figure(parts: Sequence[ResidualKind], chosen: str = "") -> dict[str, Any]:
    """Residuals over the time of the recording, a panel for each kind; the ``chosen`` one is marked."""
    panels = []
    for title in dict.fromkeys(map(_panel, parts)):
        own = [part for part in parts if _panel(part) == title]
        marks: list[Mark] = [Level(0.0)]
        for k, part in enumerate(own):
            for alone in (False, True):
                rows = [row for row in part.rows if (row[0] == chosen) == alone]
                x, y = [0.5 * (begin + end) for _, begin, end, _ in rows], [value for *_, value in rows]
                name = "" if alone or len(own) < 2 else part.what
                colour, size = (ALARM, 13.0) if alone else (COLOURS[k % len(COLOURS)], 8.0)
                marks.append(Dots(x, y, name, colour, size=size, words=[label for label, *_ in rows]))
        panels.append(Panel(marks, Axis("time [s]"), Axis(title)))
    return interactive.figure(panels, 210.0)


def span_of(parts: Sequence[ResidualKind], label: str) -> tuple[float, float]:
    """The stretch (begin, end) [s] of the residual of that label."""
    return next((begin, end) for part in parts for name, begin, end, _ in part.rows if name == label)


def _panel(part: ResidualKind) -> str:
    """The title of the panel that a part is drawn in: axes of a sensor share one."""
    of = part.what.split("_")[0] if part.what[-4:] == "rest" else part.what
    return f"{of} [{part.unit}]"
