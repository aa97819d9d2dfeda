"""A test before it is made: the uncertainties that its plan makes expect."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from inercal.foundation.arrays import Array

_STEP = 0.01
"""Relative change of a stated size by which its share is found."""


@dataclass(frozen=True)
class Lever:
    """A size that a study states: its ``key``, the ``value`` in a ``unit`` for people, and what it ``says``.

    ``written`` is the value of the key in TOML, with {} for the quantity.
    """

    key: str
    value: float
    unit: str
    says: str = ""
    written: str = '"{}"'

    def quantity(self, factor: float = 1.0) -> str:
        """The size times ``factor``, in words."""
        return f"{self.value * factor:.4g} {self.unit}"

    def setting(self, factor: float) -> str:
        """The size times ``factor``, as ``--set`` takes it."""
        return f"{self.key}={self.written.replace('{}', self.quantity(factor))}"


@dataclass(frozen=True, eq=False)
class Foresight:
    """Standard uncertainties that a plan makes expect.

    ``names`` (p,) of the coefficients with their ``units`` for people, ``sizes`` (p,) of these in SI; ``levers`` (k,)
    are noise and errors that the study states; ``u`` gives uncertainties (p,) [SI] where each is so many times (k,) as
    large. ``blind``: the share of the faults by order, place, reading and history that would shift a value by 2 u
    unseen, where that is told.
    """

    names: tuple[str, ...]
    units: tuple[str, ...]
    sizes: Array
    levers: tuple[Lever, ...]
    u: Callable[[Array], Array]
    blind: Mapping[str, float] = field(default_factory=dict)

    @property
    def hides(self) -> str:
        """Faults that the plan hides, in words; empty where that is not told."""
        parts = ", ".join(f"{100.0 * share:.0f} % by {cell}" for cell, share in self.blind.items())
        return f"Faults that would shift a value by 2 u unseen: {parts}." if parts else ""

    def shares(self, factors: Array) -> Array:
        """Share (k, p) of each lever in the variance of each coefficient; what is left is of the prior and the site.

        The gain of the best linear estimate is stationary, so that a variance V changes with that of a source,
        s_k^2, by what the source adds to it: the share is (s_k^2 / V) dV / ds_k^2 = d ln u / d ln s_k.
        """
        found = np.empty((len(self.levers), len(self.names)))
        for k in range(len(self.levers)):
            steps = np.ones((2, len(factors)))
            steps[:, k] = np.exp([_STEP, -_STEP])
            up, down = (np.log(self.u(factors * step)) for step in steps)
            found[k] = (up - down) / (2.0 * _STEP)
        return found
