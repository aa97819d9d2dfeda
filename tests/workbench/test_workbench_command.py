"""``inercal workbench`` lets other machines in for a password alone, and says what that means."""

import sys

import pytest

from inercal.cli import run

pytest.importorskip("nicegui")

GIVEN = "INERCAL_WORKBENCH_PASSWORD"


@pytest.fixture
def doors(monkeypatch):
    """The doors that would have been opened."""
    opened = []
    monkeypatch.setattr(
        "inercal.bench.workbench.serve.serve", lambda bench, door, told, browser: opened.append(door)
    )
    monkeypatch.delenv(GIVEN, raising=False)
    return opened


def test_this_machine_needs_no_password_and_others_one_of_12_characters(doors, monkeypatch, tmp_path, capsys):
    assert run(["workbench", str(tmp_path), "--no-browser"]) == 0
    assert [(door.host, door.password) for door in doors] == [("127.0.0.1", "")]
    for words in (None, "", "too short"):
        if words is not None:
            monkeypatch.setenv(GIVEN, words)
        assert run(["workbench", str(tmp_path), "--no-browser", "--host", "0.0.0.0"]) == 2
        assert "needs a password of 12 characters or more" in capsys.readouterr().err
    monkeypatch.setenv(GIVEN, "a long password")
    assert run(["workbench", str(tmp_path), "--no-browser", "--host", "0.0.0.0"]) == 0
    assert [(door.host, door.password) for door in doors[1:]] == [("0.0.0.0", "a long password")]


def test_the_prompt_says_that_nothing_is_encrypted(doors, monkeypatch, tmp_path, capsys):
    monkeypatch.setattr(sys.stdin, "isatty", lambda: True)
    monkeypatch.setattr("getpass.getpass", lambda prompt: "a long password")
    assert run(["workbench", str(tmp_path), "--no-browser", "--host", "0.0.0.0"]) == 0
    assert "without encryption" in capsys.readouterr().out
    assert doors[0].password == "a long password"
