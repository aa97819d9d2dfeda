"""The list of systems, in the order of the commands: a new one has its own room, and a line here."""

from __future__ import annotations

from collections.abc import Mapping

from inercal.systems.aoa.system import SYSTEM as AOA
from inercal.systems.contract import System
from inercal.systems.imu.system import SYSTEM as IMU
from inercal.systems.selfcal.system import SYSTEM as SELFCAL
from inercal.systems.strapdown.system import SYSTEM as STRAPDOWN
from inercal.systems.turntable.system import SYSTEM as TURNTABLE

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
