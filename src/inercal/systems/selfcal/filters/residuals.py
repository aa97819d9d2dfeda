"""Residuals of a recording at attitudes and coefficients: all rows at once, with derivatives, for the batch estimator.

Attitudes change to the right, ``q qexp(dtheta)`` with dtheta (3,) [rad] about the axes of p; coefficients are in the
linear form. Derivatives are those of the model, so that a residual changes by minus them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.kernels import integrate
from inercal.foundation.geometry.rotations import (
    boxminus,
    conjugate,
    exp,
    inverse_left_jacobian,
    multiply,
    rotate,
)
from inercal.systems.selfcal.filters.filter_result import FilterResult, RowHistory
from inercal.systems.selfcal.filters.problem import (
    AttitudeStart,
    FilterProblem,
    admitted,
    apart,
    updating,
    watch,
)
from inercal.systems.selfcal.platform.linearised import LinearisedRows, linearise_rows, linearise_steps
from inercal.systems.selfcal.platform.recording import Recording, Steps
from inercal.systems.selfcal.platform.rig import World
from inercal.systems.selfcal.platform.states import LEVER


@dataclass(frozen=True, eq=False)
class RowMeasurements:
    """Measurements of m rows; those missing or stopped by the near-level gate weigh nothing.

    ``acc`` (m, 3) [m/s^2], 0 where missing, with reciprocal standard deviations ``acc_weight``; ``attitude`` (m, 4)
    q_bp at the encoders' angles, with the Cholesky factor ``root`` (m, 3, 3) [rad] of its covariance about the axes of
    p, ``sigma^2 J D J^T + floor I``, and ``whitening`` its inverse; ``used`` (m, 6) accelerometers and encoders.
    ``th`` (m, 3) [rad] as read, 0 where missing, and the ``steps`` before the rows.
    """

    acc: Array
    acc_weight: Array
    attitude: Array
    root: Array
    whitening: Array
    used: NDArray[np.bool_]
    th: Array
    steps: Steps

    @property
    def dims(self) -> NDArray[np.int64]:
        """(m,) number of scalars measured in each row."""
        return np.asarray(np.count_nonzero(self.used, axis=1))


def readings(recording: Recording, problem: FilterProblem) -> RowMeasurements:
    """The measurements of all rows but the first."""
    acc, th = recording.acc[1:], recording.th[1:]
    seen = np.all(np.isfinite(th), axis=1)
    angles = np.where(seen[:, None], th, 0.0)
    attitude, joints = gimbals(angles, problem.world)
    used = np.column_stack([np.isfinite(acc), np.repeat(seen[:, None], 3, axis=1)])
    steps = recording.steps
    if problem.states.layout.late_encoders or problem.states.layout.moving:
        used &= np.isfinite(steps.later)[:, [0]]  # a reading that is early may be of a platform that stops
    if problem.filter.gating is not None:
        used &= _gate(attitude, seen, problem)
    noise = problem.model.noise
    floor = np.array([apart(noise, dt, noise.encoder) for dt in recording.dt])[:, None, None]
    of_joints = noise.encoder**2 * joints * noise.joints @ np.swapaxes(joints, 1, 2)
    root = np.asarray(np.linalg.cholesky(of_joints + floor * np.eye(3)), dtype=np.float64)
    return RowMeasurements(
        np.where(used[:, :3], acc, 0.0),
        used[:, :3] / _accelerometer_noise(recording, problem),
        attitude,
        root,
        np.linalg.inv(root) * used[:, 3:, None],
        used,
        angles,
        steps,
    )


def _accelerometer_noise(recording: Recording, problem: FilterProblem) -> Array | float:
    """Standard deviation [m/s^2] of the accelerometers, (m, 1) where they may be away from the centre of the gimbals:
    with what a change of rate at a row makes there."""
    noise = problem.noise.accelerometer
    if not problem.states.has("levers"):
        return noise
    reach = float(np.linalg.norm(problem.prior[problem.states.layout.place[LEVER : LEVER + 9] - 3]))
    steps = recording.steps
    change = np.linalg.norm(np.nan_to_num(steps.later) - steps.rate, axis=1) / steps.dt
    return np.asarray(np.hypot(noise, reach * change)[:, None])


def gimbals(th: Array, world: World) -> tuple[Array, Array]:
    """Attitudes q_bp (m, 4) at gimbal angles (m, 3) [rad], and the axes J (m, 3, 3) of the joints in p as columns."""
    axes = np.eye(3)[world.axes] * world.signs[:, None]
    outer, inner, last = (exp(th[:, [k]] * axes[k]) for k in range(3))
    back = conjugate(last)
    columns = [
        rotate(multiply(back, conjugate(inner)), axes[0]),
        rotate(back, axes[1]),
        np.broadcast_to(axes[2], (len(th), 3)),
    ]
    return multiply(multiply(outer, inner), last), np.stack(columns, axis=-1)


def _gate(attitude: Array, seen: NDArray[np.bool_], problem: FilterProblem) -> NDArray[np.bool_]:
    """Measurements (m, 6) that the near-level gate lets pass; it stays as it was where the encoders are silent."""
    gate, near = problem.model.gate, np.zeros(3, dtype=np.int64)
    force = rotate(conjugate(attitude), problem.world.up)
    passed = np.ones((len(attitude), 6), dtype=np.bool_)
    for k in range(len(attitude)):
        if seen[k]:
            watch((force[k, 0], force[k, 1], force[k, 2]), gate, near)
        passed[k, :3] = [admitted(i, gate, near) for i in range(3)]
        passed[k] &= updating(gate, near)
    return passed


def normalised(residual: Array, measured: RowMeasurements) -> Array:
    """Residuals (m, 6), whitened, each over its own standard deviation instead; NaN where not measured."""
    encoders = np.einsum("kij,kj->ki", measured.root, residual[:, 3:])
    deviation = np.sqrt(np.sum(measured.root**2, axis=2))
    return np.where(measured.used, np.hstack([residual[:, :3], encoders / deviation]), np.nan)


def batch_result(
    recording: Recording,
    problem: FilterProblem,
    measured: RowMeasurements,
    path: tuple[Array, Array],
    coefficients: tuple[Array, Array],
    nis: Array,
    innovations: Array | None,
    message: str,
) -> FilterResult:
    """Result of the batch estimator, but its time.

    ``path``: attitudes (n, 4) and standard deviations (n, 3) [rad]; ``coefficients`` (p,) and their covariance (p, p);
    ``innovations`` (m, 6), None where no history is wanted; ``message`` says why it did not converge.
    """
    (c, covariance), rows = coefficients, len(recording.t)
    history = None
    if innovations is not None:
        history = RowHistory(*path, np.tile(c, (rows, 1)), np.tile(np.sqrt(np.diag(covariance)), (rows, 1)))
    cosine = np.abs(np.cos(recording.th[:, 1]))
    return FilterResult(
        kind="map",
        names=problem.names,
        coefficients=c,
        covariance=covariance,
        attitude=path[0][-1],
        nis=nis,
        dims=measured.dims,
        innovations=np.empty((0, 6)) if innovations is None else innovations,
        history=history,
        seconds=math.nan,
        converged=not message,
        message=message,
        gimbal_cosine=float(np.min(cosine, where=np.isfinite(cosine), initial=1.0)),
    )


def first_reading(recording: Recording, problem: FilterProblem) -> AttitudeStart:
    """The attitude of the first encoder reading."""
    return AttitudeStart(gimbals(recording.th[:1], problem.world)[0][0], problem.noise.encoder)


class Sensed(NamedTuple):
    """Whitened residuals (m, 6) of accelerometers and of the encoders' attitude, and the derivatives of the model by
    the attitude (m, 6, 3) and by the coefficients (m, 6, p); 0 where nothing was measured."""

    residual: Array
    by_attitude: Array
    by_coefficients: Array


def sensed(q: Array, c: Array, measured: RowMeasurements, problem: FilterProblem) -> Sensed:
    """Compare measurements with attitudes (m, 4) and coefficients (p,)."""
    m, states = len(q), problem.states
    of_encoders, expected, by = np.empty((m, 4)), np.empty((m, 3)), np.zeros((m, 6, 3 + len(c)))
    rows = LinearisedRows(of_encoders, expected, by)
    linearise_rows(q, measured.th, measured.steps, states.full(c), states.layout, problem.world, rows)
    weight, whitening = measured.acc_weight, measured.whitening
    miss = boxminus(of_encoders, q)
    left = inverse_left_jacobian(miss)
    residual = np.concatenate(
        [(measured.acc - expected) * weight, np.einsum("kij,kj->ki", whitening, miss)], axis=1
    )
    by[:, :3] *= weight[:, :, None]
    # miss = log(q* q_e): a change of q_e from the right moves it by the inverse right Jacobian
    by[:, 3:, 3:] = -whitening @ np.swapaxes(left, 1, 2) @ by[:, 3:, 3:]
    by[:, 3:, :3] = whitening @ left
    return Sensed(residual, by[:, :, :3], by[:, :, 3:])


def turns(q: Array, steps: Steps, c: Array, problem: FilterProblem) -> tuple[Array, Array]:
    """Rotation vectors (m, 3) [rad] of the platform against inertial space in each step from attitude ``q`` (m, 4), and
    the rotations (m, 3, p), about the axes of p after the step, per change of each state ``c`` (p,)."""
    m, states = len(q), problem.states
    turn, slope = np.empty((m, 3)), np.empty((m, 3, len(c)))
    linearise_steps(q, steps, states.full(c), states.layout, problem.world, turn, slope)
    return turn, slope


def followed(q0: Array, turn: Array) -> Array:
    """Attitudes (m + 1, 4) from ``q0`` (4,) on, each turned further by a rotation vector (m, 3) [rad]."""
    out = np.empty((len(turn) + 1, 4))
    integrate(q0, turn, np.ones(len(turn)), out)
    return out
