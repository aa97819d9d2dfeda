"""The figures that any estimate has: the correlation of its coefficients and where their uncertainty comes from."""

from __future__ import annotations

import numpy as np

from inercal.estimate.result import Estimate
from inercal.report.html import Picture
from inercal.report.style import COLOURS, DIVERGING, INK, WIDTH, figure, svg


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
        page.colorbar(mesh, ax=axes, shrink=0.6, label="correlation coefficient")
        drawn = svg(page)
    return Picture(
        "Correlation of the coefficients",
        "Correlation coefficients of the estimates; those of 0.3 and more are written in hundredths.",
        drawn,
    )


def budget(estimate: Estimate) -> Picture:
    """The share of each source of the budget in the variance of each coefficient."""
    names = estimate.names
    left = np.zeros(len(names))
    with figure(WIDTH, 0.9 + 0.155 * len(names)) as page:
        axes = page.subplots()
        for k, item in enumerate(estimate.budget):
            share = 100.0 * np.array([item.share.get(name, 0.0) for name in names])
            axes.barh(
                names,
                share,
                left=left,
                height=0.75,
                color=COLOURS[k % len(COLOURS)],
                label=f"{item.source} ({item.type})",
            )
            left += share
        axes.set_ylim(len(names) - 0.4, -0.6)
        axes.set_xlim(0.0, 100.0)
        axes.set_xlabel("share of the variance [%]")
        axes.tick_params(axis="y", length=0, labelsize=7)
        page.legend(loc="outside upper center", ncols=3)
        drawn = svg(page)
    return Picture(
        "Where the uncertainty comes from",
        "Share of each source in the variance u² of each coefficient; in brackets whether it was evaluated from the "
        "scatter of the data (type A) or is known from elsewhere (type B).",
        drawn,
    )
