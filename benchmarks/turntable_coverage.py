"""Are the stated uncertainties of a turntable calibration true? A campaign of simulated calibrations.

    python benchmarks/turntable_coverage.py --runs 2000 --folder build/coverage-turntable

An interrupted campaign goes on where it stopped. Its result is kept in docs/uncertainty/turntable.md.
"""

import argparse
import os
import sys
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from inercal.estimate.coverage import coverage, nees
from inercal.estimate.executors import Processes
from inercal.estimate.runs import run
from inercal.instruments.by_angle import EXTRA, channel_model
from inercal.validate.gyrowheel import (
    one_turntable_calibration,
    one_turntable_calibration_of_unknown_noise,
)

SEED = 20261121


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument("--folder", type=Path, help="keep finished chunks here")
    parser.add_argument(
        "--unknown-noise", action="store_true", help="more noise, estimated from the residuals"
    )
    options = parser.parse_args()

    task = one_turntable_calibration_of_unknown_noise if options.unknown_noise else one_turntable_calibration
    names = [s for axis in "xy" for s in channel_model("gyrowheel", f"y_{axis}").without(EXTRA).symbols]
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
    found = coverage(sample["error"], sample["u"], sample["dof"])
    print(found.table(names))
    print(f"design effect {found.design_effect:.1f}")
    print(nees(sample["error"], sample["covariance"]))


if __name__ == "__main__":
    main()
