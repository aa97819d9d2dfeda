"""Positions of a table as data: grids over the full circle, the named tumbles of the field, and lists; and their tables
of a study."""

from __future__ import annotations

import difflib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.errors import InputError
from inercal.foundation.keys import Reading, option, quantity, table
from inercal.foundation.units import shown


@short_repr
@dataclass(frozen=True, eq=False)
class Plan:
    """Positions to be taken one after the other: ``angles`` (n, joints) [rad], and what they are called."""

    name: str
    angles: Array

    def __len__(self) -> int:
        """Number of positions."""
        return len(self.angles)


def grid(counts: Sequence[int], half_step: bool = True) -> Plan:
    """All combinations of evenly spaced angles over the full circle, the first joint slowest.

    Parameters
    ----------
    counts : sequence of int
        Number of angles of each joint.
    half_step : bool
        Start half a step from zero, else at zero. With multiples of four no axis then lies along gravity.
    """
    if any(count < 1 for count in counts):
        raise ValueError(f"found counts {tuple(counts)}, expected 1 or more of each joint")
    offset = 0.5 if half_step else 0.0
    circles = [2.0 * np.pi * (np.arange(count) + offset) / count for count in counts]
    angles = np.stack([axis.ravel() for axis in np.meshgrid(*circles, indexing="ij")], axis=-1)
    return Plan(" x ".join(map(str, counts)) + " grid", angles)


def listed(angles: ArrayLike) -> Plan:
    """Positions as given, (n, joints) [rad]."""
    return Plan("list", np.atleast_2d(np.asarray(angles, dtype=float)))


_EIGHTHS = 45.0 * np.arange(8)
_QUARTERS = 90.0 * np.arange(4)


def _pairs(phi1: ArrayLike, phi2: ArrayLike) -> list[tuple[float, float]]:
    """Pairs of two broadcast lists [deg]."""
    first, second = np.broadcast_arrays(np.asarray(phi1, dtype=float), np.asarray(phi2, dtype=float))
    return list(zip(first.ravel().tolist(), second.ravel().tolist(), strict=True))


#: the named plans of a two-axis table (outer y, inner z), pairs of angles [deg]
_NAMED: Mapping[str, list[tuple[float, float]]] = {
    # gravity along each half axis of the instrument
    "6-position": [(0, 0), (180, 0), (90, 0), (90, 90), (90, 180), (90, 270)],
    # gravity towards the corners of a cube
    "8-position": [
        (float(np.degrees(tilt)), turn)
        for tilt in (np.arccos(1.0 / np.sqrt(3.0)), np.arccos(-1.0 / np.sqrt(3.0)))
        for turn in (45.0, 135.0, 225.0, 315.0)
    ],
    # gravity towards the middle of the edges of a cube
    "12-position": [
        *_pairs(45.0, _QUARTERS),
        *_pairs(90.0, _QUARTERS + 45.0),
        *_pairs(135.0, _QUARTERS),
    ],
    # the classic tumble: three circles of eight
    "24-position": [*_pairs(_EIGHTHS, 0.0), *_pairs(_EIGHTHS, 90.0), *_pairs(90.0, _EIGHTHS)],
    # all quarter turns of both axes
    "16-cube": [(a, b) for a in _QUARTERS.tolist() for b in _QUARTERS.tolist()],
}

NAMED = tuple(_NAMED)
"""Names of the plans of a two-axis table."""


_ROUNDING = 1e-9
"""Angles [rad] this far outside a limit count as on it."""


def within(angles: ArrayLike, limits: Sequence[tuple[float, float] | None]) -> NDArray[np.bool_]:
    """Which positions lie within the limits of the axes.

    Parameters
    ----------
    angles : (m, joints) rad
        Whole turns do not matter: 350° lies within -20° to 20°.
    limits : sequence, one per joint
        Lower and upper end [rad]; None for an axis that turns freely.

    Returns
    -------
    (m,) bool

    Raises
    ------
    ValueError
        Another number of limits than of joints, or ends out of order.
    """
    positions = np.asarray(angles, dtype=float)
    if positions.ndim != 2 or positions.shape[1] != len(limits):
        raise ValueError(f"found angles {positions.shape}, expected (m, {len(limits)})")
    inside = np.ones(len(positions), dtype=bool)
    for angle, limit in zip(positions.T, limits, strict=True):
        if limit is None:
            continue
        low, high = limit
        if not low <= high:
            raise ValueError(f"found the limits {low:g} to {high:g}, expected two numbers in order")
        inside &= np.mod(angle - low + _ROUNDING, 2.0 * np.pi) <= high - low + 2.0 * _ROUNDING
    return inside


def named(name: str) -> Plan:
    """A named plan of a two-axis table; raises KeyError for an unknown name."""
    return Plan(name, np.radians(_NAMED[name]))


@dataclass(frozen=True)
class Grid:
    """Combinations of evenly spaced angles over full circles, the outer axis slowest."""

    phi1: int = option("number of outer angles", example=36, least=1)
    phi2: int | None = option(
        "number of angles of the next axis, where there is one", None, example=36, least=1
    )
    phi3: int | None = option("number of inner angles of a three-axis table", None, least=1)
    offset: Literal["half", "none"] = option(
        "start half a step from zero, clear of singular attitudes, or at zero", "half"
    )

    @property
    def counts(self) -> dict[str, int]:
        """Number of angles by name of the joint."""
        counts = {"phi1": self.phi1, "phi2": self.phi2, "phi3": self.phi3}
        return {joint: count for joint, count in counts.items() if count is not None}


def _known_plan(name: Any) -> Any:
    """The name of a plan; refuse one that no plan has, with the nearest one."""
    if name not in NAMED:
        near = difflib.get_close_matches(name[:80], NAMED, n=1, cutoff=0.5) if isinstance(name, str) else ()
        hint = f"did you mean {near[0]}?" if near else f"expected {', '.join(NAMED[:-1])} or {NAMED[-1]}"
        raise InputError("", f"found {shown(name)}, {hint}")
    return name


PLAN_NAME = Reading(_known_plan, {"enum": list(NAMED), "type": "string"})
"""The name of a plan of a two-axis table."""


@dataclass(frozen=True)
class StatedPositions:
    """The positions to analyse, simulate or calibrate at: one of four."""

    grid: Grid | None = table(
        "numbers of evenly spaced angles; offset none starts at zero", None,
        example={"phi1": 36, "phi2": 36, "offset": "half"},
    )  # fmt: skip
    plan: str | None = option("instead: a plan of a two-axis table by its name", None, reads=PLAN_NAME)
    rows: tuple[tuple[float, ...], ...] = quantity(
        "instead: the angles of each position", "angle", (), example=[["0 deg", "45 deg"]], name="list", least=1
    )  # fmt: skip
    file: str | None = option(
        "instead: a CSV beside the study with the header phi1 [deg],phi2 [deg] and a position a row", None,
        example="positions.csv", least=1,
    )  # fmt: skip

    def __post_init__(self) -> None:
        """Refuse two ways at once."""
        ways = {"grid": self.grid, "plan": self.plan, "list": self.rows or None, "file": self.file}
        given = [name for name, way in ways.items() if way is not None]
        if len(given) > 1:
            raise InputError("", f"found {' and '.join(given)}, expected one of them")
