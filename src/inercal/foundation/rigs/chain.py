"""A measuring rig as a kinematic chain, as data: fixed transforms, commanded joints, elementary errors.

From the base n (north, west, up) to the instrument b, each element turns (or shifts) the next frame::

    C_nb = M_1 M_2 ... M_m ,   columns of C_nb = axes of b in n,   row vectors multiply from the left

so that a reference u_n (gravity, earth rate) reads ``u_n C_nb`` on the instrument's axes. Rotations are the
elementary ones about x, y, z of the frame reached so far (`inercal.foundation.geometry.rotations.elementary`).
"""

from __future__ import annotations

import enum
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from inercal.foundation.arrays import Array
from inercal.foundation.geometry.rotations import Axis, elementary, skew
from inercal.foundation.inputs import Source
from inercal.foundation.rigs.patterns import Distribution, Known, Numbers, Pattern, commanded


class Scope(enum.Enum):
    """Time over which an error keeps its value, until it is drawn anew."""

    SAMPLE = "sample"
    POSITION = "position"
    ANGLE = "angle"
    RUN = "run"
    RIG = "rig"

    @property
    def constant(self) -> bool:
        """True if the error keeps one value throughout a test."""
        return self in (Scope.RUN, Scope.RIG)


@dataclass(frozen=True, eq=False)
class Fixed:
    """A known transform: ``rotation`` (3, 3), then ``offset`` (3,) [m] in the frame before it."""

    rotation: Array = field(default_factory=lambda: np.eye(3))
    offset: Array = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class Joint:
    """A commanded rotation about ``axis`` of the frame reached so far."""

    name: str
    axis: Axis


@dataclass(frozen=True)
class Error:
    """An elementary error: a small random rotation about ``axis``, or a shift along it.

    ``distribution`` [rad; m if ``is_offset``], ``scope`` how long a value lasts, ``what`` in words. With a ``pattern``,
    the error is the drawn value times the pattern at the angle of the joint before it. ``certificate`` says where its
    distribution is stated, if it was measured.
    """

    name: str
    axis: Axis
    distribution: Distribution
    scope: Scope
    what: str = ""
    is_offset: bool = False
    pattern: Pattern | None = None
    certificate: str = ""

    @property
    def source(self) -> str:
        """Its name in a budget: the certificate first, if there is one."""
        return f"{self.certificate}: {self.name}" if self.certificate else self.name


Element: TypeAlias = Fixed | Joint | Known | Error


@dataclass(frozen=True, eq=False)
class Chain:
    """An ordered list of elements, base first.

    Raises
    ------
    ValueError
        A joint or an error that occurs twice: one variable at two places is not covered. An error that follows the
        angle of a joint, before any joint.
    """

    elements: tuple[Element, ...]

    def __post_init__(self) -> None:
        """Refuse names that occur twice, and what follows the angle of no joint."""
        names = [element.name for element in self.elements if isinstance(element, Joint | Error)]
        twice = {name for name in names if names.count(name) > 1}
        if twice:
            raise ValueError(f"found {', '.join(sorted(twice))} twice, expected each name once in a chain")
        for element, joint in zip(self.elements, self._joint_before, strict=True):
            if joint < 0 and follows_angle(element):
                name = element.name if isinstance(element, Error) else "a known error"
                raise ValueError(f"{name} follows an angle, expected it after a joint")

    @cached_property
    def _joint_before(self) -> tuple[int, ...]:
        """Place among the joints of the last one up to each element; -1 before the first."""
        counts = np.cumsum([isinstance(element, Joint) for element in self.elements])
        return tuple((counts - 1).tolist())

    @cached_property
    def joints(self) -> tuple[str, ...]:
        """Names of the commanded angles, base first: the order of ``angles``."""
        return tuple(element.name for element in self.elements if isinstance(element, Joint))

    @cached_property
    def errors(self) -> tuple[Error, ...]:
        """The elementary errors, base first."""
        return tuple(element for element in self.elements if isinstance(element, Error))

    @cached_property
    def factors(self) -> tuple[str, ...]:
        """Names of the errors: the order of ``errors`` in every call and of every result."""
        return tuple(error.name for error in self.errors)

    @cached_property
    def std(self) -> Array:
        """Standard deviations (k,) of the errors [rad or m]."""
        return np.array([error.distribution.std for error in self.errors])

    def with_errors(self, *changed: Error) -> Chain:
        """The chain with errors of these names replaced; raises KeyError for a name it has not."""
        new = {error.name: error for error in changed}
        missing = sorted(new.keys() - set(self.factors))
        if missing:
            raise KeyError(missing[0])
        return Chain(tuple(new.get(e.name, e) if isinstance(e, Error) else e for e in self.elements))

    @cached_property
    def joint_of(self) -> tuple[int, ...]:
        """Place among the joints of the one before each error (k,), whose angle it may follow; -1 where none is."""
        pairs = zip(self.elements, self._joint_before, strict=True)
        return tuple(joint for element, joint in pairs if isinstance(element, Error))

    @property
    def sources(self) -> tuple[Source, ...]:
        """Files of measured errors."""
        return tuple(e.source for e in self.elements if isinstance(e, Known) and e.source is not None)

    @cached_property
    def followed(self) -> tuple[int, ...]:
        """Places of the joints whose angle a known error, or the size of an error, follows."""
        pairs = zip(self.elements, self._joint_before, strict=True)
        return tuple(sorted({joint for element, joint in pairs if _has_pattern(element)}))

    def sizes(self, angles: ArrayLike) -> Array:
        """Patterns (*batch, k) of the errors at ``angles`` (*batch, joints) [rad]; 1 where an error has none."""
        given, _ = self._checked(angles, None)
        sizes = np.ones((*given.shape[:-1], len(self.errors)))
        for k, (error, joint) in enumerate(zip(self.errors, self.joint_of, strict=True)):
            if error.pattern is not None:
                sizes[..., k] = error.pattern(given[..., joint])
        return sizes

    def standing(self, angles: ArrayLike) -> Chain:
        """The chain near one position (joints,) [rad], free of patterns.

        The errors are as wide as they are there, and what is known of them is a fixed rotation.
        """
        given, sizes = np.asarray(angles, dtype=float), self.sizes(angles)
        elements: list[Element] = []
        for element, joint in zip(self.elements, self._joint_before, strict=True):
            if isinstance(element, Known):
                elements.append(Fixed(elementary(element.axis, element.at(given[joint]))))
            elif isinstance(element, Error) and element.pattern is not None:
                size = float(sizes[self.factors.index(element.name)])
                elements.append(
                    replace(element, distribution=element.distribution.scaled(size), pattern=None)
                )
            else:
                elements.append(element)
        return Chain(tuple(elements))

    def groups(self, angles: ArrayLike) -> tuple[Numbers, ...]:
        """Number (n,) of the value that each error has at each of the positions (n, joints) [rad].

        Positions of one number share one value.
        """
        given, _ = self._checked(angles, None)
        every = np.arange(len(given))
        return tuple(
            np.zeros_like(every)
            if error.scope.constant
            else commanded(given[:, joint])
            if error.scope is Scope.ANGLE
            else every
            for error, joint in zip(self.errors, self.joint_of, strict=True)
        )

    def with_scope(self, scope: Scope) -> Chain:
        """The chain with the given scope for every error."""
        return self.with_errors(*(replace(error, scope=scope) for error in self.errors))

    def draw(self, rng: np.random.Generator, positions: int | Array, runs: int | None = None) -> Array:
        """Errors for the positions of a test, drawn by scope.

        Parameters
        ----------
        rng : Generator
        positions : int, or (n, joints) rad
            Their number is enough where no error has the scope ``angle``.
        runs : int, optional

        Returns
        -------
        (n, k), or (runs, n, k) where ``runs`` is given
            Errors [rad or m], before their patterns; those of scope ``run`` and ``rig`` are the same at all positions
            of a run, those of scope ``angle`` at all of one angle. One of scope ``sample`` is drawn once a position
            too: averaging it is the simulation's work.
        """
        if isinstance(positions, int):
            if any(error.scope is Scope.ANGLE for error in self.errors):
                raise ValueError(
                    "found a number of positions, expected their angles for errors of scope angle"
                )
            positions = np.zeros((positions, len(self.joints)))
        batch = () if runs is None else (runs,)
        errors = np.empty((*batch, len(positions), len(self.errors)))
        for k, (error, numbers) in enumerate(zip(self.errors, self.groups(positions), strict=True)):
            drawn = error.distribution.sample(rng, (*batch, int(numbers.max(initial=-1)) + 1))
            errors[..., k] = drawn[..., numbers]
        return errors

    def pose(self, angles: ArrayLike, errors: ArrayLike | None = None) -> Array:
        """Homogeneous transforms from b to n.

        Parameters
        ----------
        angles : (*batch, joints) rad
        errors : (*batch, k) rad or m, optional; the ideal rig if absent

        Returns
        -------
        (*batch, 4, 4) attitude C_nb and, in the last column, the place of b's origin in n [m]
        """
        angles, errors = self._checked(angles, errors)
        batch = np.broadcast_shapes(angles.shape[:-1], errors.shape[:-1])
        pose = np.broadcast_to(np.eye(4), (*batch, 4, 4))
        for element, value in self._values(angles, errors):
            pose = pose @ _transform(element, value)
        return pose

    def attitude(self, angles: ArrayLike, errors: ArrayLike | None = None) -> Array:
        """Attitudes C_nb (*batch, 3, 3); arguments as in `pose`."""
        angles, errors = self._checked(angles, errors)
        batch = np.broadcast_shapes(angles.shape[:-1], errors.shape[:-1])
        C_nb = np.broadcast_to(np.eye(3), (*batch, 3, 3))
        for element, value in self._values(angles, errors):
            C_nb = C_nb @ _rotation(element, value)
        return C_nb

    def exchanged(self, angles: ArrayLike, errors: ArrayLike, others: ArrayLike) -> Array:
        """Attitudes (k, n, 3, 3) with one of the ``errors`` (n, k) after the other taken from ``others`` (n, k)."""
        angles, errors = self._checked(angles, errors)
        _, others = self._checked(angles, others)
        C_nb = np.empty((len(self.errors), len(errors), 3, 3))
        turns = [_rotation(*each) for each in self._values(angles, errors)]
        behind = [np.eye(3)]  # products before and behind an error are made once, not for each error
        for turn in reversed(turns[1:]):
            behind.insert(0, turn @ behind[0])
        before, k = np.eye(3), 0
        for (element, other), turn, after in zip(self._values(angles, others), turns, behind, strict=True):
            if isinstance(element, Error):
                if not element.is_offset:
                    C_nb[k] = before @ _rotation(element, other) @ after
                k += 1
            before = before @ turn
        C_nb[[error.is_offset for error in self.errors]] = before
        return C_nb

    def slopes(self, angles: ArrayLike) -> Array:
        """Derivatives of the attitude with respect to the errors, at the ideal rig.

        Returns
        -------
        (*batch, k, 3, 3) dC_nb/derror_k [1/rad]; zero for offsets
        """
        angles, none = self._checked(angles, None)
        before = np.broadcast_to(np.eye(3), (*angles.shape[:-1], 3, 3))
        sizes = self.sizes(angles)
        turned_parts: list[tuple[Array, Array]] = []
        for element, value in self._values(angles, none):
            if isinstance(element, Error):
                turn: Array = np.zeros((3, 3)) if element.is_offset else skew(_UNIT[element.axis])
                # before K after, with C = before after
                size = sizes[..., len(turned_parts)][..., None, None]
                turned_parts.append((before @ turn * size, before))
            else:
                before = before @ _rotation(element, value)
        if not turned_parts:
            return np.zeros((*angles.shape[:-1], 0, 3, 3))
        whole = before
        return np.stack(
            [turned @ np.swapaxes(first, -1, -2) @ whole for turned, first in turned_parts], axis=-3
        )

    def _values(self, angles: Array, errors: Array) -> Iterable[tuple[Element, Array]]:
        """Elements of the chain with their values (*batch)."""
        error = 0
        for element, joint in zip(self.elements, self._joint_before, strict=True):
            if isinstance(element, Joint):
                yield element, angles[..., joint]
            elif isinstance(element, Error):
                value = errors[..., error]
                yield (
                    element,
                    value if element.pattern is None else value * element.pattern(angles[..., joint]),
                )
                error += 1
            elif isinstance(element, Known):
                yield element, element.at(angles[..., joint] if joint >= 0 else np.zeros(()))
            else:
                yield element, np.zeros(())

    def _checked(self, angles: ArrayLike, errors: ArrayLike | None) -> tuple[Array, Array]:
        """Arrays of the right last axis."""
        given = np.asarray(angles, dtype=float)
        values = np.zeros(len(self.errors)) if errors is None else np.asarray(errors, dtype=float)
        for array, names, what in ((given, self.joints, "angles"), (values, self.factors, "errors")):
            if array.ndim == 0 or array.shape[-1] != len(names):
                raise ValueError(
                    f"found {what} of shape {array.shape}, expected {len(names)} in the last axis"
                )
        return given, values


def follows_angle(element: Element) -> bool:
    """True if an element needs the angle of a joint: by a pattern, or by one value for each angle."""
    return _has_pattern(element) or (isinstance(element, Error) and element.scope is Scope.ANGLE)


def _has_pattern(element: Element) -> bool:
    """True if an error is known over the angle of a joint, or has a size that follows it."""
    if isinstance(element, Known):
        return bool(element.parts)
    return isinstance(element, Error) and element.pattern is not None


_UNIT: dict[str, Array] = dict(zip("xyz", np.eye(3), strict=True))


def about(axis: ArrayLike, element: Joint | Error) -> tuple[Element, ...]:
    """An element about any ``axis`` (3,) instead of its own: between two fixed rotations.

    Raises
    ------
    ValueError
        An axis of no length.
    """
    to = np.asarray(axis, dtype=float)
    length = np.linalg.norm(to)
    if not length > 0.0:
        raise ValueError(f"found the axis {to}, expected one with a length")
    own = _UNIT[element.axis]
    across = np.linalg.svd((to / length)[None, :])[2][1:]  # completes the axis to an orthonormal triad
    turn = np.empty((3, 3))
    k = int(np.argmax(own))
    turn[:, k], turn[:, (k + 1) % 3], turn[:, (k + 2) % 3] = to / length, *across
    if np.linalg.det(turn) < 0.0:
        turn[:, (k + 2) % 3] *= -1.0
    return (Fixed(turn), element, Fixed(turn.T))


def _rotation(element: Element, value: Array) -> Array:
    """Rotation (*batch, 3, 3) of an element; an offset has none."""
    if isinstance(element, Error) and element.is_offset:
        return np.eye(3)
    return element.rotation if isinstance(element, Fixed) else elementary(element.axis, value)


def _transform(element: Element, value: Array) -> Array:
    """Homogeneous transform (*batch, 4, 4) of an element."""
    matrix = np.zeros((*value.shape, 4, 4))
    matrix[..., 3, 3] = 1.0
    if isinstance(element, Error) and element.is_offset:
        matrix[..., :3, :3] = np.eye(3)
        matrix[..., :3, 3] = value[..., None] * _UNIT[element.axis]
    else:
        matrix[..., :3, :3] = _rotation(element, value)
        if isinstance(element, Fixed):
            matrix[..., :3, 3] = element.offset
    return matrix
