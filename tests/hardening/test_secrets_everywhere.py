"""A campaign of secrets: an address with a password in the place of every option and argument of every command."""

import io
import sys

import pytest

from inercal.cli import run
from inercal.cli.tree import COMMANDS, app
from inercal.examples import FOLDER

SECRET = "Hunter2SeCrEt"
ADDRESSES = (
    f"postgresql://user:{SECRET}@127.0.0.1:1/db",
    f"s3://KEY:{SECRET}@bucket/path/file.csv",
    f"https://{SECRET}@127.0.0.1:1/file.json?token={SECRET}",
    f"mqtt://user:{SECRET}@127.0.0.1:1/topic",
    f"postgresql://127.0.0.1:1/db?user=u&password={SECRET}",
    f"simplecache::https://u:{SECRET} with 'quotes\"@127.0.0.1:1/x.csv",
)
FILES = ("ferraris.csv.gz", "ferraris-map.toml", "ferraris.toml")


def lines(joined):
    """Command lines with the mark in the place of the address: each option and argument of each command once.

    ``joined``: each option once more with its value behind ``=``.
    """
    root = app()
    for verb, kind in COMMANDS:
        command = root[verb][kind] if kind else root[verb]
        words = [verb, *([kind] if kind else [])]
        for argument in command.assemble_argument_collection():
            if argument.hint is bool or not argument.parse:
                continue
            option = next((name for name in argument.names if name.startswith("--")), None)
            file = ["ferraris.csv.gz"] if verb != "workbench" else ["bench"]
            study = [] if option == "--study" else ["--study", "ferraris.toml"]
            given = ["{}"] if option is None else [*file, *study, option, "{}"]
            yield [*words, *given]
            if option is not None and joined:
                yield [*words, *file, f"{option}={{}}"]
        yield [*words, "{}", "{}", "{}"]
        yield [*words, "--unknown", "{}"]


def check(rows, folder, capsys, monkeypatch):
    """Run command lines; nothing that is said, and no file in the folder, holds the secret."""
    monkeypatch.chdir(folder)
    monkeypatch.setattr(
        "inercal.bench.workbench.serve.serve", lambda *given: None
    )  # it would wait for browsers
    for name in FILES:
        (folder / name).write_bytes((FOLDER / name).read_bytes())
    wrong = []
    for line, address in rows:
        words = [word.replace("{}", address) for word in line]
        monkeypatch.setattr(sys, "stdin", io.StringIO(""))
        code = run(words)
        captured = capsys.readouterr()
        if SECRET in captured.out + captured.err or code not in (0, 1, 2):
            wrong.append((words, code, captured.err))
    assert wrong == []
    written = [path for path in folder.rglob("*") if path.is_file() and SECRET.encode() in path.read_bytes()]
    assert written == []


@pytest.mark.slow
def test_an_address_in_each_place_of_each_command(tmp_path, capsys, monkeypatch):
    """The kinds of address in turn."""
    rows = [(line, ADDRESSES[k % len(ADDRESSES)]) for k, line in enumerate(lines(joined=False))]
    assert len(rows) > 200
    check(rows, tmp_path, capsys, monkeypatch)


@pytest.mark.campaign
def test_each_address_in_each_place_of_each_command(tmp_path, capsys, monkeypatch):
    check(
        [(line, address) for line in lines(joined=True) for address in ADDRESSES],
        tmp_path,
        capsys,
        monkeypatch,
    )
