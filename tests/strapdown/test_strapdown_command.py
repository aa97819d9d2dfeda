"""`inercal new`, `simulate` and `calibrate strapdown`: from nothing to a verdict, and what is refused."""

import json

import numpy as np
import pytest

import inercal as ic
from inercal.cli import run
from inercal.foundation.findings import Status

SITE = ["--set", "site.latitude=34 deg", "--set", "site.gravity=9.7965(1) m/s^2"]
SHORT = ["--set", "plan.dwell=6 s", "--set", "plan.first_dwell=15 s", "--set", "plan.sample_rate=50 Hz"]
TRUTH = {
    "D_F_x": "5 deg/h",
    "S_y": "1.0005",
    "K0_z": "2 mg",
    "r_xx": "2 cm",
    "tau_a": "1 ms",
    "T_xy": "100 arcsec",
}


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A folder to work in, with a study and a record of known truth."""
    monkeypatch.chdir(tmp_path)
    assert run(["new", "strapdown", "--quiet", *SITE, *SHORT]) == 0
    truth = [each for name, text in TRUTH.items() for each in ("--set", f"truth.{name}={text}")]
    assert (
        run(["simulate", "strapdown", "strapdown.toml", "--seed", "3", *truth, "--out", "run.npz", "--quiet"])
        == 0
    )
    return tmp_path


def calibrate(*more):
    return run(["calibrate", "strapdown", "run.npz", "--study", "strapdown.toml", "--quiet", *more])


def said_once(captured, *words):
    """Nothing on standard output, one line of the right form on standard error that holds the words."""
    assert captured.out == ""
    assert captured.err.count("\n") == 1, captured.err
    assert captured.err.startswith("inercal: error: ")
    for word in words:
        assert word in captured.err


def test_a_simulated_unit_is_found_again(folder, capsys):
    capsys.readouterr()
    assert calibrate("--out", "cal.json", "--report", "page.html") == 0
    assert capsys.readouterr().out.splitlines()[-1].startswith("ok: 31 coefficients from 6 rests")
    found = ic.load("cal.json")
    assert found.status is Status.OK
    study = ic.study("strapdown.toml", truth=TRUTH)
    for name in found.names:
        true = study.settings.truth.get(name, 1.0 if name.startswith(("S_", "K1_")) else 0.0)
        # one in 31 beyond 4.5 u: 2e-4
        assert abs(found.estimate[name].value - true) < 4.5 * found.estimate[name].u, name
    result = found.estimate.result
    assert result["unit"] == {"acc": "m/s^2", "gyro": "rad/s"}
    assert [round(np.degrees(each["angle"])) for each in result["turns"]] == [90, 180, 90, 180, 90]
    assert set(result["nuisances"]) == {"gravity"}
    page = (folder / "page.html").read_text("utf-8")
    assert page.lower().startswith("<!doctype html>")
    assert "Residual of each turn" in page


@pytest.mark.parametrize("walks", [False, True])
def test_the_budget_adds_up_to_u(walks, folder, capsys):
    more = ["--set", "noise.gyro_walk=0.4 deg/h/sqrt(s)", "--set", "noise.accelerometer_walk=2 ug/sqrt(s)"]
    calibrate("--out", "cal.json", "--set", "rests.attitude=0.01 deg", *(more if walks else ()))
    estimate = ic.load("cal.json").estimate
    sources = {each.source for each in estimate.budget}
    assert {"angle random walk", "velocity random walk", "velocity at rest", "gravity", "prior"} <= sources
    # u adds up the sources, the bound is of the fit as a whole; drifts by force are not fitted
    (drifts,) = (each for each in estimate.budget if each.source == "drifts by specific force")
    for name in estimate.names:
        fitted = estimate[name].u * np.sqrt(1.0 - drifts.share[name])
        assert fitted == pytest.approx(estimate.result["bounds"][name], rel=1e-3), name
    # the relative uncertainty of gravity goes into all K1, as far as the record tells more than the prior
    (gravity,) = (each for each in estimate.budget if each.source == "gravity")
    for axis in "xyz":
        u = estimate[f"K1_{axis}"].u
        seen = 1.0 - (u / 1e-3) ** 2
        assert np.sqrt(gravity.share[f"K1_{axis}"]) * u == pytest.approx(seen * 1e-4 / 9.7965, rel=0.05)


def test_json_is_an_object_whatever_the_verdict(folder, capsys):
    capsys.readouterr()
    assert calibrate("--end", "30 s", "--json") == 1
    data = json.loads(capsys.readouterr().out)
    assert data["status"]["code"] == "too_few_intervals"
    assert data["parameters"] == []
    assert calibrate("--end", "30 s", "--report", "page.html") == 1
    assert "Rests" in (folder / "page.html").read_text("utf-8")


def test_turns_about_one_axis_do_not_show_the_others(folder, capsys):
    turns = (
        'plan.turns=[["y", "90 deg"], ["y", "90 deg"], ["y", "-90 deg"], ["y", "90 deg"], ["y", "90 deg"]]'
    )
    assert (
        run(["simulate", "strapdown", "strapdown.toml", "--set", turns, "--out", "flat.npz", "--quiet"]) == 0
    )
    capsys.readouterr()
    assert run(["calibrate", "strapdown", "flat.npz", "--study", "strapdown.toml", "--json", "--quiet"]) == 1
    data = json.loads(capsys.readouterr().out)
    assert data["status"]["code"] == "unobservable"
    assert {"S_x", "S_z"} <= set(data["result"]["at_prior"])


def test_more_noise_than_stated_is_inconsistent(folder, capsys):
    capsys.readouterr()
    stated = ("noise.angle_random_walk=0.005 deg/sqrt(h)", "noise.velocity_random_walk=5 ug/sqrt(Hz)",
              "rests.velocity=0.02 mm/s", "noise.gyro_walk=0 deg/h/sqrt(s)",
              "noise.accelerometer_walk=0 ug/sqrt(s)")  # fmt: skip
    assert calibrate(*(each for key in stated for each in ("--set", key))) == 1
    assert "inconsistent: the recording contradicts model or noise" in capsys.readouterr().out


def test_the_other_hand_is_no_solution(folder, capsys):
    record = ic.read("run.npz")
    columns = {name: record[name].values for name in record.columns}
    columns["gyro_x"] = -columns["gyro_x"]
    wrong = ic.calibrate(
        ic.record(columns, rate=50.0, units={"gyro": "rad/s", "acc": "m/s^2"}), "strapdown.toml"
    )
    assert not wrong.status.done
    columns = {name: values / 9.8 if name.startswith("acc") else values for name, values in columns.items()}
    small = ic.calibrate(
        ic.record(columns, rate=50.0, units={"gyro": "rad/s", "acc": "m/s^2"}), "strapdown.toml"
    )
    assert small.status is Status.NOT_CONVERGED
    assert "at rest the accelerometers read 1 m/s^2, expected about 9.8" in small.estimate.message


def spoiled(change, **units):
    record = ic.read("run.npz")
    columns = {"t [s]": record["acc_x"].t} | {name: record[name].values for name in record.columns}
    return ic.record(change(columns), units={"gyro": "rad/s", "acc": "m/s^2"} | units)


def without(name):
    return lambda columns: {key: values for key, values in columns.items() if key != name}


def lost(columns):
    return {key: np.delete(values, slice(500, 520)) for key, values in columns.items()}


def blank(columns):
    values = columns["acc_y"].copy()
    values[700] = np.nan
    return columns | {"acc_y": values}


@pytest.mark.parametrize(
    ("change", "units", "words"),
    [
        (without("gyro_y"), {}, "gyro_y"),
        (without("acc_z"), {}, "acc_z"),
        (lost, {}, "t: a step of 0.42 s after row 500 where 0.02 s is usual"),
        (blank, {}, "acc: row 701 holds no number"),
        (lambda columns: columns, {"gyro": "count"}, "gyro is in count, expected physical units"),
    ],
)
def test_a_record_that_will_not_do_is_refused(change, units, words, folder):
    with pytest.raises(ic.InputError) as error:
        ic.calibrate(spoiled(change, **units), "strapdown.toml")
    assert words in str(error.value)


def test_rests_outside_the_record_are_refused(folder, capsys):
    capsys.readouterr()
    assert calibrate("--set", 'rests.list=[["0 s", "5000 s"]]') == 2
    said_once(capsys.readouterr(), "rests.list: found a rest from 0 s to 5000 s")


def test_a_plan_is_needed_to_simulate(folder, capsys):
    text = (folder / "strapdown.toml").read_text()
    (folder / "bare.toml").write_text(text[: text.index("[plan]")])
    capsys.readouterr()
    assert run(["simulate", "strapdown", "bare.toml", "--out", "none.csv"]) == 2
    said_once(capsys.readouterr(), "bare.toml", "plan: missing")
    assert not (folder / "none.csv").exists()
