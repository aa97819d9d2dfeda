"""A base that is stated too roughly is found by earth rate and gravity, in every frame and from every heading."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from paper_study import ARCSEC, DEG, TRUTH, study
from scipy.stats import chi2

from inercal.foundation.errors import StudyError
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import Site, gravity
from inercal.foundation.geometry.rotations import exp, to_matrix
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.find_base import heading, is_rough, relative, with_base
from inercal.systems.selfcal.platform.coefficients import BETA
from inercal.systems.selfcal.platform.rig import Base, Gimbals
from inercal.systems.selfcal.simulate import experiment, simulate, to_record
from inercal.systems.selfcal.task import calibrate

FRAMES = st.sampled_from(["nue", "enu", "ned"])
TILT = st.tuples(*[st.floats(-1.5, 1.5)] * 2)
BETAS = st.tuples(*[st.floats(-0.5, 0.5)] * 3).map(np.array)


def unknown(settings):
    """The study of a base whose heading nobody states."""
    return replace(settings, base=replace(settings.base, heading=0.0), heading_unknown=True)


def at(latitude, **changes):
    """The study of the best path at another latitude [deg]."""
    return study("best", site=Site(float(gravity(latitude * DEG)), (), latitude * DEG), **changes)


def nees(found, truth):
    """Squared normalised error of all coefficients: chi-square with 24 degrees of freedom."""
    error = found.coefficients - truth
    return error @ np.linalg.solve(found.covariance, error)


def linear_truth(settings, made, told):
    """True coefficients, linear form, with beta against the base found."""
    truth = made.truth[:24].copy()
    truth[BETA] = relative(truth[BETA], settings.base, told.base)
    return truth


def assert_consistent(values):
    """The sum of normalised errors squared of independent runs lies in its band of 99.9 %."""
    low, high = chi2.ppf([0.0005, 0.9995], 24 * len(values))
    assert low < sum(values) < high, values


@given(frame=FRAMES, angle=st.floats(-7.0, 7.0), tilt=TILT, beta=BETAS)
def test_a_base_is_turned_by_beta(frame, angle, tilt, beta):
    """C' = R(beta) C, whatever the heading, the tilt and the frame; no beta is left."""
    base = Base(frame, angle, tilt)
    turned = base.turned(beta)
    wanted = to_matrix(exp(beta)) @ base.from_geographic()
    assert_allclose(turned.from_geographic(), wanted, atol=1e-12)
    assert_allclose(relative(beta, base, turned), 0.0, atol=1e-7)


@given(frame=FRAMES, angle=st.floats(-3.0, 3.0), tilt=TILT)
def test_a_base_is_itself_when_turned_by_nothing(frame, angle, tilt):
    """Heading and tilt come back from the rotation that they make."""
    base = Base(frame, angle, tilt)
    same = base.turned(np.zeros(3))
    assert_allclose([same.heading, *same.tilt], [angle, *tilt], atol=1e-7)


@pytest.mark.parametrize(("frame", "vertical", "sign"), [("nue", 1, 1), ("enu", 2, 1), ("ned", 2, -1)])
def test_heading_of_a_level_base_is_beta_about_the_vertical(frame, vertical, sign):
    """From north to east: beta turns components, about the upward axis positive, about the downward one negative."""
    beta = np.zeros(3)
    beta[vertical] = 1e-3
    value, u = heading(Base(frame, 1.0), beta, np.diag([4.0, 9.0, 16.0]) * 1e-8)
    assert value == pytest.approx(1.0 + sign * 1e-3, abs=1e-12)
    assert u == pytest.approx((2.0, 3.0, 4.0)[vertical] * 1e-4, rel=1e-5)


@pytest.mark.slow
@pytest.mark.parametrize(
    "degrees", [-170.0, 20.0, *(pytest.param(each, marks=pytest.mark.campaign) for each in (-75.0, 137.0))]
)
def test_any_heading_is_found(degrees):
    """To a few arcminutes from 9 min of turning, within 5 of its own standard deviations; coefficients too."""
    settings = study("best", base=Base(heading=math.radians(degrees)))
    made = experiment(settings)
    recording = simulate(made, np.random.default_rng(20261121)).recording
    told = with_base(recording, unknown(settings))
    found = estimate(recording, problem(told))
    u = np.sqrt(np.diag(found.covariance))
    miss = math.remainder(told.base.heading - math.radians(degrees), 2 * math.pi)
    assert u[22] < math.radians(0.1)
    assert abs(miss + found.coefficients[22]) < 5 * u[22]
    assert np.abs((found.coefficients[:18] - made.truth[:18]) / u[:18]).max() < 5.0


@pytest.mark.slow
@pytest.mark.parametrize("seed", [3, pytest.param(6, marks=pytest.mark.campaign)])
def test_coefficients_are_those_of_a_known_heading(seed):
    """What was not known at first costs nothing in the end: earth rate tells the heading to a minute of arc."""
    settings = study("best", base=Base(heading=math.radians(137.0)))
    extended = replace(settings, filter=replace(settings.filter, extended=True))
    recording = simulate(experiment(settings), np.random.default_rng(seed)).recording
    told = with_base(recording, unknown(settings))
    wide = settings.prior.copy()
    wide[22] = math.radians(1.0)
    known = estimate(recording, problem(replace(extended, prior=wide)))
    found = estimate(recording, problem(told))
    u, values = np.sqrt(np.diag(known.covariance)), found.coefficients.copy()
    values[BETA] = relative(values[BETA], told.base, settings.base)
    assert np.abs((values - known.coefficients) / u).max() < 0.3


@pytest.mark.slow
@pytest.mark.parametrize(
    ("frame", "axes", "tilt"),
    [
        ("enu", ("y", "x", "z"), (0.0, 0.0)),
        pytest.param("ned", ("x", "y", "z"), (0.0, 0.0), marks=pytest.mark.campaign),
        ("ned", ("x", "y", "z"), (0.5, -0.3)),
    ],
)
def test_in_other_frames(frame, axes, tilt):
    """The heading counts from north to east whatever the platform's axes are called and however its base is tilted."""
    settings = study("best", base=Base(frame, 1.0, tilt), gimbals=Gimbals(axes))
    recording = simulate(experiment(settings), np.random.default_rng(20261121)).recording
    told = with_base(recording, unknown(settings))
    assert told.base.heading == pytest.approx(1.0, abs=math.radians(0.3))
    assert_allclose(told.base.tilt, tilt, atol=60 * ARCSEC)


@pytest.mark.campaign
def test_at_high_latitude_errors_are_as_large_as_stated():
    """At 85 degrees earth rate has an eleventh of its north; headings all round, errors within chi-square's band."""
    values, headings = [], []
    for seed in range(6):
        settings = at(85.0, base=Base(heading=math.radians(60.0 * seed + 2.0)))
        made = experiment(settings)
        recording = simulate(made, np.random.default_rng(seed)).recording
        told = with_base(recording, unknown(settings))
        found = estimate(recording, problem(told), history=False)
        values.append(nees(found, linear_truth(settings, made, told)))
        value, u = heading(told.base, found.coefficients[BETA], found.covariance[BETA, BETA])
        headings.append(math.remainder(value - settings.base.heading, 2 * math.pi) / u)
    assert_consistent(values)
    assert np.abs(headings).max() < 4.0


@pytest.mark.slow
@pytest.mark.parametrize("latitude", [-89.9, 90.0])
def test_no_heading_is_told_at_the_poles(latitude):
    """East of the pole is everywhere: what the record can tell is said, and no heading given out."""
    settings = at(latitude, base=Base(heading=math.radians(137.0)))
    recording = simulate(experiment(settings), np.random.default_rng(1)).recording
    with pytest.raises(
        StudyError, match=rf"rig.heading: found unknown, but at latitude {latitude:g} deg .* deg only"
    ):
        with_base(recording, unknown(settings))


@pytest.mark.slow
@pytest.mark.parametrize("degrees", [3.0, pytest.param(1.0, marks=pytest.mark.campaign)])
def test_a_base_far_off_is_found(degrees):
    """Prior of degrees about all axes, true beta half of it or more: all estimators have the errors that they state."""
    values = {kind: [] for kind in ("error-state", "map")}
    prior = study().prior.copy()
    prior[BETA] = degrees * DEG
    for seed in range(6):
        rng = np.random.default_rng(seed)
        truth = TRUTH.copy()
        truth[18:21] = rng.normal(0.0, 50e-6, 3)
        truth[BETA] = rng.uniform(0.5, 1.0, 3) * rng.choice([-1.0, 1.0], 3) * min(degrees, 2.0) * DEG
        settings = study("best", truth=truth, prior=prior, base=Base(heading=0.3))
        settings = replace(settings, filter=replace(settings.filter, extended=True))
        made = experiment(settings)
        recording = simulate(made, rng).recording
        told = with_base(recording, settings)
        for kind, found in values.items():
            estimated = estimate(recording, problem(told), kind, history=False)
            found.append(nees(estimated, linear_truth(settings, made, told)))
    for found in values.values():
        assert_consistent(found)


def test_a_prior_that_filters_can_bear_is_left_alone():
    """The search is for what is rough: not for the usual minute of arc, nor where beta is not estimated."""
    settings = study()
    extended = replace(settings, filter=replace(settings.filter, extended=True))
    rough = settings.prior.copy()
    rough[BETA.start] = 0.1 * DEG
    assert not is_rough(settings)
    assert not is_rough(extended)
    assert not is_rough(replace(settings, prior=rough))
    assert is_rough(replace(extended, prior=rough))
    assert is_rough(unknown(settings))


def test_what_the_record_does_not_tell_keeps_its_prior():
    """At the pole a heading that is stated within a degree stays uncertain by that."""
    prior = study().prior.copy()
    prior[22] = 1.0 * DEG
    settings = at(90.0, prior=prior)
    settings = replace(settings, filter=replace(settings.filter, extended=True))
    recording = simulate(experiment(settings), np.random.default_rng(1)).recording
    told = with_base(recording, settings)
    found = estimate(recording, problem(told))
    assert told.prior[22] == 1.0 * DEG
    assert math.sqrt(found.covariance[22, 22]) == pytest.approx(1.0 * DEG, rel=1e-3)


def test_a_result_says_which_base_beta_is_relative_to():
    """Base found and beta together make the true base; truth, for pictures, is told against the same base."""
    truth, prior = TRUTH.copy(), study().prior.copy()
    truth[BETA], prior[BETA] = np.array([0.8, -0.5, 0.6]) * DEG, 1.0 * DEG
    settings = study("best", truth=truth, prior=prior)
    settings = replace(settings, filter=replace(settings.filter, extended=True))
    recording = simulate(experiment(settings), np.random.default_rng(4)).recording
    done = calibrate(to_record(recording), settings)
    result, values, u = done.estimate.result, done.estimate.values, np.sqrt(np.diag(done.estimate.covariance))
    assert done.estimate.status is Status.OK, done.estimate.message
    assert "beta is relative to the base found" in done.estimate.message
    assert "heading" not in result
    found = Base("nue", result["base"]["heading"], tuple(result["base"]["tilt"]))
    left = relative(truth[BETA], settings.base, found)
    assert np.abs((values[BETA] - left) / u[BETA]).max() < 4.0
    assert_allclose(done.truth[BETA], left, atol=1e-12)


@pytest.mark.slow
def test_a_result_tells_the_heading_that_was_unknown():
    """Value and u in the result, words in the message, with the base to which beta is relative."""
    settings = study("best", base=Base(heading=2.0))
    recording = simulate(experiment(settings), np.random.default_rng(4)).recording
    done = calibrate(to_record(recording), unknown(settings))
    told = done.estimate.result["heading"]
    assert abs(told["value"] - 2.0) < 4.0 * told["u"] < 4.0 * 0.05 * DEG
    assert done.estimate.result["base"]["heading"] == pytest.approx(2.0, abs=0.2 * DEG)
    assert "; heading 114.5" in done.estimate.message
