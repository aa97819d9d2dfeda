"""Errors of `calibrate strapdown` against its stated uncertainties at three grades.

    python benchmarks/strapdown_coverage.py --runs 100

Truth is drawn from the prior, runs are those of the program's own simulator, 19 positions at 100 Hz. Of the fit: NEES
of 31 coefficients, coverage of 95 % intervals, scatter over bounds (geometric mean, least and largest coefficient),
chi-square over its degrees of freedom. Of the stated u, with drifts by force that are not fitted: the same coverage,
and by how much u is larger (geometric mean, worst coefficient). Where biases do not walk the largest difference of
filter and batch [u]; where they do, also with all noise but the white left to the recording: all figures of that are of
the stated u, which has what the sizes of noise leave open. The results are kept in docs/theory/strapdown.md, by hand.
"""

import argparse
import os
import sys
from dataclasses import replace
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
sys.path.append(str(Path(__file__).parents[1] / "tests" / "strapdown"))

import numpy as np
from grades import GRADES, drawn

from inercal.estimate.result import Estimate
from inercal.records.record import record_of
from inercal.strapdown.coefficients import stated
from inercal.strapdown.settings import ESTIMABLE, StrapdownSettings
from inercal.strapdown.simulate import simulated
from inercal.strapdown.task import calibrate
from inercal.units import parse_unit

UNITS = {"acc": parse_unit("m/s^2"), "gyro": parse_unit("rad/s")}


def studies(settings: StrapdownSettings) -> dict[str, StrapdownSettings]:
    """The study, with the filter beside the batch; where biases walk without, and one that leaves walks and turns to
    the recording."""
    if not settings.noise.walks:
        return {"stated": replace(settings, filter="error-state")}
    noise = replace(settings.noise, gyro_walk=0.0, accelerometer_walk=0.0, estimate=ESTIMABLE)
    return {"stated": settings, "estimated": replace(settings, noise=noise)}


def apart(estimate: Estimate) -> float:
    """Largest difference of filter and batch over u."""
    batch, of_filter = (estimate.result["compare"][name] for name in ("batch", "error-state"))
    return max(abs(of_filter[name]["value"] - each["value"]) / each["u"] for name, each in batch.items())


def row(settings: StrapdownSettings, true: StrapdownSettings, runs: int, seed: int) -> str:
    """Figures of a study on runs of another."""
    z, z_stated, nees, squares, growth, differ, verdicts = [], [], [], [], [], [], {}
    for number in range(runs):
        rng = np.random.default_rng([seed, number])
        c = drawn(true, rng)
        samples = simulated(true, c, rng)
        columns = [
            (f"{sensor}_{axis}", UNITS[sensor], values[:, i])
            for sensor, values in (("acc", samples.force), ("gyro", samples.rate))
            for i, axis in enumerate("xyz")
        ]
        record = record_of(columns, samples.ts * np.arange(1, len(samples.rate) + 1))
        made = calibrate(record, settings)
        of, fit = made.estimate, made.fit
        verdicts[of.status.value] = verdicts.get(of.status.value, 0) + 1
        u = np.array([of[name].u for name in of.names])
        error = np.array([of[name].value for name in of.names]) - stated(c, true.terms, true.frame)
        found = settings.noise != true.noise
        off, covariance = (error, of.covariance) if found else ((fit.c - c)[fit.free], fit.covariance)
        z.append(off / np.sqrt(np.diag(covariance)))
        nees.append(off @ np.linalg.solve(covariance, off))
        squares.append(fit.chi2 / fit.dof)
        z_stated.append(error / u)
        growth.append(u / np.array([of.result["bounds"][name] for name in of.names]))
        if settings.filter == "error-state":
            differ.append(apart(of))
    z, z_stated, growth = np.array(z), np.array(z_stated), np.array(growth)
    scatter = np.sqrt(np.mean(z**2, axis=0))
    cells = [
        f"{np.mean(nees):.1f}",
        f"{100.0 * np.mean(abs(z) < 1.96):.1f} %",
        f"{np.exp(np.mean(np.log(scatter))):.3f} ({scatter.min():.2f} to {scatter.max():.2f})",
        f"{np.mean(squares):.3f}",
        f"{100.0 * np.mean(abs(z_stated) < 1.96):.1f} %",
        f"{np.exp(np.mean(np.log(growth))):.3f}, {growth.mean(axis=0).max():.2f}",
        f"{max(differ):.4f}" if differ else "–",
        ", ".join(f"{word} {count}" for word, count in sorted(verdicts.items())),
    ]
    return " | ".join(cells)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=100)
    parser.add_argument("--seed", type=int, default=2101)
    options = parser.parse_args()
    print(
        "| grade, noise | NEES | 95 % | scatter over bounds | chi-square | stated u | larger | filter | verdicts |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for grade, true in GRADES.items():
        for name, settings in studies(true).items():
            print(f"| {grade}, {name} | {row(settings, true, options.runs, options.seed)} |", flush=True)


if __name__ == "__main__":
    main()
