"""Tables of the result of a calibration from sections: sections, moves, the budget, and poses and turns of a hand."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from inercal.foundation.results.budget import BudgetItem
from inercal.systems.imu.sections.calibration import SectionCalibration
from inercal.systems.imu.sections.cutting.proposal import Proposal
from inercal.systems.imu.sections.moves import MoveRows
from inercal.systems.imu.sections.with_moves import verticals_of


def of_moves(proposal: Proposal) -> list[Mapping[str, Any]]:
    """One row for each move."""
    return [{"section": one.name, "kind": "move", "where": one.where, "why": ""} for one in proposal.moves]


def relative_alignment(found: SectionCalibration) -> list[Mapping[str, Any]]:
    """T - M, which says how the axes of the gyro lie to those of the accelerometers, and which navigation needs."""
    names, values, covariance = found.relative_alignment()
    u = np.sqrt(np.diag(covariance))
    return [
        {"term": name, "value_rad": float(value), "u_rad": float(size)}
        for name, value, size in zip(names, values, u, strict=True)
    ]


def budget_items(found: SectionCalibration, source: str, share: Mapping[str, float]) -> list[BudgetItem]:
    """Lines of the budget by a source; gravity has one for each input of the site, such as its latitude."""
    if source != "gravity":
        return [_item(found, source, share)]
    inputs = found.problem.priors.site.inputs
    parts = {one: (one.u * one.sensitivity) ** 2 for one in inputs if one.u * one.sensitivity}
    whole = sum(parts.values())
    return [
        BudgetItem(
            one.source, "B", one.u, one.unit, {name: size * part / whole for name, size in share.items()}
        )
        for one, part in parts.items()
    ]


def _item(found: SectionCalibration, source: str, share: Mapping[str, float]) -> BudgetItem:
    """The line of the budget by a source."""
    noise = {"noise of the accelerometers": ("acc", "m/s^2"), "noise of the gyro": ("gyro", "rad/s")}
    if source in noise:
        sensor, unit = noise[source]
        return BudgetItem(source, "A", found.noise.get(sensor, 0.0), unit, share, True)
    if source == "placing" and "placing" in found.scatter:
        return BudgetItem(source, "A", found.scatter["placing"], "rad", share, True)
    problem = found.problem
    sds = [float(problem.sd[p]) for p in np.flatnonzero(problem.free) if problem.source(int(p)) == source]
    u = max((sd for sd in sds if math.isfinite(sd)), default=0.0)
    units = {
        "earth rate": "rad/s",
        "earth rate, level part": "rad/s",
        "angles and rates": "rad/s",
    }
    units |= {"K2 of the accelerometers": "1/(m/s^2)", "g-sensitivity of the gyro": "(rad/s)/(m/s^2)"}
    angles = ("mounting", "placing", "axes", "prior of M", "prior of T")
    return BudgetItem(source, "B", u, units.get(source, "rad" if source in angles else "1"), share)


def of_sections(found: SectionCalibration) -> list[Mapping[str, Any]]:
    """One row for each section: what it is, what the fit leaves of it in its noise, how far it lies off its place."""
    rows: list[Mapping[str, Any]] = []
    readings = found.problem.readings
    for k, section in enumerate(readings.sections):
        row: dict[str, Any] = {
            "section": section.name,
            "kind": section.kind,
            "where": section.where,
            "why": section.why,
        }
        for sensor, kind in (("acc", 0), ("gyro", 2)):
            seen = readings.seen[k, kind]
            if seen.any():
                row[f"{sensor}_residual"] = float(np.sqrt(np.mean(found.residuals[k, kind][seen] ** 2)))
        row["off_its_place_rad"] = float(found.placed[k].max())
        rows.append(row)
    return rows


def of_poses(found: SectionCalibration, proposal: Proposal) -> list[Mapping[str, Any]]:
    """One row for each pose of a hand: its times, its direction, and what the fit leaves of the size of its force."""
    up, rows = verticals_of(found), {row.section: row for row in proposal.rows}
    scale = np.array([found.value(f"K1_{axis}")[0] for axis in "xyz"])
    left = np.sum(found.residuals[:, 0] / scale * up, axis=1)
    return [
        {
            "pose": int(section.name.split()[1]),
            "start_s": rows[section.name].begin,
            "end_s": rows[section.name].end,
            "direction": direction,
            "residual_m_s2": float(residual),
        }
        for section, direction, residual in zip(found.problem.readings.sections, up, left, strict=True)
        if section.acc is not None
    ]


def of_turns(found: SectionCalibration) -> list[Mapping[str, Any]]:
    """One row for each move between poses that counts: its times, and the angle by which it misses the next pose."""
    rows: list[Mapping[str, Any]] = []
    sections = found.problem.readings.sections
    for extra in found.problem.extras:
        assert isinstance(extra, MoveRows)
        (block,) = extra.blocks(found.problem, found.point)
        for move, miss in zip(extra.moves, np.linalg.norm(block.residual[:, :2], axis=1), strict=True):
            rows.append(
                {
                    "from_pose": int(sections[move.first].name.split()[1]),
                    "start_s": float(move.t[0]),
                    "duration_s": move.duration,
                    "miss_rad": float(miss),
                }
            )
    return rows
