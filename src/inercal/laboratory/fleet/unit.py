"""One unit: read, calibrated, written; done again only where its inputs, study or program changed.

A unit leaves ``results/SERIAL.json``, the result that every other command reads, and ``units/SERIAL.json``, its row
with a key of all that it rests on. The row is written last: what is interrupted before has not happened.
"""

from __future__ import annotations

import hashlib
import json
import math
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass, field, replace
from datetime import UTC, datetime
from functools import cache
from pathlib import Path
from typing import Any
from urllib.parse import quote, urlsplit

from inercal.faces.python.study import Study, kind_of, read_study
from inercal.foundation._files import write_text
from inercal.foundation.addresses import hidden_in, shown_address, without_secrets
from inercal.foundation.errors import InercalError, InputError, MissingExtraError
from inercal.foundation.inputs import program
from inercal.foundation.results.files import plain_objects, save
from inercal.foundation.results.result import Estimate
from inercal.laboratory.fleet.manifest import FleetUnit, read_manifest
from inercal.laboratory.specification import Specification, judged, specification_of

REFUSED = "refused"
"""Status of a unit whose files or keys could not be used: its message is what the command would have said."""

FAILED = "failed"
"""Status of a unit that ended by a fault of the program, or by the end of its process."""


@dataclass(frozen=True)
class Coefficient:
    """A coefficient of a unit in the unit of measurement that people see."""

    name: str
    value: float
    u: float
    U: float
    dof: float
    unit: str


@dataclass(frozen=True)
class UnitRow:
    """The row of a unit: verdict, codes of the findings, coefficients, and the SHA-256 of its ``inputs`` by name.

    Coefficients ``outside`` their limits, and names of limits ``without_value``, which no coefficient has.
    ``measured`` is the date that its study states, else empty; ``made`` when it was calibrated, ``seconds`` how long
    that took; ``key`` stands for all that it rests on, empty where it is to be tried again.
    """

    serial: str
    status: str
    message: str
    findings: tuple[str, ...] = ()
    coefficients: tuple[Coefficient, ...] = ()
    outside: tuple[str, ...] = ()
    without_value: tuple[str, ...] = ()
    inputs: Mapping[str, str] = field(default_factory=dict)
    measured: str = ""
    made: str = ""
    seconds: float = 0.0
    key: str = ""


@dataclass(frozen=True)
class Batch:
    """Calibration of units by their numbers in the manifest: small, so that it can be sent to any process.

    ``content`` is what the manifest says, by `content_of`; ``overrides`` are keys of the study for all units, as
    ``--set`` takes them; ``store`` is where results are kept, None for nowhere.
    """

    manifest: Path
    content: str
    study: Path
    map: Path | None
    folder: Path
    overrides: tuple[str, ...] = ()
    store: str | None = field(default=None, repr=False)

    def __call__(self, numbers: Iterable[int]) -> list[tuple[int, UnitRow]]:
        """Do the units with these numbers that are not done, and give the rows of all."""
        units = _units(self.manifest, self.content)
        return [(number, self._row(units[number])) for number in numbers]

    def prepare(self) -> None:
        """Load what the calibration needs, and compile it where that was never done; raises `InputError`."""
        study = read_study(kind_of(self.study), self.study, self.overrides)
        if study.system.prepare:
            study.system.prepare(study, False)

    def _row(self, unit: FleetUnit) -> UnitRow:
        """The row of a unit, by a new calibration where it must be."""
        paths: Sequence[str] = ()
        try:
            with _local(unit.files) as paths:
                inputs = {name: _sha256(path) for name, path in zip(unit.names, paths, strict=True)}
                key = self._key(unit, inputs)
                before = row_of(self.folder, unit.serial)
                if before is not None and before.key == key and self._whole(before):
                    return before
                row = self._calibrated(unit, paths, inputs)
                return self.write(row if row.status == FAILED else replace(row, key=key))
        except (OSError, InercalError) as error:
            return self.write(UnitRow(unit.serial, REFUSED, _sentence(error, unit, paths)))

    def study_of(self, unit: FleetUnit) -> Study:
        """The study of a unit; raises `InputError`."""
        return read_study(kind_of(self.study), self.study, (*self.overrides, *unit.overrides))

    def _whole(self, row: UnitRow) -> bool:
        """True if the result of a row is there."""
        return row.status in (REFUSED, FAILED) or result_path(self.folder, row.serial).is_file()

    def _key(self, unit: FleetUnit, inputs: Mapping[str, str]) -> str:
        """SHA-256 of all that the row of a unit rests on."""
        study = self.study_of(unit)
        files = {str(path): _sha256(path) for path in (*study.files, *([self.map] if self.map else []))}
        store = None if self.store is None else shown_address(self.store)
        parts = [program(), unit.serial, self.overrides, unit.overrides, inputs, files, store]
        return hashlib.sha256(json.dumps(parts).encode()).hexdigest()

    def _calibrated(self, unit: FleetUnit, paths: Sequence[str], inputs: Mapping[str, str]) -> UnitRow:
        """The row of a unit by a calibration, its result written and kept; raises `InputError` where it cannot be."""
        begun, names = datetime.now(UTC), dict(zip(paths, unit.names, strict=True))
        try:
            study = self.study_of(unit)
            estimate = _renamed(_calibration(study, paths, self.map), names)
            row = _row(
                unit.serial, estimate, specification_of(study.keys.get("specification", {}), self.study)
            )
        except InercalError as error:
            row = UnitRow(unit.serial, REFUSED, _sentence(error, unit, paths))
        except Exception as error:  # a row that says why; the other units go on
            row = UnitRow(unit.serial, FAILED, without_secrets(f"{type(error).__name__}: {error}"))
        else:
            save(estimate, result_path(self.folder, unit.serial))
            if self.store is not None:
                _keep(estimate, self.store, {name: Path(path) for path, name in names.items()})
        ended = datetime.now(UTC)
        return replace(
            row,
            inputs=dict(inputs),
            made=ended.isoformat(timespec="seconds"),
            seconds=round((ended - begun).total_seconds(), 3),
        )

    def write(self, row: UnitRow) -> UnitRow:
        """Write a row, and give it back; a result of before does not stay beside one without any."""
        if row.status in (REFUSED, FAILED):
            result_path(self.folder, row.serial).unlink(missing_ok=True)
        write_text(row_path(self.folder, row.serial), json.dumps(plain_objects(asdict(row))) + "\n")
        return row


def row_path(folder: Path, serial: str) -> Path:
    """File of the row of a unit."""
    return folder / "units" / f"{quote(serial, safe=' ')}.json"


def result_path(folder: Path, serial: str) -> Path:
    """File of the result of a unit."""
    return folder / "results" / f"{quote(serial, safe=' ')}.json"


def row_of(folder: Path, serial: str) -> UnitRow | None:
    """The row that was written of a unit; None where there is none that can be read."""
    try:
        data = json.loads(row_path(folder, serial).read_bytes())
        coefficients = tuple(map(_coefficient, data.pop("coefficients")))
        texts = {key: tuple(data[key]) for key in ("findings", "outside", "without_value")}
        return UnitRow(**{**data, **texts, "coefficients": coefficients})
    except (OSError, ValueError, TypeError, KeyError, AttributeError):
        return None


def _coefficient(given: dict[str, Any]) -> Coefficient:
    """A coefficient of its plain objects, where None is not a finite number."""
    dof = math.inf if given["dof"] is None else float(given["dof"])
    value, u, U = (math.nan if given[key] is None else float(given[key]) for key in ("value", "u", "U"))
    return Coefficient(given["name"], value, u, U, dof, given["unit"])


@cache
def _units(manifest: Path, content: str) -> tuple[FleetUnit, ...]:
    """The units of a manifest, read once in a process; raises `InputError` where they are others by now."""
    units = read_manifest(manifest)
    if content_of(units) != content:
        raise InputError(manifest, "was changed while its units were calibrated, expected it as it was")
    return units


def content_of(units: Sequence[FleetUnit]) -> str:
    """SHA-256 of what a manifest says."""
    return hashlib.sha256(json.dumps([[u.serial, u.files, u.keys] for u in units]).encode()).hexdigest()


def _calibration(study: Study, paths: Sequence[str], map: Path | None) -> Estimate:
    """The calibration of a unit, as its command makes it."""
    from inercal.faces.python.recordings import repeats
    from inercal.faces.python.verbs import calibrate

    return calibrate(repeats(paths, study, map), study).estimate


def _row(serial: str, estimate: Estimate, specification: Specification) -> UnitRow:
    """The row of a result, judged."""
    shown = estimate.shown()
    verdicts = judged(estimate, specification)
    return UnitRow(
        serial,
        estimate.status.value,
        estimate.message,
        tuple(dict.fromkeys(each.code for each in estimate.findings)),
        tuple(Coefficient(p.name, p.value, p.u, p.U, p.dof, p.unit) for p in shown.parameters.values()),
        outside=tuple(name for name, each in verdicts.items() if each.verdict != "conform"),
        without_value=tuple(specification.without_value(estimate.names)),
        measured=str(estimate.traceability.get("date") or ""),
    )


def _keep(estimate: Estimate, store: str, copies: Mapping[str, Path]) -> None:
    """Keep a result in the store, once; ``copies`` are the files by their names in the manifest."""
    from inercal.laboratory.keep import item_of, keep
    from inercal.laboratory.store import open_store

    keep(open_store(store), estimate, item_of(estimate), copies=copies)


@contextmanager
def _local(files: Sequence[str]) -> Iterator[list[str]]:
    """Paths of files on this machine; those at a URL are fetched, and gone at the end. Raises `InputError`."""
    with ExitStack() as stack:
        yield [_fetched(name, stack) if "://" in name else name for name in files]


def _fetched(url: str, stack: ExitStack) -> str:
    """A copy of what is at a URL."""
    import fsspec

    folder, scheme = stack.enter_context(tempfile.TemporaryDirectory(prefix="inercal-")), url.split("://")[0]
    try:
        system, path = fsspec.core.url_to_fs(url)
        name = Path(urlsplit(url).path if scheme in ("http", "https") else path).name  # without a signature
        if name in ("", ".."):
            raise InputError(url, "names no file, expected one at the end of the address")
        copy = str(Path(folder) / name)
        system.get_file(path, copy)  # `get` would take the ? of an address for a pattern
    except InputError:
        raise
    except Exception as error:  # each file system has errors of its own
        if isinstance(error, ImportError) and scheme in _EXTRAS:
            raise MissingExtraError(f"a file at {scheme}://", _EXTRAS[scheme]) from error
        said = " ".join(hidden_in(f"{type(error).__name__}: {error}", url).split())
        raise InputError(url, f"cannot be fetched ({said})") from error
    return copy


_EXTRAS = {"s3": "s3", "gs": "gs", "http": "https", "https": "https"}
"""Extras with what fsspec needs for files at an address."""


def _sha256(path: str | Path) -> str:
    """SHA-256 of a file, or of all files of a folder (a bag)."""
    if Path(path).is_dir():
        inner = (each for each in sorted(Path(path).rglob("*")) if each.is_file())
        return hashlib.sha256("".join(map(_sha256, inner)).encode()).hexdigest()
    with open(path, "rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _sentence(error: Exception, unit: FleetUnit, paths: Sequence[str]) -> str:
    """The sentence of an error, in the names of the manifest."""
    text = (
        f"{error.filename}: cannot be read ({error.strerror})" if isinstance(error, OSError) else str(error)
    )
    for path, name in zip(paths, unit.names, strict=False):
        text = text.replace(path, name)
    return without_secrets(text)


def _renamed(estimate: Estimate, names: Mapping[str, str]) -> Estimate:
    """The estimate in the names of the manifest: a URL in the place of its copy."""
    copies = {path: name for path, name in names.items() if path != name}
    if not copies:
        return estimate

    def named(text: str) -> str:
        for path, name in copies.items():
            text = text.replace(path, name)
        return text

    return replace(
        estimate,
        message=named(estimate.message),
        findings=tuple(
            replace(each, headline=named(each.headline), action=named(each.action), where=named(each.where))
            for each in estimate.findings
        ),
        inputs=tuple(replace(each, path=names.get(each.path, each.path)) for each in estimate.inputs),
    )
