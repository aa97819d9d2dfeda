"""Stores, results and tolerances that are spoiled at random: a verdict or one sentence, never a traceback.

A store that was changed behind the program's back is either refused by the database, or named by `store check`.
"""

import json
import shutil
import tomllib

import numpy as np
import pytest
from made import ITEM, result

from inercal.cli import run
from inercal.foundation.results.files import save
from inercal.laboratory.check import check
from inercal.laboratory.keep import keep
from inercal.laboratory.store import make_store, open_store

SHORT, CASES = 12, 500
COUNTS = pytest.mark.parametrize(
    "cases",
    [range(SHORT), pytest.param(range(SHORT, CASES), marks=pytest.mark.campaign)],
    ids=["short", "rest"],
)


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A folder with a store of three results, one of them as a file, and tolerances."""
    folder = tmp_path_factory.mktemp("whole")
    store = make_store(str(folder / "store"))
    for k in range(3):
        keep(store, result(k, date=f"202{k}-01-01"), ITEM, b"<p>page</p>")
    save(result(9), folder / "result.json")
    (folder / "spec.toml").write_text(
        '[specification]\ndecision = "risk 2 %"\nK1 = ["-1 1", "1 1"]\nM_xy = "2 deg"\n'
    )
    with store.engine.connect() as connection:  # all in one file
        connection.exec_driver_sql("COMMIT")
        connection.exec_driver_sql("PRAGMA wal_checkpoint(TRUNCATE)")
    store.engine.dispose()
    return folder


def spoiled(data, rng):
    """Bytes with some changed, cut off, or moved."""
    data = bytearray(data)
    match rng.integers(3):
        case 0:
            del data[int(rng.integers(1, len(data))) :]
        case 1:
            for place in rng.integers(0, len(data), int(rng.integers(1, 30))):
                data[place] = int(rng.integers(256))
        case _:
            a, b = sorted(rng.integers(0, len(data), 2))
            data[a:b] = data[b : 2 * b - a]
    return bytes(data)


def ends_well(capsys, *words):
    """A command ends with a verdict or a sentence; its code."""
    code = run([*words, "--quiet"])
    said = capsys.readouterr().err
    assert "fault of inercal's own" not in said, (words, said)
    assert code in (0, 1, 2)
    assert (code == 2) == said.startswith("inercal: error: "), said
    assert len(said.splitlines()) <= 1
    return code


@pytest.mark.slow
@COUNTS
def test_spoiled_databases_are_refused_or_named(cases, whole, tmp_path, capsys):
    """Every fault that a reader of SQLite lets through is one that the check may name; no command breaks on it."""
    for case in cases:
        rng = np.random.default_rng([1, case])
        place = tmp_path / f"store-{case}"
        shutil.copytree(whole / "store", place)
        (place / "store.db").write_bytes(spoiled((whole / "store" / "store.db").read_bytes(), rng))
        at = ["--store", str(place)]
        for words in (["results"], ["history", "17"], ["store", "check"]):
            ends_well(capsys, *words, *at)
        ends_well(capsys, "keep", str(whole / "result.json"), "--instrument", "17", *at)
        shutil.rmtree(place)


def test_a_whole_store_is_sound(whole):
    assert check(open_store(str(whole / "store"))).faults == ()


@pytest.mark.slow
@COUNTS
def test_spoiled_results_are_kept_as_they_are_or_refused(cases, whole, tmp_path, capsys):
    """What is kept of a spoiled result is what it says; the store stays sound."""
    place = tmp_path / "store"
    shutil.copytree(whole / "store", place)
    text = (whole / "result.json").read_bytes()
    for case in cases:
        (tmp_path / "result.json").write_bytes(spoiled(text, np.random.default_rng([2, case])))
        ends_well(capsys, "keep", str(tmp_path / "result.json"), "--instrument", "17", "--store", str(place))
    assert check(open_store(str(place))).faults == ()


@pytest.mark.slow
@COUNTS
def test_spoiled_results_with_sound_json_too(cases, whole, tmp_path, capsys):
    """Values of other types, numbers that are not finite, keys that are gone, anywhere in the JSON."""
    place = tmp_path / "store"
    shutil.copytree(whole / "store", place)
    for case in cases:
        rng = np.random.default_rng([3, case])
        data = json.loads((whole / "result.json").read_text())
        within = data
        while True:
            keys = list(within) if isinstance(within, dict) else range(len(within))
            key = list(keys)[int(rng.integers(len(keys)))]
            if isinstance(within[key], dict | list) and within[key] and rng.random() < 0.8:
                within = within[key]
                continue
            break
        odd = [None, "text", -1, 1e400, float("nan"), [], {}, True, "\ud800", "x" * 5000, 2**70]
        choice = odd[int(rng.integers(len(odd)))]
        if rng.random() < 0.2:
            del within[key]
        else:
            within[key] = choice
        (tmp_path / "result.json").write_text(json.dumps(data), encoding="utf-8")
        ends_well(capsys, "keep", str(tmp_path / "result.json"), "--instrument", "17", "--store", str(place))
        ends_well(capsys, "history", str(tmp_path / "result.json"))
    assert check(open_store(str(place))).faults == ()


@pytest.mark.slow
@COUNTS
def test_spoiled_tolerances_are_one_sentence(cases, whole, tmp_path, capsys):
    text = (whole / "spec.toml").read_bytes()
    assert tomllib.loads(text.decode())
    for case in cases:
        (tmp_path / "spec.toml").write_bytes(spoiled(text, np.random.default_rng([4, case])))
        ends_well(capsys, "history", str(whole / "result.json"), "--tolerance", str(tmp_path / "spec.toml"))
