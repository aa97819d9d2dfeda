"""How many units and runs a second? By one process, by two, and by a cluster of two workers of dask.

    python benchmarks/fleets.py [--quick]

Units are the shipped Ferraris recording again and again, each of a serial number of its own; runs are simulated
self-calibrations of the published case. Rows of whole commands are by the clock on the wall, the start of their
processes included. Rows "more" are of many less of few, so that no start is in them, by the processor time of all
processes: what is left of a difference between --workers and a cluster. The overhead of a chunk is that of work that
does nothing.
"""

import os
import shutil
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from measure import Row, alone, in_turn, row

from inercal.estimate.cluster import LOCAL, Cluster
from inercal.estimate.executors import Executor, Processes, Serial
from inercal.examples import FOLDER
from inercal.fleet.batch import batch
from inercal.selfcal.monte_carlo import campaign
from inercal.studies.load import load_selfcal_study


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


def processors() -> float:
    """Seconds that this process and those that it started, and that have ended, took on their processors."""
    spent = os.times()
    return spent.user + spent.system + spent.children_user + spent.children_system


def each(work: Callable[[int], object], few: int, many: int) -> float:
    """Processor time [s] of one of many, from many less few."""
    took = []
    for count in (few, many):
        began = processors()
        work(count)
        took.append(processors() - began)
    return (took[1] - took[0]) / (many - few)


def more(
    what: str, work: Callable[[Executor, int], object], counts: tuple[int, int], rounds: int
) -> list[Row]:
    """Rows of work at each place without its start; that of the cluster beside --workers 2."""
    places = {
        "one process": Serial(),
        "--workers 2": Processes(2),
        "--cluster local of two": Cluster(LOCAL, 2),
    }
    took: dict[str, list[float]] = {name: [] for name in places}
    for _ in range(rounds):
        for name, place in places.items():
            took[name].append(each(lambda count, place=place: work(place, count), *counts))
    size, unit = f"{counts[1]} less {counts[0]}", ("ms", 1e3)
    return [
        row(f"{what}, one process", size, unit, took["one process"]),
        row(f"{what}, --workers 2", size, unit, took["--workers 2"], "one process", took["one process"]),
        row(
            *(f"{what}, --cluster local of two", size, unit, took["--cluster local of two"]),
            *("--workers 2", took["--workers 2"]),
            at_least=0.9,
        ),
    ]


def rows(quick: bool) -> list[Row]:
    units, rounds, chunks = (4, 1, 50) if quick else (400, 2, 3000)
    some, repeats = ((2, 4), 1) if quick else ((50, 200), 2)
    study = load_selfcal_study(FOLDER / "selfcal.toml")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)

        def manifest(count: int) -> Path:
            path = folder / f"fleet{count}.csv"
            lines = ["serial,files", *(f"SN {k:04d},{FOLDER / 'ferraris.csv.gz'}" for k in range(count))]
            path.write_text("\n".join(lines) + "\n", encoding="utf-8")
            return path

        def done(workers: int, cluster: str | None = None, count: int = units) -> None:
            out = folder / "out"
            batch(
                manifest(count),
                FOLDER / "ferraris.toml",
                out=out,
                map=FOLDER / "ferraris-map.toml",
                workers=workers,
                cluster=cluster,
            )
            shutil.rmtree(out)

        def at(place: Executor, count: int) -> None:
            workers = getattr(place, "workers", 1)
            done(workers, LOCAL if isinstance(place, Cluster) else None, count)

        def simulated(place: Executor, count: int) -> None:
            campaign(study, count, 1, None, place)

        found = in_turn(
            {
                "one": lambda: done(1),
                "two": lambda: done(2),
                "cluster": lambda: done(2, LOCAL),
            },
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
            *more("A unit more", at, some, repeats),
            *more("A run more", simulated, some, repeats),
            row(
                *("A chunk of nothing on the cluster", f"{chunks} chunks", ("ms", 1e3)),
                *(idle["cluster"], "--workers 2", idle["processes"]),
            ),
        ]


if __name__ == "__main__":
    alone(rows, __doc__)
