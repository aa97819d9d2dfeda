"""Noise of an instrument, shown: coefficients in units of the field, the curves with their slopes, and a page."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from inercal.faces.report.html import Picture
from inercal.faces.report.html import page as template
from inercal.faces.report.marks import Area, Axis, Dots, Level, Line, Mark, Note, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.style import COLOURS, INK, QUIET, plain_unit
from inercal.foundation.arrays import Array
from inercal.foundation.instruments.noise import BIAS_FLOOR, SYMBOLS
from inercal.foundation.instruments.terms import NOISE_TERMS, noise_shown
from inercal.foundation.noise.outcome import ChannelNoise, NoiseResult
from inercal.foundation.results.shown import aligned, csv_text, rounded
from inercal.foundation.units import parse_unit

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
"""Entries of the legend."""


def shown_units(unit: str) -> tuple[tuple[str, float], tuple[tuple[str, float], ...]]:
    """Units for people of samples in ``unit`` (SI) and of N, B, K, R, Q, each with its size in SI."""
    texts = [noise_shown(symbol, unit) for symbol in SYMBOLS]
    physical = unit in ("rad/s", "m/s^2")
    shown = tuple((text, parse_unit(text).factor if physical else 1.0) for text in texts)
    return shown[SYMBOLS.index("B")], shown  # B is in the unit of the samples


def cells(channel: ChannelNoise, noise: NoiseResult) -> list[str]:
    """N, B, K, R and Q of a channel in units of the field: ``value ± u``, or ``< limit`` where they are not seen."""
    if channel.fit is None:
        return ["–"] * len(SYMBOLS)
    texts = []
    for symbol, (_, size) in zip(SYMBOLS, shown_units(channel.unit)[1], strict=True):
        if symbol in channel.fit.names:
            p = noise.estimate[f"{symbol}_{channel.name}"]
            value, u = rounded(p.value / size, p.u / size)
            texts.append(f"{value} ± {u}")
        else:
            limit = channel.fit.bounds[symbol] / size
            texts.append(f"< {rounded(limit, limit)[1]}")
    return texts


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


def table(noise: NoiseResult) -> str:
    """The coefficients as aligned text, one table for each unit."""
    parts = []
    for unit, channels in by_unit(noise.channels).items():
        heads = [
            f"{symbol} [{text}]" for symbol, (text, _) in zip(SYMBOLS, shown_units(unit)[1], strict=True)
        ]
        heads.append(f"N of a sample [{shown_units(unit)[0][0]}]")
        rows = [["", *heads]]
        rows += [[channel.name, *cells(channel, noise), of_a_sample(channel)] for channel in channels]
        parts.append("\n".join(aligned(rows, range(len(rows[0])))))
    return "\n\n".join(parts)


def curves_csv(noise: NoiseResult) -> str:
    """The curves as CSV, one row for each channel and averaging time, in SI."""
    lines: list[Sequence[object]] = [("channel", "unit", "tau [s]", "deviation", "lower", "upper", "fitted")]
    for channel in noise.channels:
        numbers = (channel.curve.tau, channel.deviation, *channel.limits, channel.fitted)
        lines += [(channel.name, channel.unit, *row) for row in zip(*numbers, strict=True)]
    return csv_text(lines)


def pictures(noise: NoiseResult) -> list[Picture]:
    """For each sensor the curves with their fits, slopes and residuals."""
    sensors: dict[str, list[ChannelNoise]] = {}
    for channel in noise.channels:
        sensors.setdefault("a" if channel.sensor[1:].isdigit() else channel.sensor, []).append(channel)
    return [
        _picture(sensor, channels[k : k + _ABREAST], noise)
        for sensor, channels in sensors.items()
        for k in range(0, len(channels), _ABREAST)
    ]


def _picture(sensor: str, channels: Sequence[ChannelNoise], noise: NoiseResult) -> Picture:
    """Up to three channels of a sensor side by side, the residuals below."""
    text, _ = shown_units(channels[0].unit)[0]
    above, below = _common_limits(channels)
    rows = [
        [
            _curve(channel, noise, Axis(f"Allan deviation [{plain_unit(text)}]", "log", above))
            for channel in channels
        ],
        [_residuals(channel, Axis("off the fit [%]", limits=below)) for channel in channels],
    ]
    words = {"acc": "Accelerometers", "gyro": "Gyro", "a": "Accelerometers"}
    return draw(
        f"{words.get(sensor, sensor)}: {', '.join(channel.name for channel in channels)}",
        f"Overlapping Allan deviation with its {100.0 * noise.estimate.result['level']:.1f} % limits, the fitted "
        "model, and the slope of each noise process that was seen; a ring marks where a coefficient is read off its "
        "slope (N at 1 s, K at 3 s, R at √2 s, Q at √3 s). Below: deviation over fit, less one; grey: averaging "
        "times left out of the fit.",
        rows,
        3.9,
        len(_LEGEND),
        "center",
        heights=(3.2, 1.0),
        share_y="row",
    )


def _curve(channel: ChannelNoise, noise: NoiseResult, up: Axis) -> Panel:
    """Deviation, limits, fit and slopes of one channel, on logarithmic axes."""
    (_, size), coefficients = shown_units(channel.unit)
    tau, deviation = channel.curve.tau, channel.deviation / size
    lower, upper = (limit / size for limit in channel.limits)
    across = Axis(scale="log")
    if not np.nanmax(deviation, initial=0.0) > 0:
        none = Note((0.5, 0.5), "no noise", ha="center", of_panel="xy", size=8.0)
        return Panel([none], across, replace(up, scale="linear", limits=None), channel.name)
    marks: list[Mark] = [
        Area(tau, lower, upper, alpha=0.25),
        Line(tau, deviation, width=0.7),
        Dots(tau, deviation, "measured", size=2.2),
    ]
    if channel.fit is not None:
        used = _used(channel)
        marks.append(Line(tau[used], channel.fitted[used] / size, "fit", INK, 1.0))
        falls = deviation[-1] <= deviation[0]  # then the upper right is free, else the upper left
        for k, symbol in enumerate(channel.fit.names):
            p = noise.estimate[f"{symbol}_{channel.name}"]
            marks += _slope(symbol, p.value / size, tau)
            text, of_coefficient = coefficients[SYMBOLS.index(symbol)]
            value, _ = rounded(p.value / of_coefficient, p.u / of_coefficient)
            place, words = (0.97 if falls else 0.03, 0.97 - 0.075 * k), f"{symbol} {value} {plain_unit(text)}"
            marks.append(
                Note(
                    place,
                    words,
                    _SLOPES[symbol][2],
                    6.5,
                    "right" if falls else "left",
                    "top",
                    of_panel="xy",
                    ground=True,
                )
            )
    return Panel(marks, across, up, channel.name, grid="both")


def _slope(symbol: str, value: float, tau: Array) -> list[Mark]:
    """The line of one process, in the unit of the curve, marked where its coefficient is read off."""
    at, slope, colour = _SLOPES[symbol]
    laws = {
        "N": value / np.sqrt(tau),
        "B": np.full_like(tau, value * np.sqrt(BIAS_FLOOR)),
        "K": value * np.sqrt(tau / 3.0),
        "R": value * tau / np.sqrt(2.0),
        "Q": np.sqrt(3.0) * value / tau,
    }
    marks: list[Mark] = [Line(tau, laws[symbol], f"{symbol}, slope {slope}", colour, 0.9, "--")]
    if at is not None and tau[0] <= at <= tau[-1]:
        marks.append(Dots([at], [value], "", colour, size=5.0, filled=False))
    return marks


def _residuals(channel: ChannelNoise, up: Axis) -> Panel:
    """Deviation over fit, less one, in percent, with the limits."""
    marks: list[Mark] = [Level(0.0)]
    if channel.fit is not None:
        tau, used = channel.curve.tau, _used(channel)
        off, lower, upper = _off(channel)
        marks.append(Area(tau, lower, upper, alpha=0.25))
        for chosen, colour in ((used, COLOURS[0]), (~used, QUIET)):
            marks.append(Dots(tau[chosen], off[chosen], colour=colour, size=2.2))
    return Panel(marks, Axis("averaging time [s]", "log"), up, grid="x")


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


def _common_limits(
    channels: Sequence[ChannelNoise],
) -> tuple[tuple[float, float] | None, tuple[float, float]]:
    """Limits of the vertical axes that show every channel's curve, and the residuals of what was fitted."""
    size = shown_units(channels[0].unit)[0][1]
    curves = np.concatenate([channel.deviation for channel in channels]) / size
    positive = curves[np.isfinite(curves) & (curves > 0)]
    above = (0.5 * float(positive.min()), 3.0 * float(positive.max())) if positive.size else None
    off = [_off(channel)[0][_used(channel)] for channel in channels if channel.fit is not None]
    largest = 1.3 * float(np.nanmax(np.abs(np.concatenate(off)), initial=10.0)) if off else 10.0
    return above, (max(-largest, -100.0), largest)


def page(noise: NoiseResult) -> str:
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
