"""Compiled gimbals: attitude from angles, angles from attitude, and the axes of the joints.

Any order of three different axes and any signs (`inercal.systems.selfcal.platform.rig.Gimbals`): ``axes`` (3,) int64
and ``signs`` (3,). With axes i, j, k, right-handed angles a, b, c and parity e (+1 where i, j, k is cyclic),

    C_bp = R_i(a) R_j(b) R_k(c),   C[i, k] = e sin b,   C[j, k] = -e sin a cos b,   C[k, k] = cos a cos b,
    C[i, j] = -e cos b sin c,   C[i, i] = cos b cos c.
"""

from __future__ import annotations

import math
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import kernel
from inercal.foundation.arrays import Array
from inercal.foundation.geometry.kernels import Quaternion, Vector, multiply, rotate

Axes: TypeAlias = NDArray[np.int64]

TWO_PI = 2.0 * math.pi


@kernel
def elementary(axis: int, angle: float) -> Quaternion:
    """Quaternion of a rotation by ``angle`` [rad] about axis 0, 1, 2."""
    c, s = math.cos(0.5 * angle), math.sin(0.5 * angle)
    return c, s if axis == 0 else 0.0, s if axis == 1 else 0.0, s if axis == 2 else 0.0


@kernel
def attitude(th: Vector | Array, axes: Axes, signs: Array) -> Quaternion:
    """Attitude ``q_bp`` at gimbal angles (3,) [rad]; its sign follows the angles through whole turns."""
    outer = elementary(axes[0], signs[0] * th[0])
    inner = elementary(axes[1], signs[1] * th[1])
    return multiply(multiply(outer, inner), elementary(axes[2], signs[2] * th[2]))


@kernel
def parity(axes: Axes) -> float:
    """+1.0 where the axes are cyclic (x y z, y z x, z x y), else -1.0."""
    return 1.0 if (axes[1] - axes[0]) % 3 == 1 else -1.0


@kernel
def element(q: Quaternion | Array, i: int, j: int) -> float:
    """Element i, j of the rotation matrix of a unit quaternion."""
    a, b = q[1 + i], q[1 + j]
    if i == j:
        return 2.0 * (q[0] * q[0] + a * a) - 1.0
    return 2.0 * (a * b - q[0] * q[4 - i - j] * (1.0 if (j - i) % 3 == 1 else -1.0))


@kernel
def nearest_turn(angle: float, near: float) -> float:
    """The angle [rad], by the multiple of a full turn that brings it nearest to another."""
    return angle - TWO_PI * math.floor((angle - near) / TWO_PI + 0.5)


@kernel
def angles(q: Quaternion | Array, near: Vector | Array, axes: Axes, signs: Array) -> Vector:
    """Gimbal angles (3,) [rad] of an attitude: of both branches and all turns the nearest to ``near`` (3,).

    At gimbal lock (inner angle 90 deg) outer and platform angle are not unique.
    """
    i, j, k = axes[0], axes[1], axes[2]
    e = parity(axes)
    a = math.atan2(-e * element(q, j, k), element(q, k, k))
    b = math.asin(min(1.0, max(-1.0, e * element(q, i, k))))
    c = math.atan2(-e * element(q, i, j), element(q, i, i))
    first_x = nearest_turn(signs[0] * a, near[0])
    first_y = nearest_turn(signs[1] * b, near[1])
    first_z = nearest_turn(signs[2] * c, near[2])
    other_x = nearest_turn(signs[0] * (a + math.pi), near[0])
    other_y = nearest_turn(signs[1] * (math.pi - b), near[1])
    other_z = nearest_turn(signs[2] * (c + math.pi), near[2])
    to_first = abs(first_x - near[0]) + abs(first_y - near[1]) + abs(first_z - near[2])
    to_other = abs(other_x - near[0]) + abs(other_y - near[1]) + abs(other_z - near[2])
    if to_other < to_first:
        return other_x, other_y, other_z
    return first_x, first_y, first_z


@kernel
def unit(axis: int, sign: float) -> Vector:
    """Signed unit vector along axis 0, 1, 2."""
    return sign if axis == 0 else 0.0, sign if axis == 1 else 0.0, sign if axis == 2 else 0.0


@kernel
def joint_axes(th: Vector | Array, axes: Axes, signs: Array) -> tuple[Vector, Vector, Vector]:
    """Columns of J: the axes of the joints in p at gimbal angles (3,) [rad], ``w_bp^p = J th'``."""
    from_platform = elementary(axes[2], -signs[2] * th[2])
    from_inner = multiply(from_platform, elementary(axes[1], -signs[1] * th[1]))
    return (
        rotate(from_inner, unit(axes[0], signs[0])),
        rotate(from_platform, unit(axes[1], signs[1])),
        unit(axes[2], signs[2]),
    )


def axes_of(th: Array, axes: Axes, signs: Array) -> NDArray[np.int64]:
    """Axes (3,) of p, as 0, 1, 2, that the joints are nearest to at gimbal angles (3,) [rad]."""
    return np.asarray(np.argmax(np.abs(joint_axes(th, axes, signs)), axis=1))


@kernel
def commanded_rates(th: Array, dt: Array, earth: Array, axes: Axes, signs: Array, out: Array) -> None:
    """Rates ``out`` (n - 1, 3) [rad/s] of the platform against inertial space, in p, that take it from row to row.

    ``th`` (n, 3) [rad] at the rows, ``dt`` (n - 1,) [s] between them, ``earth`` (3,) [rad/s] in b; J and attitude are
    those of the middle of each step.
    """
    for k in range(len(out)):
        middle = (
            0.5 * (th[k, 0] + th[k + 1, 0]),
            0.5 * (th[k, 1] + th[k + 1, 1]),
            0.5 * (th[k, 2] + th[k + 1, 2]),
        )
        by_x, by_y, by_z = joint_axes(middle, axes, signs)
        q = attitude(middle, axes, signs)
        of_earth = rotate((q[0], -q[1], -q[2], -q[3]), earth)
        for i in range(3):
            out[k, i] = (
                of_earth[i]
                + (
                    by_x[i] * (th[k + 1, 0] - th[k, 0])
                    + by_y[i] * (th[k + 1, 1] - th[k, 1])
                    + by_z[i] * (th[k + 1, 2] - th[k, 2])
                )
                / dt[k]
            )


@kernel
def all_angles(q: Array, near: Array, axes: Axes, signs: Array, out: Array) -> None:
    """Gimbal angles ``out`` (n, 3) [rad] of attitudes (n, 4), continuous from ``near`` (3,) on."""
    last = (near[0], near[1], near[2])
    for k in range(len(q)):
        last = angles((q[k, 0], q[k, 1], q[k, 2], q[k, 3]), last, axes, signs)
        out[k, 0], out[k, 1], out[k, 2] = last
