"""Are the stated uncertainties of a hand-held calibration true? A campaign of simulated calibrations.

    python benchmarks/imu_coverage.py --runs 2000 --folder build/coverage

An interrupted campaign goes on where it stopped. Its result is kept in docs/design/coverage.md.
"""

import argparse
import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from inercal.estimate.coverage import coverage
from inercal.estimate.runs import Processes, run
from inercal.imu.campaign import one_calibration, one_calibration_with_g_sensitivity
from inercal.instruments.terms import ACCELEROMETER_TRIAD, GYRO_G_SENSITIVITY, GYRO_TRIAD

SEED = 20261121


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument("--folder", type=Path, help="keep finished chunks here")
    parser.add_argument(
        "--g-sensitivity", action="store_true", help="draw and estimate g-sensitive drift too"
    )
    options = parser.parse_args()

    task = one_calibration_with_g_sensitivity if options.g_sensitivity else one_calibration
    names = ACCELEROMETER_TRIAD + GYRO_TRIAD + (GYRO_G_SENSITIVITY if options.g_sensitivity else ())
    sample = run(
        task,
        runs=options.runs,
        seed=SEED,
        executor=Processes(os.cpu_count() or 1),
        folder=options.folder,
        progress=lambda done, total: print(f"\r{done} of {total}", end="", file=sys.stderr, flush=True),
    )
    print(file=sys.stderr)
    print(f"sound: {int(sample['sound'].sum())} of {options.runs}")
    print(coverage(sample["error"], sample["u"], sample["dof"]).table(names))


if __name__ == "__main__":
    main()
