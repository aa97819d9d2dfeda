"""Pictures of a wind-tunnel model on its sting: places and errors of its sensors, its points."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inercal.faces.report.coefficients import limits
from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Area, Arrows, Axis, Dots, Level, Line, Mark, Note, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.style import COLOURS, INK, QUIET, plain_unit
from inercal.foundation.arrays import Array
from inercal.foundation.inference.identifiability import UNSEEN
from inercal.foundation.results.shown import rounded
from inercal.systems.aoa.limits import LIMITS

_USUAL = (5e-3, 5.0)
"""Distances [m] of the outermost sensor from the pivot that models in wind tunnels have."""

_ARROW = 0.17
"""Length of an arrow, of the distance of the outermost sensor."""


def side_view(
    names: Sequence[str],
    angle: Array,
    r: Array,
    z: Array,
    gyro: bool,
    title: str = "Where the sensors are",
) -> Picture:
    """Accelerometers (N,) of a model from its right side: ``angle`` lambda [rad] of their axes, from forward towards
    down, and positions ``r`` ahead of the pivot and ``z`` above it [m]."""
    reach = float(np.max(np.hypot(r, z), initial=0.0))
    shown = 1e3 * (reach or 1.0)
    forward, up = 1e3 * r, 1e3 * z
    turn = np.linspace(0.0, 2.0 * np.pi, 60)
    nose, tail = 1.25 * shown, -1.15 * shown
    along = 0.5 * (nose + tail) + 0.5 * (nose - tail) * np.cos(turn)
    girth = (0.13 + float(np.max(np.abs(up), initial=0.0)) / shown) * shown * np.sin(turn)
    colours = [COLOURS[k % len(COLOURS)] for k in range(len(names))]
    marks: list[Mark] = [
        Area(along[:31], -girth[:31], girth[:31], alpha=0.08),
        Line([1.6 * tail, 0.0], [0.0, 0.0], "", "#D0D4D7", 4.0),
        Dots([0.0], [0.0], "", INK, "+", 11.0),
        Note((0.0, 0.0), "pivot", INK, 7.0, "center", "bottom", (0.0, -13.0)),
        Arrows(forward, up, _ARROW * shown * np.cos(angle), -_ARROW * shown * np.sin(angle), colours),
    ]
    for k, (name, lam, colour) in enumerate(zip(names, angle, colours, strict=True)):
        away = (0.0, -12.0) if np.sin(lam) < 0.5 else (0.0, 6.0)  # from the arrow
        place = f"{name}   r {forward[k]:.6g} mm, z {up[k]:.6g} mm, axis {np.degrees(lam):.5g}°"
        place = place.replace("-", "−")
        marks += [
            Dots(forward[k : k + 1], up[k : k + 1], "", colour, size=5.8),
            Note((forward[k], up[k]), name, colour, 7.5, "center", "bottom", away, bold=True),
            Note((1.02, 0.98 - 0.1 * k), place, colour, 7.5, va="top", of_panel="xy", bold=True),
        ]
    if gyro:
        swing = np.linspace(-0.45, 0.45, 20)
        x, y = 1.36 * shown * np.cos(swing), 1.36 * shown * np.sin(swing)
        tip = np.array([x[-1] - x[-3], y[-1] - y[-3]])
        marks += [
            Line(x, y, "", INK, 1.0),
            Arrows(x[-1:], y[-1:], tip[:1], tip[1:], [INK], 0.004),
            Note((x[10], y[10]), "nose up: +", size=7.0, va="center", shift=(4.0, 0.0)),
        ]
    axes = (
        Axis("r, ahead of the pivot [mm]", limits=(1.5 * tail, 1.9 * shown)),
        Axis("z, above it [mm]", limits=(-0.66 * shown, 0.66 * shown)),
    )
    far = f" The outermost is {reach:.4g} m from the pivot, which no usual model has: are the units right?"
    doubt = "" if reach == 0.0 or _USUAL[0] <= reach <= _USUAL[1] else far
    return draw(
        title,
        "The model from its right side, to scale, as the study states it: each accelerometer with an arrow along "
        "which it reads plus; at the right its place and the angle of its axis, from forward towards down. Compare "
        "with the drawing of the model: a wrong unit, swapped sensors or an axis that looks the other way show here "
        f"first.{doubt}",
        [[Panel(marks, *axes, grid="both", equal=True)]],
        2.2,
    )


def learned(
    names: Sequence[str], units: Sequence[str], values: Array, u: Array, start: Array, prior: Array
) -> Picture:
    """Coefficients (p,) with their ``u`` (p,), as differences from ``start`` (p,) over their ``prior`` standard
    deviations (p,); all in ``units``."""
    with np.errstate(divide="ignore", invalid="ignore"):
        moved, left = (values - start) / prior, u / prior
    sound = np.isfinite(moved) & np.isfinite(left) & (np.abs(moved) < 1e9)
    moved, left = np.where(sound, moved, np.nan), np.where(sound, left, np.nan)
    notes = [
        "{} ± {} {}".format(*(rounded(float(value), float(own))[:2] if good else "––"), plain_unit(unit))
        for value, own, unit, good in zip(values, u, units, sound, strict=True)
    ]
    kept = [name for name, part in zip(names, left, strict=True) if part > UNSEEN]
    seen = f" Left at their priors: {', '.join(kept)}." if kept else ""
    return limits(
        "What was learned of the sensors",
        "Each coefficient at the end, with a bar of ± two standard uncertainties, over the standard deviation of its "
        "prior, ± 2 of which are the blue strip; at the right with its standard uncertainty u. A short bar was "
        f"learned from this record; one as wide as the strip was not. Red, beyond 3: the prior is too narrow.{seen}",
        names,
        moved,
        2.0 * left,
        "difference from the prior / its standard deviation",
        2.0,
        np.abs(moved) > LIMITS.prior_sigmas,
        notes,
    )


def fitted(
    names: Sequence[str], kinds: Sequence[str], values: Array, u: Array, seen: NDArray[np.bool_]
) -> Picture:
    """Errors of sensors that were fitted to a reference angle: ``values``, ``u`` and whether they were ``seen``, a row
    for each of ``kinds``, names with units, and a column for each of ``names``."""
    places, panels = np.arange(len(names)), []
    for kind, value, own, identified in zip(kinds, values, u, seen, strict=True):
        marks: list[Mark] = [Level(0.0)]
        for chosen, colour, filled in ((identified, COLOURS[0], True), (~identified, QUIET, False)):
            bar = 2.0 * own[chosen]
            marks.append(Dots(places[chosen], value[chosen], "", colour, "o", 3.5, filled, up=bar))
        panels.append(Panel(marks, Axis(names=names), Axis(), kind, grid="y"))
    return draw(
        "Sensors against the reference angle",
        "Error of each accelerometer as the reference angle shows it, with bars of ± two standard uncertainties. Grey: "
        "not seen in this record, the bar is what was assumed before. An axis that is off by 0.1 mrad turns the angle "
        "by 0.0057°, which no sensor of the model shows.",
        [panels],
        1.7,
    )


def points(theta: Array, u: Array, left: Array, scatter: Array, error: Array | None = None) -> Picture:
    """Means ``theta`` (k,) of points at rest with their ``u``, that ``left`` by noise and motion alone, and the
    ``scatter`` of samples (k,), and their ``error`` (k,) where a reference is known; all in degrees."""
    marks: list[Mark] = []
    for label, values, shape, colour in (
        ("scatter of the samples", scatter, "s", COLOURS[1]),
        ("u of the mean", u, "o", COLOURS[0]),
        ("part of noise and motion", left, "_", INK),
    ):
        good = np.isfinite(theta) & (values > 0.0) & np.isfinite(values)
        marks.append(Dots(theta[good], values[good], label, colour, shape, filled=shape == "o"))
    across = Axis("mean angle [°]")
    panels = [Panel(marks, across, Axis("[°]", "log"), grid="both")]
    if error is not None:
        good = np.isfinite(theta) & np.isfinite(error) & np.isfinite(u)
        off = Dots(theta[good], error[good], size=3.5, up=2.0 * u[good])
        panels.append(Panel([Level(0.0), off], across, Axis("mean less reference [°]"), grid="both"))
    right = " Right: means less the reference, with bars of ± two standard uncertainties."
    against = "" if error is None else right
    return draw(
        "Points",
        f"Standard uncertainty of the mean angle of each point at rest, {len(theta)} in all, and the standard "
        "deviation of the samples about it. A scatter far above that of the other points is motion or vibration of the "
        "model. What noise and motion leave in the mean falls with its length; the rest of u, as of biases, does not."
        f"{against}",
        [panels],
        2.3,
        where="left",
    )


def side_by_side(names: Sequence[str], largest: Array, rms: Array, what: str) -> Picture:
    """The largest and the root mean square of ``what`` (k,) [rad] of methods by their names."""
    rows, most, usual = np.arange(len(names)), np.degrees(largest), np.degrees(rms)
    marks = [
        Dots(np.where(values > 0.0, values, np.nan), rows, label, COLOURS[k], "os"[k], filled=k == 0)
        for k, (label, values) in ((1, ("largest", most)), (0, ("rms", usual)))
    ]
    notes = [
        f"{a:.2g} / {b:.2g}°" if np.isfinite(a) and np.isfinite(b) else "none"
        for a, b in zip(most, usual, strict=True)
    ]
    return draw(
        "Methods side by side",
        f"Size of the {what} of each method after the first 2 s, largest and root mean square, also in numbers at the "
        "right. All have the same record.",
        [[Panel(marks, Axis(f"{what} [°]", "log"), Axis(names=names), notes=notes, grid="both")]],
        0.75 + 0.19 * len(names),
        2,
        "center",
    )
