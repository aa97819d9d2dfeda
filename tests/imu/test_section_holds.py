"""Holds found in recordings: laws that must hold of any recording, and simulated ones whose rests are known."""

import numpy as np
import pytest
from held_recordings import GRAVITY, Handling, held
from recordings import arrays, shipped
from scipy.spatial.transform import Rotation

from inercal.systems.imu.sections.cutting.holds import holds_of

TABLE = Handling(20, rest=(5.0, 6.0), tremor=0.0, tremor_rate=0.0, noise=2e-3, gyro_noise=1e-4)
SMOOTH = Handling(24, rest=(2.0, 3.0), move=(2.0, 3.0), tremor=0.0, tremor_rate=0.0, jolt=0.0, noise=0.01)
RECORDINGS = {
    "xsens": lambda: arrays(shipped("xsens")[0]),
    "mpu6050": lambda: arrays(shipped("mpu6050")[0]),
    "hand": lambda: held(1)[:3],
    "restless hand": lambda: held(2, Handling(tremor=0.05, tremor_rate=0.03))[:3],
    "table": lambda: held(3, TABLE)[:3],
    "smooth turns": lambda: held(4, SMOOTH)[:3],
    "table, then hand": lambda: held(5, Handling(first=60.0))[:3],
}
CLEAR = 0.9  # s: shorter ones may be found or not, so near to the shortest


def spans(t, holds):
    return [(float(t[hold.start]), float(t[hold.stop - 1])) for hold in holds]


def variants(t, acc, gyro):
    """What is done to a recording, time and outputs then, and where its times lie in the recording."""
    n, mirror = len(t), t[0] + t[-1]
    for k in (2, 3):
        for phase in range(k):
            yield f"1 in {k}, from {phase}", t[phase::k], acc[phase::k], gyro[phase::k], lambda a, b: (a, b)
    yield "reversed", mirror - t[::-1], acc[::-1], -gyro[::-1], lambda a, b: (mirror - b, mirror - a)
    yield "no gyro", t, acc, None, lambda a, b: (a, b)
    yield "first tenth cut", t[n // 10 :], acc[n // 10 :], gyro[n // 10 :], lambda a, b: (a, b)
    yield "last tenth cut", t[: -n // 10], acc[: -n // 10], gyro[: -n // 10], lambda a, b: (a, b)
    turned = Rotation.from_euler("xyz", [0.5, 0.9, -1.2])
    yield "turned", t, turned.apply(acc), turned.apply(gyro), lambda a, b: (a, b)
    again = np.concatenate([t, t + t[-1] - t[0] + t[1] - t[0]])
    yield "twice", again, np.concatenate([acc, acc]), np.concatenate([gyro, gyro]), lambda a, b: (a, b)


def lost(here, there, begin, end):
    """The clear spans of one list, within the times that both have, that the other does not cover for two thirds."""
    for a, b in here:
        covered = sum(max(min(b, d) - max(a, c), 0.0) for c, d in there)
        if b - a >= CLEAR and a >= begin and b <= end and covered < 0.66 * (b - a):
            yield round(a, 2), round(b, 2)


@pytest.mark.parametrize("name", RECORDINGS)
def test_the_same_holds_are_found_whatever_is_done_to_a_recording(name):
    t, acc, gyro = RECORDINGS[name]()
    found = holds_of(t, acc, gyro)
    wrong = []
    for what, time, f, w, back in variants(t, acc, gyro):
        others = holds_of(time, f, w)
        ends = back(float(time[0]), float(time[-1]))
        begin, end = max(ends[0], float(t[0])) + 0.5, min(ends[1], float(t[-1])) - 0.5
        for sensor in ("acc",) if w is None else ("acc", "gyro"):
            here, there = (
                spans(t, getattr(found, sensor)),
                [back(*span) for span in spans(time, getattr(others, sensor))],
            )
            unsure = [(t[one.start], t[one.stop - 1]) for one in found.unused]
            unsure += [back(time[one.start], time[one.stop - 1]) for one in others.unused]
            wrong += [(what, sensor, span) for span in lost(here, there + unsure, begin, end)]
            wrong += [(what, sensor, span) for span in lost(there, here + unsure, begin, end)]
    assert wrong == []


@pytest.mark.parametrize("how", [Handling(), Handling(tremor=0.05, tremor_rate=0.03), Handling(first=60.0)])
@pytest.mark.parametrize("seed", range(3))
def test_short_rests_in_the_hand_are_found(seed, how):
    """54 rests of 0.7 to 2.5 s, which lose up to 0.1 s at either end to the motions beside them."""
    t, acc, gyro, truth = held(seed, how)
    found = spans(t, holds_of(t, acc, gyro).acc)
    for a, b in found:
        assert any(a > begin - 0.15 and b < end + 0.15 for begin, end in truth)
    assert sum(any(a < end and b > begin for a, b in found) for begin, end in truth) >= 50


def test_holds_reach_to_where_the_motion_begins():
    t, acc, gyro, truth = held(6, TABLE)
    found = spans(t, holds_of(t, acc, gyro).acc)
    assert len(found) == len(truth)
    edges = np.array(found) - np.array(truth)
    assert np.all(np.abs(edges[1:-1]) < 0.15)


def test_a_rest_that_begins_in_a_smooth_turn_about_the_vertical_is_none():
    """The accelerometers see nothing of these turns; without the gyro all is one rest."""
    how = Handling(6, rest=(3.0, 4.0), move=(4.0, 5.0), tremor=0.0, tremor_rate=0.0, jolt=0.0, arm=0.0)
    axes = [(0.0, 0.0, 1.5), (0.0, 0.0, -2.0), (1.57, 0.0, 0.0), (0.0, 1.5, 0.0), (0.0, -1.0, 0.0)]
    t, acc, gyro, truth = held(7, how, axes)
    gyro_holds = spans(t, holds_of(t, acc, gyro).acc)
    assert len(gyro_holds) == 6
    assert np.max(np.abs(np.array(gyro_holds) - np.array(truth))) < 0.6  # smooth: 0.05 rad/s after 0.5 s
    assert len(holds_of(t, acc, None).acc) < 6


def test_a_recording_that_never_moves_is_one_hold():
    rng = np.random.default_rng(8)
    t = np.arange(6000) / 100.0
    acc = rng.normal(size=(6000, 3)) * 0.02 + [0.1, 0.2, GRAVITY]
    found = holds_of(t, acc, rng.normal(size=(6000, 3)) * 1e-3)
    assert [spans(t, found.acc), spans(t, found.gyro)] == [[(0.0, 59.99)]] * 2


def test_a_hinge_that_never_stops_has_no_hold():
    rng = np.random.default_rng(9)
    t = np.arange(30000) / 20.0
    angle = 2.0 * np.sin(0.7 * t) + 0.5 * np.sin(1.9 * t)
    acc = GRAVITY * np.stack([np.sin(angle), np.zeros_like(t), np.cos(angle)], axis=1)
    acc += 0.02 * rng.normal(size=acc.shape)
    gyro = np.stack([np.zeros_like(t), np.gradient(angle, t), np.zeros_like(t)], axis=1)
    found = holds_of(t, acc, gyro + 1e-3 * rng.normal(size=acc.shape))
    assert sum(b - a for a, b in spans(t, found.acc)) < 0.02 * t[-1]


def test_missing_rows_and_gaps_end_a_hold():
    t, acc, gyro, truth = held(10, TABLE)
    begin, end = truth[5]
    middle = int(np.searchsorted(t, 0.5 * (begin + end)))
    broken = acc.copy()
    broken[middle : middle + 5] = np.nan
    later = t + 10.0 * (np.arange(len(t)) >= middle)
    for time, f in ((t, broken), (later, acc)):
        found = holds_of(time, f, gyro).acc
        assert not any(hold.start < middle < hold.stop - 1 for hold in found)
        assert all(np.isfinite(hold.of(f)).all() for hold in found)
        assert len(found) == 21


def test_a_hold_that_drifts_is_named():
    t, acc, gyro, truth = held(11, TABLE)
    begin, end = truth[4]
    inside = (t >= begin) & (t <= end)
    acc[inside, 0] += np.linspace(0.0, 0.6, np.count_nonzero(inside))
    found = holds_of(t, acc, gyro)
    assert len(found.acc) == 19
    (unused,) = found.unused
    assert begin < 0.5 * (t[unused.start] + t[unused.stop - 1]) < end
    assert "drifts" in unused.why
