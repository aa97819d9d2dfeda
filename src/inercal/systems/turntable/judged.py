"""Values that an instrument on a table cannot have, and the verdict on another order of the rows."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding, Status
from inercal.foundation.inference import plausible
from inercal.systems.turntable.settings import TurntableSettings

_SCALES = ("K1_", "S_x", "S_y", "S_z", "k_x", "kY_y")
"""Beginnings of the names of scale factors."""

_ANGLES = ("M_", "T_")
"""Beginnings of the names of misalignments."""


def implausible(
    names: Sequence[str], units: Sequence[str], values: Array, u: Array, settings: TurntableSettings
) -> Iterator[Finding]:
    """Values that are outside what they can be."""
    stated = settings.instrument.coefficients
    about = {
        name: stated.get(name, 1.0 if unit == "1" else 0.0) for name, unit in zip(names, units, strict=True)
    }
    scales = {name: about[name] for name in names if name.startswith(_SCALES) and about[name]}
    angles = [name for name in names if name.startswith(_ANGLES) and name not in stated]
    return plausible.implausible(names, values, u, scales, angles)


def misordered(findings: Iterable[Finding]) -> tuple[Status, str] | None:
    """Status and sentence where another order of the rows fits better."""
    found = next((finding for finding in findings if finding.code == "row_order"), None)
    return None if found is None else (Status.INCONSISTENT, found.message)
