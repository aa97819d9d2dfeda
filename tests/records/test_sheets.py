"""Spreadsheets: the columns of every sheet are read as anybody would read them from the screen."""

import datetime
import io
import zipfile

import numpy as np
import openpyxl
import pytest

from inercal.foundation.errors import RecordError
from inercal.foundation.records.read import canonical_units, read
from inercal.foundation.records.recognise.map_text import guess_map

RNG = np.random.default_rng(48)
T = np.arange(50) / 100
ACC = np.array([0.1, -0.2, 9.8]) + 0.1 * RNG.standard_normal((50, 3))


def book(path, *sheets):
    made = openpyxl.Workbook()
    made.remove(made.active)
    for name, rows in sheets:
        sheet = made.create_sheet(name)
        for row in rows:
            sheet.append(list(row))
    made.save(path)
    return path


def mapped(path, text):
    path.write_text(text)
    return path


def ods(path, rows):
    """A sheet as LibreOffice writes it, without what it does not need."""
    kinds = {float: "float", str: "string"}

    def cell(value):
        if isinstance(value, str):
            return f'<table:table-cell office:value-type="string"><text:p>{value}</text:p></table:table-cell>'
        return f'<table:table-cell office:value-type="{kinds[float]}" office:value="{value!r}"/>'

    body = "".join(f"<table:table-row>{''.join(map(cell, row))}</table:table-row>" for row in rows)
    names = "".join(
        f' xmlns:{short}="urn:oasis:names:tc:opendocument:xmlns:{short}:1.0"'
        for short in ("office", "table", "text")
    )
    content = (
        f'<?xml version="1.0"?><office:document-content{names}><office:body><office:spreadsheet>'
        f'<table:table table:name="Log">{body}</table:table></office:spreadsheet></office:body>'
        "</office:document-content>"
    )
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("mimetype", "application/vnd.oasis.opendocument.spreadsheet")
        archive.writestr("META-INF/manifest.xml", "<manifest/>")
        archive.writestr("content.xml", content)
    return path


HEADER = ("t [s]", "acc_x [m/s^2]", "acc_y [m/s^2]", "acc_z [m/s^2]")
ROWS = [(t, *acc) for t, acc in zip(T.tolist(), ACC.tolist(), strict=True)]


@pytest.mark.parametrize(
    "path",
    [
        pytest.param(lambda folder: book(folder / "log.xlsx", ("Log", [HEADER, *ROWS])), id="xlsx"),
        pytest.param(lambda folder: ods(folder / "log.ods", [HEADER, *ROWS]), id="ods"),
    ],
)
def test_a_canonical_sheet_needs_no_map(tmp_path, path):
    file = path(tmp_path)
    record = read(file)
    np.testing.assert_allclose(record.triad("acc").values, ACC, rtol=2e-15)  # openpyxl writes 16 digits
    np.testing.assert_allclose(record["acc_x"].t, T, rtol=2e-15)
    assert canonical_units([file])["acc_x"].symbol == "m/s^2"
    assert record.findings == ()


@pytest.mark.parametrize("above", [0, 3], ids=["first row", "below a preamble"])
@pytest.mark.parametrize("unit_row", [True, False])
def test_names_and_a_row_of_units_are_found_where_they_stand(tmp_path, above, unit_row):
    preamble = [("Logger 7", "", "", ""), ("operator", "A. B.", "", ""), ("", "", "", "")][:above]
    names = (
        ("Time", "Acc X", "Acc Y", "Acc Z")
        if unit_row
        else ("Time [ms]", "Acc X [g]", "Acc Y [g]", "Acc Z [g]")
    )
    units = [("[ms]", "[g]", "[g]", "[g]")] if unit_row else []
    rows = [(1000 * t, *(a / 9.80665 for a in acc)) for t, *acc in ROWS]
    path = book(
        tmp_path / "log.xlsx",
        ("Info", [("made in a laboratory",)]),
        ("Data", [*preamble, names, *units, *rows]),
    )
    record = read(path, mapped(tmp_path / "map.toml", guess_map(path)))
    np.testing.assert_allclose(record.triad("acc").values * record["acc_x"].unit.factor, ACC, rtol=1e-12)
    assert record["acc_x"].unit.symbol == "g"
    np.testing.assert_allclose(record["acc_x"].t - record["acc_x"].t[0], T, atol=1e-9)


def test_dates_are_seconds_and_an_odd_cell_is_missing(tmp_path):
    begin = datetime.datetime(2026, 5, 4, 10, 20, 30)
    rows = [(begin + datetime.timedelta(seconds=k), *acc) for k, acc in enumerate(ACC.tolist())]
    rows[7] = (*rows[7][:3], "#N/A")
    path = book(tmp_path / "log.xlsx", ("Data", [("Time", "acc_x", "acc_y", "acc_z"), *rows]))
    text = '[columns]\nt = {from = "Time", unit = "s"}\n' + "".join(
        f'acc_{axis} = {{from = "acc_{axis}", unit = "m/s^2"}}\n' for axis in "xyz"
    )
    record = read(path, mapped(tmp_path / "map.toml", text))
    np.testing.assert_allclose(np.diff(record["acc_x"].t), 1.0, atol=1e-6)
    assert np.flatnonzero(np.isnan(record["acc_z"].values)).tolist() == [7]
    assert record.findings


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        ({"a.csv": "1,2", "b.csv": "3", "c.csv": "4"}, "is a ZIP archive that holds 3 CSV files: unpack it"),
        ({"word/document.xml": ""}, "is a Word document"),
    ],
)
def test_other_archives_say_what_they_are_and_the_way_out(tmp_path, content, sentence):
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w") as archive:
        for name, text in content.items():
            archive.writestr(name, text)
    path = tmp_path / "data.zip"
    path.write_bytes(buffer.getvalue())
    with pytest.raises(RecordError, match=sentence):
        read(path)


@pytest.mark.parametrize("ending", ["", ".imu", ".asc", ".xyz"])
def test_text_is_read_whatever_its_ending(tmp_path, ending):
    path = tmp_path / f"log{ending}"
    path.write_text("\n".join([",".join(HEADER), *(",".join(map(repr, row)) for row in ROWS)]) + "\n")
    np.testing.assert_array_equal(read(path).triad("acc").values, ACC)


@pytest.mark.parametrize("encoding", ["utf-16", "utf-16-le", "utf-16-be", "utf-8-sig"])
def test_text_of_windows_is_told_by_its_mark(tmp_path, encoding):
    text = "\r\n".join([",".join(HEADER), *(",".join(map(repr, row)) for row in ROWS)]) + "\r\n"
    mark = "" if encoding in ("utf-16", "utf-8-sig") else "\ufeff"
    path = tmp_path / "log.csv"
    path.write_bytes((mark + text).encode(encoding))
    record = read(path)
    np.testing.assert_array_equal(record.triad("acc").values, ACC)
    assert record.findings == ()


def test_a_spreadsheet_without_its_ending_is_told_by_its_content(tmp_path):
    path = book(tmp_path / "log.xlsx", ("Log", [HEADER, *ROWS]))
    plain = path.rename(tmp_path / "log")
    np.testing.assert_allclose(read(plain).triad("acc").values, ACC, rtol=2e-15)


@pytest.mark.parametrize(
    ("head", "sentence"),
    [
        (b"%PDF-1.7\n", "is a PDF document"),
        (b"\x7fELF\0\0", r"is binary \(zero byte at 4\)"),
    ],
)
def test_what_is_no_recording_says_the_way_out(tmp_path, head, sentence):
    path = tmp_path / "data.abc"
    path.write_bytes(head)
    with pytest.raises(RecordError, match=sentence):
        read(path)
