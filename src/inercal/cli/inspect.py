"""``inercal inspect``."""

from __future__ import annotations

from dataclasses import replace

from inercal.cli.options import Files, MapFile, ReportOutput, Span, read_record
from inercal.cli.outcome import WHOLE, emit, timed


def inspect(
    files: Files,
    /,
    *,
    map_file: MapFile = None,
    span: Span = Span(),  # noqa: B008  (frozen)
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> None:
    """Look at a recording before it is used."""
    from inercal._files import write_text
    from inercal.estimate.files import save
    from inercal.estimate.result import without_coefficients
    from inercal.records.places import counted
    from inercal.report.inspection import (
        channels_table,
        inspection_pictures,
        norms,
        render_inspection,
        summary,
    )

    output.check(WHOLE, (*files, map_file))
    record = read_record(files, map_file, output, span)
    if {"wc_x", "th_x", "acc_x"} <= record.columns.keys():  # a platform in gimbals
        from inercal.selfcal.reading import worth_saying

        record = replace(record, findings=tuple(worth_saying(record, record.columns.values())))
    words = counted(len(record.findings), "finding") if record.findings else "nothing suspicious"
    result = {
        "channels": [vars(row) for row in summary(record)],
        "norms": [vars(row) for row in norms(record)],
    }
    estimate = timed(without_coefficients("inspect", words, result, record.sources, record.findings))
    if output.out is not None:
        save(estimate, output.out)
        output.say(f"findings: {output.out}")
    if output.report is not None:
        write_text(output.report, render_inspection(record, estimate, inspection_pictures(record)))
        output.say(f"report: {output.report}")
    findings = [f"{f.code}: {f.message}{f' ({f.where})' if f.where else ''}" for f in record.findings] or [
        words
    ]
    emit(estimate, "\n".join([channels_table(record).text(), "", *findings]), output)
