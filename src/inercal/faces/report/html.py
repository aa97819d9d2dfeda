"""An estimate as one self-contained HTML page, in the order a metrologist reads it."""

from __future__ import annotations

import base64
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import TYPE_CHECKING, Any

from inercal.faces.report.style import plain_unit
from inercal.foundation.findings import Status
from inercal.foundation.instruments.terms import term
from inercal.foundation.results.basis import Formula
from inercal.foundation.results.budget import BudgetItem
from inercal.foundation.results.files import plain_objects
from inercal.foundation.results.result import Estimate, Parameter
from inercal.foundation.results.shown import Table, in_words, rounded
from inercal.foundation.units import parse_unit

if TYPE_CHECKING:
    from matplotlib.figure import Figure


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


_INFINITE = 1e6
"""Degrees of freedom from which they are shown as infinite: k is that of the normal distribution to six digits."""


@dataclass(frozen=True)
class Picture:
    """A figure of a page: its ``title``, what it shows in words, and the drawing itself, as text and as a figure."""

    title: str
    caption: str
    svg: str
    figure: Figure | None = field(default=None, compare=False, repr=False)

    @property
    def uri(self) -> str:
        """The drawing as a ``data:`` address, so that the names inside it never meet those of another."""
        return "data:image/svg+xml;base64," + base64.b64encode(self.svg.encode()).decode()


#: group of terms -> how their symbols begin
_GROUPS = {
    "Sensors of the model": ("b_", "dr_", "zo_", "k_g", "tau"),
    "Accelerometers": ("K", "M_", "acc_"),
    "Gyro": ("D_F_", "D_R_", "S_", "T_", "G_", "gyro_"),
    "Axis X": ("DX_", "k_"),
    "Axis Y": ("DY_", "kY_"),
    "Platform gyros": ("kg0_", "ds_", "do_", "kg1_"),
    "Platform accelerometers": ("eta_", "ka0_", "ka1_"),
    "Encoders": ("beta_",),
}

#: key -> plain name and unit, where the key alone does not say them
_LABELS = {
    "dof": ("degrees of freedom", ""),
    "condition": ("condition number", ""),
    "column_condition": ("condition number of the terms, columns scaled to one length", ""),
    "residual_rms": ("root-mean-square residual |f| − g", "m/s²"),
    "residual_m_s2": ("residual |f| − g", "µg"),
    "scatter": ("standard deviation of |f| in a pose about the fit", "m/s²"),
    "scatter_over_noise": ("that deviation over what the noise at rest explains", ""),
    "threshold": ("threshold of rest, in variances at rest", ""),
    "chi2": ("weighted sum of squares", ""),
    "intervals": ("static poses", ""),
    "turns": ("turns", ""),
    "gyro_dof": ("degrees of freedom of the turns", ""),
    "gyro_condition": ("condition number of the scaled Jacobian, gyro", ""),
    "gyro_residual_rms_rad": ("root-mean-square miss of the turns", "rad"),
    "miss_rad": ("miss", "arcsec"),
    "direction": ("direction of the specific force", ""),
}
#: key of a column -> the SI value of the unit that its label has
_SIZES = {"residual_m_s2": parse_unit("ug").factor, "miss_rad": parse_unit("arcsec").factor}
_UNITS = {
    "_m_s2": "m/s²",
    "_rad_s": "rad/s",
    "_deg_s": "°/s",
    "_rad": "rad",
    "_degC": "°C",
    "_deg": "°",
    "_arcsec": "arcsec",
    "_hz": "Hz",
    "_percent": "%",
    "_us": "µs",
    "_s": "s",
}


def render(
    estimate: Estimate,
    pictures: Sequence[Picture],
    title: str,
    tables: Sequence[Table] = (),
    answer: Sequence[Table] = (),
) -> str:
    """The report of an estimate of any command and any status: HTML without script, network or font.

    Parameters
    ----------
    pictures : sequence of Picture
        In the order they are to be shown; the first one answers the question of the page.
    tables : sequence of Table
        Further tables, ahead of the other pictures. A table of the result with the title of one of these is not shown
        again among the details.
    answer : sequence of Table
        The result where it is not the coefficients: ahead of these.
    """
    result = plain_objects(estimate.result)
    shown = {table.title.lower() for table in (*answer, *tables)}
    return page(
        "estimate.html",
        estimate,
        title,
        meaning=estimate.status.meaning,
        groups=_groups(estimate),
        conditions=[
            (*_labelled(keys), text)
            for keys, text in _leaves(plain_objects(_with_units(estimate)))
            if keys != ("date",)
        ],
        answer=answer,
        given_tables=tables,
        pictures=pictures,
        sources=estimate.budget,
        tables=[
            _table(key, value)
            for key, value in result.items()
            if _is_table(value) and _labelled((key,))[0] not in shown
        ],
    )


def page(
    template: str,
    estimate: Estimate,
    title: str,
    facts: Sequence[tuple[str, str, str]] | None = None,
    meaning: str = "",
    pictures: Sequence[Picture] = (),
    **content: Any,
) -> str:
    """A page of this package: its one frame, and in it what a file of ``templates`` makes of ``content``.

    The frame is the title, who did what, the verdict, the picture that answers the question, the findings, and at the
    end how it was done. Whatever is put in is escaped. Bytes in file names that no encoding knew are read as UTF-8,
    and what that does not know is replaced.

    ``facts`` (name, unit, text) are the subject of the page where there is no instrument to trace
    (`Estimate.traceability` if absent); ``meaning`` is the verdict in words, ahead of the message of the estimate. The
    first of ``pictures`` answers the question; a template shows the others below its tables.
    """
    import jinja2
    from markupsafe import Markup

    from inercal import __version__

    environment = jinja2.Environment(
        loader=jinja2.PackageLoader("inercal.faces.report"),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=jinja2.StrictUndefined,
    )
    environment.filters |= {
        "unit": plain_unit,
        "percent": _percent,
        "text": _text,
        "index": _index,
        "sentence": _sentence,
    }
    result = plain_objects(estimate.result)
    text = environment.get_template(template).render(
        version=__version__,
        estimate=estimate,
        title=title,
        facts=_heading(estimate) if facts is None else facts,
        mood={Status.OK: "good", Status.ILL_CONDITIONED: "doubtful", Status.SUSPECT: "doubtful"}.get(
            estimate.status, "bad"
        ),
        meaning=meaning,
        first=pictures[:1],
        pictures=pictures[1:],
        model=[Markup(clause) for clause in clauses(estimate.model)],
        statistics=[(*_labelled((key,)), _short(value)) for key, value in estimate.statistics.items()],
        provenance=[
            ("command", estimate.command),
            *((key, value) for key, value in result.items() if isinstance(value, str)),
            *((".".join(keys), text) for keys, text in _leaves(plain_objects(estimate.provenance))),
        ],
        **content,
    )
    return text.encode("utf-8", "surrogateescape").decode("utf-8", "replace")


def _with_units(estimate: Estimate) -> dict[str, Any]:
    """The conditions with angles in degrees, and the unit of the gyro's output where its range is stated."""
    shown = in_words(estimate.conditions)
    if "gyro_output" in shown.get("ranges", {}) and "D_F_x" in estimate.names:
        unit = estimate["D_F_x"].unit
        shown["ranges"] = {
            (f"{key} [{unit}]" if key == "gyro_output" else key): ends
            for key, ends in shown["ranges"].items()
        }
    return shown


def _heading(estimate: Estimate) -> list[tuple[str, str, str]]:
    """Traceability: instrument, operator, date and reference, which must be there, and any others."""
    given = estimate.traceability
    first = ("instrument", "date", "operator", "reference")
    return [(key, "", given.get(key, "")) for key in first] + [
        (key, "", text) for key, text in given.items() if key not in first
    ]


@dataclass(frozen=True)
class _PrintedRow:
    """A coefficient as it is printed."""

    parameter: Parameter
    name: str
    value: str
    u: str
    U: str
    dof: str
    shares: tuple[float | None, ...]


def _groups(estimate: Estimate) -> list[tuple[str, list[_PrintedRow]]]:
    """The coefficients by instrument, each with its printed numbers and its shares of the budget."""
    groups: dict[str, list[_PrintedRow]] = {}
    for p in estimate.parameters.values():
        begun = (name for name, ways in _GROUPS.items() if term(p.name) and p.name.startswith(ways))
        group = next(begun, "Coefficients")
        groups.setdefault(group, []).append(_row(p, estimate.budget))
    return list(groups.items())


def _row(p: Parameter, budget: Sequence[BudgetItem]) -> _PrintedRow:
    """One coefficient, rounded as in `Estimate.table`."""
    value, u, U = rounded(p.value, p.u, p.U)
    of = term(p.name)
    name = "" if of is None else of.name
    dof = "∞" if p.dof >= _INFINITE else f"{p.dof:.{0 if p.dof >= 100 else 1}f}"
    return _PrintedRow(p, name, value, u, U, dof, tuple(item.share.get(p.name) for item in budget))


def _percent(share: float) -> str:
    """A share in percent; a tiny one as below 0.1 %."""
    percent = 100.0 * share
    return "< 0.1" if percent < 0.1 else f"{percent:.1f}" if percent < 10 else f"{percent:.0f}"


def _index(value: float) -> str:
    """An index to three digits, a tiny one by its power of ten; a dash where there is none."""
    if not math.isfinite(value):
        return "–"
    return f"{value:.1e}" if 0.0 < abs(value) < 5e-4 else f"{value:.3g}"


def _sentence(text: str) -> str:
    """A text with a capital letter and no full stop at its end."""
    return text[:1].upper() + text[1:].rstrip(".")


def _leaves(value: Any, keys: tuple[str, ...] = ()) -> Iterator[tuple[tuple[str, ...], str]]:
    """Leaves of nested tables with the keys that lead to them; empty ones are left out."""
    if isinstance(value, Mapping):
        for key, item in value.items():
            yield from _leaves(item, (*keys, key))
    elif value not in (None, "", []):
        recorded = "ranges" in keys
        if recorded and isinstance(value, list) and len(value) == 2:
            yield keys, " to ".join(_column(value))
        else:
            yield keys, f"{value:.6g}" if recorded and isinstance(value, float) else _text(value)


def _text(value: Any) -> str:
    """A leaf as text."""
    match value:
        case None:
            return "–"
        case bool():
            return "yes" if value else "no"
        case float():
            return f"{value:.7g}" if math.isfinite(value) else "–"
        case list():
            return "(" + ", ".join(map(_text, value)) + ")"
        case _:
            return str(value)


def _labelled(keys: tuple[str, ...]) -> tuple[str, str]:
    """Keys as words, and the unit that the last one ends with."""
    *path, last = ("recorded" if key == "ranges" else key for key in keys)
    plain = ((last.removesuffix(end), unit) for end, unit in _UNITS.items() if last.endswith(end))
    words, unit = _LABELS.get(last) or next(plain, (last, ""))
    return " ".join([*path, words]).replace("_", " "), unit


def _is_table(value: Any) -> bool:
    """True for rows with the same keys."""
    return (
        bool(value)
        and isinstance(value, list)
        and all(isinstance(row, dict) and row.keys() == value[0].keys() for row in value)
    )


def _table(key: str, rows: Sequence[Mapping[str, Any]]) -> tuple[str, list[tuple[str, str]], list[list[str]]]:
    """Title, columns (name and unit) and cells of rows of the result; what is nested in a row has no column."""
    title, _ = _labelled((key,))
    names = [
        name
        for name, value in rows[0].items()
        if not isinstance(value, dict) and not str(value).startswith("[[")
    ]
    heads = [_labelled((name,)) for name in names]
    columns = [_column([_sized(name, row[name]) for row in rows]) for name in names]
    return title, heads, [list(cells) for cells in zip(*columns, strict=True)]


def _sized(key: str, value: Any) -> Any:
    """A value in the unit of its column's label."""
    return value / _SIZES[key] if key in _SIZES and isinstance(value, float) else value


def _column(values: Sequence[Any]) -> list[str]:
    """Cells of a column; numbers with as many decimals as give the largest four digits."""
    numbers = [x for x in values if isinstance(x, float) and math.isfinite(x)]
    largest = max(map(abs, numbers), default=0.0)
    if len(numbers) < len(values) or not 1e-6 < largest < 1e9:
        return [_short(value) for value in values]
    places = max(0, 3 - math.floor(math.log10(largest)))
    return [f"{round(x, places) + 0.0:.{places}f}" for x in numbers]


def _component(x: float, small: bool) -> str:
    """A component of a vector, to three decimals, or to three digits where the vector is small."""
    return f"{x:.3g}" if small else f"{round(x, 3) + 0.0:.3f}"


def _short(value: Any) -> str:
    """A leaf as text, to four digits; vectors to three decimals, or as many digits where all are small."""
    match value:
        case float() if math.isfinite(value):
            return f"{value:.4g}"
        case list():
            sizes = [abs(x) for x in value if isinstance(x, float) and math.isfinite(x)]
            small = 0.0 < max(sizes, default=0.0) < 0.01
            items = (_component(x, small) if isinstance(x, float) else _text(x) for x in value)
            return f"({', '.join(items)})"
        case _:
            return _text(value)
