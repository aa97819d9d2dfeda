"""Gyros across the turning axis in a rate test: what they see of its rate is their misalignment.

Of gyro i while the table turns about axis k of the instrument::

    y = D_F_i + S_i (x_i + T_ik w_k)

x_i the rate about its axis as the table and the Earth make it, w_k that about the turning axis. At nearly no rate about
its own axis, such a gyro does not tell S_i: the study states it.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.positions.outcome import unit_of_term
from inercal.systems.turntable.rate.fit import ROUNDS, GyroRateFit, weighted, weights_of
from inercal.systems.turntable.rate.stays import Effect, Input, RateDwells, gyro_input
from inercal.systems.turntable.regression import FLOOR
from inercal.systems.turntable.settings import TurntableSettings
from inercal.systems.turntable.weights import scatter


def axis_about(along: Array) -> str:
    """Axis of the instrument along which the turning axis (n, 3) lies in all stays; empty where there is none."""
    for k, axis in enumerate("xyz"):
        if np.abs(np.delete(along, k, axis=1)).max() < LIMITS.across_cosine:
            return axis
    return ""


def fit_across(
    dwells: RateDwells, settings: TurntableSettings, axis: str, about: str
) -> tuple[Input, GyroRateFit]:
    """Bias and misalignment of a gyro that lies across the turning axis.

    Parameters
    ----------
    dwells : RateDwells
    settings : TurntableSettings
        With S of the gyro among the stated coefficients; it counts with its standard uncertainty.
    axis, about : str
        ``x``, ``y`` or ``z`` of the gyro, and of the instrument along the turning axis.

    Returns
    -------
    Input
        Of the gyro; S and the rate of the table are among its effects.
    RateFit
        D_F and T; its residuals are those of the fit.
    """
    instrument, test = settings.instrument, settings.rate_test
    assert test is not None
    S = instrument.coefficients[f"S_{axis}"]
    given, w = (
        gyro_input(dwells, settings, "xyz".index(axis)),
        gyro_input(dwells, settings, "xyz".index(about)),
    )
    y = dwells.y[:, dwells.channels.index(f"gyro_{axis}")]
    rest, n = y - S * given.x, len(y)
    rows = np.column_stack([np.ones(n), S * w.x])
    floor = FLOOR * float(np.sqrt(np.mean(np.square(y))) or 1.0)
    D, T = np.linalg.lstsq(rows, rest, rcond=None)[0]
    for _ in range(ROUNDS):
        own = _with_scales(given, dwells, settings, axis, T, w)
        weight = weights_of(own.effects, S, n)
        noise = scatter(rows[:, None, :], rest[:, None], weight, [instrument.noise], np.array([floor]))
        solution = weighted(rows, rest, weight, float(noise.std[0]))
        D, T = solution.c
    gain = solution.gain[:, :, 0]
    fit = GyroRateFit(
        axis,
        (f"D_F_{axis}", f"T_{axis}{about}"),
        np.array([D, T]),
        (),
        gain,
        S,
        rest - rows @ solution.c,
        np.eye(n) - rows @ gain,
        float(noise.std[0]),
        float(noise.dof[0]),
        solution.chi2,
        n - 2,
        np.arange(n),
    )
    return own, fit


def _with_scales(
    given: Input, dwells: RateDwells, settings: TurntableSettings, axis: str, T: float, w: Input
) -> Input:
    """The input with what T makes of the uncertain rate of the table, and of a stated S that is uncertain."""
    test, instrument, S = settings.rate_test, settings.instrument, f"S_{axis}"
    assert test is not None
    effects = [each for each in given.effects if each.source != "rate of the table"]
    if test.rate_u > 0.0:
        shift = dwells.rate * (given.gain + T * w.gain) * test.rate_u
        effects.append(Effect("rate of the table", test.rate_u, "1", shift[:, None]))
    if u := instrument.coefficients_u.get(S, 0.0):
        shift = (given.x + T * w.x) * (u / instrument.coefficients[S])
        effects.append(Effect(f"stated {S}", u, unit_of_term(S, dwells.unit.si), shift[:, None]))
    return replace(given, effects=tuple(effects))


def excess_across(fit: GyroRateFit) -> list[Finding]:
    """A finding where the readings scatter about the straight line by more than their stated noise."""
    from scipy.special import chdtrc

    if fit.dof < 1 or np.isfinite(fit.noise_dof) or chdtrc(fit.dof, fit.chi2) >= LIMITS.misfit_probability:
        return []
    text = (
        f"gyro_{fit.axis} misses the straight line over the rate of the table by {np.sqrt(fit.chi2 / fit.dof):.1f} "
        f"times what the stated noise and the table explain: {fit.names[1]} may be off"
    )
    return [Finding("excess_scatter", text, harm=fit.names)]
