"""Accelerometers, and a gyro, by stretches in which nothing rests: against a simulated hand and simulated rows."""

from dataclasses import replace

import numpy as np
import pytest
from swung_units import GRAVITY, hand, rows, turn_sensor

from inercal.foundation.errors import RecordError
from inercal.foundation.geometry.earth import GravityInput, Site
from inercal.systems.imu.sections.priors import Priors
from inercal.systems.imu.sections.swing import NAMES, swing_calibration
from inercal.systems.imu.sections.swing_gyro import gravity_turns, swing_gyro
from rows import for_each

PRIORS = Priors(Site(GRAVITY))
#: limits of u(K1) of 120 s in the hand by the pushes [m/s²] that it gives
LIMITS = {0.05: 1e-3, 0.15: 2.5e-3, 0.5: 8e-3}


def errors_over_u(seeds, push, with_gyro=True):
    """Errors over u (runs, 9), and the largest u of a scale factor."""
    found, u = [], []
    for seed in seeds:
        y, w, x = hand(np.random.default_rng([45, seed]), push=push)
        fit = swing_calibration(y, PRIORS, "log", 100.0, w if with_gyro else None)
        assert not fit.refusal
        assert not fit.by_prior
        found.append((fit.x - x) / fit.u)
        u.append(np.mean(fit.u[3:6]))
    return np.array(found), np.mean(u)


@pytest.mark.slow
@pytest.mark.parametrize("with_gyro", [True, False])
def test_a_hand_that_never_rests(with_gyro):
    """Errors of 20 runs are those that u says: each kind has 60 of them, not independent within a run; with 20 to 60
    degrees of freedom their rms lies within 0.7 and 1.35 in all but 1 of 1000 cases."""
    z, u = errors_over_u(range(20), 0.15, with_gyro)
    assert u < LIMITS[0.15]
    rms = np.sqrt(np.mean(z.reshape(-1, 3, 3) ** 2, axis=(0, 2)))
    low = 0.7 if with_gyro else 0.3  # without a gyro u allows for more than this arm does
    assert np.all((low < rms) & (rms < 1.35)), rms


@pytest.mark.campaign
@pytest.mark.parametrize("push", LIMITS)
def test_errors_in_the_hand_are_those_of_u(push):
    z, u = errors_over_u(range(100, 220), push)
    rms = np.sqrt(np.mean(z.reshape(-1, 3, 3) ** 2, axis=(0, 2)))
    assert u < LIMITS[push]
    assert np.all((rms > 0.8) & (rms < 1.2)), rms


def test_arm_of_the_hand():
    """Without pushes the arm is told to a tenth, and u(K0) falls by it."""
    y, w, _ = hand(np.random.default_rng(1), push=0.02, arm=0.1)
    by_gyro, alone = (swing_calibration(y, PRIORS, "log", 100.0, rate) for rate in (w, None))
    np.testing.assert_allclose(by_gyro.arm, np.full(3, 0.1 / np.sqrt(3)), atol=0.01)
    assert alone.arm is None
    assert by_gyro.u[:3].max() < 0.4 * alone.u[:3].min()


def test_pushed_rows_are_named():
    """All six, and at most one other, in 20 tables."""
    for seed in range(20):
        y, _ = rows(np.random.default_rng([46, seed]))
        named = {window.row for window in swing_calibration(y, PRIORS, "table").outlying}
        assert set(range(6)) <= named
        assert len(named) <= 7


def test_windows_are_named_by_their_first_sample():
    y, w, _ = hand(np.random.default_rng(3), push=0.02)
    y[5000:5010] += [0.0, 0.0, 6.0]
    y[5000:5010, :2] *= 1.3
    fit = swing_calibration(y, PRIORS, "log", 100.0, w)
    assert {window.row for window in fit.outlying[:2]} == {5000, 5005}
    assert fit.length == 5


def test_errors_of_rows_are_those_of_u():
    """60 tables without pushes, 180 errors of each kind, of at least 60 degrees of freedom."""
    z = []
    for seed in range(60):
        y, x = rows(np.random.default_rng([47, seed]), 60, 0)
        fit = swing_calibration(y, PRIORS, "table")
        z.append((fit.x - x) / fit.u)
    rms = np.sqrt(np.mean(np.reshape(z, (-1, 3, 3)) ** 2, axis=(0, 2)))
    assert np.all((rms > 0.75) & (rms < 1.3)), rms


@for_each("cone", [15.0, 45.0, 90.0])
def test_directions_that_were_not_seen_are_by_prior(cone):
    """Within 15 deg of one side, K0 and K1 rest on what was known of K1, and it is refused; half a sphere tells all."""
    y, x = rows(np.random.default_rng([48, int(cone)]), 200, 0, cone)
    fit = swing_calibration(y, PRIORS, "table")
    assert ({*NAMES[:6]} <= {*fit.by_prior}) == (cone == 15.0)
    assert bool(fit.refusal) == (cone == 15.0)
    assert np.all(np.abs(fit.x - x) < 4 * fit.u)
    if cone == 90.0:
        assert not fit.by_prior
        assert fit.u[3:6].max() < 2e-3


def test_counts_have_no_scale_of_their_own():
    """Outputs in counts of unknown scale give the same, in counts, but for what was known of the scale."""
    y, _ = rows(np.random.default_rng(5), 200, 0)
    physical = swing_calibration(y, PRIORS, "table")
    counts = swing_calibration(1000 * y, replace(PRIORS, acc_scale=None), "table")
    unit = np.repeat([1000, 1000, 1], 3)
    np.testing.assert_allclose(counts.x / unit, physical.x, atol=0.05 * physical.u.min())
    np.testing.assert_allclose(counts.u / unit, physical.u, rtol=0.02)


def test_gravity_goes_into_the_scale():
    """u of gravity, of one cause for all three, is that of a scale that is told otherwise."""
    y, _ = rows(np.random.default_rng(6), 200, 0)
    site = Site(GRAVITY, (GravityInput("stated", 0.03, "m/s^2", 1.0),))
    fit = swing_calibration(y, Priors(site), "table")
    of_g = 0.03 / GRAVITY
    np.testing.assert_allclose(fit.u[3:6], of_g, rtol=0.1)
    c = fit.covariance[3:6, 3:6]
    assert np.all(c / np.sqrt(np.outer(np.diag(c), np.diag(c))) > 0.9)


def test_no_swing_is_refused():
    rng = np.random.default_rng(7)
    y, _ = rows(rng, 200, 0)
    still = np.tile([0.1, 0.2, GRAVITY], (200, 1)) + rng.normal(0, 0.02, (200, 3))
    knocked = still + rng.normal(0, 3.0, (200, 3))
    reasons = {
        "in another unit": swing_calibration(0.3 * y, PRIORS, "table").refusal,
        "no scale factor": swing_calibration(still, PRIORS, "table").refusal,
    }
    assert {words for words, reason in reasons.items() if words not in reason} == set()
    assert swing_calibration(knocked, PRIORS, "table").refusal


def test_too_little_is_told_in_a_sentence():
    y, _ = rows(np.random.default_rng(8), 200, 0)
    with pytest.raises(RecordError, match=r"table: found 6 usable windows .* expected at least 10"):
        swing_calibration(y[:6], PRIORS, "table")
    with pytest.raises(RecordError, match="hardly change"):
        swing_calibration(np.zeros((50, 3)), replace(PRIORS, acc_scale=None), "table")


def test_rows_without_a_number_do_not_count():
    y, x = rows(np.random.default_rng(9), 100, 0)
    y[::9] = np.nan
    fit = swing_calibration(y, PRIORS, "table")
    assert fit.windows == 88
    assert np.all(np.abs(fit.x - x) < 4 * fit.u)


# gyro -----------------------------------------------------------------------------------------------------------------


def turns_of(seed, push, **gyro):
    """The gyro of a swing by its own accelerometers, and the truth."""
    rng = np.random.default_rng([49, seed])
    y, w, _ = hand(rng, push=push)
    rates, truth = turn_sensor(rng, w, **gyro)
    force = swing_calibration(y, PRIORS, "log", 100.0).force(y)
    return gravity_turns(force, rates, np.arange(len(y)) / 100), truth


def test_gyro_of_a_swing():
    """Some 1 % is claimed, and no error exceeds four times that in four runs of twelve values."""
    for seed in range(4):
        turns, truth = turns_of(seed, 0.15)
        gyro = swing_gyro(turns)
        assert turns.share > 0.99
        assert np.all(np.abs(gyro.x - truth) < 4 * gyro.u)
        assert np.all(gyro.u[3:] < 0.02)
        assert np.all(gyro.u[3:6] > 0.0099 * gyro.x[3:6])


def test_axes_of_a_gyro_that_are_exchanged_or_reversed():
    turns, _ = turns_of(7, 0.05, order=(1, 0, 2), signs=(1, 1, -1))
    assert turns.axes == (2, 1, -3)
    assert swing_gyro(turns) is None


def test_covariance_of_the_gyro_is_that_of_its_matrix():
    """Derivatives of S, T and D_F by the matrix, against a thousand draws of it."""
    turns, _ = turns_of(8, 0.5)
    rng = np.random.default_rng(10)
    small = replace(turns, covariance=1e-6 * turns.covariance)
    drawn = rng.multivariate_normal(small.x, small.covariance, 1000)
    x = np.array([swing_gyro(replace(small, x=each)).x for each in drawn])
    large = swing_gyro(replace(turns, covariance=100 * turns.covariance))  # above the least that is claimed
    np.testing.assert_allclose(1e4 * x.std(axis=0), large.u, rtol=0.1)


def test_turns_about_the_vertical_tell_nothing_of_their_axis():
    rng = np.random.default_rng(11)
    y, w, _ = hand(rng, push=0.02, axis=np.array([0.0, 0.0, 1.0]))
    turns = gravity_turns(y, turn_sensor(rng, w)[0], np.arange(len(y)) / 100)
    assert turns is None or turns.axes[2] == 0


def test_nothing_turns():
    still = np.tile([0.0, 0.0, GRAVITY], (500, 1))
    assert gravity_turns(still, np.zeros((500, 3)), np.arange(500) / 100) is None
    assert gravity_turns(still[:0], np.zeros((0, 3)), np.zeros(0)) is None
