"""Units of triads that were recognised: as stated, by gravity and turns, by the steps of a converter, or a question."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.records.limits import LIMITS
from inercal.foundation.records.recognise.physics import (
    G0,
    SIZES,
    SeenTurns,
    gravity_unit,
    is_whole,
    lattice_unit,
    norm_of,
    sphere,
)
from inercal.foundation.records.recognise.words import MEASURED, Said

_FULL_SCALE = 2100.0  # deg/s


@dataclass(frozen=True)
class SensorFound:
    """Three columns of a table, in the order x, y, z, taken for a sensor (``acc`` or ``gyro``), or ``up``, what is
    known of specific force.

    ``grade`` is ``certain`` (words for the sensor and words or physics for the unit), ``likely`` (physics alone, one
    reading) or ``guess``, which has a ``question``; ``reason`` says why in one line.
    """

    sensor: str
    columns: tuple[int, int, int]
    units: tuple[str, str, str]
    grade: str
    reason: str
    question: str = ""


@dataclass(frozen=True)
class TriadOfColumns:
    """Three columns that may be a sensor (``acc``, ``gyro``, or empty where no word says it): what their names say,
    why, and the ``device`` that these name besides, if any."""

    sensor: str
    columns: tuple[int, int, int]
    said: tuple[Said, Said, Said]
    reason: str
    device: tuple[str, ...] = ()


def may_be(unit: str, sensor: str) -> bool:
    """True for a unit of what the sensor measures, a count, or none."""
    return not unit or unit == "count" or MEASURED.get(unit) == sensor


def with_acc_unit(triad: TriadOfColumns, values: Array) -> SensorFound:
    """An accelerometer with its units; ``values`` (n, k) are all columns."""
    stated = tuple(word.unit for word in triad.said)
    norm, scatter = norm_of(values[:, triad.columns])
    unit = gravity_unit(values[:, triad.columns])
    words = "certain" if triad.sensor else "likely"
    round_about = None if unit else sphere(values[:, triad.columns])
    if all(stated) and all(may_be(each, "acc") for each in stated):
        reason = f"{triad.reason}; with this unit" + _of_several(stated)
        size = SIZES.get(stated[0])
        seen = norm if round_about is None else round_about.radius
        if size is not None and (
            abs(seen * size / G0 - 1.0) > 0.04 or (scatter > 0.08 and round_about is None)
        ):
            reason += f", though the median norm is {norm:.4g}, not gravity"
        return SensorFound("acc", triad.columns, (stated[0], stated[1], stated[2]), words, reason)
    if unit and unit != "count":
        return _alike("acc", triad, unit, words, f"the median norm is {norm:.4g}, gravity in {unit}")
    whole = is_whole(values[:, triad.columns])
    if round_about is not None:
        norm = round_about.radius
        centre = ", ".join(f"{place:.4g}" for place in round_about.centre)
        around = f"all lie on a sphere of radius {norm:.4g} about {centre}"
    near = min(("m/s^2", "g", "mg"), key=lambda each: abs(np.log(max(norm, 1e-9) * SIZES[each] / G0)))
    if not whole and abs(norm * SIZES[near] / G0 - 1.0) < (0.15 if round_about is None else 0.06):
        seen_as = f"the median norm is {norm:.4g}, near to" if round_about is None else f"{around},"
        return _alike("acc", triad, near, "likely", f"{seen_as} gravity in {near}")
    reason = f"the median norm is {norm:.5g}" if round_about is None else around
    reason += ", gravity in neither m/s^2 nor g" + (", whole numbers" if whole else "")
    return _alike("acc", triad, "count", "likely", reason)


def with_gyro_unit(
    triad: TriadOfColumns, seen: SeenTurns | None, values: Array, timed: bool, beside_counts: bool
) -> SensorFound:
    """A gyro with its units: as stated, by its turns, by the steps of its converter, or by its reach, which beside
    accelerometers in counts is that of counts where it is too large for deg/s."""
    rates = values[:, triad.columns]
    stated = tuple(word.unit for word in triad.said)
    words = "certain" if triad.sensor else "likely"
    triad = replace(triad, reason=triad.reason + turned_otherwise(seen))
    if all(stated) and all(may_be(each, "gyro") for each in stated):
        reason = f"{triad.reason}; with this unit" + _of_several(stated)
        if seen is not None and timed and stated[0] in SIZES:
            reason += contradiction(SIZES[stated[0]] / seen.size)
        return SensorFound("gyro", triad.columns, (stated[0], stated[1], stated[2]), words, reason)
    if is_whole(rates):
        reason = "all are whole numbers"
        if seen is not None and timed and abs(SIZES["deg/s"] / seen.size - 1.0) < 0.15:
            reason += ", which by the turns that the accelerometers see are deg/s"
            return _alike("gyro", triad, "deg/s", words, reason)
        if triad.sensor and "gyroADC" in triad.reason and np.nanmax(np.abs(rates)) <= _FULL_SCALE:
            return _alike("gyro", triad, "deg/s", "likely", f"{reason}, which Betaflight writes in deg/s")
        if seen is not None and timed:
            reason += (
                f"; by the turns that the accelerometers see {SIZES['deg/s'] / seen.size:.4g} for 1 deg/s"
            )
        return _alike("gyro", triad, "count", "likely", reason)
    if seen is not None and timed:
        near = min(
            ("rad/s", "deg/s", "mrad/s", "mdeg/s"), key=lambda each: abs(np.log(SIZES[each] / seen.size))
        )
        if abs(SIZES[near] / seen.size - 1.0) < 0.15:
            share = seen.size / SIZES[near]
            reason = f"the turns that the accelerometers see say {near} ({share:.3f}, u {seen.u:.1%})"
            return _alike("gyro", triad, near, words, reason)
    if unit := lattice_unit(rates):
        return _alike("gyro", triad, unit, "likely", f"all lie on steps of a converter, written in {unit}")
    reach = float(np.nanmax(np.abs(rates - np.nanmedian(rates, axis=0))))
    if reach > 35.0:
        if reach < 4100.0:
            reason = f"the largest move is {reach:.4g}, which is none in rad/s"
            return _alike("gyro", triad, "deg/s", "likely", reason)
        reason = f"the largest move is {reach:.4g}, which is none in deg/s"
        return _alike("gyro", triad, "count" if beside_counts else "mdeg/s", "likely", reason)
    noise = float(np.nanmedian(np.abs(np.diff(rates, axis=0))))
    unit = "deg/s" if noise > 0.012 and reach > 5.0 else "rad/s"
    reason = f"the largest move is {reach:.3g} and the noise {noise:.2g}"
    other = "rad/s" if unit == "deg/s" else "deg/s"
    question = f"Is the gyro in {unit} or {other}? It moves by {reach:.3g}, and nothing else tells."
    return _alike("gyro", triad, unit, "guess", reason, question)


def contradiction(ratio: float) -> str:
    """Words on a gyro that shows ``ratio`` times the turns that the accelerometers see; empty where it agrees."""
    if LIMITS.seen_rate_low < ratio < LIMITS.seen_rate_high:
        return ""
    cause = ""
    if min(abs(ratio / 2.0 - 1.0), abs(2.0 * ratio - 1.0)) < 0.1:
        cause = " (the full-scale range, or the stamps, are off by two)"
    return f", though it shows {ratio:.3g} times the turns that the accelerometers see{cause}"


class WithAxes(Protocol):
    """Turns that accelerometers see, by the axes of a gyro."""

    @property
    def axes(self) -> tuple[int, int, int]:
        """As of `inercal.foundation.records.recognise.physics.SeenTurns`."""


def turned_otherwise(seen: WithAxes | None) -> str:
    """The axes of a gyro that turn about others than the accelerometers see, or the other way, in words."""
    if seen is None:
        return ""
    odd = [
        f"{own} turns as {'-' if axis < 0 else ''}{'xyz'[abs(axis) - 1]} of the accelerometers"
        for own, axis in zip("xyz", seen.axes, strict=True)
        if axis and axis != "xyz".index(own) + 1
    ]
    return f", though its {', its '.join(odd)}" if odd else ""


def _of_several(stated: tuple[str, ...]) -> str:
    """Words on axes of one triad that are stated in several units."""
    return f", though its axes are in {', '.join(stated)}" if len(set(stated)) > 1 else ""


def _alike(
    sensor: str, triad: TriadOfColumns, unit: str, grade: str, reason: str, question: str = ""
) -> SensorFound:
    """A triad with one unit."""
    return SensorFound(
        sensor, triad.columns, (unit, unit, unit), grade, f"{triad.reason}; {reason}", question
    )
