"""Studies that ask for what no computer holds, or for sizes that no rig has, are refused before any work is done."""

import resource

import pytest
from new_studies import FILL

from inercal.cli import run
from rows import for_each


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("studies")
    for kind in ("strapdown", "turntable", "selfcal", "aoa"):
        assert run(["new", kind, "--out", str(path / f"{kind}.toml"), "--quiet", *FILL]) == 0
    return path


KINDS = ("strapdown", "turntable", "selfcal", "aoa")
SIMULATE = {kind: f"simulate {kind} {kind}.toml --out out.csv" for kind in KINDS}
SENSITIVITY = "sensitivity turntable.toml"
POSITIONS = "design positions turntable.toml"
PATH = "design selfcal selfcal.toml"
TURNS = "design strapdown strapdown.toml"


@for_each(
    ("command", "override", "words"),
    [
        (
            SIMULATE["turntable"],
            "positions.grid={ phi1 = 1000000000, phi2 = 1000000000 }",
            "positions, expected at most",
        ),
        (SIMULATE["strapdown"], "plan.sample_rate=1e15 Hz", "samples, expected 100 to"),
        (SIMULATE["strapdown"], "plan.dwell=1e9 s", "samples, expected 100 to"),
        (SIMULATE["strapdown"], "plan.sample_rate=1e-9 Hz", "samples, expected 100 to"),
        (SIMULATE["turntable"], "instrument.sample_rate=1e5 Hz", "samples in all, expected at most"),
        (SIMULATE["turntable"], "instrument.sample_rate=1e15 Hz", "samples in a dwell, expected at most"),
        (SIMULATE["turntable"], "instrument.sample_rate=1e300 Hz", "out of range"),
        (SIMULATE["turntable"], "instrument.noise=1e-300 deg/h", "out of range"),
        (SIMULATE["turntable"], 'rig.errors.d_eta={ normal = "1e9 um" }', "a length above 0 and up to 1 m"),
        (SIMULATE["turntable"], 'positions.file=""', "expected a text that is not empty"),
        (SIMULATE["selfcal"], "plan.step=1e-59 s", "steps of 1e-59 s, expected 10 to"),
        (SIMULATE["selfcal"], "plan.step=5e-324 s", "out of range"),
        (SIMULATE["selfcal"], "plan.rate=1e-40 deg/s", "steps of 0.2 s, expected 10 to"),
        (SIMULATE["aoa"], "motion.duration=1e12 s", "samples, expected 2 to"),
        (SIMULATE["aoa"], "motion.sample_rate=1e-50 Hz", "samples, expected 2 to"),
        (SIMULATE["aoa"], "motion.sample_rate=1e400 Hz", "out of range"),
        (SIMULATE["aoa"], 'sensors.a1.calibration=""', "expected a text that is not empty"),
        (SIMULATE["aoa"], 'motion.file=""', "expected a text that is not empty"),
        (SENSITIVITY, "positions.grid={ phi1 = 700, phi2 = 700 }", "490000 positions, expected at most"),
        (SENSITIVITY, "analysis.samples=1000000000", "expected less than or equal to"),
        (SENSITIVITY, "analysis.samples=10000000000000000000000000", "expected less than or equal to"),
        (POSITIONS, "design.positions=1000000000", "expected less than or equal to"),
        (POSITIONS, "design.candidates={ phi1 = 1000000, phi2 = 1000000 }", "expected at most"),
        (TURNS, "design.turns=1000000000", "expected less than or equal to"),
        (TURNS, "design.time=1e12 s", "a time above 0, up to 1e6 s"),
        (TURNS, "design.time=10 s", "for 18 turns, expected 160.8 s or more"),
        (TURNS, 'design.angles=["1e-9 deg"]', "an angle from 15 to 360 deg"),
        (TURNS, "noise.angle_random_walk=1e-12 deg/sqrt(h)", "bounds are lost in rounding"),
        (PATH, "design.turns=1000000000", "expected less than or equal to"),
        (PATH, "design.angle=1e-9 deg", "expected at most 5000: a larger angle, or less time"),
        (PATH, "design.angle=1e-300 deg", "out of range"),
        (PATH, "design.time=1e12 s", "steps of 0.2 s, expected at most 5,000,000"),
        (PATH, "design.time=2e5 s", "turns of 30 deg within 200000 s, expected at most 5000"),
        (PATH, "design.time=1e-12 s", "expected a smaller angle, more time or wider limits"),
    ],
)
def test_one_sentence_before_memory_is_taken(command, override, words, folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert run([*command.split(), "--set", override, "--quiet"]) == 2
    out, err = capsys.readouterr()
    study = next(word for word in command.split() if word.endswith(".toml"))
    assert out == ""
    assert err.startswith(f"inercal: error: {study}: ")
    assert words in err
    assert err.count("\n") == 1
    assert override.partition("=")[0].split(".")[0] in err
    # in kilobytes; loading of libraries takes some, any of these works would take far more
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 300_000
    assert not (folder / "out.csv").exists()


@pytest.mark.parametrize("runs", ["1", "-5", "1000001", "1" + "0" * 30, "1e3", "nan"])
def test_a_number_of_runs_that_nobody_waits_for(runs, folder, monkeypatch, capsys):
    monkeypatch.chdir(folder)
    assert run(["simulate", "selfcal", "selfcal.toml", "--runs", runs]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert err.startswith("inercal: error: --runs: found ")
