"""The multiplicative unscented filter: its twin, its peer, large errors at the start, gimbal lock, lost samples."""

from dataclasses import replace

import numpy as np
import pytest
from paper_study import DEG, study
from unscented_twins import RIGS, multiplicative

from inercal.geometry.rotations import boxminus, boxplus, normalize
from inercal.selfcal.before.simulate import experiment, simulate
from inercal.selfcal.filters import multiplicative as mukf
from inercal.selfcal.filters.problem import Start, problem
from inercal.selfcal.filters.run import estimate
from inercal.selfcal.platform.coefficients import to_linear
from inercal.selfcal.platform.kinematics import attitude
from inercal.selfcal.platform.plan import Plan, Turn, path
from inercal.selfcal.platform.rig import Gimbals
from inercal.selfcal.settings import Filter, Gating

COARSE = path("best", step=3.0)


def runs(settings, count):
    """Simulations with seeds 0, 1, ..."""
    prepared = experiment(settings)
    return [simulate(prepared, np.random.default_rng(seed)) for seed in range(count)]


def with_gaps(recording):
    """The same with rows and single values missing."""
    acc, th = recording.acc.copy(), recording.th.copy()
    acc[7], th[7] = np.nan, np.nan
    acc[20, 1], th[30, 2] = np.nan, np.nan
    th[40], acc[50] = np.nan, np.nan
    return replace(recording, acc=acc, th=th)


def in_sigma(found, expected, covariance):
    """Largest difference in standard deviations."""
    return np.abs((found - expected) / np.sqrt(np.diag(covariance))).max()


@pytest.fixture(scope="module")
def paper():
    """The paper's study at nominal noise, and eight runs of it."""
    settings = study()
    return settings, runs(settings, 8)


@pytest.mark.kernels
@pytest.mark.parametrize("extended", [False, True])
@pytest.mark.parametrize("rig", [RIGS[0], RIGS[4], RIGS[8]])
def test_the_kernel_is_its_numpy_twin(rig, extended):
    settings = study(plan=COARSE, gimbals=Gimbals(*rig), filter=Filter(extended=extended))
    given = problem(settings)
    recording = with_gaps(simulate(experiment(settings), np.random.default_rng(5)).recording)
    found = estimate(recording, given, "mukf", brief=True)
    start = np.array(attitude(recording.th[0], given.world.axes, given.world.signs))
    q, c, P, nis = multiplicative(recording, given, start, given.noise.encoder)
    assert in_sigma(found.coefficients, c, P[3:, 3:]) < 1e-7
    assert in_sigma(boxminus(found.attitude, q), np.zeros(3), P[:3, :3]) < 1e-7
    size = np.sqrt(np.diag(P))
    assert np.abs((found.state.covariance - P) / np.outer(size, size)).max() < 1e-7
    np.testing.assert_allclose(found.nis, nis, rtol=1e-7)
    assert found.fallbacks == 0


@pytest.mark.parametrize(("degrees", "limit"), [(1.0, 1e-7), (60.0, 1e-5), (170.0, 1e-4)])
def test_the_twin_from_large_errors(degrees, limit):
    """A first reading of arc seconds leaves (sig/sigma)^2 of the covariance's digits: 1e-16 / 1e-11 for 170 deg."""
    settings = study(plan=COARSE)
    given, run = problem(settings), simulate(experiment(settings), np.random.default_rng(6))
    error = degrees * DEG * np.array([0.48, 0.6, 0.64])
    start = Start(boxplus(run.attitude[0], error), degrees * DEG)
    found = estimate(run.recording, given, "mukf", start)
    q, c, P, _ = multiplicative(run.recording, given, start.attitude, start.sigma)
    assert in_sigma(found.coefficients, c, P[3:, 3:]) < limit
    assert in_sigma(boxminus(found.attitude, q), np.zeros(3), P[:3, :3]) < limit


@pytest.mark.parametrize("degrees", [1.0, 10.0, 60.0, 120.0])
def test_it_converges_from_any_attitude_with_encoders(paper, degrees):
    """All coefficients within 4 sigma over 8 seeds, about any axis; and what the start was is forgotten."""
    settings, all_runs = paper
    given, truth = problem(settings), to_linear(settings.truth)[:18]
    rng = np.random.default_rng(202)
    for run in all_runs:
        axis = rng.normal(size=3)
        error = degrees * DEG * axis / np.linalg.norm(axis)
        start = Start(boxplus(run.attitude[0], error), degrees * DEG)
        found = estimate(run.recording, given, "mukf", start, history=False)
        assert found.converged
        assert in_sigma(found.coefficients, truth, found.covariance) < 4.0
        near = estimate(run.recording, given, "mukf", Start(run.attitude[0], DEG), history=False)
        assert in_sigma(found.coefficients, near.coefficients, near.covariance) < 0.001


def test_it_agrees_with_the_error_state_filter(paper):
    """Within 0.002 sigma; both are first order in errors of arc seconds."""
    settings, all_runs = paper
    given = problem(settings)
    for run in all_runs:
        found, peer = (estimate(run.recording, given, kind) for kind in ("mukf", "error-state"))
        assert in_sigma(found.coefficients, peer.coefficients, peer.covariance) < 0.002
        np.testing.assert_allclose(np.diag(found.covariance), np.diag(peer.covariance), rtol=1e-5)
        np.testing.assert_allclose(found.nis, peer.nis, rtol=1e-2, atol=1e-2)
        np.testing.assert_allclose(found.innovations[:, 3:], peer.innovations[:, 3:], atol=1e-2)
        np.testing.assert_allclose(found.history.attitude_u, peer.history.attitude_u, rtol=1e-4)


def test_innovations_are_of_unit_variance(paper):
    """Each over its own standard deviation, accelerometers after encoders: mean square 1 in 2700 rows."""
    settings, all_runs = paper
    found = estimate(all_runs[0].recording, problem(settings), "mukf")
    square = np.mean(found.innovations**2, axis=0)
    # of the attitude the floor of 0.05^2 takes a little
    np.testing.assert_allclose(square, 1.0, atol=5.0 * np.sqrt(2.0 / len(found.nis)))
    assert found.nis_mean == pytest.approx(6.0, abs=5.0 * np.sqrt(12.0 / len(found.nis)))


def test_gimbal_lock_does_not_matter():
    """A path through thy = 90 deg: all coefficients within 3.5 sigma over 8 seeds."""
    moves = (("x", 90.0), ("y", 180.0), ("z", 180.0), ("x", 90.0))
    settings = study(plan=Plan(tuple(Turn(joint, angle * DEG) for joint, angle in moves)))
    given, truth = problem(settings), to_linear(settings.truth)[:18]
    for run in runs(settings, 8):
        found = estimate(run.recording, given, "mukf", history=False)
        assert found.converged
        assert found.gimbal_cosine < 0.01
        assert in_sigma(found.coefficients, truth, found.covariance) < 3.5


def test_one_row_at_a_time_gives_the_same_digits(paper):
    settings, all_runs = paper
    given, recording = problem(settings), with_gaps(all_runs[1].recording)
    steps = recording.steps.part(slice(60))
    whole, trace = mukf.advance(mukf.initial(given, recording.th[0]), given, steps)
    state = mukf.initial(given, recording.th[0])
    for k in range(60):
        state, one = mukf.advance(state, given, steps.part(slice(k, k + 1)))
        for name in ("attitude", "attitude_u", "coefficients", "u", "innovations", "nis", "dims"):
            np.testing.assert_array_equal(getattr(one.estimates, name)[0], getattr(trace.estimates, name)[k])
    for found, expected in zip(state, whole, strict=True):
        np.testing.assert_array_equal(found, expected)


def test_what_is_missing_is_left_out(paper):
    """A row without measurements is a prediction: no digit is learnt, only the walk of the gyros is added."""
    settings, all_runs = paper
    given, recording = problem(settings), with_gaps(all_runs[2].recording)
    found = estimate(recording, given, "mukf")
    assert [found.dims[row - 1] for row in (7, 20, 30, 40, 50, 51)] == [0, 5, 3, 3, 3, 6]
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(found.nis)), [6])
    np.testing.assert_array_equal(np.isnan(found.innovations).sum(axis=1), 6 - found.dims)
    np.testing.assert_array_equal(found.history.coefficients[7], found.history.coefficients[6])
    np.testing.assert_array_equal(found.history.u[7], found.history.u[6])
    assert (found.history.attitude_u[7] > found.history.attitude_u[6]).all()


def test_other_factors_give_other_points_but_the_same_filter(paper):
    settings, all_runs = paper
    given, recording = problem(settings), all_runs[3].recording
    usual = estimate(recording, given, "mukf", history=False)
    for factor in ("eigen", "svd"):
        other = estimate(recording, replace(given, filter=Filter(factor=factor)), "mukf", history=False)
        assert in_sigma(other.coefficients, usual.coefficients, usual.covariance) < 0.002
        assert 0.0 < other.lowest_eigenvalue < 1.0
    assert np.isnan(usual.lowest_eigenvalue)


def test_extended_truth_is_found():
    """Gyro scale errors and a tilted base: 24 coefficients, within 4 sigma over 4 seeds."""
    truth = study().truth.copy()
    truth[18:21], truth[21:] = [5e-5, -8e-5, 1e-4], np.array([40.0, -60.0, 50.0]) * DEG / 3600.0
    settings = study("best", truth=truth, filter=Filter(extended=True))
    for run in runs(settings, 4):
        found = estimate(run.recording, problem(settings), "mukf", history=False)
        assert in_sigma(found.coefficients, to_linear(truth), found.covariance) < 4.0


def test_gated_accelerometers_take_no_part(paper):
    """Rule ``any`` never runs on this path; where the whole step stops nothing is learnt at all."""
    settings, all_runs = paper
    for stops, dims in (("accelerometers", 3), ("step", 0)):
        given = replace(problem(settings), filter=Filter(gating=Gating("any", stops)))
        found = estimate(all_runs[4].recording, given, "mukf")
        assert (found.dims == dims).all()


def test_the_attitude_stays_a_unit_quaternion(paper):
    settings, all_runs = paper
    found = estimate(all_runs[5].recording, problem(settings), "mukf")
    q = found.history.attitude
    np.testing.assert_allclose(q, normalize(q), atol=1e-15)
    error = boxminus(q, all_runs[5].attitude) / found.history.attitude_u
    assert np.abs(error).max() < 5.5
