"""The page of tolerances from a goal."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from inercal.faces.report.coefficients import heat
from inercal.faces.report.html import Picture
from inercal.faces.report.html import page as framed
from inercal.faces.report.marks import Axis, Bars, Dots, Level, Note, Panel
from inercal.faces.report.panels import draw
from inercal.faces.report.sphere import hemispheres
from inercal.faces.report.style import COLOURS, INK
from inercal.foundation.rigs.outputs import gravity_reference
from inercal.systems.turntable.figures.table import factor_rows, rig, rig_facts
from inercal.systems.turntable.positions.tolerance_result import factor_text, goal_texts, result, size_text

if TYPE_CHECKING:
    from inercal.foundation.results.result import Estimate
    from inercal.systems.turntable.positions.tolerance_design import ToleranceDesign
    from inercal.systems.turntable.settings import TurntableSettings


def main(made: Mapping[str, Any]) -> Picture:
    """The picture that answers the question: each tolerance as a part of the present one, beside its cost.

    ``made`` is the `inercal.systems.turntable.positions.tolerance_result.result`.
    """
    each = made["tolerances"]
    rows = np.arange(float(len(each)))
    factor, cost, present = (
        np.array([row[key] for row in each]) for key in ("factor", "cost", "present_cost")
    )
    sizes = [size_text(row["wanted"], row["unit"]) for row in each]
    down = Axis(names=[row["error"] for row in each])
    ends = (0.5 * min(1.0, float(factor.min())), 4.0 * max(1.0, float(factor.max())))
    return draw(
        "Tolerances to ask for",
        "Left: each tolerance over the present one, its size beside it; to the left of the line it is to be tightened. "
        "Right: its cost, and that of the present one.",
        [
            [
                Panel(
                    [
                        Level(1.0, "", INK, upright=True),
                        Dots(factor, rows),
                        *(
                            Note((x, row), text, size=6.5, shift=(5.0, 0.0))
                            for x, row, text in zip(factor, rows, sizes, strict=True)
                        ),
                    ],
                    Axis("wanted over present tolerance", "log", ends),
                    down,
                    grid="x",
                ),
                Panel(
                    [
                        Bars(rows - 0.2, 0.0 * rows, cost, "wanted", COLOURS[0], 0.38),
                        Bars(rows + 0.2, 0.0 * rows, present, "present", COLOURS[1], 0.38),
                    ],
                    Axis("cost"),
                    down,
                    grid="x",
                ),
            ]
        ],
        0.8 + 0.2 * len(each),
        2,
        share_y=True,
    )


def shares(made: Mapping[str, Any]) -> Picture:
    """The part of each tolerance in each goal."""
    goals = [goal["name"] for goal in made["goals"]]
    columns = [row["error"] for row in made["tolerances"]]
    of_error = [[100.0 * row["share"][name] for row in made["tolerances"]] for name in goals]
    rest = [
        [100.0 * goal["share_of_noise"], 100.0 * sum(goal["share_of_inputs"].values())]
        for goal in made["goals"]
    ]
    return heat(
        "What each tolerance is bought for",
        "Share of each error of the table, at its wanted tolerance, in the variance of each goal; of noise; and of "
        "what the study states with an uncertainty. Shares below 0.5 % have no number.",
        goals,
        [*columns, "noise", "stated"],
        np.hstack([np.array(of_error), np.array(rest)]),
        "share [%]",
    )


def page(designed: ToleranceDesign, settings: TurntableSettings, estimate: Estimate) -> str:
    """The report of a search for tolerances as one self-contained HTML page."""
    made = result(designed, settings)
    trial = designed.best.test
    gravity = gravity_reference() @ settings.chain.attitude(trial.plan.angles)
    where = draw(
        "Positions",
        "Direction of gravity on the axes of the instrument, on two hemispheres seen along −z (equal-area projection; "
        "circles at 30° and 60° from the pole). Numbers as in the list of positions.",
        [hemispheres(gravity)],
        3.2,
    )
    return framed(
        "tolerances.html",
        estimate,
        "Tolerances of a turntable",
        facts=[
            *rig_facts(settings),
            ("instrument", "", settings.instrument.kind),
            ("plan", "", f"{trial.plan.name}, {trial.positions} positions in all"),
        ],
        factors=factor_rows(settings.chain.errors),
        pictures=[main(made), shares(made), where, rig(settings.chain)],
        tolerances=[
            (
                row["error"],
                size_text(row["present"], row["unit"]),
                size_text(row["wanted"], row["unit"]),
                factor_text(row["factor"]),
                f"{row['present_cost']:.3g}",
                f"{row['cost']:.3g}",
                f"{row['kept_present']:.2f}",
            )
            for row in made["tolerances"]
        ],
        goals=[
            (*goal_texts(goal, settings), f"{100.0 * goal['share_of_noise']:.0f}") for goal in made["goals"]
        ],
        plans=made["compare"],
        cost=(made["present_cost"], made["cost"]),
        joints=settings.chain.joints,
        positions=np.degrees(trial.plan.angles).tolist(),
        repeats=trial.repeats,
    )
