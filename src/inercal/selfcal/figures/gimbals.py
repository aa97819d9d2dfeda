"""The gimbals and their platform with their axes, drawn."""

from __future__ import annotations

import numpy as np

from inercal.report.html import Picture
from inercal.report.rig import Triad, Turn
from inercal.report.rig import rig as drawn
from inercal.selfcal.platform.rig import JOINTS, Base, Gimbals


def rig(base: Base, gimbals: Gimbals) -> Picture:
    """Three gimbals on their base at zero angles: outer, inner and platform axis, and the axes of the platform."""
    to_geographic = base.from_geographic().T
    joints = [
        Turn(name, sign * to_geographic[:, "xyz".index(axis)])
        for name, axis, sign in zip(JOINTS, gimbals.axes, gimbals.signs, strict=True)
    ]
    return drawn(
        "Axes and signs of the gimbals",
        "The gimbals at zero angles as the study states them: th_x turns the outer gimbal, th_y the inner one, th_z "
        "the platform, each plus along its arrow; X_p, Y_p, Z_p the axes of the platform. Compare with the rig: an "
        "axis in another place or an angle that counts the other way shows here first.",
        joints,
        Triad(("X_p", "Y_p", "Z_p"), np.asarray(to_geographic)),
    )
