"""The estimate of an angle of attack: what u comes from, what is said, and when it is refused."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from sting_study import DEG, G, scenario, study

from inercal.foundation.findings import Finding, Status
from inercal.foundation.geometry.earth import GravityInput, Site
from inercal.foundation.results.files import from_json, to_json
from inercal.foundation.units import Quantity, parse_unit
from inercal.systems.aoa.angles import Angles
from inercal.systems.aoa.diagnosis.passed import pass_of
from inercal.systems.aoa.fusion.filter_result import estimate
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.reading.wind_off_zero import with_zero
from inercal.systems.aoa.result.budget import parts
from inercal.systems.aoa.result.outcome import assemble, assemble_angles
from inercal.systems.aoa.result.systematic import by_fusion, by_methods
from inercal.systems.aoa.result.verification import errors
from inercal.systems.aoa.settings import Attitude, Estimator, Methods, Timing, Zero
from inercal.systems.aoa.simulate import simulate

UNCERTAIN = Site(G, (GravityInput("gravity", 1e-3, "m/s^2", 1.0),))
SINE = MotionPlan("sine", duration=6.0, mean=30.0 * DEG, amplitude=10.0 * DEG, frequency=1.0)


def assembled(settings, made=None, findings=(), seed=3, **other):
    made = simulate(settings, np.random.default_rng(seed)).recording if made is None else made
    stated = problem(settings, made.spatial)
    found = estimate(made, stated, settings.estimator.smooth)
    return assemble(made, settings, stated, found, findings, None, **other), found, made


@pytest.fixture(scope="module")
def sound():
    return assembled(study(motion=SINE))


def test_parameters_are_the_filters_coefficients_at_the_end(sound):
    result, found, _ = sound
    assert result.status is Status.OK
    positions = ("dr_1", "dr_2", "dr_3", "zo_1", "zo_2", "zo_3")
    assert result.names == ("b_g", "b_1", "b_2", "b_3", *positions, "k_g", "tau_g")
    assert result.units == ("rad/s", *["m/s^2"] * 3, *["m"] * 6, "1", "s")
    at = list(problem(study(motion=SINE)).nuisances.values())
    np.testing.assert_array_equal(result.values, found.state.x[at])
    np.testing.assert_array_equal(result.covariance, found.state.P[np.ix_(at, at)])
    for name, told in result.result["posterior"].items():
        assert (told["value"], told["u"]) == (result[name].value, result[name].u)
        assert told["u"] <= told["prior"] * (1.0 + 1e-9)


def test_the_result_is_plain_json_with_the_keys_of_the_contract(sound):
    result, *_ = sound
    text = json.dumps(to_json(result), allow_nan=False)
    back = from_json(json.loads(text))
    assert back.names == result.names
    assert back.status is Status.OK
    told = json.loads(text)["result"]
    assert {"method", "nis_mean", "posterior", "compare", "angle", "timing", "points"} <= set(told)
    assert "reference" not in told
    assert told["method"] == "fusion 19"
    assert told["angle"]["range"] == pytest.approx([20.0 * DEG, 40.0 * DEG], abs=0.1 * DEG)


def test_degrees_of_freedom_are_scalars_used_less_coefficients(sound):
    result, *_ = sound
    assert result.statistics["dof"] == 6000 * 4 - 12
    assert result.statistics["rate_hz"] == pytest.approx(1000.0)


@pytest.mark.parametrize("smoothed", [False, True])
def test_parts_of_the_variance_add_up_to_it(smoothed, monkeypatch):
    """Euler's theorem: P is homogeneous in the variances of all its sources, the delay's and the zero's among them."""
    settings = study(
        motion=replace(SINE, duration=4.0),
        timing=Timing(gyro_delay=None, common_delay=1e-3, common_delay_u=2e-4),
        zero=Zero(0.0, 4.0, 0.0, 0.02 * DEG),
    )
    made = simulate(settings, np.random.default_rng(1)).recording
    made.zero_angle[2500] = made.reference[2500], 0.02 * DEG
    found = []
    monkeypatch.setattr(
        "inercal.systems.aoa.result.budget._items", lambda parts, names: found.extend(parts) or ()
    )
    parts(made, of := problem(settings), settings, smoothed, np.full(len(made.t), True))
    whole = np.sum([part for _, part in found], axis=0)
    told = estimate(made, of, smoothed)
    after = made.t >= 2.0
    assert whole[0] == pytest.approx(np.mean(told.u[after] ** 2), rel=3e-3)
    at = list(of.nuisances.values())
    np.testing.assert_allclose(whole[1:-1], np.diag(told.state.P)[at][:-1], rtol=3e-3)
    # a delay multiplies the acceleration alone, of which as much is believed as its variance allows
    assert whole[-1] == pytest.approx(told.state.P[at[-1], at[-1]], rel=0.05)
    by_name = {source.name: part[0] for source, part in found}
    # a common delay adds (w u)^2, and nothing else does it
    assert by_name["common delay"] == pytest.approx(np.mean((told.rate[after] * 2e-4) ** 2), rel=3e-3)
    assert by_name["stated zero"] > 0.0


@pytest.mark.parametrize("smooth", [False, True])
def test_the_budget_of_sensors_that_come_late_is_that_of_the_record_from_there_on(smooth, monkeypatch):
    """Rows without accelerometers, more than are looked at, tell of no angle: they split nothing."""
    monkeypatch.setattr("inercal.systems.aoa.result.budget.MOST", 600)
    settings = study(
        motion=replace(SINE, sample_rate=250.0), estimator=Estimator(19, smooth=smooth), site=UNCERTAIN
    )
    made = simulate(settings, np.random.default_rng(4)).recording
    made.acc[:660] = np.nan
    made.gyro[:660] = np.nan
    late, *_ = assembled(settings, made)
    from_there, *_ = assembled(settings, made.of(np.arange(660, len(made.t))))
    for item, other in zip(late.budget, from_there.budget, strict=True):
        assert item.share == pytest.approx(other.share, rel=1e-5)
    assert sum(item.share.get("theta", 0.0) for item in late.budget) == pytest.approx(1.0, abs=1e-3)


def test_rows_long_after_the_rest_that_have_no_angle_do_not_empty_the_budget():
    """Half a second of angles, and one row of silence much later: the shares are those of the half second."""
    settings = study(motion=replace(SINE, duration=0.5))
    made = simulate(settings, np.random.default_rng(4)).recording
    made.acc[-1] = made.gyro[-1] = np.nan
    made.t[-1] += 1e6
    result, found, _ = assembled(settings, made)
    assert np.isnan(found.theta[-1])
    assert np.isfinite(found.theta[:-1]).all()
    assert sum(item.share.get("theta", 0.0) for item in result.budget) == pytest.approx(1.0, abs=1e-3)


def test_gravity_and_a_stated_roll_widen_the_angle_as_wrong_ones_move_it():
    """A roll of 20 deg that is off by 0.1 deg, and gravity by 1e-3 m/s^2: the filter settles on other angles."""
    roll = Quantity(20.0 * DEG, 0.1 * DEG, parse_unit("rad"), "")
    settings = study(motion=SINE, attitude=Attitude(roll=roll), site=UNCERTAIN)
    result, found, made = assembled(settings)
    told = by_fusion(made, settings, problem(settings), found)
    other = replace(roll, value=roll.value + roll.u)
    by_roll, _, _ = assembled(replace(settings, attitude=Attitude(roll=other)), made)
    turned = estimate(made, problem(replace(settings, attitude=Attitude(roll=other)))).theta - found.theta
    heavier = estimate(made, problem(replace(settings, site=Site(G + 1e-3)))).theta - found.theta
    late = made.t > 2.0
    np.testing.assert_allclose(
        told.by_roll[late] * roll.u, turned[late], rtol=0.02, atol=0.02 * np.ptp(turned)
    )
    own = np.hypot(found.u, heavier)[late]
    np.testing.assert_allclose(told.known_u[late], own, rtol=0.02)
    np.testing.assert_allclose(told.u[late], np.hypot(own, turned[late]), rtol=0.02)
    assert result.result["angle"]["u"]["max"] == pytest.approx(told.u[made.t >= 2.0].max())
    # coefficients move too, all by one error
    moved = by_roll.values - result.values
    assert (result.u >= 0.97 * np.abs(moved)).all()
    share = {item.source: item.share.get("theta", 0.0) for item in result.budget}
    assert share["stated roll"] == pytest.approx(
        np.mean(turned[late] ** 2) / np.mean(told.u[late] ** 2), rel=0.03
    )
    assert share["gravity"] == pytest.approx(
        np.mean(heavier[late] ** 2) / np.mean(told.u[late] ** 2), rel=0.03
    )
    sure = replace(settings, attitude=Attitude(roll=replace(roll, u=0.0)), site=Site(G))
    exact, *_ = assembled(sure, made)
    assert exact.result["angle"]["u"]["max"] == pytest.approx(found.u[made.t >= 2.0].max())


@pytest.mark.parametrize("with_zero_at", [None, Zero(0.0, 4.0, 30.0 * DEG, 0.0)])
def test_an_uncertain_roll_is_in_u_of_the_papers_methods_unless_a_zero_takes_it_out(with_zero_at):
    """theta = atan2(A2, A3 / cos phi): tan theta moves by -tan phi tan theta per radian of phi."""
    roll = Quantity(20.0 * DEG, 0.1 * DEG, parse_unit("rad"), "")
    still = MotionPlan("static", duration=4.0, sample_rate=200.0, first=30.0 * DEG, last=30.0 * DEG)
    settings = study(motion=still, attitude=Attitude(roll=roll), zero=with_zero_at)
    made = simulate(settings, np.random.default_rng(6)).recording
    angles = by_methods(made, settings, Methods(static="complementary"))
    expected = -math.tan(20.0 * DEG) * math.sin(30.0 * DEG) * math.cos(30.0 * DEG)
    if with_zero_at is None:
        np.testing.assert_allclose(angles.by_roll, expected, rtol=5e-3)
    else:
        np.testing.assert_allclose(angles.by_roll, 0.0, atol=5e-3)
    part = np.sqrt(angles.u**2 - angles.known_u**2)
    np.testing.assert_allclose(part, np.abs(angles.by_roll) * roll.u, rtol=1e-6, atol=1e-9)


def test_a_share_says_what_a_better_sensor_would_bring():
    """Halving a variance takes half of its share off, as far as slopes go: less than that is not to be had."""
    settings = scenario("buffet", duration=6.0)
    result, *_ = assembled(settings)
    share = {item.source: item.share.get("b_2", 0.0) for item in result.budget}
    assert share["accelerometer bias"] > 0.8
    for name in ("theta", *result.names):
        assert sum(item.share.get(name, 0.0) for item in result.budget) == pytest.approx(1.0, abs=1e-4)
    better = replace(settings, noise=replace(settings.noise, accelerometer_bias=1e-4 * G * math.sqrt(0.98)))
    other, *_ = assembled(better)
    drop = 1.0 - (other["b_2"].u / result["b_2"].u) ** 2
    assert drop == pytest.approx(0.02 * share["accelerometer bias"], rel=0.05)


def test_gravity_that_is_uncertain_widens_the_biases_as_a_wrong_one_moves_them():
    u_g = 1e-3
    settings = study(motion=SINE, site=Site(G, (GravityInput("gravity", u_g, "m/s^2", 1.0),)))
    result, _, made = assembled(settings)
    off, *_ = assembled(replace(settings, site=Site(G + u_g)), made)
    exact, *_ = assembled(replace(settings, site=Site(G)), made)
    moved = off.values - exact.values
    np.testing.assert_allclose(np.diag(result.common), moved**2, rtol=0.05, atol=1e-3 * result.u.min() ** 2)
    np.testing.assert_allclose(result.covariance, exact.covariance + result.common, rtol=1e-12, atol=0.0)
    assert "gravity" in [item.source for item in result.budget]


def test_contradiction_is_inconsistent_and_named_by_the_most_telling_finding():
    settings = study(motion=SINE)
    made = simulate(settings, np.random.default_rng(2)).recording
    said = [Finding("outlier", "three spikes"), Finding("sign_suspect", "the gyro is reversed")]
    result, found, _ = assembled(settings, replace(made, gyro=-made.gyro), said)
    assert found.nis_mean > 2.0
    assert result.status is Status.INCONSISTENT
    assert "the gyro is reversed" in result.message
    assert "spikes" not in result.message


def test_a_low_nis_is_sound(sound):
    result, found, _ = sound
    assert found.nis_mean < 0.5
    assert result.status is Status.OK


def test_a_coefficient_at_its_prior_is_one_finding_and_no_bad_status():
    """At rest nothing tells positions, scale or the gyro's bias beyond its noise."""
    result, *_ = assembled(study(motion=MotionPlan("static", duration=4.0, first=0.1, last=0.1)))
    left = [each for each in result.findings if each.code == "at_prior"]
    assert len(left) == 1
    assert all(name in left[0].message for name in ("dr_1", "zo_2", "k_g"))
    assert result.status is Status.OK


def test_too_few_angles_are_no_result():
    settings = study(motion=replace(SINE, duration=2.0))
    made = simulate(settings, np.random.default_rng(2)).recording
    acc = made.acc.copy()
    acc[500:] = np.nan
    blind = replace(made, acc=acc, gyro=np.where(np.arange(2000) < 500, made.gyro, np.nan))
    result, *_ = assembled(settings, blind)
    assert result.status is Status.NOT_CONVERGED
    assert result.names == ()
    json.dumps(to_json(result), allow_nan=False)


def test_starts_after_gaps_are_no_loss_of_the_angle():
    settings = study(motion=replace(SINE, duration=8.0))
    made = simulate(settings, np.random.default_rng(2)).recording
    kept = np.flatnonzero((made.t % 2.0) < 1.4)
    gaps = replace(
        made, t=made.t[kept], acc=made.acc[kept], gyro=made.gyro[kept], turns=made.turns[kept],
        zero_angle=made.zero_angle[kept], reference=made.reference[kept], point=None,
    )  # fmt: skip
    result, found, _ = assembled(settings, gaps)
    assert len(found.starts) == 4
    assert result.status is Status.OK


def test_the_cost_of_a_common_delay_is_the_rate_times_it():
    """theta' = 10 deg 2 pi cos, so that 0.5 ms costs 0.0314 deg at most, and that over sqrt 2 rms."""
    result, *_ = assembled(study(motion=SINE, timing=Timing(common_delay=5e-4, common_delay_u=1e-4)))
    timing = result.result["timing"]
    assert timing["cost"]["max"] == pytest.approx(5e-4 * 10 * DEG * 2 * math.pi, rel=0.02)
    assert timing["cost"]["rms"] == pytest.approx(5e-4 * 10 * DEG * 2 * math.pi / math.sqrt(2), rel=0.02)
    assert timing["cost_u"]["max"] == pytest.approx(0.2 * timing["cost"]["max"])


def test_errors_against_a_reference_are_told_in_degrees():
    settings = study(motion=SINE)
    made = simulate(settings, np.random.default_rng(3)).recording
    off = Angles(
        "by hand", made.reference + 0.01 * DEG, np.full(6000, 0.01 * DEG), np.zeros(6000), np.zeros(6000)
    )
    found = estimate(made, problem(settings))
    own = Angles("fusion 19", found.theta, found.u, found.rate, found.rate_u)
    judged = {each.method: errors(made, each) for each in (own, off)}
    result, *_ = assembled(settings, made, errors=judged, compared={"by hand": off})
    assert result.result["reference"]["max_abs_deg"] == pytest.approx(
        np.degrees(np.abs(found.theta - made.reference)[2000:].max())
    )
    told = result.result["compare"]["by hand"]
    for key in ("max_abs_deg", "rms_deg", "mean_deg"):
        assert told["reference"][key] == pytest.approx(0.01, rel=1e-6)


def test_a_paper_method_has_angles_and_no_coefficients():
    settings = study(motion=SINE)
    made = simulate(settings, np.random.default_rng(3)).recording
    u = np.full(6000, 0.01 * DEG)
    angles = Angles("improved, mechanical, dual", made.reference, u, made.gyro, u)
    result = assemble_angles(made, settings, angles, [], None)
    assert result.status is Status.OK
    assert result.names == ()
    assert result.covariance.shape == (0, 0)
    assert result.result["method"] == "improved, mechanical, dual"
    assert result.result["angle"]["u"]["median"] == pytest.approx(0.01 * DEG)
    assert "yaw" in result.model
    none = replace(angles, theta=np.full(6000, np.nan))
    assert assemble_angles(made, settings, none, [], None).status is Status.NOT_CONVERGED


def test_a_zero_lowers_u_of_the_angle():
    """One angle known to 0.001 deg fixes what the biases do at it."""
    settings = study(
        motion=MotionPlan("static", duration=4.0, first=0.1, last=0.1), estimator=Estimator(19, True)
    )
    plain, *_ = assembled(settings)
    zeroed = replace(settings, zero=Zero(0.5, 3.5, 0.1, 0.001 * DEG))
    made = simulate(zeroed, np.random.default_rng(3)).recording
    result, *_ = assembled(zeroed, with_zero(made, zeroed))
    assert result.result["angle"]["u"]["median"] < 0.5 * plain.result["angle"]["u"]["median"]
    share = {item.source: item.share.get("theta", 0.0) for item in result.budget}
    assert share["stated zero"] > 0.0


def test_parts_of_priors_and_gravity_by_the_pass_are_those_of_runs_with_larger_ones():
    """P_s = P Pi^-1 Pi_s Pi^-1 P of constants, against q_s dP/dq_s of the filter run again for each; and gravity off
    by its uncertainty."""
    settings = replace(study(motion=SINE), site=UNCERTAIN)
    recording = simulate(settings, np.random.default_rng(3)).recording
    of, answered = problem(settings), np.ones(len(recording.t), dtype=bool)
    found = estimate(recording, of)
    by_pass = pass_of(recording, of, settings, found)
    quick = parts(recording, of, settings, False, answered, found, by_pass).budget
    slow = parts(recording, of, settings, False, answered).budget
    assert [item.source for item in quick] == [item.source for item in slow]
    for one, other in zip(quick, slow, strict=True):
        for name in {*one.share, *other.share}:
            assert one.share.get(name, 0.0) == pytest.approx(other.share.get(name, 0.0), abs=3e-3)
