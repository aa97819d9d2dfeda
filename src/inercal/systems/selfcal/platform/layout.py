"""The table of ports at which states enter the model of the platform, and the layout of states as kernels take it.

The model (`inercal.systems.selfcal.platform.model`) has a few *ports*. At the linear ones a state enters as its
coefficient times a *quantity* that the row gives: rate of an axis, specific force at an accelerometer, output of an
accelerometer, angle of a joint. Such a state is one row of the table of states and no code, unless its quantity is new:
then it is a name in `QUANTITIES` and a line in the model besides. What turns the chain of joints or shifts it in time
(base, mount, link, bend, delay) has its lines there. The core, the paper's 18, is always estimated, at the first
places, and written out.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array

QUANTITIES: Final[Mapping[str, tuple[str, ...]]] = {
    "rate": ("w_x", "w_y", "w_z", "|w_x|/2", "|w_y|/2", "|w_z|/2", "f_x", "f_y", "f_z", "warm", "1"),
    "force": tuple(f"ww_{i}{j}" for i in "xyz" for j in "xyz"),
    "output": ("s2_x", "s2_y", "s2_z", "warm", "warm_x", "warm_y", "warm_z", "1"),
    "angle": ("1", "sin", "cos"),
}
"""Linear port -> its quantities, in the order in which the model fills them in."""

_OTHER: Final = ("core", "base", "mount", "link", "bend", "delay")
"""Ports at which the model has lines for each state."""

_BY_FORCE: Final = tuple(QUANTITIES["rate"].index(f"f_{i}") for i in "xyz")


def by_axis(port: str, quantity: str) -> str:
    """The same quantity for each axis; ``*`` in it stands for the axis."""
    return f"{port} " + ", ".join(f"{i} {quantity.replace('*', i)}" for i in "xyz")


class Entry(NamedTuple):
    """The entry of a parameter: ``port``, ``axis`` or joint, ``quantity`` of a linear port, ``order`` of a harmonic."""

    port: str
    axis: int
    quantity: int = 0
    order: int = 0


def entries(words: str, count: int) -> list[Entry]:
    """Entries of the ``count`` parameters of a kind.

    ``words`` are a port with lines of its own (``base``), a linear one with axis and quantity of each parameter
    (``rate x f_x, ...``), or ``waves`` of angles, whose joint and order the study says.
    """
    port, _, rest = words.partition(" ")
    if port in _OTHER:
        return [Entry(port, k) for k in range(count)]
    if port == "waves":  # sine and cosine by turns
        return [Entry("angle", 0, 1 + k % 2) for k in range(count)]
    parts = [part.split(" ") for part in rest.split(", ")]
    return [Entry(port, "xyz".index(axis), QUANTITIES[port].index(name)) for axis, name in parts]


class StateLayout(NamedTuple):
    """States as kernels take them, in few arrays: each costs seven words wherever a layout is handed over.

    ``chosen`` (p,) places of the states in the full vector; ``place`` (K,) of each parameter in the error state, -1
    where it is no state; ``stated`` (K,) the full vector without the states; ``turning`` (3,) true of joints that are
    not fixed.
    ``terms`` (t, 6): active parameters of rate, force, output, angle, those of each ``until`` (4,); a line has place in
    the full vector, place in the error state or -1, axis, quantity, order, and the number of its entry in a row or
    column, or -1.
    ``links`` (l, 4) of the chain of joints, outer first: axis, joint or -1, place in the full vector, column or -1.
    ``columns`` (m,) places of the encoders' columns; ``rows`` (3, w) places of the entries of the accelerometers' rows,
    ``sizes`` (3,) of them; ``mount``, ``bend``, ``base`` (3,), ``late`` (2,): numbers of columns, or of entries behind
    ``begin`` (3,), or -1.
    The flags say what is active, estimated or stated other than 0, so that kernels leave out the rest: drift
    ``by_force``; a base that is turned, ``based``; sensors ``mounted`` with a turn, or ``bent`` by sag;
    ``late_encoders``; accelerometers ``moving`` while they read, late or off the centre; ``walking`` biases;
    ``read_off``: encoders that read other angles than those of the joints.
    """

    chosen: NDArray[np.int64]
    place: NDArray[np.int64]
    stated: Array
    turning: NDArray[np.bool_]
    terms: NDArray[np.int64]
    until: tuple[int, ...]
    links: NDArray[np.int64]
    columns: NDArray[np.int64]
    rows: NDArray[np.int64]
    sizes: tuple[int, ...]
    begin: tuple[int, ...]
    mount: tuple[int, ...]
    bend: tuple[int, ...]
    base: tuple[int, ...]
    late: tuple[int, ...]
    by_force: bool
    based: bool
    mounted: bool
    bent: bool
    late_encoders: bool
    moving: bool
    walking: bool
    read_off: bool


def layout_of(
    table: Sequence[Entry],
    index: NDArray[np.int64],
    stated: Array,
    harmonics: Sequence[tuple[int, int]],
    fixed: Sequence[int],
    walks: int,
) -> StateLayout:
    """The layout of states at places ``index`` (p,) of the full vector.

    ``table`` (K,) says where each parameter enters, those from ``walks`` on walk; ``harmonics`` are joint and order of
    each.
    """
    table = list(table)
    first = next(k for k, entry in enumerate(table) if entry.port == "angle" and entry.quantity)
    for k, (joint, order) in enumerate(harmonics):
        for j in (first + 2 * k, first + 2 * k + 1):
            table[j] = table[j]._replace(axis=joint, order=order)
    place = np.full(len(table), -1, dtype=np.int64)
    place[index] = 3 + np.arange(len(index))
    active = (place >= 0) | (stated != 0.0)
    slots = {
        port: [k for k, entry in enumerate(table) if entry.port == port] for port in (*QUANTITIES, *_OTHER)
    }
    there = {port: bool(active[those].any()) for port, those in slots.items()}
    columns, behind = list[int](), list[int]()
    rows = [[0, 1, 2, 15, 18], [0, 1, 2, 16, 19, 7], [0, 1, 2, 17, 20, 6, 8]]  # attitude, ka0, ka1, eta

    def put(into: list[int], slot: int) -> int:
        """Put the place of a state into columns or a row; its number there, -1 where it is no state."""
        if place[slot] >= 0:
            into.append(int(place[slot]))
        return len(into) - 1 if place[slot] >= 0 else -1

    terms, until = list[tuple[int, ...]](), list[int]()
    for port in QUANTITIES:
        for slot in (slot for slot in slots[port] if active[slot]):
            of = table[slot]
            at = -1 if port == "rate" else put(columns if port == "angle" else rows[of.axis], slot)
            terms.append((slot, int(place[slot]), of.axis, of.quantity, of.order, at))
        until.append(len(terms))
    links = list[tuple[int, ...]]()
    for joint, axis in enumerate(
        (2, 0, -1)
    ):  # a link behind each joint but the last, about another joint's axis
        links.append((joint, joint, -1, -1))
        if axis >= 0 and active[slots["link"][joint]]:
            links.append((axis, -1, slots["link"][joint], put(columns, slots["link"][joint])))
    mount, bend = (tuple(put(columns, slot) for slot in slots[port]) for port in ("mount", "bend"))
    late = (put(columns, slots["delay"][0]), put(behind, slots["delay"][1]))
    base = tuple(put(behind, slot) for slot in slots["base"])
    begin = tuple(len(row) for row in rows)
    width = max(begin) + len(behind)
    late_encoders, late_accelerometers = (bool(active[slot]) for slot in slots["delay"])
    return StateLayout(
        chosen=index, place=place, stated=np.array(stated, dtype=float),
        turning=np.isin(np.arange(3), fixed, invert=True),
        terms=_integers(terms, -1, 6), until=tuple(until), links=_integers(links, -1, 4),
        columns=_integers(columns, -1),
        rows=_integers([row + behind + [0] * (width - len(row) - len(behind)) for row in rows], 3, width),
        sizes=tuple(size + len(behind) for size in begin), begin=begin, mount=mount, bend=bend, base=base, late=late,
        by_force=any(term[3] in _BY_FORCE for term in terms[: until[0]]),
        based=there["base"], mounted=there["mount"], bent=there["bend"], late_encoders=late_encoders,
        moving=late_accelerometers or there["force"], walking=bool((place[walks:] >= 0).any()),
        read_off=late_encoders or any(there[port] for port in ("angle", "link", "mount", "bend")),
    )  # fmt: skip


def _integers(numbers: Sequence[object], *shape: int) -> NDArray[np.int64]:
    """An array of a shape, also of no numbers."""
    return np.array(numbers, dtype=np.int64).reshape(*shape)
