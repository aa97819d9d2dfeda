"""Drift of the biases over a test, as a study asks for it: fitted beside the terms, from positions and within dwells.

Linear: a slope for each channel. Exponential: an amplitude for each, and one time constant for all, found where the
misfit is least; its uncertainty takes part to first order. Random walk: one size for all channels, by restricted
likelihood, as that of the noise (`inercal.systems.turntable.noise`), and the walk itself by the first terms of its
series (Karhunen and Loeve). Samples within the dwells tell a slope too: where it agrees with that from dwell to dwell,
both are used.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inference.variances import degrees
from inercal.foundation.results.budget import TypeA
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.positions.faults import fraction
from inercal.systems.turntable.readings import Readings
from inercal.systems.turntable.regression import Effects, Regression
from inercal.systems.turntable.settings import BiasDrift

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
    walks = np.concatenate([_one(basis, k, channels) for k in range(channels)], axis=-1)
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


def _one(columns: Array, channel: int, channels: int) -> Array:
    """Columns (n, m) on one channel: (n, c, m)."""
    made = np.zeros((len(columns), channels, columns.shape[1]))
    made[:, channel] = columns
    return made


def _lowest(function: Callable[[float], float], grid: Array, tolerance: float) -> float:
    """Place at which a function is lowest: the lowest point of a grid, then a search about it."""
    from scipy.optimize import minimize_scalar

    best = int(np.argmin([function(x) for x in grid]))
    ends = grid[max(best - 1, 0)], grid[min(best + 1, len(grid) - 1)]
    return float(minimize_scalar(function, bounds=ends, method="bounded", options={"xatol": tolerance}).x)
