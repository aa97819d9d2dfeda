"""``inercal apply``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from inercal.cli.options import FileOutput, Files, MapFile, envelope, read_record, reading
from inercal.errors import InputError


def apply(
    calibration: Annotated[Path, Parameter(help="Calibration that `inercal calibrate --out` wrote.")],
    files: Files,
    /,
    *,
    map_file: MapFile = None,
    invert: Annotated[bool, Parameter(help="From true values to outputs of the instrument.")] = False,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Correct a recording with a calibration."""
    from inercal.convert.correct import apply_to, imu_model
    from inercal.estimate.exchange import load
    from inercal.estimate.status import Status
    from inercal.records.read import source_of
    from inercal.records.write import write_csv

    if output.out is None:
        raise InputError("--out", "missing, expected the file to write, such as corrected.csv")
    output.check((".csv",), (calibration, *files, map_file))
    estimate = load(calibration)
    if estimate.status is not Status.OK:
        output.say(f"{estimate.status.value}: {estimate.message}")
    model = imu_model(estimate, calibration)
    record = apply_to(read_record(files, map_file, output), model, invert)
    output.say_findings(record.findings)
    with reading(output) as progress:
        write_csv(record, output.out, progress)
    result = {"out": str(output.out), "rows": len(next(iter(record.columns.values())).t)}
    words = f"{result['rows']} rows written to {output.out}"
    inputs = (*record.sources, source_of(calibration))
    output.emit(envelope("apply", words, result, inputs, record.findings), words)
