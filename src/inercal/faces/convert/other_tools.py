"""Calibrations to and from other tools: values and covariance, and the files these tools read."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from inercal.faces.convert import imu_tk, imucal, kalibr, psins
from inercal.faces.convert.convention import Convention, Units, flat, in_si_outputs, output_unit
from inercal.faces.convert.correct import ImuModel, imu_model
from inercal.foundation._files import input_text
from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding, Status
from inercal.foundation.instruments.terms import GYRO_G_SENSITIVITY, TERMS
from inercal.foundation.instruments.triad import TriadModel
from inercal.foundation.records.read import source_of
from inercal.foundation.results.basis import Basis, Formula, provenance
from inercal.foundation.results.budget import Uncertainty
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import STANDARD_GRAVITY

CONVENTIONS: dict[str, Convention] = {
    module.CONVENTION.name: module.CONVENTION for module in (imu_tk, imucal, kalibr, psins)
}
"""Conventions of other tools, by name."""

_ROUNDING = 1e-14
"""Misalignment [rad] that a turn of the axes and back leaves of zero."""

MODEL = Formula(
    "$y = S M x + b$, and for the gyro $+ G f$ ($K_1$, $M$, $K_0$; $S$, $T$, $D_F$, $G$), frame that of the file"
)


@dataclass(frozen=True)
class Converted:
    """A calibration in another tool's terms: an ``estimate`` of them, and the ``texts`` of the tool's files.

    The key of a text goes between the stem and the suffix of its file's name.
    """

    estimate: Estimate
    texts: Mapping[str, str]


def to_tool(estimate: Estimate, name: str, where: object = "calibration") -> Converted:
    """An IMU's calibration in the terms of a convention of `CONVENTIONS`.

    The covariance of the terms is that of the coefficients by linear propagation (GUM 5.2), their degrees of
    freedom the fewest of the coefficients that they are made of. Entries that are the same for every instrument
    (zeros below a diagonal) are no parameters.

    Raises `InputError`: the estimate is not of an IMU, or the convention has no place for a term that matters.
    """
    convention = CONVENTIONS[name]
    own = estimate.result.get(name)
    if isinstance(own, Mapping):
        made = [
            float(own.get(term, value)) for term, value in zip(estimate.names, estimate.values, strict=True)
        ]
        estimate = replace(estimate, values=np.array(made))

    def model_at(values: Array) -> ImuModel:
        model = imu_model(replace(estimate, values=values), where)
        missing = {"acc", *(("gyro",) if model.gyro else ())} - model.units.keys()
        if missing:
            raise InputError(where, f"states no unit of {', '.join(sorted(missing))} outputs, expected one")
        return in_si_outputs(model) if convention.si else model

    model = model_at(estimate.values)
    terms = convention.terms(model)
    names, values = flat(terms)
    J = _jacobian(estimate, lambda x: flat(convention.terms(model_at(x)))[1])
    unused = [estimate.names[j] for j in np.flatnonzero(~J.any(axis=0))]
    rows = np.flatnonzero(J.any(axis=1))
    J = J[rows]
    units = convention.term_units(model.units)
    unit_of = [units[term] for term, array in terms.items() for _ in range(array.size)]
    parts = np.abs(J) * estimate.u
    matters = parts > 1e-6 * parts.max(axis=1, initial=0.0, keepdims=True)
    dof = np.where(matters, estimate.dof, math.inf).min(axis=1, initial=math.inf)
    findings = list(convention.notes(terms))
    if unused:
        text = f"{name} has no place for {', '.join(unused)}: left out"
        if any(term.startswith("G_") for term in unused):
            largest = float(np.max(np.abs(model.g_sensitivity))) * STANDARD_GRAVITY
            text += f" (G is up to {largest:.2g} {model.units['gyro']} at 1 g)"
        findings.append(Finding("not_held", text))
    earlier = [
        replace(each, harm=_touched(each.harm, estimate.names, matters, [names[i] for i in rows]))
        for each in estimate.findings
    ]
    converted = replace(
        estimate,
        command="convert",
        names=tuple(names[i] for i in rows),
        units=tuple(unit_of[i] for i in rows),
        values=values[rows],
        covariance=J @ estimate.covariance @ J.T,
        common=None if estimate.common is None else J @ estimate.common @ J.T,
        dof=dof,
        findings=(*earlier, *findings),
        budget=(),
        model=convention.equation,
        timing={},
        result={"convention": name, "unit": dict(model.units)},
    )
    return Converted(converted, convention.render(terms, dict(model.units)))


def _touched(
    harm: Sequence[str], before: Sequence[str], matters: NDArray[np.bool_], after: Sequence[str]
) -> tuple[str, ...]:
    """Those of the terms ``after`` (m,) into which coefficients ``before`` (p,) go that a finding harms; ``matters``
    (m, p) says which go into which."""
    hit = np.any(matters[:, [name in harm for name in before]], axis=1).tolist()
    return tuple(name for name, each in zip(after, hit, strict=True) if each)


def _jacobian(estimate: Estimate, function: Callable[[Array], Array]) -> Array:
    """Derivatives (m, p) of a function of the coefficients, by central differences.

    The terms are linear in each bias and g-sensitivity, so that a large step does no harm there.
    """
    columns = []
    for j, (name, x, u) in enumerate(zip(estimate.names, estimate.values, estimate.u, strict=True)):
        if name.startswith(("K1_", "S_")) and not name.startswith("S_asym_"):
            h = 1e-6 * abs(x)
        elif name.startswith(("M_", "T_")):
            h = 1e-6
        else:
            h = abs(x) + (u if np.isfinite(u) else 0.0) or 1.0
        step = np.zeros(len(estimate.values))
        step[j] = h
        columns.append((function(estimate.values + step) - function(estimate.values - step)) / (2.0 * h))
    return np.stack(columns, axis=1)


def from_tool(paths: Sequence[Path], name: str, units: Mapping[str, str] | None = None) -> Estimate:
    """The calibration in another tool's files, uncertainties not known (NaN).

    ``paths`` is one file, for imu_tk that of the accelerometers and perhaps that of the gyro; ``name`` one of
    `CONVENTIONS`; ``units`` those of the outputs of ``acc`` and ``gyro`` where the files do not state them. Raises
    `InputError` where the files are not of that convention, hold terms that a triad cannot, or units are neither stated
    nor given.
    """
    convention = CONVENTIONS[name]
    terms, in_files = convention.parse(
        [(path, input_text(path, f"a calibration of {name}")) for path in paths]
    )
    try:
        model = convention.model(terms, in_files)
    except InputError as error:
        raise InputError(paths[0], error.message) from error
    outputs = _outputs(in_files, units or {}, model.gyro is not None, paths)
    values = coefficients(model)
    findings = [Finding("not_stated", f"a file of {name} states no uncertainty: it is unknown", harm=())]
    if not terms.keys() & {"b_a", "db"}:
        findings.append(Finding("not_stated", "the file states no biases: they are taken as zero", harm=()))
    unknown = np.full((len(values), len(values)), math.nan)
    estimate = Estimate.of(
        Basis(
            "convert",
            MODEL,
            {"frame": f"b, as the file of {name} has it"},
            inputs=tuple(map(source_of, paths)),
            provenance=provenance({"convention": name}),
        ),
        tuple(values),
        [TERMS[term].unit_for(outputs["acc" if term[0] in "KM" else "gyro"]) for term in values],
        np.array(list(values.values())),
        Uncertainty(unknown, np.full(len(values), math.inf)),
        (Status.OK, f"{len(values)} coefficients from {name}, their uncertainties unknown"),
        findings=findings,
        result={"method": name, "unit": outputs},
    )
    imu_model(estimate, paths[0])
    return estimate


def _outputs(units: Units, given: Mapping[str, str], has_gyro: bool, paths: Sequence[Path]) -> Units:
    """Units of the outputs, from the file or else as given."""
    outputs: Units = {}
    for sensor in ("acc", "gyro") if has_gyro else ("acc",):
        option = f"--{sensor}-unit"
        unit = units.get(sensor) or given.get(sensor)
        if unit is None:
            raise InputError(
                paths[0], f"states no unit of the {sensor} outputs, expected {option}, such as count"
            )
        outputs[sensor] = output_unit(sensor, unit, paths[0] if sensor in units else option)
        if sensor in given and outputs[sensor] != output_unit(sensor, given[sensor], option):
            raise InputError(option, f"found {given[sensor]}, but the file states {unit}, expected the same")
    return outputs


def coefficients(model: ImuModel) -> dict[str, float]:
    """The model's coefficients by symbol; M below the diagonal and G only where they are not zero."""
    below = bool(np.abs(np.tril(model.accelerometer.misalignment, -1)).max() > _ROUNDING)
    values = _of_triad(model.accelerometer, "K0", "K1", "M", full=below)
    if model.gyro is not None:
        values |= _of_triad(model.gyro, "D_F", "S", "T", full=True)
        if model.g_sensitivity.any():
            values |= dict(zip(GYRO_G_SENSITIVITY, model.g_sensitivity.ravel().tolist(), strict=True))
    if model.second_order.any():
        values |= {f"K2_{axis}": float(x) for axis, x in zip("xyz", model.second_order, strict=True)}
    if model.levers.any():
        values |= {
            f"r_{i}{j}": float(model.levers["xyz".index(i), "xyz".index(j)]) for i in "xy" for j in "xyz"
        }
    return values | ({"tau_a": model.delay} if model.delay else {})


def _of_triad(triad: TriadModel, bias: str, scale: str, misalignment: str, full: bool) -> dict[str, float]:
    """The coefficients of one triad by symbol."""
    pairs = [(i, j) for i in range(3) for j in range(3) if (i != j if full else i < j)]
    return {
        **{f"{bias}_{axis}": float(b) for axis, b in zip("xyz", triad.bias, strict=True)},
        **{f"{scale}_{axis}": float(s) for axis, s in zip("xyz", triad.scale, strict=True)},
        **{f"{misalignment}_{'xyz'[i]}{'xyz'[j]}": float(triad.misalignment[i, j]) for i, j in pairs},
    }
