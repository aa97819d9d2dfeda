"""``inercal calibrate``."""

from __future__ import annotations

import time
from dataclasses import replace

from inercal.cli import EXIT_BAD_VERDICT, process_age
from inercal.cli.options import Files, MapFile, Overrides, ReportOutput, StudyFile, read_record, working


def calibrate_imu(
    files: Files,
    /,
    *,
    study: StudyFile,
    map_file: MapFile = None,
    overrides: Overrides = None,
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> int:
    """Calibrate an IMU that was held still in many poses by hand."""
    from inercal.estimate.exchange import save, to_json
    from inercal.estimate.status import Status
    from inercal.imu.task import calibrate
    from inercal.records.read import source_of
    from inercal.study.load import load_imu_study

    output.check((".json", ".toml"), (*files, map_file, study))
    settings = load_imu_study(study, overrides or ())
    clock = time.perf_counter()
    record = read_record(files, map_file, output)
    read_s = time.perf_counter() - clock
    with working(output) as progress:
        calibration = calibrate(record, settings, progress)
    estimate = calibration.estimate
    timing = {"read": read_s, "solve": estimate.timing["solve"], "total": process_age()}
    estimate = replace(estimate, timing=timing, inputs=(*estimate.inputs, source_of(study)))
    output.say_findings(estimate.findings)
    if output.out is not None:
        save(estimate, output.out)
        output.say(f"calibration: {output.out}")
    if output.report is not None:
        from inercal._files import write_text
        from inercal.imu.figures import pictures
        from inercal.report.html import render

        page = render(estimate, pictures(calibration), "Calibration of an inertial measurement unit")
        write_text(output.report, page)
        output.say(f"report: {output.report}")
    text = f"{estimate.table()}\n\n" if estimate.names else ""
    verdict = f"{estimate.status.value}: {estimate.message}"
    if estimate.status is not Status.OK:
        verdict += f"\n{estimate.status.advice}"
    output.emit(to_json(estimate), text + verdict)
    return 0 if estimate.status is Status.OK else EXIT_BAD_VERDICT
