"""Settings that say how a study states them: what is read, refused, explained and taken where a key is absent."""

import dataclasses
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Literal

import pytest

from inercal.faces.studies.tables import Stated, as_typed, settings_of, table_of
from inercal.foundation._toml import Strict, check
from inercal.foundation.errors import InputError, StudyError
from inercal.foundation.keys import (
    AS_TYPED,
    REQUIRED,
    TIME,
    Reading,
    keyed,
    keys_of,
    option,
    quantities,
    quantity,
    table,
    within,
)
from inercal.foundation.units import Quantity
from rows import for_each

ACUTE = within(0.0, 0.5 * math.pi, "an angle from 0 to 90 deg")


@dataclasses.dataclass(frozen=True)
class Search:
    """A search.

    What follows is for programmers.
    """

    time: float = quantity("most that it may take", "time", REQUIRED, example="9 min", bounds=TIME)
    angle: float = quantity("of a step", "angle", "30 deg", bounds=ACUTE, u="angle_u")
    angle_u: float = 0.0
    rates: tuple[float, ...] = quantities("to try", "rate", example=["1 deg/s"])
    heading: Quantity | None = quantity("of the base", "angle", example="0.0(1) deg")
    most: int = option("how many", 5, least=1, most=50, name="turns")
    criterion: Literal["mean", "worst"] = option("what is small", "mean")
    seen: Path | None = option("a file", None, example="a.csv")


class File(Strict):
    search: Stated[Search]


@dataclasses.dataclass(frozen=True)
class Wave:
    """A wave."""

    size: float = quantity("of it", "angle", REQUIRED, example="1 deg", uncertain=True, u="u")
    u: float = 0.0
    order: int = option("periods", 1, least=1)

    def __post_init__(self):
        """Refuse a wave that is none."""
        if self.size == 0.0:
            raise InputError("size", "found no size, expected one")


@dataclasses.dataclass(frozen=True)
class Course:
    """A test of some kind."""

    kind: Literal["sine", "file"] = option("how it moves", "sine")
    mean: float | None = quantity(
        "of a sine", "angle", "auto", example="1 deg", words={"auto": None}, kinds=("sine",)
    )
    path: str = option("of a file", "", kinds=("file",), needed=("file",))
    start: tuple[float, float] = quantity(
        "at the begin", "angle", (0.0, 0.0), example=["1 deg", "2 deg"], of="x, y", one=True, u="start_u"
    )
    start_u: tuple[float, float] = (0.0, 0.0)
    spans: tuple[tuple[float, float], ...] = quantity(
        "rests", "time", (), example=[["0 s", "1 s"]], of="a, b"
    )
    rates: Mapping[str, float] = quantity("by name", "frequency", {}, example={"gyro": "1 Hz"})
    outputs: tuple[Literal["x", "y"], ...] = option("which", ("x",), least=1)
    number: tuple[int, ...] = option("read", (), reads=Reading(lambda typed: 2 * typed, {"type": "integer"}))
    usual: Wave = table("the usual wave", Wave(0.5, 0.1, 3))
    waves: tuple[Wave, ...] = table("waves", ())
    other: Wave | None = table("another", None)


class CourseFile(Strict):
    test: Stated[Course]


def course(**keys):
    return check(CourseFile, {"test": keys}, "s.toml", StudyError).test


def test_tables_in_tables_are_settings_in_settings():
    """Absent keys of a table are those of the field's default; lists and optional ones are read by the same fields."""
    degree = math.radians(1.0)
    found = course(usual={"order": 5}, waves=[{"size": "1(1) deg"}, {"size": "2(1) deg", "order": 2}])
    assert found.usual == Wave(0.5, 0.1, 5)
    assert [wave.order for wave in found.waves] == [1, 2]
    assert (found.waves[1].size, found.waves[1].u) == pytest.approx((2.0 * degree, degree))
    assert (course().usual, course().waves, course().other) == (Wave(0.5, 0.1, 3), (), None)


def test_words_lists_of_so_many_names_and_readings():
    found = course(
        mean="auto", start="1.0(1) deg", spans=[["0 s", "2 s"]], rates={"gyro": "1 kHz"}, number=[2]
    )
    assert found.mean is None
    assert found.start == pytest.approx((math.radians(1.0),) * 2)
    assert found.start_u == pytest.approx((math.radians(0.1),) * 2)
    assert (found.spans, found.rates, found.number) == (((0.0, 2.0),), {"gyro": 1000.0}, (4,))
    assert course(outputs=["y", "x"]).outputs == ("y", "x")
    assert course(mean="2 deg").mean == pytest.approx(math.radians(2.0))


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({"mean": "none"}, "test.mean: found 'none', expected .* such as \"1 deg\", or auto"),
        (
            {"kind": "file", "path": "a", "mean": "1 deg"},
            "test.mean: found with kind = 'file', expected it with sine",
        ),
        ({"kind": "file"}, "test.path: missing, expected it with kind = 'file'"),
        ({"start": ["1 deg"]}, "test.start: found .* expected a list of 2, for x, y, or one for all"),
        ({"spans": [["1 s"]]}, "test.spans.0: found .* expected a list of 2, for a, b"),
        ({"outputs": []}, "test.outputs: found \\[\\], expected 1 or more in it"),
        ({"outputs": ["z"]}, "test.outputs.0: found 'z', expected 'x' or 'y'"),
        (
            {"waves": [{"size": "1 deg"}]},
            "test.waves.0.size: found '1 deg', expected it with its standard unc",
        ),
        ({"waves": [{"size": "0(1) deg"}]}, "test.waves.0.size: found no size, expected one"),
        ({"waves": [{"sice": "1(1) deg"}]}, "test.waves.0.sice: unknown key, did you mean size"),
        ({"usual": {"order": 0}}, "test.usual.order: found 0, .* greater than or equal to 1"),
        ({"rates": {"gyro": "1 s"}}, "test.rates.gyro: found '1 s'"),
    ],
)
def test_what_is_wrong_in_a_nested_table_is_named_by_its_key(keys, words):
    with pytest.raises(StudyError, match=words):
        course(**keys)


def read(**keys):
    return check(File, {"search": keys}, "s.toml", StudyError).search


def test_settings_are_in_si_and_absent_keys_are_their_defaults():
    found = read(time="9 min")
    assert found == Search(time=540.0)
    assert found.angle == pytest.approx(math.radians(30.0))
    assert found.rates == ()


def test_an_uncertainty_goes_to_its_own_field_or_stays_with_the_quantity():
    found = read(
        time="1 s", angle="40(1) deg", heading="0.0(1) deg", rates=["180 deg/s"], turns=3, seen="b.csv"
    )
    assert (found.angle, found.angle_u) == pytest.approx((math.radians(40.0), math.radians(1.0)))
    assert found.heading.u == pytest.approx(math.radians(0.1))
    assert found.rates == pytest.approx((math.pi,))
    assert (found.most, found.seen) == (3, Path("b.csv"))


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        ({}, "search.time: missing"),
        ({"time": "0 s"}, "search.time: found '0 s', expected a time above zero"),
        ({"time": "1 m"}, "search.time: found '1 m', which is of length, .* such as \"9 min\""),
        ({"time": "1 s", "angle": "91 deg"}, "search.angle: .* expected an angle from 0 to 90 deg"),
        ({"time": "1 s", "angel": "1 deg"}, "search.angel: unknown key, did you mean angle"),
        ({"time": "1 s", "most": 5}, "search.most: unknown key"),
        ({"time": "1 s", "turns": 51}, "search.turns: found 51, .* less than or equal to 50"),
        ({"time": "1 s", "turns": True}, "search.turns: found True, expected a whole number"),
        ({"time": "1 s", "criterion": "best"}, "search.criterion: found 'best', expected 'mean' or 'worst'"),
        ({"time": "1 s", "rates": []}, "search.rates: found \\[\\], expected 1 or more in it"),
        ({"time": "1 s", "seen": ""}, "search.seen: found '', expected a text that is not empty"),
    ],
)
def test_one_sentence_for_what_is_wrong(keys, words):
    with pytest.raises(StudyError, match=words):
        read(**keys)


def test_the_schema_has_what_the_field_says():
    """Unit and default as people write them, not in SI."""
    schema = table_of(Search).model_json_schema()
    assert schema["description"] == "A search."
    angle = schema["properties"]["angle"]
    assert (angle["default"], angle["description"]) == ("30 deg", "of a step")
    assert schema["required"] == ["time"]
    assert "angle_u" not in schema["properties"]
    assert [key.name or field.name for field, key in keys_of(Search)] == list(schema["properties"])


def test_a_table_with_more_keys_fills_fields_of_its_own():
    class SearchTable(table_of(Search)):
        label: str = ""

    table = SearchTable(time="1 s", label="x")
    assert settings_of(Search, table, angle_u=0.5) == Search(time=1.0, angle_u=0.5)


def test_what_is_given_is_kept_as_typed():
    import datetime

    assert as_typed({"a": {"date": datetime.date(2026, 1, 31)}, "b": [1, "2 m"]}) == {
        "a": {"date": "2026-01-31"},
        "b": [1, "2 m"],
    }


class Names(
    keyed(
        "ByName", {name: (float | None, quantity("of it", "angle", example="1 deg")) for name in ("a", "b")}
    )
):
    """A table whose keys are names of another one."""


@dataclasses.dataclass(frozen=True)
class Rig:
    """A rig."""

    by_name: Names = table("names", Names())
    error: Wave | None = table("an error", None, example={"size": "1(1) deg"}, words={"none": "none"})
    rows: tuple[tuple[float, ...], ...] = quantity("angles", "angle", (), example=[["1 deg"]], least=1)
    value: object = option("of a term", None, reads=AS_TYPED)
    terms: tuple[str, ...] | None = option("names", None, least=1)
    note: str = option("a text", "", most=3)


class RigFile(Strict):
    rig: Stated[Rig]


def rig(**keys):
    return check(RigFile, {"rig": keys}, "s.toml", StudyError).rig


def test_tables_by_names_words_in_their_place_and_rows_of_any_length():
    found = rig(
        by_name={"b": "180 deg"}, error="none", rows=[["0 deg"], ["0 deg", "180 deg"]], value="2 deg/h/g"
    )
    assert (found.by_name.a, found.by_name.b) == (None, math.pi)
    assert found.rows == ((0.0,), (0.0, math.pi))
    assert (found.error, found.value) == ("none", "2 deg/h/g")
    assert rig(error={"size": "180(1) deg"}).error.size == math.pi
    assert (rig().error, rig().terms, rig(terms=["x"]).terms) == (None, None, ("x",))


@for_each(
    "keys, message",
    [
        ({"by_name": {"c": "1 deg"}}, "rig.by_name.c: unknown key, "),
        (
            {"error": "some"},
            'rig.error: found \'some\', expected "none" or a table such as { size = "1(1) deg" }',
        ),
        ({"rows": []}, "rig.rows: found [], expected 1 or more in it"),
        ({"rows": [["x"]]}, "rig.rows.0.0: found 'x', expected a quantity with a unit of angle"),
        ({"value": ["1 deg"]}, "rig.value: found ['1 deg'], expected a quantity with its unit"),
        ({"terms": []}, "rig.terms: found [], expected 1 or more in it"),
        ({"terms": "x"}, "rig.terms: found 'x', expected a list in brackets"),
        ({"note": "long"}, "rig.note: found 'long'"),
    ],
)
def test_one_sentence_for_what_such_keys_are_not(keys, message):
    with pytest.raises(StudyError) as caught:
        rig(**keys)
    assert message in str(caught.value)
