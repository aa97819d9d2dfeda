"""Tables of a study by groups of coefficients and kinds of errors of the rig: prior, goal, truth, model, true errors.

Their keys follow from the one table of states.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Final, Literal

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.errors import InputError, StudyError
from inercal.foundation.keys import (
    ANYTHING,
    REQUIRED,
    Bounds,
    Reading,
    above_zero,
    keyed,
    option,
    quantity,
    table,
    within,
)
from inercal.foundation.units import Quantity, shown
from inercal.systems.selfcal.estimators import ESTIMATORS
from inercal.systems.selfcal.platform.coefficients import BETA, EXTENDED, GROUPS
from inercal.systems.selfcal.platform.rig import Base
from inercal.systems.selfcal.platform.states import (
    ADDED,
    ALL,
    EXTENDED_MODEL,
    MOST_WAVES,
    PAPER,
    RIG,
    RIG_BEGINS,
    STATES,
    USUAL_WAVES,
    WORDS,
)
from inercal.systems.selfcal.settings import Filter, PlatformStates

_KINDS = tuple(kind for kind, state in STATES.items() if state.key and kind != "harmonics")

#: key of a study -> parameters that it states
_DELAYS = {"delay_encoder": ("tau_enc",), "delay_accelerometer": ("tau_a",)}

_ANGLE = within(-math.radians(10.0), math.radians(10.0), "an angle within 10 deg")
_TIME = within(-60.0, 60.0, "a time within 60 s")

#: dimension -> values that are believed of a coefficient
_OF_COEFFICIENTS = {"angle": _ANGLE, "number": within(-0.5, 0.5, "a scale error within 0.5")}

#: dimension -> values that are believed of an error of the rig
_BELIEVED: Final[Mapping[str, Bounds]] = {
    "angle": _ANGLE,
    "time": _TIME,
    "length": within(-100.0, 100.0, "a length within 100 m"),
    "number": within(-0.5, 0.5, "a number within 0.5"),
    "quadratic": within(-0.01, 0.01, "a coefficient within 0.1 g/g^2"),
    "rate by force": within(-5e-3, 5e-3, "a drift within 3 deg/s/g"),
    "angle by force": within(-0.02, 0.02, "a turn within 10 deg/g"),
    "rate by temperature": within(-0.02, 0.02, "a drift within 1 deg/s/K"),
    "acceleration by temperature": within(-0.1, 0.1, "a drift within 10 mg/K"),
    "number by temperature": within(-0.01, 0.01, "a change within 1 %/K"),
}

Three = tuple[float, float, float] | None


def _of_group(group: str, says: str, bounds: Bounds, one: bool) -> tuple[Any, Any]:
    """Type and field of three quantities of a group, or ``one`` for all."""
    state = STATES[group]
    example = state.example if one else [state.example] * 3
    ends = ", ".join(GROUPS[group][0])
    return Three, quantity(says, state.dimension, None, example=example, bounds=bounds, of=ends, one=one)


def _deviations(what: str, note: str) -> dict[str, tuple[Any, Any]]:
    """Fields of one standard deviation for each group, or three; ``note`` on what absent ones mean."""
    return {
        group: _of_group(
            group,
            f"of {STATES[group].words}; {note.format(STATES[group].prior)} if absent",
            above_zero(what),
            True,
        )
        for group in GROUPS
    }


class PriorDeviations(keyed("ByGroup", _deviations("a standard deviation", "{}"))):  # type: ignore[misc]
    """Standard deviations of the coefficients about 0 before the test: one for a group, or three.

    To that of the encoders' zero the uncertainties of heading and tilt are added.
    """

    def of(self, base: Base) -> Array:
        """(24,) standard deviations; that of beta with the uncertainty of the base, about the axes of b."""
        prior = np.concatenate([getattr(self, group) or (STATES[group].usual,) * 3 for group in GROUPS])
        (north, east), up = base.tilt_u, base.heading_u
        prior[BETA] = np.sqrt(prior[BETA] ** 2 + base.from_geographic() ** 2 @ np.square([north, east, up]))
        return prior


class Goal(keyed("Wanted", _deviations("a standard uncertainty", "no goal"))):  # type: ignore[misc]
    """Wanted standard uncertainties: one for a group, or three."""

    @property
    def by_name(self) -> dict[str, float]:
        """Those stated, by name of coefficient."""
        return {
            name: value
            for k, group in enumerate(GROUPS)
            for name, value in zip(EXTENDED[3 * k :], getattr(self, group) or (), strict=False)
        }


_TRUE = {
    group: _of_group(
        group,
        f"{STATES[group].words}; 0 if absent",
        _OF_COEFFICIENTS.get(STATES[group].dimension, ANYTHING),
        False,
    )
    for group in GROUPS
}


class TrueCoefficients(keyed("TrueValues", _TRUE)):  # type: ignore[misc]
    """True coefficients of a simulation, in the product form, three of each group."""

    @property
    def values(self) -> Array:
        """(24,) all of them."""
        return np.concatenate([getattr(self, group) or (0.0,) * 3 for group in GROUPS])


def _keys() -> Iterator[tuple[str, str, tuple[str, ...]]]:
    """Key, kind and parameters of what a study may state of the rig."""
    for kind in _KINDS:
        if kind == "delay":
            yield from ((key, kind, names) for key, names in _DELAYS.items())
        else:
            yield STATES[kind].key, kind, STATES[kind].parameters


def _of_rig(says: str, true: bool, hint: Any) -> dict[str, tuple[Any, Any]]:
    """Fields of one quantity for each parameter of a key, or one for all; examples without u of ``true`` ones."""
    fields = {}
    for key, kind, names in _keys():
        state = STATES[kind]
        example = state.example.replace("0(", "").replace(")", "") if true else state.example
        field = quantity(
            says.format(words=state.words, prior=state.prior), state.dimension, None, example=example,
            bounds=_BELIEVED[state.dimension], of=", ".join(names), one=True,
        )  # fmt: skip
        fields[key] = (hint, field)
    return fields


_TRUE_OF_RIG = _of_rig("{words}; 0 if absent", True, tuple[float, ...] | None)
_LATE = quantity(
    "by which rates, or the log of commands, are late: the same as encoders and accelerometers early",
    "time", None, example="5 ms", bounds=_TIME,
)  # fmt: skip


class TrueErrors(keyed("OnRig", _TRUE_OF_RIG | {"delay_gyro": (float | None, _LATE)})):  # type: ignore[misc]
    """True errors of the rig, for simulations."""

    @property
    def values(self) -> Array:
        """(K - 24,) true errors of the rig; nothing where there are none. Late rates are encoders and accelerometers
        that are early."""
        true = np.zeros(len(ALL))
        for key, _, names in _keys():
            if (given := getattr(self, key)) is not None:
                true[[ALL.index(name) for name in names]] = given
        true[[ALL.index("tau_enc"), ALL.index("tau_a")]] -= self.delay_gyro or 0.0
        return true[RIG_BEGINS:] if true.any() else true[:0]


@dataclass(frozen=True)
class StatedHarmonic:
    """An error of an encoder that repeats with its angle: a sin(order th) + b cos(order th)."""

    axis: Literal["x", "y", "z"] = option("the joint")
    order: int = option("periods in a full turn", least=1, most=100_000)
    amplitude: Quantity = quantity(
        "0 with the standard uncertainty of a, and of b", "angle", REQUIRED, example="0(5) arcsec"
    )

    def __post_init__(self) -> None:
        """Refuse a value, and an amplitude that is exact."""
        if self.amplitude.value != 0.0 or self.amplitude.u == 0.0:
            text = f"found {shown(self.amplitude.text)}, expected 0 with an uncertainty, such as 0(5) arcsec"
            raise InputError("amplitude", text)


def _states(typed: object) -> tuple[str, ...]:
    """A word for a set of states, or a list of kinds that may begin with one; refuse anything else."""
    listed = typed if isinstance(typed, list) else [typed]
    words = ", ".join(f'"{word}"' for word in WORDS)
    first, *rest = listed or [None]
    if first not in (*WORDS, *ADDED) or (not isinstance(typed, list) and first not in WORDS):
        others = ", ".join(f'"{kind}"' for kind in ADDED)
        text = f"found {shown(typed)}, expected {words}, or a list that may begin with one, of {others}"
        raise InputError("states", text)
    for kind in rest:
        if kind not in ADDED:
            raise InputError("states", f"found {shown(kind)}, expected one of {', '.join(ADDED)}")
    if len(set(listed)) < len(listed):
        raise InputError("states", f"found {shown(typed)}, expected each kind once")
    return tuple(listed)


_PRIORS_OF_RIG = _of_rig(
    "{words}: prior of what is estimated, about the value; of what is not, considered in u; 0({prior}) if estimated "
    "and absent",
    False,
    tuple[Quantity, ...] | None,
)
_TEXTS = {"anyOf": [{"type": "string"}, {"items": {"type": "string"}, "type": "array"}]}


@dataclass(frozen=True)
class RigModel(keyed("StatedModel", _PRIORS_OF_RIG)):  # type: ignore[misc]
    """Errors of the rig: states that are estimated, and what is stated of those that are not."""

    states: tuple[str, ...] | None = option(
        "paper (18), extended (24), rig (extended, gamma, non_orthogonality, zero_y, delay), or a list that may begin "
        "with one of these, and goes on with kinds of this table, temperature (kg0_T1, ka0_T1, ka1_T1) or bias_walk, "
        "which map has not; rig if absent, paper for estimators that have no rig", None,
        example=["rig", "k2", "levers"], reads=Reading(_states, _TEXTS),
    )  # fmt: skip
    harmonics: tuple[StatedHarmonic, ...] = table(
        "errors of the encoders that repeat with their angle, up to 12: priors of what is estimated; of what is not, "
        "considered in u; orders 1 and 2 of each encoder, 0(5) arcsec, if estimated and absent", (),
        example=[{"axis": "z", "order": 1, "amplitude": "0(5) arcsec"}], most=MOST_WAVES,
    )  # fmt: skip

    def of(self, filter: Filter, where: object) -> PlatformStates:
        """The model for an estimator; without ``states`` that of the rig where it has it.

        Raises `StudyError` for states beside ``extended``, for an estimator that does not have them, and for one that
        is estimated without an uncertainty.
        """
        states = RIG if ESTIMATORS[filter.kind].rig and not filter.extended else None
        if self.states is not None:
            states = self._asked(filter, where)
        stated = {}
        for key, kind, names in _keys():
            for name, known in zip(names, getattr(self, key) or (), strict=False):
                if kind in (states or ()) and known.u == 0.0:
                    text = f"model.{key}: found {shown(known.text)} for a state that is estimated"
                    raise StudyError(
                        where, f"{text}, expected it with an uncertainty, such as {STATES[kind].example}"
                    )
                stated[name] = (known.value, known.u)
        waves = tuple(("xyz".index(wave.axis), wave.order) for wave in self.harmonics) or USUAL_WAVES
        if len(set(waves)) < len(waves):
            raise StudyError(where, "model.harmonics: found an order of a joint twice, expected each once")
        for k, wave in enumerate(self.harmonics):
            names = STATES["harmonics"].parameters[2 * k : 2 * k + 2]
            stated |= dict.fromkeys(names, (0.0, wave.amplitude.u))
        return PlatformStates(states, stated, harmonics=waves)

    def _asked(self, filter: Filter, where: object) -> tuple[str, ...]:
        """Kinds of the states that are asked for."""
        listed = self.states or ()
        if filter.extended:
            raise StudyError(where, "model.states: found it beside filter.extended, expected one of them")
        kinds = {kind for word in listed for kind in WORDS.get(word) or (*PAPER, *ADDED[word])}
        if filter.kind == "map" and "bias_walk" in listed:
            text = "model.states: found bias_walk for map, to which biases are constant, expected it without"
            raise StudyError(where, text)
        states = tuple(kind for kind in STATES if kind in kinds)
        beyond = [kind for kind in states if kind not in EXTENDED_MODEL]
        if beyond and not ESTIMATORS[filter.kind].rig:
            having = ", ".join(kind for kind, estimator in ESTIMATORS.items() if estimator.rig)
            raise StudyError(
                where,
                f"model.states: found {', '.join(beyond)} for {filter.kind}, which has none of them, expected "
                f'"paper" or "extended", or one of {having} under filter.kind',
            )
        return states
