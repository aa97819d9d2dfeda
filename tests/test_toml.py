"""TOML in, and one sentence for whatever is wrong with it."""

from typing import Annotated, Literal

import pytest
from pydantic import BeforeValidator, Field, StrictBool, StrictInt
from pydantic_core import PydanticCustomError

from inercal.foundation._toml import Strict, check, read_toml
from inercal.foundation.errors import InputError, MapError, StudyError
from rows import for_each


class Leaf(Strict):
    kind: Literal["a", "b"]
    on: StrictBool = False
    note: str = ""
    size: int = Field(default=1, gt=0, alias="length")
    count: StrictInt = 1
    many: list[str] = Field(default=["a"], min_length=1)


class Tree(Strict):
    leaf: Leaf | None = None
    leaves: dict[str, Leaf] = Field(default_factory=dict)


@for_each(
    ("data", "message"),
    [
        ({"leef": {}}, "f.toml: leef: unknown key, did you mean leaf?"),
        ({"zzz": 1}, "f.toml: zzz: unknown key, known keys: leaf, leaves"),
        ({"leaf": {"kin": "a"}}, "f.toml: leaf.kin: unknown key, did you mean kind?"),
        ({"leaf": {"kind": "a", "lenght": 2}}, "f.toml: leaf.lenght: unknown key, did you mean length?"),
        ({"leaves": {"x": {"kind": "a", "nte": 1}}}, "f.toml: leaves.x.nte: unknown key, did you mean note?"),
        ({"leaf": {}}, "f.toml: leaf.kind: missing, expected a value"),
        ({"leaf": {"kind": "c"}}, "f.toml: leaf.kind: found 'c', expected 'a' or 'b'"),
        ({"leaf": 5}, "f.toml: leaf: found 5, expected a table"),
        ({"leaves": []}, "f.toml: leaves: found [], expected a table"),
        ({"leaf": {"kind": "a", "on": "yes"}}, "f.toml: leaf.on: found 'yes', expected true or false"),
        ({"leaf": {"kind": "a", "note": 5}}, "f.toml: leaf.note: found 5, expected a text in quotes"),
        ({"leaf": {"kind": "a", "length": 0}}, "f.toml: leaf.length: found 0, expected greater than 0"),
        ({"leaf": {"kind": "a", "count": 1.5}}, "f.toml: leaf.count: found 1.5, expected a whole number"),
        ({"leaf": {"kind": "a", "many": "b"}}, "f.toml: leaf.many: found 'b', expected a list in brackets"),
        ({"leaf": {"kind": "a", "many": []}}, "f.toml: leaf.many: found [], expected 1 or more in it"),
        ({"a\nb": 1}, r"f.toml: 'a\nb': unknown key, known keys: leaf, leaves"),
    ],
)
def test_one_sentence_names_file_key_found_and_expected(data, message):
    with pytest.raises(StudyError) as caught:
        check(Tree, data, "f.toml", StudyError)
    assert str(caught.value) == message


def test_good_data_becomes_the_model():
    assert check(Tree, {"leaf": {"kind": "a"}}, "f.toml", StudyError).leaf == Leaf(kind="a")


def test_an_input_error_in_a_validator_is_reported_after_its_key():
    def refuse(value):
        raise PydanticCustomError("refused", "refused", {"error": InputError("x", "found it, expected else")})

    class Picky(Strict):
        key: Annotated[str, BeforeValidator(refuse)]

    with pytest.raises(MapError, match=r"^m.toml: key.x: found it, expected else$"):
        check(Picky, {"key": "a"}, "m.toml", MapError)


def test_values_without_end_are_not_printed():
    deep = {}
    for _ in range(100_000):
        deep = {"a": deep}
    with pytest.raises(StudyError, match="found a dict too large to print, expected 'a' or 'b'"):
        check(Tree, {"leaf": {"kind": deep}}, "f.toml", StudyError)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"a = ", r"not valid TOML: Invalid value \(at .*\)"),
        (b"\xff\xfe", "byte 0 is not UTF-8 text"),
        (b"a = " + b"9" * 5000, "not valid TOML: Exceeds the limit"),
        (b"a = " + b"[" * 5000, "nested too deeply"),
    ],
)
def test_what_is_no_toml(tmp_path, content, message):
    path = tmp_path / "f.toml"
    path.write_bytes(content)
    with pytest.raises(MapError, match=message) as caught:
        read_toml(path, MapError)
    assert caught.value.where == str(path)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ("[a]\nb = 1\nc = 2\nb = 3\n", "line 4: b is given a second time, expected it once"),
        ("[a]\nb = 1\n'b' = 3", "line 3: 'b' is given a second time, expected it once"),
        ("b = 1\nb = [\n1]\n", "line 3: a key is given a second time, expected it once"),
        ("a = { b = 1, b = 2 }", "not valid TOML: Duplicate inline table key 'b'"),
        ("[a]\n[a]\n", "not valid TOML: Cannot declare"),
    ],
)
def test_what_is_given_twice(tmp_path, content, message):
    path = tmp_path / "f.toml"
    path.write_text(content)
    with pytest.raises(StudyError) as caught:
        read_toml(path, StudyError)
    assert caught.value.message.startswith(message)


def test_files_that_cannot_be_read(tmp_path):
    for path in (tmp_path / "absent.toml", tmp_path, "nul\0.toml"):
        with pytest.raises(StudyError):
            read_toml(path, StudyError)


def test_a_byte_order_mark_is_no_key(tmp_path):
    path = tmp_path / "f.toml"
    path.write_bytes(b"\xef\xbb\xbfa = 1")
    assert read_toml(path, StudyError) == {"a": 1}
