"""Rows of a stream whose stamps are in doubt: held until later ones decide (`inercal.foundation.records.stamps`).

A row that goes on as expected is given at once, but for the first ones, which wait for each other. A row whose stamp is
wrong is given in its turn, without a time.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from inercal.faces.stream.lines import Lines, Sample
from inercal.foundation.arrays import Array
from inercal.foundation.records.stamps import Order


class HeldRows(NamedTuple):
    """A doubt as a state that can be saved: ``last``, ``steps`` and ``held`` as of
    `inercal.foundation.records.stamps.Order`; of the rows held the number of each and of its line, ``values`` (n,
    columns), and ``labels``, a line each."""

    last: float = float("nan")
    steps: Array = np.empty(0)
    held: Array = np.empty(0)
    rows: Array = np.empty(0)
    lines: Array = np.empty(0)
    values: Array = np.empty((0, 0))
    labels: str = ""


@dataclass(frozen=True)
class Doubt:
    """Knowledge of the time of a stream, and the rows in doubt, each a sample with the number of its line."""

    order: Order
    held: tuple[tuple[Sample, int], ...] = ()

    @property
    def saved(self) -> HeldRows:
        """As a state that can be saved."""
        samples = [sample for sample, _ in self.held]
        return HeldRows(
            self.order.last,
            np.array(self.order.steps, dtype=float),
            np.array(self.order.held, dtype=float),
            np.array([sample.row for sample in samples], dtype=float),
            np.array([line for _, line in self.held], dtype=float),
            np.array([sample.values for sample in samples], dtype=float).reshape(
                len(samples), -1 if samples else 0
            ),
            "\n".join(sample.label.replace("\n", " ") for sample in samples),
        )

    @staticmethod
    def of(saved: HeldRows) -> Doubt:
        """As it was saved."""
        order = Order(saved.last, tuple(saved.steps.tolist()), tuple(saved.held.tolist()))
        each = zip(
            map(int, saved.rows.tolist()),
            order.held,
            saved.values.tolist(),
            saved.labels.split("\n"),
            strict=False,
        )
        samples = [Sample(*row) for row in each]
        return Doubt(order, tuple(zip(samples, map(int, saved.lines.tolist()), strict=True)))

    def without_held(self) -> Doubt:
        """Without the rows in doubt, for a stream that brings them once more."""
        return Doubt(self.order._replace(held=()))

    def on(self, sample: Sample, line: int, lines: Lines) -> tuple[Doubt, list[Sample]]:
        """The doubt after a row, and the rows that are decided now; what is wrong with their time is said."""
        if not lines.stamped:
            return self, [sample]
        order, sound = self.order.on(sample.t)
        held = (*self.held, (sample, line))
        if not sound:
            return Doubt(order, held), []
        return Doubt(order), list(_decided(held, sound, self.order.last, lines))

    def end(self, lines: Lines) -> list[Sample]:
        """The rows in doubt where none follows."""
        return list(_decided(self.held, self.order.end(), self.order.last, lines))


def _decided(
    held: tuple[tuple[Sample, int], ...], sound: Sequence[bool], last: float, lines: Lines
) -> Iterator[Sample]:
    """Rows as they go on, those without a ``sound`` stamp without a time; ``last`` [s] is the stamp before them."""
    for k, ((sample, line), each) in enumerate(zip(held, sound, strict=True)):
        if each:
            lines.say_order(sample.t, line)
            last = sample.t if sample.t == sample.t else last
            yield sample
        else:
            after = [other.t for (other, _), good in zip(held[k:], sound[k:], strict=True) if good]
            beside = [t for t in (last, *after) if t == t]
            lines.say_wrong(sample.t, beside[:2], line)
            yield sample._replace(t=float("nan"), wrong=True)
