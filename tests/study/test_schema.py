"""The JSON Schema of studies: valid, strict, described, and of one mind with the reader."""

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from inercal.errors import StudyError
from inercal.study.imu import imu_study
from inercal.study.schema import json_schema
from inercal.units import _TABLE

SCHEMA = json_schema()
VALIDATOR = Draft202012Validator(SCHEMA)
GOOD = {
    "schema": 1,
    "site": {"latitude": "39.1 deg", "height": "0 m", "gravity": "9.81744(2) m/s^2"},
    "imu": {
        "method": "multiposition", "static_start": "50 s", "g_sensitivity": True, "time_base": "20 ppm",
    },
    "traceability": {"instrument": "a", "operator": "b", "date": "c", "reference": "d"},
    "conditions": {"temperature": "23 degC"},
}  # fmt: skip


def changed(table, key, value):
    return {**GOOD, table: {**GOOD[table], key: value}}


def test_it_is_a_schema_and_the_full_study_fits():
    Draft202012Validator.check_schema(SCHEMA)
    assert VALIDATOR.is_valid(GOOD)
    assert imu_study(GOOD, "study.toml").static_start == 50.0


def test_every_table_and_key_has_title_and_description():
    tables = list(SCHEMA["$defs"].values())
    assert {"ImuStudyFile", "TurntableStudyFile", "ErrorsTable", "SiteTable"} <= SCHEMA["$defs"].keys()
    for table in tables:
        assert table["additionalProperties"] is False
        for node in (table, *table["properties"].values()):
            assert node["title"]
            assert node["description"]


@pytest.mark.parametrize(
    "data",
    [
        {**GOOD, "sight": {}},
        changed("site", "gravty", "9.8 m/s^2"),
        changed("site", "gravity", 9.8),
        changed("site", "gravity", "9.8"),
        changed("imu", "method", "by hand"),
        changed("imu", "g_sensitivity", "yes"),
        changed("traceability", "operator", 5),
        {**GOOD, "schema": 2},
        {**GOOD, "site": []},
    ],
)
def test_both_refuse(data):
    assert not VALIDATOR.is_valid(data)
    with pytest.raises(StudyError):
        imu_study(data, "study.toml")


def test_examples_in_the_schema_are_accepted():
    for name, key in [("site", "gravity"), ("site", "latitude"), ("site", "height"), ("imu", "static_start"),
                      ("imu", "time_base"), ("conditions", "temperature")]:  # fmt: skip
        table = SCHEMA["$defs"][f"{name.title()}Table"]
        for example in table["properties"][key]["examples"]:
            assert VALIDATOR.is_valid(changed(name, key, example))
            imu_study(changed(name, key, example), "study.toml")


@settings(deadline=None)  # pint is loaded on the way
@given(
    number=st.from_regex(r"[+-]?[0-9.]{1,6}(\([0-9.]{1,3}\))?(e[+-]?[0-9])?", fullmatch=True),
    plus_minus=st.sampled_from(["", " ± 0.5", "+/-1e-3"]),
    unit=st.sampled_from(["", "1", *(unit for unit in _TABLE["time"][1]), " min", "\u00a0s", "fortnight"]),
    table_key=st.sampled_from([("imu", "static_start"), ("imu", "time_base")]),
)
def test_the_schema_is_never_stricter_than_the_reader(number, plus_minus, unit, table_key):
    data = changed(*table_key, number + plus_minus + unit)
    try:
        imu_study(data, "study.toml")
    except StudyError:
        return
    assert VALIDATOR.is_valid(data)
