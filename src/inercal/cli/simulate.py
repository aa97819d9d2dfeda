"""``inercal simulate``."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from inercal.cli.options import FileOutput, Overrides, Study, envelope, of_study, reading
from inercal.errors import InputError

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
    import numpy as np

    from inercal.records.read import source_of
    from inercal.records.write import SUFFIXES, write_record
    from inercal.study.load import files_of, load_turntable_study
    from inercal.turntable.task import simulate

    if output.out is None:
        raise InputError("--out", "missing, expected the file to write, such as simulated.csv")
    if seed < 0:
        raise InputError("--seed", f"found {seed}, expected 0 or more")
    output.check(SUFFIXES, (study,))
    settings = load_turntable_study(study, overrides or ())
    inputs = files_of(study, settings.given)
    output.spare(inputs)
    with of_study(study):
        record = simulate(settings, np.random.default_rng(seed))
    with reading(output, "writing") as progress:
        write_record(record, output.out, progress)
    rows = len(next(iter(record.columns.values())).t)
    words = f"{rows} rows written to {output.out}"
    result = {"out": str(output.out), "rows": rows, "seed": seed, "columns": list(record.columns)}
    output.emit(envelope("simulate turntable", words, result, map(source_of, inputs)), words)
