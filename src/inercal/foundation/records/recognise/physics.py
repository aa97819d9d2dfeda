"""Physics between columns: norms that are gravity's, and turns that accelerometers see as a gyro does."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.records.limits import LIMITS

G0 = 9.80665
"""Standard gravity [m/s^2]."""

SIZES = {
    "m/s^2": 1.0, "g": G0, "mg": G0 / 1000.0, "cm/s^2": 0.01,
    "rad/s": 1.0, "deg/s": np.pi / 180.0, "mrad/s": 1e-3, "mdeg/s": np.pi / 180e3, "deg/h": np.pi / 648e3,
}  # fmt: skip
"""Sizes of units in m/s^2 and rad/s."""

_COUNTS_OF_G = (
    16384,
    8192,
    4096,
    2048,
    1024,
    512,
    256,
    1000 / 0.061,
    1000 / 0.122,
    1000 / 0.244,
    1000 / 0.488,
    1000,
)
_STEPS = (
    131.072,
    131.0,
    65.5,
    32.8,
    16.4,
    14.375,
    1 / 0.00875,
    1 / 0.0175,
    1 / 0.035,
    1 / 0.07,
)  # in 1 deg/s
_STEADY = 0.08  # scatter of a norm over its median
_MOST = 20_000  # rows of a fit


def norm_of(triad: Array) -> tuple[float, float]:
    """Median norm of a triad (n, 3), and its scatter (median deviation) over that; 0 and infinite of none."""
    norm = np.linalg.norm(triad[np.isfinite(triad).all(axis=1)], axis=1)
    middle = float(np.median(norm)) if norm.size else 0.0
    return middle, float(np.median(np.abs(norm - middle)) / middle) if middle else np.inf


def is_whole(values: Array) -> bool:
    """True for whole numbers, as those of a converter."""
    return bool((values[np.isfinite(values)] % 1.0 == 0.0).all())


def is_direction(triad: Array) -> bool:
    """True for a triad (n, 3) of norm 1 in every row: directions, as normals of a surface, and no sensor."""
    norm, scatter = norm_of(triad)
    return scatter < 1e-5 and abs(norm - 1.0) < 1e-3


def gravity_unit(triad: Array) -> str:
    """The unit in which a steady norm of a triad (n, 3) is that of gravity, ``count`` of a converter's; else empty."""
    norm, scatter = norm_of(triad)
    if scatter > _STEADY or is_direction(triad):
        return ""
    if is_whole(triad):
        return "count" if min(abs(norm / counts - 1.0) for counts in _COUNTS_OF_G) < 0.06 else ""
    near = (("m/s^2", G0), ("g", 1.0), ("cm/s^2", 980.665), ("mg", 1000.0))
    unit, size = min(near, key=lambda each: abs(norm / each[1] - 1.0))
    return unit if abs(norm / size - 1.0) < 0.04 else ""


@dataclass(frozen=True)
class FreeSphere:
    """A sphere on which a triad lies: its ``centre`` (3,), its ``radius``, and the ``scatter`` about it, relative."""

    centre: tuple[float, float, float]
    radius: float
    scatter: float


def sphere(triad: Array) -> FreeSphere | None:
    """The sphere, its centre free, on which the rows of a triad (n, 3) lie that point all around; None of others.

    Rows far off, as those in motion, are left out: they are a third at most. What stays put lies on none.
    """
    rows = np.unique(triad[np.isfinite(triad).all(axis=1)], axis=0)
    rows = rows[:: max(1, len(rows) // _MOST)]
    if len(rows) < LIMITS.sphere_rows:
        return None
    middle, size = np.median(rows, axis=0), float(np.std(rows))
    if not size > 0.0:
        return None
    scaled = (rows - middle) / size
    used = np.ones(len(scaled), dtype=bool)
    for _ in range(4):
        design = np.column_stack([2.0 * scaled[used], np.ones(used.sum())])
        found = np.linalg.lstsq(design, (scaled[used] ** 2).sum(axis=1), rcond=None)[0]
        square = float(found[3] + found[:3] @ found[:3])
        if not square > 0.0:
            return None
        radius = np.sqrt(square)
        away = np.linalg.norm(scaled - found[:3], axis=1) / radius - 1.0
        scatter = float(np.median(np.abs(away[used])))
        used = np.abs(away) < max(6.0 * scatter, 1e-6)
        if used.sum() < max(LIMITS.sphere_rows, 2 * len(rows) // 3):
            return None
    directions = (scaled[used] - found[:3]) / radius
    around = float(np.linalg.eigvalsh(directions.T @ directions / len(directions))[0])
    if (
        scatter > LIMITS.sphere_scatter
        or around < LIMITS.sphere_moment
        or np.linalg.norm(directions.mean(axis=0)) > LIMITS.sphere_mean
    ):
        return None
    centre = middle + size * found[:3]
    return FreeSphere(tuple(centre.tolist()), size * float(radius), scatter)


@dataclass(frozen=True)
class SeenTurns:
    """A gyro as accelerometers see it turn: ``size`` [rad/s] of its unit, u its relative standard uncertainty, and for
    each axis of the gyro the accelerometers' axis (1 to 3, negative if reversed, 0 where gravity does not show it)."""

    size: float
    axes: tuple[int, int, int]
    u: float


def turns(acc: Array, gyro: Array, t: Array) -> SeenTurns | None:
    """Fit of a gyro (n, 3) to the turns of gravity in accelerometers (n, 3) at times ``t`` (n,) [s].

    With u the direction of the smoothed specific force, du = sum dt u x (M w + b) over windows that begin and end near
    one g: linear in M and b. A column of M counts where its spread is below 8 % of its length, 90 % of it lies on one
    axis, and windows of another length agree within 20 %. None where nothing such turns.
    """
    sound = np.flatnonzero(np.isfinite(acc).all(axis=1) & np.isfinite(gyro).all(axis=1) & np.isfinite(t))[
        :_MOST
    ]
    if len(sound) < 200:
        return None
    kernel = np.ones(5) / 5.0
    f, w = (
        np.stack([np.convolve(axis, kernel, "valid") for axis in triad[sound].T], axis=1)
        for triad in (acc, gyro)
    )
    norm = np.linalg.norm(f, axis=1)
    middle, scale = float(np.median(norm)), float(np.std(w))
    step = np.clip(np.diff(t[sound][2:-2], append=t[sound][-3]), 0.0, None)
    if not middle > 0.0 or not scale > 0.0 or not (step > 0.0).any():
        return None
    typical = float(np.median(step[step > 0.0]))
    u = f / np.maximum(norm, 1e-9 * middle)[:, np.newaxis]
    cross = np.stack([np.cross(u, axis) for axis in np.eye(3)], axis=2)
    summands = (cross[:, :, :, np.newaxis] * (w / scale)[:, np.newaxis, np.newaxis, :]).reshape(len(u), 3, 9)
    summands = np.concatenate([summands, cross], axis=2) * (step / typical)[:, np.newaxis, np.newaxis]
    fits = [
        fit
        for length in (10, 30, 100)
        if (fit := _fit(summands, u, norm / middle, step / typical, length)) is not None
    ]
    if not fits:
        return None
    fits.sort(key=_doubt)
    matrix, spread = fits[0]
    sizes = np.linalg.norm(matrix, axis=0)
    axes = [_axis(matrix, spread, column, [other for other, _ in fits[1:]]) for column in range(3)]
    seen = [float(size) for size, axis in zip(sizes, axes, strict=True) if axis]
    places = [abs(axis) for axis in axes if axis]
    if not seen or max(seen) > 1.2 * min(seen) or len(set(places)) < len(places):
        return None
    doubt = max(float(spread[:, column].max() / sizes[column]) for column in range(3) if axes[column])
    return SeenTurns(float(np.median(seen)) / scale / typical, (axes[0], axes[1], axes[2]), max(doubt, 0.01))


def _doubt(fit: tuple[Array, Array]) -> float:
    """The second smallest relative spread among the three columns of a fit."""
    matrix, spread = fit
    return float(np.sort(spread.max(axis=0) / np.maximum(np.linalg.norm(matrix, axis=0), 1e-30))[1])


def _axis(matrix: Array, spread: Array, column: int, others: list[Array]) -> int:
    """The accelerometers' axis about which one of the gyro turns, 0 if that is not seen."""
    length = np.linalg.norm(matrix[:, column])
    place = int(np.argmax(np.abs(matrix[:, column])))
    agreed = any(np.linalg.norm(other[:, column] - matrix[:, column]) < 0.2 * length for other in others)
    good = spread[:, column].max() < 0.08 * length and abs(matrix[place, column]) > 0.9 * length
    return (place + 1) * int(np.sign(matrix[place, column])) if good and agreed else 0


def _fit(summands: Array, u: Array, norm: Array, step: Array, length: int) -> tuple[Array, Array] | None:
    """One fit over windows of so many rows: the matrix and its spread; None of too few that turn."""
    edges = np.arange(0, len(u), length)
    if len(edges) < 15:
        return None
    sums = np.add.reduceat(summands, edges, axis=0)[:-1]
    moved = u[edges[1:]] - u[edges[:-1]]
    still = (np.abs(norm[edges[1:]] - 1.0) < 0.1) & (np.abs(norm[edges[:-1]] - 1.0) < 0.1)
    use = still & (np.maximum.reduceat(step, edges)[:-1] < 5.0)  # not over gaps
    if use.sum() < 12 or (np.linalg.norm(moved[use], axis=1) > 0.05).sum() < 4:
        return None
    design, target = sums[use].reshape(-1, 12), moved[use].reshape(-1)
    solution: Array = np.asarray(np.linalg.lstsq(design, target, rcond=1e-9)[0], dtype=np.float64)
    left = target - design @ solution
    variance = float(left @ left) / max(len(target) - 12, 1)
    covariance = variance * np.linalg.pinv(design.T @ design)
    spread: Array = np.sqrt(np.abs(np.diag(covariance)[:9])).reshape(3, 3)
    matrix: Array = solution[:9].reshape(3, 3)
    return matrix, spread


def lattice_unit(values: Array) -> str:
    """``deg/s`` or ``rad/s`` where all ``values`` lie on the steps of a common converter written in it; else empty."""
    places = np.unique(values[np.isfinite(values)])[:5000]
    digits = next(
        (d for d in range(1, 9) if (np.abs(places * 10.0**d - np.round(places * 10.0**d)) < 1e-4).all()), 0
    )
    if not digits or len(places) < 8:
        return ""
    for unit in ("deg/s", "rad/s"):
        for counts in _STEPS:
            step = (1.0 if unit == "deg/s" else SIZES["deg/s"]) / counts
            room = 0.5 * 10.0**-digits / step
            if room < 0.15 and (np.abs(places / step - np.round(places / step)) < 1.05 * room + 1e-6).all():
                return unit
    return ""
