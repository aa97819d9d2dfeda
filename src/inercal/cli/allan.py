"""``inercal allan``."""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Annotated

from cyclopts import Parameter

from inercal.cli.options import Files, MapFile, ReportOutput, read_record, working
from inercal.cli.outcome import WHOLE, hand_over


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
    from inercal._files import write_text
    from inercal.noise.outcome import noise_of, within
    from inercal.report.allan import curves_csv, page, table
    from inercal.units import parse_quantity

    output.check((*WHOLE, ".csv"), (*files, map_file))
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
    timing = {"read": read_s, "solve": noise.estimate.timing["solve"]}
    estimate = replace(noise.estimate, timing=timing)
    noise = replace(noise, estimate=estimate)
    return hand_over(
        estimate,
        [table(noise)],
        lambda: page(noise),
        output,
        "noise",
        lambda path: write_text(path, curves_csv(noise)),
    )
