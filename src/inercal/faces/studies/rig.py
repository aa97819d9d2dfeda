"""The table of a study: its kind, its errors by name or a chain of its own, its base, the limits of its axes."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Annotated, Any, Literal, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, GetCoreSchemaHandler, GetJsonSchemaHandler, create_model, model_validator
from pydantic_core import core_schema

from inercal.faces.studies.fields import QuantityText, refusal
from inercal.faces.studies.rig_errors import (
    EXPECTED,
    AngularErrorTable,
    ErrorPlace,
    NamedErrorTable,
    OffsetErrorTable,
    elements_of,
)
from inercal.foundation._toml import Strict
from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.foundation.geometry.rotations import Axis, elementary
from inercal.foundation.rigs.chain import Chain, Element, Error, Fixed, Joint, Scope
from inercal.foundation.rigs.patterns import Distribution
from inercal.foundation.rigs.tables import TABLES, Slot, slots, turntable
from inercal.foundation.units import Quantity, shown

JOINTS = ("phi1", "phi2", "phi3")
"""Names that the joints of a chain have, base first: those of the angles in a record."""

Turn = Annotated[Quantity, QuantityText("angle", "90 deg")]


class ElementTable(NamedErrorTable):
    """An element of a chain: a joint, a fixed turn, or an error with its distribution."""

    joint: Literal["phi1", "phi2", "phi3"] | None = Field(
        default=None, description="a commanded angle; the record has it by this name"
    )
    turn: Turn | None = Field(default=None, description="a known, fixed angle")
    error: str | None = Field(default=None, description="name of an error", examples=["sag_x"], max_length=40)
    axis: Literal["x", "y", "z"] = Field(
        description="axis, of the frame that the elements before have reached, about which it turns"
    )
    what: str = Field(default="", description="the error in words", max_length=120)

    @model_validator(mode="after")
    def _one_kind(self) -> ElementTable:
        """Refuse elements of two kinds or none, and keys that say nothing of theirs."""
        kinds = [name for name in ("joint", "turn", "error") if getattr(self, name) is not None]
        if len(kinds) != 1:
            raise refusal(f"found {' and '.join(kinds) or 'none'}, expected one of joint, turn and error")
        if self.error is None:
            beside = sorted(self.model_fields_set - {*kinds, "axis"})
            if beside:
                raise refusal(f"{beside[0]}: found with a {kinds[0]}, expected it with an error only")
        elif not re.fullmatch(r"[A-Za-z]\w*", self.error):
            raise refusal(f"error: found {self.error!r}, expected a name of letters, digits and _")
        if self.turn is not None and self.turn.u > 0.0:
            raise refusal("turn: found an uncertainty, expected it as an error with a value beside the turn")
        return self


def custom_chain(
    elements: Sequence[ElementTable], base: Sequence[float], mounting: Array | None, key: str, where: object
) -> Chain:
    """The chain of a study, its known attitude of the base [rad] before it, the instrument's ``mounting`` after it.

    Raises `StudyError` for no joint, joints that are not phi1, phi2, phi3 in order, an error without a distribution, a
    name twice.
    """
    joints = [element.joint for element in elements if element.joint is not None]
    if not joints or joints != list(JOINTS[: len(joints)]):
        raise StudyError(
            where, f"{key}: found the joints {', '.join(joints) or 'none'}, expected phi1, then phi2, phi3"
        )
    made: list[Element] = []
    if any(base):
        azimuth, north, west = base
        made.append(Fixed(elementary("z", azimuth) @ elementary("x", north) @ elementary("y", west)))
    jointed = False
    for k, element in enumerate(elements):
        axis: Axis = element.axis
        if element.joint is not None:
            made.append(Joint(element.joint, axis))
            jointed = True
        elif element.turn is not None:
            made.append(Fixed(elementary(axis, element.turn.value)))
        else:
            made += _errors(element, axis, jointed, f"{key}.{k}", where)
    if mounting is not None:
        made.append(Fixed(mounting))
    try:
        return Chain(tuple(made))
    except ValueError as problem:
        raise StudyError(where, f"{key}: {problem}") from problem


def _errors(element: ElementTable, axis: Axis, jointed: bool, key: str, where: object) -> list[Element]:
    """Everything that is stated of an error."""
    assert element.error is not None
    distribution = element.distribution()
    if distribution is None and not element.measured:
        raise StudyError(where, f"{key}: found no distribution, expected {EXPECTED}, or what is measured")
    made = elements_of(element, ErrorPlace(element.error, axis, element.what, jointed, key, where))
    if distribution is not None:
        scope = Scope.RIG if element.scope is None else Scope(element.scope)
        if scope is Scope.ANGLE and not jointed:
            raise StudyError(
                where, f'{key}.scope: found "angle" before the first joint, expected another scope'
            )
        made.append(Error(element.error, axis, distribution, scope, element.what))
    return made


Limits: TypeAlias = Mapping[str, tuple[float, float]]
RigKind = Literal["two_axis_turntable", "three_axis_turntable", "chain"]

Angle = Annotated[Quantity, QuantityText("angle", "40 deg")]
"""Any angle."""


@dataclass(frozen=True)
class OrNone:
    """Lets a field that holds a table also take the text "none": ``Annotated[Table | Literal["none"], OrNone()]``.

    A union would do the same, but would name its members in every error.
    """

    def __get_pydantic_core_schema__(
        self, source: type[Any], handler: GetCoreSchemaHandler
    ) -> core_schema.CoreSchema:
        """The table's own validation, but for that text."""

        def read(value: object, table: core_schema.ValidatorFunctionWrapHandler) -> object:
            if value == "none":
                return value
            if isinstance(value, str):
                raise refusal(
                    f'found {shown(value)}, expected "none" or a table such as {{ uniform = "2 arcmin" }}'
                )
            return table(value)

        as_given = core_schema.plain_serializer_function_ser_schema(
            lambda value: value if value == "none" else value.model_dump(mode="json", exclude_unset=True)
        )
        inner = handler(get_args(source)[0])
        return core_schema.no_info_wrap_validator_function(read, inner, serialization=as_given)

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """The table, or the text."""
        return {"anyOf": [handler(schema), {"const": "none"}]}


def _slots() -> list[Slot]:
    """Every error that some table may have, each name once."""
    return list({slot.name: slot for kind in TABLES for slot in slots(kind)}.values())


def _error_field(slot: Slot) -> Any:
    """The field of one error of a table."""
    table = OffsetErrorTable if slot.is_offset else NamedErrorTable
    note = "; only where it is given" if slot.optional else ""
    field = Field(
        default=None,
        title=slot.name,
        description=f"{slot.what}; usual scope {slot.scope.value}{note}",
        examples=[{"normal": "10 um" if slot.is_offset else "1 arcmin"}],
    )
    return (Annotated[table | Literal["none"], OrNone()], field)


_BY_NAME: Any = create_model(
    "ByName", __base__=Strict, **{slot.name: _error_field(slot) for slot in _slots()}
)


class ErrorsTable(_BY_NAME):  # type: ignore[misc]
    """Errors of the table: one default, and by name what differs from it."""

    default: AngularErrorTable | None = Field(
        default=None,
        title="Default",
        examples=[{"uniform": "2 arcmin"}],
        description="of every error not named here, the optional ones aside",
    )


class BaseTable(Strict):
    """Known attitude of the table's base, turned in this order."""

    azimuth: Angle | None = Field(
        default=None, description="about up, north towards west positive; 0 if absent"
    )
    tilt_north: Angle | None = Field(default=None, description="about north; 0 if absent")
    tilt_west: Angle | None = Field(default=None, description="about west; 0 if absent")


class LimitsTable(Strict):
    """Ranges within which the axes turn; a whole circle if absent."""

    phi1: tuple[Angle, Angle] | None = Field(
        default=None, description="lowest and highest outer angle", examples=[["-90 deg", "90 deg"]]
    )
    phi2: tuple[Angle, Angle] | None = Field(
        default=None, description="of the next axis", examples=[["-180 deg", "180 deg"]]
    )
    phi3: tuple[Angle, Angle] | None = Field(
        default=None, description="of the inner axis of three", examples=[["-180 deg", "180 deg"]]
    )


class RigTable(Strict):
    """The turntable."""

    kind: RigKind = Field(
        description="two axes (outer y, inner z), three (z, y, x), or a chain of elements of your own"
    )
    chain: list[ElementTable] = Field(
        default=[],
        title="Chain",
        description="elements of a chain, base first; for kind = chain only",
        examples=[[{"joint": "phi1", "axis": "z"}]],
    )
    errors: ErrorsTable = Field(
        default=ErrorsTable(),
        title="Errors",
        description='errors of the table, NAME = "none" leaves one out; none if absent',
    )
    base: BaseTable = Field(
        default=BaseTable(), title="Base", description="known attitude of the base; level and north if absent"
    )
    limits: LimitsTable = Field(
        default=LimitsTable(), title="Limits", description="ranges of the axes; whole circles if absent"
    )


def chain_of(
    table: RigTable, where: object, mounting: NDArray[np.float64] | None = None, key: str = "rig"
) -> Chain:
    """The chain of a table with the errors that are given for it, and an instrument ``mounting`` (3, 3) on it.

    Raises `StudyError`, with the ``key`` of the table in the study, for an error that this kind of table does not have,
    or one without any distribution.
    """
    angles = (table.base.azimuth, table.base.tilt_north, table.base.tilt_west)
    base = [0.0 if angle is None else angle.value for angle in angles]
    if table.kind == "chain":
        if "errors" in table.model_fields_set:
            raise StudyError(
                where, f"{key}.errors: found with a chain, expected its errors among {key}.chain"
            )
        return custom_chain(table.chain, base, mounting, f"{key}.chain", where)
    if table.chain:
        raise StudyError(
            where, f'{key}.chain: found with kind = {table.kind!r}, expected it with "chain" only'
        )
    by_name = {slot.name: slot for slot in slots(table.kind)}
    given: dict[str, Any] = {name: getattr(table.errors, name) for name in table.errors.model_fields_set}
    usual = given.pop("default", None)
    default = None if usual is None else usual.distribution()
    if usual is not None and default is None:
        raise StudyError(where, f"{key}.errors.default: found no distribution, expected {EXPECTED}")
    after_joint = _after_joint(table.kind)
    scopes: dict[str, Scope] = {}
    if usual is not None and usual.scope is not None:
        scope = Scope(usual.scope)
        scopes = {name: scope for name in by_name if name in after_joint or scope is not Scope.ANGLE}
    errors: dict[str, Distribution] = {}
    parts: dict[str, list[Element]] = {}
    for name, error in given.items():
        own = f"{key}.errors.{name}"
        if name not in by_name:
            near = difflib.get_close_matches(name, by_name, n=1, cutoff=0.0)[0]
            raise StudyError(where, f"{own}: unknown error of a {table.kind}, did you mean {near}?")
        if error == "none":
            continue
        slot, distribution = by_name[name], error.distribution()
        if isinstance(error, NamedErrorTable) and error.measured:
            place = ErrorPlace(name, slot.axis, slot.what, name in after_joint, own, where)
            parts[name] = elements_of(error, place)
        elif distribution is None:
            distribution = None if slot.is_offset else default
            if distribution is None:
                raise StudyError(where, f"{own}: found no distribution, expected {EXPECTED}")
        if distribution is not None:
            errors[name] = distribution
        if error.scope is not None:
            scopes[name] = Scope(error.scope)
            if scopes[name] is Scope.ANGLE and name not in after_joint:
                raise StudyError(
                    where, f'{own}.scope: found "angle" before the first joint, expected another scope'
                )
    if default is not None:
        unnamed = (slot.name for slot in by_name.values() if not slot.optional and slot.name not in given)
        errors |= dict.fromkeys(unnamed, default)
    return turntable(table.kind, None, errors, scopes, base, mounting, parts)


def _after_joint(kind: str) -> frozenset[str]:
    """Names of the errors of a table of that kind that come after a joint."""
    parts = TABLES[kind]
    first = next(k for k, part in enumerate(parts) if isinstance(part, Joint))
    return frozenset(part.name for part in parts[first:] if isinstance(part, Slot))


def limits_of(table: RigTable, chain: Chain, where: object) -> dict[str, tuple[float, float]]:
    """Allowed range (low, high) [rad] of the joints that have one.

    Raises `StudyError` for limits of a joint the table does not have, or ends out of order.
    """
    limits = {}
    for joint in LimitsTable.model_fields:
        ends = getattr(table.limits, joint)
        if ends is None:
            continue
        if joint not in chain.joints:
            raise StudyError(where, f"rig.limits.{joint}: a {table.kind} has {', '.join(chain.joints)} only")
        low, high = ends
        if not low.value < high.value:
            raise StudyError(
                where,
                f"rig.limits.{joint}: found {low.text!r} to {high.text!r}, expected the lower end first",
            )
        limits[joint] = (low.value, high.value)
    return limits
