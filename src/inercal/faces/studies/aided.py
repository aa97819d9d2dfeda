"""The table of a study of an IMU that a turntable with known angles calibrates."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator

from inercal.faces.studies.fields import refusal
from inercal.faces.studies.rig import RigTable, chain_of
from inercal.foundation._toml import Strict
from inercal.systems.imu.settings import AidedSettings, mounting_of

SignedAxis = Literal["+x", "-x", "+y", "-y", "+z", "-z"]


class AidedTable(Strict):
    """Reference-aided calibration: the table, and the instrument on it."""

    rig: RigTable = Field(
        default=RigTable(kind="two_axis_turntable"),
        title="Rig",
        description="the table, as in a study of a turntable; of two axes and without errors if absent, "
        "its azimuth unknown unless given",
    )
    mounting: tuple[SignedAxis, SignedAxis, SignedAxis] = Field(
        default=("+x", "+y", "+z"),
        examples=[["+x", "+y", "+z"]],
        description="axes of the table, at zero angles, along which the instrument's x, y and z point",
    )

    @model_validator(mode="after")
    def _right_handed(self) -> AidedTable:
        """Refuse axes that make no frame."""
        if mounting_of(self.mounting) is None:
            raise refusal(
                f"found the mounting {', '.join(self.mounting)}, expected three axes that make a right-handed frame"
            )
        return self

    @model_validator(mode="after")
    def _no_limits(self) -> AidedTable:
        """Refuse what would change nothing."""
        if self.rig.limits.model_fields_set:
            raise refusal("found rig.limits, expected none: the angles are those of the record")
        return self


def aided_settings(table: AidedTable, where: object) -> AidedSettings:
    """Put the table in SI.

    Raises `StudyError` for an error that this kind of table does not have, or one without any distribution.
    """
    azimuth = table.rig.base.azimuth
    chain = chain_of(table.rig, where, mounting_of(table.mounting), "imu.aided.rig")
    return AidedSettings(chain, None if azimuth is None else azimuth.u)
