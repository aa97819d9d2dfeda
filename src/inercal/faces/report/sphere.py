"""Positions of a test, drawn: where the vertical lies on the instrument, and the angles of a table."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill

import numpy as np
from numpy.typing import NDArray

from inercal.faces.report.marks import Axis, Colours, Dots, Line, Mark, Note, Panel
from inercal.faces.report.style import ALARM, DIVERGING, INK, QUIET
from inercal.foundation.arrays import Array

NUMBERED = 60
"""Positions up to which each has its number beside it."""

_NET = "#D5DBE1"
_NEAR = 0.15
"""Distance on the unit disc up to which positions share a label."""


def hemispheres(
    directions: Array, values: Array | None = None, label: str = "", stars: Array | None = None
) -> list[Panel]:
    """Unit vectors (n, 3) on two hemispheres seen along -z, +z first, in equal-area projection, numbered in their
    order.

    ``values`` (n,) with a sign are shown as colour, and ``label`` is their quantity with its unit; ``stars`` (m, 3) are
    directions to be marked.
    """
    few, colours = len(directions) <= NUMBERED, None
    if values is not None:
        limit = float(np.max(np.abs(values))) or 1.0
        colours = Colours(DIVERGING, -limit, limit, label, 0.7)
    panels = []
    for side in (1.0, -1.0):
        here = side * directions[:, 2] >= 0.0
        x, y = flat(directions)
        marks = [
            *_net(),
            Dots(
                x[here],
                y[here],
                size=6.5 if few else 4.0,
                edged=True,
                values=None if values is None else values[here],
            ),
        ]
        if few:
            marks += _numbers(np.stack([x, y], axis=-1), here)
        if stars is not None:
            marked = flat(stars[side * stars[:, 2] >= 0.0])
            marks.append(Dots(*marked, colour=ALARM, shape="*", size=13.0, filled=False))
        title = f"towards {'+' if side > 0 else '−'}z"
        panels.append(Panel(marks, title=title, equal=True, bare=True, colours=colours))
    return panels


def flat(directions: Array) -> tuple[Array, Array]:
    """Lambert's equal-area projection of unit vectors (*batch, 3) from the nearer pole; the equator has radius 1."""
    shrink = np.sqrt(1.0 + np.abs(directions[..., 2]))
    return directions[..., 0] / shrink, directions[..., 1] / shrink


def circle_axes(joints: Sequence[str], margin: float = 0.0) -> tuple[Axis, Axis]:
    """Two angles of a table as axes, 0 to 360 degrees."""
    limits, ticks = (-margin, 360.0 + margin), np.arange(0.0, 361.0, 90.0).tolist()
    first, second = (Axis(f"{joint} [°]", limits=limits, ticks=ticks) for joint in joints)
    return first, second


def plane(angles: Array, joints: Sequence[str]) -> Panel:
    """Positions over the two angles (n, 2) [rad] of a table, numbered in their order."""
    turns = np.degrees(angles) % 360.0
    marks: list[Mark] = [Dots(turns[:, 0], turns[:, 1], size=4.7, edged=True)]
    if len(turns) <= NUMBERED:
        marks += [
            Note(place, str(k), size=6.0, va="bottom", shift=(4.0, 3.0))
            for k, place in enumerate(turns.tolist(), start=1)
        ]
    return Panel(marks, *circle_axes(joints, 12.0), grid="both", equal=True)


def _net() -> list[Mark]:
    """The net of one hemisphere, with the names of its axes."""
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    marks: list[Mark] = []
    for colatitude in (30.0, 60.0, 90.0):
        radius, edge = np.sqrt(2.0) * np.sin(np.radians(colatitude) / 2.0), colatitude == 90.0
        look = (QUIET, 0.9) if edge else (_NET, 0.5)
        marks.append(Line(radius * np.cos(angle), radius * np.sin(angle), "", *look))
    marks += [Line([-1, 1], [0, 0], "", _NET, 0.5), Line([0, 0], [-1, 1], "", _NET, 0.5)]
    return marks + [
        Note((1.12 * x, 1.12 * y), name, INK, 8.0, "center", "center")
        for x, y, name in ((1, 0, "+x"), (-1, 0, "−x"), (0, 1, "+y"), (0, -1, "−y"))
    ]


def _numbers(places: Array, here: NDArray[np.bool_]) -> list[Mark]:
    """The numbers of the positions on one hemisphere beside them, those of near ones together."""
    shared: dict[int, list[int]] = {}
    for k in np.flatnonzero(here).tolist():
        first = next((j for j in shared if np.linalg.norm(places[j] - places[k]) < _NEAR), k)
        shared.setdefault(first, []).append(k + 1)
    notes: list[Mark] = []
    for k, numbers in shared.items():
        right, below = places[k, 0] <= 0.5, places[k, 1] > 0.7
        text = fill(", ".join(map(str, numbers)), 16)
        shift = (6.0 if right else -6.0, -8.0 if below else 4.0)
        notes.append(Note(places[k], text, INK, 6.0, "left" if right else "right", "bottom", shift))
    return notes
