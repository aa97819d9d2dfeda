"""A result of `inercal calibrate turntable` from positions, read as the instrument that it describes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from inercal.faces.convert.correction import range_of
from inercal.faces.convert.table import TableInstrument
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding
from inercal.foundation.instruments.by_angle import CHANNELS, Monomial, channel_model
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import parse_unit

_SMALLEST = 1e-9
"""Determinant, over the product of its rows' lengths, from which on axes count as one."""


def table_instrument(estimate: Estimate, where: object = "calibration") -> TableInstrument:
    """The instrument of an estimate of `inercal calibrate turntable` from positions.

    Raises `InputError`: the estimate has no values, does not say what was stated, or its scale factors cannot be
    inverted.
    """
    result = estimate.result
    if "steps" in result:
        raise InputError(
            where,
            "is of small steps about level, which tell threshold and dead zone, expected one by positions",
        )
    needed = ("instrument", "unit", "stated", "attitude", "gravity_m_s2")
    missing = [key for key in needed if key not in result]
    if missing:
        raise InputError(
            where, f"states no {missing[0]} under result, expected a calibration by this version"
        )
    values = {name: each.value for name, each in estimate.parameters.items()}
    if not values or not np.isfinite(estimate.values).all():
        raise InputError(where, "found no coefficients, expected those of an instrument on a table")
    kind = str(result["instrument"])
    channels = tuple(c for c in CHANNELS[kind] if values.keys() & set(channel_model(kind, c).symbols))
    values = {name: float(each["value"]) for name, each in result["stated"].items()} | values
    units = {str(unit) for unit in result["unit"].values()}
    output = parse_unit(units.pop(), where)
    attitude = tuple(result["attitude"])
    ends = {channel: range_of(estimate, f"reading_of_{channel}", where) for channel in channels}
    readings = {c: (float(each[0]), float(each[1])) for c, each in ends.items() if each is not None}
    instrument = TableInstrument(
        kind, channels, values, output, float(result["gravity_m_s2"]), attitude, readings
    )
    _check_axes(instrument, where)
    return instrument


def _check_axes(instrument: TableInstrument, where: object) -> None:
    """Refuse an instrument whose outputs do not tell their axes apart; raises `InputError`."""
    rows = np.eye(3)
    for channel in instrument.channels:
        model, k = channel_model(instrument.kind, channel), "xyz".index(channel[-1])
        for j in range(3):
            alone = _input(j if instrument.kind == "accelerometer" else j + 3)
            symbol = next(s for s, m in zip(model.symbols, model.monomials, strict=True) if m == alone)
            value = instrument.values.get(symbol, 0.0)
            lead = instrument.values.get(model.leading, 0.0) if symbol in model.relative else 1.0
            rows[k, j] = float(value) * float(lead)
    lengths = np.linalg.norm(rows, axis=1)
    if not lengths.all() or abs(np.linalg.det(rows / lengths[:, None])) < _SMALLEST:
        raise InputError(
            where, f"the scale factors of {', '.join(instrument.channels)} cannot be inverted, expected "
            "independent axes"
        )  # fmt: skip


def _input(place: int) -> Monomial:
    """The input at a place of (a_x, a_y, a_z, w_x, w_y, w_z) alone."""
    a, b, c, d, e, f = (int(k == place) for k in range(6))
    return Monomial((a, b, c, d, e, f))


def with_stated(estimate: Estimate) -> Estimate:
    """The estimate with its stated terms among the coefficients, and their covariance with the fitted ones.

    A stated value that is too large makes fitted terms too small that act alike: what such a pair does to a corrected
    value partly cancels.
    """
    stated = {name: each for name, each in estimate.result.get("stated", {}).items() if each["u"]}
    if not stated:
        return estimate
    p, q = len(estimate.names), len(stated)
    covariance = np.zeros((p + q, p + q))
    covariance[:p, :p] = estimate.covariance
    for k, each in enumerate(stated.values(), start=p):
        covariance[k, k] = float(each["u"]) ** 2
        covariance[k, :p] = covariance[:p, k] = each["covariance"]
    return replace(
        estimate,
        names=(*estimate.names, *stated),
        units=(*estimate.units, *(str(each["unit"]) for each in stated.values())),
        values=np.append(estimate.values, [float(each["value"]) for each in stated.values()]),
        covariance=covariance,
        dof=np.append(estimate.dof, np.full(q, np.inf)),
    )


def not_applied(estimate: Estimate, where: object = "calibration") -> tuple[Finding, ...]:
    """``not_held``: coefficients that `table_instrument` leaves out."""
    kind = str(estimate.result.get("instrument"))
    known = {s for channel in CHANNELS.get(kind, ()) for s in channel_model(kind, channel).symbols}
    other = [name for name in estimate.names if name not in known]
    if not other:
        return ()
    text = f"{', '.join(other)}: not applied, they belong to the test of the calibration"
    return (Finding("not_held", text, str(where)),)
