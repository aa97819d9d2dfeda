"""The one grammar of pictures: panels of marks in rows, one legend above, and the drawing of them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from inercal.faces.report.html import Picture
from inercal.faces.report.marks import (
    Area,
    Arrows,
    Axis,
    Bars,
    Cells,
    Colours,
    Dots,
    Level,
    Line,
    Mark,
    Note,
    Panel,
    Strips,
)
from inercal.faces.report.style import INK, WIDTH, few_powers, figure, power_of_ten, svg

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.axis import Axis as DrawnAxis
    from matplotlib.figure import Figure


_OUTSIDE: dict[str, Literal["outside upper left", "outside upper center", "outside upper right"]] = {
    "left": "outside upper left",
    "center": "outside upper center",
    "right": "outside upper right",
}


def draw(
    title: str,
    caption: str,
    panels: Sequence[Sequence[Panel]],
    height: float,
    columns: int = 3,
    where: Literal["left", "center", "right"] = "right",
    heights: Sequence[float] | None = None,
    share_y: bool | Literal["row"] = False,
    share_x: bool = True,
) -> Picture:
    """A picture of ``panels``, row by row, of that ``height`` [inch], with one legend above of so many ``columns``.

    ``heights`` of the rows are in proportion. Panels of a column share their x axis unless said otherwise.
    """
    with figure(WIDTH, height) as page:
        grid = page.subplots(
            len(panels),
            len(panels[0]),
            squeeze=False,
            sharex="col" if share_x else False,
            sharey=share_y,
            height_ratios=heights,
        )
        shown: dict[str, Any] = {}
        for r, row in enumerate(panels):
            for c, panel in enumerate(row):
                axes = grid[r, c]
                _panel(axes, panel, first=c == 0 or not share_y)
                if not panel.legend:
                    for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
                        shown.setdefault(label, handle)
            for axes in grid[r, len(row) :]:
                axes.set_axis_off()
        if len(panels[0]) == 1:
            page.align_ylabels(grid[:, 0])
        if shown:
            page.legend(
                list(shown.values()),
                list(shown),
                loc=_OUTSIDE[where],
                ncols=columns,
                markerscale=_enlarged(panels),
            )
        places = [
            (panel, axes)
            for row, line in zip(panels, grid, strict=True)
            for panel, axes in zip(row, line, strict=False)
        ]
        for scale in dict.fromkeys(panel.colours for panel, _ in places if panel.colours is not None):
            _scale(page, scale, [axes for panel, axes in places if panel.colours == scale])
        return Picture(title, caption, svg(page), page)


def _enlarged(panels: Sequence[Sequence[Panel]]) -> float:
    """Size of a legend's dots over that of the picture's, so that their colours can be told apart."""
    sizes = [
        mark.size
        for row in panels
        for panel in row
        for mark in panel.marks
        if isinstance(mark, Dots) and mark.label
    ]
    return max(1.0, 4.0 / max(sizes, default=4.0))


def _scale(page: Figure, colours: Colours, panels: list[Axes]) -> None:
    """The scale of colours at the right."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import Normalize

    mesh = ScalarMappable(Normalize(colours.low, colours.high), colours.name)
    page.colorbar(mesh, ax=panels, shrink=colours.shrink, pad=colours.pad, label=colours.label)


def _panel(axes: Axes, panel: Panel, first: bool) -> None:
    """Marks, axes and words of one panel."""
    for axis, set_scale in ((panel.x, axes.set_xscale), (panel.y, axes.set_yscale)):
        if axis.scale == "log":
            set_scale("log", nonpositive="clip")
        elif axis.scale == "symlog":
            set_scale("symlog", linthresh=axis.linear, linscale=0.7)
    for mark in panel.marks:
        _mark(axes, mark, panel.colours)
    if panel.title:
        axes.set_title(panel.title, pad=12.0 if panel.bare else None)
    axes.margins(x=panel.x.margin, y=panel.y.margin)
    _axis(axes.xaxis, panel.x, "x")
    _axis(axes.yaxis, panel.y, "y", named=first)
    for k, note in enumerate(panel.notes):
        axes.text(1.01, k, note, transform=axes.get_yaxis_transform(), fontsize=6.5, va="center_baseline")
    if panel.equal:
        axes.set_aspect("equal")
    if panel.grid:
        axes.grid(axis=panel.grid, which="major")
    if not panel.framed:
        for spine in axes.spines.values():
            spine.set_visible(False)
    if panel.bare:
        axes.set_axis_off()
    if panel.legend == "beside":
        axes.legend(loc="center left", bbox_to_anchor=(1.0, 0.5))
    elif panel.legend == "inside":
        axes.legend(loc="best", ncols=2)


def _axis(artist: DrawnAxis, axis: Axis, way: Literal["x", "y"], named: bool = True) -> None:
    """Limits, ticks and label of an axis; rows are counted from the top."""
    from matplotlib.ticker import MaxNLocator

    axes = artist.axes
    set_limits, set_ticks = getattr(axes, f"set_{way}lim"), getattr(axes, f"set_{way}ticks")
    if axis.names:
        count = len(axis.names)
        set_limits(*((count - 0.4, -0.6) if way == "y" else (-0.6, count - 0.4)))
        if named:
            look: Any = {"rotation": axis.turned, "fontsize": axis.size}
            if axis.turned:
                look |= {"ha": "left" if axis.far else "center"}
            if axis.far:
                axes.xaxis.tick_top()
            set_ticks(range(count), axis.names, **look)
        axes.tick_params(axis=way, length=0)
    if axis.limits is not None:
        set_limits(*axis.limits)
    if axis.scale == "log":
        few_powers(artist, axis.powers)
        set_ticks([], minor=True)
    elif axis.scale == "symlog":
        ticks = (
            list(axis.ticks)
            if axis.ticks is not None
            else symlog_ticks(axis.linear, artist.get_view_interval())
        )
        set_ticks(ticks, list(map(power_of_ten, ticks)))
        set_ticks([], minor=True)
    elif axis.ticks is not None:
        set_ticks(axis.ticks)
    elif axis.whole:
        artist.set_major_locator(MaxNLocator(integer=True))
    elif axis.few:
        artist.set_major_locator(MaxNLocator(4, prune="both"))
        axes.ticklabel_format(axis=way, style="plain", useOffset=False)
    if axis.label and named:
        artist.set_label_text(axis.label)


def symlog_ticks(linear: float, limits: ArrayLike) -> list[float]:
    """Zero and at most four powers of ten on each side, from ``linear`` to the farther of the ``limits``."""
    far = min(max(float(np.max(np.abs(limits))), 3.0 * linear), 1e12 * linear)
    powers = linear * 10.0 ** np.arange(0, int(np.log10(far / linear)) + 1)
    every = powers[:: max(1, -(-len(powers) // 4))].tolist()
    return [*(-power for power in every[::-1]), 0.0, *every]


def _mark(axes: Axes, mark: Mark, colours: Colours | None) -> None:
    """One mark of a panel."""
    match mark:
        case Line():
            axes.plot(
                mark.x, mark.y, color=mark.colour, lw=mark.width, ls=mark.style, label=mark.label or None
            )
        case Dots():
            _dots(axes, mark, colours)
        case Area(steps=True):
            axes.stairs(
                mark.high, mark.x, baseline=mark.low, fill=True, color=mark.colour, alpha=mark.alpha, lw=0,
                label=mark.label or None,
            )  # fmt: skip
        case Area():
            axes.fill_between(
                mark.x,
                mark.low,
                mark.high,
                color=mark.colour,
                alpha=mark.alpha,
                lw=0,
                label=mark.label or None,
            )
        case Strips():
            across = axes.axhspan if mark.level else axes.axvspan
            for low, high in np.reshape(mark.spans, (-1, 2)).tolist():
                across(low, high, color=mark.colour, alpha=mark.alpha, lw=mark.edge)
        case Level():
            (axes.axvline if mark.upright else axes.axhline)(
                mark.at, color=mark.colour, lw=mark.width, ls=mark.style, label=mark.label or None, zorder=1
            )
        case Bars():
            _bars(axes, mark)
        case Cells():
            _cells(axes, mark, colours)
        case Note():
            _note(axes, mark)
        case Arrows():
            axes.quiver(
                mark.x, mark.y, mark.dx, mark.dy, color=list(mark.colours), angles="xy", scale_units="xy", scale=1.0,
                width=mark.width, zorder=3,
            )  # fmt: skip


def _dots(axes: Axes, mark: Dots, colours: Colours | None) -> None:
    """Points, by colour where they have values."""
    if mark.values is not None and colours is not None:
        axes.scatter(
            mark.x, mark.y, mark.size**2, c=mark.values, cmap=colours.name, vmin=colours.low, vmax=colours.high,
            edgecolors=INK, linewidths=0.4, zorder=3,
        )  # fmt: skip
        return
    look: Any = {
        "ls": "none",
        "marker": mark.shape,
        "color": mark.colour,
        "mec": INK if mark.edged else mark.colour,
        "mfc": mark.colour if mark.filled else "none",
        "mew": 0.5 if mark.edged else 1.0 if mark.filled and mark.shape not in ("|", "_", "+", "x") else 1.2,
        "ms": mark.size,
        "label": mark.label or None,
    }
    if mark.across is None and mark.up is None:
        axes.plot(mark.x, mark.y, **look)
    else:
        axes.errorbar(
            mark.x, mark.y, mark.up, mark.across, ecolor=mark.bar or mark.colour, elinewidth=0.9, **look
        )


def _bars(axes: Axes, mark: Bars) -> None:
    """Bars of one colour."""
    start, length = np.asarray(mark.start), np.asarray(mark.end) - np.asarray(mark.start)
    look: Any = {"color": mark.colour, "label": mark.label or None, "alpha": mark.alpha}
    look |= {"hatch": mark.hatch, "edgecolor": "white", "linewidth": 0.0}
    if mark.upright:
        axes.bar(mark.at, length, mark.thickness, bottom=start, **look)
    else:
        axes.barh(mark.at, length, mark.thickness, left=start, **look)


def _cells(axes: Axes, mark: Cells, colours: Colours | None) -> None:
    """Cells, and the numbers in them."""
    assert colours is not None
    left, right, first, last = mark.extent
    axes.imshow(
        mark.values, origin="lower", extent=mark.extent, cmap=colours.name, vmin=colours.low, vmax=colours.high,
        interpolation="none", aspect="auto",
    )  # fmt: skip
    if mark.numbers is None:
        return
    rows, columns = mark.values.shape
    light = np.zeros(mark.values.shape, dtype=bool) if mark.light is None else np.asarray(mark.light)
    for r, row in enumerate(mark.numbers):
        for c, text in enumerate(row):
            if text:
                axes.text(
                    left + (c + 0.5) * (right - left) / columns, first + (r + 0.5) * (last - first) / rows, text,
                    fontsize=mark.size, ha="center", va="center_baseline", color="white" if light[r, c] else INK,
                )  # fmt: skip


def _note(axes: Axes, mark: Note) -> None:
    """A text at its place."""
    x, y = np.asarray(mark.place, dtype=float).tolist()
    places = {
        "": axes.transData,
        "x": axes.get_yaxis_transform(),
        "y": axes.get_xaxis_transform(),
        "xy": axes.transAxes,
    }
    axes.annotate(
        mark.text, (x, y), mark.shift, places[mark.of_panel], "offset points", fontsize=mark.size,
        color=mark.colour, ha=mark.ha, va=mark.va, fontweight="bold" if mark.bold else None, zorder=4,
        bbox={"facecolor": "white", "alpha": 0.8, "lw": 0, "pad": 0.8} if mark.ground else None,
    )  # fmt: skip
