"""The report: well-formed, self-contained, escaped, and its numbers are those of the estimate."""

import base64
import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from inercal.faces.report.html import Picture, render
from inercal.faces.report.style import plain_unit
from inercal.foundation.findings import Finding, Status
from inercal.foundation.inputs import Source
from inercal.foundation.instruments.terms import TERMS
from inercal.foundation.results.budget import BudgetItem
from inercal.foundation.results.files import from_json, to_json
from inercal.foundation.results.result import Estimate

VOID = {"meta", "img", "br", "col", "hr", "link", "input"}
HOSTILE = "<script>alert(1)</script> \"><img src='http://evil.example/x' onerror=alert(2)> & {{ 7 * 7 }} $x$"


class Page(HTMLParser):
    """A page taken apart; raises where a tag is left open or closed twice."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.open, self.tags, self.links, self.rows, self.words = [], set(), [], [], []
        self.feed(text)
        self.close()
        assert not self.open

    def handle_starttag(self, tag, attributes):
        self.tags.add(tag)
        self.links += [v for k, v in attributes if k in ("src", "href", "srcset", "data", "action")]
        assert not any(key.startswith("on") for key, _ in attributes)
        if tag not in VOID:
            self.open.append(tag)
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if self.open and self.open[-1] == "style":
            return
        self.words.append(data)
        if {"td", "th"} & set(self.open):
            self.rows[-1][-1] += data

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())


def check_self_contained(text):
    page = Page(text)
    assert "script" not in page.tags
    assert all(link.startswith("data:") for link in page.links)
    style = text[text.index("<style>") : text.index("</style>")]
    assert "@import" not in style
    assert "url(" not in style
    for link in page.links:
        svg = base64.b64decode(link.partition(",")[2]).decode()
        assert all(target.startswith("#") for target in re.findall(r"href=\"([^\"]*)\"", svg))
        assert all(target.startswith("#") for target in re.findall(r"url\(([^)]*)\)", svg))
    return page


def estimate(names=("K0_x", "K1_x", "M_xy", "D_F_x", "S_x"), **changes):
    rng = np.random.default_rng(7)
    p = len(names)
    root = rng.normal(size=(p, p)) * np.geomspace(1e-5, 10.0, p)[:, None]
    dof = np.resize([4.2, 29.0, np.inf], p)
    whole = Estimate(
        command="calibrate imu",
        names=tuple(names),
        units=tuple(TERMS[n].unit_for("count") if n in TERMS else "1" for n in names),
        values=rng.normal(size=p) * 1e3,
        covariance=root @ root.T,
        dof=dof,
        status=Status.OK,
        message="5 coefficients",
        findings=(Finding("saturation", "gyro_x sits at 32767", "rows 3-10"),),
        statistics={"scatter": 1.25e-3, "intervals": 38.0, "new_number_s": 2.0},
        budget=(
            BudgetItem("pose scatter", "A", 1e-3, "m/s^2", {names[0]: 0.25, names[1]: 1.0} if p > 1 else {}),
            BudgetItem("gravity", "B", 2e-5, "m/s^2", {names[0]: 0.75} if p else {}),
        ),
        model="y = S M x + b",
        conditions={
            "temperature": {"value": 23.0, "u": 0.5, "unit": "degC"},
            "ranges": {"rate_hz": 100.0, "duration_s": 511.0},
            "site": {},
        },
        traceability={"instrument": "MTi 7", "date": "2026-11-03", "operator": "", "reference": "NMI"},
        inputs=(Source("run 1.mat", "ab" * 32),),
        provenance={"settings": {"imu": {"static_start": "50 s", "g_sensitivity": False}}},
        result={
            "method": "multiposition",
            "intervals": [
                {"start_s": 0.5, "direction": np.array([0.0, -1e-9, 1.0]), "residual_m_s2": -1.5e-3},
                {"start_s": 61.25, "direction": np.array([1.0, 0.0, 0.0]), "residual_m_s2": 2.5e-4},
            ],
            "turns": [],
        },
        references=("JCGM 100:2008",),
    )
    return replace(whole, **changes)


PICTURE = Picture("A figure", "What it shows.", '<svg xmlns="http://www.w3.org/2000/svg"></svg>')


def test_every_number_is_that_of_the_table():
    e = estimate(tuple(TERMS))
    page = check_self_contained(render(e, [], "Report"))
    rows = {row[0].split()[0]: row[1:] for row in page.rows if len(row) == 7 and row[0].split()[0] in TERMS}
    for line in e.table().splitlines()[1:]:
        name, value, u, U, k, unit = line.split()
        assert rows[name][:4] == [value, u, U, k]
        assert rows[name][5] == plain_unit(unit)
        assert rows[name][4] == ("∞" if np.isinf(e[name].dof) else f"{e[name].dof:.1f}")
    assert set(rows) == set(TERMS)
    assert all(TERMS[name].name in page.text for name in TERMS)


def test_degrees_of_freedom_beyond_a_million_are_infinite():
    dof = np.array([999_999.0, 1e6, 2433221319326.0, np.inf, 4.2])
    rows = Page(render(estimate(dof=dof), [], "Report")).rows
    assert [row[5] for row in rows if len(row) == 7][1:] == ["999999", "∞", "∞", "∞", "4.2"]


def test_what_was_recorded_in_four_digits_of_the_larger_end():
    ranges = {"th_x_deg": [-0.03631672, 179.9956], "temperature_degC": [-0.00012345, 0.06500617]}
    text = Page(render(estimate(conditions={"ranges": ranges}), [], "Report")).text
    assert "recorded th x 0.0 to 180.0°" in text
    assert "recorded temperature -0.00012 to 0.06501 °C" in text


@pytest.mark.parametrize("status", Status)
def test_the_verdict_in_words(status):
    page = Page(render(estimate(status=status, message="why so"), [], "Report"))
    for words in (status.value.replace("_", " "), status.meaning, "why so"):
        assert words in page.text


def test_what_a_metrologist_looks_for():
    text = Page(render(estimate(), [PICTURE], "Calibration of MTi 7")).text
    for words in (
        "Calibration of MTi 7", "2026-11-03", "NMI", "not stated", "saturation : gyro_x sits at 32767 (rows 3-10)",
        "95.45 %", "JCGM 100:2008", "y = S M x + b", "temperature 23.00 ± 0.50 degC", "recorded rate 100 Hz",
        "A figure",
        "What it shows.", "pose scatter", "settings.imu.static_start 50 s", "g_sensitivity no",
        "run 1.mat", "ab" * 32, "method multiposition", "new number 2 s",
    ):  # fmt: skip
        assert words in text


def test_order_of_the_sections():
    text = render(estimate(), [PICTURE, replace(PICTURE, title="Another")], "Report")
    heads = re.findall("<h2>(.*?)</h2>", text)
    assert heads == [
        "A figure", "Findings", "Coefficients", "Figures", "Uncertainty budget", "Model, conditions and validity",
        "Details", "How it was done",
    ]  # fmt: skip


def test_residuals_have_aligned_decimals():
    rows = Page(render(estimate(), [], "Report")).rows
    assert ["1", "0.50", "(0.000, 0.000, 1.000)", "-153.0"] in rows
    assert ["2", "61.25", "(1.000, 0.000, 0.000)", "25.5"] in rows


def test_shares_of_the_budget():
    rows = Page(render(estimate(), [], "Report")).rows
    assert ["K0_x", "25", "75"] in rows
    assert ["K1_x", "100", ""] in rows
    assert ["gravity", "B", "2e-05", "m/s²"] in rows


def test_groups_by_instrument():
    text = render(estimate(("K1_x", "S_x", "Größe_α")), [], "Report")
    at = [text.index(f">{word}<") for word in ("Accelerometers", "K1_x", "Gyro", "S_x", "Größe_α")]
    assert at == sorted(at)


def test_hostile_text_is_only_text():
    e = estimate(
        traceability={"instrument": HOSTILE, HOSTILE: HOSTILE},
        message=HOSTILE,
        model=HOSTILE,
        conditions={HOSTILE: HOSTILE},
        findings=(Finding("nan", HOSTILE, HOSTILE),),
        inputs=(Source(HOSTILE, HOSTILE),),
        provenance={HOSTILE: [HOSTILE]},
        statistics={HOSTILE: 1.0},
        references=(HOSTILE,),
        result={HOSTILE: [{HOSTILE: HOSTILE}], "method": HOSTILE},
        budget=(BudgetItem(HOSTILE, "A", 1.0, HOSTILE, {}),),
    )
    page = check_self_contained(render(e, [replace(PICTURE, title=HOSTILE, caption=HOSTILE)], HOSTILE))
    assert page.text.count("<script>alert(1)</script>") > 10
    assert "{{ 7 * 7 }}" in page.text


def test_an_estimate_without_parameters():
    nothing = dict.fromkeys(("budget", "findings", "inputs", "references"), ())
    nothing |= {key: {} for key in ("result", "statistics", "conditions", "provenance", "traceability")}
    e = estimate((), status=Status.TOO_FEW_INTERVALS, message="found 3", model="", **nothing)
    page = check_self_contained(render(e, [], "Report"))
    assert "found 3" in page.text
    assert "There are no coefficients" in page.text
    assert "Nothing suspicious" in page.text


def test_numbers_that_are_not_finite():
    e = estimate()
    e = replace(
        e, covariance=np.full_like(e.covariance, np.nan), statistics={"condition": np.inf, "x": np.nan}
    )
    assert "condition number –" in check_self_contained(render(e, [], "Report")).text


def test_an_estimate_read_back_gives_the_same_report():
    e = estimate()
    assert render(from_json(to_json(e)), [PICTURE], "Report") == render(e, [PICTURE], "Report")


def test_same_estimate_same_bytes():
    assert render(estimate(), [PICTURE], "Report") == render(estimate(), [PICTURE], "Report")


def test_phone_and_paper():
    text = render(estimate(), [], "Report")
    for rule in ("width=device-width", "@media print", "size: A4", "break-inside: avoid"):
        assert rule in text
