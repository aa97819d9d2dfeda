"""A certificate written: results of one instrument as XML that is valid by the schema."""

from __future__ import annotations

import datetime
from collections.abc import Sequence

from lxml import etree

from inercal.errors import InputError
from inercal.estimate.result import Estimate
from inercal.findings import Status
from inercal.laboratory.certificate.administration import administrative
from inercal.laboratory.certificate.elements import DCC, NAMESPACES, XSI, plain
from inercal.laboratory.certificate.lab import LabFile, joined, sources_known
from inercal.laboratory.certificate.results import measured
from inercal.laboratory.certificate.schema import VERSION, fault


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
    pages = [*reports, *[None] * (len(estimates) - len(reports))]
    results = etree.Element(f"{{{DCC}}}measurementResults", nsmap=NAMESPACES)
    results.extend(measured(estimate, stated, page) for estimate, page in zip(estimates, pages, strict=True))
    types = [text for each in results.iter() if (text := each.get("refType")) is not None]
    root = etree.Element(f"{{{DCC}}}digitalCalibrationCertificate", nsmap={**NAMESPACES, "xsi": XSI})
    root.set("schemaVersion", VERSION)
    root.set(f"{{{XSI}}}schemaLocation", f"{DCC} https://ptb.de/dcc/v{VERSION}/dcc.xsd")
    root.append(administrative(stated, number, issued.isoformat(), supersedes, types))
    root.append(results)
    etree.indent(root, " ")
    wrong = fault(root)
    if wrong is not None:
        raise InputError("certificate", f"does not meet the schema DCC {VERSION}: {wrong}")
    made: bytes = etree.tostring(root, xml_declaration=True, encoding="UTF-8")
    return made
