"""The plan of a self-calibration in a study: turns and rests one by one, or a path by its name."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Annotated, Any, Literal, get_args

from pydantic import Field, GetJsonSchemaHandler
from pydantic_core import core_schema

from inercal._toml import Strict
from inercal.errors import StudyError
from inercal.selfcal.limits import LIMITS
from inercal.selfcal.platform.plan import JointName, Move, Plan, Rest, Turn, path
from inercal.studies.fields import AsTyped, Duration, QuantityText, Several, SeveralTexts, positive, refusal
from inercal.studies.rig import Limits
from inercal.units import Quantity, shown

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


class PlanTable(Strict):
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


def plan_of(table: PlanTable, limits: Limits, where: object) -> Plan:
    """The plan.

    Raises
    ------
    StudyError
        Neither or both of turns and path, too few or too many rows, or angles beyond the ``limits`` [rad].
    """
    match table:
        case PlanTable(turns=None, path=str(name)):
            plan = path(name)
        case PlanTable(turns=list(turns), path=None):
            plan = Plan(tuple(each.move for each in turns))
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
    rows = plan.duration / plan.step
    if not FEWEST <= rows <= LIMITS.most_rows:
        raise StudyError(
            where,
            f"plan: found {rows:.6g} steps of {plan.step:g} s, expected {FEWEST} to {LIMITS.most_rows:,}",
        )
    if beyond := plan.beyond(limits):
        low, high = limits[beyond[0]]
        raise StudyError(
            where,
            f"plan: found turns that take {beyond[0]} beyond rig.limits, expected them within "
            f"{math.degrees(low):.6g} deg to {math.degrees(high):.6g} deg",
        )
    return plan
