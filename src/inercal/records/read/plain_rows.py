"""Plain rows of text, compiled: fields of digits, read to the nearest float64 as Python reads them, or empty, NaN.

A number of up to 19 digits is w 10^q. Where w and the power of ten are floats themselves one operation rounds it; else
it is the product of w and a power of five of 128 bits. Source: D. Lemire, Number parsing at a gigabyte per second,
Software: Practice and Experience 51 (2021), 1700-1727, algorithm 1, and for why one product does: N. Mushtak,
D. Lemire, Fast number parsing without fallback, same journal 53 (2023), 1467-1471. What is beyond that, a number below
the normal range or of more digits, is left to Python.
"""

from __future__ import annotations

import functools

import numpy as np
from numpy.typing import NDArray

from inercal._jit import kernel
from inercal.arrays import Array

Bits = np.uint64
Bytes = NDArray[np.uint8]

LEAST, MOST = -325, 308
"""Powers of ten by which whole numbers of 19 digits are multiplied."""

_TENS = np.array([10.0**k for k in range(23)])
_U1, _U9, _U32, _U63 = np.uint64(1), np.uint64(9), np.uint64(32), np.uint64(63)
_LOW = np.uint64(0xFFFFFFFF)
_ALL = np.uint64(0xFFFFFFFFFFFFFFFF)
_TAIL = np.uint64(0x1FF)
_HIDDEN = np.uint64(1 << 52)
_TEN = np.uint64(10)
_EXACT = np.uint64(1 << 53)


@functools.cache
def fives() -> NDArray[Bits]:
    """The first 128 bits of 5^q (n, 2), high half first, from `LEAST` to `MOST`; from -27 to -1 rounded up."""
    rows = []
    for q in range(LEAST, MOST + 1):
        power = 5 ** abs(q)
        if q >= 0:
            shift = power.bit_length() - 128
            value = power >> shift if shift > 0 else power << -shift
        else:
            z = (power - 1).bit_length()
            value = (1 << (z + 127 if q >= -27 else 2 * z + 128)) // power + 1
            value >>= max(value.bit_length() - 128, 0)
        rows.append((value >> 64, value & 0xFFFFFFFFFFFFFFFF))
    return np.array(rows, dtype=np.uint64)


@kernel
def _product(a: Bits, b: Bits) -> tuple[Bits, Bits]:
    """High and low 64 bits of the product of two whole numbers."""
    a0, a1, b0, b1 = a & _LOW, a >> _U32, b & _LOW, b >> _U32
    low, one, two = a0 * b0, a1 * b0, a0 * b1
    middle = (low >> _U32) + (one & _LOW) + (two & _LOW)
    high = a1 * b1 + (one >> _U32) + (two >> _U32) + (middle >> _U32)
    return high, (middle << _U32) | (low & _LOW)


@kernel
def _bits(w: Bits, q: int, powers: NDArray[Bits]) -> Bits:
    """The bits of the float nearest to w 10^q, w not 0; all ones where this cannot tell."""
    leading = 0
    while w >> _U63 == 0:
        w <<= _U1
        leading += 1
    high, low = _product(w, powers[q - LEAST, 0])
    if high & _TAIL == _TAIL:
        more, _ = _product(w, powers[q - LEAST, 1])
        low += more
        if low < more:
            high += _U1
    if low == _ALL and not -27 <= q <= 55:
        return _ALL
    upper = high >> _U63
    mantissa = high >> (upper + _U9)
    power = ((217706 * q) >> 16) + 63 + np.int64(upper) - leading + 1023
    if power <= 0 or power >= 0x7FE:
        return _ALL
    if low <= _U1 and -4 <= q <= 23 and mantissa & np.uint64(3) == _U1 and mantissa << (upper + _U9) == high:
        mantissa &= ~_U1  # halfway: to even
    mantissa = (mantissa + (mantissa & _U1)) >> _U1
    if mantissa >= _EXACT:
        mantissa = _HIDDEN
        power += 1
    return (mantissa & ~_HIDDEN) | (np.uint64(power) << np.uint64(52))


@kernel
def _number(
    data: Bytes, at: int, end: int, mark: int, powers: NDArray[Bits], value: Array, bits: NDArray[Bits]
) -> int:
    """Read a number at a place: the place behind it, -1 where there is none that this can tell; into ``value`` (1,)."""
    negative = at < end and data[at] == 45
    if at < end and (data[at] == 45 or data[at] == 43):
        at += 1
    w, digits, places, seen, q = np.uint64(0), 0, 0, 0, 0
    point = False
    while at < end:
        c = data[at]
        if 48 <= c <= 57:
            seen += 1
            if digits or c != 48:
                digits += 1
                w = w * _TEN + np.uint64(c - 48)
            places += point
        elif c == mark and not point:
            point = True
        else:
            break
        at += 1
    if seen == 0 or digits > 19:
        return -1
    if at < end and (data[at] == 101 or data[at] == 69):
        at += 1
        down = at < end and data[at] == 45
        if at < end and (data[at] == 45 or data[at] == 43):
            at += 1
        begin = at
        while at < end and 48 <= data[at] <= 57 and at - begin < 5:
            q = 10 * q + int(data[at]) - 48
            at += 1
        if at == begin:
            return -1
        q = -q if down else q
    q -= places
    if w == 0:
        value[0] = 0.0
    elif w <= _EXACT and -22 <= q <= 22:
        value[0] = np.float64(w) / _TENS[-q] if q < 0 else np.float64(w) * _TENS[q]
    elif LEAST <= q <= MOST:
        bits[0] = _bits(w, q, powers)
        if bits[0] == _ALL:
            return -1
    else:
        return -1
    if negative:
        value[0] = -value[0]
    return at


@kernel
def _blank(data: Bytes, at: int, end: int, delimiter: int) -> int:
    """The place behind blanks that are no delimiter."""
    while at < end and (data[at] == 32 or data[at] == 9) and data[at] != delimiter:
        at += 1
    return at


@kernel
def _row(
    data: Bytes,
    at: int,
    end: int,
    marks: Bytes,
    places: NDArray[np.int64],
    largest: float,
    powers: NDArray[Bits],
    value: Array,
    bits: NDArray[Bits],
    row: Array,
) -> bool:
    """Read the line from ``at`` to ``end`` into a ``row`` (k,): true if it is a plain one, with a number."""
    delimiter, mark = marks[0], marks[1]
    filled = False
    at = _blank(data, at, end, delimiter)
    for comment in marks[2:]:
        if at < end and data[at] == comment:
            return False
    width = len(places)
    for field in range(width):
        at = _blank(data, at, end, delimiter)
        if places[field] >= 0 and delimiter and (at == end or data[at] == delimiter):
            row[places[field]] = np.nan
        elif places[field] >= 0:
            filled = True
            at = _number(data, at, end, mark, powers, value, bits)
            if at < 0 or not abs(value[0]) < largest:
                return False
            row[places[field]] = value[0]
            behind = _blank(data, at, end, delimiter)
            if delimiter == 0 and field < width - 1 and behind == at:
                return False
            at = behind
        else:
            begin = at
            while at < end and data[at] != delimiter:
                c = data[at]
                if c == 34 or (c < 32 and c != 9) or (delimiter == 0 and c > 126):
                    return False
                if delimiter == 0 and (c == 32 or c == 9):
                    break
                at += 1
            if delimiter == 0 and at == begin:
                return False
        if delimiter and field < width - 1:
            if at == end or data[at] != delimiter:
                return False
            at += 1
    at = _blank(data, at, end, delimiter)
    if delimiter and at < end and data[at] == delimiter:  # behind the last field there may be one more
        at = _blank(data, at + 1, end, delimiter)
    return filled and at == end


@kernel
def read_rows(
    data: Bytes,
    at: int,
    marks: Bytes,
    places: NDArray[np.int64],
    largest: float,
    powers: NDArray[Bits],
    rows: Array,
) -> tuple[int, int]:
    """Read plain lines of ``data`` (m,) from a place on, until one is not.

    Parameters
    ----------
    data : (m,) uint8
        Whole lines, each ended by a line feed or both characters, the last one perhaps by the end.
    at : int
    marks : (3 + c,) uint8
        Delimiter, 0 for blanks; decimal mark; the last character of a line; the first ones of comments.
    places : (w,) int
        Place in ``rows`` of each field of a line, -1 for those that are not wanted.
    largest : float
        Limit of a number.
    powers : (n, 2) uint64
        `fives`.
    rows : (n, k) float
        Written to.

    Returns
    -------
    number of rows read, place of the line that is not plain
    """
    value = np.empty(1)
    bits = value.view(np.uint64)
    ends, kept = marks[2], np.concatenate((marks[:2], marks[3:]))
    count = 0
    while at < len(data) and count < len(rows):
        end = at
        while end < len(data) and data[end] != ends:
            end += 1
        last = end - 1 if end > at and ends == 10 and data[end - 1] == 13 else end
        if not _row(data, at, last, kept, places, largest, powers, value, bits, rows[count]):
            break
        count += 1
        at = end + 1
    return count, at


def plain_rows(
    data: Bytes, at: int, marks: bytes, places: NDArray[np.int64], largest: float, rows: Array
) -> tuple[int, int]:
    """`read_rows`, with its table of powers."""
    count, end = read_rows(data, at, np.frombuffer(marks, np.uint8), places, largest, fives(), rows)
    return int(count), int(end)
