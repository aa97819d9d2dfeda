"""A certificate written: administrative data and results, joined, and validated by the schema."""

from __future__ import annotations

import datetime
from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from lxml import etree

from inercal import __version__
from inercal.foundation.addresses import without_secrets
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Status
from inercal.foundation.instruments.dsi import OTHERS, PREFIX, reference_types
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import shown
from inercal.laboratory.certificate.elements import DCC, NAMESPACES, XSI, dcc, optional, plain, words
from inercal.laboratory.certificate.lab import LabFile, joined, sources_known
from inercal.laboratory.certificate.results import limits_used, measured, software, statement
from inercal.laboratory.certificate.schema import VERSION, fault
from inercal.laboratory.specification import Conformity, Specification, judged, specification_of

if TYPE_CHECKING:
    from lxml.etree import _Element

    from inercal.faces.studies.laboratory import AddressTable


GENERAL = (
    (
        "The results relate to the item calibrated alone, in the state and under the conditions at the time of the "
        "calibration.",
        "ISO/IEC 17025:2017",
        "7.8.2.1 l",
    ),
    (
        "The expanded uncertainty U is the standard uncertainty times the coverage factor k that stands beside it, "
        "which is of Student's t for a coverage probability of 95.45 %. It was found by the Guide to the expression of "
        "uncertainty in measurement.",
        "JCGM 100:2008",
        "7.8.4.1 a",
    ),
)
"""Statements of every certificate: text, norm, clause."""


def administrative(
    lab: LabFile,
    number: str,
    issued: str,
    supersedes: str | None,
    types: Iterable[str],
    conformity: _Element | None,
) -> _Element:
    """The element ``administrativeData``; ``types`` are the reference types that the certificate uses.

    ``conformity`` is the statement of that, where there is one.
    """
    return dcc(
        "administrativeData",
        dcc("dccSoftware", software()),
        _definitions(types),
        _core(lab, number, issued, supersedes),
        _items(lab),
        dcc(
            "calibrationLaboratory",
            optional("calibrationLaboratoryCode", lab.laboratory.code),
            _contact("contact", lab.laboratory),
        ),
        dcc("respPersons", *(_person(each.name, each.role, each.signs) for each in lab.persons)),
        _contact("customer", lab.customer),
        _statements(lab, conformity),
    )


def _definitions(types: Iterable[str]) -> _Element | None:
    """Meanings of the reference types that are used."""
    known = {kind: meaning for kind, (meaning, _) in reference_types().items()} | OTHERS
    used = [kind for kind in dict.fromkeys(types) if kind.startswith(PREFIX)]
    if not used:
        return None
    rows = (
        dcc(
            "refTypeDefinition",
            words("name", kind),
            words("description", known.get(kind) or known[_of_temperature(kind)]),
            dcc("namespace", PREFIX.rstrip("_")),
            dcc("link", "inercal, docs/reference/reference-types.md"),
            dcc("release", __version__),
            dcc("value", kind),
        )
        for kind in used
    )
    return dcc("refTypeDefinitions", *rows)


def _of_temperature(kind: str) -> str:
    """The type of the term whose change with temperature this is."""
    return kind.rpartition("_")[0]


def _core(lab: LabFile, number: str, issued: str, supersedes: str | None) -> _Element:
    """Number, days and place."""
    replaced = None
    if supersedes is not None:
        replaced = dcc(
            "reportAmendedSubstituted",
            dcc("typeOfChange", "substituted"),
            dcc("replacedUniqueIdentifier", supersedes),
        )
    order = lab.order
    return dcc(
        "coreData",
        dcc("countryCodeISO3166_1", lab.laboratory.country),
        dcc("usedLangCodeISO639_1", "en"),
        dcc("mandatoryLangCodeISO639_1", "en"),
        dcc("uniqueIdentifier", number),
        _identifications([("calibrationLaboratory", order.number, "Order no.")]),
        optional("receiptDate", order.received),
        dcc("beginPerformanceDate", order.begin),
        dcc("endPerformanceDate", order.end),
        dcc("performanceLocation", order.place),
        dcc("issueDate", issued),
        replaced,
    )


def _identifications(rows: Sequence[tuple[str, str, str]]) -> _Element | None:
    """Issuer, number and name of identifications; those without a number are left out."""
    made = [
        dcc("identification", dcc("issuer", issuer), dcc("value", value), words("name", name))
        for issuer, value, name in rows
        if plain(value)
    ]
    return dcc("identifications", *made) if made else None


def _items(lab: LabFile) -> _Element:
    """The instrument."""
    item = lab.item
    maker = dcc("manufacturer", words("name", item.maker)) if plain(item.maker) else None
    return dcc(
        "items",
        dcc(
            "item",
            words("name", " ".join(filter(None, (item.maker, item.model)))),
            maker,
            dcc("model", item.model),
            _identifications([("manufacturer", item.serial, "Serial no."), ("owner", item.owner, "Owner")]),
        ),
    )


def _contact(name: str, place: AddressTable) -> _Element:
    """Name and address of a company."""
    location = dcc(
        "location",
        optional("city", place.city),
        optional("countryCode", place.country),
        optional("postCode", place.post_code),
        optional("street", place.street),
    )
    return dcc(
        name,
        words("name", place.name),
        optional("eMail", place.email),
        optional("phone", place.phone),
        location,
    )


def _person(name: str, role: str, signs: bool) -> _Element:
    """A person who answers for the certificate."""
    return dcc(
        "respPerson",
        dcc("person", words("name", name)),
        optional("role", role),
        dcc("mainSigner", "true" if signs else "false"),
    )


def _statements(lab: LabFile, conformity: _Element | None) -> _Element:
    """Statements of every certificate, and those of the laboratory."""
    rows = [
        dcc("statement", dcc("norm", norm), dcc("reference", clause), words("declaration", text))
        for text, norm, clause in GENERAL
    ]
    rows.append(
        dcc(
            "statement",
            dcc("traceable", "true"),
            dcc("norm", "ISO/IEC 17025:2017"),
            dcc("reference", "7.8.4.1 c"),
            words("declaration", lab.statements.traceability),
            ref_type="basic_metrologicallyTraceableToSI",
        )
    )
    rows += [dcc("statement", words("declaration", text)) for text in lab.statements.remarks]
    return dcc("statements", *rows, conformity)


def certificate(
    estimates: Sequence[Estimate],
    lab: LabFile,
    number: str,
    issued: datetime.date,
    reports: Sequence[bytes | None] = (),
    supersedes: str | None = None,
    where: object = "lab.toml",
) -> bytes:
    """A digital calibration certificate (DCC 3.2.1) of results of one instrument.

    Parameters
    ----------
    estimates : sequence of Estimate
        All of status ``ok``, with coefficients.
    lab : LabFile
        What the laboratory states (`inercal.laboratory.certificate.lab.read_lab`); the studies of the results win.
    number : str
        Number of the certificate.
    issued : date
    reports : sequence of bytes or None
        Pages of the results, in their order, to be put inside.
    supersedes : str, optional
        Number of the certificate that this one replaces.
    where : object
        Named in errors: the file of ``lab``.

    Raises
    ------
    InputError
        A result that is not ``ok``, or none; several instruments; what must be stated and is not, all of it in one
        sentence; a number without uncertainty.
    """
    if not estimates:
        raise InputError("certificate", "found no result, expected one or more")
    if not plain(number):
        raise InputError("--number", "found an empty text, expected the number of the certificate")
    for estimate in estimates:
        if estimate.status is not Status.OK:
            raise InputError(
                "certificate",
                f"found a result of `{estimate.command}` that is {estimate.status.value}: {estimate.message}; only one "
                "that is ok gets a certificate",
            )
        if not estimate.names:
            raise InputError(
                "certificate",
                f"found a result of `{estimate.command}` without coefficients, expected some to certify",
            )
    stated = joined(lab, estimates, where)
    sources_known(stated.equipment, estimates, where)
    specification, verdicts = _conformity(stated, estimates, where)
    pages = [*reports, *[None] * (len(estimates) - len(reports))]
    results = etree.Element(f"{{{DCC}}}measurementResults", nsmap=NAMESPACES)
    each = zip(estimates, verdicts, pages, strict=True)
    results.extend(measured(estimate, stated, verdict, page) for estimate, verdict, page in each)
    types = [text for one in results.iter() if (text := one.get("refType")) is not None]
    root = etree.Element(f"{{{DCC}}}digitalCalibrationCertificate", nsmap={**NAMESPACES, "xsi": XSI})
    root.set("schemaVersion", VERSION)
    root.set(f"{{{XSI}}}schemaLocation", f"{DCC} https://ptb.de/dcc/v{VERSION}/dcc.xsd")
    found = [each for verdict in verdicts for each in verdict.values()]
    conform = statement(specification, found) if found else None
    root.append(administrative(stated, number, issued.isoformat(), supersedes, types, conform))
    root.append(results)
    for element in root.iter():
        text = element.text or ""
        if element.tag != f"{{{DCC}}}dataBase64" and (clean := without_secrets(text)) != text:
            raise InputError(
                "certificate",
                f"found a secret in the address {shown(clean)}, expected it without login and query, for a certificate "
                "is handed out",
            )
    etree.indent(root, " ")
    wrong = fault(root)
    if wrong is not None:
        raise InputError("certificate", f"does not meet the schema DCC {VERSION}: {wrong}")
    made: bytes = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
    return made + b"\n"


def _conformity(
    lab: LabFile, estimates: Sequence[Estimate], where: object
) -> tuple[Specification, list[dict[str, Conformity]]]:
    """The specification, and the conformity of each result."""
    specification = specification_of(lab.specification, where)
    limits_used(specification, estimates, where)
    return specification, [judged(estimate, specification) for estimate in estimates]
