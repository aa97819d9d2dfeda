"""The filter of the paper: against its whole set of points in NumPy, the error-state filter, and its own laws."""

import math
from dataclasses import replace

import numpy as np
import pytest
from paper_study import study

from inercal.foundation.geometry.rotations import exp, multiply
from inercal.foundation.inference.sigma_point import CHOLESKY, FACTORS, NEGATIVE, root
from inercal.systems.selfcal.filters import error_state, quaternion
from inercal.systems.selfcal.filters.problem import AttitudeStart, problem
from inercal.systems.selfcal.platform.coefficients import to_linear
from inercal.systems.selfcal.platform.kinematics import attitude, joint_axes
from inercal.systems.selfcal.platform.plan import PlatformPlan, Turn
from inercal.systems.selfcal.settings import Filter, Gating
from inercal.systems.selfcal.simulate import experiment, simulate

#: a path on which all three joints turn, 431 rows
MIXED = PlatformPlan((Turn("y", 0.5), Turn("z", -0.6), Turn("x", 0.4)), start=(0.3, -0.2, 0.1))


def simulated(seed=20261121, factor="cholesky", extended=False, **changes):
    """A recording and what the filter is told."""
    kind = Filter("svd-qukf", factor=factor, extended=extended)
    settings = study(filter=kind, **changes)
    return simulate(experiment(settings), np.random.default_rng(seed)), problem(settings)


def run(recording, told, steps=None, state=None, first=0, module=quaternion):
    """Some steps of the filter: state and trace."""
    last = len(recording.t) - 1 if steps is None else first + steps
    state = module.initial(told, recording.th[0]) if state is None else state
    return module.advance(state, told, recording.steps.part(slice(first, last)))


# The twin: all points of the augmented state, by the equations of the paper as they stand.


def rates_of(w, c):
    """Rate of the platform (points, 3) for coefficients (points, p)."""
    M = np.zeros((len(c), 3, 3))
    M[:, 0, 1], M[:, 1, 2], M[:, 2, 0] = c[:, 6], c[:, 7], c[:, 8]
    M[:, 0, 2], M[:, 1, 0], M[:, 2, 1] = -c[:, 9], -c[:, 10], -c[:, 11]
    if c.shape[1] > 18:
        M[:, [0, 1, 2], [0, 1, 2]] = c[:, 18:21]
    return w + M @ w + c[:, :3]


def turned(c, v):
    """A vector of the base in the frame of the encoders, as quaternions (points, 4)."""
    v = np.append(0.0, v)
    if c.shape[1] == 18:
        return np.tile(v, (len(c), 1))
    q = exp(c[:, 21:])
    return multiply(multiply(q, v), q * [1, -1, -1, -1])


def outputs(q, c, up):
    """Accelerometers (points, 3), by the matrix of a quaternion of any length."""
    f = multiply(multiply(q * [1, -1, -1, -1], turned(c, up)), q)[:, 1:]
    a = c[:, 12:15] + (1.0 + c[:, 15:18]) * f
    a[:, 1] -= c[:, 4] * f[:, 0]
    a[:, 2] += c[:, 3] * f[:, 0] - c[:, 5] * f[:, 1]
    return a


def columns(q, vectors):
    """(4, 3): ``q`` times the vectors (columns) of a matrix (3, 3)."""
    return multiply(q, np.hstack([np.zeros((3, 1)), vectors.T])).T


def factor_of(P, kind):
    """NumPy's own Cholesky factor; of the others ours, since equal eigenvalues let the vectors turn at will."""
    if kind == CHOLESKY:
        return np.linalg.cholesky(P)
    A, work = np.empty_like(P), np.empty_like(P)
    root(np.ascontiguousarray(P), kind, A, work)
    return A


def twin(recording, told, steps):
    """State (4 + p,), covariance and NIS after each step."""
    world, noise, p = told.world, told.noise, len(told.prior)
    n, L = 4 + p, 12 + p
    kind = FACTORS[told.filter.factor]
    x, P = np.zeros(n), np.zeros((n, n))
    x[:4] = attitude(recording.th[0], world.axes, world.signs)
    xi = columns(x[:4], np.eye(3))
    P[:4, :4] = noise.encoder**2 / 4 * (xi @ xi.T + 1e-8 * np.outer(x[:4], x[:4]))
    P[4:, 4:] = np.diag(told.prior**2)
    for k in range(steps):
        dt = recording.dt[k]

        def ahead(q, c, dt=dt, w=recording.rate[k]):
            by_earth = exp(-turned(c, world.earth)[:, 1:] * dt)
            return multiply(multiply(by_earth, q), exp(rates_of(w, c) * dt))

        predicted = ahead(x[None, :4], x[None, 4:])[0]
        th, acc = recording.th[k + 1], recording.acc[k + 1]
        of_encoders = np.array(attitude(np.nan_to_num(th), world.axes, world.signs))
        of_encoders *= np.sign(of_encoders @ predicted)
        J = np.array(joint_axes(np.nan_to_num(th), world.axes, world.signs)).T
        A = np.zeros((L, L))
        A[:n, :n] = factor_of(P, kind)
        A[n : n + 4, n : n + 3] = (
            0.5 * noise.angle_random_walk * math.sqrt(dt) * columns(predicted, np.eye(3))
        )
        A[n + 4 :, n + 4 : n + 7] = noise.encoder * 0.5 * columns(of_encoders, J)
        A[n + 4 :, n + 7] = noise.encoder * 0.5 * of_encoders
        points = np.vstack([np.zeros(L), math.sqrt(L) * A.T, -math.sqrt(L) * A.T])
        points[:, :n] += x
        weight = np.append(0.0, np.full(2 * L, 0.5 / L))
        points[:, :4] = ahead(points[:, :4], points[:, 4:n]) + points[:, n : n + 4]
        z = np.hstack([points[:, :4] + points[:, n + 4 :], outputs(points[:, :4], points[:, 4:n], world.up)])
        x, z_mean = weight @ points[:, :n], weight @ z
        dx, dz = points[:, :n] - x, z - z_mean
        P, Pxz, Pzz = (dx.T * weight) @ dx, (dx.T * weight) @ dz, (dz.T * weight) @ dz
        Pzz[4:, 4:] += noise.accelerometer**2 * np.eye(3)
        r = np.append(of_encoders, acc) - z_mean
        r[:4] += 0.0 * th.sum()  # NaN where one of the angles is
        known = np.isfinite(r)
        r, Pxz, Pzz = r[known], Pxz[:, known], Pzz[np.ix_(known, known)]
        K = np.linalg.solve(Pzz, Pxz.T).T
        x = x + K @ r
        P = P - K @ Pzz @ K.T
        P = 0.5 * (P + P.T)
        x[:4] /= np.linalg.norm(x[:4])
        yield x, P, r @ np.linalg.solve(Pzz, r) if len(r) else math.nan


@pytest.mark.kernels
@pytest.mark.parametrize("extended", [False, True], ids=["18", "24"])
@pytest.mark.parametrize("factor", FACTORS)
def test_all_points_in_numpy(factor, extended):
    """300 steps with and without measurements: mean, covariance and NIS within 1e-7 standard deviations."""
    simulation, told = simulated(factor=factor, extended=extended, plan=MIXED)
    recording, steps = simulation.recording, 300
    recording.acc[40, 1] = recording.acc[41] = recording.th[60, 2] = np.nan
    recording.acc[80], recording.th[80] = np.nan, np.nan
    state, trace = run(recording, told, steps)
    worst = 0.0
    for k, (x, P, nis) in enumerate(twin(recording, told, steps)):
        u = np.sqrt(np.diag(P))
        xi = columns(x[:4], np.eye(3))
        about = 2.0 * np.sqrt(np.diag(xi.T @ P[:4, :4] @ xi))
        moved = 2.0 * xi.T @ (trace.estimates.attitude[k] - x[:4])
        gone = np.concatenate(
            [
                np.abs(trace.estimates.coefficients[k] - x[4:]) / u[4:],
                np.abs(moved) / about,
                np.abs(trace.estimates.u[k] / u[4:] - 1.0),
                np.abs(trace.estimates.attitude_u[k] / about - 1.0),
            ]
        )
        worst = max(worst, gone.max(), 0.0 if math.isnan(nis) else abs(trace.estimates.nis[k] - nis))
        assert math.isnan(trace.estimates.nis[k]) == math.isnan(nis)
    scale = u.copy()
    scale[:4] = 0.5 * about.max()
    assert np.max(np.abs(state.covariance - P) / np.outer(scale, scale)) < 1e-7
    assert worst < 1e-7
    assert trace.estimates.dims[[38, 39, 40, 59, 79]].tolist() == [6, 5, 3, 3, 0]
    assert trace.fallbacks == 0
    assert math.isnan(trace.lowest_eigenvalue) == (factor == "cholesky")


@pytest.mark.parametrize("factor", FACTORS)
def test_step_by_step_gives_the_same_digits(factor):
    """A stream and a file are one filter."""
    simulation, told = simulated(factor=factor, plan=MIXED)
    whole, trace = run(simulation.recording, told, 60)
    state, eigenvalues = None, []
    for k in range(60):
        state, row = run(simulation.recording, told, 1, state, k)
        assert row.estimates.nis[0] == trace.estimates.nis[k]
        assert np.array_equal(row.estimates.innovations[0], trace.estimates.innovations[k])
        eigenvalues.append(row.lowest_eigenvalue)
    assert all(np.array_equal(a, b) for a, b in zip(state, whole, strict=True))
    np.testing.assert_equal(np.min(eigenvalues), trace.lowest_eigenvalue)


def test_agreement_with_the_error_state_filter():
    """Both know the same at the end of the paper's path, though one has a vector of four and the other of three.

    0.02 standard deviations over 8 recordings; NIS is 6 on average, with 5 standard deviations of room.
    """
    gaps, nis = [], []
    for seed in range(8):
        simulation, told = simulated(seed)
        state, trace = run(simulation.recording, told)
        other, _ = run(simulation.recording, told, module=error_state)
        u = np.sqrt(np.diag(other.covariance)[3:])
        gaps.append(np.max(np.abs(state.coefficients - other.coefficients) / u))
        np.testing.assert_allclose(np.sqrt(np.diag(state.covariance)[4:]), u, rtol=5e-3)
        nis.append(trace.estimates.nis)
        assert np.all(trace.estimates.dims == 6)
        assert np.all(
            np.abs(trace.estimates.innovations.std(axis=0) - 1.0)
            < 5.0 / math.sqrt(2.0 * len(trace.estimates.nis))
        )
    assert np.median(gaps) < 0.02
    nis = np.concatenate(nis)
    assert abs(nis.mean() - 6.0) < 5.0 * math.sqrt(12.0 / len(nis))


def test_through_gimbal_lock():
    """A quaternion knows no lock: the inner joint goes through 90 deg, 8 times.

    Errors are those of chance: of 144 none beyond 4.5 u (of one set in 1000), their squares add up to 144 +- 17, 4
    standard deviations allowed. The error-state filter, with its floor of encoder noise there, is within 0.5 u.
    """
    moves = (Turn("z", math.pi), Turn("y", math.pi), Turn("x", -math.pi))
    truth = to_linear(study().truth)[:18]
    squares = 0.0
    for seed in range(8):
        simulation, told = simulated(seed, plan=PlatformPlan(moves))
        state, trace = run(simulation.recording, told)
        other, _ = run(simulation.recording, told, module=error_state)
        u = np.sqrt(np.diag(state.covariance)[4:])
        error = state.coefficients - truth
        assert np.max(np.abs(error) / u) < 4.5
        assert np.max(np.abs(state.coefficients - other.coefficients) / u) < 0.5
        squares += error @ np.linalg.solve(state.covariance[4:, 4:], error)
        assert trace.gimbal_cosine < 2e-3  # a row is 0.2 deg away from the next
    assert abs(squares - 144.0) < 4.0 * math.sqrt(2.0 * 144.0)


def test_an_encoder_triple_with_one_missing_is_left_out():
    """One NaN of three angles, or all: the same digits, and no change of the attitude by encoders."""
    simulation, told = simulated(plan=MIXED)
    one, three = simulation.recording, replace(simulation.recording, th=simulation.recording.th.copy())
    one.th[5:9, 1] = np.nan
    three.th[5:9] = np.nan
    (state, trace), (other, expected) = run(one, told, 20), run(three, told, 20)
    for a, b in ((state, other), (trace.estimates, expected.estimates), (trace[1:], expected[1:])):
        for x, y in zip(a, b, strict=True):
            np.testing.assert_array_equal(x, y)


def test_angles_counted_anew_change_nothing():
    """Encoders that lose whole turns are taken to the nearest turn; the quaternion's sign follows the prediction."""
    simulation, told = simulated(plan=MIXED)
    jumped = replace(simulation.recording, th=simulation.recording.th.copy())
    jumped.th[50:] += 2.0 * math.pi * np.array([1.0, -1.0, 3.0])
    a, b = run(simulation.recording, told, 100)[0], run(jumped, told, 100)[0]
    u = np.sqrt(np.diag(a.covariance)[4:])
    assert np.max(np.abs(a.coefficients - b.coefficients) / u) < 1e-6


def test_an_attitude_of_the_other_sign_is_the_same_attitude():
    simulation, told = simulated(plan=MIXED)
    q = np.array(attitude(simulation.recording.th[0], told.world.axes, told.world.signs))
    ends = []
    for sign in (1.0, -1.0):
        start = AttitudeStart(sign * q, told.noise.encoder)
        state, _ = run(
            simulation.recording, told, 50, quaternion.initial(told, simulation.recording.th[0], start)
        )
        ends.append(state)
    np.testing.assert_allclose(ends[1].attitude, -ends[0].attitude, atol=1e-12)
    u = np.sqrt(np.diag(ends[0].covariance)[4:])
    assert np.max(np.abs(ends[0].coefficients - ends[1].coefficients) / u) < 1e-6


def test_a_start_of_its_own():
    """10 deg away and told so: the state's covariance says sigma / 2 across q; the end is where the encoders say."""
    simulation, told = simulated(plan=MIXED)
    q = np.array(attitude(simulation.recording.th[0], told.world.axes, told.world.signs))
    away = multiply(q, exp(np.radians([6.0, -6.0, 5.0])))
    state = quaternion.initial(told, simulation.recording.th[0], AttitudeStart(away, math.radians(10.0)))
    variances = np.sort(np.linalg.eigvalsh(state.covariance[:4, :4]))
    np.testing.assert_allclose(variances[1:], math.radians(5.0) ** 2, rtol=1e-6)
    assert variances[0] == pytest.approx(1e-8 * math.radians(5.0) ** 2, rel=1e-4)
    state, trace = run(simulation.recording, told, state=state)
    miss = 2.0 * (columns(trace.estimates.attitude[-1], np.eye(3)).T @ simulation.attitude[-1])
    assert np.all(np.abs(miss) < 4.0 * trace.estimates.attitude_u[-1])


@pytest.mark.parametrize("degrees", [1.0, 10.0])
def test_from_a_wrong_attitude(degrees):
    """Told how wrong it is: all coefficients of 8 recordings within 4 u."""
    truth = to_linear(study().truth)[:18]
    for seed in range(8):
        simulation, told = simulated(seed)
        axis = np.random.default_rng(100 + seed).standard_normal(3)
        away = exp(math.radians(degrees) * axis / np.linalg.norm(axis))
        q = multiply(attitude(simulation.recording.th[0], told.world.axes, told.world.signs), away)
        state = quaternion.initial(told, simulation.recording.th[0], AttitudeStart(q, math.radians(degrees)))
        state, _ = run(simulation.recording, told, state=state)
        u = np.sqrt(np.diag(state.covariance)[4:])
        assert np.max(np.abs(state.coefficients - truth) / u) < 4.0


@pytest.mark.kernels
@pytest.mark.parametrize("factor", FACTORS)
def test_a_covariance_that_is_none_is_told(factor):
    """An indefinite covariance: every factor reports the eigenvalue, none goes on with |P|."""
    simulation, told = simulated(factor=factor, plan=MIXED)
    state = quaternion.initial(told, simulation.recording.th[0])
    i, j = 4, 10
    state.covariance[i, j] = state.covariance[j, i] = 1.1 * told.prior[0] * told.prior[6]
    _, trace = run(simulation.recording, told, 3, state)
    assert trace.lowest_eigenvalue < 100.0 * NEGATIVE
    assert (trace.fallbacks > 0) == (factor == "cholesky")


def test_gating_by_any_never_runs_on_this_path():
    """On the paper's path one accelerometer is near level at every moment: `any` is a filter without accelerometers."""
    simulation, told = simulated()
    gated = replace(told, filter=replace(told.filter, gating=Gating("any")))
    without = replace(simulation.recording, acc=np.full_like(simulation.recording.acc, np.nan))
    a, trace = run(simulation.recording, gated, 200)
    b, _ = run(without, told, 200)
    assert np.array_equal(a.coefficients, b.coefficients)
    assert np.array_equal(a.covariance, b.covariance)
    assert np.all(trace.estimates.dims == 3)
    whole = replace(told, filter=replace(told.filter, gating=Gating("any", "step")))
    _, trace = run(simulation.recording, whole, 200)
    assert np.all(trace.estimates.dims == 0)


def test_no_steps():
    """m = 0 loads the kernels and changes nothing."""
    simulation, told = simulated(plan=MIXED)
    state, trace = run(simulation.recording, told, 0)
    assert np.array_equal(state.coefficients, np.zeros(18))
    assert len(trace.estimates.nis) == 0
