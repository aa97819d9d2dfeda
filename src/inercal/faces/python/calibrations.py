"""Calibrations used: loaded, compared with each other, applied to recordings."""

from __future__ import annotations

import time
from dataclasses import replace
from pathlib import Path

from inercal.faces.python.result import Result, View, loaded
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import Estimate, timed
from inercal.systems.listed import SYSTEMS


def _of_comparison(estimate: Estimate, first: Estimate) -> Result:
    """The comparison of a calibration with the ``first`` as a result, in the units in which that is shown."""
    from inercal.faces.report.comparison import page, picture, table

    shown = _shown(estimate, first)
    view = View(
        shown,
        estimate.message,
        lambda: [table(shown)],
        lambda: page(shown),
        lambda: picture(shown),
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
