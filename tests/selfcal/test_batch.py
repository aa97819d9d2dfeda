"""The batch estimator over all attitudes and coefficients, against other solvers, filters and bounds."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from paper_study import PRIOR, TRUTH, study
from scipy.linalg import cholesky_banded
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from inercal.foundation.geometry.rotations import (
    boxminus,
    boxplus,
    exp,
    inverse_left_jacobian,
    log,
    multiply,
    right_jacobian,
)
from inercal.systems.selfcal.before.bounds import bounds
from inercal.systems.selfcal.filters.batch import _terms_at, estimate_map, inverse_diagonal
from inercal.systems.selfcal.filters.problem import AttitudeStart, problem
from inercal.systems.selfcal.filters.residuals import (
    first_reading,
    readings,
    sensed,
    turns,
)
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.platform.coefficients import product_slope, to_linear
from inercal.systems.selfcal.platform.plan import path
from inercal.systems.selfcal.platform.recording import Steps
from inercal.systems.selfcal.settings import Filter, Gating
from inercal.systems.selfcal.simulate import experiment, simulate

EXTENDED_TRUTH = TRUTH + np.append(np.zeros(18), [40e-6, -60e-6, 80e-6, 1e-4, -2e-4, 1.5e-4])


def recorded(seed=1, name="paper", step=0.2, **changes):
    """A recording, its problem and the true coefficients in the linear form."""
    settings = study(plan=path(name, step), **changes)
    prepared = experiment(settings)
    simulated = simulate(prepared, np.random.default_rng(seed))
    return simulated.recording, problem(settings), prepared.truth[: len(settings.states.names)]


def sigmas(found):
    return np.sqrt(np.diag(found.covariance))


def with_gaps(recording, seed):
    """Without 30 % of the accelerometers' scalars, 80 % of the encoder readings and all of one minute."""
    rng = np.random.default_rng(seed)
    acc, th = recording.acc.copy(), recording.th.copy()
    acc[rng.random(acc.shape) < 0.3] = np.nan
    th[1:][rng.random(len(th) - 1) < 0.8, 1] = np.nan
    lost = (recording.t > 100.0) & (recording.t < 160.0)
    acc[lost], th[lost] = np.nan, np.nan
    return replace(recording, acc=acc, th=th)


def slope(function, size, step=1e-6):
    """Central differences of a vector function of ``size`` small changes."""
    columns = [(function(e) - function(-e)) / (2.0 * step) for e in step * np.eye(size)]
    return np.stack(columns, axis=-1)


@pytest.mark.kernels
@pytest.mark.parametrize("length", [0.0, 1e-9, 9e-3, 1.1e-2, 0.5, 3.0])
def test_jacobians_of_the_exponential(length):
    v = length * np.array([0.6, -0.64, 0.48])
    assert_allclose(right_jacobian(v), slope(lambda d: boxminus(exp(v + d), exp(v)), 3), atol=1e-9)
    assert_allclose(inverse_left_jacobian(v), slope(lambda d: log(multiply(exp(d), exp(v))), 3), atol=1e-8)


@pytest.mark.kernels
@pytest.mark.parametrize("extended", [False, True])
def test_derivatives_of_all_terms(extended):
    recording, given, _ = recorded(step=10.0, truth=EXTENDED_TRUTH, filter=Filter(extended=extended))
    rng = np.random.default_rng(4)
    p, n = len(given.prior), len(recording.t)
    c = given.prior * rng.standard_normal(p)
    measured, first = readings(recording, given), first_reading(recording, given)
    q = boxplus(np.vstack([first.attitude, measured.attitude]), 0.2 * rng.standard_normal((n, 3)))
    terms = _terms_at(q, c, recording, given, measured, first)

    def changed(attitudes, z):
        return _terms_at(boxplus(q, attitudes), c + given.prior * z, recording, given, measured, first)

    def check(derivative, residual, move, size):
        # residuals change by minus the derivative; steps differ in size over the rows, hence relative
        by = -slope(lambda d: residual(changed(*move(d))), size, 1e-4)
        scale = np.abs(by).max()
        # a turn of the earth within a step, 7e-4 in 10 s, is taken as small
        assert_allclose(derivative / scale, by / scale, atol=5e-7)

    still, at_rest = np.zeros(p), np.zeros((n, 3))
    after = (np.arange(n) > 0)[:, None]
    odd = (np.arange(n) % 2 == 1)[:, None]
    check(terms.by_first, lambda t: t.first, lambda d: (np.tile(d, (n, 1)), still), 3)
    check(terms.sensed.by_attitude, lambda t: t.sensed.residual, lambda d: (after * d, still), 3)
    check(terms.sensed.by_coefficients, lambda t: t.sensed.residual, lambda d: (at_rest, d), p)
    check(terms.by_coefficients, lambda t: t.process, lambda d: (at_rest, d), p)
    check(terms.by_next[::2], lambda t: t.process[::2], lambda d: (odd * d, still), 3)
    check(terms.by_last[1::2], lambda t: t.process[1::2], lambda d: (odd * d, still), 3)


def written_out(recording, given, q0):
    """All whitened residuals as a function of (n, 3) rotation vectors from ``q0`` and coefficients over prior.

    By matrices and SciPy's rotations, from the text of the model.
    """
    world, noise, n = given.world, given.noise, len(recording.t)
    base = Rotation.from_quat(q0, scalar_first=True)
    encoders = Rotation.from_euler("ZXY", recording.th)
    dt = recording.dt[:, None]
    _, thy, thz = recording.th[1:].T
    J = np.zeros((n - 1, 3, 3))
    J[:, 0, 0], J[:, 0, 1] = -np.sin(thz) * np.cos(thy), np.cos(thz)
    J[:, 1, 0], J[:, 1, 2] = np.sin(thy), 1.0
    J[:, 2, 0], J[:, 2, 1] = np.cos(thz) * np.cos(thy), np.sin(thz)
    R = noise.encoder**2 * (J @ np.swapaxes(J, 1, 2) + 0.05**2 * np.eye(3))
    root = np.linalg.cholesky(R)

    def function(x):
        turned = base * Rotation.from_rotvec(x[: 3 * n].reshape(n, 3))
        z = x[3 * n :]
        kg0, eta, ds, do, ka0, ka1 = (given.prior[:18] * z).reshape(6, 3)
        M = np.array([[0, ds[0], -do[0]], [-do[1], 0, ds[1]], [ds[2], -do[2], 0]])
        ahead = Rotation.from_rotvec((recording.rate @ (np.eye(3) + M).T + kg0) * dt)
        there = Rotation.from_rotvec(-world.earth * dt) * turned[:-1] * ahead
        f = turned[1:].inv().apply(world.up)
        misaligned = np.column_stack([0 * f[:, 0], -eta[1] * f[:, 0], eta[0] * f[:, 0] - eta[2] * f[:, 1]])
        miss = (turned.inv() * encoders).as_rotvec()
        terms = [
            miss[0] / noise.encoder,
            -z,
            (turned[1:].inv() * there).as_rotvec() / (noise.angle_random_walk * np.sqrt(dt)),
            (recording.acc[1:] - ka0 - (1 + ka1) * f - misaligned) / noise.accelerometer,
            np.linalg.solve(root, miss[1:, :, None]),
        ]
        return np.concatenate([np.ravel(term) for term in terms])

    return function


def test_least_squares_written_out_has_the_same_minimum():
    """A general solver on differences: same estimates, same uncertainties of everything, no gradient left."""
    recording, given, _ = recorded(step=45.0)
    found = estimate_map(recording, given)
    n, p = len(recording.t), 18
    encoders = np.vstack([first_reading(recording, given).attitude, readings(recording, given).attitude])
    steps = np.append(np.full(3 * n, 1e-6), np.full(p, 1e-3))

    def differences(function):
        def jacobian(x):
            columns = [(function(x + e) - function(x - e)) / (2.0 * e.sum()) for e in np.diag(steps)]
            return np.stack(columns, axis=-1)

        return jacobian

    function = written_out(recording, given, encoders)
    other = least_squares(function, np.zeros(3 * n + p), differences(function), x_scale=steps, ftol=1e-14)
    u = sigmas(found)
    assert_allclose(found.coefficients / u, given.prior * other.x[-p:] / u, atol=1e-4)
    # the prior's share included, normalised residuals are the least sum of squares
    assert found.nis.sum() == pytest.approx(2.0 * other.cost, rel=1e-7)
    function = written_out(recording, given, found.history.attitude)
    at = np.append(np.zeros(3 * n), found.coefficients / given.prior)
    J = differences(function)(at)
    every = np.linalg.inv(J.T @ J)
    u = np.sqrt(np.diag(every))
    assert_allclose(J.T @ function(at) * u, 0.0, atol=1e-4)
    assert_allclose(found.history.attitude_u.ravel(), u[:-p], rtol=1e-5)
    scaled = found.covariance / np.outer(given.prior, given.prior)
    assert_allclose(scaled / np.outer(u[-p:], u[-p:]), every[-p:, -p:] / np.outer(u[-p:], u[-p:]), atol=1e-5)


@pytest.mark.kernels
def test_diagonal_of_an_inverse():
    rng = np.random.default_rng(2)
    A = np.zeros((40, 40))
    for k in range(6):
        A += np.diag(rng.standard_normal(40 - k), -k)
    A = A @ A.T * (np.abs(np.subtract.outer(range(40), range(40))) < 6) + 40.0 * np.eye(40)
    band = np.array([np.append(np.diag(A, -k), np.zeros(k)) for k in range(6)])
    out = np.empty(40)
    inverse_diagonal(cholesky_banded(band, lower=True), out)
    assert_allclose(out, np.diag(np.linalg.inv(A)), rtol=1e-12)


def test_equal_to_the_error_state_filter():
    """At nominal noise both are the optimum: within 0.02 sigma (median over 8 seeds), and of one likelihood."""
    apart = []
    for seed in range(8):
        recording, given, _ = recorded(seed)
        found, filtered = estimate_map(recording, given), estimate(recording, given, "error-state")
        assert found.converged
        u = sigmas(found)
        apart.append(np.max(np.abs(found.coefficients - filtered.coefficients) / u))
        assert_allclose(u, sigmas(filtered), rtol=2e-3)
        # the sum of a filter's normalised innovations is the least sum of squares of the batch
        assert found.nis.sum() == pytest.approx(filtered.nis.sum(), rel=1e-5)
        assert_allclose(found.history.attitude_u[-1], filtered.history.attitude_u[-1], rtol=2e-3)
        miss = boxminus(found.attitude, filtered.attitude) / found.history.attitude_u[-1]
        assert_allclose(miss, 0.0, atol=0.02)
    assert np.median(apart) < 0.02


@pytest.mark.parametrize("noise", ["low", "nominal", "high"])
def test_covariance_is_the_bound(noise):
    recording, given, _ = recorded(noise=noise)
    settings = study(noise=noise)
    found = estimate_map(recording, given, history=False)
    bound = bounds(experiment(settings).motion, given, TRUTH)
    turned = product_slope(found.coefficients)
    assert_allclose(np.sqrt(np.diag(turned @ found.covariance @ turned.T)), bound.u, rtol=3e-3)
    assert found.history is None
    assert found.innovations.shape == (0, 6)


def test_gaps_are_left_out():
    for seed in (11, 12, 13):
        recording, given, truth = recorded(seed)
        recording = with_gaps(recording, seed)
        found, filtered = estimate_map(recording, given), estimate(recording, given, "error-state")
        assert np.all(np.abs(found.coefficients - filtered.coefficients) < 0.02 * sigmas(found))
        assert np.all(np.abs(found.coefficients - truth) < 4.5 * sigmas(found))
        assert_allclose(found.dims, filtered.dims)
        assert np.array_equal(np.isnan(found.nis), found.dims == 0)
        assert np.nansum(found.nis) == pytest.approx(np.nansum(filtered.nis), rel=1e-4)
        assert np.array_equal(np.isnan(found.innovations), np.isnan(filtered.innovations))


def test_extended_model():
    """Gyro scale errors and the zero of the encoders are found too, as the error-state filter finds them."""
    for seed in (21, 22, 23):
        recording, given, truth = recorded(seed, truth=EXTENDED_TRUTH, filter=Filter(extended=True))
        found, filtered = estimate_map(recording, given), estimate(recording, given, "error-state")
        assert found.converged
        assert len(found.coefficients) == 24
        u = sigmas(found)
        assert np.all(np.abs(found.coefficients - truth) < 4.5 * u)
        assert np.all(np.abs(found.coefficients - filtered.coefficients) < 0.05 * u)
        # X_p is never torqued, and the heading is that of the encoders: kg1x and beta up (y of b) stay at the prior
        known = [19, 20, 21, 23]
        assert np.all(u[known] < 0.02 * PRIOR[known])


@pytest.mark.parametrize("rule", ["any", "two", "channel"])
@pytest.mark.parametrize("stops", ["accelerometers", "step"])
def test_gate_stops_the_same_measurements_as_in_the_filter(rule, stops):
    recording, given, _ = recorded(31, step=1.0, filter=Filter(gating=Gating(rule, stops)))
    found, filtered = estimate_map(recording, given), estimate(recording, given, "error-state")
    assert_allclose(found.dims, filtered.dims)
    assert np.all(np.abs(found.coefficients - filtered.coefficients) < 0.02 * sigmas(found))


def test_other_gimbals_and_base():
    from inercal.systems.selfcal.platform.rig import Base, Gimbals

    rig = {"gimbals": Gimbals(("y", "z", "x"), (1, -1, 1)), "base": Base("ned", 0.7, (0.01, -0.02))}
    recording, given, truth = recorded(41, "best", 1.0, **rig)
    found, filtered = estimate_map(recording, given), estimate(recording, given, "error-state")
    assert np.all(np.abs(found.coefficients - truth) < 4.5 * sigmas(found))
    assert np.all(np.abs(found.coefficients - filtered.coefficients) < 0.02 * sigmas(found))


@pytest.mark.slow
def test_consistent_in_sixty_runs():
    """Truth from the prior, fresh noise: NEES is chi-square of 18 a run, NIS of 6 a row (seeds set beforehand)."""
    rng = np.random.default_rng(1905)
    runs, nees, nis, rows = 60, 0.0, 0.0, 0
    for _ in range(runs):
        truth = np.append(PRIOR[:18] * rng.standard_normal(18), np.zeros(6))
        settings = study("best", plan=path("best", 2.0), truth=truth)
        recording = simulate(experiment(settings), rng).recording
        found = estimate_map(recording, problem(settings), history=False)
        error = found.coefficients - to_linear(truth)[:18]
        nees += error @ np.linalg.solve(found.covariance, error)
        nis, rows = nis + found.nis.sum(), rows + found.steps
    # 3.3 standard deviations of the mean of a chi-square
    assert abs(nees / runs - 18.0) < 3.3 * np.sqrt(2 * 18.0 / runs)
    assert abs(nis / rows - 6.0) < 3.3 * np.sqrt(2 * 6.0 / rows)


def test_says_where_a_recording_is_far_from_the_model():
    recording, given, _ = recorded(step=1.0)
    swapped = replace(recording, acc=recording.acc[:, [1, 0, 2]])
    found = estimate_map(swapped, given)
    assert not found.converged
    assert "did not end" in found.message


def test_turn_of_a_step_is_that_of_the_commanded_rate():
    """Without errors a step turns by w dt, and a gyro bias by itself adds to it in proportion."""
    rate, dt, none = np.array([[0.1, -0.2, 0.3], [0.0, 0.0, 0.0]]), np.array([0.5, 2.0]), np.zeros((2, 3))
    steps, q = Steps(dt, rate, none, none, none, np.zeros(2)), np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
    turn, by = turns(q, steps, np.zeros(18), problem(study()))
    assert_allclose(turn, rate * dt[:, None])
    assert_allclose(by[1, :, :3], 2.0 * np.eye(3))


def test_perfect_attitude_leaves_the_outputs_of_the_coefficients():
    """Accelerometer y along the vertical reads ka0 + (1 + ka1) g."""
    recording, given, _ = recorded(step=10.0)
    measured = readings(recording, given)
    c = np.zeros(18)
    c[13], c[16] = 1e-3, 1e-3
    level = np.tile([1.0, 0.0, 0.0, 0.0], (len(measured.acc), 1))
    g = np.linalg.norm(given.world.up)
    read = measured.acc - sensed(level, c, measured, given).residual[:, :3] / measured.acc_weight
    assert_allclose(read[:, 1], 1e-3 + 1.001 * g)
    assert_allclose(read[:, [0, 2]], 0.0, atol=1e-12)


@pytest.mark.parametrize("degrees", [10.0, 45.0])
@pytest.mark.parametrize("name", ["paper", "best"])
def test_a_wrong_start_without_encoders_is_forgotten(name, degrees):
    """Told as such, up to 45 deg about any axis: the coefficients of a start at the truth, within 0.01 u."""
    settings = study(plan=path(name, 1.0))
    made, given = simulate(experiment(settings), np.random.default_rng(6)), problem(settings)
    directions = [*np.eye(3), *np.random.default_rng(17).standard_normal((2, 3))]
    th = np.where(np.arange(len(made.recording.t))[:, None] > 0, np.nan, made.recording.th)
    blind = replace(made.recording, th=th)
    near = estimate_map(blind, given, AttitudeStart(made.attitude[0], np.radians(degrees)))
    for direction in directions:
        off = np.radians(degrees) * direction / np.linalg.norm(direction)
        found = estimate_map(blind, given, AttitudeStart(boxplus(made.attitude[0], off), np.radians(degrees)))
        assert found.converged
        assert_allclose(found.coefficients / sigmas(near), near.coefficients / sigmas(near), atol=0.01)
