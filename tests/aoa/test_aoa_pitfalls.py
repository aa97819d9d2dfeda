"""What breaks filters of this kind, and must not break ours."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sting_study import BASE, DEG, G, clipped, scenario, study

from inercal.foundation.errors import RecordError
from inercal.foundation.inference.kalman import empty_row
from inercal.systems.aoa.disturbances import Disturbances
from inercal.systems.aoa.fusion import loop, model
from inercal.systems.aoa.fusion.filter_result import estimate
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.fusion.run import advance, initial
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.settings import Estimator, Heave, Noise, Prior
from inercal.systems.aoa.simulate import simulate


def told(found, simulated, after):
    """Errors and uncertainties [rad] ``after`` a time [s]; every row has its angle."""
    late = simulated.recording.t > after
    assert np.isfinite(found.theta).all()
    assert (found.u > 0.0).all()
    return abs(found.theta - simulated.theta)[late], found.u[late]


def hard_gated(of, recording):
    """Angles (n,) of the same filter with a gate that shuts: what is off by five standard deviations is left out."""
    _, trace = advance(
        initial(of),
        of,
        recording.t[: LIMITS.starting_rows],
        recording.rows[: LIMITS.starting_rows],
        last=True,
    )
    x, P = (each.copy() for each in trace.starts[0][1:3])
    n, d = of.size, len(of.places.moving)
    F, Q, work, line = np.empty((d, d)), np.empty((d, d)), np.empty((d, n)), np.empty(n)
    row, belief = empty_row(model.WIDEST), loop.Belief(x, P, np.zeros(of.count + 3))
    step = recording.t[1] - recording.t[0]
    model.transition(step, of.model, F, Q)
    theta = []
    for k, z in enumerate(recording.rows):
        motion = x[1], x[2], x[3]
        if k:
            loop.go_on(belief, model.FusionStep(step, 0.0, 0.0, 0.0), of.model, F, Q, work)
        at = model.Prediction(x, math.sin(x[0]), math.cos(x[0]), 0.0, 0.0, *motion)
        for i in range(of.count + 1):
            expected, noise, size = loop.reading(i, at, math.nan, of.model, row)
            v, h = z[i] - expected, np.zeros(n)
            h[row.places[:size]] = row.values[:size]
            if v * v <= 25.0 * (h @ P @ h + noise):
                loop.update(P, x, row, size, v, noise, math.inf, line)
        theta.append(x[0])
    return np.array(theta)


def kicked(settings):
    """A second at rest, then at once, within one sample, 10 deg at 2 Hz: a jump of the rate by 126 deg/s."""
    still = replace(settings, motion=replace(BASE, amplitude=0.0, duration=1.0))
    going = replace(settings, motion=replace(BASE, frequency=2.0, duration=3.0))
    first, second = (
        simulate(each, np.random.default_rng(20 + k)).recording for k, each in enumerate((still, going))
    )
    joined = {
        name: np.concatenate([getattr(first, name), getattr(second, name)])
        for name in ("acc", "gyro", "turns", "zero_angle", "reference")
    }
    return replace(second, t=np.append(first.t, 1.0 + second.t), **joined)


@pytest.mark.parametrize("snap", [1e5, 1e7])
def test_a_gate_that_shuts_locks_the_filter_out_and_ours_does_not(snap):
    """What no sensor could follow has passed, and the angle is off by tens of degrees, which the gyro does not show.

    Behind a gate that shuts the filter stays there, as sure as before. The soft one alone would stay as well, for its
    pull falls as 1 / v; but that sensors surprise without an end is seen after half a second, and it is found anew.
    """
    settings = study(8, estimator=Estimator(8, snap=snap))
    recording = kicked(settings)
    of = problem(settings)
    late = recording.t > 2.5
    shut = abs(hard_gated(of, recording) - recording.reference)[late]
    assert not shut.max() < 20.0 * DEG
    for smoothed in (False, True):
        ours = estimate(recording, of, smoothed)
        assert len(ours.starts) == 2
        assert 1500 <= ours.starts[1] < 2000
        assert abs(ours.theta - recording.reference)[late].max() < 0.02 * DEG


@pytest.mark.parametrize(("which", "size"), [([0, 1, 2], 0.2), ([0], 0.05), ([1], 0.1)])
def test_a_shock_is_over_when_it_is_over(which, size):
    """A fifth of a second of 0.05 to 0.2 g that is no motion leads far astray; a second later it is as if forgotten."""
    settings = scenario("base", duration=10.0)
    simulated = simulate(settings, np.random.default_rng(38))
    acc = simulated.recording.acc.copy()
    acc[4000:4200, which] += size * G
    for smoothed in (False, True):
        found = estimate(replace(simulated.recording, acc=acc), problem(settings), smoothed)
        error = abs(found.theta - simulated.theta)
        assert (error < 5.0 * found.u)[6000:].all()
        assert error[6000:].max() < 0.06 * DEG


def test_one_bad_accelerometer_does_not_lead_ever_further_astray():
    """0.05 g in a1 alone, for good: an error of degrees, and a NIS that says so."""
    settings = scenario("base", duration=20.0)
    simulated = simulate(settings, np.random.default_rng(38))
    acc = simulated.recording.acc.copy()
    acc[3000:, 0] += 0.05 * G
    found = estimate(replace(simulated.recording, acc=acc), problem(settings))
    error, _ = told(found, simulated, 0.0)
    assert error.max() < 20.0 * DEG
    assert found.nis_mean > 10.0


@pytest.mark.parametrize("name", ["base", "chirp", "pivot", "flexure"])
def test_nothing_is_found_anew_where_nothing_was_lost(name):
    """Also not by the small filter where it is wrong by 3 mm; under flexure that filter may lose itself."""
    for states in (19,) if name == "flexure" else (8, 19):
        settings = scenario(name, states=states, duration=10.0)
        recording = simulate(settings, np.random.default_rng(39)).recording
        assert estimate(recording, problem(settings)).starts == (0,)


@pytest.mark.slow
@pytest.mark.parametrize("moving", [True, pytest.param(False, marks=pytest.mark.campaign)])
def test_a_million_samples_without_a_missing_angle(moving):
    """19 states, at rest or moving with spikes and lost rows: angles, uncertainties, a covariance that is one.

    `benchmarks/aoa_endless.py` goes further.
    """
    plan = replace(BASE, duration=1000.0, amplitude=(10.0 if moving else 0.0) * DEG)
    spoiled = Disturbances(spikes=1e-3, dropouts=1e-3) if moving else Disturbances()
    settings = study(19, motion=plan, disturbances=spoiled)
    simulated = simulate(settings, np.random.default_rng(23))
    found = estimate(simulated.recording, problem(settings))
    error, u = told(found, simulated, 5.0)
    assert len(error) > 900_000
    assert (u < 0.05 * DEG).all()
    # a spike pulls by five standard deviations of an innovation; a million times four hold some that meet
    assert error.max() < (0.3 if moving else 0.05) * DEG
    P = found.state.P
    np.testing.assert_array_equal(P, P.T)
    scale = np.sqrt(np.diag(P))
    assert np.linalg.eigvalsh(P / np.outer(scale, scale)).min() > 1e-8


@pytest.mark.parametrize("states", [8, 19])
def test_spikes_do_no_more_than_five_standard_deviations(states):
    """Half a g (half a rad/s) in one of a hundred samples of each sensor."""
    settings = study(states, motion=replace(BASE, duration=10.0), disturbances=Disturbances(spikes=0.01))
    simulated = simulate(settings, np.random.default_rng(24))
    found = estimate(simulated.recording, problem(settings))
    error, _ = told(found, simulated, 3.0)
    # a spike pulls by five standard deviations of an innovation, some 0.003 deg with 8 states, 0.02 with 19
    assert error.max() < (0.03 if states == 8 else 0.15) * DEG
    assert np.nanmax(abs(found.innovations)) > 100.0


def test_saturated_samples_are_left_out():
    """Clipped at 0.95 g and 40 deg/s and masked: as good as nothing clipped. Taken for true it costs tenths."""
    settings = scenario("clipping", states=8, duration=10.0)
    simulated = simulate(settings, np.random.default_rng(25))
    masked = estimate(clipped(simulated.recording, settings), problem(settings))
    error, _ = told(masked, simulated, 3.0)
    assert error.max() < 0.01 * DEG
    blind = abs(estimate(simulated.recording, problem(settings)).theta - simulated.theta)
    assert blind[3000:].max() > 3.0 * error.max()


def without(recording, rows):
    """The recording without some of its rows."""
    columns = ("t", "acc", "gyro", "turns", "zero_angle", "reference")
    return replace(recording, **{name: np.delete(getattr(recording, name), rows, axis=0) for name in columns})


@pytest.mark.parametrize(("length", "starts"), [(5, 1), (50, 1), (500, 2), (3000, 2)])
def test_gaps(length, starts):
    """A short gap is bridged, its uncertainty told; after a long one the filter starts anew and knows its sensors."""
    settings = scenario("base", duration=10.0)
    recording = without(simulate(settings, np.random.default_rng(26)).recording, np.s_[5000 : 5000 + length])
    of = problem(settings)
    for smoothed in (False, True):
        found = estimate(recording, of, smoothed)
        assert len(found.starts) == starts
        error = abs(found.theta - recording.reference)
        late = recording.t > 2.0
        assert (error < 5.0 * found.u)[late].all()
        assert error[recording.t > recording.t[5000] + 0.2].max() < 0.06 * DEG
    before = estimate(without(recording, np.s_[5000:]), of)
    for name in ("b_2", "dr_1", "k_g"):
        k = of.names.index(name)
        assert found.state.P[k, k] <= before.state.P[k, k]


def test_stamps_that_stand_still_or_run_backward_are_left_out():
    settings = scenario("base", duration=4.0)
    simulated = simulate(settings, np.random.default_rng(27))
    t = simulated.recording.t.copy()
    t[1000:1010] = t[1000]
    t[2000] -= 0.5
    t[3000] = np.nan
    found = estimate(replace(simulated.recording, t=t), problem(settings))
    wrong = np.r_[1001:1010, 2000, 3000]
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(found.theta)), wrong)
    right = np.setdiff1d(np.arange(4000), wrong)
    kept = without(replace(simulated.recording, t=t), wrong)
    alone = estimate(kept, problem(settings))
    np.testing.assert_array_equal(found.theta[right], alone.theta)
    assert len(found.starts) == 1


def test_a_clock_that_was_set_back_is_an_error():
    settings = scenario("base", duration=4.0)
    recording = simulate(settings, np.random.default_rng(28)).recording
    t = recording.t.copy()
    t[2000:] -= 1.5
    with pytest.raises(RecordError, match="expected time to increase"):
        estimate(replace(recording, t=t), problem(settings))


@pytest.mark.parametrize("states", [8, 19])
def test_without_a_gyro(states):
    """The accelerometers alone: less certain, and as good as they say."""
    settings = scenario("base", states=states, duration=10.0)
    simulated = simulate(settings, np.random.default_rng(29))
    of = problem(settings)
    whole = estimate(simulated.recording, of)
    found = estimate(replace(simulated.recording, gyro=np.full(10000, np.nan)), of)
    error, u = told(found, simulated, 3.0)
    assert (error < 4.0 * u).all()
    assert np.median(u) > np.median(told(whole, simulated, 3.0)[1])
    assert np.isnan(found.innovations[:, 3]).all()


@pytest.mark.parametrize("which", [0, 1, 2])
def test_without_one_of_the_accelerometers(which):
    settings = scenario("base", duration=10.0)
    simulated = simulate(settings, np.random.default_rng(30))
    acc = simulated.recording.acc.copy()
    acc[:, which] = np.nan
    found = estimate(replace(simulated.recording, acc=acc), problem(settings))
    if which == 1:
        # what is left looks up and down: it does not tell nose-up from nose-down, and nothing is said
        assert np.isnan(found.theta).all()
        return
    error, u = told(found, simulated, 3.0)
    assert (error < 4.0 * u).all()


def test_an_accelerometer_that_fails_on_the_way():
    """Also the only forward one: what is known of the angle goes on with the others and the gyro."""
    settings = scenario("base", duration=10.0)
    simulated = simulate(settings, np.random.default_rng(31))
    for which in range(3):
        acc = simulated.recording.acc.copy()
        acc[5000:, which] = np.nan
        found = estimate(replace(simulated.recording, acc=acc), problem(settings))
        error, u = told(found, simulated, 3.0)
        assert (error < 4.0 * u).all()


def test_nothing_at_all_gives_nothing_and_no_more():
    """Stretches without a number, at the beginning, on the way, at the end; angles come back when readings do."""
    settings = scenario("base", duration=6.0)
    simulated = simulate(settings, np.random.default_rng(32))
    acc, gyro = simulated.recording.acc.copy(), simulated.recording.gyro.copy()
    for gone in (np.s_[:500], np.s_[3000:4000], np.s_[5500:]):
        acc[gone], gyro[gone] = np.nan, np.nan
    recording = replace(simulated.recording, acc=acc, gyro=gyro)
    for smoothed in (False, True):
        found = estimate(recording, problem(settings), smoothed)
        known = np.isfinite(found.theta)
        assert (known == (np.isfinite(found.u) & (found.u > 0.0))).all()
        assert known[[600, 2999, 4050, 5499]].all()
        assert not known[[0, 400, 3500, 5900]].any()
        assert (abs(found.theta - simulated.theta) < 5.0 * found.u)[known & (recording.t > 2.0)].all()
    none = estimate(
        replace(recording, acc=np.full((6000, 3), np.nan), gyro=np.full(6000, np.nan)), problem(settings)
    )
    assert np.isnan(none.theta).all()
    assert math.isnan(none.nis_mean)
    empty = without(recording, np.s_[:])
    assert len(estimate(empty, problem(settings), smoothed=True).theta) == 0


ABSURD = {
    "no noise": {"noise": Noise(0.0, 1e-3, 0.0, 1e-5)},
    "tiny noise": {"noise": Noise(1e-12, 1e-3, 1e-12, 1e-5)},
    "nothing unknown": {"noise": Noise(0.0, 0.0, 0.0, 0.0), "prior": Prior(0.0, 0.0, 0.0, 0.0)},
    "huge noise": {"noise": Noise(1e3, 1e3, 1e3, 1e3)},
    "huge prior": {"prior": Prior(100.0, 100.0, 100.0, 10.0)},
    "no snap": {"estimator": Estimator(snap=0.0)},
    "huge snap": {"estimator": Estimator(snap=1e20)},
    "no gate": {"estimator": Estimator(gate=math.inf)},
    "a gate for nothing": {"estimator": Estimator(gate=1e-6)},
    "a stiff sting": {"prior": Prior(heave=Heave(1e6, 0.5, 0.1))},
    "a slack sting": {"prior": Prior(heave=Heave(1e-3, 0.01, 0.1))},
}
READINGS = (math.inf, -math.inf, 1e300, 1e20, -1e5)


@pytest.mark.parametrize("case", ABSURD)
def test_absurd_settings_and_readings_end_and_report_no_missing_number(case):
    """An angle has an uncertainty, above zero, and never one without the other; it comes to an end."""
    usual = scenario("base", duration=2.0)
    recording = simulate(usual, np.random.default_rng(33)).recording
    acc, gyro = recording.acc.copy(), recording.gyro.copy()
    for k, reading in enumerate(READINGS):
        acc[500 + 100 * k, k % 3], gyro[1100 + 100 * k] = reading, reading
    for each in (recording, replace(recording, acc=acc, gyro=gyro)):
        for smoothed in (False, True):
            found = estimate(each, problem(replace(usual, **ABSURD[case])), smoothed)
            known = np.isfinite(found.theta)
            assert known.any()
            assert np.isfinite(found.u[known]).all()
            assert (found.u[known] >= 0.0).all()
            assert np.isnan(found.u[~known]).all()


def test_noise_alone_for_a_record():
    """White noise of 1000 m/s^2 for all sensors is no motion; nothing is raised, and no number is missing."""
    recording = simulate(scenario("base", duration=2.0), np.random.default_rng(34)).recording
    rng = np.random.default_rng(35)
    noise = replace(recording, acc=1e3 * rng.standard_normal((2000, 3)), gyro=1e3 * rng.standard_normal(2000))
    found = estimate(noise, problem(scenario("base")), smoothed=True)
    assert np.isfinite(found.u[np.isfinite(found.theta)]).all()
    assert found.nis_mean > 10.0 or math.isnan(found.nis_mean)


def test_samples_ten_times_slower_and_uneven():
    """100 Hz with stamps that shake by a tenth of an interval: the same filter, by its true intervals."""
    plan = MotionPlan(
        "sine", mean=20.0 * DEG, amplitude=5.0 * DEG, frequency=0.5, duration=20.0, sample_rate=1000.0
    )
    settings = study(19, motion=plan)
    simulated = simulate(settings, np.random.default_rng(36))
    rows = np.arange(0, 20000, 10) + np.random.default_rng(37).integers(-1, 2, 2000).clip(min=0)
    rows = np.unique(rows)
    recording = without(simulated.recording, np.setdiff1d(np.arange(20000), rows))
    found = estimate(recording, problem(settings))
    late = recording.t > 5.0
    assert (abs(found.theta - recording.reference) < 4.0 * found.u)[late].all()
    assert len(found.starts) == 1
    assert np.median(found.u[late]) < 5e-4 * G
