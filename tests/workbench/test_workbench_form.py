"""The form changes one key of a study's text, and nothing else; comments stay."""

import tomllib

import pytest

from inercal.errors import InputError
from inercal.studies.template import template
from inercal.workbench.form import as_toml, changed, problem, tables
from inercal.workbench.sessions import COMMANDS


def at(data, path):
    for name in path.split("."):
        data = data.get(name, {}) if isinstance(data, dict) else {}
    return data


@pytest.mark.parametrize("kind", COMMANDS)
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


def test_a_key_keeps_its_comment_and_its_place():
    text = '[site]\nlatitude = "?"    # north # positive\nheight = "100 m"\n'
    made = changed(text, "site.latitude", '"45 # deg"')
    assert made.splitlines()[1].endswith("# north # positive")
    assert tomllib.loads(made) == {"site": {"latitude": "45 # deg", "height": "100 m"}}


def test_a_commented_key_and_its_table_come_into_force():
    text = '[site]\nlatitude = "45 deg"\n\n# [item]    # the instrument\n# serial = "0042"    # its number\n'
    made = changed(text, "item.serial", '"7"')
    assert tomllib.loads(made) == {"site": {"latitude": "45 deg"}, "item": {"serial": "7"}}
    assert made.count("serial") == 1


def test_a_table_within_a_line_is_changed_there():
    text = '[columns]\nacc_x = { from = 1, unit = "m/s^2" }\nacc_y = { from = 2, unit = "m/s^2" }\n'
    made = changed(text, "columns.acc_x.unit", '"g"')
    assert tomllib.loads(made)["columns"] == {
        "acc_x": {"from": 1, "unit": "g"},
        "acc_y": {"from": 2, "unit": "m/s^2"},
    }


@pytest.mark.parametrize("value", ['"open', "1 2", "}", "\n[other]\nx = 1"])
def test_a_value_that_is_no_toml_is_refused(value):
    with pytest.raises(InputError):
        changed('[site]\nlatitude = "45 deg"\n', "site.latitude", value)


def test_a_study_is_judged_in_one_sentence():
    assert problem("imu", '[site]\nlatitude = "45 deg"\n') == ""
    assert "site.latitude" in problem("imu", '[site]\nlatitude = "45 m"\n')
    assert "TOML" in problem("imu", "[site")
