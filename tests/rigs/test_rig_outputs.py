"""Gravity and earth rate on the instrument's axes, with the signs of Zhao et al. 2023."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.foundation.rigs.outputs import NAMES, gravity_reference, rate_reference, table_outputs
from inercal.foundation.rigs.plans import grid
from inercal.foundation.rigs.tables import turntable

G, LATITUDE = 9.8, np.radians(40.0)
TABLE = turntable("two_axis_turntable", None)


def test_gravity_and_earth_rate_of_the_two_axis_table():
    """a = g (s1 c2, -s1 s2, -c1); omega is the row (we cos L, 0, we sin L) on the same axes."""
    angles = grid((5, 7)).angles
    (c1, c2), (s1, s2) = np.cos(angles).T, np.sin(angles).T
    north, up = EARTH_RATE * np.cos(LATITUDE), EARTH_RATE * np.sin(LATITUDE)
    expected = {
        "ax": G * s1 * c2,
        "ay": -G * s1 * s2,
        "az": -G * c1,
        "wx": north * c1 * c2 - up * s1 * c2,
        "wy": -north * c1 * s2 + up * s1 * s2,
        "wz": north * s1 + up * c1,
    }
    C = TABLE.attitude(angles)
    for output in table_outputs(NAMES, G, LATITUDE):
        rate = output.name[0] == "w"
        assert_allclose(output.value(C), expected[output.name], atol=1e-14 * output.scale)
        assert output.unit == ("rad/s" if rate else "m/s^2")
        assert output.scale == (EARTH_RATE if rate else G)


def test_the_magnitudes_are_those_of_the_site():
    assert np.linalg.norm(gravity_reference(G)) == pytest.approx(G)
    assert np.linalg.norm(rate_reference(LATITUDE)) == pytest.approx(EARTH_RATE)
    assert_allclose(rate_reference(0.0), [EARTH_RATE, 0.0, 0.0])
    assert_allclose(gravity_reference(), [0.0, 0.0, -1.0])


def test_wx_is_an_acceleration_turned_by_the_colatitude():
    """we (cos L, 0, sin L) is -we times gravity's direction turned about y: phi1 + L - 90 deg."""
    angles = grid((12, 8)).angles
    ax, wx = table_outputs(("ax", "wx"), 1.0, LATITUDE)
    shifted = angles + np.array([LATITUDE - 0.5 * np.pi, 0.0])
    assert_allclose(
        wx.value(TABLE.attitude(angles)) / EARTH_RATE, -ax.value(TABLE.attitude(shifted)), atol=1e-14
    )


def test_rates_need_a_latitude():
    assert [each.name for each in table_outputs(("az", "ax"), G, None)] == ["az", "ax"]
    with pytest.raises(ValueError, match="wx is a component of earth rate"):
        table_outputs(("ax", "wx"), G, None)
    with pytest.raises(KeyError, match="bx"):
        table_outputs(("bx",), G, LATITUDE)
