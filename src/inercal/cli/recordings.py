"""``inercal inspect``, ``allan`` and ``monitor``: a recording looked at."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

from inercal.cli.options import OutputOptions, ReportOutput, ResultOutput, working
from inercal.cli.outcome import WHOLE, emit, give, timed
from inercal.cli.records_in import Answers, Files, MapFile, Span, read_record
from inercal.cli.streaming import Every, StreamFile, StreamOptions, interval_of, run_stream


def inspect(
    files: Files,
    /,
    *,
    map_file: MapFile = None,
    span: Span = Span(),
    output: ReportOutput = ReportOutput(),
) -> None:
    """Look at a recording before it is used."""
    from inercal.faces.report.inspection import (
        channels_table,
        inspection_pictures,
        norms,
        render_inspection,
        summary,
    )
    from inercal.foundation._files import write_text
    from inercal.foundation.records.checks.clocks import clock_rates, turns_seen
    from inercal.foundation.records.places import counted
    from inercal.foundation.results.files import save
    from inercal.foundation.results.result import without_coefficients

    output.check(WHOLE, (*files, map_file))
    record = read_record(files, map_file, output, span, with_guess=True)
    if {"wc_x", "th_x", "acc_x"} <= record.columns.keys():  # a platform in gimbals
        from inercal.systems.selfcal.reading import worth_saying

        record = replace(record, findings=tuple(worth_saying(record, record.columns.values())))
    rates, seen = clock_rates(record), turns_seen(record)
    if seen is not None:
        record = replace(record, findings=(*record.findings, *seen.findings))
    words = counted(len(record.findings), "finding") if record.findings else "nothing suspicious"
    result = {
        "channels": [vars(row) for row in summary(record)],
        "norms": [vars(row) for row in norms(record)],
        "taken": dict(record.taken),
        "rates": [vars(rate) for rate in rates],
        "turns": None if seen is None else vars(seen),
    }
    estimate = timed(without_coefficients("inspect", words, result, record.sources, record.findings))
    if output.out is not None:
        save(estimate, output.out)
        output.say(f"findings: {output.out}")
    if output.report is not None:
        write_text(output.report, render_inspection(record, estimate, inspection_pictures(record)))
        output.say(f"report: {output.report}")
    taken = [f"{sensor}: {of_sensor}" for sensor, of_sensor in record.taken.items()]
    clocks = [*(rate.line for rate in rates), *([] if seen is None else [seen.line])]
    findings = [finding.line for finding in record.findings] or [words]
    text = "\n".join(
        [channels_table(record).text(), "", *(taken if map_file is not None else ()), *clocks, *findings]
    )
    emit(estimate, text, output)


def allan(
    files: Files,
    /,
    *,
    map_file: MapFile = None,
    span: Span = Span(),
    output: ResultOutput = ResultOutput(),
) -> int:
    """Tell the noise of an instrument at rest."""
    from inercal.faces.python.verbs import allan as noise_of
    from inercal.faces.report.allan import curves_csv
    from inercal.foundation._files import write_text

    output.check((*WHOLE, ".csv"), (*files, map_file))
    clock = time.perf_counter()
    record = read_record(files, map_file, output, span)
    read_s = time.perf_counter() - clock
    with working(output) as progress:
        progress("noise")
        result = noise_of(record)

    def curves(path: Path) -> None:
        write_text(path, curves_csv(result.evidence))

    return give(result, output, read_s, "noise", curves)


def monitor(
    file: StreamFile = None,
    /,
    *,
    map_file: MapFile = None,
    every: Every = None,
    answers: Answers = None,
    streaming: StreamOptions = StreamOptions(),
    output: OutputOptions = OutputOptions(),
) -> None:
    """Tell rest from motion, live, and measure the noise at rest."""
    from inercal.faces.stream.estimators import monitor as prepared

    interval = interval_of(every)
    streaming.check(output, (file, map_file))
    run_stream(prepared(interval, output.say), file, map_file, output, streaming, answers or ())
