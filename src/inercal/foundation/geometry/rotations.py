"""Attitudes as unit quaternions and rotation matrices, in plain NumPy.

Quaternions are scalar first (wxyz) with the Hamilton product. ``q_ab`` and ``C_ab`` take b-components to
a-components, so adjacent letters match: ``q_ac = multiply(q_ab, q_bc)``, ``v_a = rotate(q_ab, v_b)``.
``q`` and ``-q`` are one attitude. Rotation vectors are in rad and live in the right frame (b of ``q_ab``).
Arrays are ``(*batch, 4)``, ``(*batch, 3)`` or ``(*batch, 3, 3)``; the batch axes broadcast. Quaternions are
taken to be of unit length except where a function says otherwise.

References: Sola 2017, "Quaternion kinematics for the error-state Kalman filter", arXiv:1711.02508, chapters
1, 2 and 4; Shepperd 1978, "Quaternion from rotation matrix", J. Guidance and Control 1(3); Markley et al.
2007, "Averaging quaternions", J. Guidance, Control, and Dynamics 30(4); Kahan 2006, "How futile are mindless
assessments of roundoff in floating-point computation?".
"""

from __future__ import annotations

from typing import Literal, TypeAlias

import numpy as np
from numpy.lib.array_utils import normalize_axis_index
from numpy.typing import ArrayLike, NDArray

Array: TypeAlias = NDArray[np.float64]
Axis: TypeAlias = Literal["x", "y", "z"]

# Below it, the two-term series used here are exact to double precision (the next term is under 1e-18).
SMALL_ANGLE = 1e-3
# How far C C^T may be from the identity, and still be taken for a rotation.
ORTHOGONALITY = 1e-6
# Below it, the series of `right_jacobian` is exact to double precision.
_SMALL_TURN = 1e-2


def principal(angle: ArrayLike) -> Array:
    """The same angle [rad] (*batch) within (-pi, pi]; NaN of NaN."""
    wrapped = np.pi - np.remainder(np.pi - np.asarray(angle, dtype=float), 2.0 * np.pi)
    # of a rounding error below -pi the remainder is 2 pi itself
    return np.where(wrapped <= -np.pi, np.pi, wrapped)


def multiply(p_ab: ArrayLike, q_bc: ArrayLike) -> Array:
    """Hamilton product of two quaternions of any length.

    Parameters
    ----------
    p_ab, q_bc : (*batch, 4)

    Returns
    -------
    (*batch, 4) : the quaternion that takes c-components to a.
    """
    pw, px, py, pz = _components(p_ab)
    qw, qx, qy, qz = _components(q_bc)
    return np.stack(
        [
            pw * qw - px * qx - py * qy - pz * qz,
            pw * qx + px * qw + py * qz - pz * qy,
            pw * qy - px * qz + py * qw + pz * qx,
            pw * qz + px * qy - py * qx + pz * qw,
        ],
        axis=-1,
    )


def conjugate(q_ab: ArrayLike) -> Array:
    """Conjugate ``q_ba``, for a unit quaternion the inverse; ``(*batch, 4)`` to the same shape."""
    return np.asarray(q_ab, dtype=float) * [1.0, -1.0, -1.0, -1.0]


def normalize(q: ArrayLike) -> Array:
    """Scale quaternions ``(*batch, 4)`` to unit length, sign kept.

    Raises
    ------
    ValueError : a quaternion is zero, and so is no attitude.
    """
    q = np.asarray(q, dtype=float)
    length = _norm(q)[..., None]
    if np.any(length == 0.0):
        raise ValueError("a zero quaternion is no attitude; expected one of non-zero length")
    return q / length


def rotate(q_ab: ArrayLike, v_b: ArrayLike) -> Array:
    """Components in a of a vector given in b, the vector part of ``q (0, v) q*``.

    Parameters
    ----------
    q_ab : (*batch, 4)
    v_b : (*batch, 3), any unit

    Returns
    -------
    (*batch, 3) : v_a, in the unit of ``v_b``.
    """
    q, v = np.asarray(q_ab, dtype=float), np.asarray(v_b, dtype=float)
    w, u = q[..., :1], q[..., 1:]
    t = 2.0 * _cross(u, v)
    return v + w * t + _cross(u, t)


def exp(rotvec: ArrayLike) -> Array:
    """Quaternion of a rotation by ``|rotvec|`` about ``rotvec``, right-handed.

    With ``angle = |rotvec|`` it is ``(cos(angle/2), sin(angle/2) rotvec / angle)``.

    Parameters
    ----------
    rotvec : (*batch, 3) rad, any length

    Returns
    -------
    (*batch, 4) : unit quaternion; ``exp(omega_ab_b * t)`` takes components in the turned frame b to a.
    """
    rotvec = np.asarray(rotvec, dtype=float)
    angle = _norm(rotvec)
    small = angle < SMALL_ANGLE
    safe_angle = np.where(small, 1.0, angle)
    series = 0.5 - angle**2 * (1.0 / 48.0 - angle**2 / 3840.0)
    half_sinc = np.where(small, series, np.sin(0.5 * safe_angle) / safe_angle)  # sin(angle/2) / angle
    return np.concatenate([np.cos(0.5 * angle)[..., None], half_sinc[..., None] * rotvec], axis=-1)


def log(q: ArrayLike) -> Array:
    """Shortest rotation vector of an attitude, the inverse of `exp`.

    Parameters
    ----------
    q : (*batch, 4), of any length but zero; ``q`` and ``-q`` give one vector

    Returns
    -------
    (*batch, 3) rad : of length at most pi. At pi itself both directions are right and one is returned.
    """
    q = np.asarray(q, dtype=float)
    q = np.where(q[..., :1] < 0.0, -q, q)
    w, u = q[..., 0], q[..., 1:]
    length = _norm(u)
    small = length < SMALL_ANGLE * w
    safe_w, safe_length = np.where(small, w, 1.0), np.where(small, 1.0, length)
    tangent = np.where(small, length, 0.0) / safe_w  # of the half angle
    series = (2.0 - tangent**2 * (2.0 / 3.0 - 0.4 * tangent**2)) / safe_w
    return np.where(small, series, 2.0 * np.arctan2(length, w) / safe_length)[..., None] * u


def to_matrix(q_ab: ArrayLike) -> Array:
    """Rotation matrices ``C_ab``, ``(*batch, 3, 3)``, of unit quaternions ``(*batch, 4)``."""
    w, x, y, z = _components(q_ab)
    C = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.stack([np.stack(row, axis=-1) for row in C], axis=-2)


def from_matrix(C_ab: ArrayLike) -> Array:
    """Unit quaternion of a rotation matrix, exact at every angle (Shepperd 1978).

    The matrix gives all of ``4 q q^T`` linearly; its row with the largest diagonal is the best multiple of q.

    Parameters
    ----------
    C_ab : (*batch, 3, 3)

    Returns
    -------
    (*batch, 4) : q_ab, with w >= 0.

    Raises
    ------
    ValueError : a matrix is a reflection, or its rows are not orthonormal to 1e-6.
    """
    C = np.asarray(C_ab, dtype=float)
    error = np.abs(C @ np.swapaxes(C, -1, -2) - np.eye(3)).max(initial=0.0)
    volume = np.sum(_cross(C[..., 0, :], C[..., 1, :]) * C[..., 2, :], axis=-1).min(initial=1.0)
    if not error < ORTHOGONALITY or volume < 0.0:
        raise ValueError(
            f"not a rotation matrix: |C C^T - I| is {error:.3g} (below {ORTHOGONALITY} expected), "
            f"determinant {volume:.6g} (1 expected)"
        )
    (xx, xy, xz), (yx, yy, yz), (zx, zy, zz) = (_components(row) for row in np.moveaxis(C, -2, 0))
    rows = [
        [1.0 + xx + yy + zz, zy - yz, xz - zx, yx - xy],
        [zy - yz, 1.0 + xx - yy - zz, xy + yx, xz + zx],
        [xz - zx, xy + yx, 1.0 - xx + yy - zz, yz + zy],
        [yx - xy, xz + zx, yz + zy, 1.0 - xx - yy + zz],
    ]
    candidates = np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
    best = np.argmax(np.diagonal(candidates, axis1=-2, axis2=-1), axis=-1)
    return _upper(normalize(np.take_along_axis(candidates, best[..., None, None], axis=-2)[..., 0, :]))


def elementary(axis: Axis, angle: ArrayLike) -> Array:
    """Rotation about one axis; its columns are the turned axes expressed in the old frame.

    ``Rx = [1 0 0; 0 c -s; 0 s c]``, ``Ry = [c 0 s; 0 1 0; -s 0 c]``, ``Rz = [c -s 0; s c 0; 0 0 1]``.

    Parameters
    ----------
    axis : "x", "y" or "z"
    angle : (*batch) rad, right-handed

    Returns
    -------
    (*batch, 3, 3)

    Raises
    ------
    ValueError : another axis.
    """
    if axis not in ("x", "y", "z"):
        raise ValueError(f"axis is {axis!r}; expected 'x', 'y' or 'z'")
    i = "xyz".index(axis)
    j, k = (i + 1) % 3, (i + 2) % 3
    cosine, sine = np.cos(angle), np.sin(angle)
    C = np.zeros((*np.shape(angle), 3, 3))
    C[..., i, i] = 1.0
    C[..., j, j] = C[..., k, k] = cosine
    C[..., k, j] = sine
    C[..., j, k] = -sine
    return C


def skew(v: ArrayLike) -> Array:
    """Cross-product matrix, ``skew(v) @ u == cross(v, u)``; ``(*batch, 3)`` to ``(*batch, 3, 3)``."""
    x, y, z = _components(v)
    C = np.zeros((*x.shape, 3, 3))
    C[..., 2, 1], C[..., 0, 2], C[..., 1, 0] = x, y, z
    C[..., 1, 2], C[..., 2, 0], C[..., 0, 1] = -x, -y, -z
    return C


def angle_between(u: ArrayLike, v: ArrayLike) -> Array:
    """Angle between two vectors, accurate from 0 to pi (Kahan 2006).

    Parameters
    ----------
    u, v : (*batch, n), any unit, not zero

    Returns
    -------
    (*batch) rad : in [0, pi].
    """
    u, v = np.asarray(u, dtype=float), np.asarray(v, dtype=float)
    u, v = u * _norm(v)[..., None], v * _norm(u)[..., None]
    return 2.0 * np.arctan2(_norm(u - v), _norm(u + v))


def attitude_difference(p: ArrayLike, q: ArrayLike) -> Array:
    """Angle of the shortest rotation between two attitudes.

    Parameters
    ----------
    p, q : (*batch, 4)

    Returns
    -------
    (*batch) rad : in [0, pi]; the same for ``q`` and ``-q``.
    """
    d = multiply(conjugate(p), q)
    return 2.0 * np.arctan2(_norm(d[..., 1:]), np.abs(d[..., 0]))


def mean(q: ArrayLike, weights: ArrayLike | None = None, axis: int = -1) -> Array:
    """Mean attitude: least weighted sum of squared chordal distances (Markley et al. 2007).

    It is the eigenvector of the largest eigenvalue of ``sum(weight q q^T)``, so the sign of each q is
    immaterial. Where attitudes balance (two half a turn apart) it is not unique and one is returned.

    Parameters
    ----------
    q : (*batch, 4)
    weights : broadcasts against (*batch), of any scale; equal if left out
    axis : the batch axis to average over, by default the last

    Returns
    -------
    (*batch without axis, 4) : unit quaternions with w >= 0.
    """
    q = np.asarray(q, dtype=float)
    outer = q[..., :, None] * q[..., None, :]
    if weights is not None:
        outer = outer * np.asarray(weights, dtype=float)[..., None, None]
    total = outer.sum(axis=normalize_axis_index(axis, outer.ndim - 2))
    return _upper(np.linalg.eigh(total).eigenvectors[..., -1])


def boxplus(q_ab: ArrayLike, delta_b: ArrayLike) -> Array:
    """Attitude turned further by a rotation vector ``(*batch, 3)`` [rad] in b: ``q exp(delta)``."""
    return multiply(q_ab, exp(delta_b))


def boxminus(p_ab: ArrayLike, q_ab: ArrayLike) -> Array:
    """Shortest ``delta_b`` ``(*batch, 3)`` [rad] with ``boxplus(q_ab, delta_b) == p_ab``."""
    return log(multiply(conjugate(q_ab), p_ab))


def right_jacobian(rotvec: ArrayLike) -> Array:
    """(*batch, 3, 3) J with ``exp(rotvec + d) = exp(rotvec) exp(J d)`` to first order (Sola 2017, eq. (183))."""
    rotvec = np.asarray(rotvec, dtype=float)
    angle = np.linalg.norm(rotvec, axis=-1)[..., None, None]
    small = angle < _SMALL_TURN
    safe = np.where(small, 1.0, angle)
    cubic = np.where(
        small, 1.0 / 6.0 - angle**2 * (1.0 / 120.0 - angle**2 / 5040.0), (safe - np.sin(safe)) / safe**3
    )
    cross = skew(rotvec)
    return np.asarray(np.eye(3) - 0.5 * np.sinc(angle / (2.0 * np.pi)) ** 2 * cross + cubic * cross @ cross)


def inverse_left_jacobian(rotvec: ArrayLike) -> Array:
    """(*batch, 3, 3) K with ``log(exp(d) exp(rotvec)) = rotvec + K d`` to first order; K^T if d stands to the right."""
    return np.asarray(np.linalg.inv(right_jacobian(-np.asarray(rotvec, dtype=float))))


def step(q_nb: ArrayLike, omega_b: ArrayLike, dt: ArrayLike) -> Array:
    """Attitude after turning at a constant rate: ``q exp(omega dt)``, exact.

    Parameters
    ----------
    q_nb : (*batch, 4)
    omega_b : (*batch, 3) rad/s, rate of b against n, in b
    dt : (*batch) s

    Returns
    -------
    (*batch, 4) : unit quaternions, normalised so that rounding does not build up over many steps.

    Raises
    ------
    ValueError : ``q_nb`` is zero.
    """
    rotvec = np.asarray(omega_b, dtype=float) * np.asarray(dt, dtype=float)[..., None]
    return normalize(boxplus(q_nb, rotvec))


def _components(a: ArrayLike) -> Array:
    """Last axis first, to unpack components."""
    a = np.asarray(a, dtype=float)
    return a.transpose(a.ndim - 1, *range(a.ndim - 1))


def _cross(a: Array, b: Array) -> Array:
    """Vector product along the last axis; `numpy.cross` takes several times as long where vectors are few."""
    x, y, z = _components(a)
    u, v, w = _components(b)
    return np.stack([y * w - z * v, z * u - x * w, x * v - y * u], axis=-1)


def _norm(a: Array) -> Array:
    """Euclidean length along the last axis."""
    squares: Array = np.sum(a * a, axis=-1)
    return np.sqrt(squares)


def _upper(q: Array) -> Array:
    """Of q and -q the one with w >= 0."""
    return np.where(q[..., :1] < 0.0, -q, q)
