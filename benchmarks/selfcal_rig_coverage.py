"""Are the uncertainties true where the states of a rig are estimated too? Every run has errors drawn from the priors.

    python benchmarks/selfcal_rig_coverage.py --runs 2000 --checkpoint build/coverage-rig [--more k2 levers]

Recordings are those of the simulator of tests/selfcal/test_rig_states.py, written with SciPy's rotations: joints that
move, sensors that read them. Its results are kept in docs/uncertainty/self-calibration.md.
"""

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from campaigns.places import add_options, answers, in_words
from campaigns.rig import SEED, Calibration, posed

from inercal.foundation.inference.consistency import coverage, nees
from inercal.systems.selfcal.platform.states import ADDED, RIG


def main() -> None:
    """Run the campaign, and print its figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument(
        "--more", nargs="*", default=[], choices=[*ADDED], help="kinds of states beside those of rig"
    )
    add_options(parser)
    given = parser.parse_args()
    kinds = (*RIG, *(each for name in given.more for each in ADDED[name]))
    names = posed(kinds)[1].names
    found = answers(Calibration(kinds), given.runs, given, {"rig": kinds, "seed": SEED})
    error, covariance, nis = (np.array(each) for each in zip(*found, strict=True))
    u = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    held, fits = coverage(error, u), nees(error, covariance)
    off = np.sqrt(np.mean(np.square(error / u), axis=0))
    print(f"{len(names)} states, {given.runs} runs")
    print(f"covered {held.fraction.min():.3f} to {held.fraction.max():.3f}, limits {held.limits}")
    print(f"all together {held.pooled:.4f}, limits {held.pooled_limits}")
    print(f"NEES {fits.mean:.3f} of {fits.expected}, limits {fits.limits}")
    print(f"rms over u {off.min():.3f} ({names[off.argmin()]}) to {off.max():.3f} ({names[off.argmax()]})")
    print(f"NIS {np.mean(nis):.4f}; largest error {np.abs(error / u).max():.2f} u")


if __name__ == "__main__":
    in_words(main)
