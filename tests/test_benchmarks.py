"""The benchmarks run: a smoke test, no timing is judged here."""

import subprocess
import sys
from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "benchmarks"


@pytest.mark.parametrize(
    ("command", "says"),
    [
        (["aoa_bands.py", "--seeds", "1", "--draws", "4", "--scenario", "base"], "smoothed 19"),
        (["aoa_fusion.py", "--smoke"], "19 states"),
        (["aoa_fusion.py", "--endless", "20000"], " 0 without an angle"),
        (["ferraris.py", "--smoke"], "inercal, with uncertainties"),
        (["imu_calibration.py", "--smoke"], "inercal, solve"),
        (["imu_coverage.py", "--runs", "2"], "all together"),
        (["imu_coverage.py", "--runs", "2", "--method", "ferraris", "--by-scatter"], "all together"),
        (["imu_coverage.py", "--runs", "2", "--method", "aided"], "all together"),
        (["noise_coverage.py", "--runs", "2"], "weak K"),
        (["selfcal_command.py", "--smoke"], "to the written report"),
        (["selfcal_coverage.py", "--runs", "4"], "runs/s"),
        (["selfcal_robustness.py", "--seeds", "1"], "stuck_encoder 1"),
        (["selfcal_filters.py", "--smoke"], "svd-qukf, eigen"),
        (["sensitivity.py", "--smoke"], "inercal, exact"),
        (["streaming.py", "--smoke"], "lines a second"),
        (["turntable_coverage.py", "--runs", "2"], "all together"),
    ],
)
def test_a_small_run(command, says, tmp_path):
    done = subprocess.run(
        [sys.executable, str(FOLDER / command[0]), *command[1:]],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0, done.stderr
    assert says in done.stdout
