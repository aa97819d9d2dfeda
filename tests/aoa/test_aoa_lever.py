"""Lever-arm terms and what each way of taking them off leaves."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sting_study import DEG, NOISE, G, layout, study

from inercal.foundation.errors import StudyError
from inercal.foundation.inference.kalman import empty_row
from inercal.foundation.units import parse_quantity
from inercal.systems.aoa.fusion import model
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.layout import (
    Layout,
    all_weights,
    axes,
    centrifugal_arms,
    pair_weights,
    tangential_arms,
)
from inercal.systems.aoa.paper import residuals
from inercal.systems.aoa.paper.lever import centrifugal, differentiated, dual, peak_rate
from inercal.systems.aoa.paper.static import angle as angle_of
from inercal.systems.aoa.settings import Attitude

DA, DW, L = 1e-4 * G, 0.2 * DEG, 0.5
THREE = layout()


def place(low=-0.5, high=0.5):
    return st.floats(low, high)


@st.composite
def layouts(draw):
    """Axes -z, +x, +z and two more, anywhere."""
    angle = np.array([90.0, 0.0, -90.0, *(draw(st.floats(-180.0, 180.0)) for _ in range(2))]) * DEG
    r, z = (np.array([draw(place()) for _ in range(5)]) for _ in range(2))
    r[2] = r[0] + draw(st.sampled_from([-1.0, 1.0])) * draw(place(0.1, 1.0))
    return Layout(("a1", "a2", "a3", "a4", "a5"), angle, r, z)


def readings(of, level, theta, rate, acceleration):
    """Specific force at each sensor along its axis, from the equations of the rigid body."""
    fx = G * np.sin(theta) - of.r * rate**2 - level * of.z * acceleration
    fz = level * (G * np.cos(theta) + of.r * acceleration) - level**2 * of.z * rate**2
    return fx * np.cos(of.angle) - fz * np.sin(of.angle)


@given(of=layouts(), level=st.floats(0.2, 1.0), theta=place(-3, 3), rate=place(-2, 2), al=place(-50, 50))
@settings(max_examples=50, deadline=None)
def test_arms_are_those_of_the_model_of_the_fusion(of, level, theta, rate, al):
    """A = g (sin theta cos lambda - c cos theta sin lambda) - q w^2 + p al as the compiled model has it."""
    of_roll = Attitude(roll=parse_quantity(f"{math.degrees(math.acos(level))} deg", "angle", "roll"))
    fusion = problem(study(8, layout=of, attitude=of_roll))
    x = np.zeros(fusion.size)
    x[:3] = theta, rate, al
    at, row = (
        model.Prediction(x, math.sin(theta), math.cos(theta), 0.0, 0.0, rate, al, 0.0),
        empty_row(model.WIDEST),
    )
    read = [model.accelerometer(i, at, fusion.model, row)[0] for i in range(5)]
    level = fusion.constants.roll_cosine
    static = G * axes(of, level) @ [math.sin(theta), math.cos(theta)]
    q, p = centrifugal_arms(of, level), tangential_arms(of, level)
    np.testing.assert_allclose(static - q * rate**2 + p * al, read, atol=1e-10)


@given(of=layouts(), level=st.floats(0.2, 1.0), theta=place(-3, 3), rate=place(-2, 2), al=place(-50, 50))
@settings(max_examples=50, deadline=None)
def test_both_compensations_together_leave_what_is_read_at_rest(of, level, theta, rate, al):
    """Any axes, any positions, any roll."""
    acc = readings(of, level, theta, rate, al)[None]
    made, compensated = centrifugal("mechanical", np.zeros(1), acc, np.array([level * rate]), of, level, DW)
    weights, matrix = dual(of, level)
    assert float(made[0] @ weights) == pytest.approx(al, abs=1e-9)
    np.testing.assert_allclose(matrix @ made[0], readings(of, level, theta, 0.0, 0.0), atol=1e-9)
    assert compensated.tolist() == [1.0]


def test_the_longest_arm_makes_the_dual_accelerometer():
    """Of antiparallel pairs (A1 + A3)/(r3 - r1), of parallel ones the difference."""
    np.testing.assert_allclose(pair_weights(THREE), [2.0, 0.0, 2.0])
    down = np.full(3, 0.5 * math.pi)
    parallel = Layout(("a1", "a2", "a3"), down, np.array([0.1, -0.2, 0.5]), np.zeros(3))
    np.testing.assert_allclose(pair_weights(parallel), np.array([0.0, 1.0, -1.0]) / 0.7)
    five = Layout(
        tuple("abcde"), np.array([90, -90, 90, -90, 0]) * DEG, np.array([0.1, 0.3, -0.4, 0.2, 0]), np.zeros(5)
    )
    np.testing.assert_allclose(pair_weights(five), np.array([0, 1, 1, 0, 0]) / 0.7)


def test_of_calibrated_axes_that_are_not_quite_parallel_gravity_cancels_too():
    """0.03 deg off: a third axis takes the rest off, which would be 5e-4 g at the arm's end."""
    angle = np.array([90.03, 0.01, -90.02]) * DEG
    of = Layout(("a1", "a2", "a3"), angle, np.array([-0.25, 0.2, 0.3]), np.array([0.0, 0.01, 0.0]))
    weights, matrix = dual(of, 1.0)
    for theta in np.linspace(-3.0, 3.0, 13):
        acc = readings(of, 1.0, theta, 0.0, 7.0)
        assert acc @ weights == pytest.approx(7.0, abs=1e-12)
        np.testing.assert_allclose(matrix @ acc, readings(of, 1.0, theta, 0.0, 0.0), atol=1e-12)
        for way in ("complementary", "improved"):
            found = angle_of(way, readings(of, 1.0, theta, 0.0, 0.0)[None], of, G).theta
            assert found == pytest.approx(theta, abs=1e-12)


@given(of=layouts())
@settings(deadline=None)
def test_least_squares_from_all_axes_have_no_gravity_and_less_noise_than_a_pair(of):
    every, pair = all_weights(of), pair_weights(of)
    if every is None:  # five axes of which two were drawn so that their arms cancel
        return
    np.testing.assert_allclose(every @ axes(of), 0.0, atol=1e-9 * np.abs(every).max())
    assert every @ tangential_arms(of) == pytest.approx(1.0)
    assert np.linalg.norm(every) <= np.linalg.norm(pair) * (1.0 + 1e-9)


def test_without_an_arm_between_parallel_axes_there_is_no_dual_accelerometer():
    angle = np.array([90.0, 0.0, -90.0]) * DEG
    together = Layout(("a1", "a2", "a3"), angle, np.full(3, 0.2), np.zeros(3))
    for of in (together, THREE.of(0, 1)):
        with pytest.raises(StudyError, match="lever arm between them"):
            dual(of, 1.0)
        assert all_weights(of) is None


@given(r1=place(-0.6, 0.6), r3=place(-0.6, 0.6), read=st.lists(place(-30, 30), min_size=3, max_size=3))
@settings(deadline=None)
def test_dual_compensation_makes_the_antiparallel_axes_equal_whatever_they_read(r1, r3, read):
    """A1c = -A3c identically, and the noise of either is sqrt(r1^2 + r3^2)/|r3 - r1| of that of a reading."""
    if abs(r3 - r1) < 0.05:
        return
    _, matrix = dual(layout(r=(r1, 0.2, r3)), 1.0)
    a1, _, a3 = matrix @ np.array(read)
    assert a1 == pytest.approx(-a3, abs=1e-9)
    gain = residuals.dual_gain(r1, r3)
    np.testing.assert_allclose(np.linalg.norm(matrix, axis=1)[[0, 2]], gain, rtol=1e-9)
    assert gain >= 1.0 / math.sqrt(2.0) - 1e-12
    assert residuals.dual_gain(-0.3, 0.3) == pytest.approx(1.0 / math.sqrt(2.0))


def oscillating(amplitude, frequency, duration=40.0, mean=0.0):
    """Times, angle, rate and acceleration of an oscillation [deg, Hz] sampled at 500 Hz."""
    t = np.arange(0.0, duration, 2e-3)
    om, a = 2.0 * math.pi * frequency, amplitude * DEG
    return t, mean * DEG + a * np.sin(om * t), a * om * np.cos(om * t), -a * om**2 * np.sin(om * t)


def read_of(theta, rate, al, of=THREE):
    return np.stack([readings(of, 1.0, *each) for each in zip(theta, rate, al, strict=True)])


@pytest.mark.parametrize(("amplitude", "frequency"), [(0.5, 0.78), (1.0, 1.3), (0.2, 4.0)])
def test_a_low_pass_leaves_half_of_the_centrifugal_term(amplitude, frequency):
    """-r X^2/2 at a mean of zero, where sin theta has no part at twice the frequency: the cosine is gone to 2 %.

    Of the oscillation itself 0.4 % are lost to the filter, its stated cost.
    """
    t, theta, rate, al = oscillating(amplitude, frequency)
    made, compensated = centrifugal("low-pass", t, read_of(theta, rate, al), rate, THREE, 1.0, DW)
    kept = 1.0 / (1.0 + 0.5**8)
    left = (made[:, 1] - kept * G * np.sin(theta))[(t > 8.0) & (t < 32.0)]
    expected = residuals.low_pass(0.20, np.abs(rate).max())
    assert -left.mean() == pytest.approx(expected, rel=0.01)
    assert np.abs(left + expected).max() < 0.03 * expected + 2e-5 * G * np.sin(amplitude * DEG)
    assert not compensated.any()


def test_of_an_oscillation_about_another_angle_the_low_pass_takes_gravity_too():
    """(theta_m^2/4) sin theta_0 at twice the frequency: 0.22 deg of 10 deg about 30 deg, why it is no default."""
    t, theta, rate, al = oscillating(10.0, 1.0, mean=30.0)
    made, _ = centrifugal(
        "low-pass", t, read_of(theta, rate, al) + 0.2 * rate[:, None] ** 2, rate, THREE, 1.0, DW
    )
    inner = (t > 8.0) & (t < 32.0)
    lost = (G * np.sin(theta) - made[:, 1])[inner]
    second = 2.0 * np.mean(lost * np.cos(4.0 * math.pi * t[inner]))
    assert second / G == pytest.approx((10.0 * DEG) ** 2 / 4.0 * math.sin(30.0 * DEG), rel=0.02)


@pytest.mark.parametrize("x", [0.5, 3.0, 30.0])
def test_mechanical_compensation_leaves_what_the_gyro_errs_by(x):
    """r (2 X dw + dw^2) at the peak of the rate, by a gyro that is off by dw."""
    t, theta, rate, al = oscillating(x / (2.0 * math.pi), 1.0)
    made, _ = centrifugal("mechanical", t, read_of(theta, rate, al), rate + DW, THREE, 1.0, DW)
    left = made[:, 1] - G * np.sin(theta)
    assert left.max() == pytest.approx(residuals.mechanical(0.20, x * DEG, DW), rel=1e-3)


def test_both_leave_as_much_at_the_rate_of_the_decision():
    """X/dw = 2 + sqrt 6; f0 is where an oscillation has that rate."""
    x = residuals.DECISION * DW
    assert residuals.low_pass(0.2, x) == pytest.approx(residuals.mechanical(0.2, x, DW), rel=1e-12)
    assert residuals.peak_rate_at(1.0, DW) == pytest.approx(x, rel=1e-12)
    assert pytest.approx(4.449, abs=5e-4) == residuals.DECISION
    for amplitude in (0.01, 1.0):
        f0 = residuals.decision_frequency(amplitude * DEG, DW)
        assert 2.0 * math.pi * f0 * amplitude * DEG == pytest.approx(x)


def test_the_decision_is_that_of_the_rate_not_of_its_noise():
    """Oscillations of 0.8 and of 1.2 times the deciding rate, in the gyro's noise, whose samples exceed both."""
    rng = np.random.default_rng(11)
    for times, mechanical in ((0.8, False), (1.2, True)):
        t, theta, rate, al = oscillating(times * residuals.DECISION * 0.2 / (2.0 * math.pi * 1.5), 1.5)
        gyro = rate + DW * rng.standard_normal(len(t))
        made, compensated = centrifugal("decision", t, read_of(theta, rate, al), gyro, THREE, 1.0, DW)
        inner = (t > 5.0) & (t < 35.0)
        assert (compensated[inner] == mechanical).all()
        same, _ = centrifugal(
            "mechanical" if mechanical else "low-pass", t, read_of(theta, rate, al), gyro, THREE, 1.0, DW
        )
        np.testing.assert_array_equal(made[inner], same[inner])
        assert np.median(peak_rate(t, gyro, DW)) == pytest.approx(np.abs(rate).max(), rel=0.05)


def test_at_rest_a_low_pass_has_nothing_to_remove():
    t = np.arange(0.0, 20.0, 2e-3)
    acc = DA * np.random.default_rng(12).standard_normal((len(t), 3))
    for way in ("none", "low-pass"):
        made, _ = centrifugal(way, t, acc, np.zeros(len(t)), THREE, 1.0, DW)
        np.testing.assert_array_equal(made, acc)


def test_the_first_difference_of_a_gyro_has_the_noise_of_its_formula():
    """sqrt(2) dw fs; behind an ideal low pass the root of its spectrum's integral. 2 % for 20000 samples."""
    rng = np.random.default_rng(13)
    n, fs = 20000, 1000.0
    gyro = DW * rng.standard_normal(n)
    t = np.arange(n) / fs
    assert np.nanstd(differentiated(t, gyro, 1.0)) == pytest.approx(
        residuals.differentiated(DW, fs), rel=0.03
    )
    assert np.isnan(differentiated(t, gyro, 1.0)[0])
    for cutoff in (50.0, 200.0, 499.9):
        spectrum = np.fft.rfft(gyro)
        spectrum[np.fft.rfftfreq(n, 1.0 / fs) > cutoff] = 0.0
        smooth = np.fft.irfft(spectrum, n)
        found = differentiated(t, smooth, 1.0)[1:].std()
        assert found == pytest.approx(residuals.differentiated(DW, fs, cutoff), rel=0.05)
    # narrow bands: 2 pi fc sqrt(2 fc/(3 fs)) dw
    close = 2.0 * math.pi * 10.0 * math.sqrt(20.0 / (3.0 * fs)) * DW
    assert residuals.differentiated(DW, fs, 10.0) == pytest.approx(close, rel=1e-3)


def test_errors_of_the_dual_accelerometer_are_those_of_its_formula():
    weights, _ = dual(THREE, 1.0)
    assert np.linalg.norm(weights) * DA == pytest.approx(residuals.dual(DA, L, alike=False))
    assert abs(weights.sum()) * DA == pytest.approx(residuals.dual(DA, L, alike=True))


class TestSectionFour:
    """The paper's figures: dA = 1e-4 g, dw = 0.2 deg/s, L = 0.5 m, and where they come out."""

    def test_micro_oscillation(self):
        """The low pass leaves 2 % of mechanical compensation at a peak rate of 0.049 deg/s: 0.01 deg at 0.78 Hz."""
        x = residuals.peak_rate_at(0.02, DW)
        assert x / DEG == pytest.approx(0.049, abs=5e-4)
        assert x / (2.0 * math.pi * 0.01 * DEG) == pytest.approx(0.78, abs=5e-3)
        assert residuals.low_pass(0.2, x) == pytest.approx(0.02 * residuals.mechanical(0.2, x, DW))

    def test_large_oscillation(self):
        """Mechanical compensation leaves 3 to 1 % of the low pass at 27 to 80 deg/s: 10 deg at 0.43 to 1.27 Hz."""
        low, high = (residuals.peak_rate_at(100.0 / percent, DW) for percent in (3.0, 1.0))
        assert (low / DEG, high / DEG) == pytest.approx((27.0, 80.0), abs=0.3)
        assert (low / (2.0 * math.pi * 10.0 * DEG), high / (2.0 * math.pi * 10.0 * DEG)) == pytest.approx(
            (0.43, 1.27), abs=6e-3
        )

    def test_dual_against_untreated(self):
        """1 to 0.1 % at theta_m Om^2 = 0.28-2.8 (independent errors) and 0.39-3.9 rad/s^2 (equal)."""
        for alike, expected in ((False, (0.28, 2.8)), (True, (0.39, 3.9))):
            found = [residuals.dual(DA, L, alike) / ratio for ratio in (0.01, 0.001)]
            assert found == pytest.approx(expected, rel=0.01)
        assert residuals.may_be_left(DA, L) == pytest.approx(3.9e-3, rel=0.01)
        assert residuals.untreated(10.0 * DEG, 1.0) == pytest.approx(10.0 * DEG * 2.0 * math.pi)

    def test_dual_against_differentiation(self):
        """0.1 % of an unfiltered first difference at 500 to 1000 Hz, 15-25 % behind a low pass of 7.3-10.2 Hz."""
        ratios = [
            residuals.dual(DA, L, alike) / residuals.differentiated(DW, fs)
            for alike in (False, True)
            for fs in (500.0, 1000.0)
        ]
        assert min(ratios) == pytest.approx(0.56e-3, rel=0.01)
        assert max(ratios) == pytest.approx(1.6e-3, rel=0.01)
        behind = [
            residuals.dual(DA, L, False) / residuals.differentiated(DW, 1000.0, fc) for fc in (7.3, 10.2)
        ]
        assert behind == pytest.approx([0.25, 0.15], rel=0.02)

    def test_dynamic(self):
        """0.12 deg: per sample of 60 s at r2 X = 0.87 m/s about 30 deg."""
        found = residuals.sampled(1.0, 0.867, DW, G, 60000.0, 30.0 * DEG)
        assert found / DEG == pytest.approx(0.12, rel=2e-3)

    def test_largest_of_many_samples(self):
        """Against draws: 200 times 5000 samples, whose largest scatters by 8 %: 0.6 % of the median."""
        rng = np.random.default_rng(14)
        rate = np.cos(2.0 * math.pi * np.arange(5000) / 500.0)
        drawn = np.abs(2.0 * 0.8 * rate * NOISE.gyro * rng.standard_normal((200, 5000))).max(axis=1) / G
        # the level exceeded once on average lies where the largest stays below with probability 1/e
        found = residuals.sampled(1.0, 0.8, NOISE.gyro, G, 5000.0)
        assert found == pytest.approx(np.quantile(drawn, math.exp(-1.0)), rel=0.02)
