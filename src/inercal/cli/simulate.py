"""``inercal simulate``."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from inercal.cli.options import FileOutput, Overrides, ReportOutput, Study, of_study, reading, whole_number
from inercal.cli.outcome import WHOLE, emit, hand_over, told
from inercal.errors import InputError

if TYPE_CHECKING:
    from numpy.random import Generator

    from inercal.records.record import Record

Seed = Annotated[
    int, Parameter(converter=whole_number, help="Seed of the random numbers, 0 or more; 1 if absent.")
]

_MOST_RUNS = 1_000_000
"""Runs whose results fit into memory; hours of work."""


def simulate_turntable(
    study: Study,
    /,
    *,
    seed: Seed = 1,
    overrides: Overrides = None,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Simulate a test of an instrument on a turntable."""
    from inercal.studies.load import files_of, load_turntable_study
    from inercal.turntable.task import simulate

    _check(study, seed, output)
    settings = load_turntable_study(study, overrides or ())
    inputs = files_of(study, settings.given)
    output.spare(inputs)
    _write("turntable", partial(simulate, settings), study, inputs, settings.given, seed, output)


def simulate_selfcal(
    study: Study,
    /,
    *,
    seed: Seed = 1,
    runs: Annotated[
        int | None,
        Parameter(
            converter=whole_number,
            help="Simulate and calibrate so often instead, and judge the stated uncertainties.",
        ),
    ] = None,
    overrides: Overrides = None,
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> int:
    """Simulate a platform that turns through the plan of a study, once or many times."""
    from inercal.selfcal.before.simulate import experiment, to_record
    from inercal.selfcal.before.simulate import simulate as simulate_run
    from inercal.studies.load import load_selfcal_study

    if runs is not None:
        return _campaign(study, runs, seed, overrides or (), output)
    if output.report is not None:
        raise InputError("--report", "found without --runs, expected them together")
    _check(study, seed, output)
    settings = load_selfcal_study(study, overrides or ())

    def simulate(rng: Generator) -> Record:
        return to_record(simulate_run(experiment(settings), rng).recording)

    _write("selfcal", simulate, study, (study,), settings.given, seed, output)
    return 0


def simulate_aoa(
    study: Study,
    /,
    *,
    seed: Seed = 1,
    overrides: Overrides = None,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Simulate a wind-tunnel model that moves as its study plans."""
    from inercal.aoa.simulate import simulate as simulate_run
    from inercal.aoa.simulate import to_record
    from inercal.studies.load import files_of, load_aoa_study

    _check(study, seed, output)
    settings = load_aoa_study(study, overrides or ())
    inputs = files_of(study, settings.given, unread="estimator")
    output.spare(inputs)

    def simulate(rng: Generator) -> Record:
        return to_record(simulate_run(settings, rng).recording, settings)

    _write("aoa", simulate, study, inputs, settings.given, seed, output)


def _campaign(study: Path, runs: int, seed: int, overrides: Iterable[str], output: ReportOutput) -> int:
    """Many simulated calibrations; exit code 1 where the stated uncertainties are too small."""
    from inercal._jit import compiling
    from inercal.findings import Status
    from inercal.records.read import source_of
    from inercal.selfcal.filters.problem import problem
    from inercal.selfcal.filters.run import load_kernels
    from inercal.selfcal.monte_carlo import REFERENCES, campaign
    from inercal.studies.load import load_selfcal_study

    if not 2 <= runs <= _MOST_RUNS:
        raise InputError("--runs", f"found {runs}, expected 2 to {_MOST_RUNS:,}")
    _not_negative(seed)
    output.check(WHOLE, (study,))
    settings = load_selfcal_study(study, overrides)
    with of_study(study):
        with compiling(f"campaign {settings.filter.kind}", output.say_now):
            load_kernels(settings.filter.kind, problem(settings))
        clock = time.perf_counter()
        with reading(output, "simulating") as progress:
            found = campaign(settings, runs, seed, workers=os.cpu_count() or 1, progress=progress)
    timing = {"solve": time.perf_counter() - clock}
    estimate = told(
        "simulate selfcal",
        found.message,
        found.result,
        [source_of(study)],
        timing=timing,
        settings=settings.given,
        seed=seed,
        references=REFERENCES,
    )
    estimate = estimate if found.passed else replace(estimate, status=Status.INCONSISTENT)

    def page() -> str:
        from inercal.selfcal.figures.monte_carlo import page as campaign_page

        return campaign_page(found, settings, estimate)

    return hand_over(estimate, [found.table()], page, output, "campaign")


def _check(study: Path, seed: int, output: FileOutput) -> None:
    """Fail before any work is done where a result could not be written."""
    from inercal.records.write import SUFFIXES

    if output.out is None:
        raise InputError("--out", "missing, expected the file to write, such as simulated.csv")
    _not_negative(seed)
    output.check(SUFFIXES, (study,))


def _not_negative(seed: int) -> None:
    """Refuse a seed below 0."""
    if seed < 0:
        raise InputError("--seed", f"found {seed}, expected 0 or more")


def _write(
    kind: str,
    simulate: Callable[[Generator], Record],
    study: Path,
    inputs: Sequence[Path],
    given: Mapping[str, Any],
    seed: int,
    output: FileOutput,
) -> None:
    """Simulate, and write the record."""
    import numpy as np

    from inercal.records.read import source_of
    from inercal.records.write import write_record

    assert output.out is not None
    with of_study(study):
        record = simulate(np.random.default_rng(seed))
    with reading(output, "writing") as progress:
        write_record(record, output.out, progress)
    rows = len(next(iter(record.columns.values())).t)
    words = f"{rows} rows written to {output.out}"
    result = {"out": str(output.out), "rows": rows, "seed": seed, "columns": list(record.columns)}
    sources = map(source_of, inputs)
    emit(told(f"simulate {kind}", words, result, sources, settings=given, seed=seed), words, output)
