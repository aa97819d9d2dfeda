"""Sections of rows of means, one row for each pose, with directions or forces that are known, or without."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.foundation.units import STANDARD_GRAVITY
from inercal.systems.imu.sections.cutting.checks import direction
from inercal.systems.imu.sections.cutting.cut import section_of
from inercal.systems.imu.sections.cutting.limits import LIMITS
from inercal.systems.imu.sections.cutting.table import SectionRow
from inercal.systems.imu.sections.section import Section


@dataclass(frozen=True, eq=False)
class Means:
    """Rows of means: outputs ``acc`` and ``gyro`` (n, 3), None where not there; NaN for a value that is missing.

    ``acc_u`` and ``gyro_u`` (n, 3) are their standard uncertainties by noise. ``true`` (n, 3) is what another
    instrument or the placing says of specific force: in m/s^2 where ``in_si``, else in g.
    """

    acc: Array | None = None
    gyro: Array | None = None
    acc_u: Array | None = None
    gyro_u: Array | None = None
    true: Array | None = None
    in_si: bool = True


def rows_of_means(file: str, means: Means) -> list[SectionRow]:
    """A row of the table for each row of means.

    Where the size of ``true`` is that of gravity everywhere it is a direction; elsewhere the specific force itself.
    Rows in which it is not known have neither. Raises `StudyError` for one of size 0.
    """
    outputs = means.acc if means.acc is not None else means.gyro
    assert outputs is not None
    rows = [SectionRow(f"row {k}", file, why="row") for k in range(1, len(outputs) + 1)]
    if means.true is None:
        return rows
    force = means.true * (1.0 if means.in_si else STANDARD_GRAVITY)
    sizes = np.linalg.norm(force, axis=1)
    known = np.isfinite(sizes)
    if np.any(sizes[known] == 0.0):
        row = int(np.flatnonzero(known & (sizes == 0.0))[0]) + 1
        raise StudyError(f"{file}, row {row}", "found a direction of size 0, expected one, or blank cells")
    # 1 for g in either unit: a table of directions is often one of unit vectors, whatever its heading says
    unit = (
        1.0 if means.in_si and np.all(np.abs(sizes[known] - 1.0) < LIMITS.known_gravity) else STANDARD_GRAVITY
    )
    directions = bool(np.all(np.abs(sizes[known] / unit - 1.0) < LIMITS.known_gravity))
    return [
        _with(row, force[k] / sizes[k] if directions else force[k], directions) if known[k] else row
        for k, row in enumerate(rows)
    ]


def _with(row: SectionRow, vector: Array, is_direction: bool) -> SectionRow:
    """A row with a direction or a force (3,)."""
    if not is_direction:
        return replace(row, force=vector)
    k = int(np.argmax(np.abs(vector)))
    exact = np.eye(3)[k] * np.sign(vector[k])
    up = exact if np.allclose(vector, exact, atol=1e-12) else vector
    return replace(row, up=up, why=f"row, {direction(up)}" if up is exact else "row")


def sections_of_means(rows: Sequence[SectionRow], means: Means) -> list[Section]:
    """The sections of rows of means, in order; those without any output are left out.

    Raises `StudyError` for a row that is neither a rest nor a rate: a mean tells nothing of the motion of a turn.
    """
    sections = []
    for k, row in enumerate(rows):
        acc, gyro = (
            None if x is None or not np.isfinite(x[k]).any() else x[k] for x in (means.acc, means.gyro)
        )
        if acc is None and gyro is None:
            continue
        if row.kind not in ("rest", "rate"):
            found = f"section {row.section}, kind"
            raise StudyError(found, f"found {row.kind} of a row of means, expected rest or rate")
        sections.append(
            replace(
                section_of(row),
                where=f"{row.file}, {row.section}",
                acc=acc,
                acc_var=None if acc is None or means.acc_u is None else means.acc_u[k] ** 2,
                gyro=gyro,
                gyro_var=None if gyro is None or means.gyro_u is None else means.gyro_u[k] ** 2,
            )
        )
    return sections
