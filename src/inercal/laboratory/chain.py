"""Events of a store: a chain of hashes, so that whoever changes a row later is found out."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from typing import Any

from sqlalchemy import Connection, func, insert, select

from inercal.laboratory.tables import Event

BEGIN = "0" * 64
"""Hash before the first event."""


def now() -> str:
    """The time, as a store writes it."""
    return datetime.now(UTC).isoformat(timespec="seconds")


def digest_of(rows: Any) -> str:
    """SHA-256 of rows, as JSON in one spelling."""
    text = json.dumps(rows, ensure_ascii=False, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def hash_of(row: Mapping[str, Any]) -> str:
    """Hash of an event: of all its fields but the hash itself, the hash of the event before among them."""
    return digest_of({key: row[key] for key in ("number", "made", "kind", "subject", "digest", "previous")})


SCRUB = "scrub"
"""Kind of the event that says that secrets were taken out; ``scrub KIND`` says so of the subject of another event."""


def told(events: Iterable[Mapping[str, Any]]) -> dict[tuple[str, str], str]:
    """The digest of each kind and subject, as the last event tells it that added the rows or took a secret out."""
    return {(row["kind"].removeprefix(f"{SCRUB} "), row["subject"]): row["digest"] for row in events}


def scrubbed(events: Iterable[Mapping[str, Any]]) -> dict[tuple[str, str], str]:
    """The day on which secrets were taken out of the rows of each kind and subject."""
    return {
        (row["kind"].removeprefix(f"{SCRUB} "), row["subject"]): row["made"][:10]
        for row in events
        if row["kind"].startswith(f"{SCRUB} ")
    }


def happened(connection: Connection, kind: str, subject: str, digest: str) -> None:
    """Add an event, in a transaction that writes."""
    number = connection.execute(select(func.max(Event.number))).scalar() or 0
    previous = connection.execute(select(Event.hash).where(Event.number == number)).scalar() or BEGIN
    row = {
        "number": number + 1,
        "made": now(),
        "kind": kind,
        "subject": subject,
        "digest": digest,
        "previous": previous,
    }
    connection.execute(insert(Event).values(**row, hash=hash_of(row)))
