"""``inercal design``."""

from __future__ import annotations

import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

from inercal.cli.options import Overrides, ReportOutput, Study, envelope, of_study, working

if TYPE_CHECKING:
    from inercal.turntable.settings import TurntableSettings


def design_positions(
    study: Study,
    /,
    *,
    overrides: Overrides = None,
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> None:
    """Find the positions of a turntable that calibrate best."""
    from inercal.records.read import source_of
    from inercal.study.load import files_of, load_turntable_study
    from inercal.turntable.task import design

    output.check((".json", ".csv"), (study,))
    clock = time.perf_counter()
    settings = load_turntable_study(study, overrides or ())
    inputs = files_of(study, settings.given)
    output.spare(inputs)
    read_s = time.perf_counter() - clock
    clock = time.perf_counter()
    with of_study(study), working(output) as progress:
        designed = design(settings, progress)
    timing = {"read": read_s, "solve": time.perf_counter() - clock}
    output.say_findings(designed.findings)
    data = envelope(
        "design positions",
        designed.message,
        designed.result,
        map(source_of, inputs),
        designed.findings,
        timing=timing,
    )
    if output.out is not None:
        _write(data, settings, output.out)
        output.say(f"positions: {output.out}")
    if output.report is not None:
        from inercal._files import write_text
        from inercal.turntable.figures import design_page

        write_text(output.report, design_page(designed, settings))
        output.say(f"report: {output.report}")
    output.emit(data, f"{designed.table()}\n\n{designed.message}")


def _write(data: Mapping[str, Any], settings: TurntableSettings, path: Path) -> None:
    """The whole object as JSON, or the positions as a CSV table."""
    import json
    import math

    from inercal._files import write_text

    if path.suffix.lower() == ".json":
        write_text(path, json.dumps(data, indent=1, ensure_ascii=False) + "\n")
        return
    head = ",".join(f"{joint} [deg]" for joint in settings.chain.joints)
    rows = (
        ",".join(f"{math.degrees(angle):.10g}" for angle in position)
        for position in data["result"]["positions"]
    )
    write_text(path, "\n".join([head, *rows]) + "\n")
