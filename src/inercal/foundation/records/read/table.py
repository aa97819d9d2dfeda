"""The contract of the file formats: the request to a reader, and the table that it returns."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Protocol

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.records.channels import Channel, Origin
from inercal.foundation.records.frames import Frame

LARGEST = 1e30
"""Limit that no sensor reads in any unit: a larger value counts as missing, as infinity does, and powers of it do not
overflow."""


@dataclass(frozen=True)
class FileOptions:
    """Stated layout of a file; the reader finds out from the file what is None.

    ``delimiter`` " " is any run of blanks; ``comment`` begins lines to pass over (``#`` and ``%`` if None);
    ``skip`` counts lines before the header, or bytes of a binary file; ``variable`` is the array of a file that holds
    several. ``transpose``: rows are channels. A raw ``binary`` file has a type of NumPy for each of its ``fields``, and
    where its rows are frames, with sync bytes and check, a ``frame``. Lines that are no rows of cells: ``json``
    objects or ``documents``, those that begin with the word of a ``message``, or a ``pattern`` of words, {} for each
    number.
    """

    delimiter: str | None = None
    decimal: str | None = None
    comment: str | None = None
    skip: int = 0
    variable: str | None = None
    transpose: bool = False
    binary: tuple[str, ...] = ()
    fields: tuple[str, ...] = ()
    frame: Frame | None = None
    lines: str = ""
    message: str = ""
    pattern: tuple[str, ...] = ()


@dataclass(frozen=True)
class FileShare:
    """A file's share of a map: its options and the channels wanted from it.

    ``name`` and ``path`` are those of ``[file.NAME]``, empty for the plain ``[columns]``. ``channels`` is
    None without a map: the file's own header must then name quantities and units.
    """

    channels: tuple[Channel, ...] | None
    options: FileOptions = FileOptions()
    name: str = ""
    path: str = ""


@dataclass(frozen=True)
class RawTable:
    """Raw columns of one file, or those of one clock where a file has several.

    ``values`` holds an array (n,) for each channel found, as in the file, before sign, scale and unit; what
    is missing, infinite or beyond `LARGEST` is NaN and is in ``findings``, with rows that could not be read.
    ``contents`` says in words what the file holds, for the error about a channel that is not there.
    ``clock`` (n,) [s] is the time axis that the file states for these columns, where no column t is wanted.
    """

    channels: tuple[Channel, ...]
    values: Mapping[str, Array]
    contents: str
    rows: int
    labels: tuple[str, ...] = field(default=(), repr=False)
    findings: tuple[Finding, ...] = ()
    clock: Array | None = field(default=None, repr=False)


@dataclass(frozen=True)
class FirstLook:
    """A first look at an array of a file, to guess a map from.

    ``values`` (n, k) are its columns (text is NaN), ``names`` (k,) its header and ``units`` (k,) those stated
    beside the names, if any; ``leading`` holds the lines passed over by ``options.skip``. Columns ``numbered`` are
    found by their number alone: their names stand in those lines. ``texts`` are columns, by index, of words,
    and ``stated`` what else the file says, a line each, such as ``Fs = 100``. ``origins`` (k,) are columns of
    several arrays, looked at together.
    """

    values: Array
    names: tuple[str, ...]
    options: FileOptions
    variable: str = ""
    leading: tuple[str, ...] = ()
    units: tuple[str | None, ...] = ()
    numbered: bool = False
    texts: Mapping[int, tuple[str, ...]] = field(default_factory=dict, repr=False)
    stated: tuple[str, ...] = ()
    origins: tuple[Origin, ...] = ()

    @cached_property
    def times_named(self) -> Counter[str]:
        """Counts of the names in the header; empty where none is a name."""
        return Counter(self.names) if any(self.names) else Counter()

    def origin(self, index: int) -> Origin:
        """The name of a column in a map."""
        if self.origins:
            return self.origins[index]
        if self.times_named:
            alone = not self.numbered and self.times_named[self.names[index]] == 1
            return self.names[index] if alone else index
        return (self.variable, index) if self.variable else index


class Reader(Protocol):
    """A module that reads files as a map describes them."""

    def read(
        self,
        path: Path,
        options: FileOptions,
        channels: tuple[Channel, ...] | None,
        progress: Callable[[int], None],
    ) -> list[RawTable]:
        """Read those of the channels that the file holds; ``progress`` is told the bytes done.

        A table for each clock, one at least. Without ``channels``, those that the file itself names.
        """


class Format(Reader, Protocol):
    """A module that knows one file format."""

    def header(self, path: Path) -> tuple[Channel, ...]:
        """The channels that the file itself names, with units; raises `InputError` where it names none."""

    def peek(self, path: Path) -> list[FirstLook]:
        """Look at the beginning of each array in the file."""
