"""Small faults of a test on a table: their patterns in its residuals, and the effect of each.

Wrong signs, units and axes were found before the fit (`inercal.systems.imu.aided.diagnosis.gross`). Each
pattern (`inercal.systems.imu.aided.diagnosis.small`) is tested as an added variable, the score test of
`inercal.foundation.inference.hypotheses`: by how much the weighted sum of squares falls if its amplitudes are estimated
with all the rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.inference.hypotheses import search
from inercal.systems.imu.aided.diagnosis.fit_quality import mean_bias, variation, whitening
from inercal.systems.imu.aided.diagnosis.small import constant_errors
from inercal.systems.imu.aided.fit import AidedFit, noise_of
from inercal.systems.imu.aided.table import TableMotion
from inercal.systems.imu.limits import LIMITS


@dataclass(frozen=True, eq=False)
class Misfit:
    """A fault that is in the data, as the ``finding`` says it.

    ``shift`` (p,) of the coefficients if it is fitted with them; ``part`` the rms of what it does to the outputs, the
    ``patterns`` (n,) of each sensor, over the variation of these.
    """

    finding: Finding
    shift: Array
    part: float
    patterns: tuple[Array, ...]


def misfits(
    fit: AidedFit, names: tuple[str, ...], rows: Array, motion: TableMotion, gravity: float
) -> list[Misfit]:
    """Faults that are in the residuals, the most certain first.

    Parameters
    ----------
    fit : Fit
    names : (p,)
        Of the coefficients.
    rows : (p, P)
        Their derivatives by the unknowns, as from `coefficients`.
    motion : Motion
        Of the table.
    gravity : float
        Of the site [m/s^2].
    """
    judge = whitening(fit)
    errors = list(constant_errors(fit, motion, gravity, judge))
    fitted, _ = search(fit, lambda _: errors, judge, LIMITS.misfit_risk, LIMITS.misfits)
    named = []
    for each in fitted:
        without = each.hypothesis.without(fit, each.values)
        pairs = zip(fit.sensors, without.sensors, strict=True)
        patterns = [before.equation.residual - after.equation.residual for before, after in pairs]
        part, change = _part(fit, patterns), judge.change(patterns)
        if part >= LIMITS.faint_share and _explains(fit, without, change):
            shift = rows @ change - _biases(fit, names, patterns)
            named.append(Misfit(each.finding, shift, part, tuple(patterns)))
    return named


def _biases(fit: AidedFit, names: tuple[str, ...], patterns: Sequence[Array]) -> Array:
    """Means (p,) of patterns in the biases of the sensors."""
    means = np.zeros(len(names))
    for k, (sensor, pattern) in enumerate(zip(fit.sensors, patterns, strict=True)):
        bias = f"{'K0' if sensor.side.sensor == 'acc' else 'D_F'}_{'xyz'[k % 3]}"
        means[names.index(bias)] = mean_bias(sensor, pattern)
    return means


def _explains(fit: AidedFit, without: AidedFit, change: Array) -> bool:
    """True where outputs that shift in turns no longer do, or hardly, once a fault is taken out."""
    before = after = 0.0
    for sensor, other in zip(fit.sensors, without.sensors, strict=True):
        left = other.equation.residual
        if sensor.noise.excess > 0.0 and np.any(left != sensor.equation.residual):
            equation = replace(
                sensor.equation, residual=left - sensor.equation.columns @ change[sensor.equation.index]
            )
            before += sensor.noise.excess
            _, apart = noise_of(sensor.side, equation, fit.unknowns, fit.x + change)
            after += apart.excess
    return after <= LIMITS.excess_left * before


def _part(fit: AidedFit, patterns: Sequence[Array]) -> float:
    """Largest rms of a pattern in an output, over the variation of its triad."""
    pairs = zip(fit.sensors, patterns, strict=True)
    return max(float(np.std(pattern) / variation(sensor.side.blocks.y)) for sensor, pattern in pairs)
