"""The file ``lab.toml``: who calibrates, for whom, with what; joined with what the studies of the results say."""

from __future__ import annotations

import datetime
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field

from inercal.faces.studies.common import ConditionsTable
from inercal.faces.studies.fields import refusal
from inercal.faces.studies.laboratory import (
    AddressTable,
    Day,
    Equipment,
    EquipmentTable,
    ItemTable,
    LaboratoryTable,
    Tolerances,
)
from inercal.faces.studies.load import put
from inercal.faces.studies.schema import TomlSchema, commented
from inercal.faces.studies.starting import UNKNOWN
from inercal.foundation._toml import Strict, check, read_toml
from inercal.foundation.errors import InputError
from inercal.foundation.keys import in_place_of
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import shown
from inercal.laboratory.certificate.elements import plain


class PersonTable(Strict):
    """A person who answers for the certificate."""

    name: str = Field(examples=["A. Smith"], description="name")
    role: str = Field(default="", examples=["head of laboratory"], description="role in the laboratory")
    signs: bool = Field(default=False, description="signs the certificate")


class OrderTable(Strict):
    """The order, and its days."""

    number: str = Field(default="", examples=["A-2026-118"], description="number of the order")
    received: Day = Field(
        default="", examples=["2026-01-12"], description="day on which the item was received"
    )
    begin: Day = Field(
        default="",
        examples=["2026-01-30"],
        description="first day of the calibration; traceability.date of the studies if absent",
    )
    end: Day = Field(default="", examples=["2026-01-31"], description="last day of the calibration; likewise")
    place: Literal["laboratory", "customer", "laboratoryBranch", "customerBranch", "other"] = Field(
        default="laboratory", description="where it was calibrated"
    )


class StatementsTable(Strict):
    """Statements of the laboratory."""

    traceability: str = Field(
        default="",
        examples=["Gravity is traceable to the national gravity network, angles to certificate K-2026-117."],
        description="how the results are traceable to the SI",
    )
    remarks: list[str] = Field(
        default=[], examples=[["Calibrated as received."]], description="further statements, a text each"
    )


def _persons(value: object) -> object:
    """A list of persons; one table is a list of one."""
    if isinstance(value, Mapping):
        raise refusal("found one table, expected [[persons]], a table for each person")
    return value


class LabFile(Strict):
    """Statements of a laboratory in its certificates."""

    persons: Annotated[list[PersonTable], BeforeValidator(_persons)] = Field(
        default=[],
        examples=[[{"name": "A. Smith", "role": "head of laboratory", "signs": True}]],
        description="who answers for the certificate",
    )
    equipment: Equipment
    laboratory: LaboratoryTable = Field(
        default=LaboratoryTable(), title="Laboratory", description="who calibrates"
    )
    customer: AddressTable = Field(default=AddressTable(), title="Customer", description="for whom")
    order: OrderTable = Field(default=OrderTable(), title="Order", description="the order, and its days")
    item: ItemTable = Field(
        default=ItemTable(), title="Item", description="the instrument, as a store and a certificate name it"
    )
    conditions: ConditionsTable = Field(
        default=ConditionsTable(), title="Conditions", description="conditions during the recording"
    )
    specification: Tolerances
    statements: StatementsTable = Field(
        default=StatementsTable(), title="Statements", description="statements of the laboratory"
    )


_STARTING: dict[str, Any] = {
    "persons": [{"name": UNKNOWN, "role": "head of laboratory", "signs": True}],
    "laboratory": dict.fromkeys(("name", "street", "post_code", "city", "country"), UNKNOWN),
    "customer": dict.fromkeys(("name", "city"), UNKNOWN),
    "order": {},
    "item": {},
    "conditions": {},
    "statements": {"traceability": UNKNOWN},
}

_HEAD = """\
# What a laboratory states in its certificates. Fill in each "?"; take the "# " from keys that you know.
# The studies of the results may have the tables [laboratory], [item], [equipment], [specification] and
# [conditions] too: those win.
#
# Next: inercal certificate RESULT.json --lab {path} --number N --out certificate.xml

"""

_NEEDED = {
    "laboratory": ("name", "street", "city", "country"),
    "customer": ("name", "city"),
    "item": ("model", "serial"),
    "statements": ("traceability",),
}
"""Table -> keys without which there is no certificate."""


def lab_template(path: str | Path = "lab.toml", overrides: Iterable[str] = ()) -> str:
    """A ``lab.toml`` with every key in it, each explained; ``overrides`` are keys to state, ``"customer.name=Acme"``.

    Raises `InputError` for a key that it cannot have.
    """
    schema = LabFile.model_json_schema(schema_generator=TomlSchema)
    stated = deepcopy(_STARTING)
    for override in overrides:
        put(stated, override, Path(path).parent)
    check(LabFile, stated, path, InputError)
    return _HEAD.format(path=path) + commented(schema, schema["$defs"], stated)


def read_lab(path: str | Path) -> LabFile:
    """Read a ``lab.toml``; raises `InputError` for the first thing that is wrong in itself."""
    return check(LabFile, read_toml(path, InputError), path, InputError)


def joined(lab: LabFile, estimates: Sequence[Estimate], where: object) -> LabFile:
    """The statements of a laboratory of these results: those of their studies ahead of ``lab``, days filled in.

    Raises `InputError`: results of different instruments, and in one sentence all that a certificate must state (DCC
    schema, ISO/IEC 17025:2017 clause 7.8) and nobody did.
    """
    given: dict[str, Any] = lab.model_dump(mode="json")
    for estimate in estimates:
        study = estimate.provenance.get("settings") or {}
        for table in ("laboratory", "conditions"):
            given[table] |= study.get(table, {})
        for table in ("equipment", "specification"):
            given[table] |= study.get(table, {})
    given["item"] |= _one_item(estimates)
    if not (given["item"]["model"] or given["item"]["serial"]):
        given["item"] |= _named(estimates)
    found = check(LabFile, _without_none(given), where, InputError)
    begin, end = _days(found.order, estimates)
    found = found.model_copy(update={"order": found.order.model_copy(update={"begin": begin, "end": end})})
    missing = _missing(found, estimates)
    if missing:
        names = missing[0] if len(missing) == 1 else f"{', '.join(missing[:-1])} and {missing[-1]}"
        raise InputError(
            where, f"{names}: missing, expected all that ISO/IEC 17025 and the schema ask of a certificate"
        )
    return found


def _without_none(table: Mapping[str, Any]) -> dict[str, Any]:
    """A table without keys that were not given."""
    return {
        key: _without_none(value) if isinstance(value, Mapping) else value
        for key, value in table.items()
        if value is not None
    }


def _one_item(estimates: Sequence[Estimate]) -> dict[str, str]:
    """The instrument of the results; raises `InputError` where they are of several."""
    keys = ("maker", "model", "serial", "owner")
    items = [{key: e.traceability[key] for key in keys if e.traceability.get(key)} for e in estimates]
    merged: dict[str, str] = {}
    for item in items:
        for key, text in item.items():
            if merged.setdefault(key, text) != text:
                raise InputError(
                    "certificate",
                    f"found results of several instruments ({key} {merged[key]!r} and {text!r}), expected those of one",
                )
    texts = sorted({text for e in estimates if (text := e.traceability.get("instrument", ""))})
    if len(texts) > 1 and not all("serial" in item for item in items):
        raise InputError(
            "certificate",
            f"found results of several instruments ({texts[0]!r} and {texts[1]!r}), expected those of one",
        )
    return merged


def _named(estimates: Sequence[Estimate]) -> dict[str, str]:
    """Maker, model and serial of the text "maker, model, serial" that a study has of its instrument."""
    text = next((text for e in estimates if (text := e.traceability.get("instrument", ""))), "")
    parts = [part.strip() for part in text.split(",")]
    if len(parts) not in (2, 3) or not all(parts):
        return {}
    return dict(zip(("maker", "model", "serial")[-len(parts) :], parts, strict=True))


def _days(order: OrderTable, estimates: Sequence[Estimate]) -> tuple[str, str]:
    """First and last day of the calibration: of the order, else of the results."""
    days = []
    for estimate in estimates:
        try:
            days.append(datetime.date.fromisoformat(estimate.traceability.get("date", "")[:10]).isoformat())
        except ValueError:
            days.append("")
    known = sorted(filter(None, days))
    begin = order.begin or (known[0] if all(days) else "")
    end = order.end or (known[-1] if all(days) else "")
    if begin and end and begin > end:
        raise InputError("order.end", f"found {end}, expected a day that is not before order.begin, {begin}")
    return begin, end


def _missing(lab: LabFile, estimates: Sequence[Estimate]) -> list[str]:
    """Dotted keys of what nobody stated."""
    keys = [
        f"{table}.{key}"
        for table, needed in _NEEDED.items()
        for key in needed
        if plain(getattr(getattr(lab, table), key)) in ("", UNKNOWN)
    ]
    keys += [
        f"{table}.{key}"
        for table in ("laboratory", "customer")
        for key, text in getattr(lab, table)
        if text == UNKNOWN and f"{table}.{key}" not in keys
    ]
    if not lab.persons or any(plain(person.name) in ("", UNKNOWN) for person in lab.persons):
        keys.append("persons.name")
    keys += [f"order.{key}" for key in ("begin", "end") if not getattr(lab.order, key)]
    if lab.conditions.temperature is None and not all(e.conditions.get("temperature") for e in estimates):
        keys.append("conditions.temperature")
    return keys


def sources_known(
    equipment: Mapping[str, EquipmentTable], estimates: Sequence[Estimate], where: object
) -> None:
    """Refuse equipment that names a source which no budget of the results has."""
    sources = {item.source for estimate in estimates for item in estimate.budget}
    for name, table in equipment.items():
        for source in table.budget:
            if source not in sources:
                expected = in_place_of("budget", source) or "expected a source of the budget"
                raise InputError(
                    where,
                    f"equipment.{name}.budget: found {shown(source)}, {expected}: {', '.join(sorted(sources))}",
                )
