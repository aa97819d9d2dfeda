"""The error-state filter: against a plain matrix twin, against differences of the model, and against its own laws."""

from dataclasses import replace

import numpy as np
import pytest
from paper_study import PRIOR, study

from inercal.foundation.geometry.rotations import (
    boxminus,
    boxplus,
    conjugate,
    exp,
    log,
    multiply,
    rotate,
    skew,
    to_matrix,
)
from inercal.systems.selfcal.filters import error_state
from inercal.systems.selfcal.filters.plain import accelerometers, on_the_base, platform_rate
from inercal.systems.selfcal.filters.problem import AttitudeStart, problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.platform import linearised, model
from inercal.systems.selfcal.platform.kinematics import attitude, joint_axes
from inercal.systems.selfcal.platform.rig import Gimbals, World
from inercal.systems.selfcal.platform.states import ALL, EXTENDED_MODEL, state_vector
from inercal.systems.selfcal.settings import Filter
from inercal.systems.selfcal.simulate import experiment, simulate

EXTENDED = Filter(extended=True)


@pytest.fixture(scope="module")
def short():
    """The first 60 s and the first turn's end of the paper's path, nominal noise."""
    settings = study()
    return simulate(experiment(settings), np.random.default_rng(20261121)).recording


def cut(recording, rows):
    """Rows of a recording, in a piece."""
    return replace(
        recording,
        t=recording.t[rows],
        th=recording.th[rows],
        acc=recording.acc[rows],
        rate=recording.rate[rows][:-1],
    )


# A twin in plain matrices: the same filter, written from the equations.


def gyro_matrix(w):
    """dw / dc (3, 24): change of the platform's rate by the coefficients."""
    G = np.zeros((3, 24))
    G[:, 0:3] = np.eye(3)
    G[0, 6], G[1, 7], G[2, 8] = w[1], w[2], w[0]
    G[0, 9], G[1, 10], G[2, 11] = -w[2], -w[0], -w[1]
    G[:, 18:21] = np.diag(w)
    return G


def right_jacobian(r):
    """Of rotations, by its series."""
    total, term = np.eye(3), np.eye(3)
    for k in range(1, 30):
        term = -term @ skew(r) / (k + 1)
        total = total + term
    return total


def update(P, z, H, R):
    """Correction, covariance and NIS of a joint update by all that was measured."""
    kept = np.isfinite(z)
    z, H, R = z[kept], H[kept], R[np.ix_(kept, kept)]
    S = H @ P @ H.T + R
    gain = np.linalg.solve(S, H @ P).T
    left = np.eye(len(P)) - gain @ H
    return gain @ z, left @ P @ left.T + gain @ R @ gain.T, z @ np.linalg.solve(S, z)


def twin(recording, problem, steps):
    """State and covariance after some steps, and the NIS: encoders first, then accelerometers at what they found."""
    world, noise, p = problem.world, problem.noise, len(problem.prior)
    q = np.array(attitude(recording.th[0], world.axes, world.signs))
    c, P = np.zeros(p), np.diag(np.concatenate([np.full(3, noise.encoder), problem.prior]) ** 2)
    nis = []
    for k in range(steps):
        dt, w = recording.dt[k], recording.rate[k]
        full = np.append(c, np.zeros(24 - p))
        beta = full[21:]
        earth, up = rotate(exp(beta), world.earth), rotate(exp(beta), world.up)
        rate = w + gyro_matrix(w) @ full
        q = multiply(multiply(exp(-earth * dt), q), exp(rate * dt))
        q = q / np.linalg.norm(q)
        left = right_jacobian(-beta)
        F = np.eye(3 + p)
        F[:3, :3] = to_matrix(exp(-rate * dt))
        by_c = right_jacobian(rate * dt) @ gyro_matrix(w) * dt
        by_c[:, 21:] = to_matrix(q).T @ skew(earth) @ left * dt
        F[:3, 3:] = by_c[:, :p]
        P = F @ P @ F.T
        P[:3, :3] += np.eye(3) * noise.angle_random_walk**2 * dt
        J = np.array(joint_axes(recording.th[k + 1], world.axes, world.signs)).T
        R = noise.encoder**2 * (J @ J.T + 0.05**2 * np.eye(3))
        measured = np.array(attitude(recording.th[k + 1], world.axes, world.signs))
        H = np.eye(3, 3 + p)
        x, P, of_encoders = update(P, log(multiply(conjugate(q), measured)), H, R)
        q, c = boxplus(q, x[:3]), c + x[3:]
        full = np.append(c, np.zeros(24 - p))
        up, left = rotate(exp(full[21:]), world.up), right_jacobian(-full[21:])
        C = to_matrix(q)
        f = C.T @ up
        K = np.diag(1.0 + full[15:18]) + np.array([[0, 0, 0], [-full[4], 0, 0], [full[3], -full[5], 0]])
        by = np.zeros((3, 24))
        by[:, 12:15], by[:, 15:18] = np.eye(3), np.diag(f)
        by[1, 4], by[2, 3], by[2, 5] = -f[0], f[0], -f[1]
        by[:, 21:] = -K @ C.T @ skew(up) @ left
        H = np.hstack([K @ skew(f), by[:, :p]])
        z = recording.acc[k + 1] - full[12:15] - K @ f
        x, P, of_accelerometers = update(P, z, H, np.eye(3) * noise.accelerometer**2)
        q, c = boxplus(q, x[:3]), c + x[3:]
        nis.append(of_encoders + of_accelerometers)
    return q, c, P, np.array(nis)


@pytest.mark.kernels
@pytest.mark.parametrize("extended", [False, True])
def test_the_kernel_is_its_matrix_twin(short, extended):
    """Apart by rounding alone: 1e-7 of a standard deviation after 400 steps, over a change of turns."""
    of = replace(problem(study(filter=EXTENDED if extended else Filter())))
    recording = cut(short, np.r_[700:1101])
    recording.acc[5], recording.th[50] = np.nan, np.nan
    recording.acc[80, 1] = np.nan
    found = estimate(recording, of, brief=True)
    q, c, P, nis = twin(recording, of, 400)
    sigma = np.sqrt(np.diag(P))
    assert np.abs((found.coefficients - c) / sigma[3:]).max() < 1e-7
    assert np.abs(boxminus(found.attitude, q) / sigma[:3]).max() < 1e-7
    assert np.abs(found.state.covariance / np.outer(sigma, sigma) - P / np.outer(sigma, sigma)).max() < 1e-7
    assert found.nis == pytest.approx(nis, rel=1e-6)


LAYOUT = state_vector(EXTENDED_MODEL).layout
NO_RIG = np.zeros(len(ALL) - 24)


def on(v):
    """A world in which a vector (3,) is both earth rate and specific force."""
    return World(v, v, Gimbals().index, Gimbals().sign)


def random_case(seed):
    """Attitude, coefficients of rough size, rate, and vectors of the base."""
    rng = np.random.default_rng(seed)
    q = rng.standard_normal(4)
    c = 0.03 * rng.standard_normal(24)
    return q / np.linalg.norm(q), c, rng.uniform(-1.0, 1.0, 3), rng.standard_normal(3), rng


@pytest.mark.kernels
@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("turn", [1e-6, 1e-3])
def test_the_transition_is_the_derivative_of_the_step(seed, turn):
    """Differences of the exact step over errors of attitude and coefficients, at rates of radians per step.

    ``turn`` [rad] is about that of the earth in a step: 1.5e-5 in 0.2 s.
    """
    q, c, w, _, rng = random_case(seed)
    earth, dt = turn * rng.standard_normal(3), 0.7

    def step(error):
        moved = c + error[3:]
        start = boxplus(q, error[:3])
        end = model.propagate(start, platform_rate(w, moved, True), on_the_base(earth, moved, True), dt)
        return np.array(end)

    h, base = 1e-6, step(np.zeros(27))
    F = np.eye(27)
    for k in range(27):
        e = np.zeros(27)
        e[k] = h
        F[:3, k] = (boxminus(step(e), base) - boxminus(step(-e), base)) / (2 * h)
    A = rng.standard_normal((27, 27))
    P = A @ A.T
    expected = F @ P @ F.T + np.diag(np.r_[np.full(3, 0.4), np.zeros(24)])
    own, full = model.room(), np.append(c, NO_RIG)
    rate, earth_e = model.turning(tuple(w), model.STILL, 0.0, full, LAYOUT, own), on_the_base(earth, c, True)
    F = linearised.transition(tuple(w), rate, dt, tuple(base), earth_e, full, True)
    linearised.propagate_covariance(P, F, LAYOUT, own, 0.4, np.empty((3, 27)), np.empty((3, 27)))
    # the kernel takes the earth's turn within a step for small
    assert np.abs(P - expected).max() < 10.0 * turn * np.abs(expected).max()
    assert np.array_equal(P, P.T)


@pytest.mark.kernels
@pytest.mark.parametrize("seed", range(5))
def test_accelerometer_rows_are_derivatives(seed):
    """Differences of the outputs over all errors, beta among them, at attitudes of any kind."""
    q, c, _, up, _ = random_case(seed)

    def read(error):
        moved = c + error[3:]
        f = model.specific_force(tuple(boxplus(q, error[:3])), on_the_base(up, moved, True))
        return np.array(accelerometers(f, moved))

    h = 1e-6
    differences = np.stack([(read(e) - read(-e)) / (2 * h) for e in h * np.eye(27)], axis=1)
    own, full, still = model.room(), np.append(c, NO_RIG), model.Rates(model.STILL, model.STILL)
    model.accelerometers(tuple(q), still, 0.0, model.base_of(full, True, on(up)), full, LAYOUT, own)
    for i in range(3):
        whole, size = np.zeros(27), LAYOUT.sizes[i]
        whole[LAYOUT.rows[i, :size]] = own.entries[i, :size]
        assert whole == pytest.approx(differences[i], abs=1e-8)


def test_encoder_covariance_is_that_of_small_angle_errors():
    """Noise of the three angles, put through the rig, has covariance sigma^2 J J^T about the axes of p."""
    rig = Gimbals()
    th, sigma = np.array([0.4, 0.7, -1.1]), 1e-5
    rng = np.random.default_rng(20261121)
    q = np.array(attitude(th, rig.index, rig.sign))
    drawn = th + sigma * rng.standard_normal((20000, 3))
    miss = np.array([boxminus(np.array(attitude(each, rig.index, rig.sign)), q) for each in drawn])
    floor = (linearised.FLOOR * sigma) ** 2
    roots, variances = linearised.encoder_roots(th, rig.index, rig.sign, sigma, np.ones(3), floor)
    L = np.linalg.inv(np.array(roots))
    stated = L @ L.T - (linearised.FLOOR * sigma) ** 2 * np.eye(3)
    assert np.diag(L @ L.T) == pytest.approx(np.array(variances))
    # standard errors of a covariance of n samples
    se = np.sqrt((np.outer(np.diag(stated), np.diag(stated)) + stated**2) / len(drawn))
    assert (np.abs(np.cov(miss.T) - stated) < 5 * se).all()


@pytest.mark.parametrize("extended", [False, True])
def test_sample_by_sample_gives_the_same_digits(short, extended):
    """What a stream computes is what a batch computes."""
    of = problem(study(filter=EXTENDED if extended else Filter()))
    recording = cut(short, np.r_[800:1000])
    whole, _ = error_state.advance(error_state.initial(of, recording.th[0]), of, recording.steps)
    state = error_state.initial(of, recording.th[0])
    for k in range(199):
        one = recording.steps.part(slice(k, k + 1))
        state, _ = error_state.advance(state, of, one, history=False)
    for a, b in zip(whole, state, strict=True):
        assert np.array_equal(a, b)


def test_full_turns_of_an_encoder_change_nothing(short):
    """An angle is an angle: 2 pi jumps of encoders leave every digit but rounding."""
    of = problem(study())
    jumped = replace(short, th=np.mod(short.th, 2 * np.pi))
    plain, other = estimate(short, of), estimate(jumped, of)
    assert (
        np.abs(other.coefficients - plain.coefficients).max()
        < 1e-6 * np.sqrt(np.diag(plain.covariance)).max()
    )
    assert other.nis_mean == pytest.approx(plain.nis_mean, rel=1e-6)


def test_nothing_measured_leaves_the_prior():
    """Without measurements after the start the coefficients stay at 0 with their prior, and nothing is counted."""
    settings = study()
    recording = simulate(experiment(settings), np.random.default_rng(1)).recording
    blind = replace(recording, acc=np.full_like(recording.acc, np.nan), th=np.full_like(recording.th, np.nan))
    blind.th[0] = recording.th[0]
    found = estimate(blind, problem(settings))
    assert np.array_equal(found.coefficients, np.zeros(18))
    assert np.sqrt(np.diag(found.covariance)) == pytest.approx(PRIOR[:18])
    assert not found.dims.any()
    assert np.isnan(found.nis).all()


@pytest.mark.parametrize("degrees", [1.0, 10.0, 60.0, 120.0])
def test_a_wrong_start_that_is_told_as_such_does_no_harm(short, degrees):
    """The encoders put the attitude right before any accelerometer is believed: within 0.1 sigma of the usual start."""
    of = problem(study())
    q = np.array(attitude(short.th[0], of.world.axes, of.world.signs))
    off = np.radians(degrees) * np.array([0.6, -0.64, 0.48])
    found = estimate(short, of, start=AttitudeStart(boxplus(q, off), np.radians(degrees)))
    plain = estimate(short, of)
    sigma = np.sqrt(np.diag(plain.covariance))
    assert np.abs((found.coefficients - plain.coefficients) / sigma).max() < 0.1
    assert found.converged


@pytest.mark.parametrize(("rule", "few"), [("any", 0.0), ("two", 0.4), ("channel", 0.4)])
def test_near_level_gating(short, rule, few):
    """On the paper's path one axis is level at any time: rule `any` never admits an accelerometer, the others do."""
    from inercal.systems.selfcal.settings import Gating

    of = problem(study(filter=Filter(gating=Gating(rule))))
    found, plain = estimate(short, of), estimate(short, problem(study()))
    used = np.isfinite(found.innovations[:, :3]).mean()
    assert used <= few if rule == "any" else few < used < 1.0
    assert np.isfinite(found.innovations[:, 3:]).all()  # encoders go on
    # leaving out measurements never makes a coefficient better known
    assert (np.diag(found.covariance) >= np.diag(plain.covariance) * (1 - 1e-9)).all()
