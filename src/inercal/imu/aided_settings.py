"""What a calibration against a table's angles is told beside the settings that every calibration of an IMU has."""

from __future__ import annotations

import itertools
from dataclasses import dataclass, field

import numpy as np

from inercal.arrays import Array
from inercal.rigs.chain import Chain


@dataclass(frozen=True)
class AidedSettings:
    """Options of a reference-aided calibration, in SI.

    Attributes
    ----------
    chain : Chain
        The table from n (north, west, up) to the nominal axes of the instrument, with its errors; its joints are
        columns of the record. Errors of scope ``sample`` are left to the scatter of the data.
    azimuth_u : float or None
        Standard uncertainty [rad] of the azimuth in the chain's base; None: the azimuth is not known.
    """

    chain: Chain = field()
    azimuth_u: float | None = None


def mounting_of(axes: tuple[str, str, str]) -> Array | None:
    """Rotation (3, 3) whose columns are the instrument's x, y, z in the frame of the inner axis.

    Parameters
    ----------
    axes : three of ``+x -x +y -y +z -z``
        The axis of the table, at zero angles, along which each axis of the instrument points.

    Returns
    -------
    (3, 3), or None where the three make no right-handed frame
    """
    columns = [float(f"{axis[0]}1") * np.eye(3)["xyz".index(axis[1])] for axis in axes]
    rotation = np.stack(columns, axis=1)
    return rotation if np.linalg.det(rotation) > 0.5 else None


def mountings() -> dict[tuple[str, ...], Array]:
    """The 24 ways to mount an instrument square on a table, as rotations by axes."""
    axes = [f"{sign}{axis}" for axis in "xyz" for sign in "+-"]
    made = {each: mounting_of((each[0], each[1], each[2])) for each in itertools.permutations(axes, 3)}
    return {each: rotation for each, rotation in made.items() if rotation is not None}
