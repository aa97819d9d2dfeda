"""The command line keeps its contract: exit codes, clean standard output, one line for whatever is wrong."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from new_studies import filled

from inercal.cli import run
from inercal.cli.tree import COMMANDS, app
from rows import for_each

pytestmark = pytest.mark.usefixtures("undrawn")


def inercal(*arguments: object, **options: object) -> subprocess.CompletedProcess[str]:
    """Run the command line in a process of its own."""
    command = [sys.executable, "-m", "inercal", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120, check=False, **options)


@pytest.fixture
def simulated(tmp_path) -> Path:
    """A recording in canonical CSV, with its study."""
    from inercal.foundation.records.write import write_record
    from inercal.systems.imu.simulate import draw_truth, hand_poses, simulate

    rng = np.random.default_rng(1)
    record, _ = simulate(draw_truth(rng), hand_poses(rng, 16), 9.81, 0.8, rng, rate=50.0)
    write_record(record, tmp_path / "log.csv")
    (tmp_path / "imu.toml").write_text('[site]\ngravity = "9.81(1) m/s^2"\nlatitude = "0.8 rad"\n', "utf-8")
    return tmp_path


def calibrate(folder: Path, *more: object) -> list[str]:
    return ["calibrate", "imu", str(folder / "log.csv"), "--study", str(folder / "imu.toml"), *map(str, more)]


def said_once(captured, *words: str) -> None:
    """Standard output is empty, standard error one line of the right form that holds the words."""
    assert captured.out == ""
    lines = captured.err.splitlines()
    assert len(lines) == 1, captured.err
    assert lines[0].startswith("inercal: error: ")
    for word in words:
        assert word in lines[0]


def test_a_sound_calibration_as_json(simulated, capsys):
    assert run(calibrate(simulated, "--json", "--quiet")) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    data = json.loads(captured.out, parse_constant=lambda text: pytest.fail(f"{text} is not JSON"))
    assert list(data)[:14] == [
        "inercal", "command", "status", "parameters", "covariance", "findings", "statistics", "budget", "model",
        "conditions", "traceability", "inputs", "timing_s", "provenance",
    ]  # fmt: skip
    assert data["command"] == "calibrate imu"
    assert data["status"]["code"] == "ok"
    names = [p["name"] for p in data["parameters"]]
    assert names == data["covariance"]["names"]
    covariance = np.array(data["covariance"]["matrix"])
    for i, p in enumerate(data["parameters"]):
        assert p["U"] == pytest.approx(p["k"] * p["u"])
        assert covariance[i, i] == pytest.approx(p["u"] ** 2)
        assert p["dof"] > 0
    assert np.all(np.linalg.eigvalsh(covariance / np.outer(*[np.sqrt(np.diag(covariance))] * 2)) > 0)
    assert set(data["timing_s"]) == {"read", "solve", "total"}
    assert data["timing_s"]["solve"] < data["timing_s"]["total"]
    assert len(data["inputs"][0]["sha256"]) == 64
    assert any(item["source"] == "gravity" and item["type"] == "B" for item in data["budget"])


def test_a_bad_verdict_is_exit_code_one_and_still_the_whole_object(simulated, capsys):
    """Of a log in which an accelerometer becomes 2 % larger halfway."""
    first, *lines = (simulated / "log.csv").read_text().splitlines()
    rows = np.array([line.split(",") for line in lines], dtype=float)
    rows[len(rows) // 2 :, first.split(",").index("acc_x [count]")] *= 1.02
    np.savetxt(simulated / "log.csv", rows, "%.9g", ",", header=first, comments="")
    assert run(calibrate(simulated, "--json", "--quiet")) == 1
    data = json.loads(capsys.readouterr().out)
    assert data["status"]["code"] == "suspect"
    assert len(data["parameters"]) == len(data["covariance"]["matrix"]) == 33


def test_calibrate_apply_and_back(simulated, capsys):
    """Outputs -> truth -> outputs is the identity to rounding."""
    cal, log = simulated / "cal.json", simulated / "log.csv"
    true, back = simulated / "true.csv", simulated / "back.csv"
    assert run(calibrate(simulated, "--out", cal)) == 0
    assert run(["apply", str(cal), str(log), "--out", str(true)]) == 0
    assert run(["apply", str(cal), str(true), "--invert", "--out", str(back)]) == 0
    a, b, c = (np.loadtxt(path, delimiter=",", skiprows=1) for path in (log, true, back))
    np.testing.assert_allclose(c, a, rtol=1e-11)
    assert true.read_text().splitlines()[0] == (
        "t [s],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2],gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s]"
    )
    # at rest the size of the corrected specific force is that of gravity, within its uncertainty and noise
    assert np.linalg.norm(b[:1000, 1:4].mean(axis=0)) == pytest.approx(9.81, abs=0.01)


def test_apply_refuses_what_the_calibration_is_not_for(simulated, capsys):
    cal = simulated / "cal.json"
    run(calibrate(simulated, "--out", cal, "--quiet"))
    capsys.readouterr()
    other = simulated / "other.csv"
    other.write_text(
        "t [s],acc_x [g],acc_y [g],acc_z [g]\n" + "".join(f"{i / 10},0,0,1\n" for i in range(50))
    )
    assert run(["apply", str(cal), str(other), "--out", str(simulated / "x.csv")]) == 2
    said_once(capsys.readouterr(), "other.csv", "expected count")
    assert not (simulated / "x.csv").exists()


def test_new_writes_what_calibrate_reads(simulated, capsys, monkeypatch):
    monkeypatch.chdir(simulated)
    (simulated / "imu.toml").unlink()
    assert run(["new", "imu", "log.csv", "--set", "site.latitude=48 deg"]) == 0
    assert run(["inspect", "log.csv", "--map", "imu-map.toml", "--json"]) == 0
    out = capsys.readouterr().out
    data = json.loads(out[out.index("{") :])
    assert [row["name"] for row in data["result"]["channels"]][:3] == ["acc_x", "acc_y", "acc_z"]
    assert (
        run(["calibrate", "imu", "log.csv", "--map", "imu-map.toml", "--study", "imu.toml", "--quiet"]) == 0
    )
    assert run(["new", "imu"]) == 2  # nothing is overwritten
    assert "exists already" in capsys.readouterr().err


def test_set_overrides_one_key(simulated, capsys):
    """Of gravity twice as uncertain the scale factors, which are by it, are twice as uncertain."""
    u = []
    for more in ((), ("--set", "site.gravity=9.81(2) m/s^2")):
        assert run(calibrate(simulated, *more, "--json", "--quiet")) == 0
        u.append({p["name"]: p["u"] for p in json.loads(capsys.readouterr().out)["parameters"]})
    assert u[1]["K1_x"] == pytest.approx(2.0 * u[0]["K1_x"], rel=0.02)
    assert u[1]["M_xy"] == pytest.approx(u[0]["M_xy"], rel=0.02)


@for_each(
    ("arguments", "words"),
    [
        (["frobnicate"], ["found 'frobnicate', expected new, inspect"]),
        (["calibrate", "ium"], ["calibrate: found 'ium', did you mean imu?"]),
        (["compare", "A", "B", "C"], ["compare: found 'C' too, expected inercal compare FIRST SECOND"]),
        (["compare", "A", "B", "--out", "x", "--out", "y"], ["compare: found --out twice, expected it once"]),
        (["aoa", "A", "--study", "B", "--states", "7"], ["found '7' for --states, expected 8, 11, 15 or 19"]),
        (["inspect", "log.csv", "--begin", "5 m"], ["--begin", "time"]),
        (["inspect", "log.csv", "--begin", "5 h"], ["--begin", "expected a span within the record"]),
        (["calibrate", "imu", "log.csv", "--study", "imu.toml", "--jsno"], ["--jsno"]),
        (["calibrate", "imu", "log.csv", "--study", "imu.toml", "--no-json"], ["--no-json"]),
        (["calibrate", "imu", "log.csv", "--study", "imu.toml", "--out", "no/cal.json"], ["no/cal.json"]),
        (
            ["calibrate", "imu", "log.csv", "--study", "imu.toml", "--set", "imu.staticstart=3 s"],
            ["static_start"],
        ),
        (
            ["calibrate", "imu", "log.csv", "--study", "imu.toml", "--set", "site.gravity=9.81 deg"],
            ["gravity"],
        ),
        (["calibrate", "imu", "log.csv", "--study", "imu.toml", "--map", "no-map.toml"], ["no-map.toml"]),
        (["calibrate", "imu", "imu.toml", "--study", "imu.toml"], ["imu.toml"]),
        (["inspect", "log.csv", "log.csv"], ["log.csv"]),
        (["apply", "log.csv", "log.csv", "--out", "x.csv"], ["log.csv"]),
        (["apply", "cal.json", "log.csv"], ["--out"]),
        (["examples", "nonesuch"], ["nonesuch", "xsens"]),
    ],
)
@for_each("json_too", [False, True])
def test_bad_usage_and_input_get_one_line_and_exit_code_two(
    arguments, words, json_too, simulated, capsys, monkeypatch
):
    monkeypatch.chdir(simulated)
    before = sorted(simulated.iterdir())
    assert run([*arguments, "--json"] if json_too else arguments) == 2
    said_once(capsys.readouterr(), *words)
    assert sorted(simulated.iterdir()) == before


@for_each("command", [(), ("new",), ("calibrate",), *COMMANDS])
def test_every_help_ends_with_an_example_that_runs_on_one_line(command, capsys):
    words = [word for word in command if word]
    assert run([*words, "--help"]) == 0
    last = capsys.readouterr().out.rstrip().splitlines()[-1]
    assert last.startswith("Example: inercal ")


def test_help_comes_before_anything_heavy_is_loaded():
    code = (
        "import sys, inercal.cli\n"
        "assert inercal.cli.run(['--help']) == 0\n"
        "heavy = {'numpy', 'numba', 'scipy', 'xarray', 'matplotlib', 'pydantic', 'jinja2', 'pint', 'h5py'}\n"
        "found = heavy & set(sys.modules)\n"
        "assert not found, found\n"
    )
    subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, timeout=60)


def test_calibrating_loads_no_compiler_and_no_plotting(simulated):
    code = (
        "import sys, inercal.cli\n"
        "assert inercal.cli.run(sys.argv[1:]) == 0\n"
        "found = {'numba', 'xarray', 'matplotlib', 'jinja2', 'pint', 'h5py'} & set(sys.modules)\n"
        "assert not found, found\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, *calibrate(simulated)], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 0, done.stderr


def test_version():
    import inercal as package

    assert inercal("--version").stdout.strip() == package.__version__


def test_a_reader_that_leaves_gets_a_sentence_not_a_traceback():
    command = f"{sys.executable} -m inercal schema | true"
    done = subprocess.run(command, shell=True, capture_output=True, text=True, timeout=60, check=False)
    assert "Traceback" not in done.stderr
    assert done.stderr.count("\n") <= 1


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="needs /dev/full, a device that is always full")
def test_a_full_disk_gets_a_sentence():
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            [sys.executable, "-m", "inercal", "schema"],
            stdout=full,
            stderr=subprocess.PIPE,
            text=True,
            timeout=60,
            check=False,
        )
    assert done.returncode == 2
    assert done.stderr == "inercal: error: standard output: No space left on device\n"


@pytest.mark.skipif(os.name == "nt", reason="signals as on POSIX")
def test_interrupted(simulated):
    """An interrupt in the middle ends with 130, one line, and no output file."""
    big = simulated / "big.csv"
    lines = (simulated / "log.csv").read_text().splitlines()
    rows = "\n".join(f"{i / 100},{line.split(',', 1)[1]}" for i, line in enumerate(lines[1:] * 60))
    big.write_text(lines[0] + "\n" + rows + "\n")
    out = simulated / "cal.json"
    command = [
        sys.executable,
        "-m",
        "inercal",
        "calibrate",
        "imu",
        str(big),
        "--study",
        str(simulated / "imu.toml"),
    ]
    process = subprocess.Popen(
        [*command, "--out", str(out)], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    time.sleep(1.0)
    process.send_signal(signal.SIGINT)
    stdout, stderr = process.communicate(timeout=60)
    assert process.returncode == 130, stderr
    assert stdout == ""
    assert stderr == "inercal: interrupted\n"
    assert not out.exists()


@pytest.mark.skipif(os.name == "nt", reason="signals as on POSIX")
def test_interrupted_while_a_text_is_executed():
    """As when a dataclass is made on import: Python may remember the interrupt, and die of it at its end."""
    program = (
        "import inercal.cli, inercal.cli.tree as tree\n"
        "def call(arguments): exec('raise KeyboardInterrupt')\n"
        "tree.call = call\n"
        "inercal.cli.main([])\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "inercal: interrupted\n")


@pytest.mark.skipif(os.name == "nt", reason="signals as on POSIX")
def test_interrupted_while_a_library_is_loaded():
    """A library that is interrupted while it is loaded may say that it could not be imported."""
    program = (
        "import os, signal, inercal.cli, inercal.cli.tree as tree\n"
        "def call(arguments):\n"
        "    try:\n"
        "        os.kill(os.getpid(), signal.SIGINT)\n"
        "    except KeyboardInterrupt:\n"
        "        raise ImportError('initialization failed') from None\n"
        "tree.call = call\n"
        "inercal.cli.main([])\n"
    )
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "inercal: interrupted\n")


def test_an_untouched_template_calibrates(simulated, capsys):
    """The study that `new` writes is a study: gravity then is uncertain by what it is over the Earth."""
    (simulated / "imu.toml").write_text(filled("imu"), "utf-8")
    assert run(calibrate(simulated, "--json", "--quiet")) == 0
    data = json.loads(capsys.readouterr().out)
    share = {item["source"]: item["share"].get("K1_x", 0) for item in data["budget"]}
    assert share["latitude"] > 0.9


def test_every_command_that_reads_a_recording_takes_a_part_of_it():
    """Those with a column map; `monitor` and `live` read a stream, of which each line goes out once it has come;
    the recordings of `batch` are those of many units."""
    without = []
    for verb, kind in COMMANDS:
        command = app()[verb][kind] if kind else app()[verb]
        options = {name for each in command.assemble_argument_collection() for name in each.names}
        if "--map" in options and not {"--begin", "--end"} <= options:
            without.append(verb)
    assert without == ["monitor", "batch", "live"]
