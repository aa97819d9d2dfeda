"""The page of a design of positions."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from inercal.faces.report.coefficients import dots, heat
from inercal.faces.report.html import Picture
from inercal.faces.report.html import page as framed
from inercal.faces.report.panels import draw
from inercal.faces.report.sphere import hemispheres, plane
from inercal.foundation.arrays import Array
from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.results.shown import rounded
from inercal.foundation.rigs.outputs import gravity_reference
from inercal.systems.turntable.figures.table import factor_rows, rig, rig_facts

if TYPE_CHECKING:
    from inercal.foundation.results.result import Estimate
    from inercal.systems.turntable.positions.planning import DesignedPositions
    from inercal.systems.turntable.settings import TurntableSettings


def main(designed: DesignedPositions, settings: TurntableSettings) -> Picture:
    """The picture that answers the question: where gravity lies on the instrument in the positions chosen."""
    angles, chain = designed.plan.angles, settings.chain
    return draw(
        "Positions chosen",
        f"Direction of gravity on the axes of the instrument in the {len(angles)} positions, on two hemispheres "
        "seen along −z (equal-area projection; circles at 30° and 60° from the pole). Numbers as in the list of "
        "positions; near ones share a label.",
        [hemispheres(gravity_reference() @ chain.attitude(angles))],
        3.2,
    )


def page(designed: DesignedPositions, settings: TurntableSettings, estimate: Estimate) -> str:
    """The report of a search for positions as one self-contained HTML page."""
    judged, unit = designed.compare, designed.unit
    names, shown = list(designed.units), [shown_unit(text, unit) for text in designed.units.values()]
    units, scale = [text for text, _ in shown], np.array([size for _, size in shown])
    u = [
        np.array([dict(zip(each.names, each.figures.u, strict=True)).get(name, np.nan) for name in names])
        / scale
        for each in judged
    ]
    return framed(
        "design.html",
        estimate,
        "Positions for a turntable test",
        facts=[
            *rig_facts(settings),
            ("instrument", "", f"{settings.instrument.kind}, {', '.join(names)}"),
        ],
        factors=factor_rows(settings.chain.errors),
        pictures=_design_pictures(designed, settings, names, units, u),
        plans=[
            {
                "name": each.plan.name,
                "positions": len(each.plan),
                "rank": f"{each.figures.rank} of {each.terms}",
                "condition": each.figures.condition,
                "efficiency": each.figures.d_efficiency,
                "earth_rate": each.earth_rate,
                "rms": each.figures.rms_prediction / unit.factor,
                "unidentified": each.figures.unidentified,
            }
            for each in judged
        ],
        unit=unit.symbol,
        uncertainties=[
            (
                name,
                units[k],
                [_stated_or(values[k], name, each.names) for values, each in zip(u, judged, strict=True)],
            )
            for k, name in enumerate(names)
        ],
        joints=settings.chain.joints,
        positions=np.degrees(designed.plan.angles).tolist(),
    )


def _stated_or(u: float, name: str, fitted: Sequence[str]) -> str:
    """An uncertainty as text; whether the term is stated, or not identified."""
    if name not in fitted:
        return "stated"
    return rounded(u, u)[1] if np.isfinite(u) else "free"


def _design_pictures(
    designed: DesignedPositions,
    settings: TurntableSettings,
    names: Sequence[str],
    units: Sequence[str],
    u: list[Array],
) -> list[Picture]:
    """The chosen positions, the uncertainties by plan, and where they come from."""
    angles, chain = designed.plan.angles, settings.chain
    pictures = [
        main(designed, settings),
        rig(chain),
    ]
    if len(chain.joints) == 2:
        panels = [[plane(angles, chain.joints)]]
        pictures.append(draw("Angles of the table", "The same positions over both angles.", panels, 3.4))
    pictures.append(
        dots(
            "Uncertainties by plan",
            "Standard uncertainty of each coefficient that noise and errors of the table make expect. A plan that does "
            "not identify a term, or takes it as stated, has no mark there.",
            names,
            units,
            {each.plan.name: values for each, values in zip(designed.compare, u, strict=True)},
        )
    )
    shared = [each for each in designed.compare if each.drift_shares]
    if shared:
        pictures.append(
            heat(
                "Which tolerance matters for the drift",
                "Share of each error of the table in the mean square error of the predicted output that the table "
                "causes, over all directions of gravity, by plan. Shares below 0.5 % have no number.",
                [each.plan.name for each in shared],
                list(chain.factors),
                np.array([[100.0 * each.drift_shares[name] for name in chain.factors] for each in shared]),
                "share [%]",
            )
        )
    return pictures
