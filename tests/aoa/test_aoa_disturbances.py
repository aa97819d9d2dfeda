"""What a simulation adds to a quiet tunnel, each against its closed form: its size, its band, where it acts."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sting_study import DEG, G, study

from inercal.foundation.errors import InputError
from inercal.foundation.findings import Status
from inercal.foundation.records.read import read
from inercal.foundation.records.write import write_record
from inercal.systems.aoa.disturbances import AngleShaking, Disturbances, Mains, Plunge, Shaking, VibrationLine
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.settings import Noise
from inercal.systems.aoa.simulate import simulate, to_record
from inercal.systems.aoa.task import measure

FS = 1000.0
NONE = Noise(1e-12, 1e-12, 1e-12, 1e-12)
NO_ERRORS: dict[str, float] = {}


def rest(angle=0.0, duration=20.0, **disturbances):
    """A model at rest without noise, and what disturbs it."""
    plan = MotionPlan(
        "static", duration=duration, sample_rate=FS, first=angle * DEG, last=angle * DEG + 1e-15
    )
    of = study(motion=plan, noise=NONE, disturbances=Disturbances(**disturbances))
    return simulate(of, np.random.default_rng(5), NO_ERRORS)


def amplitudes(x):
    """Frequencies [Hz] and amplitudes of the sines in ``x`` (n,), all of whole periods."""
    return np.fft.rfftfreq(len(x), 1.0 / FS), 2.0 * np.abs(np.fft.rfft(x - x.mean())) / len(x)


def outside(x, low, high):
    """Rms of ``x`` outside of a band with margins for its windowing [Hz], over that of all."""
    f = np.fft.rfftfreq(len(x), 1.0 / FS)
    power = np.abs(np.fft.rfft((x - x.mean()) * np.hanning(len(x)))) ** 2
    return math.sqrt(power[(f < low - 1.0) | (f > high + 1.0)].sum() / power.sum())


def test_lines_shake_the_whole_model_along_z_and_x():
    lines = (VibrationLine(112.0, 0.3 * G), VibrationLine(230.0, 0.05 * G, 0.1 * G))
    acc = rest(lines=lines).recording.acc
    f, up = amplitudes(acc[:, 2])
    along = amplitudes(acc[:, 1])[1]
    for line in lines:
        assert up[np.argmin(abs(f - line.frequency))] == pytest.approx(line.level, rel=1e-6)
        assert along[np.argmin(abs(f - line.frequency))] == pytest.approx(line.axial, rel=1e-6, abs=1e-6)
    assert np.sum(up > 1e-6 * G) == len(lines)
    np.testing.assert_allclose(acc[:, 0], -acc[:, 2], atol=1e-8)


def test_local_vibration_is_of_each_accelerometer_by_itself():
    """Of 40 sines of random frequency each, over 20 s: the rms scatters by a few per cent, where two beat slowly."""
    told = rest(local_vibration=Shaking(0.5 * G, 120.0, 240.0)).recording
    shaken = told.acc - told.acc.mean(axis=0)
    assert shaken.std(axis=0) == pytest.approx(0.5 * G, rel=0.05)
    assert all(outside(each, 120.0, 240.0) < 1e-3 for each in shaken.T)
    correlation = np.corrcoef(shaken.T) - np.eye(3)
    assert np.abs(correlation).max() < 0.2
    assert np.ptp(told.gyro) < 1e-9


def test_mains_are_picked_up_by_each_channel():
    told = rest(mains=Mains(0.05 * G, 0.5 * DEG, 60.0)).recording
    f, size = amplitudes(told.acc[:, 1])
    assert size[np.argmin(abs(f - 60.0))] == pytest.approx(0.05 * G, rel=1e-6)
    assert np.ptp(told.acc, axis=0) == pytest.approx(0.1 * G, rel=0.02)
    assert np.ptp(told.gyro) == pytest.approx(1.0 * DEG, rel=0.02)
    # each with a phase of its own
    assert abs(np.corrcoef(told.acc[:, 0], told.acc[:, 2])[0, 1]) < 0.999


def test_a_buffet_turns_the_model_in_its_band_and_the_sensors_feel_it():
    """A1 + A3 = L al, and the gyro reads its rate: closed forms of a rigid body, whatever the frequencies."""
    told = rest(10.0, buffet=AngleShaking(0.1 * DEG, 5.0, 60.0))
    off = told.theta - told.theta.mean()
    assert off.std() == pytest.approx(0.1 * DEG, rel=0.05)
    assert outside(off, 5.0, 60.0) < 1e-3
    centred = np.gradient(told.theta, 1.0 / FS)[5:-5]
    np.testing.assert_allclose(told.rate[5:-5], centred, atol=0.1 * told.rate.std())
    acc = told.recording.acc
    np.testing.assert_allclose(acc[:, 0] + acc[:, 2], 0.5 * told.acceleration, atol=1e-8)
    np.testing.assert_allclose(told.recording.gyro, told.rate, atol=1e-10)


def test_a_plunge_is_along_the_vertical():
    acc = rest(30.0, plunge=Plunge(0.02 * G, 2.0)).recording.acc
    for k, share in ((0, math.cos(30.0 * DEG)), (1, 0.5), (2, math.cos(30.0 * DEG))):
        assert amplitudes(acc[:, k])[1].max() == pytest.approx(0.02 * G * share, rel=1e-6)


def test_axes_are_turned():
    acc = rest(20.0, axis_errors=(0.0, 0.3 * DEG, -0.1 * DEG), duration=0.1).recording.acc
    expected = G * np.sin(20.0 * DEG - np.array([90.0, 0.3, -90.1]) * DEG)
    np.testing.assert_allclose(acc, np.broadcast_to(expected, acc.shape), atol=1e-9)


def test_rectification_makes_an_offset_of_vibration():
    """K2 E f^2: that of gravity, and of the vibration's power."""
    k2 = 500e-6 / G
    quiet = rest(30.0, local_vibration=Shaking(3.0 * G, 120.0, 240.0)).recording.acc
    rectified = rest(30.0, local_vibration=Shaking(3.0 * G, 120.0, 240.0), rectification=k2).recording.acc
    np.testing.assert_allclose(rectified, quiet + k2 * quiet**2, rtol=1e-12)
    shift = (rectified - quiet).mean(axis=0) / G
    static = np.array([math.cos(30.0 * DEG), 0.5, math.cos(30.0 * DEG)])
    assert shift == pytest.approx(500e-6 * (9.0 + static**2), rel=0.05)


def test_a_bias_drifts_from_begin_to_end():
    told = rest(bias_drift=(0.0, 1e-3 * G, 0.0)).recording
    read = told.acc[:, 1]
    assert read[0] == pytest.approx(0.0, abs=1e-9)
    assert read[-1] == pytest.approx(1e-3 * G)
    assert read[len(read) // 2] == pytest.approx(0.5e-3 * G, rel=1e-3)
    assert np.ptp(told.acc[:, 0]) < 1e-9


def test_jitter_of_stamps_moves_readings_by_their_slope():
    """dA tau, of the standard deviation 0.1 ms times the rms slope; 20000 samples, four deviations."""
    plan = MotionPlan("sine", duration=20.0, sample_rate=FS, amplitude=10.0 * DEG, frequency=1.0)
    steady = study(motion=plan, noise=NONE, r=(-0.25, 0.0, 0.25))
    told = [
        simulate(replace(steady, disturbances=each), np.random.default_rng(3), NO_ERRORS)
        for each in (Disturbances(), Disturbances(stamp_jitter=1e-4))
    ]
    np.testing.assert_array_equal(told[0].theta, told[1].theta)
    off = (told[1].recording.acc - told[0].recording.acc)[:, 1]
    slope = G * np.cos(told[0].theta) * told[0].rate
    expected = 1e-4 * np.sqrt(np.mean(slope**2))
    assert off.std() == pytest.approx(expected, rel=4.0 * math.sqrt(1.5 / 2.0 / len(off)))


def test_sensors_with_rates_of_their_own(tmp_path):
    plan = MotionPlan("sine", duration=2.0, sample_rate=FS, amplitude=10.0 * DEG, frequency=1.0)
    of = study(motion=plan)
    slow = replace(of, disturbances=Disturbances(sample_rates={"gyro": 250.0, "a2": 500.0}))
    recording = simulate(of, np.random.default_rng(1)).recording
    whole, record = to_record(recording, of), to_record(recording, slow)
    for name, every in (("a1", 1), ("a2", 2), ("a3", 1), ("gyro", 4)):
        np.testing.assert_array_equal(record[name].values, whole[name].values[::every])
        np.testing.assert_array_equal(record[name].t, whole[name].t[::every])
    assert record["a1"].t is record["a3"].t
    write_record(record, tmp_path / "slow.h5")
    again = read(tmp_path / "slow.h5")
    assert {name: len(again[name].t) for name in ("a1", "a2", "gyro")} == {
        "a1": 2000,
        "a2": 1000,
        "gyro": 500,
    }
    with pytest.raises(InputError, match="another clock"):
        write_record(record, tmp_path / "slow.csv")


@pytest.mark.slow
@pytest.mark.parametrize(
    "rates",
    [
        {"a1": 500.0, "a2": 250.0, "gyro": 125.0},
        *(pytest.param(each, marks=pytest.mark.campaign) for each in ({"a2": 250.0}, {"gyro": 250.0})),
    ],
)
def test_the_angle_with_sensors_at_rates_of_their_own(rates):
    """30 deg + 10 deg at 1 Hz, 1 kHz the fastest: within u, over four draws of the biases."""
    plan = MotionPlan("sine", mean=0.5, duration=15.0, sample_rate=FS, amplitude=10.0 * DEG, frequency=1.0)
    of = study(motion=plan, disturbances=Disturbances(sample_rates=rates))
    squares = []
    for seed in range(4):
        told = simulate(of, np.random.default_rng(seed))
        measured = measure(to_record(told.recording, of), of)
        assert measured.estimate.status is Status.OK, measured.estimate.message
        late = told.recording.t > 3.0
        error = measured.angles.theta - told.theta
        squares.append(np.nanmean((error / measured.angles.u)[late] ** 2))
        assert np.isfinite(error[late]).all()
    assert math.sqrt(np.mean(squares)) < 1.0 + 4.0 / math.sqrt(2.0 * 4.0)
