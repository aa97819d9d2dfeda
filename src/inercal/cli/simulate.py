"""``inercal simulate``."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from inercal.cli.options import FileOutput, Overrides, Study, envelope, of_study, reading
from inercal.errors import InputError

if TYPE_CHECKING:
    from numpy.random import Generator

    from inercal.records.record import Record

Seed = Annotated[int, Parameter(help="Seed of the random numbers, 0 or more; 1 if absent.")]


def simulate_turntable(
    study: Study,
    /,
    *,
    seed: Seed = 1,
    overrides: Overrides = None,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Simulate a test of an instrument on a turntable."""
    from inercal.study.load import files_of, load_turntable_study
    from inercal.turntable.task import simulate

    _check(study, seed, output)
    settings = load_turntable_study(study, overrides or ())
    inputs = files_of(study, settings.given)
    output.spare(inputs)
    _write("turntable", partial(simulate, settings), study, inputs, seed, output)


def simulate_selfcal(
    study: Study,
    /,
    *,
    seed: Seed = 1,
    overrides: Overrides = None,
    output: FileOutput = FileOutput(),  # noqa: B008  (frozen)
) -> None:
    """Simulate a platform that turns through the plan of a study."""
    from inercal.selfcal.simulate import experiment, to_record
    from inercal.selfcal.simulate import simulate as simulate_run
    from inercal.study.load import load_selfcal_study

    _check(study, seed, output)
    settings = load_selfcal_study(study, overrides or ())

    def simulate(rng: Generator) -> Record:
        return to_record(simulate_run(experiment(settings), rng).recording)

    _write("selfcal", simulate, study, (study,), seed, output)


def _check(study: Path, seed: int, output: FileOutput) -> None:
    """Fail before any work is done where a result could not be written."""
    from inercal.records.write import SUFFIXES

    if output.out is None:
        raise InputError("--out", "missing, expected the file to write, such as simulated.csv")
    if seed < 0:
        raise InputError("--seed", f"found {seed}, expected 0 or more")
    output.check(SUFFIXES, (study,))


def _write(
    kind: str,
    simulate: Callable[[Generator], Record],
    study: Path,
    inputs: Sequence[Path],
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
    output.emit(envelope(f"simulate {kind}", words, result, map(source_of, inputs)), words)
