"""All units of a manifest calibrated, on many processors, from where an earlier run stopped.

The outcome is a folder: a table with a row for each unit in CSV and Parquet, a page, a result, and the result of each
unit.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import BrokenExecutor
from contextlib import closing
from os.path import realpath
from pathlib import Path
from typing import Any

from inercal.faces.python.result import Result, View
from inercal.faces.python.study import Study, kind_of, read_study
from inercal.foundation._files import make_folder, replacing, write_text
from inercal.foundation.addresses import holds_secret
from inercal.foundation.arrays import finite
from inercal.foundation.computing.cluster import LOCAL, ChunkLostError, Cluster, place
from inercal.foundation.computing.executors import Executor, Processes
from inercal.foundation.errors import InputError, MissingExtraError
from inercal.foundation.findings import Status
from inercal.foundation.results.basis import Basis, provenance
from inercal.foundation.results.files import save
from inercal.foundation.results.result import Estimate
from inercal.foundation.results.shown import csv_text
from inercal.laboratory.fleet.fleet import Fleet, fleet_of
from inercal.laboratory.fleet.manifest import FleetUnit, read_manifest
from inercal.laboratory.fleet.page import page, pictures, result_of, summary, table
from inercal.laboratory.fleet.unit import FAILED, Batch, UnitRow, content_of
from inercal.laboratory.specification import specification_of


def columns(rows: Sequence[UnitRow]) -> dict[str, list[Any]]:
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
        found[f"{name} [{unit}]"] = [None if each is None else finite(each.value) for each in same]
        found[f"U_{name} [{unit}]"] = [None if each is None else finite(each.U) for each in same]
    found["measured"] = [row.measured for row in rows]
    found["made"] = [row.made for row in rows]
    found["seconds [s]"] = [row.seconds for row in rows]
    found["inputs"] = [" ".join(row.inputs.values()) for row in rows]
    return found


def as_csv(rows: Sequence[UnitRow]) -> str:
    """The table as CSV: numbers in full, empty cells where there are none."""
    found = columns(rows)
    return csv_text([found, *zip(*found.values(), strict=True)])


def write_parquet(rows: Sequence[UnitRow], path: Path) -> None:
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


COMMAND = "batch"

Progress = Callable[[int, int], None]
"""Callback (done, all) of the units."""


def batch(
    manifest: str | Path,
    study: str | Path,
    *,
    out: str | Path,
    map: str | Path | None = None,
    overrides: Iterable[str] = (),
    workers: int = 1,
    cluster: str | None = None,
    store: str | None = None,
    progress: Progress = lambda done, all: None,
) -> Result:
    """Calibrate every unit of a manifest by one study.

    Parameters
    ----------
    manifest : path
        A CSV ``serial,files`` with further columns for keys of the study that are a unit's own, or a folder of
        recordings (`inercal.laboratory.fleet.manifest.read_manifest`).
    study : path
        Study of any kind; its ``[specification]`` has the limits for yield and capability.
    out : path
        Folder of the outcome, made if absent: ``units.csv`` and ``units.parquet`` (with the extra ``files``),
        ``fleet.html``, ``fleet.json``, ``results/SERIAL.json``. What is there already and still holds is not done
        again: a unit is, where its inputs, the study or the program changed.
    map : path, optional
        Column map of all files.
    overrides : iterable of str
        Keys of the study for all units, ``"imu.method=means"``.
    workers : int
        Processes. The digits are the same for any number.
    cluster : str, optional
        Address of a dask cluster (`inercal.foundation.computing.cluster.Cluster`), whose workers see manifest, study
        and folder under the same paths as this process.
    store : str, optional
        Store in which every result is kept.
    progress : callable
        Called as ``progress(done, all)``.

    Returns
    -------
    Result
        Without coefficients: ``evidence`` is the `Fleet`; ``ok`` where all units are good.

    Raises
    ------
    InputError
        Manifest, study or folder cannot be used. A unit that cannot be calibrated is a row that says why.

    Examples
    --------
    >>> import inercal as ic, pathlib, tempfile
    >>> from inercal.examples import FOLDER
    >>> there = pathlib.Path(tempfile.mkdtemp())
    >>> _ = (there / "fleet.csv").write_text(f"serial,files\\n7,{FOLDER / 'ferraris.csv.gz'}\\n")
    >>> found = ic.batch(there / "fleet.csv", FOLDER / "ferraris.toml", out=there / "out",
    ...     map=FOLDER / "ferraris-map.toml")
    >>> found.message
    '1 of 1 unit is good'
    """
    executor = place(workers, cluster)
    if store is not None and cluster not in (None, LOCAL) and holds_secret(store):
        raise InputError(
            "--store",
            "found a secret in it, which a cluster would be sent, expected an address without, and the password where "
            "each worker has it (PGPASSWORD, or ~/.pgpass)",
        )
    paths = [Path(manifest), Path(study), Path(out), *([] if map is None else [Path(map)])]
    if cluster is not None:  # workers have working folders of their own
        paths = [path.absolute() for path in paths]
    manifest, study, folder, *maps = paths
    overrides = tuple(overrides)
    units, the_study = read_manifest(manifest), read_study(kind_of(study), study, overrides)
    specification = specification_of(the_study.keys.get("specification", {}), study)
    _spare(folder, manifest, units, [*maps, *the_study.files])
    for each in (folder, folder / "units", folder / "results"):
        make_folder(each)
    work = Batch(manifest, content_of(units), study, maps[0] if maps else None, folder, overrides, store)
    work.prepare()
    rows = _rows(work, units, executor, workers, progress)
    found = fleet_of(rows, specification)
    estimate = _estimate(found, the_study)
    _write(found, estimate, folder)
    view = View(
        estimate,
        estimate.message,
        lambda: [table(found)],
        lambda: page(found, estimate),
        lambda: pictures(found)[0],
    )
    return Result(estimate, view, found)


_AT_ONCE = 8
"""Units that a worker of a cluster is given at once at most, for its scheduler takes some milliseconds each time."""

_NAMES = ("units.csv", "units.parquet", "fleet.html", "fleet.json")
"""Files of a fleet in its folder, beside those of the units."""


def _spare(folder: Path, manifest: Path, units: Sequence[FleetUnit], others: Iterable[Path]) -> None:
    """Refuse a folder where the outcome would take the place of an input, or be taken for recordings."""
    if manifest.is_dir() and Path(realpath(folder)).is_relative_to(realpath(manifest)):
        raise InputError(folder, f"lies in {manifest}, whose files are recordings, expected another folder")
    inputs = {realpath(path) for path in (manifest, *others)}
    inputs |= {realpath(name) for unit in units for name in unit.files if "://" not in name}
    for target in (folder / name for name in _NAMES):
        if realpath(target) in inputs:
            raise InputError(target, "is an input, expected another folder for the outcome")


def _rows(
    work: Batch, units: Sequence[FleetUnit], executor: Executor, workers: int, progress: Progress
) -> list[UnitRow]:
    """The row of each unit; one whose process ended by itself says so, and the others are done all the same."""
    done: dict[int, UnitRow] = {}
    progress(0, len(units))

    size = max(1, min(_AT_ONCE, len(units) // (32 * workers))) if isinstance(executor, Cluster) else 1

    def take(numbers: Sequence[int], place: Executor) -> None:
        with closing(place.map(work, _chunks(numbers, size))) as finished:
            for _, rows in finished:
                done.update(rows)
                progress(len(done), len(units))

    while left := [n for n in range(len(units)) if n not in done]:
        try:
            take(left, executor)
        except BrokenExecutor as error:
            # whichever was at work ended it: those that may have been are tried one by one
            left = [n for n in left if n not in done][: 2 * workers + 2]
            for number in error.chunk if isinstance(error, ChunkLostError) else left:
                try:
                    take([number], Processes(1))
                except BrokenExecutor:
                    done[number] = _ended(work, units[number])
    return [done[n] for n in range(len(units))]


def _chunks(numbers: Sequence[int], size: int) -> list[range]:
    """Increasing numbers in ranges of at most so many."""
    chunks: list[range] = []
    for n in numbers:
        if chunks and n == chunks[-1].stop and len(chunks[-1]) < size:
            chunks[-1] = range(chunks[-1].start, n + 1)
        else:
            chunks.append(range(n, n + 1))
    return chunks


def _ended(work: Batch, unit: FleetUnit) -> UnitRow:
    """The row of a unit whose process ended."""
    row = UnitRow(unit.serial, FAILED, "its process was ended, perhaps for want of memory")
    work.write(row)
    return row


def _estimate(fleet: Fleet, study: Study) -> Estimate:
    """The fleet as a result without parameters."""
    basis = Basis(COMMAND, provenance=provenance(study.keys), references=REFERENCES)
    message = summary(fleet)
    status = Status.OK if fleet.good.good == fleet.good.all else Status.SUSPECT
    return Estimate.without(basis, status, message, result=result_of(fleet))


REFERENCES = (
    "C. J. Clopper, E. S. Pearson, Biometrika 26 (1934) 404-413",
    "A. F. Bissell, Applied Statistics 39 (1990) 331-340",
    "ISO 22514-2:2017, Statistical methods in process management: capability and performance",
    "P. J. Rousseeuw, K. Van Driessen, Technometrics 41 (1999) 212-223",
    "M. Hubert, P. J. Rousseeuw, T. Verdonck, J. Comput. Graph. Stat. 21 (2012) 618-637",
)


def _write(fleet: Fleet, estimate: Estimate, folder: Path) -> None:
    """Write table, page and result; Parquet where the extra `files` is installed."""
    write_text(folder / "units.csv", as_csv(fleet.rows))
    try:
        write_parquet(fleet.rows, folder / "units.parquet")
    except MissingExtraError:
        (folder / "units.parquet").unlink(missing_ok=True)  # of a run with the extra
    write_text(folder / "fleet.html", page(fleet, estimate))
    save(estimate, folder / "fleet.json")


def written(folder: Path) -> tuple[Path, ...]:
    """The files of a fleet in its folder, but for those of the units."""
    return tuple(folder / name for name in _NAMES if (folder / name).is_file())
