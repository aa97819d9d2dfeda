"""A stream that decides on band, snap and delay: its lines until then and after, and what it says of itself."""

import io
from dataclasses import replace

import numpy as np
import pytest
from independent.aoa import CASES, DEG, Tunnel, simulate
from sting_study import study
from streams_that_break import lines_out

from inercal.faces.stream.aoa import Aoa
from inercal.faces.stream.lines import Lines
from inercal.faces.stream.run import Saving
from inercal.foundation.records.write import number
from inercal.systems.aoa.alarm import AlarmLimits
from inercal.systems.aoa.band import Band
from inercal.systems.aoa.fusion.band import with_rate
from inercal.systems.aoa.fusion.filter_result import estimate
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.fusion.watch import watched
from inercal.systems.aoa.reading.recording import plain
from inercal.systems.aoa.settings import Estimator

LINES_OF_TUNNEL = "lines 0.05 g, 47, 112, 230 Hz"


def text_of(run):
    """A run as a file."""
    rows = np.column_stack([run.t, run.acc, run.gyro])
    lines = [",".join(number(x) for x in row) for row in rows.tolist()]
    return "\n".join(["t [s],a1 [m/s^2],a2 [m/s^2],a3 [m/s^2],gyro [rad/s]", *lines]) + "\n"


def streamed(text, settings, saving=None, kill=None):
    """Columns of the lines out, the estimator, and its findings."""
    said = []
    lines = Lines(io.BytesIO(text.encode()), "log", None, lambda finding: None)
    of = Aoa(lines, settings, 0.0, said.append)
    return lines_out(of, lines, saving, kill), of, said


def table(out):
    return np.genfromtxt(out[1:], delimiter=",")


@pytest.mark.parametrize("low_pass", [35.0, np.inf])
def test_where_band_and_snap_are_stated_the_digits_are_those_of_the_file(low_pass):
    """Of each row, from the first: nothing is decided, and no status is 1."""
    run = simulate(Tunnel(duration=3.0, **CASES[LINES_OF_TUNNEL]), 0)
    settings = study(band=Band(low_pass, (47.0,)), estimator=Estimator(snap=2e8))
    out = table(streamed(text_of(run), settings)[0])
    filtered = estimate(plain(run.t, run.acc, run.gyro), problem(with_rate(settings, run.t)))
    shown = np.degrees(np.column_stack([filtered.theta, filtered.u, filtered.rate]))
    assert np.array_equal(out[:, 1:4], shown, equal_nan=True)
    assert np.isfinite(shown[200:]).all()
    assert not (out[:, 5] == 1.0).any()
    gate = problem(settings).constants.gate
    nis = np.where(np.isfinite(filtered.theta), watched(run.t, filtered.innovations, gate), np.nan)
    assert np.array_equal(out[:, 4], nis, equal_nan=True)


@pytest.mark.slow
def test_a_stream_decides_within_15_s_and_says_until_when(tmp_path):
    """Lines of a tunnel: after the choice the digits of a file that states it, also where the stream was killed."""
    run = simulate(Tunnel(duration=20.0, fs=300.0, **CASES[LINES_OF_TUNNEL]), 1)
    text = text_of(run)
    whole, of, said = streamed(text, study())
    out = table(whole)
    after = run.t > 15.0
    assert set(out[~after, 5]) <= {1.0, 2.0}
    assert set(out[after, 5]) == {0.0}
    error, u = out[after, 1] - run.theta[after] / DEG, out[after, 2]
    assert np.sqrt(np.mean(error**2)) < 0.05
    assert np.sqrt(np.mean((error / u) ** 2)) < 2.0
    assert "band_limited" in [each.code for each in said]
    assert of.failure == ""
    problem_ = of._problem
    filtered = estimate(plain(run.t, run.acc, run.gyro), problem_)
    assert np.array_equal(out[after, 1], np.degrees(filtered.theta[after]))
    assert np.array_equal(out[after, 4], watched(run.t, filtered.innovations, problem_.constants.gate)[after])
    saving, given = Saving(tmp_path / "state", 100), []
    for kill in (2000, 4450, 4600, 5500, None):
        given += streamed(text, study(), saving, kill)[0]
    assert set(given) == set(whole)


def test_a_stream_that_contradicts_the_model_ends_with_that():
    run = simulate(Tunnel(duration=6.0), 0)
    run = replace(run, gyro=-run.gyro)
    out, of, _ = streamed(text_of(run), study())
    assert table(out)[-1, 5] == 1.0
    assert "contradicts the model: mean NIS" in of.failure
    assert table(out)[-1, 4] > 2.0


def test_angles_beyond_the_limits_are_said_as_they_come():
    """15 deg + 10 deg at 0.25 Hz: each of two excursions above 24 deg once, and the rows of each in their column."""
    run = simulate(Tunnel(duration=7.0, frequency=0.25), 0)
    settings = study(
        band=Band(np.inf),
        estimator=Estimator(snap=1e8),
        alarm=AlarmLimits(lowest=-5.0 * DEG, highest=24.0 * DEG),
    )
    out, of, said = streamed(text_of(run), settings)
    assert out[0].endswith(",nis [1],status [1],alarm [1]")
    rows = table(out)
    known = np.isfinite(rows[:, 1])
    assert np.array_equal(rows[known, 6], 1.0 * (rows[known, 1] > 24.0))
    told = [each for each in said if each.code == "beyond_limits"]
    assert len(told) == 2
    assert "theta is 24.01 deg, above the study's 24 deg" in told[0].message
    first = run.t[np.flatnonzero(run.theta > 24.0 * DEG)[0]]
    assert abs(float(told[0].where.split()[2]) - first) < 0.02
    assert of.failure == ""
