"""Runs of an entry: the table, the tare between wind-offs, polars up and down, oscillations, the command."""

import json
import math
from dataclasses import replace

import numpy as np
import pytest
from sting_study import BASE, DEG, G, study

import inercal as ic
from inercal.cli import run
from inercal.foundation.errors import InputError
from inercal.foundation.records.write import write_record
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.runs.outcome import error_terms
from inercal.systems.aoa.runs.run_table import read_runs_table
from inercal.systems.aoa.runs.series import WindOff, interpolated
from inercal.systems.aoa.simulate import drawn_biases, simulate, to_record
from rows import for_each

FS = 200.0
REST = MotionPlan("static", duration=20.0, sample_rate=FS)
POLAR = MotionPlan(
    "pitch-pause", sample_rate=FS, first=0.0, last=15.0 * DEG, step=5.0 * DEG, pause=3.0, move=1.0
)
DOWN = replace(POLAR, first=15.0 * DEG, last=0.0, step=-5.0 * DEG)
SINE = replace(BASE, duration=20.0, sample_rate=FS, mean=10.0 * DEG, amplitude=5.0 * DEG)
STUDY = """
[site]
gravity = "9.80665 m/s^2"
[rig]
kind = "sting"
[sensors.a1]
axis = "-z"
r = "-0.25 m"
[sensors.a2]
axis = "+x"
r = "0.20 m"
[sensors.a3]
axis = "+z"
r = "0.25 m"
[sensors.gyro]
[noise]
accelerometer = "1e-4 g"
accelerometer_bias = "2 mg"
gyro = "0.2 deg/s"
gyro_bias = "5 deg/h"
"""
TABLE = """file,role,angle,begin,amplitude,frequency
off1.csv,wind-off,0.000(2) deg,0 min,,
up1.csv,up,,5 min,,
down1.csv,down,,10 min,,
up2.csv,up,,15 min,,
# the oscillation, as driven
sine.csv,run,,20 min,5 deg,1 Hz
off2.csv,wind-off,0.000(2) deg,25 min,,
"""


@pytest.fixture(scope="module")
def entry(tmp_path_factory):
    """Six runs of sensors whose biases of some mg drift by 1 mg from the first wind-off to the last."""
    folder = tmp_path_factory.mktemp("entry")
    of = study()
    biases = drawn_biases(replace(of.noise, accelerometer_bias=2e-3 * G), 3, np.random.default_rng(1))
    motions = {"off1": REST, "up1": POLAR, "down1": DOWN, "up2": POLAR, "sine": SINE, "off2": REST}
    for k, (name, motion) in enumerate(motions.items()):
        errors = dict(biases)
        errors["b_2"] += 1e-3 * G * k / 5.0
        moved = simulate(replace(of, motion=motion), np.random.default_rng(10 + k), errors)
        write_record(to_record(moved.recording, of), folder / f"{name}.csv")
    (folder / "runs.csv").write_text(TABLE)
    (folder / "aoa.toml").write_text(STUDY)
    return folder


@pytest.fixture(scope="module")
def measured(entry):
    return ic.runs(entry / "runs.csv", entry / "aoa.toml")


@pytest.mark.slow
def test_the_tare_is_interpolated(measured):
    """A bias of 2 mg is 0.11 deg; with the tare the angle is right to the wind-off's u and noise, drift and all."""
    result = measured.estimate.result
    assert [each["tare"] for each in result["runs"]] == [
        "", *["off1.csv and off2.csv"] * 4, "",
    ]  # fmt: skip
    for each in measured.evidence.measured[1:5]:
        off = each.measurement.errors[each.measurement.angles.method].all
        assert off.rms < 0.012 * DEG
        assert off.ratio < 1.5


def test_without_wind_offs_the_biases_are_in_the_angle(entry):
    (entry / "alone.csv").write_text("file,role\nup1.csv,up\n")
    (alone,) = ic.runs(entry / "alone.csv", entry / "aoa.toml").evidence.measured
    assert alone.tare == ""
    assert alone.measurement.errors[alone.measurement.angles.method].all.rms > 0.02 * DEG


@pytest.mark.slow
def test_points_of_polars_up_and_down(measured):
    points = measured.evidence.at_points
    assert np.degrees([each.theta for each in points]) == pytest.approx([0.0, 5.0, 10.0, 15.0], abs=0.02)
    for each in points:
        assert each.runs == 3
        assert math.isfinite(each.spread)
        assert abs(each.up - each.down) < 5.0 * each.u_apart + 0.02 * DEG
        assert each.u > each.u_apart


@pytest.mark.slow
def test_a_drift_between_wind_offs_is_told(measured):
    (drift,) = (each for each in measured.findings if each.code == "bias_drift" and "off2" in each.message)
    assert "b_2" in drift.message
    assert "interpolated" in drift.message


@pytest.mark.slow
def test_oscillations_by_amplitude_and_frequency(measured):
    (sine,) = measured.evidence.oscillating
    assert (sine.amplitude, sine.frequency, sine.runs) == pytest.approx((5.0 * DEG, 1.0, 1))
    X = 2.0 * math.pi * 5.0 * DEG
    assert sine.terms["centrifugal, low pass"] == pytest.approx(0.5 * 0.20 * X**2 / G)
    assert sine.terms["tangential, none"] == pytest.approx(0.25 * 2.0 * math.pi * X / G)
    assert len(sine.errors) == 1


def test_an_oscillation_is_found_where_the_table_does_not_state_it(entry):
    (entry / "sine.txt").write_text("file,role\nsine.csv,run\n")
    (sine,) = ic.runs(entry / "sine.txt", entry / "aoa.toml").evidence.oscillating
    assert (sine.amplitude, sine.frequency) == pytest.approx((5.0 * DEG, 1.0), rel=5e-3)


def test_error_terms_of_the_papers_figures():
    """10 deg at 0.5 Hz, r2 = 0.2 m: mechanical compensation leaves 2.6 % of the low pass, dual 0.16 % of untreated."""
    of = study()
    of = replace(of, noise=replace(of.noise, accelerometer_bias=1e-12, gyro_bias=1e-12))
    terms = error_terms(of, 10.0 * DEG, 0.5)
    assert terms["centrifugal, mechanical"] / terms["centrifugal, low pass"] == pytest.approx(0.026, abs=5e-4)
    assert terms["tangential, dual"] / terms["tangential, none"] == pytest.approx(0.0016, abs=5e-5)


def test_the_interpolated_covariance_holds_a_random_walk():
    """Biases that walk, wind-offs that see them with errors in common and of their own: error^2/u^2 is at most 1 on
    average, and above 0.5, over 4000 draws at four times; a mean of squares of that many scatters by 0.02 or so."""
    rng = np.random.default_rng(6)
    n, walk, own, common = 4000, 1.0, 0.3, 0.5
    for f in (0.0, 0.25, 0.5, 0.75):
        squares = []
        for _ in range(n // 4):
            steps = rng.standard_normal(4) * walk / 2.0
            course = np.concatenate([[0.0], np.cumsum(steps)])
            shared = common * rng.standard_normal()
            seen = course[[0, 4]] + shared + own * rng.standard_normal(2)
            P = np.array([[own**2 + common**2]])
            tares = [WindOff(t, "", ("b_1",), seen[k : k + 1], P) for k, t in enumerate((0.0, 1.0))]
            (values, covariances), _ = interpolated(tares, f)
            squares.append((values["b_1"] - course[round(4 * f)], covariances["b_1", "b_1"]))
        error, variance = np.array(squares).T
        ratio = np.mean(error**2) / np.mean(variance)
        assert 0.5 < ratio < 1.0 + 4.0 * math.sqrt(2.0 / len(error))


def test_after_the_last_wind_off_the_walk_goes_on():
    one = np.ones((1, 1))
    tares = [WindOff(float(t), f"{t}", ("b_1",), np.array([float(t)]), one) for t in (0, 2)]
    (values, covariances), words = interpolated(tares, 4.0)
    assert (values["b_1"], covariances["b_1", "b_1"], words) == (2.0, 1.0 + 4.0, "2")
    (values, covariances), words = interpolated(tares[:1], 9.0)
    assert (values["b_1"], covariances["b_1", "b_1"], words) == (0.0, 1.0, "0")


@pytest.mark.slow
def test_the_command(entry, capsys):
    table, points, page = entry / "runs.csv", entry / "points.csv", entry / "runs.html"
    words = ["aoa", "--runs", str(table), "--study", str(entry / "aoa.toml"), "--json"]
    code = run([*words, "--out", str(points), "--report", str(page)])
    told = json.loads(capsys.readouterr().out)
    assert code == (0 if told["status"]["code"] == "ok" else 1)
    assert [each["role"] for each in told["result"]["runs"]] == [
        "wind-off",
        "up",
        "down",
        "up",
        "run",
        "wind-off",
    ]
    assert len(told["result"]["by_point"]) == 4
    titles, *rows = points.read_text().splitlines()
    columns = np.array([line.split(",") for line in rows]).T
    for title, expected in (("run [1]", {"2.0", "3.0", "4.0"}), ("sense [1]", {"-1.0", "1.0"})):
        assert set(columns[titles.split(",").index(title)]) == expected
    text = page.read_text(encoding="utf-8")
    assert all(title in text for title in ("By point", "down - up", "By amplitude and frequency"))


@pytest.mark.slow
def test_the_papers_way_takes_the_tare_off_its_readings(entry, capsys):
    words = ["aoa", "--runs", str(entry / "runs.csv"), "--study", str(entry / "aoa.toml"), "--json"]
    assert run([*words, "--static", "improved"]) in (0, 1)
    told = json.loads(capsys.readouterr().out)
    moving = [each["reference"]["mean_deg"] for each in told["result"]["runs"] if each["role"] != "wind-off"]
    assert np.abs(moving).max() < 0.015


REFUSED = {
    "role\nup": "found no column file",
    "file,role,begin [s],begin [min]\nup1.csv,up,60,": "found the column 'begin' twice, expected it once",
    "file [x],role\nup1.csv,up": "found 'x' as unit of the column file, expected none",
    "file,role,amplitude [deg\nup1.csv,up,10": "found the head 'amplitude .deg', expected a unit in brackets",
    "file,role,amplitude deg]\nup1.csv,up,10": "found the head 'amplitude deg.', expected a unit in brackets",
    "file,role,begin [m]\nup1.csv,up,1": "begin: found '1 m', which is of length",
    "file,role,color\nup1.csv,up,red": "found the column 'color', expected file, role, angle",
    "file,role\nnone.csv,up": "row 1: file: found none.csv, which is not there",
    "file,role\nup1.csv,sideways": "role: found 'sideways', expected wind-off, up, down, run",
    "file,role\noff1.csv,wind-off\nup1.csv,up": "row 1: angle: missing, expected that of the wind-off",
    "file,role,angle\noff1.csv,wind-off,0 deg\nup1.csv,up,": "row 1: angle: found '0 deg', expected",
    "file,role,angle\nup1.csv,up,0.0(1) deg": "angle: found with the role up",
    "file,role,angle\noff1.csv,wind-off,0.0(1) deg": "found no run with the wind on",
    "file,role,begin\nup1.csv,up,1 min\ndown1.csv,down,": "begin: found 1 of 2 rows, expected all of them or none",
    "file,role,begin\nup1.csv,up,1 min\ndown1.csv,down,1 min": "begin: found rows that do not go on in time",
    "file,role,begin\nup1.csv,up,1 m": "begin: found '1 m', which is of length",
    "file,role,angle\nup1.csv,wind-off,0.000(2) deg\ndown1.csv,down,": "up1.csv: .*the angle changes by",
}  # fmt: skip


@for_each(("text", "words"), REFUSED.items())
def test_one_sentence_for_what_is_wrong(entry, text, words):
    (entry / "bad.csv").write_text(text + "\n")
    with pytest.raises(InputError, match=words) as error:
        ic.runs(entry / "bad.csv", entry / "aoa.toml")
    assert "\n" not in str(error.value)


def test_a_unit_in_the_head_of_a_column_is_that_of_its_cells(tmp_path):
    """The same table with units in the cells, and in the heads."""
    for name in ("off.csv", "sine.csv"):
        (tmp_path / name).touch()
    tables = (
        "file,role,angle,begin,amplitude,frequency\n"
        "off.csv,wind-off,0.000(2) deg,0 min,,\nsine.csv,run,,5 min,10 deg,1 Hz",
        "file,role,angle [deg],begin [min],amplitude [deg],frequency [Hz]\n"
        "off.csv,wind-off,0.000(2),0,,\nsine.csv,run,,5,10,1",
    )
    found = []
    for text in tables:
        (tmp_path / "runs.csv").write_text(text)
        off, sine = read_runs_table(tmp_path / "runs.csv").runs
        found.append((off.angle.value, off.angle.u, sine.begin, sine.amplitude, sine.frequency))
    assert found[0] == found[1]
    assert found[0] == pytest.approx((0.0, np.radians(0.002), 300.0, np.radians(10.0), 1.0))


def test_a_table_beside_files_is_refused(entry, capsys):
    words = [
        "aoa",
        str(entry / "up1.csv"),
        "--runs",
        str(entry / "runs.csv"),
        "--study",
        str(entry / "aoa.toml"),
    ]
    assert run(words) == 2
    assert "--runs: found with FILES" in capsys.readouterr().err


def test_points_that_are_clipped_raise_an_alarm(entry):
    record = ic.read(entry / "up1.csv")
    limited = replace(record["a2"], values=np.minimum(record["a2"].values, 0.17))
    write_record(replace(record, columns={**record.columns, "a2": limited}), entry / "clipped.csv")
    (entry / "clipped.txt").write_text("file,role\nclipped.csv,up\n")
    found = ic.runs(entry / "clipped.txt", entry / "aoa.toml").findings
    (alarm,) = (each for each in found if "rows of a point" in each.message)
    assert alarm.code == "saturation"
