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

from inercal.foundation._jit import allocating, kernel
from inercal.foundation.arrays import Array

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


@allocating
def _nearest(w: Bits, q: int, powers: NDArray[Bits]) -> float:
    """The float nearest to w 10^q, NaN where this cannot tell."""
    if w == 0:
        return 0.0
    if not LEAST <= q <= MOST:
        return np.nan
    value = np.empty(1)
    value.view(np.uint64)[0] = _bits(w, q, powers)  # all ones are NaN
    return float(value[0])


@kernel
def _power(data: Bytes, at: int) -> tuple[int, int]:
    """The place behind a power of ten and the power; the place of its mark where there is none."""
    behind = at + 1
    sign = data[behind] if behind < len(data) else 0
    if sign == 45 or sign == 43:
        behind += 1
    begin, power = behind, 0
    while behind < len(data) and 48 <= data[behind] <= 57 and behind - begin < 5:
        power = 10 * power + int(data[behind]) - 48
        behind += 1
    return (behind if behind > begin else at), (-power if sign == 45 else power)


@kernel
def _zeros(data: Bytes, at: int, mark: int) -> int:
    """Number of zeros that a number begins with."""
    zeros = 0
    while at < len(data) and (data[at] == 48 or data[at] == mark):
        zeros += data[at] == 48
        at += 1
    return zeros


@kernel
def _blank(data: Bytes, at: int, delimiter: int) -> int:
    """The place behind blanks that are no delimiter."""
    while at < len(data) and (data[at] == 32 or data[at] == 9) and data[at] != delimiter:
        at += 1
    return at


@kernel
def _digits(data: Bytes, at: int, w: Bits) -> tuple[int, Bits]:
    """The place behind digits, and the whole number ``w`` with them behind it, which is right up to 19 digits."""
    while at < len(data):
        c = int(data[np.uint64(at)])
        if c < 48 or c > 57:
            break
        w = w * _TEN + np.uint64(c - 48)
        at += 1
    return at, w


@kernel
def _unwanted(data: Bytes, at: int, delimiter: int, ends: int) -> int:
    """The place behind a field of any plain characters, -1 where it holds others, or none between blanks."""
    begin = at
    while at < len(data):
        c = int(data[at])
        if c in (delimiter, ends) or (c == 13 and ends == 10) or (delimiter == 0 and c in (9, 32)):
            break
        if c == 34 or (c < 32 and c != 9) or (delimiter == 0 and c > 126):
            return -1
        at += 1
    return -1 if delimiter == 0 and at == begin else at


@kernel
def read_rows(
    data: Bytes,
    begin: int,
    marks: Bytes,
    places: NDArray[np.int64],
    largest: float,
    powers: NDArray[Bits],
    rows: Array,
) -> tuple[int, int]:
    """Read plain lines of ``data`` (m,) from a place on, until one is not.

    Indices without a sign skip the check for negative ones, which would count from the end.

    Parameters
    ----------
    data : (m,) uint8
        Whole lines, each ended by a line feed or both characters, the last one perhaps by the end.
    begin : int
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
    delimiter, mark, ends = int(marks[0]), int(marks[1]), int(marks[2])
    count, width, end = 0, len(places), len(data)
    while begin < end and count < len(rows):
        at, filled = _blank(data, begin, delimiter), False
        for comment in marks[3:]:
            if at < end and data[at] == comment:
                return count, begin
        for field in range(width):
            place = places[field]
            if at < end and data[np.uint64(at)] <= 32:
                at = _blank(data, at, delimiter)
            c = int(data[np.uint64(at)]) if at < end else ends
            if place < 0:
                at = _unwanted(data, at, delimiter, ends)
                if at < 0:
                    return count, begin
            elif delimiter and (c in (delimiter, ends) or (c == 13 and ends == 10)):
                rows[count, place] = np.nan
            else:
                negative = c == 45
                if negative or c == 43:
                    at += 1
                first, q = at, 0
                at, w = _digits(data, at, np.uint64(0))
                digits = at - first
                if at < end and data[np.uint64(at)] == mark:
                    point = at + 1
                    at, w = _digits(data, point, w)
                    q = point - at
                    digits -= q
                c = int(data[np.uint64(at)]) if at < end else ends
                if digits == 0 or (digits > 19 and digits - _zeros(data, first, mark) > 19):
                    return count, begin
                if at < end and (c == 101 or c == 69):
                    behind, power = _power(data, at)
                    if behind == at:
                        return count, begin
                    at, q = behind, q + power
                if w > _EXACT or q < -22 or q > 22:
                    value = _nearest(w, q, powers)
                elif q < 0:
                    value = np.float64(w) / _TENS[np.uint64(-q)]
                else:
                    value = np.float64(w) * _TENS[np.uint64(q)]
                if not value < largest:
                    return count, begin
                rows[count, place] = -value if negative else value
                filled = True
            behind = at
            if at < end and data[np.uint64(at)] <= 32:
                at = _blank(data, at, delimiter)
            if field < width - 1 and delimiter:
                if at == end or data[np.uint64(at)] != delimiter:
                    return count, begin
                at += 1
            elif field < width - 1 and at == behind:
                return count, begin
        if delimiter and at < end and data[at] == delimiter:  # behind the last field there may be one more
            at = _blank(data, at + 1, delimiter)
        if ends == 10 and at < end and data[at] == 13:
            at += 1
        if not filled or (at < end and data[at] != ends):
            return count, begin
        count += 1
        begin = at + 1
    return count, begin


def plain_rows(
    data: Bytes, at: int, marks: bytes, places: NDArray[np.int64], largest: float, rows: Array
) -> tuple[int, int]:
    """`read_rows`, with its table of powers."""
    count, end = read_rows(data, at, np.frombuffer(marks, np.uint8), places, largest, fives(), rows)
    return int(count), int(end)
