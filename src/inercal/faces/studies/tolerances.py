"""Goals and costs of a study, for the search for tolerances."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, create_model, model_validator

from inercal.faces.studies.fields import refusal
from inercal.faces.studies.instrument import check_symbol, coefficient_of
from inercal.faces.studies.tables import settings_of, table_of
from inercal.foundation.designs.tolerances import Price
from inercal.foundation.errors import QuantityError, StudyError
from inercal.foundation.rigs.chain import Chain, Error
from inercal.foundation.rigs.tables import TABLES, slots
from inercal.foundation.units import parse_quantity, shown
from inercal.systems.turntable.settings import DRIFT, SYMBOLS, Cost, Instrument, Tolerances, WantedOfTable


class CostTable(table_of(Cost)):  # type: ignore[misc]
    """The cost of a tolerance: a power, or a table."""

    table: list[tuple[str, Annotated[float, Field(ge=0.0)]]] | None = Field(
        default=None,
        min_length=1,
        description="sizes that can be had, each with its cost, instead of cost and exponent",
        examples=[[["2 arcmin", 1.0], ["1 arcmin", 3.0]]],
    )

    @model_validator(mode="after")
    def _one_way(self) -> CostTable:
        """Refuse a table beside a power."""
        if self.table is not None and self.model_fields_set & {"cost", "exponent"}:
            raise refusal("found a table beside cost or exponent, expected one of them")
        return self


_NAMES = list(dict.fromkeys(slot.name for kind in TABLES for slot in slots(kind)))
_FIELDS: dict[str, Any] = {
    name: (
        CostTable | None,
        Field(
            default=None,
            title=name,
            description=f"cost of the tolerance of {name}",
            examples=[{"cost": 2.0, "exponent": 1.0}],
        ),
    )
    for name in _NAMES
}
_BY_NAME: Any = create_model("CostByName", __base__=table_of(Tolerances), **_FIELDS)


class CostsTable(_BY_NAME):  # type: ignore[misc]
    """Costs of the tolerances: one default, and by name of the error what differs from it."""

    default: CostTable = Field(
        default=CostTable(),
        title="Default",
        description="of every error not named here",
        examples=[{"cost": 1.0, "exponent": 1.0}],
    )


def tolerances_of(
    goals: WantedOfTable,
    costs: CostsTable,
    chain: Chain,
    instrument: Instrument,
    gravity: float,
    where: object,
) -> Tolerances:
    """Goals and prices in SI; raises `StudyError` for an unknown coefficient or error, or a size that is none."""
    kind, goal = instrument.kind, {}
    for symbol, text in goals.stated.items():
        key = f"goal.{symbol}"
        if symbol == DRIFT:
            value, u = _drift(text, instrument, key, where)
        else:
            check_symbol(symbol, (*SYMBOLS[kind], DRIFT), key, where)
            value, u = coefficient_of(text, symbol, kind, instrument.unit, gravity, key, where)
        if not (value > 0.0 and u == 0.0):
            raise StudyError(where, f"{key}: found {shown(text)}, expected a u above zero")
        goal[symbol] = value
    given = {name for name in _NAMES if getattr(costs, name) is not None}
    # what was measured, or follows an angle, is what it is
    bought = {error.name for error in chain.errors if error.pattern is None and not error.certificate}
    for name in sorted(given - bought):
        raise StudyError(where, f"cost.{name}: the table has no such tolerance, expected one of rig.errors")
    prices = {error.name: Price(levels=((1.0, 0.0),)) for error in chain.errors} | {
        error.name: _price(getattr(costs, error.name) if error.name in given else costs.default, error, where)
        for error in chain.errors
        if error.name in bought
    }
    return settings_of(Tolerances, costs, goal=goal, prices=prices)


def _drift(text: object, instrument: Instrument, key: str, where: object) -> tuple[float, float]:
    """The wanted u of an output."""
    try:
        quantity = parse_quantity(text, instrument.unit.dimension, key)
    except QuantityError as error:
        raise StudyError(where, f"{key}: {error.message}") from error
    return quantity.value, quantity.u


def _price(table: CostTable, error: Error, where: object) -> Price:
    """The price of an error's tolerance, sizes over the present one."""
    if table.table is None:
        stated = settings_of(Cost, table)
        return Price(stated.cost, stated.exponent)
    levels = {}
    for text, cost in table.table:
        key = f"cost.{error.name}.table"
        try:
            size = parse_quantity(text, "length" if error.is_offset else "angle", key).value
        except QuantityError as wrong:
            raise StudyError(where, f"{key}: {wrong.message}") from wrong
        if not size > 0.0:
            raise StudyError(where, f"{key}: found {shown(text)}, expected a size above zero")
        levels[size / error.distribution.size] = cost
    return Price(levels=tuple(sorted(levels.items())))
