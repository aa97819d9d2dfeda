"""``inercal simulate``."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from inercal.cli.options import (
    CheckpointOption,
    ClusterOption,
    FileOutput,
    Overrides,
    ReportOutput,
    Study,
    WorkersOption,
    count_of,
    reading,
    whole_number,
)
from inercal.cli.outcome import WHOLE, emit, hand_over
from inercal.foundation.errors import InputError

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
    _simulated("turntable", study, seed, overrides, output)


def simulate_imu(
    study: Study,
    /,
    *,
    seed: Seed = 1,
    overrides: Overrides = None,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Simulate an IMU by hand in many poses, in six positions and three turns, or on a table."""
    _simulated("imu", study, seed, overrides, output)


def simulate_strapdown(
    study: Study,
    /,
    *,
    seed: Seed = 1,
    overrides: Overrides = None,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Simulate a strapdown unit that rests and is turned."""
    _simulated("strapdown", study, seed, overrides, output)


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
    checkpoint: CheckpointOption = None,
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    overrides: Overrides = None,
    output: ReportOutput = ReportOutput(),  # noqa: B008  (frozen)
) -> int:
    """Simulate a platform that turns through the plan of a study, once or many times."""
    if runs is not None:
        return _campaign(study, runs, seed, checkpoint, (workers, cluster), overrides or (), output)
    of_runs = {
        "--checkpoint": checkpoint,
        "--report": output.report,
        "--workers": workers,
        "--cluster": cluster,
    }
    for option, found in of_runs.items():
        if found is not None:
            raise InputError(option, "found without --runs, expected them together")
    _simulated("selfcal", study, seed, overrides, output)
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
    _simulated("aoa", study, seed, overrides, output)


def _campaign(
    study: Path,
    runs: int,
    seed: int,
    checkpoint: Path | None,
    place: tuple[int | None, str | None],
    overrides: Iterable[str],
    output: ReportOutput,
) -> int:
    """Many simulated calibrations; exit code 1 where the stated uncertainties are too small."""
    from inercal.faces.python.study import read_study
    from inercal.foundation._jit import compiling
    from inercal.foundation.computing.cluster import Cluster
    from inercal.foundation.computing.executors import Threads
    from inercal.foundation.findings import Status
    from inercal.foundation.records.read import source_of
    from inercal.foundation.results.result import without_coefficients
    from inercal.systems.selfcal.filters.problem import problem
    from inercal.systems.selfcal.filters.run import load_kernels
    from inercal.systems.selfcal.monte_carlo import REFERENCES, campaign

    if not 2 <= runs <= _MOST_RUNS:
        raise InputError("--runs", f"found {runs}, expected 2 to {_MOST_RUNS:,}")
    _not_negative(seed)
    output.check(WHOLE, (study,))
    workers, cluster = count_of(*place), place[1]
    executor = Threads(workers) if cluster is None else Cluster(cluster, workers)
    of = read_study("selfcal", study, overrides)
    settings = of.settings
    with of.at_fault():
        with compiling(f"campaign {settings.filter.kind}", output.say_now):
            load_kernels(settings.filter.kind, problem(settings))
        clock = time.perf_counter()
        with reading(output, "simulating") as progress:
            outcome = campaign(settings, runs, seed, None, executor, checkpoint, progress)
    timing = {"solve": time.perf_counter() - clock}
    estimate = without_coefficients(
        "simulate selfcal",
        outcome.message,
        outcome.result,
        [source_of(study)],
        timing=timing,
        settings=settings.given,
        seed=seed,
        references=REFERENCES,
    )
    estimate = estimate if outcome.passed else replace(estimate, status=Status.INCONSISTENT)

    def page() -> str:
        from inercal.systems.selfcal.figures.monte_carlo import page as campaign_page

        return campaign_page(outcome, settings, estimate)

    return hand_over(estimate, [outcome.table()], page, output, "campaign")


def _check(study: Path, seed: int, output: FileOutput) -> None:
    """Fail before any work is done where a result could not be written."""
    from inercal.foundation.records.write import SUFFIXES

    if output.out is None:
        raise InputError("--out", "missing, expected the file to write, such as simulated.csv")
    _not_negative(seed)
    output.check(SUFFIXES, (study,))


def _not_negative(seed: int) -> None:
    """Refuse a seed below 0."""
    if seed < 0:
        raise InputError("--seed", f"found {seed}, expected 0 or more")


def _simulated(
    kind: str, study: Path, seed: int, overrides: Iterable[str] | None, output: FileOutput
) -> None:
    """Simulate, and write the record."""
    import numpy as np

    from inercal.faces.python.study import read_study
    from inercal.faces.python.verbs import simulate
    from inercal.foundation.records.read import source_of
    from inercal.foundation.records.write import write_record
    from inercal.foundation.results.result import without_coefficients

    _check(study, seed, output)
    assert output.out is not None
    of = read_study(kind, study, overrides or ())
    inputs = of.files_without(of.system.unsimulated)
    output.spare(inputs)
    record = simulate(of, np.random.default_rng(seed))
    with reading(output, "writing") as progress:
        write_record(record, output.out, progress)
    rows = len(next(iter(record.columns.values())).t)
    words = f"{rows} rows written to {output.out}"
    result = {"out": str(output.out), "rows": rows, "seed": seed, "columns": list(record.columns)}
    sources = map(source_of, inputs)
    emit(
        without_coefficients(f"simulate {kind}", words, result, sources, settings=of.keys, seed=seed),
        words,
        output,
    )
