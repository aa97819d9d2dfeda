"""The estimators of the angle: their choices and words; light, as ``--help`` reads it.

`inercal.systems.aoa.estimation` holds what each computes.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, Literal, get_args

EstimatorKind = Literal["fusion", "paper"]

WORDS: Final[Mapping[EstimatorKind, str]] = {
    "fusion": "a filter of all sensors",
    "paper": "sample by sample, as [methods] says",
}

STREAMED: Final[tuple[EstimatorKind, ...]] = ("fusion",)
"""Estimators that streams have; files have all."""

States = Literal[8, 11, 15, 19]

STATES: Final[tuple[States, ...]] = get_args(States)
"""Sizes of the fusion's state for three accelerometers, the smallest first."""

Static = Literal["segmented", "complementary", "improved"]
STATICS: Final[tuple[Static, ...]] = get_args(Static)
Centrifugal = Literal["none", "low-pass", "mechanical", "decision"]
Tangential = Literal["none", "differentiated", "dual"]
