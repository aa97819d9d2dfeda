"""Gravity and Earth rate at a site, on the WGS-84 ellipsoid.

References: NIMA TR8350.2, third edition, amendment 1 (2000), "Department of Defense World Geodetic System
1984", chapters 3 and 4; Hofmann-Wellenhof and Moritz 2006, "Physical Geodesy", second edition, chapter 2.
Real gravity differs from the normal gravity given here by up to some 1e-3 m/s², in most places by less than
5e-4 m/s².

A `Site` is a place with known gravity, and what that value is uncertain by.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray


class GravityInput(NamedTuple):
    """One source of uncertainty of gravity, type B.

    ``u`` its standard uncertainty in ``unit`` (SI), ``sensitivity`` dg/dinput [m/s^2 per that unit].
    """

    source: str
    u: float
    unit: str
    sensitivity: float


@dataclass(frozen=True)
class Site:
    """A place with known gravity.

    ``gravity`` [m/s^2] with its type B ``inputs``; ``latitude`` [rad], None if not known, with its standard
    uncertainty ``latitude_u`` [rad].
    """

    gravity: float
    inputs: tuple[GravityInput, ...] = ()
    latitude: float | None = None
    latitude_u: float = 0.0

    @property
    def vertical_rate(self) -> float:
        """Upward part of earth rate [rad/s]; 0 where the latitude is not known."""
        return 0.0 if self.latitude is None else EARTH_RATE * math.sin(self.latitude)

    @property
    def vertical_rate_u(self) -> float:
        """Standard uncertainty of `vertical_rate` [rad/s]; that of any latitude where it is not known.

        Over the whole sphere the sine of the latitude is uniform from -1 to 1.
        """
        if self.latitude is None:
            return EARTH_RATE / math.sqrt(3.0)
        return EARTH_RATE * min(math.cos(self.latitude) * self.latitude_u, 1.0 / math.sqrt(3.0))

    @property
    def horizontal_rate_u(self) -> float:
        """Standard deviation of either horizontal component of earth rate [rad/s] at an unknown heading.

        The square of the cosine of the latitude is 2/3 on average over the sphere.
        """
        if self.latitude is None:
            return EARTH_RATE / math.sqrt(3.0)
        return EARTH_RATE * math.cos(self.latitude) / math.sqrt(2.0)


Array: TypeAlias = NDArray[np.float64]

EARTH_RATE = 7.292115e-5
"""Rotation rate of the Earth against inertial space [rad/s], TR8350.2 table 3.1."""

# TR8350.2 tables 3.1, 3.3 and 3.4.
_A = 6378137.0  # semi-major axis [m]
_F = 1.0 / 298.257223563  # flattening
_E2 = _F * (2.0 - _F)  # first eccentricity squared
_M = 0.00344978650684  # omega² a² b / GM
_G_EQUATOR = 9.7803253359  # normal gravity [m/s²] at the equator
_G_POLE = 9.8321849378  # and at the poles
_K = (1.0 - _F) * _G_POLE / _G_EQUATOR - 1.0  # Somigliana's constant, b g_p / (a g_e) - 1


def gravity(latitude: ArrayLike, height: ArrayLike = 0.0) -> Array:
    """Magnitude of normal gravity.

    Somigliana's closed form on the ellipsoid, times its second-order continuation upward (both in TR8350.2,
    chapter 4). With s the sine squared of the latitude::

        g = g_e (1 + k s) / sqrt(1 - e² s) [1 - 2 (1 + f + m - 2 f s) h/a + 3 (h/a)²]

    Parameters
    ----------
    latitude : (*batch) rad, geodetic, north positive
    height : (*batch) m, above the ellipsoid

    Returns
    -------
    (*batch) m/s², positive; it acts downward, an accelerometer at rest indicates it upward.

    Raises
    ------
    ValueError : a latitude outside ±pi/2.
    """
    s, h = _sin2(latitude), np.asarray(height, dtype=float) / _A
    return _on_ellipsoid(s) * _height_factor(s, h)


def gravity_gradient(latitude: ArrayLike, height: ArrayLike = 0.0) -> tuple[Array, Array]:
    """Derivatives of `gravity` with respect to latitude and height, for the propagation of uncertainty.

    Parameters
    ----------
    latitude : (*batch) rad, geodetic, north positive
    height : (*batch) m, above the ellipsoid

    Returns
    -------
    (*batch) m/s² per rad, (*batch) m/s² per m : about +0.05 sin(2 latitude) and -3.09e-6.

    Raises
    ------
    ValueError : a latitude outside ±pi/2.
    """
    s, h = _sin2(latitude), np.asarray(height, dtype=float) / _A
    surface = _on_ellipsoid(s)
    surface_by_s = _G_EQUATOR * _K / np.sqrt(1.0 - _E2 * s) + surface * 0.5 * _E2 / (1.0 - _E2 * s)
    factor_by_h = -2.0 * (1.0 + _F + _M - 2.0 * _F * s) + 6.0 * h
    by_s = surface_by_s * _height_factor(s, h) + surface * 4.0 * _F * h
    return by_s * np.sin(2.0 * np.asarray(latitude, dtype=float)), surface * factor_by_h / _A


def earth_rate(latitude: ArrayLike) -> tuple[Array, Array]:
    """Earth rate against inertial space in the local level frame; its east component is zero.

    Parameters
    ----------
    latitude : (*batch) rad, geodetic, north positive

    Returns
    -------
    (*batch) rad/s, (*batch) rad/s : the components north and up; up is negative in the south.

    Raises
    ------
    ValueError : a latitude outside ±pi/2.
    """
    latitude = _checked(latitude)
    return EARTH_RATE * np.cos(latitude), EARTH_RATE * np.sin(latitude)


def _checked(latitude: ArrayLike) -> Array:
    """Latitude as an array, refused where it must be in degrees."""
    latitude = np.asarray(latitude, dtype=float)
    if np.any(np.abs(latitude) > 0.5 * np.pi):
        raise ValueError(f"latitude reaches {np.abs(latitude).max():g}; expected radians within ±pi/2")
    return latitude


def _sin2(latitude: ArrayLike) -> Array:
    """Sine squared of the latitude."""
    return np.square(np.sin(_checked(latitude)))


def _on_ellipsoid(s: Array) -> Array:
    """Somigliana's formula, s the sine squared of the latitude."""
    return _G_EQUATOR * (1.0 + _K * s) / np.sqrt(1.0 - _E2 * s)


def _height_factor(s: Array, h: Array) -> Array:
    """Gravity at height over gravity on the ellipsoid, h the height over the semi-major axis."""
    return 1.0 - 2.0 * (1.0 + _F + _M - 2.0 * _F * s) * h + 3.0 * h * h
