"""How many units, and simulated runs, a second? By one process, by two, and by a cluster of two workers of dask.

    python benchmarks/fleets.py [--quick]

Units are the shipped Ferraris recording again and again, each of a serial number of its own; runs are those of
`simulate selfcal --runs` on the published case; times are by the clock on the wall, starts and ends in them. The
overhead of a chunk is that of work that does nothing.
"""

import os
import shutil
import tempfile
import time
from collections.abc import Iterable
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from measure import Row, alone, in_turn, row

from inercal.examples import FOLDER
from inercal.faces.python.study import read_study
from inercal.foundation.computing.cluster import LOCAL, Cluster
from inercal.foundation.computing.executors import Executor, Processes, Serial
from inercal.laboratory.fleet.batch import batch
from inercal.systems.selfcal.monte_carlo import campaign


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


def fleets(folder: Path, units: int, rounds: int) -> list[Row]:
    """A fleet of so many units, each way."""
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

    works = {"one": lambda: done(1), "two": lambda: done(2), "cluster": lambda: done(2, LOCAL)}
    return each_way("A fleet", f"{units} units", in_turn(works, rounds, time.perf_counter), "a unit", units)


def runs(count: int, rounds: int) -> list[Row]:
    """So many simulated and estimated runs of the published case, each way."""
    settings = read_study("selfcal", FOLDER / "selfcal.toml").settings
    places = {"one": Serial(), "two": Processes(2), "cluster": Cluster(LOCAL, 2)}
    works = {
        name: lambda place=place: campaign(settings, count, seed=1, executor=place)
        for name, place in places.items()
    }
    return each_way("Runs", f"{count} runs", in_turn(works, rounds, time.perf_counter), "a run", count)


def each_way(what: str, size: str, found: dict[str, list[float]], each: str, count: int) -> list[Row]:
    """Rows of the three ways."""
    unit = (f"ms {each}", 1e3 / count)
    return [
        row(f"{what}, one process", size, unit, found["one"]),
        row(f"{what}, --workers 2", size, unit, found["two"], "one process", found["one"]),
        row(f"{what}, --cluster local of two", size, unit, found["cluster"], "--workers 2", found["two"]),
    ]


def rows(quick: bool) -> list[Row]:
    units, many, rounds, chunks = (4, 20, 1, 50) if quick else (1200, 4000, 2, 3000)
    places = {"processes": Processes(2), "cluster": Cluster(LOCAL, 2)}
    with tempfile.TemporaryDirectory() as name:
        found = fleets(Path(name), units, rounds)
    found += runs(many, rounds)
    idle = {name: [drained(place, chunks) for _ in range(rounds)] for name, place in places.items()}
    what, size = "A chunk of nothing on the cluster", f"{chunks} chunks"
    return [*found, row(what, size, ("ms", 1e3), idle["cluster"], "--workers 2", idle["processes"])]


if __name__ == "__main__":
    alone(rows, __doc__)
