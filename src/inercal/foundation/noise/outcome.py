"""The noise of an instrument at rest: a record's Allan deviations and noise coefficients as an estimate.

Pieces of a recording in which a channel is far more restless than in its calm ones are told: there it did not rest.
"""

from __future__ import annotations

import re
import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Finding, Status, settled
from inercal.foundation.instruments.noise import SYMBOLS
from inercal.foundation.instruments.terms import noise_term
from inercal.foundation.noise.coefficients import NoiseCoefficients, noise_coefficients
from inercal.foundation.noise.deviation import AllanDeviation, allan_deviation, regular
from inercal.foundation.noise.limits import LIMITS
from inercal.foundation.noise.measured import measured, of_coarse, of_held
from inercal.foundation.records.column import Column, usable_interval
from inercal.foundation.records.dwells import window_samples
from inercal.foundation.records.places import counted
from inercal.foundation.records.record import Record
from inercal.foundation.results.basis import Basis, Formula, provenance
from inercal.foundation.results.budget import Uncertainty
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import RAW

_MEDIAN_OF_A_SQUARE = 0.455  # of a standard normal variable


@dataclass(frozen=True)
class Unrest:
    """Disturbances of a channel.

    ``pieces`` of ``of`` pieces, each ``tau`` [s] long, are restless, the ``first`` and the last one from and to these
    times [s] from the start; ``factor`` is the deviation of adjacent means over ``tau`` with them, over that without.
    """

    pieces: int
    of: int
    tau: float
    first: float
    last: float
    factor: float

    @property
    def moving(self) -> bool:
        """True where the instrument moves, not only is knocked now and then."""
        return self.pieces > LIMITS.moving_share * self.of or not self.factor <= LIMITS.moving_ratio

    @property
    def felt(self) -> bool:
        """True where it changes the deviation, not only a few samples."""
        return not self.factor <= 1.05

    @property
    def words(self) -> str:
        """A sentence of it, without the channel."""
        effect = (
            f"; without them the deviation at {self.tau:.3g} s would be {self.factor:.2g} times smaller"
            if np.isfinite(self.factor) and self.felt
            else ""
        )
        return (
            f"{'moves' if self.moving else 'is disturbed'}: {self.pieces} of {self.of} pieces of {self.tau:.3g} s are "
            f"far more restless than the calm ones{effect}"
        )


def unrest(x: Array, interval: float) -> Unrest | None:
    """Pieces of samples ``x`` (n,) at equal intervals [s] (NaN: missing) that are not noise alone; None: none are.

    Pieces are of a second, of eleven samples at least. One is restless by the variance within it, or by a jump of
    its mean. The variance of calm pieces is taken for that of a uniform rounding error at least, so that a step now
    and then of a coarse output is no unrest.
    """
    window = window_samples(1.0 / interval)
    count = len(x) // window
    if count < 5:
        return None
    pieces = x[: count * window].reshape(count, window)
    mean = pieces.mean(axis=1)
    variance = np.mean((pieces - mean[:, None]) ** 2, axis=1)
    finite = np.isfinite(variance)  # a piece that lacks a sample says nothing
    if not finite.any():
        return None
    moves = np.abs(np.diff(x))
    step = float(np.min(moves, initial=np.inf, where=moves > 0))
    calm = max(float(np.quantile(variance[finite], LIMITS.calm_share)), step**2 / 12.0)
    restless = finite & (variance > LIMITS.restless_ratio * calm)
    d, both = np.diff(mean) ** 2, finite[1:] & finite[:-1]
    usual = max(float(np.median(d[both])) / _MEDIAN_OF_A_SQUARE, calm / window) if both.any() else np.inf
    jump = both & (d > LIMITS.jump_sigmas**2 * usual)
    restless[1:] |= jump
    restless[:-1] |= jump
    if not restless.any():
        return None
    quiet = both & ~restless[1:] & ~restless[:-1]
    factor = float(np.sqrt(d[both].mean() / d[quiet].mean())) if d[quiet].any() else np.inf
    first, last = np.flatnonzero(restless)[[0, -1]] * window * interval
    return Unrest(
        int(restless.sum()), int(finite.sum()), window * interval, first, last + window * interval, factor
    )


COMMAND = "allan"

LEVEL = 0.683
"""Confidence of the limits of the curves."""

ONE_SIDED = 1.6449
"""Standard uncertainties to the one-sided 95 % limit of a normal distribution."""

MODEL = Formula(
    r"$\sigma^2(\tau) = R^2 \tau^2/2 + K^2 \tau/3 + B^2 (2 \ln\,2)/\pi + N^2/\tau + 3 Q^2/\tau^2$, $\sigma$ the "
    r"overlapping Allan deviation of means over $\tau$: $N$ at 1 s on the slope -1/2, $K$ at 3 s on +1/2, $B$ = "
    "floor/0.664"
)

REFERENCES = (
    "W. J. Riley, D. A. Howe, Handbook of frequency stability analysis, NIST SP 1065 (2008)",
    "C. A. Greenhall, W. J. Riley, Uncertainty of stability variances based on finite differences, 35th PTTI (2003)",
    "IEEE Std 952, Specification format guide and test procedure for single-axis interferometric fiber optic gyros",
)

_CHANNELS = re.compile(r"acc_[xyz]|a[1-9]\d*|gyro(_[xyz]|_roll|_yaw)?|y_[xy]")
_DIMENSIONS = ("acceleration", "rate", "number", *RAW)


@dataclass(frozen=True, eq=False)
class ChannelNoise:
    """One channel: its ``unit`` (SI), ``curve`` and where it is ``at`` in it, and the fit (None: there is no noise)."""

    name: str
    sensor: str
    unit: str
    curve: AllanDeviation
    at: int
    fit: NoiseCoefficients | None

    @property
    def deviation(self) -> Array:
        """Allan deviation (k,) at ``curve.tau``."""
        return self.curve.deviation[:, self.at]

    @property
    def fitted(self) -> Array:
        """Deviation (k,) that the fit expects at ``curve.tau`` with the gaps there are; NaN without a fit."""
        if self.fit is None:
            return np.full(len(self.curve.tau), np.nan)
        return np.sqrt(self.fit.variance(self.curve.tau, self.curve.gain[:, self.at]))

    @property
    def limits(self) -> tuple[Array, Array]:
        """Its confidence limits (k,), (k,)."""
        return self.curve.lower[:, self.at], self.curve.upper[:, self.at]


@short_repr
@dataclass(frozen=True, eq=False)
class NoiseResult:
    """The ``estimate`` and what it was made from."""

    estimate: Estimate
    channels: tuple[ChannelNoise, ...]


def noise_of(record: Record) -> NoiseResult:
    """Allan deviations and noise coefficients of every channel of a record at rest that measures motion.

    Raises `RecordError`: no such channel, hardly any samples, or time stamps that do not increase.
    """
    groups = _groups(record)
    noise_coefficients(allan_deviation(np.sin(np.arange(64.0) ** 2), 1.0))  # loads or compiles kernels
    clock = time.perf_counter()
    channels: list[ChannelNoise] = []
    channels_of: dict[Finding, list[str]] = {}
    findings: list[Finding] = []
    disturbed: dict[str, Unrest] = {}
    for rows, columns in groups:
        findings += of_held(rows, columns) + of_coarse(columns)
        interval, samples = _on_a_grid(columns)
        curve = allan_deviation(samples, interval, level=LEVEL)
        for at, column in enumerate(columns):
            fit, own = _fitted(curve, at)
            for each in own:
                channels_of.setdefault(each, []).append(column.name)
            channels.append(ChannelNoise(column.name, column.sensor, column.unit.si, curve, at, fit))
            disturbance = unrest(samples[:, at], interval)
            if disturbance is not None:
                where = f"{disturbance.first:.1f} s to {disturbance.last:.1f} s from the start"
                harm = (column.name,) if disturbance.felt else ()
                findings.append(Finding("not_at_rest", f"{column.name} {disturbance.words}", where, harm))
                disturbed[column.name] = disturbance
    of_fits = [
        replace(each, headline=f"{', '.join(names)}: {each.headline}") for each, names in channels_of.items()
    ]
    estimate = _assemble(record, channels, [*of_fits, *findings], disturbed)
    return NoiseResult(replace(estimate, timing={"solve": time.perf_counter() - clock}), tuple(channels))


def _groups(record: Record) -> list[tuple[float, list[Column]]]:
    """Channels of motion that are measured together, without rows that are no samples of them."""
    groups: dict[int, list[Column]] = {}
    for column in record.columns.values():
        if _CHANNELS.fullmatch(column.name) and column.unit.dimension in _DIMENSIONS:
            groups.setdefault(id(column.t), []).append(column)
    if not groups:
        where = ", ".join(source.path for source in record.sources) or "record"
        raise RecordError(
            where,
            f"found {', '.join(record.columns) or 'no channels'}, expected acceleration or rate, such as acc_x or "
            "gyro_x",
        )
    return [part for columns in groups.values() for part in measured(columns)]


def _on_a_grid(columns: list[Column]) -> tuple[float, Array]:
    """Sample interval [s] and samples (n, channels) in SI of channels of one clock, NaN where one is missing."""
    t, where = columns[0].t, columns[0].source.path
    # rows without a stamp, or with one that is not later than all before, are among the record's findings
    forward = np.isfinite(t) & (t > np.concatenate([[-np.inf], np.fmax.accumulate(t)[:-1]]))
    samples = np.stack([column.values * column.unit.factor for column in columns], axis=1)
    if not forward.all() and np.mean(forward) > LIMITS.in_order_share:
        t, samples = t[forward], samples[forward]
    samples[~np.isfinite(samples)] = np.nan
    size = float(np.nanmax(np.abs(samples), initial=0.0))
    if size > 1e100:
        raise RecordError(where, f"found values up to {size:.3g}, expected the output of a sensor")
    counts = np.isfinite(samples).sum(axis=0)
    if counts.min() < LIMITS.fewest_samples:
        name = columns[int(np.argmin(counts))].name
        raise RecordError(
            where, f"found {counts.min()} samples of {name}, expected at least {LIMITS.fewest_samples}"
        )
    interval, samples = regular(t, samples, where)
    return usable_interval(interval, where), samples


def _fitted(curve: AllanDeviation, at: int) -> tuple[NoiseCoefficients | None, tuple[Finding, ...]]:
    """The fit of a channel, None if it shows no noise, and the findings."""
    if not np.nanmax(curve.deviation[:, at], initial=0.0) > 0:
        return None, (Finding("resolution", "the output never changes, there is no noise to be seen"),)
    whole = noise_coefficients(curve, at)
    if curve.samples >= LIMITS.all_kinds_samples:
        return (whole if whole.names else None), whole.findings
    white = noise_coefficients(curve, at, terms=("N",))
    seen = {
        name: value + ONE_SIDED * u for name, value, u in zip(whole.names, whole.values, whole.u, strict=True)
    }
    bounds = {name: limit for name, limit in {**whole.bounds, **seen}.items() if name not in white.names}
    few = (
        f"{curve.samples} samples show white noise at most: of the others only limits are given, expected at least "
        f"{LIMITS.all_kinds_samples} samples, and minutes of them"
    )
    return replace(white, bounds=bounds), (*white.findings, Finding("few_degrees_of_freedom", few))


def _assemble(
    record: Record,
    channels: list[ChannelNoise],
    findings: list[Finding],
    disturbed: Mapping[str, Unrest],
) -> Estimate:
    """Put the estimate together: N, B, K, R, Q of each channel.

    A coefficient that a curve does not show has the value 0 and a u by which its upper limit is 1.645 u; it is
    listed in ``result`` with that limit. What is found in a channel without coefficients harms those of no other.
    """
    from scipy.linalg import block_diag

    names, units, values, dof = [], [], [], []
    blocks = []
    for channel in channels:
        if channel.fit is None:
            continue
        fit = channel.fit
        block = np.zeros((len(SYMBOLS), len(SYMBOLS)))
        seen = [SYMBOLS.index(name) for name in fit.names]
        block[np.ix_(seen, seen)] = fit.covariance
        for symbol in SYMBOLS:
            names.append(f"{symbol}_{channel.name}")
            units.append(noise_term(symbol, channel.unit))
            if symbol in fit.names:
                k = fit.names.index(symbol)
                values.append(float(fit.values[k]))
                dof.append(float(fit.dof[k]))
            else:
                k = SYMBOLS.index(symbol)
                block[k, k] = (fit.bounds.get(symbol, np.inf) / ONE_SIDED) ** 2
                values.append(0.0)
                dof.append(np.inf)
        blocks.append(block)
    longest = max(channels, key=lambda each: each.curve.samples * each.curve.interval).curve
    return Estimate.of(
        Basis(
            COMMAND, MODEL, inputs=record.sources, provenance=provenance(record.span), references=REFERENCES
        ),
        names,
        units,
        np.array(values),
        Uncertainty(block_diag(np.zeros((0, 0)), *blocks), np.array(dof)),
        _verdict(channels, disturbed),
        findings=(*settled(record.findings, "no_data"), *findings),
        statistics={
            "samples": float(longest.samples),
            "rate_hz": 1.0 / longest.interval,
            "duration_s": longest.samples * longest.interval,
        },
        result={"level": LEVEL, "channels": {channel.name: _curve(channel) for channel in channels}},
    )


def _curve(channel: ChannelNoise) -> dict[str, Any]:
    """One channel of the result, in SI; ``sample`` is the noise of a sample, N over the root of the interval."""
    curve, at, fit = channel.curve, channel.at, channel.fit
    out: dict[str, Any] = {
        "unit": channel.unit,
        "tau": curve.tau,
        "deviation": channel.deviation,
        "lower": channel.limits[0],
        "upper": channel.limits[1],
        "dof": curve.dof[:, at],
        "samples": curve.samples,
        "interval_s": curve.interval,
    }
    if fit is not None:
        out |= {
            "fitted": channel.fitted,
            "fit_range_s": list(fit.fit_range),
            "resolved": list(fit.names),
            "sample": float(fit.values[fit.names.index("N")]) / curve.interval**0.5
            if "N" in fit.names
            else None,
            "upper_limits": dict(fit.bounds),
            "chi2": fit.chi2,
            "chi2_dof": fit.chi2_dof,
        }
    return out


def _verdict(channels: list[ChannelNoise], disturbed: Mapping[str, Unrest]) -> tuple[Status, str]:
    """The status and the message of the result."""
    seconds = max(each.curve.samples * each.curve.interval for each in channels)
    moving = [name for name, each in disturbed.items() if each.moving]
    if moving:
        return Status.INCONSISTENT, (
            f"the instrument was not at rest ({', '.join(moving)}), and noise coefficients are of rest alone: take the "
            "part at rest with --begin and --end"
        )
    though = f", {', '.join(disturbed)} disturbed" if disturbed else ""
    lasted = f"{seconds:.0f}" if seconds >= 1000 else f"{seconds:.4g}"
    return Status.OK, f"noise of {counted(len(channels), 'channel')} from {lasted} s at rest{though}"
