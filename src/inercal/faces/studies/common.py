"""The tables every kind of study shares: the site, what makes a result traceable, the conditions."""

from __future__ import annotations

import datetime
import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BeforeValidator, Field, GetJsonSchemaHandler
from pydantic_core import core_schema

from inercal.faces.studies.fields import QuantityText, Temperature
from inercal.faces.studies.laboratory import Equipment, ItemTable, LaboratoryTable, Tolerances, traced
from inercal.faces.studies.tables import as_typed
from inercal.foundation._toml import Strict
from inercal.foundation.errors import StudyError
from inercal.foundation.geometry.earth import GravityInput, Site, gravity, gravity_gradient
from inercal.foundation.units import Quantity
from inercal.systems.listed import SYSTEMS

GRAVITY_ANOMALY = 3.5e-4
"""Standard uncertainty of normal gravity [m/s²]: rms free-air anomaly, about 35 mGal."""

UNSTATED_HEIGHT = 300.0
"""Standard uncertainty of the height 0 m that is taken where none is given [m]."""

Latitude = Annotated[
    Quantity,
    QuantityText("angle", "45.3 deg", lambda a: abs(a) <= 0.5 * math.pi, "a latitude from -90 deg to 90 deg"),
]
Height = Annotated[
    Quantity, QuantityText("length", "120 m", lambda h: -1e3 <= h <= 20e3, "a height from -1 km to 20 km")
]
Gravity = Annotated[
    Quantity,
    QuantityText(
        "acceleration",
        "9.81744(2) m/s^2",
        lambda g: 9.6 <= g <= 10.0,
        "9.6 to 10.0 m/s^2 on Earth (check the unit: 1 g is 9.80665 m/s^2)",
    ),
]


class SiteTable(Strict):
    """Place of the instrument."""

    latitude: Latitude | None = Field(default=None, description="geodetic latitude, north positive")
    height: Height | None = Field(
        default=None, description="height above sea level; 0 m give or take 300 m if absent"
    )
    gravity: Gravity | None = Field(
        default=None, description="local gravity, if known; from latitude and height if absent"
    )


def _date_text(value: object) -> object:
    """A TOML date as text; anything else as it is."""
    return value.isoformat() if isinstance(value, datetime.date) else value


class TraceabilityTable(Strict):
    """Free texts that go with the result."""

    instrument: str = Field(
        default="", examples=["model, serial no."], description="model and serial number of the instrument"
    )
    operator: str = Field(default="", examples=["name"], description="who made the recording")
    date: Annotated[str, BeforeValidator(_date_text)] = Field(
        default="", examples=["2026-01-31"], description="when it was made"
    )
    reference: str = Field(
        default="", examples=["order or report"], description="number of the order, report or standard"
    )


Humidity = Annotated[
    Quantity, QuantityText("number", "45(5) %", lambda h: 0.0 <= h <= 1.0, "a humidity from 0 % to 100 %")
]


class ConditionsTable(Strict):
    """Conditions during the recording."""

    temperature: Temperature | None = Field(default=None, description="temperature of the instrument")
    humidity: Humidity | None = Field(default=None, description="relative humidity of the air")


class StudyFile(Strict):
    """Keys of every kind of study; a kind has its own tables between them."""

    version: Literal[1] = Field(default=1, alias="schema", description="version of the study format")
    site: SiteTable = Field(default=SiteTable(), title="Site", description="where the instrument stands")
    item: ItemTable = Field(
        default=ItemTable(),
        title="Item",
        description="the instrument, as a store and a certificate name it",
    )
    laboratory: LaboratoryTable = Field(
        default=LaboratoryTable(),
        title="Laboratory",
        description="who calibrates, ahead of what lab.toml says",
    )
    equipment: Equipment
    specification: Tolerances
    traceability: TraceabilityTable = Field(
        default=TraceabilityTable(), title="Traceability", description="free texts that go with the result"
    )
    conditions: ConditionsTable = Field(
        default=ConditionsTable(), title="Conditions", description="conditions during the recording"
    )

    @classmethod
    def __get_pydantic_json_schema__(
        cls, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """The schema in the order in which people read a study: instrument, test, certificate."""
        made = handler.resolve_ref_schema(handler(schema))
        keys, last = made["properties"], list(StudyFile.model_fields)[2:]
        first = [key for key in _FIRST if key in keys]
        middle = [key for key in keys if key not in (*first, *last)]
        made["properties"] = {key: keys[key] for key in (*first, *middle, *last)}
        return made

    def shared(self, data: Mapping[str, Any]) -> dict[str, Any]:
        """Fields that the settings of all systems have; ``data`` is the study as parsed."""
        return {
            "traceability": traced(self.traceability.model_dump(), self.item),
            "temperature": self.conditions.temperature,
            "given": as_typed(data),
        }


#: tables at the begin of a study
_FIRST = (
    "schema",
    "site",
    "rig",
    "records",
    "sensors",
    "positions",
    *(system.table for system in SYSTEMS.values()),
    "noise",
)


def site_of(table: SiteTable, where: object) -> Site:
    """Gravity of a site: as typed, or else normal gravity at its latitude and height.

    Raises `StudyError` where neither gravity nor latitude is given.
    """
    latitude = None if table.latitude is None else table.latitude.value
    latitude_u = 0.0 if table.latitude is None else table.latitude.u
    if table.gravity is not None:
        typed = GravityInput("gravity", table.gravity.u, "m/s^2", 1.0)
        return Site(table.gravity.value, _uncertain(typed), latitude, latitude_u)
    if table.latitude is None or latitude is None:
        raise StudyError(
            where,
            "site: neither gravity nor latitude given, expected one of them, "
            'such as latitude = "45.3 deg" (and height = "120 m") or gravity = "9.81744(2) m/s^2"',
        )
    height, u_height = (
        (0.0, UNSTATED_HEIGHT) if table.height is None else (table.height.value, table.height.u)
    )
    by_latitude, by_height = gravity_gradient(latitude, height)
    inputs = _uncertain(
        GravityInput("latitude", latitude_u, "rad", float(by_latitude)),
        GravityInput("height", u_height, "m", float(by_height)),
        GravityInput("gravity anomaly", GRAVITY_ANOMALY, "m/s^2", 1.0),
    )
    return Site(float(gravity(latitude, height)), inputs, latitude, latitude_u)


def site_on_earth(table: SiteTable, where: object, what: str) -> Site:
    """The site of ``what``, in words, which turns with the earth, and so must have a latitude.

    Raises `StudyError` where no latitude is given.
    """
    if table.latitude is None:
        raise StudyError(
            where,
            f'site.latitude: missing, expected the latitude of the {what} for earth rate, such as "39.1 deg"',
        )
    return site_of(table, where)


def _uncertain(*inputs: GravityInput) -> tuple[GravityInput, ...]:
    """Those with an uncertainty."""
    return tuple(each for each in inputs if each.u > 0.0)
