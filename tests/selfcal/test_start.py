"""The start by Levenberg-Marquardt: from any attitude, with accelerometers alone, and honest about gyro noise."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from paper_study import ARCSEC, DEG, MICRO_G, PRIOR, TRUTH, study

from inercal.geometry.rotations import attitude_difference, boxminus, boxplus, normalize
from inercal.selfcal.before.simulate import experiment, simulate
from inercal.selfcal.filters.batch import estimate_map
from inercal.selfcal.filters.problem import Start, problem
from inercal.selfcal.filters.residuals import readings
from inercal.selfcal.filters.start import _along, estimate_lm, wahba
from inercal.selfcal.platform.coefficients import to_linear
from inercal.selfcal.platform.plan import path
from inercal.selfcal.settings import Filter, Noise


def simulated(seed=1, name="paper", step=0.2, **changes):
    """A simulation, its problem and the true coefficients in the linear form."""
    settings = study(plan=path(name, step), **changes)
    prepared = experiment(settings)
    made = simulate(prepared, np.random.default_rng(seed))
    return made, problem(settings), prepared.truth[: len(settings.states.names)]


def blind(recording):
    """Without any encoder reading after the first row."""
    th = recording.th.copy()
    th[1:] = np.nan
    return replace(recording, th=th)


def sigmas(found):
    return np.sqrt(np.diag(found.covariance))


@pytest.mark.parametrize("extended", [False, True])
def test_path_and_its_derivatives(extended):
    truth = TRUTH + np.append(np.zeros(18), [40e-6, -60e-6, 80e-6, 1e-3, -2e-3, 1.5e-3])
    made, given, _ = simulated(step=5.0, truth=truth, filter=Filter(extended=extended))
    rng = np.random.default_rng(3)
    size = 3 + len(given.prior)
    x = rng.standard_normal(size)
    x[:3] *= 0.5
    guess, measured = made.attitude[0], readings(made.recording, given)
    at = _along(x, guess, made.recording, given, measured)
    for k in range(size):
        d = np.zeros(size)
        d[k] = h = 1e-5 if k < 3 else 1e-3
        after = _along(x + d, guess, made.recording, given, measured)
        before = _along(x - d, guess, made.recording, given, measured)
        by = boxminus(after.q, before.q) / (2.0 * h)
        assert_allclose(at.slope[:, :, k], by, atol=1e-8 * max(1.0, np.abs(by).max()))
        by = -(after.sensed.residual - before.sensed.residual) / (2.0 * h)
        of_rows = (at.sensed.by_attitude @ at.slope[1:])[:, :, k]
        if k >= 3:
            of_rows = of_rows + at.sensed.by_coefficients[:, :, k - 3]
        scale = np.abs(by).max() + 1.0
        assert_allclose(of_rows / scale, by / scale, atol=1e-6)


def test_path_is_the_simulated_one_without_gyro_noise():
    made, given, truth = simulated(noise="low", step=1.0)
    x = np.append(np.zeros(3), truth / given.prior)
    at = _along(x, made.attitude[0], made.recording, given, readings(made.recording, given))
    wander = given.noise.angle_random_walk * np.sqrt(made.recording.t[-1])
    assert np.max(attitude_difference(at.q, made.attitude)) < 5.0 * wander


def test_wahba_finds_the_attitude_from_any_start():
    """Without errors of the instruments, forces turned back by the commands are the vertical as the earth turns."""
    quiet = Noise(1e-12, 1e-9, 1e-9)
    made, given, _ = simulated(step=1.0, truth=np.zeros(24))
    settings = replace(study(plan=path("paper", 1.0), truth=np.zeros(24)), noise=quiet)
    made = simulate(experiment(settings), np.random.default_rng(1))
    recording, given = blind(made.recording), problem(settings)
    rng = np.random.default_rng(8)
    for _ in range(20):
        start = Start(normalize(rng.standard_normal(4)), np.inf)
        found = wahba(recording, given, readings(recording, given), start)
        assert attitude_difference(found, made.attitude[0]) < 1e-4
    # a start that is known better than the heading that the forces tell is kept
    tight = Start(boxplus(made.attitude[0], np.array([0.0, 0.1, 0.0])), 1e-6)
    found = wahba(recording, given, readings(recording, given), tight)
    assert attitude_difference(found, tight.attitude) < 1e-6
    # encoders alone tell it too
    silent = replace(made.recording, acc=np.full_like(made.recording.acc, np.nan))
    found = wahba(silent, given, readings(silent, given), start)
    assert attitude_difference(found, made.attitude[0]) < 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("name", ["paper", "best", "paper two turns"])
def test_from_a_hundred_degrees_with_accelerometers_alone(name):
    """About each axis and four directions drawn: one and the same answer, within 4.5 sigma of the truth."""
    rng = np.random.default_rng(17)
    directions = [*np.eye(3), *-np.eye(3), *rng.standard_normal((4, 3))]
    for seed in (1, 2):
        made, given, truth = simulated(seed, name, 1.0)
        recording, answers = blind(made.recording), []
        for direction in directions:
            off = np.radians(100.0) * direction / np.linalg.norm(direction)
            start = Start(boxplus(made.attitude[0], off), np.radians(100.0))
            found = estimate_lm(recording, given, start)
            assert found.converged
            u = sigmas(found)
            assert np.all(np.abs(found.coefficients - truth) < 4.5 * u)
            miss = boxminus(found.history.attitude[0], made.attitude[0]) / found.history.attitude_u[0]
            assert np.all(np.abs(miss) < 4.5)
            assert found.nis_mean == pytest.approx(3.0, abs=0.5)
            answers.append(found.coefficients / u)
        assert_allclose(answers - answers[0], 0.0, atol=0.05)


def test_the_batch_takes_it_where_encoders_are_silent():
    made, given, truth = simulated(5, step=1.0)
    start = Start(boxplus(made.attitude[0], np.array([0.0, 1.7, 0.0])), np.radians(100.0))
    recording = blind(made.recording)
    found, rough = estimate_map(recording, given, start), estimate_lm(recording, given, start)
    assert found.converged
    assert np.all(np.abs(found.coefficients - truth) < 4.5 * sigmas(found))
    assert np.all(sigmas(found) < 1.001 * sigmas(rough))
    # with encoders it needs none
    found = estimate_map(made.recording, given, start)
    assert found.converged
    assert np.all(np.abs(found.coefficients - truth) < 4.5 * sigmas(found))


@pytest.mark.slow
def test_with_encoders_never_better_than_the_bound():
    made, given, truth = simulated(7)
    found, best = estimate_lm(made.recording, given), estimate_map(made.recording, given)
    assert found.converged
    assert np.all(sigmas(found) > 0.999 * sigmas(best))
    assert np.all(np.abs(found.coefficients - truth) < 4.5 * sigmas(found))
    assert np.all(found.dims == 6)
    assert 5.0 < found.nis_mean < 6.2
    assert np.all(np.abs(np.mean(found.innovations**2, axis=0) - 1.0) < 0.3)
    assert estimate_lm(made.recording, given, history=False).history is None


def test_extended_model_with_gaps():
    truth = TRUTH + np.append(np.zeros(18), [40e-6, -60e-6, 80e-6, 1e-4, -2e-4, 1.5e-4])
    made, given, linear = simulated(9, step=1.0, truth=truth, filter=Filter(extended=True))
    acc, th = made.recording.acc.copy(), made.recording.th.copy()
    acc[50:150], th[100:200], acc[300:310, 1], th[400, 2] = np.nan, np.nan, np.nan, np.nan
    recording = replace(made.recording, acc=acc, th=th)
    found = estimate_lm(recording, given)
    assert found.converged
    assert np.all(np.abs(found.coefficients - linear) < 4.5 * sigmas(found))
    assert np.array_equal(np.flatnonzero(np.isnan(found.nis)), np.arange(99, 149))
    assert np.all(np.isnan(found.innovations[299:309, 1]))
    assert np.all(np.isfinite(found.innovations[299:309, [0, 2]]))


@pytest.mark.slow
def test_uncertainty_holds_where_gyro_noise_is_most_of_it():
    """Sixty runs of truth from the prior, gyro noise ten times the nominal: NEES of coefficients and attitudes.

    Without the wander in the covariance the first would be some two thousand. Seeds and limits set beforehand.
    """
    noise = Noise(5e-3 * DEG / 60.0, 10.0 * MICRO_G, 2.0 * ARCSEC)
    rng = np.random.default_rng(2718)
    runs, nees, ends = 60, 0.0, []
    for _ in range(runs):
        truth = np.append(PRIOR[:18] * rng.standard_normal(18), np.zeros(6))
        settings = replace(study("best", plan=path("best", 2.0), truth=truth), noise=noise)
        made = simulate(experiment(settings), rng)
        found = estimate_lm(made.recording, problem(settings))
        error = found.coefficients - to_linear(truth)[:18]
        nees += error @ np.linalg.solve(found.covariance, error)
        for row in (0, 100, -1):
            past = found.history
            ends.append(boxminus(past.attitude[row], made.attitude[row]) / past.attitude_u[row])
    assert abs(nees / runs - 18.0) < 3.3 * np.sqrt(2 * 18.0 / runs)
    # three of the nine errors of a run may well go together
    assert abs(np.mean(np.square(ends)) - 1.0) < 3.3 * np.sqrt(2.0 / (3 * runs))
