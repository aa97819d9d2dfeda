"""A kept result made once more: its files laid out, and the new result set beside the old."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath
from typing import Literal

from inercal.foundation._files import input_bytes, read_bytes, write_bytes
from inercal.foundation.errors import InputError, plain
from inercal.foundation.results.result import Estimate
from inercal.laboratory.catalog import ShownResult
from inercal.laboratory.store import Store

Same = Literal["equal", "within u", "changed", "missing", "new"]


@dataclass(frozen=True)
class LaidOut:
    """The files of a result below ``root``, and ``folder`` there, which stands for the one its command ran in.

    ``places`` has each file by its path in the result, normalised: that path itself, or where an absolute one lies now.
    """

    root: Path
    folder: Path
    places: Mapping[str, str]

    def place(self, path: str) -> str:
        """The path of a file in ``folder``; raises `InputError` for one that was not kept with the result."""
        found = self.places.get(os.path.normpath(path))
        if found is None:
            raise InputError(path, "is not among the files kept with the result, expected one of them")
        return found

    def moved(self, text: str) -> str:
        """A text in which files are named by their absolute paths, with those of their places."""
        far = sorted((path for path, place in self.places.items() if path != place), key=len, reverse=True)
        names = "|".join(map(re.escape, far))
        between = r"\s\"'=,;:\[\](){}"
        whole = rf"(?<![^{between}])({names})(?![^{between}])"
        return re.sub(whole, lambda found: self.places[found[0]], text) if far else text

    def name_places(self, path: Path) -> None:
        """Let a file in ``folder`` that names others by their absolute paths, as a study may, name their places."""
        before = read_bytes(self.folder / path).decode(errors="surrogateescape")
        after = self.moved(before)
        if after != before:
            write_bytes(self.folder / path, after.encode(errors="surrogateescape"))

    def check(self, path: Path) -> None:
        """Refuse a file that a study, a map or a table names and that lies elsewhere; raises `InputError`."""
        if not Path(os.path.realpath(self.folder / path)).is_relative_to(self.root):
            raise InputError(path, "lies outside the files kept with the result, expected one of them")


def laid_out(store: Store, shown: ShownResult, root: Path) -> LaidOut:
    """Lay the files of a result out below ``root`` (empty) as they lay when it was made.

    Raises `InputError` where a file was kept by reference and is gone or changed, or has a path that none can have.
    """
    root = Path(os.path.realpath(root))
    folder = root / "root" / Path(*["d"] * max(map(_upward, (path for path, _, _ in shown.files)), default=0))
    folder.mkdir(parents=True)
    places = {}
    for path, sha256, kept_at in shown.files:
        plain("a file of the result", path)
        absolute = _absolute(path)
        target = _below(root / "absolute", path) if absolute else Path(os.path.normpath(folder / path))
        if not target.is_relative_to(root):
            raise InputError(path, "leads elsewhere, expected the path of a file")
        if target.name.startswith("."):
            raise InputError(
                path, "has a hidden name, as settings of other programs have, expected a recording or study"
            )
        content = _bytes(store, path, sha256, kept_at)
        if target.exists() and target.read_bytes() != content:
            raise InputError(path, "stands for two files of this result, expected a name for each")
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)
        places[os.path.normpath(path)] = str(target) if absolute else os.path.normpath(path)
    return LaidOut(root, folder, places)


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

    data = input_bytes(place, f"{path}, kept by reference")
    if hashlib.sha256(data).hexdigest() != sha256:
        raise InputError(place, f"was changed, expected {path} as it was, kept by reference")
    return data


@dataclass(frozen=True)
class Repeated:
    """A coefficient of both results: how the new value stands to the old."""

    name: str
    old: float
    new: float
    u: float
    unit: str
    same: Same


def beside(old: Estimate, new: Estimate) -> list[Repeated]:
    """The coefficients of both, those of the old result first.

    Values and uncertainties are ``equal`` to the last digit, ``within u`` where the value moved by at most u of the old
    result, else ``changed``.
    """
    rows = []
    for name, p in old.parameters.items():
        if name not in new.parameters:
            rows.append(Repeated(name, p.value, float("nan"), p.u, p.unit, "missing"))
            continue
        q = new[name]
        same: Same = "changed"
        if (repr(p.value), repr(p.u), p.unit) == (repr(q.value), repr(q.u), q.unit):
            same = "equal"
        elif p.unit == q.unit and abs(q.value - p.value) <= p.u:
            same = "within u"
        rows.append(Repeated(name, p.value, q.value, p.u, p.unit, same))
    rows += [
        Repeated(name, float("nan"), q.value, q.u, q.unit, "new")
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
