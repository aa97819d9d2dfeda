"""``inercal aoa``."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from inercal.cli.options import Overrides, ResultOutput, StudyFile, study_in, working
from inercal.cli.outcome import WHOLE, give
from inercal.cli.records_in import MapFile, Span, map_in, read_repeats
from inercal.cli.streaming import Every, StreamOptions, recorded, stream_study
from inercal.foundation.errors import InputError
from inercal.systems.aoa.estimators import Centrifugal, States, Static, Tangential
from inercal.systems.aoa.system import SYSTEM as AOA

if TYPE_CHECKING:
    from inercal.foundation.records.record import Record


@Parameter(name="*")
@dataclass(frozen=True)
class MethodOptions:
    """Choice of the method: the fusion, or with any of the first three the paper's way."""

    static: Annotated[
        Static | None, Parameter(help="The paper's way: angle from the accelerometers at rest.")
    ] = None
    centrifugal: Annotated[
        Centrifugal | None, Parameter(help="The paper's way: what is done about centrifugal acceleration.")
    ] = None
    tangential: Annotated[
        Tangential | None, Parameter(help="The paper's way: what is done about tangential acceleration.")
    ] = None
    states: Annotated[States | None, Parameter(help="States of the fusion, in the place of the study's.")] = (
        None
    )
    smooth: Annotated[
        bool, Parameter(help="The fusion from all of the recording, not from its past alone.")
    ] = False
    compare: Annotated[bool, Parameter(help="Run the other methods too, and set them side by side.")] = False
    points: Annotated[
        bool,
        Parameter(help="Show the angle of each pause; --out then has a row for each, not for each sample."),
    ] = False

    @property
    def paper(self) -> dict[str, str]:
        """The choices of the paper's way that were made."""
        made = {"static": self.static, "centrifugal": self.centrifugal, "tangential": self.tangential}
        return {name: choice for name, choice in made.items() if choice is not None}

    @property
    def fusion(self) -> dict[str, bool]:
        """Options of the fusion, and true where given."""
        return {"--states": self.states is not None, "--smooth": self.smooth}

    @property
    def keys(self) -> list[str]:
        """The overrides of the study that stand for options."""
        kind = "paper" if self.paper else "fusion" if any(self.fusion.values()) else ""
        return [
            *([f"estimator.kind={kind}"] if kind else []),
            *(f"methods.{name}={choice}" for name, choice in self.paper.items()),
            *([] if self.states is None else [f"estimator.states={self.states}"]),
            *(["estimator.smooth=true"] if self.smooth else []),
        ]

    def check(self, stream: bool) -> None:
        """Fail where options contradict each other; raises `InputError`."""
        chosen = [f"--{name}" for name in self.paper]
        for option in (name for name, given in self.fusion.items() if given and chosen):
            raise InputError(
                option, f"found with {chosen[0]}, expected the fusion or the paper's way, not both"
            )
        if stream and chosen:
            raise InputError(
                chosen[0],
                "found with a stream, expected the fusion, which is the default: the paper's way is for files",
            )
        whole = {"--compare": self.compare, "--smooth": self.smooth, "--points": self.points}
        for option in (name for name, given in whole.items() if given):
            if stream:
                raise InputError(
                    option,
                    "found with a stream, expected one method that does not look ahead, a line for each sample",
                )


def aoa(
    files: Annotated[
        list[Path] | None,
        Parameter(help="Recording; several files with distinct channels are one."),
    ] = None,
    /,
    *,
    study: StudyFile,
    how: MethodOptions = MethodOptions(),
    join: Annotated[
        Path | None,
        Parameter(
            help="With --points: table of a balance (CSV) to set beside the points, by number or by time."
        ),
    ] = None,
    runs: Annotated[
        Path | None,
        Parameter(
            help="Table of runs (CSV: file, role, ...) in the place of FILES: wind-offs, polars, sines."
        ),
    ] = None,
    stream: Annotated[
        bool, Parameter(help="Lines in, from standard input or one FILE, and angles out, live.")
    ] = False,
    every: Every = None,
    map_file: MapFile = None,
    span: Span = Span(),
    overrides: Overrides = None,
    streaming: StreamOptions = StreamOptions(),
    output: ResultOutput = ResultOutput(),
) -> int:
    """Measure the angle of attack of a wind-tunnel model."""
    keys = [*(overrides or ()), *how.keys]
    how.check(stream)
    if join is not None and not (how.points and runs is None):
        raise InputError("--join", "found without --points of one recording, expected them together")
    if runs is not None:
        return _runs(runs, files, study, keys, how, stream, map_file, span, output)
    if stream:
        made: Any = stream_study("aoa", files, study, keys, every, map_file, span, streaming, output)
        if failure := made.failure:
            output.say(failure)
        return 1 if failure else 0
    paths = recorded("aoa", files, streaming, every)

    from inercal.faces.python.study import one_run
    from inercal.foundation._jit import compiling
    from inercal.foundation.records.write import SUFFIXES
    from inercal.systems.aoa import verbs as system

    output.check((*WHOLE, *SUFFIXES), (*paths, map_file, study, join))
    the_study, _ = study_in("aoa", study, keys, output)
    clock = time.perf_counter()
    record = one_run(read_repeats(paths, map_file, output, span, how=AOA.guess), system.ONE_RUN)
    read_s = time.perf_counter() - clock
    smoothed = " smoothed" if the_study.settings.estimator.smooth or how.compare else ""
    with compiling(f"aoa{smoothed}", output.say):
        system.prepare(the_study, how.compare)
    with working(output) as progress:
        result = system.calibrate([record], the_study, how.compare, progress, how.points, join)
    return give(result, output, read_s, "angles")


def _runs(
    table: Path,
    files: list[Path] | None,
    study: Path,
    keys: list[str],
    how: MethodOptions,
    stream: bool,
    map_file: Path | None,
    span: Span,
    output: ResultOutput,
) -> int:
    """Measure the runs of a table."""
    from inercal.foundation._jit import compiling
    from inercal.foundation.records.read import read
    from inercal.foundation.records.write import SUFFIXES
    from inercal.systems.aoa import verbs as system

    for option, given in (("FILES", bool(files)), ("--stream", stream)):
        if given:
            raise InputError(
                "--runs", f"found with {option}, expected the table alone, which names the files"
            )
    output.check((*WHOLE, *SUFFIXES), (table, map_file, study))
    the_study, _ = study_in("aoa", study, keys, output)
    span.check()
    record_map = map_in(map_file, span.answers or ())
    smoothed = " smoothed" if the_study.settings.estimator.smooth or how.compare else ""
    with compiling(f"aoa{smoothed}", output.say):
        system.prepare(the_study, how.compare)

    def record(path: Path) -> Record:
        output.spare([path])
        return span.of(read(path, record_map))

    with working(output) as progress:
        result = system.runs(table, the_study, record, how.compare, progress)
    return give(result, output, 0.0, "runs")
