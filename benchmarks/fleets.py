"""How many units a second? A fleet by one process, by two, and by a cluster of two workers of dask.

    python benchmarks/fleets.py [--quick]

Units are the shipped Ferraris recording again and again, each of a serial number of its own; times are by the clock on
the wall. The overhead of a chunk is that of work that does nothing.
"""

import os
import shutil
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from measure import Row, alone, in_turn, row

from inercal.estimate.cluster import LOCAL, Cluster
from inercal.estimate.executors import Executor, Processes
from inercal.examples import FOLDER
from inercal.fleet.batch import batch


def nothing(numbers: Iterable[int]) -> int:
    """Work that does nothing."""
    return sum(1 for _ in numbers)


def drained(place: Executor, chunks: int) -> float:
    """Seconds a chunk of nothing: many chunks less few, so that the start is not in it."""
    few = chunks // 10
    seconds = []
    for many in (few, chunks):
        began = time.perf_counter()
        assert sum(answer for _, answer in place.map(nothing, [range(k, k + 1) for k in range(many)])) == many
        seconds.append(time.perf_counter() - began)
    return (seconds[1] - seconds[0]) / (chunks - few)


def rows(quick: bool) -> list[Row]:
    units, rounds, chunks = (4, 1, 50) if quick else (400, 2, 3000)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        lines = ["serial,files", *(f"SN {k:04d},{FOLDER / 'ferraris.csv.gz'}" for k in range(units))]
        (folder / "fleet.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")

        def done(workers: int, cluster: str | None = None) -> None:
            out = folder / "out"
            batch(
                folder / "fleet.csv",
                FOLDER / "ferraris.toml",
                out=out,
                map=FOLDER / "ferraris-map.toml",
                workers=workers,
                cluster=cluster,
            )
            shutil.rmtree(out)

        found = in_turn(
            {"one": lambda: done(1), "two": lambda: done(2), "cluster": lambda: done(2, LOCAL)},
            rounds,
            time.perf_counter,
        )
        size, unit = f"{units} units", ("ms a unit", 1e3 / units)
        places = {"processes": Processes(2), "cluster": Cluster(LOCAL, 2)}
        idle = {name: [drained(place, chunks) for _ in range(rounds)] for name, place in places.items()}
        return [
            row("A fleet, one process", size, unit, found["one"]),
            row("A fleet, --workers 2", size, unit, found["two"], "one process", found["one"]),
            row("A fleet, --cluster local of two", size, unit, found["cluster"], "--workers 2", found["two"]),
            row(
                *("A chunk of nothing on the cluster", f"{chunks} chunks", ("ms", 1e3)),
                *(idle["cluster"], "--workers 2", idle["processes"]),
            ),
        ]


if __name__ == "__main__":
    alone(rows, __doc__)
