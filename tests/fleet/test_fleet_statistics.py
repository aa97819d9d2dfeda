"""What a fleet says as a whole: yield, capability, trends, and units unlike the others."""

import numpy as np
import pytest
from scipy.stats import binom, binomtest

from inercal.laboratory.fleet.fleet import Share, distances, fleet_of, limit, spreads
from inercal.laboratory.fleet.unit import Coefficient, UnitRow
from inercal.laboratory.limits import LIMITS
from inercal.laboratory.specification import specification_of


def rows_of(values, status="ok", **more):
    """Rows of units with coefficients K1_x.. of the given values (n, p)."""
    return [
        UnitRow(
            f"{k}",
            status,
            "",
            (),
            tuple(Coefficient(f"K1_{i}", float(v), 0.1, 0.2, np.inf, "m") for i, v in enumerate(row)),
            **more,
        )
        for k, row in enumerate(values)
    ]


def specification(**limits):
    return specification_of({"decision": "simple acceptance", **limits}, "study")


@pytest.mark.parametrize(("good", "every"), [(0, 10), (10, 10), (27, 30), (4999, 5000)])
def test_the_interval_of_the_yield_is_that_of_scipy(good, every):
    theirs = binomtest(good, every).proportion_ci(0.95, method="exact")
    assert Share(good, every).interval == pytest.approx((theirs.low, theirs.high), abs=1e-12)


def test_intervals_of_capability_hold_the_truth_as_often_as_they_say():
    """2000 fleets of 50 units: Cp 2.0 and Cpk 1.5 are inside in 95 %; Bissell's interval is approximate."""
    rng = np.random.default_rng(20261123)
    fleets, inside = 2000, np.zeros(2)
    given = specification(K1_0=["-6 m", "6 m"])
    for _ in range(fleets):
        (spread,) = spreads(rows_of(1.5 + rng.standard_normal((50, 1))), given)
        for i, (index, true) in enumerate(((spread.Cp, 2.0), (spread.Cpk, 1.5))):
            inside[i] += index.low <= true <= index.high
    low, high = binom.ppf([0.0005, 0.9995], fleets, 0.95)
    assert low <= inside[0] <= high
    assert low - 0.01 * fleets <= inside[1] <= high + 0.01 * fleets


@pytest.mark.parametrize(("units", "coefficients"), [(12, 6), (30, 9), (100, 12)])
def test_a_sound_fleet_has_no_strange_unit(units, coefficients):
    """Whatever the correlations of the coefficients, in all but one of twenty fleets."""
    rng = np.random.default_rng(4)
    mixed = rng.standard_normal((coefficients, coefficients))
    fleets = 200
    named = sum(
        distances(rng.standard_normal((units, coefficients)) @ mixed).max() > limit(units, coefficients)
        for _ in range(fleets)
    )
    # the limit itself is a quantile of 200 simulated fleets: as uncertain as this share of 200
    assert named <= binom.ppf(0.999, fleets, LIMITS.strange_risk) + 3.1 * np.sqrt(
        fleets * LIMITS.strange_risk
    )


def test_a_unit_off_along_no_single_coefficient_is_found():
    """Two coefficients that go together in all units but one, which is within the range of each."""
    rng = np.random.default_rng(5)
    common = rng.standard_normal(60)
    values = np.stack([common, common], axis=1) + 0.05 * rng.standard_normal((60, 2))
    values[7] = [1.0, -1.0]
    fleet = fleet_of(rows_of(values), specification())
    assert [each.place for each in fleet.strange] == [7]


def test_a_fifth_of_strange_units_does_not_hide_itself():
    rng = np.random.default_rng(6)
    values = rng.standard_normal((50, 4))
    values[:10] += 12.0
    found = {each.place for each in fleet_of(rows_of(values), specification()).strange}
    assert set(range(10)) <= found
    assert len(found) <= 12


def test_a_trend_is_found_and_none_where_there_is_none():
    rng = np.random.default_rng(7)
    values = rng.standard_normal((80, 3))
    drift = values + np.outer(np.arange(80), [0.0, 0.03, 0.0])
    (trend,) = fleet_of(rows_of(drift), specification()).trends
    assert trend.name == "K1_1"
    assert trend.slope == pytest.approx(0.03, abs=0.012)  # 4 standard deviations: sqrt(12 / 80^3)
    false = sum(
        bool(fleet_of(rows_of(rng.standard_normal((40, 3))), specification()).trends) for _ in range(100)
    )
    assert false <= binom.ppf(0.999, 100, LIMITS.trend_risk)


def test_dates_are_the_time_of_the_trend():
    rng = np.random.default_rng(8)
    days = [f"2026-01-{1 + k:02d}" for k in range(30)]
    values = rng.standard_normal((30, 1)) + 0.5 * np.arange(30)[:, None]
    rows = [UnitRow(**{**vars(row), "measured": day}) for row, day in zip(rows_of(values), days, strict=True)]
    fleet = fleet_of(rows[::-1], specification())
    assert fleet.per == "day"
    assert fleet.trends[0].slope == pytest.approx(0.5, abs=0.1)


def test_nothing_is_said_of_too_few_and_of_no_units():
    assert fleet_of(rows_of(np.zeros((3, 2))), specification()).strange == ()
    empty = fleet_of([UnitRow("1", "refused", "why")], specification())
    assert empty.spreads == ()
    assert empty.first == ((0, "refused: why"),)
