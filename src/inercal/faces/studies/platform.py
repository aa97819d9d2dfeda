"""The platform of a self-calibration in a study: its gimbals, the base below them, and the plan of its turns."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, get_args

from pydantic import BeforeValidator, Field, GetJsonSchemaHandler, StrictInt
from pydantic_core import core_schema

from inercal.faces.studies.fields import (
    AsTyped,
    Duration,
    ExactText,
    QuantityText,
    Several,
    SeveralTexts,
    positive,
    refusal,
)
from inercal.faces.studies.rig import Angle
from inercal.foundation._toml import Strict
from inercal.foundation.errors import StudyError
from inercal.foundation.units import Quantity, shown
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.joint_limits import ANY, ForbiddenAngles, JointLimits
from inercal.systems.selfcal.platform.plan import (
    NO_LIMIT,
    JointName,
    Move,
    PlatformPlan,
    Rest,
    Turn,
    of_joints,
    path,
)
from inercal.systems.selfcal.platform.rig import JOINTS, Base, Gimbals

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


FixedAngle = Annotated[Quantity, ExactText("angle", "0 deg")]
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


_MOST_RATE = QuantityText("rate", "5 deg/s", positive, "a rate above zero")
_MOST_ACCELERATION = QuantityText("rate ramp", "2 deg/s^2", positive, "an acceleration above zero")
_OF_JOINTS = "the joints x, y, z"


class ForbiddenTable(GimbalLimitsTable):
    """Angles that the joints may not have together, whole turns aside; any angle of a joint that is absent."""


class FixedJointsTable(Strict):
    """Joints that do not turn, of a rig of one or two axes; a record needs no column of their angles."""

    x: FixedAngle | None = Field(default=None, description="outer angle", examples=["0 deg"])
    y: FixedAngle | None = Field(default=None, description="of the inner joint", examples=["0 deg"])
    z: FixedAngle | None = Field(default=None, description="of the joint of the platform", examples=["0 deg"])


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
    joint_rate: Annotated[Several, SeveralTexts(_MOST_RATE, _OF_JOINTS, one=True)] | None = Field(
        default=None,
        description="largest rate of the joints, one for all or x, y, z; those of the plan if absent",
        examples=[["5 deg/s", "2 deg/s", "5 deg/s"]],
    )
    joint_acceleration: Annotated[Several, SeveralTexts(_MOST_ACCELERATION, _OF_JOINTS, one=True)] | None = (
        Field(
            default=None,
            description="by which turns begin and end, one for all or x, y, z; at once if absent",
            examples=[["2 deg/s^2", "1 deg/s^2", "2 deg/s^2"]],
        )
    )
    forbidden: list[ForbiddenTable] | None = Field(
        default=None,
        description="regions that no path of the rig may touch, such as where something is in the way",
        examples=[[{"x": ["80 deg", "100 deg"], "y": ["20 deg", "60 deg"]}]],
    )
    fixed: FixedJointsTable = Field(
        default=FixedJointsTable(),
        title="Fixed joints",
        description="joints that do not turn, and their angles; all turn if absent",
    )


class PlacedRecordTable(Strict):
    """A record of a platform on a base of its own; several are fitted together."""

    file: Annotated[str, Field(min_length=1)] = Field(
        description="of the record, as the command is given it", examples=["south.csv"]
    )
    heading: Angle | Literal["unknown"] | None = Field(
        default=None, description="of the base, from north to east; that of [rig] if absent"
    )
    tilt: Annotated[Several, _TILT] | None = Field(
        default=None, description="of the base, about north and about east; that of [rig] if absent"
    )


def gimbals_of(table: GimbalsTable) -> Gimbals:
    """Order and signs."""
    x, y, z = table.gimbals
    outer, inner, platform = table.signs
    return Gimbals((x, y, z), (outer, inner, platform))


def base_of(table: GimbalsTable, record: PlacedRecordTable | None = None) -> Base:
    """Attitude of the base, that of a ``record`` where it states another."""
    typed = table.heading if record is None or record.heading is None else record.heading
    tilt = table.tilt if record is None or record.tilt is None else record.tilt
    heading = None if typed == "unknown" else typed
    north, east = (0.0, 0.0) if tilt is None else tilt.values
    tilt_u = (0.0, 0.0) if tilt is None else tuple(each.u for each in tilt.quantities)
    return Base(
        table.frame,
        0.0 if heading is None else heading.value,
        (north, east),
        0.0 if heading is None else heading.u,
        (tilt_u[0], tilt_u[1]),
    )


def limits_of(table: GimbalsTable, where: object) -> dict[str, tuple[float, float]]:
    """Allowed range (low, high) [rad] of the gimbal angles that have one, by name.

    Raises `StudyError` for ends out of order.
    """
    return _ranges(table.limits, "rig.limits", where)


def _ranges(table: GimbalLimitsTable, key: str, where: object) -> dict[str, tuple[float, float]]:
    """Ranges (low, high) [rad] of the joints that have one, by name of the angle."""
    limits: dict[str, tuple[float, float]] = {}
    for name in JOINTS:
        ends: Several | None = getattr(table, name[-1])
        if ends is None:
            continue
        low, high = ends.values
        if not low < high:
            raise StudyError(
                where, f"{key}.{name[-1]}: found {shown(ends.typed)}, expected the lower end first"
            )
        limits[name] = (low, high)
    return limits


def joints_of(table: GimbalsTable, where: object) -> JointLimits:
    """Rates, accelerations and forbidden regions; raises `StudyError` for a region without angles, or with ends out of
    order."""
    rate, acceleration = (
        NO_LIMIT if several is None else of_joints(several.values)
        for several in (table.joint_rate, table.joint_acceleration)
    )
    regions = []
    for k, region in enumerate(table.forbidden or ()):
        ranges = _ranges(region, f"rig.forbidden[{k + 1}]", where)
        if not ranges:
            raise StudyError(where, f"rig.forbidden[{k + 1}]: found no angles, expected those of a joint")
        x, y, z = (ranges.get(name, ANY) for name in JOINTS)
        regions.append(ForbiddenAngles((x, y, z)))
    return JointLimits(rate, acceleration, tuple(regions))


def fixed_of(table: GimbalsTable, where: object) -> dict[str, float]:
    """Angle [rad] of the joints that do not turn, by name; raises `StudyError` where none turns."""
    typed = {name: getattr(table.fixed, name[-1]) for name in JOINTS}
    fixed = {name: angle.value for name, angle in typed.items() if angle is not None}
    if len(fixed) == len(JOINTS):
        raise StudyError(where, "rig.fixed: found all joints, expected one that turns")
    return fixed


FEWEST = 10
"""Rows of a plan below which there is nothing to find out."""

_ANGLE = QuantityText("angle", "180 deg", lambda angle: angle != 0.0, "an angle other than 0")
_RATE = QuantityText("rate", "1 deg/s", positive, "a rate above zero")
_TIME = QuantityText("time", "60 s", positive, "a time above zero")
_START = SeveralTexts(QuantityText("angle", "0 deg"), "x, y, z")
_EXPECTED = '["z", "180 deg"], with a third entry for its rate, or ["rest", "60 s"]'

RateAbove = Annotated[Quantity, _RATE]


@dataclass(frozen=True)
class TypedMove:
    """A turn or a rest, and the list of texts that was typed."""

    move: Move
    typed: list[str]


class MoveTexts(AsTyped):
    """Makes a pydantic field read a turn or a rest."""

    def parse(self, typed: object) -> TypedMove:
        """Read one; refusals go to pydantic, which knows the key."""
        match typed:
            case ["rest", str(time)]:
                return TypedMove(Rest(_TIME.parse(time).value), ["rest", time])
            case ["x" | "y" | "z" as joint, str(angle)]:
                return TypedMove(Turn(joint, _ANGLE.parse(angle).value), [joint, angle])
            case ["x" | "y" | "z" as joint, str(angle), str(rate)]:
                turn = Turn(joint, _ANGLE.parse(angle).value, _RATE.parse(rate).value)
                return TypedMove(turn, [joint, angle, rate])
        raise refusal(f"found {shown(typed)}, expected a turn such as {_EXPECTED}")

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """A list of texts that begins with a joint, or with rest."""
        angle, rate, time = (
            each.__get_pydantic_json_schema__(schema, handler) for each in (_ANGLE, _RATE, _TIME)
        )
        joint = {"enum": list(get_args(JointName))}
        return {
            "type": "array",
            "minItems": 2,
            "anyOf": [
                {"prefixItems": [joint, angle, rate], "maxItems": 3},
                {"prefixItems": [{"const": "rest"}, time], "maxItems": 2},
            ],
        }


class CommandTable(Strict):
    """Commands to the gimbals: turns one after the other, or a path by its name."""

    turns: list[Annotated[TypedMove, MoveTexts()]] | None = Field(
        default=None,
        min_length=1,
        description=f"one after the other, each a joint and an angle, as {_EXPECTED}",
    )
    path: Literal["paper", "paper two turns", "best", "plain"] | None = Field(
        default=None, description="instead: a path by its name, at the rate of the plan"
    )
    rate: RateAbove | None = Field(default=None, description="of the turns; 1 deg/s if absent")
    step: Duration | None = Field(default=None, description="from row to row; 0.2 s if absent")
    start: Annotated[Several, _START] | None = Field(
        default=None, description="angles of the joints x, y, z at the start; 0 if absent"
    )


def plan_of(
    table: CommandTable, fixed: Mapping[str, float], joints: JointLimits, where: object
) -> PlatformPlan:
    """The plan, as its ``joints`` can; those that are ``fixed`` [rad] as they are.

    Raises `StudyError` for neither or both of turns and path, too few or too many rows, or a turn of a fixed joint.
    """
    match table:
        case CommandTable(turns=None, path=str(name)):
            plan = path(name)
        case CommandTable(turns=list(turns), path=None):
            plan = PlatformPlan(tuple(each.move for each in turns))
        case _:
            given = "both turns and path" if table.turns else "neither turns nor path"
            raise StudyError(where, f"plan: found {given}, expected one of them")
    if table.rate is not None:
        plan = replace(plan, rate=table.rate.value)
    if table.step is not None:
        plan = replace(plan, step=table.step.value)
    if table.start is not None:
        x, y, z = table.start.values
        plan = replace(plan, start=(x, y, z))
    plan = joints.kept(_with_fixed(plan, fixed, table.start is not None, where))
    rows = plan.duration / plan.step
    if not FEWEST <= rows <= LIMITS.most_rows:
        raise StudyError(
            where,
            f"plan: found {rows:.6g} steps of {plan.step:g} s, expected {FEWEST} to {LIMITS.most_rows:,}",
        )
    return plan


def _with_fixed(plan: PlatformPlan, fixed: Mapping[str, float], stated: bool, where: object) -> PlatformPlan:
    """The plan with joints that do not turn at their angles; raises `StudyError` where it turns one of them, or begins
    elsewhere."""
    for k, name in enumerate(JOINTS):
        if name not in fixed:
            continue
        if any(isinstance(move, Turn) and move.joint == name[-1] for move in plan.moves):
            raise StudyError(where, f"plan: found a turn of {name}, expected none of a joint of rig.fixed")
        if stated and abs(plan.start[k] - fixed[name]) > 1e-9:
            found, wanted = math.degrees(plan.start[k]), math.degrees(fixed[name])
            text = f"plan.start: found {found:.6g} deg for {name}, expected {wanted:.6g} deg as of rig.fixed"
            raise StudyError(where, text)
    x, y, z = (fixed.get(name, plan.start[k]) for k, name in enumerate(JOINTS))
    return replace(plan, start=(x, y, z))
