"""The gimbals of a study: their order and signs, the base below them, the limits of their angles."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import BeforeValidator, Field, StrictInt

from inercal._toml import Strict
from inercal.errors import StudyError
from inercal.selfcal.platform.rig import JOINTS, Base, Gimbals
from inercal.studies.fields import QuantityText, Several, SeveralTexts, refusal
from inercal.studies.rig import Angle
from inercal.units import shown

_ENDS = SeveralTexts(QuantityText("angle", "-90 deg"), "the lowest, the highest angle")
_TILT = SeveralTexts(
    QuantityText("angle", "0 arcmin", lambda a: abs(a) <= 0.5 * math.pi, "an angle from -90 deg to 90 deg"),
    "the one about north, the one about east",
)


def _once_each(axes: object) -> object:
    """Refuse anything but x, y and z in some order."""
    if not isinstance(axes, list) or sorted(map(str, axes)) != ["x", "y", "z"]:
        raise refusal(f'found {shown(axes)}, expected "x", "y" and "z" once each, the outer joint first')
    return axes


def _signs(signs: object) -> object:
    """Refuse anything but three signs."""
    good = isinstance(signs, list) and len(signs) == 3
    if not good or any(type(sign) is not int or sign not in (1, -1) for sign in signs):  # type: ignore[attr-defined]
        raise refusal(f"found {shown(signs)}, expected three of 1 and -1, for the joints x, y, z")
    return signs


AxisName = Literal["x", "y", "z"]
Order = Annotated[list[AxisName], BeforeValidator(_once_each), Field(min_length=3, max_length=3)]
Signs = Annotated[
    list[Annotated[StrictInt, Field(json_schema_extra={"enum": [1, -1]})]],
    BeforeValidator(_signs),
    Field(min_length=3, max_length=3),
]


class GimbalLimitsTable(Strict):
    """Ranges within which the gimbals turn; no limits if absent."""

    x: Annotated[Several, _ENDS] | None = Field(
        default=None, description="lowest and highest outer angle", examples=[["-180 deg", "180 deg"]]
    )
    y: Annotated[Several, _ENDS] | None = Field(
        default=None, description="of the inner joint", examples=[["-80 deg", "80 deg"]]
    )
    z: Annotated[Several, _ENDS] | None = Field(
        default=None, description="of the joint of the platform", examples=[["-360 deg", "360 deg"]]
    )


class GimbalsTable(Strict):
    """The platform in its gimbals, and the base that carries them."""

    kind: Literal["three_axis_gimbals"] = Field(description="three gimbals: outer x, inner y, platform z")
    heading: Angle | Literal["unknown"] | None = Field(
        default=None,
        description="of the base, from north to east; may carry an uncertainty; unknown: found from the record; 0 if "
        "absent",
    )
    tilt: Annotated[Several, _TILT] | None = Field(
        default=None,
        description="of the base, about north and about east; may carry uncertainties; level if absent",
    )
    frame: Literal["nue", "enu", "ned"] = Field(
        default="nue",
        description="axes of the platform at zero angles: north-up-east, east-north-up, north-east-down",
    )
    gimbals: Order = Field(
        default=["z", "x", "y"],
        examples=[["z", "x", "y"]],
        description="axis of the platform along which each joint lies at zero angles, outer first",
    )
    signs: Signs = Field(default=[1, 1, 1], description="of the angles: -1 where one counts left-handed")
    limits: GimbalLimitsTable = Field(
        default=GimbalLimitsTable(), title="Limits", description="ranges of the joints; none if absent"
    )


def gimbals_of(table: GimbalsTable) -> Gimbals:
    """Order and signs."""
    x, y, z = table.gimbals
    outer, inner, platform = table.signs
    return Gimbals((x, y, z), (outer, inner, platform))


def base_of(table: GimbalsTable) -> Base:
    """Attitude of the base."""
    heading = None if table.heading == "unknown" else table.heading
    north, east = (0.0, 0.0) if table.tilt is None else table.tilt.values
    tilt_u = (0.0, 0.0) if table.tilt is None else tuple(each.u for each in table.tilt.quantities)
    return Base(
        table.frame,
        0.0 if heading is None else heading.value,
        (north, east),
        0.0 if heading is None else heading.u,
        (tilt_u[0], tilt_u[1]),
    )


def limits_of(table: GimbalsTable, where: object) -> dict[str, tuple[float, float]]:
    """Allowed range (low, high) [rad] of the gimbal angles that have one, by name.

    Raises
    ------
    StudyError
        Ends out of order.
    """
    limits: dict[str, tuple[float, float]] = {}
    for name, joint in zip(JOINTS, GimbalLimitsTable.model_fields, strict=True):
        ends: Several | None = getattr(table.limits, joint)
        if ends is None:
            continue
        low, high = ends.values
        if not low < high:
            raise StudyError(
                where, f"rig.limits.{joint}: found {shown(ends.typed)}, expected the lower end first"
            )
        limits[name] = (low, high)
    return limits
