"""The result of several runs: their verdicts together, and tables by run, by point and by oscillation."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import asdict, replace
from typing import Any

import numpy as np

from inercal.foundation.findings import Finding, Status
from inercal.foundation.records.places import counted, counted_names
from inercal.foundation.results.basis import studied
from inercal.foundation.results.result import Estimate
from inercal.foundation.results.shown import Table, heads, rounded, short
from inercal.systems.aoa.result.outcome import COMMAND, REFERENCES
from inercal.systems.aoa.runs.run_table import Run, RunTable
from inercal.systems.aoa.runs.summary import AtPoint, OscillationRuns
from inercal.systems.aoa.settings import AoaSettings

MODEL = (
    "each run by the fusion or the paper's way; biases of a run are those of the wind-offs before and after it, linear "
    "in time, with a random walk between"
)

_ORDER = (
    Status.NOT_CONVERGED,
    Status.INCONSISTENT,
    Status.UNOBSERVABLE,
    Status.ILL_CONDITIONED,
    Status.SUSPECT,
)
"""Verdicts, the worst first."""


def assemble(
    table: RunTable,
    measured: Sequence[tuple[Run, Estimate, str]],
    at_points: Sequence[AtPoint],
    oscillating: Sequence[OscillationRuns],
    findings: Sequence[Finding],
    settings: AoaSettings,
) -> Estimate:
    """The estimate of a table of runs, each with its own estimate and its tare in words."""
    inputs = dict.fromkeys([table.source, *(source for _, each, _ in measured for source in each.inputs)])
    basis = studied(COMMAND, settings, inputs, MODEL, REFERENCES)
    statuses = [each.status for _, each, _ in measured]
    worst = next((status for status in _ORDER if status in statuses), Status.OK)
    others = [
        f"{run.name} is {each.status.value}" for run, each, _ in measured if each.status is not Status.OK
    ]
    words = f"{counted(len(measured), 'run')}, {counted(len(at_points), 'point')}"
    message = f"{words}; {'; '.join(others)}" if others else words
    own = _named([(run.name, finding) for run, each, _ in measured for finding in each.findings])
    result: dict[str, Any] = {
        "runs": [_row(run, each, tare) for run, each, tare in measured],
        "by_point": [asdict(each) for each in at_points],
        "oscillations": [asdict(each) for each in oscillating],
    }
    return Estimate.without(
        basis, worst, message, findings=[*findings, *own], result=result, beside=("theta",)
    )


def _named(found: Sequence[tuple[str, Finding]]) -> list[Finding]:
    """Findings of runs with the names of their files, the same ones once; what they harm beside the angle is told with
    each run alone."""
    files: dict[Finding, list[str]] = {}
    for name, each in found:
        harm = tuple(one for one in each.harm if one == "theta")
        files.setdefault(replace(each, harm=harm), []).append(name)
    return [
        replace(each, headline=f"{counted_names(list(dict.fromkeys(names)), 4)}: {each.headline}")
        for each, names in files.items()
    ]


def _row(run: Run, estimate: Estimate, tare: str) -> dict[str, Any]:
    """A run in the result."""
    angle = estimate.result["angle"]
    return {
        "file": run.name,
        "role": run.role,
        "tare": tare,
        "status": estimate.status.value,
        "message": estimate.message,
        "points": len(estimate.result["points"]),
        "range": angle["range"],
        "u": angle["u"]["median"],
        "reference": estimate.result.get("reference"),
    }


def tables(estimate: Estimate) -> list[Table]:
    """By run, by point, by oscillation; those with rows."""
    result = estimate.result
    return [
        each for each in (_by_run(result), _by_point(result), _terms(result), _errors(result)) if each.rows
    ]


def _by_run(result: Any) -> Table:
    rows = [
        (
            each["file"],
            each["role"],
            each["status"],
            each["tare"] or "–",
            str(each["points"]),
            *(_fixed(end) for end in each["range"] or (None, None)),
            _deg(each["u"], 2),
        )
        for each in result["runs"]
    ]
    columns = heads("file", "role", "status", "tare of", "points", "lowest [deg]", "highest [deg]", "u [deg]")
    caption = "u is the median of the samples; a tare of two wind-offs is interpolated between them."
    return Table("Runs", caption, columns, tuple(rows), 4)


def _by_point(result: Any) -> Table:
    rows = []
    for each in result["by_point"]:
        theta, u = rounded(math.degrees(each["theta"]), math.degrees(each["u"]))
        apart = each["down"] - each["up"]
        rows.append(
            (
                theta,
                u,
                str(each["runs"]),
                _fixed(each["up"]),
                _fixed(each["down"]),
                _deg(apart, 2),
                _deg(each["u_apart"], 2),
                _deg(each["spread"], 2),
            )
        )
    columns = heads(
        "theta [deg]", "u [deg]", "runs", "up [deg]", "down [deg]", "down - up [deg]", "u of that [deg]",
        "repeats differ by [deg]",
    )  # fmt: skip
    caption = (
        "Points of all runs, those of about the same angle together. The last column is the standard deviation of "
        "repeats."
    )
    return Table("By point", caption, columns, tuple(rows), 0)


def _terms(result: Any) -> Table:
    names = list(dict.fromkeys(name for each in result["oscillations"] for name in each["terms"]))
    rows = [
        (*_of_sine(each), *(_deg(each["terms"].get(name), 2) for name in names))
        for each in result["oscillations"]
    ]
    columns = (
        *heads("amplitude [deg]", "frequency [Hz]", "runs", "peak rate [deg/s]"),
        *((n, "deg") for n in names),
    )
    caption = (
        "Left of the lever-arm terms by each way of the paper, in closed form for the stated noise, at most."
    )
    return Table("By amplitude and frequency: error terms", caption, columns, tuple(rows), 0)


def _errors(result: Any) -> Table:
    names = list(dict.fromkeys(name for each in result["oscillations"] for name in each["errors"]))
    rows = [(name, *(_deg(each["errors"].get(name), 2) for each in result["oscillations"])) for name in names]
    sines = [
        (f"{math.degrees(each['amplitude']):.3g} deg, {each['frequency']:.3g} Hz", "deg")
        for each in result["oscillations"]
    ]
    caption = "Root mean square of the angle less theta_ref, of all repeats."
    return Table("By amplitude and frequency: methods", caption, (("method", ""), *sines), tuple(rows), 1)


def _of_sine(each: Any) -> tuple[str, str, str, str]:
    peak = 2.0 * math.pi * each["frequency"] * math.degrees(each["amplitude"])
    return (
        f"{math.degrees(each['amplitude']):.4g}",
        f"{each['frequency']:.4g}",
        str(each["runs"]),
        f"{peak:.4g}",
    )


def _fixed(value: float | None) -> str:
    """An angle [rad] in degrees to 1e-4; a dash without one."""
    return "–" if value is None or not math.isfinite(value) else f"{math.degrees(value):.4f}"


def _deg(value: float | None, digits: int) -> str:
    """An angle [rad] in degrees; a dash without one."""
    return "–" if value is None or not math.isfinite(value) else short(float(np.degrees(value)), digits)
