"""``inercal apply``, ``compare`` and ``convert``: what is done with saved calibrations."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from inercal.cli import EXIT_BAD_VERDICT
from inercal.cli.options import FileOutput, ResultOutput, reading
from inercal.cli.outcome import WHOLE, emit, give, say_findings, tell
from inercal.cli.records_in import MapFile, Span, read_record
from inercal.cli.streaming import StreamOptions, recorded, run_stream, streamed
from inercal.foundation.errors import InputError

if TYPE_CHECKING:
    from inercal.faces.convert.correction import CalibratedInstrument
    from inercal.faces.convert.other_tools import Converted
    from inercal.foundation.findings import Finding
    from inercal.foundation.results.result import Estimate


def apply(
    calibration: Annotated[
        Path,
        Parameter(
            help="Calibration that `inercal calibrate` or `inercal selfcal` wrote to --out, or a certificate."
        ),
    ],
    files: Annotated[
        list[Path] | None, Parameter(help="Recordings; several files with distinct channels are one record.")
    ] = None,
    /,
    *,
    map_file: MapFile = None,
    span: Span = Span(),
    invert: Annotated[bool, Parameter(help="From true values to outputs of the instrument.")] = False,
    uncertainty: Annotated[
        bool, Parameter(help="Also write the standard uncertainty of each corrected value (u_acc_x, ...).")
    ] = False,
    stream: Annotated[
        bool, Parameter(help="Lines in, from standard input or one FILE, and corrected lines out.")
    ] = False,
    streaming: StreamOptions = StreamOptions(),
    output: FileOutput = FileOutput(),
) -> None:
    """Correct a recording with a calibration."""
    if stream:
        span.refuse("a stream")
        from inercal.faces.stream.apply import Apply

        file = streamed(files)
        streaming.check(output, (calibration, file, map_file))
        model, findings, _ = usable(calibration, uncertainty)
        say_findings(findings, output)
        run_stream(
            lambda lines: Apply(lines, model, invert, output.say_finding), file, map_file, output, streaming
        )
        return

    from inercal.faces.convert.correction import apply_to
    from inercal.faces.python.calibrations import worth_saying
    from inercal.foundation.records.read import source_of
    from inercal.foundation.records.write import SUFFIXES, write_record

    paths = recorded("apply", files, streaming)
    if output.out is None:
        raise InputError("--out", "missing, expected the file to write, such as corrected.csv")
    output.check(SUFFIXES, (calibration, *paths, map_file))
    model, findings, estimate = usable(calibration, uncertainty)
    record = apply_to(read_record(paths, map_file, output, span), model, invert)
    with reading(output) as progress:
        write_record(record, output.out, progress)
    findings += worth_saying(record, estimate)
    say_findings(findings, output)
    result = {"out": str(output.out), "rows": len(next(iter(record.columns.values())).t)}
    words = f"{result['rows']} rows written to {output.out}"
    inputs = (*record.sources, source_of(calibration))
    tell(output, "apply", words, result, inputs, findings=findings)


def usable(
    calibration: Path, uncertainty: bool = False
) -> tuple[CalibratedInstrument, tuple[Finding, ...], Estimate]:
    """The instrument of a calibration that was saved, what to say of that, and the calibration."""
    from inercal.faces.convert.models import model_of, worth_knowing
    from inercal.faces.python.calibrations import read_estimate

    estimate = read_estimate(calibration)
    return (
        model_of(estimate, calibration, uncertainty),
        worth_knowing(estimate, calibration),
        estimate,
    )


_CALIBRATION = "Calibration that `inercal calibrate` or `inercal selfcal` wrote to --out, or a certificate."


def compare(
    first: Annotated[Path, Parameter(help=_CALIBRATION)],
    second: Annotated[Path, Parameter(help="The later one, of the same instrument.")],
    /,
    *,
    output: ResultOutput = ResultOutput(),
) -> int:
    """Compare two calibrations of one instrument."""
    from inercal.faces.python.calibrations import compare as compared

    output.check(WHOLE, (first, second))
    clock = time.perf_counter()
    result = compared(first, second)
    read_s = time.perf_counter() - clock - result.estimate.timing["solve"]
    return give(result, output, read_s, "comparison")


Tool = Literal["imu_tk", "imucal", "kalibr", "psins"]
Target = Literal["imu_tk", "imucal", "kalibr", "openvins", "psins", "vins"]


def convert(
    files: Annotated[
        list[Path],
        Parameter(help="Calibration, or noise; with --from imu_tk its accelerometers' and gyro's files."),
    ],
    /,
    *,
    to: Annotated[Target | None, Parameter(help="The tool to write for.")] = None,
    source: Annotated[Tool | None, Parameter(name="--from", help="The tool that wrote the file.")] = None,
    acc_unit: Annotated[
        str | None,
        Parameter(help="With --from: unit of the accelerometers' outputs, if the file states none."),
    ] = None,
    gyro_unit: Annotated[
        str | None, Parameter(help="With --from: unit of the gyro's outputs, if the file states none.")
    ] = None,
    output: FileOutput = FileOutput(),
) -> int:
    """Convert a calibration to or from another tool's."""
    from inercal.faces.convert.noise_files import noise_to_tool
    from inercal.faces.convert.other_tools import CONVENTIONS, from_tool, to_tool
    from inercal.foundation.findings import Status
    from inercal.foundation.records.read import source_of
    from inercal.foundation.results.files import load

    if to is None and source is None:
        raise InputError("--to", "missing, expected --to or --from and one of " + ", ".join(CONVENTIONS))
    output.check(
        WHOLE if to is None else CONVENTIONS[to].suffixes if to in CONVENTIONS else (".yaml",), files
    )
    units = {sensor: unit for sensor, unit in (("acc", acc_unit), ("gyro", gyro_unit)) if unit is not None}
    if source is None:
        if units:
            raise InputError(
                "--acc-unit" if acc_unit else "--gyro-unit", "found without --from, expected with it"
            )
        if len(files) > 1:
            raise InputError(files[1], "found a second calibration, expected one")
        estimate = load(files[0])
        estimate = replace(estimate, inputs=(*estimate.inputs, source_of(files[0])))
    else:
        estimate = from_tool(files, source, units)
    if estimate.status is not Status.OK:
        output.say(f"{estimate.status.value}: {estimate.message}")
    if to is None:
        _write_calibration(estimate, output)
    elif estimate.command == "allan":
        _write_texts(noise_to_tool(estimate, to, files[0]), to, files, output)
    elif to not in CONVENTIONS:
        raise InputError(files[0], f"is no noise of `inercal allan`, expected it for {to}")
    else:
        _write_texts(to_tool(estimate, to, files[0]), to, files, output)
    return 0 if estimate.status is Status.OK else EXIT_BAD_VERDICT


def _write_calibration(estimate: Estimate, output: FileOutput) -> None:
    """The calibration, to its file and as a table."""
    from inercal.foundation.results.files import save

    for finding in estimate.findings:  # all: what was not held is among them
        output.say_finding(finding)
    if output.out is not None:
        save(estimate, output.out)
        output.say(f"calibration: {output.out}")
    emit(replace(estimate, timing={}), f"{estimate.table()}\n\n{estimate.message}", output)


def _write_texts(converted: Converted, tool: str, files: list[Path], output: FileOutput) -> None:
    """The files of the tool and the table of their terms; without --out their texts instead."""
    from inercal.foundation._files import write_text

    estimate = converted.estimate
    for finding in estimate.findings:
        output.say_finding(finding)
    if output.out is None:
        written = {}
        text = "\n".join(converted.texts.values()).rstrip("\n")
    else:
        out = output.out
        written = {
            out.with_name(f"{out.stem}{end}{out.suffix}"): text for end, text in converted.texts.items()
        }
        for path in written:
            replace(output, out=path).spare(files)
        for path, content in written.items():
            write_text(path, content)
            output.say(f"{tool}: {path}")
        text = f"{estimate.table()}\n\n{estimate.model}"
    result = {
        **estimate.result,
        "texts": list(converted.texts.values()),
        "files": [str(path) for path in written],
    }
    emit(replace(estimate, result=result, timing={}), text, output)
