"""Run to run: differences are as uncertain as they scatter, what is common cancels, and the verdict seldom errs."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from inercal.foundation.errors import InputError
from inercal.foundation.findings import Status
from inercal.foundation.inputs import Source
from inercal.foundation.results.budget import BudgetItem
from inercal.foundation.results.compare import Saved, compare
from inercal.foundation.results.files import load, save
from inercal.foundation.results.limits import LIMITS
from inercal.foundation.results.result import Estimate, coverage_factor

SITE = {"site": {"gravity_m_s2": 9.81, "latitude_rad": None}}


def calibration(values, covariance, dof=np.inf, names=None, units=None, where="a.json", **more):
    """A saved calibration; ``covariance`` may be given as standard uncertainties."""
    values, covariance = np.atleast_1d(np.asarray(values, float)), np.asarray(covariance, float)
    p = len(values)
    covariance = covariance if covariance.ndim == 2 else np.diag(np.broadcast_to(covariance, p) ** 2)
    dof = np.broadcast_to(np.asarray(dof, float), p).copy()
    settings = {"status": Status.OK, "message": "fine", "conditions": SITE} | more
    names = tuple(names or (f"c{k}" for k in range(p)))
    units = tuple(units or ("1",) * p)
    return Saved(Estimate("calibrate imu", names, units, values, covariance, dof, **settings), where)


def scaled_by(source, u, fraction, values, covariance):
    """A budget line of a source that is part of ``covariance`` and changes every value by a fraction of itself."""
    share = (fraction * np.asarray(values)) ** 2 / np.diag(covariance)
    return BudgetItem(source, "B", u, "m/s^2", {f"c{k}": float(part) for k, part in enumerate(share)})


# Closed forms.


def test_one_coefficient():
    found = compare(calibration(5.0, [0.3]), calibration(6.0, [0.4], where="b.json"))
    row = found.result["coefficients"][0]
    assert found.values[0] == pytest.approx(1.0)
    assert found.u[0] == pytest.approx(0.5)
    assert row["z"] == pytest.approx(2.0)
    assert row["normalised_error"] == pytest.approx(1.0 / (coverage_factor(np.inf) * 0.5))
    assert row["probability"] == pytest.approx(2.0 * stats.norm.sf(2.0))
    assert found.statistics["chi2"] == pytest.approx(4.0)
    assert found.statistics["probability"] == pytest.approx(stats.chi2.sf(4.0, 1))


def test_degrees_of_freedom_are_those_of_welch():
    """Two means of normal samples: Welch's t test is the same comparison."""
    rng = np.random.default_rng(4)
    a, b = rng.normal(0.0, 1.0, 7), rng.normal(1.0, 3.0, 12)
    saved = [
        calibration(x.mean(), [x.std(ddof=1) / np.sqrt(len(x))], len(x) - 1, where=where)
        for x, where in ((a, "a.json"), (b, "b.json"))
    ]
    found = compare(*saved)
    expected = stats.ttest_ind(b, a, equal_var=False)
    assert found.result["coefficients"][0]["z"] == pytest.approx(expected.statistic)
    assert found.dof[0] == pytest.approx(expected.df)
    assert found.result["coefficients"][0]["probability"] == pytest.approx(expected.pvalue)


def covariances(rng, p):
    root = rng.normal(size=(p, p)) * np.geomspace(1e-5, 10.0, p)[:, None]
    return root @ root.T


def test_the_joint_sum_uses_the_whole_covariance():
    rng = np.random.default_rng(8)
    first, second = covariances(rng, 5), covariances(rng, 5)
    d = rng.multivariate_normal(np.zeros(5), first + second, method="cholesky")
    found = compare(calibration(np.zeros(5), first), calibration(d, second, where="b.json"))
    expected = d @ np.linalg.solve(first + second, d)
    assert found.statistics["chi2"] == pytest.approx(expected, rel=1e-6)
    assert found.statistics["dof"] == 5
    assert found.statistics["probability"] == pytest.approx(stats.chi2.sf(expected, 5), rel=1e-6)


def test_a_coefficient_that_repeats_another_adds_nothing():
    """Where the covariance is singular, the sum is over the combinations that can differ."""
    once = compare(calibration([1.0], [0.1]), calibration([1.3], [0.1], where="b.json"))
    covariance = 0.01 * np.outer([1.0, 1e3], [1.0, 1e3])
    twice = compare(
        calibration([1.0, 5e3], covariance), calibration([1.3, 5.3e3], covariance, where="b.json")
    )
    assert twice.statistics["dof"] == 1
    assert twice.statistics["chi2"] == pytest.approx(once.statistics["chi2"])


def test_together_they_may_differ_where_none_does_alone():
    """Two strongly correlated differences of opposite sign, each 1.2 u."""
    covariance = 0.5 * np.array([[1.0, 0.99], [0.99, 1.0]])
    found = compare(calibration([0.0, 0.0], covariance), calibration([1.2, -1.2], covariance, where="b.json"))
    assert not any(row["moved"] for row in found.result["coefficients"])
    assert found.status is Status.INCONSISTENT
    assert found.statistics["probability"] == pytest.approx(stats.chi2.sf(2.0 * 1.2**2 / 0.01, 2))
    assert "c0 - 1.00 c1" in found.message


# Laws.


@settings(deadline=None, max_examples=25)
@given(st.integers(1, 6), st.integers(0, 2**32 - 1), st.sampled_from([np.inf, 7.0]))
def test_exchanging_the_files_changes_signs_only(p, seed, dof):
    rng = np.random.default_rng(seed)
    a = calibration(rng.normal(size=p), covariances(rng, p), dof)
    b = calibration(rng.normal(size=p), covariances(rng, p), 12.0, where="b.json")
    there, back = compare(a, b), compare(b, a)
    np.testing.assert_allclose(back.values, -there.values)
    np.testing.assert_allclose(back.covariance, there.covariance)
    np.testing.assert_allclose(back.dof, there.dof)
    assert back.statistics == pytest.approx(there.statistics)
    assert back.status is there.status


def test_a_calibration_does_not_differ_from_itself():
    rng = np.random.default_rng(2)
    values, covariance = rng.normal(size=4), covariances(rng, 4)
    a = calibration(values, covariance, inputs=(Source("log.csv", "ab"), Source("imu.toml", "cd")))
    found = compare(a, a)
    assert not found.values.any()
    assert found.statistics["chi2"] == 0.0
    assert found.statistics["probability"] == 1.0
    assert found.status is Status.OK
    assert "same_recording" in [finding.code for finding in found.findings]


def test_a_study_that_is_used_again_is_no_recording():
    a = calibration([1.0], [0.1], inputs=(Source("log1.csv", "ab"), Source("imu.toml", "cd")))
    b = calibration([1.0], [0.1], inputs=(Source("log2.csv", "ef"), Source("imu.toml", "cd")), where="b.json")
    assert compare(a, b).findings == ()


# Statistics: what is said of differences holds where nothing moved.


def test_differences_scatter_as_stated_with_and_without_a_common_source():
    """Scale factors of two runs share the error of gravity: z has unit variance, and would be far below if the
    common part stayed in."""
    rng = np.random.default_rng(20)
    truth, u_gravity, noise, runs = np.array([400.0, -410.0, 0.3]), 0.01, np.array([0.2, 0.3, 0.1]), 500
    z = {"same site": [], "another site": []}
    for _ in range(runs):
        by_gravity = 1.0 + u_gravity / 9.81 * rng.normal()
        saved = []
        for where in ("a.json", "b.json"):
            values = truth * by_gravity + noise * rng.normal(size=3)
            common = u_gravity / 9.81 * values
            covariance = np.diag(noise**2) + np.outer(common, common)
            budget = (scaled_by("gravity", u_gravity, u_gravity / 9.81, values, covariance),)
            saved.append(calibration(values, covariance, where=where, budget=budget))
        here = compare(*saved)
        assert here.result["common_sources"] == ["gravity"]
        z["same site"].append([row["z"] for row in here.result["coefficients"]])
        elsewhere = {"site": {"gravity_m_s2": 9.82, "latitude_rad": None}}
        other = replace(saved[1], estimate=replace(saved[1].estimate, conditions=elsewhere))
        there = compare(saved[0], other)
        assert there.result["common_sources"] == []
        z["another site"].append([row["z"] for row in there.result["coefficients"]])
    square = np.mean(np.square(z["same site"]), axis=0)
    np.testing.assert_allclose(square, 1.0, atol=5.0 * np.sqrt(2.0 / runs))
    # of the same noise, with the error of gravity counted as if it differed
    expected = noise**2 / (noise**2 + (u_gravity / 9.81 * truth) ** 2)
    np.testing.assert_allclose(np.mean(np.square(z["another site"]), axis=0), expected, rtol=0.35)


def test_what_is_common_leaves_the_joint_sum_a_chi_square():
    rng = np.random.default_rng(21)
    truth, fraction, runs = np.array([400.0, -410.0, 405.0, 2.0]), 1e-2, 400
    sums = []
    for _ in range(runs):
        by_gravity = 1.0 + fraction * rng.normal()
        saved = []
        for where in ("a.json", "b.json"):
            values = truth * by_gravity + rng.normal(size=4)
            covariance = np.eye(4) + np.outer(fraction * values, fraction * values)
            budget = (scaled_by("gravity", 0.1, fraction, values, covariance),)
            saved.append(calibration(values, covariance, where=where, budget=budget))
        sums.append(compare(*saved).statistics["chi2"])
    assert np.mean(sums) == pytest.approx(4.0, abs=5.0 * np.sqrt(8.0 / runs))
    assert stats.kstest(sums, stats.chi2(4).cdf).pvalue > 1e-4


@pytest.mark.parametrize("dof", [np.inf, 6.0])
def test_where_nothing_moved_the_verdict_is_wrong_in_five_percent_at_most(dof):
    rng = np.random.default_rng(22)
    shape, runs, wrong, beyond = covariances(rng, 8), 600, 0, 0
    for _ in range(runs):
        saved = []
        for where in ("a.json", "b.json"):
            size = 1.0 if np.isinf(dof) else rng.chisquare(dof) / dof
            values = rng.multivariate_normal(np.zeros(8), shape, method="svd")
            saved.append(calibration(values, size * shape, dof, where=where))
        found = compare(*saved)
        wrong += found.status is not Status.OK
        beyond += sum(row["normalised_error"] > 1.0 for row in found.result["coefficients"])
    assert wrong / runs < LIMITS.moved_risk + 4.0 * np.sqrt(
        LIMITS.moved_risk * (1.0 - LIMITS.moved_risk) / runs
    )
    # E_n alone would be wrong far more often: 4.55 % of the time for each of eight coefficients
    assert beyond / runs > 2.0 * LIMITS.moved_risk


def test_a_coefficient_that_moved_is_named():
    u = np.full(20, 0.1)
    values = np.zeros(20)
    values[7] = 1.0
    found = compare(calibration(np.zeros(20), u), calibration(values, u, where="b.json"))
    assert found.status is Status.INCONSISTENT
    assert [row["name"] for row in found.result["coefficients"] if row["moved"]] == ["c7"]
    assert "c7 (E_n 3.5)" in found.message


# What is taken as common.


def pair(source="gravity", ratio=1.0, u=0.01, **second):
    """Two calibrations with one source in proportion to the coefficients, in the second by ``ratio`` as much."""
    values, saved = np.array([400.0, -3.0]), []
    for where, factor, more in (("a.json", 1.0, {}), ("b.json", ratio, second)):
        by_source = 1e-3 * factor * values
        covariance = np.eye(2) * 0.01 + np.outer(by_source, by_source)
        budget = (scaled_by(source, u, 1e-3 * factor, values, covariance),)
        saved.append(calibration(values, covariance, where=where, budget=budget, **more))
    return saved


@pytest.mark.parametrize("source", ["gravity", "gravity anomaly", "latitude", "height", "time base"])
def test_gravity_and_time_base_cancel(source):
    found = compare(*pair(source))
    assert found.result["common_sources"] == [source]
    np.testing.assert_allclose(found.covariance, 0.02 * np.eye(2), atol=1e-12)
    assert found.findings == ()


@pytest.mark.parametrize(
    "saved",
    [
        pair("dphi_x"),
        pair("latitude", ratio=1.1),
        pair("gravity", conditions={}),
        pair("gravity", conditions={"site": {"gravity_m_s2": 9.81, "latitude_rad": 0.7}}),
    ],
    ids=["table", "not in proportion", "no site", "another latitude"],
)
def test_what_is_not_known_to_act_alike_is_taken_as_independent_and_said(saved):
    found = compare(*saved)
    assert found.result["common_sources"] == []
    np.testing.assert_allclose(found.covariance, saved[0].estimate.covariance + saved[1].estimate.covariance)
    assert [finding.code for finding in found.findings] == ["perhaps_common"]


def test_another_instrument_has_another_clock():
    a, b = pair("time base")
    for first, second, common in (("1", "1", True), ("1", "2", False), ("1", "", True)):
        saved = [
            replace(each, estimate=replace(each.estimate, traceability={"instrument": name}))
            for each, name in ((a, first), (b, second))
        ]
        found = compare(*saved)
        assert found.result["common_sources"] == (["time base"] if common else [])
        assert any(finding.code == "other_model" for finding in found.findings) is (not common)


# Units, and files that do not go together.


@pytest.mark.parametrize(
    ("unit", "other", "factor"),
    [
        ("m/s^2", "g", 9.80665),
        ("(deg/s)/(m/s^2)", "(rad/s)/(m/s^2)", np.degrees(1.0)),
        ("V/(rad/s)", "mV/(rad/s)", 1e-3),
        ("count/(m/s^2)", "count/(m/s^2)", 1.0),
        ("1/(m/s^2)^2", "1/(m/s^2)^2", 1.0),
    ],
)
def test_units_of_one_dimension_are_converted(unit, other, factor):
    a = calibration([2.0], [0.1], units=[unit])
    b = calibration([2.0 / factor], [0.1 / factor], units=[other], where="b.json")
    found = compare(a, b)
    assert found.units == (unit,)
    assert found.values[0] == pytest.approx(0.0, abs=1e-12)
    assert found.u[0] == pytest.approx(0.1 * np.sqrt(2.0))


@pytest.mark.parametrize(
    ("unit", "other"),
    [
        ("m/s^2", "count"),
        ("count/(m/s^2)", "count/(rad/s)"),
        ("rad", "rad/s"),
        ("furlong", "count"),
        ("g", ""),
    ],
)
def test_other_units_name_the_coefficient(unit, other):
    a, b = (
        calibration([1.0], [1.0], names=["K0_x"], units=[text], where=where)
        for text, where in ((unit, "a.json"), (other, "b.json"))
    )
    with pytest.raises(InputError, match=r"b\.json: K0_x is in") as error:
        compare(a, b)
    assert f"a unit like {unit}" in str(error.value)


def test_what_is_no_calibration_is_refused():
    good = calibration([1.0], [0.1])
    itself = replace(good, estimate=compare(good, good))
    with pytest.raises(InputError, match="is a comparison itself"):
        compare(good, itself)
    with pytest.raises(InputError, match="holds no coefficients"):
        compare(calibration([], []), good)
    with pytest.raises(InputError, match=r"no coefficient in common with a\.json"):
        compare(good, calibration([1.0], [0.1], names=["K1_x"], where="b.json"))
    for values, u, dof in (([np.nan], [0.1], 3.0), ([1.0], [np.nan], 3.0), ([1.0], [0.1], 0.0)):
        bad = replace(good.estimate, values=np.array(values), covariance=np.diag(u), dof=np.array([dof]))
        with pytest.raises(InputError, match=r"b\.json: c0 is without"):
            compare(good, Saved(bad, "b.json"))


def test_coefficients_in_one_file_only_are_listed_and_verdicts_said():
    a = calibration([1.0, 2.0], [0.1, 0.1], names=["K1_x", "K1_y"])
    b = calibration(
        [2.0, 3.0], [0.1, 0.1], names=["K1_y", "K1_z"], where="b.json", status=Status.ILL_CONDITIONED
    )
    found = compare(a, b)
    assert found.names == ("K1_y",)
    assert found.result["only_in_first"] == ["K1_x"]
    assert found.result["only_in_second"] == ["K1_z"]
    assert [(finding.code, finding.where) for finding in found.findings] == [("bad_verdict", "b.json")]


@pytest.mark.parametrize(("second", "status"), [(1.0, Status.OK), (1.5, Status.INCONSISTENT)])
def test_coefficients_without_uncertainty_are_equal_or_not(second, status):
    found = compare(calibration([1.0, 3.0], [0.0, 0.1]), calibration([second, 3.0], [0.0, 0.1], where="b"))
    assert found.status is status
    assert found.statistics["dof"] == 1


@pytest.mark.parametrize("suffix", ["json", "toml"])
def test_a_comparison_is_saved_and_read_back(suffix, tmp_path):
    found = compare(*pair())
    save(found, tmp_path / f"drift.{suffix}")
    again = load(tmp_path / f"drift.{suffix}")
    assert again.names == found.names
    np.testing.assert_array_equal(again.values, found.values)
    np.testing.assert_array_equal(again.covariance, found.covariance)
    assert again.result["common_sources"] == ["gravity"]
