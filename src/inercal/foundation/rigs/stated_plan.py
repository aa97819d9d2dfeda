"""Positions of a table in a study: a grid, a plan by its name, a list, or a file."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError, StudyError
from inercal.foundation.records.read import read
from inercal.foundation.rigs.chain import Chain
from inercal.foundation.rigs.plans import NAMED, Grid, Plan, StatedPositions, grid, listed, named, within
from inercal.foundation.rigs.stated_chain import JOINTS, Limits
from inercal.foundation.units import shown

MOST = 200_000
"""Positions of a grid that fit into memory with all their indices."""

#: the grid where a study gives none, by number of joints
_USUAL: Mapping[int, tuple[int, ...]] = {1: (36,), 2: (36, 36), 3: (12, 12, 12)}


def plan_of(table: StatedPositions, chain: Chain, limits: Limits, where: object) -> Plan:
    """The positions of a study [rad]; those of a grid that the axes reach.

    Raises `StudyError` for a plan that is not for this table, a list or a file that does not fit its joints, a file
    that cannot be read, or a position beyond a limit.
    """
    if table.plan is not None:
        key, plan = f"positions.plan {table.plan}", _named(table.plan, chain, "positions.plan", where)
    elif table.rows:
        _check_rows(table.rows, chain, where)
        key, plan = "positions.list", listed(table.rows)
    elif table.file is not None:
        key, plan = f"positions.file {shown(table.file)}", _of_file(table.file, chain, where)
    else:
        return grid_of(table.grid, chain, limits, "positions.grid", where, half=True)
    inside, angles = _reached(plan, chain, limits)
    if not inside.all():
        first = int(np.argmin(inside))
        place = ", ".join(f"{math.degrees(angle):.6g} deg" for angle in plan.angles[first])
        raise StudyError(
            where,
            f"{key}: found position {first + 1} ({place}) beyond rig.limits, expected all within",
        )
    return Plan(plan.name, angles)


def grid_of(
    table: Grid | None,
    chain: Chain,
    limits: Limits,
    key: str,
    where: object,
    half: bool,
) -> Plan:
    """The positions of a grid that the axes reach; where none is given, of the usual one, ``half`` a step off or not.

    Raises `StudyError` for a grid that does not fit the joints, is too large, or has no position within the limits.
    """
    counts = _USUAL[len(chain.joints)]
    if table is not None:
        joints = tuple(table.counts)
        if joints != chain.joints:
            raise StudyError(where, f"{key}: found {', '.join(joints)}, expected {', '.join(chain.joints)}")
        counts, half = tuple(table.counts.values()), table.offset == "half"
    if math.prod(counts) > MOST:
        raise StudyError(where, f"{key}: found {math.prod(counts)} positions, expected at most {MOST}")
    whole = grid(counts, half)
    inside, angles = _reached(whole, chain, limits)
    if not inside.any():
        raise StudyError(where, f"{key}: found no position within rig.limits, expected a finer grid")
    return Plan(whole.name if inside.all() else f"{whole.name} within limits", angles[inside])


def compared(names: Sequence[str] | None, chain: Chain, limits: Limits, where: object) -> tuple[str, ...]:
    """Named plans to set beside a design: those asked for, or all that the table can take.

    Raises `StudyError` for a plan that the table cannot take.
    """
    if names is None:
        names = [
            name for name in NAMED if len(chain.joints) == 2 and _reached(named(name), chain, limits)[0].all()
        ]
    for name in names:
        if not _reached(_named(name, chain, "design.compare", where), chain, limits)[0].all():
            raise StudyError(
                where, f"design.compare: found {name!r}, which goes beyond rig.limits, expected others"
            )
    return tuple(names)


def _reached(plan: Plan, chain: Chain, limits: Limits) -> tuple[NDArray[np.bool_], Array]:
    """Positions (n,) that the axes reach, and angles (n, joints) whole turns away that lie within the limits."""
    ranges = [limits.get(joint) for joint in chain.joints]
    angles = plan.angles.copy()
    for k, ends in enumerate(ranges):
        if ends is not None:
            low, high = ends
            beyond = (angles[:, k] < low) | (angles[:, k] > high)
            angles[beyond, k] = low + np.mod(angles[beyond, k] - low, 2.0 * np.pi)
    return within(plan.angles, ranges), angles


def _named(name: str, chain: Chain, key: str, where: object) -> Plan:
    """A named plan, if the table has two axes."""
    if len(chain.joints) != 2:
        raise StudyError(
            where, f"{key}: found {name!r}, a plan of a two-axis table, expected a grid or a list"
        )
    return named(name)


def _check_rows(rows: Sequence[Sequence[float]], chain: Chain, where: object) -> None:
    """Refuse positions with more or fewer angles than there are joints."""
    for k, row in enumerate(rows):
        if len(row) != len(chain.joints):
            raise StudyError(
                where,
                f"positions.list.{k}: found {len(row)} angles, expected {', '.join(chain.joints)}",
            )


def _of_file(name: str, chain: Chain, where: object) -> Plan:
    """The positions in a file, whose path is taken from the folder of the study."""
    path = Path(str(where)).parent / name
    key = f"positions.file: {shown(name)}"
    head = ",".join(f"{joint} [deg]" for joint in chain.joints)
    if not path.exists():
        raise StudyError(
            where, f"{key}: no such file beside the study, expected a CSV with the header {head}"
        )
    try:
        record = read(path)
        angles = {column.name: column.si() for column in record.columns.values() if column.name in JOINTS}
    except InputError as error:
        raise StudyError(where, f"positions.file: {error} (its header should be {head})") from error
    if tuple(sorted(angles)) != chain.joints:
        raise StudyError(
            where, f"{key}: found {', '.join(record.columns)}, expected {', '.join(chain.joints)}"
        )
    if len(rows := np.stack([angles[joint] for joint in chain.joints], axis=-1)) > MOST:
        raise StudyError(where, f"{key}: found {len(rows)} positions, expected at most {MOST}")
    missing = np.flatnonzero(~np.isfinite(rows).all(axis=1))
    if missing.size:
        raise StudyError(where, f"{key}: found no angle in row {missing[0] + 1}, expected one for each axis")
    return Plan(path.name, rows)
