"""Gaps in what a platform was told: the turn is held over the base, or found out to have been another one."""

import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from numpy.testing import assert_allclose
from paper_study import ARCSEC, TRUTH, study
from scipy.stats import chi2

from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.foundation.geometry.rotations import boxminus, conjugate, exp, multiply, rotate
from inercal.foundation.records.record import Record
from inercal.systems.selfcal.before.bounds import recorded_bounds
from inercal.systems.selfcal.filters.gaps import broken, held_rate, taken_anew, with_held
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.platform.coefficients import product_slope, to_product
from inercal.systems.selfcal.platform.kinematics import attitude
from inercal.systems.selfcal.reading import recording_of
from inercal.systems.selfcal.simulate import experiment, simulate, to_record

BEST = study("best")
SEEDS = range(6)
RECURSIVE = ("error-state", "svd-qukf", "gimbal-ukf")

#: on the best path, five rows a second: x by -90 deg to row 450, z by -210 to 1500, x by -60 to 1800, z to 2250, x
WITHIN = {"4 s": (500, 520), "10 s": (900, 950), "four": (60, 80, 300, 320, 900, 920, 2300, 2320)}
ACROSS = {"a turn ends": (1480, 1520), "in the last step": (1490, 1502), "more": (430, 460, 1790, 1805)}


def cut(record, edges):
    """The record without the rows from the first edge to the second, the third to the fourth, ..."""
    rows = np.arange(len(record["th_x"].t))
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        rows = rows[(rows < first) | (rows >= end) | (rows >= len(record["th_x"].t))]
    t = record["th_x"].t[rows]
    columns = {name: replace(each, values=each.values[rows], t=t) for name, each in record.columns.items()}
    return Record(columns, (), record.sources)


def silent(record, edges, names):
    """The record without the numbers of some columns in those rows."""
    columns = dict(record.columns)
    for name in names:
        values = columns[name].values.copy()
        for first, end in zip(edges[::2], edges[1::2], strict=True):
            values[first:end] = np.nan
        columns[name] = replace(columns[name], values=values)
    return Record(columns, (), record.sources)


@cache
def recorded(seed):
    return to_record(simulate(experiment(BEST), np.random.default_rng([seed, 5])).recording)


def nees(found):
    """Squared error of the coefficients over their covariance: chi-square with 18 degrees of freedom."""
    slope, miss = product_slope(found.coefficients), to_product(found.coefficients) - TRUTH[:18]
    return float(miss @ np.linalg.solve(slope @ found.covariance @ slope.T, miss))


def assert_consistent(values):
    """Mean of chi-squares with 18 degrees of freedom, within 99.99 %."""
    low, high = chi2.ppf([5e-5, 1.0 - 5e-5], 18 * len(values)) / len(values)
    assert low < np.mean(values) < high


RATES = [np.array([0.0, -0.02, 0.0]), np.array([0.01, 0.02, -0.015]), np.zeros(3)]


@pytest.mark.parametrize("turn", RATES)
@pytest.mark.parametrize("dt", [0.2, 10.0, 200.0])
def test_a_held_rate_takes_the_platform_on_over_the_base(turn, dt):
    """The exact step ends where a constant rate over the base does, also beyond half a turn, and in that sense."""
    world, th = BEST.world, np.array([0.3, -0.5, 2.0])
    q = np.array(attitude(th, world.axes, world.signs))
    middle, since = 0.1, 3.0
    at = multiply(q, exp(turn * middle))
    w = turn + rotate(conjugate(at), world.earth)  # commanded then
    rate = held_rate(w, th, world, middle, since, dt)
    begin = multiply(q, exp(turn * since))
    end = multiply(multiply(exp(-world.earth * dt), begin), exp(rate * dt))
    assert_allclose(boxminus(end, multiply(begin, exp(turn * dt))), 0.0, atol=1e-13 * (1.0 + dt))
    half = 0.5 * np.linalg.norm(turn) * dt
    assert np.linalg.norm(rate - turn) < 1.01 * EARTH_RATE / abs(np.sinc(half / np.pi))
    if dt == 0.2:  # nothing but the rate itself, one step on
        later = turn + rotate(conjugate(multiply(q, exp(turn * (since + 0.1)))), world.earth)
        assert_allclose(rate, later, atol=EARTH_RATE * (1e-9 + half**2))


@pytest.mark.parametrize("edges", WITHIN.values(), ids=WITHIN)
def test_rates_over_a_gap_within_a_turn_are_what_the_platform_did(edges):
    """Steps commanded in the gap, one after the other, end where the step held does: to 0.005 arcsec/s."""
    whole, found = recording_of(recorded(0), BEST), recording_of(cut(recorded(0), edges), BEST)
    gaps = list(zip(edges[::2], edges[1::2], strict=True))
    assert len(found.held) == len(gaps)
    for k, (first, end) in zip(found.held, gaps, strict=True):
        turn = np.array([1.0, 0.0, 0.0, 0.0])
        for rate, dt in zip(whole.rate[first - 1 : end], whole.dt[first - 1 : end], strict=True):
            turn = multiply(turn, exp(rate * dt))
        off = boxminus(exp(found.rate[k] * found.dt[k]), turn)
        assert np.abs(off).max() < 0.005 * ARCSEC * found.dt[k]


def test_what_is_a_gap():
    """Longer than 1.5 times what is usual of late: also after a short interval, a jitter, another rate; a first
    interval is what it is."""
    steps = [0.2, 2.0, 0.2, 0.001, *[0.2] * 5, 0.15, 0.25, 0.15, 0.25, *[1.0] * 9, 4.0, 1.0]
    t = np.append(0.0, np.cumsum(steps))
    _, held = with_held(t, np.zeros((len(steps), 3)), np.zeros((len(t), 3)), BEST.world, False)
    # lower medians: a new rate is usual once it has been five of nine
    assert held == (1, 13, 14, 15, 16, 22)


@pytest.mark.parametrize("edges", WITHIN.values(), ids=WITHIN)
def test_errors_are_what_u_says_with_gaps_within_turns(edges):
    found = [estimate(recording_of(cut(recorded(seed), edges), BEST), problem(BEST)) for seed in SEEDS]
    assert all(each.restarts == () for each in found)
    assert_consistent([nees(each) for each in found])
    assert np.mean([each.nis_mean for each in found]) == pytest.approx(6.0, abs=5 * math.sqrt(12 / 2600 / 6))


@pytest.mark.parametrize("edges", ACROSS.values(), ids=ACROSS)
def test_errors_are_what_u_says_with_gaps_over_a_change_of_turns(edges):
    """The attitude is taken anew; the finding says when."""
    recordings = [recording_of(cut(recorded(seed), edges), BEST) for seed in SEEDS]
    found = [estimate(each, problem(BEST)) for each in recordings]
    assert all(len(each.restarts) == len(edges) // 2 for each in found)
    assert all(each.findings == () for each in recordings)  # nor do angles and rates contradict each other
    assert_consistent([nees(each) for each in found])
    (said,) = taken_anew(recordings[0], found[0])
    assert said.code == "gap"
    assert said.where.startswith(f"t = {0.2 * edges[1]:.10g}")


@pytest.mark.parametrize("kind", ["svd-qukf", "gimbal-ukf", "map"])
def test_all_estimators_find_the_same(kind):
    """What differs are points of second order: a tenth of u."""
    recording = recording_of(cut(recorded(1), (500, 520, 1490, 1520)), BEST)
    mine, theirs = (estimate(recording, problem(BEST), each) for each in ("error-state", kind))
    assert mine.restarts == theirs.restarts == (1470,)
    assert theirs.converged
    u = np.sqrt(np.diag(mine.covariance))
    assert_allclose(theirs.coefficients / u, mine.coefficients / u, atol=0.1)
    assert_allclose(np.sqrt(np.diag(theirs.covariance)) / u, 1.0, rtol=0.01)


def test_rates_missing_in_rows_that_are_there():
    """Through 10 s within a turn, of one axis or all: held; over the end of a turn: anew in each row till rates are
    back."""
    all_axes = ["wc_x", "wc_y", "wc_z"]
    found = []
    for seed in SEEDS:
        record = silent(silent(recorded(seed), (900, 950), all_axes), (1600, 1650), ["wc_y"])
        recording = recording_of(silent(record, (1490, 1510), all_axes), BEST)
        assert recording.held == (*range(900, 950), *range(1490, 1510), *range(1600, 1650))
        found.append(estimate(recording, problem(BEST)))
        assert found[-1].restarts == tuple(range(1501, 1511))
    assert_consistent([nees(each) for each in found])


@pytest.mark.parametrize("kind", RECURSIVE)
def test_nothing_counts_behind_a_gap_before_the_encoders_read(kind):
    """They are silent for 10 s behind a gap in which a turn ended: accelerometers alone would spoil everything."""
    record = silent(cut(recorded(2), (1490, 1520)), (1490, 1540), ["th_x", "th_y"])
    recording = recording_of(record, BEST)
    found = estimate(recording, problem(BEST), kind)
    assert found.restarts == (1540,)
    assert broken(recording, problem(BEST)) == [1489]
    assert not found.dims[1489:1540].any()
    assert nees(found) < chi2.ppf(1.0 - 1e-4, 18)
    of_map = estimate(recording, problem(BEST), "map")
    assert nees(of_map) < chi2.ppf(1.0 - 1e-4, 18)


@pytest.mark.parametrize("edges", [(500, 520), (1490, 1520)])
def test_bounds_know_what_was_forgotten(edges):
    """Uncertainties of the filter are the bounds along its path; and these still add up from their sources."""
    recording = recording_of(cut(recorded(3), edges), BEST)
    found = estimate(recording, problem(BEST))
    along = recorded_bounds(
        recording, problem(BEST), found.history.attitude, found.coefficients, contributions=True,
        restarts=found.restarts,
    )  # fmt: skip
    slope = product_slope(found.coefficients)
    u = np.sqrt(np.diag(slope @ found.covariance @ slope.T))
    assert_allclose(along.u / u, 1.0, rtol=0.01)
    assert_allclose(
        sum(along.contributions.values()), along.covariance, rtol=1e-6, atol=1e-9 * along.u.max() ** 2
    )
