"""Parts of a picture as plain data: marks, axes, panels.

What is NaN has no mark.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal, TypeAlias

from numpy.typing import ArrayLike

from inercal.faces.report.style import COLOURS, INK, QUIET
from inercal.foundation.arrays import Array

Style: TypeAlias = str | tuple[float, tuple[float, float]]


@dataclass(frozen=True, eq=False)
class Line:
    """A line through points ``x``, ``y`` (n,); a break where one is NaN."""

    x: ArrayLike
    y: ArrayLike
    label: str = ""
    colour: str = COLOURS[0]
    width: float = 0.8
    style: Style = "-"


@dataclass(frozen=True, eq=False)
class Dots:
    """Points ``x``, ``y`` (n,), with bars of half the length ``across`` (n,) or ``up`` (n,), both ways.

    ``edged`` points have an outline; ``values`` (n,) are shown by colour, on the scale of the `Colours` of the panel.
    ``words`` (n,) are told where a mouse is over a point.
    """

    x: ArrayLike
    y: ArrayLike
    label: str = ""
    colour: str = COLOURS[0]
    shape: str | tuple[int, int, float] = "o"
    size: float = 4.0
    filled: bool = True
    across: ArrayLike | None = None
    up: ArrayLike | None = None
    bar: str = ""
    edged: bool = False
    values: Array | None = None
    words: Sequence[str] = ()


@dataclass(frozen=True, eq=False)
class Area:
    """The area between ``low`` and ``high`` (n,) over ``x`` (n,); with ``steps``, ``x`` (n + 1,) are edges."""

    x: ArrayLike
    low: ArrayLike
    high: ArrayLike
    label: str = ""
    colour: str = COLOURS[0]
    alpha: float = 0.15
    steps: bool = False


@dataclass(frozen=True, eq=False)
class Strips:
    """Areas from and to ``spans`` (k, 2) of the x axis, as high as the panel; with ``level`` of the y axis.

    An ``edge`` [points] lets short ones be seen.
    """

    spans: ArrayLike
    colour: str = COLOURS[0]
    alpha: float = 0.15
    level: bool = False
    edge: float = 0.0


@dataclass(frozen=True, eq=False)
class Level:
    """A straight line across the panel at ``at`` of the y axis; ``upright`` of the x axis."""

    at: float
    label: str = ""
    colour: str = QUIET
    width: float = 0.6
    style: Style = "-"
    upright: bool = False


@dataclass(frozen=True, eq=False)
class Bars:
    """Level bars from ``start`` (n,) to ``end`` (n,) at rows ``at`` (n,); ``upright`` ones at places of the x axis."""

    at: ArrayLike
    start: ArrayLike
    end: ArrayLike
    label: str = ""
    colour: str = COLOURS[0]
    thickness: float = 0.7
    hatch: str = ""
    upright: bool = False
    alpha: float = 1.0


@dataclass(frozen=True, eq=False)
class Cells:
    """Values (rows, columns) as colours within ``extent`` (left, right, first row, last row); ``numbers`` in them.

    ``numbers`` (rows, columns) are texts, empty for none; those of ``light`` (rows, columns) are white.
    """

    values: Array
    extent: tuple[float, float, float, float]
    numbers: Sequence[Sequence[str]] | None = None
    light: ArrayLike | None = None
    size: float = 6.0


@dataclass(frozen=True, eq=False)
class Note:
    """A text at ``place`` (2,) of the axes, moved by ``shift`` points.

    ``of_panel``: ``x``, ``y`` or both are parts of the panel's width and height.
    """

    place: ArrayLike
    text: str
    colour: str = INK
    size: float = 6.5
    ha: Literal["left", "center", "right"] = "left"
    va: Literal["top", "center", "center_baseline", "bottom"] = "center_baseline"
    shift: tuple[float, float] = (0.0, 0.0)
    of_panel: Literal["", "x", "y", "xy"] = ""
    bold: bool = False
    ground: bool = False


@dataclass(frozen=True, eq=False)
class Arrows:
    """Arrows from ``x``, ``y`` (n,) by ``dx``, ``dy`` (n,), each in its colour."""

    x: ArrayLike
    y: ArrayLike
    dx: ArrayLike
    dy: ArrayLike
    colours: Sequence[str]
    width: float = 0.005


Mark: TypeAlias = Line | Dots | Area | Strips | Level | Bars | Cells | Note | Arrows


@dataclass(frozen=True, eq=False)
class Axis:
    """An axis: its ``label``, ``scale`` and ``limits``; ``names`` of rows or columns; ``ticks`` where not as usual.

    With ``symlog`` the axis is linear up to ``linear``. Names are ``turned`` by degrees; ``far`` sets them at the top.
    A logarithmic axis has at most so many ``powers`` of ten, ``whole`` numbers count, and
    ``few`` ones leave room for long ones.
    """

    label: str = ""
    scale: Literal["linear", "log", "symlog"] = "linear"
    limits: tuple[float | None, float | None] | None = None
    names: Sequence[str] = ()
    ticks: Sequence[float] | None = None
    linear: float = 1.0
    whole: bool = False
    turned: float = 0.0
    far: bool = False
    size: float = 7.0
    powers: int = 6
    few: bool = False
    margin: float | None = None


@dataclass(frozen=True)
class Colours:
    """Values by colour: the ``name`` of the map, its ends, and the label of the scale."""

    name: str
    low: float
    high: float
    label: str
    shrink: float = 0.8
    pad: float = 0.02


@dataclass(frozen=True, eq=False)
class Panel:
    """Marks with two axes; ``notes`` stand at the right of the rows, ``grid`` says which axes have lines across.

    ``legend``: where the panel has one of its own, ``beside`` or ``inside`` it. Units of both axes are
    ``equal``; without being ``framed`` it has no edges, and ``bare`` no axes at all. Panels
    that share their ``colours`` share one scale at the right.
    """

    marks: Sequence[Mark]
    x: Axis = field(default_factory=Axis)
    y: Axis = field(default_factory=Axis)
    title: str = ""
    notes: Sequence[str] = ()
    grid: Literal["", "x", "y", "both"] = ""
    legend: Literal["", "beside", "inside"] = ""
    equal: bool = False
    framed: bool = True
    bare: bool = False
    colours: Colours | None = None
