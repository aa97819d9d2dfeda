"""Figures of estimates: correlation of the coefficients, where their uncertainty comes from, what would change it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from inercal.arrays import Array
from inercal.estimate.result import Estimate
from inercal.report.html import Picture
from inercal.report.style import (
    COLOURS,
    DIVERGING,
    INK,
    QUIET,
    SEQUENTIAL,
    WIDTH,
    few_powers,
    figure,
    plain_unit,
    svg,
)

_SMALL = 0.02
"""Share that a source reaches in no coefficient, to be drawn together with others of the kind."""

_MARKS = "osD^vP"


def correlation(estimate: Estimate) -> Picture:
    """The correlation matrix of the coefficients, below its diagonal."""
    names, r = estimate.names, estimate.correlation
    below = np.tri(len(names), k=-1, dtype=bool)
    with figure(WIDTH, 0.7 + 0.185 * len(names)) as page:
        axes = page.subplots()
        mesh = axes.pcolormesh(np.where(below, r, np.nan), cmap=DIVERGING, vmin=-1.0, vmax=1.0)
        for row, column in np.argwhere(below & (np.abs(r) >= 0.3)):
            strong = abs(r[row, column]) > 0.6
            axes.text(
                column + 0.5,
                row + 0.5,
                f"{100 * r[row, column]:.0f}",
                fontsize=5,
                ha="center",
                va="center_baseline",
                color="white" if strong else INK,
            )
        places = np.arange(len(names)) + 0.5
        axes.set_xticks(places[:-1], names[:-1], rotation=90, fontsize=6.5)
        axes.set_yticks(places[1:], names[1:], fontsize=6.5)
        axes.tick_params(length=0)
        axes.set_ylim(len(names), 1)
        axes.set_xlim(0, len(names) - 1)
        axes.set_aspect("equal")
        for spine in axes.spines.values():
            spine.set_visible(False)
        page.colorbar(mesh, ax=axes, shrink=0.6, label="correlation")
        drawn = svg(page)
    return Picture(
        "Correlation of the coefficients",
        "Correlation coefficients of the estimates; those of 0.3 and more are written in hundredths.",
        drawn,
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
    left = np.zeros(len(names))
    with figure(WIDTH, 0.9 + 0.155 * len(names) + 0.13 * (len(shares) // 4)) as page:
        axes = page.subplots()
        for k, (label, share) in enumerate(shares.items()):
            again, colour = divmod(k, len(COLOURS))
            axes.barh(
                names,
                100.0 * share,
                left=left,
                height=0.75,
                color=COLOURS[colour],
                hatch=("", "//////", "......")[again % 3],
                edgecolor="white",
                linewidth=0.0,
                label=label,
            )
            left += 100.0 * share
        axes.set_ylim(len(names) - 0.4, -0.6)
        axes.set_xlim(0.0, 100.0)
        axes.set_xlabel("share of the variance [%]")
        axes.tick_params(axis="y", length=0, labelsize=7)
        page.legend(loc="outside upper center", ncols=4 if len(shares) > 6 else 3)
        drawn = svg(page)
    return Picture(
        "Where the uncertainty comes from",
        "Share of each source in the variance u² of each coefficient; in brackets whether it was evaluated from the "
        "scatter of the data (type A) or is known from elsewhere (type B).",
        drawn,
    )


def heat(
    title: str, caption: str, rows: Sequence[str], columns: Sequence[str], percent: Array, label: str
) -> Picture:
    """A table of percentages (rows, columns) as colours, with the numbers that round to one or more."""
    top = max(float(np.nanmax(percent, initial=0.0)), 1.0)
    with figure(WIDTH, 0.9 + 0.165 * len(rows)) as page:
        axes = page.subplots()
        mesh = axes.pcolormesh(
            percent, cmap=SEQUENTIAL, vmin=0.0, vmax=top, edgecolors="white", linewidth=0.6
        )
        for row, column in np.argwhere(np.nan_to_num(percent) >= 0.5):
            axes.text(
                column + 0.5,
                row + 0.5,
                f"{percent[row, column]:.0f}",
                fontsize=6,
                ha="center",
                va="center_baseline",
                color="white" if percent[row, column] > 0.55 * top else INK,
            )
        axes.set_xticks(np.arange(len(columns)) + 0.5, columns, rotation=45, ha="left", fontsize=6.5)
        axes.set_yticks(np.arange(len(rows)) + 0.5, rows, fontsize=6.5)
        axes.xaxis.tick_top()
        axes.tick_params(length=0, pad=2)
        axes.set_ylim(len(rows), 0)
        for spine in axes.spines.values():
            spine.set_visible(False)
        page.colorbar(mesh, ax=axes, shrink=min(1.0, 14 / len(rows)), pad=0.01, label=label)
        drawn = svg(page)
    return Picture(title, caption, drawn)


def dots(
    title: str,
    caption: str,
    names: Sequence[str],
    units: Sequence[str],
    series: Mapping[str, Array],
    goal: Array | None = None,
) -> Picture:
    """Uncertainties (p,) of coefficients in several cases, on a logarithmic scale for each unit.

    A bar is the ``goal`` (p,), the uncertainty that is wanted. What is not finite is left out.
    """
    groups = [[k for k, own in enumerate(units) if own == unit] for unit in dict.fromkeys(units)]
    heights = [len(group) + 1.5 for group in groups]
    with figure(WIDTH, 0.5 + 0.15 * sum(heights) + 0.12 * len(groups)) as page:
        panels = page.subplots(len(groups), 1, squeeze=False, height_ratios=heights)[:, 0]
        for axes, group in zip(panels, groups, strict=True):
            axes.set_xscale("log")
            for k, (label, u) in enumerate(series.items()):
                axes.plot(
                    np.where(np.isfinite(u[group]), u[group], np.nan),
                    np.arange(len(group)),
                    _MARKS[k % len(_MARKS)],
                    color=COLOURS[k % len(COLOURS)],
                    mfc="none" if k else COLOURS[0],
                    mew=1.1,
                    label=label,
                )
            if goal is not None:
                axes.plot(
                    goal[group],
                    np.arange(len(group)),
                    "|",
                    color=INK,
                    ms=9.0,
                    mew=1.6,
                    label="goal",
                    zorder=1,
                )
            axes.set_yticks(np.arange(len(group)), [names[k] for k in group], fontsize=7)
            axes.set_ylim(len(group) - 0.5, -0.5)
            axes.tick_params(axis="y", length=0)
            axes.grid(axis="both")
            unit = plain_unit(units[group[0]])
            axes.set_xlabel("u" if unit == "1" else f"u [{unit}]")
            few_powers(axes.xaxis)
            axes.spines["left"].set_color(QUIET)
        handles, labels = panels[0].get_legend_handles_labels()
        page.legend(handles, labels, loc="outside upper center", ncols=3)
        drawn = svg(page)
    return Picture(title, caption, drawn)


def repeats(estimate: Estimate) -> list[Picture]:
    """The coefficients of each run of combined runs, and the budget of the combination."""
    names = estimate.names
    if "by_run" not in estimate.result:
        return []
    by_run = [estimate.result["by_run"][name] for name in names]
    values, u = (np.array([row[key] for row in by_run]).T for key in ("values", "u"))
    U = np.array([p.U for p in estimate.parameters.values()])
    with figure(WIDTH, 0.9 + 0.17 * len(names)) as page:
        axes = page.subplots()
        axes.axvspan(-1.0, 1.0, color=COLOURS[0], alpha=0.15, lw=0)
        axes.axvline(0.0, color=QUIET, lw=0.6)
        for number in range(len(values)):
            off = values[number] - estimate.values
            places = np.arange(len(names)) + 0.5 * (number - 0.5 * (len(values) - 1)) / len(values)
            with np.errstate(divide="ignore", invalid="ignore"):
                axes.errorbar(
                    off / U,
                    places,
                    xerr=2.0 * u[number] / U,
                    fmt="o",
                    ms=3,
                    lw=0.8,
                    color=COLOURS[number % len(COLOURS)],
                    label=f"run {number + 1}",
                )
        axes.set_ylim(len(names) - 0.4, -0.6)
        axes.set_yticks(range(len(names)), names, fontsize=7)
        axes.tick_params(axis="y", length=0)
        axes.set_xlabel("difference from the combined value / its U")
        axes.grid(axis="x")
        page.legend(loc="outside upper center", ncols=6)
        drawn = svg(page)
    shown = Picture(
        "The runs about their combined value",
        "Each sound run with a bar of two standard uncertainties; band: expanded uncertainty of the combined value. "
        "Bars that do not meet are changes from run to run, and widen the band.",
        drawn,
    )
    return [shown, correlation(estimate), budget(estimate)]
