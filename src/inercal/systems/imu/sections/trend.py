"""Trends over sections in order: biases or scale factors of the gyro that change from the first to the last."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from scipy.special import fdtrc

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.results.shown import rounded
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.sections.arrow import ArrowSolution, Linear
from inercal.systems.imu.sections.calibration import SectionCalibration
from inercal.systems.imu.sections.outputs import rows
from inercal.systems.imu.sections.unknowns import D_F


def trend_findings(found: SectionCalibration) -> Iterator[Finding]:
    """The trend that shows most, at `LIMITS.driver_probability`, where sections were taken in their order.

    A bias that changes evenly shifts each output of a section; a scale factor, or the rate of a table, all of them in
    proportion.
    """
    readings, point = found.problem.readings, found.point
    seen = readings.seen[:, 2]
    if not found.converged or not seen.any():
        return
    linear = Linear(found.problem, point.x, rows(found.problem, point))
    z = np.log([found.scatter[name] for name in found.problem.sizes])
    best = linear.at(z)
    number = np.arange(len(seen), dtype=float)
    passed = (number - number.mean()) / max(number[-1], 1.0)
    of_bias = np.zeros((3, len(seen), 9))
    of_bias[range(3), :, range(6, 9)] = passed
    of_scale = np.zeros((1, len(seen), 9))
    turned = np.where(readings.rate[:, None] != 0.0, readings.y[:, 2] - point.x[D_F], 0.0)
    of_scale[0, :, 6:] = passed[:, None] * np.where(seen, turned, 0.0)
    by_bias, by_scale = (_told(linear, z, best, effects, found.freedom) for effects in (of_bias, of_scale))
    if min(by_bias[0], by_scale[0]) >= LIMITS.driver_probability:
        return
    _, size, u = min(by_bias, by_scale, key=lambda told: told[0])
    if len(size) == 3:
        gain = np.array(
            [found.value(f"S_{axis}")[0] if f"S_{axis}" in found.names else np.nan for axis in "xyz"]
        )
        told = zip(
            "xyz", np.degrees(size / gain) * 3600.0, np.degrees(u / np.abs(gain)) * 3600.0, strict=True
        )
        headline = "The biases drift from the first to the last section."
        action = "Wait until the gyro is warm, or take the sections in an order that tells, there and back."
        items = tuple({"gyro": axis, "drift [deg/h]": " ± ".join(rounded(v, s))} for axis, v, s in told)
    else:
        words = " ± ".join(rounded(1e6 * float(size[0]), 1e6 * float(u[0])))
        headline = f"The rate or the scale factors change by {words} ppm from the first to the last section."
        action = "Let table and gyro get warm, and check the rate at the end."
        items = ()
    effects = of_bias if len(size) == 3 else of_scale
    shift = np.abs(
        linear.displaced(z, best, np.tensordot(size, effects, axes=1)[None])[0][: len(found.names)]
    )
    harm = tuple(name for name, change, own in zip(found.names, shift, found.u, strict=True) if change > own)
    yield Finding("trend", headline, harm=harm, action=action, items=items)


def _told(
    linear: Linear, z: Array, best: ArrowSolution, effects: Array, freedom: float
) -> tuple[float, Array, Array]:
    """Probability of such effects by chance, their sizes (k,) and the u of these."""
    scores, information = linear.scores(z, best, effects)
    count, none = len(effects), np.zeros(len(effects))
    scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
    if freedom - count < LIMITS.outlier_dof or np.linalg.cond(information / np.outer(scale, scale)) > 1e8:
        return 1.0, none, none
    inverse = np.linalg.inv(information)
    size = inverse @ scores
    gained = float(scores @ size)
    left = max(best.chi2 - gained, 1e-300) / (freedom - count)
    return float(fdtrc(count, freedom - count, gained / count / left)), size, np.sqrt(np.diag(inverse) * left)
