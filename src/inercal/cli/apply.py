"""``inercal apply``."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from inercal.cli.options import FileOutput, MapFile, read_record, reading
from inercal.cli.outcome import emit, told
from inercal.cli.streaming import StreamOptions, recorded, run_stream, streamed
from inercal.errors import InputError
from inercal.findings import Finding

if TYPE_CHECKING:
    from inercal.convert.correct import Model
    from inercal.records.record import Record


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
    invert: Annotated[bool, Parameter(help="From true values to outputs of the instrument.")] = False,
    stream: Annotated[
        bool, Parameter(help="Lines in, from standard input or one FILE, and corrected lines out.")
    ] = False,
    streaming: StreamOptions = StreamOptions(),  # noqa: B008  (frozen)
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Correct a recording with a calibration."""
    if stream:
        from inercal.stream.apply import Apply

        file = streamed(files)
        streaming.check(output, (calibration, file, map_file))
        model, findings = _model(calibration)
        output.say_findings(findings)
        run_stream(lambda lines: Apply(lines, model, invert), file, map_file, output, streaming)
        return

    from inercal.convert.correct import apply_to
    from inercal.records.read import source_of
    from inercal.records.write import SUFFIXES, write_record

    paths = recorded("apply", files, streaming)
    if output.out is None:
        raise InputError("--out", "missing, expected the file to write, such as corrected.csv")
    output.check(SUFFIXES, (calibration, *paths, map_file))
    model, findings = _model(calibration)
    record = apply_to(read_record(paths, map_file, output), model, invert)
    with reading(output) as progress:
        write_record(record, output.out, progress)
    findings += _said_of(record, model)
    output.say_findings(findings)
    result = {"out": str(output.out), "rows": len(next(iter(record.columns.values())).t)}
    words = f"{result['rows']} rows written to {output.out}"
    inputs = (*record.sources, source_of(calibration))
    emit(told("apply", words, result, inputs, findings), words, output)


def _said_of(record: Record, model: Model) -> tuple[Finding, ...]:
    """Findings of a record, but for the rate and the accelerometers that nobody needs of a platform."""
    from inercal.convert.platform import PlatformModel
    from inercal.selfcal.reading import worth_saying

    if isinstance(model, PlatformModel):
        return tuple(worth_saying(record, record.columns.values()))
    return record.findings


def _model(calibration: Path) -> tuple[Model, tuple[Finding, ...]]:
    """The instrument of a calibration, and what to say of that: a bad verdict, terms that are not applied."""
    from inercal.convert import correct, platform
    from inercal.estimate.files import load
    from inercal.findings import Status

    estimate = load(calibration)
    verdict = f"the calibration ended {estimate.status.value}: {estimate.message}"
    bad = () if estimate.status is Status.OK else (Finding("bad_verdict", verdict, str(calibration)),)
    if estimate.command == platform.COMMAND:
        return platform.platform_model(estimate, calibration), (
            *bad,
            *platform.not_applied(estimate, calibration),
        )
    return correct.imu_model(estimate, calibration), (*bad, *correct.not_applied(estimate, calibration))
