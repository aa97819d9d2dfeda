"""Rests and moves that lie off all others, one after the other: one that is off does not hide another."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final, Literal, NamedTuple

import numpy as np
from scipy.linalg import LinAlgError
from scipy.special import chdtrc, fdtrc

from inercal.foundation.arrays import Array
from inercal.systems.imu.limits import LIMITS as OF_ALL
from inercal.systems.imu.sections.agreement import of_sections
from inercal.systems.imu.sections.arrow import Linear
from inercal.systems.imu.sections.calibration import SectionCalibration
from inercal.systems.imu.sections.limits import LIMITS
from inercal.systems.imu.sections.outputs import rows
from inercal.systems.imu.sections.scatters import mode

_KINDS: Final[tuple[Literal["section", "move"], ...]] = ("section", "move")
"""Blocks of rows in their order."""

_TRIED: Final = 2
"""Candidates of each kind that are judged by the others' scatter alone."""


class Outlying(NamedTuple):
    """A section or move that lies off all others: its place in their list, the ``probability`` that any sound one does
    by chance, and its distance in standard deviations of what the others expect."""

    kind: Literal["section", "move"]
    place: int
    probability: float
    sigmas: float


class _Judged(NamedTuple):
    """A cell of a block of rows without which the others have the variances ``z``, and how far it is off them."""

    probability: float
    sigmas: float
    block: int
    cell: int
    z: Array


def outlying_of(found: SectionCalibration) -> tuple[Outlying, ...]:
    """Sections and moves that lie off the others, the clearest first.

    Each is judged by the scatter that the others have without it, and then left out; no more than a fifth of all are.
    """
    linear = Linear(found.problem, found.point.x, rows(found.problem, found.point))
    z, _ = mode(linear, np.log([found.scatter[name] for name in found.problem.sizes]))
    items = sum(len(rest) for rest, _ in linear.left(z, linear.at(z))[: len(_KINDS)])
    out: list[Outlying] = []
    while len(out) < max(1, int(OF_ALL.outlier_share * items)):
        judged = [each for at in _suspects(linear, z) if (each := _judged(linear, z, *at)) is not None]
        worst = min(judged, key=lambda each: each.probability, default=None)
        if worst is None or worst.probability * items > LIMITS.outlying_risk:
            break
        out.append(Outlying(_KINDS[worst.block], worst.cell, worst.probability * items, worst.sigmas))
        linear, z = linear.without(worst.cell, worst.block), worst.z
    return tuple(out)


def shifts_of(found: SectionCalibration, outlying: Sequence[Outlying]) -> dict[str, float]:
    """Changes of the coefficients by name where all these are left out, in their u then."""
    linear = Linear(found.problem, found.point.x, rows(found.problem, found.point))
    start = np.log([found.scatter[name] for name in found.problem.sizes])
    here = linear.at(mode(linear, start)[0])
    for one in outlying:
        linear = linear.without(one.place, _KINDS.index(one.kind))
    without = linear.at(mode(linear, start)[0])
    count = len(found.names)
    shift = (without.shared - here.shared)[:count] / np.sqrt(np.diag(without.covariance)[:count])
    return dict(zip(found.names, shift.tolist(), strict=True))


def _suspects(linear: Linear, z: Array) -> Iterator[tuple[int, int]]:
    """Block and cell of the sections and moves that are off most by the scatter of all."""
    for block, (rest, covariance) in enumerate(linear.left(z, linear.at(z))[: len(_KINDS)]):
        off, told = of_sections(rest, covariance)
        p = np.where(told > 0, chdtrc(np.maximum(told, 1.0), off), 1.0)
        yield from ((block, int(cell)) for cell in np.argsort(p)[:_TRIED] if told[cell] > 0)


def _judged(linear: Linear, z: Array, block: int, cell: int) -> _Judged | None:
    """Judge a cell by the scatter of the others without it; None where these alone tell too little."""
    try:
        there, _ = mode(linear.without(cell, block), z)
        rest, covariance = linear.left(there, linear.at(there))[block]
    except LinAlgError:
        return None
    off, told = of_sections(rest, covariance)
    variance = linear.variances(there)[block]
    left = np.einsum("ckk->ck", covariance) / np.where(variance > 0.0, variance, 1.0)
    freedom = float(np.sum(np.delete(left, cell, axis=0)))
    if freedom < OF_ALL.outlier_dof:
        return None
    p = float(fdtrc(told[cell], freedom, off[cell] / told[cell]))
    return _Judged(p, float(np.sqrt(off[cell])), block, cell, there)
