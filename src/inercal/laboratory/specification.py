"""Tolerances of coefficients, and what a calibration says of them: conform or not, by a stated rule.

Rules (ILAC-G8:09/2019): *simple acceptance*, the value is within its limits; *guard band*, it is within by U; *risk*,
the probability that the true value is outside is at most the one that is stated (JCGM 106:2012, 8.3).
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

from inercal.foundation.errors import InputError
from inercal.foundation.units import parse_unit

if TYPE_CHECKING:
    from inercal.foundation.results.result import Estimate

Verdict = Literal["conform", "not conform"]

_AXES = re.compile(r"_(?:[xyz]{1,2}|\d+)$")

_RISK = re.compile(r"risk (\d+(?:\.\d+)?) ?%")
_QUANTITY = re.compile(r"([-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?)\s*(.*)")
_RULES = 'expected "simple acceptance", "guard band" or a risk such as "risk 2 %"'


def group_of(name: str) -> str:
    """Group of a coefficient: its name without its axes or number, ``D_F`` of ``D_F_x``."""
    return _AXES.sub("", name)


@dataclass(frozen=True)
class TypedLimits:
    """Limits of a coefficient as they were typed: (number, unit) of the lower and the upper one."""

    low: tuple[float, str]
    high: tuple[float, str]


@dataclass(frozen=True)
class Specification:
    """Limits by the name of a coefficient, or of a group such as ``K1``; the rule of decision, and its risk."""

    limits: Mapping[str, TypedLimits]
    rule: str
    risk: float | None

    def of(self, name: str, unit: str, shown: tuple[str, float] | None = None) -> tuple[float, float] | None:
        """Limits of a coefficient in its ``unit``, None without any; ``shown`` is the unit for people and how many of
        ``unit`` it is.

        Raises `InputError` where they are in a unit of another kind.
        """
        key = name if name in self.limits else group_of(name)
        found = self.limits.get(key)
        if found is None:
            return None
        low, high = (
            value * _factor(text, unit, shown, f"specification.{key}")
            for value, text in (found.low, found.high)
        )
        return low, high

    def without_value(self, names: Iterable[str]) -> list[str]:
        """The names of limits that belong to none of the coefficients ``names``."""
        there = {each for name in names for each in (name, group_of(name))}
        return [key for key in self.limits if key not in there]


def specification_of(table: Mapping[str, Any], where: object) -> Specification:
    """The table ``[specification]``: ``decision``, and limits of coefficients.

    ``K1_x = ["-50 ppm", "50 ppm"]`` are limits, ``"50 ppm"`` is short for those about zero. Raises `InputError`.
    """
    rule = table.get("decision", "simple acceptance")
    risk = None
    if rule not in ("simple acceptance", "guard band"):
        match = _RISK.fullmatch(rule) if isinstance(rule, str) else None
        risk = float(match[1]) / 100.0 if match else math.nan
        if not 0.0 < risk < 0.5:
            raise InputError(where, f"specification.decision: found {rule!r}, {_RULES}")
    limits = {name: _limits(value, name, where) for name, value in table.items() if name != "decision"}
    return Specification(limits, rule, risk)


def _limits(value: Any, name: str, where: object) -> TypedLimits:
    """The limits of a coefficient."""
    key = f"specification.{name}"
    texts: Sequence[Any] = [value] if isinstance(value, str) else value
    if (
        not isinstance(texts, list)
        or len(texts) not in (1, 2)
        or not all(isinstance(each, str) for each in texts)
    ):
        raise InputError(
            where, f'{key}: found {value!r}, expected limits such as ["-50 ppm", "50 ppm"] or "50 ppm"'
        )
    ends = [_typed(text, key, where) for text in texts]
    if len(ends) == 1:
        ((size, unit),) = ends
        ends = [(-size, unit), (size, unit)]
    if ends[0][1] == ends[1][1] and not ends[0][0] < ends[1][0]:
        raise InputError(where, f"{key}: found {value!r}, expected the lower limit first")
    return TypedLimits(*ends)


def _typed(text: str, key: str, where: object) -> tuple[float, str]:
    """Number and unit."""
    match = _QUANTITY.fullmatch(text.strip())
    if match is None or not math.isfinite(float(match[1])):
        raise InputError(where, f'{key}: found {text!r}, expected a number with its unit, such as "50 ppm"')
    return float(match[1]), match[2].strip() or "1"


def _factor(text: str, unit: str, shown: tuple[str, float] | None, where: str) -> float:
    """Size of a typed unit in that of the coefficient."""
    if text == unit:
        return 1.0
    if shown is not None and text == shown[0]:
        return shown[1]
    expected = InputError(where, f"found the unit {text!r}, expected one like {shown[0] if shown else unit}")
    try:
        typed, own = parse_unit(text, where), parse_unit(unit, where)
    except InputError as error:
        raise expected from error
    if typed.dimension != own.dimension:
        raise expected
    return typed.factor / own.factor


@dataclass(frozen=True)
class Conformity:
    """The limits of a coefficient, the probability that its true value is within, and the verdict by the rule."""

    low: float
    high: float
    probability: float
    verdict: Verdict
    rule: str


def conformity(
    specification: Specification, limits: tuple[float, float], value: float, u: float, U: float, dof: float
) -> Conformity:
    """Conformity of a value with standard uncertainty u, expanded U and degrees of freedom (Student t)."""
    from scipy.special import ndtr, stdtr

    low, high = limits

    def below(x: float) -> float:
        if u == 0.0:
            return float(x >= value)
        z = (x - value) / u
        return float(ndtr(z) if math.isinf(dof) else stdtr(dof, z))

    probability = below(high) - below(low)
    guard = U if specification.rule == "guard band" else 0.0
    inside = low + guard <= value <= high - guard
    if specification.risk is not None:
        inside = probability >= 1.0 - specification.risk
    return Conformity(low, high, probability, "conform" if inside else "not conform", specification.rule)


def judged(estimate: Estimate, specification: Specification) -> dict[str, Conformity]:
    """Conformity of the coefficients with limits."""
    shown = estimate.shown_units()
    found = {}
    for p in estimate.parameters.values():
        limits = specification.of(p.name, p.unit, shown[p.name])
        if limits is not None:
            found[p.name] = conformity(specification, limits, p.value, p.u, p.U, p.dof)
    return found
