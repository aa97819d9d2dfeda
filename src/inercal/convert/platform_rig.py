"""A platform beside its linear triads: drift by force, sag, temperature, squares of accelerometers, scale asymmetry.

With f the specific force in p, w the rate commanded or measured, T kelvins above the temperature of the coefficients
(`inercal.selfcal.platform.model`):

    w_p = (1 + M) w + S |w| / 2 + kg0 + kg0_T1 T + G f,
    a   = ka0 + ka0_T1 T + (1 + ka1_T1 T / (1 + ka1)) s + K2 s^2 / (1 + ka1),   s the linear part of the output.

Vectors are given in the axes of the unbent platform: ``v = exp(sag x f) v_p``. What needs f or T of a record that has
none is left out, and named.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from inercal.arrays import Array
from inercal.geometry.rotations import conjugate, exp, rotate
from inercal.instruments.triad import TriadModel, apart

_ROUNDS = 4
"""Rounds of an inverse: each is nearer by a factor below 1e-3."""

BY_FORCE = ("G", "sag")
"""Groups of coefficients that need the specific force."""

BY_TEMPERATURE = ("kg0_T1", "ka0_T1", "ka1_T1")
"""Groups of coefficients that need the temperature."""


def _three() -> Array:
    """Zeros for the three axes."""
    return np.zeros(3)


@dataclass(frozen=True)
class RigPlatform:
    """The linear ``platform`` and ``accelerometer``, and beside them, in SI: ``squares`` K2 and ``asymmetry`` S_asym
    (3,), drift ``by_force`` G (3, 3), ``sag`` (3,), and per kelvin ``kg0_T1``, ``ka0_T1``, ``ka1_T1`` (3,)."""

    platform: TriadModel
    accelerometer: TriadModel
    squares: Array = field(default_factory=_three)
    asymmetry: Array = field(default_factory=_three)
    by_force: Array = field(default_factory=lambda: np.zeros((3, 3)))
    sag: Array = field(default_factory=_three)
    kg0_T1: Array = field(default_factory=_three)
    ka0_T1: Array = field(default_factory=_three)
    ka1_T1: Array = field(default_factory=_three)

    @property
    def linear(self) -> bool:
        """True if the rig adds nothing to the triads."""
        return not self.needs(("K2", "S_asym", *BY_FORCE, *BY_TEMPERATURE))

    def needs(self, groups: tuple[str, ...]) -> tuple[str, ...]:
        """Nonzero coefficients of these groups."""
        return tuple(group for group in groups if self._of[group].any())

    @property
    def _of(self) -> Mapping[str, Array]:
        """Coefficients by group."""
        return {
            "K2": self.squares, "S_asym": self.asymmetry, "G": self.by_force, "sag": self.sag,
            "kg0_T1": self.kg0_T1, "ka0_T1": self.ka0_T1, "ka1_T1": self.ka1_T1,
        }  # fmt: skip

    def force(self, outputs: Array, warm: Array) -> Array:
        """Specific force (*batch, 3) [m/s^2] in p of accelerometer outputs; ``warm`` (*batch, 1) [K]."""
        gain = self.accelerometer.scale
        d = outputs - self.accelerometer.bias - self.ka0_T1 * warm
        b, k = 1.0 + self.ka1_T1 * warm / gain, self.squares / gain
        s = 2.0 * d / (b + np.sqrt(np.square(b) + 4.0 * k * d))
        return self.accelerometer.correct(s + self.accelerometer.bias)

    def outputs(self, force: Array, warm: Array) -> Array:
        """Accelerometer outputs (*batch, 3) [m/s^2] at specific force in p: the inverse of `force`."""
        bias, gain = self.accelerometer.bias, self.accelerometer.scale
        s = apart(self.accelerometer.gain, force)
        beside = self.ka1_T1 * warm * s / gain + self.squares * np.square(s) / gain
        return s + beside + bias + self.ka0_T1 * warm

    def turning(self, rate: Array, force: Array, warm: Array) -> Array:
        """Rate (*batch, 3) [rad/s] in p at which the platform turns, at one commanded or measured."""
        beside = 0.5 * self.asymmetry * np.abs(rate) + self.kg0_T1 * warm + apart(self.by_force, force)
        return self.platform.indicate(rate) + beside

    def commanded(self, turning: Array, force: Array, warm: Array) -> Array:
        """Rate commanded, or measured, for the platform to turn at one: the inverse of `turning`."""
        constant = turning - self.kg0_T1 * warm - apart(self.by_force, force)
        rate = self.platform.correct(constant)
        for _ in range(_ROUNDS):
            rate = self.platform.correct(constant - 0.5 * self.asymmetry * np.abs(rate))
        return rate

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
