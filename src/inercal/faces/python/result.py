"""Results of the verbs: an estimate with its evidence, ready to be looked at, saved and handed on."""

from __future__ import annotations

import difflib
import html
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from inercal.foundation.errors import InputError, MissingExtraError
from inercal.foundation.findings import Finding, Status
from inercal.foundation.records.places import counted
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate, Parameter
from inercal.foundation.results.shown import rounded

if TYPE_CHECKING:
    import pandas
    import xarray
    from matplotlib.figure import Figure

    from inercal.faces.report.html import Picture


@dataclass(frozen=True, eq=False)
class View:
    """View of a result at a prompt, in a notebook, in a terminal, on a page.

    ``shown`` is the estimate in the units of the command line; ``answer`` says the main number in a line; ``tables``
    are those that the command prints; ``page`` is its report; ``picture`` is the one that answers the question;
    ``rows`` are what was found from row to row of the recording.
    """

    shown: Estimate
    answer: str
    tables: Callable[[], Sequence[str]]
    page: Callable[[], str]
    picture: Callable[[], Picture]
    rows: Callable[[], Record] | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Result:
    """A result: an ``estimate`` in SI, and the ``evidence`` behind it for whoever wants to look deeper.

    Whatever people look at (`repr`, `table`, `plot`, `report`, ``result["K1_x"]``) is in the units of the command
    line, and names them; ``values`` and ``estimate`` are in SI.
    """

    estimate: Estimate
    view: View
    evidence: Any = None

    @property
    def status(self) -> Status:
        """The verdict."""
        return self.estimate.status

    @property
    def message(self) -> str:
        """The verdict in a sentence."""
        return self.estimate.message

    @property
    def findings(self) -> tuple[Finding, ...]:
        """Findings about the recording and the result."""
        return self.estimate.findings

    @property
    def values(self) -> Mapping[str, float]:
        """The coefficients by name, in SI."""
        return dict(zip(self.estimate.names, self.estimate.values.tolist(), strict=True))

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the coefficients, in the order of ``values`` and of the covariance."""
        return self.estimate.names

    def __getitem__(self, name: str) -> Parameter:
        """The coefficient of that name, in the unit that it names itself, that of the command line.

        Raises
        ------
        InputError
            There is no such coefficient; the sentence has the nearest name.
        """
        if name in self.estimate.names:
            return self.view.shown[name]
        near = difflib.get_close_matches(str(name), self.names, n=1, cutoff=0.4)
        others = f"found {', '.join(self.names[:12])}" if self.names else "there are none"
        raise InputError(repr(name), f"no such coefficient, {f'did you mean {near[0]}?' if near else others}")

    def __contains__(self, name: str) -> bool:
        """True if there is such a coefficient."""
        return name in self.names

    def raise_for_status(self, *also: Status | str) -> Result:
        """The result itself if its status is ok, or one of those ``also`` accepted; else raises `CalibrationError`."""
        if self.status in also or self.status.value in also:
            return self
        self.estimate.raise_for_status()
        return self

    def table(self) -> str:
        """The tables that the command prints, as aligned text in the units that they name."""
        return "\n\n".join(text for text in self.view.tables() if text)

    def plot(self) -> Figure:
        """The picture that answers the question, as a figure of matplotlib, in the units that it names."""
        figure = self.view.picture().figure
        assert figure is not None
        return figure

    def report(self, path: str | Path) -> Path:
        """Write the page that one can hand over, as ``--report`` does; raises `InputError`."""
        from inercal.foundation._files import write_text

        if Path(path).suffix.lower() not in (".html", ".htm"):
            raise InputError(path, f"found the suffix {Path(path).suffix!r}, expected .html")
        write_text(path, self.view.page())
        return Path(path)

    def save(self, path: str | Path) -> Path:
        """Write the result, as ``--out`` does, whole or not at all.

        A ``.json`` or ``.toml`` file holds all of the result in SI, and `inercal.load` reads it; any other holds what
        was found from row to row. Raises `InputError` where there are no rows, or the file cannot be written.
        """
        from inercal.foundation.records.write import SUFFIXES, write_record
        from inercal.foundation.results.files import save

        suffix = Path(path).suffix.lower()
        if self.view.rows is not None and suffix in SUFFIXES:
            write_record(self.view.rows(), path)
        else:
            save(self.estimate, path)
        return Path(path)

    def to_dataframe(self) -> pandas.DataFrame:
        """The coefficients as a pandas DataFrame, a row each; needs the extra ``pandas``.

        ``value``, ``u`` and ``U`` are in ``unit``, that of the command line; ``value_si`` and ``u_si`` are in
        ``unit_si``.
        """
        try:
            import pandas
        except ImportError as error:
            raise MissingExtraError("Result.to_dataframe", "pandas") from error
        of, si = self.view.shown, self.estimate
        shown = list(of.parameters.values())
        return pandas.DataFrame(
            {
                "value": of.values,
                "u": of.u,
                "U": [each.U for each in shown],
                "k": of.k,
                "dof": of.dof,
                "unit": list(of.units),
                "value_si": si.values,
                "u_si": si.u,
                "unit_si": list(si.units),
            },
            index=pandas.Index(list(si.names), name="parameter"),
        )

    def to_xarray(self) -> xarray.Dataset:
        """The result as an xarray Dataset; needs the extra ``xarray``.

        ``value``, ``u``, ``k``, ``dof`` (parameter) and ``covariance`` (parameter, parameter_2) in SI, each parameter
        in the coordinate ``unit``; beside them what was found from row to row, angles or coefficients over time, each
        variable in its attribute ``units``.
        """
        try:
            import xarray
        except ImportError as error:
            raise MissingExtraError("Result.to_xarray", "xarray") from error
        of, names = self.estimate, list(self.names)
        each = ("parameter",)
        dataset = xarray.Dataset(
            {
                "value": (each, of.values),
                "u": (each, of.u),
                "k": (each, of.k),
                "dof": (each, of.dof),
                "covariance": (("parameter", "parameter_2"), of.covariance),
            },
            coords={"parameter": names, "parameter_2": names, "unit": (each, list(of.units))},
            attrs={"command": of.command, "status": of.status.value, "message": of.message},
        )
        return (
            dataset
            if self.view.rows is None
            else dataset.merge(self.view.rows().to_xarray(), combine_attrs="override")
        )

    def __repr__(self) -> str:
        """Three lines: the verdict, the main number, and what to do next."""
        bad = (
            ""
            if self.status is Status.OK
            else f"look at .findings ({counted(len(self.findings), 'finding')}); "
        )
        return "\n".join(
            (
                f"{self.status.value}: {_cut(self.message)}",
                f"  {_cut(self.view.answer)}",
                f'  next: {bad}.table(), .plot(), .report("page.html"); .values are in SI',
            )
        )

    def _repr_html_(self) -> str:
        """The verdict, the picture and the table, for a notebook."""
        picture = self.view.picture()
        mood = {Status.OK: "#2E7D4F", Status.ILL_CONDITIONED: "#B07A00"}.get(self.status, "#C03A2B")
        items = "".join(map(_finding_as_html, self.findings))
        findings = (
            f"<details><summary>{counted(len(self.findings), 'finding')}</summary><ul>{items}</ul></details>"
        )
        return (
            f'<div style="max-width:52em"><p style="margin:.4em 0"><strong style="color:{mood}">'
            f"{self.status.value}</strong>: {html.escape(self.message)}</p>"
            f'<img src="{picture.uri}" alt="{html.escape(self.view.answer)}" style="max-width:100%">'
            f"{self._rows_as_html()}{findings if items else ''}</div>"
        )

    def _rows_as_html(self) -> str:
        """The coefficients as a table; where there are none, what the command prints."""
        from inercal.faces.report.style import plain_unit
        from inercal.foundation.instruments.terms import term

        if not self.names:
            return f'<pre style="overflow-x:auto">{html.escape(self.table())}</pre>'
        left = 'style="text-align:left;padding:.1em .6em"'
        right = 'style="text-align:right;padding:.1em .6em;font-variant-numeric:tabular-nums"'
        rows = []
        for p in self.view.shown.parameters.values():
            of = term(p.name)
            cells = "".join(f"<td {right}>{cell}</td>" for cell in rounded(p.value, p.u, p.U))
            words = "" if of is None else html.escape(of.name)
            unit = "" if p.unit == "1" else html.escape(plain_unit(p.unit))
            rows.append(
                f"<tr><td {left}>{p.name}</td>{cells}<td {left}>{unit}</td><td {left}>{words}</td></tr>"
            )
        heads = "".join(
            f"<th {right if head in ('value', 'u', 'U') else left}>{head}</th>"
            for head in ("", "value", "u", "U", "unit", "")
        )
        return f"<table><thead><tr>{heads}</tr></thead><tbody>{''.join(rows)}</tbody></table>"


def _finding_as_html(finding: Finding) -> str:
    """An item of a list: what was found, what to do about it, and the table of its items."""
    action = f"<br>→ {html.escape(finding.action)}" if finding.action else ""
    heads, rows = finding.table
    table = "".join(
        f"<tr>{''.join(f'<td>{html.escape(cell)}</td>' for cell in row)}</tr>" for row in (heads, *rows)
    )
    return (
        f"<li><code>{html.escape(finding.code)}</code> {html.escape(finding.headline)}{action}"
        f"{f'<table>{table}</table>' if rows else ''}</li>"
    )


def coefficients(shown: Estimate) -> str:
    """A line with the number of coefficients and the first of them."""
    first = next(iter(shown.parameters.values()), None)
    if first is None:
        return "no coefficients"
    value, U = rounded(first.value, first.u, first.U)[::2]
    unit = "" if first.unit == "1" else f" {first.unit}"
    first_text = (
        f"{first.name} = {value} ± {U}{unit}" if np.isfinite(first.u) else f"{first.name} = {value}{unit}"
    )
    return f"{counted(len(shown.names), 'coefficient')}, the first {first_text} (± U, k = {first.k:.2f})"


def _cut(text: str) -> str:
    """A text that fits on a line or two."""
    return text if len(text) <= 200 else f"{text[:196]} ..."


def of_coefficients(
    shown: Estimate, page: Callable[[], str], more: Callable[[], Sequence[str]] = tuple
) -> View:
    """The view of a result that is its coefficients, with ``more`` tables behind that of them."""

    def values() -> Picture:
        from inercal.faces.report.coefficients import values

        return values(shown)

    return View(
        shown,
        coefficients(shown),
        lambda: [shown.table() if shown.names else "", *more()],
        page,
        values,
    )


def loaded(estimate: Estimate, shown: Estimate | None = None) -> Result:
    """A result that was saved, ``shown`` in other units than those of its kind."""
    given = estimate.shown() if shown is None else shown

    def page() -> str:
        from inercal.faces.report.coefficients import budget, correlation
        from inercal.faces.report.html import render

        pictures = [correlation(given)] if len(estimate.names) > 1 else []
        pictures += [budget(given)] if estimate.names and estimate.budget else []
        return render(given, pictures, f"inercal {estimate.command}")

    return Result(estimate, of_coefficients(given, page))
