"""Compiled twins of `inercal.foundation.geometry.rotations` for loops over samples.

Scalars only: a quaternion or a vector comes in as anything that is indexed (a tuple, a row of an array) and
goes out as a tuple, which stays in registers when a kernel is inlined in a loop; nothing is allocated.
Conventions are those of `inercal.foundation.geometry.rotations`, whose functions are the oracle of these in the tests.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import kernel
from inercal.foundation.geometry.rotations import SMALL_ANGLE

Array: TypeAlias = NDArray[np.float64]
Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]

# Below it, four terms of the series of (angle - sin angle) lose less than the closed form does.
SERIES_ANGLE = 0.1


@kernel
def multiply(p_ab: Quaternion | Array, q_bc: Quaternion | Array) -> Quaternion:
    """Hamilton product ``q_ac`` of two quaternions (4,) of any length."""
    return (
        p_ab[0] * q_bc[0] - p_ab[1] * q_bc[1] - p_ab[2] * q_bc[2] - p_ab[3] * q_bc[3],
        p_ab[0] * q_bc[1] + p_ab[1] * q_bc[0] + p_ab[2] * q_bc[3] - p_ab[3] * q_bc[2],
        p_ab[0] * q_bc[2] - p_ab[1] * q_bc[3] + p_ab[2] * q_bc[0] + p_ab[3] * q_bc[1],
        p_ab[0] * q_bc[3] + p_ab[1] * q_bc[2] - p_ab[2] * q_bc[1] + p_ab[3] * q_bc[0],
    )


@kernel
def normalize(q: Quaternion | Array) -> Quaternion:
    """Quaternion (4,) scaled to unit length, sign kept; a zero one raises ZeroDivisionError."""
    length = math.sqrt(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3])
    return q[0] / length, q[1] / length, q[2] / length, q[3] / length


@kernel
def rotate(q_ab: Quaternion | Array, v_b: Vector | Array) -> Vector:
    """Components in a, in the unit of ``v_b`` (3,), of a vector given in b."""
    w, x, y, z = q_ab[0], q_ab[1], q_ab[2], q_ab[3]
    tx = 2.0 * (y * v_b[2] - z * v_b[1])
    ty = 2.0 * (z * v_b[0] - x * v_b[2])
    tz = 2.0 * (x * v_b[1] - y * v_b[0])
    return (
        v_b[0] + w * tx + (y * tz - z * ty),
        v_b[1] + w * ty + (z * tx - x * tz),
        v_b[2] + w * tz + (x * ty - y * tx),
    )


@kernel
def exp(rotvec: Vector | Array) -> Quaternion:
    """Unit quaternion of a rotation vector (3,) [rad]."""
    angle2 = rotvec[0] * rotvec[0] + rotvec[1] * rotvec[1] + rotvec[2] * rotvec[2]
    angle = math.sqrt(angle2)
    if angle < SMALL_ANGLE:
        half_sinc = 0.5 - angle2 * (1.0 / 48.0 - angle2 / 3840.0)
    else:
        half_sinc = math.sin(0.5 * angle) / angle
    return math.cos(0.5 * angle), half_sinc * rotvec[0], half_sinc * rotvec[1], half_sinc * rotvec[2]


@kernel
def log(q: Quaternion | Array) -> Vector:
    """Shortest rotation vector (3,) [rad] of an attitude (4,) of any length but zero; of ``q`` and ``-q`` the same."""
    sign = -1.0 if q[0] < 0.0 else 1.0
    w, x, y, z = sign * q[0], sign * q[1], sign * q[2], sign * q[3]
    length = math.sqrt(x * x + y * y + z * z)
    if length < SMALL_ANGLE * w:
        tangent2 = (length / w) * (length / w)
        scale = (2.0 - tangent2 * (2.0 / 3.0 - 0.4 * tangent2)) / w
    else:
        scale = 2.0 * math.atan2(length, w) / length
    return scale * x, scale * y, scale * z


@kernel
def right_jacobian(rotvec: Vector | Array) -> tuple[Vector, Vector, Vector]:
    """Rows of J (3, 3) with ``exp(rotvec + d) = exp(rotvec) exp(J d)`` to first order in d (Sola 2017, eq. (183)).

    ``J = 1 - (1 - cos a)/a^2 [v]x + (a - sin a)/a^3 [v]x^2`` with a the length of v (3,) [rad].
    """
    x, y, z = rotvec[0], rotvec[1], rotvec[2]
    angle2 = x * x + y * y + z * z
    if angle2 < SERIES_ANGLE * SERIES_ANGLE:
        a = 0.5 - angle2 * (1.0 / 24.0 - angle2 * (1.0 / 720.0 - angle2 / 40320.0))
        b = 1.0 / 6.0 - angle2 * (1.0 / 120.0 - angle2 * (1.0 / 5040.0 - angle2 / 362880.0))
    else:
        angle = math.sqrt(angle2)
        half_sine = math.sin(0.5 * angle)
        a = 2.0 * half_sine * half_sine / angle2
        b = (angle - math.sin(angle)) / (angle * angle2)
    return (
        (1.0 - b * (y * y + z * z), b * x * y + a * z, b * x * z - a * y),
        (b * x * y - a * z, 1.0 - b * (x * x + z * z), b * y * z + a * x),
        (b * x * z + a * y, b * y * z - a * x, 1.0 - b * (x * x + y * y)),
    )


@kernel
def step(q_nb: Quaternion | Array, omega_b: Vector | Array, dt: float) -> Quaternion:
    """Attitude after turning for ``dt`` [s] at a constant rate ``omega_b`` (3,) [rad/s]; normalised."""
    turn = exp((omega_b[0] * dt, omega_b[1] * dt, omega_b[2] * dt))
    return normalize(multiply(q_nb, turn))


@kernel
def integrate(q0_nb: Quaternion | Array, omega_b: Array, dt: Array, out: Array) -> None:
    """Attitude at every sample of rates that are constant over each interval.

    Parameters
    ----------
    q0_nb : (4,) attitude at the first sample
    omega_b : (N, 3) rad/s, rate of b against n, in b, over each interval
    dt : (N,) s, lengths of the intervals
    out : (N + 1, 4) receives the attitudes; ``out[0]`` is ``q0_nb``
    """
    q = (q0_nb[0], q0_nb[1], q0_nb[2], q0_nb[3])
    out[0, 0], out[0, 1], out[0, 2], out[0, 3] = q
    for i in range(len(dt)):
        q = step(q, (omega_b[i, 0], omega_b[i, 1], omega_b[i, 2]), dt[i])
        out[i + 1, 0], out[i + 1, 1], out[i + 1, 2], out[i + 1, 3] = q
