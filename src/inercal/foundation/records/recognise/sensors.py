"""Which columns are accelerometers and gyros, how sure that is and why: words first, then physics."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from inercal.foundation.arrays import Array
from inercal.foundation.records.recognise.physics import (
    SeenTurns,
    gravity_unit,
    is_direction,
    sphere,
    turns,
)
from inercal.foundation.records.recognise.sensor_units import (
    SensorFound,
    TriadOfColumns,
    may_be,
    with_acc_unit,
    with_gyro_unit,
)
from inercal.foundation.records.recognise.units import quoted
from inercal.foundation.records.recognise.words import (
    MEASURED,
    Said,
    device_of,
    is_one_of_several,
    said,
    sensors_named,
    words_of,
)
from inercal.foundation.records.titles import triads_by_name

Units = Sequence[str | None]


def sensors(
    names: Sequence[str],
    units: Units,
    values: Array,
    t: Array | None,
    file: str,
    called: Sequence[str],
    chosen: Mapping[str, str],
) -> list[SensorFound]:
    """The accelerometers and gyros among named columns.

    ``values`` (n, k) are the columns, ``names`` (k,) and ``units`` (k,) what is written above them, ``called`` (k,) the
    names as their count tells them, ``t`` (n,) [s] the times or None, ``file`` the name of the file, which speaks where
    it names one sensor and there is one triad; ``chosen`` the name of the first column by sensor, where that was asked.
    """
    if not any(names):
        return _nameless(values, t, file)
    units = units or (None,) * len(names)
    triads = _by_name(names, called, units, values, file)
    pairs = _in_pairs(triads, names, chosen)
    acc = _accelerometer(triads, values, pairs)
    found, rivals = _by_sphere(triads, values) if acc is None else ([with_acc_unit(acc, values)], [])
    if acc is None and found:
        acc = next(triad for triad in triads if triad.columns == found[0].columns)
    gyro, seen = _gyro([triad for triad in triads if triad not in rivals], acc, values, t, pairs)
    if gyro is not None:
        beside_counts = any("count" in triad.units for triad in found)
        found.append(with_gyro_unit(gyro, seen, values, t is not None, beside_counts))
    found = [_with_others(triad, triads, names) for triad in found]
    devices = [] if chosen.keys() & {"acc", "gyro"} else _devices(triads)
    if found and len(devices) > 1:
        asked = (
            f"Which of the devices {' and '.join(' '.join(device) for device in devices)} is meant? The first is "
            f"taken; for another answer with the name of its first column, as {found[0].sensor}="
            f"{_first_of(triads, found[0].sensor, devices[1], names)}."
        )
        found[0] = replace(found[0], grade="guess", question=asked)
    return [*found, *_known_force(names, units, values)]


def _known_force(names: Sequence[str], units: Sequence[str | None], values: Array) -> list[SensorFound]:
    """Columns such as ``x_true`` or ``up_x``: directions of specific force that are known, or this itself."""
    axes: dict[str, tuple[int, Said]] = {}
    for index, (name, unit) in enumerate(zip(names, units, strict=True)):
        words = said(name, unit)
        if words.axis and words.sensor in ("", "acc") and {"true", "up"} & set(words_of(name)):
            axes.setdefault(words.axis, (index, words))
    if len(axes) < 3:
        return []
    x, y, z = (axes[axis] for axis in "xyz")
    columns = x[0], y[0], z[0]
    stated = x[1].unit
    unit = stated if MEASURED.get(stated) == "acc" else ""
    if not unit:
        unit = "number" if is_direction(values[:, columns]) else gravity_unit(values[:, columns])
    if not unit or unit == "count":
        return []
    return [
        SensorFound("up", columns, (unit,) * 3, "certain", f"the header says {quoted(names[x[0]].strip())}")
    ]


def _by_name(
    names: Sequence[str], called: Sequence[str], units: Units, values: Array, file: str
) -> list[TriadOfColumns]:
    """Columns whose names differ in their axis alone, but for those that no sensor bears."""
    groups: dict[tuple[str, str], dict[str, tuple[int, Said]]] = {}
    usable = [bool(np.isfinite(column).any()) for column in values.T]
    for index, (name, unit) in enumerate(zip(called, units, strict=True)):
        words = said(name, unit)
        if usable[index] and words.axis and not words.never and words.sensor in ("", "acc", "gyro"):
            groups.setdefault((words.sensor, words.stem), {}).setdefault(words.axis, (index, words))
    full = [(key[0], axes) for key, axes in groups.items() if len(axes) == 3]
    hints = sensors_named(file.rpartition(".")[0])
    if not any(sensor == "gyro" for sensor, _ in full):
        # the rates of aircraft, beside accelerometers
        rates = {axis: _lone(letter, names, units) for axis, letter in zip("xyz", "pqr", strict=True)}
        rolls = {axis: rate for axis, rate in rates.items() if rate is not None}
        full += [("gyro", rolls)] if len(rolls) == 3 and any(sensor == "acc" for sensor, _ in full) else []
    if full:
        # three names that are alike but for x, y, z, though no word is known in them
        taken = {index for _, axes in full for index, _ in axes.values()}
        for alike in triads_by_name(called):
            spoken = [said(called[index], units[index]) for index in alike]
            plain = all(not word.never and word.sensor in ("", "t") and not word.axis for word in spoken)
            if plain and not taken & set(alike) and all(usable[index] for index in alike):
                axes = {
                    axis: (column, replace(word, sensor="", axis=axis))
                    for axis, column, word in zip(("x", "y", "z"), alike, spoken, strict=True)
                }
                full.append(("", axes))
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
            found.append(TriadOfColumns(sensor, columns, (x[1], y[1], z[1]), reason, device_of(called[x[0]])))
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
        TriadOfColumns(
            "", (k, k + 1, k + 2), (Said(), Said(), Said()), f"columns {k} to {k + 2} have no names"
        )
        for k in able
        if {k + 1, k + 2} <= set(able)
    ]
    hints = sensors_named(file.rpartition(".")[0])
    if len(able) == 3 and len(windows) == 1 and len(hints) == 1 and hints[0] != "mag":
        only = replace(windows[0], sensor=hints[0], reason=f"the name says {quoted(file)}")
        if hints[0] == "acc":
            return [with_acc_unit(only, values)]
        return [with_gyro_unit(only, None, values, t is not None, False)]
    steady = [window for window in windows if gravity_unit(values[:, window.columns])]
    if not steady:
        return _by_sphere(windows, values)[0]
    first = min(steady, key=lambda window: (_unlike(values[:, window.columns]), window.columns))
    found = [with_acc_unit(first, values)]
    apart = [window for window in windows if not set(window.columns) & set(first.columns)]
    rows = np.arange(len(values), dtype=float) if t is None else t
    seen = [(turns(values[:, first.columns], values[:, window.columns], rows), window) for window in apart]
    turned = [(fit, window) for fit, window in seen if fit is not None]
    if turned:
        fit, window = min(
            turned, key=lambda each: sum(axis not in (0, k) for k, axis in enumerate(each[0].axes, 1))
        )
        return [*found, with_gyro_unit(window, fit, values, t is not None, "count" in found[0].units)]
    if len(apart) == 1:
        gyro = with_gyro_unit(apart[0], None, values, t is not None, "count" in found[0].units)
        asked = gyro.question or (
            f"Are columns {apart[0].columns[0]} to {apart[0].columns[2]} the gyro, in {gyro.units[0]}?"
        )
        found.append(replace(gyro, grade="guess", question=asked))
    return found


def _by_sphere(
    triads: Sequence[TriadOfColumns], values: Array
) -> tuple[list[SensorFound], list[TriadOfColumns]]:
    """The triad without a word that lies on a sphere about any centre, as accelerometers with a large bias do, and the
    others that do so: a magnetometer scatters more, and which is which is asked."""
    free = [triad for triad in triads if not triad.sensor]
    spheres = [(fit, triad) for triad in free if (fit := sphere(values[:, triad.columns])) is not None]
    if not spheres:
        return [], []
    spheres.sort(key=lambda each: each[0].scatter)
    best = spheres[0][1]
    rivals = [(fit, each) for fit, each in spheres[1:] if not set(each.columns) & set(best.columns)]
    found = with_acc_unit(best, values)
    place = f"columns {best.columns[0]} to {best.columns[2]}"
    asked = (
        f"Are {place} the accelerometers, in {found.units[0]}? They lie on a sphere, as a magnetometer does."
    )
    if rivals:
        fit, other = rivals[0]
        asked = (
            f"Are {place} the accelerometers, in {found.units[0]}, and {other.columns[0]} to {other.columns[2]} a "
            f"magnetometer? Both lie on a sphere, these with {fit.scatter / spheres[0][0].scatter:.2g} times the "
            "scatter."
        )
    return [replace(found, grade="guess", question=asked)], [each for _, each in rivals]


def _unlike(triad: Array) -> float:
    """The ratio of the largest to the least noise of three columns, in halves of a decade."""
    noise = np.median(np.abs(np.diff(triad, axis=0)), axis=0)
    return float(np.round(2.0 * np.log10(max(noise.max(), 1e-12) / max(noise.min(), 1e-12))))


def _lone(letter: str, names: Sequence[str], units: Units) -> tuple[int, Said] | None:
    """The only column whose name is that letter and perhaps a unit of rate."""
    found = []
    for index, (name, unit) in enumerate(zip(names, units, strict=True)):
        words = said(name, unit)
        if words_of(name)[:1] == [letter] and (words.stem == f"{letter} |") and may_be(words.unit, "gyro"):
            found.append((index, words))
    return found[0] if len(found) == 1 else None


def _plain(triads: Sequence[TriadOfColumns], sensor: str) -> list[TriadOfColumns]:
    """The triads that words call a sensor; those whose names give way to plain ones only where there are no others."""
    named = [triad for triad in triads if triad.sensor == sensor]
    return [triad for triad in named if not triad.said[0].seldom] or named


def _in_pairs(
    triads: Sequence[TriadOfColumns], names: Sequence[str], chosen: Mapping[str, str]
) -> list[TriadOfColumns]:
    """The triads of devices that have both sensors; of the device whose column was chosen, and those columns, alone."""
    for sensor, name in chosen.items():
        picked = [triad for triad in triads if name.strip() == names[triad.columns[0]].strip()]
        if sensor in ("acc", "gyro") and picked:
            return [triad for triad in triads if triad is picked[0] or triad.device == picked[0].device]
    of_both = {triad.device for triad in _plain(triads, "acc")} & {
        triad.device for triad in _plain(triads, "gyro")
    }
    return [triad for triad in triads if triad.device in of_both]


def _devices(triads: Sequence[TriadOfColumns]) -> list[tuple[str, ...]]:
    """The devices, in order, whose every sensor is there as often as there are devices."""
    kinds = [kind for kind in (_plain(triads, "acc"), _plain(triads, "gyro")) if kind]
    named = [[triad.device for triad in kind] for kind in kinds]
    first = named[0] if named else []
    alike = all(sorted(devices) == sorted(first) for devices in named)
    told_apart = () not in first and (len(kinds) > 1 or all(map(is_one_of_several, first)))
    return list(dict.fromkeys(first)) if alike and len(set(first)) > 1 and told_apart else []


def _first_of(
    triads: Sequence[TriadOfColumns], sensor: str, device: tuple[str, ...], names: Sequence[str]
) -> str:
    """The name of the first column of a sensor of a device."""
    return next(
        names[triad.columns[0]] for triad in triads if (triad.sensor, triad.device) == (sensor, device)
    )


def _with_others(found: SensorFound, triads: Sequence[TriadOfColumns], names: Sequence[str]) -> SensorFound:
    """A sensor with words on the triads of the same kind that were not taken."""
    others = [
        names[triad.columns[0]].strip()
        for triad in triads
        if triad.sensor == found.sensor and triad.columns != found.columns
    ]
    if not others:
        return found
    return replace(found, reason=f"{found.reason}; not taken: {', '.join(map(quoted, others[:3]))}")


def _accelerometer(
    triads: Sequence[TriadOfColumns], values: Array, pairs: Sequence[TriadOfColumns]
) -> TriadOfColumns | None:
    """The accelerometer: by words, and of several the first with the norm of gravity, best of a device that has a gyro,
    too; else by that norm alone."""
    plain = _plain(pairs, "acc") or _plain(triads, "acc")
    steady = [triad for triad in plain or triads if gravity_unit(values[:, triad.columns])]
    if plain:
        return (steady or plain)[0]
    steady = [triad for triad in steady if triad.sensor == ""]
    return steady[0] if len(steady) == 1 else None


def _gyro(
    triads: Sequence[TriadOfColumns],
    acc: TriadOfColumns | None,
    values: Array,
    t: Array | None,
    pairs: Sequence[TriadOfColumns],
) -> tuple[TriadOfColumns | None, SeenTurns | None]:
    """The gyro: by words, best of the accelerometer's device, else the triad whose turns the accelerometers see; and
    these turns, where they are seen."""
    able = _plain(triads, "gyro")
    of_device = [triad for triad in _plain(pairs, "gyro") if acc is not None and triad.device == acc.device]
    rows = np.arange(len(values), dtype=float) if t is None else t

    def seen(triad: TriadOfColumns) -> SeenTurns | None:
        return None if acc is None else turns(values[:, acc.columns], values[:, triad.columns], rows)

    if able:
        first = (of_device or able)[0]
        return first, seen(first)
    free = [triad for triad in triads if triad.sensor == "" and triad is not acc]
    return next(((triad, fit) for triad in free if (fit := seen(triad)) is not None), (None, None))
