"""Checks of binary frames: checksums and cyclic redundancy checks, by name.

Parameters and check values of the CRCs are those of the catalogue of parametrised CRC algorithms (G. Cook).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

SUM, XOR, CRC, FLETCHER = range(1, 5)
"""Kinds of checks; 0 is none."""


@dataclass(frozen=True)
class Check:
    """A check over bytes: its ``kind``, and its ``width`` [bit].

    Of a CRC: ``polynomial``, ``start``, ``reflected`` (input and output), and ``end``, which is exclusive-ored at last.
    Of a sum, ``end`` 1 is its two's complement, so that all bytes add up to 0. Of Fletcher's, ``start`` is the modulus.
    """

    kind: int
    width: int
    polynomial: int = 0
    start: int = 0
    reflected: bool = False
    end: int = 0

    @property
    def table(self) -> NDArray[np.int64]:
        """Remainder (256,) of each byte; zeros for what is no CRC."""
        return np.array([self._remainder(byte) for byte in range(256)], np.int64)

    def _remainder(self, byte: int) -> int:
        """The remainder of one byte."""
        if self.kind != CRC:
            return 0
        mask, top = (1 << self.width) - 1, 1 << (self.width - 1)
        if self.reflected:
            turned = int(f"{self.polynomial:0{self.width}b}"[::-1], 2)
            for _ in range(8):
                byte = byte >> 1 ^ (turned if byte & 1 else 0)
            return byte
        byte <<= self.width - 8
        for _ in range(8):
            byte = (byte << 1 ^ (self.polynomial if byte & top else 0)) & mask
        return byte


def _crc(width: int, polynomial: int, start: int = 0, reflected: bool = False, end: int = 0) -> Check:
    """A cyclic redundancy check."""
    return Check(CRC, width, polynomial, start, reflected, end)


NONE = Check(0, 0)

CHECKS = {
    "sum-8": Check(SUM, 8),
    "sum-8/negated": Check(SUM, 8, end=1),
    "sum-16": Check(SUM, 16),
    "sum-32": Check(SUM, 32),
    "xor-8": Check(XOR, 8),
    "fletcher-16": Check(FLETCHER, 16, start=255),
    "fletcher-16/ubx": Check(FLETCHER, 16, start=256),
    "crc-8": _crc(8, 0x07),
    "crc-8/autosar": _crc(8, 0x2F, 0xFF, end=0xFF),
    "crc-8/dvb-s2": _crc(8, 0xD5),
    "crc-8/maxim": _crc(8, 0x31, reflected=True),
    "crc-8/nrsc-5": _crc(8, 0x31, 0xFF),
    "crc-8/sae-j1850": _crc(8, 0x1D, 0xFF, end=0xFF),
    "crc-16/arc": _crc(16, 0x8005, reflected=True),
    "crc-16/ccitt-false": _crc(16, 0x1021, 0xFFFF),
    "crc-16/kermit": _crc(16, 0x1021, reflected=True),
    "crc-16/modbus": _crc(16, 0x8005, 0xFFFF, True),
    "crc-16/x-25": _crc(16, 0x1021, 0xFFFF, True, 0xFFFF),
    "crc-16/xmodem": _crc(16, 0x1021),
    "crc-32": _crc(32, 0x04C11DB7, 0xFFFFFFFF, True, 0xFFFFFFFF),
    "crc-32/bzip2": _crc(32, 0x04C11DB7, 0xFFFFFFFF, end=0xFFFFFFFF),
    "crc-32/mpeg-2": _crc(32, 0x04C11DB7, 0xFFFFFFFF),
    "crc-32c": _crc(32, 0x1EDC6F41, 0xFFFFFFFF, True, 0xFFFFFFFF),
}
"""Checks by the name that a map gives them."""
