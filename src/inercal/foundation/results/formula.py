r"""A model as it is stated: words, and its mathematics in LaTeX between dollars, of which the plain text follows.

``$y = S M f + b$, $b = K_0$`` is ``y = S M f + b, b = K0`` in plain text. What is written between dollars keeps to
letters, numbers, operators, brackets, ``_``, ``^``, ``\,``, names as ``\tau``, ``\mathrm`` and ``bmatrix``.
"""

from __future__ import annotations

import re


class Formula(str):
    """The plain text of a model; ``latex`` is the text that it was made of."""

    latex: str

    def __new__(cls, latex: str) -> Formula:
        """Make it of words with LaTeX between dollars."""
        parts = latex.split("$")
        made = super().__new__(cls, "".join(_plain(part) if k % 2 else part for k, part in enumerate(parts)))
        made.latex = latex
        return made

    def __add__(self, more: str) -> Formula:
        """A formula or words after it."""
        return Formula(self.latex + (more.latex if isinstance(more, Formula) else more))

    def __getnewargs__(self) -> tuple[str]:
        """The text that a copy is made of."""
        return (self.latex,)


def _plain(latex: str) -> str:
    """LaTeX as plain text: ``K_{0,x}^{2}`` is ``K0_x^2``."""
    text = re.sub(r"\\begin\{bmatrix\}(.*?)\\end\{bmatrix\}", _rows, latex)
    text = re.sub(r"\\mathrm\{(\w*)\}", r"\1", text)
    text = re.sub(r"_(?:\{([^}]*)\}|(\w))", _subscript, text)
    text = re.sub(r"\^\{([^}]*)\}", r"^\1", text).replace(r"\,", " ").replace(r"\times", "x")
    return text.replace("{}", "").replace("\\", "")


def _rows(matrix: re.Match[str]) -> str:
    """The rows of a matrix in brackets; one row alone as it is."""
    rows = [[cell.strip() for cell in row.split("&")] for row in matrix[1].split(r"\\")]
    if len(rows) == 1:
        return f"[{' '.join(rows[0])}]"
    return "[" + ", ".join(f"[{', '.join(row)}]" for row in rows) + "]"


def _subscript(found: re.Match[str]) -> str:
    """A subscript as names of coefficients have it: a number stands beside its letter."""
    text = (found[1] or found[2]).replace(",", "_")
    return text if text[0].isdigit() else f"_{text}"
