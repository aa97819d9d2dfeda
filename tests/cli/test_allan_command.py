"""``inercal allan``: JSON in SI, units of the field for people, curves and pages, and one line for bad input."""

import json

import numpy as np
import pytest

from inercal.cli import run
from inercal.examples import FOLDER
from inercal.faces.validate.foundation import ALLANTOOLS, TAU
from inercal.foundation.instruments.noise import NoiseModel
from inercal.foundation.results.files import load
from rows import for_each

#: 0.1 deg/sqrt(h) and 50 ug/sqrt(Hz)
WALKS = {"gyro": np.radians(0.1) / 60.0, "acc": 50e-6 * 9.80665}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("static")
    rng = np.random.default_rng(30)
    gyro, acc = (NoiseModel(N=WALKS[name]).simulate(6000, 0.01, rng, 2) for name in ("gyro", "acc"))
    columns = np.column_stack([np.arange(6000) / 100, np.degrees(gyro), acc / 9.80665 + [0.0, 1.0]])
    header = "t [s],gyro_x [deg/s],gyro_y [deg/s],acc_x [g],acc_z [g]"
    np.savetxt(path / "static.csv", columns, "%.12g", ",", header=header, comments="")
    columns[4000:, 1] += 30.0 * np.sin(np.arange(2000.0) / 100.0)
    np.savetxt(path / "moved.csv", columns, "%.12g", ",", header=header, comments="")
    (path / "hot.csv").write_text("t [s],temperature [degC]\n" + "".join(f"{k},20\n" for k in range(50)))
    (path / "short.csv").write_text("t [s],acc_x [g]\n0,1\n1,1.01\n2,1\n")
    return path


@pytest.fixture(autouse=True)
def here(folder, monkeypatch):
    monkeypatch.chdir(folder)


def test_json_is_the_contract_in_si(capsys):
    assert run(["allan", "static.csv", "--json", "--quiet"]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    data = json.loads(captured.out, parse_constant=lambda text: pytest.fail(f"{text} is not JSON"))
    assert data["command"] == "allan"
    assert list(data["result"]["channels"]) == ["gyro_x", "gyro_y", "acc_x", "acc_z"]
    for name, found in data["result"]["channels"].items():
        lengths = {len(found[key]) for key in ("tau", "deviation", "lower", "upper")}
        assert len(lengths) == 1
        assert all(
            a < b < c for a, b, c in zip(found["lower"], found["deviation"], found["upper"], strict=True)
        )
        assert found["unit"] == ("rad/s" if name.startswith("gyro") else "m/s^2")
    by_name = {p["name"]: p for p in data["parameters"]}
    assert list(by_name) == data["covariance"]["names"]
    assert len(by_name) == 20
    for name, unit in (("N_gyro_x", "rad/sqrt(s)"), ("N_acc_z", "m/s/sqrt(s)")):
        p = by_name[name]
        assert p["unit"] == unit
        assert abs(p["value"] - WALKS[name.split("_")[1]]) < 4.0 * p["u"]
    assert [by_name[f"{symbol}_gyro_x"]["unit"] for symbol in "BKRQ"] == [
        "rad/s",
        "rad/s/sqrt(s)",
        "rad/s^2",
        "rad",
    ]
    assert set(data["timing_s"]) == {"read", "solve", "total"}
    assert len(data["inputs"][0]["sha256"]) == 64


def test_people_see_units_of_the_field(capsys):
    assert run(["allan", "static.csv"]) == 0
    out = capsys.readouterr().out
    for words in (
        "N [deg/sqrt(h)]",
        "B [deg/h]",
        "K [deg/h/sqrt(h)]",
        "N [ug/sqrt(Hz)]",
        "B [ug]",
        "Q [arcsec]",
    ):
        assert words in out
    row = next(line.split() for line in out.splitlines() if line.startswith("gyro_x"))
    assert row[2] == "±"
    assert abs(float(row[1]) - 0.1) < 4.0 * float(row[3])
    row = next(line.split() for line in out.splitlines() if line.startswith("acc_z"))
    assert abs(float(row[1]) - 50.0) < 4.0 * float(row[3])
    assert "ok: noise of 4 channels from 60 s at rest" in out


def test_results_curves_and_page_go_to_files(capsys):
    assert run(["allan", "static.csv", "--out", "noise.toml", "--report", "noise.html"]) == 0
    assert run(["allan", "static.csv", "--out", "curves.csv", "--quiet"]) == 0
    saved = load("noise.toml")
    assert saved.names[0] == "N_gyro_x"
    lines = open("curves.csv", encoding="utf-8").read().splitlines()  # noqa: SIM115
    assert lines[0] == "channel,unit,tau [s],deviation,lower,upper,fitted"
    first = lines[1].split(",")
    told = saved.result["channels"]["gyro_x"]
    assert first[:2] == ["gyro_x", "rad/s"]
    assert [float(x) for x in first[2:6]] == [told[key][0] for key in ("tau", "deviation", "lower", "upper")]
    assert len(lines) == 1 + sum(len(each["tau"]) for each in saved.result["channels"].values())
    assert "noise.html" in capsys.readouterr().err


def test_two_runs_of_noise_can_be_compared(capsys):
    run(["allan", "static.csv", "--end", "30 s", "--out", "one.json", "--quiet"])
    run(["allan", "static.csv", "--begin", "30 s", "--out", "two.json", "--quiet"])
    capsys.readouterr()
    run(["compare", "one.json", "two.json", "--json", "--quiet"])
    rows = json.loads(capsys.readouterr().out)["result"]["coefficients"]
    assert next(row for row in rows if row["name"] == "N_gyro_x")["normalised_error"] < 2.0


def test_an_instrument_that_moved_is_exit_code_one_and_its_rest_is_not(capsys):
    assert run(["allan", "moved.csv"]) == 1
    captured = capsys.readouterr()
    assert "inconsistent: the instrument was not at rest (gyro_x)" in captured.out
    assert "not_at_rest: gyro_x moves" in captured.err
    assert run(["allan", "moved.csv", "--end", "39 s"]) == 0


@for_each(
    ("arguments", "words"),
    [
        (["no.csv"], ["no.csv"]),
        (["hot.csv"], ["hot.csv", "found temperature"]),
        (["short.csv"], ["short.csv", "found 3 samples"]),
        (["static.csv", "--end", "soon"], ["--end", "'soon'"]),
        (["static.csv", "--begin", "5 m"], ["--begin", "length"]),
        (["static.csv", "--begin", "100 s"], ["--begin", "within the record"]),
        (["static.csv", "--out", "x.npz"], ["x.npz", ".csv"]),
        (["static.csv", "--out", "static.csv"], ["static.csv", "is an input"]),
        ([], ["FILES"]),
    ],
)
@for_each("more", [[], ["--json"]])
def test_bad_input_gets_one_line(arguments, words, more, capsys):
    assert run(["allan", *arguments, *more]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    lines = captured.err.splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("inercal: error: ")
    for word in words:
        assert word in lines[0]


def test_the_ring_laser_recording_with_its_map(capsys):
    """Angles and velocities gained, in counts: deviations in deg/h and m/s^2 as another program has them.

    Values of allantools' oadev on the same recording, at 1 s and 10 s.
    """
    command = ["allan", str(FOLDER / "lasergyro.txt.gz"), "--map", str(FOLDER / "lasergyro-map.toml")]
    assert run([*command, "--json", "--quiet"]) == 1
    data = json.loads(capsys.readouterr().out)
    assert data["status"]["code"] == "suspect"  # it stood on a vehicle that was disturbed
    for name, size, published in (
        ("gyro_x", np.radians(1.0) / 3600.0, ALLANTOOLS[0]),
        ("gyro_z", np.radians(1.0) / 3600.0, ALLANTOOLS[2]),
        ("acc_x", 1.0, ALLANTOOLS[3]),
    ):
        found = data["result"]["channels"][name]
        for tau, expected in list(zip(TAU, published, strict=True))[2:4]:
            at = int(np.argmin(np.abs(np.array(found["tau"]) - tau)))
            assert found["tau"][at] == pytest.approx(tau)
            assert found["deviation"][at] == pytest.approx(expected * size, rel=1e-6)
    disturbed = [f["message"].split()[0] for f in data["findings"] if f["code"] == "not_at_rest"]
    assert disturbed == ["gyro_x", "gyro_y", "gyro_z"]
