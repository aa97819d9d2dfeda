"""The platform of a self-calibration in a study: its gimbals, the base below them, and the plan of its turns."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, get_args

from pydantic import Field, GetJsonSchemaHandler
from pydantic_core import core_schema

from inercal.faces.studies.fields import AsTyped, QuantityText, positive, refusal
from inercal.faces.studies.tables import Stated, replaced, table_of
from inercal.foundation.errors import StudyError
from inercal.foundation.units import shown
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.joint_limits import FixedJoints, JointLimits, JointRanges
from inercal.systems.selfcal.platform.plan import JointName, Move, PlatformPlan, Rest, Turn, path
from inercal.systems.selfcal.platform.rig import JOINTS, Base, Gimbals


class GimbalsTable(table_of(JointLimits), table_of(Gimbals), table_of(Base)):  # type: ignore[misc]
    """The platform in its gimbals, and the base that carries them."""

    kind: Literal["three_axis_gimbals"] = Field(description="three gimbals: outer x, inner y, platform z")
    limits: Stated[JointRanges] = Field(
        default=JointRanges(), title="Limits", description="ranges of the joints; none if absent"
    )
    fixed: Stated[FixedJoints] = Field(
        default=FixedJoints(),
        title="Fixed joints",
        description="joints that do not turn, and their angles; all turn if absent",
    )


FEWEST = 10
"""Rows of a plan below which there is nothing to find out."""

_ANGLE = QuantityText("angle", "180 deg", lambda angle: angle != 0.0, "an angle other than 0")
_RATE = QuantityText("rate", "1 deg/s", positive, "a rate above zero")
_TIME = QuantityText("time", "60 s", positive, "a time above zero")
_EXPECTED = '["z", "180 deg"], with a third entry for its rate, or ["rest", "60 s"]'


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


class CommandTable(table_of(PlatformPlan)):  # type: ignore[misc]
    """Commands to the gimbals: turns one after the other, or a path by its name."""

    turns: list[Annotated[TypedMove, MoveTexts()]] | None = Field(
        default=None,
        min_length=1,
        description=f"one after the other, each a joint and an angle, as {_EXPECTED}",
    )
    path: Literal["paper", "paper two turns", "best", "plain"] | None = Field(
        default=None, description="instead: a path by its name, at the rate of the plan"
    )


def plan_of(table: Any, fixed: Mapping[str, float], joints: JointLimits, where: object) -> PlatformPlan:
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
    plan = replaced(plan, table)
    plan = joints.kept(_with_fixed(plan, fixed, "start" in table.model_fields_set, where))
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
