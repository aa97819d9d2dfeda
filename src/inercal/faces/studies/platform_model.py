"""The model of a platform in a study: which errors of the rig are states, and what is stated of them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BeforeValidator, Field, StrictInt, create_model

from inercal.faces.studies.fields import QuantityText, Several, SeveralTexts, refusal
from inercal.foundation._toml import Strict
from inercal.foundation.arrays import Array
from inercal.foundation.errors import StudyError
from inercal.foundation.units import Quantity, shown
from inercal.systems.selfcal.estimators import ESTIMATORS
from inercal.systems.selfcal.platform.states import (
    ADDED,
    ALL,
    EXTENDED_MODEL,
    MOST_WAVES,
    PAPER,
    RIG,
    STATES,
    USUAL_WAVES,
    WORDS,
)
from inercal.systems.selfcal.settings import PlatformStates

_KINDS = tuple(kind for kind, state in STATES.items() if state.key and kind != "harmonics")

#: key of a study -> parameters that it states
_DELAYS = {"delay_encoder": ("tau_enc",), "delay_accelerometer": ("tau_a",)}

#: largest value that is believed, and the same in words
_BELIEVED = {
    "angle": (math.radians(10.0), "an angle within 10 deg"),
    "time": (60.0, "a time within 60 s"),
    "length": (100.0, "a length within 100 m"),
    "number": (0.5, "a number within 0.5"),
    "quadratic": (0.01, "a coefficient within 0.1 g/g^2"),
    "rate by force": (5e-3, "a drift within 3 deg/s/g"),
    "angle by force": (0.02, "a turn within 10 deg/g"),
    "rate by temperature": (0.02, "a drift within 1 deg/s/K"),
    "acceleration by temperature": (0.1, "a drift within 10 mg/K"),
    "number by temperature": (0.01, "a change within 1 %/K"),
}


def _keys() -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Key, kind and parameters of what a study may state."""
    for kind in _KINDS:
        if kind == "delay":
            yield from ((key, kind, names) for key, names in _DELAYS.items())
        else:
            yield STATES[kind].key, kind, STATES[kind].parameters


def _texts(kind: str, names: tuple[str, ...], example: str) -> Any:
    """The type of one quantity for each of some parameters, or one for all."""
    limit, words = _BELIEVED[STATES[kind].dimension]
    each = QuantityText(STATES[kind].dimension, example, lambda value: abs(value) <= limit, words)
    return Annotated[Several | None, SeveralTexts(each, ", ".join(names), one=True)]


def _stated() -> dict[str, Any]:
    """Fields of what is known of the rig before a test."""
    return {
        key: (
            _texts(kind, names, STATES[kind].example),
            Field(
                default=None,
                description=f"{STATES[kind].words}: prior of what is estimated, about the value; of what is not, "
                f"considered in u; 0({STATES[kind].prior}) if estimated and absent",
            ),
        )
        for key, kind, names in _keys()
    }


def true_errors() -> dict[str, Any]:
    """Fields of true errors of the rig, for simulations."""
    fields: dict[str, Any] = {
        key: (
            _texts(kind, names, STATES[kind].example.replace("0(", "").replace(")", "")),
            Field(default=None, description=f"{STATES[kind].words}; 0 if absent"),
        )
        for key, kind, names in _keys()
    }
    late = QuantityText("time", "5 ms", lambda value: abs(value) <= 60.0, "a time within 60 s")
    says = "by which rates, or the log of commands, are late: the same as encoders and accelerometers early"
    return fields | {"delay_gyro": (Annotated[Quantity, late] | None, Field(default=None, description=says))}


def _kinds(typed: object) -> object:
    """Refuse anything but a word for a set of states, or a list of kinds that may begin with one."""
    listed = typed if isinstance(typed, list) else [typed]
    words = ", ".join(f'"{word}"' for word in WORDS)
    first, *rest = listed or [None]
    if first not in (*WORDS, *ADDED) or (not isinstance(typed, list) and first not in WORDS):
        others = ", ".join(f'"{kind}"' for kind in ADDED)
        raise refusal(
            f"found {shown(typed)}, expected {words}, or a list that may begin with one, of {others}"
        )
    for kind in rest:
        if kind not in ADDED:
            raise refusal(f"found {shown(kind)}, expected one of {', '.join(ADDED)}")
    if len(set(listed)) < len(listed):
        raise refusal(f"found {shown(typed)}, expected each kind once")
    return typed


_MODEL: Any = create_model("StatedModel", __base__=Strict, **_stated())


class StatedHarmonic(Strict):
    """An error of an encoder that repeats with its angle: a sin(order th) + b cos(order th)."""

    axis: Literal["x", "y", "z"] = Field(description="the joint")
    order: Annotated[StrictInt, Field(ge=1, le=100_000)] = Field(description="periods in a full turn")
    amplitude: Annotated[Quantity, QuantityText("angle", "0(5) arcsec")] = Field(
        description="0 with the standard uncertainty of a, and of b"
    )


class ModelTable(_MODEL):  # type: ignore[misc]
    """Errors of the rig: states that are estimated, and what is stated of those that are not."""

    states: Annotated[str | list[str], BeforeValidator(_kinds)] | None = Field(
        default=None,
        description="paper (18), extended (24), rig (extended, gamma, non_orthogonality, zero_y, delay), or a list "
        "that may begin with one of these, and goes on with kinds of this table, temperature (kg0_T1, ka0_T1, ka1_T1) "
        "or bias_walk, which map has not; rig if absent, paper for estimators that have no rig",
        examples=[["rig", "k2", "levers"]],
    )
    harmonics: list[StatedHarmonic] | None = Field(
        default=None,
        max_length=MOST_WAVES,
        description="errors of the encoders that repeat with their angle, up to 12: priors of what is estimated; of "
        "what is not, considered in u; orders 1 and 2 of each encoder, 0(5) arcsec, if estimated and absent",
        examples=[[{"axis": "z", "order": 1, "amplitude": "0(5) arcsec"}]],
    )


def model_of(table: Any, filter: Any, where: object) -> PlatformStates:
    """The model that a study states, without ``states`` that of the rig for estimators that have it.

    Raises `StudyError` for states beside ``extended``, for an estimator that does not have them, and for one that is
    estimated without an uncertainty.
    """
    states = RIG if ESTIMATORS[filter.kind].rig and not filter.extended else None
    if table.states is not None:
        if filter.extended:
            raise StudyError(where, "model.states: found it beside filter.extended, expected one of them")
        listed = table.states if isinstance(table.states, list) else [table.states]
        kinds = {kind for each in listed for kind in WORDS.get(each) or (*PAPER, *ADDED[each])}
        if filter.kind == "map" and "bias_walk" in listed:
            text = "model.states: found bias_walk for map, to which biases are constant, expected it without"
            raise StudyError(where, text)
        states = tuple(kind for kind in STATES if kind in kinds)
        beyond = [kind for kind in states if kind not in EXTENDED_MODEL]
        if beyond and not ESTIMATORS[filter.kind].rig:
            having = ", ".join(kind for kind, each in ESTIMATORS.items() if each.rig)
            raise StudyError(
                where,
                f"model.states: found {', '.join(beyond)} for {filter.kind}, which has none of them, expected "
                f'"paper" or "extended", or one of {having} under filter.kind',
            )
    stated = {}
    for key, kind, names in _keys():
        if (given := getattr(table, key)) is None:
            continue
        for name, each in zip(names, given.quantities, strict=True):
            if kind in (states or ()) and each.u == 0.0:
                text = f"model.{key}: found {shown(each.text)} for a state that is estimated"
                raise StudyError(
                    where, f"{text}, expected it with an uncertainty, such as {STATES[kind].example}"
                )
            stated[name] = (each.value, each.u)
    waves = tuple(("xyz".index(each.axis), each.order) for each in table.harmonics or ()) or USUAL_WAVES
    if len(set(waves)) < len(waves):
        raise StudyError(where, "model.harmonics: found an order of a joint twice, expected each once")
    for k, each in enumerate(table.harmonics or ()):
        if each.amplitude.value != 0.0 or each.amplitude.u == 0.0:
            text = f"model.harmonics.{k}.amplitude: found {shown(each.amplitude.text)}"
            raise StudyError(where, f"{text}, expected 0 with an uncertainty, such as 0(5) arcsec")
        for name in STATES["harmonics"].parameters[2 * k : 2 * k + 2]:
            stated[name] = (0.0, each.amplitude.u)
    return PlatformStates(states, stated, harmonics=waves)


def on_rig(table: Any) -> Array:
    """(K - 24,) true errors of the rig; nothing where there are none. Late rates are encoders and accelerometers that
    are early."""
    true = np.zeros(len(ALL))
    for key, _, names in _keys():
        if (given := getattr(table, key)) is not None:
            true[[ALL.index(name) for name in names]] = given.values
    if table.delay_gyro is not None:
        true[[ALL.index("tau_enc"), ALL.index("tau_a")]] -= table.delay_gyro.value
    return true[24:] if true.any() else true[:0]
