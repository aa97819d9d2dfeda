"""The model of the sensors and of how the state goes on: against differences, scipy, and points of a turning body."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from sting_study import DEG, G, study

from inercal.foundation.inference.kalman import empty_row
from inercal.foundation.units import Quantity, parse_unit
from inercal.systems.aoa.fusion import model
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.settings import Attitude, Timing

pytestmark = pytest.mark.kernels

STATES = (8, 11, 15, 19)


def made(states=19, spatial=False, delay=0.0, roll=0.0, plunge=False):
    """The problem of a study with heights, so that each term counts."""
    settings = study(
        states, timing=Timing(delay), attitude=Attitude(roll=Quantity(roll, 0.0, parse_unit("rad"), ""))
    )
    of = problem(replace(settings, layout=replace(settings.layout, z=np.array([0.05, -0.03, 0.04]))), spatial)
    # an axis that is square to nothing
    of.geometry[1, :2] = math.cos(0.4), math.sin(0.4)
    return replace(of, constants=of.constants._replace(plunge=float(plunge)))


def state(of, seed):
    """A state of a lively model."""
    rng = np.random.default_rng(seed)
    size = {
        "theta": 1.4, "rate": 3.0, "acceleration": 50.0, "jerk": 1e3, "phi": 1.0, "tau_g": 5e-3, "k_g": 0.05,
    }  # fmt: skip
    return np.array([size.get(name, 0.1) for name in of.names]) * rng.uniform(-1.0, 1.0, of.size)


def read(of, x, i, p=0.0, y=0.0):
    """Value, dense row and variance of accelerometer ``i``, of the gyro for i = N."""
    row = empty_row(model.WIDEST)
    at = model.Prediction(x, math.sin(x[0]), math.cos(x[0]), p, y, *x[1:4])
    if i < of.count:
        value, noise, size = model.accelerometer(i, at, of.model, row)
    else:
        value, noise, size = model.gyro(at, of.model, row)
    assert size <= model.WIDEST
    places = row.places[:size]
    assert len(set(places)) == size
    dense = np.zeros(of.size)
    dense[places] = row.values[:size]
    return value, dense, noise


def differences(function, x, step=1e-5):
    """Central differences (n,) or (n, m) of a function."""
    found = []
    for k in range(len(x)):
        each = np.zeros(len(x))
        each[k] = step * max(1.0, abs(x[k]))
        found.append((np.asarray(function(x + each)) - np.asarray(function(x - each))) / (2.0 * each[k]))
    return np.array(found)


CASES = st.fixed_dictionaries(
    {
        "states": st.sampled_from(STATES),
        "spatial": st.booleans(),
        "delay": st.sampled_from([0.0, 2e-3, None]),
        "roll": st.sampled_from([0.0, 0.6]),
        "plunge": st.booleans(),
    }
)


@settings(max_examples=60, deadline=None)
@given(case=CASES, seed=st.integers(0, 10**6), p=st.floats(-2, 2), y=st.floats(-2, 2))
def test_rows_are_the_derivatives_of_what_sensors_read(case, seed, p, y):
    """All sensors by all states; readings are of order g, their differences good to 1e-7 of that."""
    of = made(**case)
    x = state(of, seed)
    for i in range(of.count + 1):
        _, row, _ = read(of, x, i, p, y)
        expected = differences(lambda at, i=i: read(of, at, i, p, y)[0], x)
        np.testing.assert_allclose(row, expected, rtol=1e-6, atol=3e-7 * (1.0 + abs(expected).max()))


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), p=st.floats(-2, 2), y=st.floats(-2, 2))
def test_noise_of_the_roll_and_yaw_gyros_goes_through_the_lever_arms(seed, p, y):
    """Variance by propagation: that of the sensor, and (dA/dp)^2 + (dA/dy)^2 times that of a gyro."""
    of = made(spatial=True)
    x = state(of, seed)
    for i in range(of.count):
        by = differences(lambda at, i=i: read(of, x, i, *at)[0], np.array([p, y]))
        expected = of.constants.accelerometer_noise + (by @ by) * of.constants.turn_noise
        assert read(of, x, i, p, y)[2] == pytest.approx(expected, rel=1e-6)
    assert read(of, x, of.count)[2] == of.constants.gyro_noise


def attitude(psi, theta, phi):
    """Body to tunnel, x forward, y left, z up: yaw about z, then nose-up pitch, then roll about x."""
    c, s = math.cos, math.sin
    yaw = np.array([[c(psi), -s(psi), 0], [s(psi), c(psi), 0], [0, 0, 1]])
    pitch = np.array([[c(theta), 0, -s(theta)], [0, 1, 0], [s(theta), 0, c(theta)]])
    roll = np.array([[1, 0, 0], [0, c(phi), -s(phi)], [0, s(phi), c(phi)]])
    return yaw @ pitch @ roll


def moved(course, t, h=1e-3):
    """Body rates (3,), their derivatives, and the attitude at ``t``, by differences of rotation matrices alone."""

    def rates(t):
        ahead, here, back = attitude(*course(t + h)), attitude(*course(t)), attitude(*course(t - h))
        further, before = attitude(*course(t + 2 * h)), attitude(*course(t - 2 * h))
        W = here.T @ (8.0 * (ahead - back) - (further - before)) / (12.0 * h)
        return np.array([W[2, 1], W[0, 2], W[1, 0]])

    turning = (8.0 * (rates(t + h) - rates(t - h)) - rates(t + 2 * h) + rates(t - 2 * h)) / (12.0 * h)
    return rates(t), turning, attitude(*course(t))


@pytest.mark.parametrize("spatial", [False, True])
def test_an_accelerometer_reads_the_specific_force_of_its_point(spatial):
    """Positions of a point of a turning body, differentiated twice; gravity taken off; along the stated axis."""
    roll = 0.4
    of = made(spatial=spatial, roll=roll)

    def course(t):
        theta = 0.5 + 0.3 * math.sin(4.0 * t)
        if not spatial:
            return 0.0, theta, roll
        return 0.05 * math.sin(5.0 * t + 1.0), theta, roll + 0.1 * math.sin(3.0 * t)

    t, h = 0.37, 1e-3
    omega, turning, C = moved(course, t)
    _, theta, phi = course(t)
    x = np.zeros(of.size)
    x[0] = theta
    # the pitch at a fixed roll; with roll gyros the rate about the body's own axis, nose-up against +y
    x[1], x[2] = (
        (-omega[1], -turning[1]) if spatial else (-omega[1] / math.cos(phi), -turning[1] / math.cos(phi))
    )
    if spatial:
        x[of.places.roll] = phi
    for i, (along, down, r, z) in enumerate(of.geometry):

        def at(t, r=r, z=z):
            return attitude(*course(t)) @ np.array([r, 0.0, z])

        acceleration = (
            16.0 * (at(t + h) + at(t - h)) - (at(t + 2 * h) + at(t - 2 * h)) - 30.0 * at(t)
        ) / (12.0 * h * h)  # fmt: skip
        force = C.T @ (acceleration + np.array([0.0, 0.0, G]))
        # the differences are good to about 1e-8 m/s^2: h^4 / 30 of the sixth derivatives, rounding / h^2
        expected = force @ np.array([along, 0.0, -down])
        assert read(of, x, i, omega[0], omega[2])[0] == pytest.approx(expected, abs=1e-6)
    assert read(of, x, of.count)[0] == pytest.approx(-omega[1], abs=1e-9)


def test_at_rest_an_accelerometer_reads_g_sin_of_the_angle_from_its_axis():
    of = problem(study(8))
    for theta in np.linspace(-3.0, 3.0, 13):
        x = np.zeros(of.size)
        x[0] = theta
        for i, axis in enumerate(of.layout.angle):
            assert read(of, x, i)[0] == pytest.approx(G * math.sin(theta - axis), abs=1e-12)


def test_a_plunge_is_felt_as_more_gravity_and_heave_across_the_body():
    for theta in (-0.7, 0.2, 1.3):
        for plunge in (False, True):
            of = made(plunge=plunge)
            x = np.zeros(of.size)
            x[0] = theta
            still = np.array([read(of, x, i)[0] for i in range(of.count)])
            x[of.places.resonators + 1] = 0.5
            shaken = np.array([read(of, x, i)[0] for i in range(of.count)])
            felt = 0.5 / G * still if plunge else -0.5 * of.geometry[:, 1]
            np.testing.assert_allclose(shaken - still, felt, atol=1e-12)


@settings(max_examples=30, deadline=None)
@given(tau=st.floats(-5e-3, 5e-3), seed=st.integers(0, 10**6))
def test_a_late_gyro_reads_the_rate_of_before(tau, seed):
    """Where the jerk is constant the Taylor series ends, so that it is exact."""
    of = made(8, delay=tau)
    x = state(of, seed)
    before = x[1] - tau * x[2] + 0.5 * tau**2 * x[3]
    assert read(of, x, of.count)[0] == pytest.approx(before + x[model.GYRO_BIAS], rel=1e-12, abs=1e-12)


def continuous(of):
    """A (d, d) and the density of its noise (d, d), of motion and flexure."""
    d = len(of.places.moving)
    A, N = np.zeros((d, d)), np.zeros((d, d))
    A[0, 1] = A[1, 2] = A[2, 3] = 1.0
    N[3, 3] = of.constants.snap
    for b in range(2 if d > 4 else 0):
        w0, zeta, level = of.constants[-7:-1][3 * b : 3 * b + 3]
        s = 4 + 2 * b
        A[s : s + 2, s : s + 2] = [[0.0, 1.0], [-(w0**2), -2.0 * zeta * w0]]
        N[s + 1, s + 1] = 4.0 * zeta * w0 * level**2
    return A, N


def transition(of, dt):
    d = len(of.places.moving)
    F, Q = np.full((d, d), np.nan), np.full((d, d), np.nan)
    model.transition(dt, of.model, F, Q)
    return F, Q


@pytest.mark.parametrize("states", [8, 19])
@pytest.mark.parametrize("dt", [1e-4, 1e-3, 0.013, 0.1])
def test_the_transition_is_the_matrix_exponential_and_its_noise_van_loans(states, dt):
    of = made(states)
    F, Q = transition(of, dt)
    A, N = continuous(of)
    N[3, 3] *= max(1.0, 1e-3 / dt) ** 2  # above 1 kHz the snap grows with the square of the rate
    d = len(A)
    # units in which the numbers are alike, so that expm's error, relative to the largest, is small for each
    scale = np.array([1.0, 1 / dt, 1 / dt**2, 1 / dt**3, *([1e-3, 0.1] * 2)])[:d]
    A, N = A * scale / scale[:, None], N / np.outer(scale, scale)
    size = N.max()
    N /= size
    block = expm(np.block([[-A, N], [np.zeros((d, d)), A.T]]) * dt)
    expected = block[d:, d:].T
    np.testing.assert_allclose(F * scale / scale[:, None], expected, rtol=1e-10, atol=1e-12)
    noise = expected @ block[:d, d:]
    mine = Q / np.outer(scale, scale) / size
    np.testing.assert_allclose(mine, noise, rtol=1e-9, atol=1e-11 * abs(noise).max())
    # those of resonators for themselves: they are small beside the motion's
    mine, theirs = mine[4:, 4:], noise[4:, 4:]
    np.testing.assert_allclose(mine, theirs, rtol=1e-6, atol=1e-9 * abs(theirs).max(initial=0.0))


def test_resonators_start_as_they_stay():
    """Their prior covariance is that of the stationary process: F P F^T + Q = P."""
    of = made(19)
    F, Q = transition(of, 1e-3)
    s = of.places.resonators
    P = of.covariance[s : s + 4, s : s + 4]
    np.testing.assert_allclose(F[4:, 4:] @ P @ F[4:, 4:].T + Q[4:, 4:], P, rtol=1e-12, atol=1e-18)
    assert np.sqrt(np.diag(P)[[1, 3]]) == pytest.approx(0.01 * G, rel=1e-12)


def test_the_sting_does_not_bear_a_constant_force():
    """Zero gain at rest: the outputs s' of the resonators under a constant u go to zero, s to u / w0^2."""
    of = made(19)
    dt = 1e-3
    F, _ = transition(of, dt)
    constants = of.constants
    directions = (
        (constants.heave_frequency, constants.heave_damping),
        (constants.axial_frequency, constants.axial_damping),
    )
    for b, (w0, damping) in enumerate(directions):
        block = F[4 + 2 * b : 6 + 2 * b, 4 + 2 * b : 6 + 2 * b]
        fixed = np.array(
            [1.0 / w0**2, 0.0]
        )  # of u = 1: it must stay where it is, and all else must come to it
        A = np.array([[0.0, 1.0], [-(w0**2), -2.0 * damping * w0]])
        forced = np.linalg.solve(A, (block - np.eye(2)) @ np.array([0.0, 1.0]))
        np.testing.assert_allclose(block @ fixed + forced, fixed, rtol=1e-10, atol=1e-15)
        assert abs(np.linalg.eigvals(block)).max() < 1.0


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 10**6), p=st.floats(-1, 1), y=st.floats(-1, 1))
def test_the_turning_of_a_rolled_model_and_its_derivatives(seed, p, y):
    """theta' = w cos phi + y sin phi, phi' = p + (w sin phi - y cos phi) tan theta over a small step."""
    of = made(19, spatial=True)
    x, dt = state(of, seed), 1e-3
    x[0] *= 0.7  # away from the vertical, where roll has no meaning
    rows, roll = of.places.moving, of.places.roll
    d = len(rows)

    def after(x):
        F, Q = transition(of, dt)
        angles = model.turning(x, model.FusionStep(dt, p, y, Q[0, 0]), of.model, F, Q)
        return np.array(angles), F, Q

    (theta, phi), F, Q = after(x)
    jacobian = differences(lambda at: after(at)[0], x)[rows].T
    # in the row of the rate its change within the step is left out of tan theta; of order dt^2
    np.testing.assert_allclose(F[[0, d - 3]], jacobian, rtol=1e-3, atol=5e-5)
    pb, yb = p - x[roll + 1], y - x[roll + 2]
    s, c = math.sin(x[roll]), math.cos(x[roll])
    w = x[1] + 0.5 * x[2] * dt
    assert theta - x[0] == pytest.approx((w * c + yb * s) * dt, abs=1e-6)
    assert phi - x[roll] == pytest.approx(
        (pb + (x[1] * s - yb * c) * math.tan(x[0])) * dt, rel=2e-3, abs=1e-6
    )
    block = Q[np.ix_([0, d - 3], [0, d - 3])]
    assert (np.linalg.eigvalsh(block) >= -1e-18).all()


def test_the_rates_of_the_angles_are_those_of_the_attitude():
    """The same kinematics by differences of rotation matrices, at 0.5 rad of roll."""
    of = made(19, spatial=True)

    def course(t):
        return 0.2 * math.sin(3.0 * t), 0.6 + 0.3 * math.sin(2.0 * t), 0.5 + 0.2 * math.sin(4.0 * t + 1.0)

    t, dt = 0.21, 1e-4
    omega, _, _ = moved(course, t)
    x = np.zeros(of.size)
    x[0], x[1] = course(t)[1], -omega[1]
    x[of.places.roll] = course(t)[2]
    F, Q = transition(of, dt)
    theta, phi = model.turning(x, model.FusionStep(dt, omega[0], omega[2], 0.0), of.model, F, Q)
    _, ahead, rolled = course(t + dt)
    assert theta - x[0] == pytest.approx(ahead - x[0], abs=30 * DEG * dt**2 * 50)
    # over cos^2 theta + 1e-4 in place of cos^2 theta
    assert phi - course(t)[2] == pytest.approx(rolled - course(t)[2], rel=2e-3)
