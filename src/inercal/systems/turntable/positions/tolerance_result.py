"""Tolerances from a goal, for people and programs: what each costs and what it buys."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from inercal.foundation.designs.tolerances import LOOSEST, TIGHTEST
from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.results.shown import aligned
from inercal.systems.turntable.display import per_g
from inercal.systems.turntable.positions.fit import earth_rate_of
from inercal.systems.turntable.positions.outcome import unit_of_term
from inercal.systems.turntable.positions.tolerance_design import ToleranceDesign
from inercal.systems.turntable.settings import DRIFT, TurntableSettings


def result(designed: ToleranceDesign, settings: TurntableSettings) -> dict[str, Any]:
    """The command's part of the JSON result.

    ``tolerances``: for each error its present and wanted size, what both cost, its ``share`` in the variance of each
    goal, and ``kept_present``: u of the worst goal over its goal, were this one tolerance left as it is. ``goals``: u
    wanted and reached, and by the present tolerances. ``compare``: cost by plan, null where the goals are not reached.
    """
    trial, x, unit = designed.best.test, designed.x, settings.instrument.unit.si
    noise, inputs, errors = trial.parts(x)
    whole = noise + inputs.sum(axis=1) + errors @ np.square(x)
    of_error = errors * np.square(x)
    present = np.sqrt(trial.ratios(np.ones(len(x))).at(np.ones(len(x))))
    names = list(designed.goal)
    return {
        "positions": np.tile(trial.plan.angles, (trial.repeats, 1)).tolist(),
        "plan": trial.plan.name,
        "repeats": trial.repeats,
        "earth_rate": earth_rate_of(trial.model),
        "cost": designed.best.cost,
        "present_cost": designed.present_cost,
        "tolerances": [
            {
                "error": error.name,
                "distribution": error.distribution.kind,
                "scope": error.scope.value,
                "present": error.distribution.size,
                "wanted": error.distribution.size * float(x[k]),
                "unit": "m" if error.is_offset else "rad",
                "factor": float(x[k]),
                "present_cost": price.at(1.0),
                "cost": price.at(float(x[k])),
                "share": dict(zip(names, (of_error[:, k] / whole).tolist(), strict=True)),
                "kept_present": _with_one_present(designed, k),
            }
            for k, (error, price) in enumerate(zip(trial.model.chain.errors, designed.prices, strict=True))
        ],
        "goals": [
            {
                "name": name,
                "unit": unit if name == DRIFT else unit_of_term(name, unit),
                "wanted": wanted,
                "u": wanted * float(np.sqrt(whole[j])),
                "u_present": wanted * float(present[j]),
                "share_of_noise": float(noise[j] / whole[j]),
                "share_of_inputs": dict(zip(trial.inputs, (inputs[j] / whole[j]).tolist(), strict=True)),
            }
            for j, (name, wanted) in enumerate(designed.goal.items())
        ],
        "compare": [
            {
                "name": each.test.plan.name,
                "positions": each.test.positions,
                "repeats": each.test.repeats,
                "cost": None if each.x is None else each.cost,
            }
            for each in designed.tried
        ],
    }


def _with_one_present(designed: ToleranceDesign, k: int) -> float:
    """The largest u over its goal with one tolerance as it is now, all others as found."""
    x = designed.x.copy()
    x[k] = 1.0
    return float(np.sqrt(designed.best.test.ratios(x).at(x).max()))


def table(made: dict[str, Any], settings: TurntableSettings) -> str:
    """Tolerances, goals and plans as aligned text."""
    rows = [("", "present", "wanted", "x", "cost", "present cost", "largest share", "u/goal, kept")]
    for each in made["tolerances"]:
        goal, share = max(each["share"].items(), key=lambda item: item[1])
        rows.append(
            (
                each["error"],
                size_text(each["present"], each["unit"]),
                size_text(each["wanted"], each["unit"]),
                factor_text(each["factor"]),
                f"{each['cost']:.3g}",
                f"{each['present_cost']:.3g}",
                f"{100.0 * share:.0f} % of {goal}" if share >= 0.005 else "–",
                f"{each['kept_present']:.2f}",
            )
        )
    goals: list[tuple[str, ...]] = [("", "wanted", "u", "now", "unit", "by noise")]
    goals += [
        (*goal_texts(each, settings), f"{100.0 * each['share_of_noise']:.0f} %") for each in made["goals"]
    ]
    plans = [("", "positions", "cost")]
    plans += [
        (
            each["name"],
            str(each["positions"]),
            "not reached" if each["cost"] is None else f"{each['cost']:.4g}",
        )
        for each in made["compare"]
    ]
    return "\n\n".join("\n".join(aligned(each)) for each in (rows, goals, plans))


def goal_texts(goal: Mapping[str, Any], settings: TurntableSettings) -> tuple[str, ...]:
    """Name of a goal; wanted u, u, and u by the present tolerances, in a unit for people; that unit."""
    shown = shown_unit(goal["unit"], settings.instrument.unit)
    text, size = per_g(goal["name"], *shown, settings.site.gravity)
    return (goal["name"], *(f"{goal[key] / size:.4g}" for key in ("wanted", "u", "u_present")), text)


def factor_text(x: float) -> str:
    """A factor on the present tolerance; its ends in words."""
    if math.isclose(x, LOOSEST, rel_tol=1e-3):
        return f"{LOOSEST:.0f} or more"
    return f"{TIGHTEST:g} or less" if math.isclose(x, TIGHTEST, rel_tol=1e-3) else f"{x:.3g}"


def size_text(size: float, unit: str) -> str:
    """A tolerance in a unit of its magnitude."""
    return "{:.3g} {}".format(*_in_unit(size, unit))


def _in_unit(size: float, unit: str) -> tuple[float, str]:
    """A size in arcsec, arcmin, deg or um, by its magnitude."""
    if unit == "m":
        return 1e6 * size, "um"
    arcsec = math.degrees(size) * 3600.0
    for text, many in (("deg", 3600.0), ("arcmin", 60.0)):
        if arcsec >= many * (1.0 - 1e-9):
            return arcsec / many, text
    return arcsec, "arcsec"


def study_tables(designed: ToleranceDesign) -> str:
    """The tolerances and the plan as tables of a study."""
    trial = designed.best.test
    lines = [f"# {designed.message}", "[rig.errors]"]
    for error, by in zip(trial.model.chain.errors, designed.x.tolist(), strict=True):
        value, unit = _in_unit(error.distribution.size * by, "m" if error.is_offset else "rad")
        lines.append(
            f'{error.name} = {{ {error.distribution.kind} = "{value:.6g} {unit}", scope = "{error.scope.value}" }}'
        )
    positions = ", ".join(
        "[" + ", ".join(f'"{math.degrees(angle):.10g} deg"' for angle in row) + "]"
        for row in np.tile(trial.plan.angles, (trial.repeats, 1))
    )
    return "\n".join([*lines, "", "[positions]", f"list = [{positions}]", ""])
