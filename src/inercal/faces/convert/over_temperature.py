"""A temperature model in use: coefficients at the temperature of each sample, or the change of an output taken off."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from inercal.faces.convert.correction import CalibratedInstrument, Correction, Samples, factor_of, one_clock
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding
from inercal.foundation.records.channels import is_channel
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import Unit, parse_unit

COMMAND = "temperature"
"""Command whose estimates are of temperature models."""

Polynomials = Mapping[str, tuple[float, ...]]
"""Coefficients of 1, d, d^2, d^3 by quantity, d = T - T0."""


@dataclass(frozen=True)
class OverTemperature:
    """An instrument whose terms are ``polynomials`` about ``reference`` [degC]; ``model_of`` takes their values
    (*batch,)."""

    model_of: Callable[[Mapping[str, Any]], CalibratedInstrument]
    polynomials: Polynomials
    reference: float

    def correction(self, record: Record, invert: bool = False) -> Correction:
        """The correction of a record that has its ``temperature``; raises `InputError` as that of the model does."""
        base = self._at(np.float64(0.0)).correction(record, invert)
        temperature = _temperature(record, next(iter(base.writes)))

        def work(samples: Samples) -> Samples:
            at = self._at(samples["temperature"] - self.reference)
            return at.correction(record, invert).work(samples)

        return replace(
            base,
            work=work,
            reads={**base.reads, "temperature": temperature},
            settings={"polynomials": str(dict(self.polynomials)), "T0": self.reference, "invert": invert},
        )

    def _at(self, d: Any) -> CalibratedInstrument:
        return self.model_of({name: polynomial(c, d) for name, c in self.polynomials.items()})


@dataclass(frozen=True)
class OutputOverTemperature:
    """Outputs whose change with temperature from ``reference`` [degC] on is known, with the ``units`` it is in."""

    polynomials: Polynomials
    reference: float
    units: Mapping[str, Unit]

    def correction(self, record: Record, invert: bool = False) -> Correction:
        """The correction of a record that has its ``temperature``: outputs as they would be at the reference.

        Raises `InputError`: none of the channels, another kind of unit, or no temperature.
        """
        present = [name for name in self.polynomials if name in record]
        where = ", ".join(source.path for source in record.sources) or "record"
        if not present:
            names = ", ".join(record.columns) or "no column"
            raise InputError(where, f"found {names}, expected {' or '.join(self.polynomials)}")
        reads = {name: factor_of(record[name], self.units[name], "as in the sweep") for name in present}
        reads["temperature"] = _temperature(record, present[0])
        one_clock(record, list(reads))
        sign = 1.0 if invert else -1.0

        def work(samples: Samples) -> Samples:
            d = samples["temperature"] - self.reference
            return {
                name: samples[name] + sign * polynomial((0.0, *self.polynomials[name][1:]), d)
                for name in present
            }

        settings = {"polynomials": str(dict(self.polynomials)), "T0": self.reference, "invert": invert}
        return Correction(work, reads, {name: (name, self.units[name]) for name in present}, settings)


def over_temperature(
    estimate: Estimate,
    instrument_of: Callable[[Estimate], Callable[[Mapping[str, Any]], CalibratedInstrument]],
    where: object = "calibration",
) -> OverTemperature | OutputOverTemperature:
    """The instrument of an estimate of `inercal temperature`, of a sweep or of calibrations at several temperatures.

    ``instrument_of`` takes the calibration at T0 and gives what makes a model of other values of its terms. Raises
    `InputError`, naming ``where``, without values, or where the estimate does not say of which calibrations it is.
    """
    result, values = estimate.result, {name: p.value for name, p in estimate.parameters.items()}
    if not values or not np.isfinite(estimate.values).all():
        raise InputError(where, "found no coefficients, expected those of a temperature model")
    polynomials = {
        curve["name"]: tuple(
            values[curve["name"] + (f"_T{order}" if order else "")] for order in range(int(curve["terms"]))
        )
        for curve in result["curves"]
    }
    reference = float(result["reference_degC"])
    if all(is_channel(name) for name in polynomials):
        units = {name: parse_unit(estimate[name].unit, where) for name in polynomials}
        return OutputOverTemperature(polynomials, reference, units)
    if "calibration" not in result:
        raise InputError(where, "does not say of which calibrations it is, expected a model by this version")
    own = [k for k, name in enumerate(estimate.names) if name in polynomials]
    at_reference = replace(
        estimate,
        command=str(result["calibration"]["command"]),
        names=tuple(estimate.names[k] for k in own),
        units=tuple(estimate.units[k] for k in own),
        values=estimate.values[own],
        covariance=estimate.covariance[np.ix_(own, own)],
        dof=estimate.dof[own],
        result=result["calibration"]["result"],
    )
    return OverTemperature(instrument_of(at_reference), polynomials, reference)


def not_applied(estimate: Estimate, where: object = "calibration") -> tuple[Finding, ...]:
    """``not_held``: the hysteresis, and what a sweep at rest cannot tell of accelerometers."""
    findings = []
    late = [name for name in estimate.names if name.endswith("_hyst")]
    if late:
        text = f"{', '.join(late)}: not applied, a sample does not tell whether it warms or cools"
        findings.append(Finding("not_held", text, str(where)))
    if any(re.fullmatch(r"acc_[xyz]|a\d+", name) for name in estimate.names):
        text = (
            "the change of an accelerometer's output is that at the pose of the sweep: it holds that of its scale "
            "factor, which in another pose is another"
        )
        findings.append(Finding("not_held", text, str(where)))
    return tuple(findings)


def polynomial(coefficients: tuple[float, ...], d: Any) -> Any:
    """Value (*batch,) of a polynomial, to the same digits in any batch."""
    value: Any = 0.0 * d
    for c in reversed(coefficients):
        value = value * d + c
    return value


def _temperature(record: Record, beside: str) -> tuple[float, float]:
    """Factor and zero of the temperature of a record [degC]; raises `InputError` where it has none in such a unit."""
    one_clock(record, [beside, "temperature"])
    return factor_of(record["temperature"], parse_unit("degC"), "or another scale of temperature")
