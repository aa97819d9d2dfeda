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
    from inercal.convert.correction import Model
    from inercal.estimate.result import Estimate
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
    uncertainty: Annotated[
        bool, Parameter(help="Also write the standard uncertainty of each corrected value (u_acc_x, ...).")
    ] = False,
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
        model, findings, _ = _model(calibration, uncertainty)
        output.say_findings(findings)
        run_stream(
            lambda lines: Apply(lines, model, invert, output.say_finding), file, map_file, output, streaming
        )
        return

    from inercal.convert.correction import apply_to
    from inercal.estimate.result import without_coefficients
    from inercal.face.calibrations import worth_saying
    from inercal.records.read import source_of
    from inercal.records.write import SUFFIXES, write_record

    paths = recorded("apply", files, streaming)
    if output.out is None:
        raise InputError("--out", "missing, expected the file to write, such as corrected.csv")
    output.check(SUFFIXES, (calibration, *paths, map_file))
    model, findings, estimate = _model(calibration, uncertainty)
    record = apply_to(read_record(paths, map_file, output, span), model, invert)
    with reading(output) as progress:
        write_record(record, output.out, progress)
    findings += worth_saying(record, estimate)
    output.say_findings(findings)
    result = {"out": str(output.out), "rows": len(next(iter(record.columns.values())).t)}
    words = f"{result['rows']} rows written to {output.out}"
    inputs = (*record.sources, source_of(calibration))
    emit(without_coefficients("apply", words, result, inputs, findings), words, output)


def _model(calibration: Path, uncertainty: bool) -> tuple[Model, tuple[Finding, ...], Estimate]:
    """The instrument of a calibration that was saved, what to say of that, and the calibration."""
    from inercal.convert.models import model_of, worth_knowing
    from inercal.estimate.files import load

    estimate = load(calibration)
    return (
        model_of(estimate, calibration, uncertainty),
        worth_knowing(estimate, calibration),
        estimate,
    )
