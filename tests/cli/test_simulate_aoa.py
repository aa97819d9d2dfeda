"""`inercal new aoa` and `inercal simulate aoa`: from nothing to a recording that fits its study."""

import json
from pathlib import Path

import numpy as np
import pytest
from new_studies import FILL
from numpy.testing import assert_allclose, assert_array_equal

from inercal.cli import run
from inercal.faces.studies.load import load_aoa_study
from inercal.foundation.records.read import read
from inercal.systems.aoa.reading.from_record import recording_of
from inercal.systems.aoa.simulate import simulate
from rows import for_each

SHORT = ["--set", "motion.duration=2 s", "--set", "site.latitude=40 deg"]
PAUSES = 'motion={kind="pitch-pause", first="0 deg", last="4 deg", step="2 deg", move="1 s", pause="1 s"}'


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """A folder to work in, with the study that `inercal new aoa` writes."""
    monkeypatch.chdir(tmp_path)
    assert run(["new", "aoa", "--quiet", *FILL]) == 0
    return tmp_path


def simulated(*more: str) -> int:
    return run(["simulate", "aoa", "aoa.toml", *SHORT, *more])


def said_once(captured, *words: str) -> None:
    """Standard output is empty, standard error one line of the right form that holds the words."""
    assert captured.out == ""
    assert captured.err.count("\n") == 1, captured.err
    assert captured.err.startswith("inercal: error: ")
    for word in words:
        assert word in captured.err


def test_the_recording_is_that_of_the_seed(folder):
    out = "run.npz"
    assert simulated("--seed", "7", "--out", out, "--quiet") == 0
    settings = load_aoa_study("aoa.toml", SHORT[1::2])
    found = recording_of(read(out), settings)
    expected = simulate(settings, np.random.default_rng(7))
    assert found.findings == ()
    for name in ("t", "acc", "gyro", "reference"):
        assert_allclose(getattr(found, name), getattr(expected.recording, name), rtol=1e-12, atol=1e-15)
    assert_allclose(found.reference, expected.theta, rtol=1e-12)


def test_pauses_have_numbers(folder):
    assert run(["simulate", "aoa", "aoa.toml", "--set", PAUSES, "--out", "run.csv", "--quiet"]) == 0
    record = read("run.csv")
    point, angle = record["point"].values, record["theta_ref"].values
    assert len(point) == 5000
    for number in (1, 2, 3):
        assert_allclose(angle[point == number], 2.0 * (number - 1), atol=1e-12)
    assert np.isnan(point).sum() == 2000


def test_a_recorded_motion_is_an_input_and_is_spared(folder, capsys):
    t = np.arange(0.0, 1.0, 0.01).tolist()
    Path("pitch.csv").write_text("t [s],theta_ref [deg]\n" + "".join(f"{a},{3 * np.sin(9 * a)}\n" for a in t))
    command = ["simulate", "aoa", "aoa.toml", "--set", 'motion={kind="file", file="pitch.csv"}', "--out"]
    capsys.readouterr()
    assert run([*command, "run.csv", "--json", "--quiet"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert [source["path"] for source in data["inputs"]] == ["aoa.toml", "pitch.csv"]
    assert_allclose(read("run.csv")["theta_ref"].values[::10], 3 * np.sin(9 * np.array(t))[:99], atol=1e-6)
    assert run([*command, "pitch.csv"]) == 2
    said_once(capsys.readouterr(), "pitch.csv: is an input")


def test_another_seed_is_another_run_of_the_same_motion(folder):
    for seed in (1, 2):
        assert simulated("--seed", str(seed), "--out", f"{seed}.csv", "--quiet") == 0
    a, b = read("1.csv"), read("2.csv")
    assert_array_equal(a["theta_ref"].values, b["theta_ref"].values)
    assert not np.array_equal(a["a1"].values, b["a1"].values)


@for_each(
    ("more", "words"),
    [
        (["--out", "run.csv", "--set", "sensors.a1.r=250 m"], ["aoa.toml: sensors.a1.r", "mm given as m?"]),
        (["--out", "run.csv", "--set", "noise.gyro=-1 deg/s"], ["noise.gyro", "above zero"]),
        (["--out", "run.csv", "--set", 'motion={kind="file", file="no.csv"}'], ["no.csv"]),
    ],
)
def test_one_line_for_what_is_wrong(more, words, folder, capsys):
    capsys.readouterr()
    assert run(["simulate", "aoa", "aoa.toml", *more]) == 2
    said_once(capsys.readouterr(), *words)
    assert not list(folder.glob("run*"))


def test_a_study_without_motion_says_so(folder, capsys):
    text = Path("aoa.toml").read_text()
    start = text.index("[motion]")
    Path("bare.toml").write_text(text[:start] + text[text.index("[disturbances]") :])
    capsys.readouterr()
    assert run(["simulate", "aoa", "bare.toml", "--out", "run.csv"]) == 2
    said_once(capsys.readouterr(), "bare.toml: motion: missing")
