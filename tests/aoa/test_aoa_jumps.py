"""Time stamps that jump by days or decades, as of two runs in one file, or of a clock that was set while it ran."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from new_studies import FILL
from sting_study import BASE, layout, scenario, study

from inercal.cli import run
from inercal.foundation.records.write import write_record
from inercal.systems.aoa.disturbances import Disturbances
from inercal.systems.aoa.paper.delay import relative_delay
from inercal.systems.aoa.paper.lever import oscillation_frequency, zero_phase
from inercal.systems.aoa.reading.recording import shortened, usual_step
from inercal.systems.aoa.simulate import simulate, to_record

POSIX = pytest.mark.skipif(os.name == "nt", reason="limits of memory as on POSIX")
JUMPS = [1e6, 1.7e9]

COMMANDS = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (4 << 30, 4 << 30))
from inercal.cli import run
study, *files = sys.argv[1:]
for file in files:
    code = run(["aoa", file, "--study", study, "--compare", "--points", "--report", file + ".html", "--quiet"])
    assert code == 0, code
"""


@pytest.mark.campaign
@POSIX
def test_the_whole_command_needs_no_memory_for_the_time_in_between(tmp_path):
    """12 s in two halves: all methods and the page fit in 4 GiB, where a value for each millisecond would not."""
    settings = study(motion=replace(BASE, duration=12.0, sample_rate=250.0))
    made = simulate(settings, np.random.default_rng(1)).recording
    of = tmp_path / "aoa.toml"
    assert run(["new", "aoa", "--out", str(of), "--quiet", *FILL]) == 0
    files = []
    for jump in JUMPS:
        files.append(tmp_path / f"{jump:g}.csv")
        t = np.where(made.t > 6.0, made.t + jump, made.t)
        write_record(to_record(replace(made, t=t), settings), files[-1])
    done = subprocess.run(
        [sys.executable, "-c", COMMANDS, of, *files], capture_output=True, text=True, timeout=300
    )
    assert done.returncode == 0, done.stdout[-2000:] + done.stderr[-2000:]


@pytest.mark.parametrize("jump", [60.0, *JUMPS])
def test_the_delay_of_two_runs_is_that_of_one(jump):
    settings = replace(
        scenario("buffet", duration=40.0, sample_rate=200.0), disturbances=Disturbances(gyro_delay=7e-3)
    )
    made = simulate(settings, np.random.default_rng(2)).recording
    whole = relative_delay(made, settings.layout)
    found = relative_delay(replace(made, t=np.where(made.t > 20.0, made.t + jump, made.t)), settings.layout)
    assert found.value == pytest.approx(7e-3, abs=4.0 * found.u)
    assert found.u == pytest.approx(whole.u, rel=0.3)


@pytest.mark.parametrize("jump", JUMPS)
def test_the_frequency_after_a_jump_is_that_of_the_second_run_alone(jump):
    fs, om = 200.0, 2.0 * np.pi * np.array([1.3, 2.9])
    t = np.arange(0.0, 24.0, 1.0 / fs)
    second = t >= 12.0
    phase = np.where(second, om[1], om[0]) * t
    al = 0.5 * np.sin(phase)
    acc = al[:, None] * np.array([0.25, 0.0, 0.25]) + 1e-3 * np.random.default_rng(3).standard_normal(
        (len(t), 3)
    )
    gyro = -al / np.where(second, om[1], om[0])
    stamps = np.where(second, t + jump, t)
    found = oscillation_frequency(stamps, acc, gyro, layout())
    first = oscillation_frequency(t[~second], acc[~second], gyro[~second], layout())
    np.testing.assert_array_equal(found[~second], first)
    np.testing.assert_allclose(found[t > 23.0], 2.9, rtol=5e-3)


@pytest.mark.parametrize("jump", JUMPS)
def test_two_runs_are_filtered_apart(jump):
    rng = np.random.default_rng(4)
    t = np.concatenate([np.arange(1000) / 100.0, jump + np.arange(800) / 100.0])
    x = rng.standard_normal(1800)
    parts = [zero_phase(t[part], x[part], 3.0, 4) for part in (slice(0, 1000), slice(1000, 1800))]
    np.testing.assert_array_equal(zero_phase(t, x, 3.0, 4), np.concatenate(parts))


def test_times_without_gaps_stay_to_the_digit():
    t = np.cumsum(np.random.default_rng(5).uniform(0.5e-3, 2e-3, 1000))
    assert shortened(t, 0.1) is t
    later = np.where(np.arange(1000) < 500, t, t + 1e6)
    np.testing.assert_allclose(np.diff(shortened(later, 0.1)), np.minimum(np.diff(later), 0.1), atol=1e-9)


def test_rows_that_come_in_bursts_make_no_fine_grid():
    """64 rows within 64 us each 64 ms: a grid of microseconds would have a thousand points for each row."""
    t = (np.arange(100)[:, None] * 64e-3 + np.arange(64) * 1e-6).ravel()
    assert (t[-1] - t[0]) / usual_step(t) == pytest.approx(16 * len(t), rel=1e-6)
    assert usual_step(np.arange(100) * 1e-3) == pytest.approx(1e-3)
    smooth = zero_phase(t, np.sin(2.0 * np.pi * t), 20.0, 4)
    assert np.abs(smooth - np.sin(2.0 * np.pi * t))[640:-640].max() < 0.01
