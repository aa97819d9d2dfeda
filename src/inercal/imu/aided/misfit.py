"""Tests of fit: whether a fault's pattern is in the residuals, and what it does to the coefficients.

Each pattern is tested as an added variable (the score test: Breusch and Pagan, Review of Economic Studies 47 (1980)
239): by how much the weighted sum of squares falls if its amplitudes are estimated with all the rest. The levels of
noise stay those of the fit. Where a fault has raised them the fall is still large, as the pattern then explains most of
what the raised levels stand for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from inercal.arrays import Array
from inercal.imu.aided.faults import Fault
from inercal.imu.aided.fit import Fit, noise_of
from inercal.imu.aided.walk import whiten
from inercal.imu.limits import LIMITS

SIGNIFICANCE = 1e-6
"""Probability of a fall of the sum of squares by chance, below which a fault is named."""

STILL_THERE = 0.3
"""Part of the likelihood's gain by outputs that shift in turns, which a fault may leave if it is to explain them."""

FAINT = 1e-6
"""Change of the outputs over their variation that is left to rounding."""

ALIKE = 1e-3
"""Part of a pattern that the other unknowns have to leave for it to be told from them."""

MOST = 3
"""Faults named at most."""


KNOCK = 12.0
"""Distance of a block from its neighbours, over the robust standard deviation of that at rest or in turns, that is a
knock."""

LEAST_KNOCK = 0.02
"""Distance over the variation of the triad's output below which no block is left out."""

FEW = 0.01
"""Part of the blocks that knocks may be; more are no knocks."""


@dataclass(frozen=True, eq=False)
class Misfit:
    """A fault that is in the data.

    ``shift`` (p,) of the coefficients if it is fitted with them; ``part`` the rms of what it does to the outputs over
    the variation of these.
    """

    code: str
    message: str
    shift: Array
    part: float


def misfits(fit: Fit, names: tuple[str, ...], rows: Array, candidates: Sequence[Fault]) -> list[Misfit]:
    """The faults that are in the residuals, the most certain first.

    Parameters
    ----------
    fit : Fit
    names : (p,)
        Of the coefficients.
    rows : (p, P)
        Their derivatives by the unknowns, as from `coefficients`.
    candidates : sequence of Fault
    """
    ends = np.cumsum([0, *(fault.width for fault in candidates)])
    places = [np.arange(a, b) for a, b in pairwise(ends)]
    added = _added(fit, names, candidates, places)
    right, basis = added.right, np.zeros((len(added.right), 0))
    found: list[Misfit] = []
    for _ in range(MOST):
        tried = [_tried(added.left[:, place], basis, right) for place in places]
        k = int(np.argmax([each.rarity for each in tried]))
        best, fault, place = tried[k], candidates[k], places[k]
        if best.rarity < -math.log(SIGNIFICANCE):
            break
        right, basis = right - best.basis @ (best.basis.T @ right), np.hstack([basis, best.basis])
        amplitudes = best.amplitudes / added.size[place]
        part = _part(fit, fault, amplitudes)
        dx = -fit.unknowns.sd * np.linalg.solve(added.upper, added.cross[:, place] @ best.amplitudes)
        if part < FAINT or not _explains(fit, fault, amplitudes, dx):
            continue
        shift = rows @ dx - added.means[:, place] @ best.amplitudes
        found.append(Misfit(fault.code, fault.words(amplitudes), shift, part))
    return found


@dataclass(frozen=True, eq=False)
class _Added:
    """Triangular factor of the fit with all patterns added, each of ``size`` (Q,) before it was scaled to 1.

    ``upper`` (P, P) of the unknowns, ``cross`` (P, Q), ``left`` (Q + 1, Q) what they leave of the patterns, ``right``
    (Q + 1,) of the residuals; ``means`` (p, Q) means of the patterns in the biases.
    """

    upper: Array
    cross: Array
    left: Array
    right: Array
    means: Array
    size: Array


def _added(
    fit: Fit, names: tuple[str, ...], candidates: Sequence[Fault], places: Sequence[NDArray[np.int64]]
) -> _Added:
    """Whiten the patterns and stack them beside the equations of the fit."""
    known = fit.unknowns
    P, Q = len(fit.x), int(places[-1][-1]) + 1
    stacked = [np.hstack([np.eye(P), np.zeros((P, Q)), ((known.mean - fit.x) / known.sd)[:, None]])]
    means = np.zeros((len(names), Q))
    for k, sensor in enumerate(fit.sensors):
        patterns = np.zeros((len(sensor.residual), Q))
        for fault, place in zip(candidates, places, strict=True):
            own = fault.columns[k]
            if own is not None:
                patterns[:, place] = own
        blocks, index = sensor.side.blocks, sensor.equation.index
        t, length, resting = blocks.middle, blocks.length, blocks.resting
        columns = np.column_stack([sensor.equation.columns, patterns, sensor.equation.residual])
        done = whiten(
            columns, t, sensor.noise.white(length, resting), sensor.noise.wander(t, length, resting)
        )
        small: Array = np.asarray(np.linalg.qr(done.rows[1:], mode="r"))
        wide = np.zeros((len(small), P + Q + 1))
        wide[:, index] = small[:, : len(index)] * known.sd[index]
        wide[:, P:] = small[:, len(index) :]
        stacked.append(wide)
        bias = f"{'K0' if sensor.side.sensor == 'acc' else 'D_F'}_{'xyz'[k % 3]}"
        means[names.index(bias)] = done.mean[len(index) : -1]
    whole = np.vstack(stacked)
    size = np.linalg.norm(whole[:, P:-1], axis=0)
    size[size == 0.0] = 1.0
    whole[:, P:-1] /= size
    R: Array = np.asarray(np.linalg.qr(whole, mode="r"))
    return _Added(R[:P, :P], R[:P, P:-1], R[P:, P:-1], R[P:, -1], means / size, size)


@dataclass(frozen=True, eq=False)
class _Tried:
    """A pattern by itself: minus the log of the probability of what it explains, its amplitudes, what it takes up."""

    rarity: float
    amplitudes: Array
    basis: Array


def _tried(columns: Array, basis: Array, right: Array) -> _Tried:
    """Fit ``right`` by ``columns``, beside what ``basis`` has already taken."""
    from scipy.special import gammaincc

    U, s, Vt = np.linalg.svd(columns - basis @ (basis.T @ columns), full_matrices=False)
    some = s > ALIKE
    told = U[:, some].T @ right
    fall = float(told @ told)
    if not some.any():
        return _Tried(0.0, np.zeros(columns.shape[1]), U[:, some])
    a, x = float(0.5 * np.count_nonzero(some)), 0.5 * fall
    p = float(gammaincc(a, x))
    rarity = -math.log(p) if p > 0.0 else x - (a - 1.0) * math.log(x) + math.lgamma(a)
    return _Tried(rarity, Vt[some].T @ (told / s[some]), U[:, some])


def _explains(fit: Fit, fault: Fault, amplitudes: Array, dx: Array) -> bool:
    """Whether outputs that shift in turns no longer do, or hardly, once a fault is allowed for."""
    before = after = 0.0
    for sensor, columns in zip(fit.sensors, fault.columns, strict=True):
        if columns is not None and sensor.noise.excess > 0.0:
            equation = sensor.equation
            left = equation.residual - equation.columns @ dx[equation.index] - columns @ amplitudes
            before += sensor.noise.excess
            _, apart = noise_of(sensor.side, replace(equation, residual=left), fit.unknowns, fit.x + dx)
            after += apart.excess
    return after <= STILL_THERE * before


def _part(fit: Fit, fault: Fault, amplitudes: Array) -> float:
    """Largest rms of what a fault does to an output, over the variation of its triad."""
    parts = [0.0]
    for sensor, columns in zip(fit.sensors, fault.columns, strict=True):
        if columns is not None:
            blocks = sensor.side.blocks
            parts.append(float(np.std(columns @ amplitudes) / variation(blocks.y)))
    return max(parts)


def variation(y: Array) -> float:
    """Root mean square of the variation of a triad's output (n, 3) along its axes."""
    return float(np.sqrt(np.max(np.var(y, axis=0))))


def knocks(fit: Fit) -> dict[str, NDArray[np.bool_]]:
    """By triad, blocks (n,) far off the median of the five around them, one or two in a row, if these are few."""
    found: dict[str, NDArray[np.bool_]] = {}
    for sensor in fit.sensors:
        blocks, residual = sensor.side.blocks, sensor.residual
        near = np.lib.stride_tricks.sliding_window_view(np.pad(residual, 2, mode="edge"), 5)
        size = np.abs(residual - np.median(near, axis=1))
        least = LEAST_KNOCK * variation(blocks.y)
        far = np.zeros(len(size), dtype=bool)
        for kind in (blocks.resting, ~blocks.resting):
            if np.count_nonzero(kind) >= LIMITS.fewest_blocks:
                far |= kind & (size > max(KNOCK * np.median(size[kind]) / 0.6745, least, 0.2 * np.max(size)))
        triad = blocks.triad.sensor
        found[triad] = found.get(triad, False) | far
    return {
        triad: wrong if np.count_nonzero(wrong) <= max(3, FEW * len(wrong)) else np.zeros_like(wrong)
        for triad, wrong in found.items()
    }
