"""The band of the sensors before the fusion: its delay, its rows one by one, missing samples, gaps."""

from dataclasses import replace

import numpy as np
import pytest
from independent.aoa import DEG, Tunnel, simulate
from sting_study import study

from inercal.systems.aoa.band import Band
from inercal.systems.aoa.diagnosis.choice import of_delay, of_vibration
from inercal.systems.aoa.fusion import band
from inercal.systems.aoa.fusion.filter_result import estimate
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.paper.delay import relative_delay
from inercal.systems.aoa.reading.recording import plain
from inercal.systems.aoa.settings import Estimator

RATE = 500.0
LIMITED = Band(35.0, (120.0,), RATE)
T = np.arange(3000) / RATE


def rows_of(*columns):
    """Rows of measurements with these of the first channels, one accelerometer."""
    rows = np.full((len(T), 6), np.nan)
    for k, column in enumerate(columns):
        rows[:, k] = column
    return rows


def limited(rows, t=T, of=LIMITED):
    filter_ = band.filter_of(of)
    return band.causal(filter_, band.initial(filter_, rows.shape[1]), t, rows)


def test_a_slow_motion_passes_with_the_stamp_it_belongs_to():
    """3 Hz: to 2e-4 of its size; causal at t - d, zero phase at t. A line at the notch is gone."""
    motion = np.sin(2.0 * np.pi * 3.0 * T)
    line = np.sin(2.0 * np.pi * 120.0 * T)
    for fused in (
        limited(rows_of(motion + line, line)),
        band.zero_phase(band.filter_of(LIMITED), T, rows_of(motion + line, line)),
    ):
        late = (fused.t > 0.5) & (fused.t < 5.5)
        assert np.abs(fused.rows[late, 0] - np.sin(2.0 * np.pi * 3.0 * fused.t[late])).max() < 3e-4
        assert np.abs(fused.rows[late, 1]).max() < 1e-6
        assert np.diff(fused.t) == pytest.approx(LIMITED.every / RATE)


def test_of_white_noise_the_rows_that_are_fused_say_as_much_as_all():
    """The mean of all is as well known from one row of some, of a variance that is smaller by their number."""
    noise = np.random.default_rng(0).standard_normal((400, 500))
    means = []
    for each in noise:
        rows = np.full((500, 6), np.nan)
        rows[:, 0] = each
        means.append(np.nanmean(limited(rows, T[:500]).rows[:, 0]))
    expected = 1.0 / np.sqrt(500 - band.filter_of(LIMITED).memory)
    assert np.std(means) == pytest.approx(expected, rel=3.0 / np.sqrt(2 * 400))


def test_rows_one_by_one_are_those_of_the_whole():
    rng = np.random.default_rng(1)
    rows = rows_of(rng.standard_normal(len(T)), rng.standard_normal(len(T)))
    rows[rng.integers(0, len(T), 40), 0] = np.nan
    t = np.delete(T + 1e-5 * rng.standard_normal(len(T)), slice(1000, 1003))
    rows = np.delete(rows, slice(1000, 1003), axis=0)
    whole = limited(rows, t)
    filter_ = band.filter_of(LIMITED)
    state = band.initial(filter_, 6)
    parts = [band.causal(filter_, state, t[k : k + 1], rows[k : k + 1]) for k in range(len(t))]
    assert np.array_equal(np.concatenate([each.t for each in parts]), whole.t)
    assert np.array_equal(np.concatenate([each.rows for each in parts]), whole.rows, equal_nan=True)


def test_a_missing_sample_and_a_gap_leave_nothing_wrong_behind():
    motion = 5.0 + np.sin(2.0 * np.pi * 2.0 * T)
    rows = rows_of(motion, motion)
    rows[1500:1503, 0] = np.nan
    t = np.where(T > 4.0, T + 10.0, T)
    fused = limited(rows, t)
    truth = 5.0 + np.sin(2.0 * np.pi * 2.0 * np.where(fused.t > 4.1, fused.t - 10.0, fused.t))
    error = np.abs(fused.rows[:, :2] - truth[:, None])
    assert np.isnan(fused.rows[(fused.t > 2.99) & (fused.t < 3.02), 0]).all()
    assert np.isfinite(fused.rows[:, 1]).all()
    assert np.nanmax(error) < 0.02  # of the start at a motion
    assert not ((fused.t > 4.0) & (fused.t < 14.0)).any()


def test_a_late_gyro_is_learned_in_a_band_and_said_where_it_is_not():
    """35 Hz leave 100 rows a second. 1 ms at 63 deg/s are 0.06 deg; 40 ms are more than the series in tau holds. A gyro
    that comes 4 ms before the accelerometers says that these are late, and the angle with them: 0.18 deg rms."""
    for late, codes in ((0.0, []), (1e-3, []), (40e-3, ["command_shift"]), (-4e-3, ["command_shift"])):
        run = simulate(Tunnel("sine", duration=30.0, gyro_delay=late), 0)
        recording = plain(run.t, run.acc, run.gyro)
        stated = replace(study(), band=Band(35.0), estimator=Estimator(snap=1e8))
        of = problem(band.with_rate(stated, run.t))
        delay = relative_delay(recording, stated.layout)
        found = estimate(recording, of)
        said = of_delay(delay, of, found)
        assert [each.code for each in said] == codes
        if late < 0.0:
            assert 'common_delay = "4 ms"' in said[0].message
            told = replace(stated, timing=replace(stated.timing, common_delay=4e-3))
            corrected = problem(band.with_rate(told, run.t))
            assert of_delay(delay, corrected, estimate(recording, corrected)) == []
        if not codes:
            off = (found.theta - run.theta)[run.t > 5.0]
            assert np.sqrt(np.nanmean(np.square(off))) < 0.03 * DEG


@pytest.mark.parametrize("smoothed", [False, True])
def test_on_a_calm_rig_a_stated_band_costs_little_and_u_says_it(smoothed):
    """35 Hz: each row has its angle, at its own stamp."""
    errors = []
    for seed in range(3):
        run = simulate(Tunnel("sine", duration=12.0), seed)
        settings = band.with_rate(replace(study(), band=Band(35.0)), run.t)
        filtered = estimate(plain(run.t, run.acc, run.gyro), problem(settings), smoothed)
        late = (run.t > 2.0) & (run.t < 11.8)
        errors.append(np.column_stack([filtered.theta - run.theta, filtered.u])[late])
    error, u = np.concatenate(errors).T
    assert np.sqrt(np.mean(error**2)) < 0.03 * DEG
    assert 0.2 < np.sqrt(np.mean(np.square(error / u))) < 1.4


def test_what_the_rate_has_no_room_for_is_said():
    """230 Hz at 500 rows a second is below half of it and is taken out; 300 Hz would be another line."""
    assert len(Band(np.inf, (230.0,), 500.0).sections) == 1
    assert Band(np.inf, (230.0,), 500.0).left_out == ()
    stated = study(band=Band(250.0, (230.0, 300.0), 500.0))
    (told,) = of_vibration(stated, stated)
    assert told.code == "band_limited"
    assert told.message.startswith("250 Hz, 300 Hz under [band] is left out")
