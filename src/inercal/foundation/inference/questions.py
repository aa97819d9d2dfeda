"""Questions about a calibration, without a list of faults: every pair of what errs and by what it errs.

A calibration takes its values as constant, its inputs as stated, and its outputs as undistorted. Each may err by
order (time), by place (the coordinate of an input), by the reading itself, and by history (what came before). Columns
are made of predictions, never of readings, whose own noise would be taken for a fault.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from inercal.foundation.arrays import Array
from inercal.foundation.inference.limits import LIMITS


@dataclass(frozen=True, eq=False)
class StatedInput:
    """An input that the model takes as stated: ``value`` (n,) at each reading, ``slope`` (n,) of the readings by a
    small error of it, ``period`` of its coordinate, or 0."""

    name: str
    value: Array
    slope: Array
    period: float = 0.0


@dataclass(frozen=True, eq=False)
class JudgedFit:
    """A least-squares fit of n readings as its judge sees it.

    Attributes
    ----------
    names, values, u : (p,)
    gain : (p, n) change of the values by each reading
    by_value : (n, p) change of the readings by each value
    beside : (n, k) columns of all else that was fitted, or is known to be there
    readings, residuals : (n,) readings, and readings less model; unknowns whose prior is in ``covariance`` at its mean
    covariance : (n, n) of the readings, or (n,) variances of those whose evidence is made elsewhere
    row, channel : (n,) numbers from 0, of the test's rows in the order of time and of the channels; a channel of -1 is
        none: a condition that is fitted like a reading
    time : (n,)
    channels : names of the channels
    inputs : inputs that the model takes as stated
    noise_dof : as in `inercal.foundation.inference.evidence.FitEvidence`
    part : (n,) numbers from 0 of the ``parts`` of the test, such as files, by name; -1 for none
    """

    names: tuple[str, ...]
    values: Array
    u: Array
    gain: Array
    by_value: Array
    beside: Array
    readings: Array
    residuals: Array
    covariance: Array
    row: NDArray[np.int64]
    channel: NDArray[np.int64]
    time: Array
    channels: tuple[str, ...]
    inputs: tuple[StatedInput, ...]
    noise_dof: float
    part: NDArray[np.int64] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    parts: tuple[str, ...] = ()

    @property
    def predicted(self) -> Array:
        """The readings (n,) by the model."""
        return self.readings - self.residuals

    @property
    def triads(self) -> dict[str, list[int]]:
        """Channels by the heads of their names, such as ``acc`` of ``acc_x``; under "" where all have one head."""
        heads: dict[str, list[int]] = {}
        for k, name in enumerate(self.channels):
            heads.setdefault(name.rpartition("_")[0] or name, []).append(k)
        return heads if len(heads) > 1 else {"": list(range(len(self.channels)))}

    @property
    def ranging(self) -> NDArray[np.bool_]:
        """Channels (c,) whose predictions range over many times their noise, so that shapes of them mean something."""
        variance = self.covariance if self.covariance.ndim == 1 else np.diag(self.covariance)
        sigma, y = np.sqrt(variance), self.predicted
        return np.array(
            [
                bool(np.ptp(y[own]) > LIMITS.least_range * np.median(sigma[own]))
                if (own := self.channel == k).any()
                else False
                for k in range(len(self.channels))
            ]
        )

    @property
    def per_channel(self) -> Array:
        """One (n, c) at the readings of each channel."""
        return np.asarray(self.channel[:, None] == np.arange(len(self.channels)), dtype=float)


@dataclass(frozen=True, eq=False)
class Question:
    """One pair: ``cell`` is order, place, reading or history; ``what`` (``plural`` or not) does what ``verb`` and
    ``rest`` say, by the ``columns`` (n, m). Where the physics of a system names the cause, ``code`` and ``action`` are
    those of its finding."""

    cell: str
    what: str
    plural: bool
    verb: str
    rest: str
    columns: Array
    code: str = ""
    action: str = ""

    @property
    def sentence(self) -> str:
        """Subject and verb, as in "The bias drifts"."""
        verb = self.verb if self.plural else f"{self.verb}s"
        return f"{self.what[0].upper()}{self.what[1:]} {verb} {self.rest}".rstrip()


@dataclass(frozen=True, eq=False)
class _Subject:
    """One thing that may err: columns (n, q) by a small error of each of its parts."""

    what: str
    plural: bool
    columns: Array


CELLS = ("order", "place", "reading", "history")
"""Things that errors go by."""

_TRIADS = {"acc": "the accelerometers", "gyro": "the gyro"}
"""Channels in words by the head of their names."""

_STEPS = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8)
"""Places of steps that are asked for, over the length of a record."""

_LAG = 0.35
"""Share of the way by which a lagging output follows its load from row to row."""


def questions(fit: JudgedFit) -> list[Question]:
    """All questions about a fit, some 45 to 120."""
    return [*_by_order(fit), *_by_place(fit), *_by_reading(fit), *_by_history(fit)]


def _times(columns: Array, shape: Array) -> Array:
    """Each column (n, q) times each shape (n, k): (n, q k)."""
    return np.asarray((columns[:, :, None] * shape[:, None, :]).reshape(len(columns), -1))


def _subjects(fit: JudgedFit) -> list[_Subject]:
    """Biases, gains, values by family, inputs."""
    one = fit.per_channel
    made = []
    for triad, its in fit.triads.items():
        own, plural = one[:, its], len(its) > 1
        of = triad and f" of {_TRIADS.get(triad, triad)}"
        made.append(_Subject(f"the biases{of}" if plural else f"the bias{of}", plural, own))
        gains = own * fit.predicted[:, None]
        made.append(_Subject(f"the gains{of}" if plural else f"the gain{of}", plural, gains))
        if plural:
            every = gains.sum(axis=1, keepdims=True)
            made.append(_Subject(f"the gain of all channels{of}", False, every))
    families: dict[str, list[int]] = {}
    for k, name in enumerate(fit.names):
        families.setdefault(name.rpartition("_")[0] or name, []).append(k)
    for family, members in families.items():
        columns = fit.by_value[:, members]
        if not columns.any():
            continue
        alone = len(members) == 1
        what = fit.names[members[0]] if alone else f"the values {family}"
        made.append(_Subject(what, not alone, columns))
        if (turned := _as_one(fit.names, members, fit.by_value)) is not None:
            made.append(_Subject(f"the frame of {family}", False, turned))
    return made + [_Subject(f"the input {given.name}", False, given.slope[:, None]) for given in fit.inputs]


def _as_one(names: Sequence[str], members: Sequence[int], by_value: Array) -> Array | None:
    """Columns (n, 3) by a rotation of a family of six misalignments as one; None for another family."""
    at = {names[k].rpartition("_")[2]: k for k in members}
    pairs = [("yz", "zy"), ("zx", "xz"), ("xy", "yx")]
    if not all(pair in at for both in pairs for pair in both):
        return None
    return np.stack([by_value[:, at[one]] - by_value[:, at[other]] for one, other in pairs], axis=1)


def over_time(time: Array) -> list[tuple[str, str, Array]]:
    """Shapes (n, m) over the times (n,) of a record, behind what something does that has them: a verb, and the rest."""
    s = (time - time.min()) / max(float(np.ptp(time)), 1e-300)
    return [
        ("drift", "over the record", s[:, None]),
        ("bend", "over the record", np.stack([s, s**2, s**3], axis=1)),
        ("sway", "slowly", np.cos(math.pi * s[:, None] * np.arange(1, 7))),
        ("settle", "at the start", np.exp(-s[:, None] / np.array([0.05, 0.25]))),
        *(("step", f"at {100 * at:.0f} % of the record", (s > at).astype(float)[:, None]) for at in _STEPS),
    ]


def lagging(x: Array) -> Array:
    """A state (n,) that follows ``x`` (n,) from row to row."""
    made, state = np.empty_like(x), 0.0
    for k, value in enumerate(x):
        state += _LAG * (value - state)
        made[k] = state
    return made


def _by_order(fit: JudgedFit) -> Iterator[Question]:
    """Drift, bend, sway, settling and steps over time."""
    for subject in _subjects(fit):
        for verb, rest, shape in over_time(fit.time):
            yield Question("order", subject.what, subject.plural, verb, rest, _times(subject.columns, shape))
    late = (fit.time > np.median(fit.time)).astype(float)[:, None]
    yield Question("order", "the values", True, "differ", "between the halves", fit.by_value * late)


def _by_place(fit: JudgedFit) -> Iterator[Question]:
    """Harmonics or curves over the coordinate of each input, of the input and of the biases."""
    biases = [subject for subject in _subjects(fit) if subject.what.startswith("the bias")]
    for given in fit.inputs:
        for rest, shape in _places(given):
            slope = given.slope[:, None]
            yield Question("place", f"the input {given.name}", False, "err", rest, _times(slope, shape))
            over = f"with {given.name} {rest}"
            for bias in biases:
                yield Question("place", bias.what, bias.plural, "change", over, _times(bias.columns, shape))


def _places(given: StatedInput) -> list[tuple[str, Array]]:
    """Functions of an input's coordinate, in words."""
    if given.period:
        x = 2.0 * math.pi * given.value / given.period
        words = {
            1: "once a turn",
            2: "twice a turn",
            3: "3 times a turn",
            4: "4 times a turn",
            8: "8 times a turn",
        }
        return [(text, np.stack([np.cos(k * x), np.sin(k * x)], axis=1)) for k, text in words.items()]
    x = given.value / max(float(np.abs(given.value).max()), 1e-300)
    return [
        ("by its size", np.abs(x)[:, None]),
        ("by its sign", np.sign(x)[:, None]),
        ("along a curve", np.stack([x**2, x**3], axis=1)),
    ]


def _by_reading(fit: JudgedFit) -> Iterator[Question]:
    """Distortions of the output by itself, of each channel and of all alike."""
    by_channel: dict[tuple[str, str], list[Array]] = {}
    for own in fit.per_channel[:, fit.ranging].T:
        y = fit.predicted * own
        size, used = np.abs(y), own > 0.0
        top, middle = max(float(size.max()), 1e-300), float(np.median(size[used]))
        low, high = np.quantile(y[used], [0.15, 0.85])
        ends = y[used].min() + np.ptp(y[used]) * np.array([0.05, 0.95])
        shapes = {
            ("differ", "between its two signs"): size[:, None],
            ("step", "where it changes its sign"): (np.sign(y) * own)[:, None],
            ("curve", "over its range"): np.stack([y**2 / top, y**3 / top**2], axis=1),
            ("differ", "above half its range"): (y * (size > 0.5 * top))[:, None],
            ("differ", "in the middle of its range"): np.stack(
                [y * (size < middle), own * (size < 0.1 * top)], axis=1
            ),
            ("bend", "at its upper end"): (np.maximum(y - high, 0.0) * own)[:, None],
            ("bend", "at its lower end"): (np.minimum(y - low, 0.0) * own)[:, None],
            ("bend", "close to its upper end"): (np.maximum(y - ends[1], 0.0) * own)[:, None],
            ("bend", "close to its lower end"): (np.minimum(y - ends[0], 0.0) * own)[:, None],
        }
        for words, shape in shapes.items():
            by_channel.setdefault(words, []).append(shape)
    for (verb, rest), shapes_of in by_channel.items():
        if len(shapes_of) > 1:
            yield Question("reading", "an output", False, verb, rest, np.hstack(shapes_of))
            yield Question(
                "reading", "every output", False, verb, f"{rest}, all alike", np.sum(shapes_of, axis=0)
            )
        else:
            yield Question("reading", "the output", False, verb, rest, shapes_of[0])


def neighbours(fit: JudgedFit, x: Array, by: int) -> Array:
    """``x`` (n,) of the row before (``by`` = -1) or behind (1) in the same channel; its own at the end."""
    made = x.copy()
    for own in fit.per_channel.T:
        index = np.flatnonzero(own)
        index = index[np.argsort(fit.row[index], kind="stable")]
        moved = np.clip(np.arange(len(index)) + by, 0, len(index) - 1)
        made[index] = x[index[moved]]
    return made


def _lagging(fit: JudgedFit, x: Array) -> Array:
    """A state that follows ``x`` (n,) from row to row in each channel."""
    made = np.zeros_like(x)
    for own in fit.per_channel.T:
        index = np.flatnonzero(own)
        index = index[np.argsort(fit.row[index], kind="stable")]
        made[index] = lagging(x[index])
    return made


def _by_history(fit: JudgedFit) -> Iterator[Question]:
    """Memory of outputs and of inputs."""
    one, y = fit.per_channel[:, fit.ranging], fit.predicted * np.any(fit.per_channel[:, fit.ranging], axis=1)
    several = one.shape[1] > 1
    what = "the outputs" if several else "the output"
    load = y / max(float(np.abs(y).max()), 1e-300)
    change = y - neighbours(fit, y, -1)
    sense = np.sign(np.where(np.abs(change) > 1e-3 * np.ptp(y), change, 0.0))
    shapes = [
        ("keep", "a part of the reading before", change),
        ("hold", "a part of the reading behind", neighbours(fit, y, 1) - y),
        ("depend", "on the sense of change", sense),
        ("follow", "the load with a lag", _lagging(fit, load) - load),
        ("follow", "the square of the load with a lag", _lagging(fit, load**2)),
    ]
    for verb, rest, shape in shapes:
        yield Question("history", what, several, verb, rest, shape[:, None] * one)
        if several:
            yield Question("history", what, True, verb, f"{rest}, all alike", shape[:, None])
    warm = (_lagging(fit, load**2) * y)[:, None]
    yield Question("history", what, several, "change", "in scale after large readings", warm)
    for given in fit.inputs:
        step = given.value - neighbours(fit, given.value, -1)
        if given.period:
            step = (step + given.period / 2.0) % given.period - given.period / 2.0
        sign = np.sign(np.where(np.abs(step) > 1e-6 * np.ptp(given.value), step, 0.0))
        name = f"the input {given.name}"
        yield Question("history", name, False, "lag", "behind its change", (given.slope * step)[:, None])
        yield Question(
            "history", name, False, "depend", "on the sense of its change", (given.slope * sign)[:, None]
        )
        yield Question(
            "history",
            what,
            several,
            "depend",
            f"on the sense in which {given.name} changed",
            sign[:, None] * one,
        )
