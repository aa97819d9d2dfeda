"""``inercal allan``."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Annotated

from cyclopts import Parameter

from inercal.cli import EXIT_BAD_VERDICT, process_age
from inercal.cli.options import Files, MapFile, ReportOutput, read_record, working


def allan(
    files: Files,
    /,
    *,
    map_file: MapFile = None,
    begin: Annotated[str | None, Parameter(help='Leave out what comes before, such as "10 s".')] = None,
    end: Annotated[str | None, Parameter(help='Leave out what comes after, such as "30 min".')] = None,
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> int:
    """Tell the noise of an instrument at rest."""
    from inercal.estimate.exchange import save, to_json
    from inercal.estimate.status import Status
    from inercal.noise.outcome import noise_of, within
    from inercal.report.allan import curves_csv, table
    from inercal.units import parse_quantity

    output.check((".json", ".toml", ".csv"), (*files, map_file))
    span = {
        name: None if text is None else parse_quantity(text, "time", f"--{name}").value
        for name, text in (("begin", begin), ("end", end))
    }
    clock = time.perf_counter()
    record = within(read_record(files, map_file, output), span["begin"], span["end"])
    read_s = time.perf_counter() - clock
    with working(output) as progress:
        progress("noise")
        noise = noise_of(record, {f"{name}_s": value for name, value in span.items() if value is not None})
    timing = {"read": read_s, "solve": noise.estimate.timing["solve"], "total": process_age()}
    estimate = replace(noise.estimate, timing=timing)
    noise = replace(noise, estimate=estimate)
    output.say_findings(estimate.findings)
    if output.out is not None:
        if output.out.suffix.lower() == ".csv":
            from inercal._files import write_text

            write_text(output.out, curves_csv(noise))
        else:
            save(estimate, output.out)
        output.say(f"noise: {output.out}")
    if output.report is not None:
        from inercal._files import write_text
        from inercal.report.allan import page

        write_text(output.report, page(noise))
        output.say(f"report: {output.report}")
    output.emit(to_json(estimate), f"{table(noise)}\n\n{estimate.status.value}: {estimate.message}")
    return 0 if estimate.status is Status.OK else EXIT_BAD_VERDICT
