"""Objects of a store: files by the SHA-256 of their bytes, ``ab/abcd...``, written whole and never changed."""

from __future__ import annotations

import hashlib
import os
import stat
from collections.abc import Iterable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

from inercal.foundation._files import is_pipe, make_folder, replacing
from inercal.foundation.addresses import hidden_in
from inercal.foundation.errors import InputError, MissingExtraError

_PIECE = 1 << 22
"""Bytes that are read at a time."""


@dataclass(frozen=True)
class Objects:
    """The folder of objects: a path, or a URL of fsspec such as ``s3://bucket/objects``."""

    where: str

    @cached_property
    def _folder(self) -> tuple[Any, str]:
        """File system and path within it."""
        import fsspec

        try:
            system, path = fsspec.core.url_to_fs(self.where)
        except ImportError as error:
            raise MissingExtraError(f"objects at {self.where.split('://')[0]}://", "s3") from error
        except ValueError as error:
            said = hidden_in(str(error), self.where)
            raise InputError(
                self.where, f"{said}, expected a folder or a URL such as s3://bucket/objects"
            ) from error
        return system, path.rstrip("/")

    def _said(self, error: OSError) -> str:
        """The words of a file system, without the secrets of the address."""
        return hidden_in(error.strerror or str(error), self.where)

    @property
    def local(self) -> bool:
        """True if the objects are files of this machine."""
        return "://" not in self.where

    def place(self, sha256: str) -> str:
        """Path or URL of an object."""
        return f"{self.where.rstrip('/')}/{sha256[:2]}/{sha256}"

    def add(self, data: bytes) -> str:
        """Keep an object, unless it is there; the SHA-256 of its bytes."""
        sha256 = hashlib.sha256(data).hexdigest()
        if not self.has(sha256, len(data)):
            self._write(sha256, [data])
        return sha256

    def add_file(self, path: Path, sha256: str) -> int:
        """Keep a file of that SHA-256, unless it is there; its size.

        Raises `InputError` where it is another file, or cannot be read.
        """
        if is_pipe(path):
            raise InputError(path, "is a pipe or a device, expected a file")
        try:
            size = path.stat().st_size
            if not self.has(sha256, size):
                with open(path, "rb") as file:
                    if hashlib.file_digest(file, "sha256").hexdigest() != sha256:
                        raise InputError(
                            path, "was changed after the result was made, expected the file as it was then"
                        )
                    file.seek(0)
                    self._write(sha256, iter(lambda: file.read(_PIECE), b""))
        except OSError as error:
            raise InputError(path, f"cannot be read ({error.strerror})") from error
        return size

    def _write(self, sha256: str, pieces: Iterable[bytes]) -> None:
        """Write an object whole, read-only."""
        if not self.local:
            system, path = self._folder
            try:
                system.makedirs(f"{path}/{sha256[:2]}", exist_ok=True)
                system.pipe_file(f"{path}/{sha256[:2]}/{sha256}", b"".join(pieces))
            except OSError as error:
                raise InputError(self.place(sha256), f"cannot be written ({self._said(error)})") from error
            return
        target = Path(self.place(sha256))
        make_folder(target.parent)
        with replacing(target) as file:
            file.writelines(pieces)
        with suppress(OSError):  # a file system without modes
            os.chmod(target, stat.S_IRUSR | stat.S_IRGRP | stat.S_IROTH)

    def remove(self, sha256: str) -> None:
        """Delete an object that holds what may not be kept; raises `InputError` where it cannot be deleted."""
        try:
            if self.local:
                Path(self.place(sha256)).unlink(missing_ok=True)
            else:
                system, path = self._folder
                system.rm_file(f"{path}/{sha256[:2]}/{sha256}")
        except FileNotFoundError:
            return
        except OSError as error:
            raise InputError(self.place(sha256), f"cannot be deleted ({self._said(error)})") from error

    def has(self, sha256: str, size: int) -> bool:
        """True if an object of that size is there."""
        try:
            found = Path(self.place(sha256)).stat().st_size if self.local else self._size(sha256)
        except (FileNotFoundError, NotADirectoryError):
            return False
        except OSError as error:
            raise InputError(self.place(sha256), f"cannot be read ({self._said(error)})") from error
        return found == size

    def _size(self, sha256: str) -> int:
        """Size of an object that is not of this machine."""
        system, path = self._folder
        return int(system.size(f"{path}/{sha256[:2]}/{sha256}"))

    def read(self, sha256: str) -> bytes:
        """The bytes of an object; raises `InputError` where it is missing, or is not what its name says."""
        return b"".join(self.pieces(sha256))

    def pieces(self, sha256: str) -> Iterator[bytes]:
        """The bytes of an object in pieces; raises `InputError` as `read`, at the end for one that was changed."""
        digest = hashlib.sha256()
        try:
            with self._opened(sha256) as file:
                while piece := file.read(_PIECE):
                    digest.update(piece)
                    yield piece
        except FileNotFoundError as error:
            raise InputError(self.place(sha256), "is missing, expected an object of the store") from error
        except OSError as error:
            raise InputError(self.place(sha256), f"cannot be read ({self._said(error)})") from error
        if digest.hexdigest() != sha256:
            raise InputError(
                self.place(sha256), f"has the SHA-256 {digest.hexdigest()[:12]}..., expected that of its name"
            )

    def _opened(self, sha256: str) -> Any:
        """An object opened; fsspec takes a while to load, and files of this machine need none of it."""
        if self.local:
            return open(self.place(sha256), "rb")
        system, path = self._folder
        return system.open(f"{path}/{sha256[:2]}/{sha256}", "rb")

    def names(self) -> set[str]:
        """The SHA-256 of every object."""
        if self.local:
            names = {name for _, _, files in os.walk(self.where) for name in files}
        else:
            system, path = self._folder
            try:
                names = {each.rpartition("/")[2] for each in system.find(path)}
            except FileNotFoundError:
                return set()
        return {name for name in names if not name.startswith(".")}  # left by a writer that was killed
