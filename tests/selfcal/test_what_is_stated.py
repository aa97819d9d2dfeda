"""What a study states with an uncertainty may be wrong by about that, and by no more, without a contradiction."""

from dataclasses import replace

import numpy as np
import pytest
from paper_study import ARCSEC, DEG, TRUTH, study

from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import EARTH_RATE, GravityInput
from inercal.systems.selfcal.before.bounds import recorded_bounds
from inercal.systems.selfcal.diagnosis.examination import diagnose
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.platform.rig import Base
from inercal.systems.selfcal.result.budget import stated_errors, systematic_inputs
from inercal.systems.selfcal.result.outcome import assemble, verdict
from inercal.systems.selfcal.simulate import experiment, simulate

PLAIN = study(path="best")
PLAIN_LIMIT = 6.0 + 5.0 * np.sqrt(12.0 / 2700.0)


def recorded(settings, seed=5):
    return simulate(experiment(settings), np.random.default_rng(seed)).recording


def calibrated(settings, made):
    """Estimate and diagnosis of a recording, as the command makes them."""
    of = problem(settings)
    found = estimate(made, of)
    faults = diagnose(made, of, found, stated_errors(settings))
    bounds = recorded_bounds(made, of, found.history.attitude, found.coefficients, contributions=True)
    return assemble(made, settings, found, bounds, faults), [each.code for each in faults]


def with_latitude(settings, degrees, u=0.0):
    return replace(settings, site=replace(settings.site, latitude=degrees * DEG, latitude_u=u * DEG))


def with_tilt(settings, north, east, u=0.0):
    base = Base(tilt=(north * ARCSEC, east * ARCSEC), tilt_u=(u * ARCSEC, u * ARCSEC))
    return replace(settings, base=base)


@pytest.mark.parametrize("degrees", [40.0, 89.95, 90.0, -90.0])
@pytest.mark.parametrize("by", [0.1 * DEG, -0.1 * DEG, 7.0])
def test_earth_rate_turns_evenly_with_the_latitude_over_the_poles_too(degrees, by):
    """we (cos L, sin L) to north and up for any L, so that half of the difference of both ways is the derivative."""
    heading, latitude = 0.3, degrees * DEG + by
    (stated,) = (
        each
        for each in systematic_inputs(replace(with_latitude(PLAIN, degrees), base=Base(heading=heading)))
        if each.name == "latitude"
    )
    north = np.array(
        [np.cos(heading), 0.0, -np.sin(heading)]
    )  # in b: north, up, east of a base turned clockwise
    expected = EARTH_RATE * (np.cos(latitude) * north + np.sin(latitude) * np.array([0.0, 1.0, 0.0]))
    np.testing.assert_allclose(stated.changed(by).world.earth, expected, atol=1e-14 * EARTH_RATE)


@pytest.mark.slow
def test_worlds_drawn_from_what_is_stated_contradict_nothing():
    """All of it wrong at once. Of 3 worlds one finding would be rare at a risk of 1e-3 a test, and there is none."""
    rng = np.random.default_rng(31)
    site = replace(PLAIN.site, inputs=(GravityInput("gravity", 1e-4, "m/s^2", 1.0),), latitude_u=0.2 * DEG)
    base = Base(heading=0.5, tilt=(5e-5, -1e-4), heading_u=0.5 * DEG, tilt_u=(5 * ARCSEC, 20 * ARCSEC))
    stated = replace(PLAIN, site=site, base=base)
    squares = []
    for seed in range(3):
        by = rng.standard_normal(5)
        there = replace(
            site, latitude=site.latitude + by[0] * site.latitude_u, gravity=site.gravity + 1e-4 * by[1]
        )
        tilt = tuple(t + u * x for t, u, x in zip(base.tilt, base.tilt_u, by[3:], strict=True))
        turned = Base(heading=base.heading + by[2] * base.heading_u, tilt=tilt)
        result, codes = calibrated(stated, recorded(replace(PLAIN, site=there, base=turned), seed))
        assert (result.status, codes) == (Status.OK, [])
        errors = result.values - TRUTH[:18]
        squares.append(errors @ np.linalg.solve(result.covariance, errors))
    # chi-square of 18: four standard errors of the mean of 3
    assert abs(np.mean(squares) - 18.0) < 4.0 * np.sqrt(2.0 * 18.0 / 3.0)


@pytest.mark.slow
def test_the_limit_of_the_verdict_is_raised_by_what_a_stated_tilt_explains():
    made = recorded(with_tilt(PLAIN, 10.0, -8.0))
    sure, doubted = with_tilt(PLAIN, 0.0, 0.0, 1.0), with_tilt(PLAIN, 0.0, 0.0, 5.0)
    contradicted, codes = calibrated(sure, made)
    assert contradicted.status is Status.SUSPECT  # ten u off
    assert codes == ["unmodelled"]
    assert contradicted.statistics["nis_limit"] == pytest.approx(PLAIN_LIMIT)
    agreeing, codes = calibrated(doubted, made)
    assert (agreeing.status, codes) == (Status.OK, [])
    assert agreeing.statistics["nis_mean"] == contradicted.statistics["nis_mean"] > PLAIN_LIMIT
    # what is left is the mean NIS of the tilt that is true
    true = estimate(made, problem(with_tilt(PLAIN, 10.0, -8.0))).nis_mean
    left = agreeing.statistics["nis_mean"] - (agreeing.statistics["nis_limit"] - PLAIN_LIMIT)
    assert left == pytest.approx(true, abs=0.02)
    other = estimate(made, problem(doubted), "map")
    assert verdict(other, made, doubted)[0] is Status.OK


def test_without_anything_uncertain_the_limit_is_that_of_the_contract():
    assert stated_errors(PLAIN) == []
    result, _ = calibrated(PLAIN, recorded(PLAIN))
    assert result.statistics["nis_limit"] == pytest.approx(PLAIN_LIMIT)


@pytest.mark.slow
def test_other_faults_stay_contradictions_beside_what_is_uncertain():
    made = recorded(with_tilt(PLAIN, 10.0, -8.0))
    shifted = replace(made, rate=np.roll(made.rate, 1, axis=0))
    result, codes = calibrated(with_tilt(PLAIN, 0.0, 0.0, 5.0), shifted)
    assert (result.status, codes) == (Status.INCONSISTENT, ["command_shift"])
    # an uncertain latitude is no excuse for a tilt
    result, codes = calibrated(with_latitude(PLAIN, 40.0, 0.2), made)
    assert (result.status, codes) == (Status.SUSPECT, ["unmodelled"])


@pytest.mark.parametrize(("u", "named"), [(0.0, True), (0.01, True), (0.1, False)])
def test_a_verdict_that_values_can_be_used_names_what_speaks_against_it(u, named):
    """0.1 deg of latitude are 12 sigma, and the mean NIS shows nothing: the message does."""
    result, codes = calibrated(with_latitude(PLAIN, 40.0, u), recorded(with_latitude(PLAIN, 40.1)))
    off = np.abs((result.values - TRUTH[:18]) / result.u).max()
    assert result.status is (Status.SUSPECT if named else Status.OK)
    assert codes == ["site_suspect"] * named
    assert ("but see site_suspect" in result.message) == named
    assert (off > 5.0) == named
