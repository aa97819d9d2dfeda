"""The list of systems, in the order of the commands: a new one has its own room, and a line here."""

from __future__ import annotations

from collections.abc import Mapping

from inercal.aoa.system import SYSTEM as AOA
from inercal.imu.system import SYSTEM as IMU
from inercal.selfcal.system import SYSTEM as SELFCAL
from inercal.strapdown.system import SYSTEM as STRAPDOWN
from inercal.systems.contract import System
from inercal.turntable.system import SYSTEM as TURNTABLE

SYSTEMS: Mapping[str, System] = {
    system.kind: system
    for system in (
        IMU,
        STRAPDOWN,
        TURNTABLE,
        SELFCAL,
        AOA,
    )
}
"""Systems by the kind of their studies."""
