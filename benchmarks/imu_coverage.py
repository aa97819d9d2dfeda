"""Are the stated uncertainties of an IMU's calibration true? Campaigns of simulated calibrations.

    python benchmarks/imu_coverage.py --runs 2000 --checkpoint build/coverage
    python benchmarks/imu_coverage.py --runs 2000 --method ferraris

An interrupted campaign with --checkpoint goes on where it stopped. The results are kept in docs/uncertainty/imu.md (by
hand) and docs/uncertainty/imu-methods.md (the other methods).
"""

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from campaigns import aided, ferraris, rows
from campaigns import imu as by_hand
from campaigns.places import add_options, in_words, place_of, progress

from inercal.foundation.computing.runs import run
from inercal.foundation.inference.consistency import coverage
from inercal.foundation.instruments.terms import (
    ACCELEROMETER_TRIAD,
    ACCELEROMETERS_IN_A_FRAME,
    GYRO_G_SENSITIVITY,
    GYRO_TRIAD,
)
from inercal.systems.imu.aided.coefficients import LEVER_ARMS
from inercal.systems.imu.ferraris.names import TERMS_OF_FERRARIS

SEED = 20261121
METHODS = ("multiposition", "ferraris", "aided", "means", "known_rates", "known_turns")
ON_A_TABLE = (*ACCELEROMETERS_IN_A_FRAME, *GYRO_TRIAD, *LEVER_ARMS, "tau_a", "tau_g")
BY_HAND = ACCELEROMETER_TRIAD + GYRO_TRIAD
WITH_SQUARES = (*ACCELEROMETER_TRIAD, "K2_x", "K2_y", "K2_z", *GYRO_TRIAD, *GYRO_G_SENSITIVITY)
OF_RATES = (*GYRO_TRIAD[:6], "T_xy", "T_xz", "T_yz")
CAMPAIGNS = {
    "means": (rows.one_of_means, ACCELEROMETER_TRIAD),
    "known_rates": (rows.one_of_known_rates, OF_RATES),
    "known_turns": (rows.one_of_known_turns, GYRO_TRIAD),
    "multiposition, K2 drawn": (rows.one_with_k2, WITH_SQUARES),
    "multiposition, K2 fitted": (rows.one_with_k2_fitted, WITH_SQUARES),
    "multiposition": (by_hand.one_calibration, BY_HAND),
    "multiposition, g-sensitivity": (
        by_hand.one_calibration_with_g_sensitivity,
        BY_HAND + GYRO_G_SENSITIVITY,
    ),
    "ferraris": (ferraris.one_calibration, TERMS_OF_FERRARIS),
    "ferraris, by scatter": (ferraris.one_calibration_by_scatter, TERMS_OF_FERRARIS),
    "aided": (aided.one_calibration, ON_A_TABLE),
}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument("--method", choices=METHODS, default="multiposition")
    kind = parser.add_mutually_exclusive_group()
    kind.add_argument(
        "--g-sensitivity",
        action="store_const",
        dest="kind",
        const=", g-sensitivity",
        help="multiposition: draw and estimate g-sensitive drift too",
    )
    kind.add_argument(
        "--by-scatter",
        action="store_const",
        dest="kind",
        const=", by scatter",
        help="ferraris: leave the alignment to the scatter of the positions",
    )
    kind.add_argument(
        "--k2",
        choices=("drawn", "fitted"),
        help="multiposition: draw second-order coefficients, or draw and fit them",
    )
    add_options(parser)
    options = parser.parse_args()
    if options.k2:
        options.kind = f", K2 {options.k2}"
    chosen = options.method + (options.kind or "")
    if chosen not in CAMPAIGNS:
        parser.error(f"found {chosen}, expected one of: {'; '.join(CAMPAIGNS)}")

    task, names = CAMPAIGNS[chosen]
    sample = run(
        task,
        runs=options.runs,
        seed=SEED,
        executor=place_of(options),
        folder=options.checkpoint,
        progress=progress,
    )
    print(f"sound: {int(sample['sound'].sum())} of {options.runs}")
    print(coverage(sample["error"], sample["u"], sample["dof"]).table(names))


if __name__ == "__main__":
    in_words(main)
