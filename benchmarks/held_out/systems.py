"""The simulators by system and method."""

from __future__ import annotations

from importlib import import_module
from typing import Any

import numpy as np

from .kinds import Kind
from .trial import Act, Scene

METHODS = {
    ("turntable", "positions"): "positions",
    ("turntable", "rates"): "rates",
    ("turntable", "steps"): "steps",
    ("imu", "means"): "means",
    ("imu", "ferraris"): "ferraris",
    ("imu", "known_rates"): "known_rates",
    ("imu", "known_turns"): "known_turns",
    ("imu", "multiposition"): "hand",
    ("imu", "aided"): "aided",
    ("strapdown", "batch"): "unit",
    ("selfcal", "error-state"): "platform",
    ("aoa", "static"): "tunnel_static",
    ("aoa", "oscillating"): "tunnel_oscillating",
}
"""Module of each (system, method); it has `draw` and `FAULTS`."""


def module_of(system: str, method: str) -> Any:
    """The simulator of a method."""
    return import_module(f"{__package__}.{METHODS[system, method]}")


def scene_of(system: str, method: str, rng: np.random.Generator) -> Scene:
    """A rig, instrument and plan of a method, drawn."""
    scene: Scene = module_of(system, method).draw(rng)
    return scene


def fault_of(kind: Kind) -> tuple[Act, float]:
    """What a fault does, and a size to begin with."""
    nominal, act = module_of(kind.system, kind.method).FAULTS[kind.name]
    return act, nominal
