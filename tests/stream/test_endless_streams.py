"""A million lines through each stream: its memory stays what it was after the first tenth."""

import itertools
import os
import subprocess
import sys
import threading
from pathlib import Path

import pytest
from new_studies import FILL

from inercal.cli import run
from inercal.examples import FOLDER

ROWS = int(os.environ.get("INERCAL_ENDLESS_ROWS", "1000000"))
SPARE = 4.0
"""Memory that may be added after the first tenth [MiB]."""

STREAMS = {
    "monitor": ("log.csv", "monitor --checkpoint state1"),
    "apply": ("log.csv", "apply cal.json --stream --checkpoint state2"),
    "selfcal": ("platform.csv", "selfcal --study selfcal.toml --stream --checkpoint state3"),
    "aoa": ("model.csv", "aoa --study aoa.toml --stream --checkpoint state4"),
}

pytestmark = [
    pytest.mark.campaign,
    pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="memory is told as on Linux"),
]


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("endless")
    for kind in ("selfcal", "aoa"):
        assert run(["new", kind, "--out", str(path / f"{kind}.toml"), "--quiet", *FILL]) == 0
    for kind, name, short in (
        ("selfcal", "platform.csv", []),
        ("aoa", "model.csv", ["--set", "motion.duration=5 s"]),
    ):
        words = ["simulate", kind, str(path / f"{kind}.toml"), "--out", str(path / name), "--quiet", *short]
        assert run(words) == 0
    xsens = [str(FOLDER / f"xsens_{sensor}.mat") for sensor in ("acc", "gyro")]
    mapped = ["--map", str(FOLDER / "xsens-map.toml")]
    words = ["calibrate", "imu", *xsens, *mapped, "--study", str(FOLDER / "xsens.toml")]
    assert run([*words, "--out", str(path / "cal.json"), "--quiet"]) in (0, 1)
    names = ["acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z"]
    rows = [",".join(["0", *(str(32000 + (7919 * k + 31 * i) % 97) for i in range(6))]) for k in range(500)]
    header = ",".join(["t [s]", *(f"{name} [count]" for name in names)])
    (path / "log.csv").write_text("\n".join([header, *rows]) + "\n")
    return path


def lines(path):
    """The rows of a file again and again, their time going on."""
    head, *rows = path.read_text().splitlines()
    rests = [row.partition(",")[2] for row in rows[1:-1]]
    yield head
    for k, rest in enumerate(itertools.islice(itertools.cycle(rests), ROWS)):
        yield f"{k / 100:.2f},{rest}"


@pytest.mark.parametrize("name", STREAMS)
def test_memory_is_flat(name, folder):
    source, words = STREAMS[name]
    command = [sys.executable, "-m", "inercal", *words.split(), "--quiet"]
    taken = 0
    with subprocess.Popen(command, cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:

        def drain():
            nonlocal taken
            while piece := process.stdout.read(1 << 16):
                taken += piece.count(b"\n")

        reader = threading.Thread(target=drain)
        reader.start()
        memory = []
        for k, line in enumerate(lines(folder / source)):
            process.stdin.write(f"{line}\n".encode())
            if k % (ROWS // 10) == 0:
                process.stdin.flush()
                pages = int(Path(f"/proc/{process.pid}/statm").read_text().split()[1])
                memory.append(pages * os.sysconf("SC_PAGE_SIZE") / 2**20)
        process.stdin.close()
        reader.join()
    print(name, [round(each, 1) for each in memory], taken)
    assert process.returncode in (
        (0, 1) if name == "aoa" else (0,)
    )  # repeated rows jump, which the verdict may say
    assert taken >= 0.9 * ROWS or name == "selfcal"
    assert max(memory[2:]) < memory[1] + SPARE
