"""The history of an instrument: trend, next date and E_n in one command."""

import csv
import json
from dataclasses import replace
from datetime import date, timedelta

import numpy as np
import pytest
from made import result

import inercal as ic
from inercal.cli import run
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Status
from inercal.foundation.results.files import save
from inercal.laboratory.catalog import values_of
from inercal.laboratory.history import history
from inercal.laboratory.keep import Item, keep
from inercal.laboratory.specification import specification_of
from inercal.laboratory.store import make_store

NAMES = ("K1_x", "K1_y", "K0_x")
BEGIN = date(2021, 1, 15)


def aged(folder, count=20, ageing=5e-6, u=3e-6, step=0.0, seed=5):
    """A store with calibrations of one instrument, four a year, whose K1_x ages and K0_x steps at the last."""
    store = make_store(str(folder))
    rng = np.random.default_rng(seed)
    for k in range(count):
        day = BEGIN + timedelta(days=91 * k)
        values = np.array([1.0 + ageing * (day - BEGIN).days / 365.25, 1.0, 0.0]) + u * rng.normal(size=3)
        values[2] += step * (k == count - 1)
        keep(store, result(k, NAMES, day.isoformat(), values, u), Item("Maker", "G1", "17"))
    return store


@pytest.fixture
def store(tmp_path):
    made = aged(tmp_path / "store")
    yield made
    made.engine.dispose()


def test_ageing_is_found_with_its_date(store):
    """K1 ages by 5 ppm a year under u of 3 ppm: the drift is within its U, and clear of zero; so is the date.

    1 + 5e-6 t leaves 1 + 60 ppm after 12 years; with U some years earlier, and never later.
    """
    specification = specification_of({"K1": ["0.99994 1", "1.00006 1"]}, "spec.toml")
    found = history(values_of(store, "17"), "17", specification=specification)
    by_name = {course.name: course for course in found.courses}
    x, y = by_name["K1_x"], by_name["K1_y"]
    assert abs(x.wandering.drift.value - 5e-6) < x.wandering.drift.U < 5e-6
    assert abs(y.wandering.drift.value) < y.wandering.drift.U
    assert BEGIN + timedelta(days=365 * 7) < x.due < BEGIN + timedelta(days=366 * 12)
    assert y.due is None or y.due > x.due + timedelta(days=365 * 5)
    assert x.conformity.verdict == "conform"
    truth = 1.0 + 5e-6 * (found.at - BEGIN).days / 365.25
    assert abs(x.expected.value - truth) < x.expected.U
    np.testing.assert_allclose(
        x.E_n[1:], np.abs(np.diff(x.series.y)) / np.hypot(x.U[1:], x.U[:-1]), rtol=1e-12
    )
    assert found.status is Status.INCONSISTENT
    assert "K1_x drifted" in found.message


def test_an_instrument_that_stays_is_ok_in_all_but_the_stated_share(tmp_path):
    """40 instruments that do not change: a verdict on the last calibration is wrong in 5 %, at most 6 of 40 (0.3 %)."""
    wrong = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        rows = [
            {
                "id": str(k), "command": "calibrate imu", "status": "ok", "made": "", "position": i,
                "measured": (BEGIN + timedelta(days=200 * k)).isoformat(), "name": name, "value": rng.normal(),
                "u": 1.0, "expanded": 2.0, "k": 2.0, "dof": None, "unit": "1", "common": None,
            }
            for k in range(8)
            for i, name in enumerate(NAMES)
        ]  # fmt: skip
        wrong += history(rows, "17").status is not Status.OK
    assert wrong <= 6


def test_a_step_at_the_last_calibration_is_the_verdict(tmp_path):
    made = aged(tmp_path / "store", ageing=0.0, step=60e-6)
    found = history(values_of(made, "17"), "17")
    assert found.status is Status.INCONSISTENT
    assert "K0_x moved" in found.message


def test_what_does_not_count_is_said(store):
    """A calibration that is not ok is left out, one without a date counts by the day it was kept."""
    keep(store, replace(result(99, NAMES), status=Status.SUSPECT), Item("Maker", "G1", "17"))
    keep(store, result(98, NAMES, "", [1.0, 1.0, 0.0], 3e-6), Item("Maker", "G1", "17"))
    found = history(values_of(store, "17"), "17")
    assert {finding.code for finding in found.findings} == {"calibration_left_out", "undated"}
    assert len(found.courses[0].dates) == 21


def test_too_few_calibrations_say_so(tmp_path):
    made = aged(tmp_path / "store", count=2)
    found = history(values_of(made, "17"), "17")
    assert found.courses[0].wandering is None
    assert "2 calibrations, three are needed" in found.message
    with pytest.raises(InputError, match="no such coefficient"):
        history(values_of(made, "17"), "17", ["K9"])


def test_one_command_gives_trend_date_and_normalised_errors(store, tmp_path, monkeypatch, capsys):
    """`inercal history`: table, page, CSV and JSON of twenty calibrations."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "spec.toml").write_text(
        '[specification]\ndecision = "guard band"\nK1 = ["0.99994 1", "1.00006 1"]\n'
    )
    words = ["history", "17", "--store", store.where, "--coefficient", "K1", "--tolerance", "spec.toml"]
    assert run([*words, "--report", "h.html", "--out", "h.csv", "--json"]) == 1
    data = json.loads(capsys.readouterr().out)
    x = data["result"]["coefficients"][0]
    assert (x["name"], len(x["calibrations"])) == ("K1_x", 20)
    assert x["conformity"]["verdict"] == "conform"
    assert date.fromisoformat(x["due"]) > date(2027, 1, 1)
    with open("h.csv") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 40
    assert float(rows[1]["E_n"]) == x["calibrations"][1]["normalised_error"]
    page = (tmp_path / "h.html").read_text()
    assert page.count("<img") == 1
    assert "guard band" in page
    for wrong, said in (
        (["--until", "soon"], "expected a day"),
        (["--coefficient", "K9"], "no such coefficient"),
        (["--tolerance", "h.html"], "not valid TOML"),
    ):
        assert run(["history", "17", "--store", store.where, *wrong]) == 2
        assert said in capsys.readouterr().err


def test_results_as_files_need_no_store(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for k in range(4):
        save(result(k, NAMES, f"202{k}-01-01", [1.0, 1.0, 0.0], 1e-6), f"{k}.json")
    assert run(["history", *(f"{k}.json" for k in range(4))]) == 0
    assert "K1_x" in capsys.readouterr().out
    assert ic.history(*(f"{k}.json" for k in range(4))).status is Status.OK


def test_tolerances_of_the_last_study_count_where_no_others_are_given(tmp_path):
    """`[specification]` of the study is kept with the result; in the store as in files."""
    made = aged(tmp_path / "store", count=3)
    stated = result(50, NAMES, "2022-01-01", [1.0, 1.0, 0.0], 3e-6)
    settings = {"specification": {"K1": ["0.999 1", "1.001 1"]}}
    stated = replace(stated, provenance={**stated.provenance, "settings": settings})
    keep(made, stated, Item("Maker", "G1", "17"))
    save(stated, tmp_path / "last.json")
    for of, more in ((("17",), {"store": made.where}), ((tmp_path / "last.json",), {})):
        found = ic.history(*of, **more).evidence
        judged = {course.name: course.conformity for course in found.courses}
        assert judged["K1_x"].verdict == "conform"
        assert judged["K0_x"] is None


def test_five_units_of_one_make_have_histories_of_their_own(tmp_path):
    """Five units whose K1 age differently, in one store: each drift is its own, within 3 sigma of U / 2."""
    store = make_store(str(tmp_path / "store"))
    rng = np.random.default_rng(12)
    ageing = np.array([-10e-6, -5e-6, 0.0, 5e-6, 10e-6])
    for unit, rate in enumerate(ageing):
        for k in range(10):
            day = BEGIN + timedelta(days=182 * k)
            value = 1.0 + rate * (day - BEGIN).days / 365.25 + 3e-6 * rng.normal()
            keep(
                store,
                result(100 * unit + k, ("K1_x",), day.isoformat(), [value], 3e-6),
                Item("M", "G1", str(unit)),
            )
    for unit, rate in enumerate(ageing):
        (course,) = history(values_of(store, str(unit)), str(unit)).courses
        drift = course.wandering.drift
        assert abs(drift.value - rate) < 1.5 * drift.U
