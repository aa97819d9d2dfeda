"""Pictures and pages of the turntable: a calibration, a sensitivity analysis, a design of positions."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from inercal.arrays import Array
from inercal.estimate.rounding import rounded
from inercal.instruments.terms import shown_unit
from inercal.records.places import counted
from inercal.report import sensitivity
from inercal.report.figures import budget, correlation, dots, heat
from inercal.report.html import Picture, page
from inercal.report.positions import NUMBERED, hemispheres, plane
from inercal.report.rates import residuals_by_rate
from inercal.report.style import COLOURS, INK, QUIET, WIDTH, figure, plain_unit, svg
from inercal.rigs.chain import Error
from inercal.rigs.outputs import gravity_reference
from inercal.turntable.analysis import result as analysis_result
from inercal.turntable.regression import Regression
from inercal.turntable.weights import weights

if TYPE_CHECKING:
    from inercal.estimate.result import Estimate
    from inercal.turntable.analysis import Analysed
    from inercal.turntable.planning import Designed
    from inercal.turntable.rate_calibration import RateCalibration
    from inercal.turntable.readings import Readings
    from inercal.turntable.settings import TurntableSettings
    from inercal.turntable.task import Calibration


_FLAGS = 12
"""Flagged positions that a page lists."""

_SCOPES = {
    "stated": "as stated",
    "random": "all redrawn at each position",
    "constant": "all constant over the test",
}


def pictures(calibration: Calibration) -> list[Picture]:
    """Draw what there is to see of a calibration.

    Parameters
    ----------
    calibration : Calibration
        Of any status; where the positions do not identify the terms there is one picture, of the positions.
    """
    found, fit, estimate = calibration.readings, calibration.fitting.fit, calibration.shown
    plan = estimate.result["plan"]["name"]
    if fit is None:
        directions = gravity_reference() @ calibration.fitting.model.chain.attitude(found.angles)
        return [_positions(found, directions, None, plan)]
    directions = gravity_reference() @ fit.model.chain.attitude(found.angles)
    factor, alone = found.unit.factor, estimate.u / calibration.estimate.u
    return [
        _residuals(found, fit),
        _positions(found, directions, fit.residuals / factor, plan),
        correlation(estimate),
        budget(estimate),
        *_tolerances(estimate, alone),
    ]


def rate_pictures(calibration: RateCalibration) -> list[Picture]:
    """Draw what there is to see of a rate test; nothing where no gyro could be fitted."""
    estimate = calibration.shown
    if not estimate.names:
        return []
    return [residuals_by_rate(estimate.result["rates"]), correlation(estimate), budget(estimate)]


def _residuals(found: Readings, fit: Regression) -> Picture:
    """Residual of each reading, with what noise and table explain."""
    factor, n = found.unit.factor, len(found.y)
    few = n <= NUMBERED
    weight = weights(fit.model, fit.angles, fit.c, fit.noise, samples=fit.samples)
    band = weight.std / factor
    numbers = np.arange(1, n + 1)
    with figure(WIDTH, 0.5 + 1.5 * len(found.channels)) as drawing:
        panels = drawing.subplots(len(found.channels), 1, sharex=True, squeeze=False)[:, 0]
        for k, (axes, channel) in enumerate(zip(panels, found.channels, strict=True)):
            edges = np.append(numbers - 0.5, n + 0.5)
            axes.stairs(
                band[:, k], edges, baseline=-band[:, k], fill=True, color=COLOURS[0], alpha=0.15, lw=0
            )
            axes.axhline(0.0, color=QUIET, lw=0.6)
            residuals = fit.residuals[:, k] / factor
            axes.plot(numbers, residuals, "o", ms=4 if few else 1.5, color=COLOURS[0])
            if few:
                axes.errorbar(
                    numbers, residuals, fit.noise[k] / factor, fmt="none", ecolor=INK, elinewidth=0.7
                )
            axes.set_ylabel(f"{channel} [{plain_unit(found.unit.symbol)}]")
            axes.margins(x=0.01)
            axes.grid(axis="y")
        panels[-1].set_xlabel("position")
        drawn = svg(drawing)
    bars = "Bars: ± one standard deviation of the noise. " if few else ""
    rms = ", ".join(
        f"{channel} {value:.2g} {plain_unit(found.unit.symbol)}"
        for channel, value in zip(
            found.channels, np.sqrt(np.mean(np.square(fit.residuals), axis=0)) / factor, strict=True
        )
    )
    return Picture(
        "Residual of each position",
        f"Reading less the fitted model at the commanded angles. {bars}Band: ± one standard deviation of noise and "
        "errors of the table together. The fit draws the residuals towards zero: "
        f"{counted(n, 'position')} of {counted(len(found.channels), 'channel')} leave "
        f"{counted(fit.dof, 'degree')} of freedom. Root mean square: {rms}.",
        drawn,
    )


def _positions(found: Readings, directions: Array, residuals: Array | None, plan: str) -> Picture:
    """Where gravity points to on the instrument, coloured by residual (n, c) where there is one."""
    rows = found.channels if residuals is not None else ("",)
    with figure(WIDTH, 3.2 * len(rows)) as drawing:
        panels = drawing.subplots(len(rows), 2, squeeze=False)
        for k, channel in enumerate(rows):
            label = f"residual of {channel} [{plain_unit(found.unit.symbol)}]"
            hemispheres(panels[k], directions, None if residuals is None else residuals[:, k], label)
        drawn = svg(drawing)
    coloured = "" if residuals is None else ", coloured by residual"
    return Picture(
        "Positions",
        f"Direction of gravity on the axes of the instrument in each of the {len(found.y)} positions ({plan}), on two "
        f"hemispheres seen along −z (equal-area projection; circles at 30° and 60° from the pole){coloured}. Numbers "
        "count the positions in order; near ones share a label.",
        drawn,
    )


def _tolerances(estimate: Estimate, factor: Array) -> list[Picture]:
    """What each tolerance of the table does; ``factor`` (p,) takes uncertainties from SI to the shown units."""
    given, names = estimate.result, estimate.names
    factors = list(given["halved"])
    if not factors:
        return []
    rows = {name: given["tolerance_shares"].get(name, {}) for name in names}
    if given["drift_shares"]:
        rows["output"] = given["drift_shares"]
    shares = np.array([[row.get(each, 0.0) for each in factors] for row in rows.values()])
    gains = np.array([[1.0 - given["halved"][each][name] for each in factors] for name in names])
    scopes = {
        words: factor * [given["scopes"][key][name] for name in names] for key, words in _SCOPES.items()
    }
    drift = (
        " The last row is the predicted output as a whole, its mean square error over all directions of gravity."
        if given["drift_shares"]
        else ""
    )
    return [
        heat(
            "Which tolerance matters for which coefficient",
            "Share of each error of the table in the part of the variance of a coefficient that the table causes. "
            f"Shares below 0.5 % have no number.{drift}",
            list(rows),
            factors,
            100.0 * shares,
            "share [%]",
        ),
        heat(
            "What halving a tolerance brings",
            "How much smaller the standard uncertainty u of a coefficient were, all sources counted, if that one "
            "error of the table were half as large. Reductions below 0.5 % have no number.",
            names,
            factors,
            100.0 * gains,
            "reduction of u [%]",
        ),
        dots(
            "What the scopes mean",
            "Standard uncertainty of noise and table together, for errors of the table as stated, if all were redrawn "
            "at each position, and if all kept one value over the test: those that are redrawn average out over the "
            "positions, constant ones do not, but pull at some coefficients only.",
            names,
            estimate.units,
            scopes,
        ),
    ]


def sensitivity_page(analysed: Analysed, settings: TurntableSettings, estimate: Estimate) -> str:
    """The report of a sensitivity analysis as one self-contained HTML page."""
    indices = analysed.indices
    drawn = [
        sensitivity.ranking(indices, analysed.aggregate),
        sensitivity.mean_indices(indices, analysed.mean),
        sensitivity.maps(indices, analysed.joints, analysed.flagged),
        sensitivity.interactions(indices, analysed.mean, analysed.weighted),
    ]
    order = np.argsort(-np.nan_to_num(analysed.aggregate.total), kind="stable")
    worst = sorted(analysed.flagged, key=lambda flag: flag.sum_first)
    found = analysis_result(analysed)
    return page(
        "sensitivity.html",
        estimate,
        "Sensitivity of a turntable",
        note=analysed.note,
        facts=[
            *_rig_facts(settings),
            ("positions", "", f"{settings.plan.name} ({counted(len(settings.plan), 'position')})"),
            ("method", "", _method_words(indices.method)),
            ("outputs", "", ", ".join(indices.outputs)),
        ],
        factors=_factor_rows(settings.chain.errors),
        ranking=[
            (
                indices.factors[k],
                analysed.what[k],
                float(analysed.aggregate.first[k]),
                float(analysed.aggregate.total[k]),
                float(analysed.aggregate.total_minus_first[k]),
            )
            for k in order
        ],
        pictures=[picture for picture in drawn if picture is not None],
        flagged=_flag_counts(analysed),
        sampled=indices.u_first is not None,
        joints=analysed.joints,
        worst=[(flag.output, np.degrees(flag.angles).tolist(), flag.sum_first) for flag in worst[:_FLAGS]],
        outputs=indices.outputs,
        names=indices.factors,
        tables=[
            (title, np.asarray(found[kind][key]).tolist())
            for kind, words in (("mean", "mean over the positions"), ("weighted", "weighted by variance"))
            for key, title in (
                ("first", f"First order S, {words}"),
                ("total", f"Total order ST, {words}"),
                ("total_minus_first", f"Interactions ST − S, {words}"),
                ("shapley", f"Shapley effects, {words}"),
            )
            if key in found[kind]
        ],
    )


def _flag_counts(analysed: Analysed) -> list[tuple[str, int]]:
    """How many positions are flagged by output."""
    outputs = [flag.output for flag in analysed.flagged]
    return [(name, outputs.count(name)) for name in analysed.indices.outputs if name in outputs]


def design_page(designed: Designed, settings: TurntableSettings, estimate: Estimate) -> str:
    """The report of a search for positions as one self-contained HTML page."""
    judged, unit = designed.judged, designed.unit
    names, shown = list(designed.units), [shown_unit(text, unit) for text in designed.units.values()]
    units, scale = [text for text, _ in shown], np.array([size for _, size in shown])
    u = [
        np.array([dict(zip(each.names, each.figures.u, strict=True)).get(name, np.nan) for name in names])
        / scale
        for each in judged
    ]
    return page(
        "design.html",
        estimate,
        "Positions for a turntable test",
        facts=[
            *_rig_facts(settings),
            ("instrument", "", f"{settings.instrument.kind}, {', '.join(names)}"),
        ],
        factors=_factor_rows(settings.chain.errors),
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
    designed: Designed,
    settings: TurntableSettings,
    names: Sequence[str],
    units: Sequence[str],
    u: list[Array],
) -> list[Picture]:
    """The chosen positions, the uncertainties by plan, and where they come from."""
    angles, chain = designed.plan.angles, settings.chain
    with figure(WIDTH, 3.2) as drawing:
        hemispheres(drawing.subplots(1, 2), gravity_reference() @ chain.attitude(angles))
        sphere = svg(drawing)
    drawn = [
        Picture(
            "Positions chosen",
            f"Direction of gravity on the axes of the instrument in the {len(angles)} positions, on two hemispheres "
            "seen along −z (equal-area projection; circles at 30° and 60° from the pole). Numbers as in the list of "
            "positions; near ones share a label.",
            sphere,
        )
    ]
    if len(chain.joints) == 2:
        with figure(WIDTH, 3.4) as drawing:
            plane(drawing.subplots(), angles, chain.joints)
            drawn.append(Picture("Angles of the table", "The same positions over both angles.", svg(drawing)))
    drawn.append(
        dots(
            "Uncertainties by plan",
            "Standard uncertainty of each coefficient that noise and errors of the table make expect. A plan that does "
            "not identify a term, or takes it as stated, has no mark there.",
            names,
            units,
            {each.plan.name: values for each, values in zip(designed.judged, u, strict=True)},
        )
    )
    shared = [each for each in designed.judged if each.drift_shares]
    if shared:
        drawn.append(
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
    return drawn


def _rig_facts(settings: TurntableSettings) -> list[tuple[str, str, str]]:
    """Rig and site, as name, unit and text."""
    site = settings.site
    facts = [("rig", "", settings.rig.replace("_", " ")), ("gravity", "m/s²", f"{site.gravity:.7g}")]
    if site.latitude is not None:
        u = f" (u {np.degrees(site.latitude_u):.2g}°)" if site.latitude_u else ""
        facts.append(("latitude", "", f"{np.degrees(site.latitude):.6g}°{u}"))
    return facts


def _method_words(method: Mapping[str, Any]) -> str:
    """How the indices were computed."""
    others = ", ".join(f"{key} {value}" for key, value in method.items() if key != "name")
    return f"{method['name']} ({others})" if others else str(method["name"])


def _factor_rows(errors: Sequence[Error]) -> list[tuple[str, str, str, str, str]]:
    """Name, words, distribution, size and scope of the errors of a table."""
    return [
        (
            error.name,
            error.what,
            error.distribution.kind.replace("_", "-"),
            _size(error),
            error.scope.value,
        )
        for error in errors
    ]


def _size(error: Error) -> str:
    """Size of an error in a unit of its magnitude: half width with ±, else one standard deviation."""
    size = error.distribution.size
    sign = "± " if error.distribution.kind in ("uniform", "triangular", "two_point") else "σ = "
    if error.is_offset:
        return f"{sign}{1e3 * size:.3g} mm"
    arcmin = float(np.degrees(size)) * 60.0
    if arcmin >= 60.0:
        return f"{sign}{arcmin / 60.0:.3g}°"
    return f"{sign}{arcmin:.3g} arcmin" if arcmin >= 0.9995 else f"{sign}{60.0 * arcmin:.3g} arcsec"
