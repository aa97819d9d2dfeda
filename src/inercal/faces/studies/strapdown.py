"""The study of a strapdown unit: one file for its simulation and its calibration."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, GetJsonSchemaHandler
from pydantic_core import core_schema

from inercal.faces.studies.common import (
    Conditions,
    ConditionsTable,
    SiteTable,
    Traceability,
    TraceabilityTable,
    Version,
    site_on_earth,
)
from inercal.faces.studies.fields import (
    AsTyped,
    ExactText,
    QuantityText,
    Several,
    SeveralTexts,
    positive,
    refusal,
)
from inercal.faces.studies.instrument import Typed, check_symbol, coefficient_of
from inercal.faces.studies.laboratory import (
    Equipment,
    Item,
    ItemTable,
    Laboratory,
    LaboratoryTable,
    Tolerances,
    traced,
)
from inercal.faces.studies.tables import Stated, as_typed, settings_of, table_of
from inercal.foundation._toml import Strict, check
from inercal.foundation.errors import StudyError
from inercal.foundation.units import Quantity, parse_unit, shown
from inercal.systems.strapdown.model.coefficients import OPTIONS, names
from inercal.systems.strapdown.settings import (
    ESTIMABLE,
    Goal,
    Motion,
    Noise,
    PathDesign,
    Prior,
    Rests,
    Start,
    StrapdownSettings,
    Term,
    TurnPlan,
)

FEWEST_ROWS, MOST_ROWS = 100, 20_000_000
"""Samples of a simulated recording."""

_ANGLE = ExactText(
    "angle", "90 deg", lambda a: 0.0 < abs(a) <= 2.0 * math.pi, "an angle within 360 deg, not 0"
)
_TIME = ExactText("time", "20 s", lambda t: t >= 0.0, "a time of 0 or more")
_EXPECTED = '["y", "90 deg"]'


@dataclass(frozen=True)
class TypedTurn:
    """A turn, axis 0 to 2 and angle [rad], and the list of texts that was typed."""

    turn: tuple[int, float]
    typed: object


@dataclass(frozen=True)
class TurnTexts(AsTyped):
    """Makes a pydantic field read a turn."""

    def parse(self, typed: object) -> TypedTurn:
        """Read one turn; an axis may have a sign."""
        match typed:
            case [("x" | "y" | "z" | "-x" | "-y" | "-z" | "+x" | "+y" | "+z") as axis, angle]:
                sign = -1.0 if axis.startswith("-") else 1.0
                return TypedTurn(("xyz".index(axis[-1]), sign * _ANGLE.parse(angle).value), typed)
        raise refusal(f"found {shown(typed)}, expected a turn such as {_EXPECTED}")

    def __get_pydantic_json_schema__(
        self, schema: core_schema.CoreSchema, handler: GetJsonSchemaHandler
    ) -> dict[str, Any]:
        """A list of two texts."""
        return {
            "type": "array",
            "items": {"type": "string"},
            "minItems": 2,
            "maxItems": 2,
            "examples": [["y", "90 deg"]],
        }


def _ordered(ends: list[Quantity]) -> list[Quantity]:
    """Begin and end of a rest; refused the other way round."""
    if ends[0].value >= ends[1].value:
        raise refusal(f"found a rest from {ends[0].text} to {ends[1].text}, expected its end after its begin")
    return ends


Stretches = list[
    Annotated[list[Annotated[Quantity, _TIME]], Field(min_length=2, max_length=2), AfterValidator(_ordered)]
]


class StrapdownTable(table_of(StrapdownSettings)):  # type: ignore[misc]
    """Frame and terms of the calibration; this table tells the kind of study."""

    terms: list[Term] = Field(
        default=["k2", "size", "delay"],
        examples=[["k2", "size", "delay"]],
        description="what is estimated beside bias, scale factor and misalignment: second-order coefficients, places "
        "of accelerometers x and y beside z, delay of the accelerometers; also asymmetry of gyro scale factors and "
        "g_sensitivity of the gyros",
    )


class StartTable(Strict):
    """Attitude at the first rest."""

    heading: (
        Literal["gyrocompass", "free"] | Annotated[Quantity, QuantityText("angle", "30(5) deg")] | None
    ) = Field(
        default=None,
        examples=["gyrocompass"],
        description="of the body axis nearest to level, clockwise from north: found from earth rate (gyrocompass), not "
        "known (free), or stated with its standard uncertainty; gyrocompass if absent where the prior of the gyro bias "
        "is below earth rate, else free",
    )


def _size(dimension: str, example: str) -> QuantityText:
    """The reading of a noise that a recording can tell."""
    return QuantityText(dimension, example, lambda size: size >= 0.0, "0 or more, or estimate")


def _estimable(says: str, example: str) -> Any:
    """The field of such a noise, which is found from the recording if absent."""
    return Field(
        default=None,
        examples=[example],
        description=f"{says}; estimate finds it from the recording",
        json_schema_extra={"default": "estimate"},
    )


class NoiseTable(table_of(Noise)):  # type: ignore[misc]
    """Noise of the sensors, and of turns."""

    gyro_walk: (
        Literal["estimate"] | Annotated[Quantity, _size("rate random walk", "0.4 deg/h/sqrt(s)")] | None
    ) = _estimable("random walk of the gyros' biases", "0.4 deg/h/sqrt(s)")
    accelerometer_walk: (
        Literal["estimate"] | Annotated[Quantity, _size("acceleration random walk", "2 ug/sqrt(s)")] | None
    ) = _estimable("random walk of the accelerometers' biases", "2 ug/sqrt(s)")
    turn_attitude: Literal["estimate"] | Annotated[Quantity, _size("angle", "0.02 deg")] | None = _estimable(
        "standard deviation by which the attitude does not close over a turn, beyond the noise of the sensors",
        "0.02 deg",
    )
    turn_velocity: Literal["estimate"] | Annotated[Quantity, _size("velocity", "1 cm/s")] | None = _estimable(
        "the same of the velocity", "1 cm/s"
    )


class RestsTable(table_of(Rests)):  # type: ignore[misc]
    """Rests of the unit between its turns."""

    attitude: (
        Literal["off"]
        | Annotated[
            Quantity, QuantityText("angle", "0.01 deg", positive, "a standard deviation above zero, or off")
        ]
    ) = Field(
        default="off",
        examples=["0.01 deg"],
        description="standard deviation of the attitude at a node about that of its rest: sway of the stand; off "
        "leaves it free",
    )
    list: Stretches = Field(
        default=[],
        examples=[[["0 s", "69 s"], ["80 s", "168 s"]]],
        description="begin and end of each rest, from the first sample on; found in the recording if absent",
    )


class PlanTable(table_of(TurnPlan)):  # type: ignore[misc]
    """The plan of a test, or of a simulated recording."""

    start: Annotated[Several, SeveralTexts(ExactText("angle", "0 deg"), "pitch, roll, yaw")] | None = Field(
        default=None,
        examples=[["0 deg", "-90 deg", "0 deg"]],
        description="attitude of the first rest: from x east, y north, z up turned about z by yaw, then about x by "
        "pitch, then about y by roll; pitch, roll, yaw, 0 if absent",
    )
    turns: list[Annotated[TypedTurn, TurnTexts()]] | None = Field(
        default=None,
        min_length=1,
        examples=[[["y", "90 deg"], ["-z", "90 deg"]]],
        description="turns of the unit, consecutively: axis and angle; only a search for them does without",
    )


class StrapdownStudyFile(Strict):
    """A study of a strapdown unit, for `inercal design strapdown`, `simulate strapdown` and `calibrate strapdown`."""

    version: Version = 1
    site: SiteTable = Field(default=SiteTable(), title="Site", description="where the unit stands")
    strapdown: StrapdownTable = Field(title="Strapdown", description="what to calibrate")
    noise: NoiseTable = Field(title="Noise", description="noise of the sensors, and of turns")
    rests: RestsTable = Field(default=RestsTable(), title="Rests", description="rests between the turns")
    start: StartTable = Field(default=StartTable(), title="Start", description="attitude at the first rest")
    prior: Stated[Prior] = Field(default=Prior(), title="Prior", description="what is known before the test")
    goal: Stated[Goal] = Field(default=Goal(), title="Goal", description="wanted standard uncertainties")
    plan: PlanTable | None = Field(
        default=None, title="Plan", description="the plan of a test, or of a simulated recording"
    )
    design: Stated[PathDesign] | None = Field(
        default=None,
        title="Design",
        description="the search for a path; without this table the plan is judged alone",
    )
    truth: dict[str, Typed] = Field(
        default_factory=dict,
        description="true coefficients of a simulated recording by symbol, outputs in m/s^2 and rad/s; those of a "
        "perfect unit if absent",
        examples=[{"D_F_x": "0.1 deg/h", "r_xx": "1 cm"}],
    )
    motion: Stated[Motion] = Field(
        default=Motion(), title="Motion", description="motion in a simulated recording"
    )
    item: Item = ItemTable()
    laboratory: Laboratory = LaboratoryTable()
    equipment: Equipment
    specification: Tolerances
    traceability: Traceability = TraceabilityTable()
    conditions: Conditions = ConditionsTable()


def strapdown_study(data: Mapping[str, Any], path: str | Path) -> StrapdownSettings:
    """A study in SI, of its parsed TOML ``data``.

    Raises `StudyError` for the first thing wrong, naming file and key.
    """
    file = check(StrapdownStudyFile, data, path, StudyError)
    site = site_on_earth(file.site, path, "unit")
    rests, attitude = file.rests, file.rests.attitude
    truth = _truth(file, site.gravity, path)
    return settings_of(
        StrapdownSettings,
        file.strapdown,
        site=site,
        noise=_noise(file.noise),
        terms=tuple(dict.fromkeys(file.strapdown.terms)),
        rests=settings_of(
            Rests,
            rests,
            attitude=None if attitude == "off" else attitude.value,
            list=tuple((begin.value, end.value) for begin, end in rests.list),
        ),
        start=_start(file.start),
        prior=file.prior,
        goal=file.goal,
        design=file.design,
        plan=None if file.plan is None else _plan(file.plan, path),
        motion=file.motion,
        truth=truth,
        traceability=traced(file.traceability.model_dump(), file.item),
        temperature=file.conditions.temperature,
        given=as_typed(data),
    )


def _truth(file: StrapdownStudyFile, gravity: float, path: str | Path) -> dict[str, float]:
    """True coefficients [SI] by symbol."""
    known, truth = names(OPTIONS, file.strapdown.frame), {}
    for symbol, text in file.truth.items():
        key = f"truth.{symbol}"
        check_symbol(symbol, known, key, path)
        kind = "accelerometer" if symbol.startswith("K") else "gyro"
        unit = parse_unit("m/s^2" if kind == "accelerometer" else "rad/s")
        truth[symbol], _ = coefficient_of(text, symbol, kind, unit, gravity, key, path)
    return truth


def _noise(table: Any) -> Noise:
    """Noise that is stated, and the names of that which is to be found from the recording."""
    typed = {name: getattr(table, name) or "estimate" for name in ESTIMABLE}
    sizes = {name: each.value if isinstance(each, Quantity) else 0.0 for name, each in typed.items()}
    return settings_of(
        Noise, table, **sizes, estimate=tuple(name for name, each in typed.items() if each == "estimate")
    )


def _start(table: StartTable) -> Start:
    """The heading at the first rest."""
    if isinstance(table.heading, Quantity):
        return Start(False, table.heading.value, table.heading.u or math.radians(0.01))
    return Start(compass=None if table.heading is None else table.heading == "gyrocompass")


def _plan(table: Any, path: str | Path) -> TurnPlan:
    """The plan; refused where it has too many samples, or too few for its turns."""
    start = (0.0, 0.0, 0.0) if table.start is None else table.start.values
    plan = settings_of(TurnPlan, table, start=start, turns=tuple(each.turn for each in table.turns or ()))
    rows = plan.duration * plan.sample_rate
    if not FEWEST_ROWS <= rows <= MOST_ROWS:
        raise StudyError(path, f"plan: found {rows:.4g} samples, expected {FEWEST_ROWS} to {MOST_ROWS:.0e}")
    return plan
