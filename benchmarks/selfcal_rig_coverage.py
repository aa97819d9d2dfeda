"""Are the uncertainties true where the states of a rig are estimated too? Every run has errors drawn from the priors.

    python benchmarks/selfcal_rig_coverage.py --runs 2000 [--more k2 levers]

Recordings are those of the simulator of tests/selfcal/test_rig_states.py, written with SciPy's rotations: joints that
move, sensors that read them. Its results are kept in docs/uncertainty/self-calibration.md.
"""

import argparse
import os
import sys
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "selfcal"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "studies"))

import numpy as np
from test_rig_states import BASE, drawn, recorded

from inercal.estimate.coverage import coverage, nees
from inercal.selfcal.filters.problem import problem
from inercal.selfcal.filters.run import estimate
from inercal.selfcal.platform.states import ADDED, RIG
from inercal.selfcal.settings import Model

SEED = 20261123


def main() -> None:
    """Run the campaign, and print its figures."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=2000)
    parser.add_argument(
        "--more", nargs="*", default=[], choices=[*ADDED], help="kinds of states beside those of rig"
    )
    given = parser.parse_args()
    kinds = (*RIG, *(each for name in given.more for each in ADDED[name]))
    settings = replace(BASE, model=Model(kinds))
    posed, errors, covariances, mean_nis = problem(settings), [], [], []
    for number in range(given.runs):
        rng = np.random.default_rng([SEED, number])
        c = drawn(settings, rng, kinds)
        found = estimate(recorded(settings, c, rng), posed, "error-state", history=False)
        errors.append(found.coefficients - c[posed.states.index])
        covariances.append(found.covariance)
        mean_nis.append(np.nanmean(found.nis))
    error, covariance = np.array(errors), np.array(covariances)
    u = np.sqrt(np.diagonal(covariance, axis1=1, axis2=2))
    held, fits = coverage(error, u), nees(error, covariance)
    off = np.sqrt(np.mean(np.square(error / u), axis=0))
    print(f"{len(posed.names)} states, {given.runs} runs")
    print(f"covered {held.fraction.min():.3f} to {held.fraction.max():.3f}, limits {held.limits}")
    print(f"all together {held.pooled:.4f}, limits {held.pooled_limits}")
    print(f"NEES {fits.mean:.3f} of {fits.expected}, limits {fits.limits}")
    print(
        f"rms over u {off.min():.3f} ({posed.names[off.argmin()]}) to {off.max():.3f} ({posed.names[off.argmax()]})"
    )
    print(f"NIS {np.mean(mean_nis):.4f}; largest error {np.abs(error / u).max():.2f} u")


if __name__ == "__main__":
    main()
