"""Calibrations used: loaded, compared with each other, which is shown too, applied to recordings."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from inercal.faces.python.result import Result, View, loaded
from inercal.faces.report.html import Picture, page
from inercal.faces.report.marks import Axis, Bars, Dots, Level, Mark, Panel, Strips
from inercal.faces.report.panels import draw
from inercal.faces.report.style import ALARM, COLOURS
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding, Status
from inercal.foundation.instruments.terms import term
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate, timed
from inercal.foundation.results.shown import aligned, rounded, temperature
from inercal.systems.listed import SYSTEMS


def _of_comparison(estimate: Estimate, first: Estimate) -> Result:
    """The comparison of a calibration with the ``first`` as a result, in the units in which that is shown."""
    shown = _shown(estimate, first)
    view = View(
        shown,
        estimate.message,
        lambda: [_table(shown)],
        lambda: _page(shown),
        lambda: _picture(shown),
    )
    return Result(estimate, view)


def _shown(estimate: Estimate, first: Estimate) -> Estimate:
    """The comparison with its rows in the units in which the first calibration is shown."""
    lengths = ("first", "u_first", "second", "u_second", "difference", "u", "U")
    units, rows = first.shown_units(), []
    for row in estimate.result["coefficients"]:
        unit, size = units[row["name"]]
        rows.append({**row, **{key: row[key] / size for key in lengths}, "unit": unit})
    of_field = estimate.in_units([units[name] for name in estimate.names])
    return replace(of_field, result={**estimate.result, "coefficients": rows})


def compare(first: Result | Estimate | str | Path, second: Result | Estimate | str | Path) -> Result:
    """Compare two calibrations of one instrument, run to run.

    Parameters
    ----------
    first, second : Result, or path of a saved one
        The later one second.

    Returns
    -------
    Result
        The differences second - first; `Status.INCONSISTENT` where they are larger than their uncertainties explain.

    Raises
    ------
    InputError
        No coefficient in common, or a coefficient whose units do not agree.

    Examples
    --------
    >>> import inercal as ic
    >>> from inercal.examples import FOLDER
    >>> log = ic.read(FOLDER / "ferraris.csv.gz", map=FOLDER / "ferraris-map.toml")
    >>> found = ic.calibrate(log, gravity="9.81(1) m/s^2")
    >>> ic.compare(found, found)["K1_x"].value
    0.0
    """
    from inercal.foundation.records.read import source_of
    from inercal.foundation.results.compare import Saved
    from inercal.foundation.results.compare import compare as compared

    both = ((first, "first"), (second, "second"))
    files = [Saved(*estimate_of(each, where)) for each, where in both]
    inputs = tuple(source_of(each) for each, _ in both if isinstance(each, str | Path))
    clock = time.perf_counter()
    estimate = timed(compared(*files), clock)
    return _of_comparison(replace(estimate, inputs=inputs or estimate.inputs), files[0].estimate)


def apply(
    calibration: Result | Estimate | str | Path,
    record: Record,
    invert: bool = False,
    uncertainty: bool = False,
) -> Record:
    """Correct a recording with a calibration.

    Parameters
    ----------
    calibration : Result, or path of a saved one
        Of an IMU, an instrument on a turntable, a platform, or a temperature model.
    record : Record
        With the channels that were calibrated, in units of the same kind; of gyros whose drift depends on gravity also
        the specific force ``acc_x acc_y acc_z`` or the angles of the table, of a temperature model ``temperature``.
    invert : bool
        The record holds true values, and outputs of the instrument are made of them.
    uncertainty : bool
        Also the standard uncertainty of each corrected value by that of the coefficients, as columns ``u_acc_x``, ...

    Returns
    -------
    Record
        Specific force [m/s^2] and rate [rad/s] (``rate_x`` of an instrument that was calibrated on a turntable); its
        findings include those of the calibration.

    Raises
    ------
    InputError
        The calibration is of another instrument, or the record not of this one.

    Examples
    --------
    >>> import inercal as ic
    >>> from inercal.examples import FOLDER
    >>> log = ic.read(FOLDER / "ferraris.csv.gz", map=FOLDER / "ferraris-map.toml")
    >>> ic.apply(ic.calibrate(log, gravity="9.81 m/s^2"), log)["acc_x"].unit.symbol
    'm/s^2'
    """
    from inercal.faces.convert.correction import apply_to
    from inercal.faces.convert.models import model_of, worth_knowing

    estimate, where = estimate_of(calibration, "calibration")
    corrected = apply_to(record, model_of(estimate, where, uncertainty), invert)
    findings = (*worth_knowing(estimate, where), *worth_saying(corrected, estimate))
    return replace(corrected, findings=findings)


def worth_saying(record: Record, estimate: Estimate) -> tuple[Finding, ...]:
    """Findings of a record, but for the rate and the accelerometers that nobody needs of a platform."""
    from inercal.faces.convert.platform import COMMAND

    if estimate.command != COMMAND:
        return record.findings
    from inercal.systems.selfcal.reading import worth_saying as of_platform

    return tuple(of_platform(record, record.columns.values()))


def load(path: str | Path) -> Result:
    """Read a result that was saved, by `Result.save` or ``--out``, or that a digital calibration certificate states.

    Raises
    ------
    InputError
        In one sentence: no such file, or not one of inercal's.

    Examples
    --------
    >>> import inercal as ic, pathlib, tempfile
    >>> from inercal.examples import FOLDER
    >>> log = ic.read(FOLDER / "ferraris.csv.gz", map=FOLDER / "ferraris-map.toml")
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "cal.json"
    >>> _ = ic.calibrate(log, gravity="9.81 m/s^2").save(path)
    >>> ic.load(path).status.value
    'ok'
    """
    estimate = read_estimate(path)
    if estimate.command == "compare":
        return _of_comparison(estimate, estimate)
    of_command = (system.loaded for system in SYSTEMS.values() if system.command == estimate.command)
    return (next(of_command, None) or loaded)(estimate)


def read_estimate(path: str | Path) -> Estimate:
    """The estimate in a file: a result of inercal, or a digital calibration certificate (.xml).

    Raises `InputError` in one sentence.
    """
    if Path(path).suffix.lower() == ".xml":
        from inercal.laboratory.certificate.reading import estimate_of_certificate

        return estimate_of_certificate(path)
    from inercal.foundation.results.files import load as of_file

    return of_file(path)


def estimate_of(given: Result | Estimate | str | Path, where: str = "result") -> tuple[Estimate, str]:
    """The estimate of a result, or of the file of one, and what to call it."""
    match given:
        case Result():
            return given.estimate, where
        case Estimate():
            return given, where
        case str() | Path():
            return read_estimate(given), str(given)
        case _:
            raise InputError(
                where, f"found {type(given).__name__}, expected a result or the path of a saved one"
            )


_FAR = 4.0
"""Normalised error beyond which the axis of the picture becomes logarithmic."""


def _table(estimate: Estimate) -> str:
    """The comparison as aligned text, in the order of the coefficients; those that moved are marked."""
    head = ("", "first", "second", "second - first", "u", "E_n", "", "unit")
    lines = [head] + [
        (row["name"], *_numbers(row), _mark(row), row["unit"]) for row in estimate.result["coefficients"]
    ]
    return "\n".join(aligned(lines, (0, 6, 7)))


def _numbers(row: Mapping[str, Any]) -> tuple[str, ...]:
    """Both values, difference, its u and E_n as texts; the values to the digits that the difference needs."""
    first, second = (rounded(row[way], min(row[f"u_{way}"], row["u"]))[0] for way in ("first", "second"))
    return first, second, *rounded(row["difference"], row["u"])[:2], f"{row['normalised_error']:.2f}"


def _words(name: str) -> str:
    """The meaning of a coefficient, in words."""
    of = term(name)
    return "" if of is None else of.name


def _mark(row: Mapping[str, Any]) -> str:
    """The mark of a coefficient that moved, or is only beyond its own limit."""
    return "moved" if row["moved"] else "> 1" if row["normalised_error"] > 1.0 else ""


def _picture(estimate: Estimate) -> Picture:
    """Differences over their expanded uncertainties, with the band in which they are explained."""
    compared = estimate.result["coefficients"]
    names = [row["name"] for row in compared]
    over_U = np.array([np.copysign(row["normalised_error"], row["difference"]) for row in compared])
    over_U = np.clip(over_U, -1e6, 1e6)  # a coefficient without uncertainty
    moved = np.array([row["moved"] for row in compared])
    far = max(1.5, 1.15 * float(np.abs(over_U).max()))
    rows = np.arange(len(names))
    marks: list[Mark] = [Strips((-1.0, 1.0)), Level(0.0, upright=True)]
    for chosen, colour in ((~moved, COLOURS[0]), (moved, ALARM)):
        marks.append(Bars(rows[chosen], np.zeros(chosen.sum()), over_U[chosen], "", colour, 0.08))
        marks.append(Dots(over_U[chosen], rows[chosen], colour=colour))
    powers = (10.0 ** np.arange(1, int(np.log10(far)) + 1)).tolist()
    across = Axis(
        "difference / U",
        "symlog" if far > _FAR else "linear",
        (-far, far),
        ticks=[*(-power for power in powers[::-1]), -1.0, 0.0, 1.0, *powers] if far > _FAR else None,
        linear=2.0,
    )
    outside = " Logarithmic beyond ±2." if far > _FAR else ""
    return draw(
        "Differences over their uncertainties",
        "Second minus first over the expanded uncertainty of the difference; band: |E_n| ≤ 1. Red: moved by more than "
        f"chance explains among {len(names)} coefficients.{outside}",
        [[Panel(marks, across, Axis(names=names), grid="x")]],
        0.7 + 0.16 * len(names),
    )


def _page(estimate: Estimate) -> str:
    """The page of a comparison: HTML that needs nothing but itself."""
    result, given = estimate.result, estimate.provenance["settings"]
    facts = []
    for way in ("first", "second"):
        conditions = estimate.conditions[way]
        details = (Path(given[way]).name, conditions["date"], temperature(conditions["temperature"]))
        facts.append((way, "", ", ".join(filter(None, details))))
    facts += [(name, "", text) for name, text in estimate.traceability.items() if text]
    return page(
        "comparison.html",
        estimate,
        "Two calibrations compared",
        facts,
        f"the two calibrations {'agree' if estimate.status is Status.OK else 'differ'}",
        rows=[
            (
                row["name"],
                _words(row["name"]),
                *_numbers(row),
                _mark(row),
                row,
            )
            for row in result["coefficients"]
        ],
        pictures=[_picture(estimate)],
        missing=[(way, result[f"only_in_{way}"]) for way in ("first", "second") if result[f"only_in_{way}"]],
    )
