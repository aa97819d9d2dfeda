"""The figures of a temperature model: each quantity with its curve, and what the curve leaves over."""

from __future__ import annotations

import numpy as np

from inercal.imu.temperature.model import Curve, TemperatureModel
from inercal.report.html import Picture
from inercal.report.style import COLOURS, INK, QUIET, WIDTH, figure, plain_unit, svg

_POINTS = 1500


def pictures(model: TemperatureModel) -> list[Picture]:
    """One picture for the quantities of each sensor; none without curves."""
    groups: dict[str, list[Curve]] = {}
    for curve in model.curves:
        groups.setdefault(curve.name.rpartition("_")[0] or curve.name, []).append(curve)
    return [_group(curves) for curves in groups.values()]


def _group(curves: list[Curve]) -> Picture:
    """Quantities below each other, on the left with their cubics, on the right the residuals."""
    with figure(WIDTH, 0.7 + 1.45 * len(curves)) as page:
        panels = page.subplots(len(curves), 2, sharex=True, squeeze=False)
        for row, curve in zip(panels, curves, strict=True):
            grid = np.linspace(curve.temperature.min(), curve.temperature.max(), 201)
            fitted, u = curve.cubic.value(grid), curve.cubic.u(grid)
            some = slice(None, None, len(curve.values) // _POINTS + 1)
            for panel, values in zip(row, (curve.values, curve.cubic.residuals), strict=True):
                for sign, colour, word in (
                    (1, COLOURS[1], "rising"),
                    (-1, COLOURS[0], "falling"),
                    (0, QUIET, "steady"),
                ):
                    here = np.sign(curve.rising[some]) == sign
                    if here.any():
                        size = 1.2 if curve.u is None else 4.0
                        panel.plot(
                            curve.temperature[some][here],
                            values[some][here],
                            ".",
                            color=colour,
                            ms=size,
                            label=word,
                        )
                panel.grid(True)
            if curve.u is not None:
                for panel, values in zip(row, (curve.values, curve.cubic.residuals), strict=True):
                    panel.errorbar(curve.temperature, values, 2.0 * curve.u, fmt="none", ecolor=QUIET, lw=0.7)
            row[0].plot(grid, fitted, color=INK, lw=1.0)
            row[0].fill_between(grid, fitted - 2 * u, fitted + 2 * u, color=INK, alpha=0.15, lw=0)
            row[1].axhline(0.0, color=INK, lw=0.7)
            row[0].set_ylabel(f"{curve.name}\n[{plain_unit(curve.unit)}]")
        panels[0, 0].set_title("values and polynomial (band: ± 2 u)")
        panels[0, 1].set_title("residuals")
        panels[0, 0].legend(loc="best", markerscale=4)
        for panel in panels[-1]:
            panel.set_xlabel("temperature [°C]")
        names = ", ".join(curve.name for curve in curves)
        return Picture(
            f"{names} against temperature",
            "Left: what was measured while it got warmer and colder, and the polynomial through all of it with a band "
            "of two standard uncertainties. Right: what the polynomial leaves over; branches that part here are "
            "hysteresis or the lag of the thermometer.",
            svg(page),
        )
