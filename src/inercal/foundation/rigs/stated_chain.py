"""The rig of a study as a chain: a table with its errors, a chain of its own, measured tables, limits of its axes."""

from __future__ import annotations

import difflib
import hashlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._files import read_bytes
from inercal.foundation.arrays import Array
from inercal.foundation.errors import QuantityError, StudyError
from inercal.foundation.geometry.rotations import Axis, elementary
from inercal.foundation.inputs import Source
from inercal.foundation.rigs.chain import Chain, Element, Error, Fixed, Joint, Scope
from inercal.foundation.rigs.patterns import Distribution, Harmonic, Known, Pattern, Tabulated, normal
from inercal.foundation.rigs.stated import (
    LARGEST,
    LEFT_OUT,
    ChainElement,
    NamedError,
    StatedRig,
    TableErrors,
)
from inercal.foundation.rigs.tables import TABLES, Slot, slots, turntable
from inercal.foundation.units import parse_unit, shown

JOINTS = ("phi1", "phi2", "phi3")
"""Names that the joints of a chain have, base first: those of the angles in a record."""

_EXPECTED = "uniform, normal, triangular or two_point"

Limits: TypeAlias = Mapping[str, tuple[float, float]]


def chain_of(
    table: StatedRig, where: object, mounting: NDArray[np.float64] | None = None, key: str = "rig"
) -> Chain:
    """The chain of a table with the errors that are given for it, and an instrument ``mounting`` (3, 3) on it.

    Raises `StudyError`, with the ``key`` of the table in the study, for an error that this kind of table does not have,
    or one without any distribution.
    """
    base = table.base.angles
    if table.kind == "chain":
        if table.errors is not None:
            raise StudyError(
                where, f"{key}.errors: found with a chain, expected its errors among {key}.chain"
            )
        return _custom_chain(table.chain, base, mounting, f"{key}.chain", where)
    if table.chain:
        raise StudyError(
            where, f'{key}.chain: found with kind = {table.kind!r}, expected it with "chain" only'
        )
    by_name = {slot.name: slot for slot in slots(table.kind)}
    stated = table.errors or TableErrors()
    given = {name: error for name in _ERRORS if (error := getattr(stated, name)) is not None}
    usual = stated.default
    default = None if usual is None else usual.distribution
    if usual is not None and default is None:
        raise StudyError(where, f"{key}.errors.default: found no distribution, expected {_EXPECTED}")
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
        if error == LEFT_OUT:
            continue
        slot, distribution = by_name[name], error.distribution
        if isinstance(error, NamedError) and error.measured:
            place = _ErrorPlace(name, slot.axis, slot.what, name in after_joint, own, where)
            parts[name] = _elements_of(error, place)
        elif distribution is None:
            distribution = None if slot.is_offset else default
            if distribution is None:
                raise StudyError(where, f"{own}: found no distribution, expected {_EXPECTED}")
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


_ERRORS = tuple(dict.fromkeys(slot.name for kind in TABLES for slot in slots(kind)))
"""Names of all errors that some table may have."""


def _after_joint(kind: str) -> frozenset[str]:
    """Names of the errors of a table of that kind that come after a joint."""
    parts = TABLES[kind]
    first = next(k for k, part in enumerate(parts) if isinstance(part, Joint))
    return frozenset(part.name for part in parts[first:] if isinstance(part, Slot))


def limits_of(table: StatedRig, chain: Chain, where: object) -> dict[str, tuple[float, float]]:
    """Allowed range (low, high) [rad] of the joints that have one.

    Raises `StudyError` for limits of a joint the table does not have.
    """
    for joint in table.limits.stated:
        if joint not in chain.joints:
            raise StudyError(where, f"rig.limits.{joint}: a {table.kind} has {', '.join(chain.joints)} only")
    return {joint: (low.value, high.value) for joint, (low, high) in table.limits.stated.items()}


def _custom_chain(
    elements: Sequence[ChainElement], base: Sequence[float], mounting: Array | None, key: str, where: object
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


def _errors(element: ChainElement, axis: Axis, jointed: bool, key: str, where: object) -> list[Element]:
    """Everything that is stated of an error."""
    assert element.error is not None
    distribution = element.distribution
    if distribution is None and not element.measured:
        raise StudyError(where, f"{key}: found no distribution, expected {_EXPECTED}, or what is measured")
    made = _elements_of(element, _ErrorPlace(element.error, axis, element.what, jointed, key, where))
    if distribution is not None:
        scope = Scope.RIG if element.scope is None else Scope(element.scope)
        if scope is Scope.ANGLE and not jointed:
            raise StudyError(
                where, f'{key}.scope: found "angle" before the first joint, expected another scope'
            )
        made.append(Error(element.error, axis, distribution, scope, element.what))
    return made


@dataclass(frozen=True)
class _ErrorPlace:
    """The place of an error in a chain: its name, its axis, words for it, and if a joint comes before it.

    ``key`` is that of the error in the study ``where``, for errors.
    """

    name: str
    axis: Axis
    what: str
    after_joint: bool
    key: str
    where: object


def _elements_of(table: NamedError, place: _ErrorPlace) -> list[Element]:
    """Elements of an error beside its distribution: what is known of it, and how well.

    Raises `StudyError` for a table or harmonic before any joint, or a table that cannot be read.
    """
    if (table.measured_table is not None or table.harmonics) and not place.after_joint:
        raise StudyError(
            place.where, f"{place.key}: found an error over angle before the first joint, expected a value"
        )
    made: list[Error] = []
    value, source = 0.0, None
    parts: list[tuple[float, Pattern]] = []

    def uncertain(
        name: str, u: float, what: str, pattern: Pattern | None = None, scope: Scope = Scope.RIG
    ) -> None:
        certificate = table.certificate if what != "unknown phase" else ""
        words = f"{place.what}, {what}" if place.what else what
        made.append(Error(name, place.axis, normal(u), scope, words, False, pattern, certificate))

    if table.value is not None:
        value = table.value.value
        if table.value.u > 0.0:
            alone = table.distribution is None
            uncertain(place.name if alone else f"{place.name}_value", table.value.u, "as measured")
    if table.measured_table is not None:
        angles, errors, u, source = _read_table(table.measured_table, place)
        parts.append((1.0, Tabulated(angles, errors)))
        if np.any(u > 0.0):
            largest = float(u.max())
            uncertain(
                f"{place.name}_table",
                largest,
                "as measured over angle",
                Tabulated(angles, u / largest),
                Scope.ANGLE,
            )
    for harmonic in table.harmonics:
        name, order, size = place.name, harmonic.order, harmonic.amplitude
        if harmonic.phase is None:
            uncertain(f"{name}_s{order}", size.value, "unknown phase", Harmonic(order, 0.0))
            uncertain(f"{name}_c{order}", size.value, "unknown phase", Harmonic(order, 0.5 * math.pi))
            continue
        phase = harmonic.phase.value
        parts.append((size.value, Harmonic(order, phase)))
        across = size.value * harmonic.phase.u
        if size.u > 0.0:
            uncertain(f"{name}_s{order}", size.u, f"amplitude of order {order}", Harmonic(order, phase))
        if across > 0.0:
            uncertain(
                f"{name}_c{order}", across, f"phase of order {order}", Harmonic(order, phase + 0.5 * math.pi)
            )
    known: list[Element] = [Known(place.axis, value, tuple(parts), source)] if value or parts else []
    return [*known, *made]


def _read_table(name: str, place: _ErrorPlace) -> tuple[Array, Array, Array, Source]:
    """Angles within one turn, in order, errors and u (m,) [rad] of a measured table, and its file."""
    path, key, where = Path(str(place.where)).parent / name, f"{place.key}.table: {shown(name)}", place.where
    head = "angle [deg],error [arcsec],u [arcsec]"
    try:
        content = read_bytes(path)
        lines = content.decode("utf-8-sig").splitlines()
    except OSError as problem:
        raise StudyError(
            where, f"{key}: cannot be read ({problem.strerror}), expected a CSV beside the study"
        ) from problem
    except UnicodeDecodeError as problem:
        raise StudyError(where, f"{key}: byte {problem.start} is not UTF-8 text, expected a CSV") from problem
    titles = [title.strip().removesuffix("]").split("[") for title in (lines or [""])[0].split(",")]
    if [title[0].strip() for title in titles] != ["angle", "error", "u"] or any(
        len(each) != 2 for each in titles
    ):
        raise StudyError(
            where, f"{key}, line 1: found {shown((lines or [''])[0])}, expected a header such as {head}"
        )
    try:
        units = [parse_unit(title[1], key, "angle") for title in titles]
    except QuantityError as problem:
        raise StudyError(where, f"{key}, line 1: {problem.message}") from problem
    other = next((unit for unit in units if unit.dimension != "angle"), None)
    if other is not None:
        raise StudyError(
            where, f"{key}, line 1: found {other.symbol}, a unit of {other.dimension}, expected an angle"
        )
    factors = [unit.factor for unit in units]
    rows = []
    for number, line in enumerate(lines[1:], start=2):
        if not line.strip():
            continue
        try:
            row = [float(cell) for cell in line.split(",")]
        except ValueError:
            row = []
        if len(row) != len(titles) or not all(map(math.isfinite, row)):
            raise StudyError(where, f"{key}, line {number}: found {shown(line)}, expected three numbers")
        angle, error, own = (cell * factor for cell, factor in zip(row, factors, strict=True))
        if own < 0.0 or abs(error) > LARGEST:
            wrong = "u below zero" if own < 0.0 else "an error above 10 deg"
            raise StudyError(
                where, f"{key}, line {number}: found {wrong}, expected an error within 10 deg and its u"
            )
        rows.append((angle % (2.0 * math.pi), error, own))
    rows.sort()
    angles, errors, u = np.array(rows).reshape(-1, 3).T
    if len(rows) < 2 or np.any(np.diff(angles) < 1e-9):
        wrong = f"{len(rows)} rows" if len(rows) < 2 else "an angle twice"
        raise StudyError(
            where, f"{key}: found {wrong}, expected two or more different angles within one turn"
        )
    return angles, errors, u, Source(str(path), hashlib.sha256(content).hexdigest())
