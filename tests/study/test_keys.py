"""Settings that say how a study states them: what is read, refused, explained and taken where a key is absent."""

import dataclasses
import math
from pathlib import Path
from typing import Literal

import pytest

from inercal.faces.studies.tables import Stated, as_typed, settings_of, table_of
from inercal.foundation._toml import Strict, check
from inercal.foundation.errors import StudyError
from inercal.foundation.keys import REQUIRED, TIME, keys_of, option, quantities, quantity, within
from inercal.foundation.units import Quantity

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
    table = table_of(Search).model_json_schema()
    assert table["description"] == "A search."
    angle = table["properties"]["angle"]
    assert (angle["default"], angle["description"]) == ("30 deg", "of a step")
    assert table["required"] == ["time"]
    assert "angle_u" not in table["properties"]
    assert [key.name or field.name for field, key in keys_of(Search)] == list(table["properties"])


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
