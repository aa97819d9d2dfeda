"""The figures of a temperature model: each quantity with its curve, and what the curve leaves over."""

from __future__ import annotations

import numpy as np

from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Area, Axis, Dots, Level, Line, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.style import COLOURS, INK, QUIET, plain_unit
from inercal.foundation.arrays import Array
from inercal.systems.imu.temperature.model import Curve, TemperatureModel

_POINTS = 1500
_WAYS = ((1, COLOURS[1], "rising"), (-1, COLOURS[0], "falling"), (0, QUIET, "steady"))


def pictures(model: TemperatureModel) -> list[Picture]:
    """One picture for the quantities of each sensor; none without curves."""
    groups: dict[str, list[Curve]] = {}
    for curve in model.curves:
        groups.setdefault(curve.name.rpartition("_")[0] or curve.name, []).append(curve)
    return [_group(curves) for curves in groups.values()]


def _group(curves: list[Curve]) -> Picture:
    """Quantities below each other, on the left with their cubics, on the right the residuals."""
    panels = []
    for number, curve in enumerate(curves):
        grid = np.linspace(curve.temperature.min(), curve.temperature.max(), 201)
        fitted, u = curve.polynomial.value(grid), curve.polynomial.u(grid)
        measured, left = _dots(curve, curve.values), _dots(curve, curve.polynomial.residuals)
        band = Area(grid, fitted - 2.0 * u, fitted + 2.0 * u, colour=INK)
        across = Axis("temperature [°C]" if number == len(curves) - 1 else "")
        heads = ("values and polynomial (band: ± 2 u)", "residuals") if number == 0 else ("", "")
        up = Axis(f"{curve.name}\n[{plain_unit(curve.unit)}]")
        panels.append(
            [
                Panel([*measured, Line(grid, fitted, "", INK, 1.0), band], across, up, heads[0], grid="both"),
                Panel([*left, Level(0.0, "", INK, 0.7)], across, Axis(), heads[1], grid="both"),
            ]
        )
    names = ", ".join(curve.name for curve in curves)
    return draw(
        f"{names} against temperature",
        "Left: what was measured while it got warmer and colder, and the polynomial through all of it with a band "
        "of two standard uncertainties. Right: what the polynomial leaves over; branches that part here are "
        "hysteresis or the lag of the thermometer.",
        panels,
        0.7 + 1.45 * len(curves),
    )


def _dots(curve: Curve, values: Array) -> list[Dots]:
    """Values (n,) over the temperature, by whether it rose or fell, with bars of ± 2 u where known."""
    some = slice(None, None, len(values) // _POINTS + 1)
    way = np.sign(curve.rising[some])
    dots = [
        Dots(curve.temperature[some][way == sign], values[some][way == sign], word, colour, ".", size)
        for sign, colour, word in _WAYS
        if (way == sign).any()
        for size in (2.4 if curve.u is None else 6.0,)
    ]
    if curve.u is None:
        return dots
    return [Dots(curve.temperature, values, colour=QUIET, shape="none", up=2.0 * curve.u), *dots]
