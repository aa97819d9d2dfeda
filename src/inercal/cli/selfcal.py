"""``inercal selfcal``."""

from __future__ import annotations

import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from inercal.cli.options import MapFile, Overrides, ResultOutput, Span, StudyFile, read_repeats, working
from inercal.cli.outcome import WHOLE, give
from inercal.cli.streaming import Every, StreamOptions, recorded, stream_study
from inercal.foundation.errors import InputError
from inercal.systems.selfcal.estimators import FilterKind

if TYPE_CHECKING:
    from inercal.cli.streaming import Estimators
    from inercal.systems.selfcal.settings import SelfcalSettings


def selfcal(
    files: Annotated[
        list[Path] | None,
        Parameter(
            help="Recordings; files with distinct channels are one record, with the same ones repeat runs."
        ),
    ] = None,
    /,
    *,
    study: StudyFile,
    kind: Annotated[
        FilterKind | None,
        Parameter(
            name="--filter",
            help="Estimator, in the place of that of the study. Points of svd-qukf are drawn by the eigenvalues of the "
            "covariance; by its singular values or its Cholesky factor with --set filter.factor=svd, or cholesky.",
        ),
    ] = None,
    compare: Annotated[bool, Parameter(help="Run all estimators, and set them side by side.")] = False,
    stream: Annotated[
        bool, Parameter(help="Lines in, from standard input or one FILE, and coefficients out, live.")
    ] = False,
    every: Every = None,
    until_goals: Annotated[
        bool, Parameter(help="End a stream where the goals of the study are met and nothing contradicts it.")
    ] = False,
    map_file: MapFile = None,
    span: Span = Span(),  # noqa: B008  (frozen)
    overrides: Overrides = None,
    streaming: StreamOptions = StreamOptions(),  # noqa: B008  (frozen)
    output: ResultOutput = ResultOutput(),  # noqa: B008  (frozen)
) -> int:
    """Calibrate a gimbaled platform while it turns."""
    keys = [*(overrides or ()), *([f"filter.kind={kind}"] if kind is not None else [])]
    if stream:
        if compare:
            raise InputError("--compare", "found with a stream, expected one estimator")
        prepare = partial(_live, until_goals=until_goals)
        stream_study("selfcal", prepare, files, study, keys, every, map_file, span, streaming, output)
        return 0
    if until_goals:
        raise InputError("--until-goals", "found without --stream, expected them together")
    paths = recorded("selfcal", files, streaming, every)

    from inercal.faces.python.study import read_study
    from inercal.foundation._jit import compiling
    from inercal.foundation.records.write import SUFFIXES
    from inercal.systems.selfcal import verbs as system

    output.check((*WHOLE, *SUFFIXES), (*paths, map_file, study))
    of = read_study("selfcal", study, keys)
    clock = time.perf_counter()
    records = read_repeats(paths, map_file, output, span)
    read_s = time.perf_counter() - clock
    if len(records) > 1 and compare:
        raise InputError("--compare", f"found {len(records)} runs, expected one")
    if len(records) > 1 and output.out is not None and output.out.suffix.lower() in SUFFIXES:
        raise InputError(output.out, f"found {len(records)} runs, expected one for a history, or .json")
    of_all = " all" if compare else f" {of.settings.filter.kind}"
    with compiling(f"selfcal{of_all}", output.say):
        system.prepare(of, compare)
    with working(output) as progress:
        file = output.out is not None and output.out.suffix.lower() in SUFFIXES
        outcome = system.calibrate(records, of, compare, progress, output.report is not None or file)
    return give(outcome, output, read_s)


def _live(settings: SelfcalSettings, interval: float, output: ResultOutput, until_goals: bool) -> Estimators:
    """Prepare a calibration row by row."""
    from inercal.faces.stream.estimators import selfcal as prepared

    return prepared(settings, interval, output.say, output.say_finding, until_goals)
