"""Three sensors as one: the linear triad, forward from truth to indication and back.

``y = S M x + b``, S diagonal scale [output per SI unit], M unit-diagonal misalignment, b the output at zero
input [output]. M_ij is the response of sensor i to the input along j, so that the rows of M lie along the input
axes. An accelerometer triad that defines the frame has an upper-triangular M: z of the frame along the input axis
of sensor z, y in the plane of those of y and z.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from inercal.foundation.arrays import Array


@dataclass(frozen=True)
class TriadModel:
    """Coefficients of a triad: ``scale`` (3,), ``misalignment`` (3, 3) with unit diagonal, ``bias`` (3,).

    All may have batch axes in front, as where they change with temperature from sample to sample.
    """

    scale: Array
    misalignment: Array
    bias: Array

    @property
    def gain(self) -> Array:
        """S M (3, 3) [output per SI unit]."""
        return self.scale[..., :, None] * self.misalignment

    def indicate(self, x: Array) -> Array:
        """Outputs (*batch, 3) for true inputs ``x`` (*batch, 3) in SI units."""
        return apart(self.gain, x) + self.bias

    def correct(self, y: Array) -> Array:
        """True inputs (*batch, 3) in SI units for outputs ``y`` (*batch, 3): the inverse of `indicate`."""
        return apart(self._inverse, y - self.bias)

    @cached_property
    def _inverse(self) -> Array:
        """Inverse of the gain (3, 3) [SI unit per output]."""
        return np.asarray(np.linalg.inv(self.gain), dtype=np.float64)


def apart(A: Array, x: Array) -> Array:
    """``A x`` of a matrix (*batch, 3, 3) and vectors ``x`` (*batch, 3), to the same digits in any batch.

    The matrix product of NumPy rounds one sample otherwise than the same among many.
    """
    return x[..., 0, None] * A[..., :, 0] + x[..., 1, None] * A[..., :, 1] + x[..., 2, None] * A[..., :, 2]


def triad_from_terms(
    values: Mapping[str, float] | Mapping[str, Array], scale: str, misalignment: str, bias: str
) -> TriadModel:
    """A triad from values (*batch,) by term symbol (prefixes such as ``K1``, ``M``, ``K0``); absent terms are 0."""

    def together(parts: Iterable[float | Array]) -> Array:
        return np.stack(np.broadcast_arrays(*parts), axis=-1)

    rows = [
        together(1.0 if i == j else values.get(f"{misalignment}_{i}{j}", 0.0) for j in "xyz") for i in "xyz"
    ]
    return TriadModel(
        together(values[f"{scale}_{axis}"] for axis in "xyz"),
        np.stack(np.broadcast_arrays(*rows), axis=-2),
        together(values.get(f"{bias}_{axis}", 0.0) for axis in "xyz"),
    )
