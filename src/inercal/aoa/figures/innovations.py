"""Is a filter as good as it says, sensor by sensor: squared innovations over time, and whether they are white."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from inercal.arrays import Array
from inercal.report import innovations as white_noise
from inercal.report.html import Picture
from inercal.report.over_time import Marks, Panel, over_time

_BLOCKS = 400
"""Pieces of a record whose mean squared innovations are drawn."""


def of_innovations(
    t: Array, values: Array, names: Sequence[str], nis_mean: float, marks: Marks
) -> list[Picture]:
    """Innovations, ``values`` (n, k) of ``names`` over their standard deviations, NaN where not measured, over ``t``
    (n,) [s].

    ``nis_mean`` is the mean of their squares once settled. Nothing where there are none.
    """
    at = np.isfinite(values)
    if not at.any():
        return []
    starts = np.unique(np.linspace(0, len(t), min(_BLOCKS, len(t)), endpoint=False).astype(np.int64))
    squared = np.add.reduceat(np.where(at, values, 0.0) ** 2, starts, axis=0)
    count = np.add.reduceat(at.astype(float), starts, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        each, together = squared / count, squared.sum(axis=1) / count.sum(axis=1)
    middle = 0.5 * (t[starts] + t[np.append(starts[1:], len(t)) - 1])
    nis = over_time(
        "Normalised innovations squared",
        "What the sensors tell beyond what the filter expected, squared and over its variance (NIS): means over pieces "
        f"of {(t[-1] - t[0]) / len(starts):.2g} s. Over the record, once settled, {nis_mean:.3g}. Below 1 is normal "
        "where the filter allows for a sting that bends: about 0.25 for a rigid model, the gyro near 1, accelerometers "
        "far below. Above 2 the model does not hold: the sensor that stands out is the one to look at. Peaks are "
        "spikes, knocks, or lost rows."
        f"{marks.words}",
        middle,
        [
            Panel(
                "all",
                {"": together},
                "all sensors",
                levels={"1, as stated": 1.0, "2, inconsistent": 2.0},
                scale="log",
            ),
            Panel(
                "each", dict(zip(names, each.T, strict=True)), "each sensor", levels={"": 1.0}, scale="log"
            ),
        ],
        replace(marks, gaps=np.empty((0, 2))),
    )
    white = white_noise.innovations(t, values, names)
    return [
        nis,
        replace(
            white,
            caption="Left: reading less what the filter expected, over its standard deviation; least and greatest "
            "value of pieces of the record; strip: ± 2. Right: correlation with itself some rows later; strip: ± two "
            "standard deviations of white noise, red beyond. A filter that allows for flexure stays within the strip "
            "and leaves some correlation, also of a rigid model. Suspicious is what stays off zero (a bias beyond its "
            "prior) or swings with the motion (a lever arm, a sign, a delay).",
        ),
    ]
