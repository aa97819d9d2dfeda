"""Equations as MathML: what is mathematics and what is words, and nothing of the text lost."""

import re

import pytest

from inercal.report.mathml import clauses


def words(html):
    """The text of a clause as it is read, spaces aside."""
    return re.sub(r"<[^>]*>|\s", "", html)


def mathematics(html):
    return [words(each) for each in re.findall("<math>(.*?)</math>", html)]


def test_equations_and_words_are_told_apart():
    (line,) = clauses("y = S M f + b, f the specific force (+g up at rest), a mean of 3 s at 2 Hz")
    assert mathematics(line) == ["y=SMf+b", "f", "+g"]
    assert "a mean of 3 s at 2 Hz" in line


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        (
            "w_Ip^p = w_c",
            "<msubsup><mi>w</mi><mrow><mtext>Ip</mtext></mrow><mrow><mi>p</mi></mrow></msubsup>",
        ),
        ("x = R_a^-1 y", "<mrow><mo>−</mo><mn>1</mn></mrow></msubsup>"),
        ("y = R^2 tau^2/2", "<mfrac displaystyle='true'><mrow><msup><mi>R</mi>"),
        ("E = |d|/U(d)", "<mi>U</mi><mrow><mo>(</mo><mi>d</mi><mo>)</mo></mrow></mrow></mfrac>"),
        ("w = theta'", "<mi>θ′</mi>"),
        ("b = K0_x", "<msub><mi>K</mi><mrow><mtext>0,x</mtext></mrow></msub>"),
        ("S = diag(scale factor)", "<mtext>scale factor</mtext>"),
    ],
)
def test_signs(text, expected):
    assert expected in clauses(text)[0]


def test_a_matrix_has_rows_and_columns():
    (line,) = clauses("M = [[0, ds_x, -do_x], [-do_y, 0, ds_y], [ds_z, -do_z, 0]]")
    assert line.count("<mtr>") == 3
    assert line.count("<mtd>") == 9
    assert clauses("a = [0 0 -1] C_nb")[0].count("<mtd>") == 3


def test_a_line_for_each_clause_but_none_within_brackets():
    assert len(clauses("y = S f (full; S_ij the response); b = K0; turns by the right-hand rule")) == 3


def test_plain_words_stay_as_they_are():
    text = "a case passes where every number found is within its limit of the number expected"
    assert clauses(text) == [text]
    assert clauses("") == []


def test_what_cannot_be_read_is_shown_as_it_is():
    for text in (
        "x = (",
        "x = ) y",
        "[[",
        "x ^",
        "a^-",
        "|x",
        "= = /",
        "x = <b>",
        "/ 2",
        "M = []",
        "x_ = _y",
    ):
        html = "".join(clauses(text))
        assert "<b>" not in html
        assert html.count("<math>") == html.count("</math>")
