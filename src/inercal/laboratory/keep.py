"""Keeping a result: its JSON, page and files as objects, its coefficients as rows; whole or not at all."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from sqlalchemy import Connection, insert, select

from inercal.foundation.addresses import without_secrets
from inercal.foundation.arrays import finite
from inercal.foundation.errors import InputError
from inercal.foundation.inputs import program
from inercal.foundation.results.files import plain_objects, to_json
from inercal.foundation.results.result import Estimate
from inercal.laboratory.database import (
    SourceOf,
    StoredCoefficient,
    StoredFile,
    StoredInstrument,
    StoredReference,
    StoredResult,
    Used,
    numbered,
    reading,
    writing,
)
from inercal.laboratory.limits import LIMITS
from inercal.laboratory.store import Store, digest_of, happened, now


@dataclass(frozen=True)
class Item:
    """An instrument by its maker, model and serial number; ``owner`` and ``kind`` where they are known."""

    maker: str
    model: str
    serial: str
    owner: str = ""
    kind: str = ""

    def __str__(self) -> str:
        """In words."""
        return " ".join(filter(None, (self.maker, self.model, self.serial)))


@dataclass(frozen=True)
class KeptResult:
    """A result in a store: its ``id``, ``new`` unless it was there, and ``notes`` on what could not be kept whole."""

    id: str
    new: bool
    notes: tuple[str, ...] = ()


def item_of(estimate: Estimate, given: str | None = None) -> Item | None:
    """The instrument of a result: ``given`` as "maker, model, serial", "model, serial" or "serial", else as its study
    says; None where that says nothing."""
    said = estimate.traceability
    if given is None and said.get("serial"):
        return Item(
            said.get("maker", ""),
            said.get("model", ""),
            said["serial"],
            said.get("owner", ""),
            estimate.command,
        )
    text = without_secrets(given if given is not None else said.get("instrument", ""))
    parts = [part.strip() for part in text.split(",")]
    if not parts[-1]:
        if given is not None:
            raise InputError("--instrument", f'found {given!r}, expected "maker, model, serial"')
        return None
    maker, model, serial = [
        "",
        "",
        *(parts if len(parts) < 4 else [parts[0], ", ".join(parts[1:-1]), parts[-1]]),
    ][-3:]
    return Item(maker, model, serial, "", estimate.command)


def id_of(data: Mapping[str, Any]) -> str:
    """SHA-256 of what a result says: all of its JSON but the times of computing and the command line."""
    provenance = {key: value for key, value in data["provenance"].items() if key != "arguments"}
    return digest_of({**{k: v for k, v in data.items() if k != "timing_s"}, "provenance": provenance})


def keep(
    store: Store,
    estimate: Estimate,
    item: Item | None,
    report: bytes | None = None,
    saved: Mapping[str, Any] | None = None,
    copies: Mapping[str, Path] | None = None,
) -> KeptResult:
    """Keep a result with the files it rests on.

    Parameters
    ----------
    store : Store
    estimate : Estimate
    item : Item or None
        Its instrument; a result with coefficients must have one.
    report : bytes, optional
        Its page.
    saved : mapping, optional
        The JSON of a result that was made elsewhere, of which each key is kept as it is; without it this program made
        the result, just now: its files must be as they were, and the checksum of the sources is kept.
    copies : mapping, optional
        Files of this machine by the path that the result says, where that is a URL.

    Raises
    ------
    InputError
        Without an instrument, or a file of the result cannot be read or was changed (without ``saved``).
    """
    if item is None and estimate.names:
        raise InputError(
            "--instrument",
            'missing, expected "maker, model, serial" (or the serial under [item] in the study)',
        )
    data = to_json(estimate) | plain_objects(saved or {})
    made_here = saved is None
    identity = id_of(data)
    files, notes = _files(store, estimate, made_here, copies or {})
    text = json.dumps(data, indent=1, ensure_ascii=False) + "\n"
    result = {
        "id": identity,
        "object": store.objects.add(text.encode()),
        "report": None if report is None else store.objects.add(report),
        "command": data["command"],
        "version": str(data["inercal"]),
        "program": program() if made_here else "",
        "made": now(),
        "measured": str(data["traceability"].get("date") or ""),
        "operator": str(data["traceability"].get("operator") or ""),
        "status": data["status"]["code"],
        "message": data["status"]["message"],
    }
    rows = StoredRows(
        result,
        () if item is None else (item.maker, item.model, item.serial),
        tuple((source["sha256"], source["path"]) for source in data["inputs"]),
        coefficients_of(estimate),
        references_of(data),
    )
    with writing(store.engine, store.where) as connection:
        if connection.execute(select(StoredResult.id).where(StoredResult.id == identity)).first():
            return KeptResult(identity, False)
        number = None if item is None else numbered(connection, StoredInstrument, {**vars(item), "notes": ""})
        for file in files:
            if not connection.execute(select(StoredFile).where(StoredFile.sha256 == file["sha256"])).first():
                connection.execute(insert(StoredFile).values(**file))
        add_rows(connection, rows, number)
        happened(connection, "keep", identity, rows.digest)
    return KeptResult(identity, True, tuple(notes))


def kept_already(store: Store, estimate: Estimate, saved: Mapping[str, Any]) -> str | None:
    """Identity of a result in the store, whatever instrument it was kept under; None where it is not there."""
    identity = id_of(to_json(estimate) | plain_objects(saved))
    with reading(store.engine, store.where) as connection:
        return (
            identity
            if connection.execute(select(StoredResult.id).where(StoredResult.id == identity)).first()
            else None
        )


@dataclass(frozen=True)
class StoredRows:
    """The rows of a result: its own without the instrument's number, instrument, files, coefficients, references."""

    result: Mapping[str, Any]
    instrument: tuple[str, ...]
    sources: tuple[tuple[str, str], ...]
    coefficients: tuple[Mapping[str, Any], ...]
    references: tuple[Mapping[str, str], ...]

    @property
    def digest(self) -> str:
        """SHA-256 of the rows of a result."""
        more = [[dict(row) for row in many] for many in (self.coefficients, self.references)]
        return digest_of([dict(self.result), self.instrument, self.sources, *more])


def saved_in(path: Path, estimate: Estimate) -> Mapping[str, Any]:
    """The JSON of a result that was saved: of a JSON file as it is, else as this program writes it."""
    if path.suffix.lower() != ".json":
        return to_json(estimate)
    data: dict[str, Any] = json.loads(path.read_bytes())
    return data


def coefficients_of(estimate: Estimate) -> tuple[dict[str, Any], ...]:
    """Rows of the coefficients, in order; what is not finite is None."""
    common = None if estimate.common is None else estimate.common.diagonal()
    return tuple(
        {
            "name": plain_objects(p.name),
            **{
                key: finite(value)
                for key, value in (("value", p.value), ("u", p.u), ("expanded", p.U), ("k", p.k))
            },
            "dof": finite(p.dof),
            "unit": plain_objects(p.unit),
            "common": None if common is None else finite(math.sqrt(max(float(common[i]), 0.0))),
        }
        for i, p in enumerate(estimate.parameters.values())
    )


def references_of(data: Mapping[str, Any]) -> tuple[dict[str, str], ...]:
    """Rows of the standards, tables and rigs that the study of a result states as ``[equipment.NAME]``, by name."""
    settings = data["provenance"].get("settings")
    stated = settings.get("equipment") if isinstance(settings, Mapping) else None
    keys = ("name", "serial", "certificate", "valid_until")
    rows = [
        {key: str(each.get(key) or "") for key in keys}
        for each in (stated.values() if isinstance(stated, Mapping) else ())
        if isinstance(each, Mapping)
    ]
    return tuple(dict(zip(keys, row, strict=True)) for row in sorted({tuple(row.values()) for row in rows}))


def add_rows(connection: Connection, rows: StoredRows, instrument_id: int | None) -> None:
    """Add the rows of a result, in a transaction that writes."""
    connection.execute(insert(StoredResult).values(**rows.result, instrument_id=instrument_id))
    identity = rows.result["id"]
    sources = [
        {"result_id": identity, "position": i, "sha256": sha256, "path": path}
        for i, (sha256, path) in enumerate(rows.sources)
    ]
    coefficients = [{"result_id": identity, "position": i, **row} for i, row in enumerate(rows.coefficients)]
    numbers = dict.fromkeys(numbered(connection, StoredReference, row) for row in rows.references)
    used = [{"result_id": identity, "reference_id": number} for number in numbers]
    for table, values in ((SourceOf, sources), (StoredCoefficient, coefficients), (Used, used)):
        if values:
            connection.execute(insert(table), values)


def _files(
    store: Store, estimate: Estimate, made_here: bool, copies: Mapping[str, Path]
) -> tuple[list[dict[str, Any]], list[str]]:
    """Rows of the files that a result rests on, which become objects, and notes on those that could not."""
    rows, notes = [], []
    for source in {each.sha256: each for each in estimate.inputs}.values():
        path = copies.get(source.path) or _place(source.path)
        place = without_secrets(source.path if "://" in source.path else str(path.absolute()))
        try:
            size = path.stat().st_size
            if size > LIMITS.whole_bytes:
                rows.append({"sha256": source.sha256, "bytes": size, "place": place})
                notes.append(f"{source.path}: {size / 2**30:.1f} GiB, kept by its path and checksum")
                continue
            store.objects.add_file(path, source.sha256)
            rows.append({"sha256": source.sha256, "bytes": size, "place": None})
        except (OSError, InputError) as error:
            if made_here:
                raise (
                    error
                    if isinstance(error, InputError)
                    else InputError(path, f"cannot be read ({error.strerror})")
                ) from error
            rows.append({"sha256": source.sha256, "bytes": None, "place": place})
            why = error.message if isinstance(error, InputError) else f"cannot be read ({error.strerror})"
            notes.append(f"{source.path}: {why}; kept by its checksum alone")
    return rows, notes


def _place(path: str) -> Path:
    """The file of a path: of this machine, or one that ships with the package, as results of `validate` name them."""
    from inercal.examples import FOLDER

    shipped = FOLDER.parent / path
    return shipped if not Path(path).exists() and shipped.is_file() else Path(path)
