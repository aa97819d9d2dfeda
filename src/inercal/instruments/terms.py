"""The one table of terms: symbol, long name, unit, order.

API names, JSON, plots and reports all use these symbols ("IEEE-style" names). Units are those of the value
in a result; ``output`` stands for the unit of the instrument's output (m/s^2, deg/s, count, ...).
"""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Term:
    """One coefficient of an instrument.

    ``unit`` is what its value is expressed in, with ``output`` for the unit the instrument's output has.
    """

    symbol: str
    name: str
    unit: str

    def unit_for(self, output: str) -> str:
        """The unit with the output unit put in, for example ``count/(m/s^2)``."""
        if self.unit.startswith("output"):
            rest = self.unit.removeprefix("output")
            return f"({output}){rest}" if rest and "/" in output else f"{output}{rest}"
        return self.unit


_AXES = "xyz"
_ACCELEROMETER = (
    *(Term(f"K0_{i}", f"accelerometer {i} bias: output at zero specific force", "output") for i in _AXES),
    *(Term(f"K1_{i}", f"accelerometer {i} scale factor", "output/(m/s^2)") for i in _AXES),
    *(
        Term(f"M_{i}{j}", f"misalignment: response of accelerometer {i} to specific force along {j}", "rad")
        for i, j in ("xy", "xz", "yz")
    ),
)
_GYRO = (
    *(Term(f"D_F_{i}", f"gyro {i} bias: output at zero rate", "output") for i in _AXES),
    *(Term(f"S_{i}", f"gyro {i} scale factor", "output/(rad/s)") for i in _AXES),
    *(
        Term(f"T_{i}{j}", f"misalignment: response of gyro {i} to rate about {j}", "rad")
        for i in _AXES
        for j in _AXES
        if i != j
    ),
    *(
        Term(f"G_{i}{j}", f"g-sensitive drift: gyro {i} output per force along {j}", "output/(m/s^2)")
        for i in _AXES
        for j in _AXES
    ),
)

#: every term, in the order results list them
TERMS: dict[str, Term] = {term.symbol: term for term in (*_ACCELEROMETER, *_GYRO)}

ACCELEROMETER_TRIAD = tuple(term.symbol for term in _ACCELEROMETER)
"""K0, K1 and the upper-triangular M of an accelerometer triad that defines the frame."""

GYRO_TRIAD = tuple(term.symbol for term in _GYRO if not term.symbol.startswith("G_"))
"""D_F, S and the six T of a gyro triad."""

GYRO_G_SENSITIVITY = tuple(term.symbol for term in _GYRO if term.symbol.startswith("G_"))
"""The nine g-sensitive drift coefficients of a gyro triad, row i the gyro axis."""
