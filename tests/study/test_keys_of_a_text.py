"""A key set in the text of a study: that key changes and nothing else; comments stay."""

import datetime
import tomllib

import numpy as np
import pytest

from inercal.faces.studies.text import changed, toml
from inercal.foundation.errors import InputError, StudyError


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


def test_a_value_over_several_lines_is_changed_as_a_whole():
    text = '[plan]\nturns = [\n    ["z", "1 deg"],  # a ] in a remark\n    ["x", "2 deg"],\n]\nrate = "1 deg/s"\n'
    assert changed(text, "plan.turns", '[["y", "3 deg"]]').splitlines() == [
        "[plan]", 'turns = [["y", "3 deg"]]', 'rate = "1 deg/s"',
    ]  # fmt: skip
    out = changed(text, "plan.turns", "")
    assert [line for line in out.splitlines() if not line.startswith("#")] == ["[plan]", 'rate = "1 deg/s"']


HEADS = """[site]
latitude = "45 deg"    # north
# height = "100 m"    # above the sea,
                      # or below

# [item]
# serial = "0042"

[sensors.a1]
axis = "+x"    # ahead
"""


def lines_but(text, *gone):
    return [line for line in text.splitlines() if line not in gone]


def test_an_example_comes_into_force_in_its_place():
    made = changed(HEADS, "site.height", '"5 m"').splitlines()
    assert made[2] == 'height = "5 m"        # above the sea,'
    assert [*made[:2], HEADS.splitlines()[2], *made[3:]] == HEADS.splitlines()


def test_a_new_key_stands_below_the_others_of_its_table():
    made = changed(HEADS, "site.gravity", '"9.81 m/s^2"')
    assert made.splitlines()[2] == 'gravity = "9.81 m/s^2"'
    assert lines_but(made, 'gravity = "9.81 m/s^2"') == HEADS.splitlines()


def test_a_new_table_stands_at_the_end():
    assert changed(HEADS, "rig.errors.phi1", "1") == HEADS + "\n[rig.errors]\nphi1 = 1\n"


def test_what_is_taken_out_stays_as_a_comment_and_comes_back():
    gone = changed(HEADS, "site.latitude", "")
    assert gone == HEADS.replace('latitude = "45 deg"  ', '# latitude = "45 deg"')
    assert changed(gone, "site.latitude", '"45 deg"') == HEADS
    gone = changed(HEADS, "sensors.a1", "")
    assert gone == HEADS.replace("[sensors", "[sensors]\n# [sensors").replace("axis", "# axis")
    assert tomllib.loads(changed(gone, "sensors.a1.axis", '"+x"')) == tomllib.loads(HEADS)


@pytest.mark.parametrize("path", ["rows.a", "site.latitude.degrees", "nothing.there"])
def test_a_key_that_cannot_be_changed_in_the_text_is_refused(path):
    with pytest.raises(InputError, match="cannot be changed here"):
        changed(HEADS + "[[rows]]\na = 1\n", path, "" if path == "nothing.there" else "2")


def test_values_are_written_as_they_are_read():
    value = {
        "a b": [1, 2.5, float("inf"), True], "text": 'ä "quoted" \\ \x7f', "day": datetime.date(2026, 1, 30), "in": {}
    }  # fmt: skip
    assert tomllib.loads(f"v = {toml(value)}")["v"] == value
    assert toml(np.array([[1.0, 2.0]])) == "[[1.0, 2.0]]"
    with pytest.raises(StudyError, match="expected a text, a number"):
        toml(object())
