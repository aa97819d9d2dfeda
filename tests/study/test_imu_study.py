"""The study of ``calibrate imu``: what its keys mean, and gravity with what it is uncertain by."""

import json
import math

import pytest
from numpy.testing import assert_allclose

from inercal.faces.studies.common import GRAVITY_ANOMALY, UNSTATED_HEIGHT
from inercal.faces.studies.imu import imu_study
from inercal.faces.studies.load import load_imu_study
from inercal.foundation.errors import StudyError
from inercal.foundation.geometry.earth import gravity
from rows import for_each

FULL = """
schema = 1
[site]
latitude = "39.1 deg"
height = "120 m"
gravity = "9.81744(2) m/s^2"
[imu]
method = "multiposition"
static_start = "50 s"
g_sensitivity = true
time_base = "20 ppm"
[traceability]
instrument = "MTi 7"
date = 2026-11-03
[conditions]
temperature = "296.15(50) K"
"""


@pytest.fixture
def write(tmp_path):
    def write(text):
        path = tmp_path / "study.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_every_key(write):
    path = write(FULL)
    study = load_imu_study(path)
    assert study.site.gravity == 9.81744
    assert study.site.latitude == pytest.approx(math.radians(39.1))
    assert study.static_start == 50.0
    assert study.g_sensitivity is True
    assert study.time_base_u == pytest.approx(2e-5)
    assert study.traceability == {
        "instrument": "MTi 7", "operator": "", "date": "2026-11-03", "reference": "",
    }  # fmt: skip
    assert study.temperature.value == pytest.approx(23.0)
    assert study.temperature.u == pytest.approx(0.5)


def test_what_is_absent():
    study = imu_study({"site": {"gravity": "9.8 m/s^2"}}, "study.toml")
    assert (study.static_start, study.g_sensitivity, study.time_base_u) == (None, False, 0.0)
    assert (study.temperature, study.site.latitude, study.site.inputs) == (None, None, ())


def test_settings_are_the_given_keys_as_typed_ready_for_json(write):
    settings = load_imu_study(write(FULL)).given
    assert settings["site"]["gravity"] == "9.81744(2) m/s^2"
    assert settings["traceability"] == {"instrument": "MTi 7", "date": "2026-11-03"}
    assert json.loads(json.dumps(settings)) == settings
    assert imu_study(settings, "again").site == load_imu_study(write(FULL)).site


def test_explicit_gravity_wins_and_brings_its_own_uncertainty(write):
    site = load_imu_study(write(FULL)).site
    assert [tuple(each) for each in site.inputs] == [("gravity", pytest.approx(2e-5), "m/s^2", 1.0)]


def test_gravity_of_latitude_and_height():
    site = imu_study({"site": {"latitude": "39.1(1) deg", "height": "120(10) m"}}, "s").site
    latitude = math.radians(39.1)
    assert site.gravity == float(gravity(latitude, 120.0))
    by = {each.source: each for each in site.inputs}
    assert list(by) == ["latitude", "height", "gravity anomaly"]
    assert (by["latitude"].u, by["height"].u) == (pytest.approx(math.radians(0.1)), pytest.approx(10.0))
    assert (by["latitude"].unit, by["height"].unit) == ("rad", "m")
    assert by["gravity anomaly"][1:] == (GRAVITY_ANOMALY, "m/s^2", 1.0)
    step = 1e-4
    assert_allclose(
        by["latitude"].sensitivity,
        (gravity(latitude + step, 120.0) - gravity(latitude - step, 120.0)) / (2 * step),
        rtol=1e-6,
    )
    assert_allclose(
        by["height"].sensitivity, (gravity(latitude, 130.0) - gravity(latitude, 110.0)) / 20, rtol=1e-6
    )


def test_exact_latitude_and_height_leave_the_anomaly():
    site = imu_study({"site": {"latitude": "-90 deg", "height": "0 m"}}, "s").site
    assert [each.source for each in site.inputs] == ["gravity anomaly"]


def test_a_height_nobody_gave_is_in_the_budget():
    site = imu_study({"site": {"latitude": "40 deg"}}, "s").site
    assert site.gravity == float(gravity(math.radians(40.0), 0.0))
    assert {each.source: each.u for each in site.inputs}["height"] == UNSTATED_HEIGHT


def test_overrides_take_toml_or_plain_text(write):
    study = load_imu_study(
        write(FULL),
        [
            "imu.static_start=40 s",
            'site.gravity="9.80 m/s^2"',
            "imu.g_sensitivity = false",
            "imu.time_base=1e-6",
            "conditions.temperature=20 degC",
            "traceability.reference=a = b",
        ],
    )
    assert study.static_start == 40.0
    assert study.site.gravity == 9.80
    assert study.g_sensitivity is False
    assert study.time_base_u == 1e-6
    assert study.temperature.value == 20.0
    assert study.traceability["reference"] == "a = b"
    assert study.given["imu"]["static_start"] == "40 s"


def test_overrides_make_tables_that_the_file_lacks(write):
    assert load_imu_study(write(""), ["site.gravity=9.8 m/s^2"]).site.gravity == 9.8


@for_each(
    ("override", "message"),
    [
        ("imu.static_start", "--set 'imu.static_start': found no key and value, expected key=value"),
        ("=5", "found no key and value"),
        ("imu..x=5", "found no key and value"),
        ("schema.x=5", "--set 'schema.x=5': schema is no table, expected the key of a value"),
        ("imu.method.x=5", "imu.method is no table"),
        ("imu.statc_start=5 s", "imu.statc_start: unknown key, did you mean static_start"),
        (
            "imu.static_start=5\nx = 1",
            "imu.static_start: found the unit 'x = 1', expected a unit of time: s, ms",
        ),
    ],
)
def test_wrong_overrides(write, override, message):
    with pytest.raises(StudyError, match=message):
        load_imu_study(write(FULL), [override])
