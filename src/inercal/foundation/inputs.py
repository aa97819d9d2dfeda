"""Files that a result rests on, and the program that made it."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cache
from pathlib import Path


@dataclass(frozen=True)
class Source:
    """A file that was read: its path as given, and the SHA-256 of its bytes."""

    path: str
    sha256: str


@cache
def program() -> str:
    """SHA-256 of the sources of this program."""
    import inercal

    digest = hashlib.sha256()
    root = Path(inercal.__file__).parent
    for path in sorted(root.rglob("*.py")):
        digest.update(f"{path.relative_to(root).as_posix()}\n".encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()
