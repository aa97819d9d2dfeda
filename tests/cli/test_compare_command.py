"""``inercal compare``: two saved calibrations in, differences out, and one line for whatever cannot be compared."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from inercal.cli import run
from inercal.foundation.geometry.earth import GravityInput, Site
from inercal.foundation.results.files import load, save
from inercal.systems.imu.settings import ImuSettings
from inercal.systems.imu.simulate import draw_truth, hand_poses, simulate
from inercal.systems.imu.task import calibrate
from rows import for_each


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Two runs of one instrument, and a third after its x accelerometer changed."""
    folder = tmp_path_factory.mktemp("runs")
    truth = draw_truth(np.random.default_rng(5))
    site = Site(9.81, (GravityInput("gravity", 0.01, "m/s^2", 1.0),))
    for k, name in enumerate(("one.json", "two.toml", "three.json")):
        rng = np.random.default_rng([5, k])
        record, _ = simulate(truth, hand_poses(rng, 14), 9.81, 0.8, rng, rate=50.0)
        estimate = calibrate(record, ImuSettings(site, time_base_u=2e-5)).estimate
        if name.startswith("three"):
            factor = np.where(np.array(estimate.names) == "K1_x", 1.002, 1.0)
            covariance = estimate.covariance * np.outer(factor, factor)
            estimate = replace(estimate, values=estimate.values * factor, covariance=covariance)
        save(estimate, folder / name)
    (folder / "noise.csv").write_text("t [s],acc_x [g]\n0,1\n1,1\n")
    return folder


@pytest.fixture(autouse=True)
def here(runs, monkeypatch):
    monkeypatch.chdir(runs)


def test_two_runs_of_one_instrument_agree(capsys):
    assert run(["compare", "one.json", "two.toml", "--json", "--quiet"]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    data = json.loads(captured.out, parse_constant=lambda text: pytest.fail(f"{text} is not JSON"))
    assert data["command"] == "compare"
    assert data["status"]["code"] == "ok"
    assert data["result"]["common_sources"] == ["gravity", "time base"]
    assert [source["path"] for source in data["inputs"]] == ["one.json", "two.toml"]
    assert set(data["timing_s"]) == {"read", "solve", "total"}
    one, two = load("one.json"), load("two.toml")
    covariance = np.array(data["covariance"]["matrix"])
    for i, (p, row) in enumerate(zip(data["parameters"], data["result"]["coefficients"], strict=True)):
        assert p["name"] == row["name"] == one.names[i]
        assert p["value"] == pytest.approx(two[p["name"]].value - one[p["name"]].value)
        assert covariance[i, i] == pytest.approx(p["u"] ** 2)
        assert row["normalised_error"] == pytest.approx(abs(p["value"]) / p["U"])
    # gravity, by far the largest part of both, is off the scale factors
    by_name = {row["name"]: row for row in data["result"]["coefficients"]}
    assert by_name["K1_x"]["common"] == ["gravity"]
    assert by_name["K1_x"]["u"] < 0.2 * by_name["K1_x"]["u_first"]
    assert by_name["S_x"]["common"] == ["time base"]


def test_a_change_is_found_named_and_exit_code_one(capsys):
    assert run(["compare", "two.toml", "three.json", "--out", "d.toml", "--report", "d.html"]) == 1
    captured = capsys.readouterr()
    moved = [line for line in captured.out.splitlines() if "  moved" in line]
    assert [line.split()[0] for line in moved] == ["K1_x"]
    assert "inconsistent: K1_x (E_n " in captured.out
    assert "report: d.html" in captured.err
    assert load("d.toml").status.value == "inconsistent"
    page = Path("d.html").read_text("utf-8")
    assert "<b>moved</b>" in page
    assert "Common to both, and taken off:\ngravity, time base." in page
    assert page.count("<img") == 1
    assert "<script" not in page


@for_each(
    ("files", "words"),
    [
        (["no.json", "one.json"], ["no.json", "cannot be read"]),
        (["one.json", "no.toml"], ["no.toml", "cannot be read"]),
        (["one.json", "noise.csv"], ["noise.csv", "expected a calibration"]),
        (["one.json", "drift.json"], ["drift.json", "is a comparison itself"]),
        (["one.json", "gyro.json"], ["gyro.json", "no coefficient in common"]),
        (["one.json", "volts.json"], ["volts.json", "K0_x is in V", "count"]),
        (["one.json"], ["SECOND"]),
    ],
)
@for_each("more", [[], ["--json"]])
def test_what_cannot_be_compared_gets_one_line(files, words, more, capsys):
    one = load("one.json")
    run(["compare", "one.json", "two.toml", "--out", "drift.json", "--quiet"])
    save(replace(one, names=tuple(f"other_{name}" for name in one.names)), "gyro.json")
    save(replace(one, units=tuple(text.replace("count", "V") for text in one.units)), "volts.json")
    capsys.readouterr()
    assert run(["compare", *files, *more]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    lines = captured.err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("inercal: error: ")
    for word in words:
        assert word in lines[0]


@pytest.mark.parametrize("option", [["--out", "d.csv"], ["--out", "one.json"], ["--report", "d.pdf"]])
def test_outputs_that_cannot_be(option, capsys):
    assert run(["compare", "one.json", "two.toml", *option]) == 2
    assert option[1] in capsys.readouterr().err
