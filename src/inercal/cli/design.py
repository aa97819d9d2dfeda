"""``inercal design`` and ``inercal sensitivity``: what is asked before a test."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from inercal.cli.options import (
    ClusterOption,
    Overrides,
    ResultOutput,
    Study,
    WorkersOption,
    place_of,
    reading,
    study_in,
    working,
)
from inercal.cli.outcome import WHOLE, give

if TYPE_CHECKING:
    from inercal.systems.selfcal.platform.plan import PlatformPlan
    from inercal.systems.turntable.settings import TurntableSettings


_ANYWHERE = "45 deg"
"""Latitude of a table of sections without a study."""


def design_positions(
    study: Study,
    /,
    *,
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    front: Annotated[
        bool,
        Parameter(
            help="The tests to choose from by number of positions, u of the drift, and cost of tolerances."
        ),
    ] = False,
    overrides: Overrides = None,
    output: ResultOutput = ResultOutput(),
) -> int:
    """Find the positions of a turntable that calibrate best."""
    from inercal.foundation._files import write_text
    from inercal.systems.turntable import verbs as system

    output.check(WHOLE if front else (*WHOLE, ".csv"), (study,))
    place = place_of(workers, cluster)
    the_study, read_s = study_in("turntable", study, overrides, output)
    if front:
        with working(output) as progress:
            return give(system.design_front(the_study, progress), output, read_s, "front")
    with working(output) as progress:
        designed = system.design(the_study, progress, place)

    def rows(path: Path) -> None:
        write_text(path, _positions(designed.estimate.result["positions"], the_study.settings))

    return give(designed, output, read_s, "positions", rows)


def design_tolerances(
    study: Study,
    /,
    *,
    overrides: Overrides = None,
    output: ResultOutput = ResultOutput(),
) -> int:
    """Find the cheapest tolerances of a turntable that reach wanted uncertainties."""
    from inercal.foundation._files import write_text
    from inercal.systems.turntable import verbs as system
    from inercal.systems.turntable.positions.tolerance_result import study_tables

    output.check((".json", ".toml"), (study,))
    the_study, read_s = study_in("turntable", study, overrides, output)
    with working(output) as progress:
        designed = system.design_tolerances(the_study, progress)

    def tables(path: Path) -> None:
        write_text(path, study_tables(designed.evidence))

    return give(designed, output, read_s, "tolerances", tables, whole=(".json",))


def design_selfcal(
    study: Study,
    /,
    *,
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    overrides: Overrides = None,
    output: ResultOutput = ResultOutput(),
) -> int:
    """Find the path on which a platform calibrates itself best."""
    from inercal.foundation._files import write_text
    from inercal.foundation._jit import compiling
    from inercal.systems.selfcal import verbs as system

    output.check((".json", ".toml"), (study,))
    place = place_of(workers, cluster)
    the_study, read_s = study_in("selfcal", study, overrides, output)
    with compiling("design selfcal", output.say_now):
        system.prepare_design(the_study)
    with reading(output, "searching") as progress:
        designed = system.design(the_study, progress, place)

    def plan(path: Path) -> None:
        write_text(path, _plan(designed.evidence.plan, designed.message))

    return give(designed, output, read_s, "plan", plan, whole=(".json",))


def design_strapdown(
    study: Study,
    /,
    *,
    overrides: Overrides = None,
    output: ResultOutput = ResultOutput(),
) -> int:
    """Say what the turns of a strapdown unit tell, and find better ones."""
    from inercal.foundation._files import write_text
    from inercal.foundation._jit import compiling
    from inercal.systems.strapdown import verbs as system
    from inercal.systems.strapdown.before.design import study_table

    output.check((".json", ".toml"), (study,))
    the_study, read_s = study_in("strapdown", study, overrides, output)
    with compiling("design strapdown", output.say_now):
        system.prepare_design(the_study)
    with reading(output, "searching") as progress:
        designed = system.design(the_study, progress)

    def plan(path: Path) -> None:
        write_text(path, study_table(designed.evidence))

    return give(designed, output, read_s, "plan", plan, whole=(".json",))


def design_aoa(
    study: Study,
    /,
    *,
    overrides: Overrides = None,
    output: ResultOutput = ResultOutput(),
) -> int:
    """Say what the sensors of a model can tell of its angle, and other layouts beside."""
    from inercal.foundation._jit import compiling
    from inercal.systems.aoa import verbs as system

    output.check(WHOLE, (study,))
    the_study, read_s = study_in("aoa", study, overrides, output)
    with compiling("aoa", output.say_now):
        system.prepare_design(the_study)
    with working(output) as progress:
        compared = system.design(the_study, progress)
    return give(compared, output, read_s, "layouts")


def design_sections(
    study: Study,
    /,
    *,
    overrides: Overrides = None,
    output: ResultOutput = ResultOutput(),
) -> int:
    """Say what sections of an IMU tell, and which one more would help most."""
    from inercal.systems.imu import verbs as system

    output.check(WHOLE, (study,))
    if study.suffix.lower() == ".csv":  # what sections tell hardly depends on the place
        overrides = [f"site.latitude={_ANYWHERE}", *(overrides or ())]
    the_study, read_s = study_in("imu", study, overrides, output)
    with working(output):
        designed = system.design(the_study)
    return give(designed, output, read_s, "sections")


def _positions(positions: Iterable[Iterable[float]], settings: TurntableSettings) -> str:
    """Positions as a CSV table."""
    head = ",".join(f"{joint} [deg]" for joint in settings.chain.joints)
    rows = (",".join(f"{math.degrees(angle):.10g}" for angle in position) for position in positions)
    return "\n".join([head, *rows]) + "\n"


def _plan(plan: PlatformPlan, message: str) -> str:
    """A plan as the table of a study."""
    from inercal.systems.selfcal.before.path_design import stated_moves

    moves = (f"    {json.dumps(move)},\n" for move in stated_moves(plan.moves))
    start = [f"{math.degrees(angle):.10g} deg" for angle in plan.start]
    return (
        f"# {message}\n[plan]\nturns = [\n{''.join(moves)}]\n"
        f'rate = "{math.degrees(plan.rate):.10g} deg/s"\nstep = "{plan.step:.10g} s"\nstart = {json.dumps(start)}\n'
    )


def sensitivity(
    study: Study,
    /,
    *,
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    overrides: Overrides = None,
    output: ResultOutput = ResultOutput(),
) -> int:
    """Say which error of a turntable matters."""
    from inercal.systems.turntable import verbs as system

    output.check((*WHOLE, ".nc", ".npz"), (study,))
    place = place_of(workers, cluster)
    the_study, read_s = study_in("turntable", study, overrides, output)
    with reading(output, "sampling") as progress:
        result = system.sensitivity(the_study, bool(output.targets), output.say_now, progress, place)
    analysed = result.evidence
    if analysed.note:
        output.say(analysed.note)

    def maps(path: Path) -> None:
        from inercal.systems.turntable.sensitivity_maps import write_maps

        write_maps(analysed, path)

    return give(result, output, read_s, "maps", maps)
