"""Test points: uncertainty of means by Monte Carlo, numbers and triggers, pauses that are found."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter
from sting_study import BASE, DEG, SCENARIOS, scenario, study

from inercal.foundation.units import Quantity, parse_unit
from inercal.systems.aoa.angles import Angles, stated_roll, theta_by_roll
from inercal.systems.aoa.fusion.filter_result import estimate, of_fusion
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.motion import MotionPlan, Sines, buffet
from inercal.systems.aoa.reading.pauses import at_rest, pauses
from inercal.systems.aoa.reading.recording import COSINES, mean_u, plain
from inercal.systems.aoa.result.points import points
from inercal.systems.aoa.settings import Attitude
from inercal.systems.aoa.simulate import simulate
from rows import for_each

DRAWS = 600


def angles(theta, u=1e-5):
    """Some angles, all with the same uncertainty."""
    theta = np.asarray(theta, dtype=float)
    return Angles("test", theta, np.full(len(theta), u), np.zeros(len(theta)), np.full(len(theta), 1e-3))


def recording(t, **columns):
    return replace(plain(t, np.zeros((len(t), 3)), np.zeros(len(t))), **columns)


def white(rng):
    return rng.standard_normal(2000)


def correlated(rng):
    return lfilter([1.0], [1.0, -math.exp(-1.0 / 20.0)], rng.standard_normal(2500))[500:]


def limits(draws):
    """Four standard deviations of a mean squared error over a mean variance of 8 degrees of freedom, about 1."""
    return 4.0 * math.sqrt(2.0 / draws + 2.0 / COSINES / draws)


@pytest.mark.parametrize("kind", [white, correlated])
def test_errors_of_means_are_as_large_as_their_uncertainty(kind):
    # the correlated noise has 50 times less effective samples than samples
    rng = np.random.default_rng(61)
    drawn = [kind(rng) for _ in range(DRAWS)]
    ratio = np.mean([x.mean() ** 2 for x in drawn]) / np.mean([mean_u(x) ** 2 for x in drawn])
    assert abs(ratio - 1.0) < limits(DRAWS) + (0.05 if kind is correlated else 0.0)


def test_white_noise_leaves_its_deviation_over_the_root_of_n():
    rng = np.random.default_rng(62)
    found = np.mean([mean_u(white(rng)) ** 2 for _ in range(DRAWS)]) * 2000
    assert found == pytest.approx(1.0, abs=4.0 * math.sqrt(2.0 / COSINES / DRAWS))


def test_the_cut_periods_of_an_oscillation_leave_half_the_variance_that_is_told():
    # mean over T of a sine: a (cos p - cos(omega T + p)) / omega T; through a cosine of the pause: sqrt 2 of that
    rng, t = np.random.default_rng(63), np.arange(2000) / 500.0
    drawn = [buffet(1.0, 3.0, 15.0, rng)(t)[0] for _ in range(120)]
    ratio = np.mean([x.mean() ** 2 for x in drawn]) / np.mean([mean_u(x) ** 2 for x in drawn])
    assert abs(ratio - 0.5) < 0.5 * limits(120) + 0.02
    naive = 1.0 / math.sqrt(2000)
    assert np.mean([mean_u(x) for x in drawn]) < naive


def test_a_mean_of_one_row_has_no_scatter():
    assert mean_u(np.array([0.3])) == 0.0
    assert mean_u(np.array([0.3, 0.3])) == 0.0


def test_the_fusions_points_are_no_worse_than_their_uncertainty():
    # constants of the sensors drawn from the prior, as in the statement of the fusion's consistency
    settings = scenario("pitch-pause", last=10.0 * DEG, pause=2.0, sample_rate=500.0)
    known = problem(settings)
    squares = []
    for seed in range(20):
        rng = np.random.default_rng([64, seed])
        drawn = rng.multivariate_normal(known.mean[4:], known.covariance[4:, 4:])
        errors = dict(zip(known.names[4:], map(float, drawn), strict=True)) | {"b_roll": 0.0, "b_yaw": 0.0}
        simulated = simulate(settings, rng, errors)
        found = points(simulated.recording, of_fusion(estimate(simulated.recording, known), 19), settings)
        assert [each.number for each in found] == [1.0, 2.0, 3.0]
        for each in found:
            true = settings.motion.first + (each.number - 1.0) * settings.motion.step
            squares.append(((each.theta - true) / each.u) ** 2)
            assert each.u == pytest.approx(math.hypot(each.u_angle, each.u_scatter))
            assert each.scatter == pytest.approx(0.05 * DEG, rel=0.3)
    # 20 independent records; the filter leaves room for a flexure that these have not
    assert 0.1 < np.mean(squares) < 1.0 + 4.0 * math.sqrt(2.0 / 20.0)


def test_what_is_common_to_a_pause_is_not_averaged():
    rng, t = np.random.default_rng(65), np.arange(4000) / 1000.0
    theta = 0.1 + 1e-4 * rng.standard_normal(4000)
    (found,) = points(recording(t, point=np.ones(4000)), angles(theta, u=5e-5), study())
    assert found.u_angle == pytest.approx(5e-5)
    # chi of 8 degrees of freedom: within a factor of 2.5 with all but 1e-4
    assert 1e-4 / math.sqrt(4000) / 2.5 < found.u_scatter < 1e-4 / math.sqrt(4000) * 2.5
    assert found.theta == pytest.approx(0.1, abs=5.0 * found.u_scatter)


def test_points_keep_their_numbers_triggers_and_rows():
    t = np.arange(12.0)
    number = np.array([np.nan, 7, 7, np.nan, 7, 7, 9, 9, 9, np.nan, 8, 8])
    trigger = np.array([1, 11, 11, 11, 12, 13, np.nan, 14, 14, 14, np.nan, np.nan])
    theta = 0.01 * np.arange(12.0)
    theta[7] = np.nan  # a lost row splits no point
    found = points(recording(t, point=number, trigger=trigger), angles(theta), study())
    assert [each.number for each in found] == [7.0, 7.0, 9.0, 8.0]
    assert [(each.start, each.stop, each.rows) for each in found] == [
        (1, 3, 2),
        (4, 6, 2),
        (6, 9, 2),
        (10, 12, 2),
    ]
    assert [(each.begin, each.end) for each in found] == [(1.0, 2.0), (4.0, 5.0), (6.0, 8.0), (10.0, 11.0)]
    assert [each.trigger for each in found][:3] == [11.0, 12.0, 14.0]
    assert [each.last_trigger for each in found][:3] == [11.0, 13.0, 14.0]
    assert math.isnan(found[3].trigger)
    assert found[0].theta == pytest.approx(0.015)
    assert all(each.rate == pytest.approx(0.01) for each in found)


def test_a_mean_across_180_deg_is_there_and_not_at_0():
    t = np.arange(8.0)
    theta = (
        np.remainder(math.pi + 0.01 * np.array([-1, 1, -1, 1, -1, 1, -1, 1]) + math.pi, 2 * math.pi) - math.pi
    )
    (found,) = points(recording(t, point=np.ones(8)), angles(theta), study())
    assert abs(found.theta) == pytest.approx(math.pi, abs=1e-12)
    assert found.scatter == pytest.approx(0.01)


def test_a_record_without_angles_has_no_points():
    t = np.arange(5.0)
    assert points(recording(t, point=np.ones(5)), angles(np.full(5, np.nan)), study()) == ()
    assert points(recording(t), angles(np.full(5, np.nan)), study()) == ()


def test_a_rolled_models_points_have_alpha_and_beta():
    roll = Quantity(0.5 * math.pi, 0.0, parse_unit("rad"), "")
    t = np.arange(5.0)
    (found,) = points(
        recording(t, point=np.ones(5)), angles(np.full(5, 0.2), u=1e-3), study(attitude=Attitude(roll=roll))
    )
    assert (found.theta, found.beta) == pytest.approx((0.2, 0.2))
    assert found.alpha == pytest.approx(0.0, abs=1e-12)
    assert found.u_beta == pytest.approx(1e-3)
    tracked = points(
        recording(t, point=np.ones(5)),
        replace(angles(np.full(5, 0.2)), roll=np.full(5, 0.5 * math.pi), roll_u=np.zeros(5)),
        study(),
    )
    assert tracked[0].beta == pytest.approx(0.2)


def test_the_uncertainty_of_a_stated_roll_is_in_that_of_a_point():
    t, attitude = np.arange(5.0), Attitude(roll=Quantity(0.5, 0.02, parse_unit("rad"), ""))
    settings, plain_angles = study(attitude=attitude), angles(np.full(5, 0.4), u=1e-4)
    numbered = recording(t, point=np.ones(5))
    (found,) = points(numbered, stated_roll(plain_angles, attitude), settings)
    by = float(theta_by_roll(np.array([0.4]), 0.5)[0])
    assert found.u == pytest.approx(math.hypot(1e-4, 0.02 * by))
    # alpha takes the roll both ways from what is left without it, and not twice
    (without,) = points(numbered, plain_angles, settings)
    assert (found.u_alpha, found.u_beta) == pytest.approx((without.u_alpha, without.u_beta))


@pytest.mark.parametrize("rms", [0.0, 0.05, 0.3])
def test_pauses_are_found_within_those_that_were_made(rms):
    # pauses of 4 s, moves of 1.5 s by 10 deg; at least 3 s of each, nothing of the moves
    settings = scenario("pitch-pause", last=20.0 * DEG, rms=rms * DEG, sample_rate=200.0)
    simulated = simulate(settings, np.random.default_rng(66))
    noise = 1e-5 * np.random.default_rng(67).standard_normal(len(simulated.theta))
    found = points(replace(simulated.recording, point=None), angles(simulated.theta + noise), settings)
    assert [each.number for each in found] == [1.0, 2.0, 3.0, 4.0]
    for k, each in enumerate(found):
        first = k * 5.5
        assert first - 1e-9 <= each.begin
        assert each.end <= first + 4.0
        assert each.end - each.begin > 3.0
        assert each.theta == pytest.approx((-10.0 + 10.0 * k) * DEG, abs=4.0 * each.u)


def test_a_ring_down_after_a_move_is_left_out():
    t = np.arange(0.0, 12.0, 0.005)
    ring = np.where(t > 5.0, 0.02 * np.exp(-(t - 5.0) / 0.4) * np.sin(60.0 * (t - 5.0)), 0.0)
    step = 0.2 * np.clip((t - 4.0) / 1.0, 0.0, 1.0)
    theta = step + ring + 1e-4 * np.random.default_rng(68).standard_normal(len(t))
    before, after = pauses(t, theta, np.full(len(t), 1e-5))
    assert t[before.stop - 1] <= 4.0
    # 0.02 e^(-x/0.4)/sqrt 2 is 2e-4 after 1.7 s
    assert 6.0 < t[after.start] < 7.5


@pytest.mark.parametrize("frequency", [0.1, 0.5, 1.0])
def test_a_slow_oscillation_has_no_pauses(frequency):
    settings = study(motion=replace(BASE, frequency=frequency, duration=20.0, sample_rate=200.0))
    simulated = simulate(settings, np.random.default_rng(69))
    assert points(simulated.recording, angles(simulated.theta), settings) == ()


@for_each("name", SCENARIOS)
def test_only_a_pitch_pause_has_pauses(name):
    # 10 deg and 16 deg at 1 Hz, a chirp to 5 Hz, a buffet of 0.2 deg: whatever the seed, none of them rests
    for seed in range(8):
        settings = scenario(name, sample_rate=100.0)
        simulated = simulate(settings, np.random.default_rng([73, seed]))
        t, u = simulated.recording.t, 1e-5
        theta = simulated.theta + u * np.random.default_rng(seed).standard_normal(len(t))
        still, _ = at_rest(t, theta, np.full(len(t), u))
        found = pauses(t, theta, np.full(len(t), u))
        if name == "pitch-pause":
            assert len(found) == 11
            assert 0.7 < still.mean() < 0.76  # 4 s of 5.5 s, 11 pauses and 10 moves: 0.746
        else:
            assert found == ()
            assert still.mean() < 0.02


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("rms", [0.05, 0.1, 0.2, 0.3])
def test_a_pause_is_found_under_buffet_whatever_the_seed(seed, rms):
    settings = scenario("pitch-pause", last=10.0 * DEG, rms=rms * DEG, sample_rate=100.0)
    simulated = simulate(settings, np.random.default_rng([74, seed]))
    t = simulated.recording.t
    found = pauses(t, simulated.theta, np.full(len(t), 1e-5))
    assert len(found) == 3
    for k, each in enumerate(found):
        assert 5.5 * k - 1e-9 <= t[each.start]
        assert t[each.stop - 1] <= 5.5 * k + 4.0


def test_a_long_chirp_does_not_rest_however_fast_it_gets():
    """Of 5 deg, 0.1 to 5 Hz in 600 s: more than half of it turns to and fro within the window."""
    settings = scenario("chirp", duration=600.0, sample_rate=50.0)
    simulated = simulate(settings, np.random.default_rng(75))
    t, u = simulated.recording.t, np.full(30_000, 1e-5)
    assert pauses(t, simulated.theta, u) == ()
    still, _ = at_rest(t, simulated.theta, u)
    # what is left are the turning points of the slow oscillations, of a rate that reaches 157 deg/s
    assert still.mean() < 0.02
    assert np.abs(simulated.rate[still]).max() < 5.0 * DEG


def test_a_model_at_one_angle_rests_under_a_small_buffet_and_not_under_a_large_one():
    t, u = np.arange(0.0, 20.0, 0.005), np.full(4000, 1e-5)
    for rms, count in ((0.05, 1), (0.5, 0)):
        shaken = buffet(rms * DEG, 3.0, 15.0, np.random.default_rng(76))(t)[0]
        assert len(pauses(t, 0.1 + shaken, u)) == count


def test_an_oscillation_that_begins_ends_a_pause():
    t = np.arange(0.0, 20.0, 0.005)
    theta = 0.1 + np.where(t > 8.0, 5.0 * DEG * np.sin(2.0 * math.pi * 5.0 * t), 0.0)
    (found,) = pauses(t, theta, np.full(len(t), 1e-5))
    assert found.start == 0
    assert 7.0 < t[found.stop] <= 8.0


def test_noise_within_its_uncertainty_is_no_motion():
    # a poor sensor: 1 deg from row to row, and said to be so
    t = np.arange(0.0, 10.0, 0.01)
    theta = DEG * np.random.default_rng(77).standard_normal(len(t))
    assert len(pauses(t, theta, np.full(len(t), DEG))) == 1


def test_a_sweep_has_no_pauses_and_a_model_at_rest_is_one():
    sweep = study(motion=MotionPlan("static", duration=30.0, sample_rate=100.0, last=30.0 * DEG))
    simulated = simulate(sweep, np.random.default_rng(70))
    assert points(simulated.recording, angles(simulated.theta), sweep) == ()
    (found,) = points(simulated.recording, angles(np.full(3000, 0.1)), sweep)
    assert (found.start, found.stop) == (0, 3000)


def test_a_gap_parts_pauses():
    t = np.concatenate([np.arange(0.0, 5.0, 0.01), np.arange(20.0, 25.0, 0.01)])
    theta = 0.1 + 1e-4 * np.random.default_rng(71).standard_normal(len(t))
    assert [(each.start, each.stop) for each in pauses(t, theta, np.full(len(t), 1e-4))] == [
        (0, 500),
        (500, 1000),
    ]


def test_the_line_of_a_window_is_that_of_a_fit():
    rng, t = np.random.default_rng(72), np.arange(200) / 100.0
    theta = 5.0 + Sines(np.array([0.1]), np.array([9.0]), np.zeros(1))(t)[0] + 0.01 * rng.standard_normal(200)
    _, scatter = at_rest(t, theta, np.zeros(200))
    for row in (40, 100, 150):
        window = slice(row - 25, row + 25)
        line = np.polynomial.Polynomial.fit(t[window], theta[window], 1)
        left = theta[window] - line(t[window])
        assert scatter[row] == pytest.approx(math.sqrt(float(left @ left) / 48.0), rel=1e-9)
