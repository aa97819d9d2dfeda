"""Files out: whole or not at all, whatever goes wrong while writing."""

import builtins
import errno
import os
import signal
import subprocess
import sys
import threading

import pytest

from inercal.foundation._files import replacing, write_bytes, write_text
from inercal.foundation.errors import InputError


@pytest.fixture
def old(tmp_path):
    """A folder with one file, whose content is old."""
    path = tmp_path / "result.txt"
    path.write_text("old")
    return path


def only(path, content):
    """That file with that content is all there is in its folder."""
    assert path.read_text() == content
    assert list(path.parent.iterdir()) == [path]


def test_a_new_file_and_one_replaced(tmp_path):
    path = tmp_path / "a.txt"
    write_text(path, "grüße °\n")
    assert path.read_bytes() == "grüße °\n".encode()
    write_bytes(str(path), b"\x00\xff")
    assert path.read_bytes() == b"\x00\xff"
    assert list(tmp_path.iterdir()) == [path]


def test_nothing_is_seen_before_the_end(old):
    with replacing(old) as file:
        file.write(b"new" * 100_000)
        file.flush()
        assert old.read_text() == "old"
    only(old, "new" * 100_000)


def test_readers_see_the_old_or_the_new_and_nothing_between(tmp_path):
    path = tmp_path / "a.txt"
    contents = {letter * 50_000 for letter in "abc"}
    write_text(path, "a" * 50_000)
    stop = threading.Event()

    def write():
        while not stop.is_set():
            for content in contents:
                write_text(path, content)

    writer = threading.Thread(target=write)
    writer.start()
    try:
        seen = {path.read_text() for _ in range(300)}
    finally:
        stop.set()
        writer.join()
    assert seen <= contents


class InterruptedByUserError(Exception):
    pass


@pytest.mark.parametrize("error", [InterruptedByUserError, KeyboardInterrupt, ValueError, SystemExit])
def test_an_error_in_the_block_leaves_everything_as_it_was(old, error):
    def half():
        with replacing(old) as file:
            file.write(b"half")
            raise error

    with pytest.raises(error):
        half()
    only(old, "old")


def test_a_killed_process_leaves_the_old_content(old):
    code = (
        "import os, signal, sys; from inercal.foundation._files import replacing\n"
        "with replacing(sys.argv[1]) as file:\n"
        "    file.write(b'half' * 10_000); file.flush(); os.kill(os.getpid(), signal.SIGKILL)"
    )
    done = subprocess.run([sys.executable, "-c", code, str(old)], check=False)
    assert done.returncode == -signal.SIGKILL
    assert old.read_text() == "old"
    left = [path.name for path in old.parent.iterdir() if path != old]
    assert all(name.startswith(".result.txt.") for name in left)  # hidden, and tells whose it is


# The disk and the folder.


def no_space(*_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


@pytest.mark.parametrize("call", ["fsync", "chmod", "replace"])
def test_a_full_disk_at_the_end(old, monkeypatch, call):
    monkeypatch.setattr(os, call, no_space)
    with pytest.raises(InputError, match=r"result\.txt: cannot be written \(No space left on device\)"):
        write_text(old, "new")
    only(old, "old")


def test_a_full_disk_while_writing(old, monkeypatch):
    """The write itself fails, as do all that follow (the flush on closing)."""
    opened = os.fdopen

    def fdopen(handle, *rest, **more):
        full = os.open("/dev/full", os.O_WRONLY)
        os.dup2(full, handle)
        os.close(full)
        return opened(handle, *rest, **more)

    monkeypatch.setattr(os, "fdopen", fdopen)
    with pytest.raises(InputError, match="No space left on device"):
        write_bytes(old, b"new" * 100_000)
    only(old, "old")


def test_a_full_disk_at_the_start(old, monkeypatch):
    monkeypatch.setattr("tempfile.mkstemp", lambda **_: no_space())
    with pytest.raises(InputError, match="No space left on device"):
        write_text(old, "new")
    only(old, "old")


def test_a_message_even_where_the_system_has_none(old):
    with pytest.raises(InputError, match=r"cannot be written \(out of paper\)"), replacing(old):
        raise OSError("out of paper")


@pytest.mark.parametrize("name", ["none/a.txt", "file/a.txt", "folder", "a\0b", "n" * 300])
def test_places_that_cannot_be_written(tmp_path, name):
    (tmp_path / "file").write_text("kept")
    (tmp_path / "folder").mkdir()
    with pytest.raises(InputError, match="cannot be written") as caught:
        write_text(f"{tmp_path}/{name}", "x")
    assert "\n" not in str(caught.value)
    assert "\0" not in str(caught.value)
    assert sorted(path.name for path in tmp_path.rglob("*")) == ["file", "folder"]
    assert (tmp_path / "file").read_text() == "kept"


# Paths, permissions, links, devices.


def test_a_relative_path(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_text("a.txt", "here")
    (tmp_path / "inner").mkdir()
    write_text("inner/../inner/b.txt", "there")
    assert (tmp_path / "a.txt").read_text() == "here"
    assert (tmp_path / "inner" / "b.txt").read_text() == "there"


@pytest.mark.parametrize("mask", [0o022, 0o077, 0o002, 0o000])
def test_permissions_follow_the_mask(tmp_path, mask):
    """As for a file opened plainly; the temporary file alone would be closed to everybody else."""
    before = os.umask(mask)
    try:
        write_text(tmp_path / "ours", "x")
        with builtins.open(tmp_path / "plain", "w"):
            pass
        assert os.umask(mask) == mask  # and the mask itself is left as it was
    finally:
        os.umask(before)
    assert (tmp_path / "ours").stat().st_mode == (tmp_path / "plain").stat().st_mode


@pytest.mark.parametrize("mode", [0o600, 0o640, 0o666])
def test_permissions_of_a_file_that_is_replaced_stay(old, mode):
    """What its owner has closed to others is not opened by a new result."""
    old.chmod(mode)
    write_text(old, "new")
    only(old, "new")
    assert old.stat().st_mode & 0o777 == mode


def test_a_link_stays_a_link(tmp_path):
    target, link = tmp_path / "deep" / "target.txt", tmp_path / "link.txt"
    target.parent.mkdir()
    target.write_text("old")
    link.symlink_to("deep/target.txt")
    write_text(link, "new")
    assert link.is_symlink()
    assert target.read_text() == "new"


def test_a_link_to_nothing_makes_the_file(tmp_path):
    (tmp_path / "link").symlink_to("target")
    write_text(tmp_path / "link", "new")
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "target").read_text() == "new"


def test_a_pipe_is_written_to_and_stays_a_pipe(tmp_path):
    """And so /dev/null and /dev/stdout, which root could otherwise replace."""
    pipe, received = tmp_path / "pipe", []
    os.mkfifo(pipe)
    reader = threading.Thread(target=lambda: received.append(pipe.read_bytes()))
    reader.start()
    write_text(pipe, "through")
    reader.join(10)
    assert received == [b"through"]
    assert pipe.is_fifo()


def test_a_full_device(tmp_path):
    (tmp_path / "link").symlink_to("/dev/full")
    with pytest.raises(InputError, match="No space left on device"):
        write_text(tmp_path / "link", "x")
    assert (tmp_path / "link").is_symlink()
