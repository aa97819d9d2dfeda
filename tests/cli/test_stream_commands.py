"""The commands on streams, each in a process of its own: one line in, one line out, and killed at any moment."""

import io
import json
import os
import queue
import signal
import subprocess
import sys
import threading
from pathlib import Path

import numpy as np
import pytest

from inercal.cli import run
from rows import for_each

POSIX = pytest.mark.skipif(os.name == "nt", reason="signals and pipes as on POSIX")
HEADER = (
    "t [s],acc_x [count],acc_y [count],acc_z [count],gyro_x [count],gyro_y [count],gyro_z [count],label\n"
)
COMMAND = [sys.executable, "-m", "inercal"]


def calibration(path: Path, seed: int) -> None:
    """Write a calibration with every coefficient that one may have."""
    rng = np.random.default_rng(seed)
    pairs = [f"{i}{j}" for i in "xyz" for j in "xyz"]
    values = {f"K1_{axis}": 400 + 20 * rng.standard_normal() for axis in "xyz"}
    values |= {f"S_{axis}": 4700 + 90 * rng.standard_normal() for axis in "xyz"}
    values |= {
        f"{name}_{axis}": 33000 + 99 * rng.standard_normal() for name in ("K0", "D_F") for axis in "xyz"
    }
    values |= {f"M_{pair}": 0.01 * rng.standard_normal() for pair in ("xy", "xz", "yz")}
    values |= {f"T_{i}{j}": 0.01 * rng.standard_normal() for i, j in pairs if i != j}
    values |= {f"G_{pair}": 0.3 * rng.standard_normal() for pair in pairs}
    whole = {
        "command": "calibrate imu",
        "status": {"code": "ok", "message": ""},
        "parameters": [{"name": n, "value": v, "u": 0.1, "unit": "1"} for n, v in values.items()],
        "covariance": {"names": list(values), "matrix": np.eye(len(values)).tolist()},
        "result": {"unit": {"acc": "count", "gyro": "count"}},
    }
    path.write_text(json.dumps(whole))


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """A recording at 50 Hz with two motions, flawed rows and labels, a map, and two calibrations."""
    path = tmp_path_factory.mktemp("stream")
    rng = np.random.default_rng(1)
    x = 33000.0 + rng.standard_normal((900, 6)) * [3, 3, 4, 2, 2, 2]
    for begin, end in ((420, 480), (700, 720)):
        x[begin:end] += 500 * rng.standard_normal((end - begin, 6))
    rows = [",".join([repr(i / 50), *map(repr, row), f"run {i // 300}"]) for i, row in enumerate(x.tolist())]
    rows[555] = "lost,in,transmission"
    rows[600] = rows[600].replace(repr(x[600, 4].item()), "")
    (path / "log.csv").write_text(HEADER + "\n".join(rows) + "\n")
    titles = [title.split(" ")[0] for title in HEADER.strip().split(",")[:-1]]
    units = ["s", *["count"] * 6]
    columns = [
        f'[columns.{n}]\nfrom = {i}\nunit = "{u}"\n'
        for i, (n, u) in enumerate(zip(titles, units, strict=True))
    ]
    (path / "map.toml").write_text("".join(columns) + '[file]\ndelimiter = ";"\ndecimal = ","\n')
    european = [row.replace(",", ";").replace(".", ",") for row in rows]
    (path / "european.csv").write_text("\r\n".join(european) + "\r\n")
    calibration(path / "cal.json", 2)
    calibration(path / "other.json", 3)
    return path


def inercal(folder, *arguments, **options):
    """Run a command in the folder, on the recording as standard input unless there is another."""
    options = {"input": (folder / "log.csv").read_bytes()} | options
    done = subprocess.run(
        [*COMMAND, *arguments], cwd=folder, capture_output=True, timeout=120, check=False, **options
    )
    return done.returncode, done.stdout, done.stderr.decode()


@pytest.fixture
def here(folder, monkeypatch, capsys):
    """Run a command in this process, which is quicker; like `inercal`."""

    def command(*arguments, log=None):
        data = (folder / "log.csv").read_bytes() if log is None else log.encode()
        monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))
        monkeypatch.chdir(folder)
        capsys.readouterr()
        code = run(list(arguments))
        return code, *capsys.readouterr()

    return command


def refused(result, *words):
    """Exit code 2, nothing on standard output, one sentence with the words on standard error."""
    code, out, err = result
    assert (code, out) == (2, ""), err
    lines = [line for line in err.splitlines() if line.startswith("inercal: error: ")]
    assert len(lines) == 1, err
    assert err.endswith(lines[0] + "\n")
    for word in words:
        assert word in lines[0]


def test_no_line_up_to_the_last_one_received(here, tmp_path):
    """A resumed run gives those since the last save once more; told the stamp of the last line, none twice."""
    _, whole, _ = here("apply", "cal.json", "--stream", "--quiet")
    _, rest, _ = here("apply", "cal.json", "--stream", "--quiet", "--after", "9.98 s")
    lines = whole.splitlines()
    k = next(k for k, line in enumerate(lines) if line.startswith("9.98,"))
    assert rest.splitlines() == lines[k + 1 :]


# Applying a calibration.


@pytest.mark.parametrize("more", [[], ["--invert"]])
def test_apply_gives_the_bytes_of_the_file(more, folder, tmp_path):
    """Correction and its inverse, row by row and over the whole file."""
    log = (folder / "log.csv").read_bytes()
    if more:
        log = log.replace(b"[count]", b"[g]", 3).replace(b"[count]", b"[deg/h]")
    (tmp_path / "log.csv").write_bytes(log)
    assert (
        run(
            [
                "apply",
                str(folder / "cal.json"),
                str(tmp_path / "log.csv"),
                "--out",
                str(tmp_path / "x.csv"),
                "--quiet",
                *more,
            ]
        )
        == 0
    )
    code, out, err = inercal(folder, "apply", "cal.json", "--stream", *more, input=log)
    assert code == 0, err
    assert out == (tmp_path / "x.csv").read_bytes()
    assert err == (
        "bad_row: row other than 8 fields with numbers, left as NaN (line 557)\nnan: gyro_y: missing value (line 602)\n"
    )


def test_apply_by_a_map_and_from_a_file(folder, tmp_path):
    out_file = tmp_path / "x.csv"
    with_map = [
        "apply",
        str(folder / "cal.json"),
        str(folder / "european.csv"),
        "--map",
        str(folder / "map.toml"),
    ]
    assert run([*with_map, "--out", str(out_file), "--quiet"]) == 0
    code, out, _ = inercal(folder, *with_map, "--stream", "--quiet", input=b"")
    assert code == 0
    assert out == out_file.read_bytes()


def test_apply_goes_on_after_its_last_row(folder, here, tmp_path):
    state = str(tmp_path / "state")
    log = (folder / "log.csv").read_bytes().splitlines(keepends=True)
    whole = inercal(folder, "apply", "cal.json", "--stream")[1].splitlines()
    command = ["apply", "cal.json", "--stream", "--checkpoint", state, "--quiet"]
    assert inercal(folder, *command, input=b"".join(log[:301]))[1].splitlines() == whole[:301]
    assert inercal(folder, *command)[1].splitlines() == [whole[0], *whole[301:]]
    refused(here("apply", "other.json", *command[2:]), state, "other settings or inputs")


def test_apply_loads_no_more_than_it_needs(folder):
    """No scipy, no compiler, no checker of studies: it answers soon after it is started."""
    code = (
        "import sys, inercal.cli\n"
        "assert inercal.cli.run(['apply', 'cal.json', '--stream']) == 0\n"
        "found = {'numba', 'scipy', 'pydantic', 'xarray', 'matplotlib', 'jinja2', 'pint', 'h5py'} & set(sys.modules)\n"
        "assert not found, found\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], cwd=folder, input=(folder / "log.csv").read_bytes(), capture_output=True,
        timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr


# One line in, one line out.


@pytest.mark.slow
@pytest.mark.parametrize("command", [["apply", "cal.json", "--stream"], ["monitor"]])
def test_each_line_is_answered_before_the_next_is_sent(command, folder):
    process = subprocess.Popen(
        [*COMMAND, *command], cwd=folder, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    answers = queue.Queue()
    threading.Thread(target=lambda: [answers.put(line) for line in process.stdout], daemon=True).start()
    rows = (folder / "log.csv").read_text().splitlines(keepends=True)
    process.stdin.writelines(rows[:4])  # the first line waits for three rows
    for i, row in enumerate(rows[1:40]):
        if i > 2:
            process.stdin.write(row)
        process.stdin.flush()
        if i == 0:
            assert answers.get(timeout=60).startswith("t [s],")
        assert answers.get(timeout=60).startswith(f"{i / 50},")
        assert answers.empty() or i < 2
    process.stdin.close()
    assert process.wait(60) == 0
    process.stdout.close()


# Killed, interrupted, left alone.


@pytest.mark.slow
@POSIX
@pytest.mark.parametrize("seed", [11, *(pytest.param(k, marks=pytest.mark.campaign) for k in (12, 13))])
def test_the_monitor_killed_at_any_moment_and_restarted(seed, folder, tmp_path):
    """Killed without warning three times, while it works: each row is answered, and always with the same digits."""
    whole = inercal(folder, "monitor", "--quiet")[1].splitlines(keepends=True)
    command = [
        *COMMAND,
        "monitor",
        "--checkpoint",
        str(tmp_path / "state"),
        "--checkpoint-every",
        "17",
        "--quiet",
    ]
    given = []
    for lines in (*np.random.default_rng(seed).integers(20, 300, 3), None):
        with open(folder / "log.csv", "rb") as log:
            process = subprocess.Popen(command, cwd=folder, stdin=log, stdout=subprocess.PIPE)
        if lines is not None:
            given += [process.stdout.readline() for _ in range(lines)]
            process.send_signal(signal.SIGKILL)
        given += process.stdout.readlines()
        process.stdout.close()
        assert process.wait(60) == (0 if lines is None else -signal.SIGKILL)
        if not given[-1].endswith(b"\n"):
            given.pop()  # killed in the middle of a line
    assert given.count(whole[0]) == 4
    assert set(given) == set(whole)
    assert list(dict.fromkeys(given)) == whole


@pytest.mark.slow
@POSIX
def test_an_interrupt_saves_and_ends_with_130(folder, tmp_path):
    log = (folder / "log.csv").read_bytes().splitlines(keepends=True)
    command = ["monitor", "--checkpoint", str(tmp_path / "state"), "--quiet"]
    process = subprocess.Popen(
        [*COMMAND, *command],
        cwd=folder,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    process.stdin.write(b"".join(log[:51]))
    process.stdin.flush()
    first = [process.stdout.readline() for _ in range(51)]
    process.send_signal(signal.SIGINT)
    rest, err = process.communicate(timeout=60)
    assert (process.returncode, rest, err) == (130, b"", b"inercal: interrupted\n")
    whole = inercal(folder, "monitor", "--quiet")[1].splitlines(keepends=True)
    assert first + inercal(folder, *command)[1].splitlines(keepends=True)[1:] == whole


@POSIX
def test_a_reader_that_leaves_ends_the_stream_in_order(folder):
    done = subprocess.run(
        f"{' '.join(COMMAND)} apply cal.json log.csv --stream 2>err.txt | head -3; echo ${{PIPESTATUS[0]}}",
        shell=True, executable="/bin/bash", cwd=folder, capture_output=True, text=True, timeout=60, check=False,
    )  # fmt: skip
    assert done.stdout.splitlines()[3:] == ["0"]
    assert (folder / "err.txt").read_text().endswith("the reader of standard output has left\n")


# The monitor.


def test_the_monitor_says_what_it_sees(folder):
    code, out, _ = inercal(folder, "monitor", "--every", "1 s")
    rows = [line.split(",") for line in out.decode().splitlines()]
    assert code == 0
    assert rows[0][:5] == ["t [s]", "rest", "still [s]", "restlessness", "tau [s]"]
    assert rows[0][5:10] == [
        "mean_acc_x [count]", "sd_acc_x [count]", "N_acc_x [count/sqrt(Hz)]", "u_N_acc_x [count/sqrt(Hz)]",
        "adev_acc_x [count]",
    ]  # fmt: skip
    assert [float(row[0]) for row in rows[1:]] == list(range(18))
    # the start; rest; a motion; rest; two flawed rows within a window of each other; a motion at 14 s; rest
    assert "".join(row[1] or "-" for row in rows[1:]) == "------111001--0011"
    last = dict(zip(rows[0], rows[-1], strict=True))
    assert float(last["sd_acc_z [count]"]) == pytest.approx(4.0, abs=4 * 4.0 / np.sqrt(100))


# What is refused.


@for_each(
    ("arguments", "words"),
    [
        (["apply", "cal.json", "--stream", "--out", "x.csv"], ["--out"]),
        (["apply", "cal.json", "--stream", "--json"], ["--json"]),
        (["monitor", "--json"], ["--json"]),
        (["apply", "cal.json"], ["FILES is missing"]),
        (
            ["apply", "cal.json", "log.csv", "--out", "x.csv", "--checkpoint", "c"],
            ["--checkpoint", "--stream"],
        ),
        (["apply", "cal.json", "log.csv", "european.csv", "--stream"], ["--stream", "2 files"]),
        (["apply", "none.json", "--stream"], ["none.json"]),
        (["apply", "cal.json", "none.csv", "--stream"], ["none.csv", "cannot be read"]),
        (["monitor", "--after", "soon"], ["--after", "soon"]),
        (["apply", "cal.json", "log.csv", "--out", "x.csv", "--after", "1 s"], ["--after", "--stream"]),
        (["monitor", "--checkpoint", "none/state"], ["none/state", "cannot be written"]),
        (["monitor", "--checkpoint", "log.csv/state"], ["log.csv/state", "cannot be written"]),
        (["monitor", "log.csv", "--checkpoint", "log.csv"], ["is an input"]),
        (["apply", "cal.json", "--stream", "--checkpoint", "cal.json"], ["is an input"]),
        (["monitor", "--checkpoint", "map.toml"], ["map.toml", "is no checkpoint"]),
        (["monitor", "--checkpoint-every", "0"], ["--checkpoint-every", "found 0"]),
        (["monitor", "--every", "0 s"], ["--every", "above 0"]),
        (["monitor", "--every", "soon"], ["--every", "'soon'"]),
        (["monitor", "--map", "none.toml"], ["none.toml"]),
        (["monitor", "--map", "map.toml"], ["map.toml: columns.acc_x.from"]),
    ],
)
def test_bad_usage_is_one_sentence(arguments, words, folder, here):
    before = sorted(path.name for path in folder.iterdir())
    refused(here(*arguments), *words)
    assert sorted(path.name for path in folder.iterdir()) == before


@for_each(
    ("log", "words"),
    [
        ("", ["standard input", "ended without a row"]),
        (HEADER, ["a header and no row"]),
        ("a,b\n1,2\n3,4\n", ["standard input", "expected known ones"]),
        ("t [s],acc_x [count],acc_y [count]\n0,1,2\n", ["no column acc_z"]),
        (HEADER.replace("count", "deg/s") + "0,1,2,3,4,5,6,a\n" * 3, ["acc_x", "acceleration"]),
        (HEADER.replace("gyro_x [count]", "gyro_x [deg/s]") + "0,1,2,3,4,5,6,a\n", ["gyro_y", "another unit"]),
        (HEADER.replace("acc_x [count],acc_y [count],acc_z [count]", "acc_x [g],acc_y [g],acc_z [g]")
         + "0,1,2,3,4,5,6,a\n", ["acc_x is in g, expected count"]),
    ],
)  # fmt: skip
def test_a_stream_that_does_not_fit_is_one_sentence(log, words, here):
    refused(here("apply", "cal.json", "--stream", log=log), *words)


def test_a_damaged_or_another_state_is_one_sentence(here, tmp_path):
    state = tmp_path / "state"
    command = ["monitor", "--checkpoint", str(state), "--quiet"]
    assert here(*command)[0] == 0
    refused(here(*command, "--every", "1 s"), "other settings or inputs")
    refused(here("apply", "cal.json", "--stream", *command[1:]), "expected one of apply")
    state.write_bytes(state.read_bytes()[:-1])
    refused(here(*command), "damaged")
