"""Files that a result rests on."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Source:
    """A file that was read: its path as given, and the SHA-256 of its bytes."""

    path: str
    sha256: str
