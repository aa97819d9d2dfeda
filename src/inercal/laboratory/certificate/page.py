"""The readable page of a certificate, made from its XML alone, so that both say the same; A4 when printed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from inercal.faces.report.style import plain_unit
from inercal.foundation.errors import QuantityError
from inercal.foundation.instruments.dsi import dsi
from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.results.shown import rounded
from inercal.laboratory.certificate.elements import NAMESPACES
from inercal.laboratory.certificate.reading import (
    Certificate,
    CertifiedValue,
    quantities_in,
    quantities_of,
    text,
)

if TYPE_CHECKING:
    from lxml.etree import _Element


@dataclass(frozen=True)
class _Row:
    """A number as it is printed: name, value, U, k, unit, both in the unit of the field, and whether it conforms."""

    symbol: str
    name: str
    value: str
    U: str
    k: str
    unit: str
    field: str
    limits: str


@dataclass(frozen=True)
class _Method:
    """A method: its name, its model, norms and publications."""

    name: str
    description: str
    sources: tuple[str, ...]


@dataclass(frozen=True)
class _Section:
    """A measurement result as the page prints it."""

    name: str
    methods: list[_Method]
    software: list[str]
    equipment: list[tuple[str, ...]]
    conditions: list[_Row]
    tables: list[tuple[str, list[_Row]]]
    files: list[str]


def page(certificate: Certificate) -> str:
    """The page of a certificate that was read: HTML without script, network or font."""
    import jinja2

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("inercal.laboratory.certificate"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    root = certificate.root
    return environment.get_template("certificate.html").render(
        certificate=certificate,
        laboratory=_contact(root, ".//dcc:calibrationLaboratory/dcc:contact"),
        code=text(root, ".//dcc:calibrationLaboratory/dcc:calibrationLaboratoryCode"),
        customer=_contact(root, ".//dcc:customer"),
        facts=[(name, value) for name, value in _facts(root) if value],
        persons=[
            (text(each, "dcc:person/dcc:name/dcc:content"), text(each, "dcc:role"))
            for each in root.iterfind(".//dcc:respPersons/dcc:respPerson", NAMESPACES)
        ],
        statements=list(_statements(root)),
        sections=[_section(each) for each in root.iterfind(".//dcc:measurementResult", NAMESPACES)],
    )


def _contact(root: _Element, path: str) -> list[str]:
    """Lines of name, address and ways to reach a company."""
    found = root.find(path, NAMESPACES)
    if found is None:
        return []
    place = {
        key: text(found, f"dcc:location/dcc:{key}")
        for key in ("street", "streetNo", "postCode", "city", "countryCode")
    }
    lines = [
        text(found, "dcc:name/dcc:content"),
        _joined(place["street"], place["streetNo"]),
        _joined(place["postCode"], place["city"], place["countryCode"]),
        _joined(text(found, "dcc:eMail"), text(found, "dcc:phone")),
    ]
    return [line for line in lines if line]


def _joined(*parts: str) -> str:
    """Parts that are not empty, with a space between."""
    return " ".join(filter(None, parts))


def _facts(root: _Element) -> list[tuple[str, str]]:
    """Item, order, days and place."""
    core, item = ".//dcc:coreData", ".//dcc:items/dcc:item"
    begin, end = (text(root, f"{core}/dcc:{which}PerformanceDate") for which in ("begin", "end"))
    named = [
        (text(each, "dcc:name/dcc:content") or text(each, "dcc:issuer"), text(each, "dcc:value"))
        for each in root.iterfind(f"{item}/dcc:identifications/dcc:identification", NAMESPACES)
    ]
    order = [
        (text(each, "dcc:name/dcc:content"), text(each, "dcc:value"))
        for each in root.iterfind(f"{core}/dcc:identifications/dcc:identification", NAMESPACES)
    ]
    return [
        ("Item", text(root, f"{item}/dcc:name/dcc:content")),
        ("Manufacturer", text(root, f"{item}/dcc:manufacturer/dcc:name/dcc:content")),
        ("Model", text(root, f"{item}/dcc:model")),
        *named,
        *order,
        ("Received", text(root, f"{core}/dcc:receiptDate")),
        ("Calibrated", begin if begin == end else f"{begin} to {end}"),
        ("Place", text(root, f"{core}/dcc:performanceLocation")),
        ("Issued", text(root, f"{core}/dcc:issueDate")),
        (
            "Replaces certificate",
            text(root, f"{core}/dcc:reportAmendedSubstituted/dcc:replacedUniqueIdentifier"),
        ),
    ]


def _statements(root: _Element) -> list[tuple[str, str]]:
    """Statements of the laboratory with norm and clause."""
    found = root.iterfind(".//dcc:statements/dcc:statement", NAMESPACES)
    return [
        (said, _joined(text(each, "dcc:norm"), text(each, "dcc:reference")))
        for each in found
        if (said := text(each, "dcc:declaration/dcc:content"))
    ]


def _section(element: _Element) -> _Section:
    """The section of a measurement result."""
    methods = [
        _Method(
            text(each, "dcc:name/dcc:content"),
            text(each, "dcc:description/dcc:content"),
            tuple(
                " ".join((one.text or "").split())
                for key in ("norm", "reference")
                for one in each.iterfind(f"dcc:{key}", NAMESPACES)
            ),
        )
        for each in element.iterfind("dcc:usedMethods/dcc:usedMethod", NAMESPACES)
    ]
    conditions = [
        _row(quantity, text(each, "dcc:name/dcc:content"))
        for each in element.iterfind("dcc:influenceConditions/dcc:influenceCondition", NAMESPACES)
        for one in each.iterfind("dcc:data/dcc:quantity", NAMESPACES)
        for quantity in quantities_in(one, last=True)
    ]
    tables = [
        (
            text(each, "dcc:name/dcc:content"),
            [_row(quantity, "", _limits(one)) for one in _plain(each) for quantity in quantities_in(one)],
        )
        for each in element.iterfind("dcc:results/dcc:result", NAMESPACES)
    ]
    return _Section(
        text(element, "dcc:name/dcc:content"),
        methods,
        [
            _joined(text(each, "dcc:name/dcc:content"), text(each, "dcc:release"))
            for each in element.iterfind("dcc:usedSoftware/dcc:software", NAMESPACES)
        ],
        [_equipment(each) for each in element.iterfind(".//dcc:measuringEquipment", NAMESPACES)],
        conditions,
        [(name, rows) for name, rows in tables if rows],
        [text(each, "dcc:fileName") for each in element.iterfind("dcc:results//dcc:byteData", NAMESPACES)],
    )


def _plain(result: _Element) -> Sequence[_Element]:
    """The quantities of a result but for the covariance, which only a machine wants."""
    return [
        each
        for each in quantities_of([result])
        if "inertial_covariance" not in each.get("refType", "").split()
    ]


def _equipment(element: _Element) -> tuple[str, ...]:
    """Name, maker and model, serial number, certificate, its validity, what of the budget it stands behind."""
    return (
        text(element, "dcc:name/dcc:content"),
        _joined(text(element, "dcc:manufacturer/dcc:name/dcc:content"), text(element, "dcc:model")),
        text(element, "dcc:identifications/dcc:identification/dcc:value"),
        text(element, "dcc:certificate/dcc:referralID"),
        text(element, "dcc:certificate/dcc:referral/dcc:content"),
        text(element, "dcc:certificate/dcc:description/dcc:content"),
        text(element, "dcc:description/dcc:content"),
    )


def _limits(element: _Element) -> str:
    """Conformity and limits of a quantity in its unit; empty where none is stated."""
    verdict = text(element, "dcc:measurementMetaData/dcc:metaData/dcc:conformity")
    ends = element.iterfind("dcc:measurementMetaData/dcc:metaData/dcc:data/dcc:quantity", NAMESPACES)
    values = [f"{quantity.value:.6g}" for each in ends for quantity in quantities_in(each, last=True)]
    return f"{verdict}: {' to '.join(values)}" if values else verdict


def _row(quantity: CertifiedValue, name: str = "", limits: str = "") -> _Row:
    """A number rounded by its uncertainty, and the same in the unit of the field."""
    words = (name or quantity.name).removeprefix(f"{quantity.label}: ")
    value, U = _rounded(quantity.value, quantity.U, quantity.k)
    k = "" if math.isnan(quantity.k) else f"{quantity.k:.2f}"
    unit = "" if quantity.unit == "1" else plain_unit(quantity.unit)
    return _Row(quantity.label, words, value, U, k, unit, _in_field(quantity), limits)


def _rounded(value: float, U: float, k: float) -> tuple[str, str]:
    """Value and U as texts; a value without uncertainty as it is."""
    if not (math.isfinite(U) and k > 0.0):
        return f"{value:.10g}", ""
    shown, _, expanded = rounded(value, U / k, U)
    return shown, expanded


def _in_field(quantity: CertifiedValue) -> str:
    """Value and U in deg/h, ug, arcsec, ppm, ...; empty where the unit is that already, or a scale factor near 1."""
    try:
        coherent = dsi(quantity.unit)[1] == 1.0 and "count" not in quantity.unit
    except QuantityError:
        return ""
    unit, size = shown_unit(quantity.unit)
    if not coherent or unit == quantity.unit or (unit == "ppm" and abs(quantity.value) > 0.1):
        return ""
    value, U = _rounded(quantity.value / size, quantity.U / size, quantity.k)
    return f"{value} ± {U} {plain_unit(unit)}" if U else f"{value} {plain_unit(unit)}"
