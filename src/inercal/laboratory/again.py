"""A kept result made once more: its files and command line restored, and the new result set beside the old."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Literal

from inercal.errors import InputError
from inercal.estimate.result import Estimate
from inercal.laboratory.catalog import SHORT, Shown
from inercal.laboratory.store import Store

_FLAGS = ("--keep", "--json", "--quiet")
_LEFT_OUT = ("--store", "--instrument", "--checkpoint")
_WRITTEN = ("--out", "--report")

Same = Literal["equal", "within u", "changed", "missing", "new"]


@dataclass(frozen=True)
class Restored:
    """Arguments of the command, and the folder to run it in."""

    arguments: tuple[str, ...]
    folder: Path


def restored(store: Store, shown: Shown, folder: Path) -> Restored:
    """Lay the files of a result out below ``folder`` (empty) as they lay when it was made.

    What the command would write goes to ``folder`` too. Raises `InputError` where a file was kept by reference and is
    gone or changed, or the command line is not known, as of a result made in Python.
    """
    arguments = [str(each) for each in shown.estimate.provenance.get("arguments", ())]
    if not arguments:
        raise InputError(
            shown.listed.id[:SHORT],
            "its command line is not known (it was made in Python, or by an older inercal), expected one of a command",
        )
    work = folder / "root" / Path(*["d"] * max(map(_upward, (path for path, _, _ in shown.files)), default=0))
    work.mkdir(parents=True)
    places = {}
    for path, sha256, place in shown.files:
        target = _below(folder / "absolute", path) if _absolute(path) else Path(os.path.normpath(work / path))
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(_bytes(store, path, sha256, place))
        places[path] = str(target) if _absolute(path) else path
    return Restored(tuple(_arguments(arguments, places, folder)), work)


def _upward(path: str) -> int:
    """Count of the folders that a relative path leads up."""
    parts = PurePosixPath(Path(os.path.normpath(path)).as_posix()).parts
    return 0 if _absolute(path) else parts.count("..")


def _absolute(path: str) -> bool:
    """True for a path from the root."""
    return Path(path).is_absolute()


def _below(folder: Path, path: str) -> Path:
    """An absolute path as one below a folder."""
    whole = Path(os.path.normpath(path))
    return folder / whole.relative_to(whole.anchor)


def _bytes(store: Store, path: str, sha256: str, place: str | None) -> bytes:
    """The bytes of a file: of its object, or from where it was kept by reference."""
    if place is None:
        return store.objects.read(sha256)
    import hashlib

    try:
        data = Path(place).read_bytes()
    except OSError as error:
        raise InputError(
            place, f"cannot be read ({error.strerror}), expected {path}, kept by reference"
        ) from error
    if hashlib.sha256(data).hexdigest() != sha256:
        raise InputError(place, f"was changed, expected {path} as it was, kept by reference")
    return data


def _arguments(given: Sequence[str], places: Mapping[str, str], folder: Path) -> list[str]:
    """The command line, its files where they are now, its outputs below ``folder``, and what a rerun needs."""
    found: list[str] = []
    words = iter(given)
    for word in words:
        option, equals, value = word.partition("=") if word.startswith("--") else (word, "", "")
        if option in _FLAGS:
            continue
        if option in (*_LEFT_OUT, *_WRITTEN):
            value = value if equals else next(words, "")
            if option in _WRITTEN:
                found += [option, str(folder / f"{option[2:]}{Path(value).suffix}")]
        elif equals:
            found.append(f"{option}={_where(value, places)}")
        else:
            found.append(_where(word, places))
    return [*found, "--json", "--quiet"]


def _where(word: str, places: Mapping[str, str]) -> str:
    """A word, or the place of the file that it names."""
    for path, place in places.items():
        if os.path.normpath(word) == os.path.normpath(path):
            return place if place != path else word
    return word


@dataclass(frozen=True)
class Beside:
    """A coefficient of both results: how the new value stands to the old."""

    name: str
    old: float
    new: float
    u: float
    unit: str
    same: Same


def beside(old: Estimate, new: Estimate) -> list[Beside]:
    """The coefficients of both, those of the old result first.

    Values and uncertainties are ``equal`` to the last digit, ``within u`` where the value moved by at most u of the old
    result, else ``changed``.
    """
    rows = []
    for name, p in old.parameters.items():
        if name not in new.parameters:
            rows.append(Beside(name, p.value, float("nan"), p.u, p.unit, "missing"))
            continue
        q = new[name]
        same: Same = "changed"
        if (repr(p.value), repr(p.u), p.unit) == (repr(q.value), repr(q.u), q.unit):
            same = "equal"
        elif p.unit == q.unit and abs(q.value - p.value) <= p.u:
            same = "within u"
        rows.append(Beside(name, p.value, q.value, p.u, p.unit, same))
    rows += [
        Beside(name, float("nan"), q.value, q.u, q.unit, "new")
        for name, q in new.parameters.items()
        if name not in old.parameters
    ]
    return rows


def verdict(old: Estimate, new: Estimate) -> tuple[bool, str]:
    """True if the new result says what the old said, within u; and a sentence on it."""
    rows = beside(old, new)
    counts = {
        word: sum(row.same == word for row in rows)
        for word in ("equal", "within u", "changed", "missing", "new")
    }
    words = ", ".join(f"{count} {word}" for word, count in counts.items() if count) or "no coefficients"
    sound = not counts["changed"] and not counts["missing"] and old.status is new.status
    if old.status is not new.status:
        words += f"; the status was {old.status.value} and is {new.status.value}"
    if not rows:
        sound = sound and old.message == new.message
        words += f"; {'the same message' if old.message == new.message else f'it says now: {new.message}'}"
    versions = [str(each.provenance.get("versions", {})) for each in (old, new)]
    if versions[0] != versions[1]:
        words += f"; versions were {versions[0]}, are {versions[1]}"
    return sound, words
