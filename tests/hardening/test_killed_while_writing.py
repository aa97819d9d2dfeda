"""Killed, or out of disk, at any moment of writing: the old file or the new one is there, and nothing between.

A command is disturbed in forks of its process. A limit on the size of files stands for a full disk (the system then
refuses to write on) and, where its signal is left to kill, for a kill in the middle of a write.
"""

import gzip
import io
import json
import os
import resource
import shlex
import signal
import sys
import tempfile
import threading
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import IO

import numpy as np
import pytest
from certified import LAB
from made import result
from new_studies import FILL

from inercal.cli import main, run
from inercal.cli.tree import COMMANDS as TREE
from inercal.examples import EXAMPLES, FOLDER
from inercal.foundation.computing.executors import Serial
from inercal.foundation.records.read import read
from inercal.foundation.results.files import save
from inercal.laboratory.catalog import results
from inercal.laboratory.store import open_store

pytestmark = [
    pytest.mark.skipif(os.name == "nt", reason="forks and signals as on POSIX"),
    pytest.mark.usefixtures("undrawn"),
]

MKSTEMP = tempfile.mkstemp
OLD = b"what was there before\n" * 50
LIMIT = 400
"""Bytes after which the disk is full: less than any of the files."""

SMALL = "--set design.turns=1 --set design.time='300 s' --set design.angle='180 deg'"
COMMANDS = {
    "new imu": "new imu --out NEW.toml",
    "new strapdown": "new strapdown --out NEW.toml",
    "new turntable": "new turntable --out NEW.toml",
    "new selfcal": "new selfcal --out NEW.toml",
    "new aoa": "new aoa --out NEW.toml",
    "new lab": "new lab --out NEW.toml",
    "inspect": "inspect log.csv --report NEW.html",
    "inspect result": "inspect log.csv --out NEW.json",
    "calibrate imu": "calibrate imu log.csv --study imu.toml --out NEW.json --report NEW.html",
    "calibrate strapdown": "calibrate strapdown unit.csv --study strapdown.toml --out NEW.json --report NEW.html",
    "calibrate turntable": "calibrate turntable table.csv --study turntable.toml --out NEW.toml --report NEW.html",
    "selfcal": "selfcal platform.csv --study selfcal.toml --out NEW.json --report NEW.html",
    "selfcal histories": "selfcal platform.csv --study selfcal.toml --out NEW.npz",
    "aoa": "aoa model.csv --study aoa.toml --out NEW.csv",
    "aoa result": "aoa model.csv --study aoa.toml --out NEW.json",
    "allan": "allan log.csv --out NEW.csv",
    "sensitivity": "sensitivity turntable.toml --out NEW.npz",
    "design positions": "design positions turntable.toml --out NEW.json",
    "design selfcal": f"design selfcal selfcal.toml {SMALL} --out NEW.json",
    "design strapdown": "design strapdown strapdown.toml --out NEW.json",
    "design aoa": "design aoa aoa.toml --set motion.duration='4 s' --out NEW.json",
    "design sections": "design sections sections.csv --out NEW.json",
    "design tolerances": "design tolerances turntable.toml --set goal.DX_F='10 deg/h' --out NEW.json",
    "simulate imu": "simulate imu imu.toml --set site.latitude='39.1 deg' --out NEW.csv",
    "simulate strapdown": "simulate strapdown strapdown.toml --out NEW.csv",
    "simulate turntable": "simulate turntable turntable.toml --out NEW.csv",
    "simulate selfcal": "simulate selfcal selfcal.toml --out NEW.csv",
    "simulate selfcal campaign": "simulate selfcal selfcal.toml --runs 2 --out NEW.json",
    "simulate aoa": "simulate aoa aoa.toml --set motion.duration='1 s' --out NEW.csv",
    "temperature": f"{EXAMPLES['thermal'].command(str(FOLDER)).partition(' ')[2]} --out NEW.json",
    "apply csv": "apply cal.json log.csv --out NEW.csv",
    "apply npz": "apply cal.json log.csv --out NEW.npz",
    "apply h5": "apply cal.json log.csv --out NEW.h5",
    "apply nc": "apply cal.json log.csv --out NEW.nc",
    "apply parquet": "apply cal.json log.csv --out NEW.parquet",
    "compare": "compare cal.json cal.json --out NEW.json",
    "convert": "convert cal.json --to kalibr --out NEW.yaml",
    "show": "show KEPT --store store --out NEW.json",
    "certificate": "certificate ok.json --lab lab.toml --number 1 --out NEW.xml --html NEW.html",
    "history": "history cal.json --out NEW.json",
    "validate": "validate --out NEW.json",
    "schema": "schema --out NEW.json",
    "completion": "completion bash --out NEW.sh",
    "examples": "examples thermal --out NEW",
}
CREATING = ("new", "examples")
"""Commands that overwrite nothing."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """Studies with small tests, and recordings of them."""
    from inercal.foundation.records.write import write_record
    from inercal.systems.imu.simulate import draw_truth, hand_poses, simulate

    path = tmp_path_factory.mktemp("killed")
    rng = np.random.default_rng(1)
    record, _ = simulate(
        draw_truth(rng), hand_poses(rng, 12), 9.81, 0.8, rng, rate=20.0, start=12.0, hold=2.5, turn=1.5
    )
    write_record(record, path / "log.csv")
    (path / "imu.toml").write_text('[site]\ngravity = "9.81(1) m/s^2"\n[imu]\nstatic_start = "10 s"\n')
    (path / "sections.csv").write_text(
        "section,up\n" + "".join(f"{s}{a},{s}{a}\n" for a in "xyz" for s in "+-")
    )
    for kind in ("strapdown", "turntable", "selfcal", "aoa"):
        assert run(["new", kind, "--out", str(path / f"{kind}.toml"), "--quiet", *FILL]) == 0
    smaller = {
        "strapdown": ('dwell = "20 s"', 'dwell = "2 s"\nsample_rate = "50 Hz"'),
        "turntable": ("phi1 = 36, phi2 = 36", "phi1 = 5, phi2 = 5"),
        "selfcal": ('"0.2 s"', '"2 s"'),
    }
    for kind, (old, new) in smaller.items():
        text = (path / f"{kind}.toml").read_text("utf-8")
        (path / f"{kind}.toml").write_text(text.replace(old, new), "utf-8")
    simulated = {
        "strapdown": "unit.csv",
        "turntable": "table.csv",
        "selfcal": "platform.csv",
        "aoa": "model.csv",
    }
    for kind, name in simulated.items():
        study, short = str(path / f"{kind}.toml"), ["--set", "motion.duration=3 s"] if kind == "aoa" else []
        assert run(["simulate", kind, study, "--out", str(path / name), "--quiet", *short]) == 0
    done = run(["calibrate", "imu", str(path / "log.csv"), "--study", str(path / "imu.toml"),
                "--out", str(path / "cal.json"), "--quiet"])  # fmt: skip
    assert done == 0
    save(result(), path / "ok.json")
    (path / "lab.toml").write_text(LAB)
    store = ["--store", str(path / "store")]
    assert run(["store", "init", *store, "--quiet"]) == 0
    assert run(["keep", str(path / "cal.json"), "--instrument", "17", *store, "--quiet"]) == 0
    return path


def kept(folder: Path) -> str:
    """Identity of the result in the store of the folder."""
    return results(open_store(str(folder / "store")))[0].id


def fork(spoil) -> tuple[list[IO[bytes]], int]:
    """Files that take standard output and error of a fork of this process, and its id; 0 in the fork, once spoiled."""
    said = [tempfile.TemporaryFile() for _ in range(2)]  # noqa: SIM115
    if (child := os.fork()) == 0:
        tempfile.mkstemp = MKSTEMP
        # at the limit Python would keep a compiled module cut off, and fail on it ever after
        sys.dont_write_bytecode = True
        for target, file in enumerate(said, start=1):
            os.dup2(file.fileno(), target)
        sys.stdout, sys.stderr = (open(n, "w", encoding="utf-8", closefd=False) for n in (1, 2))  # noqa: SIM115
        spoil()
    return said, child


def ended(child: int, said: list[IO[bytes]]) -> tuple[int, str, str]:
    """Exit code (that of a signal negative), standard output and error of a fork, once it has ended."""
    status = os.waitpid(child, 0)[1]
    texts = []
    for file in said:
        with file:
            file.seek(0)
            texts.append(file.read().decode())
    return os.waitstatus_to_exitcode(status), texts[0], texts[1]


def forked(command: Callable[[], int], spoil) -> tuple[int, str, str]:
    """The same of a command in a fork of its own."""
    said, child = fork(spoil)
    if child == 0:
        code = 99
        try:
            code = command()
            sys.stdout.flush()
        finally:
            os._exit(code)
    return ended(child, said)


def full() -> None:
    """The disk is full after some bytes."""
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT, LIMIT))


def killed_in_a_write() -> None:
    """The signal of the limit kills in the middle of a write."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGXFSZ, signal.SIG_DFL)
    resource.setrlimit(resource.RLIMIT_FSIZE, (LIMIT, LIMIT))


def killed_before_it_is_in_place() -> None:
    os.replace = lambda *_: os.kill(os.getpid(), signal.SIGKILL)


def killed_once_it_is_in_place() -> None:
    replace = os.replace

    def then_die(*arguments):
        replace(*arguments)
        os.kill(os.getpid(), signal.SIGKILL)

    os.replace = then_die


SPOILS = (full, killed_in_a_write, killed_before_it_is_in_place, killed_once_it_is_in_place)


def is_whole(path: Path) -> bool:
    """True for a file that can be read to its end."""
    match path.suffix:
        case ".json":
            return bool(json.loads(path.read_text("utf-8")))
        case ".toml":
            return bool(tomllib.loads(path.read_text("utf-8")))
        case ".html":
            return path.read_text("utf-8").rstrip().endswith("</html>")
        case ".npz":
            with np.load(path) as arrays:
                return all(arrays[name].size for name in arrays)
        case ".h5" | ".nc" | ".parquet":
            return bool(read(path).columns)
        case ".gz":
            return bool(gzip.decompress(path.read_bytes()))
        case _:
            return path.read_bytes().endswith(b"\n")


def test_no_command_that_writes_is_forgotten(capsys):
    """Whatever has --out is in the list above, whatever has --checkpoint in that of the streams."""
    for verb, kind in TREE:
        words = [word for word in (verb, kind) if word]
        assert run([*words, "--help"]) == 0
        text = capsys.readouterr().out
        for option, listed in (("--out", COMMANDS), ("--checkpoint", STREAMS)):
            there = any(line.split()[: len(words)] == words for line in listed.values())
            if (*words, option) == ("batch", "--out"):
                there = True  # a folder of files for each unit, of which test_fleet kills the writing
            if (*words, option) == ("simulate", "selfcal", "--checkpoint"):
                there = (
                    True  # a folder of one file a run, of which test_killed_while_working stops the writing
                )
            assert (f"{option} PATH:" in text) == there, (words, option)


@pytest.mark.slow
@pytest.mark.parametrize("name", COMMANDS)
def test_the_old_file_or_the_new_one(name, folder, tmp_path, monkeypatch):
    """Whenever a command begins to write, forks of it go on, each to an end of its own; then it ends undisturbed.

    It talks to a terminal that knows ASCII alone.
    """
    for path in folder.iterdir():
        (tmp_path / path.name).symlink_to(path)
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("inercal.faces.validate.run.SYSTEMS", {"foundation": "the quickest"})
    monkeypatch.setattr("inercal.faces.validate.run.executor", Serial)
    arguments = shlex.split(COMMANDS[name].replace("KEPT", kept(folder) if name == "show" else ""))
    old = None if arguments[0] in CREATING else OLD
    parent, written = os.getpid(), []
    begin = tempfile.mkstemp

    def content(path: Path) -> bytes | None:
        return path.read_bytes() if path.exists() else None

    def begin_in_forks(dir, prefix):
        target = Path(dir, prefix[1:-1])
        shown = next(
            word for word in arguments if Path(word).name == target.name or target.parent.name == word
        )
        if shown != target.name:
            shown = f"{shown}/{target.name}"
        before = set(tmp_path.rglob("*"))

        def left() -> set[str]:
            return {path.name for path in set(tmp_path.rglob("*")) - before - {target}}

        for spoil in SPOILS:
            if old is not None:
                target.write_bytes(old)
            said, child = fork(spoil)
            if child == 0:
                return begin(dir=dir, prefix=prefix)
            code, out, err = ended(child, said)
            if spoil is full:
                assert (code, out) == (2, ""), err
                assert err.splitlines()[-1] == f"inercal: error: {shown}: cannot be written (File too large)"
                assert left() == set()
            else:
                assert code == -(signal.SIGXFSZ if spoil is killed_in_a_write else signal.SIGKILL), err
                # what is left of the new one is hidden, and tells whose it is
                assert all(each.startswith(f".{target.name}.") for each in left())
            if spoil is killed_once_it_is_in_place:
                assert is_whole(target)
                assert content(target) != old
            else:
                assert content(target) == old
            target.unlink(missing_ok=True)
        written.append(target)
        return begin(dir=dir, prefix=prefix)

    monkeypatch.setenv("INERCAL_DEBUG", "1")  # what fails in there is to be seen
    monkeypatch.setattr(tempfile, "mkstemp", begin_in_forks)
    code, said = 99, [io.TextIOWrapper(io.BytesIO(), encoding="ascii") for _ in range(2)]
    monkeypatch.setattr(sys, "stdout", said[0])
    monkeypatch.setattr(sys, "stderr", said[1])
    try:
        code = run(arguments)
    finally:
        if os.getpid() != parent:
            sys.stdout.flush()
            os._exit(code)
    for stream in said:
        stream.flush()
    assert code in (0, 1), said[1].buffer.getvalue()
    assert said[0].buffer.getvalue() or arguments[0] in ("schema", "completion")
    assert {path.name for path in written} >= {
        Path(word).name for word in arguments if word.startswith("NEW.")
    }
    for target in written:
        assert is_whole(target)


def test_a_copy_that_was_broken_off_is_made_whole(tmp_path, monkeypatch, capsys):
    """What was killed between two files is done by the same command again; what is not of it stays."""
    monkeypatch.chdir(tmp_path)
    assert run(["examples", "thermal", "--quiet"]) == 0
    whole = {path.name: path.read_bytes() for path in Path("thermal").iterdir()}
    Path("thermal/thermal-map.toml").unlink()
    assert run(["examples", "thermal", "--quiet"]) == 0
    assert {path.name: path.read_bytes() for path in Path("thermal").iterdir()} == whole
    Path("thermal/thermal-map.toml").write_text("mine")
    assert run(["examples", "thermal", "--quiet"]) == 2
    assert Path("thermal/thermal-map.toml").read_text() == "mine"


@pytest.mark.parametrize("signum", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_asked_to_end_in_the_middle_of_a_write(signum, tmp_path):
    """As by Ctrl-C, so by `kill`, a shutdown and a closed terminal: the old file, nothing beside it, exit code 130."""
    target = tmp_path / "schema.json"
    target.write_bytes(OLD)

    def asked() -> None:
        os.fsync = lambda _: os.kill(os.getpid(), signum)

    def command() -> int:
        with pytest.raises(SystemExit) as ended:
            main(["schema", "--out", str(target)])
        return ended.value.code

    assert forked(command, asked) == (130, "", "inercal: interrupted\n")
    assert target.read_bytes() == OLD
    assert list(tmp_path.iterdir()) == [target]


def test_two_runs_at_once_leave_one_whole_file(folder, tmp_path, monkeypatch):
    """Both end well, and the file is that of one of them."""
    monkeypatch.chdir(folder)
    target, wanted = tmp_path / "out.csv", {}
    command = ["simulate", "turntable", "turntable.toml", "--out", str(target), "--quiet"]
    for seed in ("1", "2"):
        assert run([*command, "--seed", seed]) == 0
        wanted[seed] = target.read_bytes()
    assert wanted["1"] != wanted["2"]
    for _ in range(5):
        children = []
        for seed in ("1", "2"):
            if (child := os.fork()) == 0:
                code = 99
                try:
                    code = run([*command, "--seed", seed])
                finally:
                    os._exit(code)
            children.append(child)
        assert [os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]) for child in children] == [0, 0]
        assert target.read_bytes() in wanted.values()
    assert list(tmp_path.iterdir()) == [target]


STREAMS = {
    "monitor": "monitor log.csv",
    "apply": "apply cal.json log.csv --stream",
    "selfcal": "selfcal platform.csv --study selfcal.toml --stream",
    "aoa": "aoa model.csv --study aoa.toml --stream",
    "strapdown": "calibrate strapdown unit.csv --study strapdown.toml --stream",
    "live": "live replay:log.csv?speed=0 --study imu.toml",
}


@pytest.mark.parametrize("name", STREAMS)
@pytest.mark.parametrize(
    "spoil",
    [
        killed_in_a_write,
        pytest.param(killed_before_it_is_in_place, marks=pytest.mark.campaign),
        killed_once_it_is_in_place,
    ],
)
def test_a_stream_killed_while_it_saves_goes_on_with_the_same_digits(
    name, spoil, folder, tmp_path, monkeypatch, capsys
):
    """At the third save: the lines until then, and those of the run that goes on, are those of an undisturbed run."""
    monkeypatch.chdir(folder)
    command = [*STREAMS[name].split(), "--quiet"]
    assert run(command) == 0
    wanted = capsys.readouterr().out.splitlines()
    saves = []

    def at_the_third() -> None:
        import inercal.faces.stream.checkpoint as checkpoint

        write = checkpoint.write_bytes
        signal.signal(signal.SIGXFSZ, signal.SIG_DFL)  # here: a live source saves in another thread

        def spoiled(*arguments):
            saves.append(1)
            if len(saves) == 3:
                spoil()
            write(*arguments)

        checkpoint.write_bytes = spoiled

    state = tmp_path / "state"
    saving = [*command, "--checkpoint", str(state), "--checkpoint-every", "20"]
    monkeypatch.chdir(tmp_path)
    for path in folder.iterdir():
        (tmp_path / path.name).symlink_to(path)
    code, out, err = forked(lambda: run(saving), at_the_third)
    assert code in (-signal.SIGXFSZ, -signal.SIGKILL), err
    first = out.splitlines()
    assert run(saving) == 0
    again = capsys.readouterr().out.splitlines()
    assert again[0] == first[0] == wanted[0]
    assert first[1:] == wanted[1 : len(first)]
    assert again[1:] == wanted[len(wanted) - len(again) + 1 :]
    assert len(first) + len(again) >= len(wanted) + 1  # no line is lost
