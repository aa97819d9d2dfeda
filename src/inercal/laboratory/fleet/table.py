"""The table of a fleet as files: a row for each unit, in CSV and Parquet."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from inercal.foundation._files import replacing
from inercal.foundation.errors import MissingExtraError
from inercal.laboratory.fleet.unit import Row


def columns(rows: Sequence[Row]) -> dict[str, list[Any]]:
    """Columns by title: verdict, each coefficient with its U in one unit of measurement, times, SHA-256 of the inputs.

    A unit without a coefficient, or with it in another unit of measurement, has None there.
    """
    units: dict[str, str] = {}
    for row in rows:
        for each in row.coefficients:
            units.setdefault(each.name, each.unit)
    found: dict[str, list[Any]] = {
        "serial": [row.serial for row in rows],
        "status": [row.status for row in rows],
        "message": [row.message for row in rows],
        "findings": [" ".join(row.findings) for row in rows],
    }
    own = [{each.name: each for each in row.coefficients} for row in rows]
    for name, unit in units.items():
        these = [c.get(name) for c in own]
        same = [each if each is not None and each.unit == unit else None for each in these]
        found[f"{name} [{unit}]"] = [None if each is None else _finite(each.value) for each in same]
        found[f"U_{name} [{unit}]"] = [None if each is None else _finite(each.U) for each in same]
    found["measured"] = [row.measured for row in rows]
    found["made"] = [row.made for row in rows]
    found["seconds [s]"] = [row.seconds for row in rows]
    found["inputs"] = [" ".join(row.inputs.values()) for row in rows]
    return found


def _finite(value: float) -> float | None:
    """A finite number, else None."""
    return value if math.isfinite(value) else None


def as_csv(rows: Sequence[Row]) -> str:
    """The table as CSV: numbers in full, empty cells where there are none."""
    found = columns(rows)
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(found)
    for cells in zip(*found.values(), strict=True):
        writer.writerow(
            ["" if cell is None else repr(cell) if isinstance(cell, float) else cell for cell in cells]
        )
    return out.getvalue()


def write_parquet(rows: Sequence[Row], path: Path) -> None:
    """Write the table as Parquet; raises `MissingExtraError` without pyarrow."""
    try:
        import pyarrow
        import pyarrow.parquet
    except ImportError as error:
        raise MissingExtraError("a table in Parquet", "files") from error
    found = columns(rows)
    texts = {*("serial", "status", "message", "findings", "measured", "made", "inputs")}
    fields = [(name, pyarrow.string() if name in texts else pyarrow.float64()) for name in found]
    with replacing(path) as file:
        pyarrow.parquet.write_table(pyarrow.table(found, schema=pyarrow.schema(fields)), file)
