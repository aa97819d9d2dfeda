"""``calibrate imu RUN1 RUN2 ...``: one combined calibration."""

import json
from dataclasses import replace

import numpy as np
import pytest

from inercal.cli import run
from inercal.foundation.records.write import write_record
from inercal.foundation.results.files import load
from inercal.systems.imu.simulate import draw_truth, hand_poses, simulate


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Three runs of an instrument whose gyro has another bias each time, 20 counts rms."""
    folder = tmp_path_factory.mktemp("runs")
    rng = np.random.default_rng(1)
    truth = draw_truth(rng)
    for k in range(3):
        gyro = replace(truth.gyro, bias=truth.gyro.bias + rng.normal(0.0, 20.0, 3))
        record, _ = simulate(replace(truth, gyro=gyro), hand_poses(rng, 16), 9.81, 0.8, rng, rate=50.0)
        write_record(record, folder / f"run{k}.csv")
    (folder / "imu.toml").write_text('[site]\ngravity = "9.81(1) m/s^2"\nlatitude = "0.8 rad"\n')
    (folder / "truth.json").write_text(json.dumps(truth.values()))
    return folder


def calibrate(folder, *files, **options):
    more = [word for key, value in options.items() for word in (f"--{key}", str(value))]
    return run(
        ["calibrate", "imu", *(str(folder / f) for f in files), "--study", str(folder / "imu.toml"), *more]
    )


def test_runs_are_combined_and_their_changes_said(folder, tmp_path, capsys):
    out, page = tmp_path / "c.json", tmp_path / "c.html"
    assert calibrate(folder, "run0.csv", "run1.csv", "run2.csv", out=out, report=page) == 0
    said = capsys.readouterr()
    assert "33 coefficients from 3 runs" in said.out
    found, truth = load(out), json.loads((folder / "truth.json").read_text())
    changed = [each.headline for each in found.findings if each.code == "between_runs"]
    assert any(each.startswith("D_F_x changes from run to run") for each in changed)
    assert found.result["between"]["D_F_x"]["s"] > 5.0
    for name in found.names:  # those that the truth lacks, K2 and g-sensitivity, are not simulated
        assert abs(found[name].value - truth.get(name, 0.0)) < 3.0 * found[name].U, name
    # gravity is the same in all runs: the scale factors are no better known than by it
    assert found["K1_x"].u >= 0.99 * found["K1_x"].value * 0.01 / 9.81
    assert len([source for source in found.inputs if source.path.endswith(".csv")]) == 3
    assert "The runs about their combined value" in page.read_text("utf-8")


def test_the_combined_calibration_is_applied_like_any_other(folder, tmp_path, capsys):
    out = tmp_path / "c.toml"
    assert calibrate(folder, "run0.csv", "run1.csv", out=out) == 0
    assert run(["apply", str(out), str(folder / "run2.csv"), "--out", str(tmp_path / "x.csv")]) == 0


def test_a_run_that_is_no_calibration_gives_the_verdict(folder, tmp_path, capsys):
    lines = (folder / "run2.csv").read_text().splitlines(keepends=True)
    (tmp_path / "short.csv").write_text("".join(lines[:2000]))
    code = calibrate(folder, "run0.csv", "run1.csv", tmp_path / "short.csv", json="")
    assert code == 2  # --json takes no value: said as usage
    capsys.readouterr()
    files = [str(folder / "run0.csv"), str(folder / "run1.csv"), str(tmp_path / "short.csv")]
    assert run(["calibrate", "imu", *files, "--study", str(folder / "imu.toml"), "--json", "--quiet"]) == 1
    data = json.loads(capsys.readouterr().out)
    assert data["status"]["code"] == "unobservable"
    assert "run 3" in data["status"]["message"]
    assert len(data["parameters"]) == 33


def test_the_same_run_twice_is_refused(folder, capsys):
    assert calibrate(folder, "run0.csv", "run0.csv") == 2
    assert "given twice" in capsys.readouterr().err
