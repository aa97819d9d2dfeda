"""Questions whose cause physics names: what each error of rig, site, encoders and commands is called."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.foundation.instruments.terms import shown_unit
from inercal.foundation.records.places import counted
from inercal.systems.selfcal.limits import LIMITS
from inercal.systems.selfcal.platform.rig import JOINTS, World
from inercal.systems.selfcal.platform.states import TEMPERATURE, UNIT_OF


class NamedCause(NamedTuple):
    """A cause in words: the ``code`` of its finding, the ``sentence`` without a full stop, the ``action`` that puts it
    right, and rows of a table."""

    code: str
    sentence: str
    action: str
    items: tuple[Mapping[str, str | float], ...] = ()


Naming = Callable[[Array, Array], NamedCause]
"""The cause in words, by the sizes (k,) of an error [SI] and their standard uncertainties (k,)."""

_EXTENDED: Final = 'take states = "extended" under [model]'

WORDS: Final[Mapping[str, tuple[str, str]]] = {
    "beta": (
        "the base or the zero of the encoders is turned",
        f"{_EXTENDED}, or correct heading and tilt under [rig]",
    ),
    "kg1": ("the gyros have scale errors", _EXTENDED),
    "gamma": (
        "the sensors are turned on the platform, against the axis of its joint",
        "name gamma in states under [model], or align them",
    ),
    "non_orthogonality": ("the axes of the joints are not orthogonal", ""),
    "zero_y": ("the inner encoder does not read zero where its joint is at zero", ""),
    "k2": ("the accelerometers have second-order errors", ""),
    "levers": ("the accelerometers are not at the centre of the gimbals", ""),
    "scale_asymmetry": ("the scale of the gyros is not the same both ways", ""),
    "g_sensitivity": ("the gyros drift by specific force", ""),
    "sag": ("gravity turns the sensors on the platform", ""),
    "kg0_T1": ("the gyro biases change with temperature", ""),
    "ka0_T1": ("the accelerometer biases change with temperature", ""),
    "ka1_T1": ("the accelerometer scales change with temperature", ""),
}
"""Kind of states -> what is wrong, and what to do where naming it under [model] is not enough."""

LATE: Final = {"tau_enc": "encoders", "tau_a": "accelerometers"}
"""Parameter of a delay -> its sensors."""

WANDERING: Final = {"ka0": "accelerometer biases wander", "kg0": "gyro biases wander"}
"""Biases -> what it is called where they do."""


def of_kind(kind: str, names: Sequence[str]) -> Naming:
    """Errors of the rig of one kind that are no states."""
    what, advice = WORDS[kind]
    remedy = advice or f"name {'temperature' if kind in TEMPERATURE else kind} in states under [model]"

    def naming(b: Array, u: Array) -> NamedCause:
        sentence = f"{what}, which the model leaves out ({_largest(names, UNIT_OF[names[0]], b, u)})"
        return NamedCause("unmodelled", sentence, remedy, _items(names, UNIT_OF[names[0]], b, u))

    return naming


def late(name: str) -> Naming:
    """Encoders or accelerometers that are late."""

    def naming(b: Array, u: Array) -> NamedCause:
        how = "late" if b[0] > 0.0 else "early"
        sentence = f"{LATE[name]} are {1e3 * abs(float(b[0])):.3g} ms {how}"
        return NamedCause(
            "command_shift", sentence, "name delay in states under [model], or shift their times"
        )

    return naming


def of_commands(scale: float) -> Naming:
    """Commands on which the platform acts late, ``scale`` [s] for each unit of the error."""

    def naming(b: Array, u: Array) -> NamedCause:
        late = scale * float(b[0])
        how = "later" if late > 0.0 else "earlier"
        sentence = f"the platform acts {1e3 * abs(late):.3g} ms {how} than its commands are logged"
        return NamedCause("command_shift", sentence, "shift the times of the commands")

    return naming


def directions(world: World) -> tuple[Array, Array]:
    """Unit vectors north and up in b; any level one for north at a pole."""
    up = world.up / np.linalg.norm(world.up)
    level = world.earth - (world.earth @ up) * up
    if np.linalg.norm(level) < 1e-9 * EARTH_RATE:
        level = np.eye(3)[int(np.argmin(np.abs(up)))]
        level = level - (level @ up) * up
    return level / np.linalg.norm(level), up


def of_latitude(world: World) -> Naming:
    """An earth rate with other parts to north and up than that of the stated latitude."""
    north, up = directions(world)

    def naming(b: Array, u: Array) -> NamedCause:
        at = np.array([world.earth @ north, world.earth @ up])
        seen, stated = (math.atan2(there[1], there[0]) for there in (at + b, at))
        u_seen = math.hypot(u[0] * math.sin(seen), u[1] * math.cos(seen)) / EARTH_RATE
        sentence = (
            f"the earth rate seen is that of latitude {math.degrees(seen):.2f} +- {math.degrees(u_seen):.1g} deg, "
            f"stated is {math.degrees(stated):.2f} deg"
        )
        return NamedCause("site_suspect", sentence, "check latitude and heading")

    return naming


def of_encoder(joint: int, order: int) -> Naming:
    """An encoder that errs with its angle."""

    def naming(b: Array, u: Array) -> NamedCause:
        amplitude = math.degrees(float(np.hypot(*b))) * 3600.0
        periods = counted(order, "period")
        sentence = (
            f"{JOINTS[joint]} errs periodically with its angle: {amplitude:.2g} arcsec, {periods} a turn"
        )
        return NamedCause("unmodelled", sentence, "name harmonics in states under [model]")

    return naming


def of_asymmetry(scale: float) -> Naming:
    """Accelerometers whose scale differs with the sign of the force; ``scale`` for each unit of the error."""
    names = tuple(f"scale of accelerometer {i} forward less backward" for i in "xyz")

    def naming(b: Array, u: Array) -> NamedCause:
        b, u = scale * b, abs(scale) * u
        what = f"the scale of the accelerometers is not the same both ways ({_largest(names, '1', b, u)})"
        return NamedCause("unmodelled", what, "take it out of their readings", _items(names, "1", b, u))

    return naming


def of_wandering(biases: str, course: Array) -> Naming:
    """Biases ``ka0`` or ``kg0`` that wander along the columns of a ``course`` (blocks, k)."""

    def naming(b: Array, u: Array) -> NamedCause:
        unit, size = shown_unit(UNIT_OF[f"{biases}_x"])
        spread = np.ptp(course @ b.reshape(course.shape[1], -1), axis=0)
        worst = int(np.argmax(spread))
        sentence = f"{WANDERING[biases]}, {biases}_{'xyz'[worst]} by {spread[worst] / size:.2g} {unit}"
        return NamedCause("unmodelled", sentence, "name bias_walk, or temperature, in states under [model]")

    return naming


def _largest(names: Sequence[str], unit: str, b: Array, u: Array) -> str:
    """The parameter that is clearest, in words; all of them where none is clear by itself."""
    shown, size = shown_unit(unit)
    over = np.abs(b) / u
    worst = int(np.argmax(over))
    if not over[worst] > LIMITS.shown_sigmas:
        return f"all {len(names)} together"
    return f"{names[worst]} by {b[worst] / size:.3g} +- {u[worst] / size:.1g} {shown}"


def _items(names: Sequence[str], unit: str, b: Array, u: Array) -> tuple[Mapping[str, str | float], ...]:
    """Parameters with their values, as rows of a table."""
    shown, size = shown_unit(unit)
    return tuple(
        {"error": name, "value": value / size, "u": of / size, "unit": shown}
        for name, value, of in zip(names, b.tolist(), u.tolist(), strict=True)
    )
