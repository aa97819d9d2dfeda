"""Model of an instrument on a table: its outputs, and their change by the errors of the table."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.designs.criteria import basis
from inercal.foundation.errors import StudyError
from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.foundation.instruments.by_angle import CHANNELS, EXTRA, ChannelModel, channel_model
from inercal.foundation.rigs.chain import Chain
from inercal.foundation.rigs.outputs import gravity_reference, rate_reference
from inercal.systems.turntable.settings import TurntableSettings

FRAME = "b, of the instrument: x, y, z of the table's innermost frame at zero angles and no errors"
"""Axes of the results."""


@dataclass(frozen=True, eq=False)
class Stated:
    """Terms of a channel that are not estimated: ``channel`` with these alone, their linear coefficients ``values``
    (q,) and the standard uncertainties ``u`` (q,) of these."""

    channel: ChannelModel
    values: Array
    u: Array


@dataclass(frozen=True, eq=False)
class ReferenceInput:
    """An input on which gravity or earth rate depends: its standard uncertainty ``u`` [``unit``], and the change
    ``a_n``, ``w_n`` (3,) of the references in n per unit of it."""

    source: str
    u: float
    unit: str
    a_n: Array
    w_n: Array


@dataclass(frozen=True)
class Beside:
    """A source of uncertainty beside noise and table: ``unit`` empty for that of the ``term`` it belongs to."""

    source: str
    u: float
    unit: str
    term: str = ""


@dataclass(frozen=True, eq=False)
class TableModel:
    """An instrument's channels on a table.

    Attributes
    ----------
    chain : Chain
        The table with its errors.
    a_n : (3,)
        The vector a of the monomials, in n: the gravity reference in units of the site's gravity for a gyrowheel,
        specific force [m/s^2] for the others.
    w_n : (3,)
        Earth rate [rad/s] in n.
    channels : tuple of ChannelModel
        Their terms are those to be estimated.
    stated : tuple of Stated
        Terms of each channel that are stated and not estimated.
    references : tuple of Reference
        Uncertain inputs of a and w.
    """

    chain: Chain
    a_n: Array
    w_n: Array
    channels: tuple[ChannelModel, ...]
    stated: tuple[Stated, ...] = ()
    references: tuple[ReferenceInput, ...] = ()

    @property
    def symbols(self) -> tuple[str, ...]:
        """Terms of all channels, one channel after the other."""
        return tuple(symbol for channel in self.channels for symbol in channel.symbols)

    @property
    def blocks(self) -> tuple[slice, ...]:
        """Places of the terms of each channel among `symbols`."""
        ends = np.cumsum([len(channel.symbols) for channel in self.channels]).tolist()
        return tuple(slice(a, b) for a, b in zip([0, *ends], ends, strict=False))

    def inputs(self, angles: Array, errors: Array | None = None) -> tuple[Array, Array]:
        """a and w (*batch, 3) on the instrument's axes at ``angles`` (*batch, joints) [rad]."""
        C_nb = self.chain.attitude(angles, errors)
        return self.a_n @ C_nb, self.w_n @ C_nb

    def rows(self, angles: Array) -> Array:
        """Regressors (n, channels, p) of all coefficients, at the nominal attitudes."""
        a, w = self.inputs(angles)
        made = np.zeros((len(a), len(self.channels), len(self.symbols)))
        for k, (channel, block) in enumerate(zip(self.channels, self.blocks, strict=True)):
            made[:, k, block] = channel.regressors(a, w)
        return made

    def outputs(self, angles: Array, c: Array, errors: Array | None = None) -> Array:
        """Outputs (*batch, channels) for linear coefficients ``c`` (p,), stated terms included."""
        a, w = self.inputs(angles, errors)
        made = [
            channel.regressors(a, w) @ c[block]
            for channel, block in zip(self.channels, self.blocks, strict=True)
        ]
        for k, fixed in enumerate(self.stated):
            made[k] = made[k] + fixed.channel.regressors(a, w) @ fixed.values
        return np.stack(made, axis=-1)

    def by_inputs(self, angles: Array, c: Array) -> Array:
        """Derivatives (n, channels, 6) of the outputs with respect to a and w on the instrument's axes."""
        a, w = self.inputs(angles)
        made = [
            np.einsum("npi,p->ni", channel.slopes(a, w), c[block])
            for channel, block in zip(self.channels, self.blocks, strict=True)
        ]
        for k, fixed in enumerate(self.stated):
            made[k] = made[k] + np.einsum("npi,p->ni", fixed.channel.slopes(a, w), fixed.values)
        return np.stack(made, axis=1)

    def bend_by_inputs(self, angles: Array, c: Array) -> Array | None:
        """Second derivatives (n, channels, 6, 6) of the outputs by a and w there; None where all terms are linear."""
        parts = [*self.channels, *(each.channel for each in self.stated)]
        if all(each.order + sum(each.powers[3:]) < 2 for part in parts for each in part.monomials):
            return None
        a, w = self.inputs(angles)
        values = [c[block] for block in self.blocks] + [each.values for each in self.stated]
        bend = np.zeros((len(angles), len(self.channels), 6, 6))
        steps = 1e-3 * np.repeat([np.linalg.norm(self.a_n), np.linalg.norm(self.w_n)], 3)
        for k, (part, own) in enumerate(zip(parts, values, strict=True)):
            for i, step in enumerate(np.diag(steps)):
                ends = [part.slopes(a + sign * step[:3], w + sign * step[3:]) for sign in (1.0, -1.0)]
                change = np.einsum("npi,p->ni", ends[0] - ends[1], own) / (2.0 * steps[i])
                bend[:, k % len(self.channels), i] += change
        return bend

    def by_errors(self, angles: Array, c: Array) -> Array:
        """Derivatives (n, channels, k) of the outputs with respect to the table's errors, at none."""
        turns = self.chain.slopes(angles)
        moved = np.concatenate([self.a_n @ turns, self.w_n @ turns], axis=-1)  # (n, k, 6)
        return np.asarray(np.einsum("nci,nki->nck", self.by_inputs(angles, c), moved))

    def by_references(self, angles: Array, c: Array, a_n: Array, w_n: Array) -> Array:
        """Change (n, channels) of the outputs for small changes of the references in n."""
        C_nb = self.chain.attitude(angles)
        moved = np.concatenate([a_n @ C_nb, w_n @ C_nb], axis=-1)
        return np.asarray(np.einsum("nci,ni->nc", self.by_inputs(angles, c), moved))

    def beside(self, angles: Array, c: Array) -> tuple[tuple[Beside, ...], Array]:
        """Uncertain inputs beside noise and table, and the change (n, channels, q) of the outputs per unit of each.

        Each has one value throughout a test.
        """
        inputs, columns = [], []
        for reference in self.references:
            change = self.by_references(angles, c, reference.a_n, reference.w_n)
            if np.any(change):
                inputs.append(Beside(reference.source, reference.u, reference.unit))
                columns.append(change)
        a, w = self.inputs(angles)
        for k, fixed in enumerate(self.stated):
            regressors = fixed.channel.regressors(a, w)
            for j in np.flatnonzero(fixed.u):
                column = np.zeros((len(angles), len(self.channels)))
                column[:, k] = regressors[:, j]
                symbol = fixed.channel.symbols[j]
                inputs.append(Beside(f"stated {symbol}", float(fixed.u[j]), "", symbol))
                columns.append(column)
        empty = np.zeros((len(angles), len(self.channels), 0))
        return tuple(inputs), np.stack(columns, axis=-1) if columns else empty


def table_model(
    settings: TurntableSettings, channels: Sequence[str], left_out: Collection[str] = ()
) -> TableModel:
    """The model of a study for these channels, with the terms it asks for but those ``left_out``.

    All other terms of the channels are taken as stated.

    Raises
    ------
    StudyError
        A latitude that is missing, or terms that leave a channel without any.
    """
    site, instrument = settings.site, settings.instrument
    if site.latitude is None:
        raise StudyError("site", 'no latitude, expected one such as latitude = "39.1 deg" for the earth rate')
    models = [channel_model(instrument.kind, channel) for channel in channels]
    wanted = instrument.terms
    chosen, fixed = [], []
    for model in models:
        unwanted = set(EXTRA) if wanted is None else set(model.symbols) - set(wanted)
        kept = model.without(unwanted | set(left_out))
        if not kept.symbols:
            raise StudyError(
                "instrument.terms", f"none of them belongs to {model.channel}, which the record has"
            )
        if kept.relative & set(kept.symbols) and kept.leading not in kept.symbols:
            raise StudyError(
                "instrument.terms", f"{kept.leading} is missing, to which others of {model.channel} relate"
            )
        chosen.append(kept)
        fixed.append(_stated(settings, model, model.without(kept.symbols)))
    a_n = gravity_reference() if instrument.kind == "gyrowheel" else -gravity_reference(site.gravity)
    w_n = rate_reference(site.latitude)
    return TableModel(settings.chain, a_n, w_n, tuple(chosen), tuple(fixed), _references(settings))


def _stated(settings: TurntableSettings, model: ChannelModel, rest: ChannelModel) -> Stated:
    """Stated values of the terms in ``rest``, a part of the whole ``model`` of a channel."""
    values = stated_values(settings, model)
    linear, typed = model.linear(values), settings.instrument.coefficients_u
    # a relative term enters times the stated scale factor: what is fitted of that changes it to second order
    lead = [model.gain(values) if symbol in model.relative else 1.0 for symbol in model.symbols]
    places = [model.symbols.index(symbol) for symbol in rest.symbols]
    lost = [s for s in rest.symbols if s in model.relative and settings.instrument.coefficients.get(s)]
    if lost and not model.gain(values):
        raise StudyError(
            "instrument.coefficients",
            f"{', '.join(lost)} relate to {model.leading}, expected a value of {model.leading} too, or to fit them",
        )
    u = np.array([typed.get(model.symbols[j], 0.0) * lead[j] for j in places])
    return Stated(rest, linear[places], np.abs(u))


def _references(settings: TurntableSettings) -> tuple[ReferenceInput, ...]:
    """Uncertain inputs of gravity and earth rate."""
    site, still = settings.site, np.zeros(3)
    assert site.latitude is not None
    # in units of the site's gravity, gravity is one whatever its value
    up = still if settings.instrument.kind == "gyrowheel" else np.array([0.0, 0.0, 1.0])
    references = {
        (each.source, each.u, each.unit): ReferenceInput(
            each.source, each.u, each.unit, up * each.sensitivity, still
        )
        for each in site.inputs
    }
    if site.latitude_u > 0.0:
        key = ("latitude", site.latitude_u, "rad")
        w_n = EARTH_RATE * np.array([-np.sin(site.latitude), 0.0, np.cos(site.latitude)])
        references[key] = ReferenceInput(*key, references[key].a_n if key in references else still, w_n)
    return tuple(references.values())


def orthonormal(model: TableModel, angles: Array) -> Array:
    """Functions (n, b) of the direction of gravity, orthonormal over the sphere: as many as the terms have orders.

    Nine, up to second order, or four, up to first (`inercal.foundation.designs.criteria.basis`).
    """
    quadratic = any(each.order > 1 for channel in model.channels for each in channel.monomials)
    made = basis(gravity_reference() @ model.chain.attitude(angles))
    return made if quadratic else made[:, :4]


def channels_of(settings: TurntableSettings) -> tuple[str, ...]:
    """Channels of which the study states a coefficient; all of the kind where it states none."""
    kind, coefficients = settings.instrument.kind, settings.instrument.coefficients
    named = [
        channel
        for channel in CHANNELS[kind]
        if any(symbol in coefficients for symbol in channel_model(kind, channel).symbols)
    ]
    return tuple(named) or CHANNELS[kind]


def stated_values(settings: TurntableSettings, channel: ChannelModel) -> Array:
    """Values (p,) of the terms of a channel as the study states them.

    Of those it does not state, the gain is 1 where the output is in the unit of its input; all others are 0.
    """
    coefficients, dimension = settings.instrument.coefficients, settings.instrument.unit.dimension
    gain = 1.0 if dimension in ("rate", "acceleration") else 0.0
    return np.array(
        [coefficients.get(symbol, gain if symbol in UNIT_GAINS else 0.0) for symbol in channel.symbols]
    )


UNIT_GAINS = ("k_x", "kY_y", *(f"{k}_{i}" for k in ("S", "K1") for i in "xyz"))
"""Terms that are 1 where nothing is said and the output is in the unit of the input."""
