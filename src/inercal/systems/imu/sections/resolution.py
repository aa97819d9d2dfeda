"""Steps of a gyro's output that hide its noise at rest: every rest is rounded alike, and its scatter shows nothing."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Final

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.systems.imu.sections.calibration import SectionCalibration

SOURCE: Final = "gyro resolution"
"""Its name in budgets."""


def with_resolution(found: SectionCalibration, steps: Array) -> SectionCalibration:
    """The calibration with step/sqrt(12) in u of the biases, of ``steps`` (3,) [output] (GUM F.2.2.1)."""
    names = [f"D_F_{axis}" for axis in "xyz"]
    at = [k for k, name in enumerate(names) if name in found.names and steps[k] > 0.0]
    if not at:
        return found
    places = [found.names.index(names[k]) for k in at]
    added = np.zeros(len(found.names))
    added[places] = steps[at] ** 2 / 12.0
    variance = found.u**2 + added
    kept = found.u**2 / variance
    budget = {source: share * kept for source, share in found.budget.items()}
    return replace(
        found,
        u=np.sqrt(variance),
        U=found.U / np.sqrt(kept),
        covariance=found.covariance + np.diag(added),
        budget={**budget, SOURCE: 1.0 - kept},
    )


def resolution_finding(steps: Array, unit: str) -> Iterator[Finding]:
    """A finding where any of the ``steps`` (3,) in the ``unit`` of the gyro hides its noise."""
    if np.any(steps > 0.0):
        yield Finding(
            "resolution",
            "The noise of the gyro at rest is below half a step of its output, which hides it.",
            action="Set a smaller range of the gyro, which has finer steps.",
            items=tuple(
                {"axis": axis, f"step [{unit}]": float(step)}
                for axis, step in zip("xyz", steps, strict=True)
                if step > 0.0
            ),
        )
