"""Numbers as texts: rounded to their uncertainty, or short where they have none."""

from __future__ import annotations

import math
from decimal import Decimal

_DIGITS = 16
"""Digits after the first that tell every number from its neighbours."""


def rounded(value: float, u: float, *others: float) -> tuple[str, ...]:
    """Texts of a value, its u and further uncertainties, to two significant digits of u (GUM 7.2.6).

    A dash stands for NaN, an unknown number.
    """
    if not (math.isfinite(value) and math.isfinite(u)) or u <= 0:
        return tuple("–" if math.isnan(x) else f"{x:.6g}" for x in (value, u, *others))
    first = Decimal(f"{u:.1e}").adjusted()  # power of ten of the first digit; 0.0996 rounds to 0.10
    if first >= -4 and max(abs(value), u) < 1e7:
        places = max(0, 1 - first)
        # + 0.0 takes the sign off a zero
        return tuple(f"{round(x, 1 - first) + 0.0:.{places}f}" for x in (value, u, *others))
    if -11 <= first < -4 and 1e-3 <= abs(value) < 1e7:  # 0.99999047, but 2.2e-07
        return (f"{round(value, 1 - first):.{1 - first}f}", *(f"{x:.1e}" for x in (u, *others)))
    if abs(value) < 1e308:  # one above may not be there when it is rounded
        value = round(value, 1 - first) + 0.0  # no digits below the last of u, also of a value smaller than u
    digits = min(max(0, Decimal(str(value)).adjusted() - first + 1), _DIGITS) if value else 0
    return (f"{value:.{digits}e}", *(f"{x:.1e}" for x in (u, *others)))


def concise(value: float, u: float) -> str:
    """A value with its u in brackets, in units of the last digits: ``0.1667(12)``, ``3.0(21)e-09``."""
    power = Decimal(f"{max(abs(value), u):.1e}").adjusted()
    if power < -5:
        return f"{concise(value / 10.0**power, u / 10.0**power)}e{power:03d}"
    first = Decimal(f"{u:.1e}").adjusted()
    places = max(0, 1 - first)
    return f"{round(value, 1 - first) + 0.0:.{places}f}({round(u * 10**places)})"


def short(value: float | None, digits: int = 2) -> str:
    """A number without an uncertainty, to so many digits after the first; a dash where there is none."""
    if value is None or not math.isfinite(value):
        return "–"
    if value and not 1e-4 <= abs(value) < 1e5:
        return f"{value:.1e}"
    return f"{value:.{digits + 1}g}" if abs(value) < 10 ** (digits + 1) else f"{value:.0f}"
