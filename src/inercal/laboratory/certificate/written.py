"""A certificate written: results of one instrument as XML that is valid by the schema."""

from __future__ import annotations

import datetime
from collections.abc import Sequence

from lxml import etree

from inercal.foundation.addresses import without_secrets
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Status
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import shown
from inercal.laboratory.certificate.administration import administrative
from inercal.laboratory.certificate.elements import DCC, NAMESPACES, XSI, plain
from inercal.laboratory.certificate.lab import LabFile, joined, sources_known
from inercal.laboratory.certificate.results import limits_used, measured, statement
from inercal.laboratory.certificate.schema import VERSION, fault
from inercal.laboratory.specification import Conformity, Specification, judged, specification_of


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
