"""Where gravity points in the instrument over the positions of the named plans."""

import itertools

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from inercal.foundation.rigs.outputs import gravity_reference
from inercal.foundation.rigs.plans import NAMED, grid, listed, named
from inercal.foundation.rigs.tables import turntable

TABLE = turntable("two_axis_turntable", None)


def gravity(plan):
    """Directions (n, 3) of gravity on the instrument's axes."""
    return gravity_reference() @ TABLE.attitude(plan.angles)


def as_set(directions):
    return {tuple(row) for row in (np.round(directions, 9) + 0.0).tolist()}


def around(values):
    """All vectors with these magnitudes in any order and with any sign."""
    every = itertools.product(set(itertools.permutations(values)), itertools.product((1.0, -1.0), repeat=3))
    return as_set(np.array([np.multiply(*pair) for pair in every]))


@pytest.mark.parametrize(
    ("name", "values", "count"),
    [
        ("6-position", (1.0, 0.0, 0.0), 6),  # half axes
        ("8-position", (1 / np.sqrt(3),) * 3, 8),  # corners of a cube
        ("12-position", (1 / np.sqrt(2), 1 / np.sqrt(2), 0.0), 12),  # edges of a cube
    ],
)
def test_gravity_takes_each_direction_once(name, values, count):
    found = as_set(gravity(named(name)))
    assert len(named(name)) == len(found) == count
    assert found == around(values)


def test_directions_are_spread_evenly():
    """Sum of a a^T is n/3 times the identity: no direction is preferred."""
    for name in ("6-position", "8-position", "12-position"):
        a = gravity(named(name))
        assert_allclose(a.T @ a, len(a) / 3.0 * np.eye(3), atol=1e-12)
        assert_allclose(a.sum(axis=0), 0.0, atol=1e-12)


def test_the_classic_tumble():
    """(45 k, 0), (45 k, 90) and (90, 45 k) for k = 0..7 [deg]: three circles of eight about y, x and z."""
    plan = named("24-position")
    k = 45.0 * np.arange(8)
    expected = [*((a, 0.0) for a in k), *((a, 90.0) for a in k), *((90.0, a) for a in k)]
    assert_allclose(np.degrees(plan.angles), expected, atol=1e-12)
    a = gravity(plan)
    assert_allclose(np.stack([a[:8, 1], a[8:16, 0], a[16:, 2]]), 0.0, atol=1e-15)


def test_all_quarter_turns():
    plan = named("16-cube")
    quarters = (0.0, 90.0, 180.0, 270.0)
    assert_allclose(np.degrees(plan.angles), list(itertools.product(quarters, quarters)), atol=1e-12)


def test_names():
    assert [named(name).name for name in NAMED] == list(NAMED)
    with pytest.raises(KeyError, match="7-position"):
        named("7-position")


def test_grids_start_half_a_step_from_zero_and_the_first_joint_is_slowest():
    plan = grid((4, 2))
    expected = list(itertools.product((45.0, 135.0, 225.0, 315.0), (90.0, 270.0)))
    assert_allclose(np.degrees(plan.angles), expected, atol=1e-12)
    assert plan.name == "4 x 2 grid"
    plain = grid((2, 4), half_step=False)
    expected = list(itertools.product((0.0, 180.0), (0.0, 90.0, 180.0, 270.0)))
    assert_allclose(np.degrees(plain.angles), expected, atol=1e-12)
    assert grid((2, 3, 4)).angles.shape == (24, 3)


@pytest.mark.parametrize("counts", [(36, 36), (8, 12)])
def test_grids_of_multiples_of_four_meet_no_singular_attitude(counts):
    """No axis of the instrument is along gravity, where the derivative of its reading vanishes."""
    assert np.abs(gravity(grid(counts))).max() < 1.0 - 1e-3


def test_a_grid_has_positions():
    with pytest.raises(ValueError, match="expected 1 or more"):
        grid((3, 0))


def test_a_list_is_taken_as_it_is():
    assert_array_equal(listed([[0.1, 0.2], [0.3, 0.4]]).angles, [[0.1, 0.2], [0.3, 0.4]])
    assert len(listed([0.1, 0.2])) == 1
