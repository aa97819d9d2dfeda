"""Rows of numbers by compiled code: the floats of Python, bit for bit, and the rows and flaws of the slower ways."""

import struct

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from inercal.foundation.records.read import read, text
from inercal.foundation.records.read.layout import Block, TextLayout
from inercal.foundation.records.read.plain_rows import LEAST, MOST, fives, plain_rows

COMMA = b",.\n#%"

# of integers of 64 bits, as compiled kernels do without a word
pytestmark = pytest.mark.filterwarnings("ignore:overflow encountered")


def numbers_of(texts):
    """The numbers of texts, a line each, and how many of them are plain before the first that is not."""
    data = np.frombuffer("\n".join(texts).encode(), np.uint8)
    rows = np.empty((len(texts), 1))
    count, _ = plain_rows(data, 0, COMMA, np.array([0]), 1e300, rows)
    return rows[:count, 0]


def same(texts):
    """True if all texts are plain and the numbers are those of Python, signs of zeros too."""
    found, wanted = numbers_of(texts), np.array([float(each) for each in texts])
    return len(found) == len(wanted) and np.array_equal(found.view(np.int64), wanted.view(np.int64))


@pytest.mark.kernels
def test_numbers_are_the_nearest_floats():
    """Of every size, with 1 to 19 digits, in every notation, and halfway between two floats."""
    rng = np.random.default_rng(20261123)
    n = 20_000
    sizes = rng.normal(size=n) * 10.0 ** rng.uniform(-290, 290, n)
    assert same([repr(float(each)) for each in sizes])
    assert same([f"{each:.{places}e}" for each, places in zip(sizes, rng.integers(0, 19, n), strict=True)])
    assert same(
        [
            f"{each:.{places}f}"
            for each, places in zip(rng.normal(size=n), rng.integers(1, 17, n), strict=True)
        ]
    )
    odd = 2 * (rng.integers(0, 1 << 52, n) + (1 << 52)) + 1
    assert same([str(each << int(k)) for each, k in zip(odd.tolist(), rng.integers(0, 9, n), strict=True)])
    assert same([f"{each // 2}.5" for each in (odd // 2).tolist()])
    assert same(
        ["0", "-0", "+0.00", ".5", "5.", "00012.5", "9007199254740993", "1e22", "1E+23", "-8.5e-7", "1e00003"]
    )


@pytest.mark.kernels
@given(
    st.floats(allow_nan=False, allow_infinity=False, min_value=-1e299, max_value=1e299), st.integers(0, 40)
)
@settings(derandomize=True, deadline=None)
@example(2.2250738585072014e-308, 17)
@example(5e-324, 3)
def test_what_is_plain_is_right(value, places):
    """Subnormal numbers and more than 19 digits are left to Python; whatever is read is its number."""
    for written in (repr(value), f"{value:.{places}e}", f"{value:.{min(places, 20)}f}"):
        found = numbers_of([written])
        if len(found):
            assert struct.pack("<d", found[0]) == struct.pack("<d", float(written))
        else:
            assert len(written) > 19 or abs(value) < 1e-290


@pytest.mark.kernels
@pytest.mark.parametrize(
    "written",
    [
        "",
        "-",
        ".",
        "e5",
        "1e",
        "1e+",
        "1_0",
        "0x1",
        "nan",
        "inf",
        "1 2",
        "1.2.3",
        "--1",
        "1,",
        '"1"',
        "1e400",
    ],
)
def test_what_is_no_plain_number_is_left(written):
    assert len(numbers_of([written, "1"])) == 0 or written == "1,"  # a delimiter may end a line


@pytest.mark.kernels
def test_powers_of_five_have_128_bits():
    """Cut off, but for 5^-27 to 5^-1, which are rounded up, as exact whole numbers say."""
    table = fives()
    for q in range(LEAST, MOST + 1):
        high, low = (int(each) for each in table[q - LEAST])
        value, power = (high << 64) + low, 5 ** abs(q)
        assert 1 << 127 <= value < 1 << 128
        if q >= 0:
            shift = power.bit_length() - 128
            assert value == (power >> shift if shift >= 0 else power << -shift)
        else:
            shift = 127 + power.bit_length() - (power & (power - 1) == 0)
            beyond = value * power - (1 << shift)
            assert 0 < beyond <= power if q >= -27 else -power < beyond < 0


FIELDS = st.sampled_from(
    ["1", "-2.5", " 3e-2 ", "", "nan", "x", "1.000", "2,5", '"4"', "1e31", "7\t", "99999999999999999999"]
)
LINES = st.one_of(
    st.lists(FIELDS, min_size=2, max_size=4),
    st.lists(st.sampled_from(["1", "-2.25", "0.125"]), min_size=3, max_size=3),
    st.sampled_from([["# words"], [""], ["%"], [" "], ["  # 1"]]),
)  # fmt: skip


@pytest.mark.kernels
@given(
    st.lists(LINES, min_size=1, max_size=30),
    st.sampled_from([(",", "."), (";", ","), (";", "."), ("\t", "."), (None, "."), (";", "")]),
    st.sampled_from(["\n", "\r\n"]),
    st.booleans(),
)
@settings(derandomize=True, deadline=None, max_examples=300)
def test_rows_and_flaws_are_those_of_line_by_line(lines, marks, end, cut):
    """Whatever stands between the plain lines, in every dialect."""
    delimiter, decimal = marks
    data = "".join((delimiter or " ").join(line) + end for line in lines)
    data = data.removesuffix(end) if cut and data.removesuffix(end) else data
    block = Block(data.encode(), b"\n", 5, not data.endswith("\n"))
    layout = TextLayout(delimiter, decimal, ("#", "%"), 3, (), 0, 0)
    for indices in ((0, 1, 2), (2, 0), (1,)):
        rows, flaws = text._gone_through(block, layout, indices)
        wanted, flaw = text._line_by_line(block, layout, indices)
        np.testing.assert_array_equal(rows, wanted)
        for name in range(len(indices)):
            missing = [line for each in flaws for line in each.missing[name].tolist()]
            assert missing == flaw.missing[name].tolist()
        assert [line for each in flaws for line in each.bad.tolist()] == flaw.bad.tolist()


def test_a_long_file_is_the_same_by_either_way(tmp_path, monkeypatch):
    """Five megabytes with holes, words and comments: values, labels and findings."""
    rng = np.random.default_rng(20261123)
    rows = [
        f"{k / 1000},{a!r},{b:.6f},{'rest' if k % 3 else 'turn'}"
        for k, (a, b) in enumerate(rng.normal(size=(125_000, 2)))
    ]
    rows[70_000] = rows[70_000].replace(",", ",x", 1)
    rows[90_000:90_000] = ["# a pause", "90,,1.5,rest"]
    path = tmp_path / "a.csv"
    path.write_text("\n".join(["t [s],acc_x [m/s^2],acc_y [m/s^2],label", *rows]) + "\n")
    assert path.stat().st_size > 2.5 * 2**21
    found = read(path)
    monkeypatch.setattr(text, "_gone_through", text._looked_at)
    wanted = read(path)
    assert [each.code for each in wanted.findings if each.code in ("nan", "bad_row")] == ["bad_row", "nan"]
    assert (found.findings, found.labels) == (wanted.findings, wanted.labels)
    for name in ("acc_x", "acc_y"):
        np.testing.assert_array_equal(found[name].values, wanted[name].values)
        np.testing.assert_array_equal(found[name].t, wanted[name].t)
