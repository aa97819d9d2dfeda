"""Effects that are no unknowns of a calibration, looked for in what it leaves: trends, drifts over turns, larger K2."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import fdtrc

from inercal.foundation.arrays import Array
from inercal.foundation.findings import Finding
from inercal.foundation.results.shown import rounded
from inercal.foundation.units import parse_unit
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.sections.arrow import ArrowSolution, Linear
from inercal.systems.imu.sections.calibration import SectionCalibration
from inercal.systems.imu.sections.cutting.cut import ENDS
from inercal.systems.imu.sections.outputs import rows
from inercal.systems.imu.sections.unknowns import D_F, K0, K1, S


@dataclass(frozen=True, eq=False)
class _Told:
    """Test of ``effects`` (k, c, 9) on the means of a calibration.

    ``probability`` is that of such by chance, ``sizes`` (k,) are theirs, with their ``u`` (k,).
    """

    effects: Array
    probability: float
    sizes: Array
    u: Array


class _Left:
    """Residuals of the means of a calibration, at the likeliest variances."""

    def __init__(self, found: SectionCalibration) -> None:
        self.found = found
        self.linear = Linear(found.problem, found.point.x, rows(found.problem, found.point))
        self.z = np.log([found.scatter[name] for name in found.problem.sizes])
        self.best: ArrowSolution = self.linear.at(self.z)

    def told(self, effects: Array) -> _Told:
        """The test of effects (k, c, 9); they count as chance where hardly anything tells of them."""
        scores, information = self.linear.scores(self.z, self.best, effects)
        count, freedom = len(effects), self.found.freedom - len(effects)
        scale = np.sqrt(np.maximum(np.diag(information), 1e-300))
        if freedom < LIMITS.outlier_dof or np.linalg.cond(information / np.outer(scale, scale)) > 1e8:
            return _Told(effects, 1.0, np.zeros(count), np.zeros(count))
        inverse = np.linalg.inv(information)
        sizes = inverse @ scores
        gained = float(scores @ sizes)
        left = max(self.best.chi2 - gained, 1e-300) / freedom
        if not self.found.problem.on:  # all noise is stated
            left = max(left, 1.0)
        probability = float(fdtrc(count, freedom, gained / count / left))
        return _Told(effects, probability, sizes, np.sqrt(np.diag(inverse) * left))

    def harmed(self, told: _Told) -> tuple[str, ...]:
        """Coefficients that the effects shift by more than their u."""
        whole = np.tensordot(told.sizes, told.effects, axes=1)[None]
        shift = np.abs(self.linear.displaced(self.z, self.best, whole)[0])
        return tuple(
            name
            for name, change, u in zip(
                self.found.names, shift[: len(self.found.u)], self.found.u, strict=True
            )
            if change > u
        )


def effects_of(found: SectionCalibration, *, in_order: bool) -> Iterator[Finding]:
    """Findings about effects that show; of trends where sections were taken ``in_order``."""
    if found.converged and not found.problem.extras:
        yield from _of_k2(found)
        yield from _of_ends(found)
        if in_order:
            yield from _of_order(found)


def _of_order(found: SectionCalibration) -> Iterator[Finding]:
    """The trend of a gyro that shows most, at `LIMITS.driver_probability`, where sections were taken in their order.

    A bias that changes evenly shifts each output of a section; a scale factor, or the rate of a table, all of them in
    proportion.
    """
    readings = found.problem.readings
    if not readings.seen[:, 2].any():
        return
    number = np.arange(len(readings.sections), dtype=float)
    passed = (number - number.mean()) / max(number[-1], 1.0)
    left = _Left(found)
    of_scale = np.zeros((1, len(number), 9))
    turned = readings.seen[:, 2] & (readings.rate != 0.0)[:, None]
    of_scale[0, :, 6:] = passed[:, None] * np.where(turned, readings.y[:, 2] - found.point.x[D_F], 0.0)
    by_bias, by_scale = left.told(_of_biases(passed)), left.told(of_scale)
    if min(by_bias.probability, by_scale.probability) >= LIMITS.driver_probability:
        return
    if by_bias.probability <= by_scale.probability:
        yield Finding(
            "trend",
            "The biases drift from the first to the last section.",
            harm=left.harmed(by_bias),
            action="Wait until the gyro is warm, or take the sections in an order that tells, there and back.",
            items=_drifts(found, by_bias),
        )
    else:
        words = " ± ".join(rounded(1e6 * float(by_scale.sizes[0]), 1e6 * float(by_scale.u[0])))
        yield Finding(
            "trend",
            f"The rate or the scale factors change by {words} ppm from the first to the last section.",
            harm=left.harmed(by_scale),
            action="Let table and gyro get warm, and check the rate at the end.",
        )


def _of_ends(found: SectionCalibration) -> Iterator[Finding]:
    """A drift of the biases of a gyro that is alike in all turns, from the rests before them to those after.

    It leaves S and T as they are, but which bias is D_F is open by half of it.
    """
    sections = found.problem.readings.sections
    turns = {section.name for section in sections if section.kind == "turn"}
    before, after = (
        np.array([s.name.endswith(end) and s.name.removesuffix(end) in turns for s in sections])
        for end in ENDS
    )
    if not before.any():
        return
    told = _Left(found).told(_of_biases(0.5 * (after.astype(float) - before)))
    if told.probability < LIMITS.driver_probability:
        halves = zip([f"D_F_{axis}" for axis in "xyz"], 0.5 * np.abs(told.sizes), strict=True)
        yield Finding(
            "bias_drift",
            "The output at rest drifts alike in all turns, from before to after.",
            harm=tuple(name for name, half in halves if half > found.value(name)[1]),
            action="Wait until the gyro is warm.",
            items=_drifts(found, told),
        )


def _of_k2(found: SectionCalibration) -> Iterator[Finding]:
    """Second-order coefficients of the accelerometers that are larger than what was known of them, at
    `LIMITS.k2_probability`, where |f| = g in unknown directions tells them."""
    readings, x = found.problem.readings, found.point.x
    seen = readings.seen[:, 0]
    if not seen.all(axis=1).any() or readings.know_up.any() or found.problem.priors.k2 == np.inf:
        return
    effects = np.zeros((3, len(seen), 9))
    along = np.where(seen, (readings.y[:, 0] - x[K0]) / x[K1], 0.0)
    effects[range(3), :, range(3)] = (x[K1] * along**2).T
    left = _Left(found)
    told = left.told(effects)
    if told.probability < LIMITS.k2_probability:
        unit = parse_unit("ug/g^2").factor
        yield Finding(
            "unmodelled_k2",
            "Second-order coefficients of the accelerometers are larger than what was known of them.",
            harm=left.harmed(told),
            action="Set imu.k2 = true, or state their u.",
            items=tuple(
                {"accelerometer": axis, "beyond [ug/g^2]": " ± ".join(rounded(size / unit, u / unit))}
                for axis, size, u in zip("xyz", told.sizes, told.u, strict=True)
            ),
        )


def _of_biases(share: Array) -> Array:
    """The effect (3, n, 9) of the biases of a gyro that change by a share (n,) of a size for each."""
    effects = np.zeros((3, len(share), 9))
    effects[range(3), :, range(6, 9)] = share
    return effects


def _drifts(found: SectionCalibration, told: _Told) -> tuple[dict[str, str], ...]:
    """Drifts of the biases of a gyro in rows."""
    per_hour = np.degrees(3600.0) / np.abs(found.point.x[S])
    values = zip("xyz", told.sizes * per_hour, told.u * per_hour, strict=True)
    return tuple({"gyro": axis, "drift [deg/h]": " ± ".join(rounded(size, u))} for axis, size, u in values)
