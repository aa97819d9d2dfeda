"""Maps of a sensitivity analysis as files: every index by output, position and factor."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from inercal.foundation._files import write_bytes
from inercal.foundation.arrays import Array
from inercal.systems.turntable.sensitivity import Analysed

#: name -> dimensions and what it is
_MAPS: dict[str, tuple[tuple[str, ...], str]] = {
    "first": (("output", "position", "factor"), "first-order Sobol index"),
    "total": (("output", "position", "factor"), "total-order Sobol index"),
    "total_minus_first": (("output", "position", "factor"), "total-order minus first-order Sobol index"),
    "shapley": (("output", "position", "factor"), "Shapley effect"),
    "second": (("output", "position", "factor", "other_factor"), "second-order Sobol index"),
    "u_first": (("output", "position", "factor"), "standard uncertainty of first"),
    "u_total": (("output", "position", "factor"), "standard uncertainty of total"),
    "u_total_minus_first": (("output", "position", "factor"), "standard uncertainty of total_minus_first"),
    "variance": (("output", "position"), "variance of the error of the output, in the square of its unit"),
    "bias": (("output", "position"), "expectation of the error of the output, in its unit"),
}


def write_maps(analysed: Analysed, path: str | Path) -> None:
    """Write all indices to a ``.nc`` (NetCDF-3) or ``.npz`` file, whole or not at all; raises `InputError`.

    Dimensions are output, position, factor and, of ``second``, other_factor; angles ``phi1``, ... [rad] belong
    to positions. What an analysis does not give (``shapley``, ``second``) is not in the file. Null indices are
    NaN.
    """
    data = _netcdf(analysed) if Path(path).suffix.lower() == ".nc" else _npz(analysed)
    write_bytes(path, data)


def _maps(analysed: Analysed) -> Iterator[tuple[str, Array]]:
    """The maps there are."""
    for name in _MAPS:
        values = getattr(analysed.indices, name)
        if values is not None:
            yield name, np.asarray(values)


def _npz(analysed: Analysed) -> bytes:
    """The maps and what their axes are, as an NPZ archive."""
    indices = analysed.indices
    texts = {
        "output": indices.outputs,
        "unit": indices.units,
        "factor": indices.factors,
        "what": analysed.what,
    }
    arrays: dict[str, Any] = {name: np.array(values) for name, values in texts.items()}
    arrays |= {"scale": indices.scales, "method": np.array(json.dumps(dict(indices.method)))}
    arrays |= dict(zip(analysed.joints, indices.angles.T, strict=True))
    arrays |= dict(_maps(analysed))
    buffer = io.BytesIO()
    np.savez(buffer, **arrays)
    return buffer.getvalue()


def _netcdf(analysed: Analysed) -> bytes:
    """The maps with coordinates and units, as NetCDF-3."""
    from scipy.io import netcdf_file

    from inercal import __version__

    indices = analysed.indices
    maps = dict(_maps(analysed))
    buffer = io.BytesIO()
    file: Any = netcdf_file(buffer, "w")
    file.title = "Sensitivity of what an instrument on a turntable should read to the errors of the table"
    file.source = f"inercal {__version__}"
    file.method = json.dumps(dict(indices.method))
    sizes = {"output": len(indices.outputs), "position": len(indices.angles), "factor": len(indices.factors)}
    if "second" in maps:
        sizes["other_factor"] = len(indices.factors)
        _add_texts(file, "other_factor", "other_factor", indices.factors, "the other error of a pair")
    for dimension, size in sizes.items():
        if dimension not in file.dimensions:
            file.createDimension(dimension, size)
    _add_texts(
        file, "output", "output", indices.outputs, "gravity (a) or earth rate (w) on the instrument's axes"
    )
    _add_texts(file, "unit", "output", indices.units, "unit of the output")
    _add_texts(file, "factor", "factor", indices.factors, "error of the table")
    _add_texts(file, "what", "factor", analysed.what, "error of the table in words")
    _add(file, "scale", ("output",), indices.scales, "what the output is divided by, in its unit")
    for k, joint in enumerate(analysed.joints):
        _add(file, joint, ("position",), indices.angles[:, k], f"commanded angle {joint}", units="rad")
    place = " ".join(analysed.joints)
    for name, values in maps.items():
        dimensions, words = _MAPS[name]
        units = {} if name in ("variance", "bias") else {"units": "1"}
        _add(file, name, dimensions, values, words, coordinates=place, **units)
    file.flush()
    return buffer.getvalue()


def _add(
    file: Any, name: str, dimensions: tuple[str, ...], values: Array, words: str, **attributes: str
) -> None:
    """A variable of numbers."""
    variable = file.createVariable(name, "d", dimensions)
    variable[:] = values
    for key, text in {"long_name": words, **attributes}.items():
        setattr(variable, key, text)


def _add_texts(file: Any, name: str, dimension: str, texts: Sequence[str], words: str) -> None:
    """A variable of texts, which NetCDF-3 has as rows of characters."""
    rows = [text.encode("utf-8") for text in texts]
    width = max(1, *map(len, rows))
    for each, size in ((dimension, len(rows)), (f"characters_{width}", width)):
        if each not in file.dimensions:
            file.createDimension(each, size)
    variable = file.createVariable(name, "c", (dimension, f"characters_{width}"))
    variable[:] = np.array([list(row.ljust(width, b"\0")) for row in rows], dtype=np.uint8).view("S1")
    variable._Encoding = "utf-8"
    variable.long_name = words
