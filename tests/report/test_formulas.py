"""Models as they are stated: one LaTeX text gives the plain text of results and the MathML of pages."""

import copy
import pickle
import re

import pytest

from inercal.faces.report.html import clauses
from inercal.foundation.results.basis import Formula
from rows import for_each


@for_each(
    ("latex", "plain"),
    [
        ("$y = S M f + b$, $f$ the force", "y = S M f + b, f the force"),
        (r"$w_{Ip}^p = R_a^{-1} w_c$", "w_Ip^p = R_a^-1 w_c"),
        (r"$\sigma^2(\tau) = 3 Q^2/\tau^2$", "sigma^2(tau) = 3 Q^2/tau^2"),
        (r"$K_{0,x} + \mathrm{ka}_{1,y} + T_{ij} + K_{\mathrm{hyst}}$", "K0_x + ka1_y + T_ij + K_hyst"),
        (r"$f_x \cos\,\lambda_i$, $[w' \times]$", "f_x cos lambda_i, [w' x]"),
        (r"$M = \begin{bmatrix}0 & a \\ -b & 0\end{bmatrix}$", "M = [[0, a], [-b, 0]]"),
        (r"$\begin{bmatrix}0 & 0 & -1\end{bmatrix} C_{nb}$", "[0 0 -1] C_nb"),
    ],
)
def test_the_plain_text_of_a_formula(latex, plain):
    assert Formula(latex) == plain


@pytest.mark.parametrize("again", [copy.deepcopy, lambda each: pickle.loads(pickle.dumps(each))])
def test_a_formula_stays_one(again):
    whole = again(Formula("$y = a$") + Formula("; $b = c$") + "; words")
    assert whole == "y = a; b = c; words"
    assert len(clauses(whole)) == 3
    assert clauses(whole)[1].startswith("<math")


def test_formulas_are_mathematics_and_words_stay_words():
    (line,) = clauses(Formula("$y = b$, a mean of 3 s <at> 2 m/s^2"))
    assert re.findall("<mi>(.*?)</mi>", line) == ["y", "b"]
    assert line.endswith("a mean of 3 s &lt;at&gt; 2 m/s²")


def test_a_matrix_has_rows_columns_and_edges():
    (line,) = clauses(Formula(r"$M = \begin{bmatrix}0 & a & b \\ -c & 0 & d\end{bmatrix} C$"))
    assert line.count("<mtr>") == 2
    assert line.count("<mtd>") == 6
    assert "<mtable class='matrix'>" in line
    assert "&#x0005B;" not in line


def test_a_line_for_each_clause_but_none_within_brackets():
    stated = Formula("$y = S f$ (full; $S_{ij}$ the response); $b = K_0$; turns by the right-hand rule")
    assert len(clauses(stated)) == len(clauses(str(stated))) == 3


def test_a_model_from_a_file_is_shown_as_its_text():
    assert clauses("y = <b>; x_") == ["y = &lt;b&gt;", "x_"]
    assert clauses("") == []
