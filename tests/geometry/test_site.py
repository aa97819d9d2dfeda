"""Sites: the vertical part of earth rate, and how well it is known."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inercal.foundation.geometry.earth import GravityInput, Site

WE = 7.292115e-5


@pytest.mark.parametrize(
    ("latitude_deg", "deg_per_h"),
    [(0.0, 0.0), (30.0, 7.52053), (90.0, 15.04107), (-90.0, -15.04107), (-30.0, -7.52053), (45.0, 10.63564)],
)
def test_vertical_rate(latitude_deg, deg_per_h):
    """15.04107 deg/h times the sine of the latitude; down in the south."""
    rate = Site(9.8, latitude=math.radians(latitude_deg)).vertical_rate
    assert math.degrees(rate) * 3600 == pytest.approx(deg_per_h, abs=2e-5)


def test_no_latitude_no_rate():
    assert Site(9.8).vertical_rate == 0.0


def test_any_latitude():
    """Places spread evenly over the sphere: mean 0 and the standard deviation of 200 000 draws (known to 0.1 %)."""
    rng = np.random.default_rng(1)
    place = rng.standard_normal((200_000, 3))
    rate = WE * place[:, 2] / np.linalg.norm(place, axis=1)
    site = Site(9.8)
    assert rate.std() == pytest.approx(site.vertical_rate_u, rel=0.005)
    assert rate.mean() == pytest.approx(site.vertical_rate, abs=5 * site.vertical_rate_u / math.sqrt(200_000))


@pytest.mark.parametrize("latitude_deg", [-60.0, 0.0, 39.1, 75.0])
def test_an_uncertain_latitude(latitude_deg):
    """Half a degree: the spread of 100 000 draws (known to 0.2 %; the second order adds less)."""
    latitude, u = math.radians(latitude_deg), math.radians(0.5)
    rates = WE * np.sin(np.random.default_rng(2).normal(latitude, u, 100_000))
    assert Site(9.8, (), latitude, u).vertical_rate_u == pytest.approx(rates.std(), rel=0.01)


@settings(deadline=None)
@given(st.floats(-math.pi / 2, math.pi / 2), st.floats(0.0, 10.0))
def test_a_stated_latitude_never_tells_less_than_none(latitude, u):
    assert 0.0 <= Site(9.8, (), latitude, u).vertical_rate_u <= Site(9.8).vertical_rate_u


def test_an_exact_latitude():
    assert Site(9.8, latitude=0.7).vertical_rate_u == 0.0


def test_inputs_of_gravity_are_kept():
    gravity = GravityInput("gravity", 2e-5, "m/s^2", 1.0)
    assert Site(9.81744, (gravity,)).inputs == (("gravity", 2e-5, "m/s^2", 1.0),)
