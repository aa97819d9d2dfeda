"""The table of sections: written and read again, and what is said of a wrong cell."""

import numpy as np
import pytest

from inercal.foundation.errors import StudyError
from inercal.foundation.units import parse_quantity
from inercal.systems.imu.sections.cutting.table import (
    COLUMNS,
    SectionRow,
    of_tables,
    quantity_of,
    read_table,
    table_text,
    write_table,
)
from rows import for_each

TEXT = """section,file,begin,end,kind,up,axis,rate,angle,setup,why
x_up,x_up.csv,,,rest,+x,,,,,name
z-360,z-360.txt,,,turn,,+z,,-360.000(3) deg,,name
x 30,X_30dps.csv,,,rate,+x,+x,30.000(3) deg/s,,x,name
rest 7,log.csv,25.82 s,33.61 s,rest,,,,,,"detected, 11 deg off +y"
"rate 3",log.csv,71 s,83.4 s,rate,,,,,,"plateau, about 25 deg/s about z: which rate?"
"""


def test_the_table_that_people_see(tmp_path):
    """Read, written and read again, it is the same text."""
    path = tmp_path / "sections.csv"
    path.write_text(TEXT, encoding="utf-8")
    rows = read_table(path)
    assert [row.kind for row in rows] == ["rest", "turn", "rate", "rest", "rate"]
    assert rows[1].angle.value == pytest.approx(-2.0 * np.pi)
    assert rows[1].angle.u == pytest.approx(np.radians(0.003))
    assert rows[2].rate.value == pytest.approx(np.radians(30.0))
    assert (rows[3].begin, rows[3].end) == (25.82, 33.61)
    assert rows[3].up is None
    write_table(rows, path)
    assert path.read_text(encoding="utf-8") == TEXT.replace('"rate 3"', "rate 3")


def test_every_cell_comes_back(tmp_path):
    row = SectionRow(
        "tilted", "log.csv", 1.25, 7.5, "rate", np.array([0.6, 0.0, 0.8]), np.array([0.1, -0.2, 9.7]),
        np.array([0.0, -1.0, 0.0]), parse_quantity("0.5(2) rad/s", "rate", "r"), None, 0.005, 0.001,
        np.array([0.0, 0.6, -0.8]), 0.02, "a", "day 1", "table", "log", 298.15, "row, with a comma",
    )  # fmt: skip
    path = tmp_path / "sections.csv"
    write_table([row], path)
    (again,) = read_table(path)
    for name in COLUMNS:
        one, other = getattr(row, name), getattr(again, name)
        if name == "rate":
            assert other == one
        elif isinstance(one, np.ndarray | float):
            np.testing.assert_allclose(other, one, rtol=1e-8)
        else:
            assert other == one


def test_tables_of_a_study_say_the_same():
    (row,) = of_tables(
        [{"section": "x 30", "kind": "rate", "axis": [0, 0, 2], "rate": "30 deg/s", "up": "-z"}]
    )
    assert row.axis.tolist() == [0.0, 0.0, 1.0]
    assert row.up.tolist() == [0.0, 0.0, -1.0]
    (row,) = of_tables([{"section": "shaker", "force": "ref_x ref_y ref_z"}])
    assert row.force == ("ref_x", "ref_y", "ref_z")


@for_each(
    "column, cell, said",
    [
        ("kind", "stand", "found 'stand', expected one of rest, rate, turn, move, swing"),
        ("up", "w", "found 'w', expected an axis such as +x or -z, or three numbers"),
        ("up", "0 0 0", "expected an axis such as +x or -z, or three numbers"),
        ("up", "nan 0 1", "expected an axis such as +x or -z, or three numbers"),
        ("begin", "7", "without a unit"),
        ("rate", "30 deg", "is of angle"),
        ("rate", "30 deg/s", "for a section of kind rest, expected kind rate"),
        ("force", "1 2 g", "expected a force such as 0 0 9.81 m/s^2, or three channels"),
        ("level", "-1 deg", "found a negative uncertainty"),
        ("north", "up", "expected an axis such as +x or -z, or three numbers"),
    ],
)
def test_a_wrong_cell_is_named_with_file_line_and_column(tmp_path, column, cell, said):
    path = tmp_path / "sections.csv"
    path.write_text(f"section,{column}\ngood,\n\nbad,{cell}\n", encoding="utf-8")
    with pytest.raises(StudyError) as error:
        read_table(path)
    assert error.value.where == f"{path}, line 4, column {column}"
    assert said in error.value.message


@for_each(
    "text, said",
    [
        ("", "found no column 'section'"),
        ("file\na", "found no column 'section'"),
        ("section,ups\na,", "found the column 'ups'"),
        ("section,up,up\na,,", "found the column 'up' a second time"),
        ("section,up\na\n", "found 1 cells, expected 2"),
        ("section,up\na,\na,\n", "found the section 'a' again"),
        ("section,up\n,+x\n", "found no name of the section"),
        ("section,begin,end\na,3 s,2 s\n", "found 2 s, expected an end after its begin, 3 s"),
    ],
)
def test_a_wrong_table_is_one_sentence(tmp_path, text, said):
    path = tmp_path / "sections.csv"
    path.write_text(text, encoding="utf-8")
    with pytest.raises(StudyError, match=r".") as error:
        read_table(path)
    assert said in str(error.value)
    assert str(path) in str(error.value)


def test_nothing_is_known_where_nothing_is_written():
    assert table_text([SectionRow("a")]).splitlines()[1] == "a,,,,rest,,,,,,"


@for_each(
    "value, u, unit, text",
    [
        (-2.0 * np.pi, np.radians(0.003), "deg", "-360.000(3) deg"),
        (np.radians(30.0), np.radians(0.3), "deg/s", "30.0(3) deg/s"),
        (np.radians(30.0), np.radians(0.25), "deg/s", "30.00(25) deg/s"),
        (np.radians(360.0), np.radians(12.0), "deg", "360(12) deg"),
        (np.radians(90.0), 0.0, "deg", "90 deg"),
    ],
)
def test_a_quantity_is_written_with_its_uncertainty(value, u, unit, text):
    quantity = quantity_of(value, u, unit)
    again = parse_quantity(text, "rate" if "/" in unit else "angle", "x")
    assert quantity.text == text
    assert (again.value, again.u) == (pytest.approx(value), pytest.approx(u))
