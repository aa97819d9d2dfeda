"""The estimate of a self-calibration: what it is uncertain by, and its verdict."""

import json
from dataclasses import replace

import numpy as np
import pytest
from paper_study import ARCSEC, DEG, TRUTH, study

from inercal.foundation.findings import Finding, Status
from inercal.foundation.geometry.earth import GravityInput, Site
from inercal.foundation.results.files import to_json
from inercal.systems.selfcal.before.bounds import recorded_bounds
from inercal.systems.selfcal.diagnosis.examination import diagnose
from inercal.systems.selfcal.diagnosis.gross import implausible
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.platform.coefficients import NAMES, to_product, units
from inercal.systems.selfcal.platform.rig import Base
from inercal.systems.selfcal.result.outcome import assemble, verdict
from inercal.systems.selfcal.simulate import experiment, simulate

LATITUDE_U = 0.02 * DEG
GRAVITY_U = 1e-4
SITE = Site(9.8, (GravityInput("gravity", GRAVITY_U, "m/s^2", 1.0),), 40.0 * DEG, LATITUDE_U)
BASE = Base(heading_u=0.05 * DEG, tilt_u=(1.0 * ARCSEC, 2.0 * ARCSEC))


def recording(settings, seed=5):
    return simulate(experiment(settings), np.random.default_rng(seed)).recording


def assembled(settings, made=None, kind=None, findings=()):
    made = recording(settings) if made is None else made
    stated = problem(settings)
    found = estimate(made, stated, kind)
    judge = estimate(made, stated, "error-state")
    bounds = recorded_bounds(made, stated, judge.history.attitude, judge.coefficients, contributions=True)
    return assemble(made, settings, found, bounds, findings), found


@pytest.fixture(scope="module")
def sound():
    settings = study(path="best", site=SITE, base=BASE, goal={"kg0_x": 1e-12, "ds_z": 1e-3})
    return settings, *assembled(settings)


def test_a_sound_recording_gives_all_coefficients_in_product_form(sound):
    _, result, found = sound
    assert result.status is Status.OK
    assert result.names == NAMES
    assert result.units == units(NAMES)
    np.testing.assert_array_equal(result.values, to_product(found.coefficients))
    errors = (result.values - TRUTH[:18]) / result.u
    assert np.abs(errors).max() < 4.0


def test_degrees_of_freedom_are_scalars_used_minus_parameters(sound):
    settings, result, _ = sound
    assert result.statistics["dof"] == 2700 * 6 - 21 == 16179
    # type B adds to what the noise leaves, so that the effective degrees of freedom only grow
    assert (result.dof >= 16179 * (1 - 1e-9)).all()
    np.testing.assert_allclose(result.k, 2.0, atol=1e-3)
    made = recording(settings)
    acc = made.acc.copy()
    acc[5, 1] = np.nan
    fewer, _ = assembled(settings, replace(made, acc=acc))
    assert fewer.statistics["dof"] == 16178


def test_the_budget_adds_up_to_the_stated_variances(sound):
    _, result, found = sound
    sources = [item.source for item in result.budget]
    assert sources == [
        "angle random walk", "accelerometer noise", "encoder noise", "prior",
        "latitude", "gravity", "heading", "tilt about north", "tilt about east",
    ]  # fmt: skip
    for name in NAMES:
        assert sum(item.share.get(name, 0.0) for item in result.budget) == pytest.approx(1.0, abs=1e-9)
    share = {item.source: item.share for item in result.budget}
    assert share["gravity"]["ka1_x"] > 0.5  # the scale of accelerometers is that of gravity
    assert [item.type for item in result.budget] == ["A"] * 3 + ["B"] * 6
    # noise and prior alone are the filter's own covariance; the slope to the product form is 1 to 1e-3
    by_filter = np.sqrt(np.diag(found.covariance))
    parts = [sum(share[source].get(name, 0.0) for source in sources[:4]) for name in NAMES]
    np.testing.assert_allclose(result.u * np.sqrt(parts), by_filter, rtol=2e-3)


def test_a_wrong_latitude_shifts_the_coefficients_as_the_budget_says(sound):
    """The truth itself is moved by one standard uncertainty, with the same noise."""
    settings, result, _ = sound
    shifted = replace(settings, site=replace(SITE, latitude=SITE.latitude + LATITUDE_U))
    plain, other = (estimate(recording(each), problem(settings)).coefficients for each in (settings, shifted))
    shift = to_product(other) - to_product(plain)
    share = next(item.share for item in result.budget if item.source == "latitude")
    said = result.u * np.sqrt([share.get(name, 0.0) for name in NAMES])
    np.testing.assert_allclose(np.abs(shift), said, atol=0.02 * result.u.max(), rtol=0.02)
    # 0.1 deg of latitude, five times what is stated, is 12 sigma
    by_noise = np.sqrt(np.diag(result.covariance - result.common))
    assert np.max(said / by_noise) * 5.0 == pytest.approx(12.0, rel=0.2)


def test_stated_uncertainties_cover_a_world_that_is_drawn_from_them():
    """Errors over u have unit variance when the site and the base are drawn from what is stated of them."""
    settings = study(path="best", site=SITE, base=BASE)
    result, _ = assembled(settings)
    rng = np.random.default_rng(8)
    stated = problem(settings)
    errors = []
    for _ in range(40):
        site = replace(
            SITE,
            latitude=SITE.latitude + LATITUDE_U * rng.standard_normal(),
            gravity=SITE.gravity + GRAVITY_U * rng.standard_normal(),
        )
        tilt = tuple(u * rng.standard_normal() for u in BASE.tilt_u)
        base = Base(heading=BASE.heading_u * rng.standard_normal(), tilt=tilt)
        world = study(path="best", site=site, base=base)
        made = simulate(experiment(world), rng).recording
        errors.append(to_product(estimate(made, stated, history=False).coefficients) - TRUTH[:18])
    ratio = np.mean(np.square(errors), axis=0) / np.square(result.u)
    # chi-square of 40 over 40: 4.5 standard deviations for 18 coefficients
    assert ratio.max() < 1.0 + 4.5 * np.sqrt(2.0 / 40.0)
    assert ratio.min() > 1.0 - 3.5 * np.sqrt(2.0 / 40.0)
    whole = np.einsum("ri,ij,rj->r", errors, np.linalg.inv(result.covariance), errors)
    assert abs(whole.mean() - 18.0) < 4.0 * np.sqrt(2.0 * 18.0 / 40.0)


def test_heading_and_tilt_are_left_to_beta_where_it_is_estimated():
    settings = study(path="best", site=SITE, base=BASE)
    result, _ = assembled(replace(settings, filter=replace(settings.filter, extended=True)))
    assert [item.source for item in result.budget][4:] == ["latitude", "gravity"]
    assert len(result.names) == 24
    assert "beta" in result.model


def test_what_is_taken_as_exact_is_said():
    result, _ = assembled(study(path="best"))
    found = next(finding for finding in result.findings if finding.code == "stated_exact")
    for word in ("latitude", "gravity", "heading", "tilt"):
        assert word in found.message


def test_nothing_is_said_to_be_exact_where_all_has_an_uncertainty(sound):
    said = [each.message for each in sound[1].findings if each.code == "stated_exact"]
    assert not [text for text in said if "taken as exact" in text]
    assert "are no states" in said[0]


def test_goals_are_judged_with_the_stated_uncertainty(sound):
    _, result, _ = sound
    assert result.result["goal"]["ds_z"]["met"] is True
    assert result.result["goal"]["kg0_x"]["met"] is False
    found = [finding.message for finding in result.findings if finding.code == "goal_missed"]
    assert len(found) == 1
    assert found[0].startswith("kg0_x: u = ")


def test_a_goal_missed_for_want_of_a_turn_says_which():
    """On the paper's path X_p is never torqued: ds_z and do_y see only earth rate."""
    result, _ = assembled(study(goal={"ds_z": 1e-5, "kg0_x": 1e-12}))
    found = {f.message.split(":")[0]: f.message for f in result.findings if f.code == "goal_missed"}
    assert "X_p is turned by" in found["ds_z"]
    assert "X_p" not in found["kg0_x"]


def test_a_path_that_leaves_coefficients_at_their_prior():
    """The two turns of the paper tell nothing of kg0_x, and little of ka1_z."""
    result, _ = assembled(study(path="paper two turns"))
    assert result.status is Status.UNOBSERVABLE
    assert "kg0_x" in result.message
    assert {"kg0_x", "ka1_z"} <= set(result.result["at_prior"])
    assert {f.message.split(":")[0] for f in result.findings if f.code == "at_prior"} == set(
        result.result["at_prior"]
    )


def test_a_recording_that_contradicts_the_model_is_inconsistent_and_says_why():
    settings = study(path="best")
    made = recording(settings)
    made = replace(made, rate=np.roll(made.rate, 1, axis=0))
    stated = problem(settings)
    result, _ = assembled(settings, made, findings=diagnose(made, stated, estimate(made, stated)))
    assert result.status is Status.INCONSISTENT
    assert "1 row later" in result.message
    assert (
        result.statistics["nis_mean"]
        > result.statistics["nis_limit"]
        == pytest.approx(6.0 + 5.0 * np.sqrt(12.0 / 2700.0))
    )


def test_an_inconsistent_verdict_names_what_explains_it_and_leaves_the_rest_unsaid():
    """A wrong sign explains more than a saturated sample; goals of such numbers are of no interest."""
    settings = study(path="best", goal={"kg0_x": 1e-12})
    made = recording(settings)
    known = (Finding("saturation", "acc_z: 3 samples"), Finding("outlier", "acc_x: 1 sample"))
    made = replace(made, th=made.th * [1.0, 1.0, -1.0], findings=known)
    made = replace(made, findings=(*known, *implausible(made, settings, "record")))
    assert made.findings[-1].code == "sign_suspect"
    result, _ = assembled(settings, made)
    assert result.status is Status.INCONSISTENT
    assert result.message.endswith(made.findings[-1].message)
    assert [finding.code for finding in result.findings] == ["saturation", "outlier", "sign_suspect"]
    silent, _ = assembled(settings, replace(made, findings=known[:1]))
    assert silent.message.endswith("acc_z: 3 samples")
    unexplained, _ = assembled(settings, replace(made, findings=()))
    assert unexplained.message.endswith("check noise, commands, signs and units")
    # what the diagnosis found comes before what was seen in single channels
    told, _ = assembled(settings, made, findings=[Finding("low_scatter", "a"), Finding("unmodelled", "b")])
    assert told.message.endswith("; b")


def test_a_filter_that_did_not_converge_gives_no_numbers(sound):
    settings, _, found = sound
    made = recording(settings)
    bounds = recorded_bounds(made, problem(settings), found.history.attitude, found.coefficients)
    locked = replace(
        found, kind="gimbal-ukf", converged=False, message="the filter diverged", gimbal_cosine=1e-3
    )
    result = assemble(made, settings, locked, bounds)
    assert result.status is Status.NOT_CONVERGED
    assert result.names == ()
    assert "gimbal_lock" in {finding.code for finding in result.findings}
    assert verdict(locked, made, settings) == (Status.NOT_CONVERGED, "the filter diverged")


def test_verdicts_of_comparisons_are_those_of_estimates(sound):
    settings, result, found = sound
    assert verdict(found, recording(settings), settings) == (result.status, result.message)


def test_at_an_exact_site_u_is_the_bound():
    """The filter reaches the Cramer-Rao bound of its path, so nothing but the site is above it."""
    result, _ = assembled(study(path="best"))
    np.testing.assert_allclose(result.u, list(result.result["bounds"].values()), rtol=1e-3)


def test_the_result_holds_what_the_interface_asks(sound):
    _, result, _ = sound
    text = json.loads(json.dumps(to_json(result)))
    own = text["result"]
    assert {"filter", "bounds", "at_prior", "goal", "sample_interval", "compare"} <= set(own)
    assert (np.array(list(own["bounds"].values())) < result.u).all()  # which has the site's part, too
    assert own["sample_interval"] == pytest.approx(0.2)
    assert text["parameters"][0]["unit"] == "rad/s"
    assert text["conditions"]["ranges"]["duration_s"] == pytest.approx(540.0)
    assert text["statistics"]["condition"] > 1.0


@pytest.mark.parametrize("kind", ["svd-qukf", "map"])
def test_other_estimators_give_the_same_estimate(sound, kind):
    settings, result, _ = sound
    other, _ = assembled(settings, kind=kind)
    assert np.abs((other.values - result.values) / result.u).max() < 0.1
    np.testing.assert_allclose(other.u, result.u, rtol=0.02)
    assert other.status is Status.OK


def test_a_latitude_that_nobody_knows_hides_what_the_path_shows():
    """With 5 deg of latitude earth rate is uncertain by more than the prior of the gyro biases."""
    settings = study(path="best", site=replace(SITE, latitude_u=5.0 * DEG))
    result, _ = assembled(settings)
    assert result.status is Status.UNOBSERVABLE
    assert "what is stated of latitude" in result.message
    assert {"kg0_x", "kg0_y"} <= set(result.result["at_prior"])
    assert result["kg0_x"].u > 0.9 * settings.prior[0]
