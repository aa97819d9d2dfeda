"""Pictures that ask whether a filter is as good as it says: innovations, and campaigns of simulated runs."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array
from inercal.estimate.coverage import Coverage
from inercal.report.cells import Cell, band, canvas, frame, line
from inercal.report.html import Picture
from inercal.report.style import ALARM, COLOURS, INK, QUIET, WIDTH, envelope, few_powers, figure, svg

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

    known = np.isfinite(values) & (dims > 0)
    t, values, dims = t[known], np.clip(values[known], 0.0, 1e12), dims[known]
    window, tail = min(_WINDOW, len(values)), 0.5 * (1.0 - _BAND)
    with figure(WIDTH, 2.4) as page:
        axes = page.subplots()
        if window:
            ends = np.arange(0, len(values) - window + 1)
            run, many = (_running(x.astype(float), window) for x in (values, dims))
            middle = 0.5 * (t[ends] + t[ends + window - 1])
            # chdtri takes the probability of more
            low, high = chdtri(many, 1.0 - tail) / window, chdtri(many, tail) / window
            shown = np.unique(np.linspace(0, len(ends) - 1, min(len(ends), 200)).round().astype(np.int64))
            axes.fill_between(
                middle[shown], low[shown], high[shown], color=COLOURS[0], alpha=0.18, lw=0, label="95 % band"
            )
            axes.plot(*envelope(middle, run / window, 300), color=COLOURS[0], label=f"mean of {window} rows")
            axes.plot(middle[shown], many[shown] / window, color=QUIET, lw=0.7, label="expected")
            if (run / window).max() > 5.0 * high.max():
                axes.set_yscale("log")
                few_powers(axes.yaxis, 5)
        axes.set_xlabel("time [s]")
        axes.set_ylabel("NIS")
        axes.margins(x=0.005)
        axes.grid(axis="y")
        if window:
            page.legend(loc="outside upper right", ncols=3)
        drawn = svg(page)
    if not window:
        return Picture("Normalised innovations squared", "Nothing was measured.", drawn)
    total, mean = int(dims.sum()), float(values.mean())
    least, most = (float(chdtri(total, p)) / len(values) for p in (1.0 - tail, tail))
    verdict = "within" if least <= mean <= most else "above" if mean > most else "below"
    outside = float(np.mean((run < chdtri(many, 1.0 - tail)) | (run > chdtri(many, tail))))
    return Picture(
        "Normalised innovations squared",
        f"What each row tells beyond what the filter expected, squared and over its covariance (NIS), as the mean of "
        f"{window} rows, with the band in which 95 % of such means lie if model and noise are right; "
        f"{100.0 * outside:.0f} % of them lie outside. Over all {len(values)} rows the mean is {mean:.3f}, {verdict} "
        f"{least:.3f} to {most:.3f}, its own 95 % band about {total / len(values):.4g}. Above: noise or model are "
        "worse than stated; below: better.",
        drawn,
    )


def _running(x: Array, window: int) -> Array:
    """Sums of so many neighbours."""
    total = np.concatenate([[0.0], np.cumsum(x)])
    return np.asarray(total[window:] - total[:-window])


def innovations(t: Array, values: Array, channels: Sequence[str]) -> Picture:
    """Normalised innovations (m, c) over ``t`` (m,) [s], and beside each channel its autocorrelation."""
    height, gap, beyond = 0.72, 0.14, []
    total = 0.52 + len(channels) * (height + gap)
    times, rows = (float(t[0]), float(t[-1])), (0.0, _LAGS + 1.0)
    with canvas(WIDTH, total) as (page, axes):
        for k, (channel, own) in enumerate(zip(channels, values.T, strict=True)):
            bottom, last = total - 0.22 - (k + 1) * (height + gap) + gap, k == len(channels) - 1
            largest = float(np.max(np.abs(own), initial=0.0, where=np.isfinite(own)))
            top = max(4.0, 1.1 * min(largest, 1e6))
            left = Cell(0.65, bottom, 4.05, height, times, (-top, top))
            head = ("innovation / its standard deviation", "autocorrelation") if k == 0 else ("", "")
            frame(axes, left, head[0], last, channel)
            band(axes, left, t[[0, -1]], np.full(2, -2.0), np.full(2, 2.0), color=COLOURS[0], alpha=0.15)
            line(axes, left, *envelope(t, own, 250), color=COLOURS[0], lw=0.5)
            r, pairs = autocorrelation(own, _LAGS)
            limit = 2.0 / np.sqrt(np.maximum(pairs, 1))  # twice the standard deviation of white noise
            most = max(0.1, 1.1 * float(np.max(np.abs(r), initial=0.0)))
            right = Cell(5.3, bottom, 1.7, height, rows, (-most, most))
            frame(axes, right, head[1], last)
            lags = np.arange(1.0, len(r) + 1.0)
            band(axes, right, lags, -limit, limit, color=COLOURS[0], alpha=0.15)
            far = np.abs(r) > limit
            beyond.append(f"{channel} {int(far.sum())}")
            for chosen, colour in ((~far, COLOURS[0]), (far, ALARM)):
                feet = right.up(np.zeros(int(chosen.sum())))
                axes.vlines(right.across(lags[chosen]), feet, right.up(r[chosen]), color=colour, lw=1.4)
        for cell, label in ((left, "time [s]"), (right, "lag [rows]")):
            axes.text(cell.left + 0.5 * cell.width, 0.06, label, fontsize=7.5, ha="center", va="bottom")
        drawn = svg(page)
    return Picture(
        "Innovations and whether they are white",
        "Left: measurement less what the filter expected, over its standard deviation; least and greatest value of "
        "pieces of the recording; band: ± 2. Right: correlation with itself some rows later; band: ± two standard "
        f"deviations of white noise, red beyond. Of {_LAGS} lags one or two lie beyond by chance; many, or a slow "
        f"fall, show what the model lacks. Beyond: {', '.join(beyond)}.",
        drawn,
    )


def autocorrelation(x: Array, lags: int) -> tuple[Array, NDArray[np.int64]]:
    """Correlation of ``x`` (n,) about zero with itself 1 to ``lags`` rows later, and the number of pairs of each.

    NaN are left out in pairs; 0 where there are no pairs.
    """
    known = np.isfinite(x)
    values = np.where(known, x, 0.0)
    power = float(np.mean(values[known] ** 2)) if known.any() else 1.0
    count = np.array(
        [int((known[k:] & known[: len(x) - k]).sum()) for k in range(1, min(lags, len(x) - 1) + 1)]
    )
    sums = np.array([float(values[k:] @ values[: len(x) - k]) for k in range(1, len(count) + 1)])
    return sums / np.maximum(count, 1) / (power or 1.0), count.astype(np.int64)


def chi_square(title: str, caption: str, values: Array, dof: float, divisor: float, label: str) -> Picture:
    """Histogram of ``values`` (runs,) beside the density of chi-square with ``dof`` degrees of freedom, over
    ``divisor``."""
    from scipy.stats import chi2  # takes long to import

    values = values[np.isfinite(values)]
    low, high = (float(chi2.ppf(level, dof)) / divisor for level in (1e-4, 1.0 - 1e-4))
    far = high + 2.0 * (high - low)
    first, last = min([low, *values.tolist()]), min(max([high, *values.tolist()]), far)
    edges = np.linspace(first, last, int(np.clip(2.0 * np.sqrt(len(values)), 8, 40)) + 1)
    with figure(WIDTH, 2.4) as page:
        axes = page.subplots()
        if len(values):
            share = np.histogram(np.minimum(values, far), edges)[0] / (len(values) * np.diff(edges))
            axes.stairs(share, edges, fill=True, color=COLOURS[0], alpha=0.55, lw=0, label="runs")
        x = np.linspace(first, last, 200)
        axes.plot(x, divisor * chi2.pdf(divisor * x, dof), color=INK, lw=1.1, label="chi-square")
        axes.set_xlabel(label)
        axes.set_ylabel("density")
        axes.set_ylim(bottom=0.0)
        axes.margins(x=0.005)
        page.legend(loc="outside upper right", ncols=2)
        drawn = svg(page)
    beyond = int(np.sum(values > far))
    more = f" {beyond} beyond {far:.3g} are counted in the last bar." if beyond else ""
    return Picture(title, caption + more, drawn)


def covered(found: Coverage, names: Sequence[str], over_bound: Array) -> Picture:
    """How often the stated intervals held the truth, and root mean square errors over stated uncertainties and over
    bounds (p,)."""
    places, (low, high) = np.arange(len(names)), found.limits
    # the root mean square of n normal numbers is 1 with a standard deviation of about 1/sqrt(2 n)
    spread = 3.0 / np.sqrt(2.0 * found.runs)
    with figure(WIDTH, 0.7 + 0.16 * len(names)) as page:
        panels = page.subplots(1, 3, sharey=True)
        for axes, values, band, at, label in zip(
            panels,
            (100.0 * found.fraction, found.rms, over_bound),
            ((100.0 * low, 100.0 * high), *2 * ((1.0 - spread, 1.0 + spread),)),
            (100.0 * found.level, 1.0, 1.0),
            ("intervals that hold the truth [%]", "rms of error / u", "rms of error / bound"),
            strict=True,
        ):
            axes.axvspan(*band, color=COLOURS[0], alpha=0.15, lw=0)
            axes.axvline(at, color=QUIET, lw=0.7)
            out = ~((band[0] <= values) & (values <= band[1]))
            for chosen, colour in ((~out, COLOURS[0]), (out, ALARM)):
                axes.plot(values[chosen], places[chosen], "o", color=colour)
            axes.set_xlabel(label)
            axes.tick_params(axis="y", length=0)
            axes.grid(axis="y")
        panels[0].set_ylim(len(names) - 0.4, -0.6)
        panels[0].set_yticks(places, names, fontsize=7)
        drawn = svg(page)
    return Picture(
        "Coverage, and errors beside uncertainties and bounds",
        f"Left: share of {found.runs} runs in which the interval stated for {100.0 * found.level:g} % held the truth; "
        "band: where all of them lie by chance. Middle and right: root mean square of the errors over the stated "
        "standard uncertainty, and over the Cramér-Rao bound, 1 for a filter that uses all that the path tells; band: "
        "1 ± three standard deviations of such a ratio. Red: outside; right of the band on the left, and left of it "
        "elsewhere, that is harmless, for uncertainties are then rather too large.",
        drawn,
    )
