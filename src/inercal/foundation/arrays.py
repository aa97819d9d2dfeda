"""The one name for arrays of numbers, and what holds some shown in ten lines."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import fields, is_dataclass
from functools import wraps
from typing import TypeVar
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Numbers in SI and radians; batch axes lead, vector axes trail."""


def finite(value: float) -> float | None:
    """A finite number, else None, as JSON and a database have it."""
    return value if math.isfinite(value) else None


K = TypeVar("K")
T = TypeVar("T")


def short_repr(cls: type[T]) -> type[T]:
    """Give a dataclass a `repr` of ten lines at most, with the sizes of what is too long to stand there."""
    cls.__repr__ = _outline  # type: ignore[method-assign]
    return cls


def remembered(function: Callable[[K], T]) -> Callable[[K], T]:
    """The function, which computes once for each argument, as long as that lives: what it gives is not to be changed
    in place."""
    known: WeakKeyDictionary[K, T] = WeakKeyDictionary()

    @wraps(function)
    def of(argument: K) -> T:
        if argument not in known:
            known[argument] = function(argument)
        return known[argument]

    return of


def _outline(self: object) -> str:
    """The class and its fields."""
    members = (f"{each.name}={_in_short(getattr(self, each.name))}" for each in fields(self))  # type: ignore[arg-type]
    text = f"{type(self).__name__}({', '.join(members)})"
    return "\n".join(textwrap.wrap(text, 110, subsequent_indent="    ", max_lines=10, placeholder=" ..."))


def _in_short(value: object) -> str:
    """A value, or what it is where that is long."""
    if isinstance(value, np.ndarray):
        return f"array {value.shape}" if value.size > 3 else str(value.tolist())
    if isinstance(value, Mapping | tuple | list) and len(value):
        text = "" if len(value) > 6 or any(map(_is_large, value)) else repr(value)
        return text if text and len(text) <= 60 else f"{type(value).__name__} of {len(value)}"
    if _is_large(value) or len(text := repr(value)) > 60:
        return type(value).__name__
    return text


def _is_large(value: object) -> bool:
    """True for what has fields of its own, and for arrays."""
    return is_dataclass(value) or isinstance(value, np.ndarray)
