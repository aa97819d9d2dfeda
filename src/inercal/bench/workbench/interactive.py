"""Panels of marks as figures of plotly, which zoom and answer to the mouse."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from inercal.faces.report.marks import Area, Axis, Dots, Level, Line, Mark, Note, Panel, Strips

_MANY, _FEW = 2400, 150
"""Points of a line beyond which the graphics processor draws it, and below which each is marked."""

_GRID = "rgba(128,128,128,0.25)"

_CONFIG = {
    "displaylogo": False,
    "responsive": True,
    "scrollZoom": True,
    "modeBarButtonsToRemove": ["lasso2d", "select2d"],
}


def figure(
    panels: Sequence[Panel], height: float, over: Sequence[Mark] = (), unified: bool = False
) -> dict[str, Any]:
    """A figure of ``panels`` above each other, each of that ``height`` [pixel], over the x axis of the last.

    The marks ``over`` all panels are strips and upright levels of the x axis, and notes. With ``unified`` one cursor
    tells of all panels.
    """
    data = [trace for k, panel in enumerate(panels) for trace in _traces(panel, _numbered("y", k))]
    share = 1.0 / max(len(panels), 1)
    axis = panels[-1].x if panels else Axis()
    x: dict[str, Any] = {"title": {"text": axis.label}, "gridcolor": _GRID, "zeroline": False}
    x["anchor"] = _numbered("y", max(len(panels) - 1, 0))
    if unified:
        x |= {"showspikes": True, "spikemode": "across", "spikethickness": 1, "spikesnap": "cursor"}
    if axis.limits is not None:
        x |= {"range": list(axis.limits), "autorange": False}
    layout: dict[str, Any] = {
        "xaxis": x,
        "hovermode": "x unified" if unified else "closest",
        "hoversubplots": "axis",
        "dragmode": "zoom",
        "uirevision": "kept",
        "margin": {"l": 70, "r": 15, "t": 34, "b": 45},
        "height": max(len(panels) * height + 84, 284),
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
        "font": {"color": "#7A858F"},
        "legend": {"orientation": "h", "y": 1.0, "yanchor": "bottom"},
        "showlegend": any(trace["showlegend"] for trace in data),
        "shapes": [shape for mark in over for shape in _shapes(mark)],
        "annotations": [_annotation(mark) for mark in over if isinstance(mark, Note)],
    }
    for k, panel in enumerate(panels):
        layout[_numbered("yaxis", k)] = {
            "title": {"text": panel.y.label},
            "domain": [1.0 - (k + 0.9) * share, 1.0 - k * share],
            "gridcolor": _GRID,
            "zeroline": any(isinstance(mark, Level) and mark.at == 0.0 for mark in panel.marks),
            "zerolinecolor": "rgba(128,128,128,0.6)",
            "automargin": True,
        }
    return {"data": data, "layout": layout, "config": _CONFIG}


def _numbered(axis: str, k: int) -> str:
    """The name of an axis: the first has no number."""
    return f"{axis}{k + 1}" if k else axis


def _traces(panel: Panel, axis: str) -> Iterator[dict[str, Any]]:
    """Traces of the marks of a panel on an ``axis``."""
    unit = re.search(r"\[(.*)\]$", panel.y.label)
    of = f" {unit[1]}" if unit else ""
    for mark in panel.marks:
        match mark:
            case Line():
                x = _numbers(mark.x)
                yield {
                    "type": "scattergl" if len(x) > _MANY else "scatter",
                    "mode": "lines+markers" if len(x) < _FEW else "lines",
                    "name": mark.label, "showlegend": bool(mark.label), "x": x, "y": _numbers(mark.y), "yaxis": axis,
                    "line": {"width": mark.width, "color": mark.colour}, "marker": {"size": 4},
                    "hovertemplate": f"%{{y:.6g}}{of}",
                }  # fmt: skip
            case Dots():
                yield {
                    "type": "scatter", "mode": "markers", "name": mark.label, "showlegend": bool(mark.label),
                    "x": _numbers(mark.x), "y": _numbers(mark.y), "yaxis": axis, "customdata": list(mark.words),
                    "marker": {"color": mark.colour, "size": mark.size},
                    "hovertemplate": f"{'%{customdata}: ' if mark.words else ''}%{{y:.4g}}{of}<extra></extra>",
                }  # fmt: skip
            case Area():
                edge: dict[str, Any] = {
                    "type": "scatter",
                    "mode": "lines",
                    "line": {"width": 0},
                    "hoverinfo": "skip",
                }
                edge |= {"x": _numbers(mark.x), "yaxis": axis, "name": mark.label}
                yield {**edge, "y": _numbers(mark.low), "showlegend": False}
                fill = {"fill": "tonexty", "fillcolor": _shade(mark.colour, mark.alpha)}
                yield {**edge, **fill, "y": _numbers(mark.high), "showlegend": bool(mark.label)}
            case Level(at=0.0, upright=False):
                pass  # the line at zero of the axis
            case _:
                raise TypeError(f"found a {type(mark).__name__}, expected marks that figures of plotly have")


def _numbers(values: ArrayLike) -> list[float | None]:
    """Numbers for JSON; None for what is not finite."""
    array = np.asarray(values, dtype=float)
    found: list[float | None] = array.tolist()
    return found if np.isfinite(array).all() else [
        value if finite else None for value, finite in zip(found, np.isfinite(array).tolist(), strict=True)
    ]  # fmt: skip


def _shade(colour: str, alpha: float) -> str:
    """A colour (#RRGGBB) that lets others through."""
    red, green, blue = (int(colour[k : k + 2], 16) for k in (1, 3, 5))
    return f"rgba({red},{green},{blue},{alpha:g})"


def _shapes(mark: Mark) -> Iterator[dict[str, Any]]:
    """Shapes of a mark as high as the figure."""
    whole = {"xref": "x", "yref": "paper", "y0": 0, "y1": 1}
    match mark:
        case Strips():
            for begin, end in np.reshape(mark.spans, (-1, 2)).tolist():
                look = {"layer": "below", "line": {"width": 0}, "fillcolor": _shade(mark.colour, mark.alpha)}
                yield {"type": "rect", **whole, "x0": begin, "x1": end, **look}
        case Level(upright=True):
            line = {"color": mark.colour, "width": 1, "dash": "dot"}
            yield {"type": "line", **whole, "x0": mark.at, "x1": mark.at, "line": line}


def _annotation(mark: Note) -> dict[str, Any]:
    """A note along the upright at its place, below the top of the figure."""
    x, y = np.asarray(mark.place, dtype=float).tolist()
    return {
        "xref": "x", "yref": "paper", "x": x, "y": y, "text": mark.text, "showarrow": False, "textangle": -90,
        "xanchor": "right", "yanchor": "top", "font": {"color": mark.colour, "size": 10},
    }  # fmt: skip
