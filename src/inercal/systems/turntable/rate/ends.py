"""Errors that follow the angle of the turning joint, in a rate test: their difference between the ends of a stay.

A joint that errs by e(phi) turns from phi_0 to phi_1 by ``phi_1 - phi_0 + e(phi_1) - e(phi_0)``: its mean rate is off
by the difference over the time of the stay. Over whole turns nothing is left of it, over an arc of 30 deg in a minute
10 arcsec are 90 ppm. Against the Earth such errors average out over a turn, and are left out.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.rigs.chain import Chain, Element, Error, Joint, Scope, follows_angle
from inercal.foundation.rigs.patterns import Known, Numbers, commanded


@dataclass(frozen=True, eq=False)
class End:
    """An ``error`` that follows the turning joint: change (n, q) of the mean rates [rad/s] on an axis by one unit
    [rad] of each of its q values, and the ``numbers`` (2, n) of its values where the stays begin and end."""

    error: Error
    change: Array
    numbers: Numbers


def settled(chain: Chain, joint: str, angles: Array) -> Chain:
    """The chain of a rate test about ``joint`` without what follows the angle of that joint.

    Errors keep their places. One of scope ``angle`` is new at each stay if it belongs to the turning joint, and
    constant if it belongs to one that stands.
    """
    elements: list[Element] = []
    following = False
    still = dict(zip(chain.factors, chain.groups(angles), strict=True))
    for element in chain.elements:
        if isinstance(element, Joint):
            following = element.name == joint
        if isinstance(element, Known) and following:
            elements.append(replace(element, parts=()))
            continue
        if not isinstance(element, Error) or not follows_angle(element):
            elements.append(element)
            continue
        if following:
            lost = element.pattern is not None
            law = element.distribution.scaled(0.0) if lost else element.distribution
            scope = Scope.POSITION if element.scope is Scope.ANGLE else element.scope
            elements.append(replace(element, distribution=law, pattern=None, scope=scope))
        elif element.scope is Scope.ANGLE:
            numbers = still[element.name]
            scope = Scope.POSITION if 1 < len(np.unique(numbers)) == len(numbers) else Scope.RIG
            elements.append(replace(element, scope=scope))
        else:
            elements.append(element)
    return Chain(tuple(elements))


def ends(chain: Chain, joint: str, angles: Array, turn: Array, duration: float, axis: Array) -> Iterator[End]:
    """Errors that follow the turning joint, over stays that begin at ``angles`` (n, joints) and turn by ``turn`` (n,)
    [rad] in ``duration`` [s], as a gyro along ``axis`` (3,) senses them."""
    place = chain.joints.index(joint)
    begin, end = angles[:, place], angles[:, place] + turn
    along = _axes(chain, angles) @ axis
    for k, (error, own) in enumerate(zip(chain.errors, chain.joint_of, strict=True)):
        if own != place or not follows_angle(error):
            continue
        sizes = [np.ones(len(begin)) if error.pattern is None else error.pattern(at) for at in (begin, end)]
        numbers = (
            commanded(np.concatenate([begin, end])).reshape(2, -1)
            if error.scope is Scope.ANGLE
            else np.zeros((2, len(begin)), dtype=np.int64)
        )
        each = np.arange(int(numbers.max()) + 1)
        before, after = (
            size[:, None] * (number[:, None] == each) for size, number in zip(sizes, numbers, strict=True)
        )
        yield End(error, along[:, k, None] * (after - before) / duration, numbers)


def known_change(chain: Chain, joint: str, angles: Array, turn: Array, duration: float, axis: Array) -> Array:
    """Change (n,) of the mean rates [rad/s] by what is known of the errors that follow the turning joint."""
    place, before = chain.joints.index(joint), -1
    begin, end = angles[:, place], angles[:, place] + turn
    total = np.zeros(len(angles))
    for element in chain.elements:
        before += isinstance(element, Joint)
        if isinstance(element, Known) and before == place:
            along = _axis_of(chain, element, angles) @ axis
            total += along * (element.at(end) - element.at(begin)) / duration
    return total


def _axes(chain: Chain, angles: Array) -> Array:
    """Axes (n, k, 3) of the errors on the instrument's axes, whatever their patterns."""
    plain = chain.with_errors(*(replace(error, pattern=None) for error in chain.errors))
    turned = np.swapaxes(plain.attitude(angles), -1, -2)[:, None] @ plain.slopes(angles)
    return np.stack([turned[..., 2, 1], turned[..., 0, 2], turned[..., 1, 0]], axis=-1)


def _axis_of(chain: Chain, known: Known, angles: Array) -> Array:
    """Axis (n, 3) of a known error on the instrument's axes."""
    k = chain.elements.index(known)
    after = Chain(tuple(e for e in chain.elements[k + 1 :] if not (isinstance(e, Known | Error))))
    own = angles[:, len(chain.joints) - len(after.joints) :]
    return np.asarray(np.eye(3)["xyz".index(known.axis)] @ after.attitude(own))
