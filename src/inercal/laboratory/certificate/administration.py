"""Administrative data of a certificate: number, days, item, laboratory, persons, customer, statements."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import TYPE_CHECKING

from inercal import __version__
from inercal.foundation.instruments.reference_types import OTHERS, PREFIX, reference_types
from inercal.laboratory.certificate.elements import dcc, optional, plain, words

if TYPE_CHECKING:
    from lxml.etree import _Element

    from inercal.faces.studies.laboratory import AddressTable
    from inercal.laboratory.certificate.lab import LabFile

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


def software() -> _Element:
    """The element of the software: this program."""
    return dcc("software", words("name", "inercal"), dcc("release", __version__), dcc("type", "application"))


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
