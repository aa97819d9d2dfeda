"""An instrument by wire and the workbench: ``inercal live`` and ``workbench``."""

from __future__ import annotations

import getpass
import os
import sys
import time
from collections.abc import Callable
from os.path import realpath
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from inercal.cli import EXIT_INTERRUPTED, abandon_output
from inercal.cli.options import OutputOptions, Overrides, StoreOption, StudyFile
from inercal.cli.outcome import timed
from inercal.cli.records_in import MapFile, map_in
from inercal.cli.streaming import Every, StreamOptions, interval_of, settle_lines
from inercal.foundation.errors import InercalError, InputError

if TYPE_CHECKING:
    from inercal.bench.live.address import Sink
    from inercal.bench.live.measurement import RunningMeasurement
    from inercal.faces.stream.estimators import Make, Say, SayFinding


_EVERY = 30.0
"""Time [s] from one line of counts to the next."""


def live(
    source: Annotated[
        str,
        Parameter(
            help="Address: serial:DEVICE?baud=N, udp://HOST:PORT, tcp://HOST:PORT, mqtt://HOST/TOPIC, "
            "mqtts://HOST/TOPIC or replay:FILE?speed=1 (0: as fast as it goes)."
        ),
    ],
    /,
    *,
    study: StudyFile | None = None,
    calibration: Annotated[
        Path | None,
        Parameter(name="--apply", help="Calibration to correct the samples with, in the place of a study."),
    ] = None,
    to: Annotated[
        list[str] | None,
        Parameter(
            help="Sink: text:FILE, text:- (standard output, if none is given), parquet:FOLDER, hdf5:FOLDER, "
            "udp://HOST:PORT, mqtt://HOST/TOPIC or mqtts://HOST/TOPIC. May be repeated."
        ),
    ] = None,
    record: Annotated[Path | None, Parameter(help="New file that takes the raw rows, for replay:.")] = None,
    every: Every = None,
    map_file: MapFile = None,
    overrides: Overrides = None,
    streaming: StreamOptions = StreamOptions(),
    output: OutputOptions = OutputOptions(),
) -> int:
    """Measure an instrument by wire."""
    from inercal.bench.live.address import sink_of, source_of
    from inercal.bench.live.measurement import MeasurementPlan, RunningMeasurement

    wire = source_of(source)
    sinks = [sink_of(each) for each in to or ("text:-",)]
    _check(wire_file := getattr(wire, "file", None), record, sinks)
    streaming.check(output, (map_file, study, calibration, wire_file))
    if streaming.after is not None:
        raise InputError("--after", "found with a live source, expected it with a stream that begins anew")
    settle_lines()
    make = _estimator(study, calibration, overrides or [], interval_of(every))
    plan = MeasurementPlan(wire, make, map_in(map_file), record, sinks, streaming.saving)
    return _followed(RunningMeasurement(plan, output.say, output.say_finding, _print), output)


def _estimator(
    study: Path | None, calibration: Path | None, keys: list[str], interval: float
) -> Callable[[Say, SayFinding], Make]:
    """The estimator that the study or the calibration asks for; raises `InputError` unless there is one of them."""
    if (study is None) == (calibration is None):
        found = "neither" if study is None else "both"
        raise InputError("--study, --apply", f"found {found}, expected one of them")
    if study is not None:
        from inercal.faces.python.study import kind_of, read_study

        of = read_study(kind_of(study), study, keys)

        def by_study(say: Say, say_finding: SayFinding) -> Make:
            from inercal.faces.stream.estimators import of_study

            return of_study(of, interval, say, say_finding)

        return by_study
    if keys or interval:
        raise InputError("--set" if keys else "--every", "found with --apply, expected it with --study")
    from inercal.cli.saved import usable

    assert calibration is not None
    model, findings, _ = usable(calibration)

    def correcting(say: Say, say_finding: SayFinding) -> Make:
        from inercal.faces.stream.apply import Apply

        for finding in findings:
            say_finding(finding)
        return lambda lines: Apply(lines, model, False, say_finding)

    return correcting


def _check(source: Path | None, record: Path | None, sinks: list[Sink]) -> None:
    """Refuse one place for two things; raises `InputError`."""
    from inercal.bench.live.address import target

    files = [each for each in (source, record, *map(target, sinks)) if each is not None]
    names = [realpath(each) for each in files]
    for place, name in zip(files, names, strict=True):
        if names.count(name) > 1:
            raise InputError(place, "found it for two things, expected a name for each")
    if len(set(map(str, sinks))) < len(sinks):
        raise InputError("--to", "found a sink twice, expected each once")


def _followed(measurement: RunningMeasurement, output: OutputOptions) -> int:
    """Run a measurement until it ends or is asked to, and say what became of its rows; the exit code."""
    asked, due = False, time.monotonic() + _EVERY
    measurement.start()
    while True:
        try:
            if measurement.join(0.5):
                break
            if time.monotonic() >= due:
                due += _EVERY
                if measurement.columns:
                    output.say(str(measurement.counts))
        except KeyboardInterrupt:
            if asked:  # a second one does not wait
                raise
            asked = True
            measurement.stop()
    if isinstance(measurement.error, InercalError):
        if measurement.counts.used:
            output.say(str(measurement.counts))
        raise measurement.error
    if measurement.error is not None:
        raise measurement.error
    output.say(str(measurement.counts))
    if measurement.verdict:
        output.say(measurement.verdict)
    if asked:
        output.say("interrupted")
        return EXIT_INTERRUPTED
    return 1 if measurement.verdict or measurement.incomplete else 0


def _print(text: str) -> None:
    """Lines on standard output, at once."""
    try:
        sys.stdout.write(f"{text}\n")
        sys.stdout.flush()
    except BrokenPipeError:
        abandon_output()
        raise OSError("its reader has left") from None


_PASSWORD = "INERCAL_WORKBENCH_PASSWORD"
"""Variable of the environment that holds the password for other machines."""


def workbench(
    folder: Annotated[
        Path | None, Parameter(help="Work folder, for sessions and jobs; the user's own if absent.")
    ] = None,
    /,
    *,
    port: Annotated[int, Parameter(help="Port to listen at; a free one if 0.")] = 0,
    host: Annotated[
        str,
        Parameter(
            help="Address to listen at. Beyond this machine a password is asked for, and whoever is on the network "
            "can read what is sent."
        ),
    ] = "127.0.0.1",
    browser: Annotated[bool, Parameter(name="--no-browser", negative="", help="Open no browser.")] = False,
    store: StoreOption = None,
    output: OutputOptions = OutputOptions(),
) -> None:
    """Serve the workbench until it is asked to end."""
    from platformdirs import user_data_path

    from inercal.bench.workbench.bench import open_bench
    from inercal.bench.workbench.serve import HERE, Door, serve
    from inercal.foundation.results.files import to_json
    from inercal.foundation.results.result import without_coefficients

    if not 0 <= port <= 65535:
        raise InputError("--port", f"found {port}, expected a number from 0 to 65535")
    password = "" if host == HERE else _password(host)
    root = folder or user_data_path("inercal", appauthor=False) / "workbench"
    bench = open_bench(root.absolute(), store)

    def tell(address: str) -> None:
        words = f"inercal workbench: {address}"
        found = to_json(timed(without_coefficients("workbench", words, {})))
        output.emit(
            {**found, "result": {"address": address}}, words
        )  # with its key, which is meant for the reader

    try:
        serve(bench, Door(host, port, password), tell, not browser)
    finally:
        bench.close()


def _password(host: str) -> str:
    """The password that browsers of other machines need; raises `InputError` for one of fewer than 12 characters."""
    given = os.environ.get(_PASSWORD)
    if given is None and sys.stdin is not None and sys.stdin.isatty():
        print(
            f"The workbench will be reachable at {host}: without encryption, by all who know this password."
        )
        given = getpass.getpass("Password: ")
    if not given or len(given) < 12:
        raise InputError(
            "--host", f"needs a password of 12 characters or more, at the prompt or in {_PASSWORD}"
        )
    return given
