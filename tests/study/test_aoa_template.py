"""The study that `inercal new aoa` writes: complete, commented, loadable; and whatever stands in its keys."""

import copy
import json
import re
import tomllib
from typing import get_args

import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from jsonschema import Draft202012Validator
from new_studies import filled
from sting_study import DEG, scenario
from sting_text import same

from inercal.faces.studies.aoa import aoa_study
from inercal.faces.studies.schema import json_schema
from inercal.foundation.errors import StudyError
from inercal.foundation.keys import keys_of
from inercal.systems.aoa.motion import MotionKind, MotionPlan
from inercal.systems.aoa.settings import Zero

SCHEMA = json_schema()
VALIDATOR = Draft202012Validator(SCHEMA)
TEMPLATE = filled("aoa")


def test_the_template_loads_as_written_and_is_the_reference():
    data = tomllib.loads(TEMPLATE)
    found, expected = aoa_study(data, "t.toml"), scenario("base")
    VALIDATOR.validate(data)
    for name in ("layout", "noise", "prior", "motion", "disturbances", "timing", "estimator", "methods"):
        same(getattr(found, name), getattr(expected, name))
    assert found.site.latitude_u == pytest.approx(26 * DEG)


def values():
    """Every key of the template in its table, those that are comments too, with the value shown there."""
    found, table = {}, ""
    for line in TEMPLATE.splitlines():
        if head := re.match(r"(?:# )?\[([\w.]+)\]", line):
            table = head[1]
        elif key := re.match(r"(?:# )?(\w+) = ", line):
            found.setdefault(table, {})[key[1]] = tomllib.loads(line.removeprefix("# "))[key[1]]
    return found


@pytest.mark.parametrize("kind", get_args(MotionKind))
def test_the_motions_of_the_template_load_with_their_keys(kind, tmp_path):
    """With just the keys that a kind needs and heeds."""
    shown = values()["motion"]
    heeded = [key.name or field.name for field, key in keys_of(MotionPlan) if kind in key.kinds]
    data = tomllib.loads(TEMPLATE)
    data["motion"] = {"kind": kind, **{key: shown[key] for key in heeded}}
    VALIDATOR.validate(data)
    assert aoa_study(data, tmp_path / "t.toml").motion.kind == kind


def test_the_wind_off_zero_of_the_template_loads():
    data = {**tomllib.loads(TEMPLATE), "zero": values()["zero"]}
    same(aoa_study(data, "t.toml").zero, Zero(0.0, 5.0, 0.0, 0.01 * DEG))


def test_the_next_command_of_the_template():
    assert "# Next: inercal simulate aoa s.toml --out simulated.csv\n" in filled("aoa", (), "s.toml")
    assert "# Next: inercal aoa a.csv --map m.toml --study s.toml\n" in filled(
        "aoa", ["a.csv"], "s.toml", "m.toml"
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
