"""Figures of a sensitivity analysis: bars of mean indices, maps over the positions, ranking, interactions."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array
from inercal.report.html import Picture
from inercal.report.positions import full_circle
from inercal.report.style import ALARM, COLOURS, INK, WIDTH, few_powers, figure, svg
from inercal.sensitivities.averages import Averages, Flag
from inercal.sensitivities.indices import Indices

if TYPE_CHECKING:
    from matplotlib.axes import Axes


MAP = "viridis"
"""Colour map of indices over positions, where white says that there is no index."""

PUBLISHED = (("ax", "dalpha_y2"), ("ay", "dalpha_x2"), ("az", "dphi_y1"))
"""Output and factor of the maps in figure 5 of Zhao et al. 2023."""


def ranking(indices: Indices, aggregate: Averages) -> Picture:
    """The errors in order of their total index over all outputs and positions."""
    order = np.argsort(-np.nan_to_num(aggregate.total), kind="stable")
    first, total = (100.0 * np.nan_to_num(share[order]) for share in (aggregate.first, aggregate.total))
    names = [indices.factors[k] for k in order]
    with figure(WIDTH, 0.6 + 0.17 * len(names)) as page:
        axes = page.subplots()
        axes.barh(names, first, height=0.7, color=COLOURS[0], label="S, alone")
        axes.barh(names, total - first, left=first, height=0.7, color=COLOURS[1], label="ST − S, with others")
        for row, value in enumerate(total):
            axes.annotate(
                _percent(value), (value, row), (3, 0), textcoords="offset points", fontsize=7, va="center"
            )
        axes.set_ylim(len(names) - 0.4, -0.6)
        axes.set_xlim(0.0, 1.12 * float(np.max(total, initial=1.0)))
        axes.set_xlabel("share of the variance [%]")
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="x")
        page.legend(loc="outside upper right", ncols=2)
        drawn = svg(page)
    return Picture(
        "Which errors matter",
        f"Variance of the errors of {', '.join(indices.outputs)}, each in units of its reference, summed over all "
        "positions: the share that each error of the table causes alone (S, first order), and together with others "
        "(ST is the sum of both; written).",
        drawn,
    )


def mean_indices(indices: Indices, mean: Averages) -> Picture:
    """Mean first- and total-order indices by output: figure 4 of Zhao et al. 2023."""

    both = np.nan_to_num([mean.first, mean.total])
    limits = min(0.0, 1.05 * float(both.min())), 1.05 * float(both.max()) or 1.0

    def draw(axes: Axes, o: int) -> None:
        rows = np.arange(len(indices.factors))
        axes.barh(rows - 0.2, mean.first[o], height=0.38, color=COLOURS[0], label="S")
        axes.barh(rows + 0.2, mean.total[o], height=0.38, color=COLOURS[1], label="ST")
        axes.set_xlim(limits)
        axes.grid(axis="x")

    return Picture(
        "Mean indices by output",
        "Mean over the positions of the first-order (S) and total-order (ST) indices of each error of the table, for "
        "each output (figure 4 of Zhao et al. 2023).",
        _by_output(indices, draw, "index"),
    )


def interactions(indices: Indices, mean: Averages, weighted: Averages) -> Picture | None:
    """What total-order indices have beyond first order, on a logarithmic scale.

    None where there is nothing, or where the indices are sampled and the differences are mostly their noise.
    """
    if indices.u_first is not None:
        return None
    beyond = [
        np.where(found.total_minus_first > 0.0, found.total_minus_first, np.nan) for found in (mean, weighted)
    ]
    if not np.isfinite(beyond).any():
        return None
    low, high = np.nanmin(beyond), np.nanmax(beyond)

    def draw(axes: Axes, o: int) -> None:
        rows = np.arange(len(indices.factors))
        axes.set_xscale("log")
        axes.plot(beyond[0][o], rows, "o", color=COLOURS[0], label="mean over positions")
        axes.plot(
            beyond[1][o], rows, "D", color=COLOURS[1], mfc="none", mew=1.1, label="weighted by variance"
        )
        axes.set_xlim(low / 3.0, high * 3.0)
        few_powers(axes.xaxis, 4)
        axes.grid()

    return Picture(
        "Interactions",
        "ST − S: the share that an error causes only together with others. Positions where an output has hardly any "
        "variance rule the mean and hardly touch the weighted index. An error without a dot has no interactions on "
        "that output.",
        _by_output(indices, draw, "ST − S"),
    )


def _by_output(indices: Indices, draw: Callable[[Axes, int], None], label: str) -> str:
    """A panel for each output, side by side, with the errors downwards."""
    factors = indices.factors
    with figure(WIDTH, 0.9 + 0.2 * len(factors)) as page:
        panels = page.subplots(1, len(indices.outputs), sharex=True, sharey=True, squeeze=False)[0]
        for o, (axes, output) in enumerate(zip(panels, indices.outputs, strict=True)):
            draw(axes, o)
            axes.set_title(output)
            axes.set_xlabel(label)
            axes.tick_params(axis="y", length=0)
        panels[0].set_yticks(np.arange(len(factors)), factors)
        panels[0].set_ylim(len(factors) - 0.5, -0.5)
        handles, labels = panels[0].get_legend_handles_labels()
        page.legend(handles, labels, loc="outside upper right", ncols=2)
        return svg(page)


def maps(indices: Indices, joints: Sequence[str], flagged: Sequence[Flag]) -> Picture | None:
    """First-order indices over both angles of a table: figure 5 of Zhao et al. 2023 where its errors are there.

    Else the error that matters most for each output. None for a table that has not two angles.
    """
    if len(joints) != 2 or len(indices.angles) < 2:
        return None
    pairs = [
        (indices.outputs.index(output), indices.factors.index(factor))
        for output, factor in PUBLISHED
        if output in indices.outputs and factor in indices.factors
    ]
    published = len(pairs) == len(PUBLISHED)
    if not published:
        size = np.nan_to_num(indices.first).sum(axis=1)
        pairs = [(o, int(np.argmax(size[o]))) for o in range(len(indices.outputs))]
    columns = min(3, len(pairs))
    rows = -(-len(pairs) // columns)
    top = max((float(np.nanmax(indices.first[o, :, k], initial=0.0)) for o, k in pairs), default=0.0) or 1.0
    with figure(WIDTH, 0.3 + 2.15 * rows) as page:
        grid = page.subplots(rows, columns, squeeze=False, sharex=True, sharey=True)
        for axes in grid.flat[len(pairs) :]:
            axes.set_axis_off()
        for letter, axes, (o, k) in zip("abcdefgh", grid.flat, pairs, strict=False):
            drawn_map = _map(axes, indices.angles, indices.first[o, :, k], top)
            full_circle(axes, joints)
            axes.label_outer()
            axes.set_title(f"({letter}) {indices.factors[k]} on {indices.outputs[o]}")
            singular = [flag.angles for flag in flagged if flag.output == indices.outputs[o]]
            if singular:
                axes.plot(*(np.degrees(singular) % 360.0).T, "x", color=ALARM, ms=3, mew=0.8)
        page.colorbar(drawn_map, ax=list(grid.flat), shrink=0.8 / rows**0.5, pad=0.02, label="S")
        drawn = svg(page)
    source = (
        " (figure 5 of Zhao et al. 2023)" if published else ": for each output the error that matters most"
    )
    crosses = "; crosses: first-order indices of that output sum to less than 0.99" if flagged else ""
    return Picture(
        "Maps over the positions",
        f"First-order index S of an error on an output at each position{source}. White: no index, since the output "
        f"has no variance there, or no position{crosses}.",
        drawn,
    )


def _map(axes: Axes, angles: Array, values: Array, top: float) -> Any:
    """Values (n,) at pairs of angles (n, 2) [rad]: cells where these are an even grid, else points."""
    found = _even_grid(angles)
    if found is None:
        turns = np.degrees(angles) % 360.0
        return axes.scatter(
            turns[:, 0],
            turns[:, 1],
            c=values,
            cmap=MAP,
            vmin=0.0,
            vmax=top,
            s=22,
            edgecolors=INK,
            linewidths=0.3,
        )
    (first, second), place = found
    cells = np.full(len(first) * len(second), np.nan)
    cells[place] = values
    edges = [
        edge
        for axis in (first, second)
        for edge in (axis[0] - 0.5 * (axis[1] - axis[0]), axis[-1] + 0.5 * (axis[1] - axis[0]))
    ]
    return axes.imshow(
        cells.reshape(len(first), len(second)).T,
        origin="lower",
        extent=tuple(np.degrees(edges)),
        cmap=MAP,
        vmin=0.0,
        vmax=top,
        interpolation="none",
    )


def _even_grid(angles: Array) -> tuple[list[Array], NDArray[np.int64]] | None:
    """Both angles [rad] of an evenly spaced full grid, and the place (n,) of each position; None for others."""
    turned = np.round(angles, 9)
    axes = [np.unique(column) for column in turned.T]
    if min(map(len, axes)) < 2 or len(axes[0]) * len(axes[1]) != len(angles):
        return None
    if any(not np.allclose(np.diff(axis), axis[1] - axis[0], atol=1e-6) for axis in axes):
        return None
    at = [np.searchsorted(axis, column) for axis, column in zip(axes, turned.T, strict=True)]
    place = at[0] * len(axes[1]) + at[1]
    return (axes, place) if len(np.unique(place)) == len(angles) else None


def _percent(value: float) -> str:
    """A share in percent, to three digits."""
    return f"{value:.3g}" if value >= 0.01 or value == 0.0 else "< 0.01"
