"""Repeat runs: what averages out, what does not, and what changes in between."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding, Status
from inercal.foundation.inputs import Source
from inercal.foundation.results.basis import Basis
from inercal.foundation.results.budget import BudgetItem
from inercal.foundation.results.files import from_json, to_json
from inercal.foundation.results.repeat import combine_runs, mandel_paule
from inercal.foundation.results.result import Estimate


def run_of(values, own, elsewhere=None, dof=30.0, **more) -> Estimate:
    """A run with independent type A variances (p,) and a type B covariance (p, p)."""
    p = len(values)
    shared = np.zeros((p, p)) if elsewhere is None else np.asarray(elsewhere, dtype=float)
    names = ("K0_x", "K0_y", "K1_x")[:p]
    return Estimate(
        "calibrate imu", names, ("count",) * p, np.asarray(values, dtype=float), np.diag(own) + shared,
        np.full(p, dof), Status.OK, "", common=shared, **more,
    )  # fmt: skip


def test_the_rule_of_mandel_and_paule_against_its_definition():
    """With the variance found, the weighted sum of squares equals its degrees of freedom."""
    x, variances = np.array([1.0, 1.3, 0.7, 1.9]), np.array([0.01, 0.02, 0.01, 0.05])
    found = mandel_paule(x, variances, np.full(4, np.inf))
    weights = 1.0 / (variances + found.between)
    mean = weights @ x / weights.sum()
    assert weights @ (x - mean) ** 2 == pytest.approx(3.0, rel=1e-8)
    np.testing.assert_allclose(found.weights, weights / weights.sum(), rtol=1e-8)


def test_equal_variances_have_a_closed_form():
    """s^2 - sigma^2: the variance of the values less that of each."""
    x = np.array([1.0, 2.0, 4.0, 4.5, 7.0])
    found = mandel_paule(x, np.full(5, 0.25), np.full(5, np.inf))
    assert found.between == pytest.approx(np.var(x, ddof=1) - 0.25, rel=1e-8)
    np.testing.assert_allclose(found.weights, 0.2, rtol=1e-8)


def test_runs_that_agree_are_averaged_by_their_weights():
    """Values apart by less than their u: the weighted mean and its u of textbooks, no change between runs."""
    found = combine_runs([run_of([1.00], [0.04]), run_of([1.02], [0.01]), run_of([0.99], [0.04])])
    weights = np.array([25.0, 100.0, 25.0])
    assert found["K0_x"].value == pytest.approx(weights @ [1.0, 1.02, 0.99] / 150.0)
    assert found["K0_x"].u == pytest.approx(1.0 / np.sqrt(150.0))
    assert found.result["between"]["K0_x"]["s"] == 0.0
    assert found["K0_x"].dof > 30
    assert found.status is Status.OK
    assert found.findings == ()


def test_what_comes_from_elsewhere_does_not_average_out():
    """Gravity is the same error in all runs; the scatter goes down with their number."""
    elsewhere = np.array([[4.0, 2.0], [2.0, 1.0]])
    runs = [run_of([0.0, 0.0], [1.0, 1.0], elsewhere) for _ in range(4)]
    found = combine_runs(runs)
    np.testing.assert_allclose(found.covariance, elsewhere + np.eye(2) / 4.0, rtol=1e-9)
    np.testing.assert_allclose(found.common, elsewhere)


def test_a_coefficient_that_changes_between_runs_says_so_and_has_few_degrees_of_freedom():
    steady, turned_on = [5.0, 5.01, 4.99], [1.0, 2.0, 4.0]
    runs = [run_of([a, b], [1e-4, 1e-4]) for a, b in zip(steady, turned_on, strict=True)]
    found = combine_runs(runs)
    assert found["K0_y"].u == pytest.approx(np.std(turned_on, ddof=1) / np.sqrt(3.0), rel=1e-3)
    assert found["K0_y"].dof == pytest.approx(2.0)
    assert found["K0_x"].dof > 10
    (finding,) = found.findings
    assert finding.code == "between_runs"
    assert finding.message.startswith("K0_y changes from run to run, standard deviation 1.5")


@given(st.permutations(range(4)), st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_the_order_of_runs_does_not_matter(order, seed):
    rng = np.random.default_rng(seed)
    runs = [run_of(rng.normal(0, 1, 2), rng.uniform(0.1, 2.0, 2)) for _ in range(4)]
    a, b = combine_runs(runs), combine_runs([runs[k] for k in order])
    np.testing.assert_allclose(a.values, b.values, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(a.covariance, b.covariance, rtol=1e-6, atol=1e-12)
    np.testing.assert_allclose(a.dof, b.dof, rtol=1e-5)


@given(st.floats(1e-6, 1e6), st.integers(0, 2**32 - 1))
@settings(max_examples=20, deadline=None)
def test_another_unit_scales_values_and_uncertainties(factor, seed):
    rng = np.random.default_rng(seed)
    x, v = rng.normal(0, 1, (3, 1)), rng.uniform(0.1, 2.0, (3, 1))
    a = combine_runs([run_of(x[k], v[k]) for k in range(3)])
    b = combine_runs([run_of(factor * x[k], factor**2 * v[k]) for k in range(3)])
    assert b["K0_x"].value == pytest.approx(factor * a["K0_x"].value, rel=1e-6, abs=1e-9 * factor)
    assert b["K0_x"].u == pytest.approx(factor * a["K0_x"].u, rel=1e-6)


@pytest.mark.parametrize(
    ("runs", "change", "low", "high"),
    [
        (4, 0.0, 0.93, 0.985),
        (4, 1.0, 0.90, 0.97),
        (2, 2.0, 0.835, 0.98),
        *(
            pytest.param(*each, marks=pytest.mark.campaign)
            for each in ((4, 5.0, 0.92, 0.97), (3, 2.0, 0.90, 0.97))
        ),
    ],
)
def test_intervals_of_a_few_runs_cover_the_truth(runs, change, low, high):
    """2000 sets of runs with a common error from elsewhere; limits hold 95 % and the docstring's band with
    4.5 standard deviations of the count (0.005 each)."""
    rng = np.random.default_rng(20261121)
    hits = 0
    for _ in range(2000):
        own = rng.uniform(0.5, 2.0, runs)
        common = rng.normal(0.0, 0.3)
        x = common + rng.normal(0.0, np.sqrt(own + change**2))
        stated = own * rng.chisquare(30, runs) / 30
        found = combine_runs([run_of([x[k]], [stated[k]], [[0.09]]) for k in range(runs)])
        inside = found["K0_x"].interval(0.95)
        hits += inside[0] < 0.0 < inside[1]
    assert low < hits / 2000 < high


def test_exact_runs_have_no_within_run_scatter_and_stay_finite():
    same = combine_runs([run_of([1.0], [0.0]), run_of([1.0], [0.0])])
    assert same["K0_x"].value == 1.0
    assert same["K0_x"].u == pytest.approx(0.0, abs=1e-12)
    apart = combine_runs([run_of([1.0], [0.0]), run_of([3.0], [0.0])])
    assert apart["K0_x"].u == pytest.approx(1.0, rel=1e-6)
    assert np.isfinite(apart.dof).all()


def test_a_bad_run_is_left_out_and_gives_the_verdict():
    bad = Estimate.without(
        Basis("calibrate imu", inputs=(Source("b.csv", "0"),)), Status.TOO_FEW_INTERVALS, "found 3"
    )
    found = combine_runs([run_of([1.0], [0.01]), bad, run_of([1.2], [0.01])])
    assert found["K0_x"].value == pytest.approx(1.1)
    assert found.status is Status.TOO_FEW_INTERVALS
    assert found.message == "1 coefficient from 2 runs; run 2 (b.csv) is left out: found 3"
    alone = combine_runs([run_of([1.0], [0.01]), bad])
    assert alone.status is Status.TOO_FEW_INTERVALS
    assert alone.message.startswith("run 2 (b.csv): found 3")


def test_a_change_between_runs_is_claimed_by_chance_no_more_often_than_said():
    """4000 sets of six runs without any change, variances of eight degrees of freedom each: a probability below 2 %
    in 2 % of them, give or take 4.5 standard deviations (1 %)."""
    rng = np.random.default_rng(20261121)
    said = 0
    for _ in range(4000):
        true = rng.uniform(0.5, 2.0, 6)
        found = mandel_paule(rng.normal(0.0, np.sqrt(true)), true * rng.chisquare(8, 6) / 8, np.full(6, 8.0))
        said += found.probability < 0.02
    assert 0.01 < said / 4000 < 0.03


def test_runs_of_another_kind_are_refused():
    with pytest.raises(InputError, match=r"run 2: found 2 coefficients, .* expected 1 coefficient,"):
        combine_runs([run_of([1.0], [1.0]), run_of([1.0, 2.0], [1.0, 1.0])])


def test_findings_and_results_that_runs_share_are_said_once():
    shared, own = Finding("gap", "t: 1 gap", "row 5"), Finding("nan", "acc_x: 2 missing values", "rows 3, 9")
    result = {"unit": {"acc": "count"}, "intervals": 3}
    a = run_of([1.0], [1.0], findings=(shared,), result=result)
    b = run_of([1.0], [1.0], findings=(shared, own), result=result | {"intervals": 4})
    found = combine_runs([a, b])
    assert found.findings == (shared, replace(own, where="run 2, rows 3, 9"))
    assert found.result["unit"] == {"acc": "count"}
    assert "intervals" not in found.result
    assert [row["status"] for row in found.result["runs"]] == ["ok", "ok"]


def test_the_budget_adds_up():
    """Of a variance of 1.09 in each run, 0.09 is gravity's and 0.3 that of an alignment that is set up anew."""
    gravity = BudgetItem("gravity", "B", 0.3, "m/s^2", {"K0_x": 0.09 / 1.09})
    alignment = BudgetItem("alignment", "B", 0.01, "rad", {"K0_x": 0.3 / 1.09}, redrawn=True)
    runs = [run_of([x], [1.0], [[0.09]], budget=(gravity, alignment)) for x in (0.0, 3.0, 5.0)]
    found = combine_runs(runs)
    assert sum(part.share.get("K0_x", 0.0) for part in found.budget) == pytest.approx(1.0)
    assert [part.source for part in found.budget] == [
        "scatter within the runs", "changes between the runs", "gravity",
    ]  # fmt: skip


def test_a_source_of_one_run_alone_is_in_the_budget():
    """Gravity in both, a tilt that the first run excludes and the second does not."""
    gravity = BudgetItem("gravity", "B", 0.3, "m/s^2", {"K0_x": 0.09 / 1.09})
    tilt = BudgetItem("a tilt of the base, not excluded", "B", 1.0, "1", {"K0_x": 0.36 / 1.45})
    runs = [
        run_of([0.0], [1.0], [[0.09]], budget=(gravity,)),
        run_of([1.0], [1.0], [[0.45]], budget=(replace(gravity, share={"K0_x": 0.09 / 1.45}), tilt)),
    ]
    found = combine_runs(runs)
    assert sum(part.share.get("K0_x", 0.0) for part in found.budget) == pytest.approx(1.0)
    assert [part.source for part in found.budget][2:] == ["gravity", tilt.source]


def test_the_part_from_elsewhere_survives_the_file():
    found = combine_runs([run_of([1.0], [1.0], [[0.25]]), run_of([2.0], [1.0], [[0.25]])])
    again = from_json(to_json(found))
    np.testing.assert_array_equal(again.common, found.common)


def test_runs_of_different_instruments_are_said_to_be():
    """Scale factors of 0.5 % and misalignments of 5 mrad from run to run; either alone may be one instrument."""
    rng = np.random.default_rng(21)
    names = ("K1_x", "K1_y", "K1_z", "M_xy", "M_xz", "M_yz")
    units = ("count/(m/s^2)",) * 3 + ("rad",) * 3

    def codes(scale, angle):
        runs = []
        for _ in range(5):
            values = np.concatenate([400.0 * (1 + scale * rng.normal(size=3)), angle * rng.normal(size=3)])
            own = np.array([0.02] * 3 + [1e-4] * 3) ** 2
            runs.append(replace(run_of(values, own), names=names, units=units))
        combined = combine_runs(runs)
        return {finding.code for finding in combined.findings}, combined.status

    found, status = codes(5e-3, 5e-3)
    assert "several_instruments" in found
    assert status is Status.SUSPECT
    for one in (codes(5e-3, 0.0), codes(0.0, 5e-3), codes(1e-4, 1e-4)):
        assert "several_instruments" not in one[0]
