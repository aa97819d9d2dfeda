"""The filter of more than 18 coefficients: a second pass reaches the batch optimum, and u is true at low noise."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from paper_study import PRIOR, TRUTH, study
from scipy.stats import chi2

from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.platform.coefficients import product_slope, to_product
from inercal.systems.selfcal.simulate import experiment, simulate

SEED = 20261122


def drawn(run, noise="low"):
    """A recording on the best path with base and scales drawn from their priors, its problem and its truth."""
    rng, truth = np.random.default_rng([SEED, run]), TRUTH.copy()
    truth[18:] = rng.standard_normal(6) * PRIOR[18:]
    settings = study("best", noise, truth=truth)
    settings = replace(settings, filter=replace(settings.filter, extended=True))
    return simulate(experiment(settings), rng).recording, problem(settings), truth


@pytest.mark.parametrize("run", [1, 2])
def test_it_reaches_the_batch_optimum(run):
    """The batch estimator, which linearises all rows where it ends, is 0.01 u away; a single pass up to 2 u."""
    recording, of, _ = drawn(run)
    batch, found = (estimate(recording, of, each, history=False) for each in ("map", "error-state"))
    u = np.sqrt(np.diag(batch.covariance))
    assert_allclose(found.coefficients / u, batch.coefficients / u, atol=0.01)
    assert_allclose(np.sqrt(np.diag(found.covariance)) / u, 1.0, rtol=0.002)


def test_the_last_row_of_a_history_is_the_result():
    recording, of, _ = drawn(3)
    found = estimate(recording, of)
    once = estimate(recording, of, brief=True)
    assert_allclose(found.history.coefficients[-1], found.coefficients)
    assert_allclose(found.history.u[-1], np.sqrt(np.diag(found.covariance)))
    assert_allclose(found.history.attitude[:-1], once.history.attitude[:-1])
    assert (found.coefficients != once.coefficients).all()


def test_18_coefficients_need_none():
    settings = study("best", "low")
    recording = simulate(experiment(settings), np.random.default_rng(1)).recording
    one, two = (estimate(recording, problem(settings), brief=brief) for brief in (False, True))
    assert np.array_equal(one.coefficients, two.coefficients)


@pytest.mark.parametrize("runs", [12, pytest.param(200, marks=pytest.mark.campaign)])
def test_errors_are_what_u_says_at_low_noise(runs):
    """Mean of NEES over 24 degrees of freedom within 99.9 % of chance, and rms over u of each coefficient within 4.5
    standard errors; a single pass has 30."""
    squares, over = [], []
    for run in range(runs):
        recording, of, truth = drawn(run)
        found = estimate(recording, of, history=False)
        slope = product_slope(found.coefficients)
        P, miss = slope @ found.covariance @ slope.T, to_product(found.coefficients) - truth
        squares.append(miss @ np.linalg.solve(P, miss))
        over.append(miss / np.sqrt(np.diag(P)))
    low, high = chi2.ppf([0.0005, 0.9995], 24 * runs) / runs
    assert low < np.mean(squares) < high
    assert np.abs(np.sqrt(np.mean(np.square(over), axis=0)) - 1.0).max() < 4.5 / np.sqrt(2 * runs)
