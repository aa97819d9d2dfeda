"""``inercal design``."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from inercal.cli.options import Overrides, ReportOutput, Study, envelope, of_study, reading, working

if TYPE_CHECKING:
    from inercal.records.findings import Finding
    from inercal.selfcal.plan import Plan
    from inercal.turntable.settings import TurntableSettings


class Designed(Protocol):
    """What the design of a test of any system brings back."""

    @property
    def message(self) -> str:
        """What was searched, in words."""

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What is to be known about it."""

    @property
    def result(self) -> dict[str, Any]:
        """The command's part of the JSON result."""

    def table(self) -> str:
        """The result as aligned text."""


def design_positions(
    study: Study,
    /,
    *,
    overrides: Overrides = None,
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> None:
    """Find the positions of a turntable that calibrate best."""
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

    def page() -> str:
        from inercal.turntable.figures import design_page

        return design_page(designed, settings)

    rows = _positions(designed.result["positions"], settings)
    _hand_over("design positions", designed, timing, inputs, output, "positions", rows, page)


def design_selfcal(
    study: Study,
    /,
    *,
    overrides: Overrides = None,
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> None:
    """Find the path on which a platform calibrates itself best."""
    from inercal._jit import compiling
    from inercal.selfcal.bounds import bounds
    from inercal.selfcal.filtered import problem
    from inercal.selfcal.pathdesign import design
    from inercal.selfcal.plan import Plan, Rest, motion
    from inercal.study.load import load_selfcal_study

    output.check((".json", ".toml"), (study,))
    clock = time.perf_counter()
    settings = load_selfcal_study(study, overrides or ())
    read_s = time.perf_counter() - clock
    with of_study(study):
        with compiling("design selfcal", output.say_now):
            bounds(motion(Plan((Rest(0.2),)), settings.world), problem(settings))
        clock = time.perf_counter()
        with reading(output, "searching") as progress:
            designed = design(settings, *(() if progress is None else (progress,)))
    timing = {"read": read_s, "solve": time.perf_counter() - clock}

    def page() -> str:
        from inercal.selfcal.figures import design_page

        return design_page(designed, settings)

    plan = _plan(designed.plan, designed.message)
    _hand_over("design selfcal", designed, timing, (study,), output, "plan", plan, page)


def _hand_over(
    command: str,
    designed: Designed,
    timing: Mapping[str, float],
    inputs: Iterable[Path],
    output: ReportOutput,
    what: str,
    text: str,
    page: Callable[[], str],
) -> None:
    """Write what was asked for, the whole object as JSON or ``text``, which is ``what`` in a word; and print it."""
    from inercal._files import write_text
    from inercal.records.read import source_of

    output.say_findings(designed.findings)
    data = envelope(
        command, designed.message, designed.result, map(source_of, inputs), designed.findings, timing=timing
    )
    if output.out is not None:
        whole = output.out.suffix.lower() == ".json"
        write_text(output.out, json.dumps(data, indent=1, ensure_ascii=False) + "\n" if whole else text)
        output.say(f"{what}: {output.out}")
    if output.report is not None:
        write_text(output.report, page())
        output.say(f"report: {output.report}")
    output.emit(data, f"{designed.table()}\n\n{designed.message}")


def _positions(positions: Iterable[Iterable[float]], settings: TurntableSettings) -> str:
    """Positions as a CSV table."""
    head = ",".join(f"{joint} [deg]" for joint in settings.chain.joints)
    rows = (",".join(f"{math.degrees(angle):.10g}" for angle in position) for position in positions)
    return "\n".join([head, *rows]) + "\n"


def _plan(plan: Plan, message: str) -> str:
    """A plan as the table of a study."""
    from inercal.selfcal.pathdesign import stated_moves

    moves = (f"    {json.dumps(move)},\n" for move in stated_moves(plan.moves))
    start = [f"{math.degrees(angle):.10g} deg" for angle in plan.start]
    return (
        f"# {message}\n[plan]\nturns = [\n{''.join(moves)}]\n"
        f'rate = "{math.degrees(plan.rate):.10g} deg/s"\nstep = "{plan.step:.10g} s"\nstart = {json.dumps(start)}\n'
    )
