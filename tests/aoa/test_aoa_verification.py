"""A turntable: errors against the reference, and sensors that are fitted to it."""

import math
from dataclasses import replace

import numpy as np
import pytest
from sting_study import DEG, G, layout, study

from inercal.foundation.errors import RecordError
from inercal.systems.aoa.angles import Angles
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.reading.recording import plain
from inercal.systems.aoa.reference.readings import reference
from inercal.systems.aoa.reference.sensor_fit import _linearised, fit, fit_terms
from inercal.systems.aoa.result.verification import errors
from inercal.systems.aoa.simulate import simulate

WIDE = MotionPlan(
    "two-tone",
    duration=20.0,
    sample_rate=500.0,
    mean=35.0 * DEG,
    amplitude=40.0 * DEG,
    frequency=0.15,
    second_amplitude=3.0 * DEG,
    second_frequency=3.0,
)

SCALES = np.array([1.0008, 0.9995, 1.0003])
AXES = np.array([1e-4, -3e-4, 5e-4])
"""Errors of scale and axis [rad] of the sensors that are fitted."""

R = np.array([2e-3, -1e-3, 3e-3])
Z = (5e-3, -3e-3, 4e-3)


def angles(theta, u=1e-5):
    n = len(theta)
    return Angles("test", theta, np.full(n, u), np.zeros(n), np.full(n, 1e-3))


def turned(seed, noise=2e-6, motion=WIDE, scales=SCALES):
    """A recording on a turntable whose sensors are off, the study that knows nothing of it, and the truth."""
    true = layout(r=np.array([-0.25, 0.20, 0.25]) + R, z=Z)
    true = replace(true, angle=true.angle + AXES)
    rng = np.random.default_rng(seed)
    simulated = simulate(study(motion=motion, layout=true), rng)
    recording = simulated.recording
    recording = replace(
        recording,
        acc=recording.acc * scales,
        reference=recording.reference + noise * rng.standard_normal(len(recording.t)),
    )
    truth = {name: value for name, value in simulated.errors.items() if name.startswith("b_")}
    for k in range(3):
        truth |= {
            f"S_{k + 1}": scales[k],
            f"dlambda_{k + 1}": AXES[k],
            f"dr_{k + 1}": R[k],
            f"zo_{k + 1}": Z[k],
        }
    return recording, study(motion=motion), truth, simulated


def recalibrated(recording, settings):
    """The recording as reading it again under other calibrations gives it; it had none before."""
    known = [settings.calibration(name) for name in (*settings.layout.names, "gyro")]
    scale, bias = np.array([each.scale for each in known]), np.array([each.bias for each in known])
    return replace(
        recording, acc=recording.acc * scale[:3] - bias[:3], gyro=recording.gyro * scale[3] - bias[3]
    )


def test_errors_are_those_of_the_rows_that_stand_still_and_of_those_that_move():
    t = np.arange(0.0, 20.0, 0.01)
    theta = np.where(t < 10.0, 0.1, 0.1 + 0.2 * (t - 10.0))
    off = np.where(t < 10.0, 1e-3, -3e-3)
    found = errors(replace(plain(t, np.zeros((2000, 3)), t), reference=theta), angles(theta + off))
    assert found.static.max_abs == pytest.approx(1e-3)
    assert found.static.mean == pytest.approx(1e-3)
    assert found.moving.rms == pytest.approx(3e-3, rel=0.01)
    assert found.moving.mean == pytest.approx(-3e-3, rel=0.02)
    assert found.all.max_abs == pytest.approx(3e-3)
    assert found.all.rows == found.static.rows + found.moving.rows == 1800
    assert found.static.ratio == pytest.approx(100.0)


def test_errors_do_not_jump_at_180_deg_and_leave_out_what_is_unknown():
    t = np.arange(0.0, 10.0, 0.01)
    theta = np.linspace(3.0, 3.3, 1000)
    told = np.remainder(theta + 1e-3 + math.pi, 2.0 * math.pi) - math.pi
    told[500:600] = np.nan
    recording = replace(plain(t, np.zeros((1000, 3)), t), reference=theta.copy())
    recording.reference[700:800] = np.nan
    found = errors(recording, angles(told), after=0.0)
    assert found.all.max_abs == pytest.approx(1e-3)
    assert found.all.rows == 800


def test_a_record_without_a_reference_cannot_be_verified():
    none = plain(np.arange(10.0), np.zeros((10, 3)), np.zeros(10))
    with pytest.raises(RecordError, match="expected a reference angle"):
        errors(none, angles(np.zeros(10)))
    with pytest.raises(RecordError, match="expected a reference angle"):
        fit(none, study())
    with pytest.raises(RecordError, match="found 10 rows with a reference angle, expected 50"):
        fit(replace(none, reference=np.zeros(10)), study())


@pytest.fixture(scope="module")
def fits():
    """Fits of many draws of noise and biases, with their truths."""
    return [
        (fit(recording, settings), truth) for recording, settings, truth, _ in map(turned, range(900, 940))
    ]


def test_errors_of_a_fit_are_as_large_as_their_uncertainty(fits):
    names = fits[0][0].names
    z = np.array(
        [[(each[name].value - truth.get(name, 0.0)) / each[name].u for name in names] for each, truth in fits]
    )
    assert all(each.converged for each, _ in fits)
    # rms of 40 numbers: four standard deviations, and a tenth for the covariance found from 400 rows; noise of the
    # reference's second derivative is taken as more than it does
    rms = np.sqrt(np.mean(z**2, axis=0))
    assert (rms < 1.1 + 4.0 / math.sqrt(2.0 * len(fits))).all(), dict(zip(names, rms.round(2), strict=True))
    assert (rms > 0.5).all(), dict(zip(names, rms.round(2), strict=True))
    assert (np.abs(z.mean(axis=0)) < 4.5 / math.sqrt(len(fits))).all()


def test_an_axis_error_of_a_tenth_of_a_milliradian_is_found(fits):
    found, _ = fits[0]
    assert found["dlambda_1"].u < 2e-5
    assert found["dlambda_1"].value == pytest.approx(1e-4, abs=4.5 * found["dlambda_1"].u)
    assert found.unseen == ()


def test_noise_is_that_of_one_sample(fits):
    found = np.mean([each.noise for each, _ in fits], axis=0)
    assert found[1] == pytest.approx(1e-4 * G, rel=0.05)
    assert found[3] == pytest.approx(0.2 * DEG, rel=0.05)
    assert np.mean([each.reference_noise for each, _ in fits]) == pytest.approx(2e-6, rel=0.03)


def test_derivatives_are_those_of_differences():
    recording, settings, _, _ = turned(1, noise=0.0)
    names, _, usual, start = fit_terms(settings)
    known = reference(recording)
    x = start + usual * np.random.default_rng(2).standard_normal(len(start))
    at, jacobian = _linearised(recording, settings, known, x)
    for k, name in enumerate(names):
        step = np.zeros(len(x))
        step[k] = 0.01 * usual[k]
        above, below = (_linearised(recording, settings, known, x + sign * step)[0] for sign in (1.0, -1.0))
        slope = (below - above) / (2.0 * step[k])
        sound = np.isfinite(at).all(axis=1)
        size = np.abs(slope[sound]).max()
        assert jacobian[sound][:, :, k] == pytest.approx(slope[sound], abs=2e-3 * size), name


def test_a_sensor_without_noise_is_found_to_its_last_digits():
    # exact sensors and reference: what is left is interpolation
    quiet = study(motion=WIDE)
    quiet = replace(quiet, noise=replace(quiet.noise, accelerometer=1e-9, gyro=1e-9))
    true = replace(quiet, layout=replace(quiet.layout, angle=quiet.layout.angle + AXES))
    recording = simulate(true, np.random.default_rng(3), {}).recording
    found = fit(recording, quiet)
    for k in range(3):
        assert found[f"dlambda_{k + 1}"].value == pytest.approx(AXES[k], abs=1e-7)
        assert found[f"dr_{k + 1}"].value == pytest.approx(0.0, abs=1e-6)


def test_delays_are_found():
    settings = study(motion=WIDE)
    late = replace(settings.disturbances, common_delay=2e-3, gyro_delay=-1e-3)
    recording = simulate(replace(settings, disturbances=late), np.random.default_rng(4)).recording
    found = fit(recording, settings)
    assert found["tau"].value == pytest.approx(2e-3, abs=5.0 * found["tau"].u)
    assert found["tau_g"].value == pytest.approx(-1e-3, abs=5.0 * found["tau_g"].u)


def test_a_slow_sweep_shows_axes_and_biases_and_no_positions():
    sweep = MotionPlan("static", duration=20.0, sample_rate=200.0, first=-10.0 * DEG, last=90.0 * DEG)
    recording, settings, truth, _ = turned(5, motion=sweep)
    found = fit(recording, settings)
    unseen = {name for name in found.names if name.startswith(("zo", "tau")) or name in ("dr_1", "dr_3")}
    assert unseen <= set(found.unseen)
    for kind in ("S", "dlambda", "b"):
        for k in range(1, 4):
            name = f"{kind}_{k}"
            assert name not in found.unseen
            assert found[name].value == pytest.approx(truth[name], abs=5.0 * found[name].u)


def test_a_model_at_one_angle_shows_no_axes():
    still = MotionPlan("buffet", duration=20.0, sample_rate=200.0, mean=20.0 * DEG, rms=0.0)
    recording, settings, _, _ = turned(6, motion=still)
    found = fit(recording, settings)
    assert {"S_1", "dr_1", "zo_2", "k_g", "tau", "tau_g"} <= set(found.unseen)
    assert found.learned.left[0] > 0.9


def test_gaps_saturation_and_spikes_do_not_spoil_a_fit():
    recording, settings, truth, _ = turned(7)
    rng = np.random.default_rng(8)
    acc, stamps = recording.acc.copy(), recording.t.copy()
    acc[2000:2300, 1] = np.nan
    acc[rng.choice(len(acc), 5), 0] += 5.0
    stamps[5000:] += 3.0
    stamps[7000] = stamps[6000]
    # the clock was 3 s off from row 5000 on, and the table stood for so long: a gap in the record
    found = fit(replace(recording, acc=acc, t=stamps), settings)
    for name in ("dlambda_1", "dlambda_2", "dr_1", "dr_3", "S_1"):
        assert found[name].value == pytest.approx(truth[name], abs=5.0 * found[name].u)


def test_a_sensor_that_is_missing_stays_at_its_prior():
    recording, settings, truth, _ = turned(9)
    acc, gyro = recording.acc.copy(), np.full_like(recording.gyro, np.nan)
    acc[:, 2] = np.nan
    found = fit(replace(recording, acc=acc, gyro=gyro), settings)
    assert {"S_3", "b_3", "dlambda_3", "k_g", "b_g", "tau_g"} <= set(found.unseen)
    assert np.isnan(found.noise[[2, 3]]).all()
    assert found["dr_1"].value == pytest.approx(truth["dr_1"], abs=5.0 * found["dr_1"].u)
