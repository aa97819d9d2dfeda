"""From readings to a fit: the terms that the positions identify, with stated values of the others.

Drift of the biases over a test, as a study asks for it: fitted beside the terms, from positions and within dwells.

Linear: a slope for each channel. Exponential: an amplitude for each, and one time constant for all, found where the
misfit is least; its uncertainty takes part to first order. Random walk: one size for all channels, by restricted
likelihood, as that of the noise (`inercal.systems.turntable.weights`), and the walk itself by the first terms of its
series (Karhunen and Loeve). Samples within the dwells tell a slope too: where it agrees with that from dwell to dwell,
both are used.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.foundation.findings import Finding
from inercal.foundation.inference.variances import degrees
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.results.budget import TypeA
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.model import TableModel, table_model
from inercal.systems.turntable.positions.faults import fraction, on_channel
from inercal.systems.turntable.readings import Readings
from inercal.systems.turntable.regression import (
    Effects,
    Identified,
    Regression,
    fit,
    fit_to_order,
    identify_channels,
    second_order_matters,
)
from inercal.systems.turntable.settings import BiasDrift, TurntableSettings

_TERMS = 15
"""Terms of the series of a random walk at most; what is left out is 1/(4 TERMS) of its variance."""

_STEP = 0.3
"""Step of the logarithm of the size of a walk for its information."""

_SHORTEST, _LONGEST = 0.02, 2.0
"""Time constants that are looked for, over the length of the test."""

Fit = Callable[[Array, Effects], Regression]
"""A fit of readings (n, c) with effects beside the terms."""


@dataclass(frozen=True, eq=False)
class Drift:
    """A drift that was fitted.

    ``fit`` with it; ``sources`` names of its random effects, one for each, with the degrees of freedom ``dof`` of their
    sizes; ``nuisances`` name, value, u and unit (SI) of each; ``findings``.
    """

    fit: Regression
    sources: tuple[str, ...]
    dof: tuple[float, ...]
    nuisances: tuple[tuple[str, float, float, str], ...]
    findings: tuple[Finding, ...] = ()

    def components(self, slope: Array) -> list[TypeA]:
        """Its random effects as sources of uncertainty, those of one name together; ``slope`` (p, p) of the values by
        the linear coefficients."""
        shifts = slope @ self.fit.shift(self.fit.effects.random)
        made = []
        for name in dict.fromkeys(self.sources):
            own = [k for k, each in enumerate(self.sources) if each == name]
            made.append(TypeA(name, 1.0, "1", shifts[:, own] @ shifts[:, own].T, self.dof[own[0]]))
        return made

    def rows(self) -> list[dict[str, Any]]:
        """The nuisances as a result holds them."""
        return [{"name": a, "value": b, "u": c, "unit": d, "prior": None} for a, b, c, d in self.nuisances]


def fit_drift(means: Readings, kind: BiasDrift, fit: Fit, unit: str) -> Drift:
    """Fit the readings with a drift of that ``kind``; ``unit`` SI unit of the outputs.

    Raises
    ------
    LinAlgError
        As `inercal.systems.turntable.regression.fit`, also where drift and terms cannot be told apart.
    """
    if kind == "random_walk":
        return _walk(means, fit, unit)
    return _linear(means, fit, unit) if kind == "linear" else _exponential(means, fit, unit)


def _own(means: Readings, column: Array) -> Array:
    """A column (n,) for each channel: (n, c, c)."""
    return np.asarray(column[:, None, None] * np.eye(len(means.channels)))


def _linear(means: Readings, fit: Fit, unit: str) -> Drift:
    """A slope for each channel, from dwell to dwell and within the dwells."""
    n, channels = means.y.shape
    s = fraction(means.times)
    columns = _own(means, s - 0.5)
    done = fit(means.y, Effects(columns, np.zeros((n, channels, 0))))
    value, u = done.effect, np.sqrt(np.diag(done.effect_covariance))
    inside = means.slopes * (means.times[-1] - means.times[0])
    findings, used = [], np.zeros(channels, dtype=bool)
    at, at_u = value.copy(), u.copy()
    if n > 2 and np.isfinite(inside).all():
        mean, mean_u = inside.mean(axis=0), inside.std(axis=0, ddof=1) / np.sqrt(n)
        apart = np.abs(mean - value) / np.hypot(mean_u, u)
        used = apart < LIMITS.drift_sigmas
        at, at_u = np.where(used, mean, at), np.where(used, mean_u, at_u)
        for k in np.flatnonzero(~used):
            text = (
                f"{means.channels[k]} drifts within the dwells otherwise than from dwell to dwell ({apart[k]:.1f} u "
                "apart), as if it settles after moves"
            )
            action = "wait longer before each reading"
            findings.append(Finding("trend", text, "", (means.channels[k],), action=action))
    if used.any():
        known = Effects(columns[..., ~used], columns[..., used] * at_u[used])
        offset = columns[..., used] @ at[used]
        done = fit(means.y - offset, known)
        more = _random(done, int(used.sum()))
        value[~used], u[~used] = done.effect, np.sqrt(np.diag(done.effect_covariance))
        value[used] = at[used] + at_u[used] * more[0]
        u[used] = at_u[used] * more[1]
    names = tuple(
        (f"drift_{name}", float(a), float(b), unit)
        for name, a, b in zip(means.channels, value, u, strict=True)
    )
    sources = tuple(f"drift of {means.channels[k]} within dwells" for k in np.flatnonzero(used))
    return Drift(done, sources, (float(n - 1),) * len(sources), names, tuple(findings))


def _random(fit: Regression, count: int) -> tuple[Array, Array]:
    """Values and standard uncertainties of the last ``count`` random effects, in their standard deviations."""
    return fit.random_effect[-count:], np.sqrt(np.diag(fit.random_covariance)[-count:])


def _exponential(means: Readings, fit: Fit, unit: str) -> Drift:
    """An amplitude for each channel, and one time constant."""
    n, channels = means.y.shape
    s = fraction(means.times)
    none = np.zeros((n, channels, 0))

    def misfit(log_tau: float) -> float:
        done = fit(means.y, Effects(_own(means, np.exp(-s / np.exp(log_tau))), none))
        return float(np.sum(np.log(np.square(done.residuals).sum(axis=0))))

    tau = float(np.exp(_lowest(misfit, np.linspace(np.log(_SHORTEST), np.log(_LONGEST), 12), 1e-3)))
    decay = np.exp(-s / tau)
    done = fit(means.y, Effects(_own(means, decay), none))
    # change of the readings by the logarithm of the time constant, which may be off by a factor e
    by_log = (done.effect * (decay * s / tau)[:, None])[..., None]
    done = fit(means.y, Effects(_own(means, decay), by_log))
    u = np.sqrt(np.diag(done.effect_covariance))
    length = float(means.times[-1] - means.times[0])
    names = [
        (f"warm_up_{name}", float(a), float(b), unit)
        for name, a, b in zip(means.channels, done.effect, u, strict=True)
    ]
    change, spread = _random(done, 1)
    names.append(
        ("time_constant", tau * float(np.exp(change[0])) * length, tau * float(spread[0]) * length, "s")
    )
    return Drift(done, ("time constant of the warm-up",), (np.inf,), tuple(names))


def _walk(means: Readings, fit: Fit, unit: str) -> Drift:
    """A random walk of each bias: its standard deviation at the end of the test, the same for all channels, by
    restricted likelihood."""
    n, channels = means.y.shape
    s = fraction(means.times)
    order = np.pi * (np.arange(min(_TERMS, n - 1)) + 0.5)
    basis = np.sqrt(2.0) * np.sin(s[:, None] * order) / order
    walks = np.concatenate([on_channel(means, k, basis) for k in range(channels)], axis=-1)
    none = np.zeros((n, channels, 0))

    def unlikely(log: float) -> float:
        return -fit(means.y, Effects(none, walks * np.exp(log))).likelihood

    start = np.log(max(fit(means.y, Effects(none, none)).noise.max(), 1e-300))
    log = _lowest(unlikely, start + np.linspace(-3.0, 6.0, 6), 0.1)
    low, mid, high = (unlikely(log + step) for step in (-_STEP, 0.0, _STEP))
    curvature = max(low - 2.0 * mid + high, 0.0) / (2.0 * _STEP) ** 2  # by the logarithm of a variance
    dof, size = float(degrees(1.0 / max(curvature, 1e-300))), float(np.exp(log))
    done = fit(means.y, Effects(none, walks * size))
    many = walks.shape[-1]
    nuisance = ("bias_walk", size, size / np.sqrt(2.0 * dof), unit)
    return Drift(done, ("random walk of the biases",) * many, (dof,) * many, (nuisance,))


def _lowest(function: Callable[[float], float], grid: Array, tolerance: float) -> float:
    """Place at which a function is lowest: the lowest point of a grid, then a search about it."""
    from scipy.optimize import minimize_scalar

    best = int(np.argmin([function(x) for x in grid]))
    ends = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    return float(minimize_scalar(function, bounds=ends, method="bounded", options={"xatol": tolerance}).x)


@dataclass(frozen=True, eq=False)
class Fitting:
    """The terms that a plan identifies, and the fit if it identifies all.

    ``identified`` rank and null vectors by channel, of the terms of ``model``; ``fit`` None where a term is not
    identified, and where the weights of the readings do not settle; with a ``drift`` where the study asks for one.
    """

    model: TableModel
    identified: tuple[Identified, ...]
    fit: Regression | None
    findings: tuple[Finding, ...] = ()
    drift: Drift | None = None


def fit_readings(means: Readings, settings: TurntableSettings) -> Fitting:
    """Fit the terms that the study asks for, those of the earth rate only where the positions allow it.

    Raises
    ------
    StudyError
        No value stated for terms of the earth rate that cannot be fitted.
    """
    model, what, free = choose_terms(settings, means.channels, means.angles)
    fixed_rates, findings = _stated_rates(model, settings), list(means.findings)
    if free:
        text = (
            f"the positions do not identify the terms of the earth rate ({free} is free): earth rate is subtracted "
            f"with {', '.join(fixed_rates)}"
        )
        findings.append(Finding("stated_earth_rate", text))
    if any(each.words for each in what) or len(means.y) < fewest_positions(model, settings):
        return Fitting(model, what, None, tuple(findings))
    noise = [settings.instrument.noise] * len(means.channels)
    try:
        with np.errstate(
            over="ignore", divide="ignore", invalid="ignore"
        ):  # what is lost is not finite, and no fit
            if settings.instrument.bias_drift != "none":
                drift = _with_drift(model, means, noise, settings.instrument.bias_drift)
                return Fitting(model, what, drift.fit, (*findings, *drift.findings), drift)
            done = fit(model, means.angles, means.y, noise, samples=means.samples)
    except np.linalg.LinAlgError:
        return Fitting(model, what, None, tuple(findings))
    return Fitting(model, what, done, tuple(findings))


def _with_drift(model: TableModel, means: Readings, noise: Sequence[float | None], kind: BiasDrift) -> Drift:
    """The fit with a drift of that ``kind``; all fits by which it is found are of one order of the table's errors."""

    def to_order(second: bool) -> Drift:
        def fitted(y: Array, effects: Effects) -> Regression:
            return fit_to_order(model, means.angles, y, noise, None, means.samples, effects, second)

        return fit_drift(means, kind, fitted, means.unit.si)

    straight = to_order(False)
    return to_order(True) if second_order_matters(straight.fit) else straight


def stated_noise(settings: TurntableSettings) -> float:
    """Noise of a reading, which a test that is not made yet cannot tell; raises `StudyError` where none is stated."""
    if settings.instrument.noise is None:
        raise StudyError(
            "instrument.noise", 'missing, expected the noise of one reading such as noise = "0.01 deg/h"'
        )
    return settings.instrument.noise


def choose_terms(
    settings: TurntableSettings, channels: Sequence[str], angles: Array
) -> tuple[TableModel, tuple[Identified, ...], str]:
    """The terms to be fitted at these positions, and their identifiability.

    The terms of the earth rate are among them as the study says; where it says nothing, if the positions identify
    them. Where they do not, the third is the combination that would be free, in words.
    """
    whole = table_model(settings, channels)
    what, rates, choice = identify_channels(whole, angles), rate_terms(whole), settings.instrument.earth_rate
    if not rates or choice == "fitted" or (choice is None and not any(each.words for each in what)):
        return whole, what, ""
    rest = table_model(settings, channels, rates)
    without = identify_channels(rest, angles)
    if choice == "stated":
        return rest, without, ""
    if not _leaves_rates_unknown(what, without):
        return whole, what, ""
    free = [words for each in what for words in each.words]
    free.sort(
        key=lambda words: not set(words.split()) & set(rates)
    )  # one that names a term of a rate, if any does
    return rest, without, free[0]


def earth_rate_of(model: TableModel) -> str:
    """``stated`` if terms of the earth rate are taken as known, else ``fitted``."""
    fixed = any(each.of_rate for part in model.stated for each in part.channel.monomials)
    return "stated" if fixed else "fitted"


def _leaves_rates_unknown(whole: tuple[Identified, ...], without: tuple[Identified, ...]) -> bool:
    """True if fewer combinations are unknown once the earth rate is: ``whole`` with its terms, ``without`` them."""
    return any(len(a.words) > len(b.words) for a, b in zip(whole, without, strict=True))


def fewest_positions(model: TableModel, settings: TurntableSettings) -> int:
    """Positions that a fit needs: one for each term, and one more where the noise is to be estimated."""
    return max(len(channel.symbols) for channel in model.channels) + (settings.instrument.noise is None)


def rate_terms(model: TableModel) -> tuple[str, ...]:
    """Terms of the model in which a rate takes part."""
    return tuple(
        symbol
        for channel in model.channels
        for symbol, each in zip(channel.symbols, channel.monomials, strict=True)
        if each.of_rate
    )


def _stated_rates(model: TableModel, settings: TurntableSettings) -> tuple[str, ...]:
    """The terms of the earth rate that are not fitted, each with its value as ``k_x = 1``, or ``k_x = 20 mA/(rad/s)``.

    Raises
    ------
    StudyError
        None of them is stated, and the output is in no unit of rate.
    """
    rates, has_value, unit = [], False, settings.instrument.unit
    for part in model.stated:
        for symbol, each, value in zip(
            part.channel.symbols, part.channel.monomials, part.values, strict=True
        ):
            if each.of_rate:
                of = "" if unit.dimension == "rate" else f" {TERMS[symbol].unit_for(unit.symbol)}"
                rates.append(f"{symbol} = {value / (unit.factor if of else 1.0):.6g}{of}")
                has_value = has_value or symbol in settings.instrument.coefficients or bool(value)
    if rates and not has_value:
        names = ", ".join(text.partition(" ")[0] for text in rates)
        raise StudyError(
            "instrument.coefficients",
            f"none of {names} is stated, expected one or more: they are not fitted, and the output is in no unit of "
            "rate",
        )
    return tuple(rates)
