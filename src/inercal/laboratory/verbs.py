"""The laboratory in Python: results kept, and the history of an instrument."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from datetime import date
from pathlib import Path
from typing import TYPE_CHECKING, Any

from inercal.faces.python.calibrations import estimate_of
from inercal.faces.python.result import Result, View
from inercal.foundation.errors import InputError, StudyError
from inercal.foundation.inputs import Source
from inercal.foundation.results.result import Estimate

if TYPE_CHECKING:
    from inercal.laboratory.specification import Specification


def keep(
    result: Result | Estimate | str | Path, instrument: str | None = None, store: str | None = None
) -> str:
    """Keep a result in the store of the laboratory, with the files it rests on.

    Parameters
    ----------
    result : Result, or path of a saved one
    instrument : str, optional
        "maker, model, serial", where its study does not say.
    store : str, optional
        Folder or URL of the store; that of INERCAL_STORE, else the user's own, if absent.

    Returns
    -------
    str
        Its identity in the store; the same result again has the same.

    Raises
    ------
    InputError
        No store there, or no instrument.

    Examples
    --------
    >>> import inercal as ic, pathlib, tempfile
    >>> from inercal.examples import FOLDER
    >>> from inercal.laboratory.store import make_store
    >>> place = make_store(str(pathlib.Path(tempfile.mkdtemp()) / "store")).where
    >>> log = ic.read(FOLDER / "ferraris.csv.gz", map=FOLDER / "ferraris-map.toml")
    >>> found = ic.calibrate(log, gravity="9.81 m/s^2")
    >>> identity = ic.keep(found, "Portabiles, NilsPod, 2", store=place)
    >>> identity == ic.keep(found, "Portabiles, NilsPod, 2", store=place)
    True
    """
    from inercal.laboratory.keep import item_of, saved_in
    from inercal.laboratory.keep import keep as kept
    from inercal.laboratory.store import open_store

    estimate, _ = estimate_of(result)
    saved = saved_in(Path(result), estimate) if isinstance(result, str | Path) else None
    return kept(open_store(store), estimate, item_of(estimate, instrument), saved=saved).id


def history(
    *of: str | Path | Result,
    coefficients: Sequence[str] | None = None,
    tolerance: Specification | None = None,
    at: date | None = None,
    store: str | None = None,
) -> Result:
    """Follow the coefficients of an instrument from calibration to calibration.

    Parameters
    ----------
    *of : str, Path or Result
        The serial number of an instrument in the store; or results of one instrument, or the files of such.
    coefficients : sequence of str, optional
        The coefficients wanted, or groups such as ``K1``; all if absent.
    tolerance : Specification, optional
        Tolerances with their rule of decision (`inercal.laboratory.specification.specification_of`); those of the
        last result's study if absent.
    at : date, optional
        For which values are predicted; a year after the last calibration if absent.
    store : str, optional
        As of `keep`.

    Returns
    -------
    Result
        Charts, drift, random walk, predicted values with U and dates of the next calibration in
        ``estimate.result``; `Status.INCONSISTENT` where the last calibration alarms or is outside a tolerance.

    Raises
    ------
    InputError
        No such instrument, file or coefficient, or no calibration that is ok.

    Examples
    --------
    >>> import inercal as ic
    >>> from inercal.examples import FOLDER
    >>> log = ic.read(FOLDER / "ferraris.csv.gz", map=FOLDER / "ferraris-map.toml")
    >>> found = ic.calibrate(log, gravity="9.81(1) m/s^2")
    >>> ic.history(found, found, found, coefficients=["K1"]).status.value
    'ok'
    """
    from inercal.laboratory.history import history as history_of
    from inercal.laboratory.history_page import estimate_of as estimated
    from inercal.laboratory.history_page import page, pictures, table

    inputs: tuple[Source, ...] = ()
    if len(of) == 1 and isinstance(of[0], str) and not Path(of[0]).is_file():
        from inercal.laboratory.catalog import show, values_of
        from inercal.laboratory.store import open_store

        opened, name = open_store(store), of[0]
        rows = values_of(opened, name)
        last = show(opened, rows[-1]["id"]).estimate if rows and tolerance is None else None
    else:
        name, rows, inputs = _of_results(of)
        last = estimate_of(of[-1])[0]
    if tolerance is None and last is not None:
        tolerance = _stated(last)
    found = history_of(rows, name, coefficients, tolerance, at)
    estimate = estimated(found, inputs)
    view = View(
        estimate,
        found.message,
        lambda: [table(found)],
        lambda: page(found, estimate),
        lambda: pictures(found)[0],
    )
    return Result(estimate, view, found)


def _stated(estimate: Estimate) -> Specification | None:
    """Tolerances that the study of a result states, None without any."""
    from inercal.laboratory.specification import specification_of

    settings = estimate.provenance.get("settings")
    table = settings.get("specification") if isinstance(settings, Mapping) else None
    return specification_of(table, "the study of the last result") if isinstance(table, Mapping) else None


def _of_results(of: Sequence[str | Path | Result]) -> tuple[str, list[dict[str, Any]], tuple[Source, ...]]:
    """Name of the instrument, rows and files of results that are handed in."""
    from inercal.foundation.records.read import source_of
    from inercal.laboratory.keep import coefficients_of, item_of

    rows: list[dict[str, Any]] = []
    items, inputs = set(), []
    for k, each in enumerate(of):
        estimate, _ = estimate_of(each, f"result {k + 1}")
        if not isinstance(each, Result):
            inputs.append(source_of(Path(each)))
        items.add(str(item_of(estimate) or "an instrument"))
        day = estimate.traceability.get("date", "")
        head = {
            "id": f"{k + 1}",
            "command": estimate.command,
            "status": estimate.status.value,
            "measured": day,
        }
        head["made"] = date.today().isoformat()
        rows += [{**head, "position": i, **row} for i, row in enumerate(coefficients_of(estimate))]
    if len(items) > 1:
        raise InputError(
            "history", f"found results of {' and '.join(sorted(items))}, expected one instrument"
        )
    return items.pop() if items else "", rows, tuple(inputs)


def specification_in(path: Path) -> Specification:
    """The table ``[specification]`` of a TOML file; raises `InputError`."""
    from inercal.foundation._toml import read_toml
    from inercal.laboratory.specification import specification_of

    table = read_toml(path, StudyError).get("specification")
    if not isinstance(table, dict) or not table:
        raise InputError(path, "holds no table [specification], expected one with the tolerances")
    return specification_of(table, path)
