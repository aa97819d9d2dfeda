"""Sessions of the workbench: the files of one test of an instrument in one folder, with map and study."""

from __future__ import annotations

import asyncio
import json
import os
import re
import shutil
import tempfile
import unicodedata
from collections.abc import AsyncIterator, Iterator
from contextlib import suppress
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from inercal.examples import EXAMPLES, FOLDER
from inercal.faces.studies.load import is_map
from inercal.foundation._files import read_bytes, write_bytes, write_text
from inercal.foundation.errors import InputError, plain, spelt
from inercal.systems.imu.system import SYSTEM as IMU
from inercal.systems.listed import SYSTEMS

MAP, STUDY = "study-map.toml", "study.toml"
"""Names of the map and of the study in the folder of a session."""

LARGEST = 8 * 1024**3
"""Bytes that one uploaded file may have."""

SPARE = 512 * 1024**2
"""Bytes of the disk that an upload leaves free."""

PART = ".part"
"""Ending of a file that is on its way."""

_ABOUT = "session.json"
_LONGEST = 120
_LONGEST_TITLE = 200
_LARGEST_TOML = 1024**2


@dataclass(frozen=True)
class Session:
    """A session: its number, the folder of its files, what it is called, the kind of its study, when it was begun."""

    id: str
    folder: Path
    title: str
    kind: str
    made: str

    @property
    def recordings(self) -> list[Path]:
        """The recordings of the session, by name."""
        return [path for path in self.files if path.suffix.lower() not in (".toml", ".txt", ".json")]

    @property
    def files(self) -> list[Path]:
        """The files of the session, by name."""
        return sorted(path for path in self.folder.iterdir() if path.is_file() and not _hidden(path.name))

    @property
    def map(self) -> Path | None:
        """The column map of the session, None without a map."""
        return path if (path := self.folder / MAP).is_file() else None

    @property
    def study(self) -> Path | None:
        """The study of the session, None without a study."""
        return path if (path := self.folder / STUDY).is_file() else None

    def command(self, out: Path, report: Path) -> list[str]:
        """Arguments of the command that calibrates it, run in its folder; raises `InputError` where there is none."""
        if not self.recordings:
            raise InputError(self.title, "found no recording, expected one")
        if self.study is None:
            raise InputError(self.title, "found no study, expected one")
        words = [*SYSTEMS[self.kind].command.split(), *(path.name for path in self.recordings)]
        if self.map is not None:
            words += ["--map", MAP]
        words += ["--study", STUDY]
        return [*words, "--out", str(out), "--report", str(report)]


@dataclass(frozen=True)
class Sessions:
    """All sessions, each a numbered folder of ``root``."""

    root: Path

    def __iter__(self) -> Iterator[Session]:
        """The sessions, the newest first."""
        if not self.root.is_dir():
            return
        for folder in sorted(self.root.iterdir(), reverse=True):
            if folder.name.isdigit() and (folder / _ABOUT).is_file():
                with suppress(InputError):
                    yield self.get(folder.name)

    def get(self, number: str) -> Session:
        """The session of that number; raises `InputError` where there is none."""
        if not re.fullmatch(r"\d{4,9}", number):
            raise InputError("session", f"found {number!r}, expected its number")
        folder = self.root / number
        try:
            about: dict[str, Any] = json.loads(read_bytes(folder / _ABOUT))
            title, kind, made = (spelt(str(about[key])) for key in ("title", "kind", "made"))
            SYSTEMS[kind]
        except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
            raise InputError(f"session {number}", "found none, expected one that was begun") from error
        return Session(number, folder, title, kind, made)

    def begin(self, title: str, kind: str = IMU.kind) -> Session:
        """A new session without files; raises `InputError` for a title that is no plain text."""
        if len(plain("title", title)) > _LONGEST_TITLE:
            raise InputError("title", f"found {len(title)} characters, expected {_LONGEST_TITLE} at most")
        self.root.mkdir(parents=True, exist_ok=True)
        numbers = [int(folder.name) for folder in self.root.iterdir() if is_numbered(folder.name)]
        number = max(numbers, default=0)
        while True:  # another process may be taking the same number
            number += 1
            folder = self.root / f"{number:04d}"
            with suppress(FileExistsError):
                folder.mkdir()
                break
        made = datetime.now(UTC).isoformat(timespec="seconds")
        self._tell(Session(folder.name, folder, title, kind, made))
        return self.get(folder.name)

    def begin_with(self, name: str) -> Session:
        """A new session with the files of a shipped example; raises `InputError` for a name that is none."""
        if name not in EXAMPLES:
            raise InputError(name, f"no such example, expected one of {', '.join(EXAMPLES)}")
        example = EXAMPLES[name]
        kinds = (kind for kind, system in SYSTEMS.items() if system.command == example.verb)
        kind = next(kinds, IMU.kind)
        session = self.begin(f"example {name}", kind)
        for file in (*example.records, *filter(None, [example.licence])):
            shutil.copyfile(FOLDER / file, session.folder / Path(file).name)
        for named, target in ((example.map, MAP), (example.study, STUDY)):
            if named is not None:
                shutil.copyfile(FOLDER / named, session.folder / target)
        return session

    def of_kind(self, session: Session, kind: str) -> Session:
        """The session with another kind of study; raises `InputError` for a kind that is none."""
        if kind not in SYSTEMS:
            raise InputError("kind", f"found {kind!r}, expected one of {', '.join(SYSTEMS)}")
        changed = Session(session.id, session.folder, session.title, kind, session.made)
        self._tell(changed)
        return changed

    def drop(self, session: Session) -> None:
        """Delete a session with its files."""
        shutil.rmtree(session.folder)

    def _tell(self, session: Session) -> None:
        """Write what a session is."""
        about = {"title": session.title, "kind": session.kind, "made": session.made}
        write_text(session.folder / _ABOUT, json.dumps(about) + "\n")


def is_numbered(name: str) -> bool:
    """True for the name of the folder of a session or a job."""
    return name.isascii() and name.isdigit()


def safe_name(given: str) -> str:
    """The name of an uploaded file in a session: its last part, without what a system may take for something else.

    Raises `InputError` where nothing is left, or it is a name of the workbench's own.
    """
    last = re.split(r"[/\\]", unicodedata.normalize("NFC", given))[-1]
    shown = "".join(
        "_" if ord(c) < 32 or c in '<>:"|?*\x7f' else c for c in last if c.isprintable() or ord(c) < 32
    )
    name = shown.strip(" .")[-_LONGEST:]
    reserved = re.fullmatch(r"(con|prn|aux|nul|com\d|lpt\d)(\..*)?", name, re.IGNORECASE)
    if not name or reserved or _hidden(name):
        raise InputError("file name", f"found {given!r}, expected the name of a recording, map or study")
    return f"_{name}" if name.startswith("-") else name  # a dash would begin an option


async def receive(session: Session, given: str, body: AsyncIterator[bytes]) -> Path:
    """Write an uploaded file into a session, piece by piece, whole or not at all.

    A column map or study in TOML becomes that of the session. Raises `InputError` beyond `LARGEST` bytes, or where the
    disk would be full.
    """
    name = safe_name(given)
    handle, path = tempfile.mkstemp(dir=session.folder, prefix=".", suffix=PART)
    part, count = Path(path), 0
    try:
        with os.fdopen(handle, "wb") as file:
            async for piece in body:
                count += len(piece)
                if count > LARGEST:
                    raise InputError(
                        name, f"found more than {LARGEST // 1024**3} GiB, expected a smaller file"
                    )
                if shutil.disk_usage(session.folder).free < SPARE + len(piece):
                    raise InputError(name, "found too little room on the disk, expected 512 MiB to spare")
                file.write(piece)
        if Path(name).suffix.lower() == ".toml" and count > _LARGEST_TOML:
            raise InputError(name, "found more than 1 MiB, expected a map or a study")
        target = session.folder / await asyncio.to_thread(_place, part, name)
        os.replace(part, target)
        return target
    except ConnectionError:  # of the sender
        raise
    except OSError as error:
        raise InputError(name, f"cannot be written ({error.strerror or error})") from error
    finally:
        part.unlink(missing_ok=True)


def _place(part: Path, name: str) -> str:
    """The name of a file that has come: a TOML file is the map or the study."""
    if Path(name).suffix.lower() != ".toml":
        return name
    from inercal.foundation._toml import read_toml

    try:
        data = read_toml(part, InputError)
    except InputError as error:  # by the name that it was sent under
        raise InputError(name, error.message) from error
    return MAP if is_map(data) else STUDY


def _hidden(name: str) -> bool:
    """True for a file of the workbench itself."""
    return name.startswith(".") or name == _ABOUT


def put(session: Session, name: str, text: str) -> None:
    """Write the map or the study of a session; raises `InputError` for what is no plain text."""
    write_bytes(session.folder / name, plain(name, text).encode())
