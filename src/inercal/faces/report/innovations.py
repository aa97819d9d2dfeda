"""Pictures that ask whether a filter is as good as it says: innovations over time, and whether they are white."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from inercal.faces.report.cells import small
from inercal.faces.report.courses import times
from inercal.faces.report.html import Picture
from inercal.faces.report.marks import Area, Axis, Bars, Line, Mark, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.style import ALARM, COLOURS, QUIET, envelope
from inercal.foundation.arrays import Array

_WINDOW = 50
"""Rows of a running mean."""

_LAGS = 30
"""Rows by which innovations are shifted against each other."""

_BAND = 0.95
"""Probability of the bands."""


def nis(t: Array, values: Array, dims: NDArray[np.int64]) -> Picture:
    """Normalised innovations squared over time, as running means in their band.

    ``t`` (m,) [s], ``values`` (m,) NaN where nothing was measured, ``dims`` (m,) how many scalars each is of.
    """
    from scipy.special import chdtri

    finite = np.isfinite(values) & (dims > 0)
    t, values, dims = t[finite], np.clip(values[finite], 0.0, 1e12), dims[finite]
    window, tail = min(_WINDOW, len(values)), 0.5 * (1.0 - _BAND)
    title = "Normalised innovations squared"
    if not window:
        return draw(title, "Nothing was measured.", [[Panel((), Axis("time [s]"), Axis("NIS"))]], 2.4)
    ends = np.arange(0, len(values) - window + 1)
    run, many = (_running(x.astype(float), window) for x in (values, dims))
    middle = 0.5 * (t[ends] + t[ends + window - 1])
    # chdtri takes the probability of more
    low, high = chdtri(many, 1.0 - tail) / window, chdtri(many, tail) / window
    shown = np.unique(np.linspace(0, len(ends) - 1, min(len(ends), 200)).round().astype(np.int64))
    marks: list[Mark] = [
        Area(middle[shown], low[shown], high[shown], "95 % band", alpha=0.18),
        Line(*envelope(middle, run / window, 300), f"mean of {window} rows"),
        Line(middle[shown], many[shown] / window, "expected", QUIET, 0.7),
    ]
    scale: Literal["linear", "log"] = "log" if (run / window).max() > 5.0 * high.max() else "linear"
    total, mean = int(dims.sum()), float(values.mean())
    least, most = (float(chdtri(total, p)) / len(values) for p in (1.0 - tail, tail))
    verdict = "within" if least <= mean <= most else "above" if mean > most else "below"
    outside = float(np.mean((run < chdtri(many, 1.0 - tail)) | (run > chdtri(many, tail))))
    return draw(
        title,
        f"What each row tells beyond what the filter expected, squared and over its covariance (NIS), as the mean of "
        f"{window} rows, with the band in which 95 % of such means lie if model and noise are right; "
        f"{100.0 * outside:.0f} % of them lie outside. Over all {len(values)} rows the mean is {mean:.3f}, {verdict} "
        f"{least:.3f} to {most:.3f}, its own 95 % band about {total / len(values):.4g}. Above: noise or model are "
        "worse than stated; below: better.",
        [[Panel(marks, Axis("time [s]", margin=0.005), Axis("NIS", scale), grid="y")]],
        2.4,
    )


def _running(x: Array, window: int) -> Array:
    """Sums of so many neighbours."""
    total = np.concatenate([[0.0], np.cumsum(x)])
    return np.asarray(total[window:] - total[:-window])


def innovations(t: Array, values: Array, channels: Sequence[str]) -> Picture:
    """Normalised innovations (m, c) over ``t`` (m,) [s], and beside each channel its autocorrelation."""
    panels, beyond = list[Panel](), []
    for channel, own in zip(channels, values.T, strict=True):
        largest = float(np.max(np.abs(own), initial=0.0, where=np.isfinite(own)))
        top = max(4.0, 1.1 * min(largest, 1e6))
        over: list[Mark] = [
            Area(t[[0, -1]], [-2.0, -2.0], [2.0, 2.0]),
            Line(*envelope(t, own, 250), width=0.5),
        ]
        r, pairs = autocorrelation(own, _LAGS)
        limit = 2.0 / np.sqrt(np.maximum(pairs, 1))  # twice the standard deviation of white noise
        most = max(0.1, 1.1 * float(np.max(np.abs(r), initial=0.0)))
        lags, far = np.arange(1.0, len(r) + 1.0), np.abs(r) > limit
        beyond.append(f"{channel} {int(far.sum())}")
        shifted: list[Mark] = [Area(lags, -limit, limit)]
        for chosen, colour in ((~far, COLOURS[0]), (far, ALARM)):
            shifted.append(Bars(lags[chosen], 0.0 * r[chosen], r[chosen], "", colour, upright=True))
        heads = ("", "") if panels else ("innovation / its standard deviation", "autocorrelation")
        panels.append(Panel(over, times(t), Axis(channel, limits=(-top, top)), heads[0]))
        along = Axis("lag [rows]", limits=(0.0, _LAGS + 1.0))
        panels.append(Panel(shifted, along, Axis(limits=(-most, most)), heads[1]))
    return small(
        "Innovations and whether they are white",
        "Left: measurement less what the filter expected, over its standard deviation; least and greatest value of "
        "pieces of the recording; band: ± 2. Right: correlation with itself some rows later; band: ± two standard "
        f"deviations of white noise, red beyond. Of {_LAGS} lags one or two lie beyond by chance; many, or a slow "
        f"fall, show what the model lacks. Beyond: {', '.join(beyond)}.",
        panels,
        0.72,
        (4.05, 1.7),
        0.18,
    )


def autocorrelation(x: Array, lags: int) -> tuple[Array, NDArray[np.int64]]:
    """Correlation of ``x`` (n,) about zero with itself 1 to ``lags`` rows later, and the number of pairs of each.

    NaN are left out in pairs; 0 where there are no pairs.
    """
    finite = np.isfinite(x)
    values = np.where(finite, x, 0.0)
    power = float(np.mean(values[finite] ** 2)) if finite.any() else 1.0
    count = np.array(
        [int((finite[k:] & finite[: len(x) - k]).sum()) for k in range(1, min(lags, len(x) - 1) + 1)]
    )
    sums = np.array([float(values[k:] @ values[: len(x) - k]) for k in range(1, len(count) + 1)])
    return sums / np.maximum(count, 1) / (power or 1.0), count.astype(np.int64)
