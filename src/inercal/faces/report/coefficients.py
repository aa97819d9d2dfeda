"""Pictures of coefficients, a row for each: values and limits, uncertainties beside each other, shares, correlation."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from textwrap import fill

import numpy as np
from numpy.typing import NDArray

from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Axis, Bars, Cells, Colours, Dots, Level, Mark, Note, Panel, Strips
from inercal.faces.report.panels import draw
from inercal.faces.report.style import ALARM, COLOURS, DIVERGING, INK, SEQUENTIAL, plain_unit
from inercal.foundation.arrays import Array
from inercal.foundation.instruments.terms import term
from inercal.foundation.results.result import Estimate
from inercal.foundation.results.shown import rounded

_SMALL = 0.02
"""Share that a source reaches in no coefficient, to be drawn together with others of the kind."""

_MARKS = "osD^vP"


def correlation(estimate: Estimate) -> Picture:
    """The correlation matrix of the coefficients, below its diagonal."""
    names, r = estimate.names, estimate.correlation
    p = len(names)
    below = np.tri(p, k=-1, dtype=bool)
    written = below & (np.abs(r) >= 0.3)
    cells = Cells(
        np.where(below, r, np.nan)[1:, :-1],
        (-0.5, p - 1.5, -0.5, p - 1.5),
        [[f"{100.0 * r[i, j]:.0f}" if written[i, j] else "" for j in range(p - 1)] for i in range(1, p)],
        np.abs(r[1:, :-1]) > 0.6,
        5.0,
    )
    columns = Axis(names=names[:-1], turned=90.0, size=6.5, limits=(-0.5, p - 1.5))
    rows = Axis(names=names[1:], size=6.5, limits=(p - 1.5, -0.5))
    return draw(
        "Correlation of the coefficients",
        "Correlation coefficients of the estimates; those of 0.3 and more are written in hundredths.",
        [
            [
                Panel(
                    [cells],
                    columns,
                    rows,
                    equal=True,
                    framed=False,
                    colours=Colours(DIVERGING, -1.0, 1.0, "correlation", 0.6),
                )
            ]
        ],
        0.7 + 0.185 * p,
    )


def budget(estimate: Estimate) -> Picture:
    """The share of each source of the budget in the variance of each coefficient.

    Sources that are small everywhere are drawn as one; when the colours have run out they come again, hatched.
    """
    names = estimate.names
    shares = {
        f"{item.source} ({item.type})": np.array([item.share.get(name, 0.0) for name in names])
        for item in estimate.budget
    }
    small = [name for name, share in shares.items() if share.max(initial=0.0) < _SMALL]
    if len(small) > 1:
        rest = np.sum([shares.pop(name) for name in small], axis=0)
        shares[f"{len(small)} smaller ones"] = rest
    ends = 100.0 * np.cumsum([np.zeros(len(names)), *shares.values()], axis=0)
    bars = [
        Bars(
            np.arange(len(names)), ends[k], ends[k + 1], label, COLOURS[k % len(COLOURS)], 0.75,
            ("", "//////", "......")[k // len(COLOURS) % 3],
        )
        for k, label in enumerate(shares)
    ]  # fmt: skip
    return draw(
        "Where the uncertainty comes from",
        "Share of each source in the variance u² of each coefficient; in brackets whether it was evaluated from the "
        "scatter of the data (type A) or is known from elsewhere (type B).",
        [[Panel(bars, Axis("share of the variance [%]", limits=(0.0, 100.0)), Axis(names=names))]],
        0.9 + 0.155 * len(names) + 0.13 * (len(shares) // 4),
        4 if len(shares) > 6 else 3,
        "center",
    )


def heat(
    title: str, caption: str, rows: Sequence[str], columns: Sequence[str], percent: Array, label: str
) -> Picture:
    """A table of percentages (rows, columns) as colours, with the numbers that round to one or more."""
    top = max(float(np.nanmax(percent, initial=0.0)), 1.0)
    cells = Cells(
        percent,
        (-0.5, len(columns) - 0.5, -0.5, len(rows) - 0.5),
        [[f"{x:.0f}" if x >= 0.5 else "" for x in row] for row in np.nan_to_num(percent)],
        percent > 0.55 * top,
    )
    scale = Colours(SEQUENTIAL, 0.0, top, label, min(1.0, 14 / len(rows)), 0.01)
    across = Axis(names=columns, turned=45.0, far=True, size=6.5, limits=(-0.5, len(columns) - 0.5))
    down = Axis(names=rows, size=6.5, limits=(len(rows) - 0.5, -0.5))
    return draw(
        title,
        caption,
        [[Panel([cells], across, down, framed=False, colours=scale)]],
        0.9 + 0.165 * len(rows),
    )


def dots(
    title: str,
    caption: str,
    names: Sequence[str],
    units: Sequence[str],
    series: Mapping[str, Array],
    goal: Array | None = None,
) -> Picture:
    """Standard uncertainties (p,) of coefficients beside each other, on a logarithmic axis for each unit.

    ``series`` are arrays by their labels; NaN has no mark. ``goal`` (p,) is marked by a bar.
    """
    groups: dict[str, list[int]] = {}
    for k, unit in enumerate(units):
        groups.setdefault(unit, []).append(k)
    panels = []
    for unit, group in groups.items():
        rows = np.arange(len(group))
        marks: list[Mark] = []
        if goal is not None:
            marks.append(Dots(goal[group], rows, "goal", INK, "|", 9.0))
        marks += [
            Dots(u[group], rows, label, COLOURS[k % len(COLOURS)], _MARKS[k % len(_MARKS)], filled=k == 0)
            for k, (label, u) in enumerate(series.items())
        ]
        across = Axis("u" if unit == "1" else f"u [{plain_unit(unit)}]", "log")
        panels.append([Panel(marks, across, Axis(names=[names[k] for k in group]), grid="both")])
    sizes = [len(group) for group in groups.values()]
    return draw(
        title,
        caption,
        panels,
        0.55 + 0.5 * len(sizes) + 0.165 * sum(sizes),
        3,
        "center",
        heights=[size + 1.0 for size in sizes],
        share_x=False,
    )


def limits(
    title: str,
    caption: str,
    names: Sequence[str],
    values: Array,
    half: Array,
    label: str,
    band: float = 1.0,
    alarm: NDArray[np.bool_] | None = None,
    notes: Sequence[str] = (),
) -> Picture:
    """Coefficients (p,) about zero with bars of ``half`` their length (p,), beside the ``band`` of ± their limit.

    ``alarm`` (p,) are those beyond it, in red; ``notes`` stand at the right.
    """
    rows = np.arange(len(names))
    far = np.zeros(len(names), dtype=bool) if alarm is None else alarm
    finite = np.isfinite(values) & np.isfinite(half)
    marks: list[Mark] = [Strips((-band, band), alpha=0.1), Level(0.0, upright=True)]
    for chosen, colour in ((finite & ~far, COLOURS[0]), (finite & far, ALARM)):
        marks.append(Dots(values[chosen], rows[chosen], colour=colour, size=3.5, across=half[chosen]))
    widest = float(np.max(np.abs(values) + half, initial=1.25 * band, where=finite))
    across = Axis(label, limits=(-1.08 * widest, 1.08 * widest))
    return draw(
        title,
        caption,
        [[Panel(marks, across, Axis(names=names), notes=notes, grid="x")]],
        0.7 + 0.17 * len(names),
    )


def values(estimate: Estimate) -> Picture:
    """The coefficients with their expanded uncertainties, a panel for each kind; where there are none, the reason."""
    if not estimate.names:
        words = Panel([Note((0.0, 0.5), fill(estimate.message, 90))], bare=True)
        return draw("No coefficients", estimate.message, [[words]], 0.7)
    groups: dict[tuple[str, str], list[int]] = {}
    for k, (name, unit) in enumerate(zip(estimate.names, estimate.units, strict=True)):
        of = term(name)
        groups.setdefault((name.partition("_")[0] if of else name, unit), []).append(k)
    U = np.array([p.U for p in estimate.parameters.values()])
    panels = []
    for (_, unit), group in groups.items():
        rows = np.arange(len(group))
        across = Axis("" if unit == "1" else f"[{plain_unit(unit)}]", few=True)
        shown = [rounded(estimate.values[k], estimate.u[k]) for k in group]
        panels.append(
            Panel(
                [Dots(estimate.values[group], rows, across=U[group])],
                across,
                Axis(names=[estimate.names[k] for k in group]),
                notes=[f"{value} ± {u}" for value, u, *_ in shown],
                grid="x",
            )
        )
    rows_of = [panels[k : k + 2] for k in range(0, len(panels), 2)]
    sizes = [max(len(panel.y.names) for panel in row) for row in rows_of]
    return draw(
        "Coefficients and their uncertainties",
        "Each coefficient with a bar of ± its expanded uncertainty U, a panel for each kind and unit; at the right the "
        "value with its standard uncertainty u.",
        rows_of,
        0.3 + 0.42 * len(rows_of) + 0.17 * sum(sizes),
        heights=[size + 1.0 for size in sizes],
        share_x=False,
    )


def repeats(estimate: Estimate) -> list[Picture]:
    """The coefficients of each run of combined runs, and the budget of the combination."""
    names = estimate.names
    if "by_run" not in estimate.result:
        return []
    by_run = [estimate.result["by_run"][name] for name in names]
    of_runs, u = (np.array([row[key] for row in by_run]).T for key in ("values", "u"))
    U = np.array([p.U for p in estimate.parameters.values()])
    marks: list[Mark] = [Strips((-1.0, 1.0)), Level(0.0, upright=True)]
    with np.errstate(divide="ignore", invalid="ignore"):
        for number, run in enumerate(of_runs):
            rows = np.arange(len(names)) + 0.5 * (number - 0.5 * (len(of_runs) - 1)) / len(of_runs)
            off, bar = (run - estimate.values) / U, 2.0 * u[number] / U
            marks.append(
                Dots(off, rows, f"run {number + 1}", COLOURS[number % len(COLOURS)], size=3.0, across=bar)
            )
    shown = draw(
        "The runs about their combined value",
        "Each sound run with a bar of two standard uncertainties; band: expanded uncertainty of the combined value. "
        "Bars that do not meet are changes from run to run, and widen the band.",
        [[Panel(marks, Axis("difference from the combined value / its U"), Axis(names=names), grid="x")]],
        0.9 + 0.17 * len(names),
        6,
        "center",
    )
    return [shown, correlation(estimate), budget(estimate)]
