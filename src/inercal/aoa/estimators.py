"""The estimators of the angle: their choices and words; light, as ``--help`` reads it."""

from __future__ import annotations

from typing import Final, Literal, get_args

States = Literal[8, 11, 15, 19]

STATES: Final[tuple[States, ...]] = get_args(States)
"""Sizes of the fusion's state for three accelerometers, the smallest first."""

Static = Literal["segmented", "complementary", "improved"]
STATICS: Final[tuple[Static, ...]] = get_args(Static)
Centrifugal = Literal["none", "low-pass", "mechanical", "decision"]
Tangential = Literal["none", "differentiated", "dual"]
