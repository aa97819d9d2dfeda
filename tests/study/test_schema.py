"""The JSON Schema of studies: valid, strict, described, and of one mind with the reader."""

import re
from itertools import combinations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator

from inercal.faces.studies.imu import imu_study
from inercal.faces.studies.schema import json_schema
from inercal.faces.studies.starting import DISTRIBUTIONS
from inercal.foundation.errors import StudyError
from inercal.foundation.units import _TABLE, parse_unit
from rows import for_each

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


def keys(kind):
    """Dotted name -> schema of every key of a kind of study, those of its tables too."""
    found = {}

    def walk(path, schema):
        if "$ref" in schema:
            schema = SCHEMA["$defs"][schema["$ref"].rsplit("/", 1)[-1]]
        for one in schema.get("anyOf", ()):
            walk(path, one)
        for key, value in schema.get("properties", {}).items():
            found[f"{path}.{key}".lstrip(".")] = value
            walk(f"{path}.{key}", value)

    walk("", SCHEMA["$defs"][f"{kind}StudyFile"])
    return found


def dimensions(schema):
    """What the quantities that a key takes measure: of its example, of the examples of a list or of one of several."""
    parts = [schema, *schema.get("anyOf", ()), schema.get("items", {})]
    examples = [part["examples"][0] for part in parts if "pattern" in part]
    units = [re.sub(r"^[+-]?[0-9.]+(\([0-9.]+\))?(e[+-]?[0-9]+)?", "", text).strip() for text in examples]
    return {parse_unit(unit).dimension if unit else "number" for unit in units}


KINDS = {kind: keys(kind) for kind in ("Imu", "Strapdown", "Turntable", "Selfcal", "Aoa")}
OWN_TABLES = (
    "plan",
    "truth",
    "motion",
    "rig",
    "model",
    "noise",
    "prior",
    "disturbances",
    "design",
    "timing",
    "goal",
)
"""Tables that are of each kind of study what its rig, instruments and search need."""

TWO_DIMENSIONS = {
    "step": "time from row to row of a path, angle of a move of a pitch-pause",
    "start": "angles at which a path begins, time at which a stretch does",
    "rms": "of an angle, or of an acceleration",
    "range": "of an accelerometer, of a gyro",
    "z": "height of a sensor, limits of a gimbal",
    "level": "axes to the vertical, level of an effect",
    **dict.fromkeys(DISTRIBUTIONS, "errors of a table that are angles, and the offset of its axes"),
}


def test_a_key_that_several_kinds_have_is_one_key():
    """Outside the tables of each kind's own what has one dotted name has one schema, and so one meaning."""
    for one, other in combinations(KINDS.values(), 2):
        shared = {name for name in one.keys() & other.keys() if name.partition(".")[0] not in OWN_TABLES}
        assert {"schema", "site.gravity", "traceability.reference", "conditions.temperature"} <= shared
        for name in shared:
            assert one[name] == other[name], name


def test_a_key_measures_the_same_wherever_it_is():
    """One word, one dimension, but for those that say why not; samples per second are always `sample_rate`."""
    measured = {}
    for found in KINDS.values():
        for name, schema in found.items():
            measured.setdefault(name.rpartition(".")[2], set()).update(dimensions(schema))
    assert {name for name, of in measured.items() if len(of) > 1} == TWO_DIMENSIONS.keys()
    assert {name for name, of in measured.items() if "frequency" in of} == {
        *("sample_rate", "frequency", "second_frequency", "low", "high", "bandwidth", "notch", "low_pass"),
    }


def test_what_is_simulated_and_what_is_known_before_have_the_same_names():
    """A disturbance that the filter allows for, and the key of [prior] that says how much."""
    names = [{key.split(".")[1] for key in KINDS["Aoa"] if key.startswith(f"{table}.")} for table in
             ("prior", "disturbances", "timing")]  # fmt: skip
    prior, disturbances, timing = names
    assert prior & disturbances == {"heave", "axial", "gyro_scale", "gyro_delay"}
    assert timing <= disturbances
    truth, before, goal = (
        {key for key in KINDS["Selfcal"] if key.startswith(f"{table}.")}
        for table in ("truth", "prior", "goal")
    )
    assert len(truth) == 8
    assert {key[6:] for key in truth} == {key[6:] for key in before} == {key[5:] for key in goal}


def test_every_table_and_key_has_title_and_description():
    tables = list(SCHEMA["$defs"].values())
    assert {"ImuStudyFile", "TurntableStudyFile", "RigsTableErrors", "SiteTable"} <= SCHEMA["$defs"].keys()
    for table in tables:
        assert table["additionalProperties"] is False
        for node in (table, *table["properties"].values()):
            assert node["title"]
            assert node["description"]


@for_each(
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
