"""The one picture that answers the question of a task, drawn on a figure: what a notebook shows first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from inercal.arrays import Array
from inercal.estimate.result import Estimate
from inercal.report.positions import hemispheres
from inercal.report.style import COLOURS, QUIET, WIDTH, envelope, few_powers, plain_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def coefficients(figure: Figure, estimate: Estimate) -> None:
    """Values of the coefficients with their expanded uncertainties U as bars, a panel for each kind of them."""
    groups: dict[tuple[str, str], list[int]] = {}
    for k, (name, unit) in enumerate(zip(estimate.names, estimate.units, strict=True)):
        groups.setdefault((name.rpartition("_")[0], unit), []).append(k)
    if not groups:
        nothing(figure, estimate.message)
        return
    rows = [len(group) + 1.2 for group in groups.values()]
    figure.set_size_inches(WIDTH, 0.3 + 0.17 * sum(rows) + 0.3 * len(groups))
    panels = figure.subplots(len(groups), 1, squeeze=False, height_ratios=rows)[:, 0]
    U = np.array([p.U for p in estimate.parameters.values()])
    for axes, ((_, unit), group) in zip(panels, groups.items(), strict=True):
        half = np.where(np.isfinite(U[group]), U[group], 0.0)
        at = np.arange(len(group))
        axes.errorbar(
            estimate.values[group],
            at,
            xerr=half,
            fmt="o",
            ms=3.5,
            color=COLOURS[0],
            ecolor=COLOURS[1],
            elinewidth=2.2,
        )
        axes.set_yticks(at, [estimate.names[k] for k in group])
        axes.set_ylim(len(group) - 0.4, -0.6)
        axes.set_xlabel("value ± U" if unit == "1" else f"value ± U [{plain_unit(unit)}]")
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="both")
        if axes.get_xlim()[0] < 0.0 < axes.get_xlim()[1]:
            axes.axvline(0.0, color=QUIET, lw=0.6)


def over_time(figure: Figure, t: Array, values: Array, u: Array, label: str, note: str) -> None:
    """A quantity (n,) over time [s] with its band of two standard uncertainties ``u`` (n,), and below it u alone.

    ``label`` is the quantity with its unit, ``note`` says the most important number of u.
    """
    above, below = figure.subplots(2, 1, sharex=True, height_ratios=(2.4, 1.0))
    low, high = values - 2.0 * u, values + 2.0 * u
    times, drawn = envelope(t, values)
    above.fill_between(times, envelope(t, low)[1], envelope(t, high)[1], color=COLOURS[0], alpha=0.2, lw=0)
    above.plot(times, drawn, color=COLOURS[0])
    above.set_ylabel(label)
    above.set_title(f"{label.split(' [')[0]}, with a band of ± 2 u", loc="left")
    below.set_yscale("log")
    below.plot(*envelope(t, np.where(u > 0.0, u, np.nan)), color=COLOURS[1])
    below.set_ylabel(f"u of {label}".replace(" [", "\n["))
    below.set_title(note, loc="left")
    below.set_xlabel("t [s]")
    if np.isfinite(u).any() and (u > 0.0).any():
        few_powers(below.yaxis)
    for axes in (above, below):
        axes.grid(axis="both")
        axes.margins(x=0.01)


def curves(figure: Figure, courses: Mapping[str, Mapping[str, tuple[Array, Array]]], xlabel: str) -> None:
    """Lines on logarithmic axes, a panel for each unit: ``courses[unit][name]`` are x (n,) and y (n,)."""
    panels = figure.subplots(1, len(courses), squeeze=False)[0]
    for axes, (unit, lines) in zip(panels, courses.items(), strict=True):
        axes.set_xscale("log")
        axes.set_yscale("log")
        for k, (name, (x, y)) in enumerate(lines.items()):
            axes.plot(x, np.where(y > 0.0, y, np.nan), color=COLOURS[k % len(COLOURS)], label=name)
        axes.set_xlabel(xlabel)
        axes.set_ylabel(plain_unit(unit))
        axes.grid(axis="both")
        axes.legend(ncols=1 if len(lines) < 5 else 2)
        if any(np.any(y > 0.0) for _, y in lines.values()):
            few_powers(axes.xaxis)
            few_powers(axes.yaxis)


def bars(figure: Figure, names: Sequence[str], parts: Mapping[str, Array], label: str) -> None:
    """Shares (n,) of named things beside each other, the largest first."""
    order = np.argsort(-np.nan_to_num(next(iter(parts.values()))), kind="stable")
    figure.set_size_inches(WIDTH, 0.8 + 0.22 * len(names))
    axes = figure.subplots()
    thick = 0.8 / len(parts)
    for k, (part, values) in enumerate(parts.items()):
        places = np.arange(len(names)) + thick * (k - 0.5 * (len(parts) - 1))
        axes.barh(places, values[order], height=thick, color=COLOURS[k], label=part)
    axes.set_yticks(np.arange(len(names)), [names[k] for k in order])
    axes.set_ylim(len(names) - 0.4, -0.6)
    axes.tick_params(axis="y", length=0)
    axes.set_xlabel(label)
    axes.grid(axis="x")
    axes.legend(loc="lower right")


def directions(figure: Figure, on_sphere: Array) -> None:
    """Directions (n, 3) of gravity on the axes of an instrument, on two hemispheres."""
    figure.set_size_inches(WIDTH, 3.4)
    hemispheres(figure.subplots(1, 2), on_sphere)


def angles(figure: Figure, t: Array, degrees: Array, names: Sequence[str]) -> None:
    """Angles (n, k) [deg] over time [s]."""
    axes: Axes = figure.subplots()
    for k, name in enumerate(names):
        axes.plot(t, degrees[:, k], color=COLOURS[k], label=name)
    axes.set_xlabel("t [s]")
    axes.set_ylabel("angle [°]")
    axes.grid(axis="both")
    axes.legend(ncols=len(names))


def nothing(figure: Figure, words: str) -> None:
    """Where there is nothing to draw, the reason."""
    figure.set_size_inches(WIDTH, 0.7)
    figure.text(0.02, 0.5, words, va="center", wrap=True)
