"""Wandering of a coefficient: predictions and charts hold what they state, of simulated instruments."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from inercal.laboratory.history import chart
from inercal.laboratory.limits import LIMITS
from inercal.laboratory.wander import CalibrationSeries, wandering

STATED = 0.9545


def instrument(rng, n, walk, noise, drift, common, ahead):
    """Calibrations of an instrument, and its true values at them and at a time ahead: by increments, step by step."""
    t = np.arange(n) + rng.uniform(-0.2, 0.2, n)
    u = 10 ** rng.uniform(-0.2, 0.2, n)
    times = np.append(t, t[-1] + ahead)
    x = rng.normal() * 10.0
    truth = [x]
    for step in np.diff(times):
        x += drift * step + walk * np.sqrt(step) * rng.normal()
        truth.append(x)
    truth = np.array(truth)
    y = truth[:-1] + u * rng.normal(size=n) + noise * rng.normal(size=n) + common * rng.normal()
    return CalibrationSeries(t, y, u, np.full(n, common)), truth, times


@pytest.mark.parametrize("count", [250, pytest.param(500, marks=pytest.mark.campaign)])
def test_predictions_cover_as_stated(count):
    """Instruments of 4 to 20 calibrations, whose walk, noise and drift are anything from a tenth to ten u.

    Binomial: within 3 sigma of 95.45 %, which is 4.0 % of 250 and 2.8 % of 500; the truth is a
    value of the instrument, not a next reading.
    """
    rng = np.random.default_rng(20261124)
    ahead, between = [], []
    for _ in range(count):
        n = int(rng.integers(4, 21))
        walk = 10 ** rng.uniform(-1, 1) / np.sqrt(n)
        noise = 10 ** rng.uniform(-1, 0.7)
        series, truth, times = instrument(
            rng, n, walk, noise, rng.normal() * 3 / n, rng.choice([0.0, 0.7]), rng.uniform(0.2, 2.0)
        )
        found = wandering(series)
        for t, x, hits in ((times[-1], truth[-1], ahead), (times[n // 2], truth[n // 2], between)):
            there = found.at(float(t))
            hits.append(abs(there.value - x) <= there.U)
    limit = 3.0 * np.sqrt(STATED * (1.0 - STATED) / count)
    assert abs(np.mean(ahead) - STATED) < limit
    assert abs(np.mean(between) - STATED) < limit


@pytest.mark.parametrize(
    "scatter", [0.0, 3.0, *(pytest.param(each, marks=pytest.mark.campaign) for each in (1.0, 10.0))]
)
def test_charts_alarm_at_most_at_their_rate_where_nothing_changes(scatter):
    """300 instruments of 20 calibrations: 0.27 % of points in each chart, and the binomial limit of 3 sigma above it.

    The scatter between calibrations, up to ten times u, is learned from them.
    """
    rng = np.random.default_rng(7)
    single, drift = [], []
    for _ in range(300):
        y = rng.normal(size=20) * np.hypot(1.0, scatter)
        found = chart(CalibrationSeries(np.arange(20.0), y, np.ones(20), np.zeros(20)))
        single.append(found.alarms[LIMITS.first_calibrations :])
        drift.append(found.drift_alarms[LIMITS.first_calibrations :])
    count = 300 * 18
    # points of one EWMA are alike: about nine of them in a row (L = 0.2) are one
    for alarms, independent in ((single, count), (drift, count / 9)):
        assert np.mean(alarms) < 0.0027 + 3.0 * np.sqrt(0.0027 / independent)


def test_charts_see_a_step_and_a_slow_drift():
    """A step of 8 u is an alarm at once; a drift of half a u a calibration is one of the EWMA within ten."""
    rng = np.random.default_rng(3)
    y = rng.normal(size=24)
    y[20:] += 8.0
    stepped = chart(CalibrationSeries(np.arange(24.0), y, np.ones(24), np.zeros(24)))
    assert stepped.alarms[20]
    seen = []
    for _ in range(50):
        y = rng.normal(size=24) + 0.5 * np.maximum(np.arange(24) - 10, 0)
        seen.append(
            chart(CalibrationSeries(np.arange(24.0), y, np.ones(24), np.zeros(24))).drift_alarms[:21].any()
        )
    assert np.mean(seen) > 0.8


def test_a_straight_line_is_found_as_by_least_squares():
    """Without walk and noise beyond u: the trend is that of weighted least squares, and U no smaller than its own."""
    rng = np.random.default_rng(5)
    t = np.linspace(0.0, 19.0, 20)
    u = np.full(20, 0.1)
    y = 3.0 + 0.5 * t + u * rng.normal(size=20)
    found = wandering(CalibrationSeries(t, y, u, np.zeros(20)))
    slope, covariance = np.polyfit(t, y, 1, cov="unscaled")
    own = 2.0 * 0.1 * np.sqrt(covariance[0, 0])
    assert found.drift.value == pytest.approx(slope[0], abs=0.2 * own)
    assert own < found.drift.U < 4.0 * own  # a walk that these points do not exclude


def test_what_all_calibrations_have_in_common_cancels_in_the_drift_and_stays_in_the_value():
    """A table's error is in every value alike: no drift comes of it, and no average takes it away."""
    t, y = np.arange(8.0), np.zeros(8)
    alone = wandering(CalibrationSeries(t, y, np.full(8, 0.1), np.zeros(8)))
    shared = wandering(CalibrationSeries(t, y, np.full(8, 0.1), np.full(8, 5.0)))
    assert pytest.approx(alone.drift.U, rel=1e-6) == shared.drift.U
    assert shared.at(4.0).U > 2.0 * 5.0 > alone.at(4.0).U


@given(
    st.integers(4, 12),
    st.floats(-1e3, 1e3),
    st.floats(1e-9, 1e9),
    st.integers(0, 2**31),
)
def test_another_origin_and_unit_change_nothing(n, shift, size, seed):
    """Values in another unit, from another zero, at a later time: the same in that unit."""
    rng = np.random.default_rng(seed)
    t, y, u = np.sort(rng.uniform(0, 5, n)) + np.arange(n), rng.normal(size=n), rng.uniform(0.5, 2.0, n)
    one = wandering(CalibrationSeries(t, y, u, np.zeros(n)))
    other = wandering(CalibrationSeries(t + 7.0, size * (y + shift), size * u, np.zeros(n)))
    a, b = one.at(float(t[-1]) + 1.0), other.at(float(t[-1]) + 8.0)
    assert b.value / size - shift == pytest.approx(a.value, abs=1e-6 * (1.0 + abs(shift)))
    assert b.U / size == pytest.approx(a.U, rel=1e-4)


def test_three_calibrations_are_needed():
    with pytest.raises(ValueError, match="three calibrations"):
        wandering(CalibrationSeries(np.arange(2.0), np.zeros(2), np.ones(2), np.zeros(2)))
    with pytest.raises(ValueError, match="two times"):
        wandering(CalibrationSeries(np.zeros(3), np.zeros(3), np.ones(3), np.zeros(3)))


def test_results_without_an_uncertainty_are_judged_by_their_scatter():
    """u of 0, as of another tool's calibration: nothing breaks, and the scatter is all there is."""
    rng = np.random.default_rng(1)
    series = CalibrationSeries(np.arange(10.0), 1.0 + 1e-3 * rng.normal(size=10), np.zeros(10), np.zeros(10))
    found = wandering(series)
    assert 1e-4 < found.at(11.0).U < 1e-2
    assert not chart(series).alarms.any()
    still = CalibrationSeries(np.arange(4.0), np.ones(4), np.zeros(4), np.zeros(4))
    assert wandering(still).at(5.0).value == pytest.approx(1.0)


def test_results_of_which_all_of_u_is_in_common_are_judged_by_their_scatter():
    """A common part that is a million times the scatter, as of a laboratory's reference, adds to the value alone."""
    t, y = np.arange(5.0), 9.8 + 1e-6 * np.array([0.0, 1.0, -1.0, 2.0, 1.0])
    none = np.zeros(5)
    found, without = (wandering(CalibrationSeries(t, y, none, none + common)) for common in (1.0, 0.0))
    assert found.drift.value == pytest.approx(without.drift.value, rel=0.3)
    assert pytest.approx(without.drift.U, rel=0.3) == found.drift.U
    assert found.at(4.0).U > 1.9
