"""Errors of a rig in a study: distributions, measured values, tables over angle, harmonics; as elements of a chain."""

from __future__ import annotations

import hashlib
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, StrictInt, model_validator

from inercal.faces.studies.fields import QuantityText, refusal
from inercal.foundation._files import read_bytes
from inercal.foundation._toml import Strict
from inercal.foundation.arrays import Array
from inercal.foundation.errors import QuantityError, StudyError
from inercal.foundation.geometry.rotations import Axis
from inercal.foundation.inputs import Source
from inercal.foundation.rigs.chain import Element, Error, Scope
from inercal.foundation.rigs.patterns import (
    Distribution,
    Harmonic,
    Known,
    Pattern,
    Tabulated,
    normal,
    triangular,
    two_point,
    uniform,
)
from inercal.foundation.units import Quantity, parse_unit, shown

ScopeName = Literal["sample", "position", "angle", "run", "rig"]

MAKE: Mapping[str, Callable[[float], Distribution]] = {
    "uniform": uniform,
    "normal": normal,
    "triangular": triangular,
    "two_point": two_point,
}
EXPECTED = "uniform, normal, triangular or two_point"
_LEAVE_OUT = 'an error is left out with NAME = "none"'

LARGEST = math.radians(10.0)
"""Largest measured error [rad]: more is an attitude, not an error."""

HalfWidth = Annotated[
    Quantity,
    QuantityText(
        "angle",
        "2 arcmin",
        lambda size: 0.0 < size <= math.pi,
        f"a half width above 0 and up to 180 deg; {_LEAVE_OUT}",
    ),
]
StandardDeviation = Annotated[
    Quantity,
    QuantityText(
        "angle",
        "1 arcmin",
        lambda size: 0.0 < size <= math.pi / 3.0,
        f"a standard deviation above 0 and up to 60 deg; {_LEAVE_OUT}",
    ),
]
Shift = Annotated[
    Quantity,
    QuantityText(
        "length", "10 um", lambda d: 0.0 < d <= 1.0, f"a length above 0 and up to 1 m; {_LEAVE_OUT}"
    ),
]
Amplitude = Annotated[
    Quantity,
    QuantityText("angle", "1 arcsec", lambda a: 0.0 < a <= LARGEST, "an angle above 0 and up to 10 deg"),
]
Measured = Annotated[
    Quantity, QuantityText("angle", "3.2(5) arcsec", lambda a: abs(a) <= LARGEST, "an angle within 10 deg")
]
Phase = Annotated[Quantity, QuantityText("angle", "30 deg")]
_SCOPE = "how long a value lasts: until the next sample, position, angle of the joint or mounting, or for good (rig)"


class _Distributed(Strict):
    """Keys of both kinds of error."""

    @model_validator(mode="after")
    def _one_distribution(self) -> _Distributed:
        """Refuse two distributions."""
        given = [name for name in MAKE if getattr(self, name) is not None]
        if len(given) > 1:
            raise refusal(f"found {' and '.join(given)}, expected one distribution")
        return self

    def distribution(self) -> Distribution | None:
        """The distribution [rad or m], if one is given."""
        for name, make in MAKE.items():
            size = getattr(self, name)
            if size is not None:
                return make(size.value)
        return None


class AngularErrorTable(_Distributed):
    """An error of an attitude: one distribution, and perhaps its scope."""

    uniform: HalfWidth | None = Field(default=None, description="uniform, by its half width")
    normal: StandardDeviation | None = Field(default=None, description="normal, by its standard deviation")
    triangular: HalfWidth | None = Field(default=None, description="triangular, by its half width")
    two_point: HalfWidth | None = Field(default=None, description="plus or minus that size")
    scope: ScopeName | None = Field(default=None, description=_SCOPE)


class HarmonicTable(Strict):
    """A harmonic: amplitude times the sine of order times the angle of the joint, plus phase."""

    order: Annotated[StrictInt, Field(ge=1, le=1024)] = Field(description="periods in a turn of the joint")
    amplitude: Amplitude = Field(
        description="with a phase that of the measured harmonic; without one u of its sine and of its cosine"
    )
    phase: Phase | None = Field(default=None, description="phase of a measured harmonic; unknown if absent")


class NamedErrorTable(AngularErrorTable):
    """An error of an attitude: a distribution, what is measured of it, harmonics of the angle; at least one of them."""

    value: Measured | None = Field(
        default=None, description="measured value: corrected for, its u in the budget"
    )
    table: str | None = Field(
        default=None,
        description="measured error over the angle of the joint: a CSV beside the study with its header "
        "angle [deg],error [arcsec],u [arcsec]",
        examples=["encoder.csv"],
    )
    certificate: str = Field(
        default="", description="certificate of what is measured", examples=["K-2026-117"], max_length=80
    )
    harmonics: list[HarmonicTable] = Field(
        default=[],
        title="Harmonics",
        description="harmonics over the angle of the joint; none if absent",
        examples=[[{"order": 1, "amplitude": "1 arcsec"}]],
    )

    @model_validator(mode="after")
    def _what_belongs_together(self) -> NamedErrorTable:
        """Refuse keys that say nothing here."""
        phases = any(each.phase is not None for each in self.harmonics)
        if self.certificate and self.value is None and self.table is None and not phases:
            raise refusal("found a certificate of nothing measured, expected value, table or a phase with it")
        if self.measured and self.scope is not None and self.distribution() is None:
            raise refusal("scope: found with what is measured alone, expected it with a distribution")
        orders = [each.order for each in self.harmonics]
        for k, order in enumerate(orders):
            if order in orders[:k]:
                raise refusal(f"harmonics.{k}.order: found {order} twice, expected each order once")
        return self

    @property
    def measured(self) -> bool:
        """True if something other than a distribution is given."""
        return self.value is not None or self.table is not None or bool(self.harmonics)


class OffsetErrorTable(_Distributed):
    """An error of a place: one distribution of lengths, and perhaps its scope."""

    uniform: Shift | None = Field(default=None, description="uniform, by its half width")
    normal: Shift | None = Field(default=None, description="normal, by its standard deviation")
    triangular: Shift | None = Field(default=None, description="triangular, by its half width")
    two_point: Shift | None = Field(default=None, description="plus or minus that size")
    scope: ScopeName | None = Field(default=None, description=_SCOPE)


@dataclass(frozen=True)
class ErrorPlace:
    """The place of an error in a chain: its name, its axis, words for it, and if a joint comes before it.

    ``key`` is that of the error in the study ``where``, for errors.
    """

    name: str
    axis: Axis
    what: str
    after_joint: bool
    key: str
    where: object


def elements_of(table: NamedErrorTable, place: ErrorPlace) -> list[Element]:
    """Elements of an error beside its distribution: what is known of it, and how well.

    Raises `StudyError` for a table or harmonic before any joint, or a table that cannot be read.
    """
    if (table.table is not None or table.harmonics) and not place.after_joint:
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
            alone = table.distribution() is None
            uncertain(place.name if alone else f"{place.name}_value", table.value.u, "as measured")
    if table.table is not None:
        angles, errors, u, source = _read_table(table.table, place)
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
    for each in table.harmonics:
        name, order, size = place.name, each.order, each.amplitude
        if each.phase is None:
            uncertain(f"{name}_s{order}", size.value, "unknown phase", Harmonic(order, 0.0))
            uncertain(f"{name}_c{order}", size.value, "unknown phase", Harmonic(order, 0.5 * math.pi))
            continue
        phase = each.phase.value
        parts.append((size.value, Harmonic(order, phase)))
        across = size.value * each.phase.u
        if size.u > 0.0:
            uncertain(f"{name}_s{order}", size.u, f"amplitude of order {order}", Harmonic(order, phase))
        if across > 0.0:
            uncertain(
                f"{name}_c{order}", across, f"phase of order {order}", Harmonic(order, phase + 0.5 * math.pi)
            )
    known: list[Element] = [Known(place.axis, value, tuple(parts), source)] if value or parts else []
    return [*known, *made]


def _read_table(name: str, place: ErrorPlace) -> tuple[Array, Array, Array, Source]:
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
