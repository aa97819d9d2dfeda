"""How long does one wait for the workbench? Ten million rows looked at, sliders of a design, pages, 200 jobs.

    python benchmarks/workbench_speed.py [--quick]

Times are of the processor of the process that serves (a browser draws beside it), but for that of a first look, which
is on the wall: a file is read there. A zoom is the new picture and its JSON, as it goes to the browser. Memory is that
of the process that serves, before and after the jobs.
"""

import asyncio
import os
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import orjson
from measure import PROCESSOR, WALL, Row, Spread, alone, in_turn, row

from inercal.bench.workbench.bench import Bench, open_bench
from inercal.bench.workbench.charts import course_figure
from inercal.bench.workbench.pages.form import named
from inercal.bench.workbench.sessions import STUDY
from inercal.examples import FOLDER
from inercal.faces.python.study import foresight, read_study, verticals
from inercal.faces.studies.text import with_keys
from inercal.systems.listed import SYSTEMS

PLANS = {
    "turntable": "tumble.toml",
    "selfcal": "selfcal.toml",
    "strapdown": "strapdown.toml",
    "aoa": "sting.toml",
}
PAGES = ("/", "recording", "study", "design", "run", "result", "/instruments", "/validation")


def rows(quick: bool) -> list[Row]:
    """All figures."""
    with tempfile.TemporaryDirectory() as folder:
        bench = open_bench(Path(folder) / "work", str(Path(folder) / "store"))
        try:
            found = looked(bench, 10**5 if quick else 10**7, 1 if quick else 5)
            found += sliders(Path(folder), 1 if quick else 5)
            found += asyncio.run(pages(bench, 1 if quick else 5))
            return found + jobs(bench, 2 if quick else 200)
        finally:
            bench.close()


def recording(count: int) -> dict[str, np.ndarray]:
    """Channels of an IMU at 1 kHz, with a rest every minute."""
    rng = np.random.default_rng(1)
    t = np.arange(count) / 1000.0
    moving = (t % 60.0) > 40.0
    channels = {"t [s]": t}
    for sensor, unit in (("acc", "m/s^2"), ("gyro", "rad/s")):
        for axis in "xyz":
            noise = rng.standard_normal(count, dtype=np.float32).astype(float)
            channels[f"{sensor}_{axis} [{unit}]"] = 0.01 * noise + moving * np.sin(3.0 * t)
    return channels


def looked(bench: Bench, count: int, rounds: int) -> list[Row]:
    """A recording of six channels: read and drawn, then zoomed."""
    channels = recording(count)
    session = bench.sessions.begin("long")
    np.savez(session.folder / "long.npz", **channels)
    size = f"{count:,} rows".replace(",", " ")
    began = WALL()
    bench.look(session)
    look = WALL() - began
    (held,) = bench.look(session)

    def zoom(begin: float, end: float) -> int:
        return len(orjson.dumps(course_figure(held.courses, (begin, end), held.notes)))

    whole = float(channels["t [s]"][-1])
    middle = 0.4 * whole
    works = {
        "zoom: the whole": lambda: zoom(0.0, whole),
        "zoom: a tenth": lambda: zoom(middle, middle + 0.1 * whole),
        "zoom: a hundredth": lambda: zoom(middle, middle + 0.01 * whole),
        "zoom: one second, every sample": lambda: zoom(middle, middle + 1.0),
    }
    found = [row("first look: read, rests, picture", size, ("s", 1.0), [look])]
    for name, seconds in in_turn(works, rounds).items():
        found.append(row(name, size, ("ms", 1e3), seconds, at_most=150.0))
    return found


def sliders(folder: Path, rounds: int) -> list[Row]:
    """A slider of the design page moved, and a plan edited, for each kind of test."""
    found = []
    for kind, name in PLANS.items():
        text = (FOLDER / name).read_text()
        if kind == "strapdown":
            text = with_keys(text, named(SYSTEMS[kind].plan)["19 positions"])
        path = folder / f"{kind}.toml"
        path.write_text(text)
        study = read_study(kind, path)
        held = foresight(study)
        factors = np.full(len(held.levers), 0.5)

        def edited(kind: str = kind, path: Path = path) -> None:
            again = read_study(kind, path)
            made = foresight(again)
            made.u(np.ones(len(made.levers)))
            verticals(again)

        works = {"slider": lambda held=held, factors=factors: held.u(factors), "plan edited": edited}
        size = f"{kind}, {len(held.names)} values"
        for what, seconds in in_turn(works, rounds).items():
            promised = {"at_most": 100.0} if what == "slider" else {}
            found.append(row(what, size, ("ms", 1e3), seconds, **promised))
    return found


async def pages(bench: Bench, rounds: int) -> list[Row]:
    """Pages made by the server, of the example selfcal."""
    from nicegui.testing.user_simulation import user_simulation

    from inercal.bench.workbench.pages import add_pages

    session = bench.sessions.begin_with("selfcal")
    await asyncio.to_thread(bench.queue.wait, bench.run(session).id)
    found = []
    async with user_simulation() as user:
        add_pages(bench)
        for page in PAGES:
            path = page if page.startswith("/") else f"/sessions/{session.id}/{page}"
            seconds = []
            for _ in range(rounds + 1):
                began = PROCESSOR()
                await user.open(path)
                seconds.append(PROCESSOR() - began)
            found.append(row(f"page {page}", "selfcal", ("ms", 1e3), seconds[1:], at_most=300.0))
    return found


def jobs(bench: Bench, count: int) -> list[Row]:
    """Memory before and after so many jobs."""
    session = bench.sessions.begin("jobs")
    (session.folder / STUDY).write_text((FOLDER / "selfcal.toml").read_text())

    def run(times: int) -> None:
        for _ in range(times):
            job = bench.queue.add(session.id, session.folder, ["examples", "--json"])
            bench.queue.wait(job.id)

    run(min(10, count))
    before = memory()
    run(count)
    grown = memory() - before
    return [
        Row(
            "memory after the jobs less before",
            f"{count} jobs",
            "MiB",
            Spread(grown, grown, grown),
            at_most=20.0,
        )
    ]


def memory() -> float:
    """Memory of this process now [MiB]."""
    time.sleep(0.2)
    pages_held = int(Path("/proc/self/statm").read_text().split()[1])
    return pages_held * os.sysconf("SC_PAGE_SIZE") / 1024**2


if __name__ == "__main__":
    alone(rows, __doc__)
