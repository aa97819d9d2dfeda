"""Instruments as a table sees them: the terms of each output channel, forward from truth to indication.

Outputs are linear in their coefficients and polynomial in specific force (or gravity) and rate.
One form serves gyrowheels and two-axis rotor gyros, single-axis gyros and accelerometers::

    y = sum_j c_j m_j(a, w)

with monomials m_j of a vector a and a rate w, both on the instrument's axes. What a is, is the instrument's
convention: see the functions that make the channels.

gyrowheel, rotor gyro (813-style), axis X (Y alike), a the gravity reference in units of the site's gravity,
``a = [0 0 -1] C_nb`` (an accelerometer reads -a), w the rate [rad/s], y in the unit of the record::

    y = k_x w_x + k_y w_y + k_z w_z + DX_F + DX_X a_x + DX_Y a_y + DX_Z a_z
        + DX_XX a_x^2 + DX_YY a_y^2 (+ DX_ZZ a_z^2) + DX_XY a_x a_y + DX_XZ a_x a_z + DX_YZ a_y a_z

gyro (952-style), axis i, f the specific force [m/s^2]::

    y = S (w_i + T_ij w_j + T_ik w_k) + D_F + G f (+ G_ixx f_x^2 + G_iyy f_y^2 + G_izz f_z^2
        + G_ixy f_x f_y + G_ixz f_x f_z + G_iyz f_y f_z)

accelerometer (1293-style), axis i, p and o the next ones in cyclic order::

    y = K0 + K1 (f_i + M_ip f_p + M_io f_o + K2 f_i^2 + K3 f_i^3 + Koq f_i |f_i|
                 + Kip f_i f_p + Kio f_i f_o + Kpo f_p f_o + Kpp f_p^2 + Koo f_o^2)
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array


@dataclass(frozen=True)
class Monomial:
    """A product of powers of (a_x, a_y, a_z, w_x, w_y, w_z); of ``odd`` the magnitude is another factor."""

    powers: tuple[int, int, int, int, int, int]
    odd: int | None = None

    @property
    def order(self) -> int:
        """Total power of a."""
        return sum(self.powers[:3]) + (self.odd is not None)

    @property
    def of_rate(self) -> bool:
        """True if a rate takes part."""
        return any(self.powers[3:])


def monomial(text: str, odd: int | None = None) -> Monomial:
    """A monomial by its letters: ``""`` is one, ``"xxy"`` a_x^2 a_y, ``"Z"`` w_z."""
    x, y, z, X, Y, Z = (text.count(letter) for letter in "xyzXYZ")
    return Monomial((x, y, z, X, Y, Z), odd)


@dataclass(frozen=True)
class ChannelModel:
    """One output channel: its terms, and how their values follow from the linear coefficients.

    Attributes
    ----------
    channel : str
        Column of the record: ``y_x``, ``gyro_x``, ``acc_z``, ...
    symbols : tuple of str
        Terms by their symbols in the term table.
    monomials : tuple of Monomial
        What each is a coefficient of.
    leading : str
        Term by which ``relative`` ones are to be multiplied in the linear form (the scale factor).
    relative : frozenset of str
        Terms that are stated relative to the leading one: misalignments, K2, K3, ...
    """

    channel: str
    symbols: tuple[str, ...]
    monomials: tuple[Monomial, ...]
    leading: str = ""
    relative: frozenset[str] = frozenset()

    def regressors(self, a: Array, w: Array) -> Array:
        """Monomials (*batch, p) of ``a`` (*batch, 3) and ``w`` (*batch, 3) [rad/s]."""
        inputs = np.concatenate(np.broadcast_arrays(a, w), axis=-1)
        made = np.empty((*inputs.shape[:-1], len(self.monomials)))
        for j, m in enumerate(self.monomials):
            made[..., j] = _product(inputs, m.powers, m.odd)
        return made

    def slopes(self, a: Array, w: Array) -> Array:
        """Derivatives (*batch, p, 6) of the monomials with respect to a_x, a_y, a_z, w_x, w_y, w_z."""
        inputs = np.concatenate(np.broadcast_arrays(a, w), axis=-1)
        made = np.zeros((*inputs.shape[:-1], len(self.monomials), 6))
        for j, m in enumerate(self.monomials):
            for i in range(6):
                if i == m.odd:  # d(a^n |a|) = (n + 1) a^(n-1) |a|
                    lower = (*m.powers[:i], m.powers[i] - 1, *m.powers[i + 1 :])
                    made[..., j, i] = (m.powers[i] + 1) * _product(inputs, lower, m.odd)
                elif m.powers[i]:
                    lower = (*m.powers[:i], m.powers[i] - 1, *m.powers[i + 1 :])
                    made[..., j, i] = m.powers[i] * _product(inputs, lower, m.odd)
        return made

    def without(self, symbols: Iterable[str]) -> ChannelModel:
        """The channel without these terms."""
        gone = set(symbols)
        kept = [k for k, symbol in enumerate(self.symbols) if symbol not in gone]
        return ChannelModel(
            self.channel,
            tuple(self.symbols[k] for k in kept),
            tuple(self.monomials[k] for k in kept),
            self.leading,
            self.relative,
        )

    def linear(self, values: Sequence[float] | Array) -> Array:
        """Linear coefficients (p,) from the values of the terms (p,)."""
        values = np.asarray(values, dtype=float)
        return np.where(self._relative, values * self.gain(values), values)

    def terms(self, c: Array) -> tuple[Array, Array]:
        """Values (p,) of the terms from linear coefficients (p,), and their derivatives (p, p)."""
        relative, lead = self._relative, self.gain(c)
        values = np.where(relative, c / lead, c)
        slope = np.diag(np.where(relative, np.divide(1.0, lead), 1.0))
        if relative.any():
            slope[relative, self.symbols.index(self.leading)] = -values[relative] / lead
        return values, slope

    @property
    def _relative(self) -> NDArray[np.bool_]:
        """Which terms are relative (p,)."""
        return np.array([symbol in self.relative for symbol in self.symbols])

    def gain(self, values: Array) -> float:
        """Value of the leading term among ``values`` (p,); 1 where no term is relative to it."""
        return float(values[self.symbols.index(self.leading)]) if self._relative.any() else 1.0


def _product(inputs: Array, powers: Sequence[int], odd: int | None) -> Array:
    """Product of powers of the last axis of ``inputs`` (*batch, 6)."""
    value = np.ones(inputs.shape[:-1])
    for i, power in enumerate(powers):
        for _ in range(power):
            value = value * inputs[..., i]
    return value if odd is None else value * np.abs(inputs[..., odd])


#: kind of instrument -> its channels
CHANNELS: Mapping[str, tuple[str, ...]] = {
    "gyrowheel": ("y_x", "y_y"),
    "gyro": ("gyro_x", "gyro_y", "gyro_z"),
    "accelerometer": ("acc_x", "acc_y", "acc_z"),
}

#: terms that are there only where they are asked for: a plan on one table seldom tells them from others
EXTRA = (
    *("DX_ZZ", "DY_ZZ"),
    *(f"{k}_{i}" for k in ("Koq", "Kpp", "Koo") for i in "xyz"),
    *(f"G_{i}{jk}" for i in "xyz" for jk in ("xx", "yy", "zz", "xy", "xz", "yz")),
)


def channel_model(kind: str, channel: str) -> ChannelModel:
    """All terms of a channel of an instrument of that kind; raises KeyError for a channel it has not."""
    if channel not in CHANNELS[kind]:
        raise KeyError(channel)
    axis = channel[-1]
    return {"gyrowheel": _drift, "gyro": _gyro, "accelerometer": _accelerometer}[kind](axis)


def _made(
    channel: str, terms: Mapping[str, Monomial], leading: str = "", relative: frozenset[str] = frozenset()
) -> ChannelModel:
    """A channel of these terms."""
    return ChannelModel(channel, tuple(terms), tuple(terms.values()), leading, relative)


def _drift(axis: str) -> ChannelModel:
    """Axis ``x`` or ``y`` of a gyrowheel."""
    k, D = {"x": ("k", "DX"), "y": ("kY", "DY")}[axis]
    terms = {f"{k}_{i}": monomial(i.upper()) for i in "xyz"}
    for letters in ("", "x", "y", "z", "xx", "yy", "zz", "xy", "xz", "yz"):
        terms[f"{D}_{letters.upper() or 'F'}"] = monomial(letters)
    return _made(f"y_{axis}", terms)


def _gyro(axis: str) -> ChannelModel:
    """Axis x, y or z of a gyro triad, or a single-axis gyro along it."""
    others = [j for j in "xyz" if j != axis]
    terms = {f"D_F_{axis}": monomial(""), f"S_{axis}": monomial(axis.upper())}
    terms |= {f"T_{axis}{j}": monomial(j.upper()) for j in others}
    terms |= {f"G_{axis}{j}": monomial(j) for j in ("x", "y", "z", "xx", "yy", "zz", "xy", "xz", "yz")}
    return _made(f"gyro_{axis}", terms, f"S_{axis}", frozenset(f"T_{axis}{j}" for j in others))


def _accelerometer(axis: str) -> ChannelModel:
    """Axis x, y or z of an accelerometer triad, or a single accelerometer along it."""
    i = axis
    p, o = "yzx"["xyz".index(i)], "zxy"["xyz".index(i)]
    terms = {
        f"K0_{i}": monomial(""),
        f"K1_{i}": monomial(i),
        f"M_{i}{p}": monomial(p),
        f"M_{i}{o}": monomial(o),
        f"K2_{i}": monomial(i + i),
        f"K3_{i}": monomial(i + i + i),
        f"Koq_{i}": monomial(i, odd="xyz".index(i)),
        f"Kip_{i}": monomial(i + p),
        f"Kio_{i}": monomial(i + o),
        f"Kpo_{i}": monomial(p + o),
        f"Kpp_{i}": monomial(p + p),
        f"Koo_{i}": monomial(o + o),
    }
    relative = frozenset(symbol for symbol in terms if not symbol.startswith(("K0", "K1")))
    return _made(f"acc_{axis}", terms, f"K1_{i}", relative)
