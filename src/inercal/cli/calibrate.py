"""Calibrating by a recording: ``inercal calibrate``, ``selfcal``, ``temperature``, and ``batch`` of many units."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from inercal.cli import EXIT_BAD_VERDICT, command_line
from inercal.cli.options import (
    ClusterOption,
    OutputOptions,
    Overrides,
    ResultOutput,
    StoreOption,
    StudyFile,
    WorkersOption,
    count_of,
    reading,
    study_in,
    working,
)
from inercal.cli.outcome import WHOLE, emit, give
from inercal.cli.records_in import MapFile, RunFiles, Span, read_record, read_repeats
from inercal.cli.streaming import Every, StreamedFiles, StreamOptions, recorded, stream_study
from inercal.foundation.errors import InputError
from inercal.systems.selfcal.estimators import FilterKind

if TYPE_CHECKING:
    from inercal.faces.python.study import Study
    from inercal.foundation.records.record import Record


Latitude = Annotated[
    str | None, Parameter(help='Latitude of the site, in the place of that of the study: "48 deg".')
]


def calibrate_imu(
    files: RunFiles,
    /,
    *,
    study: Annotated[
        Path | None,
        Parameter(help="Study file (TOML); `inercal new` writes one."),
    ] = None,
    map_file: MapFile = None,
    latitude: Latitude = None,
    span: Span = Span(),
    overrides: Overrides = None,
    output: ResultOutput = ResultOutput(),
) -> int:
    """Calibrate an IMU turned by hand, set on its sides, or on a table."""
    keys = _with_latitude(overrides, latitude)
    if study is not None:
        return _calibrated("imu", files, study, map_file, span, keys, output)
    from inercal.faces.python.beginning import study_for

    output.check(WHOLE, (*files, map_file))
    if not any(key.strip().startswith("site.") for key in keys):
        raise InputError("--latitude", 'missing, expected it where there is no --study, such as "48 deg"')
    clock = time.perf_counter()
    records = read_repeats(files, map_file, output, span, counted=True)
    the_study, told = study_for("imu", records, keys)
    if not the_study.system.counted(the_study.settings):
        records = read_repeats(files, map_file, replace(output, quiet=True), span)
    read_s = time.perf_counter() - clock
    output.say(f"study: {told}; `inercal new imu` writes one to change")
    return _solved(the_study, records, output, read_s)


def calibrate_turntable(
    files: RunFiles,
    /,
    *,
    study: StudyFile,
    map_file: MapFile = None,
    latitude: Latitude = None,
    span: Span = Span(),
    overrides: Overrides = None,
    output: ResultOutput = ResultOutput(),
) -> int:
    """Calibrate an instrument at the positions of a table."""
    keys = _with_latitude(overrides, latitude)
    return _calibrated("turntable", files, study, map_file, span, keys, output)


def calibrate_strapdown(
    files: StreamedFiles = None,
    /,
    *,
    study: StudyFile,
    estimator: Annotated[
        Literal["batch", "error-state"] | None,
        Parameter(name="--filter", help="Estimator, in the place of that of the study."),
    ] = None,
    stream: Annotated[
        bool,
        Parameter(
            help="Lines in, from standard input or one FILE, and coefficients out after each rest, live."
        ),
    ] = False,
    map_file: MapFile = None,
    latitude: Latitude = None,
    span: Span = Span(),
    overrides: Overrides = None,
    streaming: StreamOptions = StreamOptions(),
    output: ResultOutput = ResultOutput(),
) -> int:
    """Calibrate a strapdown unit from rests and coarse turns."""
    keys = [
        *_with_latitude(overrides, latitude),
        *([f"strapdown.filter={estimator}"] if estimator is not None else []),
    ]
    if stream:
        if estimator == "batch":
            raise InputError(
                "--filter", "found batch with a stream, expected error-state, which goes rest by rest"
            )
        stream_study("strapdown", files, study, keys, None, map_file, span, streaming, output)
        return 0
    paths = recorded("calibrate strapdown", files, streaming)
    return _calibrated("strapdown", paths, study, map_file, span, keys, output)


def _calibrated(
    kind: str,
    files: list[Path],
    study: Path,
    map_file: Path | None,
    span: Span,
    overrides: list[str] | None,
    output: ResultOutput,
) -> int:
    """Read study and records, calibrate, and hand over."""
    output.check(WHOLE, (*files, map_file, study))
    the_study, _ = study_in(kind, study, overrides, output)
    clock = time.perf_counter()
    system = the_study.system
    if system.sections is not None:  # the table of sections is no recording, though `*.csv` takes it in
        tables = {path.resolve() for path in the_study.files} - {study.resolve()}
        files = [file for file in files if file.resolve() not in tables]
    records = read_repeats(files, map_file, output, span, system.counted(the_study.settings), system.guess)
    return _solved(the_study, records, output, time.perf_counter() - clock)


def _solved(study: Study, records: list[Record], output: ResultOutput, read_s: float) -> int:
    """Calibrate by a study from records, which took ``read_s`` [s] to read, and hand over."""
    system = study.system
    if system.prepare:
        from inercal.foundation._jit import compiling

        with compiling(study.kind, output.say):
            system.prepare(study, False)
    with working(output) as progress:
        result = system.calibrate(records, study, False, progress)
    return give(result, output, read_s)


def _with_latitude(overrides: list[str] | None, latitude: str | None) -> list[str]:
    """The keys that are set, the latitude of the site among them where it is given."""
    return [*(overrides or ()), *([] if latitude is None else [f"site.latitude={latitude}"])]


def temperature(
    files: Annotated[
        list[Path], Parameter(help="A static recording over a sweep, or calibrations (.json, .toml).")
    ],
    /,
    *,
    map_file: MapFile = None,
    span: Span = Span(),
    at: Annotated[
        str, Parameter(help="Temperature T0 about which the polynomial is written; 25 degC if absent.")
    ] = "25 degC",
    order: Annotated[
        int | None,
        Parameter(
            help="Highest power of temperature, 1 to 5; if absent, of a sweep as the data tell, else a cubic."
        ),
    ] = None,
    output: ResultOutput = ResultOutput(),
) -> int:
    """Fit what a sensor's output or its calibration does with temperature."""
    from inercal.faces.python.verbs import temperature as of_temperature
    from inercal.foundation.units import parse_quantity

    reference = parse_quantity(at, "temperature", "--at").value
    output.check(WHOLE, (*files, map_file))
    clock = time.perf_counter()
    given: Record | list[Path] = files
    if all(file.suffix.lower() in WHOLE for file in files):
        if map_file is not None:
            raise InputError("--map", "found one beside calibrations, expected none: they need no column map")
        span.refuse("calibrations")
    else:
        given = read_record(files, map_file, output, span)
    read_s = time.perf_counter() - clock
    return give(of_temperature(given, reference, order), output, read_s, "temperature model")


def selfcal(
    files: StreamedFiles = None,
    /,
    *,
    study: StudyFile,
    kind: Annotated[
        FilterKind | None,
        Parameter(
            name="--filter",
            help="Estimator, in the place of that of the study. Points of svd-qukf are drawn by the eigenvalues of the "
            "covariance; by its singular values or its Cholesky factor with --set filter.factor=svd, or cholesky.",
        ),
    ] = None,
    compare: Annotated[bool, Parameter(help="Run all estimators, and set them side by side.")] = False,
    stream: Annotated[
        bool, Parameter(help="Lines in, from standard input or one FILE, and coefficients out, live.")
    ] = False,
    every: Every = None,
    until_goals: Annotated[
        bool, Parameter(help="End a stream where the goals of the study are met and nothing contradicts it.")
    ] = False,
    map_file: MapFile = None,
    span: Span = Span(),
    overrides: Overrides = None,
    streaming: StreamOptions = StreamOptions(),
    output: ResultOutput = ResultOutput(),
) -> int:
    """Calibrate a gimbaled platform while it turns."""
    keys = [*(overrides or ()), *([f"filter.kind={kind}"] if kind is not None else [])]
    if stream:
        if compare:
            raise InputError("--compare", "found with a stream, expected one estimator")
        from inercal.faces.stream.estimators import selfcal as prepared

        prepare = partial(prepared, until_goals=until_goals)
        stream_study("selfcal", files, study, keys, every, map_file, span, streaming, output, prepare)
        return 0
    if until_goals:
        raise InputError("--until-goals", "found without --stream, expected them together")
    paths = recorded("selfcal", files, streaming, every)

    from inercal.foundation._jit import compiling
    from inercal.foundation.records.write import SUFFIXES
    from inercal.systems.selfcal import verbs as system

    output.check((*WHOLE, *SUFFIXES), (*paths, map_file, study))
    of, _ = study_in("selfcal", study, keys, output)
    clock = time.perf_counter()
    records = read_repeats(paths, map_file, output, span, how=of.system.guess)
    read_s = time.perf_counter() - clock
    if len(records) > 1 and compare:
        raise InputError("--compare", f"found {len(records)} runs, expected one")
    if len(records) > 1 and output.out is not None and output.out.suffix.lower() in SUFFIXES:
        raise InputError(output.out, f"found {len(records)} runs, expected one for a history, or .json")
    of_all = " all" if compare else f" {of.settings.filter.kind}"
    with compiling(f"selfcal{of_all}", output.say):
        system.prepare(of, compare)
    with working(output) as progress:
        file = output.out is not None and output.out.suffix.lower() in SUFFIXES
        outcome = system.calibrate(records, of, compare, progress, output.report is not None or file)
    return give(outcome, output, read_s)


@Parameter(name="*")
@dataclass(frozen=True)
class FolderOutput(OutputOptions):
    """The options of a command that writes a folder."""

    out: Annotated[Path | None, Parameter(help="Folder of the outcome; made if it is not there.")] = None


def batch(
    manifest: Annotated[
        Path, Parameter(help="Manifest (CSV with the columns serial and files), or a folder of recordings.")
    ],
    /,
    *,
    study: StudyFile,
    map_file: MapFile = None,
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    keep: Annotated[bool, Parameter(help="Keep the result, its files and report in the store.")] = False,
    store: StoreOption = None,
    overrides: Overrides = None,
    output: FolderOutput = FolderOutput(),
) -> int:
    """Calibrate every unit of a fleet."""
    from inercal.laboratory.fleet.batch import batch as of_fleet
    from inercal.laboratory.fleet.batch import written
    from inercal.laboratory.store import open_store

    if output.out is None:
        raise InputError("--out", "missing, expected a folder for the outcome")
    count = count_of(workers, cluster)
    if store is not None and not keep:
        raise InputError("--store", "found without --keep, expected with it")
    place = open_store(store).place.given if keep else None
    clock = time.perf_counter()
    with reading(output, "calibrating") as progress:
        result = of_fleet(
            manifest,
            study,
            out=output.out,
            map=map_file,
            overrides=overrides or (),
            workers=count,
            cluster=cluster,
            store=place,
            progress=progress or (lambda done, all: None),
        )
    estimate = replace(
        result.estimate,
        provenance={**result.estimate.provenance, "arguments": command_line()},
        timing={"solve": time.perf_counter() - clock},
    )
    for path in written(output.out):
        output.say(f"written: {path}")
    text = f"{result.table()}\n\n{estimate.status.value}: {estimate.message}".lstrip()
    emit(estimate, text, output)
    return 0 if estimate.status.value == "ok" else EXIT_BAD_VERDICT
