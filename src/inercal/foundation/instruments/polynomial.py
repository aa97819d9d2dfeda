"""Outputs that are linear in their coefficients and polynomial in specific force (or gravity) and rate.

One form serves gyrowheels and two-axis rotor gyros, single-axis gyros and accelerometers::

    y = sum_j c_j m_j(a, w)

with monomials m_j of a vector a and a rate w, both on the instrument's axes. What a is, is the instrument's
convention: see the functions that make the channels.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
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
