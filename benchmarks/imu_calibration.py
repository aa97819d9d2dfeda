"""`calibrate imu` on the shipped Xsens recording beside the same method written plainly with SciPy.

    python benchmarks/imu_calibration.py [--quick]

The peer (`plain_tedaldi`) gives values alone, ours uncertainties, budget and verdict too, and the gyro's bias. The
whole process is that of the command without a report.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import plain_tedaldi
from measure import Row, Spread, alone, in_turn, named, of_processes, row

from inercal.examples import EXAMPLES, FOLDER
from inercal.faces.studies.load import load_imu_study
from inercal.foundation.records.maps import read_map
from inercal.foundation.records.read import read
from inercal.systems.imu.task import calibrate

XSENS = EXAMPLES["xsens"]


def process() -> None:
    """The whole command, without a report; it fails where the verdict is bad."""
    with tempfile.TemporaryDirectory() as folder:
        out = Path(folder) / "cal.json"
        command = [sys.executable, "-m", *XSENS.command(str(FOLDER)).split(), "--out", str(out)]
        subprocess.run(command, check=True, capture_output=True)


def rows(quick: bool) -> list[Row]:
    record = read([FOLDER / name for name in XSENS.records], read_map(FOLDER / XSENS.map))
    settings = load_imu_study(FOLDER / XSENS.study)
    acc, gyro = record.triad("acc"), record.triad("gyro")

    def plain(product):
        return plain_tedaldi.calibrate(acc.t, acc.values, gyro.values, 9.81744, 50.0, product)

    works = {"ours": lambda: calibrate(record, settings), "together": lambda: plain(plain_tedaldi.together)}
    seconds = in_turn(works, 1 if quick else 5)
    size, peer, unit = f"{len(acc.t)} samples, 38 poses", named("scipy"), ("s", 1.0)
    what = "IMU by hand, solve with uncertainties"
    found = [row(what, size, unit, seconds["ours"], f"{peer}, all turns together", seconds["together"])]
    fit = calibrate(record, settings).estimate
    p, q = plain(plain_tedaldi.together)
    for name, symbol, values in (("accelerometers", "K1", p), ("gyro, bias free in ours", "S", q)):
        expected = np.array([fit[f"{symbol}_{axis}"].value for axis in "xyz"])
        away = float(np.max(np.abs(values[:3] / expected - 1)))
        found.append(
            Row(
                f"Scale of the {name}, relative difference",
                size,
                "1",
                Spread(away, away, away),
                peer,
                at_most=2e-3,  # the peer knows no g-sensitivity
            )
        )
    if quick:
        return found
    # nothing is left to be warmed up, and one takes half a minute
    one = in_turn(
        {"sequence": lambda: plain(plain_tedaldi.in_sequence), "ours": works["ours"]},
        1,
    )
    found.insert(
        0, row(what, size, unit, one["ours"], f"{peer}, turn by turn", one["sequence"], at_least=20.0)
    )
    whole = in_turn({"process": process}, 3, of_processes)["process"]
    found.append(row("IMU by hand, the whole process", size, unit, whole, at_most=2.0))
    return found


if __name__ == "__main__":
    alone(rows, __doc__)
