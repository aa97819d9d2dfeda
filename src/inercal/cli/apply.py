"""``inercal apply``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from inercal.cli.options import FileOutput, MapFile, Span, read_record, reading
from inercal.cli.outcome import emit
from inercal.cli.streaming import StreamOptions, recorded, run_stream, streamed
from inercal.errors import InputError

if TYPE_CHECKING:
    from inercal.convert.correct import Model
    from inercal.findings import Finding


def apply(
    calibration: Annotated[
        Path, Parameter(help="Calibration that `inercal calibrate` or `inercal selfcal` wrote to --out.")
    ],
    files: Annotated[
        list[Path] | None, Parameter(help="Recordings; several files with distinct channels are one record.")
    ] = None,
    /,
    *,
    map_file: MapFile = None,
    span: Span = Span(),  # noqa: B008  (frozen)
    invert: Annotated[bool, Parameter(help="From true values to outputs of the instrument.")] = False,
    stream: Annotated[
        bool, Parameter(help="Lines in, from standard input or one FILE, and corrected lines out.")
    ] = False,
    streaming: StreamOptions = StreamOptions(),  # noqa: B008  (frozen)
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Correct a recording with a calibration."""
    if stream:
        span.refuse("a stream")
        from inercal.stream.apply import Apply

        file = streamed(files)
        streaming.check(output, (calibration, file, map_file))
        model, findings = _model(calibration)
        output.say_findings(findings)
        run_stream(lambda lines: Apply(lines, model, invert), file, map_file, output, streaming)
        return

    from inercal.convert.correct import apply_to
    from inercal.estimate.result import without_coefficients
    from inercal.face.calibrations import worth_saying
    from inercal.records.read import source_of
    from inercal.records.write import SUFFIXES, write_record

    paths = recorded("apply", files, streaming)
    if output.out is None:
        raise InputError("--out", "missing, expected the file to write, such as corrected.csv")
    output.check(SUFFIXES, (calibration, *paths, map_file))
    model, findings = _model(calibration)
    record = apply_to(read_record(paths, map_file, output, span), model, invert)
    with reading(output) as progress:
        write_record(record, output.out, progress)
    findings += worth_saying(record, model)
    output.say_findings(findings)
    result = {"out": str(output.out), "rows": len(next(iter(record.columns.values())).t)}
    words = f"{result['rows']} rows written to {output.out}"
    inputs = (*record.sources, source_of(calibration))
    emit(without_coefficients("apply", words, result, inputs, findings), words, output)


def _model(calibration: Path) -> tuple[Model, tuple[Finding, ...]]:
    """The instrument of a calibration that was saved, and what to say of that."""
    from inercal.estimate.files import load
    from inercal.face.calibrations import model_of

    return model_of(load(calibration), calibration)
