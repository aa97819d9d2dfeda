"""A platform beside its linear triads: what the table of states has at the rate, at the outputs, and sag.

With f the specific force in p, w the rate commanded or measured, T kelvins above the temperature of the coefficients
(`inercal.systems.selfcal.platform.model`):

    w_p = (1 + M) w + kg0 + sum c v(w, f, T),   a = ka0 + s + sum c v(s, T),   s the linear part of the output,

v the quantities of `inercal.systems.selfcal.platform.layout`. Vectors are given in the axes of the unbent platform:
``v = exp(sag x f) v_p``. What needs f or T of a record that has none is left out, and named.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import conjugate, exp, rotate
from inercal.foundation.instruments.triad import TriadModel
from inercal.systems.selfcal.platform.layout import QUANTITIES
from inercal.systems.selfcal.platform.states import BIAS_WALK, ENTRY_OF, KIND_OF

_ROUNDS = 6
"""Rounds of an inverse: each is nearer by a factor below 1e-2."""

_LINEAR = 3
"""Quantities of the rate, the first, that are in the gain of the platform."""


def applied(name: str) -> bool:
    """True for a parameter by which readings are corrected: of rates, outputs or sag; no bias that walks, which is that
    of the last row."""
    port = ENTRY_OF[name].port if name in ENTRY_OF else ""
    return port in ("core", "rate", "output", "bend") and KIND_OF[name] not in BIAS_WALK


def at_port(port: str, values: Mapping[str, float]) -> Array:
    """Coefficients (3, quantities) at a linear port, by axis and quantity; ``values`` by parameter."""
    coefficients = np.zeros((3, len(QUANTITIES[port])))
    for name in filter(applied, values):
        if (entry := ENTRY_OF[name]).port == port:
            coefficients[entry.axis, entry.quantity] += values[name]
    return coefficients


def in_need(values: Mapping[str, float], quantity: str) -> str:
    """Kinds of parameters, in words, that are not 0 and need a quantity of a record: specific force, ``f``, or
    temperature, ``warm``."""
    kinds = dict[str, None]()
    for name in filter(applied, values):
        port, _, at, _ = ENTRY_OF[name]
        needed = QUANTITIES[port][at] if port in QUANTITIES else "f" if port == "bend" else ""
        if values[name] != 0.0 and needed.startswith(quantity):
            kinds[KIND_OF[name]] = None
    return ", ".join(kinds)


@dataclass(frozen=True)
class RigPlatform:
    """The linear ``platform`` and ``accelerometer``; beside them in SI coefficients ``rate`` (3, quantities) and
    ``output`` (3, quantities) of `at_port`, those of the gain apart, and ``sag`` (3,); in words the kinds that need
    specific force, ``by_force``, or temperature, ``by_temperature``."""

    platform: TriadModel
    accelerometer: TriadModel
    rate: Array
    output: Array
    sag: Array
    by_force: str = ""
    by_temperature: str = ""

    @property
    def linear(self) -> bool:
        """True where there is nothing beside the triads."""
        return not (self.rate[:, _LINEAR:].any() or self.output.any() or self.sag.any())

    def force(self, outputs: Array, warm: Array) -> Array:
        """Specific force (*batch, 3) [m/s^2] in p of accelerometer outputs; ``warm`` (*batch, 1) [K]."""
        d = outputs - self.accelerometer.bias
        s = d
        for _ in range(_ROUNDS):
            s = d - self._beside_output(s, warm)
        return self.accelerometer.correct(s + self.accelerometer.bias)

    def outputs(self, force: Array, warm: Array) -> Array:
        """Accelerometer outputs (*batch, 3) [m/s^2] at specific force in p: the inverse of `force`."""
        s = self.accelerometer.indicate(force) - self.accelerometer.bias
        return s + self._beside_output(s, warm) + self.accelerometer.bias

    def turning(self, rate: Array, force: Array, warm: Array) -> Array:
        """Rate (*batch, 3) [rad/s] in p at which the platform turns, at one commanded or measured."""
        return self.platform.indicate(rate) + self._beside_rate(rate, force, warm)

    def commanded(self, turning: Array, force: Array, warm: Array) -> Array:
        """Rate commanded, or measured, for the platform to turn at one: the inverse of `turning`."""
        rate = self.platform.correct(turning)
        for _ in range(_ROUNDS):
            rate = self.platform.correct(turning - self._beside_rate(rate, force, warm))
        return rate

    def _beside_rate(self, rate: Array, force: Array, warm: Array) -> Array:
        """The part of the rate beside that of the triad, by the quantities in the order of the table."""
        from inercal.systems.selfcal.platform.model import (
            rate_quantities,
        )  # loads numba, which most corrections do without

        quantities = _plain(rate_quantities)(_axes(rate), _axes(force), warm)
        return _total(self.rate[:, _LINEAR:], quantities[_LINEAR:])

    def _beside_output(self, s: Array, warm: Array) -> Array:
        """The part of the outputs beside ``s``, those of the triad without bias."""
        from inercal.systems.selfcal.platform.model import output_quantities

        by = s / self.accelerometer.scale
        return _total(self.output, _plain(output_quantities)(_axes(s), _axes(by), warm))

    def unbent(self, v: Array, force: Array) -> Array:
        """A vector (*batch, 3) of p in the axes of the unbent platform; ``force`` (*batch, 3) [m/s^2] in p."""
        return rotate(exp(np.cross(self.sag, force)), v)

    def bent(self, v: Array, force: Array) -> Array:
        """The inverse of `unbent`."""
        return rotate(conjugate(exp(np.cross(self.sag, force))), v)

    def force_within(self, unbent: Array) -> Array:
        """Specific force in p of one in the axes of the unbent platform."""
        force = unbent
        for _ in range(_ROUNDS):
            force = self.bent(unbent, force)
        return force


def _plain(kernel: Any) -> Any:
    """A kernel as plain Python, which takes arrays as well."""
    return getattr(kernel, "py_func", kernel)


def _axes(v: Array) -> list[Array]:
    """Components (*batch, 1) of vectors."""
    return [v[..., i, None] for i in range(3)]


def _total(coefficients: Array, quantities: Sequence[Array]) -> Array:
    """Sum (*batch, 3) of coefficients (3, n) times n quantities (*batch, 1), to the same digits in any batch."""
    total = np.zeros(3)
    for column, quantity in zip(coefficients.T, quantities, strict=True):
        if column.any():
            total = total + quantity * column
    return total
