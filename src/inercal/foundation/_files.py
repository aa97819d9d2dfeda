"""Files out: whole or not at all. Small files in: no pipes."""

from __future__ import annotations

import errno
import os
import stat
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, Any

from inercal.foundation.errors import InputError


def is_pipe(path: str | Path) -> bool:
    """True for a pipe, a socket or a device: what can be read once, and may be waited for without end."""
    return os.path.exists(path) and not os.path.isfile(path) and not os.path.isdir(path)


def read_bytes(path: str | Path) -> bytes:
    """The bytes of a file; raises `OSError`, also for what `is_pipe`."""
    if is_pipe(path):
        raise OSError(errno.ESPIPE, "it is a pipe or a device, not a file", str(path))
    with open(path, "rb") as file:
        return file.read()


@contextmanager
def replacing(path: str | Path, mode: str = "wb") -> Iterator[IO[Any]]:
    """Open a temporary file beside ``path`` that takes its place only when the block ends without error.

    A link stays a link, the file it points to is replaced; a device or a pipe is written to directly.
    Raises `InputError` where the folder is missing or cannot be written, or the disk is full.
    """
    encoding = None if "b" in mode else "utf-8"
    if is_pipe(path):
        try:
            with open(path, mode, encoding=encoding) as file:
                yield file
        except OSError as error:
            raise _refused(path, error) from error
        return
    try:
        target = Path(os.path.realpath(path))
        handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.name}.")
    except (OSError, ValueError) as error:  # ValueError: a NUL in the path
        raise _refused(path, error) from error
    try:
        with os.fdopen(handle, mode, encoding=encoding) as file:
            yield file
            file.flush()
            os.fsync(file.fileno())
        os.chmod(name, _permissions(target))
        os.replace(name, target)
    except OSError as error:
        raise _refused(path, error) from error
    finally:
        with suppress(FileNotFoundError):
            os.unlink(name)


def _refused(path: str | Path, error: Exception) -> InputError:
    """The refusal of a file, with the words of the operating system."""
    shown = repr(str(path)) if "\0" in str(path) else path
    return InputError(shown, f"cannot be written ({getattr(error, 'strerror', None) or error})")


def _permissions(target: Path) -> int:
    """Permissions of the replaced file, so that private stays private; of a new file those that the mask leaves."""
    try:
        return stat.S_IMODE(target.stat().st_mode)
    except FileNotFoundError:
        return 0o666 & ~_umask()


def _umask() -> int:
    """The process's file mode mask (which can only be read by setting it)."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def write_text(path: str | Path, text: str) -> None:
    """Write a UTF-8 text file, whole or not at all; raises `InputError`."""
    with replacing(path, "w") as file:
        file.write(text)


def write_bytes(path: str | Path, data: bytes) -> None:
    """Write a file, whole or not at all; raises `InputError`."""
    with replacing(path) as file:
        file.write(data)
