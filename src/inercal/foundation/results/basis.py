"""Basis of a result beside its numbers: command, model, conditions, files, versions, publications.

A `Formula` is a model as it is stated: words, and mathematics in LaTeX between dollars; plain text follows from it.

``$y = S M f + b$, $b = K_0$`` is ``y = S M f + b, b = K0`` in plain text. What is written between dollars keeps to
letters, numbers, operators, brackets, ``_``, ``^``, ``\\,``, names as ``\\tau``, ``\\mathrm`` and ``bmatrix``.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from inercal.foundation.inputs import Source
from inercal.foundation.units import Quantity

if TYPE_CHECKING:
    from inercal.foundation.geometry.earth import Site


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


@dataclass(frozen=True)
class Basis:
    """Basis of an `inercal.foundation.results.result.Estimate`; its fields of the same names."""

    command: str
    model: str = ""
    conditions: Mapping[str, Any] = field(default_factory=dict)
    traceability: Mapping[str, str] = field(default_factory=dict)
    inputs: tuple[Source, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    references: tuple[str, ...] = ()


class Settings(Protocol):
    """Site, temperature and texts, which studies of all systems have."""

    @property
    def site(self) -> Site:
        """Gravity and latitude."""

    @property
    def temperature(self) -> Quantity | None:
        """Temperature of the instrument, as stated."""

    @property
    def traceability(self) -> Mapping[str, str]:
        """Free texts, the date among them."""

    @property
    def given(self) -> Mapping[str, Any]:
        """Keys of the study, as they were given."""


def studied(
    command: str,
    settings: Settings,
    inputs: Iterable[Source],
    model: str,
    references: tuple[str, ...],
    conditions: Mapping[str, Any] | None = None,
) -> Basis:
    """The basis of a result that a study and recordings lead to; ``conditions`` as `conditions_of` gives them."""
    return Basis(
        command,
        model,
        conditions or {},
        settings.traceability,
        tuple(inputs),
        provenance(settings.given),
        references,
    )


def conditions_of(
    settings: Settings, recorded: Quantity | None, ranges: Mapping[str, Any], **own: Any
) -> dict[str, Any]:
    """The conditions of a result, ``own`` ones of this kind of estimate (such as its frame) first.

    The temperature is that of the study, else the ``recorded`` one
    (`inercal.foundation.records.record.recorded_temperature`); ``ranges`` has smallest and largest input by name, its
    SI unit at the end of the name.
    """
    site, of_study = settings.site, settings.temperature
    temperature = recorded if of_study is None else of_study
    return own | {
        "temperature": temperature and {"value": temperature.value, "u": temperature.u, "unit": "degC"},
        "site": {"gravity_m_s2": site.gravity, "latitude_rad": site.latitude},
        "date": settings.traceability.get("date", ""),
        "ranges": ranges,
    }


def provenance(given: Mapping[str, Any]) -> dict[str, Any]:
    """Provenance for a repetition beside the inputs: the keys ``given``; nothing is random."""
    import platform

    import scipy

    versions = {"python": platform.python_version(), "numpy": np.__version__, "scipy": scipy.__version__}
    return {"settings": given, "seed": None, "versions": versions}
