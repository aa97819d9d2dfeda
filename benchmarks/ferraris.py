"""Time the Ferraris calibration of the shipped session in physical units against imucal, in one run.

    python benchmarks/ferraris.py [--runs 30] [--smoke]

Both get the data in memory and the same sections; runs alternate. Ours also gives the covariance of all 33
coefficients, the budget and the verdict; the noise at rest and the closed form alone are timed beside it.
"""

import argparse
import os
import statistics
import time
import tomllib

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import imucal
import numpy as np
import pandas as pd

from inercal.examples import FOLDER
from inercal.geometry.site import Site
from inercal.imu.ferraris.calibration import calibrate_ferraris
from inercal.imu.ferraris.method import matrices
from inercal.imu.ferraris.readings import read_sections
from inercal.imu.settings import ImuSettings
from inercal.records.maps import read_map
from inercal.records.read import read
from inercal.study.imu_ferraris import FerrarisTable, ferraris_settings

NAME, RATE, GRAVITY = "ferraris-si", 102.4, 9.81


def alternating(works: dict, runs: int) -> dict[str, list[float]]:
    """Seconds of each work in each of the runs, one after the other."""
    seconds: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(runs + 1):
        for name, work in works.items():
            clock = time.perf_counter()
            work()
            seconds[name].append(time.perf_counter() - clock)
    return {name: each[1:] for name, each in seconds.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=30)
    parser.add_argument("--smoke", action="store_true", help="one run; no timing is to be judged")
    options = parser.parse_args()

    study = tomllib.loads((FOLDER / f"{NAME}.toml").read_text())
    told = ferraris_settings(FerrarisTable.model_validate(study["imu"]["ferraris"]))
    settings = ImuSettings(Site(GRAVITY))
    record = read([FOLDER / f"{NAME}.csv.gz"], read_map(FOLDER / f"{NAME}-map.toml"))
    data = pd.read_csv(FOLDER / f"{NAME}.csv.gz")
    spans = pd.DataFrame({name: {"start": a, "end": b} for name, (a, b) in told.sections.items()}).T

    def theirs():
        regions = imucal.ferraris_regions_from_section_list(data, spans)
        return imucal.FerrarisCalibration(grav=GRAVITY, expected_angle=np.degrees(told.turn)).compute(
            regions, RATE, from_acc_unit="m/s^2", from_gyr_unit="deg/s"
        )

    whole = calibrate_ferraris(record, settings, told)

    def closed_form():
        readings = read_sections(whole.accelerometer, whole.gyro, whole.sections, settings.site, told)
        return matrices(readings.inputs, readings.weights)

    seconds = alternating(
        {
            "imucal, values alone": theirs,
            "inercal, with uncertainties": lambda: calibrate_ferraris(record, settings, told),
            "inercal, noise and closed form": closed_form,
        },
        1 if options.smoke else options.runs,
    )
    beside = seconds["imucal, values alone"]
    for name, each in seconds.items():
        ratios = sorted(a / b for a, b in zip(each, beside, strict=True))
        low, high = ratios[len(ratios) // 10], ratios[-1 - len(ratios) // 10]
        print(
            f"{name:34s} {1e3 * statistics.median(each):8.2f} ms ({1e3 * min(each):.2f} to {1e3 * max(each):.2f})   "
            f"ratio {statistics.median(ratios):6.2f} ({low:.2f} to {high:.2f})"
        )
    gain, info = whole.found.force_gain, theirs()
    print(f"largest difference in K_a R_a: {np.max(np.abs(gain / (info.K_a @ info.R_a) - 1)):.1e}")


if __name__ == "__main__":
    main()
