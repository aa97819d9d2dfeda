"""``inercal convert``."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from inercal.cli import EXIT_BAD_VERDICT
from inercal.cli.options import FileOutput
from inercal.cli.outcome import WHOLE, emit
from inercal.errors import InputError

if TYPE_CHECKING:
    from inercal.convert.other_tools import Converted
    from inercal.estimate.result import Estimate

Tool = Literal["imu_tk", "imucal", "kalibr", "psins"]


def convert(
    files: Annotated[
        list[Path], Parameter(help="Calibration; with --from imu_tk its accelerometers' and gyro's files.")
    ],
    /,
    *,
    to: Annotated[Tool | None, Parameter(help="The tool to write for.")] = None,
    source: Annotated[Tool | None, Parameter(name="--from", help="The tool that wrote the file.")] = None,
    acc_unit: Annotated[
        str | None,
        Parameter(help="With --from: unit of the accelerometers' outputs, if the file states none."),
    ] = None,
    gyro_unit: Annotated[
        str | None, Parameter(help="With --from: unit of the gyro's outputs, if the file states none.")
    ] = None,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> int:
    """Convert a calibration to or from another tool's."""
    from inercal.convert.other_tools import CONVENTIONS, from_tool, to_tool
    from inercal.estimate.files import load
    from inercal.findings import Status
    from inercal.records.read import source_of

    if to is None and source is None:
        raise InputError("--to", "missing, expected --to or --from and one of " + ", ".join(CONVENTIONS))
    output.check(WHOLE if to is None else CONVENTIONS[to].suffixes, files)
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
    else:
        _write_texts(to_tool(estimate, to, files[0]), to, files, output)
    return 0 if estimate.status is Status.OK else EXIT_BAD_VERDICT


def _write_calibration(estimate: Estimate, output: FileOutput) -> None:
    """The calibration, to its file and as a table."""
    from inercal.estimate.files import save

    output.say_findings(estimate.findings)
    if output.out is not None:
        save(estimate, output.out)
        output.say(f"calibration: {output.out}")
    emit(replace(estimate, timing={}), f"{estimate.table()}\n\n{estimate.message}", output)


def _write_texts(converted: Converted, tool: Tool, files: list[Path], output: FileOutput) -> None:
    """The files of the tool and the table of their terms; without --out their texts instead."""
    from inercal._files import write_text

    estimate = converted.estimate
    output.say_findings(estimate.findings)
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
