"""Measurement results of a certificate: method, equipment, conditions, coefficients, covariance, files.

Conformity is stated with them: which coefficients are within their tolerances, by the rule of the laboratory.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from inercal import __version__
from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.instruments.dsi import PREFIX, as_written, dsi, from_dsi, is_coherent, reference_type
from inercal.foundation.instruments.terms import term
from inercal.foundation.results.files import to_json
from inercal.foundation.results.result import COVERAGE, Estimate, coverage_factor
from inercal.laboratory.certificate.elements import (
    dcc,
    factor,
    file,
    number,
    of_result,
    plain,
    real,
    si,
    words,
)
from inercal.laboratory.specification import Conformity, Specification

if TYPE_CHECKING:
    from lxml.etree import _Element

    from inercal.faces.studies.laboratory import EquipmentTable
    from inercal.foundation.results.result import Parameter
    from inercal.foundation.units import Quantity
    from inercal.laboratory.certificate.lab import LabFile


def limits_used(specification: Specification, estimates: Sequence[Estimate], where: object) -> None:
    """Refuse limits of a coefficient that no result has."""
    names = {name for estimate in estimates for name in estimate.names}
    for key in specification.without_value(names):
        raise InputError(
            where, f"specification.{key}: found limits of what no result has, expected one of {_some(names)}"
        )


def _some(names: set[str]) -> str:
    """A few names."""
    return ", ".join(sorted(names)[:8])


def stated(found: Conformity, unit: str) -> _Element:
    """The conformity of one coefficient, with its limits, as metadata of its quantity."""
    ends = (
        dcc("quantity", words("name", name), of_result(limit, unit), ref_type=f"basic_acceptanceLimit{end}")
        for name, end, limit in (
            ("Lower limit", "Lower", found.low),
            ("Upper limit", "Upper", found.high),
        )
    )
    said = (
        f"By {found.rule}; probability that the true value is within the limits: {number(found.probability)}"
    )
    return dcc(
        "measurementMetaData",
        dcc(
            "metaData",
            words("declaration", said),
            dcc("conformity", _verdict(found)),
            dcc("data", *ends),
            ref_type="basic_conformity",
        ),
    )


def _verdict(found: Conformity) -> str:
    """The verdict in the words of the schema."""
    return "pass" if found.verdict == "conform" else "fail"


def statement(specification: Specification, found: Sequence[Conformity]) -> _Element:
    """The statement on all coefficients that have limits, with the rule of decision."""
    all_pass = all(_verdict(each) == "pass" for each in found)
    rules = {
        "simple acceptance": "a value conforms where it is within its limits",
        "guard band": "a value conforms where it is within its limits by U at least",
    }
    rule = rules.get(
        specification.rule, "a value conforms where the true one is outside with that probability at most"
    )
    verdict = "all conform" if all_pass else "not all conform"
    said = f"{len(found)} coefficients have limits; {verdict}. The rule is {specification.rule}: {rule}."
    return dcc(
        "statement",
        dcc("norm", "ILAC-G8:09/2019"),
        dcc("reference", "ISO/IEC 17025:2017, 7.8.6"),
        words("declaration", said),
        dcc("conformity", "pass" if all_pass else "fail"),
        ref_type="basic_conformity",
    )


KELVIN = 273.15


def measured(
    estimate: Estimate, lab: LabFile, conform: Mapping[str, Conformity], report: bytes | None
) -> _Element:
    """The element ``measurementResult`` of one result; ``conform`` says of coefficients whether they do."""
    _refuse_unknown(estimate)
    files = [
        file(
            "result.json",
            "application/json",
            json.dumps(to_json(estimate), ensure_ascii=False, allow_nan=False).encode(),
            f"{PREFIX}result",
        )
    ]
    if report is not None:
        files.append(file("report.html", "text/html", report, f"{PREFIX}report"))
    equipment = [_equipment(each) for each in lab.equipment.values()]
    conditions = list(_conditions(estimate, lab))
    return dcc(
        "measurementResult",
        words("name", f"{estimate.command.capitalize()}: {len(estimate.names)} coefficients"),
        _methods(estimate),
        dcc("usedSoftware", software()),
        dcc("measuringEquipments", *equipment) if equipment else None,
        dcc("influenceConditions", *conditions) if conditions else None,
        dcc(
            "results",
            _result(
                "Coefficients",
                f"{PREFIX}coefficients",
                [_coefficient(p, conform.get(p.name)) for p in estimate.parameters.values()],
            ),
            _result("Covariance of the coefficients", f"{PREFIX}covariance", [_covariance(estimate)]),
            _result("Result as a file", f"{PREFIX}files", files),
        ),
    )


def _refuse_unknown(estimate: Estimate) -> None:
    """Refuse a result with a number that is not known."""
    for p in estimate.parameters.values():
        if not (math.isfinite(p.value) and math.isfinite(p.u)):
            raise InputError(
                "certificate", f"found {p.name} without a value or an uncertainty, expected both"
            )
    if not np.all(np.isfinite(estimate.covariance)):
        raise InputError("certificate", "found a covariance that is not known, expected all of it")


def _result(name: str, ref_type: str, parts: Iterable[_Element]) -> _Element:
    """The element ``result`` with its data."""
    return dcc("result", words("name", name), dcc("data", *parts), ref_type=ref_type)


def software() -> _Element:
    """The element of the software: this program."""
    return dcc("software", words("name", "inercal"), dcc("release", __version__), dcc("type", "application"))


def _methods(estimate: Estimate) -> _Element:
    """The method with the equation of its model, and the evaluation of uncertainty."""
    study = estimate.provenance.get("settings") or {}
    own = next(
        (table["method"] for table in study.values() if isinstance(table, dict) and "method" in table), ""
    )
    references = (dcc("reference", each) for each in estimate.references if plain(each))
    model = dcc(
        "usedMethod",
        words("name", f"inercal {estimate.command}" + (f", {own}" if isinstance(own, str) and own else "")),
        words("description", estimate.model) if plain(estimate.model) else None,
        *references,
        ref_type=f"{PREFIX}model",
    )
    uncertainty = dcc(
        "usedMethod",
        words("name", "Uncertainty of measurement"),
        words(
            "description",
            "Sources: " + "; ".join(f"{b.source} (type {b.type})" for b in estimate.budget)
            if estimate.budget
            else "Of the residuals.",
        ),
        dcc("norm", "JCGM 100:2008"),
        ref_type="basic_uncertainty",
    )
    return dcc("usedMethods", model, uncertainty)


def _equipment(table: EquipmentTable) -> _Element:
    """A standard, table or rig, with its certificate."""
    certificate = None
    if plain(table.certificate):
        until = f"valid until {table.valid_until}" if table.valid_until else ""
        certificate = dcc(
            "certificate",
            words("referral", table.issuer or "calibration certificate"),
            dcc("referralID", table.certificate),
            dcc("procedure", "not stated"),
            dcc("value", "not stated"),
            words("description", until) if until else None,
        )
    serial = None
    if plain(table.serial):
        identified = dcc("identification", dcc("issuer", "manufacturer"), dcc("value", table.serial))
        serial = dcc("identifications", identified)
    causes = f"stands behind the budget's {', '.join(table.budget)}" if table.budget else ""
    return dcc(
        "measuringEquipment",
        words("name", table.name),
        words("description", causes) if causes else None,
        certificate,
        dcc("manufacturer", words("name", table.maker)) if plain(table.maker) else None,
        dcc("model", table.model) if plain(table.model) else None,
        serial,
        ref_type="basic_normalUsed",
    )


def _conditions(estimate: Estimate, lab: LabFile) -> Iterator[_Element]:
    """Conditions that influence the result: temperature, humidity, gravity."""
    recorded = estimate.conditions.get("temperature")
    stated = lab.conditions.temperature
    if recorded is not None:
        yield _temperature(recorded["value"], recorded.get("u") or 0.0)
    elif stated is not None:
        yield _temperature(stated.value, stated.u)
    humidity: Quantity | None = lab.conditions.humidity
    if humidity is not None:
        yield _condition(
            "Relative humidity",
            "basic_humidityRelative",
            real(humidity.value, "\\one", _expanded(humidity.u)),
        )
    site = estimate.conditions.get("site") or {}
    if site.get("gravity_m_s2") is not None:
        u = next((b.u for b in estimate.budget if b.source == "gravity" and b.unit == "m/s^2"), 0.0)
        value = real(site["gravity_m_s2"], "\\metre\\second\\tothe{-2}", _expanded(u))
        yield _condition("Gravity", f"{PREFIX}gravity", value)
    if site.get("latitude_rad") is not None:
        yield _condition("Latitude", f"{PREFIX}latitude", real(site["latitude_rad"], "\\radian"))


def _expanded(u: float) -> tuple[float, float, float] | None:
    """U, k and probability of a stated standard uncertainty; None where it is not stated."""
    k = coverage_factor(math.inf)
    return (k * u, k, COVERAGE) if u > 0.0 and math.isfinite(u) else None


def _temperature(degrees: float, u: float) -> _Element:
    """The temperature, in kelvin and in degrees Celsius."""
    both = si(
        "hybrid",
        real(degrees + KELVIN, "\\kelvin", _expanded(u)),
        real(degrees, "\\degreecelsius", _expanded(u)),
    )
    return _condition("Temperature", "basic_temperature", both)


def _condition(name: str, ref_type: str, value: _Element) -> _Element:
    """The element of one influence condition."""
    return dcc(
        "influenceCondition",
        words("name", name),
        dcc("data", dcc("quantity", value)),
        ref_type=ref_type,
    )


def _coefficient(p: Parameter, conform: Conformity | None) -> _Element:
    """A coefficient in SI; where its own unit is no SI unit, in that one too; with its conformity."""
    value = of_result(p.value, p.unit, (p.U, p.k, COVERAGE), p.name)
    found = term(p.name)
    name = p.name if found is None else f"{p.name}: {found.name}"
    judgement = None if conform is None else stated(conform, p.unit)
    return dcc("quantity", words("name", name), value, judgement, ref_type=reference_type(p.name))


def _covariance(estimate: Estimate) -> _Element:
    """Coefficients and covariance in SI, and once more in the units of the result where these are not SI."""
    found = [dsi(unit) for unit in estimate.units]
    region = _region(estimate, [from_dsi(text) for text, _ in found], np.array([size for _, size in found]))
    if not all(map(is_coherent, estimate.units)):
        region = si("hybrid", region, _region(estimate, estimate.units, np.ones(len(found))))
    return dcc("quantity", region, ref_type=f"{PREFIX}covariance")


def _region(estimate: Estimate, units: Sequence[str], sizes: Array) -> _Element:
    """A list of all coefficients in those ``units``, ``sizes`` of which their own are, with the rectangular region.

    The factor of the region is Bonferroni's, of the fewest degrees of freedom: together the coefficients lie inside
    with the stated probability at least (JCGM 102:2011, 6.5.4).
    """
    count = len(units)
    joint = coverage_factor(float(np.min(estimate.dof)), 1.0 - (1.0 - COVERAGE) / count)
    squares = (estimate.covariance * np.outer(sizes, sizes)).tolist()
    columns = (
        si("column", *(_entry(squares[i][j], units[i], units[j]) for i in range(count))) for j in range(count)
    )
    return si(
        "realListXMLList",
        si("labelXMLList", " ".join(estimate.names)),
        si("valueXMLList", _numbers(estimate.values * sizes)),
        si("unitXMLList", " ".join(map(as_written, units))),
        si(
            "expandedUncXMLList",
            si("uncertaintyXMLList", _numbers(estimate.k * estimate.u * sizes)),
            si("coverageFactorXMLList", " ".join(map(factor, estimate.k.tolist()))),
            si("coverageProbabilityXMLList", " ".join([number(COVERAGE)] * count)),
        ),
        si(
            "rectangularRegionXMLList",
            si("covarianceMatrix", *columns),
            si("coverageFactor", factor(joint)),
            si("coverageProbability", number(COVERAGE)),
        ),
    )


def _entry(value: float, one: str, other: str) -> _Element:
    """A covariance with its unit, the product of two."""
    product = f"({one})*({other})"
    unit = dsi(product)[0] if is_coherent(one) and is_coherent(other) else product
    return si("covariance", si("value", number(value)), si("unit", unit))


def _numbers(values: Array) -> str:
    """Numbers of a list."""
    return " ".join(number(value) for value in values.tolist())
