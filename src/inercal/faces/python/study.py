"""Studies, of a TOML file or of the same keys as keywords: to begin with, and for tasks on records.

A study that plans a test tells before it is
made which uncertainties to expect, and where it stops.
"""

from __future__ import annotations

import time
import tomllib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from inercal.faces.python.result import Result, of_coefficients
from inercal.faces.studies.text import toml
from inercal.foundation.arrays import Array
from inercal.foundation.designs.foresight import Foresight
from inercal.foundation.errors import InputError, StudyError
from inercal.foundation.records.places import counted_names
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate, without_coefficients
from inercal.systems.contract import System
from inercal.systems.imu.system import SYSTEM as IMU
from inercal.systems.listed import SYSTEMS
from inercal.systems.turntable.system import SYSTEM as TURNTABLE

if TYPE_CHECKING:
    pass


KINDS = tuple(SYSTEMS)
"""The kinds of study, one for each system, as the commands name them."""

_SITE = ("latitude", "height", "gravity")
"""Keys of the table [site] that may stand alone."""


@dataclass(frozen=True, eq=False, repr=False)
class Study:
    """A study: its ``kind``, and its ``settings`` in SI, frozen.

    ``path`` is the file that it was read from, None of a study by keywords; ``keys`` are the keys that were given, as
    they were typed; ``files`` are the study and the files that it names.
    """

    kind: str
    settings: Any
    path: Path | None = None

    @property
    def system(self) -> System:
        """The system that the study is of."""
        return SYSTEMS[self.kind]

    @property
    def keys(self) -> Mapping[str, Any]:
        """The keys that were given, table by table, ready for JSON."""
        given: Mapping[str, Any] = self.settings.given
        return given

    @property
    def files(self) -> tuple[Path, ...]:
        """The study, and the files that it names; none of a study by keywords."""
        return self.files_without(self.system.unread)

    def files_without(self, table: str) -> tuple[Path, ...]:
        """The study, and the files that it names outside that ``table``."""
        from inercal.faces.studies.load import files_of

        if self.path is None:
            return files_of(Path("study"), self.keys, unread=table)[1:]
        return files_of(self.path, self.keys, unread=table)

    @contextmanager
    def at_fault(self) -> Iterator[None]:
        """Name the study where a task refuses a key of it; refusals of a recording stay as they are."""
        try:
            yield
        except InputError as error:
            if type(error) not in (InputError, StudyError) or self.path is None:
                raise
            raise StudyError(self.path, str(error)) from error

    def __repr__(self) -> str:
        """Ten lines at most: the kind, where it is from, and the keys by table."""
        lines = [f"Study of kind {self.kind}, {self.path or 'by keywords'}"]
        for table, keys in self.keys.items():
            if isinstance(keys, Mapping):
                text = ", ".join(f"{key} = {toml(value)}" for key, value in keys.items())
                lines.append(f"  [{table}] {text}")
        if len(lines) > 10:
            rest = counted_names([line.split("]")[0].strip(" [") for line in lines[9:]], 6)
            lines = [*lines[:9], f"  and the tables {rest}"]
        return "\n".join(line if len(line) <= 110 else f"{line[:106]} ..." for line in lines)


def study(path_or_kind: str | Path, /, **keys: Any) -> Study:
    """Read a study, or make one of keywords.

    Parameters
    ----------
    path_or_kind : str or Path
        A TOML file; or the kind ``"imu"``, ``"strapdown"``, ``"turntable"``, ``"selfcal"`` or ``"aoa"`` of a study by
        keywords.
    **keys
        Tables of the study with the keys of its file, quantities as texts with a unit: ``site={"latitude": "45 deg"}``.
        ``latitude``, ``height`` and ``gravity`` may stand without their table ``site``, and of an IMU or a strapdown
        unit all keys of the table ``imu`` or ``strapdown``: ``method="ferraris"``. Beside a file, they are set over
        its keys.

    Returns
    -------
    Study
        Checked, in SI.

    Raises
    ------
    StudyError
        One sentence: the key, what was found, and what was expected, with the nearest key for one that is unknown.

    Examples
    --------
    >>> import inercal as ic
    >>> ic.study("imu", site={"latitude": "45 deg"}, method="multiposition")
    Study of kind imu, by keywords
      [site] latitude = "45 deg"
      [imu] method = "multiposition"
    """
    if str(path_or_kind) in KINDS:
        kind = str(path_or_kind)
        return Study(kind, _of_keys(kind, _in_tables(kind, keys)))
    path = Path(path_or_kind)
    kind = kind_of(path)
    return read_study(kind, path, [*_overrides(_in_tables(kind, keys))])


def read_study(kind: str, path: Path, overrides: Iterable[str] = ()) -> Study:
    """Read a study of that kind; ``overrides`` as of ``--set``: ``imu.static_start=50 s``. Raises `StudyError`."""
    from inercal.faces.studies.load import load_study

    return Study(kind, load_study(SYSTEMS[kind], path, overrides), path)


def study_of(given: Study | str | Path) -> Study:
    """A study, or the one of a file."""
    if isinstance(given, Study):
        return given
    if isinstance(given, str | Path):
        return study(given)
    raise StudyError("study", f"found {type(given).__name__}, expected a study or the path of one")


def kind_of(path: Path) -> str:
    """The kind of study that a file is, told by ``rig.kind``, or by a table.

    Raises `StudyError` where it cannot be read.
    """
    from inercal.foundation._toml import read_toml

    if not path.suffix and not path.is_file():
        raise StudyError(path, f"found no such file, expected one, or a kind of study: {', '.join(KINDS)}")
    data = read_toml(path, StudyError)
    rig = data.get("rig")
    kind = rig.get("kind") if isinstance(rig, Mapping) else None
    if rig is None:
        return next((each.kind for each in SYSTEMS.values() if each.table in data), IMU.kind)
    return next((each.kind for each in SYSTEMS.values() if kind in each.rigs), TURNTABLE.kind)


def _of_keys(kind: str, keys: Mapping[str, Any]) -> Any:
    """The settings of a study by keywords; files that it names lie in the working folder."""
    return SYSTEMS[kind].read_study(tomllib.loads(_document(keys)), "study")


def _in_tables(kind: str, keys: Mapping[str, Any]) -> dict[str, Any]:
    """The keywords with those in their tables that stand alone."""
    tables: dict[str, Any] = {}
    whole = SYSTEMS[kind].study_file().model_fields
    for key, value in keys.items():
        of_file = isinstance(value, Mapping) and (key in whole or not SYSTEMS[kind].table)
        table = "site" if key in _SITE else "" if of_file else SYSTEMS[kind].table
        if not table or key == "schema":
            tables[key] = {**tables.get(key, {}), **value} if isinstance(value, Mapping) else value
            continue
        beside = tables.setdefault(table, {})
        if key in beside or key in keys.get(table, {}):
            raise StudyError("study", f"{key}: found it alone and in the table {table}, expected it once")
        beside[key] = value
    return tables


def _overrides(tables: Mapping[str, Any], above: str = "") -> Iterator[str]:
    """Keywords as ``--set`` takes them."""
    for key, value in tables.items():
        if isinstance(value, Mapping):
            yield from _overrides(value, f"{above}{key}.")
        else:
            yield f"{above}{key}={toml(value)}"


def _document(keys: Mapping[str, Any]) -> str:
    """Keywords as a TOML document."""
    return "\n".join(f"{toml(key)} = {toml(value)}" for key, value in keys.items())


Progress = Callable[[str], None]
"""Callback (text) that takes the progress in words."""

T = TypeVar("T")


def calibrations(
    records: Sequence[Record],
    study: Study,
    progress: Progress,
    calibrate: Callable[[Record, Any, Progress], T],
) -> list[T]:
    """The calibration of each record, its inputs with the files of the study."""
    calibrated = []
    with study.at_fault():
        for number, record in enumerate(records, start=1):
            of_run = f"run {number} of {len(records)}: " if len(records) > 1 else ""

            def say(text: str, of_run: str = of_run) -> None:
                progress(of_run + text)

            calibrated.append(_traced(calibrate(record, study.settings, say), record, study))
    return calibrated


def of_runs(
    records: Sequence[Record],
    study: Study,
    progress: Progress,
    calibrate: Callable[[Record, Any, Progress], T],
    one: Callable[[T], Result],
    title: str,
    shown_of: Callable[[Estimate, T], Estimate] = lambda estimate, first: estimate.shown(),
) -> Result:
    """The result of ``one`` record, or of repeat runs together, whose ``evidence`` has a calibration for each.

    ``title`` is that of their page; ``shown_of`` an estimate, and the calibration of the first run, is the estimate in
    the units of the command line.
    """
    from inercal.foundation.results.repeat import combine_runs

    calibrated: list[Any] = calibrations(records, study, progress, calibrate)
    if len(calibrated) == 1:
        return one(calibrated[0])
    runs = [calibration.estimate for calibration in calibrated]
    estimate = with_reading(combine_runs(runs), records[0])
    shown = shown_of(estimate, calibrated[0])

    def page() -> str:
        from inercal.faces.report.coefficients import repeats
        from inercal.faces.report.html import render

        return render(shown, repeats(shown), title)

    return Result(estimate, of_coefficients(shown, page), tuple(calibrated))


def of_files(
    records: Sequence[Record],
    study: Study,
    progress: Progress,
    calibrate: Callable[[Sequence[Record], Any, Progress], T],
) -> T:
    """The one calibration of records in order, its inputs with the files of the study."""
    with study.at_fault():
        calibrated: T = _traced(calibrate(records, study.settings, progress), records[0], study)
    return calibrated


def one_run(records: Sequence[Record], instead: str) -> Record:
    """The record, where there is one; else a refusal that says what to do ``instead``. Raises `InputError`."""
    if len(records) > 1:
        second, first = records[1].sources, records[0].sources
        raise InputError(
            second[0].path if second else "records",
            f"has the channels of {first[0].path if first else 'the first'}, expected one run: {instead}",
        )
    return records[0]


def designed_by(
    command: str, study: Study, search: Callable[[], T], references: tuple[str, ...]
) -> tuple[T, Estimate]:
    """Outcome of a search, with ``message``, ``result`` and ``findings``, and the result of the command."""
    from inercal.foundation.records.read import source_of

    clock = time.perf_counter()
    with study.at_fault():
        designed: Any = search()
    timing, files = {"solve": time.perf_counter() - clock}, map(source_of, study.files)
    what = designed.message, designed.result, files, designed.findings, timing, study.keys
    return designed, without_coefficients(command, *what, references=references)


def _traced(calibration: Any, record: Record, study: Study) -> Any:
    """The calibration, its estimate with the span of the record and with the study among its inputs."""
    from inercal.foundation.records.read import source_of

    estimate = with_reading(calibration.estimate, record)
    return replace(
        calibration, estimate=replace(estimate, inputs=(*estimate.inputs, *map(source_of, study.files)))
    )


def with_reading(estimate: Estimate, record: Record) -> Estimate:
    """The estimate, saying what part of the recording it is of, and what its columns were taken for."""
    said = {key: dict(value) for key, value in (("span", record.span), ("taken", record.taken)) if value}
    return replace(estimate, provenance={**estimate.provenance, **said}) if said else estimate


PLANNED = tuple(kind for kind, system in SYSTEMS.items() if system.foresight)
"""Kinds of study that plan a test."""


def foresight(study: Study) -> Foresight:
    """Uncertainties that the plan of a study makes expect. Raises `StudyError` for a study without one."""
    if (found := study.system.foresight) is None:
        raise _without_plan(study)
    with study.at_fault():
        return found(study.settings)


def verticals(study: Study) -> Array:
    """Directions (r, 3) of the vertical on the instrument at each stop that a study plans; none of a model in motion.

    Raises `StudyError` for a study without a plan.
    """
    if (found := study.system.verticals) is None:
        raise _without_plan(study)
    with study.at_fault():
        return found(study.settings)


def _without_plan(study: Study) -> StudyError:
    """The refusal of a study that plans no test."""
    return StudyError(study.path or "study", f"found the kind {study.kind}, expected one with a plan")
