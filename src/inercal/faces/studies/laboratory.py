"""Tables of studies and of ``lab.toml`` that a certificate needs: the item, the laboratory, its equipment."""

from __future__ import annotations

import datetime
import re
from collections.abc import Mapping
from typing import Annotated

from pydantic import BeforeValidator, Field

from inercal.faces.studies.fields import refusal
from inercal.foundation._toml import Strict
from inercal.foundation.units import shown


def _day(value: object) -> object:
    """A day as text, ``2026-01-31``; empty where none is given."""
    if isinstance(value, datetime.date) and not isinstance(value, datetime.datetime):
        return value.isoformat()
    try:
        if value not in ("", "?"):
            datetime.date.fromisoformat(value)  # type: ignore[arg-type]
    except (TypeError, ValueError):
        raise refusal(f"found {shown(value)}, expected a day such as 2026-01-31") from None
    return value


def _country(value: object) -> object:
    """Two capital letters; empty where none is given."""
    if value == "" or (isinstance(value, str) and re.fullmatch("[A-Z]{2}|[?]", value)):
        return value
    raise refusal(f'found {shown(value)}, expected two letters of ISO 3166-1 such as "DE"')


Country = Annotated[str, BeforeValidator(_country)]
"""A country by its two letters."""

Day = Annotated[str, BeforeValidator(_day)]
"""A day of the calendar; empty where none is given."""


class ItemTable(Strict):
    """The instrument, as a store and a certificate name it."""

    maker: str = Field(default="", examples=["Acme"], description="who made the instrument")
    model: str = Field(default="", examples=["G-7"], description="its model or type")
    serial: str = Field(default="", examples=["0042"], description="its serial number")
    owner: str = Field(default="", examples=["Flight Test"], description="whose it is")


class AddressTable(Strict):
    """A laboratory, a company: its name and address."""

    name: str = Field(default="", examples=["Acme Calibration"], description="name")
    street: str = Field(default="", examples=["Long Street 1"], description="street and number")
    post_code: str = Field(default="", examples=["10115"], description="post code")
    city: str = Field(default="", examples=["Berlin"], description="town")
    country: Country = Field(default="", examples=["DE"], description="country, two letters of ISO 3166-1")
    email: str = Field(default="", examples=["cal@example.org"], description="address of its mail")
    phone: str = Field(default="", examples=["+49 30 1234"], description="telephone")


class LaboratoryTable(AddressTable):
    """The laboratory that calibrated; `inercal new lab` writes a file with all of its keys."""

    code: str = Field(default="", examples=["D-K-12345"], description="its code, or number of accreditation")


class EquipmentTable(Strict):
    """A standard, table or rig that was used, with the certificate that makes it traceable."""

    name: str = Field(description="name of the standard, table or rig", examples=["rate table"])
    maker: str = Field(default="", description="who made it")
    model: str = Field(default="", description="its model")
    serial: str = Field(default="", description="its serial number")
    certificate: str = Field(default="", description="number of its certificate", examples=["K-2026-117"])
    issuer: str = Field(default="", description="laboratory that issued the certificate")
    valid_until: Day = Field(default="", description="day until which it is valid", examples=["2027-06-30"])
    budget: list[str] = Field(
        default=[],
        description="sources of the budget that its certificate stands behind",
        examples=[["gravity"]],
    )


Equipment = Annotated[
    dict[str, EquipmentTable],
    Field(
        default_factory=dict,
        title="Equipment",
        description="standards, tables and rigs that were used, each a table of a name of one's own, ahead of those of "
        "lab.toml",
        examples=[{"table": {"name": "rate table", "certificate": "K-2026-117"}}],
    ),
]
Tolerances = Annotated[
    dict[str, str | list[str]],
    Field(
        default_factory=dict,
        title="Specification",
        description="limits of coefficients by name or group, for statements of conformity; two, or one about zero; "
        "beside them decision: simple acceptance (if absent), guard band, or a risk",
        examples=[{"decision": "guard band", "K1_x": ["-50 ppm", "50 ppm"], "D_F": "2 deg/h"}],
    ),
]


def traced(texts: Mapping[str, str], item: ItemTable) -> dict[str, str]:
    """Texts of the traceability of a result, with the item: its model and serial where no instrument is named."""
    said = {key: text for key, text in item.model_dump().items() if text}
    named = texts.get("instrument") or " ".join(filter(None, (item.model, item.serial)))
    return {**texts, "instrument": named, **said}
