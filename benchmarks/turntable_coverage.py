"""Are the stated uncertainties of a turntable calibration true? A campaign of simulated calibrations.

    python benchmarks/turntable_coverage.py --runs 2000 --checkpoint build/coverage-turntable

An interrupted campaign goes on where it stopped. Its result is kept in docs/uncertainty/turntable.md.
"""

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from campaigns.places import add_options, in_words, place_of, progress

from inercal.faces.validate.table import (
    one_turntable_calibration,
    one_turntable_calibration_of_unknown_noise,
)
from inercal.foundation.computing.runs import run
from inercal.foundation.inference.consistency import coverage, nees
from inercal.foundation.instruments.by_angle import EXTRA, channel_model

SEED = 20261121


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument(
        "--unknown-noise", action="store_true", help="more noise, estimated from the residuals"
    )
    add_options(parser)
    options = parser.parse_args()

    task = one_turntable_calibration_of_unknown_noise if options.unknown_noise else one_turntable_calibration
    names = [s for axis in "xy" for s in channel_model("gyrowheel", f"y_{axis}").without(EXTRA).symbols]
    sample = run(
        task,
        runs=options.runs,
        seed=SEED,
        executor=place_of(options),
        folder=options.checkpoint,
        progress=progress,
    )
    print(f"sound: {int(sample['sound'].sum())} of {options.runs}")
    found = coverage(sample["error"], sample["u"], sample["dof"])
    print(found.table(names))
    print(f"design effect {found.design_effect:.1f}")
    print(nees(sample["error"], sample["covariance"]))


if __name__ == "__main__":
    in_words(main)
