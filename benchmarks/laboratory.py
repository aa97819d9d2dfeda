"""How long does a laboratory wait for its store? 10 000 results of 500 instruments, on SQLite and on PostgreSQL.

    python benchmarks/laboratory.py [--quick]

Whole commands from a cold process, in seconds of the processor (of the command alone: a server's are not in it), and
the time in which a result is kept. PostgreSQL is a private server that is started for the run, and left out where none
is installed.
"""

import os
import subprocess
import sys
import tempfile
from contextlib import ExitStack
from dataclasses import replace
from datetime import date, timedelta
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "laboratory"))

import numpy as np
import postgresql
from made import result
from measure import Row, alone, in_turn, of_processes, row

from inercal.laboratory.catalog import results
from inercal.laboratory.keep import Item, keep
from inercal.laboratory.store import Store, make_store

NAMES = tuple(f"{term}_{axis}" for term in ("K0", "K1", "D_F", "S") for axis in "xyz")


def filled(place: tuple[str, str | None], instruments: int, calibrations: int) -> Store:
    """A store with so many calibrations of so many instruments."""
    store = make_store(*place)
    rng = np.random.default_rng(1)
    for serial in range(instruments):
        item = Item("Maker", "Model", f"{serial:04d}")
        for k in range(calibrations):
            day = date(2021, 1, 15) + timedelta(days=91 * k)
            values = rng.normal(size=len(NAMES)) * 1e-6
            keep(store, result(serial * calibrations + k, NAMES, day.isoformat(), values, 1e-6), item)
    return store


def command(store: Store, *words: str) -> None:
    """Run a command on a store to its end."""
    done = [
        sys.executable,
        "-m",
        "inercal",
        *words,
        "--store",
        store.place.url if store.place.folder is None else store.where,
    ]
    ended = subprocess.run(done, check=False, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    assert ended.returncode in (0, 1), words


def rows(quick: bool) -> list[Row]:
    instruments, calibrations = (5, 4) if quick else (500, 20)
    found = []
    with tempfile.TemporaryDirectory() as folder, ExitStack() as servers:
        places: dict[str, tuple[str, str | None]] = {"SQLite": (str(Path(folder) / "store"), None)}
        if postgresql.programs() is not None and not quick:
            url = servers.enter_context(postgresql.started())
            places["PostgreSQL"] = (f"{url}/postgres", str(Path(folder) / "objects"))
        for kind, place in places.items():
            store = filled(place, instruments, calibrations)
            some = results(store, "0003")[0].id
            works = {
                "`results`": lambda store=store: command(store, "results"),
                "`results --instrument`": lambda store=store: command(
                    store, "results", "--instrument", "0003"
                ),
                "`history`": lambda store=store: command(store, "history", "0003"),
                "`show`": lambda store=store, some=some: command(store, "show", some[:10]),
            }
            if quick:
                works = {name: works[name] for name in ("`results`",)}
            size = f"{instruments * calibrations} results, {kind}"
            for name, each in in_turn(works, 1 if quick else 5, of_processes).items():
                found.append(row(name, size, ("s", 1.0), each, at_most=1.0))
            count = iter(range(10**6, 10**7))
            keeping = {
                "keep": lambda store=store, count=count: keep(
                    store, replace(result(next(count), NAMES), message="new"), Item("Maker", "Model", "0003")
                )
            }
            seconds = in_turn(keeping, 1 if quick else 5, least=0.0 if quick else 0.5)["keep"]
            found.append(row("a result is kept", size, ("ms", 1e3), seconds))
    return found


if __name__ == "__main__":
    alone(rows, __doc__)
