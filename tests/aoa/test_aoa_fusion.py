"""The causal filter and the smoother: against a dense twin, against filterpy, and against their own laws."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from filterpy.kalman import ExtendedKalmanFilter
from fusion_twin import Twin, believed_of, beyond, motion_of, run
from hypothesis import given, settings
from hypothesis import strategies as st
from sting_study import BASE, DEG, NOISE, G, scenario, study

from inercal.foundation.units import Quantity, parse_unit
from inercal.systems.aoa.disturbances import Disturbances, Oscillation
from inercal.systems.aoa.fusion import smoother
from inercal.systems.aoa.fusion.filter_result import estimate
from inercal.systems.aoa.fusion.loop import OUTPUTS
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.fusion.run import advance, initial
from inercal.systems.aoa.layout import Layout
from inercal.systems.aoa.limits import LIMITS
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.reading.recording import plain
from inercal.systems.aoa.settings import Attitude, Estimator, Heave, Prior, Timing
from inercal.systems.aoa.simulate import simulate

ROLLED = Attitude(roll=Quantity(0.5, 1e-3, parse_unit("rad"), ""))
COUPLED = Disturbances(yaw=Oscillation(1.0 * DEG, 8.0), roll=Oscillation(2.0 * DEG, 3.0))
WANDERING = replace(NOISE, accelerometer_walk=1e-3 * G, gyro_walk=0.1 * DEG)
PLUNGING = replace(Prior(), heave=Heave(25.0 / (2.0 * math.pi), 0.9, 0.3, "vertical"))
CASES = {
    "8": ({"states": 8}, False),
    "11, rolled": ({"states": 11, "attitude": ROLLED}, False),
    "15": ({"states": 15}, False),
    "19": ({"states": 19}, False),
    "19, plunge": ({"states": 19, "prior": PLUNGING}, False),
    "15, plunge, spatial": ({"states": 15, "prior": PLUNGING, "disturbances": COUPLED}, True),
    "19, delay": ({"states": 19, "timing": Timing(gyro_delay=None)}, False),
    "8, known delay": ({"states": 8, "timing": Timing(gyro_delay=2e-3)}, False),
    "8, spatial": ({"states": 8, "disturbances": COUPLED}, True),
    "8, spatial, walks": ({"states": 8, "noise": WANDERING, "disturbances": COUPLED}, True),
    "19, spatial, delay": (
        {"states": 19, "disturbances": COUPLED, "timing": Timing(gyro_delay=None)},
        True,
    ),
}


def spoiled(recording, rng):
    """Masked samples, uneven stamps with a gap, spikes, and an angle that is stated for a while."""
    t = recording.t + rng.uniform(-2e-4, 2e-4, len(recording.t))
    t[300:] += 0.02
    # to the nanosecond, as the filter takes intervals
    t = np.round(t * 1e9) / 1e9
    acc, gyro, stated = recording.acc.copy(), recording.gyro.copy(), recording.zero_angle.copy()
    acc[rng.random(acc.shape) < 0.05] = np.nan
    acc[150:170, 1] = np.nan
    gyro[200:230] = np.nan
    acc[250, 0] += 5.0
    stated[350:360] = recording.reference[350:360, None]
    stated[350:360, 1] = 1e-4
    return replace(recording, t=t, acc=acc, gyro=gyro, zero_angle=stated)


def trace(of, recording, block=smoother.BLOCK):
    return advance(initial(of), of, recording.t, recording.rows, last=True, block=block)


@pytest.mark.slow
@pytest.mark.kernels
@pytest.mark.parametrize("case", CASES)
def test_filter_and_smoother_are_those_of_dense_matrices(case):
    """400 spoiled rows: a filter in dense matrices and Joseph's form, and the smoother of Rauch, Tung and Striebel."""
    changes, spatial = CASES[case]
    told = study(motion=replace(BASE, duration=0.4), **changes)
    rng = np.random.default_rng(20261121)
    recording = spoiled(simulate(told, rng).recording, rng)
    of = problem(told, spatial)
    _, found = trace(of, recording)
    (start,) = found.starts
    assert start.row == 0
    kept = np.full((400, 2 * of.size), np.nan)
    smoothed = smoother.smooth(of, recording.t, recording.rows, found, kept, 1)
    x, P, xs, Ps, innovations = run(Twin(told, of.names, spatial), start, recording.t, recording.rows)
    u, us = (np.sqrt(np.diagonal(each, axis1=1, axis2=2)) for each in (P, Ps))
    # in standard deviations: rounding through some thousand updates, amplified where the filter starts
    for column, k in ((0, 0), (2, 1)):
        np.testing.assert_allclose(found.out[:, column] / u[:, k], x[:, k] / u[:, k], rtol=0, atol=1e-4)
        np.testing.assert_allclose(found.out[:, column + 1], u[:, k], rtol=1e-5)
        np.testing.assert_allclose(smoothed[:, column] / us[:, k], xs[:, k] / us[:, k], rtol=0, atol=1e-4)
        np.testing.assert_allclose(smoothed[:, column + 1], us[:, k], rtol=1e-4)
    np.testing.assert_allclose(found.out[:, OUTPUTS:], innovations, rtol=1e-6, atol=1e-6)
    assert np.nanmax(abs(innovations)) > 5.0  # the gate had something to hold back
    np.testing.assert_allclose(kept[:, : of.size] / us, xs / us, rtol=0, atol=1e-3)
    np.testing.assert_allclose(kept[:, of.size :], us, rtol=1e-3)


def test_the_states_at_all_rows_do_not_depend_on_blocks():
    """The smoother's blocks are a matter of memory alone: the same digits for any."""
    told = scenario("base", duration=0.6)
    recording = spoiled(simulate(told, np.random.default_rng(2)).recording, np.random.default_rng(3))
    of = problem(told)
    _, found = trace(of, recording)
    once = smoother.smooth(of, recording.t, recording.rows, found)
    for block in (1, 7, 599, 600, 601):
        _, found = trace(of, recording, block)
        again = smoother.smooth(of, recording.t, recording.rows, found)
        np.testing.assert_array_equal(again, once)


@pytest.fixture(scope="module")
def interrupted():
    """2 s with all that can happen: masked samples, a gap that the filter bridges, two it does not, none at all."""
    told = scenario("base", duration=2.0)
    recording = simulate(told, np.random.default_rng(5)).recording
    recording = spoiled(recording, np.random.default_rng(6))
    t, acc, gyro = recording.t.copy(), recording.acc.copy(), recording.gyro.copy()
    t[700:] += 0.8
    t[1400:] += 30.0
    acc[1400:1475], gyro[1400:1475] = np.nan, np.nan
    return told, replace(recording, t=t, acc=acc, gyro=gyro)


@settings(max_examples=25, deadline=None)
@given(cuts=st.lists(st.integers(0, 2000), max_size=12))
def test_blocks_of_any_sizes_give_the_same_digits(interrupted, cuts):
    told, recording = interrupted
    of = problem(told)
    state, whole = trace(of, recording)
    assert len(whole.starts) == 3
    going, out = initial(of), []
    edges = [0, *sorted(cuts), 2000]
    for a, b in pairwise(edges):
        going, part = advance(going, of, recording.t[a:b], recording.rows[a:b], last=b == 2000)
        out.append(part.out)
    np.testing.assert_array_equal(np.concatenate(out), whole.out)
    for one, other in zip(going, state, strict=True):
        np.testing.assert_array_equal(one, other)


def test_row_by_row_gives_the_same_digits(interrupted):
    told, recording = interrupted
    of = problem(told)
    _, whole = trace(of, recording)
    going, out = initial(of), []
    for k in range(2000):
        going, part = advance(going, of, recording.t[k : k + 1], recording.rows[k : k + 1])
        assert len(going.held) < LIMITS.starting_rows
        out.append(part.out)
    going, part = advance(going, of, recording.t[:0], recording.rows[:0], last=True)
    np.testing.assert_array_equal(np.concatenate([*out, part.out]), whole.out)


def test_across_a_restart_motion_is_forgotten_and_the_sensors_are_not(interrupted):
    """Before a gap the smoother's angles are those of a recording that ends there, but for what is learned of sensors.

    With sensors that are known (8 states, biases of no size, no delay) it is all the same.
    """
    told, recording = interrupted
    known = replace(told, noise=replace(told.noise, accelerometer_bias=1e-9 * G, gyro_bias=1e-9 * DEG))
    known = replace(known, estimator=Estimator(8), timing=Timing(0.0))
    cut = replace(
        recording, **{k: getattr(recording, k)[:700] for k in ("t", "acc", "gyro", "turns", "zero_angle")}
    )
    of = problem(known)
    whole, alone = estimate(recording, of, smoothed=True), estimate(cut, of, smoothed=True)
    assert whole.starts[1] == 700
    np.testing.assert_allclose(whole.u[:700], alone.u, rtol=1e-5)
    np.testing.assert_allclose(whole.theta[:700], alone.theta, atol=1e-3 * alone.u.max())
    of = problem(told)
    whole, alone = estimate(recording, of, smoothed=True), estimate(cut, of, smoothed=True)
    assert (whole.u[:700] < alone.u).all()
    assert np.median(whole.u[:700] / alone.u) < 0.99
    # where nothing was measured there is no angle, neither causal nor smoothed
    assert np.isnan(whole.theta[1400:1475]).sum() >= 60
    assert np.isfinite(whole.theta[1480:]).all()


def test_after_a_gap_roll_is_what_is_stated():
    """A gap of 0.3 s tells nothing of roll, here of 2 deg at 3 Hz about 0: taken for 0 afterwards, that costs at most
    1 - cos of twice it, 0.14 deg x sin theta cos theta."""
    told = study(motion=replace(BASE, duration=4.0), disturbances=COUPLED)
    recording = simulate(told, np.random.default_rng(8)).recording
    rows = np.delete(np.arange(4000), np.s_[2000:2300])
    columns = ("t", "acc", "gyro", "turns", "zero_angle", "reference")
    recording = replace(recording, **{name: getattr(recording, name)[rows] for name in columns})
    of = problem(told, spatial=True)
    for smoothed in (False, True):
        found = estimate(recording, of, smoothed)
        assert found.starts == (0, 2000)
        error = abs(found.theta - recording.reference)
        assert (error < 5.0 * found.u)[500:2000].all()
        assert error[2100:].max() < 0.1 * DEG


@pytest.mark.parametrize("states", [8, 19])
def test_filterpy_finds_the_same(states):
    """Its extended Kalman filter, fed with one scalar after the other; no spikes, so no gate."""
    told = scenario("base", states=states, duration=0.3)
    recording = simulate(told, np.random.default_rng(9)).recording
    of = problem(told)
    _, found = trace(of, recording)
    (start,) = found.starts
    twin = Twin(told, of.names)
    theirs = ExtendedKalmanFilter(dim_x=of.size, dim_z=1)
    theirs.x, theirs.P = start.x.copy(), start.P.copy()
    _, F, Q = twin.transition(start.x, 1e-3, 0.0, 0.0)
    theirs.F, theirs.Q = F, Q
    x, u = [], []
    for k, row in enumerate(recording.rows):
        motion, believed = motion_of(theirs.x, theirs.P), believed_of(twin, theirs.x, theirs.P)
        if k:
            theirs.predict()
        ahead = theirs.x.copy()
        for i in range(4):
            told_of, h, R = twin.reading(ahead, i, row, motion)
            h = h * believed
            R += beyond(twin, theirs.P, believed) if i == 3 else 0.0
            theirs.update(
                row[i : i + 1],
                HJacobian=lambda x, h=h: h[None, :],
                Hx=lambda x, h=h, told_of=told_of, ahead=ahead: np.array([told_of + h @ (x - ahead)]),
                R=np.array([[R]]),
            )
        x.append(theirs.x[:2].copy())
        u.append(np.sqrt(np.diag(theirs.P)[:2]))
    assert np.nanmax(abs(found.out[:, OUTPUTS:])) < 5.0
    np.testing.assert_allclose(found.out[:, [0, 2]] / u, x / np.array(u), rtol=0, atol=1e-5)
    np.testing.assert_allclose(found.out[:, [1, 3]], u, rtol=1e-5)


#: accelerometers at +x, -z, +z, and two more
ANGLES, ARMS = np.array([0.5 * math.pi, 0.0, -0.5 * math.pi, 0.0, 0.25 * math.pi]), np.array(
    [-0.25, 0.20, 0.25, -0.1, 0.15]
)  # fmt: skip


def test_any_number_of_accelerometers():
    """Two to five: the error is within its uncertainty, which falls with each that is added."""
    us = []
    for n in (2, 3, 4, 5):
        axes = Layout(tuple(f"a{k + 1}" for k in range(n)), ANGLES[:n], ARMS[:n], np.zeros(n))
        told = study(layout=axes, motion=replace(BASE, duration=6.0))
        simulated = simulate(told, np.random.default_rng(11))
        found = estimate(simulated.recording, problem(told), smoothed=True)
        late = simulated.recording.t > 2.0
        error = found.theta - simulated.theta
        # biases make the error a single draw; 4 is once in 16000
        assert (abs(error) < 4.0 * found.u)[late].all()
        us.append(np.median(found.u[late]))
    assert (np.diff(us) < 0.0).all()


def test_without_gyros_yaw_costs_what_the_specification_says_and_with_them_it_is_gone():
    """1 deg of yaw at 8 Hz, about r y^2 of 0.25 m x (0.88 rad/s)^2 beside g: 0.14 to 0.75 deg."""
    told = study(
        motion=replace(BASE, duration=8.0), disturbances=Disturbances(yaw=Oscillation(1.0 * DEG, 8.0))
    )
    simulated = simulate(told, np.random.default_rng(12))
    late = simulated.recording.t > 3.0
    worst = {}
    for spatial in (False, True):
        found = estimate(simulated.recording, problem(told, spatial))
        error = abs(found.theta - simulated.theta)[late]
        worst[spatial] = error.max() / DEG
        if spatial:
            assert (error < 4.0 * found.u[late]).all()
    assert 0.14 < worst[False] < 0.75
    assert worst[True] < 0.03


@pytest.mark.parametrize("delay", [-2e-3, 2e-3])
def test_the_delay_of_the_gyro_is_found(delay):
    """2 ms either way: within 4 standard deviations, of 0.1 ms at most, and the angle as without it."""
    told = study(
        motion=replace(BASE, duration=6.0),
        timing=Timing(gyro_delay=None),
        disturbances=Disturbances(gyro_delay=delay),
    )
    simulated = simulate(told, np.random.default_rng(13))
    of = problem(told)
    found = estimate(simulated.recording, of)
    at = of.names.index("tau_g")
    u = math.sqrt(found.state.P[at, at])
    assert u < 1e-4
    assert abs(found.state.x[at] - delay) < 4.0 * u
    late = simulated.recording.t > 3.0
    assert (abs(found.theta - simulated.theta) < 4.0 * found.u)[late].all()
    # taken for none it makes the rate wrong by tau theta'', 0.8 deg/s
    blind = estimate(simulated.recording, problem(replace(told, timing=Timing(0.0))))
    of_rate = [abs(each.rate - simulated.rate)[late].max() for each in (found, blind)]
    assert of_rate[1] > 1.5 * of_rate[0]


def test_a_stated_roll_is_taken_off():
    """28.6 deg of roll: stated, the pitch is within its uncertainty; not stated, it is off by degrees."""
    told = study(motion=replace(BASE, duration=6.0), attitude=ROLLED)
    simulated = simulate(told, np.random.default_rng(14))
    late = simulated.recording.t > 2.0
    found = estimate(simulated.recording, problem(told))
    assert (abs(found.theta - simulated.theta) < 4.0 * found.u)[late].all()
    blind = estimate(simulated.recording, problem(replace(told, attitude=Attitude())))
    assert abs(blind.theta - simulated.theta)[late].max() > 2.0 * DEG


def test_a_common_delay_is_made_up_for_and_counted():
    """Stated, 5 ms late at up to 63 deg/s: theta' tau taken off, and its uncertainty theta' u(tau) added."""
    told = study(
        motion=replace(BASE, duration=6.0),
        timing=Timing(common_delay=5e-3, common_delay_u=1e-4),
        disturbances=Disturbances(common_delay=5e-3),
    )
    simulated = simulate(told, np.random.default_rng(15))
    late = simulated.recording.t > 2.0
    for smoothed in (False, True):
        found = estimate(simulated.recording, problem(told), smoothed)
        exact = estimate(
            simulated.recording, problem(replace(told, timing=Timing(common_delay=5e-3))), smoothed
        )
        assert (abs(exact.theta - simulated.theta) < 4.0 * exact.u)[late].all()
        np.testing.assert_array_equal(found.theta, exact.theta)
        expected = np.hypot(exact.u, 1e-4 * found.rate)
        np.testing.assert_allclose(found.u[late], expected[late], rtol=1e-3)


def test_the_filter_starts_with_what_three_axes_show_at_rest():
    """theta = atan2(A2, (A3 - A1)/2), all around the circle, and the acceleration (A1 + A3)/(r3 - r1)."""
    of = problem(study(8))
    for theta in np.radians([-170.0, -90.0, -30.0, 0.0, 45.0, 90.0, 179.0]):
        al = 2.0
        axes = of.layout
        read = G * np.sin(theta - axes.angle) - np.sin(axes.angle) * axes.r * al
        acc = np.tile(read, (LIMITS.starting_rows, 1))
        recording = plain(np.arange(LIMITS.starting_rows) * 1e-3, acc, np.zeros(LIMITS.starting_rows))
        _, found = trace(of, recording)
        x = found.starts[0].x
        assert x[0] == pytest.approx(math.atan2(read[1], (read[2] - read[0]) / 2.0), abs=1e-12)
        assert x[2] == pytest.approx((read[0] + read[2]) / 0.5, abs=1e-9)


ALL_THE_WAY = {
    "swing": MotionPlan("sine", duration=8.0, amplitude=90.0 * DEG, frequency=0.25),
    "pauses": MotionPlan(
        "pitch-pause", first=-90.0 * DEG, last=90.0 * DEG, step=45.0 * DEG, move=1.0, pause=1.0
    ),
    "buffet at 90": MotionPlan("buffet", duration=5.0, mean=90.0 * DEG, rms=0.2 * DEG, low=2.0, high=15.0),
    "buffet at -90": MotionPlan("buffet", duration=5.0, mean=-90.0 * DEG, rms=0.2 * DEG, low=2.0, high=15.0),
}


@pytest.mark.parametrize("states", [8, 19])
@pytest.mark.parametrize("name", ALL_THE_WAY)
def test_through_90_deg_either_way(name, states):
    """Turning, at rest and shaking, where sin(theta) is flat: the angle is within 5 u, and u is below 0.05 deg."""
    told = study(states, motion=ALL_THE_WAY[name])
    simulated = simulate(told, np.random.default_rng(90))
    late = simulated.recording.t > 2.0
    for smoothed in (False, True):
        found = estimate(simulated.recording, problem(told), smoothed)
        assert len(found.starts) == 1
        assert (abs(found.theta - simulated.theta) < 5.0 * found.u)[late].all()
        assert found.u[late].max() < 0.05 * DEG


def test_a_stated_angle_calibrates_the_sensors():
    """Wind-off at a known angle: biases are learned, and the angle after it is the better for it."""
    told = study(8, motion=replace(BASE, duration=6.0, amplitude=0.0))
    simulated = simulate(told, np.random.default_rng(16))
    stated = np.full((6000, 2), np.nan)
    stated[:2000] = np.column_stack([simulated.theta[:2000], np.full(2000, 1e-6)])
    of = problem(told)
    without = estimate(simulated.recording, of)
    found = estimate(replace(simulated.recording, zero_angle=stated), of)
    assert (abs(found.theta - simulated.theta) < 4.0 * found.u)[2000:].all()
    assert found.u[-1] < 0.3 * without.u[-1]
