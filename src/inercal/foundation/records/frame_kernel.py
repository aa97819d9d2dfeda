"""Frames sought in bytes, as compiled code: where each sound one begins."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from inercal.foundation._jit import kernel
from inercal.foundation.records.checksums import CRC, FLETCHER, SUM

Bytes = NDArray[np.uint8]


@kernel
def value(data: Bytes, begin: int, end: int, form: NDArray[np.int64], table: NDArray[np.int64]) -> int:
    """The check of the bytes from ``begin`` to before ``end``; ``form`` is kind, width, start, reflected, end."""
    kind, width, start, reflected, last = int(form[0]), int(form[1]), int(form[2]), int(form[3]), int(form[4])
    mask = (1 << width) - 1
    if kind == SUM:
        total = 0
        for i in range(begin, end):
            total += int(data[i])
        return (-total if last else total) & mask
    if kind == CRC:
        crc = start
        for i in range(begin, end):
            if reflected:
                crc = int(table[(crc ^ int(data[i])) & 0xFF]) ^ (crc >> 8)
            else:
                crc = (int(table[((crc >> (width - 8)) ^ int(data[i])) & 0xFF]) ^ (crc << 8)) & mask
        return crc ^ last
    if kind == FLETCHER:
        one, two = 0, 0
        for i in range(begin, end):
            one = (one + int(data[i])) % start
            two = (two + one) % start
        return two << 8 | one
    parity = 0
    for i in range(begin, end):
        parity ^= int(data[i])
    return parity


@kernel
def seek(
    data: Bytes,
    sync: Bytes,
    size: int,
    first: int,
    little: bool,
    form: NDArray[np.int64],
    table: NDArray[np.int64],
    places: NDArray[np.int64],
) -> tuple[int, int, int]:
    """Find frames one after the other; where a check fails the search goes on one byte later.

    Parameters
    ----------
    data : uint8 (n,)
    sync : uint8 (k,)
        With which a frame begins.
    size : int
        Bytes of a frame, its check at the end.
    first : int
        Byte of a frame with which the check begins.
    little : bool
        Byte order of the check.
    form, table
        Of the check (`value`); kind 0 is none.
    places : int64 (n // size,)
        Receives where frames begin.

    Returns
    -------
    found, consumed, damaged : int
        Number of frames; bytes that need not be looked at again; frames whose check failed.
    """
    n, k, width = len(data), len(sync), int(form[1]) // 8
    found, i, damaged = 0, 0, 0
    while i < n:
        matched = 0
        while matched < k and i + matched < n and data[i + matched] == sync[matched]:
            matched += 1
        if matched < k and i + matched < n:
            i += 1
            continue
        if i + size > n:
            break
        stated = 0
        for b in range(width):
            place = i + size - 1 - b if little else i + size - width + b
            stated = stated << 8 | int(data[place])
        if form[0] == 0 or value(data, i + first, i + size - width, form, table) == stated:
            places[found] = i
            found += 1
            i += size
        else:
            damaged += 1
            i += 1
    return found, i, damaged
