"""A test before it is made, in Python: the uncertainties that its plan makes expect, and where it stops."""

from __future__ import annotations

from inercal.faces.python.study import Study
from inercal.foundation.arrays import Array
from inercal.foundation.designs.foresight import Foresight
from inercal.foundation.errors import StudyError
from inercal.systems.listed import SYSTEMS

PLANNED = tuple(kind for kind, system in SYSTEMS.items() if system.foresight)
"""Kinds of study that plan a test."""


def foresight(study: Study) -> Foresight:
    """Uncertainties that the plan of a study makes expect. Raises `StudyError` for a study without one."""
    if (found := study.system.foresight) is None:
        raise _without_plan(study)
    with study.at_fault():
        return found(study.settings)


def verticals(study: Study) -> Array:
    """Directions (r, 3) of the vertical on the instrument at each stop that a study plans; none of a model in motion.

    Raises `StudyError` for a study without a plan.
    """
    if (found := study.system.verticals) is None:
        raise _without_plan(study)
    with study.at_fault():
        return found(study.settings)


def _without_plan(study: Study) -> StudyError:
    """The refusal of a study that plans no test."""
    return StudyError(study.path or "study", f"found the kind {study.kind}, expected one with a plan")
