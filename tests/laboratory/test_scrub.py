"""Secrets are taken out of a store that an older inercal wrote them into; the chain says so, and nothing else moves."""

import base64
import json
import subprocess
import sys
from dataclasses import replace
from hashlib import sha256

import pytest
from certified import DAY, LAB, lab_of
from made import ITEM, result
from sqlalchemy import select, text

from inercal.cli import run
from inercal.foundation.errors import InputError
from inercal.foundation.inputs import Source
from inercal.foundation.results.files import save
from inercal.laboratory import keep as keeping
from inercal.laboratory.carry import export_store, import_store
from inercal.laboratory.catalog import instruments, results, show, supersede, values_of
from inercal.laboratory.certificate.reading import certificate_of
from inercal.laboratory.certificate.written import certificate
from inercal.laboratory.check import check
from inercal.laboratory.database import Event, Tables, writing
from inercal.laboratory.issue import issuing
from inercal.laboratory.keep import Item, keep
from inercal.laboratory.objects import Objects
from inercal.laboratory.scrub import scrub
from inercal.laboratory.store import digest_of, happened, make_store, open_store
from rows import for_each

SECRET = "Hunter2SeCrEt"
STORE = f"postgresql://lab:{SECRET}@host/db"


def secrets_of_old(monkeypatch):
    """What 0.2.0 did with secrets: nothing."""
    for module in (
        "foundation.results.files",
        "laboratory.keep",
        "laboratory.catalog",
        "laboratory.certificate.written",
    ):
        monkeypatch.setattr(f"inercal.{module}.without_secrets", lambda given: given)


@pytest.fixture
def spoiled(store, tmp_path, monkeypatch):
    """A store of 0.2.0 with secrets, and the identities of its results."""
    return spoil(store, tmp_path, monkeypatch)


def spoil(store, tmp_path, monkeypatch):
    """Write into a store, as 0.2.0 did, secrets in results, a page, a certificate, texts of rows and an event."""
    with monkeypatch.context() as old:
        secrets_of_old(old)
        sound = keep(store, result(1), ITEM, b"<p>page</p>").id
        arguments = {"arguments": ["calibrate", "imu", "--keep", "--store", STORE]}
        told = result(2, message=f"of https://{SECRET}@host/x.csv")
        told = replace(told, provenance={**told.provenance, **arguments})
        page = f"<p>read from s3://KEY:{SECRET}@bucket/x</p>".encode()
        said = keep(store, told, ITEM, page).id
        plain = replace(result(3), provenance={**result(3).provenance, **arguments})
        typed = keep(store, plain, ITEM).id
        supersede(store, sound, typed, f"see https://wiki/x?token={SECRET}")
        made = certificate([plain], lab_of(tmp_path, LAB), "C-1", DAY)
        with issuing(store, "C-1", made, page, [typed]):
            pass
        with writing(store.engine, store.where) as connection:
            happened(connection, "upgrade", f"postgresql://h/db?password={SECRET}", digest_of([]))
        store.objects.add(page + b" of a command that was cut short")
    assert not check(store).faults
    return store, {"sound": sound, "said": said, "typed": typed}


def everything(store):
    """All that a store holds: rows as texts, and the bytes of its objects, those inside of certificates unpacked."""
    with store.engine.connect() as connection:
        rows = [
            str(row) for table in Tables.metadata.sorted_tables for row in connection.execute(select(table))
        ]
    contents = [store.objects.read(name) for name in store.objects.names()]
    for content in list(contents):
        if content.startswith(b"<?xml"):
            inner = content.split(b"<dcc:dataBase64>")[1:]
            contents += [base64.b64decode(each.split(b"<")[0]) for each in inner]
    return "\n".join(rows).encode() + b"\n".join(contents)


def test_all_secrets_go_and_all_else_stays(spoiled, tmp_path):
    """Values, identities and files are what they were; the old head is in the chain; the check is sound and says it."""
    store, names = spoiled
    assert everything(store).count(SECRET.encode()) >= 9
    head = check(store).head
    values = {identity: show(store, identity).estimate.values for identity in names.values()}
    rows = values_of(store, "17")
    done = scrub(store)
    assert SECRET.encode() not in everything(store)
    assert done.before == head
    assert done.subjects["keep"] == tuple(sorted((names["said"], names["typed"])))
    assert (done.subjects["supersede"], done.subjects["certificate"]) == ((names["sound"],), ("C-1",))
    found = check(store)
    assert found.faults == ()
    assert found.head == done.head
    assert sum("secrets were taken out on" in note for note in found.notes) == 4
    with store.engine.connect() as connection:
        (last,) = connection.execute(select(Event.subject).where(Event.kind == "scrub"))
    assert last == (head,)
    assert {each.id for each in results(store)} == set(names.values())
    for identity, before in values.items():
        assert (show(store, identity).estimate.values == before).all()
    assert values_of(store, "17") == rows
    assert show(store, names["typed"]).estimate.provenance["arguments"][-1] == "postgresql://lab:***@host/db"
    again = scrub(store)
    assert (again.objects, again.texts, again.head) == (0, 0, done.head)
    copy = export_store(store, tmp_path / "copy")
    assert not check(copy).faults
    assert run(["store", "init", "--store", str(tmp_path / "other"), "--quiet"]) == 0
    other = open_store(str(tmp_path / "other"))
    assert import_store(other, tmp_path / "copy").results == 3
    assert not check(other).faults


def test_the_certificate_in_the_store_is_one_still(spoiled):
    """It is valid by the schema, with the same numbers, and holds the result without the secret."""
    store, names = spoiled
    scrub(store)
    with store.engine.connect() as connection:
        (place,) = connection.execute(text("SELECT object FROM certificate")).one()
    (one,) = certificate_of(store.objects.read(place), "c.xml").results
    assert (one.estimate.values == show(store, names["typed"]).estimate.values).all()


def test_rows_are_only_added_after_it_as_before(spoiled):
    store, names = spoiled
    scrub(store)
    for table in ("result", "coefficient", "supersession", "event", "certificate", "certified"):
        with pytest.raises(Exception, match="only added"), store.engine.begin() as connection:
            connection.execute(text(f"DELETE FROM {table}"))
    changed = show(store, names["said"]).estimate
    assert changed.message == "of https://***@host/x.csv"
    with writing(store.engine, store.where) as connection:  # what is changed after it is a fault still
        name = connection.dialect.name
        connection.execute(
            text(
                "ALTER TABLE result DISABLE TRIGGER ALL"
                if name == "postgresql"
                else "DROP TRIGGER result_no_update"
            )
        )
        connection.execute(text("UPDATE result SET operator = 'X'"))
    assert sum("its rows were changed" in fault for fault in check(store).faults) == 3
    with pytest.raises(InputError, match="expected a store as it was written"):
        scrub(store)


def test_nothing_is_left_in_the_files(tmp_path, monkeypatch):
    """Of a store in a folder neither the database nor its journal holds a deleted secret."""
    store, _ = spoil(make_store(str(tmp_path / "store")), tmp_path, monkeypatch)
    scrub(store)
    store.engine.dispose()
    files = [path for path in (tmp_path / "store").rglob("*") if path.is_file()]
    assert [path for path in files if SECRET.encode() in path.read_bytes()] == []


def test_a_file_with_a_secret_stays_and_is_named(store, tmp_path, capsys, place, monkeypatch):
    """Results rest on its SHA-256; a store without secrets is left as it is."""
    path = tmp_path / "study.toml"
    path.write_text(f'reference = "https://u:{SECRET}@host/x"')
    keep(store, result(1, inputs=[Source(str(path), sha256(path.read_bytes()).hexdigest())]), ITEM)
    before = check(store).head
    assert run(["store", "scrub", "--store", place[0]]) == 0
    captured = capsys.readouterr()
    assert "holds a secret and stays, for results rest on it" in captured.err
    assert captured.out.startswith("no secret found in ")
    assert check(store).head == before


def test_objects_whose_address_holds_a_secret(tmp_path, monkeypatch):
    """Their address loses its login where they can be reached without it; else it is refused, and nothing is done."""
    from inercal.laboratory import store as stores

    with monkeypatch.context() as old:
        old.setattr(stores, "holds_secret", lambda given: False)
        made = stores.make_store(str(tmp_path / "store"), f"memory://key:{SECRET}@lab/objects")
    keep(made, result(1), ITEM)
    with pytest.raises(InputError, match=r"memory://lab/objects: holds other objects .*AWS_ACCESS_KEY_ID"):
        scrub(made)
    for name in made.objects.names():
        Objects("memory://lab/objects").add(made.objects.read(name))
    scrub(made)
    assert open_store(str(tmp_path / "store")).objects.where == "memory://lab/objects"
    assert not check(open_store(str(tmp_path / "store"))).faults


def with_certificate_of_its_table(seed, address):
    """A result whose study states a table with a certificate at an address."""
    table = {"name": "T", "serial": "1", "certificate": address, "valid_until": "2027-01-01"}
    given = result(seed)
    return replace(given, provenance={**given.provenance, "settings": {"equipment": {"table": table}}})


def test_rows_that_are_one_without_their_secrets_become_one(store, monkeypatch):
    """Instruments and references of old results join those that were kept since."""
    address = f"https://lab/c.pdf?token={SECRET}"
    with monkeypatch.context() as old:
        secrets_of_old(old)
        keep(store, with_certificate_of_its_table(1, address), Item("M", "X", address))
        keep(store, with_certificate_of_its_table(2, f"{address}2"), Item("M", "X", f"{address}2"))
    keep(store, with_certificate_of_its_table(3, address), Item("M", "X", "https://lab/c.pdf?token=***"))
    scrub(store)
    assert SECRET.encode() not in everything(store)
    assert check(store).faults == ()
    (only,) = instruments(store)
    assert (only["serial"], only["results"]) == ("https://lab/c.pdf?token=***", 3)


def test_a_result_that_another_rests_on_stays_as_a_file(store, tmp_path, monkeypatch):
    """A comparison was made of a result in a file, whose bytes are those of the kept one: its checksum must hold."""
    with monkeypatch.context() as old:
        secrets_of_old(old)
        one = replace(result(1), provenance={"settings": {}, "arguments": ["selfcal", "--store", STORE]})
        save(one, tmp_path / "cal.json")
        keep(store, one, ITEM)
        source = Source(str(tmp_path / "cal.json"), sha256((tmp_path / "cal.json").read_bytes()).hexdigest())
        keep(store, result(2, inputs=[source]), ITEM)
    done = scrub(store)
    assert done.files == (source.sha256,)
    assert check(store).faults == ()
    assert scrub(store).objects == 0


def test_a_certificate_whose_number_is_an_address_stays(store, tmp_path, monkeypatch):
    """Its number is the key of its row, and the subject of its event."""
    one = result(1)
    identity = keep(store, one, ITEM).id
    with monkeypatch.context() as old:
        secrets_of_old(old)
        made = certificate([one], lab_of(tmp_path, LAB), "https://lab/c?x=7", DAY)
    with issuing(store, "https://lab/c?x=7", made, None, [identity]):
        pass
    scrub(store)
    assert check(store).faults == ()
    with pytest.raises(InputError, match=r"found a secret in the address 'https://lab/c\?x=\*\*\*'"):
        certificate([one], lab_of(tmp_path, LAB), "https://lab/c?x=7", DAY)


KILLED = """
import os, sys
import inercal.laboratory.scrub as scrubbing
from inercal.laboratory.objects import Objects
from inercal.laboratory.store import open_store

end = lambda *given: os._exit(9)
where, place = sys.argv[1:]
if where == "commit":
    scrubbing._others = end
elif where == "vacuum":
    scrubbing.vacuum = end
else:
    Objects.remove = end
scrubbing.scrub(open_store(place))
"""


@pytest.mark.slow
@for_each("where", ["commit", "remove", "vacuum"])
def test_killed_in_the_middle_it_goes_on(where, tmp_path, monkeypatch):
    """The store is sound at each moment; the same command ends what the one before began."""
    folder = tmp_path / where
    folder.mkdir()
    store, _ = spoil(make_store(str(folder / "store")), folder, monkeypatch)
    store.engine.dispose()
    ended = subprocess.run([sys.executable, "-c", KILLED, where, str(folder / "store")], check=False)
    assert ended.returncode == 9
    assert check(store).faults == ()
    scrub(store)
    store.engine.dispose()
    files = [path for path in (folder / "store").rglob("*") if path.is_file()]
    assert [path for path in files if SECRET.encode() in path.read_bytes()] == []
    assert check(store).faults == ()


def test_a_new_store_takes_no_secret(tmp_path, capsys):
    assert run(["store", "init", "--store", str(tmp_path / "x"), "--objects", f"s3://K:{SECRET}@b/o"]) == 2
    said = capsys.readouterr().err
    assert "found a secret in s3://***@b/o, which the store would keep" in said
    assert not (tmp_path / "x").exists()


def test_old_rows_are_cleaned_where_they_are_kept_again(store, monkeypatch, tmp_path):
    """A result of 0.2.0 in a file loses its secrets on the way into a store."""
    estimate = replace(result(4), provenance={"settings": {}, "arguments": ["selfcal", "--store", STORE]})
    with monkeypatch.context() as old:
        secrets_of_old(old)
        saved = keeping.to_json(estimate)
    assert SECRET in json.dumps(saved)
    keep(store, estimate, ITEM, saved=saved)
    assert SECRET.encode() not in everything(store)
