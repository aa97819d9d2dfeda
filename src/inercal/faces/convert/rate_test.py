"""Gyros that were calibrated by a rate test, in use: asymmetry, polynomial and misalignments undone."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from inercal.faces.convert.correction import Correction, Samples, factor_of, one_clock, range_of, widened
from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import Unit, parse_unit

_ROUNDS = 30

_APPLIED = ("D_F", "S", "S_asym", "S2", "S3")


@dataclass(frozen=True)
class RateGyros:
    """Gyros by axis i, ``y = D_F + S (x + S_asym |x|/2 + S2 x^2 + S3 x^3 + T_ij w_j + T_ik w_k)``.

    x is the rate about the axis of each, w those about the others, as far as a record has them.
    ``values`` (*batch,) by symbol, ``output`` the unit of y, ``rates`` (lowest, highest) of the test [rad/s].
    """

    axes: str
    values: Mapping[str, Any]
    output: Unit
    rates: tuple[float, float]

    def correction(self, record: Record, invert: bool = False) -> Correction:
        """The correction of a record: ``gyro_*`` to ``rate_*`` [rad/s], or the other way round; raises `InputError`."""
        si = parse_unit("rad/s")
        before, after = ("rate", "gyro") if invert else ("gyro", "rate")
        present = [axis for axis in self.axes if f"{before}_{axis}" in record]
        if not present:
            where = ", ".join(source.path for source in record.sources) or "record"
            names = ", ".join(record.columns) or "no column"
            expected = " or ".join(f"{before}_{axis}" for axis in self.axes)
            raise InputError(where, f"found {names}, expected {expected}")
        of = "as true values" if invert else "as the instrument was calibrated"
        wanted, written = (si, self.output) if invert else (self.output, si)
        reads = {f"{before}_{k}": factor_of(record[f"{before}_{k}"], wanted, of) for k in present}
        one_clock(record, list(reads))
        work = self._all_indicate if invert else self._all_correct

        def together(samples: Samples) -> Samples:
            made = work({axis: samples[f"{before}_{axis}"] for axis in present})
            return {f"{after}_{axis}": values for axis, values in made.items()}

        low, high = self.rates
        lost = [name for name in self._misalignments() if name[-2] in present and name[-1] not in present]
        findings: tuple[Finding, ...] = ()
        if lost:
            text = f"{', '.join(lost)}: the recording has no rate about that axis, which is taken as 0"
            findings = (Finding("not_held", text),)
        return Correction(
            together,
            reads,
            {f"{before}_{axis}": (f"{after}_{axis}", written) for axis in present},
            {"values": str(dict(self.values)), "axes": "".join(present), "invert": invert},
            findings=findings,
            ranges={f"rate_{axis}": widened(low, high, "rad/s") for axis in present},
        )

    def _misalignments(self) -> list[str]:
        """Misalignments between pairs of calibrated gyros."""
        return [f"T_{i}{j}" for i in self.axes for j in self.axes if f"T_{i}{j}" in self.values]

    def _across(self, axis: str, rates: Mapping[str, Array]) -> Any:
        """Output of a gyro for the rates about the others, over its scale factor."""
        return sum(self.values.get(f"T_{axis}{j}", 0.0) * w for j, w in rates.items() if j != axis)

    def _all_indicate(self, rates: Mapping[str, Array]) -> dict[str, Array]:
        """Outputs for rates [rad/s] by axis."""
        return {
            axis: np.asarray(self._indicate(axis, x) + self.values[f"S_{axis}"] * self._across(axis, rates))
            for axis, x in rates.items()
        }

    def _all_correct(self, outputs: Mapping[str, Array]) -> dict[str, Array]:
        """Rates [rad/s] for outputs by axis: each by itself, then less what it reads of the others."""
        rates = {axis: self._correct(axis, y) for axis, y in outputs.items()}
        if not any(name[-1] in outputs and name[-2] in outputs for name in self._misalignments()):
            return rates
        moving = np.ones(np.shape(next(iter(rates.values()))), bool)
        with np.errstate(all="ignore"):
            for _ in range(_ROUNDS):
                cleared = {
                    axis: self._correct(axis, y - self.values[f"S_{axis}"] * self._across(axis, rates))
                    for axis, y in outputs.items()
                }
                size = np.max([np.abs(x) for x in cleared.values()], axis=0)
                moves = np.max([np.abs(cleared[axis] - rates[axis]) for axis in rates], axis=0) > 1e-14 * size
                rates = {axis: np.where(moving, cleared[axis], rates[axis]) for axis in rates}
                moving = moving & moves
                if not moving.any():
                    break
        return {axis: np.where(moving, np.nan, x) for axis, x in rates.items()}

    def _of(self, axis: str) -> tuple[Any, ...]:
        return tuple(self.values.get(f"{symbol}_{axis}", 0.0) for symbol in _APPLIED)

    def _indicate(self, axis: str, x: Array) -> Array:
        """Outputs for rates [rad/s]."""
        bias, scale, asymmetry, second, third = self._of(axis)
        bent = 0.5 * asymmetry * np.abs(x) + second * x * x + third * x * x * x
        return np.asarray(bias + scale * (x + bent))

    def _correct(self, axis: str, y: Array) -> Array:
        """Rates [rad/s] for outputs, by Newton's method; a sample that does not settle is no number."""
        bias, scale, asymmetry, second, third = self._of(axis)
        x = (y - bias) / scale
        moving = np.ones(np.shape(x), bool)
        with np.errstate(all="ignore"):
            for _ in range(_ROUNDS):
                slope = 1.0 + 0.5 * asymmetry * np.sign(x) + 2.0 * second * x + 3.0 * third * x * x
                step = (y - self._indicate(axis, x)) / (scale * slope)
                moves = np.abs(step) > 1e-15 * np.abs(x)
                x = np.where(moving, x + step, x)
                moving = moving & moves
                if not moving.any():
                    break
        return np.where(moving, np.nan, x)


def rate_gyros(estimate: Estimate, where: object = "calibration") -> RateGyros:
    """The gyros of an estimate of a rate test.

    Raises `InputError`: the estimate has no values or no unit, or a scale factor is 0.
    """
    values = {name: each.value for name, each in estimate.parameters.items()}
    axes = "".join(axis for axis in "xyz" if f"S_{axis}" in values)
    if not axes or not np.isfinite(estimate.values).all():
        raise InputError(where, "found no coefficients, expected those of gyros in a rate test")
    if "unit" not in estimate.result:
        raise InputError(where, "states no unit under result, expected a calibration by this version")
    dead = [f"S_{axis}" for axis in axes if not values[f"S_{axis}"]]
    if dead:
        raise InputError(where, f"{dead[0]} is 0, expected a scale factor that can be inverted")
    ends = range_of(estimate, "rate_rad_s", where)
    low, high = (-np.inf, np.inf) if ends is None else ends
    output = parse_unit(str(estimate.result["unit"]["gyro"]), where)
    return RateGyros(axes, values, output, (float(low), float(high)))


def not_applied(estimate: Estimate, where: object = "calibration") -> tuple[Finding, ...]:
    """``not_held``: what a rate test says of a gyro beside its input and output."""
    along = {name[-1] for name in estimate.names if name.startswith("S_")}
    own = [name for name in estimate.names if name.startswith("T_") and {*name[-2:]} <= along]
    across = [
        name
        for name in estimate.names
        if name not in own and (name.startswith("T_") or name[-1] not in along)
    ]
    limits = [name for name in estimate.names if name.rpartition("_")[0] in ("S_nl", "S_hyst")]
    findings = []
    if limits:
        text = f"{', '.join(limits)}: limits of the error, not applied"
        findings.append(Finding("not_held", text, str(where)))
    if across:
        text = f"{', '.join(across)}: not applied, they belong to gyros across the turning axis"
        findings.append(Finding("not_held", text, str(where)))
    text = "D_F holds what gravity does at the attitude of the rate test: at another one the bias differs"
    return (*findings, Finding("not_held", text, str(where)))
