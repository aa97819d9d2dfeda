"""``inercal aoa``."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from inercal.cli.options import MapFile, Overrides, ReportOutput, StudyFile, of_study, read_repeats, working
from inercal.cli.outcome import WHOLE, hand_over
from inercal.cli.streaming import Every, StreamOptions, interval_of, recorded, run_stream, streamed
from inercal.errors import InputError, StudyError

if TYPE_CHECKING:
    from inercal.aoa.settings import AoaSettings, Methods
    from inercal.aoa.task import Measurement
    from inercal.records.record import Record
    from inercal.stream.lines import Lines

Static = Literal["segmented", "complementary", "improved", "difference", "gls"]
Centrifugal = Literal["none", "low-pass", "mechanical", "decision"]
Tangential = Literal["none", "differentiated", "dual"]
States = Literal[8, 11, 15, 19]


@Parameter(name="*")
@dataclass(frozen=True)
class MethodOptions:
    """How angles are found: by the fusion, or with any of the first three the paper's way."""

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
        """Which options of the fusion were given."""
        return {"--states": self.states is not None, "--smooth": self.smooth}

    @property
    def keys(self) -> list[str]:
        """The overrides of the study that stand for options."""
        states = [] if self.states is None else [f"estimator.states={self.states}"]
        return [*states, *(["estimator.smooth=true"] if self.smooth else [])]

    def check(self, stream: bool) -> None:
        """Fail where options contradict each other; raises `InputError`."""
        chosen = [f"--{name}" for name in self.paper]
        for option in (name for name, given in self.fusion.items() if given and chosen):
            raise InputError(
                option, f"found with {chosen[0]}, expected the fusion or the paper's way, not both"
            )
        whole = {"--compare": self.compare, "--smooth": self.smooth, "--points": self.points}
        for option in (*(name for name, given in whole.items() if given), *chosen):
            if stream:
                raise InputError(
                    option, "found with a stream, expected the causal fusion alone, a line for each sample"
                )

    def methods(self, settings: AoaSettings) -> Methods | None:
        """The paper's way, what was not chosen as the study says; None for the fusion."""
        return replace(settings.methods, **self.paper) if self.paper else None  # type: ignore[arg-type]


def aoa(
    files: Annotated[
        list[Path] | None,
        Parameter(help="Recording; several files with distinct channels are one."),
    ] = None,
    /,
    *,
    study: StudyFile,
    how: MethodOptions = MethodOptions(),
    stream: Annotated[
        bool, Parameter(help="Lines in, from standard input or one FILE, and angles out, live.")
    ] = False,
    every: Every = None,
    map_file: MapFile = None,
    overrides: Overrides = None,
    streaming: StreamOptions = StreamOptions(),  # noqa: B008  (frozen)
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> int:
    """Measure the angle of attack of a wind-tunnel model."""
    keys = [*(overrides or ()), *how.keys]
    how.check(stream)
    if stream:
        _live(streamed(files), study, map_file, keys, interval_of(every), streaming, output)
        return 0
    paths = recorded("aoa", files, streaming, every)

    from inercal._jit import compiling
    from inercal.aoa.task import load_kernels, measure
    from inercal.records.read import source_of
    from inercal.records.write import SUFFIXES
    from inercal.studies.load import files_of, load_aoa_study

    output.check((*WHOLE, *SUFFIXES), (*paths, map_file, study))
    settings = load_aoa_study(study, keys)
    studied = files_of(study, settings.given, unread="motion")
    output.spare(studied)
    methods = how.methods(settings)
    clock = time.perf_counter()
    record = _one_run(read_repeats(paths, map_file, output))
    read_s = time.perf_counter() - clock
    smoothed = " smoothed" if settings.estimator.smooth or how.compare else ""
    with compiling(f"aoa{smoothed}", output.say):
        load_kernels(settings, methods, how.compare)
    with of_study(study), working(output) as progress:
        found = measure(record, settings, methods, how.compare, progress)
    timing = {"read": read_s, "solve": found.estimate.timing["solve"]}
    inputs = (*found.estimate.inputs, *map(source_of, studied))
    found = replace(found, estimate=replace(found.estimate, timing=timing, inputs=inputs))
    return _handed_over(found, how, output)


def _one_run(records: Sequence[Record]) -> Record:
    """The record, where there is one; raises `InputError`."""
    if len(records) > 1:
        raise InputError(
            records[1].sources[0].path,
            f"has the channels of {records[0].sources[0].path}, expected one run: measure them one after the other, "
            "each with the result of the one before (--out run1.json) as its prior (--set estimator.prior=run1.json)",
        )
    return records[0]


def _handed_over(found: Measurement, how: MethodOptions, output: ReportOutput) -> int:
    """Write what was asked for, say what was found, and give the exit code."""
    from inercal.aoa.result.display import delays, rest_of_fit, use_of_fit
    from inercal.aoa.result.tables import answer, on_terminal

    def page() -> str:
        from inercal.aoa import figures

        return figures.page(found)

    def rows(path: Path) -> None:
        from inercal.aoa.result.columns import angles_record, points_record
        from inercal.records.write import write_record

        record = (
            points_record(found.points, found.recording, found.settings)
            if how.points
            else angles_record(found.recording, found.angles, found.settings)
        )
        write_record(record, path)

    estimate, points = found.estimate, found.points if how.points else ()
    tables = [*answer(estimate, points, found.settings), *on_terminal(estimate)]
    shown = [f"{table.title}\n{table.text()}" for table in tables]
    shown += [rest_of_fit(estimate), delays(estimate), use_of_fit(estimate)]
    return hand_over(estimate, shown, page, output, "angles", rows)


def _live(
    file: Path | None,
    study: Path,
    map_file: Path | None,
    keys: list[str],
    interval: float,
    streaming: StreamOptions,
    output: ReportOutput,
) -> None:
    """Measure row by row."""
    from inercal._jit import compiling
    from inercal.aoa.fusion.live import load_kernels
    from inercal.aoa.fusion.problem import problem
    from inercal.stream.aoa import Aoa
    from inercal.studies.load import load_aoa_study

    streaming.check(output, (file, map_file, study))
    settings = load_aoa_study(study, keys)
    with of_study(study):
        if settings.estimator.smooth:
            raise StudyError(
                "estimator.smooth", "found true with a stream, expected false: it knows the past alone"
            )
        with compiling("aoa", output.say):
            load_kernels(problem(settings))

    def measurement(lines: Lines) -> Aoa:
        with of_study(study):
            return Aoa(lines, settings, interval, output.say_finding)

    run_stream(measurement, file, map_file, output, streaming)
