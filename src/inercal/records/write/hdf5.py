"""HDF5: a dataset for each column, with attributes, and the clocks as dimension scales."""

from __future__ import annotations

import io
from collections.abc import Callable
from typing import IO

import h5py
import numpy as np

from inercal.records.clocks import Clocks
from inercal.records.record import Record
from inercal.records.write import attributes, origin

TABLE = False


def write(record: Record, axes: Clocks, file: IO[bytes], progress: Callable[[int, int], None] | None) -> None:
    """Write datasets in the root, such as ``acc_x`` on the scale ``t``; labels as strings."""
    buffer = io.BytesIO()  # HDF5 moves about in its file, which a pipe cannot
    with h5py.File(buffer, "w", track_order=True) as root:
        root.attrs.update(origin(record))
        for name, t in axes.axes.items():
            root.create_dataset(name, data=t).make_scale(name)
            root[name].attrs["units"] = "s"
        for name, column in record.columns.items():
            root.create_dataset(name, data=column.values).attrs.update(attributes(column))
            root[name].dims[0].attach_scale(root[axes.of_column[name]])
        if axes.labels is not None:
            root.create_dataset(
                "label", data=np.array(record.labels, dtype=object), dtype=h5py.string_dtype()
            )
            root["label"].dims[0].attach_scale(root[axes.labels])
    file.write(buffer.getbuffer())
