"""The study that `inercal new aoa` writes: complete, commented, loadable; and whatever stands in its keys."""

import copy
import json
import re
import tomllib

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from sting_study import DEG, scenario
from sting_text import calibrated, same

from inercal.aoa.settings import (
    Zero,
)
from inercal.errors import StudyError
from inercal.studies.aoa import aoa_study
from inercal.studies.schema import json_schema
from inercal.studies.sensors import MOST
from inercal.studies.template import aoa_template
from rows import for_each

SCHEMA = json_schema()
VALIDATOR = Draft202012Validator(SCHEMA)
KEY = re.compile(r"(?:# )?(\w+) = (.*\S) +# (.+)")
TEMPLATE = aoa_template()


def test_the_template_loads_as_written_and_is_the_reference():
    data = tomllib.loads(TEMPLATE)
    found, expected = aoa_study(data, "t.toml"), scenario("base")
    VALIDATOR.validate(data)
    for name in ("layout", "noise", "prior", "motion", "disturbances", "timing", "estimator", "methods"):
        same(getattr(found, name), getattr(expected, name))
    assert found.site.latitude_u == pytest.approx(26 * DEG)


def test_every_key_and_table_of_the_template_has_its_comment():
    lines = TEMPLATE[TEMPLATE.index("schema = 1") :].splitlines()
    for line in lines:
        assert len(line) <= 120
        if re.match(r"(# )?\w+ = ", line):
            assert KEY.fullmatch(line), line
        elif line.startswith(("[", "# [")):
            assert re.fullmatch(r"(# )?\[[\w.]+\]  +# \S.*", line), line


def properties(name):
    """Keys of a table of the schema, and the tables among them by key."""
    keys = SCHEMA["$defs"][name]["properties"]
    inner = {key: node["$ref"].rpartition("/")[2] for key, node in keys.items() if "$ref" in node}
    return set(keys), inner


def test_every_key_is_in_the_template():
    """All but the tables of more sensors, which are told in words."""
    whole = tomllib.loads(re.sub(r"(?m)^# ((\w+) = |\[)", r"\1", TEMPLATE))

    def compare(given, name):
        keys, inner = properties(name)
        told = (
            {f"a{k}" for k in range(4, MOST + 1)} | {"gyro_roll", "gyro_yaw"}
            if name == "SensorsTable"
            else set()
        )
        if name == "AccelerometerTable" and given["axis"] != "-z":
            return
        assert set(given) == keys - told, name
        for key, table in inner.items():
            if key in given:
                compare(given[key], table)

    compare(whole, "AoaStudyFile")
    VALIDATOR.validate(whole)


def lines_with_keys():
    """Table and line of every key that is commented out."""
    table = ""
    for line in TEMPLATE.splitlines():
        if found := re.match(r"(?:# )?\[([\w.]+)\]", line):
            table = found[1]
        elif re.match(r"# \w+ = ", line):
            yield table, line


@for_each(("table", "line"), [each for each in lines_with_keys() if each[0] not in ("motion", "zero")])
def test_every_commented_key_loads_alone(table, line, tmp_path):
    calibrated(tmp_path / "a1.json", K0_x=(0.0, "g"), K1_x=(1.0, "g/(m/s^2)"))
    calibrated(tmp_path / "gyro.json", D_F_y=(0.0, "V"), S_y=(1.0, "V/(rad/s)"))
    key = line.split()[1]
    text, plain = TEMPLATE, line.removeprefix("# ")
    start = text.index(f"[{table}]")
    before, after = text[:start], text[start:].replace(line, plain, 1)
    if key == "angle":
        after = re.sub("(?m)^axis = .*\n", "", after, count=1)
    if key == "channel":
        after = re.sub("(?m)^# (calibration = .*)", r"\1", after, count=1)
    data = tomllib.loads(before + after)
    VALIDATOR.validate(data)
    found = aoa_study(data, tmp_path / "t.toml")
    assert found.given != aoa_study(tomllib.loads(TEMPLATE), "t.toml").given


@pytest.mark.parametrize("kind", ["static", "pitch-pause", "two-tone", "chirp", "buffet", "file"])
def test_the_motions_of_the_template_load_with_their_keys(kind, tmp_path):
    """Keys say in their comment which kinds they are for; with just these each kind loads."""
    start, end = TEMPLATE.index("[motion]"), TEMPLATE.index("[disturbances]")
    kept = ["[motion]", f'kind = "{kind}"']
    for line in TEMPLATE[start:end].splitlines()[2:]:
        if (found := KEY.fullmatch(line)) and found[1] != "kind":
            kinds = found[3].partition(":")[0]
            everywhere = ["sample_rate", *(["duration"] if kind != "pitch-pause" else [])]
            if kind in kinds.split(", ") or found[1] in everywhere:
                kept.append(line.removeprefix("# "))
    data = tomllib.loads(TEMPLATE[:start] + "\n".join(kept) + "\n" + TEMPLATE[end:])
    VALIDATOR.validate(data)
    assert aoa_study(data, tmp_path / "t.toml").motion.kind == kind


def test_the_wind_off_zero_of_the_template_loads():
    start = TEMPLATE.index("# [zero]")
    end = TEMPLATE.index("[traceability]")
    text = TEMPLATE[:start] + TEMPLATE[start:end].replace("# ", "", 1).replace("\n# ", "\n") + TEMPLATE[end:]
    same(aoa_study(tomllib.loads(text), "t.toml").zero, Zero(0.0, 5.0, 0.0, 0.01 * DEG))


def test_the_next_command_of_the_template():
    assert "# Next: inercal simulate aoa s.toml --out simulated.csv\n" in aoa_template((), "s.toml")
    assert "# Next: inercal aoa a.csv --map m.toml --study s.toml\n" in aoa_template(
        ["a.csv"], "s.toml", "m.toml"
    )


SCALARS = st.one_of(
    st.booleans(), st.integers(), st.floats(), st.text(max_size=8),
    st.sampled_from(["1 deg", "1 g", "1 mm", "2 s", "1 Hz", "0.5 g/V", "20 V/g", "1 deg/s", "3 ug/K", "1e7 rad^2/s^7"]),
)  # fmt: skip
JUNK = st.recursive(
    SCALARS, lambda x: st.lists(x, max_size=4) | st.dictionaries(st.text(max_size=4), x, max_size=2)
)
WHOLE = tomllib.loads(
    re.sub(r"(?m)^# ((?!angle|calibration|channel|second|low|high|rms|first|last|step|move|pause|file)\w+ = |\[)",
           r"\1", TEMPLATE)
)  # fmt: skip


def places(table, path=()):
    """Paths of all keys."""
    for key, value in table.items():
        yield (*path, key)
        if isinstance(value, dict):
            yield from places(value, (*path, key))


@settings(suppress_health_check=[HealthCheck.too_slow], deadline=None, max_examples=200)
@given(place=st.sampled_from(list(places(WHOLE))), value=JUNK)
def test_whatever_a_key_holds_it_is_a_study_or_one_sentence(place, value):
    """And what the reader takes, the schema takes too."""
    data = copy.deepcopy(WHOLE)
    table = data
    for key in place[:-1]:
        table = table[key]
    table[place[-1]] = value
    try:
        found = aoa_study(data, "s.toml")
    except StudyError as error:
        said = str(error)
    else:
        said = ""
        assert VALIDATOR.is_valid(data)
        json.dumps(found.given)
    assert "\n" not in said
