"""The coefficients of a strapdown unit: one array in estimation, the symbols of the table of terms in results.

The model, truth to indication, of rate w and specific force fs_i = (f + W r_i)_i at the place of accelerometer i, with
W = [w'x] + [wx][wx] and the accelerometers late by tau:

    y_a = (1 + Ka) fs + K2' fs^2 + K0        1 + Ka = K1 M,  K2' = K1 K2
    y_g = (1 + Kg) w + A' |w| + G f + D_F    1 + Kg = S T,   A' = S S_asym / 2

Estimation works on the array (51,) of all coefficients, which is linear in the outputs but for fs^2. It keeps to the
frame ``upper``: z along the input axis of accelerometer z, y in the plane of those of y and z, so that Ka is upper
triangular. Results are in the stated form of `stated`, in that frame or in ``lower``: x along the input axis of
accelerometer x, y in the plane of those of x and y. Both frames have their origin at accelerometer z, r_z = 0.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final, Literal

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array

Frame = Literal["upper", "lower"]

D: Final = slice(0, 3)
KG: Final = slice(3, 12)
K0: Final = slice(12, 15)
KA: Final = slice(15, 24)
K2: Final = slice(24, 27)
R: Final = slice(27, 36)
TAU: Final = 36
A: Final = slice(37, 40)
G: Final = slice(40, 49)
GRAVITY: Final = 49
LATITUDE: Final = 50
SIZE: Final = 51
"""Length of the array, and the place of each group: gravity [m/s^2] and latitude [rad] are corrections to the site."""

_DIAGONAL = (0, 4, 8)
_CROSS = (1, 2, 3, 5, 6, 7)
_UPPER = (1, 2, 5)
_PAIRS = [f"{i}{j}" for i in "xyz" for j in "xyz"]

#: key of a prior or goal -> places in the array, of the frame ``upper``
GROUPS: Final[Mapping[str, tuple[int, ...]]] = {
    "gyro_bias": (0, 1, 2),
    "scale": tuple(KG.start + k for k in _DIAGONAL),
    "misalignment": tuple(KG.start + k for k in _CROSS),
    "bias": (12, 13, 14),
    "k1": tuple(KA.start + k for k in _DIAGONAL),
    "axes": tuple(KA.start + k for k in _UPPER),
    "k2": (24, 25, 26),
    "size": (27, 28, 29, 30, 31, 32),
    "delay": (36,),
    "asymmetry": (37, 38, 39),
    "g_sensitivity": tuple(range(40, 49)),
}

ALWAYS: Final = ("gyro_bias", "scale", "misalignment", "bias", "k1", "axes")
"""Groups that are always estimated, and that a recording must tell for its result to be of use."""

USUAL: Final = ("k2", "size", "delay")
"""Groups that are estimated unless the study says otherwise: every unit has them."""

OPTIONS: Final = ("k2", "size", "delay", "asymmetry", "g_sensitivity")
"""Groups that are estimated where the study says so."""


def free_places(terms: tuple[str, ...], gravity: bool, latitude: bool) -> NDArray[np.int64]:
    """Places in the array that are estimated: of the ``terms`` among `OPTIONS`, and of the nuisances that have a
    prior."""
    places = [place for group in (*ALWAYS, *terms) for place in GROUPS[group]]
    nuisances = [GRAVITY] * gravity + [LATITUDE] * latitude
    return np.array(sorted(places) + nuisances, dtype=np.int64)


def names(terms: tuple[str, ...], frame: Frame) -> tuple[str, ...]:
    """Symbols of the coefficients that `stated` gives, in its order."""
    m = ("xy", "xz", "yz") if frame == "upper" else ("yx", "zx", "zy")
    t = [_PAIRS[k] for k in _CROSS]
    of = {
        "k2": [f"K2_{i}" for i in "xyz"],
        "size": [f"r_{pair}" for pair in _PAIRS[:6]],
        "delay": ["tau_a"],
        "asymmetry": [f"S_asym_{i}" for i in "xyz"],
        "g_sensitivity": [f"G_{pair}" for pair in _PAIRS],
    }
    always = [f"{symbol}_{i}" for symbol in ("K0", "K1") for i in "xyz"]
    always += [f"M_{pair}" for pair in m] + [f"{symbol}_{i}" for symbol in ("D_F", "S") for i in "xyz"]
    always += [f"T_{pair}" for pair in t]
    return (*always, *(name for group in OPTIONS if group in terms for name in of[group]))


def group_of(name: str) -> str:
    """Key of the prior of a symbol."""
    symbol = name.rpartition("_")[0]
    return {
        "K0": "bias", "K1": "k1", "M": "axes", "D_F": "gyro_bias", "S": "scale", "T": "misalignment", "K2": "k2",
        "r": "size", "tau": "delay", "S_asym": "asymmetry", "G": "g_sensitivity",
    }[symbol]  # fmt: skip


def stated(
    c: Array, terms: tuple[str, ...], frame: Frame, outputs: tuple[float, float] = (1.0, 1.0)
) -> Array:
    """Values of `names` for an array (51,).

    ``outputs`` are the units of accelerometers and gyros in SI: K0, K1, D_F, S and G are in these.
    """
    ka, kg = np.eye(3) + c[KA].reshape(3, 3), np.eye(3) + c[KG].reshape(3, 3)
    r, g = c[R].reshape(3, 3), c[G].reshape(3, 3)
    if frame == "lower":
        turn = _turn_to_lower(ka)
        ka, kg, r, g = ka @ turn, kg @ turn, r @ turn, g @ turn
    k1, s = np.diag(ka), np.diag(kg)
    off = list(_UPPER) if frame == "upper" else [3, 6, 7]
    acc, gyro = outputs
    of = {
        "k2": c[K2] / k1,
        "size": r.ravel()[:6],
        "delay": c[TAU : TAU + 1],
        "asymmetry": 2.0 * c[A] / s,
        "g_sensitivity": g.ravel() / gyro,
    }
    always = [c[K0] / acc, k1 / acc, (ka / k1[:, None]).ravel()[off]]
    always += [c[D] / gyro, s / gyro, (kg / s[:, None]).ravel()[list(_CROSS)]]
    return np.concatenate([*always, *(of[group] for group in OPTIONS if group in terms)])


def _turn_to_lower(ka: Array) -> Array:
    """The rotation R (3, 3) that makes of a gain ``ka`` (3, 3) the lower triangular ``ka R``, with a positive diagonal:
    b of the frame ``lower`` in components of ``upper``."""
    q, r = np.linalg.qr(ka.T)
    return np.asarray(q * np.sign(np.diag(r)))


def array_of(values: Mapping[str, float], frame: Frame) -> Array:
    """The array (51,) of coefficients by symbol, in SI; those of a perfect unit where there is none: the inverse of
    `stated`."""
    from scipy.linalg import rq

    c, of = np.zeros(SIZE), values.get
    k1, s = ([of(f"{symbol}_{i}", 1.0) for i in "xyz"] for symbol in ("K1", "S"))
    own, other = (
        [of(f"{symbol}_{pair}", float(pair[0] == pair[1])) for pair in _PAIRS] for symbol in ("M", "T")
    )
    ka, kg = (
        np.reshape(matrix, (3, 3)) * np.reshape(size, (3, 1)) for matrix, size in ((own, k1), (other, s))
    )
    r, g = (np.reshape([of(f"{symbol}_{pair}", 0.0) for pair in _PAIRS], (3, 3)) for symbol in ("r", "G"))
    if frame == "lower":
        _, turned = rq(ka)
        turn = turned.T * np.sign(np.diag(ka @ turned.T))
        ka, kg, r, g = ka @ turn, kg @ turn, r @ turn, g @ turn
    c[KA], c[KG], c[R], c[G] = (x.ravel() for x in (ka - np.eye(3), kg - np.eye(3), r, g))
    for places, symbol in ((D, "D_F"), (K0, "K0"), (K2, "K2"), (A, "S_asym")):
        c[places] = [of(f"{symbol}_{i}", 0.0) for i in "xyz"]
    c[K2], c[A], c[TAU] = c[K2] * k1, 0.5 * c[A] * s, of("tau_a", 0.0)
    return c


def slope(function: Callable[[Array], Array], c: Array, step: float = 1e-5) -> Array:
    """Derivative (q, p) of a smooth function at ``c`` (p,), by central differences of fourth order."""
    columns = []
    for k in range(len(c)):
        by = np.zeros(len(c))
        by[k] = step
        near, far = function(c + by) - function(c - by), function(c + 2.0 * by) - function(c - 2.0 * by)
        columns.append((8.0 * near - far) / (12.0 * step))
    return np.stack(columns, axis=1)
