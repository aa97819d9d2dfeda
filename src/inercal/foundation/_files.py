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


def input_bytes(path: str | Path, expected: str, refusal: type[InputError] = InputError) -> bytes:
    """The bytes of a file that was named; raises ``refusal``, which ends in what was ``expected``."""
    try:
        return read_bytes(path)
    except OSError as error:
        raise refusal(path, f"cannot be read ({error.strerror or error}), expected {expected}") from error
    except ValueError as error:  # a NUL in the path
        raise refusal(repr(str(path)), f"{error}, expected {expected}") from error


def input_text(path: str | Path, expected: str, refusal: type[InputError] = InputError) -> str:
    """The text, in UTF-8, of a file that was named; raises as `input_bytes`."""
    try:
        return input_bytes(path, expected, refusal).decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise refusal(path, f"byte {error.start} is not UTF-8 text, expected {expected}") from error


def make_folder(folder: Path) -> None:
    """Make a folder, and those it lies in, unless it is there; raises `InputError`."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(
            folder, f"cannot be made ({error.strerror}), expected a folder that can be written"
        ) from error


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
        return 0o666 & ~umask()


def umask() -> int:
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
