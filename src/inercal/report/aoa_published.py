"""The figures of Tan et al. 2021 in their arrangement: angle errors that lever arms and mechanisations leave."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from inercal.report.html import Picture
from inercal.report.style import COLOURS, QUIET, WIDTH, envelope, few_powers, figure, svg

Array = NDArray[np.float64]


_SPAN = 1e-5
"""Part of its highest value down to which a logarithmic axis reaches: an error that changes sign has no lowest."""


@dataclass(frozen=True, eq=False)
class Curves:
    """Angle errors (n,) [rad] by name, over ``along`` (n,): a time [s], or an angle [rad] where ``sweep``."""

    title: str
    along: Array
    errors: Mapping[str, Array]
    sweep: bool = False
    scale: Literal["linear", "log"] = "linear"


def lever_arm_untreated(panel: Curves, conditions: str) -> Picture:
    """Figure 3: the angle error of a lever arm that nothing is done about, over time."""
    return _curves(
        "Figure 3: angle error from an untreated lever arm",
        "What the specific force at a sensor away from the pivot costs in angle if it is taken for gravity. "
        f"{conditions}",
        [panel],
    )


def centrifugal_residual(micro: Curves, large: Curves, conditions: str) -> Picture:
    """Figure 10: what low pass and mechanical compensation leave of the centrifugal term, small and large motion."""
    return _curves(
        "Figure 10: angle error from the centrifugal term, low pass and mechanical compensation",
        "Left, motion so slow that the gyro's error is larger than the motion: the low pass leaves less. Right, large "
        "motion: compensation with the gyro leaves less, the low pass keeps the mean of the centrifugal term. "
        f"{conditions}",
        [micro, large],
    )


def tangential_residual(micro: Curves, large: Curves, conditions: str) -> Picture:
    """Figure 11: what is left of the tangential term untreated, with the gyro's derivative, with two accelerometers."""
    return _curves(
        "Figure 11: angle error from the tangential term, untreated, differentiated gyro, dual accelerometer",
        "The derivative of the gyro multiplies its noise by the sample rate; two accelerometers on one axis measure "
        f"the angular acceleration itself. {conditions}",
        [micro, large],
    )


def static_methods(sweep: Curves, oscillation: Curves, conditions: str) -> Picture:
    """Figure 12: absolute angle error of the complementary and the improved mechanisation."""
    return _curves(
        "Figure 12: absolute angle error, complementary and improved mechanisation",
        "Left over a static sweep, right over an oscillation. With equal errors of its two axes the complementary "
        "pair reaches √2 times what the improved choice of pairs never exceeds. " + conditions,
        [sweep, oscillation],
    )


def _curves(title: str, caption: str, panels: Sequence[Curves]) -> Picture:
    """Panels side by side, each with its own axes and legend; on a logarithmic axis sizes of the errors."""
    with figure(WIDTH, 2.6) as page:
        for axes, panel in zip(page.subplots(1, len(panels), squeeze=False)[0], panels, strict=True):
            log = panel.scale == "log"
            if log:
                axes.set_yscale("log")
            else:
                axes.axhline(0.0, color=QUIET, lw=0.6)
            along = np.degrees(panel.along) if panel.sweep else panel.along
            for k, (name, errors) in enumerate(panel.errors.items()):
                shown = np.degrees(np.abs(errors) if log else errors)
                shown = np.where(shown > 0.0, shown, np.nan) if log else shown
                axes.plot(*envelope(along, shown, 1000), color=COLOURS[k % len(COLOURS)], lw=0.9, label=name)
            axes.set_xlabel("angle of attack [°]" if panel.sweep else "time [s]")
            axes.set_ylabel("size of the angle error [°]" if log else "angle error [°]")
            axes.set_title(panel.title)
            axes.margins(x=0.01)
            axes.grid(axis="y")
            if log:
                low, high = axes.get_ylim()
                axes.set_ylim(max(low, high * _SPAN), high)
                few_powers(axes.yaxis)
                axes.minorticks_off()
            axes.legend(loc="upper center", bbox_to_anchor=(0.5, -0.22), ncols=2)
        drawn = svg(page)
    return Picture(title, caption, drawn)
