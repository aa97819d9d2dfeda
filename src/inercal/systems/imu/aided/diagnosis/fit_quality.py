"""Fit quality of the outputs of an IMU on a table: whitened residuals, and single blocks far off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.systems.imu.aided.fit import AidedFit, Sensor
from inercal.systems.imu.aided.walk import WhitenedColumns, whiten
from inercal.systems.imu.limits import LIMITS


@dataclass(frozen=True, eq=False)
class Whitening:
    """The fit as a judge: residuals whitened by the noise of the fit, less what its unknowns take up.

    ``basis`` (N, P) is orthonormal and spans what the P unknowns do to N whitened outputs and priors; ``factor`` (P, P)
    is triangular, of the unknowns in units of their priors. The levels of noise stay those of the fit: where a fault
    has raised them, its pattern still explains most of what the raised levels stand for.
    """

    fit: AidedFit
    basis: Array
    factor: Array

    def residuals(self, case: AidedFit) -> Array:
        """(N,) residuals."""
        unknowns = self.fit.unknowns
        prior = (unknowns.mean - self.fit.x) / unknowns.sd
        outputs = [whitened(sensor, sensor.equation.residual[:, None]).rows[1:, 0] for sensor in case.sensors]
        return self._left(np.concatenate([prior, *outputs]))

    def misfit(self, case: AidedFit) -> float:
        """Sum of squares."""
        return float(np.sum(self.residuals(case) ** 2))

    def observable(self, patterns: Sequence[Array]) -> Array:
        """Combinations (q, m) of patterns (n, q) in the outputs of each sensor that the unknowns do not absorb."""
        rows = self._rows(patterns)
        size = np.linalg.norm(rows, axis=0)
        size[size == 0.0] = 1.0
        _, s, Vt = np.linalg.svd(self._left(rows / size), full_matrices=False)
        some = s > LIMITS.told_share
        return np.asarray(Vt[some].T / s[some] / size[:, None])

    def change(self, patterns: Sequence[Array]) -> Array:
        """Change (P,) of the unknowns where a pattern (n,) is taken out of the outputs of each sensor."""
        rows = self._rows([pattern[:, None] for pattern in patterns])[:, 0]
        return np.asarray(-self.fit.unknowns.sd * np.linalg.solve(self.factor, self.basis.T @ rows))

    def _rows(self, patterns: Sequence[Array]) -> Array:
        """(N, q) whitened patterns; no prior sees them."""
        white = [whitened(*each).rows[1:] for each in zip(self.fit.sensors, patterns, strict=True)]
        return np.vstack([np.zeros((len(self.fit.x), patterns[0].shape[1])), *white])

    def _left(self, rows: Array) -> Array:
        """Residuals of rows (N, ...) after the unknowns."""
        return np.asarray(rows - self.basis @ (self.basis.T @ rows))


def whitening(fit: AidedFit) -> Whitening:
    """The judge of a fit."""
    P = len(fit.x)
    rows = [np.eye(P)]
    for sensor in fit.sensors:
        index, white = sensor.equation.index, sensor.whitened.rows[1:, :-1]
        wide = np.zeros((len(white), P))
        wide[:, index] = white * fit.unknowns.sd[index]
        rows.append(wide)
    Q, R = np.linalg.qr(np.vstack(rows))
    return Whitening(fit, Q, R)


def whitened(sensor: Sensor, columns: Array) -> WhitenedColumns:
    """Columns (n, c) of the output of a sensor, whitened by its noise."""
    t, length, resting = sensor.side.blocks.middle, sensor.side.blocks.length, sensor.side.blocks.resting
    return whiten(columns, t, sensor.noise.white(length, resting), sensor.noise.wander(t, length, resting))


def mean_bias(sensor: Sensor, pattern: Array) -> float:
    """Mean of the bias over the test that a pattern (n,) in the output of a sensor makes."""
    return float(whitened(sensor, pattern[:, None]).mean[0])


def without_patterns(fit: AidedFit, patterns: Sequence[Array]) -> AidedFit:
    """A fit whose outputs are less by a pattern (n,) for each sensor."""
    sensors = [
        replace(sensor, equation=replace(sensor.equation, residual=sensor.equation.residual - pattern))
        for sensor, pattern in zip(fit.sensors, patterns, strict=True)
    ]
    return replace(fit, sensors=sensors)


def variation(y: Array) -> float:
    """Root mean square of the variation of a triad's output (n, 3) along its axes."""
    return float(np.sqrt(np.max(np.var(y, axis=0))))


def knocks(fit: AidedFit) -> dict[str, NDArray[np.bool_]]:
    """By triad, blocks (n,) far off the median of the five around them, one or two in a row, if these are few."""
    by_triad: dict[str, NDArray[np.bool_]] = {}
    for sensor in fit.sensors:
        blocks, residual = sensor.side.blocks, sensor.residual
        near = np.lib.stride_tricks.sliding_window_view(np.pad(residual, 2, mode="edge"), 5)
        size = np.abs(residual - np.median(near, axis=1))
        least = LIMITS.knock_output_share * variation(blocks.y)
        far = np.zeros(len(size), dtype=bool)
        for kind in (blocks.resting, ~blocks.resting):
            if np.count_nonzero(kind) >= LIMITS.fewest_blocks:
                typical = np.median(size[kind]) / 0.6745
                limit = max(LIMITS.knock_sigmas * typical, least, LIMITS.knock_largest_share * np.max(size))
                far |= kind & (size > limit)
        triad = blocks.triad.sensor
        by_triad[triad] = by_triad.get(triad, False) | far

    def few(wrong: NDArray[np.bool_]) -> bool:
        return int(np.count_nonzero(wrong)) <= max(LIMITS.knocked_blocks, LIMITS.knocked_share * len(wrong))

    return {triad: wrong if few(wrong) else np.zeros_like(wrong) for triad, wrong in by_triad.items()}
