"""The one table of states that an estimator of a platform may have: names, priors, meaning, source.

A platform is described by one array of all parameters, the *full vector* (K,), in the order of `ALL`: the 24 of
`inercal.systems.selfcal.platform.coefficients`, in the linear form, then those of the rig. An estimator has some of
them as states; the others stay at the values that the study states, 0 if it is silent.

What each state does, and its derivative, is `inercal.systems.selfcal.platform.model`.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.instruments.terms import term
from inercal.foundation.units import parse_quantity
from inercal.systems.selfcal.platform.layout import Entry, StateLayout, by_axis, entries, layout_of


class StateKind(NamedTuple):
    """States of one kind: their ``parameters``, ``dimension`` of a quantity, usual ``prior``, an ``example``, the
    meaning in ``words``, where it ``enters`` the model (`inercal.systems.selfcal.platform.layout.entries`), the ``key``
    of a study, and the ``source`` of the equation."""

    parameters: tuple[str, ...]
    dimension: str
    prior: str
    example: str
    words: str
    enters: str
    key: str = ""
    source: str = ""

    @property
    def usual(self) -> float:
        """Their usual prior [SI]."""
        return parse_quantity(self.prior, self.dimension, self.words).value

    @property
    def unit(self) -> str:
        """Their SI unit, that of the one table of terms."""
        of = term(self.parameters[0])
        assert of is not None
        return of.unit_for("rad/s")  # of the gyros


def _by_axis(name: str) -> tuple[str, str, str]:
    """Parameters of the axes x, y, z."""
    return f"{name}_x", f"{name}_y", f"{name}_z"


_CHAIN = (
    "R. Paul, Robot Manipulators, MIT Press (1981): a chain of turns, each axis turned against the one before"
)
_DELAY = "J. Kelly, G. S. Sukhatme, A general framework for temporal calibration, ISER 2010: delays as states"
_MARKOV = "A. Gelb (editor), Applied Optimal Estimation, MIT Press (1974), section 3.8: exponentially correlated errors"
_WARM = "IEEE Std 952 and 1293: coefficients of temperature"
_IEEE_1293 = "IEEE Std 1293: model equation of a linear accelerometer"

STATES: Final[Mapping[str, StateKind]] = {
    "kg0": StateKind(_by_axis("kg0"), "rate", "0.3 deg/h", "0.08 deg/h", "gyro biases", "core"),
    "eta": StateKind(
        ("eta_pz", "eta_oy", "eta_oz"), "angle", "300 arcsec", "60 arcsec",
        "misalignments eta of accelerometers, pz, oy, oz", "core",
    ),
    "ds": StateKind(_by_axis("ds"), "angle", "300 arcsec", "60 arcsec", "misalignments ds of gyros", "core"),
    "do": StateKind(_by_axis("do"), "angle", "300 arcsec", "60 arcsec", "misalignments do of gyros", "core"),
    "ka0": StateKind(_by_axis("ka0"), "acceleration", "500 ug", "100 ug", "accelerometer biases", "core"),
    "ka1": StateKind(_by_axis("ka1"), "number", "1500 ppm", "500 ppm", "accelerometer scale errors", "core"),
    "kg1": StateKind(
        _by_axis("kg1"), "number", "100 ppm", "10 ppm", "gyro scale errors, in the extended model",
        by_axis("rate", "w_*"),
    ),
    "beta": StateKind(
        _by_axis("beta"), "angle", "60 arcsec", "5 arcsec",
        "the encoders' zero, in the extended model", "base",
    ),
    "gamma": StateKind(
        _by_axis("gamma"), "angle", "20 arcsec", "0(20) arcsec",
        "turn of the sensors' axes p against the last gimbal, about the axes of p", "mount", "gamma", _CHAIN,
    ),
    "non_orthogonality": StateKind(
        ("nonorth_xy", "nonorth_yz"), "angle", "20 arcsec", "0(20) arcsec",
        "inner axis against the outer, turned about the last at zero angles; last axis against the inner, turned "
        "about the outer", "link", "non_orthogonality", _CHAIN,
    ),
    "zero_y": StateKind(
        ("zero_y",), "angle", "20 arcsec", "0(20) arcsec",
        "reading of the inner encoder where the joint is at zero", "angle y 1", "zero_y", _CHAIN,
    ),
    "delay": StateKind(
        ("tau_enc", "tau_a"), "time", "5 ms", "0(5) ms",
        "time by which encoders, accelerometers are late against the rates, measured or commanded", "delay", "delay",
        _DELAY,
    ),
    "k2": StateKind(
        _by_axis("K2"), "quadratic", "20 ug/g^2", "0(20) ug/g^2",
        "second-order coefficients of accelerometers", by_axis("output", "s2_*"), "k2", _IEEE_1293,
    ),
    "levers": StateKind(
        tuple(f"r_{i}{j}" for i in "xyz" for j in "xyz"), "length", "50 mm", "0(50) mm",
        "place of accelerometer x, y, z in p from the centre of the gimbals, along x, y, z",
        "force " + ", ".join(f"{i} ww_{i}{j}" for i in "xyz" for j in "xyz"), "levers",
        "centripetal acceleration w x (w x r) of textbooks on mechanics",
    ),
    "scale_asymmetry": StateKind(
        _by_axis("S_asym"), "number", "10 ppm", "0(10) ppm",
        "gyro scale for positive rates less that for negative ones", by_axis("rate", "|w_*|/2"), "scale_asymmetry",
        "IEEE Std 952: scale-factor asymmetry",
    ),
    "g_sensitivity": StateKind(
        tuple(f"G_{i}{j}" for i in "xyz" for j in "xyz"), "rate by force", "0.02 deg/h/g",
        "0(0.02) deg/h/g", "drift of gyro x, y, z per specific force along x, y, z",
        "rate " + ", ".join(f"{i} f_{j}" for i in "xyz" for j in "xyz"), "g_sensitivity",
        "IEEE Std 952: acceleration-sensitive drift",
    ),
    "sag": StateKind(
        _by_axis("sag"), "angle by force", "2 arcsec/g", "0(2) arcsec/g",
        "elastic turn of the sensors on the platform per specific force, by a mass off the centre along x, y, z",
        "bend", "sag", "Hooke's law",
    ),
    "kg0_T1": StateKind(
        tuple(f"kg0_{i}_T1" for i in "xyz"), "rate by temperature", "0.02 deg/h/K", "0(0.02) deg/h/K",
        "gyro biases per kelvin", by_axis("rate", "warm"), "kg0_T1", _WARM,
    ),
    "ka0_T1": StateKind(
        tuple(f"ka0_{i}_T1" for i in "xyz"), "acceleration by temperature", "50 ug/K", "0(50) ug/K",
        "accelerometer biases per kelvin", by_axis("output", "warm"), "ka0_T1", _WARM,
    ),
    "ka1_T1": StateKind(
        tuple(f"ka1_{i}_T1" for i in "xyz"), "number by temperature", "20 ppm/K", "0(20) ppm/K",
        "accelerometer scale errors per kelvin", by_axis("output", "warm_*"), "ka1_T1", _WARM,
    ),
    "harmonics": StateKind(
        tuple(f"harmonic_{k}_{part}" for k in range(1, 13) for part in ("sin", "cos")), "angle", "5 arcsec",
        "0(5) arcsec", "errors of the encoders that repeat with their angle, sine and cosine part of each, in the "
        "order of the study, or orders 1 and 2 of th_x, th_y, th_z", "waves", "harmonics",
        "eccentric and elliptic circles of textbooks on surveying instruments",
    ),
    "gyro_walk": StateKind(
        _by_axis("kg0_walk"), "rate", "0.0005 deg/h", "0.0005 deg/h",
        "gyro biases at the last row, less their means kg0", by_axis("rate", "1"), source=_MARKOV,
    ),
    "accelerometer_walk": StateKind(
        _by_axis("ka0_walk"), "acceleration", "1.9 ug", "1.9 ug",
        "accelerometer biases at the last row, less their means ka0", by_axis("output", "1"), source=_MARKOV,
    ),
}  # fmt: skip
"""Name of a kind -> its states; the first six are the paper's, the next two the extended model's. The last two change
with time: an estimator without them has the same states before."""

ALL: Final[tuple[str, ...]] = tuple(name for state in STATES.values() for name in state.parameters)
"""Names of the full vector, in order."""

UNIT_OF: Final[Mapping[str, str]] = {
    name: state.unit for state in STATES.values() for name in state.parameters
}
"""SI unit of each parameter."""

KIND_OF: Final[Mapping[str, str]] = {
    name: kind for kind, state in STATES.items() for name in state.parameters
}
"""Kind that each parameter belongs to."""

PAPER: Final[tuple[str, ...]] = tuple(STATES)[:6]
EXTENDED_MODEL: Final[tuple[str, ...]] = tuple(STATES)[:8]
TEMPERATURE: Final[tuple[str, ...]] = ("kg0_T1", "ka0_T1", "ka1_T1")
BIAS_WALK: Final[tuple[str, ...]] = ("gyro_walk", "accelerometer_walk")
RIG: Final[tuple[str, ...]] = (*EXTENDED_MODEL, "gamma", "non_orthogonality", "zero_y", "delay")

WORDS: Final[Mapping[str, tuple[str, ...]]] = {"paper": PAPER, "extended": EXTENDED_MODEL, "rig": RIG}
"""Word for a set of states -> their kinds."""

ADDED: Final[Mapping[str, tuple[str, ...]]] = {
    kind: (kind,) for kind, state in STATES.items() if state.key and kind not in TEMPERATURE
} | {"temperature": TEMPERATURE, "bias_walk": BIAS_WALK}
"""Additions to such a set -> their kinds."""

LEFT_OUT: Final = tuple(kind for kind, state in STATES.items() if state.key)
"""Kinds of errors of the rig that a study may leave out of the states."""

USUAL_WAVES: Final = tuple((joint, order) for joint in range(3) for order in (1, 2))
"""Joint and order of harmonics where the study names none."""

MOST_WAVES: Final = len(STATES["harmonics"].parameters) // 2

RIG_BEGINS: Final = ALL.index("gamma_x")
"""Place in the full vector from which on parameters are those of the rig."""

BETA: Final = ALL.index("beta_x")
GAMMA: Final = ALL.index("gamma_x")
TAU: Final = ALL.index("tau_enc")
LEVER: Final = ALL.index("r_xx")
SAG: Final = ALL.index("sag_x")
WAVE: Final = ALL.index("harmonic_1_sin")
WALK: Final = ALL.index("kg0_walk_x")
"""Place of each kind in the full vector, as kernels take it; of delays encoder, accelerometer; of harmonics a sine and
a cosine of each; of walks gyros, accelerometers."""

ENTRY_OF: Final[Mapping[str, Entry]] = {
    name: entry
    for state in STATES.values()
    for name, entry in zip(state.parameters, entries(state.enters, len(state.parameters)), strict=True)
}
"""The entry of each parameter of the full vector."""


@dataclass(frozen=True, eq=False)
class StateVector:
    """States of an estimator: their ``names``, the ``stated`` (K,) full vector of what is not estimated, joint and
    order of each of the ``harmonics``; joints 0, 1, 2 that are ``fixed`` and have no encoder."""

    names: tuple[str, ...]
    stated: Array
    harmonics: tuple[tuple[int, int], ...] = USUAL_WAVES
    fixed: tuple[int, ...] = ()

    @property
    def index(self) -> NDArray[np.int64]:
        """(p,) places in the full vector."""
        return np.array([ALL.index(name) for name in self.names], dtype=np.int64)

    @cached_property
    def layout(self) -> StateLayout:
        """The same for kernels."""
        return layout_of(tuple(ENTRY_OF.values()), self.index, self.stated, self.harmonics, self.fixed, WALK)

    def full(self, c: Array) -> Array:
        """The full vector (K,) of states ``c`` (p,), linear form."""
        whole = self.layout.stated.copy()
        whole[self.layout.chosen] = c
        return whole

    @cached_property
    def walks(self) -> NDArray[np.bool_]:
        """(p,) true of states that change with time."""
        return self.index >= WALK

    @property
    def without_walks(self) -> StateVector:
        """The states that are constant."""
        return replace(self, names=tuple(name for name in self.names if ALL.index(name) < WALK))

    @property
    def of_rig(self) -> bool:
        """True where there are states of the rig, or stated values of them."""
        return bool((self.index >= RIG_BEGINS).any() or self.stated[RIG_BEGINS:].any())

    def has(self, kind: str) -> bool:
        """True where all parameters of a kind are states."""
        return set(STATES[kind].parameters) <= set(self.names)


#: joint 0, 1, 2 -> parameters that nobody can tell, where it stands still, from those of another kind
_TWINS: Final[tuple[Mapping[str, str], ...]] = (
    {"nonorth_xy": "beta", "zero_y": "beta"},
    {"nonorth_xy": "gamma", "nonorth_yz": "beta"},
    {"nonorth_yz": "gamma", "zero_y": "gamma"},
)


def twins(kinds: Sequence[str], still: Sequence[int], axes: Sequence[int]) -> dict[str, str]:
    """Parameters of some kinds that are left out where joints ``still`` (0 outer, 1 inner, 2 platform) do not turn, and
    the kind that each cannot be told from; ``axes`` (3,) of p that the joints lie along, or nearest to.

    A turn between two joints that move not against each other is one of gamma, or of beta. Where one joint alone turns,
    a turn about it of all that it carries is one of what carries it: gamma about its axis is left out.
    """
    left = {name: twin for joint in still for name, twin in _TWINS[joint].items() if twin in kinds}
    if len(still) == 2 and {"gamma", "beta"} <= {*kinds}:
        (moving,) = {0, 1, 2} - {*still}
        left |= {"nonorth_xy": "beta" if moving else "gamma", "zero_y": "beta"}
        left |= {
            "nonorth_yz": "beta" if moving == 2 else "gamma",
            STATES["gamma"].parameters[axes[moving]]: "beta",
        }
    return {name: left[name] for name in ALL if name in left and KIND_OF[name] in kinds}


def state_vector(
    kinds: Sequence[str],
    stated: Array | None = None,
    left_out: Sequence[str] = (),
    harmonics: tuple[tuple[int, int], ...] = USUAL_WAVES,
    fixed: tuple[int, ...] = (),
) -> StateVector:
    """The states of some kinds, in the order of the table, but those ``left_out`` and harmonics that are not named, of
    a rig with joints that are ``fixed``."""
    without = {*left_out, *ALL[WAVE + 2 * len(harmonics) : WALK]}
    names = tuple(name for name in ALL if KIND_OF[name] in kinds and name not in without)
    return StateVector(names, np.zeros(len(ALL)) if stated is None else stated, harmonics, fixed)
