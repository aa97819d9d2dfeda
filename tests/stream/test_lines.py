"""Lines of a stream are read as the same lines in a file are."""

import io
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from inercal.faces.stream.doubt import Doubt, HeldRows
from inercal.faces.stream.lines import Lines
from inercal.foundation.errors import InputError, MapError, RecordError
from inercal.foundation.records.maps import read_map
from inercal.foundation.records.read import read
from rows import for_each

HEADER = "t [s],acc_x [g],gyro_x [deg/s]\n"
MAP = """
[columns.t]
from = 0
unit = "ms"
[columns.gyro_x]
from = 2
unit = "deg/s"
sign = -1
scale = 0.1
[columns.acc_x]
from = 1
unit = "g"
"""
INCREMENTS = """
[columns.gyro_x]
from = 1
unit = "arcsec"
kind = "increment"
scale = 0.3
sign = -1
[columns.acc_x]
from = 0
unit = "mm/s"
kind = "increment"
[time]
rate = "30 Hz"
"""


def samples(data, record_map=None):
    """All samples of some bytes, what was said, and the lines."""
    said = []
    lines = Lines(
        io.BytesIO(data if isinstance(data, bytes) else data.encode()), "stdin", record_map, said.append
    )
    found, doubt, count = [], Doubt.of(HeldRows()), 0
    while (line := lines.next()) is not None:
        doubt, decided = doubt.on(lines.sample(line, count), line.number, lines)
        found += decided
        count += 1
    found += doubt.end(lines)
    lines.close()
    return found, said, lines


def same_as_a_file(folder, data, map_text=None):
    """The stream's samples have the digits of the record that is read of the same bytes."""
    data = data if isinstance(data, bytes) else data.encode()
    (folder / "log.csv").write_bytes(data)
    record_map = None
    if map_text is not None:
        (folder / "map.toml").write_text(map_text, "utf-8")
        record_map = read_map(folder / "map.toml")
    record = read(folder / "log.csv", record_map)
    found, said, lines = samples(data, record_map)
    assert list(lines.record.columns) == list(record.columns)
    for i, (name, column) in enumerate(record.columns.items()):
        template = lines.record[name]
        assert (template.unit, template.sensor, template.axis) == (column.unit, column.sensor, column.axis)
        np.testing.assert_array_equal([sample.values[i] for sample in found], column.values)
    np.testing.assert_array_equal([sample.t for sample in found], next(iter(record.columns.values())).t)
    assert [sample.row for sample in found] == list(range(len(found)))
    if lines.labelled:
        assert tuple(sample.label for sample in found) == record.labels
    return record, found, said


ROWS = "0.0,1.5,2.25\n0.1,-1e-3,3\n0.2,0.3,-0.1\n"


@for_each(
    ("data", "map_text"),
    [
        (HEADER + ROWS, None),
        ((HEADER + ROWS).replace("\n", "\r\n"), None),
        (b"\xef\xbb\xbf" + (HEADER + ROWS).encode(), None),
        ("# by a logger\n\n" + HEADER + "# begins\n" + ROWS + "\n% ends\n", None),
        (HEADER + ROWS.rstrip("\n"), None),
        ((HEADER + ROWS).replace(",", ";"), None),
        ((HEADER + ROWS).replace(",", "\t"), None),
        ((HEADER + ROWS).replace(",", ";").replace(".", ","), None),
        (HEADER.replace(",", ";") + "0;1;2\n1;2;3\n2;0,5;1,5\n3;1,5;0,25\n", None),
        (
            HEADER.replace(",", ";")
            + "".join(f"{i};{i};7\n" for i in range(500))
            + "".join(f"{i};{i},5;7\n" for i in range(500, 600)),
            None,
        ),
        (
            "t [s];label;acc_x [g]\n"
            + "".join(f"{i};pos. {i};7\n" for i in range(500))
            + "".join(f"{i};pos. {i};{i},5\n" for i in range(500, 600)),
            None,
        ),
        (HEADER.replace(",", ",note,") + ROWS.replace(",", ",x,"), None),
        (HEADER + ROWS.replace("1.5", '"1.5"'), None),
        ("t [s],label,acc_x [g]\n0.0,rest,1\n0.1, turn ,1.5\n0.2,rest,2\n", None),
        ("position,phi1 [deg],y_x [deg/h]\n1,0,0.5\n2,90,0.25\n3,180,1\n", None),
        (b"# 20 \xb0C\n" + (HEADER + ROWS).encode(), None),
        (HEADER + ROWS, MAP),
        (ROWS, MAP),
        (
            (HEADER + ROWS).replace(",", ";").replace(".", ","),
            MAP + '[file]\ndelimiter = ";"\ndecimal = ","\n',
        ),
        ("logger 7\nserial 3,4\n" + HEADER + ROWS, MAP + "[file]\nskip = 2\n"),
        ("! note\n" + ROWS + "! end\n", MAP + '[file]\ncomment = "!"\n'),
        (ROWS, MAP + '[time]\nrate = "7 Hz"\nignore = true\n'),
        ("3,10\n4,11\n-2,12\n0,1\n", INCREMENTS),
        ("3 10\n4   11\n -2 12\n", INCREMENTS),
    ],
)
def test_digits_are_those_of_the_file(data, map_text, tmp_path):
    record, found, said = same_as_a_file(tmp_path, data, map_text)
    unended = [] if data[-1:] in ("\n", b"\n") else ["truncated"]
    assert [finding.code for finding in said] == unended
    assert len(found) >= 3
    codes = [each.code for each in record.findings if each.code in ("bad_row", "nan", "truncated")]
    assert codes == unended


def test_whole_numbers_with_too_many_digits_are_said(tmp_path):
    """2^53 + 1 has no float64 of its own; 2^53 and 2^60 have. A fraction is rounded anyway, and so are stamps."""
    stamp = 1_700_000_000_123_456_789
    numbers = [2**53 - 1, 2**53, 2**53 + 1, -(2**53) - 1, 2**60, 10**18 + 1, "9007199254740993.0", "1e400"]
    rows = [f"{stamp + 10**7 * i},{number},{i}\n" for i, number in enumerate(numbers)]
    record, found, said = same_as_a_file(tmp_path, "t [ns],acc_x [count],acc_y [count]\n" + "".join(rows))
    whole = [(finding.message, finding.where) for finding in record.findings if finding.code == "resolution"]
    assert whole == [("acc_x: 3 whole numbers beyond 2^53, rounded to 53 bits", "lines 4-5, 7")]
    live = [finding.where for finding in said if finding.code == "resolution"]
    assert live == ["line 4", "line 5", "line 7"]
    assert found[2].values[0] == 2.0**53


def test_what_is_no_number_is_nan_and_said_with_its_line(tmp_path):
    data = HEADER + "0.0,1,2\n0.1,x,3\n0.2,1\n0.3,,4\n0.4,1,inf\n,1,2\n1,2,3,4\n0.7,1,2\n0.8,"
    record, found, said = same_as_a_file(tmp_path, data)
    assert [(finding.code, finding.where) for finding in said] == [
        ("bad_row", "line 3"),
        ("bad_row", "line 4"),
        ("nan", "line 5"),
        ("nan", "line 6"),
        ("nan", "line 7"),
        ("bad_row", "line 8"),
        ("truncated", "line 10"),
    ]
    # of a bad row the other numbers are kept, unless their places are not known
    assert (found[1].t, found[1].values[1]) == (0.1, 3.0)
    assert np.isnan([found[2].t, *found[2].values]).all()
    # a file's findings say the same lines
    text = " ".join(finding.where for finding in record.findings)
    assert all(each in text for each in ("3-4", "8", "line 10"))


@settings(deadline=None, max_examples=60)
@given(
    st.lists(
        st.sampled_from(
            [
                "0.5,1,2",
                "1,2",
                "x,1,2",
                "1,,2",
                "",
                "#",
                "nan,1,2",
                "1_0,2,3",
                '"1",2,3',
                "1,2,3,",
                " 4 , 5,6",
            ]
        ),
        max_size=12,
    )
)
def test_any_rows_are_read_as_in_a_file(tmp_path_factory, rows):
    # most rows of a file are good ones, by which its layout is found out
    text = "\n".join(["0,1,2", *rows, *["9,1,2"] * 20])
    same_as_a_file(tmp_path_factory.mktemp("rows"), f"{HEADER}{text}\n")


def test_stamps_that_repeat_or_run_backward_are_said_as_they_come(tmp_path):
    """The first of a run of equal stamps, and each step back: the rows that a file's findings name, in lines."""
    stamps = [0.0, 0.1, 0.2, 0.2, 0.2, 0.3, 0.15, 0.25, "", 0.2, 0.4, 0.4]
    data = HEADER + "".join(f"{t},1,2\n" for t in stamps)
    record, _, said = same_as_a_file(tmp_path, data)
    odd = [(each.code, each.where) for each in said if each.code.endswith("_time")]
    assert odd == [
        ("duplicate_time", "line 5"),
        ("backward_time", "line 8"),
        ("backward_time", "line 11"),
        ("duplicate_time", "line 13"),
    ]
    whole = {each.code: each.where for each in record.findings}
    assert whole["backward_time"] == "rows 7, 10"
    assert whole["duplicate_time"] == "rows 4-5, 12"


def test_a_flood_is_counted():
    _, said, _ = samples(HEADER + "0,1,2\n" + "junk\n" * 30 + "1,,2\n")
    assert [finding.where for finding in said] == [*(f"line {n}" for n in range(3, 8)), "line 33", ""]
    assert said[-1].message.endswith("25 more")


def test_the_first_row_may_be_cut():
    """As where a serial line was joined in the middle, with and without a header."""
    found, said, _ = samples(HEADER + "5,2\n0.1,1,2\n0.2,1,2\n")
    assert np.isnan(found[0].values).all()
    assert [sample.t for sample in found[1:]] == [0.1, 0.2]
    assert [finding.where for finding in said] == ["line 2"]


def test_the_first_row_may_be_cut_without_a_header(tmp_path):
    (tmp_path / "map.toml").write_text(MAP)
    found, said, _ = samples("5,2\n100,1,2\n200,1,2\n", read_map(tmp_path / "map.toml"))
    assert [sample.t for sample in found[1:]] == [0.1, 0.2]
    assert [finding.where for finding in said] == ["line 1"]


class Slow(io.RawIOBase):
    """A pipe whose writer sends one line only when all before have been used."""

    def __init__(self, lines):
        self.lines, self.sent = list(lines), 0

    def readable(self):
        return True

    def readinto(self, buffer):
        if self.sent == len(self.lines):
            return 0
        data = self.lines[self.sent].encode()
        buffer[: len(data)] = data
        self.sent += 1
        return len(data)


def test_nothing_is_read_ahead():
    """The header and one row are enough to begin; then each row needs its own line alone."""
    pipe = Slow([HEADER, *ROWS.splitlines(keepends=True)])
    lines = Lines(io.BufferedReader(pipe), "stdin", None, print)
    assert pipe.sent == 2
    for n in range(3):
        assert lines.sample(lines.next(), n).t == n / 10
        assert pipe.sent == n + 2
    assert lines.next() is None


@for_each(
    ("data", "says"),
    [
        ("", "ended without a row"),
        ("# nothing\n\n", "ended without a row"),
        (HEADER, "a header and no row after it"),
        ("1,2,3\n4,5,6\n7,8,9\n", "line 1: found '1,2,3', expected a header"),
        ("a,b\n1,2\n3,4\n", "expected known ones"),
        ("t [s]\n1\n2\n3\n", "time column alone"),
        ("t,acc_x [g]\n1,2\n3,4\n", "without a unit"),
        ("acc_x [g]\n1\n2\n3\n", "no time column"),
        ("t [s],acc_x [quux]\n1,2\n3,4\n", "quux"),
        (HEADER + "1,2,3,4\n1,2,3,4\n", "3 names over rows of 4 fields"),
        ("\0\0\0\n\0\n\0\n", "zero byte"),
        (b"1" * (1 << 20), "longer than 1048576 bytes"),
    ],
)
def test_what_is_no_record_is_one_sentence(data, says):
    with pytest.raises(InputError) as caught:
        samples(data)
    assert str(caught.value).startswith("stdin")
    assert says in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("map_text", "error", "says"),
    [
        (MAP.replace("from = 2", 'from = "speed"'), MapError, "columns.gyro_x.from: found no 'speed'"),
        (MAP.replace("from = 2", "from = 9"), MapError, "found no 9 in stdin"),
        (INCREMENTS.partition("[time]")[0], MapError, "time.rate: missing"),
        (
            MAP.replace("[columns.", "[file.a.columns.") + '[file.a]\npath = "a"\n[file.b]\npath = "b"\n'
            '[file.b.columns.acc_y]\nfrom = 0\nunit = "g"\n',
            MapError,
            "columns of 2 files",
        ),
        ('[columns.acc_x]\nfrom = 1\nunit = "g"\n', RecordError, "no time column"),
    ],
)
def test_a_map_that_does_not_fit_is_one_sentence(map_text, error, says, tmp_path):
    (tmp_path / "map.toml").write_text(map_text)
    with pytest.raises(error) as caught:
        samples(HEADER + ROWS, read_map(tmp_path / "map.toml"))
    assert says in str(caught.value)


def test_settings_hold_what_decides_the_numbers(tmp_path):
    """Scale, sign, unit and rate: a state saved for one stream is not gone on with in another."""
    found = []
    for i, text in enumerate(
        [MAP, MAP.replace("-1", "1"), MAP.replace('"g"', '"m/s^2"'), MAP.replace('"ms"', '"s"')]
    ):
        (tmp_path / f"{i}.toml").write_text(text)
        found.append(str(samples(ROWS, read_map(tmp_path / f"{i}.toml"))[2].settings))
    assert len(set(found)) == len(found)


def test_carriage_returns_alone_are_refused():
    """A stream has no end to tell by that all of its lines end so."""
    data = b"t [s],acc_x [g]\r0,1\r1,1\r2,1\r"
    with pytest.raises(
        RecordError, match="line 1: found a carriage return in it, expected lines that end with"
    ):
        Lines(io.BytesIO(data), "stdin", None, print)


def test_whole_numbers_of_thousands_of_digits_end_nothing():
    """They ended a stream with a fault of inercal's own."""
    said = []
    rows = b"0,1\n1," + b"0" * 5000 + b"9007199254740993\n2," + b"9" * 5000 + b"\n3,1\n"
    lines = Lines(io.BytesIO(b"t [s],gyro_x [count]\n" + rows), "stdin", None, said.append)
    found = [lines.sample(line, row).values[0] for row, line in enumerate(iter(lines.next, None))]
    assert found[:2] + found[3:] == [1.0, 2.0**53, 1.0]
    assert math.isnan(found[2])
    assert [finding.code for finding in said] == ["resolution", "nan"]
