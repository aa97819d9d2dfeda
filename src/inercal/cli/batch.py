"""``inercal batch``."""

from __future__ import annotations

import time
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from inercal.cli import EXIT_BAD_VERDICT, command_line
from inercal.cli.options import (
    ClusterOption,
    MapFile,
    OutputOptions,
    Overrides,
    StoreOption,
    StudyFile,
    WorkersOption,
    count_of,
    reading,
)
from inercal.cli.outcome import emit
from inercal.foundation.errors import InputError


@Parameter(name="*")
@dataclass(frozen=True)
class FolderOutput(OutputOptions):
    """The options of a command that writes a folder."""

    out: Annotated[Path | None, Parameter(help="Folder of the outcome; made if it is not there.")] = None


def batch(
    manifest: Annotated[
        Path, Parameter(help="Manifest (CSV with the columns serial and files), or a folder of recordings.")
    ],
    /,
    *,
    study: StudyFile,
    map_file: MapFile = None,
    workers: WorkersOption = None,
    cluster: ClusterOption = None,
    keep: Annotated[bool, Parameter(help="Keep the result, its files and report in the store.")] = False,
    store: StoreOption = None,
    overrides: Overrides = None,
    output: FolderOutput = FolderOutput(),
) -> int:
    """Calibrate every unit of a fleet."""
    from inercal.laboratory.fleet.batch import batch as of_fleet
    from inercal.laboratory.fleet.batch import written
    from inercal.laboratory.store import open_store

    if output.out is None:
        raise InputError("--out", "missing, expected a folder for the outcome")
    count = count_of(workers, cluster)
    if store is not None and not keep:
        raise InputError("--store", "found without --keep, expected with it")
    place = open_store(store).place.given if keep else None
    clock = time.perf_counter()
    with reading(output, "calibrating") as progress:
        result = of_fleet(
            manifest,
            study,
            out=output.out,
            map=map_file,
            overrides=overrides or (),
            workers=count,
            cluster=cluster,
            store=place,
            progress=progress or (lambda done, all: None),
        )
    estimate = replace(
        result.estimate,
        provenance={**result.estimate.provenance, "arguments": command_line()},
        timing={"solve": time.perf_counter() - clock},
    )
    for path in written(output.out):
        output.say(f"written: {path}")
    text = f"{result.table()}\n\n{estimate.status.value}: {estimate.message}".lstrip()
    emit(estimate, text, output)
    return 0 if estimate.status.value == "ok" else EXIT_BAD_VERDICT
