"""A test before it is made, in Python: the uncertainties that its plan makes expect, and where it stops."""

from __future__ import annotations

from importlib import import_module
from typing import Any

from inercal.arrays import Array
from inercal.designs.foresight import Foresight
from inercal.errors import StudyError
from inercal.face.study import Study

_WHERE = {
    "turntable": "inercal.turntable.positions.foresight",
    "selfcal": "inercal.selfcal.before.foresight",
    "strapdown": "inercal.strapdown.foresight",
    "aoa": "inercal.aoa.foresight",
}

PLANNED = tuple(_WHERE)
"""Kinds of study that plan a test."""


def foresight(study: Study) -> Foresight:
    """Uncertainties that the plan of a study makes expect. Raises `StudyError` for a study without one."""
    found: Foresight = _asked(study, "foresight")
    return found


def verticals(study: Study) -> Array:
    """Directions (r, 3) of the vertical on the instrument at each stop that a study plans; none of a model in motion.

    Raises `StudyError` for a study without a plan.
    """
    found: Array = _asked(study, "verticals")
    return found


def _asked(study: Study, what: str) -> Any:
    """The answer of the system of a study about its plan."""
    if study.kind not in _WHERE:
        raise StudyError(study.path or "study", f"found the kind {study.kind}, expected one with a plan")
    with study.at_fault():
        return getattr(import_module(_WHERE[study.kind]), what)(study.settings)
