"""Which columns are accelerometers and gyros, in which units, how sure that is and why: words first, then physics."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.records.recognise.physics import (
    G0,
    SIZES,
    SeenTurns,
    gravity_unit,
    is_direction,
    is_whole,
    lattice_unit,
    norm_of,
    turns,
)
from inercal.foundation.records.recognise.units import quoted
from inercal.foundation.records.recognise.words import MEASURED, Said, said, sensors_named, words_of

_FULL_SCALE = 2100.0  # deg/s


@dataclass(frozen=True)
class SensorFound:
    """Three columns of a table, in the order x, y, z, taken for a sensor (``acc`` or ``gyro``).

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
class _Named:
    """A triad by the names of its columns."""

    sensor: str
    columns: tuple[int, int, int]
    said: tuple[Said, Said, Said]
    reason: str


def sensors(
    names: Sequence[str], units: Sequence[str | None], values: Array, t: Array | None, file: str
) -> list[SensorFound]:
    """The accelerometers and gyros among named columns.

    ``values`` (n, k) are the columns, ``names`` (k,) and ``units`` (k,) what is written above them, ``t`` (n,) [s]
    the times or None, ``file`` the name of the file, which speaks where it names one sensor and there is one triad.
    """
    if not any(names):
        return _nameless(values, t, file)
    triads = _by_name(names, units or (None,) * len(names), values, file)
    acc = _accelerometer(triads, values)
    found = [] if acc is None else [_with_acc_unit(acc, values)]
    gyro, seen = _gyro(triads, acc, values, t)
    if gyro is not None:
        beside_counts = any("count" in triad.units for triad in found)
        found.append(_with_gyro_unit(gyro, seen, values, t is not None, beside_counts))
    return found


def _by_name(names: Sequence[str], units: Sequence[str | None], values: Array, file: str) -> list[_Named]:
    """Columns whose names differ in their axis alone, but for those that no sensor bears."""
    groups: dict[tuple[str, str], dict[str, tuple[int, Said]]] = {}
    for index, (name, unit) in enumerate(zip(names, units, strict=True)):
        words = said(name, unit)
        usable = np.isfinite(values[:, index]).any() and words.axis and not words.never
        if usable and words.sensor in ("", "acc", "gyro"):
            groups.setdefault((words.sensor, words.stem), {}).setdefault(words.axis, (index, words))
    full = [(key[0], axes) for key, axes in groups.items() if len(axes) == 3]
    hints = sensors_named(file.rpartition(".")[0])
    if not any(sensor == "gyro" for sensor, _ in full):
        # the rates of aircraft, beside accelerometers
        rates = {axis: _lone(letter, names, units) for axis, letter in zip("xyz", "pqr", strict=True)}
        rolls = {axis: rate for axis, rate in rates.items() if rate is not None}
        full += [("gyro", rolls)] if len(rolls) == 3 and any(sensor == "acc" for sensor, _ in full) else []
    found = []
    for sensor, axes in full:
        x, y, z = (axes[axis] for axis in "xyz")
        columns = x[0], y[0], z[0]
        if is_direction(values[:, columns]):
            continue
        reason = f"the header says {quoted(names[x[0]].strip())}"
        if not sensor and len(hints) == 1 and len(full) == 1:
            sensor, reason = hints[0], f"the file is called {quoted(file)}"
        if sensor != "mag":
            found.append(_Named(sensor, columns, (x[1], y[1], z[1]), reason))
    return found


def _nameless(values: Array, t: Array | None, file: str) -> list[SensorFound]:
    """The sensors among columns without names: three beside each other with the norm of gravity are accelerometers,
    and a gyro those whose turns these see; of a file that is called after one sensor the only three are that."""
    able = [
        index
        for index in range(values.shape[1])
        if np.isfinite(values[:, index]).mean() > 0.9
        and np.nanstd(values[:, index]) > 0.0
        and not (np.diff(values[:, index]) >= 0.0).all()
    ]
    windows = [
        _Named("", (k, k + 1, k + 2), (Said(), Said(), Said()), f"columns {k} to {k + 2} have no names")
        for k in able
        if {k + 1, k + 2} <= set(able)
    ]
    hints = sensors_named(file.rpartition(".")[0])
    if len(able) == 3 and len(windows) == 1 and len(hints) == 1 and hints[0] != "mag":
        only = replace(windows[0], sensor=hints[0], reason=f"the name says {quoted(file)}")
        if hints[0] == "acc":
            return [_with_acc_unit(only, values)]
        return [_with_gyro_unit(only, None, values, t is not None, False)]
    steady = [window for window in windows if gravity_unit(values[:, window.columns])]
    if not steady:
        return []
    first = min(steady, key=lambda window: (_unlike(values[:, window.columns]), window.columns))
    found = [_with_acc_unit(first, values)]
    apart = [window for window in windows if not set(window.columns) & set(first.columns)]
    rows = np.arange(len(values), dtype=float) if t is None else t
    seen = [(turns(values[:, first.columns], values[:, window.columns], rows), window) for window in apart]
    turned = [(fit, window) for fit, window in seen if fit is not None]
    if turned:
        fit, window = min(
            turned, key=lambda each: sum(axis not in (0, k) for k, axis in enumerate(each[0].axes, 1))
        )
        return [*found, _with_gyro_unit(window, fit, values, t is not None, "count" in found[0].units)]
    if len(apart) == 1:
        gyro = _with_gyro_unit(apart[0], None, values, t is not None, "count" in found[0].units)
        asked = gyro.question or (
            f"Are columns {apart[0].columns[0]} to {apart[0].columns[2]} the gyro, in {gyro.units[0]}?"
        )
        found.append(replace(gyro, grade="guess", question=asked))
    return found


def _unlike(triad: Array) -> float:
    """The ratio of the largest to the least noise of three columns, in halves of a decade."""
    noise = np.median(np.abs(np.diff(triad, axis=0)), axis=0)
    return float(np.round(2.0 * np.log10(max(noise.max(), 1e-12) / max(noise.min(), 1e-12))))


def _lone(letter: str, names: Sequence[str], units: Sequence[str | None]) -> tuple[int, Said] | None:
    """The only column whose name is that letter and perhaps a unit of rate."""
    found = []
    for index, (name, unit) in enumerate(zip(names, units, strict=True)):
        words = said(name, unit)
        if words_of(name)[:1] == [letter] and (words.stem == f"{letter} |") and _may_be(words.unit, "gyro"):
            found.append((index, words))
    return found[0] if len(found) == 1 else None


def _may_be(unit: str, sensor: str) -> bool:
    """True for a unit of what the sensor measures, a count, or none."""
    return not unit or unit == "count" or MEASURED.get(unit) == sensor


def _accelerometer(triads: Sequence[_Named], values: Array) -> _Named | None:
    """The accelerometer: by words, and of several the first with the norm of gravity; else by that norm alone."""
    named = [triad for triad in triads if triad.sensor == "acc"]
    plain = [triad for triad in named if not triad.said[0].seldom] or named
    steady = [triad for triad in plain or triads if gravity_unit(values[:, triad.columns])]
    if plain:
        return (steady or plain)[0]
    steady = [triad for triad in steady if triad.sensor == ""]
    return steady[0] if len(steady) == 1 else None


def _gyro(
    triads: Sequence[_Named], acc: _Named | None, values: Array, t: Array | None
) -> tuple[_Named | None, SeenTurns | None]:
    """The gyro: by words, else the triad whose turns the accelerometers see; and these turns, where they are seen."""
    named = [triad for triad in triads if triad.sensor == "gyro"]
    able = [triad for triad in named if not triad.said[0].seldom] or named
    rows = np.arange(len(values), dtype=float) if t is None else t

    def seen(triad: _Named) -> SeenTurns | None:
        return None if acc is None else turns(values[:, acc.columns], values[:, triad.columns], rows)

    if able:
        return able[0], seen(able[0])
    free = [triad for triad in triads if triad.sensor == "" and triad is not acc]
    return next(((triad, fit) for triad in free if (fit := seen(triad)) is not None), (None, None))


def _with_acc_unit(triad: _Named, values: Array) -> SensorFound:
    """The accelerometer with its units."""
    stated = tuple(word.unit for word in triad.said)
    norm, scatter = norm_of(values[:, triad.columns])
    unit = gravity_unit(values[:, triad.columns])
    words = "certain" if triad.sensor else "likely"
    if all(stated) and all(_may_be(each, "acc") for each in stated):
        reason = f"{triad.reason}; with this unit"
        size = SIZES.get(stated[0])
        if size is not None and (abs(norm * size / G0 - 1.0) > 0.04 or scatter > 0.08):
            reason += f", though the median norm is {norm:.4g}, not gravity"
        return SensorFound("acc", triad.columns, (stated[0], stated[1], stated[2]), words, reason)
    if unit and unit != "count":
        return _alike("acc", triad, unit, words, f"the median norm is {norm:.4g}, gravity in {unit}")
    whole = is_whole(values[:, triad.columns])
    near = min(("m/s^2", "g", "mg"), key=lambda each: abs(np.log(max(norm, 1e-9) * SIZES[each] / G0)))
    if not whole and abs(norm * SIZES[near] / G0 - 1.0) < 0.15:
        reason = f"the median norm is {norm:.4g}, near to gravity in {near}"
        return _alike("acc", triad, near, "likely", reason)
    reason = f"the median norm is {norm:.5g}, gravity in neither m/s^2 nor g"
    return _alike("acc", triad, "count", "likely", reason + (", whole numbers" if whole else ""))


def _with_gyro_unit(
    triad: _Named, seen: SeenTurns | None, values: Array, timed: bool, beside_counts: bool
) -> SensorFound:
    """The gyro with its units: as stated, by its turns, by the steps of its converter, or by its reach, which beside
    accelerometers in counts is that of counts where it is too large for deg/s."""
    rates = values[:, triad.columns]
    stated = tuple(word.unit for word in triad.said)
    words = "certain" if triad.sensor else "likely"
    if all(stated) and all(_may_be(each, "gyro") for each in stated):
        reason = f"{triad.reason}; with this unit"
        if seen is not None and timed and stated[0] in SIZES:
            ratio = SIZES[stated[0]] / seen.size
            if not 0.85 < ratio < 1.18:
                reason += f", though it shows {ratio:.3g} times the turns that the accelerometers see"
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


def _alike(sensor: str, triad: _Named, unit: str, grade: str, reason: str, question: str = "") -> SensorFound:
    """A triad with one unit."""
    return SensorFound(
        sensor, triad.columns, (unit, unit, unit), grade, f"{triad.reason}; {reason}", question
    )
