"""Certificates written: valid by the schema, true to the last digit, refused where something is missing."""

from dataclasses import replace
from decimal import Decimal

import numpy as np
import pytest
from certified import DAY, LAB, certified, lab_of, mixed, with_units
from lxml import etree
from made import result as made
from scipy import stats

from inercal.foundation.errors import InputError
from inercal.foundation.findings import Status
from inercal.foundation.instruments.dsi import dsi
from inercal.foundation.results.budget import BudgetItem
from inercal.laboratory.certificate.elements import NAMESPACES, factor, plain
from inercal.laboratory.certificate.lab import LabFile, lab_template, read_lab
from inercal.laboratory.certificate.page import page
from inercal.laboratory.certificate.reading import read_certificate
from inercal.laboratory.certificate.schema import fault
from inercal.laboratory.certificate.written import certificate
from rows import for_each


def texts(root, path):
    """All texts at a path."""
    return [each.text for each in root.iterfind(path, NAMESPACES)]


def refused(folder, *estimates, text=LAB, **more):
    """The sentence in which a certificate is refused."""
    with pytest.raises(InputError) as error:
        certificate(estimates, lab_of(folder, text), "C-1", DAY, where="lab.toml", **more)
    return str(error.value)


def test_numbers_stand_in_si_and_in_their_own_unit(tmp_path):
    """Read by XPath and Decimal alone: D-SI values are the result's times the size of its unit, to the last digit."""
    estimate = mixed()
    root = etree.parse(certified(tmp_path, estimate)).getroot()
    assert fault(root) is None
    for p in estimate.parameters.values():
        (found,) = root.xpath(f".//si:real[si:label='{p.name}'][1]", namespaces=NAMESPACES)
        text, size = dsi(p.unit)
        assert found.findtext("si:unit", namespaces=NAMESPACES) == text
        assert Decimal(found.findtext("si:value", namespaces=NAMESPACES)) == Decimal(repr(p.value * size))
        stated = texts(found, "si:expandedUnc/*")
        assert list(map(Decimal, stated)) == [Decimal(repr(x)) for x in (p.U * size, p.k, 0.9545)]


def test_the_covariance_is_that_of_the_values_in_their_units(tmp_path):
    estimate = mixed()
    root = etree.parse(certified(tmp_path, estimate)).getroot()
    in_si, own = root.findall(".//si:hybrid/si:realListXMLList", NAMESPACES)
    sizes = np.array([dsi(unit)[1] for unit in estimate.units])
    for found, size in ((in_si, sizes), (own, np.ones(6))):
        matrix = np.array(list(map(float, texts(found, ".//si:covariance/si:value")))).reshape(6, 6)
        assert np.array_equal(matrix, estimate.covariance * np.outer(size, size))
        assert found.findtext("si:labelXMLList", namespaces=NAMESPACES).split() == list(estimate.names)
    units = texts(in_si, ".//si:covariance/si:unit")
    assert units[1] == dsi("s^2/m")[0]
    assert texts(own, ".//si:covariance/si:unit")[1] == "(count/(m/s^2))*(count)"


def test_the_region_of_all_coefficients_covers_at_least_as_stated(tmp_path):
    """100 000 draws of the coefficients with their scatter known from 3.5 degrees of freedom; Bonferroni."""
    estimate = replace(made(), dof=np.full(3, 3.5))
    root = etree.parse(certified(tmp_path, estimate)).getroot()
    k = float(root.findtext(".//si:rectangularRegionXMLList/si:coverageFactor", namespaces=NAMESPACES))
    assert k == pytest.approx(stats.t.ppf(1 - 0.0455 / 6, 3.5), rel=1e-9)
    rng = np.random.default_rng(24)
    z = rng.multivariate_normal(np.zeros(3), estimate.correlation, size=100_000)
    inside = np.all(np.abs(z) < k * np.sqrt(rng.chisquare(3.5, size=(100_000, 1)) / 3.5), axis=1).mean()
    assert inside > 0.9545 - 3 * np.sqrt(0.9545 * 0.0455 / 1e5)


def test_who_for_whom_and_what(tmp_path):
    root = etree.parse(certified(tmp_path, made(), supersedes="C-0")).getroot()
    core = root.find(".//dcc:coreData", NAMESPACES)
    assert texts(core, "dcc:uniqueIdentifier") + texts(core, "dcc:issueDate") == ["C-1", "2026-02-01"]
    assert texts(core, "dcc:beginPerformanceDate") == ["2026-01-30"]
    assert texts(core, ".//dcc:replacedUniqueIdentifier") == ["C-0"]
    assert texts(root, ".//dcc:respPerson//dcc:content") == ["A. Smith", "B. Jones"]
    assert texts(root, ".//dcc:calibrationLaboratoryCode") == ["D-K-1"]
    assert "17" in texts(root, ".//dcc:items//dcc:value")
    assert "Gravity is traceable to the gravity network." in texts(root, ".//dcc:declaration/dcc:content")
    used = {
        word
        for each in root.iter()
        for word in each.get("refType", "").split()
        if word.startswith("inertial_")
    }
    assert used == set(texts(root, ".//dcc:refTypeDefinition/dcc:value"))
    assert {"inertial_K1", "inertial_M"} <= used


def test_all_that_is_missing_is_one_sentence(tmp_path):
    found = refused(tmp_path, made(date=""), text="")
    keys = {
        "laboratory": ("name", "street", "city", "country"),
        "customer": ("name", "city"),
        "item": ("serial",),
        "order": ("begin", "end"),
        "persons": ("name",),
        "conditions": ("temperature",),
        "statements": ("traceability",),
    }
    assert found.startswith("lab.toml: ")
    assert found.count("missing") == 1
    assert all(f"{table}.{key}" in found for table, names in keys.items() for key in names)


def test_a_study_wins_over_the_laboratory(tmp_path):
    study = {
        "laboratory": {"city": "Bremen"},
        "equipment": {"table": {"name": "rate table", "certificate": "K-7", "budget": ["turn angle"]}},
        "conditions": {"humidity": "30 %"},
    }
    estimate = replace(
        made(),
        provenance={"settings": study},
        traceability={"maker": "Other", "serial": "18", "date": "2026-03-01"},
        budget=(BudgetItem("turn angle", "B", 1e-5, "rad", {}),),
    )
    lab = LAB.replace("begin = 2026-01-30\nend = 2026-01-31\n", "").replace(
        "[item]", '[equipment.table]\nname = "old"\n[item]'
    )
    root = etree.fromstring(certificate([estimate], lab_of(tmp_path, lab), "C", DAY))
    assert texts(root, ".//dcc:calibrationLaboratory//dcc:city") == ["Bremen"]
    assert texts(root, ".//dcc:measuringEquipment/dcc:name/dcc:content") == ["rate table"]
    assert texts(root, ".//dcc:certificate/dcc:referralID") == ["K-7"]
    assert "stands behind the budget's turn angle" in texts(root, ".//dcc:measuringEquipment//dcc:content")
    assert texts(root, ".//dcc:item/dcc:manufacturer//dcc:content") == ["Other"]
    assert "18" in texts(root, ".//dcc:item//dcc:value")
    assert texts(root, ".//dcc:endPerformanceDate") == ["2026-03-01"]
    (humidity,) = root.xpath(
        ".//dcc:influenceCondition[@refType='basic_humidityRelative']", namespaces=NAMESPACES
    )
    assert texts(humidity, ".//si:value") == ["0.3"]


def test_results_of_one_instrument_join_and_of_several_do_not(tmp_path):
    one = replace(made(), traceability={"maker": "M", "model": "G", "serial": "1"})
    noise = replace(made(1, names=("N_gyro_x",)), traceability={"model": "G", "serial": "1"})
    root = etree.fromstring(certificate([one, noise], lab_of(tmp_path), "C", DAY))
    assert len(root.findall(".//dcc:measurementResult", NAMESPACES)) == 2
    other = replace(noise, traceability={"model": "G", "serial": "2"})
    assert "found results of several instruments (serial '1' and '2')" in refused(tmp_path, one, other)
    named = [replace(noise, traceability={"instrument": text}) for text in ("G 1", "G 2")]
    assert "several instruments ('G 1' and 'G 2')" in refused(tmp_path, *named)


def test_conformity_by_the_stated_rule(tmp_path):
    """Simple acceptance and the guard band disagree where a value is within its limits by less than U."""
    estimate = replace(made(values=(1.0, 1.0, 0.5), u=0.01), dof=np.full(3, np.inf))
    limits = 'K1 = ["0.99", "1.3"]\nM_xy = "0.4 rad"\n'
    estimate = with_units(estimate, "1", "1", "rad")
    for rule, verdicts in (("simple acceptance", "pass pass fail"), ("guard band", "fail fail fail")):
        lab = lab_of(tmp_path, f'{LAB}[specification]\ndecision = "{rule}"\n{limits}')
        root = etree.fromstring(certificate([estimate], lab, "C", DAY))
        assert texts(root, ".//dcc:metaData/dcc:conformity") == verdicts.split()
        assert texts(root, ".//dcc:statement/dcc:conformity") == ["fail"]
        assert texts(root, ".//dcc:metaData/dcc:data//si:value") == [
            "0.99",
            "1.3",
            "0.99",
            "1.3",
            "-0.4",
            "0.4",
        ]
        (said,) = root.xpath(".//dcc:statement[@refType='basic_conformity']", namespaces=NAMESPACES)
        assert rule in said.findtext("dcc:declaration/dcc:content", namespaces=NAMESPACES)
    probability = stats.norm.cdf(30) - stats.norm.cdf(-1)
    (first, *_) = texts(root, ".//dcc:metaData/dcc:declaration/dcc:content")
    assert float(first.rpartition(" ")[2]) == pytest.approx(probability, rel=1e-9)
    path = tmp_path / "certificate.xml"
    path.write_bytes(etree.tostring(root))
    assert [q.label for q in read_certificate(path).results[0].quantities] == list(estimate.names)
    assert "fail: 0.99 to 1.3" in page(read_certificate(path))
    lab = f'{LAB}[specification]\nD_F_x = "1 deg/h"\n'
    assert "specification.D_F_x: found limits of what no result has" in refused(tmp_path, made(), text=lab)


def test_what_gets_no_certificate(tmp_path):
    poor = replace(made(), status=Status.SUSPECT, message="doubtful")
    assert "a result of `calibrate imu` that is suspect: doubtful" in refused(tmp_path, made(), poor)
    nothing = made(names=())
    assert "without coefficients" in refused(tmp_path, nothing)
    assert "no result" in refused(tmp_path)
    unknown = replace(made(), covariance=np.full((3, 3), np.nan))
    assert "found K1_x without a value or an uncertainty" in refused(tmp_path, unknown)
    lab = LAB + '[equipment.table]\nname = "t"\nbudget = ["parrot"]\n'
    assert "equipment.table.budget: found 'parrot'" in refused(tmp_path, made(), text=lab)


WRONG = {"country": '"Germany"', "begin": '"soon"', "place": '"moon"', "name": "7", "nme": '"x"'}


@for_each(("key", "value"), list(WRONG.items()))
def test_a_key_that_is_wrong_is_named(tmp_path_factory, key, value):
    folder = tmp_path_factory.mktemp("lab")
    table = {"country": "laboratory", "begin": "order", "place": "order"}.get(key, "customer")
    (folder / "lab.toml").write_text(f"[{table}]\n{key} = {value}\n")
    with pytest.raises(InputError, match=rf"lab.toml: {table}\.{key}: "):
        read_lab(folder / "lab.toml")


def test_the_new_file_names_every_key_and_what_to_fill_in(tmp_path):
    text = lab_template()
    (tmp_path / "lab.toml").write_text(text)
    lab = read_lab(tmp_path / "lab.toml")
    assert lab.laboratory.name == "?"
    keys = [
        f"{key} = "
        for table in ("laboratory", "order", "item")
        for key in type(getattr(lab, table)).model_fields
    ]
    assert all(key in text for key in keys)
    with pytest.raises(InputError, match=r"laboratory.name, .* and conditions.temperature: missing"):
        certificate([made(date="")], lab, "C", DAY)
    assert all(len(line) <= 120 for line in text.splitlines())


def test_texts_that_xml_cannot_hold_and_spaces_do_no_harm(tmp_path):
    odd = "Acme\x00\x1b[31m \n  <&>\t\ud800 Calibration"
    assert plain(odd) == "Acme??[31m <&> ? Calibration"
    lab = lab_of(tmp_path)
    renamed = lab.model_copy(update={"laboratory": lab.laboratory.model_copy(update={"name": odd})})
    root = etree.fromstring(certificate([made()], renamed, " C\n1 ", DAY))
    assert texts(root, ".//dcc:uniqueIdentifier") == ["C 1"]
    with pytest.raises(InputError, match="empty"):
        certificate([made()], LabFile(), " \n", DAY)


def test_coverage_factors_have_no_exponent():
    assert [factor(k) for k in (1.0, 2.0000024438996027, 1.5e17)] == [
        "1.0",
        "2.0000024438996027",
        "150000000000000000",
    ]
    with pytest.raises(InputError):
        factor(0.5)
