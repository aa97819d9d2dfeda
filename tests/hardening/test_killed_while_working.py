"""Long commands killed in the midst of their work: the old file stays, and no process of theirs lives on."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from new_studies import FILL

from inercal.cli import run

pytestmark = [
    pytest.mark.slow,
    pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="processes are listed as on Linux"),
]

COMMAND = [sys.executable, "-m", "inercal"]
OLD = "what was there before\n"

MANY = "--set analysis.samples=65536"
LONG = {
    "validate": "validate --out NEW.json",
    "sensitivity": f"sensitivity turntable.toml --set analysis.method=sampled {MANY} --out NEW.npz",
    "design selfcal": "design selfcal selfcal.toml --out NEW.json",
    "simulate selfcal --runs": "simulate selfcal selfcal.toml --runs 100000 --out NEW.json",
}


def descendants(pid):
    """Processes that a process has started, and those that they have."""
    parents = {}
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            name, fields = path.parent.name, path.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if fields[0] != "Z":
            parents[int(name)] = int(fields[1])
    found, new = set(), {pid}
    while new:
        new = {each for each, parent in parents.items() if parent in new} - found
        found |= new
    return found


def worked(pid):
    """Processor time of a process and of those below it [s]."""
    ticks = 0
    for each in {pid, *descendants(pid)}:
        try:
            fields = Path(f"/proc/{each}/stat").read_text().rpartition(")")[2].split()
        except OSError:
            continue
        ticks += int(fields[11]) + int(fields[12])
    return ticks / os.sysconf("SC_CLK_TCK")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Studies that take long."""
    path = tmp_path_factory.mktemp("long")
    for kind in ("turntable", "selfcal"):
        assert run(["new", kind, "--out", str(path / f"{kind}.toml"), "--quiet", *FILL]) == 0
    return path


@pytest.mark.parametrize(
    ("name", "signum"),
    [*((name, signal.SIGKILL) for name in LONG), ("simulate selfcal --runs", signal.SIGHUP)],
)
def test_a_long_command_is_killed(name, signum, folder):
    words = LONG[name].split()
    target = folder / words[-1]
    target.write_text(OLD)
    before = set(folder.iterdir())
    with subprocess.Popen(
        [*COMMAND, *words], cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE
    ) as process:
        deadline = time.monotonic() + 120
        while worked(process.pid) < 1.0 and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.05)
        others = descendants(process.pid)
        assert process.poll() is None
        process.send_signal(signum)
        try:
            out, err = process.communicate(timeout=120)
        finally:
            process.kill()
    assert process.returncode == (-signal.SIGKILL if signum == signal.SIGKILL else 130), err
    assert out == b""
    deadline = time.monotonic() + 30
    while (
        left := {each for each in others if Path(f"/proc/{each}").exists()}
    ) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert left == set()
    assert target.read_text() == OLD
    assert set(folder.iterdir()) == before
