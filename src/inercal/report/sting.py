"""Pictures of a wind-tunnel model on its sting: where its sensors are, what was learned of them, its points."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array
from inercal.estimate.rounding import rounded
from inercal.report.html import Picture
from inercal.report.style import ALARM, COLOURS, INK, QUIET, WIDTH, few_powers, figure, plain_unit, svg

_USUAL = (5e-3, 5.0)
"""Distances [m] of the outermost sensor from the pivot that models in wind tunnels have."""

_ARROW = 0.17
"""Length of an arrow, of the distance of the outermost sensor."""


def side_view(names: Sequence[str], angle: Array, r: Array, z: Array, gyro: bool) -> Picture:
    """Accelerometers (N,) of a model from its right side: ``angle`` lambda [rad] of their axes, from forward towards
    down, and positions ``r`` ahead of the pivot and ``z`` above it [m]."""
    reach = float(np.max(np.hypot(r, z), initial=0.0))
    shown = 1e3 * (reach or 1.0)
    forward, up = 1e3 * r, 1e3 * z
    with figure(WIDTH, 2.2) as page:
        axes = page.subplots()
        turn = np.linspace(0.0, 2.0 * np.pi, 60)
        nose, tail = 1.25 * shown, -1.15 * shown
        along = 0.5 * (nose + tail) + 0.5 * (nose - tail) * np.cos(turn)
        girth = 0.13 + float(np.max(np.abs(up), initial=0.0)) / shown
        axes.fill(along, girth * shown * np.sin(turn), color=COLOURS[0], alpha=0.08, lw=0)
        axes.plot([1.6 * tail, 0.0], [0.0, 0.0], color=QUIET, lw=4.0, alpha=0.4, solid_capstyle="butt")
        axes.plot([0.0], [0.0], "+", color=INK, ms=11, mew=1.4)
        axes.annotate("pivot", (0.0, 0.0), (0, -13), textcoords="offset points", fontsize=7, ha="center")
        colours = [COLOURS[k % len(COLOURS)] for k in range(len(names))]
        axes.quiver(
            forward, up, np.cos(angle), -np.sin(angle), color=colours, angles="xy", scale_units="xy",
            scale=1.0 / (_ARROW * shown), width=0.005, zorder=3,
        )  # fmt: skip
        axes.scatter(forward, up, 34, c=colours, zorder=3)
        for k, (name, lam, colour) in enumerate(zip(names, angle, colours, strict=True)):
            away = (0, -12) if np.sin(lam) < 0.5 else (0, 6)  # from the arrow
            look: dict[str, Any] = {"fontsize": 7.5, "color": colour, "fontweight": "bold"}
            axes.annotate(name, (forward[k], up[k]), away, textcoords="offset points", ha="center", **look)
            told = f"{name}   r {forward[k]:.6g} mm, z {up[k]:.6g} mm, axis {np.degrees(lam):.5g}°".replace(
                "-", "−"
            )
            axes.text(1.02, 0.98 - 0.1 * k, told, transform=axes.transAxes, va="top", **look)
        if gyro:
            swing = np.linspace(-0.45, 0.45, 20)
            x, y = 1.36 * shown * np.cos(swing), 1.36 * shown * np.sin(swing)
            axes.plot(x, y, color=INK, lw=1.0)
            axes.plot(x[-1:], y[-1:], marker=(3, 0, 25.0), color=INK, ms=7)
            axes.annotate(
                "nose up: +", (x[10], y[10]), (4, 0), textcoords="offset points", fontsize=7, va="center"
            )
        axes.set_aspect("equal")
        axes.set_xlim(1.5 * tail, 1.9 * shown)
        axes.set_ylim(-0.66 * shown, 0.66 * shown)
        axes.set_xlabel("r, ahead of the pivot [mm]")
        axes.set_ylabel("z, above it [mm]")
        axes.grid(axis="both")
        drawn = svg(page)
    doubt = ""
    if reach > 0.0 and not _USUAL[0] <= reach <= _USUAL[1]:
        doubt = (
            f" The outermost is {reach:.4g} m from the pivot, which no usual model has: are the units right?"
        )
    return Picture(
        "Where the sensors are",
        "The model from its right side, to scale, as the study states it: each accelerometer with an arrow along "
        "which it reads plus; at the right its place and the angle of its axis, from forward towards down. Compare "
        "with the drawing of the model: a wrong unit, swapped sensors or an axis that looks the other way show here "
        f"first.{doubt}",
        drawn,
    )


def learned(
    names: Sequence[str], units: Sequence[str], values: Array, u: Array, start: Array, prior: Array
) -> Picture:
    """Coefficients (p,) with their ``u`` (p,), as differences from ``start`` (p,) over their ``prior`` standard
    deviations (p,); all in ``units``."""
    places = np.arange(len(names))
    with np.errstate(divide="ignore", invalid="ignore"):
        moved, left = (values - start) / prior, u / prior
    sound = np.isfinite(moved) & np.isfinite(left) & (np.abs(moved) < 1e9)
    moved, left = np.where(sound, moved, np.nan), np.where(sound, left, np.nan)
    with figure(WIDTH, 0.7 + 0.17 * len(names)) as page:
        axes = page.subplots()
        axes.axvspan(-2.0, 2.0, color=COLOURS[0], alpha=0.1, lw=0)
        axes.axvline(0.0, color=QUIET, lw=0.6)
        far = np.abs(moved) > 3.0
        for chosen, colour in ((sound & ~far, COLOURS[0]), (sound & far, ALARM)):
            axes.errorbar(
                moved[chosen], places[chosen], xerr=2.0 * left[chosen], fmt="o", ms=3.5, lw=1.1, color=colour
            )
        for k, (value, own, unit) in enumerate(zip(values, u, units, strict=True)):
            told = rounded(float(value), float(own)) if sound[k] else ("–", "–")
            axes.text(
                1.01, k, f"{told[0]} ± {told[1]} {plain_unit(unit)}", transform=axes.get_yaxis_transform(),
                fontsize=6.5, va="center_baseline",
            )  # fmt: skip
        axes.set_yticks(places, names, fontsize=7)
        axes.set_ylim(len(names) - 0.4, -0.6)
        widest = float(np.nanmax(np.abs(moved) + 2.0 * left, initial=2.5, where=sound))
        axes.set_xlim(-1.08 * widest, 1.08 * widest)
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="x")
        axes.set_xlabel("difference from the prior / its standard deviation")
        drawn = svg(page)
    kept = [name for name, part in zip(names, left, strict=True) if part > 0.9]
    seen = f" Left at their priors: {', '.join(kept)}." if kept else ""
    return Picture(
        "What was learned of the sensors",
        "Each coefficient at the end, with a bar of ± two standard uncertainties, over the standard deviation of its "
        "prior, ± 2 of which are the blue strip; at the right with its standard uncertainty u. A short bar was "
        f"learned from this record; one as wide as the strip was not. Red, beyond 3: the prior is too narrow.{seen}",
        drawn,
    )


def fitted(
    names: Sequence[str], kinds: Sequence[str], values: Array, u: Array, seen: NDArray[np.bool_]
) -> Picture:
    """Errors of sensors that were fitted to a reference angle: ``values``, ``u`` and whether they were ``seen``, a row
    for each of ``kinds``, names with units, and a column for each of ``names``."""
    places = np.arange(len(names))
    with figure(WIDTH, 1.7) as page:
        panels = page.subplots(1, len(kinds), squeeze=False)[0]
        for axes, kind, value, own, told in zip(panels, kinds, values, u, seen, strict=True):
            axes.axhline(0.0, color=QUIET, lw=0.6)
            for chosen, colour, fill in ((told, COLOURS[0], COLOURS[0]), (~told, QUIET, "none")):
                axes.errorbar(
                    places[chosen], value[chosen], yerr=2.0 * own[chosen], fmt="o", ms=3.5, lw=1.1, color=colour,
                    mfc=fill,
                )  # fmt: skip
            axes.set_xticks(places, names, fontsize=7)
            axes.set_xlim(-0.6, len(names) - 0.4)
            axes.set_title(kind, fontsize=7.5)
            axes.grid(axis="y")
        drawn = svg(page)
    return Picture(
        "Sensors against the reference angle",
        "Error of each accelerometer as the reference angle shows it, with bars of ± two standard uncertainties. Grey: "
        "not seen in this record, the bar is what was assumed before. An axis that is off by 0.1 mrad turns the angle "
        "by 0.0057°, which no sensor of the model shows.",
        drawn,
    )


def points(theta: Array, u: Array, left: Array, scatter: Array, error: Array | None = None) -> Picture:
    """Means ``theta`` (k,) of points at rest with their ``u``, that ``left`` by noise and motion alone, and the
    ``scatter`` of samples (k,), and their ``error`` (k,) where a reference is known; all in degrees."""
    with figure(WIDTH, 2.3) as page:
        panels = page.subplots(1, 1 if error is None else 2, squeeze=False)[0]
        axes = panels[0]
        axes.set_yscale("log")
        for label, values, mark, fill in (
            ("scatter of the samples", scatter, "s", "none"),
            ("u of the mean", u, "o", COLOURS[0]),
            ("part of noise and motion", left, "_", "none"),
        ):
            good = np.isfinite(theta) & (values > 0.0) & np.isfinite(values)
            colour = {"s": COLOURS[1], "o": COLOURS[0], "_": INK}[mark]
            axes.plot(theta[good], values[good], mark, color=colour, mfc=fill, label=label)
        axes.set_xlabel("mean angle [°]")
        axes.set_ylabel("[°]")
        few_powers(axes.yaxis)
        axes.minorticks_off()
        axes.grid(axis="both")
        if error is not None:
            good = np.isfinite(theta) & np.isfinite(error) & np.isfinite(u)
            panels[1].axhline(0.0, color=QUIET, lw=0.6)
            panels[1].errorbar(
                theta[good], error[good], yerr=2.0 * u[good], fmt="o", ms=3.5, lw=1.0, color=COLOURS[0]
            )
            panels[1].set_xlabel("mean angle [°]")
            panels[1].set_ylabel("mean less reference [°]")
            panels[1].grid(axis="both")
        page.legend(*axes.get_legend_handles_labels(), loc="outside upper left", ncols=3)
        drawn = svg(page)
    against = (
        " Right: means less the reference, with bars of ± two standard uncertainties."
        if error is not None
        else ""
    )
    return Picture(
        "Points",
        f"Standard uncertainty of the mean angle of each point at rest, {len(theta)} in all, and the standard "
        "deviation of the samples about it. A scatter far above that of the other points is motion or vibration of the "
        "model. What noise and motion leave in the mean falls with its length; the rest of u, as of biases, does not."
        f"{against}",
        drawn,
    )


def side_by_side(names: Sequence[str], largest: Array, rms: Array, what: str) -> Picture:
    """The largest and the root mean square of ``what`` (k,) [rad] of methods by their names."""
    places = np.arange(len(names))
    with figure(WIDTH, 0.75 + 0.19 * len(names)) as page:
        axes = page.subplots()
        axes.set_xscale("log")
        for label, values, mark, fill in (("largest", largest, "s", "none"), ("rms", rms, "o", COLOURS[0])):
            shown = np.where(np.isfinite(values) & (values > 0.0), np.degrees(values), np.nan)
            axes.plot(shown, places, mark, color=COLOURS[mark == "s"], mfc=fill, mew=1.1, label=label)
        for k, (most, usual) in enumerate(zip(np.degrees(largest), np.degrees(rms), strict=True)):
            text = f"{most:.2g} / {usual:.2g}°" if np.isfinite(most) and np.isfinite(usual) else "none"
            axes.text(1.01, k, text, transform=axes.get_yaxis_transform(), fontsize=6.5, va="center_baseline")
        axes.set_yticks(places, names, fontsize=7)
        axes.set_ylim(len(names) - 0.5, -0.5)
        axes.tick_params(axis="y", length=0)
        axes.grid(axis="both")
        few_powers(axes.xaxis)
        axes.minorticks_off()
        axes.set_xlabel(f"{what} [°]")
        page.legend(loc="outside upper center", ncols=2)
        drawn = svg(page)
    return Picture(
        "Methods side by side",
        f"Size of the {what} of each method after the first 2 s, largest and root mean square, also in numbers at the "
        "right. All have the same record.",
        drawn,
    )
