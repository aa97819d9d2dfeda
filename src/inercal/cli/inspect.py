"""``inercal inspect``."""

from __future__ import annotations

from dataclasses import replace
from math import isnan
from typing import TYPE_CHECKING

from inercal.cli.options import Files, MapFile, ReportOutput, envelope, read_record

if TYPE_CHECKING:
    from inercal.report.inspection import ChannelSummary


def inspect(
    files: Files,
    /,
    *,
    map_file: MapFile = None,
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> None:
    """Look at a recording before it is used."""
    from inercal.records.places import counted
    from inercal.report.inspection import inspection_pictures, render_inspection, sparkline, summary

    output.check((".json",), (*files, map_file))
    record = read_record(files, map_file, output)
    if {"wc_x", "th_x", "acc_x"} <= record.columns.keys():  # a platform in gimbals
        from inercal.selfcal.reading import worth_saying

        record = replace(record, findings=tuple(worth_saying(record, record.columns.values())))
    rows = summary(record)
    words = counted(len(record.findings), "finding") if record.findings else "nothing suspicious"
    result = {"channels": [vars(row) for row in rows]}
    data = envelope("inspect", words, result, record.sources, record.findings)
    if output.out is not None:
        import json

        from inercal._files import write_text

        write_text(output.out, json.dumps(data, indent=1, ensure_ascii=False) + "\n")
        output.say(f"findings: {output.out}")
    if output.report is not None:
        from inercal._files import write_text

        write_text(output.report, render_inspection(record, rows, inspection_pictures(record)))
        output.say(f"report: {output.report}")
    lines = [
        f"{row.name:11s} {sparkline(record[row.name].values):24s} {_count(row)}, "
        f"mean {row.mean:.6g}, sd {row.deviation:.3g}, {row.minimum:.6g} to {row.maximum:.6g} {row.unit}"
        for row in rows
    ]
    lines += [f"{f.code}: {f.message}{f' ({f.where})' if f.where else ''}" for f in record.findings] or [
        words
    ]
    output.emit(data, "\n".join(lines))


def _count(row: ChannelSummary) -> str:
    """How many samples at which rate; rows where they have no rate."""
    if isnan(row.rate):
        return f"{row.samples} rows"
    return f"{row.samples} samples at {row.rate:.5g} Hz"
