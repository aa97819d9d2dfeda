"""Values that an instrument on a table cannot have, and the verdict on another order of the rows."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding, Status
from inercal.systems.turntable.limits import LIMITS
from inercal.systems.turntable.settings import TurntableSettings

_SCALES = ("K1_", "S_x", "S_y", "S_z", "k_x", "kY_y")
"""Beginnings of the names of scale factors."""

_ANGLES = ("M_", "T_")
"""Beginnings of the names of misalignments."""

_RANGES = (0.125, 0.25, 0.5, 2.0, 4.0, 8.0)
"""Scale factors of a range that was taken for another one."""


def implausible(
    names: Sequence[str], units: Sequence[str], values: Array, u: Array, settings: TurntableSettings
) -> Iterator[Finding]:
    """Values that are outside what they can be by more than 2 u; of misalignments only where all scale factors are
    plausible."""
    told = False
    stated = settings.instrument.coefficients
    for name, unit, value, own in zip(names, units, values.tolist(), u.tolist(), strict=True):
        about = stated.get(name, 1.0 if unit == "1" else 0.0)
        if not name.startswith(_SCALES) or not about:
            continue
        over = value / about
        if abs(over - 1.0) - 2.0 * own / abs(about) > LIMITS.scale_off:
            told = True
            yield _scale(name, value, over, own)
    if told:
        return
    for name, value, own in zip(names, values.tolist(), u.tolist(), strict=True):
        if name.startswith(_ANGLES) and name not in stated and abs(value) - 2.0 * own > LIMITS.angle_off:
            text = f"{name} is {np.degrees(value):.3g} deg, more than a misalignment can be."
            yield Finding(
                "channel_swap", text, "", (name,), action="Check the order of the axes and the mounting."
            )


def _scale(name: str, value: float, over: float, u: float) -> Finding:
    """The finding about a scale factor that is ``over`` times what was expected."""
    if u > LIMITS.scale_off * abs(value) or abs(over) < LIMITS.scale_off:
        text = f"{name} is {value:.4g}, so that this output does not follow its axis."
        action = "Check the order of the axes, the mounting, and whether the channel works."
        return Finding("channel_swap", text, "", (name,), action=action)
    if any(abs(over / each - 1.0) < LIMITS.range_off for each in _RANGES):
        text = f"{name} is {value:.4g}, as if the sensor had another range."
        return Finding(
            "unit_suspect", text, "", (name,), action="Check the range and the unit of this output."
        )
    if over < 0.0:
        text = f"{name} is negative, {value:.4g}."
        action = "Check the sign of this axis, the heading, and the sense in which the joints turn."
        return Finding("sign_suspect", text, "", (name,), action=action)
    text = f"{name} is {value:.4g}, more than a tenth off what it can be."
    return Finding("implausible", text, "", (name,), action="Check units, signs and the order of the axes.")


def misordered(findings: Iterable[Finding]) -> tuple[Status, str] | None:
    """Status and sentence where another order of the rows fits better."""
    found = next((finding for finding in findings if finding.code == "row_order"), None)
    return None if found is None else (Status.INCONSISTENT, found.message)
