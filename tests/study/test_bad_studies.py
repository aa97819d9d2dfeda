"""Whatever a study file holds: a study, or one `StudyError` of one line."""

import datetime
import math
import re

import pytest
from hypothesis import HealthCheck, example, given, settings
from hypothesis import strategies as st
from new_studies import filled

from inercal.faces.studies.imu import imu_study
from inercal.faces.studies.load import load_imu_study
from inercal.foundation.errors import StudyError
from inercal.systems.imu.settings import ImuSettings
from rows import for_each

RELAXED = settings(suppress_health_check=[HealthCheck.function_scoped_fixture], deadline=None)
TEMPLATE = re.sub(r"(?m)^# (\w+ = )", r"\1", filled("imu")).encode()
SITE = '[site]\ngravity = "9.8 m/s^2"\n'
IMU = SITE + "[imu]\n"


@pytest.fixture
def load(tmp_path):
    def load(content):
        path = tmp_path / "study.toml"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return load_imu_study(path)

    return load


@for_each(
    ("text", "message"),
    [
        ("", "site: neither gravity nor latitude given, expected one of them"),
        ('[site]\nheight = "5 m"', "site: neither gravity nor latitude given"),
        ('[site]\nlatitude = "91 deg"', "'91 deg', that is 1.58825 rad, expected a latitude from -90 deg"),
        ('[site]\nlatitude = "39.1"', "site.latitude: found '39.1' without a unit, expected a quantity"),
        ("[site]\nlatitude = 39.1", "site.latitude: found '39.1' without a unit"),
        ('[site]\nheight = "9e5 m"', "site.height: found '9e5 m', expected a height from -1 km to 20 km"),
        (
            '[site]\ngravity = "9.81 g"',
            "site.gravity: found '9.81 g', that is 96.2032 m/s^2, expected 9.6 to",
        ),
        ('[site]\ngravity = "1 m/s^2"', "on Earth (check the unit: 1 g is 9.80665 m/s^2)"),
        ('[site]\ngravity = "9.8 m/s"', "site.gravity: found '9.8 m/s', which is of velocity"),
        ('[site]\ngravity = ["9.8 m/s^2"]', "site.gravity: found ['9.8 m/s^2'], expected a quantity"),
        ('[[site]]\ngravity = "9.8 m/s^2"', "site: found [{'gravity': '9.8 m/s^2'}], expected a table"),
        ("site = 9.8", "site: found 9.8, expected a table"),
        (SITE + 'latitud = "1 deg"', "site.latitud: unknown key, did you mean latitude?"),
        (
            IMU + 'method = "ferraris"\nstatic_start = "50 s"',
            "static_start: found with method = 'ferraris', expected it with multiposition only",
        ),
        (
            IMU + "ferraris = { turn = '90 deg' }",
            "ferraris: found with method = 'multiposition', expected it with ferraris only",
        ),
        (
            IMU + "bias_drift = true",
            "imu.bias_drift: found True, which is gone since 0.3.0, expected in its place nothing: moves have",
        ),
        (IMU + 'method = "six"', "imu.method: found 'six', expected 'multiposition'"),
        (IMU + 'static_start = "0 s"', "imu.static_start: found '0 s', expected a time above zero"),
        (IMU + 'static_start = "-1 h"', "found '-1 h', that is -3600 s, expected a time above zero"),
        (IMU + "static_start = 50", "imu.static_start: found '50' without a unit"),
        (IMU + 'g_sensitivity = "yes"', "imu.g_sensitivity: found 'yes', expected true or false"),
        (IMU + "time_base = -1e-6", "imu.time_base: found -1e-06, expected 0 or more, and below 1"),
        (IMU + 'time_base = "20"', "imu.time_base: found '20', expected 0 or more, and below 1"),
        (SITE + "[traceability]\ninstrument = 7", "traceability.instrument: found 7, expected a text in"),
        (SITE + '[conditions]\ntemperature = "-3 K"', "'-3 K', that is -276.15 degC, expected a temperature"),
        ("schema = 2\n" + SITE, "schema: found 2, expected 1"),
        (SITE + '[rig]\nkind = "sting"', "found 'sting', a study for `inercal aoa`, expected one for `inerc"),
        (
            '[rig]\nkind = "three_axis_gimbals"',
            "rig.kind: found 'three_axis_gimbals', a study for `inercal se",
        ),
        ('[rig]\nkind = "two_axis_turntable"', "a study for `inercal calibrate turntable`"),
        ("rig = 5\n" + SITE, "rig: unknown key"),
        (
            "[columns.t]\nfrom = 0\nunit = 's'\n",
            "found a column map, which goes behind --map, expected a study",
        ),
        (SITE + "[rig]\nkind = []", "rig: unknown key"),
        ("t [s],acc_x [m/s^2]\n0,1\n", "not valid TOML"),
    ],
)
def test_one_sentence_names_key_found_and_expected(load, text, message):
    with pytest.raises(StudyError, match=re.escape(message)) as caught:
        load(text)
    assert str(caught.value).startswith(caught.value.where)
    assert caught.value.where.endswith("study.toml")


def is_study_or_error(make):
    """Run it; anything but a sound study or a `StudyError` of one short line fails."""
    try:
        study = make()
    except StudyError as error:
        message = str(error)
    else:
        message = ""
        assert isinstance(study, ImuSettings)
        assert 9.6 < study.site.gravity < 10.0
        assert all(each.u > 0 and math.isfinite(each.u * each.sensitivity) for each in study.site.inputs)
        assert study.static_start is None or 0 < study.static_start < math.inf
    assert "\n" not in message
    assert len(message) < 500


@RELAXED
@given(end=st.integers(0, len(TEMPLATE)))
def test_truncated(load, end):
    is_study_or_error(lambda: load(TEMPLATE[:end]))


@RELAXED
@given(
    start=st.integers(0, len(TEMPLATE)),
    length=st.integers(0, 40),
    junk=st.binary(max_size=8) | st.text().map(str.encode),
)
def test_mutated(load, start, length, junk):
    is_study_or_error(lambda: load(TEMPLATE[:start] + junk + TEMPLATE[start + length :]))


@RELAXED
@given(content=st.binary(max_size=200) | st.text().map(lambda text: text.encode()))
@example(b"a = " + b"[" * 10_000)
@example(b"site.gravity = " + b"9" * 10_000)
@example(b"site.gravity = 0x" + b"f" * 10_000)
@example(b"imu.method" + b".a" * 2_000 + b" = 1")
def test_junk(load, content):
    is_study_or_error(lambda: load(content))


scalars = st.one_of(
    st.booleans(),
    st.integers(),
    st.floats(),
    st.dates(),
    st.datetimes(),
    st.just(datetime.time(1, 2)),
    st.text(max_size=20),
    st.sampled_from(
        ["9.8 m/s^2", "1 g", "40(1) deg", "-0 m", "50 s", "20 ppm", "300 K", "multiposition", "aided"]
    ),
    st.builds(
        "{:g} {}".format, st.floats(), st.sampled_from(["deg", "m", "m/s^2", "s", "ppm", "degF", "inch"])
    ),
)
keys = st.text(max_size=8) | st.sampled_from(
    ["schema", "version", "latitude", "height", "gravity", "method", "static_start", "g_sensitivity",
     "time_base", "instrument", "date", "temperature", "kind"]
)  # fmt: skip
values = st.recursive(
    scalars, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(keys, inner, max_size=3)
)
tables = st.dictionaries(
    st.sampled_from(["schema", "site", "imu", "traceability", "conditions", "rig"]) | keys,
    st.dictionaries(keys, values, max_size=4) | values,
    max_size=5,
)


@RELAXED
@given(data=tables)
def test_random_tables(data):
    is_study_or_error(lambda: imu_study(data, "study.toml"))


@RELAXED
@given(
    site=st.dictionaries(st.sampled_from(["latitude", "height", "gravity"]), scalars),
    imu=st.dictionaries(st.sampled_from(["method", "static_start", "g_sensitivity", "time_base"]), scalars),
)
def test_random_values_of_known_keys(site, imu):
    is_study_or_error(lambda: imu_study({"site": site, "imu": imu}, "study.toml"))


@RELAXED
@given(
    override=st.text()
    | st.builds("{}.{}={}".format, st.sampled_from(["site", "imu", "schema"]), keys, st.text())
)
@example("imu.method" + ".a" * 2_000 + "=1")
@example("site.gravity=" + "[" * 10_000)
def test_any_override(tmp_path, override):
    path = tmp_path / "study.toml"
    path.write_text(SITE, encoding="utf-8")
    is_study_or_error(lambda: load_imu_study(path, [override]))
