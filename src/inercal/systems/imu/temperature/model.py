"""Coefficients over temperature: the estimate of a sweep, or of calibrations at several temperatures.

``y = c + T1 d + T2 d^2 + ..``, d = T - T0, to the fifth power at most, for each quantity; its value at T0 keeps its
name, the others end in ``_T1`` to ``_T5``. ``_hyst`` is the mean difference between rising and falling temperature.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array, short_repr
from inercal.foundation.findings import Finding, Status
from inercal.foundation.inputs import Source
from inercal.foundation.results.basis import Basis, Formula, provenance
from inercal.foundation.results.budget import Uncertainty
from inercal.foundation.results.result import Estimate
from inercal.systems.imu.limits import LIMITS
from inercal.systems.imu.temperature.polynomial import TemperaturePolynomial

COMMAND = "temperature"

REFERENCE = 25.0
"""T0 [degC], the temperature at which data sheets state coefficients."""

MODEL = Formula(
    "$y = c + T_1 d + T_2 d^2 + \\dots$, $d = T - T_0$; hyst: output on rising less that on falling temperature, its "
    "mean over the range"
)


@dataclass(frozen=True)
class Curve:
    """A quantity against temperature.

    ``values`` (n,) [``unit``] at ``temperature`` (n,) [degC], on branches ``rising`` (n,) of +1/2, -1/2 or 0 where it
    is neither; ``polynomial`` the fit through all, ``branched`` the one whose last coefficient is the difference
    between the branches (None where there are not both), ``apart`` the largest difference between two passes at one
    temperature and ``beyond_chance`` whether that is more than noise can make, ``u`` (n,) standard uncertainties of
    single values (None: of samples).
    """

    name: str
    unit: str
    temperature: Array
    values: Array
    rising: Array
    polynomial: TemperaturePolynomial
    branched: TemperaturePolynomial | None
    apart: float
    beyond_chance: bool
    u: Array | None = None

    @property
    def scatter(self) -> float:
        """Standard deviation of the residuals [``unit``]."""
        return float(np.std(self.polynomial.residuals))

    @property
    def explained(self) -> float:
        """Part of the variance that the polynomial explains (R^2); all of it where there is none."""
        whole = float(np.var(self.values))
        return 1.0 - float(np.var(self.polynomial.residuals)) / whole if whole > 0.0 else 1.0

    @property
    def change(self) -> float:
        """Largest less smallest value of the polynomial over the range of temperature."""
        grid = np.linspace(self.temperature.min(), self.temperature.max(), 201)
        return float(np.ptp(self.polynomial.value(grid)))


@short_repr
@dataclass(frozen=True)
class TemperatureModel:
    """An ``estimate`` and the ``curves`` behind it; without curves it says why."""

    estimate: Estimate
    curves: tuple[Curve, ...] = ()


def assemble(
    curves: Sequence[Curve],
    reference: float,
    inputs: Sequence[Source],
    findings: Sequence[Finding],
    given: Mapping[str, Any],
    what: str,
) -> Estimate:
    """Put the estimate together; quantities count as independent of each other."""
    from scipy.linalg import block_diag

    names: list[str] = []
    units: list[str] = []
    values: list[float] = []
    dof: list[float] = []
    blocks: list[Array] = []
    for curve in curves:
        fits = [(curve.polynomial, slice(0, curve.polynomial.terms))]
        if curve.branched is not None:
            fits.append((curve.branched, slice(curve.branched.terms, None)))
        for fit, part in fits:
            blocks.append(fit.covariance[part, part])
            values += fit.coefficients[part].tolist()
            dof += fit.dof[part].tolist()
        orders = range(curve.polynomial.terms)
        names += [curve.name + (f"_T{order}" if order else "") for order in orders]
        units += [
            curve.unit + ("" if order == 0 else "/K" if order == 1 else f"/K^{order}") for order in orders
        ]
        if curve.branched is not None:
            names.append(f"{curve.name}_hyst")
            units.append(curve.unit)
    low, high = _range(curves)
    more = []
    if not low <= reference <= high:
        text = f"T0 = {reference:g} degC lies outside {low:.1f} to {high:.1f} degC: the values there are extrapolated"
        more.append(Finding("outside_range", text))
    more += [_hysteresis(curve) for curve in curves if _shows_hysteresis(curve)]
    return Estimate.of(
        Basis(
            COMMAND,
            MODEL,
            {"reference_degC": reference, "ranges": {"temperature_degC": [low, high]}},
            inputs=tuple(inputs),
            provenance=provenance(given),
            references=("JCGM 100:2008, Guide to the expression of uncertainty in measurement",),
        ),
        names,
        units,
        np.array(values),
        Uncertainty(block_diag(*blocks), np.array(dof)),
        (Status.OK, f"{what} from {low:.1f} to {high:.1f} degC, about T0 = {reference:g} degC"),
        findings=(*findings, *more),
        result={
            "reference_degC": reference,
            "curves": [
                {
                    "name": curve.name,
                    "unit": curve.unit,
                    "terms": curve.polynomial.terms,
                    "change": curve.change,
                    "residual_std": curve.scatter,
                    "r2": curve.explained,
                    "largest_hysteresis": curve.apart,
                }
                for curve in curves
            ],
        },
    )


def no_span(low: float, high: float, inputs: Sequence[Source], findings: Sequence[Finding]) -> Estimate:
    """The estimate without parameters of data at hardly more than one temperature."""
    text = (
        f"the temperature goes from {low:.1f} to {high:.1f} degC, expected a range of at least "
        f"{LIMITS.temperature_span:g} K"
    )
    basis = Basis(COMMAND, MODEL, inputs=tuple(inputs))
    return Estimate.without(basis, Status.UNOBSERVABLE, text, findings=findings)


def _range(curves: Sequence[Curve]) -> tuple[float, float]:
    """Lowest and highest temperature [degC]."""
    return (
        min(float(curve.temperature.min()) for curve in curves),
        max(float(curve.temperature.max()) for curve in curves),
    )


def _shows_hysteresis(curve: Curve) -> bool:
    """True if passes at one temperature differ by more than chance, and than a tenth of the change with temperature."""
    return curve.beyond_chance and curve.apart > 0.1 * curve.change


def _hysteresis(curve: Curve) -> Finding:
    """The finding of hysteresis."""
    text = (
        f"{curve.name} differs by up to {curve.apart:.3g} {curve.unit} between passes at the same temperature, "
        f"{curve.apart / curve.change:.0%} of its change over the range: no polynomial in temperature takes that away "
        "(sweep more slowly, or let each temperature settle)"
    )
    return Finding("hysteresis", text)
