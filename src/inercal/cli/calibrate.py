"""``inercal calibrate`` and ``inercal temperature``."""

from __future__ import annotations

import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from inercal.cli.options import (
    MapFile,
    Overrides,
    ResultOutput,
    RunFiles,
    Span,
    StudyFile,
    read_record,
    read_repeats,
    working,
)
from inercal.cli.outcome import WHOLE, give
from inercal.cli.streaming import StreamOptions, recorded, stream_study
from inercal.foundation.errors import InputError

if TYPE_CHECKING:
    from inercal.cli.streaming import Estimators
    from inercal.systems.imu.temperature.model import TemperatureModel
    from inercal.systems.strapdown.settings import StrapdownSettings


def calibrate_imu(
    files: RunFiles,
    /,
    *,
    study: StudyFile,
    map_file: MapFile = None,
    span: Span = Span(),  # noqa: B008  (frozen)
    overrides: Overrides = None,
    output: ResultOutput = ResultOutput(),  # noqa: B008  (frozen)
) -> int:
    """Calibrate an IMU held by hand, set on its sides and turned, or turned by a table."""
    return _calibrated("imu", files, study, map_file, span, overrides, output)


def calibrate_strapdown(
    files: Annotated[
        list[Path] | None,
        Parameter(
            help="Recordings; files with distinct channels are one record, with the same ones repeat runs."
        ),
    ] = None,
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
    span: Span = Span(),  # noqa: B008  (frozen)
    overrides: Overrides = None,
    streaming: StreamOptions = StreamOptions(),  # noqa: B008  (frozen)
    output: ResultOutput = ResultOutput(),  # noqa: B008  (frozen)
) -> int:
    """Calibrate a strapdown unit from rests and coarse turns."""
    keys = [*(overrides or ()), *([f"strapdown.filter={estimator}"] if estimator is not None else [])]
    if stream:
        if estimator == "batch":
            raise InputError(
                "--filter", "found batch with a stream, expected error-state, which goes rest by rest"
            )
        stream_study("strapdown", _live, files, study, keys, None, map_file, span, streaming, output)
        return 0
    paths = recorded("calibrate strapdown", files, streaming)
    return _calibrated("strapdown", paths, study, map_file, span, keys, output)


def _live(settings: StrapdownSettings, interval: float, output: ResultOutput) -> Estimators:
    """Prepare a calibration rest by rest."""
    from inercal.faces.stream.estimators import strapdown as prepared

    return prepared(settings, interval, output.say, output.say_finding)


def calibrate_turntable(
    files: RunFiles,
    /,
    *,
    study: StudyFile,
    map_file: MapFile = None,
    span: Span = Span(),  # noqa: B008  (frozen)
    overrides: Overrides = None,
    output: ResultOutput = ResultOutput(),  # noqa: B008  (frozen)
) -> int:
    """Calibrate an instrument that was taken through positions on a turntable."""
    return _calibrated("turntable", files, study, map_file, span, overrides, output)


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
    from inercal.faces.python.study import read_study

    output.check(WHOLE, (*files, map_file, study))
    the_study = read_study(kind, study, overrides or ())
    output.spare(the_study.files)
    clock = time.perf_counter()
    records = read_repeats(files, map_file, output, span, the_study.system.counted(the_study.settings))
    read_s = time.perf_counter() - clock
    system = the_study.system
    if system.prepare:
        from inercal.foundation._jit import compiling

        with compiling(kind, output.say):
            system.prepare(the_study, False)
    with working(output) as progress:
        result = system.calibrate(records, the_study, False, progress)
    return give(result, output, read_s)


def temperature(
    files: Annotated[
        list[Path], Parameter(help="A static recording over a sweep, or calibrations (.json, .toml).")
    ],
    /,
    *,
    map_file: MapFile = None,
    span: Span = Span(),  # noqa: B008  (frozen)
    at: Annotated[
        str, Parameter(help="Temperature T0 about which the polynomial is written; 25 degC if absent.")
    ] = "25 degC",
    output: ResultOutput = ResultOutput(),  # noqa: B008  (frozen)
) -> int:
    """Fit what a sensor's output or its calibration does with temperature."""
    from dataclasses import replace

    from inercal.foundation.units import parse_quantity
    from inercal.systems.imu.verbs import of_temperature

    reference = parse_quantity(at, "temperature", "--at").value
    output.check(WHOLE, (*files, map_file))
    clock = time.perf_counter()
    if all(file.suffix.lower() in WHOLE for file in files):
        if map_file is not None:
            raise InputError("--map", "found one beside calibrations, expected none: they need no column map")
        span.refuse("calibrations")
        model, read_s = _of_calibrations(files, reference), time.perf_counter() - clock
    else:
        from inercal.systems.imu.temperature.sweep import fit_recording

        record = read_record(files, map_file, output, span)
        read_s = time.perf_counter() - clock
        model = fit_recording(record, reference)
    solve_s = time.perf_counter() - clock - read_s
    result = of_temperature(replace(model, estimate=replace(model.estimate, timing={"solve": solve_s})))
    return give(result, output, read_s, "temperature model")


def _of_calibrations(files: list[Path], reference: float) -> TemperatureModel:
    """The model of saved calibrations, in the order given."""
    from inercal.foundation.records.read import source_of
    from inercal.foundation.results.files import load
    from inercal.systems.imu.temperature.calibrations import fit_calibrations

    return fit_calibrations([load(file) for file in files], [source_of(file) for file in files], reference)
