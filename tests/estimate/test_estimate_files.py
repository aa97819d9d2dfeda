"""Estimates as files: the keys of the contract, round trips, junk, and nothing lost when writing fails."""

import errno
import json
import math
import os
import tomllib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inercal.foundation.errors import InputError
from inercal.foundation.findings import CODES, Finding, Harm, Status
from inercal.foundation.inputs import Source
from inercal.foundation.results.budget import BudgetItem
from inercal.foundation.results.files import from_json, load, plain_objects, save, to_json
from inercal.foundation.results.result import Estimate
from rows import for_each


def example(**more):
    fields = {
        "command": "calibrate imu",
        "names": ("K0_x", "K1_x"),
        "units": ("m/s^2", "1"),
        "values": np.array([1e-3, 1.0]),
        "covariance": np.array([[4e-8, 1e-9], [1e-9, 9e-8]]),
        "dof": np.array([12.0, np.inf]),
        "status": Status.OK,
        "message": "fine",
        "findings": (Finding("gap", "t: 1 gap", "rows 5-6"),),
        "statistics": {"dof": 12.0, "condition": np.float64(3.0), "nis_mean": math.nan},
        "budget": (BudgetItem("gravity", "B", 1e-5, "m/s^2", {"K1_x": 0.31}),),
        "model": "y = S M x + b",
        "conditions": {"temperature": None, "ranges": {"gyro": [np.zeros(2), np.int64(3)]}},
        "traceability": {"operator": ""},
        "inputs": (Source("a.csv", "00ff"),),
        "timing": {"read": 0.1, "solve": 0.2, "total": 0.3},
        "result": {"intervals": [{"start_s": 0.0, "samples": 5}], "none": None, "flag": np.bool_(True)},
    }
    return Estimate(**(fields | more))


# Strategies.

numbers = st.floats(allow_nan=True, allow_infinity=True)
finite = st.floats(allow_nan=False, allow_infinity=False)
plain_values = st.recursive(
    st.none() | st.booleans() | st.integers(-(2**63), 2**63 - 1) | finite | st.text(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.text(), inner, max_size=3),
    max_leaves=8,
)
tables = st.dictionaries(st.text(), plain_values, max_size=3)


def harmless():
    """Findings of any code that may do no harm, and do none."""
    codes = sorted(code for code, each in CODES.items() if each.harm is not Harm.ALWAYS)
    return st.builds(Finding, st.sampled_from(codes), st.text(), st.text(), st.just(()))


@st.composite
def estimates(draw):
    names = draw(st.lists(st.text(), max_size=3, unique=True))
    p = len(names)

    def array(elements, *shape):
        size = math.prod(shape)
        return np.array(draw(st.lists(elements, min_size=size, max_size=size)), dtype=float).reshape(shape)

    root = array(st.floats(-1e3, 1e3), p, p)
    return Estimate(
        command=draw(st.text()),
        names=tuple(names),
        units=tuple(draw(st.lists(st.text(), min_size=p, max_size=p))),
        values=array(finite | st.just(math.nan), p),
        covariance=root @ root.T,
        dof=array(st.floats(1e-3, allow_nan=False), p),
        status=draw(st.sampled_from(Status)),
        message=draw(st.text()),
        findings=tuple(draw(st.lists(harmless(), max_size=2))),
        statistics=draw(st.dictionaries(st.text(), finite | st.just(math.nan), max_size=3)),
        budget=tuple(
            draw(
                st.lists(
                    st.builds(
                        BudgetItem,
                        st.text(),
                        st.sampled_from("AB"),
                        finite | st.just(math.nan),
                        st.text(),
                        st.dictionaries(st.text(), finite, max_size=2),
                    ),
                    max_size=2,
                )
            )
        ),
        model=draw(st.text()),
        conditions=draw(tables),
        traceability=draw(st.dictionaries(st.text(), st.text(), max_size=2)),
        inputs=tuple(draw(st.lists(st.builds(Source, st.text(), st.text()), max_size=2))),
        provenance=draw(tables),
        timing=draw(st.dictionaries(st.text(), finite, max_size=3)),
        result=draw(tables),
        references=tuple(draw(st.lists(st.text(), max_size=2))),
    )


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("exchange")


# The contract.


def test_keys_of_the_contract():
    """interfaces.md, "JSON result": these keys, in this order; more may follow."""
    data = to_json(example())
    contract = [
        "inercal", "command", "status", "parameters", "covariance", "findings", "statistics", "budget",
        "model", "conditions", "traceability", "inputs", "timing_s",
    ]  # fmt: skip
    assert list(data)[: len(contract)] == contract
    assert list(data)[-1] == "result"
    assert list(data["status"]) == ["code", "message"]
    assert [list(p) for p in data["parameters"]] == [
        ["name", "value", "u", "U", "k", "dof", "unit", "coverage_probability", "long_name", "unit_dsi"]
    ] * 2
    assert list(data["covariance"]) == ["names", "matrix"]
    assert list(data["findings"][0]) == [
        "code", "headline", "action", "items", "message", "where", "harm",
    ]  # fmt: skip
    assert list(data["budget"][0]) == ["source", "type", "u", "unit", "share"]
    assert list(data["inputs"][0]) == ["path", "sha256"]


def test_values_of_the_contract():
    data = to_json(example())
    assert data["status"] == {"code": "ok", "message": "fine"}
    first, second = data["parameters"]
    assert first["u"] == pytest.approx(2e-4)
    assert first["U"] == pytest.approx(first["k"] * first["u"])
    assert (first["dof"], second["dof"]) == (12.0, None)
    assert data["covariance"] == {"names": ["K0_x", "K1_x"], "matrix": [[4e-8, 1e-9], [1e-9, 9e-8]]}
    assert data["statistics"] == {"dof": 12.0, "condition": 3.0, "nis_mean": None}
    assert data["conditions"]["ranges"] == {"gyro": [[0.0, 0.0], 3]}
    assert data["result"]["flag"] is True


@settings(max_examples=50, deadline=None)
@given(estimates())
def test_json_is_strict(estimate):
    """No NaN or Infinity, which JSON does not know, and nothing that UTF-8 cannot hold."""
    text = json.dumps(to_json(estimate), allow_nan=False, ensure_ascii=False)
    assert json.loads(text.encode("utf-8")) == to_json(estimate)


def test_names_of_files_in_no_encoding():
    """A path that came from the file system as undecodable bytes can be printed and saved."""
    path = os.fsdecode(b"run\xff.csv")
    data = to_json(example(inputs=(Source(path, ""),), provenance={path: path}))
    text = json.dumps(data, ensure_ascii=False).encode("utf-8").decode("utf-8")
    assert json.loads(text)["inputs"][0]["path"].startswith("run")


def test_plain_objects():
    given = {"a": np.arange(3), 1: (np.float64("inf"), [np.nan, {"b": np.bool_(False)}]), "c": "é"}
    assert plain_objects(given) == {"a": [0, 1, 2], "1": [None, [None, {"b": False}]], "c": "é"}


# Round trips.


@settings(max_examples=80, deadline=None)
@given(estimates())
@pytest.mark.parametrize("suffix", [".json", ".toml"])
def test_what_is_saved_is_what_is_loaded(folder, suffix, estimate):
    path = folder / f"round{suffix}"
    save(estimate, path)
    back = load(path)
    assert to_json(back) == to_json(estimate)
    for name in ("values", "covariance", "dof", "k"):
        np.testing.assert_array_equal(getattr(back, name), getattr(estimate, name))
    for name in (
        "command",
        "names",
        "units",
        "status",
        "message",
        "findings",
        "model",
        "inputs",
        "references",
    ):
        assert getattr(back, name) == getattr(estimate, name)


@pytest.mark.parametrize("suffix", [".json", ".toml"])
def test_infinite_and_unknown_come_back_as_such(tmp_path, suffix):
    """Infinite degrees of freedom stay infinite, an unknown statistic NaN, and nothing in a result None."""
    path = tmp_path / f"a{suffix}"
    save(example(), path)
    back = load(path)
    assert back.dof.tolist() == [12.0, math.inf]
    assert math.isnan(back.statistics["nis_mean"])
    assert back.result["none"] is None
    assert back.conditions["temperature"] is None


@pytest.mark.parametrize("suffix", [".json", ".toml", ".JSON"])
def test_an_estimate_that_knows_nothing(tmp_path, suffix):
    """No convergence: NaN values and infinite variances come back as not known."""
    path = tmp_path / f"nothing{suffix}"
    unknown = example(
        values=np.full(2, np.nan), covariance=np.full((2, 2), np.inf), status=Status.NOT_CONVERGED,
        budget=(BudgetItem("noise", "A", math.inf, "m/s^2", {}),),
    )  # fmt: skip
    save(unknown, path)
    back = load(path)
    assert back.status is Status.NOT_CONVERGED
    assert np.all(np.isnan(back.values))
    assert np.all(np.isnan(back.covariance))
    assert math.isnan(back.budget[0].u)


@given(estimates())
@settings(max_examples=30, deadline=None)
def test_other_programs_can_read_the_toml(folder, estimate):
    """Plain TOML, with nan where JSON has null."""
    path = folder / "other.toml"
    save(estimate, path)
    assert plain_objects(tomllib.loads(path.read_text(encoding="utf-8"))) == to_json(estimate)


def test_keys_of_a_newer_version_are_passed_over(tmp_path):
    data = to_json(example())
    data["new"] = {"x": 1}
    data["parameters"][0]["new"] = 5
    path = tmp_path / "new.json"
    path.write_text(json.dumps(data))
    assert load(path).names == ("K0_x", "K1_x")


def test_optional_keys_may_be_missing(tmp_path):
    """What an estimate is: command, status, parameters, covariance."""
    data = {key: to_json(example())[key] for key in ("command", "status", "parameters", "covariance")}
    path = tmp_path / "least.json"
    path.write_text(json.dumps(data))
    back = load(path)
    np.testing.assert_array_equal(back.values, example().values)
    assert (back.findings, back.budget, back.model) == ((), (), "")


# Junk.


def refused(path):
    """The one sentence with which a file is refused."""
    with pytest.raises(InputError) as caught:
        load(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: ")
    assert "\n" not in message
    assert "expected a calibration written by inercal (.json or .toml)" in message
    return message


def test_a_file_of_another_tool_is_told_where_to_go(tmp_path):
    path = tmp_path / "imucal.json"
    path.write_text('{"K_a": [[1, 0, 0], [0, 1, 0], [0, 0, 1]], "cal_type": "Ferraris"}')
    assert "inercal convert --from" in refused(path)


FOREIGN = [
    b"", b" ", b"null", b"5", b'"text"', b"[]", b"{}", b"[[[[", b"{" * 100_000, b"[" * 100_000, b"\xff\xfe\x00",
    b"\x00" * 50, b'{"parameters": []}', b'{"parameters": 5, "covariance": 5}', b"nan", b"t [s],acc_x [g]\n0,1\n",
    b"[site]\nlatitude = '40 deg'\n", b"parameters = []\n", b'{"name": "project", "version": "1.0.0"}',
    b"\xef\xbb\xbf{}", b"1" * 5000, b'{"a": ' + b"1" * 5000 + b"}", b"\x89PNG\r\n\x1a\n", b"a.b.c = 1",
]  # fmt: skip


@for_each("suffix", [".json", ".toml", ".txt", ""])
@for_each("content", FOREIGN)
def test_foreign_files(tmp_path, content, suffix):
    path = tmp_path / f"foreign{suffix}"
    path.write_bytes(content)
    refused(path)


def test_a_recording_in_the_place_of_a_result_is_told_from_a_damaged_one(tmp_path):
    (tmp_path / "log.csv").write_text("t [s],acc_x [g]\n0,1\n")
    assert "log.csv: not valid JSON: " in refused(tmp_path / "log.csv")


def test_files_that_are_not_there(tmp_path):
    assert "No such file" in refused(tmp_path / "none.json")
    assert "directory" in refused(tmp_path)
    with pytest.raises(InputError, match="null byte"):
        load("a\0b.json")


def damaged(path, **changes):
    """The reason for which a file with other values at those keys is refused."""
    data = to_json(example()) | changes
    path.write_text(json.dumps(data), encoding="utf-8")
    return refused(path)


def test_what_was_wrong_is_said(tmp_path):
    path = tmp_path / "wrong.json"
    for text in ("null", "[]", "5", '"text"'):
        path.write_text(text)
        assert f"holds {text!r}, " in refused(path)
    for other in (None, 5, [None]):
        assert "does not have the form of one" in damaged(path, parameters=other)
    data = to_json(example())
    first, second = data["parameters"]
    assert "the key 'name' is missing" in damaged(path, parameters=[{}])
    assert "'value' is missing" in damaged(path, parameters=[{"name": "K0_x", "unit": "1"}, second])
    assert "'sound' is not a valid Status" in damaged(path, status={"code": "sound", "message": ""})
    assert "unknown finding code 'comet'" in damaged(
        path, findings=[{"code": "comet", "message": "", "where": ""}]
    )
    for wrong in ({}, {"message": "", "items": ["gap"]}, {"message": "", "items": 5}):
        assert str(path) in damaged(path, findings=[{"code": "gap", "where": ""} | wrong])
    assert "covariance does not belong" in damaged(path, parameters=[second, first])
    assert "reshape" in damaged(path, covariance={"names": ["K0_x", "K1_x"], "matrix": [[1.0]]})
    assert "too large" in damaged(path, parameters=[first | {"value": 10**400}, second])


def spots(value, path=()):
    """Paths to every value inside nested lists and dicts."""
    yield path
    for key, inner in (
        value.items() if isinstance(value, dict) else enumerate(value if isinstance(value, list) else ())
    ):
        yield from spots(inner, (*path, key))


SPOTS = [path for path in spots(to_json(example())) if path]
JUNK = [None, True, -1, 10**400, 1e308, "", "x", [], [None], [[]], {}, {"code": []}, [1, "a"], [{"a": 1}]]


def loads_or_refuses(path):
    """An estimate or a sentence: nothing else may come of any file."""
    try:
        said = type(load(path)).__name__
    except InputError as error:
        said = str(error)
    assert "\n" not in said


@settings(max_examples=300, deadline=None)
@given(st.sampled_from(SPOTS), st.sampled_from(JUNK), st.booleans())
def test_files_with_another_value_somewhere(folder, spot, junk, remove):
    data = to_json(example())
    place = data
    for key in spot[:-1]:
        place = place[key]
    if remove:
        del place[spot[-1]]
    else:
        place[spot[-1]] = junk
    path = folder / "mutant.json"
    path.write_text(json.dumps(data), encoding="utf-8")
    loads_or_refuses(path)


@settings(max_examples=80, deadline=None)
@given(st.data())
@pytest.mark.parametrize("suffix", [".json", ".toml"])
def test_files_with_other_bytes_somewhere(folder, suffix, data):
    path = folder / f"bytes{suffix}"
    save(example(), path)
    content = bytearray(path.read_bytes())
    at = data.draw(st.integers(0, len(content)))
    content[at : at + data.draw(st.integers(0, 3))] = data.draw(st.binary(max_size=3))
    path.write_bytes(content)
    loads_or_refuses(path)


@pytest.mark.parametrize("suffix", [".json", ".toml"])
def test_truncated_files(tmp_path, suffix):
    """Cut anywhere, a JSON file is refused; TOML may still hold all that is needed."""
    path = tmp_path / f"cut{suffix}"
    save(example(), path)
    content = path.read_bytes()
    for length in range(0, len(content) - 2, 7):
        path.write_bytes(content[:length])
        if suffix == ".json":
            refused(path)
        else:
            loads_or_refuses(path)


def test_from_json_names_the_missing_key():
    with pytest.raises(KeyError, match="covariance"):
        from_json({"parameters": []})


# Writing.


@pytest.mark.parametrize("name", ["a.yaml", "a", "a.json.bak", ".json"])
def test_other_suffixes_are_refused_before_anything_is_written(tmp_path, name):
    with pytest.raises(InputError, match=r"expected \.json or \.toml"):
        save(example(), tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("call", ["fsync", "replace"])
@pytest.mark.parametrize("suffix", [".json", ".toml"])
def test_a_failed_write_leaves_the_old_calibration(tmp_path, monkeypatch, suffix, call):
    path = tmp_path / f"cal{suffix}"
    save(example(message="old"), path)

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    with monkeypatch.context() as patch:
        patch.setattr(os, call, full)
        with pytest.raises(InputError, match="No space left"):
            save(example(message="new"), path)
    assert load(path).message == "old"
    assert list(tmp_path.iterdir()) == [path]
    save(example(message="new"), path)
    assert load(path).message == "new"


def test_folders_that_cannot_be_written(tmp_path):
    (tmp_path / "file").write_text("")
    for path in (tmp_path / "none" / "cal.json", tmp_path / "file" / "cal.json"):
        with pytest.raises(InputError, match="cannot be written"):
            save(example(), path)
