"""Files as people's loggers and programs write them, by the standard library."""

from __future__ import annotations

import zipfile
from dataclasses import dataclass, field
from pathlib import Path
from xml.sax.saxutils import escape

import numpy as np


@dataclass(frozen=True)
class Case:
    """What a protocol brings: commands, the unit whose values are the truth, and what must come out.

    `commands` are lines as typed in the folder of the files. `must` are beginnings of names that have to be among the
    values. `refusal`: words of which the right refusal, or question, holds one; with `either` values are right, too.
    `more` are true values beside those of the unit, as (value, unit); `only` the beginnings of names that are compared.
    """

    commands: tuple
    unit: object = None
    must: tuple = ()
    refusal: tuple = ()
    either: bool = False
    more: dict = field(default_factory=dict)
    only: tuple = ()


LATITUDE = '--latitude "48 deg"'


def text(value, form="{:.6g}"):
    """A cell."""
    return value if isinstance(value, str) else form.format(value)


def csv(path, header, columns, mark=",", form="{:.6g}", comma=False, above=(), end="\n", encoding="utf-8"):
    """A table: lines above, a header (None for none), rows of columns; `form` for all columns, or one for each."""
    forms = [form] * len(columns) if isinstance(form, str) else form
    lines = [*above, *([] if header is None else [mark.join(header)])]
    cells = [[text(value, how) for value in column] for column, how in zip(columns, forms, strict=True)]
    if comma:
        cells = [[cell.replace(".", ",") for cell in column] for column in cells]
    lines += [mark.join(row) for row in zip(*cells, strict=True)]
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes((end.join(lines) + end).encode(encoding))


def lines(path, rows):
    """A text of lines."""
    Path(path).write_text("\n".join(rows) + "\n")


def xlsx(path, sheets):
    """A workbook as spreadsheet programs write it: sheets by name, each a list of rows of texts and numbers."""

    def cell(r, c, value):
        place = f"{chr(65 + c)}{r}"
        if isinstance(value, str):
            return f'<c r="{place}" t="inlineStr"><is><t>{escape(value)}</t></is></c>'
        return f'<c r="{place}"><v>{float(value)!r}</v></c>'

    space = 'xmlns="http://schemas.openxmlformats.org/spreadsheetml/2006/main"'
    office = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    package = "http://schemas.openxmlformats.org/package/2006"
    kind = "application/vnd.openxmlformats-officedocument.spreadsheetml"
    head = '<?xml version="1.0" encoding="UTF-8" standalone="yes"?>'
    count = range(1, len(sheets) + 1)
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as file:
        parts = "".join(
            f'<Override PartName="/xl/worksheets/sheet{k}.xml" ContentType="{kind}.worksheet+xml"/>'
            for k in count
        )
        file.writestr(
            "[Content_Types].xml",
            f'{head}<Types xmlns="{package}/content-types"><Default Extension="rels" ContentType="application/'
            f'vnd.openxmlformats-package.relationships+xml"/><Default Extension="xml" ContentType="application/xml"/>'
            f'<Override PartName="/xl/workbook.xml" ContentType="{kind}.sheet.main+xml"/>{parts}</Types>',
        )
        file.writestr(
            "_rels/.rels",
            f'{head}<Relationships xmlns="{package}/relationships"><Relationship Id="rId1" Type="{office}/'
            f'officeDocument" Target="xl/workbook.xml"/></Relationships>',
        )
        names = "".join(
            f'<sheet name="{escape(n)}" sheetId="{k}" r:id="rId{k}"/>'
            for k, n in zip(count, sheets, strict=True)
        )
        file.writestr(
            "xl/workbook.xml",
            f'{head}<workbook {space} xmlns:r="{office}"><sheets>{names}</sheets></workbook>',
        )
        links = "".join(
            f'<Relationship Id="rId{k}" Type="{office}/worksheet" Target="worksheets/sheet{k}.xml"/>'
            for k in count
        )
        file.writestr(
            "xl/_rels/workbook.xml.rels",
            f'{head}<Relationships xmlns="{package}/relationships">{links}</Relationships>',
        )
        for k, rows in zip(count, sheets.values(), strict=True):
            body = "".join(
                f'<row r="{r}">{"".join(cell(r, c, value) for c, value in enumerate(row))}</row>'
                for r, row in enumerate(rows, 1)
            )
            file.writestr(
                f"xl/worksheets/sheet{k}.xml",
                f"{head}<worksheet {space}><sheetData>{body}</sheetData></worksheet>",
            )


def means(unit, attitudes, fs, seconds, rng):
    """Means and standard deviations (N, 3) of both sensors over a rest in each attitude."""
    from .physics import Path as Course

    rows = []
    for attitude in attitudes:
        _, acc, gyro = unit.log(Course(attitude).rest(seconds), fs, rng)
        rows.append((acc.mean(0), acc.std(0, ddof=1), gyro.mean(0), gyro.std(0, ddof=1)))
    return [np.array(column) for column in zip(*rows, strict=True)]
