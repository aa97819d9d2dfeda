"""Normal gravity against published values and against the potential it is the gradient of."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from inercal.foundation.geometry import earth

# The four defining constants of WGS-84; everything else here follows from them.
A, F, GM, RATE = 6378137.0, 1.0 / 298.257223563, 3.986004418e14, 7.292115e-5
B = A * (1.0 - F)
E = np.sqrt(A * A - B * B)

LATITUDES = np.radians([-90.0, -60.0, -30.0, 0.0, 15.0, 45.0, 55.7, 75.0, 90.0])


def potential(x, z):
    """Normal gravity potential, in ellipsoidal coordinates (Hofmann-Wellenhof and Moritz, chapter 2)."""

    def q(u):
        return 0.5 * ((1.0 + 3.0 * (u / E) ** 2) * np.arctan(E / u) - 3.0 * u / E)

    r2 = x * x + z * z
    u2 = 0.5 * (r2 - E * E + np.sqrt((r2 - E * E) ** 2 + 4.0 * (E * z) ** 2))
    u = np.sqrt(u2)
    sin2 = (z / u) ** 2
    return (
        GM / E * np.arctan(E / u)
        + 0.5 * (RATE * A) ** 2 * q(u) / q(B) * (sin2 - 1.0 / 3.0)
        + 0.5 * (RATE * x) ** 2
    )


def gravity_of_the_potential(latitude, height):
    """Length of the gradient of the potential at a geodetic position, by complex steps."""
    normal = A / np.sqrt(1.0 - F * (2.0 - F) * np.sin(latitude) ** 2)
    x = (normal + height) * np.cos(latitude)
    z = (normal * (1.0 - F) ** 2 + height) * np.sin(latitude)
    h = 1e-3
    return np.hypot(potential(x + 1j * h, z).imag / h, potential(x, z + 1j * h).imag / h)


def test_published_values():
    assert earth.EARTH_RATE == 7.292115e-5
    assert_allclose(earth.gravity(0.0), 9.7803253359, atol=1e-10)
    assert_allclose(earth.gravity(0.5 * np.pi), 9.8321849378, atol=1e-10)
    assert_allclose(earth.gravity(0.25 * np.pi), 9.80619777, atol=5e-9)


def test_on_the_ellipsoid_gravity_is_the_gradient_of_the_potential():
    assert_allclose(earth.gravity(LATITUDES), gravity_of_the_potential(LATITUDES, 0.0), rtol=1e-10)


@pytest.mark.parametrize(
    ("height", "tolerance"), [(-100.0, 1e-7), (500.0, 1e-7), (2000.0, 2e-7), (10e3, 1e-6)]
)
def test_above_the_ellipsoid_gravity_is_the_gradient_of_the_potential(height, tolerance):
    """What the second-order polynomial in height leaves out [m/s²]."""
    exact = gravity_of_the_potential(LATITUDES, height)
    assert_allclose(earth.gravity(LATITUDES, height), exact, rtol=0, atol=tolerance)


def test_gravity_is_even_in_latitude():
    assert_allclose(earth.gravity(-LATITUDES, 300.0), earth.gravity(LATITUDES, 300.0))


@pytest.mark.parametrize("height", [0.0, 800.0, 10e3])
def test_gradient_is_the_numerical_derivative(height):
    latitude = LATITUDES[1:-1]
    step, lift = 1e-4, 100.0
    by_latitude, by_height = earth.gravity_gradient(latitude, height)
    turned = earth.gravity(latitude + step, height) - earth.gravity(latitude - step, height)
    lifted = earth.gravity(latitude, height + lift) - earth.gravity(latitude, height - lift)
    assert_allclose(by_latitude, turned / (2 * step), atol=1e-9)
    assert_allclose(by_height, lifted / (2 * lift), atol=1e-12)


def test_gravity_falls_by_a_third_of_a_milligal_a_metre():
    """The free-air gradient, -0.3086 mGal/m, and no change with latitude at the equator and the poles."""
    by_latitude, by_height = earth.gravity_gradient(np.array([-0.5, 0.0, 0.5]) * np.pi)
    assert_allclose(by_height, -3.086e-6, atol=5e-9)
    assert_allclose(by_latitude, 0.0, atol=1e-16)


def test_earth_rate_points_north_at_the_equator_and_down_at_the_south_pole():
    north, up = earth.earth_rate(np.radians([0.0, 90.0, -90.0]))
    assert_allclose(north, [earth.EARTH_RATE, 0.0, 0.0], atol=1e-20)
    assert_allclose(up, [0.0, earth.EARTH_RATE, -earth.EARTH_RATE], atol=1e-20)
    assert_allclose(np.hypot(*earth.earth_rate(LATITUDES)), earth.EARTH_RATE, rtol=1e-15)


@pytest.mark.parametrize("function", [earth.gravity, earth.gravity_gradient, earth.earth_rate])
def test_a_latitude_in_degrees_is_refused(function):
    with pytest.raises(ValueError, match=r"55\.7"):
        function([0.1, 55.7])


def test_latitude_and_height_broadcast():
    assert earth.gravity(LATITUDES[:, None], [0.0, 100.0]).shape == (9, 2)
    assert [part.shape for part in earth.gravity_gradient(LATITUDES[:, None], [0.0, 1.0])] == [(9, 2), (9, 2)]
