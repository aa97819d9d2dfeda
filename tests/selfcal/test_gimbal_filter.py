"""The gimbal-angle unscented filter: kinematics of any rig, its twin, its peer, Euler's bias, gimbal lock."""

from dataclasses import replace
from itertools import permutations, product

import numpy as np
import pytest
from paper_study import DEG, study
from unscented_twin import RIGS, angle_rates, gimbal, joints

from inercal.foundation.geometry.rotations import boxminus, conjugate, exp, multiply, rotate
from inercal.systems.selfcal.filters import gimbal as model
from inercal.systems.selfcal.filters.problem import AttitudeStart, problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.coefficients import NAMES, to_linear
from inercal.systems.selfcal.platform.kinematics import angles, parity
from inercal.systems.selfcal.platform.plan import PlatformPlan, Rest, Turn, path
from inercal.systems.selfcal.platform.rig import Gimbals, World
from inercal.systems.selfcal.settings import Filter
from inercal.systems.selfcal.simulate import experiment, simulate
from rows import for_each

EVERY_RIG = tuple(product(permutations("xyz"), product((1, -1), repeat=3)))
EULER = Filter(integration="euler")


def in_sigma(found, expected, covariance):
    """Largest difference in standard deviations."""
    return np.abs((found - expected) / np.sqrt(np.diag(covariance))).max()


def moved(world, d, th, rate, dt, euler=False):
    """Angles (3,) after a step, from those that differ by ``d`` from ``th``."""
    e, axes = parity(world.axes), world.axes
    at = model.cosines(model.hat(th, e, world.signs))
    end = model.step(
        at,
        model.hat(d, e, world.signs),
        model.along(rate, axes, e),
        model.along(world.earth, axes, e),
        dt,
        euler,
    )
    return th + np.array(model.hat(end, e, world.signs))


@pytest.fixture(scope="module")
def paper():
    """The paper's study at nominal noise, and four runs of it."""
    settings = study()
    prepared = experiment(settings)
    return settings, [simulate(prepared, np.random.default_rng(seed)) for seed in range(4)]


@for_each("rig", EVERY_RIG)
def test_kinematics_are_those_of_the_inverted_joint_axes(rig):
    """th' = J^-1 (w - C_pb w_Ib), f = C_pb up, walk T T^T: orders and signs as of the chain of elementary turns."""
    rng = np.random.default_rng(31)
    gimbals = Gimbals(*rig)
    world = World(rng.normal(size=3), rng.normal(size=3), gimbals.index, gimbals.sign)
    th, w, e = rng.uniform(-3.0, 3.0, 3), rng.normal(size=3), parity(gimbals.index)
    at = model.cosines(model.hat(th, e, world.signs))
    found = model.rates(at, model.along(w, world.axes, e), model.along(world.earth, world.axes, e))
    expected = angle_rates(th[None], w[None], world.earth[None], world)[0]
    np.testing.assert_allclose(model.hat(found, e, world.signs), expected, rtol=1e-11, atol=1e-12)

    q, J = (part[0] for part in joints(th[None], world))
    f = np.empty(3)
    f[world.axes] = model.force(at, model.along(world.up, world.axes, 1.0))
    np.testing.assert_allclose(f, rotate(conjugate(q), world.up), atol=1e-14)

    P = np.zeros((3, 3))
    model._add_walk(P, th[1], 2.0, world)
    T = np.linalg.inv(J)
    np.testing.assert_allclose(P, 2.0 * T @ T.T, rtol=1e-11, atol=1e-11)


@pytest.mark.kernels
@pytest.mark.parametrize(("euler", "order"), [(False, 4), (True, 1)])
def test_a_step_is_of_its_order_in_time(euler, order):
    """Against the exact attitude: over a fixed time the error falls by 2^order when steps are halved."""
    rng = np.random.default_rng(32)
    gimbals = Gimbals()
    world = World(0.1 * rng.normal(size=3), np.zeros(3), gimbals.index, gimbals.sign)
    th, w = np.array([0.4, -0.6, 0.9]), np.array([0.5, -0.4, 0.7])
    start = joints(th[None], world)[0][0]
    q = multiply(multiply(exp(-world.earth), start), exp(w))
    exact = np.array(angles(q, th, world.axes, world.signs))
    errors = []
    for steps in (64, 128):
        at = th.copy()
        for _ in range(steps):
            at = moved(world, np.zeros(3), at, w, 1.0 / steps, euler)
        errors.append(np.abs(at - exact).max())
    assert np.log2(errors[0] / errors[1]) == pytest.approx(order, abs=0.1)


@pytest.mark.parametrize("size", [1e-6, 0.009, 0.011, 1.0])
def test_points_far_and_near_step_alike(size):
    """The series of cosines near the centre and the cosines themselves are one function."""
    rng = np.random.default_rng(33)
    gimbals = Gimbals()
    world = World(rng.normal(size=3), np.zeros(3), gimbals.index, gimbals.sign)
    th, d, w = rng.uniform(-1.0, 1.0, 3), size * rng.uniform(-1.0, 1.0, 3), rng.normal(size=3)
    found = moved(world, d, th, w, 0.01)
    np.testing.assert_allclose(found, moved(world, np.zeros(3), th + d, w, 0.01), rtol=1e-13)


@pytest.mark.kernels
@pytest.mark.parametrize(("rig", "extended", "integration"), [
    (RIGS[0], False, "rk4"), (RIGS[0], True, "euler"), (RIGS[4], True, "rk4"), (RIGS[8], False, "euler"),
])  # fmt: skip
def test_the_kernel_is_its_numpy_twin(rig, extended, integration):
    settings = study(
        plan=path("best", step=3.0),
        gimbals=Gimbals(*rig),
        filter=Filter(extended=extended, integration=integration),
    )
    given = problem(settings)
    recording = simulate(experiment(settings), np.random.default_rng(5)).recording
    acc, th = recording.acc.copy(), recording.th.copy()
    acc[7], th[7] = np.nan, np.nan
    acc[20, 1], th[30, 2] = np.nan, np.nan
    th[40], acc[50] = np.nan, np.nan
    recording = replace(recording, acc=acc, th=th)
    found = estimate(recording, given, "gimbal-ukf")
    expected, c, P, nis = gimbal(recording, given, th[0], given.noise.encoder)
    size = np.sqrt(np.diag(P))
    assert in_sigma(found.coefficients, c, P[3:, 3:]) < 1e-7
    assert in_sigma(found.state.attitude, expected, P[:3, :3]) < 1e-7
    assert np.abs((found.state.covariance - P) / np.outer(size, size)).max() < 1e-7
    np.testing.assert_allclose(found.nis, nis, rtol=1e-7)
    assert [found.dims[row - 1] for row in (7, 20, 30, 40, 50, 51)] == [0, 5, 3, 3, 3, 6]
    np.testing.assert_array_equal(np.isnan(found.innovations).sum(axis=1), 6 - found.dims)


@pytest.mark.parametrize("rig", [RIGS[0], RIGS[4], RIGS[8]])
def test_away_from_lock_it_agrees_with_the_error_state_filter(rig):
    """Representation does not matter: within 0.004 sigma at nominal noise, gimbals in any order."""
    settings = study(gimbals=Gimbals(*rig))
    given, prepared = problem(settings), experiment(settings)
    for seed in range(3):
        recording = simulate(prepared, np.random.default_rng(seed)).recording
        found, peer = (estimate(recording, given, kind) for kind in ("gimbal-ukf", "error-state"))
        assert found.converged
        assert in_sigma(found.coefficients, peer.coefficients, peer.covariance) < 0.004
        # the floor of that filter's encoder noise is worth 0.05^2 / 2
        np.testing.assert_allclose(np.diag(found.covariance), np.diag(peer.covariance), rtol=2e-3)
        apart = boxminus(found.history.attitude, peer.history.attitude) / peer.history.attitude_u
        assert np.abs(apart).max() < 0.05


def test_euler_steps_bias_the_coefficients_where_nis_shows_nothing(paper):
    """Up to 9 sigma at nominal noise with a NIS within its band; at low noise 40, and there it shows."""
    settings, runs = paper
    given = problem(settings)
    exact, euler = (
        estimate(runs[0].recording, replace(given, filter=kind), "gimbal-ukf", history=False)
        for kind in (Filter(), EULER)
    )
    bias = (euler.coefficients - exact.coefficients) / np.sqrt(np.diag(exact.covariance))
    assert NAMES[np.abs(bias).argmax()] == "ds_x"
    assert 7.0 < np.abs(bias).max() < 10.0
    band = 5.0 * np.sqrt(12.0 / exact.steps)
    assert abs(exact.nis_mean - 6.0) < band
    assert abs(euler.nis_mean - 6.0) < band

    settings = study(noise="low")
    recording = simulate(experiment(settings), np.random.default_rng(0)).recording
    exact, euler = (
        estimate(recording, replace(problem(settings), filter=kind), "gimbal-ukf", history=False)
        for kind in (Filter(), EULER)
    )
    assert 35.0 < in_sigma(euler.coefficients, exact.coefficients, exact.covariance) < 45.0
    assert abs(exact.nis_mean - 6.0) < band
    assert euler.nis_mean > 6.0 + band


@pytest.mark.parametrize("moves", [
    (Turn("x", 90 * DEG), Turn("y", 180 * DEG), Turn("z", 180 * DEG), Turn("x", 90 * DEG)),
    (Turn("y", 90 * DEG), Rest(30.0), Turn("z", 90 * DEG)),
])  # fmt: skip
@pytest.mark.parametrize("integration", ["rk4", "euler"])
def test_gimbal_lock_is_flagged(moves, integration):
    """Through thy = 90 deg, or at rest there, it goes wrong without an exception, and says so."""
    settings = study(plan=PlatformPlan(moves), filter=Filter(integration=integration))
    given, truth = problem(settings), to_linear(settings.truth)[:18]
    recording = simulate(experiment(settings), np.random.default_rng(1)).recording
    found = estimate(recording, given, "gimbal-ukf")
    assert found.gimbal_cosine < LIMITS.singular_cosine
    assert not found.converged
    assert found.message
    if np.isfinite(found.coefficients).all():
        assert in_sigma(found.coefficients, truth, found.covariance) > 7.0
    assert estimate(recording, given, "error-state").converged


def test_numbers_that_are_none_end_the_filter_quietly(paper):
    """An infinite covariance, as lock may leave it: all the rest is NaN, and nothing is raised."""
    settings, runs = paper
    given, recording = problem(settings), runs[0].recording
    state = model.initial(given, recording.th[0])
    state.covariance[0, 0] = np.inf
    state, trace = model.advance(state, given, recording.steps.part(slice(20)))
    assert np.isnan(state.coefficients).all()
    assert np.isnan(trace.estimates.nis).all()


def test_one_row_at_a_time_gives_the_same_digits(paper):
    settings, runs = paper
    given, recording = problem(settings), runs[1].recording
    recording.th[20:] -= 2.0 * np.pi  # encoders that jump are followed
    steps = recording.steps.part(slice(40))
    whole, trace = model.advance(model.initial(given, recording.th[0]), given, steps)
    state = model.initial(given, recording.th[0])
    for k in range(40):
        state, one = model.advance(state, given, steps.part(slice(k, k + 1)))
        for name in ("attitude", "attitude_u", "coefficients", "u", "innovations", "nis", "dims"):
            np.testing.assert_array_equal(getattr(one.estimates, name)[0], getattr(trace.estimates, name)[k])
    for found, expected in zip(state, whole, strict=True):
        np.testing.assert_array_equal(found, expected)
    assert np.nanmax(trace.estimates.nis) < 40.0


def test_a_start_at_another_attitude_is_taken_on_the_turn_of_the_encoders(paper):
    """Angles of the start's attitude, its sigma about each; the known angles stay those of the encoders."""
    settings, runs = paper
    given, th = problem(settings), runs[2].recording.th[0] + 2.0 * np.pi
    turned = th + np.array([0.02, -0.01, 0.03])
    state = model.initial(given, th, AttitudeStart(joints(turned[None], given.world)[0][0], 0.05))
    np.testing.assert_allclose(state.attitude, turned, atol=1e-12)
    np.testing.assert_array_equal(state.th, th)
    np.testing.assert_allclose(np.diag(state.covariance)[:3], 0.05**2)
