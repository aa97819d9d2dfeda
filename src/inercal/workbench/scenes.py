"""A test as one can look at it: the sphere of positions, and the gimbals that move, as figures of plotly."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from inercal.arrays import Array
from inercal.designs.foresight import Course
from inercal.report.style import ALARM, COLOURS, QUIET

_ROUND = np.linspace(0.0, 2.0 * np.pi, 49)
_NUMBERED = 60
"""Positions up to which each has its number."""


@dataclass(frozen=True, eq=False)
class Scene:
    """A ``figure`` of plotly, and its traces that move: of each the joint that carries it, and its points (n, 3)."""

    figure: dict[str, Any]
    moving: Mapping[int, tuple[int, Array]]


def sphere(course: Course) -> Scene:
    """Directions of the vertical on the instrument: the way, the numbered stops, and where it is now."""
    up, stops = course.up, course.up[course.stops]
    numbers = _numbered(stops)
    data = [
        _line(_net(), QUIET, 1, opacity=0.35),
        *_axes(1.25, "instrument"),
        _line(up, COLOURS[5], 2),
        _dots(stops, COLOURS[0], 4, text=list(numbers) if len(stops) <= _NUMBERED else None),
        _dots(up[:1], ALARM, 7),
    ]
    return Scene(_figure(data, "up on the instrument"), {len(data) - 1: (-1, np.zeros((0, 3)))})


def gimbals(course: Course) -> Scene:
    """The gimbals and the instrument at the first moment, in axes of which the third points up."""
    joints = len(course.axes)
    data = [_line(_circle(np.array([1.0, 0.0, 0.0]), np.array([0.0, 1.0, 0.0]), 1.3), QUIET, 1)]
    data += _arrow(np.zeros(3), np.array([0.0, 0.0, 1.3]), QUIET, "up")
    moving: dict[int, tuple[int, Array]] = {}

    def add(body: int, points: Array, colour: str, width: float, **more: Any) -> None:
        moving[len(data)] = (body, points)
        data.append(_line(points @ course.poses[0, body].T, colour, width, **more))

    for k in range(joints - 1):
        own, following = course.axes[k], course.axes[k + 1]
        radius = 1.2 - 0.3 * k
        add(
            k,
            _circle(own, _beside(own, following), radius),
            COLOURS[(k + 3) % len(COLOURS)],
            6,
            name=f"joint {k + 1}",
        )
    last = joints - 1
    if len(course.sensors):
        reach = float(np.abs(course.sensors[:, 0]).max()) or 1.0
        places = course.sensors[:, 0] / reach
        add(last, np.array([[-1.15, 0.0, 0.0], [1.15, 0.0, 0.0]]), QUIET, 8, name="model")
        for number, (place, look) in enumerate(zip(places, course.sensors[:, 1], strict=True), start=1):
            name = f"a{number}"
            tip = np.array([place, place + 0.3 * look])
            add(last, tip, COLOURS[number % len(COLOURS)], 6, name=name, text=["", name])
    else:
        size = 1.2 - 0.3 * (joints - 1) - 0.1
        if course.axes[last].any():
            third = course.axes[last]
            add(last, _circle(*_across(third), size), QUIET, 3, name="table")
        add(last, 0.45 * size * _box(), QUIET, 2, name="instrument")
        for axis, colour in zip("xyz", (COLOURS[1], COLOURS[2], COLOURS[0]), strict=True):
            tip = size * np.eye(3)["xyz".index(axis)]
            add(last, np.array([np.zeros(3), tip]), colour, 6, name=axis, text=["", axis])
    return Scene(_figure(data, ""), moving)


def motion(course: Course, scenes: Mapping[str, Scene]) -> dict[str, Any]:
    """All that the page needs to move ``scenes``, by the id of their place: poses and points as lists."""
    return {
        "words": list(course.words),
        "poses": np.round(course.poses.reshape(len(course.poses), -1, 9), 5).tolist(),
        "up": np.round(course.up, 5).tolist(),
        "scenes": [
            {
                "place": place,
                "traces": [
                    {"trace": trace, "body": body, "points": _with_gaps(points)}
                    for trace, (body, points) in scene.moving.items()
                ],
            }
            for place, scene in scenes.items()
        ],
    }


def _numbered(stops: Array) -> Sequence[str]:
    """Numbers of positions; those at one place stand together at the first."""
    words = [""] * len(stops)
    for number, stop in enumerate(stops, start=1):
        first = int(np.argmax(stops @ stop > 1.0 - 1e-6))
        words[first] = f"{words[first]}, {number}" if words[first] else str(number)
    return [word if len(word) < 12 else f"{word[: word.rindex(',', 0, 12)]} …" for word in words]


def _across(axis: Array) -> tuple[Array, Array]:
    """Two directions at right angles to an axis and to each other."""
    first = _beside(axis, np.zeros(3))
    return first, np.cross(axis, first)


def _beside(axis: Array, wanted: Array) -> Array:
    """The unit vector at right angles to ``axis`` that is nearest to ``wanted``, any where that lies along it."""
    for each in (wanted, *np.eye(3)):
        left = each - axis * float(axis @ each)
        if np.linalg.norm(left) > 1e-6:
            return np.asarray(left / np.linalg.norm(left))
    return np.asarray(np.eye(3)[0])


def _circle(first: Array, second: Array, radius: float) -> Array:
    """Points (n, 3) of a circle through two directions at right angles."""
    return np.asarray(radius * (np.outer(np.cos(_ROUND), first) + np.outer(np.sin(_ROUND), second)))


def _box() -> Array:
    """Points (n, 3) along the edges of a flat box."""
    corners = [[-1, -1], [1, -1], [1, 1], [-1, 1], [-1, -1]]
    low, high = (np.array([[*xy, z] for xy in corners], dtype=float) for z in (-0.5, 0.5))
    gap = np.full((1, 3), np.nan)
    posts = [np.vstack([low[k], high[k], gap[0]]) for k in range(4)]
    return np.vstack([low, gap, high, gap, *posts])


def _net() -> Array:
    """Points (n, 3) of circles on the unit sphere, with gaps."""
    x, y, z = np.eye(3)
    gap = np.full((1, 3), np.nan)
    rings = [_circle(x, y, np.cos(a)) + np.sin(a) * z for a in np.radians([-60, -30, 0, 30, 60])]
    rings += [_circle(np.cos(a) * x + np.sin(a) * y, z, 1.0) for a in np.radians([0, 45, 90, 135])]
    return np.vstack([part for ring in rings for part in (ring, gap)])


def _axes(length: float, of: str) -> list[dict[str, Any]]:
    """The axes of a frame with their letters."""
    return [
        each
        for name, tip, colour in zip(
            "xyz", length * np.eye(3), (COLOURS[1], COLOURS[2], COLOURS[0]), strict=True
        )
        for each in _arrow(np.zeros(3), tip, colour, name)
    ]


def _arrow(begin: Array, end: Array, colour: str, name: str) -> list[dict[str, Any]]:
    """A line with its name at the end."""
    return [_line(np.array([begin, end]), colour, 4, text=["", name], name=name)]


def _line(points: Array, colour: str, width: float, **more: Any) -> dict[str, Any]:
    """A line through points (n, 3), NaN a gap; ``text`` at the points."""
    text = more.pop("text", None)
    mode = {"mode": "lines+text", "text": text, "textfont": {"color": colour}} if text else {"mode": "lines"}
    return {**_trace(points), **mode, "line": {"width": width, "color": colour}, **more}


def _dots(points: Array, colour: str, size: float, text: list[str] | None = None) -> dict[str, Any]:
    """Dots, with ``text`` beside them."""
    mode = (
        {"mode": "markers"}
        if text is None
        else {"mode": "markers+text", "text": text, "textfont": {"color": QUIET}}
    )
    return {**_trace(points), **mode, "marker": {"size": size, "color": colour}}


def _trace(points: Array) -> dict[str, Any]:
    """A trace in space."""
    x, y, z = _with_gaps(points.T)
    return {"type": "scatter3d", "x": x, "y": y, "z": z, "hoverinfo": "skip", "showlegend": False}


def _with_gaps(points: Array) -> list[list[float | None]]:
    """Rows of numbers as lists, None for NaN."""
    return [[None if np.isnan(each) else each for each in row] for row in np.round(points, 5).tolist()]


def _figure(data: list[dict[str, Any]], words: str) -> dict[str, Any]:
    """A figure of one scene without a box around it."""
    hidden = {"visible": False, "range": [-1.5, 1.5]}
    return {
        "data": data,
        "layout": {
            "scene": {
                "xaxis": hidden, "yaxis": hidden, "zaxis": hidden, "aspectmode": "cube", "dragmode": "turntable",
                "camera": {"eye": {"x": 0.72, "y": -1.04, "z": 0.6}},
            },
            "margin": {"l": 0, "r": 0, "t": 0, "b": 0},
            "height": 330,
            "uirevision": "kept",
            "paper_bgcolor": "rgba(0,0,0,0)",
            "font": {"color": "#7A858F"},
        },
        "config": {"displaylogo": False, "responsive": True, "displayModeBar": False},
    }  # fmt: skip
