"""How long does one wait at the browser? Pages until they show, and zooms into ten million rows until they are drawn.

    python benchmarks/workbench_browser.py [--quick]

By the clock on the wall, in the system's Chromium without a screen or a graphics processor, browser and workbench on
the same two processors. A page shows when its heading is painted, by the browser's own clock from the begin of
navigation; `load` is its own event. A zoom is from the gesture until the picture holds the new samples and is painted.
"""

import os
import re
import subprocess
import sys
import tempfile
import time
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from measure import WALL, Row, alone, row
from playwright.sync_api import Page, sync_playwright
from workbench_speed import PAGES, recording

from inercal.bench.workbench.bench import open_bench

CHROMIUM = next(
    (
        path
        for path in ("/usr/bin/chromium", "/usr/bin/chromium-browser", "/usr/bin/google-chrome")
        if Path(path).exists()
    ),
    None,
)

SHOWN = """
new MutationObserver((_, watcher) => {
    if (!document.querySelector("h1")) return;
    watcher.disconnect();
    requestAnimationFrame(() => requestAnimationFrame(() => { window.shown = performance.now(); }));
}).observe(document, {childList: true, subtree: true});
"""

ZOOM = """
async ([begin, end]) => {
    const plot = document.querySelector(".js-plotly-plot"), began = performance.now();
    const painted = () => new Promise(requestAnimationFrame);
    Plotly.relayout(plot, {"xaxis.range": [begin, end]});
    for (;;) {
        await painted();
        const x = plot._fullData[0].x, span = x[x.length - 1] - x[0];
        if (0.8 * (end - begin) < span && span < 1.3 * (end - begin)) break;
    }
    await painted();
    return (performance.now() - began) / 1000;
}
"""


def rows(quick: bool) -> list[Row]:
    """All figures."""
    if CHROMIUM is None:
        raise SystemExit("Chromium or Chrome is needed (apt-get install chromium)")
    count, rounds = (10**5, 1) if quick else (10**7, 5)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        work, store = folder / "work", folder / "store"
        bench = open_bench(work, str(store))
        try:
            long = bench.sessions.begin("long")
            np.savez(long.folder / "long.npz", **recording(count))
            done = bench.sessions.begin_with("selfcal")
            bench.queue.wait(bench.run(done).id)
        finally:
            bench.close()
        command = [
            sys.executable,
            "-m",
            "inercal",
            "workbench",
            str(work),
            "--no-browser",
            "--store",
            str(store),
        ]
        with subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True
        ) as served:
            try:
                assert served.stdout is not None
                told = re.search(r"(http://\S+?)/\?key=(\S+)", served.stdout.readline())
                assert told is not None
                with sync_playwright() as playwright:
                    flags = ["--disable-dev-shm-usage", *(["--no-sandbox"] if os.geteuid() == 0 else [])]
                    chromium = playwright.chromium.launch(executable_path=CHROMIUM, args=flags)
                    page = chromium.new_page(viewport={"width": 1366, "height": 768})
                    page.set_default_timeout(120_000)
                    page.add_init_script(SHOWN)
                    page.goto(f"{told[1]}/?key={told[2]}")
                    found = shown(page, told[1], done.id, rounds) + zoomed(
                        page, told[1], long.id, count, rounds
                    )
                    chromium.close()
                    return found
            finally:
                served.terminate()


def shown(page: Page, base: str, session: str, rounds: int) -> list[Row]:
    """Each page of the example selfcal, as one who has seen another page of the workbench before opens it."""
    found = []
    for name in PAGES:
        path = name if name.startswith("/") else f"/sessions/{session}/{name}"
        heading, whole = [], []
        for _ in range(rounds + 1):
            page.goto(base + path)
            page.wait_for_function("window.shown")
            page.wait_for_load_state("networkidle")
            loaded = "performance.getEntriesByType('navigation')[0].loadEventEnd"
            heading.append(1e-3 * float(page.evaluate("window.shown")))
            whole.append(1e-3 * float(page.evaluate(loaded)))
            time.sleep(1.0)  # what the page draws on is not the next one's
        found.append(row(f"page {name}, until it shows", "selfcal", ("ms", 1e3), heading[1:], at_most=300.0))
        found.append(row(f"page {name}, until `load`", "selfcal", ("ms", 1e3), whole[1:]))
    return found


def zoomed(page: Page, base: str, session: str, count: int, rounds: int) -> list[Row]:
    """Zooms into the picture of a long recording."""
    began = WALL()
    page.goto(f"{base}/sessions/{session}/recording", wait_until="commit")
    page.wait_for_selector(".js-plotly-plot .main-svg")
    size = f"{count:,} rows".replace(",", " ")
    found = [row("recording, until its picture", size, ("s", 1.0), [WALL() - began])]
    time.sleep(2.0)
    whole = count / 1000.0
    for what, part in {"a tenth": 0.1, "a hundredth": 0.01, "one second, every sample": 1.0 / whole}.items():
        seconds = []
        for k in range(rounds + 1):
            begin = (0.3 + 0.05 * k) * whole
            seconds.append(float(page.evaluate(ZOOM, [begin, begin + part * whole])))
            time.sleep(0.5)
        found.append(row(f"zoom to {what}", size, ("ms", 1e3), seconds[1:], at_most=150.0))
    return found


if __name__ == "__main__":
    alone(rows, __doc__)
