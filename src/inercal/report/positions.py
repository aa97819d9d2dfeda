"""Positions of a test, drawn: where the vertical lies on the instrument, and the angles of a table."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array
from inercal.report.style import ALARM, COLOURS, DIVERGING, INK, QUIET

if TYPE_CHECKING:
    from matplotlib.axes import Axes


NUMBERED = 60
"""Positions up to which each has its number beside it."""

_NET = "#D5DBE1"
_NEAR = 0.15
"""Distance on the unit disc up to which positions share a label."""


def hemispheres(
    panels: Sequence[Axes],
    directions: Array,
    values: Array | None = None,
    label: str = "",
    stars: Array | None = None,
) -> None:
    """Draw directions on two hemispheres seen along -z, in equal-area projection, numbered in their order.

    Parameters
    ----------
    panels : two axes
        For the half towards +z and the one towards -z.
    directions : (n, 3)
        Unit vectors.
    values : (n,), optional
        Numbers with a sign, as colour; all of one colour if absent.
    label : str
        What the values are, with their unit.
    stars : (m, 3), optional
        Directions to be marked.
    """
    few = len(directions) <= NUMBERED
    size = 42.0 if few else 16.0
    marks = None
    for axes, side in zip(panels, (1.0, -1.0), strict=True):
        _net(axes, side)
        here = side * directions[:, 2] >= 0
        x, y = flat(directions[here])
        if values is None:
            axes.scatter(x, y, color=COLOURS[0], s=size, edgecolors=INK, linewidths=0.5, zorder=3)
        else:
            limit = float(np.max(np.abs(values))) or 1.0
            marks = axes.scatter(
                x,
                y,
                c=values[here],
                cmap=DIVERGING,
                vmin=-limit,
                vmax=limit,
                s=size,
                edgecolors=INK,
                linewidths=0.5,
                zorder=3,
            )
        if few:
            _number(axes, np.stack(flat(directions), axis=-1), here)
        for star in () if stars is None else stars[side * stars[:, 2] >= 0]:
            axes.scatter(*flat(star), marker="*", s=190, c="none", edgecolors=ALARM, lw=1.4, zorder=5)
    page = panels[0].get_figure(root=True)
    if marks is not None and page is not None:
        page.colorbar(marks, ax=list(panels), shrink=0.7, label=label)


def flat(directions: Array) -> tuple[Array, Array]:
    """Lambert's equal-area projection of unit vectors (*batch, 3) from the nearer pole; the equator has radius 1."""
    shrink = np.sqrt(1.0 + np.abs(directions[..., 2]))
    return directions[..., 0] / shrink, directions[..., 1] / shrink


def full_circle(axes: Axes, joints: Sequence[str]) -> None:
    """Two angles of a table as axes, 0 to 360 degrees."""
    axes.set_xlabel(f"{joints[0]} [°]")
    axes.set_ylabel(f"{joints[1]} [°]")
    axes.set_xticks(np.arange(0, 361, 90))
    axes.set_yticks(np.arange(0, 361, 90))
    axes.set_aspect("equal")


def plane(axes: Axes, angles: Array, joints: Sequence[str]) -> None:
    """Positions over the two angles (n, 2) [rad] of a table, numbered in their order."""
    turns = np.degrees(angles) % 360.0
    axes.scatter(turns[:, 0], turns[:, 1], color=COLOURS[0], s=22, edgecolors=INK, linewidths=0.5, zorder=3)
    if len(turns) <= NUMBERED:
        for k, place in enumerate(turns, start=1):
            axes.annotate(str(k), place, (4, 3), textcoords="offset points", fontsize=6, zorder=4)
    full_circle(axes, joints)
    axes.set_xlim(-12, 372)
    axes.set_ylim(-12, 372)
    axes.grid()


def _net(axes: Axes, side: float) -> None:
    """The net of one hemisphere, with the names of its axes."""
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    for colatitude in (30.0, 60.0, 90.0):
        radius = np.sqrt(2.0) * np.sin(np.radians(colatitude) / 2.0)
        edge = colatitude == 90.0
        axes.plot(
            radius * np.cos(angle),
            radius * np.sin(angle),
            color=QUIET if edge else _NET,
            lw=0.9 if edge else 0.5,
        )
    axes.plot([-1, 1], [0, 0], [0, 0], [-1, 1], color=_NET, lw=0.5)
    for x, y, name in ((1, 0, "+x"), (-1, 0, "−x"), (0, 1, "+y"), (0, -1, "−y")):
        axes.text(1.12 * x, 1.12 * y, name, ha="center", va="center")
    axes.set_title(f"towards {'+' if side > 0 else '−'}z", pad=12)
    axes.set_aspect("equal")
    axes.set_axis_off()


def _number(axes: Axes, places: Array, here: NDArray[np.bool_]) -> None:
    """Write the numbers of the positions on one hemisphere beside them, those of near ones together."""
    shared: dict[int, list[int]] = {}
    for k in np.flatnonzero(here).tolist():
        first = next((j for j in shared if np.linalg.norm(places[j] - places[k]) < _NEAR), k)
        shared.setdefault(first, []).append(k + 1)
    for k, numbers in shared.items():
        inward, below = -1 if places[k, 0] > 0.5 else 1, places[k, 1] > 0.7
        axes.annotate(
            fill(", ".join(map(str, numbers)), 16),
            places[k],
            (6 * inward, -8 if below else 4),
            textcoords="offset points",
            fontsize=6,
            ha="left" if inward > 0 else "right",
            zorder=4,
        )
