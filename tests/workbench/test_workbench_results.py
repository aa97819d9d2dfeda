"""Residuals with their times, advice as a change of the study, rests to be shaded: from results and recordings."""

import numpy as np
import pytest

from inercal.bench.workbench.charts import Notes, course_figure, courses, marks_of, parts_of, spans_of
from inercal.bench.workbench.charts import residual_figure as of_residuals
from inercal.bench.workbench.pages.form import advice_of
from inercal.examples import FOLDER
from inercal.foundation.findings import Finding
from inercal.foundation.inputs import Source
from inercal.foundation.records.column import Column
from inercal.foundation.records.dwells import quiet
from inercal.foundation.records.record import Record
from inercal.foundation.units import parse_unit

RESULTS = {
    "poses": (
        {
            "intervals": [{"pose": 1, "start_s": 0.0, "end_s": 4.0, "residual_m_s2": 9.80665e-6}],
            "turns": [{"from_pose": 1, "start_s": 4.0, "duration_s": 2.0, "miss_rad": np.pi / 648000.0}],
        },
        [("pose 1", 0.0, 4.0, 1.0), ("turn from pose 1", 4.0, 6.0, 1.0)],
        [(0.0, 4.0)],
    ),
    "rests on a table": (
        {
            "rests": [{"start_s": 1.0, "end_s": 2.0, "residual_acc": [9.80665e-6, 0.0, 0.0]}],
            "unit": {"acc": "m/s^2"},
        },
        [("rest 1", 1.0, 2.0, 1.0), ("rest 1", 1.0, 2.0, 0.0), ("rest 1", 1.0, 2.0, 0.0)],
        [(1.0, 2.0)],
    ),
    "turns of a unit": (
        {"rests": [[0.0, 5.0], [9.0, 20.0]], "turns": [{"residual_z": -0.5}]},
        [("turn 1", 5.0, 9.0, -0.5)],
        [(0.0, 5.0), (9.0, 20.0)],
    ),
    "points": (
        {"points": [{"number": 3.0, "begin": 1.0, "end": 5.0, "scatter": np.pi / 180.0}]},
        [("point 3", 1.0, 5.0, 1.0)],
        [(1.0, 5.0)],
    ),
    "none": ({"filter": "error-state", "points": None}, [], []),
}


@pytest.mark.parametrize("name", RESULTS)
def test_residuals_have_their_times_and_units(name):
    result, rows, spans = RESULTS[name]
    found = [row for part in parts_of(result) for row in part.rows]
    assert [(label, begin, end) for label, begin, end, _ in found] == [row[:3] for row in rows]
    np.testing.assert_allclose([row[3] for row in found], [row[3] for row in rows], rtol=1e-9)
    assert list(spans_of(result)) == spans
    drawn = of_residuals(parts_of(result), "turn 1")
    assert sum(len(each["x"]) for each in drawn["data"]) == len(rows)


STUDY = '[imu]\nmethod = "multiposition"\n\n[model]\nstates = ["paper", "gamma"]\n'


@pytest.mark.parametrize(
    ("words", "changes"),
    [
        ("the drift: set imu.bias_drift = true to estimate it", ["imu.bias_drift = true"]),
        ('such as imu.k2 = "0(20) ug/g^2", or set imu.k2 = true', ["imu.k2 = true"]),
        ('write snap = "1e9 rad^2/s^7" or "auto" under [estimator]', ['estimator.snap = "1e9 rad^2/s^7"']),
        ("claims, write states = 19 under [estimator]", ["estimator.states = 19"]),
        ('take states = "extended" under [model]', ['model.states = "extended"']),
        ("name delay in states under [model], or", ['model.states = ["paper", "gamma", "delay"]']),
        ("name gamma in states under [model]", []),
        ("kg1, delay are no states; name them in states under [model]", []),
        ('set imu.method = "multiposition"', []),
        ("state heading under [rig]; check the azimuth", []),
    ],
)
def test_advice_is_a_change_that_the_study_does_not_have(words, changes):
    assert [each.words for each in advice_of(Finding("outlier", words), STUDY, "imu")] == changes


def test_advice_that_would_spoil_a_good_study_is_none():
    study = (FOLDER / "selfcal.toml").read_text()
    for words, changes in (
        ("name gamma in states under [model]", ['model.states = ["paper", "gamma"]']),
        ("name warmth in states under [model]", []),
    ):
        assert [each.words for each in advice_of(Finding("outlier", words), study, "selfcal")] == changes


def record(t, **channels):
    unit = parse_unit("m/s^2")
    columns = {
        name: Column(name, unit, values, t, Source("log.csv", "0" * 64)) for name, values in channels.items()
    }
    return Record(columns)


def test_rests_are_those_in_which_nothing_moves():
    rng = np.random.default_rng(0)
    t = np.arange(12_000) / 100.0
    moving = (t % 20.0) > 14.0
    values = rng.normal(size=len(t)) * 0.01 + np.where(moving, np.sin(7.0 * t), 0.0)
    found = quiet(record(t, acc_x=values, acc_y=rng.normal(size=len(t))))
    assert len(found) == 6
    for k, (begin, end) in enumerate(found):
        assert abs(begin - 20.0 * k) < 1.2
        assert abs(end - 20.0 * k - 14.0) < 1.2
    assert quiet(record(t, acc_x=rng.normal(size=len(t)))) == ()
    assert quiet(record(t[:50], acc_x=values[:50])) == ()
    turned = (
        np.where(t < 60.0, t, 60.0) // 0.01 * 0.01
    )  # about the vertical until 60 s: accelerometers see nothing
    found = quiet(record(t, acc_x=values, th_z=turned + 0.01 * rng.integers(0, 2, size=len(t))))
    assert [round(begin / 20.0) for begin, _ in found] == [3, 4, 5]
    positions = np.repeat([1.0, 2.0, 3.0], 4000)
    found = quiet(record(t, position=positions, acc_x=values))
    np.testing.assert_allclose(found, [[0.0, 39.99], [40.0, 79.99], [80.0, 119.99]])


def test_findings_are_marked_where_they_lie_and_rests_are_shaded():
    t = np.arange(1000) / 10.0
    findings = (
        Finding("gap", "x", "t = 12.5 s, 30 s"),
        Finding("outlier", "x", "rows 11-13, 51"),
        Finding("nan", "x"),
    )
    of = record(t, acc_x=np.sin(t))
    of = Record(of.columns, findings)
    marks = marks_of(of)
    assert marks == {12.5: "gap", 30.0: "gap", 1.0: "outlier", 5.0: "outlier"}
    drawn = course_figure(courses(of), None, Notes(marks, [(0.0, 10.0), (20.0, 40.0)]))["layout"]
    shapes = [(each["x0"], each["x1"]) for each in drawn["shapes"] if each["type"] == "rect"]
    assert shapes == [(0.0, 10.0), (20.0, 40.0), (10.0, 20.0)]
    assert [each["text"] for each in drawn["annotations"]] == [*marks.values()]
