"""Certificates read: of inercal back to the last digit, of others what they state as numbers of D-SI."""

from __future__ import annotations

import base64
import binascii
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from scipy.linalg import block_diag
from scipy.optimize import brentq

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Status
from inercal.foundation.instruments.dsi import PREFIX, as_written, from_dsi
from inercal.foundation.results.files import parse
from inercal.foundation.results.result import COVERAGE, Estimate, coverage_factor
from inercal.foundation.units import shown
from inercal.laboratory.certificate.elements import DCC, NAMESPACES, parsed, tree_of
from inercal.laboratory.certificate.schema import VERSION, fault
from inercal.laboratory.limits import LIMITS

if TYPE_CHECKING:
    from lxml.etree import _Element

T = TypeVar("T")


@dataclass(frozen=True)
class CertifiedValue:
    """One number of a certificate: ``value`` and ``U`` in ``unit``, as inercal writes units; ``k`` and ``probability``.

    ``U``, ``k`` and ``probability`` are NaN where none is stated.
    """

    name: str
    label: str
    reference_types: tuple[str, ...]
    value: float
    U: float
    k: float
    probability: float
    unit: str


@dataclass(frozen=True, eq=False)
class Region:
    """Coefficients with their covariance (p, p), in their own ``units``."""

    names: tuple[str, ...]
    units: tuple[str, ...]
    values: Array
    U: Array
    covariance: Array


@dataclass(frozen=True, eq=False)
class Measured:
    """One measurement result: its quantities, its region, and the result of inercal where that is inside."""

    name: str
    quantities: tuple[CertifiedValue, ...]
    region: Region | None
    estimate: Estimate | None


@dataclass(frozen=True, eq=False)
class Certificate:
    """A certificate that was read; ``validated`` where its schema is the one that ships."""

    root: _Element
    version: str
    validated: bool
    signed: bool
    number: str
    laboratory: str
    item: str
    results: tuple[Measured, ...]


def read_certificate(path: str | Path) -> Certificate:
    """Read a digital calibration certificate of any version.

    One of the version that ships is checked against its schema; of others only what is understood is read. Signatures
    are not verified.

    Raises
    ------
    InputError
        In one sentence: no certificate, damaged, hostile, not valid, or with other numbers than the result inside.
    """
    return _certificate(parsed(path), path)


def certificate_of(data: bytes, path: str | Path) -> Certificate:
    """As `read_certificate`, of bytes that are to be written to ``path``."""
    return _certificate(tree_of(data, path), path)


def _certificate(root: _Element, path: str | Path) -> Certificate:
    """The certificate of a tree."""
    if root.tag != f"{{{DCC}}}digitalCalibrationCertificate":
        raise InputError(path, "is XML of another kind, expected a digital calibration certificate")
    version = root.get("schemaVersion", "")
    if version == VERSION and (wrong := fault(root)) is not None:
        raise InputError(path, f"does not meet the schema DCC {VERSION}: {wrong}")
    try:
        results = tuple(
            _measured(each, path) for each in root.iterfind(".//dcc:measurementResult", NAMESPACES)
        )
    except (ValueError, OverflowError) as error:
        raise InputError(path, f"holds a number that is none ({str(error)[:80]}), expected D-SI") from error
    return Certificate(
        root,
        version,
        version == VERSION,
        root.find("{http://www.w3.org/2000/09/xmldsig#}Signature") is not None,
        text(root, ".//dcc:coreData/dcc:uniqueIdentifier"),
        text(root, ".//dcc:calibrationLaboratory/dcc:contact/dcc:name/dcc:content"),
        _item(root),
        results,
    )


def text(root: _Element, path: str) -> str:
    """The text of the first element at a path; of several languages English where there is some."""
    found = root.findall(path, NAMESPACES)
    best = next((each for each in found if each.get("lang") == "en"), found[0] if found else None)
    return " ".join((best.text or "").split()) if best is not None else ""


def _item(root: _Element) -> str:
    """The item calibrated, with its serial number."""
    serials = root.iterfind(".//dcc:items/dcc:item/dcc:identifications/dcc:identification", NAMESPACES)
    made = (each for each in serials if text(each, "dcc:issuer") == "manufacturer")
    serial = next((text(each, "dcc:value") for each in made), "")
    return " ".join(filter(None, (text(root, ".//dcc:items/dcc:item/dcc:name/dcc:content"), serial)))


def _measured(element: _Element, path: str | Path) -> Measured:
    """The measurement result of an element."""
    region = None
    quantities: list[CertifiedValue] = []
    for each in quantities_of(element.iterfind("dcc:results/dcc:result", NAMESPACES)):
        if f"{PREFIX}covariance" in each.get("refType", "").split():
            region = _region(each)
        else:
            quantities += quantities_in(each)
    estimate = _inside(element, path)
    found = Measured(text(element, "dcc:name/dcc:content"), tuple(quantities), region, estimate)
    if region is not None and not _consistent(found.quantities, region):
        raise InputError(
            path, f"states other numbers in {shown(found.name)} than beside the covariance, expected the same"
        )
    if estimate is not None and not _agree(found, estimate):
        raise InputError(
            path, f"states other numbers in {shown(found.name)} than the result inside, expected the same"
        )
    return found


def quantities_of(results: Iterable[_Element]) -> Iterator[_Element]:
    """The quantities of results, but for those inside another, as its limits."""
    for each in results:
        for found in each.iterfind("dcc:data//dcc:quantity", NAMESPACES):
            if next(found.iterancestors(f"{{{DCC}}}measurementMetaData"), None) is None:
                yield found


def quantities_in(element: _Element, last: bool | None = None) -> Iterator[CertifiedValue]:
    """The numbers of a quantity, each in one unit: where several are stated the ``last`` one, or the first.

    None: the last of ours, which is that of the result, and the first of others, which is that of D-SI.
    """
    name = text(element, "dcc:name/dcc:content")
    kinds = tuple(element.get("refType", "").split())
    if last is None:
        last = any(kind.startswith(PREFIX) for kind in kinds)
    reals = element.findall("si:real", NAMESPACES) + element.findall("si:hybrid/si:real", NAMESPACES)
    if reals:
        yield _real(reals[-1 if last else 0], name, kinds)
    hybrid = element.findall("si:hybrid/si:realListXMLList", NAMESPACES)
    lists = element.findall("si:realListXMLList", NAMESPACES) + hybrid
    if lists:
        yield from _list(lists[-1 if last else 0], name, kinds)


def _real(element: _Element, name: str, kinds: tuple[str, ...]) -> CertifiedValue:
    """A number with its expanded uncertainty."""
    stated = (
        _number(element, f"si:expandedUnc/si:{key}")
        for key in ("uncertainty", "coverageFactor", "coverageProbability")
    )
    U, k, probability = stated
    value = _number(element, "si:value")
    unit = from_dsi(text(element, "si:unit"))
    return CertifiedValue(name, text(element, "si:label"), kinds, value, U, k, probability, unit)


def _number(element: _Element, path: str) -> float:
    """The number at a path; NaN where there is none."""
    found = text(element, path)
    return float(found) if found else math.nan


def _list(element: _Element, name: str, kinds: tuple[str, ...]) -> Iterator[CertifiedValue]:
    """The numbers of a list; what is stated once is of all."""
    values = [float(each) for each in text(element, "si:valueXMLList").split()]
    count = len(values)
    labels = text(element, "si:labelXMLList").split()
    units = _spread([from_dsi(each) for each in text(element, "si:unitXMLList").split()], count, "")
    U, k, probability = (
        _spread(
            [float(each) for each in text(element, f"si:expandedUncXMLList/si:{key}XMLList").split()],
            count,
            math.nan,
        )
        for key in ("uncertainty", "coverageFactor", "coverageProbability")
    )
    for i, value in enumerate(values):
        label = labels[i] if len(labels) == count else ""
        yield CertifiedValue(name, label, kinds, value, U[i], k[i], probability[i], units[i])


def _spread(stated: list[T], count: int, absent: T) -> list[T]:
    """As many as there are values: what was stated for each, once for all, or not at all."""
    return stated if len(stated) == count else (stated or [absent])[:1] * count


def _region(element: _Element) -> Region:
    """The coefficients with their covariance, in their own units: the last list."""
    found = element.findall(".//si:realListXMLList", NAMESPACES)[-1]
    quantities = list(_list(found, "", ()))
    columns = found.findall(".//si:covarianceMatrix/si:column", NAMESPACES)
    matrix = np.array([[_number(each, "si:value") for each in column] for column in columns]).T
    if matrix.shape != (len(quantities), len(quantities)):
        raise ValueError("a covariance of another size than the values")
    return Region(
        tuple(q.label for q in quantities),
        tuple(q.unit for q in quantities),
        np.array([q.value for q in quantities]),
        np.array([q.U for q in quantities]),
        matrix,
    )


def _inside(element: _Element, path: str | Path) -> Estimate | None:
    """The result of inercal that lies inside."""
    for each in element.iterfind("dcc:results//dcc:byteData", NAMESPACES):
        if f"{PREFIX}result" in each.get("refType", "").split():
            try:
                content = base64.b64decode(text(each, "dcc:dataBase64"), validate=True)
            except binascii.Error as error:
                raise InputError(path, "holds a result that is damaged, expected base64") from error
            try:
                return parse(content, "result.json")
            except InputError as error:
                raise InputError(path, f"holds a result that cannot be read: {error.message}") from error
    return None


def _consistent(quantities: Sequence[CertifiedValue], region: Region) -> bool:
    """True if the covariance element repeats the same numbers."""
    stated = {each.label: (each.value, each.U) for each in quantities if each.label}
    there = zip(region.names, region.values.tolist(), region.U.tolist(), strict=True)
    return all(stated.get(name, (value, U)) == (value, U) for name, value, U in there)


def _agree(found: Measured, estimate: Estimate) -> bool:
    """True where the certificate states the numbers of the result, to the last digit."""
    quantities = {each.label: each for each in found.quantities if each.label}
    region = found.region
    if region is None or region.names != estimate.names:
        return False
    same = all(
        (q := quantities.get(p.name)) is not None
        and (q.value, q.U, q.k, q.unit) == (p.value, p.U, p.k, from_dsi(as_written(p.unit)))
        for p in estimate.parameters.values()
    )
    return (
        same
        and np.array_equal(region.values, estimate.values)
        and np.array_equal(region.U, estimate.k * estimate.u)
        and np.array_equal(region.covariance, estimate.covariance)
    )


def estimate_of_certificate(path: str | Path) -> Estimate:
    """The result that a certificate states: that of inercal inside, or one of its numbers.

    Of numbers alone the standard uncertainty is U / k, degrees of freedom are those of k, and covariances that are not
    stated are 0.

    Raises
    ------
    InputError
        As `read_certificate`; several results, or none with numbers.
    """
    found = read_certificate(path)
    inside = [each.estimate for each in found.results if each.estimate is not None]
    if len(inside) > 1:
        raise InputError(path, f"states {len(inside)} results, expected one")
    return inside[0] if inside else _of_numbers(found, path)


def _of_numbers(found: Certificate, path: str | Path) -> Estimate:
    """An estimate of all numbers with an uncertainty."""
    names: list[str] = []
    stated: list[CertifiedValue] = []
    blocks: list[Array] = []
    for each in found.results:
        known = [q for q in each.quantities if math.isfinite(q.U) and q.k > 0.0]
        stated += known
        region = each.region
        if region is not None and region.names == tuple(q.label for q in known):
            blocks.append(region.covariance)
        else:
            blocks += [np.array([[(q.U / q.k) ** 2]]) for q in known]
    if not stated:
        raise InputError(path, "states no number with an expanded uncertainty, expected some")
    begun = [(q.label or q.name or "quantity").replace(" ", "_") for q in stated]
    for i, name in enumerate(begun):
        names.append(name if begun.count(name) == 1 else f"{name}_{begun[: i + 1].count(name)}")
    return Estimate(
        command="certificate",
        names=tuple(names),
        units=tuple(q.unit for q in stated),
        values=np.array([q.value for q in stated]),
        covariance=block_diag(*blocks),
        dof=np.array([_dof(q.k, q.probability) for q in stated]),
        status=Status.OK,
        message=f"certificate {found.number} of {found.laboratory}",
        traceability={"instrument": found.item, "reference": found.number},
    )


def _dof(k: float, probability: float) -> float:
    """Degrees of freedom of which k is the factor of Student's t; infinite for k = 2, which is often said of 95 %."""
    p = probability if 0.0 < probability < 1.0 else COVERAGE
    if k == 2.0 or k <= coverage_factor(math.inf, p) * (1.0 + 1e-9):
        return math.inf
    if k >= coverage_factor(LIMITS.fewest_dof, p):
        return LIMITS.fewest_dof
    inverse = brentq(lambda x: coverage_factor(1.0 / x, p) - k, 1e-9, 1.0 / LIMITS.fewest_dof)
    return 1.0 / float(inverse)
