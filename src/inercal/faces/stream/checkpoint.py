"""The state of a recursive estimator on disk: saved whole or not at all, read back bit for bit.

A state is a NamedTuple, a dataclass or a mapping of arrays, integers, floats, truth values and texts, or of
such states. The file holds one line with the version and a hash of all that follows, one line of JSON with
the scalars and the shapes, and then the numbers of the arrays as they are in memory (little-endian).
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import os
import stat
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar, cast

import numpy as np

from inercal.foundation._files import input_bytes, write_bytes
from inercal.foundation.errors import InputError

S = TypeVar("S")

_MAGIC = b"inercal checkpoint "
_VERSION = b"1"
_NUMBERS = "fiub"


def save(path: str | Path, kind: str, fingerprint: str, state: object) -> None:
    """Write a state, a NamedTuple, dataclass or mapping, in the place of an older one.

    ``kind`` is the estimator of the state, such as ``monitor``; ``fingerprint`` that of all on which its meaning
    depends. Raises `InputError` where the file cannot be written; an older one is then as it was.
    """
    write_bytes(path, _encoded({"kind": kind, "fingerprint": fingerprint, "state": state}))


def load(path: str | Path, kind: str, fingerprint: str, like: S) -> S:
    """Read a state that `save` wrote with that ``kind`` and ``fingerprint``.

    ``like`` is a state of the same form, such as the initial one: its types are those of the result, its arrays may
    have other lengths. Raises `InputError` without a file, for no checkpoint, a damaged one, or one of another kind, of
    other settings or of another form.
    """
    data = input_bytes(path, "a checkpoint")
    head, _, body = data.partition(b"\n")
    words = head.removeprefix(_MAGIC).split()
    if not head.startswith(_MAGIC) or len(words) != 2:
        raise InputError(path, "is no checkpoint, expected one or the name of a new file")
    if words[0] != _VERSION:
        version = words[0][:9].decode("ascii", "replace")
        raise InputError(
            path, f"is a checkpoint of format {version}, expected {_VERSION.decode()}, or a new file"
        )
    if words[1] != hashlib.sha256(body).hexdigest().encode():
        raise InputError(path, "is a damaged checkpoint, expected it whole: remove it to begin anew")
    leaves = _decoded(body)
    if leaves.pop("kind") != kind:
        raise InputError(path, f"is a checkpoint of another command, expected one of {kind}")
    if leaves.pop("fingerprint") != fingerprint:
        raise InputError(
            path, "is a checkpoint of other settings or inputs, expected the same ones, or another file"
        )
    expected = dict(_leaves({"state": like}))
    if {name: _form(leaf) for name, leaf in leaves.items()} != {
        name: _form(leaf) for name, leaf in expected.items()
    }:
        raise InputError(path, "is a checkpoint of another version of inercal, expected one of this version")
    return cast(S, _rebuilt(like, "state", leaves))


@contextmanager
def alone(path: str | Path) -> Iterator[None]:
    """Keep a checkpoint from other runs as long as the block lasts.

    A file ``PATH.lock`` is locked meanwhile, where the system and the file system have such locks (not on Windows).
    They end with the process, however it ends; the file is then left, and harms nobody.

    Raises `InputError` where another run has it, the file cannot be written, or one of the lock's name is somebody's:
    a link, or not empty.
    """
    try:
        import fcntl
    except ImportError:
        yield
        return
    lock = Path(f"{os.path.realpath(path)}.lock")
    try:
        file = os.open(lock, os.O_RDWR | os.O_CREAT | os.O_NOFOLLOW | os.O_NONBLOCK | os.O_CLOEXEC, 0o666)
    except OSError as error:
        if lock.is_symlink():
            raise InputError(lock, "is a link, expected no file of that name beside a checkpoint") from error
        raise InputError(path, f"cannot be written ({error.strerror or error})") from error
    try:
        status = os.fstat(file)
        if status.st_size or not stat.S_ISREG(status.st_mode):
            raise InputError(
                lock, "is not empty or no file, expected no file of that name beside a checkpoint"
            )
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            # locked, but no longer the file of that name: its owner has just ended, and removed it
            if not os.path.samestat(status, os.stat(lock)):
                raise BlockingIOError
        except (BlockingIOError, FileNotFoundError) as error:
            raise InputError(path, "is in use by another run, expected a checkpoint for each") from error
        except OSError:
            pass  # no locks on this file system
        try:
            yield
        finally:
            lock.unlink(missing_ok=True)
    finally:
        os.close(file)


def fingerprint(settings: object) -> str:
    """SHA-256 over settings: a state in the sense of `save`, its names included."""
    return hashlib.sha256(_encoded({"settings": settings})).hexdigest()


def _fields(state: object) -> Mapping[str, Any] | None:
    """The named parts of a state, None for a leaf."""
    if isinstance(state, Mapping):
        return {str(name): part for name, part in state.items()}
    if isinstance(state, tuple) and hasattr(state, "_asdict"):
        return cast(Mapping[str, Any], state._asdict())
    if dataclasses.is_dataclass(state):
        return {field.name: getattr(state, field.name) for field in dataclasses.fields(state)}
    return None


def _leaves(state: object, name: str = "") -> Iterator[tuple[str, Any]]:
    """Dotted names and values of the leaves of a state, scalars as Python's own."""
    fields = _fields(state)
    if fields is not None:
        for part, value in fields.items():
            yield from _leaves(value, f"{name}.{part}" if name else part)
    elif isinstance(state, np.ndarray) and state.dtype.kind in _NUMBERS:
        yield name, state
    elif isinstance(state, np.generic) and state.dtype.kind in _NUMBERS:
        yield name, state.item()
    elif isinstance(state, bool | int | float | str):
        yield name, state
    else:
        raise TypeError(f"{name} is a {type(state).__name__}, which no checkpoint can hold")


def _form(leaf: object) -> object:
    """Form of a state: two of one form agree in it."""
    return (leaf.dtype.newbyteorder("<").str, leaf.ndim) if isinstance(leaf, np.ndarray) else type(leaf)


def _encoded(state: object) -> bytes:
    """A state as the contents of a file."""
    scalars: dict[str, Any] = {}
    arrays: list[tuple[str, str, tuple[int, ...]]] = []
    numbers = []
    for name, leaf in _leaves(state):
        if isinstance(leaf, np.ndarray):
            little = leaf.astype(leaf.dtype.newbyteorder("<"), copy=False)
            arrays.append((name, little.dtype.str, leaf.shape))
            numbers.append(little.tobytes())
        else:
            scalars[name] = leaf
    # Python writes a float in the fewest digits that read back the same, nan and inf by name
    head = json.dumps({"scalars": scalars, "arrays": arrays}).encode() + b"\n"
    body = b"".join([head, *numbers])
    return b"%b%b %b\n%b" % (_MAGIC, _VERSION, hashlib.sha256(body).hexdigest().encode(), body)


def _decoded(body: bytes) -> dict[str, Any]:
    """Leaves by dotted name; the hash has said that they are as they were written."""
    head, _, numbers = body.partition(b"\n")
    content = json.loads(head)
    leaves, at = dict(content["scalars"]), 0
    for name, dtype, shape in content["arrays"]:
        size = int(np.prod(shape, dtype=np.int64)) * np.dtype(dtype).itemsize
        little = np.frombuffer(numbers[at : at + size], dtype).reshape(shape)
        leaves[name] = little.astype(little.dtype.newbyteorder("="))  # a copy, which can be written to
        at += size
    return leaves


def _rebuilt(like: object, name: str, leaves: Mapping[str, Any]) -> Any:
    """A state of the type of ``like`` from its leaves."""
    fields = _fields(like)
    if fields is None:
        return leaves[name]
    parts = {part: _rebuilt(value, f"{name}.{part}", leaves) for part, value in fields.items()}
    return parts if isinstance(like, Mapping) else cast(Any, type(like))(**parts)
