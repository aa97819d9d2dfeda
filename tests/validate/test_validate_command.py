"""``inercal validate``: a line for each case, the record and the page to file, and what a failure says."""

import json
import re
import tomllib

import numpy as np
import pytest

from inercal.cli import run as inercal
from inercal.faces.validate import run
from inercal.faces.validate.foundation import CASES
from inercal.foundation._jit import source_hash
from inercal.foundation.computing.executors import Serial
from inercal.foundation.geometry import earth


@pytest.fixture(autouse=True)
def only_the_foundation(monkeypatch):
    """One system, in this process: the whole is run by the test of the cases."""
    monkeypatch.setattr(run, "SYSTEMS", {"foundation": run.SYSTEMS["foundation"]})
    monkeypatch.setattr(run, "executor", Serial)


def test_a_line_for_each_case(capsys):
    assert inercal(["validate", "--quiet"]) == 0
    captured = capsys.readouterr()
    assert captured.err == ""
    lines = captured.out.splitlines()
    assert [line.split()[:2] for line in lines if line.startswith("pass")] == [
        ["pass", case.name] for case in CASES
    ]
    assert lines[-1] == f"ok: all {len(CASES)} cases passed"
    assert max(map(len, lines)) <= 80
    gravity = next(line for line in lines if "wgs84-gravity" in line)
    assert re.fullmatch(r"pass wgs84-gravity +9\.8061977\d\d +9\.806197770 ± 5e-09 m/s\^2 +WGS 84", gravity)


def test_the_record(tmp_path, capsys):
    files = [tmp_path / name for name in ("record.json", "record.toml")]
    assert inercal(["validate", "--quiet", "--json", "--out", str(files[0])]) == 0
    data = json.loads(capsys.readouterr().out, parse_constant=lambda text: pytest.fail(f"{text} is not JSON"))
    assert inercal(["validate", "--quiet", "--out", str(files[1])]) == 0
    for whole in (data, json.loads(files[0].read_text("utf-8")), tomllib.loads(files[1].read_text("utf-8"))):
        assert whole["command"] == "validate"
        assert whole["status"]["code"] == "ok"
        assert whole["parameters"] == []
        rows = whole["result"]["cases"]
        assert [row["name"] for row in rows] == [case.name for case in CASES]
        for row, case in zip(rows, CASES, strict=True):
            assert row["passed"] is True
            assert abs(row["figure"] - row["expected"]) <= row["limit"]
            assert row["expected"] in np.asarray(case.expected, dtype=float)
            assert row["numbers"] == np.size(case.expected)
            assert (row["system"], row["source"]) == ("foundation", case.source)
            assert case.source in whole["result"]["sources"]
        made = whole["provenance"]
        assert made["versions"].keys() == {"inercal", "python", "numpy", "scipy", "kernels"}
        assert made["versions"]["numpy"] == np.__version__
        assert made["sources_sha256"] == source_hash()
        assert re.fullmatch(r"\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d\+00:00", whole["traceability"]["date"])
        assert all(len(source["sha256"]) == 64 for source in whole["inputs"])
        assert all(
            source["path"].startswith("examples/") for source in whole["inputs"]
        )  # not where inercal lies
        assert set(whole["timing_s"]) == {"solve", "total"}


def test_the_page(tmp_path, capsys):
    page = tmp_path / "validation.html"
    assert inercal(["validate", "--report", str(page)]) == 0
    assert f"report: {page}" in capsys.readouterr().err
    text = page.read_text("utf-8")
    for case in CASES:
        assert f"<b>{case.name}</b>" in text
    for words in (source_hash(), np.__version__, "JCGM 100:2008", "Released for use", "signature"):
        assert words in text
    assert not re.search(r"https?://|<script", text)


def test_a_failure_is_named_and_is_a_bad_verdict(monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(earth, "_G_EQUATOR", 9.78)
    page = tmp_path / "validation.html"
    assert inercal(["validate", "--report", str(page)]) == 1
    captured = capsys.readouterr()
    lines = captured.out.splitlines()
    # at a pole, by the ratio of the equators
    pole = 9.78 / 9.7803253359 * 9.8321849378
    said = f"failed_case: wgs84-gravity: found {pole:.9g}, expected 9.83218494 within 5e-11\n"
    assert said in captured.err
    assert lines[-1] == f"inconsistent: 1 of {len(CASES)} cases failed: wgs84-gravity"
    assert [line.split()[1] for line in lines if line.startswith("FAIL")] == ["wgs84-gravity"]
    assert "<b>fail</b>" in page.read_text("utf-8")


def test_a_case_that_raises_is_one_line_and_null_in_the_record(monkeypatch, capsys):
    def broken(latitude):
        raise ZeroDivisionError("division\nby zero")

    monkeypatch.setattr(earth, "earth_rate", broken)
    assert inercal(["validate", "--quiet"]) == 1
    lines = capsys.readouterr().out.splitlines()
    (line,) = [line for line in lines if line.startswith("FAIL")]
    assert line.endswith("ZeroDivisionError: division by zero")
    assert inercal(["validate", "--quiet", "--json"]) == 1
    data = json.loads(capsys.readouterr().out)
    assert data["status"] == {
        "code": "inconsistent",
        "message": f"1 of {len(CASES)} cases failed: wgs84-earth-rate",
    }
    (row,) = [row for row in data["result"]["cases"] if not row["passed"]]
    assert row["figure"] is None
    assert row["error"] == "ZeroDivisionError: division by zero"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["--out", "record.csv"], "expected .json or .toml"),
        (["--report", "nowhere/page.html"], "folder that exists"),
        (["--only", "noise"], "--only"),
    ],
)
def test_what_cannot_be_written_is_said_before_any_case_is_run(
    arguments, words, monkeypatch, tmp_path, capsys
):
    monkeypatch.chdir(tmp_path)
    assert inercal(["validate", *arguments]) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    assert captured.err.startswith("inercal: error: ")
    assert words in captured.err
    assert len(captured.err.splitlines()) == 1
