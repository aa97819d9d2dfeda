"""A chain of a study's own: its joints, fixed turns and errors, base first."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Annotated, Literal

from pydantic import Field, model_validator

from inercal.arrays import Array
from inercal.errors import StudyError
from inercal.geometry.rotations import Axis, elementary
from inercal.rigs.chain import Chain, Element, Error, Fixed, Joint, Scope
from inercal.studies.fields import QuantityText, refusal
from inercal.studies.rig_errors import EXPECTED, NamedErrorTable, Place, elements_of
from inercal.units import Quantity

JOINTS = ("phi1", "phi2", "phi3")
"""Names that the joints of a chain have, base first: those of the angles in a record."""

Turn = Annotated[Quantity, QuantityText("angle", "90 deg")]


class ElementTable(NamedErrorTable):
    """An element of a chain: a joint, a fixed turn, or an error with its distribution."""

    joint: Literal["phi1", "phi2", "phi3"] | None = Field(
        default=None, description="a commanded angle; the record has it by this name"
    )
    turn: Turn | None = Field(default=None, description="a known, fixed angle")
    error: str | None = Field(default=None, description="name of an error", examples=["sag_x"], max_length=40)
    axis: Literal["x", "y", "z"] = Field(
        description="axis, of the frame that the elements before have reached, about which it turns"
    )
    what: str = Field(default="", description="the error in words", max_length=120)

    @model_validator(mode="after")
    def _one_kind(self) -> ElementTable:
        """Refuse elements of two kinds or none, and keys that say nothing of theirs."""
        kinds = [name for name in ("joint", "turn", "error") if getattr(self, name) is not None]
        if len(kinds) != 1:
            raise refusal(f"found {' and '.join(kinds) or 'none'}, expected one of joint, turn and error")
        if self.error is None:
            beside = sorted(self.model_fields_set - {*kinds, "axis"})
            if beside:
                raise refusal(f"{beside[0]}: found with a {kinds[0]}, expected it with an error only")
        elif not re.fullmatch(r"[A-Za-z]\w*", self.error):
            raise refusal(f"error: found {self.error!r}, expected a name of letters, digits and _")
        if self.turn is not None and self.turn.u > 0.0:
            raise refusal("turn: found an uncertainty, expected it as an error with a value beside the turn")
        return self


def custom_chain(
    elements: Sequence[ElementTable], base: Sequence[float], mounting: Array | None, key: str, where: object
) -> Chain:
    """The chain of a study, its known attitude of the base [rad] before it, the instrument's ``mounting`` after it.

    Raises
    ------
    StudyError
        No joint, joints that are not phi1, phi2, phi3 in order, an error without a distribution, a name twice.
    """
    joints = [element.joint for element in elements if element.joint is not None]
    if not joints or joints != list(JOINTS[: len(joints)]):
        raise StudyError(
            where, f"{key}: found the joints {', '.join(joints) or 'none'}, expected phi1, then phi2, phi3"
        )
    made: list[Element] = []
    if any(base):
        azimuth, north, west = base
        made.append(Fixed(elementary("z", azimuth) @ elementary("x", north) @ elementary("y", west)))
    jointed = False
    for k, element in enumerate(elements):
        axis: Axis = element.axis
        if element.joint is not None:
            made.append(Joint(element.joint, axis))
            jointed = True
        elif element.turn is not None:
            made.append(Fixed(elementary(axis, element.turn.value)))
        else:
            made += _errors(element, axis, jointed, f"{key}.{k}", where)
    if mounting is not None:
        made.append(Fixed(mounting))
    try:
        return Chain(tuple(made))
    except ValueError as problem:
        raise StudyError(where, f"{key}: {problem}") from problem


def _errors(element: ElementTable, axis: Axis, jointed: bool, key: str, where: object) -> list[Element]:
    """Everything that is stated of an error."""
    assert element.error is not None
    distribution = element.distribution()
    if distribution is None and not element.measured:
        raise StudyError(where, f"{key}: found no distribution, expected {EXPECTED}, or what is measured")
    made = elements_of(element, Place(element.error, axis, element.what, jointed, key, where))
    if distribution is not None:
        scope = Scope.RIG if element.scope is None else Scope(element.scope)
        if scope is Scope.ANGLE and not jointed:
            raise StudyError(
                where, f'{key}.scope: found "angle" before the first joint, expected another scope'
            )
        made.append(Error(element.error, axis, distribution, scope, element.what))
    return made
