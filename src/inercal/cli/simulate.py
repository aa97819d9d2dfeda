"""``inercal simulate``."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable
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
    study_in,
    whole_number,
)
from inercal.cli.outcome import WHOLE, hand_over, tell
from inercal.foundation.errors import InputError

Seed = Annotated[
    int, Parameter(converter=whole_number, help="Seed of the random numbers, 0 or more; 1 if absent.")
]

_MOST_RUNS = 1_000_000
"""Runs whose results fit into memory; hours of work."""


def _simulating(kind: str) -> Callable[..., None]:
    """The command that simulates a test once, by a study of a kind."""

    def command(
        study: Study,
        /,
        *,
        seed: Seed = 1,
        overrides: Overrides = None,
        output: FileOutput = FileOutput(),
    ) -> None:
        _simulated(kind, study, seed, overrides, output)

    return command


simulate_aoa = _simulating("aoa")
simulate_imu = _simulating("imu")
simulate_strapdown = _simulating("strapdown")
simulate_turntable = _simulating("turntable")


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
    output: ReportOutput = ReportOutput(),
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
    of, _ = study_in("selfcal", study, overrides, output)
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
    from inercal.foundation.records.write import SUFFIXES, write_record

    if output.out is None:
        raise InputError("--out", "missing, expected the file to write, such as simulated.csv")
    _not_negative(seed)
    output.check(SUFFIXES, (study,))
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
    tell(output, f"simulate {kind}", words, result, sources, settings=of.keys, seed=seed)
