"""Records that were not read from files: simulated ones, and histories of estimators."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from inercal.arrays import Array
from inercal.inputs import Source
from inercal.records.column import Column
from inercal.records.record import Record
from inercal.units import Unit

SIMULATED = Source("simulated", "")


def record_of(columns: Iterable[tuple[str, Unit, Array]], t: Array, source: Source = SIMULATED) -> Record:
    """A record of columns on one clock.

    Parameters
    ----------
    columns : iterable of (name, unit, (n,) values in that unit)
    t : (n,) [s]
    source : Source
        What it says of where it comes from, in place of a file.
    """
    made = {
        name: Column(name, unit, np.ascontiguousarray(values), t, source) for name, unit, values in columns
    }
    return Record(made, sources=(source,))
