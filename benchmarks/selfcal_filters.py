"""Time a step of the self-calibration filters beside filterpy's unscented filter with the same model, in one run.

    python benchmarks/selfcal_filters.py [--runs 10] [--smoke]

filterpy draws the same 61 points (`plain_filterpy`), with Cholesky's factor first and with the eigen factor; ours run
on the 540 s record of the paper's path, filterpy on its first steps, one after the other in each run. The
error-state filter solves the same problem in another way and is set against the faster of the two. The end says how
far the filters are from each other and what share of a sample interval of 0.2 s a step takes.
"""

import argparse
import os
import statistics
import time
from dataclasses import replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
import plain_filterpy

from inercal.geometry.earth import gravity
from inercal.geometry.site import Site
from inercal.selfcal.filtered import Problem, problem
from inercal.selfcal.filtering import estimate
from inercal.selfcal.plan import path
from inercal.selfcal.recording import Recording
from inercal.selfcal.settings import Filter, Noise, SelfcalSettings
from inercal.selfcal.simulate import experiment, simulate

LATITUDE = np.radians(40.0)
ARCSEC, PER_HOUR, MICRO_G = np.radians(1 / 3600), np.radians(1 / 3600), 9.80665e-6

FILTERPY_CHOLESKY, FILTERPY_EIGEN = "filterpy, Cholesky first", "filterpy, eigen"

#: ours -> kind, factor, and the peer it is set against
OURS = {
    "svd-qukf, Cholesky": (Filter("svd-qukf", factor="cholesky"), FILTERPY_CHOLESKY),
    "svd-qukf, eigen": (Filter("svd-qukf", factor="eigen"), FILTERPY_EIGEN),
    "svd-qukf, SVD": (Filter("svd-qukf", factor="svd"), FILTERPY_EIGEN),
    "mukf": (Filter("mukf"), FILTERPY_CHOLESKY),
    "gimbal-ukf": (Filter("gimbal-ukf"), FILTERPY_CHOLESKY),
    "error-state": (Filter("error-state"), FILTERPY_CHOLESKY),
}


def paper() -> SelfcalSettings:
    """The study of the paper, nominal noise."""
    truth, prior = np.zeros(24), np.ones(24)
    prior[:18] = np.repeat(
        [0.3 * PER_HOUR, 300 * ARCSEC, 300 * ARCSEC, 300 * ARCSEC, 500 * MICRO_G, 1500e-6], 3
    )
    truth[:18] = 0.3 * prior[:18]
    return SelfcalSettings(
        site=Site(float(gravity(LATITUDE)), (), LATITUDE),
        noise=Noise(5e-4 * np.radians(1.0) / 60.0, 10 * MICRO_G, 2 * ARCSEC),
        prior=prior,
        truth=truth,
        plan=path("paper"),
    )


def compared(recording: Recording, told: Problem, steps: int) -> dict[str, float]:
    """Processor seconds of a step of each filter, one after the other; the median of three of ours."""
    seconds = {}
    for name, factor in (
        (FILTERPY_CHOLESKY, plain_filterpy.cholesky_first),
        (FILTERPY_EIGEN, plain_filterpy.eigen),
    ):
        clock = time.process_time()
        plain_filterpy.run(told, recording, steps, factor)
        seconds[name] = (time.process_time() - clock) / steps
    for name, (kind, _) in OURS.items():
        asked, each = replace(told, filter=kind), []
        for _ in range(3):
            clock = time.process_time()
            found = estimate(recording, asked, history=False)
            each.append((time.process_time() - clock) / found.steps)
        seconds[name] = statistics.median(each)
    return seconds


def spread(values: list[float]) -> tuple[float, float, float]:
    """Median, and the ends of the middle 80 %."""
    values = sorted(values)
    return statistics.median(values), values[len(values) // 10], values[-1 - len(values) // 10]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=10)
    parser.add_argument("--steps", type=int, default=500, help="of filterpy")
    parser.add_argument(
        "--smoke", action="store_true", help="one run of few steps; no timing is to be judged"
    )
    options = parser.parse_args()
    runs, steps = (1, 20) if options.smoke else (options.runs, options.steps)

    settings = paper()
    recording = simulate(experiment(settings), np.random.default_rng(1)).recording
    told = problem(settings)
    compared(recording, told, 5)  # compiles or loads
    all_runs = [compared(recording, told, steps) for _ in range(runs)]
    for name in all_runs[0]:
        step, low, high = spread([1e6 * each[name] for each in all_runs])
        print(
            f"{name:26s} {step:8.2f} us a step ({low:.2f} to {high:.2f}), {step / 2e5:.4%} of 0.2 s", end=""
        )
        if name in OURS:
            peer = OURS[name][1]
            ratio, low, high = spread([each[peer] / each[name] for each in all_runs])
            print(f"   {ratio:6.1f} times {peer} ({low:.1f} to {high:.1f})", end="")
        print()

    reference = estimate(recording, told, "error-state", history=False)
    u = np.sqrt(np.diag(reference.covariance))
    for name, (kind, _) in OURS.items():
        found = estimate(recording, replace(told, filter=kind), history=False)
        gap = np.max(np.abs(found.coefficients - reference.coefficients) / u)
        print(
            f"{name:26s} {gap:.1e} standard deviations from the error-state filter, NIS {found.nis_mean:.3f}"
        )


if __name__ == "__main__":
    main()
