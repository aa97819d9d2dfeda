"""Three ways from readings at rest to an angle: what they err by, over all angles and layouts."""

import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from sting_study import DEG, G, layout

from inercal.foundation.errors import StudyError
from inercal.systems.aoa.layout import Layout
from inercal.systems.aoa.paper.static import angle, bound, complementary, improved, segmented, spread
from rows import for_each

DA = 1e-4 * G
ALL = ("segmented", "complementary", "improved")
AROUND = np.linspace(-180.0, 180.0, 1441)[1:] * DEG
THREE = layout()


def axes_at(*degrees):
    count = len(degrees)
    return Layout(
        tuple(f"a{k + 1}" for k in range(count)), np.array(degrees) * DEG, np.zeros(count), np.zeros(count)
    )


LAYOUTS = (
    THREE,
    axes_at(0.0, 90.0, 180.0, -90.0),
    axes_at(-90.0, -45.0, 0.0, 45.0, 90.0),
    axes_at(20.0, 110.0, 200.0, 65.0, -70.0),
)


def readings(theta, of, level=1.0):
    """A = g (sin theta cos lambda - c cos theta sin lambda)."""
    theta = np.asarray(theta, dtype=float)[:, None]
    return G * (np.sin(theta) * np.cos(of.angle) - level * np.cos(theta) * np.sin(of.angle))


def apart(a, b):
    return np.remainder(a - b + math.pi, 2.0 * math.pi) - math.pi


@pytest.mark.parametrize("of", LAYOUTS)
@pytest.mark.parametrize("way", ALL)
@given(
    theta=st.floats(-math.pi, math.pi, exclude_min=True),
    level=st.one_of(st.just(1.0), st.floats(0.2, 1.0), st.floats(-1.0, -0.2)),
)
@example(theta=-3.1415926535897927, level=1.0)
@settings(max_examples=25, deadline=None)
def test_readings_without_error_give_the_angle_all_around_at_any_roll(way, of, theta, level):
    found = angle(way, readings([theta], of, level), of, G, level).theta
    # the arc sine alone loses half of the digits where its axis lies along gravity
    assert abs(apart(found, theta))[0] < (1e-7 if way == "segmented" else 1e-11)
    assert -math.pi < found[0] <= math.pi


@for_each("of", LAYOUTS)
@for_each("level", [1.0, 0.8])
@for_each("way", ALL)
def test_gain_is_how_the_angle_errs_with_each_reading(way, level, of):
    """By central differences, at angles at which no way switches from one axis to another."""
    theta = (np.arange(-175.0, 180.0, 10.0) + 1.7) * DEG
    read = readings(theta, of, level)
    gain = angle(way, read, of, G, level).gain
    for k in range(len(of.names)):
        step = np.zeros(len(of.names))
        step[k] = 1e-5 * G
        ends = [angle(way, read + sign * step, of, G, level).theta for sign in (1.0, -1.0)]
        np.testing.assert_allclose(apart(*ends) / (2e-5 * G), gain[:, k], atol=1e-6)


def test_segmented_errs_by_the_inverse_cosine_from_its_axis_and_never_by_less_than_da_over_g():
    of = axes_at(-90.0, -45.0, 0.0, 45.0, 90.0)
    theta = np.linspace(-90.0, 90.0, 722) * DEG
    still = segmented(readings(theta, of) + DA, of, G)
    nearest = np.cos(theta[:, None] - of.angle).max(axis=1)
    expected = DA / (G * nearest)
    np.testing.assert_allclose(still.theta - theta, expected, rtol=1e-4)
    np.testing.assert_allclose(bound(still.gain, DA, "alike"), expected, rtol=2e-4)
    assert (bound(still.gain, DA, "any") >= DA / G * (1.0 - 1e-9)).all()


@given(theta=st.floats(-math.pi, math.pi), sign=st.sampled_from([-1.0, 1.0]))
@settings(deadline=None)
def test_segmented_is_not_wrong_by_half_a_turn_where_axes_are_antiparallel(theta, sign):
    """The smallest reading has two angles to it; with axes all around, errors as large as 0.05 g do not mislead."""
    of = axes_at(0.0, 90.0, 180.0, -90.0)
    found = segmented(readings([theta], of) + sign * 0.05 * G * np.array([1.0, -1.0, 1.0, 1.0]), of, G).theta
    assert abs(apart(found, theta))[0] < 0.1


def test_of_antiparallel_axes_segmented_takes_that_which_looks_forward():
    gain = segmented(readings([-60.0 * DEG, 60.0 * DEG], THREE), THREE, G).gain
    assert np.argmax(np.abs(gain), axis=1).tolist() == [2, 0]


def test_complementary_errs_by_root_two_times_a_sine():
    """sqrt(2) dA sin(theta - lambda_2 + 45 deg)/g for equal errors, lambda_2 = 0: a1 and a2."""
    still = complementary(readings(AROUND, THREE) + DA, THREE, G)
    expected = math.sqrt(2.0) * DA * np.sin(AROUND + 0.25 * math.pi) / G
    np.testing.assert_allclose(apart(still.theta, AROUND), expected, atol=2.0 * (DA / G) ** 2)
    assert (still.gain[:, 2] == 0.0).all()
    assert bound(still.gain, DA, "alike").max() == pytest.approx(math.sqrt(2.0) * DA / G, rel=1e-5)


def test_improved_errs_by_no_more_than_da_over_g_all_around():
    """0.00573 deg for 1e-4 g, the paper's 0.006; both where errors are alike, of either sign."""
    for sign in (-1.0, 1.0):
        still = improved(readings(AROUND, THREE) + sign * DA, THREE, G)
        errors = apart(still.theta, AROUND)
        assert np.abs(errors).max() <= DA / G * (1.0 + 2e-4)
        assert np.degrees(np.abs(errors).max()) == pytest.approx(0.00573, abs=1e-5)
        np.testing.assert_allclose(bound(still.gain, DA, "alike"), np.abs(errors), atol=2.0 * (DA / G) ** 2)


def test_improved_switches_where_the_paper_does():
    """a1 and a2 below zero, a2 and a3 above; the same pairs again half a turn on."""
    used = improved(readings(np.array([-80, -10, 10, 80, 100, 170, -100, -170]) * DEG, THREE), THREE, G).gain
    with_a1 = [True, True, False, False, True, True, False, False]
    assert (used[:, 0] != 0.0).tolist() == with_a1
    assert (used[:, 2] != 0.0).tolist() == [not each for each in with_a1]


def test_errors_of_independent_sign_can_do_more_to_improved_than_alike_ones():
    gain = improved(readings(AROUND, THREE), THREE, G).gain
    assert bound(gain, DA, "any").max() == pytest.approx(math.sqrt(2.0) * DA / G, rel=1e-4)
    np.testing.assert_allclose(bound(gain, DA, "independent"), DA / G, rtol=1e-9)


@pytest.mark.parametrize("of", LAYOUTS)
def test_no_way_is_surer_than_the_readings(of):
    """Gauss and Markov: no unbiased way has less than 1/(h' R^-1 h)."""
    n = len(of.names)
    root = np.random.default_rng(5).normal(size=(n, n))
    covariance = DA**2 * (root @ root.T + 0.1 * np.eye(n))
    slope = G * np.cos(AROUND[:, None] - of.angle)
    least = 1.0 / np.sqrt(np.einsum("ni,ij,nj->n", slope, np.linalg.inv(covariance), slope))
    for way in ALL:
        found = spread(angle(way, readings(AROUND, of), of, G).gain, [(1.0, covariance)])
        assert (found >= least * (1.0 - 1e-9)).all()


@pytest.mark.parametrize("way", ALL)
def test_spread_is_the_standard_deviation_of_the_angle(way):
    """20000 draws at a mean of 35 deg: a standard deviation is known to 0.5 %."""
    rng = np.random.default_rng(8)
    covariance = DA**2 * (0.5 + 1.5 * np.eye(3))
    errors = rng.multivariate_normal(np.zeros(3), covariance, 20000)
    read = readings(np.full(20000, 35.0 * DEG), THREE) + errors
    still = angle(way, read, THREE, G)
    expected = spread(still.gain, [(1.0, covariance)]).mean()
    assert apart(still.theta, 35.0 * DEG).std() == pytest.approx(expected, rel=0.03)


def test_errors_add_up_with_their_weights():
    gain = complementary(readings([0.2, 0.4], THREE), THREE, G).gain
    once, twice = (spread(gain, [(weight, DA**2 * np.eye(3))]) for weight in (1.0, np.array([4.0, 9.0])))
    np.testing.assert_allclose(twice, once * [2.0, 3.0])


@pytest.mark.parametrize(
    ("way", "of", "says"),
    [
        ("segmented", axes_at(0.0, 180.0), "parallel axes only"),
        ("complementary", axes_at(0.0, 80.0, 30.0), "no two axes at a right angle"),
        ("improved", axes_at(0.0, 80.0, 30.0), "no two axes at a right angle"),
    ],
)
def test_axes_that_a_way_lacks_are_named(way, of, says):
    with pytest.raises(StudyError, match=says):
        angle(way, np.zeros((1, len(of.names))), of, G)
