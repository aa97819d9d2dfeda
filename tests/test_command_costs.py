"""Costs that no clock need tell: libraries that a command loads, and memory by row. Both lists may only shrink."""

import subprocess
import sys

import numpy as np
import pytest
from new_studies import FILL

from inercal.cli import run

HEAVY = {
    "cyclopts", "h5py", "jinja2", "matplotlib", "numba", "numpy.ctypeslib", "numpy.f2py", "numpy.testing",
    "pandas", "pint", "pyarrow", "pydantic", "rich", "scipy.interpolate", "scipy.io", "scipy.ndimage", "scipy.optimize",
    "scipy.signal", "scipy.special", "scipy.stats", "xarray",
}  # fmt: skip
"""What takes a fiftieth of a second or more to load."""

_FILES = {"cyclopts"}
_STUDY = {*_FILES, "pydantic"}
_KERNELS = {*_STUDY, "scipy.special"}
STARTS = {
    "--version": set(),
    "--help": {"cyclopts", "rich"},
    "inspect model.csv": _FILES,
    "apply cal.toml log.csv --out corrected.csv": _FILES,
    "calibrate turntable table.csv --study turntable.toml": {*_STUDY, "scipy.special"},
    "sensitivity turntable.toml": _KERNELS,
    "selfcal platform.csv --study selfcal.toml": _KERNELS,
    "aoa model.csv --study aoa.toml": {*_KERNELS, "scipy.interpolate", "scipy.optimize"},
}
ASKED = f"""
import sys
from inercal.cli import main
try:
    main(sys.argv[1:])
except SystemExit as ended:
    code = ended.code or 0
assert code in (0, 1), code
print("loaded:", *sorted({HEAVY!r} & set(sys.modules)))
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("starts")
    for kind, out, short in (
        ("turntable", "table.csv", []),
        ("selfcal", "platform.csv", []),
        ("aoa", "model.csv", ["--set", "motion.duration=5 s"]),
    ):
        study = str(path / f"{kind}.toml")
        assert run(["new", kind, "--out", study, "--quiet", *FILL]) == 0
        assert run(["simulate", kind, study, "--out", str(path / out), "--quiet", *short]) == 0
    (path / "log.csv").write_text(
        "t [s],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2]\n0,0,0,9.8\n1,0,0,9.7\n2,0,1,9.8\n"
    )
    names = [f"{symbol}_{axis}" for symbol in ("K0", "K1") for axis in "xyz"]
    text = "\n".join(
        f'[[parameters]]\nname = "{name}"\nvalue = {name.startswith("K1"):d}.0\nu = 0.1\nunit = "1"'
        for name in names
    )
    matrix = np.diag(np.full(6, 0.01)).tolist()
    (path / "cal.toml").write_text(
        f'command = "calibrate imu"\n[status]\ncode = "ok"\nmessage = ""\n[result.unit]\nacc = "m/s^2"\n'
        f"[covariance]\nnames = {names}\nmatrix = {matrix}\n{text}\n"
    )
    return path


@pytest.mark.slow
@pytest.mark.parametrize("command", STARTS)
def test_a_command_loads_no_library_that_it_does_not_need(command, folder):
    words = [
        sys.executable,
        "-c",
        ASKED,
        *command.split(),
        *(["--quiet"] * (" " in command)),
    ]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=True)
    loaded = {
        name for line in done.stdout.splitlines() if line.startswith("loaded:") for name in line.split()[1:]
    }
    assert loaded == STARTS[command]


BYTES = {
    "inspect long.csv": 200,
    "aoa long.csv --study aoa.toml": 660,
    "selfcal turning.csv --study selfcal.toml": 1500,
}
"""Most bytes of memory for a row of 5 numbers of text, of a platform 10: 700 000 of these take 1 GiB."""


def lengthened(folder, count):
    """The recording of a model with its rows again and again."""
    head, *rows = (folder / "model.csv").read_text().splitlines()
    with open(folder / "long.csv", "w") as file:
        file.write(f"{head}\n")
        for k in range(count):
            file.write(f"{k / 1000:.3f},{rows[k % len(rows)].partition(',')[2]}\n")


def turning(folder, count):
    """A platform on the path of its study, with so many rows."""
    rows = ["--set", f"plan.step={540.0 / count:.9g} s", "--out", str(folder / "turning.csv"), "--quiet"]
    assert run(["simulate", "selfcal", str(folder / "selfcal.toml"), *rows]) == 0


PEAK = """
import re, sys
from pathlib import Path
from inercal.cli import run
run(sys.argv[1:])
print("peak:", re.search(r"VmHWM:\\s*(\\d+) kB", Path("/proc/self/status").read_text())[1])
"""
"""Of the process itself: the largest size in `resource.getrusage` is that of its parent, where this is larger."""


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="the peak of memory is told in KiB as on Linux")
@pytest.mark.parametrize(
    "command",
    [pytest.param(each, marks=[pytest.mark.campaign] * (not each.startswith("inspect"))) for each in BYTES],
)
def test_memory_grows_by_no_more_than_so_many_bytes_a_row(command, folder):
    peaks = {}
    for count in (100_000, 200_000):  # both of them long enough to be read by compiled rows
        (turning if "turning" in command else lengthened)(folder, count)
        words = [sys.executable, "-c", PEAK, *command.split(), "--quiet"]
        done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=True)
        peaks[count] = int(done.stdout.rpartition("peak:")[2]) * 1024
    assert (peaks[200_000] - peaks[100_000]) / 100_000 < BYTES[command]
