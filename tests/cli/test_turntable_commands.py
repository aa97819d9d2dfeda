"""The commands on a study of a turntable: what they print, what they write, how they end."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
import xarray
from new_studies import FILL

from inercal.cli import run
from inercal.foundation.rigs.plans import named
from rows import for_each

pytestmark = pytest.mark.usefixtures("undrawn")

STUDY = """
[site]
latitude = "39.1 deg"
gravity = "9.8 m/s^2"
[rig]
kind = "two_axis_turntable"
[rig.errors]
default = { uniform = "2 arcmin" }
[positions]
grid = { phi1 = 6, phi2 = 6 }
[instrument]
unit = "deg/h"
noise = "0.01 deg/h"
[instrument.coefficients]
DX_F = "50 deg/h"
DX_X = "60 deg/h/g"
DX_XX = "2 deg/h/g^2"
k_x = "1"
[design]
positions = 14
candidates = { phi1 = 8, phi2 = 8, offset = "none" }
"""


@pytest.fixture
def folder(tmp_path, monkeypatch) -> Path:
    monkeypatch.chdir(tmp_path)
    Path("t.toml").write_text(STUDY)
    return tmp_path


def as_json(arguments, capsys, code=0):
    """The one object on standard output."""
    assert run([*arguments, "--json", "--quiet"]) == code
    captured = capsys.readouterr()
    assert captured.err == ""
    return json.loads(captured.out, parse_constant=lambda text: pytest.fail(f"{text} is not JSON"))


def refused(arguments, capsys, *words):
    """Exit code 2, nothing on standard output, one line with the words on standard error."""
    for more in ([], ["--json"]):
        assert run([*arguments, *more]) == 2
        captured = capsys.readouterr()
        assert captured.out == ""
        assert captured.err.count("\n") == 1, captured.err
        assert captured.err.startswith("inercal: error: ")
        for word in words:
            assert word in captured.err


def test_sensitivity_prints_the_contract(folder, capsys):
    data = as_json(["sensitivity", "t.toml"], capsys)
    assert data["command"] == "sensitivity"
    assert data["status"]["code"] == "ok"
    assert set(data["timing_s"]) == {"read", "solve", "total"}
    assert data["timing_s"]["solve"] < data["timing_s"]["total"]
    assert [source["path"] for source in data["inputs"]] == ["t.toml"]
    found = data["result"]
    assert set(found) >= {
        "factors", "outputs", "positions", "mean", "weighted", "aggregate", "flagged",
    }  # fmt: skip
    assert len(found["positions"]["phi1"]) == 36
    assert np.sum(found["weighted"]["total"], axis=1) == pytest.approx(1.0, abs=1e-4)


def test_sensitivity_for_people_and_its_maps(folder, capsys):
    assert run(["sensitivity", "t.toml", "--out", "m.nc"]) == 0
    captured = capsys.readouterr()
    assert "dphi_y1" in captured.out
    assert "positioning of the outer axis" in captured.out
    assert "maps: m.nc" in captured.err
    with xarray.open_dataset("m.nc", engine="scipy") as maps:
        assert maps["second"].shape == (5, 36, 11, 11)
    assert run(["sensitivity", "t.toml", "--out", "m.npz", "--quiet"]) == 0
    assert np.load("m.npz")["first"].shape == (5, 36, 11)


def test_sensitivity_rounds_samples_up_and_says_so(folder, capsys):
    command = ["sensitivity", "t.toml", "--set", "analysis.method=sampled", "--set", "analysis.samples=5"]
    assert run([*command, "--set", "positions={list=[['10 deg', '20 deg']]}"]) == 0
    assert "5 samples rounded up to 8, a power of two, for Sobol points" in capsys.readouterr().err


def test_flagged_positions_leave_the_status_ok(folder, capsys):
    data = as_json(["sensitivity", "t.toml", "--set", 'positions.grid.offset="none"'], capsys)
    assert data["status"]["code"] == "ok"
    assert {"output": "az", "phi1": 0.0, "phi2": 0.0}.items() <= next(
        flag for flag in data["result"]["flagged"] if flag["output"] == "az"
    ).items()


@for_each(
    ("arguments", "words"),
    [
        (["sensitivity", "no.toml"], ["no.toml", "cannot be read"]),
        (["sensitivity", "t.toml", "--set", "site.latitude=120 deg"], ["t.toml: site.latitude", "'120 deg'"]),
        (
            ["sensitivity", "t.toml", "--set", "rig.erors={}"],
            ["rig.erors: unknown key, did you mean errors?"],
        ),
        (["sensitivity", "t.toml", "--set", "rig.errors={}"], ["rig.errors: found no errors of the table"]),
        (
            ["sensitivity", "t.toml", "--set", "rig.errors.default.uniform=0 deg"],
            ["rig.errors.default.uniform: found '0 deg'", 'left out with NAME = "none"'],
        ),
        (["sensitivity", "twice.toml"], ["twice.toml: line 8: default is given a second time"]),
        (["sensitivity", "t.toml", "--out", "m.csv"], ["m.csv", "expected .json or .toml or .nc or .npz"]),
        (["sensitivity", "imu.toml"], ["a study for `inercal calibrate imu`"]),
        (["design", "positions", "t.toml", "--out", "p.nc"], ["p.nc", "expected .json or .toml or .csv"]),
        (["design", "positions", "t.toml", "--set", "design.compare=['x']"], ["design.compare.0: found 'x'"]),
        (
            ["design", "positions", "t.toml", "--set", "design.positions=5"],
            ["error: t.toml: design of 5 positions: found 5 positions, expected 12 or more"],
        ),
        (["design", "positions", "quiet.toml"], ["error: quiet.toml: instrument.noise: missing"]),
        (
            ["calibrate", "turntable", "volts.csv", "--study", "t.toml"],
            ["error: t.toml: instrument.unit: noise or coefficients are stated for outputs in deg/h"],
        ),
        (
            ["calibrate", "turntable", "counts.csv", "--study", "plain.toml"],
            ["error: plain.toml: instrument.coefficients: none of k_x, k_y, k_z is stated"],
        ),
        (
            [
                "calibrate",
                "turntable",
                "volts.csv",
                "--study",
                "t.toml",
                "--set",
                "instrument={kind='accelerometer'}",
            ],
            [
                "error: volts.csv: found position, phi1, phi2, y_x, expected one of acc_x, acc_y, acc_z of the accel"
            ],
        ),
        (
            ["calibrate", "turntable", "volts.csv", "--study"],
            ["found nothing after --study, expected a value"],
        ),
        (
            ["sensitivity", "t.toml", "--set", "rig.errors.default.uniform=2 arcmn"],
            [
                "rig.errors.default.uniform: found the unit 'arcmn', expected a unit of angle: rad, mrad, urad, deg,"
            ],
        ),
        (
            ["simulate", "turntable", "t.toml", "--set", "positions.file=no.csv", "--out", "x.csv"],
            ["'no.csv': no such"],
        ),
        (["design"], ["design: found no kind, expected positions"]),
        (["simulate"], ["simulate: found no kind, expected turntable"]),
    ],
)
def test_bad_studies_and_usage_get_one_line(arguments, words, folder, capsys):
    again = 'default = { normal = "1 deg" }\n[positions]'
    Path("twice.toml").write_text(STUDY.lstrip().replace("[positions]", again))
    Path("imu.toml").write_text('[site]\nlatitude = "1 deg"\n[imu]\n')
    Path("quiet.toml").write_text(STUDY.replace('noise = "0.01 deg/h"', ""))
    Path("plain.toml").write_text(STUDY.partition("[instrument]")[0])
    angles = np.degrees(named("24-position").angles).tolist()
    for name, unit in (("volts.csv", "V"), ("counts.csv", "count")):
        rows = "".join(f"{k},{a},{b},{k % 5}\n" for k, (a, b) in enumerate(angles))
        Path(name).write_text(f"position,phi1 [deg],phi2 [deg],y_x [{unit}]\n{rows}")
    before = sorted(folder.iterdir())
    refused(arguments, capsys, *words)
    assert sorted(folder.iterdir()) == before


def test_a_simulated_recording_is_calibrated_to_its_truth(folder, capsys):
    """The true coefficients lie within five standard uncertainties; per g^2 at 9.8 m/s^2 is (9.8/9.80665)^2."""
    assert run(["simulate", "turntable", "t.toml", "--seed", "2", "--out", "r.csv", "--quiet"]) == 0
    capsys.readouterr()
    data = as_json(["calibrate", "turntable", "r.csv", "--study", "t.toml", "--out", "cal.json"], capsys)
    assert (data["command"], data["status"]["code"]) == ("calibrate turntable", "ok")
    unit = math.radians(1.0) / 3600.0
    true = {"DX_F": 50 * unit, "DX_X": 60 * unit * 9.8 / 9.80665, "DX_XX": 2 * unit * (9.8 / 9.80665) ** 2}
    found = {p["name"]: p for p in data["parameters"]}
    for name, value in true.items():
        assert abs(found[name]["value"] - value) < 5 * found[name]["u"]
    assert {"rank", "null_vectors", "plan", "tolerance_shares"} <= data["result"].keys()
    assert set(data["timing_s"]) == {"read", "solve", "total"}
    assert {source["path"] for source in data["inputs"]} == {"r.csv", "t.toml"}
    assert json.loads(Path("cal.json").read_text())["parameters"] == data["parameters"]


def test_an_unidentified_term_ends_unobservable_with_its_null_vector(folder, capsys):
    """Quarter turns of both axes do not tell the products of gravity apart from nothing."""
    plan = ["--set", "positions={plan='16-cube'}"]
    assert run(["simulate", "turntable", "t.toml", "--out", "r.csv", "--quiet", *plan]) == 0
    capsys.readouterr()
    data = as_json(["calibrate", "turntable", "r.csv", "--study", "t.toml"], capsys, code=1)
    assert data["status"]["code"] == "unobservable"
    assert "DX_XY" in data["status"]["message"]
    assert run(["calibrate", "turntable", "r.csv", "--study", "t.toml"]) == 1
    shown = capsys.readouterr().out
    assert "add positions, or leave terms out" in shown


def test_design_writes_positions_that_a_table_can_be_told(folder, capsys):
    data = as_json(["design", "positions", "t.toml", "--out", "p.csv"], capsys)
    found = data["result"]
    assert set(found) >= {"positions", "rank", "condition", "d_efficiency", "predicted", "compare"}
    assert len(found["positions"]) == 14
    lines = Path("p.csv").read_text().splitlines()
    assert lines[0] == "phi1 [deg],phi2 [deg]"
    rows = np.array([[float(x) for x in line.split(",")] for line in lines[1:]])
    np.testing.assert_allclose(np.radians(rows), found["positions"], atol=1e-9)
    assert set(rows.ravel()) <= set(np.arange(0.0, 360.0, 45.0))
    assert set(data["timing_s"]) == {"read", "solve", "total"}
    assert run(["design", "positions", "t.toml", "--out", "p.json", "--quiet"]) == 0
    assert "24-position" in capsys.readouterr().out
    assert json.loads(Path("p.json").read_text())["result"]["positions"] == found["positions"]


def test_positions_that_were_designed_are_taken(folder, capsys):
    """design -> file -> simulate: the record stops at the angles of the file, in its order."""
    assert run(["design", "positions", "t.toml", "--out", "p.csv", "--quiet"]) == 0
    capsys.readouterr()
    Path("with.toml").write_text(STUDY.replace("grid = { phi1 = 6, phi2 = 6 }", 'file = "p.csv"'))
    for study, more in (("with.toml", []), ("t.toml", ["--set", "positions.file=p.csv"])):
        data = as_json(["simulate", "turntable", study, "--out", "r.csv", *more], capsys)
        assert [source["path"] for source in data["inputs"]] == [study, "p.csv"]
        asked = np.loadtxt("p.csv", delimiter=",", skiprows=1)
        taken = np.loadtxt("r.csv", delimiter=",", skiprows=1)[:, 2:4]
        np.testing.assert_allclose(taken, asked, atol=1e-9)
    data = as_json(["calibrate", "turntable", "r.csv", "--study", "with.toml"], capsys)
    assert data["result"]["plan"]["name"] == "p.csv"
    assert [source["path"] for source in data["inputs"]] == ["r.csv", "with.toml", "p.csv"]
    for command in (["design", "positions"], ["simulate", "turntable"]):
        refused([*command, "with.toml", "--out", "p.csv"], capsys, "p.csv: is an input")


def test_a_positions_file_is_looked_for_beside_the_study(folder, capsys):
    Path("sub").mkdir()
    Path("sub/p.csv").write_text("phi1 [deg],phi2 [deg]\n10,20\n")
    Path("sub/t.toml").write_text(STUDY.replace("grid = { phi1 = 6, phi2 = 6 }", 'file = "p.csv"'))
    data = as_json(["sensitivity", "sub/t.toml"], capsys)
    assert data["result"]["positions"]["phi1"] == pytest.approx([math.radians(10.0)])


def test_a_record_of_dwells_needs_no_time(folder, capsys):
    """Coefficients are the same whether or not time, or position numbers, stand beside the angles."""
    assert run(["simulate", "turntable", "t.toml", "--out", "r.csv", "--quiet"]) == 0
    rows = [line.split(",") for line in Path("r.csv").read_text().splitlines()]
    capsys.readouterr()
    values = []
    for first in (0, 1, 2):  # t, position, phi1, phi2, y_x, y_y
        Path("part.csv").write_text("\n".join(",".join(row[first:]) for row in rows) + "\n")
        data = as_json(["calibrate", "turntable", "part.csv", "--study", "t.toml"], capsys)
        assert data["status"]["code"] == "ok"
        values.append([p["value"] for p in data["parameters"]])
    assert values[0] == values[1] == values[2]


def test_new_writes_a_study_that_runs_without_a_map_where_the_header_says_all(folder, capsys):
    assert run(["simulate", "turntable", "t.toml", "--out", "r.csv", "--quiet"]) == 0
    capsys.readouterr()
    data = as_json(["new", "turntable", "r.csv", *FILL], capsys)
    assert data["result"] == {"study": "turntable.toml", "map": None}
    assert not Path("turntable-map.toml").exists()
    text = Path("turntable.toml").read_text("utf-8")
    assert "# Next: inercal calibrate turntable r.csv --study turntable.toml\n" in text
    assert 'kind = "gyrowheel"' in text
    assert '\nunit = "deg/h"' in text
    command = ["calibrate", "turntable", "r.csv", "--study", "turntable.toml"]
    assert as_json([*command, "--set", "site.latitude=39.1 deg"], capsys)["status"]["code"] == "ok"
    refused(["new", "turntable"], capsys, "turntable.toml: exists already")


def test_new_chooses_the_instrument_of_the_record_and_guesses_a_map_where_it_must(folder, capsys):
    """A plain header: angles stay angles, accelerometers are told by gravity, and no rate is asked for."""
    simulated = ["--set", "instrument={kind='accelerometer',unit='m/s^2',noise='20 ug',coefficients={}}"]
    simulated += ["--set", "positions.grid.phi1=12"]
    assert run(["simulate", "turntable", "t.toml", "--out", "r.csv", "--quiet", *simulated]) == 0
    rows = [line.split(",", 2)[2] for line in Path("r.csv").read_text().splitlines()[1:]]
    Path("plain.csv").write_text("\n".join(["phi1_deg,phi2_deg,ax,ay,az", *rows]) + "\n")
    capsys.readouterr()
    data = as_json(["new", "turntable", "plain.csv", *FILL], capsys)
    assert data["result"] == {"study": "turntable.toml", "map": "turntable-map.toml"}
    assert '\nkind = "accelerometer"' in Path("turntable.toml").read_text("utf-8")
    command = [
        "calibrate",
        "turntable",
        "plain.csv",
        "--map",
        "turntable-map.toml",
        "--study",
        "turntable.toml",
    ]
    found = as_json(command, capsys)
    assert found["status"]["code"] == "ok"
    scale = next(p for p in found["parameters"] if p["name"] == "K1_y")
    assert abs(scale["value"] - 1.0) < 5 * scale["u"]
    Path("bare.csv").write_text("\n".join(rows) + "\n")
    assert run(["new", "turntable", "bare.csv", "--out", "x.toml", *FILL]) == 0
    assert "no accelerometer or gyro was recognised" in capsys.readouterr().out
    assert "# [columns.phi1]" in Path("x-map.toml").read_text()


RATES = """
[site]
latitude = "39.1 deg"
[rig]
kind = "two_axis_turntable"
[instrument]
kind = "gyro"
unit = "deg/h"
noise = "0.1 deg/h"
[instrument.coefficients]
D_F_z = "5 deg/h"
S_z = "1.001"
[rate_test]
rates = ["-30 deg/s", "-10 deg/s", "-3 deg/s", "3 deg/s", "10 deg/s", "30 deg/s"]
"""


def test_a_rate_test_is_simulated_and_calibrated(folder, capsys):
    """The gyro along the turning axis (z of the inner one) shows its true scale factor within 5 u."""
    Path("rates.toml").write_text(RATES)
    assert run(["simulate", "turntable", "rates.toml", "--seed", "3", "--out", "r.csv", "--quiet"]) == 0
    capsys.readouterr()
    data = as_json(["calibrate", "turntable", "r.csv", "--study", "rates.toml", "--report", "r.html"], capsys)
    found = next(p for p in data["parameters"] if p["name"] == "S_z")
    assert abs(found["value"] - 1.001) < 5 * found["u"] < 1e-3
    assert Path("r.html").exists()
