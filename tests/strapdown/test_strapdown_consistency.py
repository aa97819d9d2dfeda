"""Errors of the batch estimator against its stated uncertainties, on runs of known truth."""

from dataclasses import replace

import numpy as np
import pytest
from grades import GRADES, MEMS, NAV, drawn, fitted, u_by_kind
from scipy.stats import chi2, norm

from inercal.systems.strapdown.fit.batch import fit
from inercal.systems.strapdown.fit.restricted import opened, residuals, with_noise_shown
from inercal.systems.strapdown.fit.rests import found_rests, nodes_of
from inercal.systems.strapdown.settings import ESTIMABLE, Motion
from inercal.systems.strapdown.simulate import simulated

RISK = 1e-3

#: largest u of each kind that another program has for the same tests, in the units of `u_by_kind`
EXPECTED = {
    "nav": (0.0029, 0.55, 1.35, 0.83, 0.47, 1.2, 0.96, 0.036, 0.0031),
    "tactical": (0.155, 13.5, 27.0, 16.6, 4.7, 21.0, 17.5, 0.094, 0.019),
    "mems": (2.8, 65.0, 126.0, 81.0, 17.0, 99.0, 80.0, 0.077, 0.043),
}


def as_stated(settings, c, rng):
    """The fit of a run whose noise is as stated, and the covariance of its coefficients."""
    found = fitted(settings, c, rng)
    return found, found.covariance


def as_shown(settings, c, rng):
    """The same where all noise but the white is left to the recording."""
    samples = simulated(settings, c, rng)
    nodes = nodes_of(samples, found_rests(samples, settings.rests), settings.rests.node)
    noise = replace(settings.noise, gyro_walk=0.0, accelerometer_walk=0.0, estimate=ESTIMABLE)
    without = replace(settings, noise=noise)
    shown, found, _ = with_noise_shown(samples, nodes, without, fit(samples, nodes, without))
    # chance may look like another effect, in whose place no noise is found
    more = opened(found, samples, shown) if shown.noise.estimate else 0.0
    return found, found.covariance + more


def campaign(settings, runs, seed, estimated):
    """Errors (runs, 31) over u, NEES (runs,), chi-square over degrees of freedom (runs,), and the last of these."""
    errors, nees, squares, dof = [], [], [], 0.0
    for number in range(runs):
        rng = np.random.default_rng([seed, number])
        c = drawn(settings, rng)
        found, covariance = estimated(settings, c, rng)
        error = (found.c - c)[found.free]
        assert found.converged
        errors.append(error / np.sqrt(np.diag(covariance)))
        nees.append(error @ np.linalg.solve(covariance, error))
        squares.append(found.chi2 / found.dof)
        dof = found.dof
    return np.array(errors), np.array(nees), np.array(squares), dof


def judge(settings, runs, seed, estimated=as_stated):
    """Assert that errors, their squares and chi-square are as stated, within limits for ``runs``; gives the errors."""
    z, nees, squares, dof = campaign(settings, runs, seed, estimated)
    p, sigmas = z.shape[1], norm.isf(RISK / 2.0)
    assert abs(nees.mean() - p) < sigmas * np.sqrt(2.0 * p / runs)
    low, high = chi2.ppf([RISK / (2.0 * p), 1.0 - RISK / (2.0 * p)], runs)
    assert np.all((np.sum(z**2, axis=0) > low) & (np.sum(z**2, axis=0) < high))
    assert abs(squares.mean() - 1.0) < sigmas * np.sqrt(2.0 / (dof * runs))
    return z


@pytest.mark.slow
@pytest.mark.parametrize(
    "grade", [pytest.param(grade, marks=[pytest.mark.campaign] * (grade == "tactical")) for grade in GRADES]
)
def test_errors_are_as_large_as_stated(grade):
    settings = GRADES[grade]
    judge(replace(settings, plan=replace(settings.plan, sample_rate=50.0)), 5, 20261123)


@pytest.mark.campaign
@pytest.mark.parametrize("grade", GRADES)
def test_errors_are_as_large_as_stated_in_a_hundred_runs(grade):
    in_a_hundred_runs(judge(GRADES[grade], 100, 21))


@pytest.mark.campaign
def test_errors_are_as_large_as_stated_where_walks_are_found_from_the_recording():
    in_a_hundred_runs(judge(MEMS, 100, 20261128, as_shown))


def in_a_hundred_runs(z):
    """Assert what only as many show, of errors (100, 31) over u."""
    assert 0.935 < np.mean(np.abs(z) < norm.isf(0.025)) < 0.965
    lengths = np.sum(z**2, axis=0) / len(z)
    assert 0.95 < np.exp(0.5 * np.mean(np.log(lengths))) < 1.05
    assert np.all((np.sqrt(lengths) > 0.65) & (np.sqrt(lengths) < 1.35))


def test_a_unit_that_sways_while_it_turns_is_where_its_gyros_say():
    """Turns close by gyros that hardly err, though the unit sways by fifty times that: it turns about its own axes."""
    settings = replace(NAV, rests=replace(NAV.rests, attitude=np.radians(0.01)))
    samples = simulated(settings, np.zeros(51), np.random.default_rng(7))
    nodes = nodes_of(samples, found_rests(samples, settings.rests), settings.rests.node)
    rest, turn = residuals(fit(samples, nodes, settings))
    assert 0.7 < turn < 1.3
    assert 0.9 < rest < 1.1


@pytest.mark.parametrize("grade", GRADES)
def test_uncertainties_are_those_expected_of_the_grade(grade):
    """Those of another program; that turned at an even rate, which tells places of accelerometers less well."""
    found = u_by_kind(fitted(GRADES[grade], np.zeros(51), np.random.default_rng(5)))
    for (kind, u), expected in zip(found.items(), EXPECTED[grade], strict=True):
        assert 0.8 < u / expected < 1.2, kind


def test_without_noise_only_the_integration_is_left():
    settings = replace(NAV, motion=Motion(np.radians(3.0), 1.5, 0.3))
    rng = np.random.default_rng(1)
    c = drawn(settings, rng)
    fit = fitted(settings, c, rng, noise=False)
    assert np.all(np.abs((fit.c - c)[fit.free]) < 0.1 * np.sqrt(np.diag(fit.covariance)))
