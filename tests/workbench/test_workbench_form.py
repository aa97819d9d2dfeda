"""The form shows each key of a study, and sets it alone."""

import tomllib

import pytest

from inercal.bench.workbench.pages.form import as_toml, problem, tables
from inercal.faces.studies.template import template
from inercal.faces.studies.text import changed
from inercal.systems.listed import SYSTEMS


def at(data, path):
    for name in path.split("."):
        data = data.get(name, {}) if isinstance(data, dict) else {}
    return data


@pytest.mark.parametrize("kind", SYSTEMS)
def test_every_key_of_a_new_study_takes_its_example_and_leaves_the_others(kind):
    text = template(kind)
    keys = [key for table in tables(kind, text) for key in table.keys if key.example]
    assert len(keys) > 30
    for key in keys:
        value = as_toml(key.example, key.widget)
        made = changed(text, key.path, value)
        before, after = tomllib.loads(text), tomllib.loads(made)
        assert at(after, key.path) == tomllib.loads(f"v = {value}")["v"], key.path
        gone = changed(made, key.path, "")
        expected = tomllib.loads(changed(text, key.path, "")) if at(before, key.path) else before
        assert at(tomllib.loads(gone), key.path) == at(expected, key.path) == {}
        for name in before:  # other tables are untouched
            if name != key.path.split(".")[0]:
                assert after[name] == before[name]


def test_a_study_is_judged_in_one_sentence():
    assert problem("imu", '[site]\nlatitude = "45 deg"\n') == ""
    assert "site.latitude" in problem("imu", '[site]\nlatitude = "45 m"\n')
    assert "TOML" in problem("imu", "[site")
