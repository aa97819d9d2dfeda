"""`inercal new selfcal` and `inercal simulate selfcal`: from nothing to a recording that fits its study."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest
from new_studies import FILL
from numpy.testing import assert_allclose, assert_array_equal
from paper_study import TRUTH

from inercal.cli import run
from inercal.examples import FOLDER
from inercal.faces.studies.load import load_selfcal_study
from inercal.foundation.records.read import read
from inercal.systems.selfcal.platform.coefficients import NAMES
from inercal.systems.selfcal.platform.plan import path
from inercal.systems.selfcal.reading import recording_of
from inercal.systems.selfcal.simulate import experiment, simulate

SHORT = [
    "--set", 'plan.turns=[["z", "30 deg"], ["x", "20 deg", "2 deg/s"], ["rest", "4 s"]]',
    "--set", "site.latitude=40 deg",
]  # fmt: skip


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    """A folder to work in, with the study that `inercal new selfcal` writes."""
    monkeypatch.chdir(tmp_path)
    assert run(["new", "selfcal", "--quiet", *FILL]) == 0
    return tmp_path


def simulated(*more: str) -> int:
    return run(["simulate", "selfcal", "selfcal.toml", *SHORT, *more])


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
    settings = load_selfcal_study("selfcal.toml", SHORT[1::2])
    found, expected = (
        recording_of(read(out), settings),
        simulate(experiment(settings), np.random.default_rng(7)),
    )
    assert found.findings == ()
    for name in ("t", "rate", "th", "acc"):
        assert_allclose(getattr(found, name), getattr(expected.recording, name), rtol=1e-13, atol=1e-16)
    assert_allclose(found.reference, expected.attitude, rtol=1e-13, atol=1e-16)


def test_another_seed_is_another_run_of_the_same_path(folder):
    for seed in (1, 2):
        assert simulated("--seed", str(seed), "--out", f"{seed}.csv", "--quiet") == 0
    a, b = read("1.csv"), read("2.csv")
    assert_array_equal(a["wc_y"].values, b["wc_y"].values)
    assert not np.array_equal(a["th_y"].values, b["th_y"].values)


def test_disturbances_by_set(folder):
    assert simulated("--set", "disturbances.dropouts=30 %", "--out", "run.csv", "--quiet") == 0
    missing = np.isnan(read("run.csv")["th_x"].values)
    assert 0.15 < missing.mean() < 0.45


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (
            ["--out", "run.csv", "--set", "noise.encoder=0 arcsec"],
            ["selfcal.toml", "noise.encoder: found '0 arcsec'"],
        ),
        (["--out", "run.csv", "--set", "plan.path=round"], ["plan.path", "expected 'paper'"]),
    ],
)
def test_one_line_for_what_is_wrong(more, words, folder, capsys):
    capsys.readouterr()
    assert simulated(*more) == 2
    said_once(capsys.readouterr(), *words)
    assert not list(folder.glob("run*"))


@pytest.mark.parametrize("table", ["plan", "truth"])
def test_a_study_without_plan_or_truth_says_so(table, folder, capsys):
    text = Path("selfcal.toml").read_text()
    start = text.index(f"[{table}]")
    Path("bare.toml").write_text(text[:start] + text[text.index("\n[", start) :])
    capsys.readouterr()
    assert run(["simulate", "selfcal", "bare.toml", "--out", "run.csv"]) == 2
    said_once(capsys.readouterr(), f"bare.toml: {table}: missing")


def test_new_for_a_recording_without_units_guesses_a_map(folder, capsys):
    assert simulated("--out", "run.csv", "--quiet") == 0
    head, rest = Path("run.csv").read_text().split("\n", 1)
    plain = ",".join(title.partition(" ")[0] for title in head.split(","))
    Path("plain.csv").write_text(f"{plain}\n{rest}")
    assert run(["new", "selfcal", "plain.csv", "--out", "s.toml", "--quiet", *FILL]) == 0
    guessed = tomllib.loads(Path("s-map.toml").read_text())["columns"]
    assert {"t", "acc_x", "acc_y", "acc_z"} <= set(guessed)
    assert guessed["acc_x"]["unit"] == "m/s^2"
    assert run(["new", "selfcal"]) == 2  # nothing is overwritten


def test_the_example_that_ships_is_the_simulation_of_its_study():
    """At seed 1, rounded to 1e-6 deg/h, 1e-7 deg and 1e-7 m/s^2; nothing is found wrong with it."""
    settings = load_selfcal_study(FOLDER / "selfcal.toml")
    found = recording_of(read(FOLDER / "selfcal.csv.gz"), settings)
    expected = simulate(experiment(settings), np.random.default_rng(1)).recording
    assert found.findings == ()
    assert_allclose(found.t, expected.t, atol=1e-9)
    assert_allclose(found.rate, expected.rate, rtol=0.0, atol=np.radians(0.51e-6) / 3600.0)
    assert_allclose(found.th, expected.th, rtol=0.0, atol=np.radians(0.51e-7))
    assert_allclose(found.acc, expected.acc, rtol=0.0, atol=0.51e-7)
    assert settings.plan == path("paper")
    assert_allclose(settings.truth, TRUTH, rtol=1e-12)


def test_the_example_is_copied_with_its_study(tmp_path, capsys):
    assert run(["examples", "selfcal", "--out", str(tmp_path / "here")]) == 0
    assert sorted(each.name for each in (tmp_path / "here").iterdir()) == ["selfcal.csv.gz", "selfcal.toml"]
    assert "inercal selfcal " in capsys.readouterr().out


def test_many_runs_are_judged(folder, capsys):
    """With --runs the study is simulated and calibrated so often; the file, the page and standard output agree."""
    paper = ["--set", "model.states=paper"]
    assert simulated("--runs", "40", *paper, "--json", "--out", "mc.json", "--report", "mc.html") == 0
    data = json.loads(capsys.readouterr().out)
    assert data["status"]["code"] == "ok"
    assert data["result"]["runs"] == data["result"]["converged"] == 40
    assert data["result"]["passed"] is True
    assert [each["name"] for each in data["result"]["parameters"]] == list(NAMES)
    _, high = data["result"]["nees"]["limits"]
    assert data["result"]["nees"]["mean"] <= high
    assert json.loads(Path("mc.json").read_text())["result"] == data["result"]
    assert "simulated many times" in Path("mc.html").read_text()


def test_many_runs_go_on_from_a_folder(folder, capsys):
    """Half of the chunks of a campaign that was killed: the same digits. Another seed is another campaign."""
    command = ["--runs", "12", "--checkpoint", "kept", "--json", "--quiet"]
    assert simulated(*command) == 0
    first = json.loads(capsys.readouterr().out)["result"]
    chunks = sorted(Path("kept").glob("chunk-*.npz"))
    times = {each: each.stat().st_mtime_ns for each in chunks[::2]}
    for each in chunks[1::2]:
        each.unlink()
    assert simulated(*command) == 0
    assert json.loads(capsys.readouterr().out)["result"] == first
    assert all(each.stat().st_mtime_ns == time for each, time in times.items())
    assert simulated(*command, "--seed", "2") == 2
    assert "kept" in capsys.readouterr().err


def test_many_runs_with_noise_stated_too_small_fail(folder, capsys):
    """Encoder errors that the study does not state: exit code 1, and the object all the same."""
    harmonics = 'disturbances.harmonics=[{axis="x", order=1, amplitude="30 arcsec", phase="0 deg"}]'
    assert simulated("--runs", "20", "--json", "--set", harmonics) == 1
    data = json.loads(capsys.readouterr().out)
    assert data["status"]["code"] == "inconsistent"
    assert data["result"]["passed"] is False


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (["--runs", "1"], "--runs: found 1"),
        (["--runs", "5", "--seed", "-1"], "--seed: found -1"),
        (["--runs", "5", "--out", "mc.csv"], "found the suffix '.csv'"),
        (["--out", "run.csv", "--checkpoint", "kept"], "--checkpoint: found without --runs"),
        (["--out", "run.csv", "--report", "mc.html"], "--report: found without --runs"),
    ],
)
def test_many_runs_that_cannot_be(folder, capsys, more, words):
    capsys.readouterr()
    assert simulated(*more) == 2
    said_once(capsys.readouterr(), words)


def test_many_runs_need_a_base_that_is_stated_well(folder, capsys):
    """A filter alone does not find a base that is half a degree off, and a campaign is of filters alone."""
    capsys.readouterr()
    wide = ["--set", "model.states=extended", "--set", "prior.beta=30 arcmin"]
    assert simulated("--runs", "5", *wide) == 2
    assert "prior.beta: found 30 arcmin" in capsys.readouterr().err
    assert simulated("--runs", "5", "--set", "rig.heading=unknown") == 2
    assert "rig.heading: found it unknown, expected a known one for a campaign" in capsys.readouterr().err
