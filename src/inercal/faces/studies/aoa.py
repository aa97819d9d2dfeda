"""The study of an angle of attack: one file for its simulation and its measurement."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PlainSerializer, PlainValidator, WithJsonSchema, model_validator

from inercal.faces.studies.common import (
    Conditions,
    ConditionsTable,
    SiteTable,
    Traceability,
    TraceabilityTable,
    Version,
    site_of,
)
from inercal.faces.studies.fields import ExactText, QuantityText, refusal
from inercal.faces.studies.laboratory import (
    Equipment,
    Item,
    ItemTable,
    Laboratory,
    LaboratoryTable,
    Tolerances,
    traced,
)
from inercal.faces.studies.motion import AoaDisturbancesTable, MotionTable, disturbances_of, motion_of
from inercal.faces.studies.sensors import LayoutTable, SensorsTable, calibrations_of, layout_of, layouts_of
from inercal.faces.studies.tables import Stated, as_typed, settings_of, table_of
from inercal.foundation._toml import Strict, check
from inercal.foundation.errors import StudyError
from inercal.foundation.keys import DEVIATION, FREQUENCY
from inercal.foundation.units import Quantity, shown
from inercal.systems.aoa.alarm import AlarmLimits
from inercal.systems.aoa.band import Band
from inercal.systems.aoa.disturbances import DELAY
from inercal.systems.aoa.settings import (
    AoaSettings,
    Attitude,
    Estimator,
    Flow,
    Goal,
    Methods,
    ModelAttitude,
    Noise,
    PointPlan,
    Prior,
    Resonance,
    Timing,
    Zero,
)

_Frequency = Annotated[Quantity, QuantityText("frequency", "9 Hz", FREQUENCY.accept, FREQUENCY.words)]
_Damping = Annotated[
    Quantity, QuantityText("number", "0.3", lambda z: 0.0 < z < 1.0, "a relative damping above 0, below 1")
]
_Force = Annotated[Quantity, QuantityText("acceleration", "0.01 g", DEVIATION.accept, DEVIATION.words)]
_Delay = Annotated[Quantity, ExactText("time", "2 ms", DELAY.accept, DELAY.words)]
_CommonDelay = Annotated[Quantity, QuantityText("time", "0.5(1) ms", DELAY.accept, DELAY.words)]
_Instant = Annotated[Quantity, QuantityText("time", "5 s", lambda t: abs(t) < 1e10, "a time of the record")]


def _certain(value: object) -> Quantity:
    """A known angle: its standard uncertainty is above zero."""
    quantity = QuantityText(
        "angle", "0.00(1) deg", lambda a: abs(a) <= math.pi, "an angle from -180 deg to 180 deg"
    ).parse(value)
    if not quantity.u > 0.0:
        raise refusal(
            f"found {shown(value)}, expected it with its standard uncertainty, such as '0.00(1) deg'"
        )
    return quantity


_SNAP = re.compile(r"\s*([0-9.]+(?:[eE][+-]?[0-9]+)?)\s*rad(?:\^2|²)\s*/\s*s(?:\^7|⁷)\s*")


def _snap(value: object) -> float | None:
    """A spectral density [rad^2/s^7], as a text with that unit; None for auto."""
    if value == "auto":
        return None
    match = _SNAP.fullmatch(value) if isinstance(value, str) else None
    try:
        density = float(match[1]) if match else math.nan
    except ValueError:
        density = math.nan
    if not 0.0 < density < math.inf:
        raise refusal(
            f'found {shown(value)}, expected "auto" or a spectral density above zero, such as "1e7 rad^2/s^7"'
        )
    return density


_Snap = Annotated[
    float | None,
    PlainValidator(_snap),
    PlainSerializer(lambda value: "auto" if value is None else f"{value!r} rad^2/s^7"),
    WithJsonSchema({"type": "string", "examples": ["auto", "1e9 rad^2/s^7"]}),
]


class StingTable(Strict):
    """Support of the model."""

    kind: Literal["sting"] = Field(description="a model that pitches about a pivot, on a sting")


class FlexureTable(Strict):
    """Flexure of the sting as the filter takes it: a band-pass with random input."""

    frequency: _Frequency | None = Field(default=None, description="of the resonance; as usual if absent")
    damping: _Damping | None = Field(default=None, description="relative to critical; as usual if absent")
    level: _Force | None = Field(
        default=None, description="standard deviation of the acceleration; 0.01 g if absent"
    )


class HeaveTable(FlexureTable):
    """The first of both resonances, across the model or along the vertical."""

    direction: Literal["z", "vertical"] = Field(
        default="z", description="across the model, or vertical, as of a support that plunges"
    )


class SensorPriorTable(table_of(Prior)):  # type: ignore[misc]
    """Standard deviations of the sensors' errors before the run; the usual ones if absent."""

    heave: HeaveTable = Field(
        default=HeaveTable(), title="Heave", description="flexure along z: 9 Hz, damping 0.3 if absent"
    )
    axial: FlexureTable = Field(
        default=FlexureTable(), title="Axial", description="flexure along x: 12 Hz, damping 0.5 if absent"
    )


class TimingTable(Strict):
    """Delays, positive where outputs come late."""

    gyro_delay: _Delay | Literal["estimate"] = Field(
        default="estimate", description="of the gyro against the accelerometers; or estimate"
    )
    common_delay: _CommonDelay | None = Field(
        default=None,
        description="of all sensors against the stamps, which none of them sees, with its standard uncertainty; 0 if "
        "absent",
    )


def _low_pass(value: object) -> float | None:
    """A corner frequency [Hz], infinite for none, None for auto."""
    if value in ("auto", "none"):
        return None if value == "auto" else math.inf
    if not isinstance(value, str):
        raise refusal(f'found {shown(value)}, expected "auto", "none" or a frequency, such as "35 Hz"')
    return QuantityText("frequency", "35 Hz", FREQUENCY.accept, FREQUENCY.words).parse(value).value


_LowPass = Annotated[
    float | None,
    PlainValidator(_low_pass),
    PlainSerializer(lambda f: "auto" if f is None else "none" if f == math.inf else f"{f!r} Hz"),
    WithJsonSchema({"type": "string", "examples": ["auto", "35 Hz", "none"]}),
]


class BandTable(Strict):
    """The filter of all sensors before the fusion: causal, its delay known to the model; zero phase if smoothed."""

    low_pass: _LowPass = Field(
        default=None,
        description="corner of the low pass; none; auto: none where the sensors fit each other, or the widest of 100 "
        "to 35 Hz above twice the motion under which they do, and notches at lines of the spectrum",
    )
    notch: list[_Frequency] = Field(
        default=[], description="frequencies that are taken out", examples=[["50 Hz"]]
    )


class EstimatorTable(table_of(Estimator)):  # type: ignore[misc]
    """The estimator of the angle; keys other than its kind are of the fusion of all sensors."""

    snap: _Snap = Field(
        default=None,
        description="spectral density of the angle's fourth derivative; auto: 1e7 rad^2/s^7, 1e8 from 15 states on, "
        "or in a livelier file the smallest of 1e9 to 1e12 that fits",
    )


class ZeroTable(Strict):
    """A stretch at rest, wind off, at a known angle."""

    start: _Instant = Field(description="of the stretch, in the record's time", examples=["0 s"])
    end: _Instant = Field(description="of the stretch")
    angle: Annotated[
        Quantity,
        PlainValidator(_certain),
        PlainSerializer(lambda quantity: quantity.text),
        WithJsonSchema({"type": "string", "examples": ["0.00(1) deg"]}),
    ] = Field(description="pitch in that stretch, with its standard uncertainty")

    @model_validator(mode="after")
    def _in_order(self) -> ZeroTable:
        """Refuse a stretch without length."""
        if not self.start.value < self.end.value:
            raise refusal(f"start: found {shown(self.start.text)}, expected it before end, {self.end.text}")
        return self


class AoaStudyFile(Strict):
    """A study of inertial angle of attack, for `inercal simulate aoa` and `aoa`."""

    version: Version = 1
    site: SiteTable = Field(default=SiteTable(), title="Site", description="where the tunnel stands")
    rig: StingTable = Field(title="Rig", description="what carries the model")
    sensors: SensorsTable = Field(title="Sensors", description="the sensors, by the names of their columns")
    noise: Stated[Noise] = Field(title="Noise", description="noise and biases of the sensors")
    prior: SensorPriorTable = Field(
        default=SensorPriorTable(), title="Prior", description="what is not known of the sensors"
    )
    motion: MotionTable | None = Field(
        default=None, title="Motion", description="of a simulation; a recording can do without"
    )
    disturbances: AoaDisturbancesTable = Field(
        default=AoaDisturbancesTable(),
        title="Disturbances",
        description="what a simulation adds to the model",
    )
    timing: TimingTable = Field(default=TimingTable(), title="Timing", description="delays of the sensors")
    band: BandTable = Field(
        default=BandTable(), title="Band", description="what of the sensors the fusion takes"
    )
    estimator: EstimatorTable = Field(
        default=EstimatorTable(), title="Estimator", description="how the angle is found"
    )
    methods: Stated[Methods] = Field(default=Methods(), title="Methods", description="the paper's way")
    model: Stated[ModelAttitude] = Field(
        default=ModelAttitude(), title="Model", description="how the model lies"
    )
    flow: Stated[Flow] = Field(default=Flow(), title="Flow", description="angularity of the flow")
    zero: ZeroTable | None = Field(default=None, title="Zero", description="a stretch at a known angle")
    points: Stated[PointPlan] = Field(
        default=PointPlan(), title="Points", description="stretches that are test points"
    )
    alarm: Stated[AlarmLimits] = Field(
        default=AlarmLimits(), title="Alarm", description="limits of the angle, for live measurements"
    )
    layouts: dict[str, LayoutTable] = Field(
        default_factory=dict,
        title="Layouts",
        description="what `inercal design aoa` sets beside [sensors], each a table of a name of one's own: of each "
        "accelerometer what differs, and all of further ones",
        examples=[{"long": {"a1": {"r": "-0.3 m"}, "a3": {"r": "0.3 m"}}}],
    )
    goal: Stated[Goal] = Field(
        default=Goal(), title="Goal", description="uncertainty that a design is to reach"
    )
    item: Item = ItemTable()
    laboratory: Laboratory = LaboratoryTable()
    equipment: Equipment
    specification: Tolerances
    traceability: Traceability = TraceabilityTable()
    conditions: Conditions = ConditionsTable()

    @model_validator(mode="before")
    @classmethod
    def _no_search(cls, data: Any) -> Any:
        """Refuse the table of the search for places, which 0.2.0 had."""
        if isinstance(data, Mapping) and "design" in data:
            raise refusal(
                "design: found, which is gone since 0.3.0, expected in its place [layouts.NAME], places to compare"
            )
        return data


def aoa_study(data: Mapping[str, Any], path: str | Path) -> AoaSettings:
    """A study in SI, of its parsed TOML ``data``; raises `StudyError` for the first thing wrong, naming file and key.

    ``path`` is where it came from; files that the study names lie beside it, and those of motion and
    prior are read only where they are needed.
    """
    file = check(AoaStudyFile, data, path, StudyError)
    layout, sensors = layout_of(file.sensors), calibrations_of(file.sensors, path)
    motion = None if file.motion is None else motion_of(file.motion, path)
    return AoaSettings(
        site=site_of(file.site, path),
        layout=layout,
        noise=file.noise,
        prior=_prior(file.prior),
        sensors=sensors,
        timing=_timing(file.timing),
        band=Band(file.band.low_pass, tuple(frequency.value for frequency in file.band.notch)),
        estimator=_estimator(file.estimator, path),
        methods=file.methods,
        attitude=Attitude(file.model.roll, file.model.yaw, file.flow.upwash, file.flow.sidewash),
        zero=None if file.zero is None else _zero(file.zero),
        points=file.points,
        alarm=_alarm(file.alarm, path),
        motion=motion,
        disturbances=disturbances_of(file.disturbances, layout, sensors, motion, path),
        layouts=layouts_of(data, path),
        goal=file.goal,
        traceability=traced(file.traceability.model_dump(), file.item),
        temperature=file.conditions.temperature,
        given=as_typed(data),
    )


def _alarm(alarm: AlarmLimits, path: str | Path) -> AlarmLimits:
    """The limits of the angle; refuses those between which there is nothing."""
    lowest, highest = alarm.lowest, alarm.highest
    if lowest is not None and highest is not None and not lowest < highest:
        found = f"{math.degrees(lowest):g} deg with highest {math.degrees(highest):g} deg"
        raise StudyError(path, f"alarm.lowest: found {found}, expected it below")
    return alarm


def _prior(table: SensorPriorTable) -> Prior:
    """Prior of the sensors."""
    usual = Prior()
    heave, axial = _flexure(table.heave, usual.heave), _flexure(table.axial, usual.axial)
    return settings_of(Prior, table, heave=heave, axial=axial)


def _flexure(table: FlexureTable, usual: Resonance) -> Resonance:
    """A resonance, as usual where nothing is given."""
    return Resonance(
        usual.frequency if table.frequency is None else 2.0 * math.pi * table.frequency.value,
        usual.damping if table.damping is None else table.damping.value,
        usual.level if table.level is None else table.level.value,
        isinstance(table, HeaveTable) and table.direction == "vertical",
    )


def _timing(table: TimingTable) -> Timing:
    """The delays; None for one to be estimated."""
    gyro = table.gyro_delay
    delay = gyro.value if isinstance(gyro, Quantity) else None
    common = table.common_delay
    return Timing(delay, 0.0 if common is None else common.value, 0.0 if common is None else common.u)


def _estimator(table: EstimatorTable, path: str | Path) -> Estimator:
    """The fusion."""
    prior = None if table.prior is None else Path(path).parent / table.prior
    return settings_of(Estimator, table, snap=table.snap, prior=prior)


def _zero(table: ZeroTable) -> Zero:
    """A stretch at a known angle."""
    return Zero(table.start.value, table.end.value, table.angle.value, table.angle.u)
