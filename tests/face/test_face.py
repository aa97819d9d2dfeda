"""The verbs of Python: every line that the book promises, for each system, and the same numbers as the commands."""

import doctest
import html.parser
import importlib
import importlib.util
import json
import random
import subprocess
import sys

import numpy as np
import pytest

import inercal as ic
from inercal.cli import run
from inercal.examples import FOLDER
from inercal.foundation.findings import Status

pytestmark = pytest.mark.usefixtures("undrawn")

FERRARIS = (FOLDER / "ferraris.csv.gz", FOLDER / "ferraris-map.toml")
TABLE = {
    "latitude": "45 deg",
    "rig": {"kind": "two_axis_turntable", "errors": {"default": {"uniform": "2 arcmin"}}},
    "positions": {"plan": "24-position"},
    "instrument": {
        "kind": "accelerometer",
        "unit": "g",
        "noise": "10 ug",
        "coefficients": {"K0_x": "2 mg", "K1_x": "1.001"},
    },
    "design": {"positions": 12},
}
needs_pandas = pytest.mark.skipif(
    importlib.util.find_spec("pandas") is None, reason="pandas is not installed"
)
needs_xarray = pytest.mark.skipif(
    importlib.util.find_spec("xarray") is None, reason="xarray is not installed"
)


@pytest.fixture(scope="module")
def log():
    return ic.read(*FERRARIS)


@pytest.fixture(scope="module")
def found(log):
    """Of each system a result, by kind."""
    table = ic.study("turntable", **TABLE)
    return {
        "imu": ic.calibrate(log, ic.study(FOLDER / "ferraris.toml")),
        "turntable": ic.calibrate(ic.simulate(table, np.random.default_rng(1)), table),
        "selfcal": ic.calibrate(ic.read(FOLDER / "selfcal.csv.gz"), FOLDER / "selfcal.toml"),
        "aoa": ic.calibrate(ic.read(FOLDER / "sting.csv.gz"), FOLDER / "sting.toml"),
    }


KINDS = ("imu", "turntable", "selfcal", "aoa")


class Tags(html.parser.HTMLParser):
    """That every element is closed, and in order."""

    def __init__(self, text):
        super().__init__()
        self.open, self.seen = [], set()
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        self.seen.add(tag)
        if tag not in ("img", "br"):  # these have no end
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


@pytest.mark.parametrize("kind", KINDS)
def test_a_result_shows_itself(kind, found):
    result = found[kind]
    lines = repr(result).splitlines()
    assert len(lines) == 3
    assert lines[0].startswith(f"{result.status.value}: ")
    shown = result._repr_html_()
    tags = Tags(shown)
    assert tags.open == []
    assert {"img", "table"} <= tags.seen
    assert "<script" not in shown
    assert "http" not in shown.replace("http://www.w3.org", "")
    assert result.table().splitlines()
    figure = result.plot()
    assert figure.axes
    assert repr(result.estimate).count("\n") < 10


def test_all_that_a_verb_returns_is_told_in_ten_lines(found, log):
    table = ic.study("turntable", **TABLE)
    results = [
        *found.values(),
        ic.design(table),
        ic.sensitivity(table),
        ic.temperature(ic.read(FOLDER / "thermal.csv.gz", map=FOLDER / "thermal-map.toml")),
        ic.compare(found["imu"], found["imu"]),
        ic.allan(ic.record(gyro_z=np.random.default_rng(1).standard_normal(6000), rate=100.0)),
    ]
    studies = [table, *(ic.study(FOLDER / f"{name}.toml") for name in ("ferraris", "selfcal", "sting"))]
    told = [
        *(part for each in results for part in (each, each.evidence, each.estimate)),
        *(part for each in studies for part in (each, each.settings)),
        *(log, log["acc_x"], log.triad("acc"), found["imu"]["K1_x"]),
        *(results[4].evidence.plan, results[5].evidence.indices, studies[2].settings.plan),
    ]
    long = {type(each).__name__: repr(each) for each in told if repr(each).count("\n") >= 10}
    assert long == {}
    assert max(len(line) for each in told for line in repr(each).splitlines()) <= 250


@needs_xarray
@pytest.mark.parametrize("kind", KINDS)
def test_a_dataset_has_values_and_covariance_in_si(kind, found):
    of = found[kind].estimate
    data = found[kind].to_xarray()
    np.testing.assert_array_equal(data["value"], of.values)
    np.testing.assert_array_equal(data["covariance"], of.covariance)
    assert data["unit"].values.tolist() == list(of.units)
    if kind == "aoa":
        angles = found[kind].evidence.angles.theta
        np.testing.assert_allclose(data["theta"], np.degrees(angles))
        assert data["theta"].attrs["units"] == "deg"


@needs_xarray
def test_a_record_survives_the_way_through_a_dataset(log):
    again = ic.record(log.to_xarray())
    assert list(again.columns) == list(log.columns)
    for name, column in log.columns.items():
        np.testing.assert_array_equal(again[name].values, column.values)
        np.testing.assert_array_equal(again[name].t, column.t)
        assert again[name].unit == column.unit
        assert again[name].source == column.source


@needs_pandas
def test_a_frame_becomes_a_record():
    import pandas

    t = np.arange(5) / 10
    frame = pandas.DataFrame({"t [ms]": 1e3 * t, "acc_x [g]": 1.0, "gyro_z": 2.0, "note": "x"})
    record = ic.record(frame, units={"gyro": "deg/s"})
    np.testing.assert_allclose(record["acc_x"].t, t)
    assert record["acc_x"].unit.symbol == "g"
    assert record["gyro_z"].si() == pytest.approx(np.full(5, np.radians(2.0)))
    assert list(record.columns) == ["acc_x", "gyro_z"]


def test_arrays_become_a_record():
    acc = np.arange(12.0).reshape(4, 3)
    record = ic.record(t=[0.0, 0.1, 0.2, 0.3], acc=acc, gyro=acc, units={"gyro": "deg/s"})
    np.testing.assert_array_equal(record.triad("acc").values, acc)
    assert record["acc_x"].unit.symbol == "m/s^2"
    assert record["gyro_y"].unit.symbol == "deg/s"
    assert ic.record(gyro_x=[1.0, 2.0, 1.0], rate="100 Hz")["gyro_x"].t.tolist() == [0.0, 0.01, 0.02]
    assert ic.record(phi1=[0.0, 1.0], phi2=[0.0, 1.0], rate=1.0)["phi1"].unit.symbol == "rad"


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: ic.record(acc=np.zeros((4, 2)), rate=1.0), "found the shape (4, 2), expected (n, 3)"),
        (lambda: ic.record(acc_w=[1.0], rate=1.0), "acc_w: unknown channel, did you mean acc_"),
        (lambda: ic.record(acc_x=[1.0, 2.0]), "found no time, expected t="),
        (lambda: ic.record(acc_x=[1.0, 2.0], t=[0.0]), "found 2 values, expected 1 as there are times"),
        (lambda: ic.record(acc_x=[1.0], t=[0.0], rate=1.0), "found t and rate, expected one of them"),
        (lambda: ic.record(acc_x=[1.0], rate=1.0, units={"acc": "deg"}), "expected a unit of acceleration"),
        (lambda: ic.record(acc_x=[1.0], rate=1.0, units={"gyro": "deg/s"}), "units: found gyro"),
        (lambda: ic.record(t=[0.0]), "found no channel"),
        (lambda: ic.record([1.0, 2.0]), "found list, expected a DataFrame"),
        (
            lambda: ic.study("imu", site={"latitud": "45 deg"}),
            "site.latitud: unknown key, did you mean latitude?",
        ),
        (
            lambda: ic.study("imu", latitude="45 deg", metod="x"),
            "imu.metod: unknown key, did you mean method?",
        ),
        (lambda: ic.study("imu", latitude="45 m"), "site.latitude"),
        (
            lambda: ic.study("iimu"),
            "expected one, or a kind of study: imu, strapdown, turntable, selfcal, aoa",
        ),
        (lambda: ic.study("imu", latitude="1 deg", site={"latitude": "1 deg"}), "expected it once"),
        (lambda: ic.calibrate("log.csv", "imu.toml"), "records: found str, expected a record: ic.read(path)"),
        (lambda: ic.calibrate(ic.record(acc_x=[1.0], rate=1.0)), 'latitude="48 deg"'),
        (lambda: ic.design(ic.study("turntable", **TABLE), "selfcal"), "expected 'positions'"),
        (
            lambda: ic.sensitivity(FOLDER / "selfcal.toml"),
            "found a study of kind selfcal, expected one of turntable",
        ),
        (lambda: ic.simulate(FOLDER / "sting.toml", 1), "expected numpy.random.default_rng(seed)"),
        (lambda: ic.compare(1, 2), "found int, expected a result or the path of a saved one"),
        (lambda: ic.read(*FERRARIS, begin="3 m"), "begin"),
        (lambda: ic.read(*FERRARIS, begin="3 h"), "expected a span within the record, which lasts"),
    ],
)
def test_what_is_wrong_is_one_sentence(make, words):
    with pytest.raises(ic.InputError) as error:
        make()
    assert words in str(error.value)
    assert "\n" not in str(error.value)


def test_a_wrong_name_gets_the_nearest(found):
    with pytest.raises(ic.InputError, match=r"'K1x': no such coefficient, did you mean K1_x\?"):
        found["imu"]["K1x"]
    assert "K1_x" in found["imu"]
    assert "K1x" not in found["imu"]


def test_people_see_the_units_of_the_command_and_programs_si(found):
    platform = found["selfcal"]
    assert platform["kg0_x"].unit == "deg/h"
    assert platform.values["kg0_x"] == pytest.approx(np.radians(platform["kg0_x"].value / 3600.0))


def test_a_study_by_keywords_is_that_of_its_file(tmp_path):
    (tmp_path / "imu.toml").write_text(
        '[site]\nlatitude = "45 deg"\n[imu]\nmethod = "multiposition"\n', "utf-8"
    )
    by_file = ic.study(tmp_path / "imu.toml")
    by_word = ic.study("imu", site={"latitude": "45 deg"}, method="multiposition")
    assert by_file.settings == by_word.settings
    assert by_file.kind == by_word.kind == "imu"
    assert ic.study(tmp_path / "imu.toml", gravity="9.8 m/s^2").settings.site.gravity == 9.8
    assert {ic.study(FOLDER / f"{name}.toml").kind for name in ("xsens", "table")} == {"imu"}
    assert repr(by_word).count("\n") < 10
    with pytest.raises(AttributeError):
        by_word.kind = "aoa"


def test_an_imu_needs_no_study(log):
    plain = ic.calibrate(log, gravity="9.81 m/s^2", method="ferraris")
    assert plain.values == ic.calibrate(log, gravity="9.81 m/s^2").values
    assert plain.values == ic.calibrate(log, ic.study("imu", gravity="9.81 m/s^2", method="ferraris")).values
    with pytest.raises(ic.InputError, match="found beside a study"):
        ic.calibrate(log, FOLDER / "ferraris.toml", latitude="48 deg")


def test_designs_sensitivity_noise_and_temperature_are_results_too(found):
    table = ic.study("turntable", **TABLE)
    rest = ic.record(gyro_z=1e-3 * np.random.default_rng(1).standard_normal(4000), rate=100.0)
    sweep = ic.read(FOLDER / "thermal.csv.gz", map=FOLDER / "thermal-map.toml")
    results = [ic.design(table, "positions"), ic.sensitivity(table), ic.allan(rest), ic.temperature(sweep)]
    for result in [*results, ic.compare(found["imu"], found["imu"])]:
        assert isinstance(result, ic.Result)
        assert len(repr(result).splitlines()) == 3
        assert Tags(result._repr_html_()).open == []
    assert len(results[0].evidence.plan) == 12


def test_a_calibration_is_applied_and_taken_back(found, log, tmp_path):
    corrected = ic.apply(found["imu"], log)
    assert corrected["gyro_x"].unit.symbol == "rad/s"
    back = ic.apply(found["imu"].save(tmp_path / "cal.toml"), corrected, invert=True)
    np.testing.assert_allclose(back["acc_x"].values, log["acc_x"].values, rtol=1e-9, atol=1e-9)


def test_a_bad_verdict_can_be_raised_or_accepted(found):
    assert found["imu"].raise_for_status() is found["imu"]
    few = ic.read(FOLDER / "mpu6050.csv.gz", map=FOLDER / "mpu6050-map.toml", end="60 s")
    poor = ic.calibrate(few, FOLDER / "mpu6050.toml")
    assert poor.status is Status.UNOBSERVABLE
    assert "look at .findings" in repr(poor)
    assert poor.raise_for_status("unobservable") is poor
    with pytest.raises(ic.CalibrationError, match="unobservable"):
        poor.raise_for_status()


def test_a_part_of_a_recording_is_cut_before_it_is_used(log, capsys, tmp_path):
    part = ic.read(*FERRARIS, begin="5 s", end=30.0)
    assert part.span == {"begin_s": 5.0, "end_s": 30.0}
    assert len(part.labels) == len(part["acc_x"].t)
    assert np.ptp(part["acc_x"].t) == pytest.approx(25.0, abs=0.02)
    assert len(log.between().columns["acc_x"].t) == len(log["acc_x"].t)
    arguments = [
        "inspect",
        str(FERRARIS[0]),
        "--map",
        str(FERRARIS[1]),
        "--begin",
        "5 s",
        "--end",
        "30 s",
        "--json",
    ]
    run(arguments)
    rows = json.loads(capsys.readouterr().out)["result"]["channels"]
    assert {row["samples"] for row in rows} == {len(part["acc_x"].t)}
    sting = ic.read(FOLDER / "sting.csv.gz", begin="1 s", end="20 s")
    assert sting["a1"].t[[0, -1]].tolist() == [1.0, 20.0]
    assert ic.calibrate(sting, FOLDER / "sting.toml").estimate.provenance["span"] == sting.span


@pytest.mark.slow
def test_verbs_survive_any_order_of_imports():
    program = (
        "import importlib, pkgutil, random, sys, warnings\n"
        "import inercal\n"
        "warnings.simplefilter('ignore')\n"
        "names = [m.name for m in pkgutil.walk_packages(inercal.__path__, 'inercal.')\n"
        "         if '__main__' not in m.name and not m.name.endswith('migrations.env')]  # Alembic runs it\n"
        "random.Random(int(sys.argv[1])).shuffle(names)\n"
        "for name in names:\n"
        "    importlib.import_module(name)\n"
        "wrong = [name for name in inercal.__all__ if not callable(getattr(inercal, name))]\n"
        "assert not wrong, wrong\n"
    )
    for seed in random.Random(7).sample(range(1000), 1):
        done = subprocess.run(
            [sys.executable, "-c", program, str(seed)], capture_output=True, text=True, timeout=120
        )
        assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    "module",
    [
        *(f"faces.python.{room}" for room in ("recordings", "study", "verbs", "calibrations")),
        "laboratory.verbs",
        "laboratory.fleet.batch",
    ],
)
def test_the_examples_of_the_verbs_run(module):
    failed, tried = doctest.testmod(importlib.import_module(f"inercal.{module}"))
    assert failed == 0
    assert tried > 0
