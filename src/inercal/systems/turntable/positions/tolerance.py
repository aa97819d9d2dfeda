"""Share of each error of the table in each coefficient, and the effect of halving it.

Goal-oriented shares: the part of the variance of a coefficient, or of the mean square of the predicted output
over the sphere, that each error of the table causes. For one that stays constant it is
``std^2 ||T G J_k||^2``, for one redrawn at each position ``std^2 ||T G diag(J_k)||^2``, with G the gain of the fit,
J_k the derivatives of the readings and T one row for each coefficient.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.instruments.by_angle import ChannelModel
from inercal.foundation.rigs.chain import Chain, Scope
from inercal.systems.turntable.model import TableModel
from inercal.systems.turntable.regression import Regression, solve
from inercal.systems.turntable.weights import averaged, least_noise, weights_of


def shifts(fit: Regression) -> tuple[Array, ...]:
    """Shift (p, q) of the linear coefficients by one standard deviation of each error of the table.

    q is the number of values that the error takes: 1 if it is constant, that of the positions if it is redrawn there.
    """
    chain, by_error = fit.model.chain, []
    slopes = averaged(chain, fit.slopes, fit.samples)
    for k, (error, numbers) in enumerate(zip(chain.errors, chain.groups(fit.angles), strict=True)):
        each = np.einsum("pnc,nc->pn", fit.gain, slopes[..., k]) * error.distribution.std
        by_value = np.zeros((len(each), int(numbers.max()) + 1))
        np.add.at(by_value.T, numbers, each.T)
        by_error.append(by_value)
    return tuple(by_error)


def coefficient_shares(fit: Regression, slope: Array) -> dict[str, dict[str, float]]:
    """Share of each error of the table in the table's part of the variance of each term.

    ``slope`` (p, p) derivatives of the terms with respect to the linear coefficients. The shares of a term sum
    to one; a term that the table does not touch has none.
    """
    variances = [np.square(slope @ shift).sum(axis=1) for shift in shifts(fit)]
    parts = np.array(variances).reshape(-1, len(fit.c))
    return {symbol: _shares(fit.model.chain, parts[:, j]) for j, symbol in enumerate(fit.model.symbols)}


def drift_shares(fit: Regression) -> dict[str, float]:
    """Share of each error of the table in the table's part of the mean square error of the predicted output.

    The mean is over all directions of gravity and over the channels; earth rate takes no part.
    """
    B = sphere_moments(fit.model)
    parts = np.array([np.einsum("pq,pr,rq->", shift, B, shift) for shift in shifts(fit)])
    return _shares(fit.model.chain, parts)


def _shares(chain: Chain, parts: Array) -> dict[str, float]:
    """Parts (k,) over their sum, by name of the error."""
    whole = float(parts.sum())
    if not whole > 0.0:
        return {}
    return {name: float(part / whole) for name, part in zip(chain.factors, parts, strict=True)}


def sphere_moments(model: TableModel) -> Array:
    """Mean products (p, p) of the regressors over all directions of a; zero where a rate takes part.

    ``c^T B c`` is the mean square over the sphere, summed over the channels, of the output that coefficients c
    predict.
    """
    rows = sphere_rows(model)
    flat = rows.reshape(-1, len(model.symbols))
    return np.asarray(flat.T @ flat / len(rows))


def sphere_rows(model: TableModel) -> Array:
    """Regressors (r, channels, p) at directions of a, each times the root of its weight, the mean of which is one.

    Terms of rates have zeros.

    Gauss-Legendre in the height times even steps in longitude integrates products of polynomials up to order 15
    exactly; only the magnitude in Koq is not one, and is good to a few per mille.
    """
    height, weight = np.polynomial.legendre.leggauss(8)
    longitude = 2.0 * np.pi * (np.arange(16) + 0.5) / 16
    ring = np.sqrt(1.0 - height**2)[:, None]
    directions = np.stack(
        np.broadcast_arrays(ring * np.cos(longitude), ring * np.sin(longitude), height[:, None]), axis=-1
    )
    a = directions.reshape(-1, 3) * np.linalg.norm(model.a_n)
    root = np.sqrt(np.repeat(0.5 * weight * len(weight), 16))[:, None]
    rows = np.zeros((len(a), len(model.channels), len(model.symbols)))
    for k, (channel, block) in enumerate(zip(model.channels, model.blocks, strict=True)):
        rows[:, k, block] = root * channel.regressors(a, np.zeros(3)) * _without_rate(channel)
    return rows


def _without_rate(channel: ChannelModel) -> Array:
    """1 for the terms (p,) without a rate, else 0."""
    return np.array([0.0 if each.of_rate else 1.0 for each in channel.monomials])


@dataclass(frozen=True)
class Alternatives:
    """Standard uncertainties of the terms, were the table otherwise.

    ``halved`` by error: if its tolerance were half; ``scopes`` ``random``: all errors redrawn at each position,
    ``constant``: all constant over the test, ``stated``: as they are.
    """

    halved: Mapping[str, Array]
    scopes: Mapping[str, Array]


def alternatives(fit: Regression, slope: Array) -> Alternatives:
    """Uncertainties with each tolerance halved, and with other scopes; the fit is weighted anew each time.

    ``slope`` (p, p) of the terms as reported by the linear coefficients; u is of those, in the unit of the fit.
    """
    chain, rows, p = fit.model.chain, fit.rows, len(fit.c)

    def u(changed: Chain) -> Array:
        table = weights_of(changed, fit.slopes, fit.angles, fit.beside, np.zeros_like(fit.noise), fit.samples)
        noise = np.maximum(fit.noise, least_noise(table.within))
        weight = replace(table, within=table.within + np.diag(np.square(noise))).with_common(
            fit.effects.random
        )
        root = solve(rows, np.zeros_like(fit.residuals), weight).root
        return np.asarray(np.linalg.norm(slope @ root[:p], axis=1))

    halved = {
        error.name: u(chain.with_errors(replace(error, distribution=error.distribution.scaled(0.5))))
        for error in chain.errors
    }
    scopes = {
        "stated": u(chain),
        "random": u(chain.with_scope(Scope.POSITION)),
        "constant": u(chain.with_scope(Scope.RIG)),
    }
    return Alternatives(halved, scopes)
