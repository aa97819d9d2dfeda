"""Certificates in the store: each number once, of results that stand, in the chain."""

import json
import re

import pytest
from certified import LAB
from made import ITEM, result
from sqlalchemy import text

from inercal.cli import run
from inercal.examples import FOLDER
from inercal.foundation.errors import InputError
from inercal.foundation.results.files import save
from inercal.laboratory.carry import export_store, import_store
from inercal.laboratory.catalog import show, supersede
from inercal.laboratory.check import check
from inercal.laboratory.issue import issuing
from inercal.laboratory.keep import keep
from inercal.laboratory.store import make_store, open_store


def issue(store, number, results, supersedes=None):
    with issuing(store, number, b"<xml/>", b"<p>page</p>", results, supersedes):
        pass


def test_a_number_is_used_once_and_replaced_once(store):
    one = keep(store, result(1), ITEM).id
    issue(store, "C-1", [one])
    with pytest.raises(InputError, match="has already, expected a new one"):
        issue(store, "C-1", [one])
    issue(store, "C-2", [one], "C-1")
    with pytest.raises(InputError, match="another certificate replaces already"):
        issue(store, "C-3", [one], "C-1")
    with pytest.raises(InputError, match="expected the number of a certificate"):
        issue(store, "C-3", [one], "C-9")
    assert show(store, one).certificates == ("C-1", "C-2")
    assert check(store).faults == ()


def test_what_fails_on_the_way_out_is_not_entered(store):
    """The files are written within the transaction: a disk that is full leaves the number free."""
    one = keep(store, result(1), ITEM).id
    with pytest.raises(OSError, match="full"), issuing(store, "C-1", b"x", None, [one]):
        raise OSError("full")
    assert show(store, one).certificates == ()
    issue(store, "C-1", [one])


def test_a_result_that_is_superseded_gets_none(store):
    one, two = (keep(store, result(seed), ITEM).id for seed in (1, 2))
    supersede(store, one, two, "wrong gravity")
    with pytest.raises(InputError, match="is superseded by"):
        issue(store, "C-1", [one])
    issue(store, "C-1", [two])


def test_certificates_are_in_the_chain_and_travel(store, tmp_path):
    one = keep(store, result(1), ITEM).id
    issue(store, "C-1", [one])
    export_store(store, tmp_path / "copy")
    other = make_store(str(tmp_path / "other"))
    assert import_store(other, tmp_path / "copy").certificates == 1
    assert check(other).faults == ()
    with store.engine.begin() as connection, pytest.raises(Exception, match="only added"):
        connection.execute(text("UPDATE certificate SET issued = 'later'"))
    with store.engine.begin() as connection:
        if store.engine.dialect.name == "postgresql":
            connection.execute(text("ALTER TABLE certificate DISABLE TRIGGER ALL"))
        else:
            connection.execute(text("DROP TRIGGER certificate_no_update"))
        connection.execute(text("UPDATE certificate SET issued = 'later'"))
    (fault,) = check(store).faults
    assert fault == "certificate C-1: its rows were changed"


@pytest.fixture
def lab(tmp_path, monkeypatch):
    """A laboratory with an empty store, and a recording with the study of its instrument and equipment."""
    for name in ("ferraris.csv.gz", "ferraris-map.toml"):
        (tmp_path / name).write_bytes((FOLDER / name).read_bytes())
    study = (FOLDER / "ferraris.toml").read_text()
    item = '\n[item]\nmaker = "M"\nmodel = "G"\nserial = "17"\n'
    table = '[equipment.table]\nname = "turn table"\nserial = "T-1"\ncertificate = "K-7"\nvalid_until = "2027-06-30"\n'
    (tmp_path / "study.toml").write_text(study + item + table)
    (tmp_path / "lab.toml").write_text(LAB)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("INERCAL_STORE", str(tmp_path / "store"))
    make_store(str(tmp_path / "store"))
    return tmp_path


CALIBRATE = [
    "calibrate",
    "imu",
    "ferraris.csv.gz",
    "--map",
    "ferraris-map.toml",
    "--study",
    "study.toml",
    "--quiet",
]
CALIBRATE += ["--set", "traceability.date=2026-01-30"]


def test_a_certificate_of_the_store_as_it_is_typed(lab, capsys):
    """Of a result in the store, with its report inside; the number is used once, the equipment known."""
    assert run([*CALIBRATE, "--keep", "--report", "r.html"]) == 0
    capsys.readouterr()
    assert run(["results", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["result"]["results"]
    write = ["certificate", row["id"][:10], "--lab", "lab.toml", "--number", "C-1", "--out", "c.xml"]
    assert run(write) == 0
    assert f"entered in {lab}" in capsys.readouterr().out
    assert run([*write[:-1], "d.xml"]) == 2
    assert "has already" in capsys.readouterr().err
    assert not (lab / "d.xml").exists()
    assert run(["show", row["id"][:10]]) == 0
    said = capsys.readouterr().out
    assert re.search(r"equipment +turn table, T-1, K-7", said)
    assert re.search(r"certificate +C-1", said)
    assert check(open_store(str(lab / "store"))).faults == ()


def test_a_result_of_a_file_is_kept_first(lab, capsys):
    assert run([*CALIBRATE, "--out", "cal.json"]) == 0
    assert (
        run(["certificate", "cal.json", "--lab", "lab.toml", "--number", "C-1", "--out", "c.xml", "--quiet"])
        == 0
    )
    assert run(["results", "--instrument", "17"]) == 0
    assert "1 result" in capsys.readouterr().out
    assert run(["history", "c.xml", "cal.json"]) == 0


def test_without_a_store_the_certificate_says_so(lab, capsys, monkeypatch):
    monkeypatch.delenv("INERCAL_STORE")
    monkeypatch.setenv("XDG_DATA_HOME", str(lab / "data"))
    assert run([*CALIBRATE, "--out", "cal.json"]) == 0
    words = ["certificate", "cal.json", "--lab", "lab.toml", "--number", "C-1", "--out", "c.xml"]
    assert run(words) == 0
    assert "no store keeps it" in capsys.readouterr().out
    save(result(1), "x.json")
    assert run([*words[:1], "nothing.json", *words[2:]]) == 2
    assert "nothing.json: cannot be read" in capsys.readouterr().err


def test_a_result_kept_under_a_name_by_hand_is_found(lab, capsys):
    """Its study says no instrument; kept under one, it gets its certificate, and is not kept twice."""
    study = (lab / "study.toml").read_text()
    item = '[item]\nmaker = "M"\nmodel = "G"\nserial = "17"\n'
    (lab / "study.toml").write_text(re.sub("(?m)^instrument = .*$", "", study.replace(item, "")))
    assert run([*CALIBRATE, "--out", "cal.json"]) == 0
    words = ["certificate", "cal.json", "--lab", "lab.toml", "--number", "C-1", "--out", "c.xml"]
    assert run(words) == 2
    assert "found no instrument in it" in capsys.readouterr().err
    assert run(["keep", "cal.json", "--instrument", "M, G, 18"]) == 0
    assert run(words) == 0, capsys.readouterr().err
    capsys.readouterr()
    assert run(["results", "--instrument", "18", "--json"]) == 0
    (row,) = json.loads(capsys.readouterr().out)["result"]["results"]
    assert show(open_store(str(lab / "store")), row["id"]).certificates == ("C-1",)
