"""No home, no locale, no rights, nobody who reads: what a command is asked for it does, or says in one line why not."""

import io
import json
import os
import subprocess
import sys
import tempfile
from contextlib import contextmanager
from pathlib import Path

import pytest
from new_studies import FILL

from inercal.cli import run
from inercal.cli.tree import COMMANDS as TREE
from inercal.foundation._files import write_text
from inercal.foundation.errors import InputError

pytestmark = pytest.mark.skipif(os.name == "nt", reason="rights, pipes and signals as on POSIX")
COMMAND = [sys.executable, "-m", "inercal"]
NOBODY = 65534
LOG = "t [s],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2]\n" + "".join(
    f"{i / 10},0.{i % 7},0.{i % 5},9.8{i % 3}\n" for i in range(200)
)


@contextmanager
def without_rights():
    """A folder that may be read and not be written, also by whoever is root: he is nobody as long as this lasts."""
    with tempfile.TemporaryDirectory(dir="/tmp") as name:
        folder = Path(name)
        (folder / "result.txt").write_text("old")
        (folder / "log.csv").write_text(LOG)
        folder.chmod(0o555)
        root = os.geteuid() == 0
        if root:
            os.seteuid(NOBODY)
        try:
            yield folder
        finally:
            if root:
                os.seteuid(0)
            folder.chmod(0o755)


def test_a_folder_without_permission():
    with without_rights() as folder:
        with pytest.raises(InputError, match=r"result\.txt: cannot be written \(Permission denied\)"):
            write_text(folder / "result.txt", "new")
        assert sorted(path.name for path in folder.iterdir()) == ["log.csv", "result.txt"]
        assert (folder / "result.txt").read_text() == "old"


@pytest.mark.parametrize(
    "words",
    [
        ["monitor", "log.csv", "--checkpoint", "state"],
        ["inspect", "log.csv", "--report", "log.html"],
        ["new", "imu", "--out", "imu.toml"],
        ["schema", "--out", "schema.json"],
    ],
)
def test_a_command_that_may_not_write_says_so(words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("log.csv").write_text(LOG)
    assert run(words) == 0  # loads what it needs: nobody may have no right to read it
    capsys.readouterr()
    with without_rights() as folder:
        os.chdir(folder)
        assert run(words) == 2
        assert sorted(path.name for path in folder.iterdir()) == ["log.csv", "result.txt"]
        os.chdir("/")
    out, err = capsys.readouterr()
    assert (out, err) == ("", f"inercal: error: {words[-1]}: cannot be written (Permission denied)\n")


def plain(**environment: str) -> dict[str, str]:
    """The environment that a process cannot do without, and what is given."""
    kept = {key: os.environ[key] for key in ("PATH", "PYTHONPATH", "LD_LIBRARY_PATH") if key in os.environ}
    return {**kept, **environment}


@pytest.mark.parametrize(
    "environment",
    [
        {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
        {"HOME": "/nonexistent", "XDG_CACHE_HOME": "/nonexistent/cache", "MPLCONFIGDIR": "/proc/none"},
        {"TZ": "Nowhere/At_all", "SOURCE_DATE_EPOCH": "no number", "COLUMNS": "0", "TERM": "dumb"},
    ],
    ids=["no locale", "no home", "no time"],
)
def test_a_poor_environment(environment, tmp_path):
    (tmp_path / "größe °.csv").write_text(LOG)
    done = subprocess.run(
        [*COMMAND, "inspect", "größe °.csv", "--report", "r.html"], cwd=tmp_path, env=plain(**environment),
        capture_output=True, timeout=120, check=False,
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    assert b"acc_x" in done.stdout
    assert b"Traceback" not in done.stderr
    assert (tmp_path / "r.html").read_text("utf-8").rstrip().endswith("</html>")


@pytest.mark.parametrize(
    ("words", "code"),
    [("schema", 0), ("--help", 0), ("calibrate imu --help", 0), ("inspect log.csv --json", 0)],
)
def test_a_reader_that_leaves_hears_nothing_and_changes_no_exit_code(words, code, tmp_path):
    (tmp_path / "log.csv").write_text(LOG)
    read, write = os.pipe()
    os.close(read)
    with os.fdopen(write, "wb") as closed:
        done = subprocess.run(
            [*COMMAND, *words.split()],
            cwd=tmp_path,
            stdout=closed,
            stderr=subprocess.PIPE,
            timeout=60,
            check=False,
        )
    assert done.returncode == code
    assert b"error" not in done.stderr
    assert b"Traceback" not in done.stderr


def test_a_bad_verdict_is_one_also_where_the_reader_left(tmp_path, capsys, monkeypatch):
    """The exit code of a command is known only once its result is out."""
    from inercal.examples import EXAMPLES, FOLDER

    def left(*arguments, **options):
        if options.get("file") is None:
            raise BrokenPipeError

    monkeypatch.setattr("builtins.print", left)
    command = EXAMPLES["mpu6050"].command(str(FOLDER)).split()[1:]
    assert run([*command, "--end", "60 s", "--quiet"]) == 1


@pytest.mark.parametrize(
    "name", ["with space.csv", "ü°.csv", "-dash.csv", "new\nline.csv", "quote'\".csv", "a,b.csv"]
)
def test_odd_names(name, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path(name).write_text(LOG)
    assert run(["inspect", f"./{name}", "--json"]) == 0
    assert "acc_x" in capsys.readouterr().out
    assert run(["inspect", f"./no{name}"]) == 2
    err = capsys.readouterr().err
    assert err.startswith("inercal: error: ")
    assert err.count("\n") == 1


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        ("inspect PIPE.csv", "found a pipe or a device, expected a recording in a file"),
        ("inspect log.csv --map PIPE.toml", "it is a pipe or a device, not a file"),
        ("sensitivity PIPE.toml", "it is a pipe or a device, not a file"),
        ("sensitivity turntable.toml --set positions.file=PIPE.csv", "found a pipe or a device"),
        ("compare PIPE.json PIPE.json", "it is a pipe or a device, not a file"),
        ("convert PIPE.json --from imucal --out cal.json", "it is a pipe or a device, not a file"),
        ("monitor log.csv --checkpoint PIPE", "it is a pipe or a device, not a file"),
    ],
)
def test_a_pipe_as_a_file_is_refused(words, expected, tmp_path, monkeypatch, capsys):
    """A file is read more than once; a pipe would be waited for without end."""
    monkeypatch.chdir(tmp_path)
    Path("log.csv").write_text(LOG)
    assert run(["new", "turntable", "--quiet", *FILL]) == 0
    os.mkfifo(next(word.rpartition("=")[2] for word in words.split() if "PIPE" in word))
    capsys.readouterr()
    assert run([*words.split(), "--quiet"]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert "PIPE" in err
    assert expected in err


def changed_while_read(monkeypatch, change) -> None:
    """Let a file change after its rows were read, before its checksum is taken."""
    import inercal.foundation.records.read as reading

    source_of = reading.source_of

    def later(path):
        change(Path(path))
        return source_of(path)

    monkeypatch.setattr(reading, "source_of", later)


def test_a_file_that_grows_while_it_is_read_is_said(tmp_path, monkeypatch, capsys):
    """Rows and checksum of a result belong together, or it says that they may not."""
    (tmp_path / "log.csv").write_text(LOG)
    assert run(["inspect", str(tmp_path / "log.csv"), "--json"]) == 0
    calm = json.loads(capsys.readouterr().out)
    with monkeypatch.context() as patch:
        changed_while_read(patch, lambda path: path.write_text(LOG + "20.0,0,0,9.8\n"))
        assert run(["inspect", str(tmp_path / "log.csv"), "--json"]) == 0
    data = json.loads(capsys.readouterr().out)
    assert "file_changed" not in [finding["code"] for finding in calm["findings"]]
    assert "file_changed" in [finding["code"] for finding in data["findings"]]
    assert data["inputs"][0]["sha256"] != calm["inputs"][0]["sha256"]


def test_a_file_that_vanishes_while_it_is_read(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("log.csv").write_text(LOG)
    changed_while_read(monkeypatch, lambda path: path.unlink())
    assert run(["inspect", "log.csv", "--out", "log.json"]) == 2
    assert capsys.readouterr().err == "inercal: error: log.csv: cannot be read (No such file or directory)\n"
    assert not Path("log.json").exists()


def test_two_processes_on_one_checkpoint(tmp_path, monkeypatch, capsys):
    """The second is refused in one line; the first is not disturbed, and whoever comes after it goes on."""
    monkeypatch.chdir(tmp_path)
    head, *rows = LOG.splitlines(keepends=True)
    Path("log.csv").write_text(LOG)
    assert run(["monitor", "log.csv"]) == 0
    wanted = capsys.readouterr().out.splitlines()
    with subprocess.Popen(
        [*COMMAND, "monitor", "--checkpoint", "state", "--quiet"],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as first:
        assert first.stdin is not None
        assert first.stdout is not None
        first.stdin.write(head + "".join(rows[:100]))
        first.stdin.flush()
        said = [first.stdout.readline() for _ in range(50)]  # it is at work
        assert run(["monitor", "log.csv", "--checkpoint", "state"]) == 2
        err = capsys.readouterr().err
        assert err == "inercal: error: state: is in use by another run, expected a checkpoint for each\n"
        first.stdin.close()
        said += first.stdout.readlines()
        assert first.wait(60) == 0
    assert "".join(said).splitlines() == wanted[:101]
    assert run(["monitor", "log.csv", "--checkpoint", "state", "--quiet"]) == 0
    assert capsys.readouterr().out.splitlines()[1:] == wanted[101:]
    assert not Path("state.lock").exists()


@pytest.mark.parametrize("command", TREE, ids=" ".join)
def test_help_on_a_terminal_that_knows_ascii_alone(command, monkeypatch):
    """What it cannot spell is escaped; results are looked at in test_killed_while_writing.py."""
    screen = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", screen)
    assert run([*filter(None, command), "--help"]) == 0
    screen.flush()
    assert b"Example: inercal " in screen.buffer.getvalue()


def test_a_line_without_end(tmp_path, capsys):
    (tmp_path / "long.csv").write_text("1234567 " * 1_000_000)
    assert run(["inspect", str(tmp_path / "long.csv")]) == 2
    assert capsys.readouterr().err.count("\n") == 1
