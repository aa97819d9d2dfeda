"""Reference inputs of an instrument on a rig: gravity and earth rate carried through the chain to its axes.

The signs are those of Zhao et al. 2023: ``a = [0 0 -g] C_nb`` is the gravity reference (an accelerometer at
rest indicates -a), ``omega = we [cos L, 0, sin L] C_nb`` the earth rate, n being north, west, up.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.earth import EARTH_RATE, earth_rate


@dataclass(frozen=True, eq=False)
class Output:
    """A linear output ``u_n C_nb v_b`` of a chain.

    ``reference`` u_n (3,) [``unit``] in the base frame, ``axis`` v_b (3,) of the instrument, ``scale`` [``unit``]
    the size by which outputs of different units are divided before they are added up.
    """

    name: str
    reference: Array
    axis: Array
    unit: str
    scale: float

    def value(self, C_nb: Array) -> Array:
        """The output (*batch) [``unit``] for attitudes (*batch, 3, 3)."""
        terms = np.outer(self.reference, self.axis).ravel()
        return np.asarray(C_nb.reshape(*C_nb.shape[:-2], 9) @ terms)

    def slope(self, C_nb: Array, change: Array) -> Array:
        """Change (*batch) of the output for a small ``change`` of the attitudes, both (*batch, 3, 3)."""
        return self.value(change)


#: names of the outputs of a table
NAMES = ("ax", "ay", "az", "wx", "wy", "wz")


def table_outputs(names: Sequence[str], gravity: float, latitude: float | None) -> tuple[Output, ...]:
    """Gravity ``ax ay az`` [m/s^2] and earth rate ``wx wy wz`` [rad/s] on the instrument's axes.

    Parameters
    ----------
    names : sequence of str
        Of `NAMES`.
    gravity : float
        Of the site [m/s^2].
    latitude : float or None
        Of the site [rad]; needed for the rates only.

    Raises
    ------
    ValueError
        A rate is wanted and the latitude is not known.
    KeyError
        An unknown name.
    """
    made = []
    for name in names:
        if name not in NAMES:
            raise KeyError(name)
        axis = np.eye(3)["xyz".index(name[1])]
        if name[0] == "a":
            made.append(Output(name, gravity_reference(gravity), axis, "m/s^2", gravity))
        elif latitude is None:
            raise ValueError(f"{name} is a component of earth rate, expected a latitude of the site")
        else:
            made.append(Output(name, rate_reference(latitude), axis, "rad/s", EARTH_RATE))
    return tuple(made)


def gravity_reference(gravity: float = 1.0) -> Array:
    """Gravity (3,) in n (north, west, up): ``[0, 0, -gravity]``; in units of the site's gravity by default."""
    return np.array([0.0, 0.0, -gravity])


def rate_reference(latitude: float) -> Array:
    """Earth rate (3,) [rad/s] in n (north, west, up)."""
    north, up = earth_rate(latitude)
    return np.array([float(north), 0.0, float(up)])
