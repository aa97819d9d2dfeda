"""Turns between poses: the direction of gravity carried through the gyro's output, with its derivatives.

Over one sample interval the rotation vector is ``phi = gain^-1 (Y - b dt - D X)``, with Y and X the
trapezoidal integrals of the gyro output and of the drivers of its bias (specific force, time). The
attitude is the exact product of exp(phi); a vertical n, known in the first pose, appears in the last as ``R^T n``
with ``R = exp(phi_1) exp(phi_2) ...``.
NumPy over all turns at once is fast enough here; compiling would cost more than it saves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import skew
from inercal.foundation.instruments.triad import TriadModel


@dataclass(frozen=True)
class Turns:
    """Raw increments of m turns, padded with zeros to the longest (L intervals).

    ``outputs`` (L, m, 3) [output s], ``drivers`` (L, m, q) [driver s], ``intervals`` (L, m) [s]; ``first`` and
    ``last`` (m,) are the poses that each turn joins.
    """

    outputs: Array
    drivers: Array
    intervals: Array
    first: NDArray[np.int64]
    last: NDArray[np.int64]

    @property
    def durations(self) -> Array:
        """Length of each turn (m,) [s]."""
        return np.asarray(self.intervals.sum(axis=0))

    def __len__(self) -> int:
        """Number of turns."""
        return len(self.first)

    def choose(self, rows: NDArray[np.int64] | NDArray[np.bool_]) -> Turns:
        """Some of the turns."""
        return Turns(
            self.outputs[:, rows],
            self.drivers[:, rows],
            self.intervals[:, rows],
            self.first[rows],
            self.last[rows],
        )


def cut_turns(t: Array, gyro: Array, drivers: Array, spans: Sequence[tuple[int, int, int]]) -> Turns:
    """Cut turns out of a recording.

    Parameters
    ----------
    t : (n,)
        Time [s], increasing within each turn.
    gyro : (n, 3)
        Gyro output.
    drivers : (n, q)
        Drivers of the bias, at the gyro's samples: specific force [m/s^2] for g-sensitivity, time [s] for
        drift; q is 0 where neither is asked for.
    spans : sequence of (pose, start, stop)
        Turn from ``pose`` to the next, between the samples ``start`` and ``stop`` (both included).
    """
    longest = max(stop - start for _, start, stop in spans)
    m = len(spans)
    outputs, driven = np.zeros((longest, m, 3)), np.zeros((longest, m, drivers.shape[1]))
    intervals = np.zeros((longest, m))
    for k, (_, start, stop) in enumerate(spans):
        dt = np.diff(t[start : stop + 1])
        count = stop - start
        intervals[:count, k] = dt
        for padded, x in ((outputs, gyro), (driven, drivers)):
            padded[:count, k] = 0.5 * (x[start:stop] + x[start + 1 : stop + 1]) * dt[:, None]
    first = np.array([pose for pose, _, _ in spans])
    return Turns(outputs, driven, intervals, first, first + 1)


def thin(turns: Turns, samples: int) -> Turns:
    """The same turns in intervals ``samples`` times as long: coarse, for a first guess."""
    pad = -len(turns.intervals) % samples
    count = (len(turns.intervals) + pad) // samples
    blocks = [
        np.pad(x, [(0, pad)] + [(0, 0)] * (x.ndim - 1)).reshape(count, samples, *x.shape[1:]).sum(axis=1)
        for x in (turns.outputs, turns.drivers, turns.intervals)
    ]
    return Turns(blocks[0], blocks[1], blocks[2], turns.first, turns.last)


def increments(turns: Turns, model: TriadModel, drift: Array) -> Array:
    """Rotation vectors (L, m, 3) [rad] of the intervals; ``drift`` (3, q) [output/driver]."""
    raw = turns.outputs - turns.intervals[..., None] * model.bias - turns.drivers @ drift.T
    return np.asarray(raw @ np.linalg.inv(model.gain).T)


def attitudes(phi: Array) -> Array:
    """Rotations (L + 1, m, 3, 3) from the frame after i intervals to the first one (i = 0: identity)."""
    steps = _rotation_matrices(phi)
    out = np.empty((len(phi) + 1, *steps.shape[1:]))
    out[0] = np.eye(3)
    for i in range(len(phi)):
        np.matmul(out[i], steps[i], out=out[i + 1])
    return out


def whole_turns(phi: Array) -> Array:
    """The last of `attitudes` alone (m, 3, 3): products of neighbours, then of their products, and so on."""
    R = _rotation_matrices(phi)
    while len(R) > 1:
        pairs = len(R) // 2
        R = np.concatenate([R[: 2 * pairs : 2] @ R[1 : 2 * pairs : 2], R[2 * pairs :]])
    return np.asarray(R[0])


def _rotation_matrices(phi: Array) -> Array:
    """exp(phi) (..., 3, 3) by Rodrigues' formula; sinc keeps it exact at zero."""
    angle = np.linalg.norm(phi, axis=-1)
    return _polynomial(phi, np.cos(angle), np.sinc(angle / np.pi), 0.5 * np.sinc(angle / (2 * np.pi)) ** 2)


def _polynomial(phi: Array, one: Array | float, first: Array | float, second: Array | float) -> Array:
    """``one I + first [phi x] + second phi phi^T`` (..., 3, 3) for vectors (..., 3)."""
    out = np.asarray(second)[..., None, None] * (phi[..., :, None] * phi[..., None, :])
    x, y, z = (np.asarray(first) * phi[..., k] for k in range(3))
    for i, j, value in ((2, 1, x), (0, 2, y), (1, 0, z)):
        out[..., i, j] += value
        out[..., j, i] -= value
    out[..., range(3), range(3)] += np.asarray(one)[..., None]
    return np.asarray(out)


def carried(turns: Turns, verticals: Array, model: TriadModel, drift: Array) -> Array:
    """The vertical (m, 3) at the end of each turn, from ``verticals`` (poses, 3) at its start."""
    R = whole_turns(increments(turns, model, drift))
    return np.asarray(np.einsum("mji,mj->mi", R, verticals[turns.first]))


def carried_with_derivatives(
    turns: Turns, verticals: Array, model: TriadModel, drift: Array
) -> tuple[Array, Array, Array]:
    """As `carried`, with derivatives.

    Returns
    -------
    end : (m, 3)
    by_parameter : (m, 3, 12 + 3 q)
        Derivative with respect to bias (3), scale (3), the six misalignments in the order of the term table, and
        the rows of ``drift``.
    by_vertical : (m, 3, 3)
        Derivative with respect to the vertical at the start, R^T.

    Notes
    -----
    A change d of the rotation vector of interval i moves the end by ``R^T [n x] R_i Jl(phi_i) d``, with R_i
    the attitude before the interval and Jl the left Jacobian of the rotation group (Sola, Deray, Atchuthan,
    arXiv:1812.01537). So only the sums over the turn of ``R_i Jl`` times dt, phi and X are needed.
    """
    phi = increments(turns, model, drift)
    R = attitudes(phi)
    # left Jacobian to third order, I + K/2 + K^2/6: the angle of one sample interval is small
    RJ = R[:-1] @ _polynomial(phi, 1.0 - np.sum(phi**2, axis=-1) / 6.0, 0.5, 1.0 / 6.0)
    over_time = np.einsum("lmij,lm->mij", RJ, turns.intervals)
    over_angle = np.einsum("lmij,lmk->mkij", RJ, phi)
    over_driver = np.einsum("lmij,lmk->mkij", RJ, turns.drivers)

    A = np.linalg.inv(model.gain)
    columns = [-over_time @ A[:, j] for j in range(3)]
    by_rate = over_angle @ A  # [m, k, :, j]: rate about k seen by gyro j
    columns += [-np.einsum("k,mki->mi", model.misalignment[j], by_rate[..., j]) for j in range(3)]
    columns += [-model.scale[j] * by_rate[:, k, :, j] for j in range(3) for k in range(3) if k != j]
    by_driver = over_driver @ A
    columns += [-by_driver[:, k, :, j] for j in range(3) for k in range(drift.shape[1])]
    moved = np.stack(columns, axis=-1)

    start = verticals[turns.first]
    RT = np.swapaxes(R[-1], -1, -2)
    return np.einsum("mij,mj->mi", RT, start), RT @ skew(start) @ moved, RT


def first_guess(
    turns: Turns, verticals: Array, bias: Array, axes: Array | None = None
) -> tuple[float, float]:
    """Scale [output per rad/s] common to the axes that best carries the verticals, and the miss it leaves.

    Parameters
    ----------
    turns : Turns
    verticals : (n, 3)
        Unit vectors in the poses.
    bias : (3,)
        Mean output at rest.
    axes : (3, 3), optional
        Signed permutation from the frame to the gyro's channels; identity if absent.

    Returns
    -------
    scale : float
    miss : float
        Root-mean-square angle [rad] between carried and measured verticals.

    Notes
    -----
    A hand turns an instrument by 0.1 to 7 rad between poses, so the integral of the output bounds the scale;
    steps of 8 % are well inside the catch of the fit that follows.
    """
    coarse = thin(turns, max(1, len(turns.intervals) // 80))
    raw = coarse.outputs - coarse.intervals[..., None] * bias
    swept = max(float(np.median(np.sum(np.linalg.norm(raw, axis=-1), axis=0))), 1e-300)
    channels = np.eye(3) if axes is None else axes
    no_drift = np.zeros((3, coarse.drivers.shape[2]))
    best = (1.0, np.inf)
    for scale in swept / np.geomspace(0.1, 12.0, 62):
        model = TriadModel(np.full(3, scale), channels, bias)
        miss = carried(coarse, verticals, model, no_drift) - verticals[coarse.last]
        size = float(np.sqrt(np.mean(np.sum(miss**2, axis=-1))))
        if size < best[1]:
            best = (float(scale), size)
    return best
