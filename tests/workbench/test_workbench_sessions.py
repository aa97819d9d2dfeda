"""Sessions: files land in their folder under a harmless name, whole or not at all; TOML becomes map or study."""

import asyncio
import json

import pytest
from hypothesis import given
from hypothesis import strategies as st

from inercal.bench.workbench import sessions as module
from inercal.bench.workbench.bench import open_bench
from inercal.bench.workbench.sessions import MAP, STUDY, Sessions, receive, safe_name
from inercal.examples import EXAMPLES
from inercal.foundation.errors import InputError
from inercal.systems.listed import SYSTEMS


@pytest.fixture
def sessions(tmp_path):
    return Sessions(tmp_path / "sessions")


def sent(session, name, *pieces):
    async def body():
        for piece in pieces:
            yield piece

    return asyncio.run(receive(session, name, body()))


def test_a_map_or_study_is_small(sessions):
    """It is parsed: 10 MB of TOML would hold everybody up."""
    session = sessions.begin("test")
    with pytest.raises(InputError, match="found more than 1 MiB, expected a map or a study"):
        sent(session, "x.toml", b"#" * 1024**2, b"#")
    assert session.files == []


def test_a_title_is_short_and_a_foreign_folder_no_session(sessions):
    with pytest.raises(InputError, match="found 201 characters, expected 200 at most"):
        sessions.begin("x" * 201)
    (sessions.root / "²").mkdir(parents=True)
    assert sessions.begin("x" * 200).id == "0001"


HOSTILE = [
    "../../etc/passwd",
    "..\\..\\x.csv",
    "/etc/shadow",
    "a\0b.csv",
    "<img src=x>.csv",
    "-rf.csv",
    "x" * 400 + ".csv",
]


@pytest.mark.parametrize("name", HOSTILE)
def test_a_hostile_name_lands_in_the_folder(sessions, name):
    session = sessions.begin("test")
    path = sent(session, name, b"t,acc_x\n")
    assert path.parent == session.folder
    assert not path.name.startswith(("-", "."))
    assert not {*'<>:"|?*/\\\0'} & {*path.name}


@pytest.mark.parametrize("name", ["", "..", "/", "session.json", "CON", "nul.csv", " . "])
def test_a_name_of_nothing_or_of_the_system_is_refused(sessions, name):
    with pytest.raises(InputError, match="file name"):
        sent(sessions.begin("test"), name, b"x")


@given(st.text(max_size=300))
def test_any_name_is_refused_or_safe_and_stays_as_it_is_the_second_time(text):
    try:
        name = safe_name(text)
    except InputError:
        return
    assert len(name) <= 121
    assert safe_name(name) == name


def test_an_upload_beyond_the_limit_leaves_nothing(sessions, monkeypatch):
    monkeypatch.setattr(module, "LARGEST", 10)
    session = sessions.begin("test")
    assert sent(session, "at.csv", b"12345", b"67890").stat().st_size == 10
    with pytest.raises(InputError, match="found more than"):
        sent(session, "over.csv", b"12345", b"678901")
    assert [path.name for path in session.folder.iterdir() if "over" in path.name] == []


def test_an_upload_that_breaks_off_leaves_what_was_there(sessions):
    session = sessions.begin("test")
    sent(session, "log.csv", b"before")

    async def broken():
        yield b"half"
        raise ConnectionError

    with pytest.raises(ConnectionError):
        asyncio.run(receive(session, "log.csv", broken()))
    assert (session.folder / "log.csv").read_bytes() == b"before"
    assert session.recordings == [session.folder / "log.csv"]


def test_a_toml_file_is_the_map_or_the_study(sessions):
    session = sessions.begin("test")
    assert sent(session, "any.toml", b'[columns.t]\nfrom = "t"\nunit = "s"\n').name == MAP
    assert sent(session, "other.toml", b'[site]\nlatitude = "45 deg"\n').name == STUDY
    with pytest.raises(InputError, match=r"^broken\.toml: not valid TOML"):
        sent(session, "broken.toml", b"[[[")
    assert session.recordings == []


def test_examples_begin_sessions_whose_commands_are_theirs(sessions, tmp_path):
    words = {system.command for system in SYSTEMS.values()}
    for example in EXAMPLES.values():
        if example.verb in words:
            session = sessions.begin_with(example.name)
            arguments = session.command(tmp_path / "o.json", tmp_path / "r.html")
            assert " ".join(arguments).startswith(example.verb)
            assert {path.name for path in session.recordings} == {*example.records}
            assert ("--map" in arguments) == (example.map is not None)


def test_sessions_are_numbered_found_again_and_dropped(sessions):
    first, second = sessions.begin("one"), sessions.begin("two", "aoa")
    assert [session.title for session in sessions] == ["two", "one"]
    assert sessions.get(second.id).kind == "aoa"
    sessions.drop(first)
    assert [session.id for session in sessions] == [second.id]
    assert sessions.begin("three").id > second.id
    for wrong in ("0009", "../jobs", "x"):
        with pytest.raises(InputError):
            sessions.get(wrong)


def test_a_store_is_the_same_from_every_folder(tmp_path, monkeypatch):
    """Commands run in the folders of sessions: a store is meant as seen from where the workbench was started."""
    monkeypatch.chdir(tmp_path)
    for named, expected in (
        ("lab", str(tmp_path / "lab")),
        ("postgresql://here/lab", "postgresql://here/lab"),
    ):
        bench = open_bench(tmp_path / "work", named)
        bench.close()
        assert bench.store == expected


@pytest.mark.parametrize("title", ["\0", "a\ud800", "\udfff"])
def test_a_title_that_is_no_text_is_refused_and_one_of_an_earlier_workbench_is_spelt_out(sessions, title):
    with pytest.raises(InputError, match="title: found"):
        sessions.begin(title)
    assert [*sessions] == []
    folder = sessions.begin("sound").folder
    (folder / "session.json").write_text(json.dumps({"title": title, "kind": "imu", "made": "2026"}))
    (found,) = sessions
    assert found.title.encode().startswith((b"\\x00", b"a\\ud800", b"\\udfff"))


@pytest.mark.parametrize("spoiled", [{"kind": "other"}, {"kind": None}, {"made": ["x"], "kind": []}])
def test_a_session_that_says_no_kind_is_left_out(sessions, spoiled):
    sessions.begin("sound")
    about = {"title": "x", "kind": "imu", "made": "2026", **spoiled}
    (sessions.begin("spoiled").folder / "session.json").write_text(json.dumps(about))
    (sessions.begin("deep").folder / "session.json").write_text("[" * 100_000)
    assert [each.title for each in sessions] == ["sound"]


@pytest.mark.parametrize("text", ["x = '\0'", "x = '\ud800'"])
def test_a_text_of_a_study_that_is_none_is_refused(sessions, text):
    session = sessions.begin("test")
    with pytest.raises(InputError, match=r"study.toml: found .* expected plain text"):
        module.put(session, STUDY, text)
    assert session.study is None
