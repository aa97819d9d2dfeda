"""``inercal design``."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from inercal.cli.options import Overrides, ReportOutput, Study, of_study, reading, working
from inercal.cli.outcome import WHOLE, hand_over, told

if TYPE_CHECKING:
    from inercal.estimate.result import Estimate
    from inercal.findings import Finding
    from inercal.selfcal.platform.plan import Plan
    from inercal.selfcal.settings import SelfcalSettings
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
) -> int:
    """Find the positions of a turntable that calibrate best."""
    from inercal._files import write_text
    from inercal.studies.load import files_of, load_turntable_study
    from inercal.turntable.positions.planning import REFERENCES, design

    output.check((*WHOLE, ".csv"), (study,))
    clock = time.perf_counter()
    settings = load_turntable_study(study, overrides or ())
    inputs = files_of(study, settings.given)
    output.spare(inputs)
    read_s = time.perf_counter() - clock
    clock = time.perf_counter()
    with of_study(study), working(output) as progress:
        designed = design(settings, progress)
    timing = {"read": read_s, "solve": time.perf_counter() - clock}
    estimate = _told("design positions", designed, timing, inputs, settings, REFERENCES)

    def page() -> str:
        from inercal.turntable.figures.design import page as design_page

        return design_page(designed, settings, estimate)

    def rows(path: Path) -> None:
        write_text(path, _positions(designed.result["positions"], settings))

    return hand_over(estimate, [designed.table()], page, output, "positions", rows)


def design_selfcal(
    study: Study,
    /,
    *,
    overrides: Overrides = None,
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> int:
    """Find the path on which a platform calibrates itself best."""
    from inercal._files import write_text
    from inercal._jit import compiling
    from inercal.selfcal.before.bounds import bounds
    from inercal.selfcal.before.path_design import REFERENCES, design
    from inercal.selfcal.filters.problem import problem
    from inercal.selfcal.platform.plan import Plan, Rest, motion
    from inercal.studies.load import load_selfcal_study

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
    estimate = _told("design selfcal", designed, timing, (study,), settings, REFERENCES)

    def page() -> str:
        from inercal.selfcal.figures.design import page as design_page

        return design_page(designed, settings, estimate)

    def plan(path: Path) -> None:
        write_text(path, _plan(designed.plan, designed.message))

    return hand_over(estimate, [designed.table()], page, output, "plan", plan, whole=(".json",))


def _told(
    command: str,
    designed: Designed,
    timing: Mapping[str, float],
    inputs: Iterable[Path],
    settings: TurntableSettings | SelfcalSettings,
    references: tuple[str, ...],
) -> Estimate:
    """What was designed as a result."""
    from inercal.records.read import source_of

    return told(
        command,
        designed.message,
        designed.result,
        map(source_of, inputs),
        designed.findings,
        timing,
        settings.given,
        references=references,
    )


def _positions(positions: Iterable[Iterable[float]], settings: TurntableSettings) -> str:
    """Positions as a CSV table."""
    head = ",".join(f"{joint} [deg]" for joint in settings.chain.joints)
    rows = (",".join(f"{math.degrees(angle):.10g}" for angle in position) for position in positions)
    return "\n".join([head, *rows]) + "\n"


def _plan(plan: Plan, message: str) -> str:
    """A plan as the table of a study."""
    from inercal.selfcal.before.path_design import stated_moves

    moves = (f"    {json.dumps(move)},\n" for move in stated_moves(plan.moves))
    start = [f"{math.degrees(angle):.10g} deg" for angle in plan.start]
    return (
        f"# {message}\n[plan]\nturns = [\n{''.join(moves)}]\n"
        f'rate = "{math.degrees(plan.rate):.10g} deg/s"\nstep = "{plan.step:.10g} s"\nstart = {json.dumps(start)}\n'
    )
