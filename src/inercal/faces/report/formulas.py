"""The model of a result as HTML: words as they are, formulas in MathML."""

from __future__ import annotations

import re
from html import escape

from inercal.faces.report.style import plain_unit
from inercal.foundation.results.basis import Formula

_MATRIX = r"<mtable class='matrix'>\1</mtable>"


def clauses(model: str) -> list[str]:
    """The statements of a model, one for each clause that ends in a semicolon outside brackets.

    A model that is no `Formula`, as one read from a file, is plain text.
    """
    if not isinstance(model, Formula):
        return [escape(plain_unit(part)) for part in _parted(model)]
    return [_clause(part) for part in _parted(model.latex)]


def _clause(text: str) -> str:
    """Words, and what stands between dollars as MathML."""
    from latex2mathml.converter import convert

    parts = enumerate(text.split("$"))
    html = "".join(convert(part) if k % 2 else escape(plain_unit(part), quote=False) for k, part in parts)
    # Brackets as tall as a matrix come from few fonts: the style of a page draws its edges.
    return re.sub(r"<mo>&#x0005B;</mo><mtable>(.*?)</mtable><mo>&#x0005D;</mo>", _MATRIX, html)


def _parted(text: str) -> list[str]:
    """The clauses of a text."""
    depth, begun = 0, 0
    ends = []
    for match in re.finditer(r"[(\[)\];]", text):
        depth += (match[0] in "([") - (match[0] in ")]")
        if match[0] == ";" and depth <= 0:
            ends.append(match.start())
    parts = []
    for end in [*ends, len(text)]:
        parts.append(text[begun:end].strip())
        begun = end + 1
    return [part for part in parts if part]
