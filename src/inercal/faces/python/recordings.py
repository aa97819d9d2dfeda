"""Records in: from files, and from arrays, data frames and datasets that a program already has."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from inercal.foundation.arrays import Array
from inercal.foundation.errors import RecordError
from inercal.foundation.inputs import Source
from inercal.foundation.records.channels import is_channel, misfit, nearest, needs_unit
from inercal.foundation.records.checks import check
from inercal.foundation.records.column import Column
from inercal.foundation.records.record import Record
from inercal.foundation.records.stamps import with_sound_stamps
from inercal.foundation.records.titles import name_and_unit
from inercal.foundation.units import Unit, parse_quantity, parse_unit

if TYPE_CHECKING:
    from inercal.faces.python.study import Study
    from inercal.foundation.records.maps import RecordMap

GIVEN = Source("arrays", "")
"""Source of a record of arrays."""

_SI = {"acc": "m/s^2", "a": "m/s^2", "gyro": "rad/s", "wc": "rad/s", "rate": "rad/s", "y": "rad/s"}
_SI |= {"phi": "rad", "th": "rad", "theta": "rad", "temperature": "degC"}
"""Unit of a channel whose name begins so, where none is given."""


def read(
    paths: str | Path | Sequence[str | Path],
    map: str | Path | RecordMap | None = None,
    *,
    answers: Mapping[str, str] | None = None,
    begin: str | float | None = None,
    end: str | float | None = None,
    counted: bool = False,
) -> Record:
    """Read one or several files into a record, with findings about whatever is suspicious.

    Parameters
    ----------
    paths : path or sequence of paths
        Files with distinct channels are parts of one record; each keeps its own time axis, unless the stamps are
        equal.
    map : path or RecordMap, optional
        Map from columns to channels. Without one columns are recognised, where the files do not say themselves what
        they hold; ``taken`` of the record has what was taken, and why.
    answers : mapping of str to str, optional
        Answers to what neither tells, such as ``{"gyro": "deg/s", "rate": "95 Hz"}``, as of ``--answer``.
    begin, end : str, float or None
        Part of the recording, from the first stamp of each clock: ``"12.5 s"``, or seconds.
    counted : bool
        Rows need no times and are then counted 0, 1, 2, ...: means of poses.

    Returns
    -------
    Record
        Every row of every file: what could not be read is NaN, and is in ``findings``.

    Raises
    ------
    InputError
        A file that cannot be read, a map that does not fit it, a guess that nobody answered, or no rows from ``begin``
        to ``end``.

    Examples
    --------
    >>> import inercal as ic
    >>> from inercal.examples import FOLDER
    >>> log = ic.read(FOLDER / "ferraris.csv.gz", map=FOLDER / "ferraris-map.toml", begin="10 s", end="20 s")
    >>> len(log["acc_x"].values)
    2049
    """
    from inercal.foundation.records.read import read as read_files

    return read_files(paths, _map_for(paths, map, answers), counted=counted).between(begin, end)


def _map_for(
    paths: str | Path | Sequence[str | Path],
    given: str | Path | RecordMap | None,
    answers: Mapping[str, str] | None = None,
) -> RecordMap | None:
    """The map that files are read by; raises `InputError`, also for one with a guess."""
    from inercal.foundation.records.maps import read_map
    from inercal.foundation.records.recognise.map_text import map_for

    files = [Path(path) for path in ([paths] if isinstance(paths, str | Path) else paths)]
    written = read_map(given) if isinstance(given, str | Path) else given
    record_map = map_for(files, written, answers or {}, {})
    if record_map is not None:
        record_map.refuse_guess()
    return record_map


def repeats(paths: Sequence[str | Path], study: Study, map: str | Path | None = None) -> list[Record]:
    """Read the records that a study is of: files with distinct channels are one, with the same ones repeat runs.

    Raises `InputError` as `read`.
    """
    from inercal.foundation.records.read import read_runs

    return read_runs(paths, _map_for(paths, map), counted=study.system.counted(study.settings))


def record(
    table: Any = None,
    /,
    *,
    t: ArrayLike | None = None,
    rate: float | str | None = None,
    units: Mapping[str, str] | None = None,
    **channels: ArrayLike,
) -> Record:
    """Make a record of arrays, of a pandas DataFrame, or of an xarray Dataset.

    Parameters
    ----------
    table : pandas.DataFrame, xarray.Dataset or mapping of str to arrays, optional
        Columns named as channels, with a unit in brackets (``acc_x [m/s^2]``), in ``units``, or, of a Dataset, as the
        attribute ``units`` that `Record.to_xarray` writes. Columns of other names are left out.
    t : (n,) array, optional
        Time stamps [s], or in the unit ``units["t"]``.
    rate : float or str, optional
        Sample rate [Hz], ``100.0`` or ``"100 Hz"``, where there are no stamps.
    units : mapping of str to str, optional
        Unit of a channel or of all channels of a sensor: ``{"gyro": "deg/s", "temperature": "degC"}``. Without one,
        arrays are in SI (temperature in degC).
    **channels : array
        (n,) of a channel (``acc_x``, ``phi1``, ``a1``), or (n, 3) of the axes x, y, z of a sensor (``acc``, ``gyro``,
        ``wc``, ``th``); ``label`` may be n texts.

    Returns
    -------
    Record
        With the findings that the same columns of a file would have.

    Raises
    ------
    InputError
        A name that is no channel, a unit that does not fit it, arrays of different length, or no time.

    Examples
    --------
    >>> import inercal as ic
    >>> import numpy as np
    >>> ic.record(t=np.arange(4) / 100, acc=np.ones((4, 3)), gyro=np.zeros((4, 3)), units={"gyro": "deg/s"})
    Record of 6 columns
      acc_x [m/s^2], acc_y [m/s^2], acc_z [m/s^2], gyro_x [deg/s], gyro_y [deg/s], gyro_z [deg/s]: 4 rows over 0.03 s
      findings: nothing suspicious
    """
    given = dict(units or {})
    if table is not None and hasattr(table, "data_vars"):
        return _of_dataset(table, given)
    labels: tuple[str, ...] = ()
    columns: dict[str, tuple[Array, str | None]] = {}
    for name, values, unit in (*_of_table(table), *((name, each, None) for name, each in channels.items())):
        if name == "label" and np.asarray(values).dtype.kind not in "fiub":
            labels = tuple(map(str, np.asarray(values).tolist()))
            continue
        for channel, column in _channels(name, values):
            if channel in columns:
                raise RecordError("record", f"found {channel} twice, expected each channel once")
            columns[channel] = (column, unit)
    stamps, unit_of_t = columns.pop("t", (None, None))
    if not columns:
        raise RecordError("record", "found no channel, expected arrays such as acc=(n, 3) or gyro_z=(n,)")
    rows = len(next(iter(columns.values()))[0])
    axis = _time(t if stamps is None else stamps, rate, rows, given.get("t") or unit_of_t)
    _known(given, (*columns, "t"))
    made = {
        name: _column(name, values, given.get(name) or given.get(_sensor(name)) or unit, axis)
        for name, (values, unit) in columns.items()
    }
    if labels and len(labels) != len(axis):
        raise RecordError(
            "record", f"label: found {len(labels)} texts, expected {len(axis)} as there are rows"
        )
    made, of_time = with_sound_stamps(made)
    return Record(made, (*of_time, *check(made)), (GIVEN,), labels)


def _of_table(table: Any) -> Iterator[tuple[str, ArrayLike, str | None]]:
    """Channel, values and unit of the columns of a data frame or mapping that are channels."""
    if table is None:
        return
    if not hasattr(table, "keys"):
        kind = type(table).__name__
        raise RecordError("record", f"found {kind}, expected a DataFrame, a Dataset, or arrays by keyword")
    numeric = 0
    for title in table.keys():  # noqa: SIM118  (of a DataFrame too)
        name, unit = name_and_unit(str(title))
        if is_channel(name) or _is_triad(name):
            numeric += 1
            yield name, np.asarray(table[title]), unit
    if not numeric:
        names = ", ".join(str(title) for title in list(table.keys())[:8]) or "none"
        raise RecordError("record", f'found the columns {names}, expected channels such as "acc_x [m/s^2]"')


def _of_dataset(table: Any, units: Mapping[str, str]) -> Record:
    """The record of a Dataset: a clock for each dimension, units as attributes."""
    axes: dict[str, Array] = {}
    made = {}
    source = GIVEN
    for name, variable in table.data_vars.items():
        if not is_channel(str(name)):
            continue
        (dimension,) = variable.dims if len(variable.dims) == 1 else ("",)
        if dimension not in table.coords:
            raise RecordError(
                "record", f"{name} has the dimensions {variable.dims}, expected one with its times"
            )
        axes.setdefault(dimension, np.asarray(table.coords[dimension].values, dtype=float))
        about = variable.attrs
        unit = units.get(name) or units.get(_sensor(name)) or about.get("units")
        column = _column(str(name), np.asarray(variable.values, dtype=float), unit, axes[dimension])
        source = Source(str(about.get("source", GIVEN.path)), str(about.get("sha256", "")))
        made[str(name)] = replace(column, source=source, frame=str(about.get("frame", "b")))
    if not made:
        raise RecordError(
            "record", f"found the variables {', '.join(map(str, table.data_vars))}, expected channels"
        )
    made, of_time = with_sound_stamps(made)
    sources = tuple(dict.fromkeys(column.source for column in made.values()))
    return Record(made, (*of_time, *check(made)), sources)


def _is_triad(name: str) -> bool:
    """True for a sensor of three axes x, y, z."""
    return name in ("acc", "wc", "th") or name == "gyro"


def _channels(name: str, values: ArrayLike) -> Iterator[tuple[str, Array]]:
    """The channel, or the three of a sensor; refused where the name or the shape is wrong."""
    column = np.asarray(values, dtype=float)
    if _is_triad(name) and column.ndim == 2 and column.shape[1] == 3:
        yield from zip((f"{name}_{axis}" for axis in "xyz"), column.T, strict=True)
        return
    if not is_channel(name):
        if _is_triad(name):
            raise RecordError("record", f"{name}: found the shape {column.shape}, expected (n, 3)")
        raise RecordError("record", f"{name}: unknown channel, {nearest(name)}")
    if column.ndim != 1:
        shapes = "(n,) or (n, 3)" if _is_triad(name) else "(n,)"
        raise RecordError("record", f"{name}: found the shape {column.shape}, expected {shapes}")
    yield name, column


def _time(t: ArrayLike | None, rate: float | str | None, rows: int, unit: str | None) -> Array:
    """Time stamps (n,) [s], given or by the rate."""
    if t is not None:
        if rate is not None:
            raise RecordError("record", "found t and rate, expected one of them")
        stamps = np.asarray(t, dtype=float)
        if stamps.ndim != 1:
            raise RecordError("record", f"t: found the shape {stamps.shape}, expected (n,)")
        time_unit = parse_unit(unit or "s", "t")
        if problem := misfit("t", time_unit):
            raise RecordError("record", f"t: {problem}")
        return np.ascontiguousarray(stamps * time_unit.factor) if time_unit.factor != 1.0 else stamps
    if rate is None:
        raise RecordError("record", 'found no time, expected t=(n,) in seconds or rate="100 Hz"')
    hertz = parse_quantity(rate, "frequency", "rate").value if isinstance(rate, str) else float(rate)
    if not hertz > 0.0:
        raise RecordError("record", f"rate: found {rate}, expected a rate above 0")
    return np.arange(rows) / hertz


def _column(name: str, values: Array, unit: str | None, t: Array) -> Column:
    """A channel with its unit, in SI where none is given."""
    if len(values) != len(t):
        raise RecordError(
            "record", f"{name}: found {len(values)} values, expected {len(t)} as there are times"
        )
    column_unit = _unit(name, unit)
    if problem := misfit(name, column_unit):
        raise RecordError("record", f"{name}: {problem}")
    return Column(name, column_unit, np.ascontiguousarray(values), t, GIVEN)


def _unit(name: str, unit: str | None) -> Unit:
    """The unit given, or the SI unit of a channel."""
    if unit:
        return parse_unit(unit, name)
    begins = (si for word, si in _SI.items() if name.rstrip("0123456789").split("_")[0] == word)
    return parse_unit(next(begins, "1") if needs_unit(name) else "1")


def _sensor(name: str) -> str:
    """``acc`` of ``acc_x``."""
    return name.rsplit("_", 1)[0]


def _known(units: Mapping[str, str], names: Sequence[str]) -> None:
    """Refuse a unit of something that is not in the record."""
    channels = {*names, *map(_sensor, names)}
    for name in units:
        if name not in channels:
            raise RecordError(
                "record", f"units: found {name}, expected one of {', '.join(names)}, or their sensor"
            )
