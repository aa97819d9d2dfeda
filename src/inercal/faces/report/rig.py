"""A rig with its axes, drawn: which way each joint turns plus, and how instrument and base lie at zero angles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Arrows, Axis, Dots, Line, Mark, Note, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.style import COLOURS, INK, QUIET
from inercal.foundation.arrays import Array

_AZIMUTH, _ELEVATION = np.radians(40.0), np.radians(22.0)
"""View of the rig: turned from south to east, and above the horizon."""

_STEP = 0.34
"""Distance of a ring from the next one inside; the innermost has radius 1."""


@dataclass(frozen=True, eq=False)
class DrawnTurn:
    """A joint: its ``name`` and the ``axis`` (3,), north, west, up, about which its angle counts right-handed."""

    name: str
    axis: Array


@dataclass(frozen=True, eq=False)
class DrawnTriad:
    """Three axes: their ``names``, and their directions (3, 3), north, west, up, in columns."""

    names: Sequence[str]
    axes: Array


def rig(title: str, caption: str, joints: Sequence[DrawnTurn], instrument: DrawnTriad) -> Picture:
    """A rig at zero angles, outer joint first: a ring for each joint with its axis and an arrow the way it turns plus,
    the axes of the instrument within, and north, west and up beside it."""
    marks: list[Mark] = []
    outermost = 1.0 + _STEP * (len(joints) - 1)
    for k, joint in enumerate(joints):
        radius, colour = 1.0 + _STEP * (len(joints) - 1 - k), COLOURS[k % len(COLOURS)]
        inner = joints[k + 1].axis if k + 1 < len(joints) else None
        marks += [*_ring(joint.axis, inner, radius, colour), *_turn(joint, outermost, colour)]
    marks += _triad(instrument, np.zeros(2), 0.66, INK)
    reach = 1.0 + _STEP * len(joints) + 0.45
    marks += _triad(
        DrawnTriad(("north", "west", "up"), np.eye(3)), np.array([-reach - 1.15, -0.75]), 0.62, QUIET
    )
    axes = Axis(limits=(-reach - 2.1, reach + 0.9)), Axis(limits=(-reach + 0.3, reach - 0.2))
    return draw(title, caption, [[Panel(marks, *axes, equal=True, bare=True)]], 3.4)


def _seen(points: Array) -> Array:
    """Points (*batch, 3), north, west, up, on the paper (*batch, 2): seen from the south-east and from above."""
    east, north, up = -points[..., 1], points[..., 0], points[..., 2]
    right = np.cos(_AZIMUTH) * east + np.sin(_AZIMUTH) * north
    away = np.cos(_AZIMUTH) * north - np.sin(_AZIMUTH) * east
    return np.stack([right, np.cos(_ELEVATION) * up + np.sin(_ELEVATION) * away], axis=-1)


def _across(axis: Array) -> tuple[Array, Array]:
    """Two directions that make a right-handed frame with an axis as the third."""
    first = np.cross(axis, np.eye(3)[int(np.argmin(np.abs(axis)))])
    first = first / np.linalg.norm(first)
    return first, np.cross(axis, first)


def _ring(axis: Array, inner: Array | None, radius: float, colour: str) -> list[Mark]:
    """The frame of a joint, in the plane of its axis and the next one; that of the last one lies across its axis."""
    angle = np.linspace(0.0, 2.0 * np.pi, 121)[:, None]
    side = None if inner is None else inner - axis * (axis @ inner)
    if side is None or np.linalg.norm(side) < 1e-3:
        first, second = _across(axis)
    else:
        first, second = axis, side / np.linalg.norm(side)
    ring = _seen(radius * (np.cos(angle) * first + np.sin(angle) * second))
    return [Line(ring[:, 0], ring[:, 1], "", colour, 2.2)]


def _turn(joint: DrawnTurn, radius: float, colour: str) -> list[Mark]:
    """The axis of a joint, and around its plus end, outside all rings, an arrow the way it turns."""
    ends = _seen(np.outer([-(radius + 0.12), radius + 0.42], joint.axis))
    first, second = _across(joint.axis)
    angle = np.radians(np.linspace(-60.0, 215.0, 60))[:, None]
    arc = _seen((radius + 0.2) * joint.axis + 0.19 * (np.cos(angle) * first + np.sin(angle) * second))
    heading = float(np.degrees(np.arctan2(*(arc[-1] - arc[-3])[::-1])))
    far = _seen((radius + 0.8) * joint.axis)
    return [
        Line(ends[:, 0], ends[:, 1], "", colour, 0.9, (0, (6, 2))),
        Line(arc[:, 0], arc[:, 1], "", colour, 1.4),
        Dots(arc[-1:, 0], arc[-1:, 1], "", colour, (3, 0, heading - 90.0), 6.0),
        Note(far, f"{joint.name} +", colour, 8.0, "center", "center", bold=True, ground=True),
    ]


def _triad(triad: DrawnTriad, at: Array, size: float, colour: str) -> list[Mark]:
    """Three arrows from a point of the paper, with their names."""
    tips = _seen(size * triad.axes.T)
    start = np.tile(at, (3, 1))
    marks: list[Mark] = [Arrows(start[:, 0], start[:, 1], tips[:, 0], tips[:, 1], [colour] * 3, 0.0035)]
    for name, tip in zip(triad.names, tips, strict=True):
        beyond = at + tip + 0.16 * tip / max(float(np.linalg.norm(tip)), 0.3)
        marks.append(Note(beyond, name, colour, 7.5, "center", "center", ground=True))
    return marks
