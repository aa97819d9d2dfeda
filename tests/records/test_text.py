"""Text files: every dialect of CSV reads the same, and whatever is wrong is said."""

import gzip
import hashlib
import subprocess
import sys

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from inercal.foundation.errors import InputError, RecordError
from inercal.foundation.records.read import layout, read
from rows import for_each

HEADER = "t [s],acc_x [m/s^2],gyro_x [deg/h]"
ROWS = [[0.0, 9.81, -0.5], [0.01, 9.79, 0.25], [0.02, 9.80, 1.0], [0.03, 9.82, -2.0]]


def written(path, text, encoding="utf-8"):
    path.write_bytes(text.encode(encoding))
    return path


def table(rows=ROWS, delimiter=",", end="\n", header=HEADER):
    named = [header.replace(",", delimiter)] if header else []
    return end.join([*named, *(delimiter.join(map(repr, row)) for row in rows), ""])


def codes(record):
    return [finding.code for finding in record.findings]


def where(record, code):
    return next(finding.where for finding in record.findings if finding.code == code)


def holds_rows(record, rows=ROWS):
    t, acc, gyro = np.array(rows).T
    return (
        np.array_equal(record["acc_x"].t, t)
        and np.array_equal(record["acc_x"].values, acc)
        and np.array_equal(record["gyro_x"].values, gyro)
    )


def test_a_canonical_header_names_quantity_and_unit(tmp_path):
    path = written(tmp_path / "a.csv", table())
    record = read(path)
    assert holds_rows(record)
    assert list(record.columns) == ["acc_x", "gyro_x"]
    assert (record["acc_x"].sensor, record["acc_x"].axis, record["acc_x"].unit.symbol) == (
        "acc",
        "x",
        "m/s^2",
    )
    assert record["gyro_x"].unit.symbol == "deg/h"
    assert record["acc_x"].t is record["gyro_x"].t
    assert record.findings == ()
    assert record.sources[0].sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


@for_each("delimiter", [",", ";", "\t", " ", "   "])
@for_each("end", ["\n", "\r\n"])
def test_delimiters_and_line_ends_are_found_out(tmp_path, delimiter, end):
    assert holds_rows(read(written(tmp_path / "a.txt", table(delimiter=delimiter, end=end))))


def test_a_byte_order_mark_a_missing_last_line_end_and_quotes_change_nothing(tmp_path):
    assert holds_rows(read(written(tmp_path / "a.csv", "\ufeff" + table())))
    assert holds_rows(read(written(tmp_path / "a.csv", table().rstrip("\n"))))
    quoted = "\n".join(
        ",".join(f'"{field}"' for field in line.split(",")) for line in table().split("\n")[:-1]
    )
    assert holds_rows(read(written(tmp_path / "a.csv", quoted)))


def test_commas_mark_decimals_between_semicolons(tmp_path):
    text = table(delimiter=";").replace(".", ",")
    assert holds_rows(read(written(tmp_path / "a.csv", text)))


def test_comments_and_blank_lines_are_no_rows(tmp_path):
    text = "# a log, of, some\n\n" + table().replace("0.02,", "% later, and, so on\n   \n0.02,")
    assert holds_rows(read(written(tmp_path / "a.csv", text)))


def test_the_degree_sign_of_an_old_logger_is_read(tmp_path):
    header = "t [s],acc_x [m/s²],gyro_x [°/s]"
    record = read(written(tmp_path / "a.csv", table(header=header), "latin-1"))
    assert record["gyro_x"].unit.symbol == "deg/s"
    assert record["acc_x"].unit.symbol == "m/s^2"


def test_unknown_columns_are_passed_over_and_labels_kept(tmp_path):
    text = "t [s],label,acc_x [g],battery\n0.0,x up,1.0,full\n0.1,x up,1.0,full\n0.2,x down,-1.0,empty\n"
    record = read(written(tmp_path / "a.csv", text))
    assert record.labels == ("x up", "x up", "x down")
    assert list(record.columns) == ["acc_x"]
    assert record.findings == ()


@pytest.mark.parametrize("title", ["ax (m/s2)", "ax [m/s2]", "ax(m/s2)", "ax"])
def test_a_map_may_leave_out_the_unit_that_a_header_has_in_brackets(tmp_path, title):
    path = written(tmp_path / "a.csv", table(header=f"t,{title},gx (deg/h)"))
    columns = "t = { from = 't', unit = 's' }\nacc_x = { from = 'ax', unit = 'm/s^2' }\n"
    columns += "gyro_x = { from = 'gx', unit = 'deg/h' }\n"
    record = read(path, written(tmp_path / "map.toml", f"[columns]\n{columns}"))
    assert holds_rows(record)


def test_compressed_files_are_read(tmp_path):
    path = tmp_path / "a.csv.gz"
    path.write_bytes(gzip.compress(table().encode()))
    assert holds_rows(read(path))


@settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    rows=st.lists(st.tuples(*[st.floats(-1e29, 1e29)] * 3), min_size=1, max_size=30),
    delimiter=st.sampled_from([",", ";", "\t", " "]),
    block=st.sampled_from([200, 1000, 1 << 21]),
)
def test_what_is_written_reads_back_exactly(tmp_path, monkeypatch, rows, delimiter, block):
    monkeypatch.setattr(layout, "_BLOCK", block)
    rows = [(0.1 * k, *values) for k, (_, *values) in enumerate(rows)]
    record = read(written(tmp_path / "a.csv", table(rows, delimiter)))
    assert holds_rows(record, rows)
    assert not {"bad_row", "nan", "truncated"} & set(codes(record))


@pytest.mark.parametrize("block", [60, 100, 1 << 21])
def test_findings_do_not_depend_on_the_blocks_read(tmp_path, monkeypatch, block):
    text = (
        table(ROWS * 10).replace("0.03,9.82,-2.0\n", "0.03,,-2.0\n", 3).replace("0.02,9.8,1.0\n", "oops\n", 2)
    )
    whole = read(written(tmp_path / "a.csv", text))
    monkeypatch.setattr(layout, "_BLOCK", block)
    parts = read(tmp_path / "a.csv")
    assert parts.findings == whole.findings
    np.testing.assert_array_equal(parts["acc_x"].values, whole["acc_x"].values)


def test_unreadable_rows_stay_as_nan_and_their_lines_are_said(tmp_path):
    text = table().replace("0.01,9.79,0.25", "0.01,9.7x9,0.25").replace("0.02,9.8,1.0", "0.02,9.8")
    record = read(written(tmp_path / "a.csv", text))
    assert where(record, "bad_row") == "lines 3-4"
    assert codes(record) == ["bad_row"]
    np.testing.assert_array_equal(record["acc_x"].values, [9.81, np.nan, np.nan, 9.82])
    np.testing.assert_array_equal(record["gyro_x"].values, [-0.5, 0.25, np.nan, -2.0])
    np.testing.assert_array_equal(record["acc_x"].t, [0.0, 0.01, np.nan, 0.03])


@for_each("empty", ["", " ", "nan", "NaN", "NA", "null", "inf", "1e999"])
def test_missing_values_are_nan_and_said_for_each_column(tmp_path, empty):
    record = read(written(tmp_path / "a.csv", table().replace("9.79", empty)))
    assert codes(record) == ["nan"]
    assert record.findings[0].message.startswith("acc_x: 1 missing value")
    assert record.findings[0].where == "line 3"
    np.testing.assert_array_equal(record["acc_x"].values, [9.81, np.nan, 9.80, 9.82])


@pytest.mark.parametrize("cut", ["0.04,9", "0.04,9.8,-1.5e", "0."])
def test_a_cut_last_row_is_said(tmp_path, cut):
    record = read(written(tmp_path / "a.csv", table() + cut))
    assert codes(record) == ["truncated"]
    assert where(record, "truncated") == "line 6"
    assert len(record["acc_x"].values) == 5
    assert np.isnan(record["gyro_x"].values[-1])


def test_a_compressed_file_that_ends_too_soon_is_said(tmp_path):
    rng = np.random.default_rng(1)
    rows = np.column_stack([np.arange(5000) / 100, rng.standard_normal((5000, 2))]).tolist()
    packed = gzip.compress(table(rows).encode())
    path = tmp_path / "a.csv.gz"
    path.write_bytes(packed[: len(packed) // 2])
    record = read(path)
    assert codes(record) == ["truncated"]
    assert 2000 < len(record["acc_x"].values) < 3000
    np.testing.assert_array_equal(record["acc_x"].values[:2000], np.array(rows)[:2000, 1])
    path.write_bytes(packed[:3000] + b"oops" + packed[3000:])
    with pytest.raises(RecordError, match="damaged"):
        read(path)


@pytest.mark.parametrize(
    "header",
    ["position,y_x [deg/h]", "phi1 [deg],y_x [deg/h]", "phi3 [rad],y_x [V]", "rate [deg/s],gyro_z [deg/s]"],
)
def test_rows_of_a_test_on_a_table_are_counted_where_no_time_is_said(tmp_path, header):
    rows = "".join(f"{k // 2},{0.5 * k}\n" for k in range(600))
    record = read(written(tmp_path / "a.csv", f"{header}\n{rows}"))
    first, output = record.columns.values()
    np.testing.assert_array_equal(output.t, np.arange(600.0))
    np.testing.assert_array_equal(output.values, 0.5 * np.arange(600))
    assert first.t is output.t
    assert record.findings == ()


@for_each(
    ("content", "message"),
    [
        ("", "is empty"),
        ("\n\n", "found no rows"),
        (HEADER + "\n", "line 1: found a header and no row after it, expected numbers"),
        (HEADER + "\nx,y,z\nx,y,z\n", "no row of numbers, line 2 is 'x,y,z', expected numbers"),
        ("1,2,3\n4,5,6\n", "line 1: found '1,2,3', expected a header such as"),
        ("time,ax,ay\n1,2,3\n", "line 1: found the columns time, ax, ay, expected known ones"),
        ("t [s],acc_x\n1,2\n", "line 1: found 'acc_x' without a unit, expected it in brackets"),
        ("t [s],acc_x [flurb]\n1,2\n", "line 1: acc_x: found the unit 'flurb', expected one such as"),
        (
            "t [s],acc_x [deg]\n1,2\n",
            r'line 1: acc_x: found "deg" \(angle\), expected a unit of acceleration',
        ),
        ("t [s],acc_x [g],acc_x [g]\n1,2,3\n", "line 1: found acc_x twice, expected each column once"),
        ("t [s],acc_x [g]\n1,2,3\n1,2,3\n", "line 1: found 2 names over rows of 3 fields"),
        ("acc_x [g]\n1.0\n2.0\n", r'found no time column t, expected one, .* \[time\] rate = "100 Hz"'),
        ("t [s]\n1.0\n2.0\n", "found a time column alone"),
        ("\x00\x01\x02PNG\x00\x00", "found a zero byte, expected text"),
    ],
)
def test_what_cannot_be_read_is_said_in_one_sentence(tmp_path, content, message):
    path = written(tmp_path / "a.csv", content)
    with pytest.raises(InputError, match=message) as caught:
        read(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_and_a_folder_are_said(tmp_path):
    with pytest.raises(RecordError, match="no such file"):
        read(tmp_path / "none.csv")
    (tmp_path / "folder.csv").mkdir()
    (tmp_path / "bag").mkdir()
    with pytest.raises(RecordError, match=r"is a folder without metadata\.yaml"):
        read(tmp_path / "bag")
    with pytest.raises(RecordError, match="a folder"):
        read(tmp_path / "folder.csv")
    with pytest.raises(RecordError, match="no file"):
        read([])


def test_of_many_strange_columns_whole_names_are_said(tmp_path):
    names = [f"Drehrate {i} [mdeg/s]" for i in range(12)]
    path = written(tmp_path / "a.csv", ";".join(names) + "\n" + ";".join("1" * 12) + "\n")
    said = (
        r"Drehrate 7 \[mdeg/s\] and 4 more, expected known ones .* or a map "
        r"\(`inercal new` imu, turntable, selfcal or aoa writes one\)"
    )
    with pytest.raises(RecordError, match=said):
        read(path)


def test_positions_need_no_clock(tmp_path):
    text = "position,phi1 [deg],phi2 [deg],y_x [deg/h]\n0,0.0,0.0,1.5\n1,90.0,0.0,2.5\n2,90.0,45.0,3.5\n"
    record = read(written(tmp_path / "a.csv", text))
    assert list(record.columns) == ["position", "phi1", "phi2", "y_x"]
    np.testing.assert_array_equal(record["y_x"].t, [0.0, 1.0, 2.0])


def test_progress_counts_bytes_up_to_all(tmp_path, monkeypatch):
    monkeypatch.setattr(layout, "_BLOCK", 200)
    first = written(tmp_path / "a.csv", table(ROWS * 20))
    second = written(tmp_path / "b.csv", "t [s],acc_y [g]\n" + "0.1,2.0\n" * 50)
    told = []
    read([first, second], progress=lambda done, total: told.append((done, total)))
    done, total = np.array(told).T
    size = first.stat().st_size + second.stat().st_size
    assert len(told) > 4
    assert (np.diff(done) >= 0).all()
    assert done[-1] == size
    assert set(total) == {size}


def test_a_plain_csv_loads_nothing_heavy(tmp_path):
    path = written(tmp_path / "a.csv", table())
    script = (
        "import sys; from inercal.foundation.records.read import read; read(sys.argv[1]);"
        "print([name for name in ('scipy', 'pydantic', 'h5py', 'numba', 'xarray', 'pint') if name in sys.modules])"
    )
    run = subprocess.run([sys.executable, "-c", script, path], capture_output=True, text=True, check=True)
    assert run.stdout.strip() == "[]"


def test_long_recordings_take_little_memory(tmp_path):
    """300 000 rows of 7 columns stay within their share of 4 GiB for ten million."""
    rows = 300_000
    rng = np.random.default_rng(2)
    names = [f"{sensor}_{axis}" for sensor in ("acc", "gyro") for axis in "xyz"]
    units = ["m/s^2"] * 3 + ["deg/h"] * 3
    line = ",".join(f"{value:.9g}" for value in rng.standard_normal(6))
    path = tmp_path / "long.csv"
    with path.open("w") as file:
        file.write(",".join(["t [s]", *(f"{n} [{u}]" for n, u in zip(names, units, strict=True))]) + "\n")
        file.writelines(f"{index / 100:.2f},{line}\n" for index in range(rows))
    script = (
        "import resource, sys, numpy; from inercal.foundation.records.read import read, text;"
        "peak = lambda: resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024;"
        "before = peak(); record = read(sys.argv[1]); print(peak() - before, len(record['acc_x'].values))"
    )
    run = subprocess.run([sys.executable, "-c", script, path], capture_output=True, text=True, check=True)
    used, read_rows = map(int, run.stdout.split())
    assert read_rows == rows
    assert used < 4 * 2**30 * rows / 10_000_000
