"""The page of a sensitivity analysis: ranking, bars of mean indices, maps over the positions, interactions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
from numpy.typing import NDArray

from inercal.faces.report.html import Picture
from inercal.faces.report.html import page as framed
from inercal.faces.report.marks import Axis, Bars, Cells, Colours, Dots, Mark, Note, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.sphere import circle_axes
from inercal.faces.report.style import ALARM, COLOURS
from inercal.foundation.arrays import Array
from inercal.foundation.records.places import counted
from inercal.foundation.sensitivities.averages import Averages, Flag
from inercal.foundation.sensitivities.indices import Indices
from inercal.systems.turntable.figures.table import factor_rows, rig, rig_facts
from inercal.systems.turntable.sensitivity import result as analysis_result

if TYPE_CHECKING:
    from inercal.foundation.results.result import Estimate
    from inercal.systems.turntable.sensitivity import Analysed
    from inercal.systems.turntable.settings import TurntableSettings


_FLAGS = 12
"""Flagged positions that a page lists."""

_MAP = "viridis"
"""Colour map of indices over positions, where white says that there is no index."""

_PUBLISHED = (("ax", "dalpha_y2"), ("ay", "dalpha_x2"), ("az", "dphi_y1"))
"""Output and factor of the maps in figure 5 of Zhao et al. 2023."""


def page(analysed: Analysed, settings: TurntableSettings, estimate: Estimate) -> str:
    """The report of a sensitivity analysis as one self-contained HTML page."""
    indices = analysed.indices
    pictures = [
        ranking(indices, analysed.aggregate),
        mean_indices(indices, analysed.mean),
        maps(indices, analysed.joints, analysed.flagged),
        interactions(indices, analysed.mean, analysed.weighted),
        rig(settings.chain),
    ]
    order = np.argsort(-np.nan_to_num(analysed.aggregate.total), kind="stable")
    worst = sorted(analysed.flagged, key=lambda flag: flag.sum_first)
    result, aggregate = analysis_result(analysed), analysed.aggregate
    return framed(
        "sensitivity.html",
        estimate,
        "Sensitivity of a turntable",
        note=analysed.note,
        facts=[
            *rig_facts(settings),
            ("positions", "", f"{settings.plan.name} ({counted(len(settings.plan), 'position')})"),
            ("method", "", _method_words(indices.method)),
            ("outputs", "", ", ".join(indices.outputs)),
        ],
        factors=factor_rows(settings.chain.errors),
        ranking=[
            (
                indices.factors[k],
                analysed.what[k],
                [
                    (float(share[k]), None if u is None else float(u[k]))
                    for share, u in (
                        (aggregate.first, aggregate.u_first),
                        (aggregate.total, aggregate.u_total),
                        (aggregate.total_minus_first, aggregate.u_total_minus_first),
                    )
                ],
            )
            for k in order
        ],
        pictures=[picture for picture in pictures if picture is not None],
        flagged=_flag_counts(analysed),
        sampled=indices.resampled is not None,
        joints=analysed.joints,
        worst=[
            (flag.output, np.degrees(flag.angles).tolist(), flag.sum_first, flag.u) for flag in worst[:_FLAGS]
        ],
        outputs=indices.outputs,
        names=indices.factors,
        tables=[
            (title, np.asarray(result[kind][key]).tolist())
            for kind, words in (("mean", "mean over the positions"), ("weighted", "weighted by variance"))
            for key, title in (
                ("first", f"First order S, {words}"),
                ("total", f"Total order ST, {words}"),
                ("total_minus_first", f"Interactions ST − S, {words}"),
                ("u_first", f"u of S, {words}"),
                ("u_total", f"u of ST, {words}"),
                ("u_total_minus_first", f"u of ST − S, {words}"),
                ("shapley", f"Shapley effects, {words}"),
            )
            if key in result[kind]
        ],
    )


def _flag_counts(analysed: Analysed) -> list[tuple[str, int]]:
    """Number of flagged positions by output."""
    outputs = [flag.output for flag in analysed.flagged]
    return [(name, outputs.count(name)) for name in analysed.indices.outputs if name in outputs]


def ranking(indices: Indices, aggregate: Averages) -> Picture:
    """The errors in order of their total index over all outputs and positions."""
    order = np.argsort(-np.nan_to_num(aggregate.total), kind="stable")
    first, total = (100.0 * np.nan_to_num(share[order]) for share in (aggregate.first, aggregate.total))
    names, rows = [indices.factors[k] for k in order], np.arange(len(order))
    marks: list[Mark] = [
        Bars(rows, np.zeros(len(rows)), first, "S, alone"),
        Bars(rows, first, total, "ST − S, with others", COLOURS[1]),
        *(Note((value, row), _percent(value), size=7.0, shift=(3.0, 0.0)) for row, value in enumerate(total)),
    ]
    across = Axis("share of the variance [%]", limits=(0.0, 1.12 * float(np.max(total, initial=1.0))))
    return draw(
        "Which errors matter",
        f"Variance of the errors of {', '.join(indices.outputs)}, each in units of its reference, summed over all "
        "positions: the share that each error of the table causes alone (S, first order), and together with others "
        "(ST is the sum of both; written).",
        [[Panel(marks, across, Axis(names=names), grid="x")]],
        0.6 + 0.17 * len(names),
        2,
    )


def mean_indices(indices: Indices, mean: Averages) -> Picture:
    """Mean first- and total-order indices by output: figure 4 of Zhao et al. 2023."""
    both, rows = np.nan_to_num([mean.first, mean.total]), np.arange(len(indices.factors))
    across = Axis("index", limits=(min(0.0, 1.05 * float(both.min())), 1.05 * float(both.max()) or 1.0))
    none = np.zeros(len(rows))
    return draw(
        "Mean indices by output",
        "Mean over the positions of the first-order (S) and total-order (ST) indices of each error of the table, for "
        "each output (figure 4 of Zhao et al. 2023).",
        _by_output(
            indices,
            across,
            [
                [
                    Bars(rows - 0.2, none, mean.first[o], "S", COLOURS[0], 0.38),
                    Bars(rows + 0.2, none, mean.total[o], "ST", COLOURS[1], 0.38),
                ]
                for o in range(len(indices.outputs))
            ],
            "x",
        ),
        0.9 + 0.2 * len(rows),
        2,
        share_y=True,
    )


def interactions(indices: Indices, mean: Averages, weighted: Averages) -> Picture | None:
    """Excess of total-order over first-order indices, on a logarithmic scale.

    None where there is nothing, or where the indices are sampled and the differences are mostly their noise.
    """
    if indices.resampled is not None:
        return None
    beyond = [
        np.where(each.total_minus_first > 0.0, each.total_minus_first, np.nan) for each in (mean, weighted)
    ]
    if not np.isfinite(beyond).any():
        return None
    rows = np.arange(len(indices.factors))
    across = Axis("ST − S", "log", (float(np.nanmin(beyond)) / 3.0, float(np.nanmax(beyond)) * 3.0), powers=4)
    return draw(
        "Interactions",
        "ST − S: the share that an error causes only together with others. Positions where an output has hardly any "
        "variance rule the mean and hardly touch the weighted index. An error without a dot has no interactions on "
        "that output.",
        _by_output(
            indices,
            across,
            [
                [
                    Dots(beyond[0][o], rows, "mean over positions"),
                    Dots(beyond[1][o], rows, "weighted by variance", COLOURS[1], "D", filled=False),
                ]
                for o in range(len(indices.outputs))
            ],
            "both",
        ),
        0.9 + 0.2 * len(rows),
        2,
        share_y=True,
    )


def _by_output(
    indices: Indices, across: Axis, marks: Sequence[Sequence[Mark]], grid: Literal["x", "both"]
) -> list[list[Panel]]:
    """A panel for each output, side by side, with the errors downwards."""
    down = Axis(names=indices.factors, size=7.5)
    return [
        [
            Panel(own, across, down, output, grid=grid)
            for own, output in zip(marks, indices.outputs, strict=True)
        ]
    ]


def maps(indices: Indices, joints: Sequence[str], flagged: Sequence[Flag]) -> Picture | None:
    """First-order indices over both angles of a table: figure 5 of Zhao et al. 2023 where its errors are there.

    Else the error that matters most for each output. None for a table that has not two angles.
    """
    if len(joints) != 2 or len(indices.angles) < 2:
        return None
    pairs = [
        (indices.outputs.index(output), indices.factors.index(factor))
        for output, factor in _PUBLISHED
        if output in indices.outputs and factor in indices.factors
    ]
    published = len(pairs) == len(_PUBLISHED)
    if not published:
        size = np.nan_to_num(indices.first).sum(axis=1)
        pairs = [(o, int(np.argmax(size[o]))) for o in range(len(indices.outputs))]
    columns = min(3, len(pairs))
    top = max((float(np.nanmax(indices.first[o, :, k], initial=0.0)) for o, k in pairs), default=0.0) or 1.0
    colours, across = (
        Colours(_MAP, 0.0, top, "S", 0.8 / (-(-len(pairs) // columns)) ** 0.5),
        circle_axes(joints),
    )
    panels = []
    for letter, (o, k) in zip("abcdefgh", pairs, strict=False):
        marks = [_map(indices.angles, indices.first[o, :, k])]
        singular = [flag.angles for flag in flagged if flag.output == indices.outputs[o]]
        if singular:
            first, second = np.transpose(np.degrees(singular) % 360.0)
            marks.append(Dots(first, second, colour=ALARM, shape="x", size=3.0))
        name = f"({letter}) {indices.factors[k]} on {indices.outputs[o]}"
        panels.append(Panel(marks, *across, name, equal=True, colours=colours))
    rows = [panels[k : k + columns] for k in range(0, len(panels), columns)]
    source = (
        " (figure 5 of Zhao et al. 2023)" if published else ": for each output the error that matters most"
    )
    crosses = "; crosses: first-order indices of that output sum to less than 0.99" if flagged else ""
    return draw(
        "Maps over the positions",
        f"First-order index S of an error on an output at each position{source}. White: no index, since the output "
        f"has no variance there, or no position{crosses}.",
        rows,
        0.3 + 2.15 * len(rows),
        share_y=True,
    )


def _map(angles: Array, values: Array) -> Mark:
    """Values (n,) at pairs of angles (n, 2) [rad]: cells where these are an even grid, else points."""
    grid = _even_grid(angles)
    if grid is None:
        turns = np.degrees(angles) % 360.0
        return Dots(turns[:, 0], turns[:, 1], size=4.7, values=values)
    (first, second), place = grid
    cells = np.full(len(first) * len(second), np.nan)
    cells[place] = values
    left, right, low, high = (
        float(np.degrees(edge))
        for axis in (first, second)
        for edge in (axis[0] - 0.5 * (axis[1] - axis[0]), axis[-1] + 0.5 * (axis[1] - axis[0]))
    )
    return Cells(cells.reshape(len(first), len(second)).T, (left, right, low, high))


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


def _method_words(method: Mapping[str, Any]) -> str:
    """Method and settings of the indices."""
    others = ", ".join(f"{key} {value}" for key, value in method.items() if key != "name")
    return f"{method['name']} ({others})" if others else str(method["name"])
