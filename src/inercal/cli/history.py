"""``inercal history``: an instrument over its calibrations."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from inercal.cli.options import ReportOutput, StoreOption
from inercal.cli.outcome import WHOLE, hand_over
from inercal.foundation.errors import InputError


def history(
    of: Annotated[
        list[str],
        Parameter(help="Serial number of an instrument in the store, or results of one instrument."),
    ],
    /,
    *,
    coefficient: Annotated[
        list[str] | None, Parameter(help="Only this coefficient, or group such as K1. May be repeated.")
    ] = None,
    tolerance: Annotated[
        Path | None,
        Parameter(help="File (TOML) with the table [specification]; that of the last study if absent."),
    ] = None,
    until: Annotated[
        str | None,
        Parameter(help='Date to predict for, such as "2027-01-31"; a year after the last if absent.'),
    ] = None,
    store: StoreOption = None,
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> int:
    """Follow the coefficients of an instrument from calibration to calibration."""
    from datetime import date

    from inercal.foundation._files import write_text
    from inercal.laboratory.history_page import rows_csv
    from inercal.laboratory.verbs import history as history_of
    from inercal.laboratory.verbs import specification_in

    try:
        day = None if until is None else date.fromisoformat(until)
    except ValueError as error:
        raise InputError("--until", f"found {until!r}, expected a day such as 2027-01-31") from error
    files = [Path(each) for each in of if Path(each).is_file()]
    output.check((*WHOLE, ".csv"), (tolerance, *files))
    limits = None if tolerance is None else specification_in(tolerance)
    result = history_of(*of, coefficients=coefficient, tolerance=limits, at=day, store=store)

    def curves(path: Path) -> None:
        write_text(path, rows_csv(result.evidence))

    return hand_over(result.estimate, result.view.tables(), result.view.page, output, "history", curves)
