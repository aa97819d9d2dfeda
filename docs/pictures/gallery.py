"""Takes the pictures of the gallery: the first screen of the report of each system, from examples that ship.

Into this folder, or the one given. Needs the system's Chromium; the tests compare no pixels.
"""

import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[2]
sys.path.insert(0, str(ROOT / "tests" / "workbench"))

from browsing import browser  # noqa: E402

import inercal as ic  # noqa: E402
from inercal.cli import run  # noqa: E402
from inercal.examples import EXAMPLES, FOLDER  # noqa: E402
from inercal.laboratory.store import make_store  # noqa: E402

#: name -> command whose report is shown, files of examples by their names
REPORTS = {
    "imu": "calibrate imu xsens_acc.mat xsens_gyro.mat --map xsens-map.toml --study xsens.toml",
    "turntable": "calibrate turntable tumble.csv.gz --study tumble.toml",
    "strapdown": "calibrate strapdown strapdown.bin.gz --map strapdown-map.toml --study strapdown.toml",
    "selfcal": "selfcal selfcal.csv.gz --study selfcal.toml",
    "aoa": "aoa sting.csv.gz --study sting.toml",
    "noise": "allan lasergyro.txt.gz --map lasergyro-map.toml",
}


def made(folder):
    """The reports, in a folder."""
    for name, command in REPORTS.items():
        words = [str(FOLDER / word) if (FOLDER / word).is_file() else word for word in command.split()]
        if not (folder / f"{name}.html").exists():
            run([*words, "--report", str(folder / f"{name}.html"), "--quiet"])
    store = str(folder / "lab")
    make_store(store)
    for record in EXAMPLES["five-years"].records:
        day = record.removeprefix("gyro-").removesuffix(".csv")
        study = ic.study(FOLDER / "gyro.toml", traceability={"date": day})
        ic.keep(ic.calibrate(ic.read(FOLDER / record), study), store=store)
    run(["history", "0117", "--store", store, "--report", str(folder / "history.html"), "--quiet"])
    return [*REPORTS, "history"]


if __name__ == "__main__":
    into = Path(sys.argv[1]) if len(sys.argv) > 1 else Path(__file__).parent
    with tempfile.TemporaryDirectory() as work, browser() as chromium:
        names = made(Path(work))
        page = chromium.new_context(viewport={"width": 1000, "height": 900}).new_page()
        for name in names:
            page.goto((Path(work) / f"{name}.html").as_uri())
            page.wait_for_timeout(300)
            page.screenshot(path=into / f"report-{name}.png")
