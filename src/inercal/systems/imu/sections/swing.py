"""A swing: nothing rests, but specific force has the size of gravity in every short window, whatever its direction.

Outputs of the accelerometers are y = K0 + K1 M f, with M of unit diagonal and zeros below it: the accelerometers define
the frame. What a hand adds to gravity scatters, it does so alike in neighbouring windows, and knocks must not count:
Student's distribution gives the weights, and the residuals tell its size and how far neighbours are correlated.

In units of gravity, a turn by theta within a window shortens its mean by theta^2/24, and a scatter s lengthens |f| by
s^2. With a gyro the arm from the pivot of the turning to the sensors is unknown, too; without one what it adds goes
into u(K0).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Final, NamedTuple

import numpy as np
from scipy.special import chdtri, ndtri

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.errors import RecordError
from inercal.systems.imu.sections.limits import LIMITS
from inercal.systems.imu.sections.priors import Priors, Size
from inercal.systems.imu.sections.readings import Flags, Places
from inercal.systems.imu.sections.sphere import Sphere, sphere
from inercal.systems.imu.sections.unknowns import Values

NAMES: Final = (*(f"K0_{i}" for i in "xyz"), *(f"K1_{i}" for i in "xyz"), "M_xy", "M_xz", "M_yz")
"""Coefficients of a swing in their order."""

_NU: Final = 4.0
"""Degrees of freedom of Student's distribution."""

_NORMAL: Final = 1.4
"""Variance of a normal scatter over the square of the scale that Student's distribution finds in it."""

_BIAS, _SCALE, _OFF, _GRAVITY, _ARM = slice(0, 3), slice(3, 6), slice(6, 9), 9, slice(10, 13)
"""Unknowns: K0 over what gravity makes of the scale, relative errors of K1, M, that of gravity, arm [m]."""


class OutlyingWindow(NamedTuple):
    """A window that a swing does not explain: its first ``row``, counted from 0, and by how many scatters it is off."""

    row: int
    sigmas: float


@short_repr
@dataclass(frozen=True, eq=False)
class SwingCalibration:
    """Accelerometers by a swing: ``x`` (9,) with ``u`` and ``covariance`` (9, 9), by `NAMES`, in outputs and SI."""

    x: Array
    u: Array
    covariance: Array
    by_prior: tuple[str, ...]
    """Terms of which the directions say less than what was known before."""
    refusal: str
    """Why none of this can be used, in words; empty where it can."""
    scatter: float
    """Robust standard deviation of the size of specific force [m/s^2]."""
    correlation: float
    """Factor on u^2 by the correlation of neighbouring windows."""
    windows: int
    """Windows used."""
    length: int
    """Samples in a window."""
    spread: Array
    """Range (3,) of the direction of specific force along x, y, z: 2 where both sides were up."""
    outlying: tuple[OutlyingWindow, ...]
    """Windows beyond chance, the farthest first, no more than are worth naming."""
    outlying_count: int
    """All of these."""
    arm: Array | None
    """Arm (3,) from the pivot of the turning to the sensors [m]; None without a gyro."""

    def force(self, acc: Array) -> Array:
        """Specific force (n, 3) [m/s^2] of outputs (n, 3)."""
        M = np.eye(3)
        M[[0, 0, 1], [1, 2, 2]] = self.x[6:]
        return np.asarray((acc - self.x[:3]) / self.x[3:6] @ np.linalg.inv(M).T)


@dataclass(frozen=True, eq=False)
class _SwingWindows:
    """Mean outputs ``mean`` (m, 3) of windows of ``length`` samples from rows ``first`` (m,) on, the part ``short``
    (m,) by which turning shortens them, what a metre of ``arm`` (m, 3, 3) adds over gravity, and the typical rate of
    turning ``speed`` [rad/s]."""

    mean: Array
    first: Places
    length: int
    short: Array
    arm: Array
    speed: float


@dataclass(frozen=True, eq=False)
class _SwingFit:
    """Unknowns ``p`` (13,) with the scale ``s`` of their scatter, and at them residuals, weights, normal matrix and
    correlation factor."""

    p: Array
    s: float
    e: Array
    weights: Array
    normal: Array
    more: float


def swing_calibration(
    acc: Array, priors: Priors, where: str, rate: float | None = None, gyro: Array | None = None
) -> SwingCalibration:
    """Calibrate accelerometers by a stretch, or single rows, in which nothing needs to rest.

    Parameters
    ----------
    acc : (n, 3)
        Outputs of the accelerometers; rows with NaN do not count.
    priors : Priors
        Gravity, the scale of the accelerometers, and the size of misalignments.
    where : str
        The file.
    rate : float, optional
        Samples in a second [Hz]; None for rows without times, each of which counts alone.
    gyro : (n, 3), optional
        Rate of turn [rad/s] on the axes of the accelerometers, within some 5 %; only with ``rate``.

    Raises
    ------
    RecordError
        Too few windows, or all alike.
    """
    g, scale = priors.site.gravity, priors.acc_scale
    if scale is not None and not np.isfinite(scale.spread):
        scale = None
    radius = None if scale is None else Size(scale.median * g, scale.spread)
    know = rate is not None and gyro is not None
    short = _means(acc, 1 if rate is None else max(1, round(LIMITS.swing_window * rate)))
    short = short[np.isfinite(short).all(axis=1)]
    if len(short) < LIMITS.fewest_windows:
        raise RecordError(
            where,
            f"found {len(short)} usable windows of the accelerometers, expected at least {LIMITS.fewest_windows} in "
            "many directions: record longer, or add rows",
        )
    start, refusal = sphere(short, radius), ""
    if radius is not None and start.miss > LIMITS.wrong_unit:
        other = sphere(short, None)
        if other.miss < LIMITS.better_sphere * start.miss:
            scale, start = None, other
            refusal = "the outputs are in another unit than is said, or not of accelerometers"
    if not np.isfinite(start.miss):
        raise RecordError(
            where,
            "the outputs of the accelerometers hardly change, expected gravity along each of their axes in turn",
        )
    windows = _windows(acc, rate, gyro if know else None, start, g)
    if len(windows.mean) < LIMITS.fewest_windows:
        raise RecordError(
            where,
            f"the instrument turns by more than {np.degrees(LIMITS.swing_turn):.0f} deg within "
            f"{windows.length} samples almost everywhere: record it faster, or turn it more slowly",
        )
    typical = start.radius / g if scale is None else scale.median
    sd = np.full(13, np.inf)
    sd[_SCALE], sd[_OFF], sd[_ARM] = (
        LIMITS.alike if scale is None else scale.spread,
        priors.misalignment,
        LIMITS.hand_arm,
    )
    sd[_GRAVITY] = max(np.sqrt(sum((i.u * i.sensitivity) ** 2 for i in priors.site.inputs)) / g, 1e-7)
    prior = np.diag(np.where(np.isfinite(sd), sd**2, 0.0))
    if scale is None:
        prior[_SCALE, _SCALE] += 1.0  # their common size is open
    free = np.ones(13, dtype=bool)
    free[_ARM] = know
    in_units = replace(windows, mean=windows.mean / (typical * g), arm=windows.arm / g)
    guess = np.concatenate(
        [start.centre / (typical * g), np.full(3, start.radius / (typical * g) - 1.0), np.zeros(7)]
    )
    fitted, P = _fitted(in_units, guess, max(1.5 * start.miss, 1e-5), prior, free)
    return _result(in_units, fitted, P, prior, free, typical, g, refusal, blind=rate is not None and not know)


def _means(y: Array, length: int) -> Array:
    """Means (m, 3) of consecutive ``length`` rows of y (n, 3)."""
    return np.asarray(y[: len(y) // length * length].reshape(-1, length, 3).mean(axis=1))


def _windows(
    acc: Array, rate: float | None, gyro: Array | None, start: Sphere, gravity: float
) -> _SwingWindows:
    """Windows short enough for the turning that the gyro tells, or directions over 0.2 s."""
    n, speed = 1, 0.0
    if rate is not None:
        n = max(1, round(LIMITS.swing_window * rate))
        direction = _means(acc, n) - start.centre
        direction /= np.linalg.norm(direction, axis=1, keepdims=True)
        lag = min(max(1, round(0.2 * rate / n)), len(direction) - 1)
        chord = np.linalg.norm(direction[lag:] - direction[:-lag], axis=1)
        turning = 2.0 * np.arcsin(np.minimum(0.5 * chord, 1.0)) / (lag * n / rate)
        speed = float(
            np.sqrt(1.5 * np.nanmedian(turning**2) / np.log(2.0))
        )  # two components of three are seen
        fast = float(np.nanquantile(turning if gyro is None else np.linalg.norm(gyro, axis=1), 0.95))
        n = int(np.clip(LIMITS.swing_turn * rate / max(fast, 1e-300), 1, n))
    mean = _means(acc, n)
    first, short, arm = np.arange(len(mean)) * n, np.zeros(len(mean)), np.zeros((len(mean), 3, 3))
    usable = np.isfinite(mean).all(axis=1)
    if rate is not None and gyro is not None:
        w = _means(gyro, n)
        change = np.gradient(w, n / rate, axis=0)
        axes = np.eye(3)
        arm = np.stack([np.cross(w, np.cross(w, e)) + np.cross(change, e) for e in axes], axis=2)
        angle = np.linalg.norm(w, axis=1) * n / rate
        short = angle**2 / 24.0
        usable &= (angle < LIMITS.swing_turn) & np.isfinite(arm).all(axis=(1, 2))
    return _SwingWindows(mean[usable], first[usable], n, short[usable], arm[usable], speed)


def _force(p: Values, mean: Array) -> Values:
    """Specific force (m, 3) over gravity; analytic in p, so that complex steps pass."""
    v = (mean - p[_BIAS]) / (1.0 + p[_SCALE])
    y = v[:, 1] - p[8] * v[:, 2]
    return np.stack([v[:, 0] - p[6] * y - p[7] * v[:, 2], y, v[:, 2]], axis=1)


def _miss(windows: _SwingWindows, p: Values, s: float) -> Values:
    """Distances (m,) in outputs by which |f| misses gravity. Taken in f, a large K1 would make all of them small."""
    f = _force(p, windows.mean)
    size = np.sqrt(np.sum(f * f, axis=1))
    way = f / size[:, None]
    by_arm = np.sum((windows.arm @ p[_ARM]) * way, axis=1)
    e = size - 1.0 + windows.short - p[_GRAVITY] - _NORMAL * s**2 - by_arm
    x, y, z = way.T
    y = y - p[6] * x
    z = z - p[7] * x - p[8] * y
    slope = (x / (1.0 + p[3])) ** 2 + (y / (1.0 + p[4])) ** 2 + (z / (1.0 + p[5])) ** 2
    return np.asarray(e / np.sqrt(slope))


def _fitted(windows: _SwingWindows, p: Array, s: float, prior: Array, free: Flags) -> tuple[_SwingFit, Array]:
    """Unknowns by Student's likelihood, with the inverse covariance (13, 13) of what was known beforehand. The scatter
    and the correlation of neighbours are found anew four times."""
    steps, more, inside = 1e-30j * np.eye(13), 1.0, np.ix_(free, free)
    gravity = prior[_GRAVITY, _GRAVITY]
    P = np.zeros((13, 13))
    for _ in range(4):
        prior[_GRAVITY, _GRAVITY] = gravity + s**4  # how well the lengthening by s^2 is known
        P[3:, 3:] = np.linalg.inv(prior[3:, 3:])

        def cost(p: Array, s: float, more: float = more) -> float:
            t = np.log1p(_miss(windows, p, s) ** 2 / (_NU * s**2)).sum()
            return float((_NU + 1.0) / 2.0 * t / more + 0.5 * p @ P @ p)

        for _ in range(60):
            e = _miss(windows, p, s)
            J = np.array([_miss(windows, p + step, s).imag / 1e-30 for step in steps]).T
            weights = (_NU + 1.0) / (_NU + (e / s) ** 2)
            normal = (J.T * weights) @ J / s**2
            A = (normal / more + P)[inside]
            change, part, before = np.zeros(13), 1.0, cost(p, s)
            change[free] = -np.linalg.solve(A, (J.T @ (weights * e) / s**2 / more + P @ p)[free])
            while part > 1e-4 and not (
                np.all(1.0 + p[_SCALE] + part * change[_SCALE] > 0.1)
                and cost(p + part * change, s) <= before + 1e-9
            ):
                part *= 0.5
            p, s = p + part * change, max(float(np.sqrt(np.mean(weights * e**2))), 1e-7)
            if np.sqrt(change[free] @ A @ change[free]) < 1e-3:
                break
        more = _correlation(weights * e)
    return _SwingFit(p, s, e, weights, normal, more), P


def _correlation(values: Array) -> float:
    """Sum of the autocorrelations of values (m,) until they vanish."""
    psi, more = values - values.mean(), 1.0
    for lag in range(1, len(psi) // 4):
        rho = float(psi[lag:] @ psi[:-lag] / (psi @ psi))
        if rho < 1.0 / np.sqrt(len(psi)):
            break
        more += 2.0 * rho
    return more


def _result(
    windows: _SwingWindows,
    fitted: _SwingFit,
    P: Array,
    prior: Array,
    free: Flags,
    typical: float,
    g: float,
    refusal: str,
    *,
    blind: bool,
) -> SwingCalibration:
    """Coefficients with covariance, what rests on priors, what lies off. ``blind``: turned without a gyro."""
    p, s, e, weights, inside = fitted.p, fitted.s, fitted.e, fitted.weights, np.ix_(free, free)
    # mean curvature of the cost, and the variance of its slope, each with the correlation of neighbours
    curve = max(float(np.sum(weights * (1.0 - 2.0 * e**2 / (_NU * s**2 + e**2))) / weights.sum()), 0.1)
    H = np.linalg.inv((curve * fitted.normal / fitted.more + P)[inside])
    psi = weights * e - np.mean(weights * e)
    left = max(1.0 - free.sum() / len(e), 0.1)
    noise = (psi @ psi) / weights.sum() / s**2 / left * fitted.normal / fitted.more

    def carried(B: Array) -> Array:
        return np.asarray((H @ B[inside] @ H)[:9, :9])

    coefficient = np.arange(13) < 9
    told = np.diag(carried(P * np.outer(coefficient, coefficient)))
    covariance = carried(noise + P)
    if blind:
        covariance[_BIAS, _BIAS] += np.eye(3) * (2.0 / 3.0 * windows.speed**2 * LIMITS.hand_arm / g) ** 2
    variance = np.diag(covariance)
    beforehand = np.concatenate([np.full(3, np.inf), np.diag(prior)[3:9]])
    ruled = (variance > 0.5 * beforehand) | (told > 0.5 * variance)
    usual = 1.4826 * float(np.median(np.abs(e)))
    far = np.flatnonzero(np.abs(e) > -ndtri(0.5 * LIMITS.outlying_window_risk / len(e)) * usual)
    far = far[np.argsort(-np.abs(e[far]), kind="stable")]
    named = far[: max(LIMITS.outlying_rows, int(LIMITS.outlying_windows * len(e)))]
    pull = float((p * coefficient) @ P @ (p * coefficient))
    if not refusal and usual > LIMITS.swing_scatter:
        refusal = f"specific force scatters by {usual:.0%} of gravity: this is no swing, or of another unit"
    if not refusal and pull > chdtri(6, LIMITS.swing_contradiction):
        refusal = (
            "scale factors or misalignments lie far off what is known of them: another unit, or hardly turned"
        )
    if not refusal and ruled[_SCALE].all():
        refusal = "the directions tell no scale factor: turn the instrument so that each of its axes points up and down"
    unit = np.array([typical * g] * 3 + [typical] * 3 + [1.0] * 3)
    return SwingCalibration(
        x=(p[:9] + np.repeat([0.0, 1.0, 0.0], 3)) * unit,
        u=np.sqrt(variance) * unit,
        covariance=covariance * np.outer(unit, unit),
        by_prior=tuple(name for name, by in zip(NAMES, ruled, strict=True) if by),
        refusal=refusal,
        scatter=usual * g,
        correlation=fitted.more,
        windows=len(e),
        length=windows.length,
        spread=np.ptp(np.quantile(_force(p, windows.mean), [0.02, 0.98], axis=0), axis=0),
        outlying=tuple(OutlyingWindow(int(windows.first[k]), float(e[k] / usual)) for k in named),
        outlying_count=len(far),
        arm=p[_ARM] if free[_ARM].all() else None,
    )
