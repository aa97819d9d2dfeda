"""What ``inercal allan`` shows: coefficients in units of the field, the curves with their slopes, and a page."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array
from inercal.estimate.rounding import rounded
from inercal.instruments.noise import BIAS_FLOOR, SYMBOLS
from inercal.instruments.terms import NOISE_TERMS, noise_shown
from inercal.noise.outcome import ChannelNoise, Noise
from inercal.report.html import Picture
from inercal.report.html import page as template
from inercal.report.style import COLOURS, INK, QUIET, WIDTH, figure, plain_unit, powers_of_ten, svg
from inercal.units import parse_unit

if TYPE_CHECKING:
    from matplotlib.axes import Axes


#: symbol -> averaging time [s] at which it is read off its slope, the slope in words, the slope's colour
_SLOPES = {
    "N": (1.0, "−1/2", COLOURS[1]),
    "B": (None, "0", COLOURS[2]),
    "K": (3.0, "+1/2", COLOURS[3]),
    "R": (np.sqrt(2.0), "+1", COLOURS[4]),
    "Q": (np.sqrt(3.0), "−1", COLOURS[5]),
}

_ABREAST = 3
"""Channels side by side in a picture."""

_LEGEND = ("measured", "fit", *SYMBOLS)
"""Entries of the legend, in its order, by what they begin with."""


def shown_units(unit: str) -> tuple[tuple[str, float], tuple[tuple[str, float], ...]]:
    """Units for people of samples in ``unit`` (SI) and of N, B, K, R, Q, each with its size in SI."""
    texts = [noise_shown(symbol, unit) for symbol in SYMBOLS]
    known = unit in ("rad/s", "m/s^2")
    shown = tuple((text, parse_unit(text).factor if known else 1.0) for text in texts)
    return shown[SYMBOLS.index("B")], shown  # B is in the unit of the samples


def cells(channel: ChannelNoise, noise: Noise) -> list[str]:
    """N, B, K, R and Q of a channel in units of the field: ``value ± u``, or ``< limit`` where they are not seen."""
    if channel.fit is None:
        return ["–"] * len(SYMBOLS)
    found = []
    for symbol, (_, size) in zip(SYMBOLS, shown_units(channel.unit)[1], strict=True):
        if symbol in channel.fit.names:
            p = noise.estimate[f"{symbol}_{channel.name}"]
            value, u = rounded(p.value / size, p.u / size)
            found.append(f"{value} ± {u}")
        else:
            limit = channel.fit.bounds[symbol] / size
            found.append(f"< {rounded(limit, limit)[1]}")
    return found


def of_a_sample(channel: ChannelNoise) -> str:
    """Standard deviation of N in one sample, N over the root of the interval, in the unit of B: as studies state it."""
    if channel.fit is None:
        return "–"
    size = shown_units(channel.unit)[0][1] * float(np.sqrt(channel.curve.interval))
    if "N" in channel.fit.names:
        return f"{channel.fit.values[channel.fit.names.index('N')] / size:.3g}"
    limit = channel.fit.bounds["N"] / size
    return f"< {rounded(limit, limit)[1]}"


def by_unit(channels: Iterable[ChannelNoise]) -> dict[str, list[ChannelNoise]]:
    """Channels by unit (SI), in the order read."""
    groups: dict[str, list[ChannelNoise]] = {}
    for channel in channels:
        groups.setdefault(channel.unit, []).append(channel)
    return groups


def table(noise: Noise) -> str:
    """The coefficients as aligned text, one table for each unit."""
    parts = []
    for unit, channels in by_unit(noise.channels).items():
        heads = [
            f"{symbol} [{text}]" for symbol, (text, _) in zip(SYMBOLS, shown_units(unit)[1], strict=True)
        ]
        heads.append(f"N of a sample [{shown_units(unit)[0][0]}]")
        rows = [["", *heads]]
        rows += [[channel.name, *cells(channel, noise), of_a_sample(channel)] for channel in channels]
        widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
        parts.append(
            "\n".join(
                "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
                for row in rows
            )
        )
    return "\n\n".join(parts)


def curves_csv(noise: Noise) -> str:
    """The curves as CSV, one row for each channel and averaging time, in SI."""
    lines = ["channel,unit,tau [s],deviation,lower,upper,fitted"]
    for channel in noise.channels:
        tau = channel.curve.tau
        for row in zip(tau, channel.deviation, *channel.limits, channel.fitted, strict=True):
            numbers = ("" if np.isnan(x) else repr(float(x)) for x in row)
            lines.append(",".join([channel.name, channel.unit, *numbers]))
    return "\n".join(lines) + "\n"


def pictures(noise: Noise) -> list[Picture]:
    """For each sensor the curves with their fits, slopes and residuals."""
    sensors: dict[str, list[ChannelNoise]] = {}
    for channel in noise.channels:
        sensors.setdefault("a" if channel.sensor[1:].isdigit() else channel.sensor, []).append(channel)
    return [
        _picture(sensor, channels[k : k + _ABREAST], noise)
        for sensor, channels in sensors.items()
        for k in range(0, len(channels), _ABREAST)
    ]


def _picture(sensor: str, channels: Sequence[ChannelNoise], noise: Noise) -> Picture:
    """Up to three channels of a sensor side by side, the residuals below."""
    text, _ = shown_units(channels[0].unit)[0]
    with figure(WIDTH, 3.9) as page:
        panels = page.subplots(
            2, len(channels), sharex=True, sharey="row", squeeze=False, height_ratios=(3.2, 1.0)
        )
        for axes, below, channel in zip(panels[0], panels[1], channels, strict=True):
            _curve(axes, channel, noise)
            _residuals(below, channel)
            below.set_xlabel("averaging time [s]")
        _common_limits(panels[0, 0], panels[1, 0], channels)
        panels[0, 0].set_ylabel(f"Allan deviation [{plain_unit(text)}]")
        panels[1, 0].set_ylabel("off the fit [%]")
        # one legend for all panels: what any of them shows, once
        shown = {
            label: handle
            for axes in panels[0]
            for handle, label in zip(*axes.get_legend_handles_labels(), strict=True)
        }
        labels = sorted(shown, key=lambda label: _LEGEND.index(label.partition(",")[0]))
        handles = [shown[label] for label in labels]
        page.legend(handles, labels, loc="outside upper center", ncols=len(_LEGEND))
        drawn = svg(page)
    words = {"acc": "Accelerometers", "gyro": "Gyro", "a": "Accelerometers"}
    return Picture(
        f"{words.get(sensor, sensor)}: {', '.join(channel.name for channel in channels)}",
        f"Overlapping Allan deviation with its {100.0 * noise.estimate.result['level']:.1f} % limits, the fitted "
        "model, and the slope of each noise process that was seen; a ring marks where a coefficient is read off its "
        "slope (N at 1 s, K at 3 s, R at √2 s, Q at √3 s). Below: deviation over fit, less one; grey: averaging "
        "times left out of the fit.",
        drawn,
    )


def _curve(axes: Axes, channel: ChannelNoise, noise: Noise) -> None:
    """Deviation, limits, fit and slopes of one channel, on logarithmic axes."""
    (_, size), coefficients = shown_units(channel.unit)
    tau, deviation = channel.curve.tau, channel.deviation / size
    lower, upper = (limit / size for limit in channel.limits)
    axes.set_title(channel.name)
    axes.set_xscale("log")
    if not np.nanmax(deviation, initial=0.0) > 0:
        axes.text(0.5, 0.5, "no noise", transform=axes.transAxes, ha="center")
        return
    axes.set_yscale("log", nonpositive="clip")
    axes.fill_between(tau, lower, upper, color=COLOURS[0], alpha=0.25, lw=0)
    axes.plot(tau, deviation, "o-", color=COLOURS[0], ms=2.2, lw=0.7, label="measured")
    if channel.fit is not None:
        used = _used(channel)
        axes.plot(tau[used], channel.fitted[used] / size, color=INK, lw=1.0, label="fit")
        falls = deviation[-1] <= deviation[0]  # then the upper right is free, else the upper left
        for k, symbol in enumerate(channel.fit.names):
            p = noise.estimate[f"{symbol}_{channel.name}"]
            _slope(axes, symbol, p.value / size, tau)
            text, of_coefficient = coefficients[SYMBOLS.index(symbol)]
            value, _ = rounded(p.value / of_coefficient, p.u / of_coefficient)
            axes.text(
                0.97 if falls else 0.03,
                0.97 - 0.075 * k,
                f"{symbol} {value} {plain_unit(text)}",
                transform=axes.transAxes,
                ha="right" if falls else "left",
                va="top",
                fontsize=6.5,
                color=_SLOPES[symbol][2],
                bbox={"facecolor": "white", "alpha": 0.8, "lw": 0, "pad": 0.8},
            )
    powers_of_ten(axes.xaxis)
    powers_of_ten(axes.yaxis)
    axes.grid(which="major")


def _slope(axes: Axes, symbol: str, value: float, tau: Array) -> None:
    """The line of one process, in the unit of the curve, marked where its coefficient is read off."""
    at, slope, colour = _SLOPES[symbol]
    laws = {
        "N": value / np.sqrt(tau),
        "B": np.full_like(tau, value * np.sqrt(BIAS_FLOOR)),
        "K": value * np.sqrt(tau / 3.0),
        "R": value * tau / np.sqrt(2.0),
        "Q": np.sqrt(3.0) * value / tau,
    }
    axes.plot(tau, laws[symbol], "--", color=colour, lw=0.9, label=f"{symbol}, slope {slope}")
    if at is not None and tau[0] <= at <= tau[-1]:
        axes.plot([at], [value], "o", color=colour, mfc="none", ms=5.0, mew=1.0)


def _residuals(axes: Axes, channel: ChannelNoise) -> None:
    """Deviation over fit, less one, in percent, with the limits."""
    axes.axhline(0.0, color=QUIET, lw=0.6)
    axes.grid(axis="x", which="major")
    if channel.fit is None:
        return
    tau, used = channel.curve.tau, _used(channel)
    off, lower, upper = _off(channel)
    axes.fill_between(tau, lower, upper, color=COLOURS[0], alpha=0.25, lw=0)
    axes.plot(tau[used], off[used], "o", color=COLOURS[0], ms=2.2)
    axes.plot(tau[~used], off[~used], "o", color=QUIET, ms=2.2)


def _used(channel: ChannelNoise) -> NDArray[np.bool_]:
    """True for the averaging times (k,) that took part in the fit."""
    assert channel.fit is not None
    low, high = channel.fit.fit_range
    tau = channel.curve.tau
    return np.asarray((tau >= low * (1.0 - 1e-9)) & (tau <= high * (1.0 + 1e-9)))


def _off(channel: ChannelNoise) -> tuple[Array, Array, Array]:
    """Deviation and its limits (k,) over the fit, less one [%]."""
    with np.errstate(divide="ignore", invalid="ignore"):
        off, lower, upper = (
            100.0 * (each / channel.fitted - 1.0) for each in (channel.deviation, *channel.limits)
        )
    return off, lower, upper


def _common_limits(above: Axes, below: Axes, channels: Sequence[ChannelNoise]) -> None:
    """Limits of the vertical axes that show every channel's curve, and the residuals of what was fitted."""
    size = shown_units(channels[0].unit)[0][1]
    curves = np.concatenate([channel.deviation for channel in channels]) / size
    known = curves[np.isfinite(curves) & (curves > 0)]
    if known.size:
        above.set_ylim(0.5 * known.min(), 3.0 * known.max())
    off = [_off(channel)[0][_used(channel)] for channel in channels if channel.fit is not None]
    largest = 1.3 * float(np.nanmax(np.abs(np.concatenate(off)), initial=10.0)) if off else 10.0
    below.set_ylim(max(-largest, -100.0), largest)


def page(noise: Noise) -> str:
    """The page of the noise of an instrument: HTML that needs nothing but itself."""
    estimate = noise.estimate
    files = ", ".join(Path(s.path).name for s in estimate.inputs if not s.path.endswith(".toml"))  # no maps
    return template(
        "allan.html",
        estimate,
        f"Noise of {files}" if files else "Noise at rest",
        words={symbol: term.name for symbol, term in NOISE_TERMS.items()},
        tables=[
            (
                {"rad/s": "Rate", "m/s^2": "Acceleration"}.get(unit, f"Output in {unit}"),
                [
                    *(
                        (symbol, text)
                        for symbol, (text, _) in zip(SYMBOLS, shown_units(unit)[1], strict=True)
                    ),
                    ("N of a sample", shown_units(unit)[0][0]),
                ],
                [(channel, [*cells(channel, noise), of_a_sample(channel)]) for channel in channels],
            )
            for unit, channels in by_unit(noise.channels).items()
        ],
        pictures=pictures(noise),
    )
