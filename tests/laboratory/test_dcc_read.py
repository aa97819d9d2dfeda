"""Certificates read: back to the last digit, those of others, and hostile ones refused."""

import json
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from certified import DAY, certified, lab_of, mixed
from lxml import etree
from made import result as made

import inercal as ic
from inercal.foundation.errors import InputError
from inercal.foundation.results.files import save, to_json
from inercal.laboratory.certificate.elements import NAMESPACES, parsed
from inercal.laboratory.certificate.page import page
from inercal.laboratory.certificate.reading import estimate_of_certificate, read_certificate
from inercal.laboratory.certificate.written import certificate

PTB = sorted((Path(__file__).parents[1] / "data" / "dcc").glob("*.xml"))


@pytest.mark.parametrize("seed", range(5))
def test_values_come_back_to_the_last_digit(tmp_path, seed):
    """Values, U, k, covariance and units, by the numbers of the XML and by the result inside."""
    estimate = mixed(seed=seed)
    found = read_certificate(certified(tmp_path, estimate))
    assert (found.validated, found.number, found.item) == (True, "C-1", "Maker Model 17")
    (one,) = found.results
    assert [q.label for q in one.quantities] == list(estimate.names)
    for q, p in zip(one.quantities, estimate.parameters.values(), strict=True):
        assert (q.value, q.U, q.k, q.probability) == (p.value, p.U, p.k, 0.9545)
    assert [q.unit for q in one.quantities] == [
        "count",
        "count/(m/s^2)",
        "rad",
        "deg/s",
        "rad/sqrt(s)",
        "s^2/m",
    ]
    assert np.array_equal(one.region.covariance, estimate.covariance)
    assert to_json(one.estimate) == to_json(estimate)


def without_the_result(path):
    """The certificate without the file of inercal, as another program would write it."""
    root = etree.parse(path).getroot()
    for each in root.xpath(".//dcc:result[@refType='inertial_files']", namespaces=NAMESPACES):
        each.getparent().remove(each)
    path.write_bytes(etree.tostring(root))
    return path


def test_numbers_alone_make_an_estimate(tmp_path):
    estimate = mixed()
    found = estimate_of_certificate(without_the_result(certified(tmp_path, estimate)))
    assert found.names == estimate.names
    assert np.array_equal(found.values, estimate.values)
    assert np.array_equal(found.covariance, estimate.covariance)
    assert found.dof[[0, 1, 4]] == pytest.approx(estimate.dof[[0, 1, 4]], rel=1e-6)


@pytest.mark.parametrize("path", PTB, ids=[path.stem for path in PTB])
def test_the_examples_of_ptb(path):
    """Schema 3.1.1; numbers as they stand in the files."""
    found = read_certificate(path)
    assert (found.version, found.validated, found.laboratory) == ("3.1.1", False, "Kalibrierfirma GmbH")
    quantities = found.results[0].quantities
    assert [q.value for q in quantities[:5]] == [306.248, 373.121, 448.253, 523.319, 593.154]
    errors = [q for q in quantities if q.name == "Measurement error"]
    assert [(q.value, q.U, q.k, q.unit) for q in errors][3] == (-0.009, 0.061, 2.0, "K")
    assert estimate_of_certificate(path).u == pytest.approx(np.full(5, 0.0305))
    assert "read, but not validated" in page(found)


def test_a_number_changed_by_hand_is_found(tmp_path):
    path = certified(tmp_path, made())
    value = repr(float(made().values[0]))
    path.write_text(path.read_text().replace(value, "1.25", 1))
    with pytest.raises(InputError, match=r"states other numbers in .* than beside the covariance"):
        read_certificate(path)
    path.write_text(certified(tmp_path, made()).read_text().replace(value, "1.25"))
    with pytest.raises(InputError, match=r"states other numbers in .* than the result inside"):
        read_certificate(path)


def test_a_certificate_stands_for_a_result(tmp_path):
    path = certified(tmp_path, made())
    save(made(), tmp_path / "result.json")
    assert np.array_equal(ic.load(path).estimate.values, made().values)
    assert ic.compare(path, tmp_path / "result.json").status.value == "ok"
    both = certificate([made(), made(1)], lab_of(tmp_path), "C", DAY)
    path.write_bytes(both)
    with pytest.raises(InputError, match="states 2 results, expected one"):
        ic.load(path)


def test_the_page_says_what_the_xml_says(tmp_path):
    estimate = replace(mixed(), values=np.array([12.5, 208.5, 1e-3, 0.01, 1e-5, 1e-6]))
    text = page(read_certificate(certified(tmp_path, estimate, reports=[b"<html></html>"])))
    names = ("C-1", "Acme Calibration", "Flight Test", "Maker Model", "A. Smith")
    for said in (*names, "22.5", "count/(m/s²)", "report.html"):
        assert said in text
    assert "<script" not in text
    assert "http" not in text.replace("http://www.w3.org", "")


# Hostile files.

HEAD = (
    '<dcc:digitalCalibrationCertificate xmlns:dcc="https://ptb.de/dcc" xmlns:si="https://ptb.de/si" '
    'schemaVersion="3.1.1">'
)
TAIL = "</dcc:digitalCalibrationCertificate>"
BEGUN = "<dcc:measurementResult><dcc:results><dcc:result><dcc:data><dcc:quantity>"
ENDED = "</dcc:quantity></dcc:data></dcc:result></dcc:results></dcc:measurementResult>"
LAUGHS = "".join(f'<!ENTITY l{i} "{f"&l{i - 1};" * 10}">' for i in range(1, 12))
HOSTILE = {
    "entity": (f"<!DOCTYPE a [<!ENTITY b 'c'>]>{HEAD}&b;{TAIL}", "declares a document type"),
    "laughs": (f"<!DOCTYPE a [<!ENTITY l0 'ha'>{LAUGHS}]>{HEAD}&l11;{TAIL}", "declares a document type"),
    "external": (f'<!DOCTYPE a SYSTEM "file:///etc/passwd">{HEAD}{TAIL}', "declares a document type"),
    "external entity": (f'<!DOCTYPE a [<!ENTITY b SYSTEM "file:///etc/passwd">]>{HEAD}&b;{TAIL}', "document type"),
    "in UTF-16": (f"<!DOCTYPE a [<!ENTITY b 'c'>]>{HEAD}&b;{TAIL}".encode("utf-16"), "declares a document type"),
    "undeclared": (f"{HEAD}&parrot;{TAIL}", "no whole XML"),
    "deep": (lambda: HEAD + "<a>" * 100_000, "more than 64 deep"),
    "many": (lambda: HEAD + "<a/>" * 5_000_000 + TAIL, "more than 200000 elements"),
    "large": (lambda: HEAD + " " * 100 * 2**20 + TAIL, "bytes, expected"),
    "attributes": (lambda: HEAD + "<a " + " ".join(f'b{i}="c"' for i in range(300_000)) + "/>" + TAIL, ""),
    "cut": (HEAD + "<dcc:administrativeData>", "no whole XML"),
    "empty": ("", "no whole XML"),
    "bytes": (bytes(range(256)) * 100, "no whole XML"),
    "zeros": (b"\0" * 2**20, "no whole XML"),
    "other": ("<html/>", "XML of another kind"),
    "number": (f"{HEAD}{BEGUN}<si:real><si:value>ten</si:value></si:real>{ENDED}{TAIL}", "a number that is none"),
}  # fmt: skip


READING = """
import json, resource, sys, time
from inercal.foundation.errors import InputError
from inercal.laboratory.certificate.reading import estimate_of_certificate as read

before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
for path in sys.argv[1:]:
    begun = time.process_time()
    try:
        said = str(read(path))
    except InputError as error:
        said = str(error)
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before
    print(json.dumps([said, time.process_time() - begun, used / 1024]))
"""


@pytest.mark.slow
def test_hostile_files_are_refused_at_once(tmp_path):
    """One after another in one process: each in 2 s of processor time, all with 500 MB beyond what imports took."""
    paths = [tmp_path / f"{name}.xml" for name in HOSTILE]
    for path, (content, _) in zip(paths, HOSTILE.values(), strict=True):
        written = content() if callable(content) else content  # the large ones when they are wanted
        path.write_bytes(written if isinstance(written, bytes) else written.encode())
    done = subprocess.run([sys.executable, "-c", READING, *paths], capture_output=True, text=True, check=True)
    answers = [json.loads(line) for line in done.stdout.splitlines()]
    for (name, (_, words)), (sentence, seconds, megabytes) in zip(HOSTILE.items(), answers, strict=True):
        assert words in sentence, name
        assert len(sentence) < 500, name
        assert "root:" not in sentence, name
        assert seconds < 2.0, name
        assert megabytes < 500.0, name


def test_a_schema_that_is_not_met_is_said(tmp_path):
    path = certified(tmp_path, made())
    path.write_text(
        path.read_text().replace("<dcc:countryCodeISO3166_1>DE", "<dcc:countryCodeISO3166_1>Germany")
    )
    with pytest.raises(InputError, match=r"does not meet the schema DCC 3.2.1: line \d+: .*countryCode"):
        read_certificate(path)


def test_nothing_outside_is_fetched(tmp_path):
    """Schema locations, inclusions and style sheets of a file are not followed."""
    path = certified(tmp_path, made())
    text = path.read_text()
    style = '<?xml-stylesheet href="http://127.0.0.1:9/x.xsl" type="text/xsl"?>'
    hint = text.replace(
        "https://ptb.de/dcc https://ptb.de/dcc/v3.2.1/dcc.xsd",
        "https://ptb.de/dcc http://127.0.0.1:9/dcc.xsd",
    )
    path.write_text(hint.replace("?>", f"?>{style}", 1))
    begun = time.perf_counter()
    assert parsed(path).tag.endswith("digitalCalibrationCertificate")
    assert read_certificate(path).validated
    assert time.perf_counter() - begun < 5.0
