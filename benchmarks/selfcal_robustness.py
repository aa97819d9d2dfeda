"""How self-calibration takes wrong starts, gimbal lock, and recordings with faults. A campaign of simulated runs.

    python benchmarks/selfcal_robustness.py --seeds 100

Its results are kept in docs/uncertainty/self-calibration.md.
"""

import argparse
import math
import os
from collections import Counter
from dataclasses import replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

from inercal.examples import FOLDER
from inercal.faces.studies.load import load_selfcal_study
from inercal.foundation.geometry.rotations import boxplus
from inercal.systems.selfcal.diagnosis.examination import diagnose
from inercal.systems.selfcal.disturbances import Disturbances, EncoderHarmonic
from inercal.systems.selfcal.estimators import KINDS
from inercal.systems.selfcal.filters.problem import AttitudeStart, problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.platform.plan import PlatformPlan, Turn
from inercal.systems.selfcal.simulate import experiment, simulate

SEED = 20261121
STUDY = load_selfcal_study(FOLDER / "selfcal.toml")

THROUGH_LOCK = tuple(
    Turn(joint, math.radians(angle)) for joint, angle in (("x", 90), ("y", 180), ("z", 180), ("x", 90))
)


def generator(run):
    """The random stream of one run."""
    return np.random.default_rng([SEED, run])


def worst(found, truth):
    """Largest error of a coefficient over its standard uncertainty; infinite where the filter says it failed."""
    if not found.converged:
        return math.inf
    return float(np.abs((found.coefficients - truth[:18]) / np.sqrt(np.diag(found.covariance))).max())


def wrong_starts(seeds):
    """From initial attitudes that are off by an angle in a random direction, and told so."""
    made, of = experiment(STUDY), problem(STUDY)
    print(f"\nlargest error over u of any coefficient, {seeds} seeds, started off by", end="")
    print("".join(f"{angle:>9} deg" for angle in (1, 10, 60, 120)) + "   encoders")
    for kind in KINDS:
        row = []
        for angle in (1, 10, 60, 120, None):
            errors = []
            for run in range(seeds):
                rng = generator(run)
                simulated = simulate(made, rng)
                start = None
                if angle is not None:
                    axis = rng.standard_normal(3)
                    off = math.radians(angle) * axis / np.linalg.norm(axis)
                    start = AttitudeStart(boxplus(simulated.attitude[0], off), math.radians(angle))
                errors.append(
                    worst(estimate(simulated.recording, of, kind, start, history=False), made.truth)
                )
            row.append(max(errors))
        print(f"{kind:>74}" + "".join(f"{each:13.2f}" for each in row[:-1]) + f"{row[-1]:11.2f}")


def gimbal_lock(seeds):
    """A path on which the inner gimbal goes through 90 deg."""
    settings = replace(STUDY, plan=PlatformPlan(THROUGH_LOCK))
    made, of = experiment(settings), problem(settings)
    print(
        f"\npath through thy = 90 deg, {seeds} seeds: largest error over u, and how many say that they failed"
    )
    for kind in KINDS:
        found = [
            estimate(simulate(made, generator(run)).recording, of, kind, history=False)
            for run in range(seeds)
        ]
        failed = sum(not each.converged for each in found)
        sound = [replace(each, converged=True) for each in found]
        print(f"{kind:>12} {max(worst(each, made.truth) for each in sound):10.2f}  {failed}")


def faulty(name, recording):
    """The recording with a fault."""
    th, acc, rate = recording.th.copy(), recording.acc.copy(), recording.rate.copy()
    match name:
        case "stuck encoder":
            th[300:340, 2] = th[300, 2]
        case "command log shifted by a row":
            rate = np.roll(rate, 1, axis=0)
        case "accelerometers x and y swapped":
            acc = np.ascontiguousarray(acc[:, [1, 0, 2]])
        case "accelerometer z reversed":
            acc[:, 2] *= -1.0
        case "ten samples dropped without a gap in time":
            keep = np.delete(np.arange(len(th)), np.arange(1000, 1010))
            th, acc = th[keep], acc[keep]
            return replace(recording, t=recording.t[: len(keep)], th=th, acc=acc, rate=rate[keep[:-1]])
        case "a reading far off":
            acc[1500, 0] += 0.05
    return replace(recording, th=th, acc=acc, rate=rate)


FAULTS = (
    "none",
    "stuck encoder",
    "command log shifted by a row",
    "accelerometers x and y swapped",
    "accelerometer z reversed",
    "ten samples dropped without a gap in time",
    "a reading far off",
    "gyro scale 20 ppm",
    "base turned by 5 arcsec",
    "encoder error of 5 arcsec, twice a turn",
    "10 % of the samples missing",
)


def disturbed(name):
    """The study of a fault that is simulated."""
    truth = STUDY.truth.copy()
    match name:
        case "gyro scale 20 ppm":
            truth[18:21] = 20e-6
        case "base turned by 5 arcsec":
            truth[21] = np.radians(5.0 / 3600.0)
        case "encoder error of 5 arcsec, twice a turn":
            wave = EncoderHarmonic("z", 2, float(np.radians(5.0 / 3600.0)), 0.4)
            return replace(STUDY, disturbances=Disturbances(harmonics=(wave,)))
        case "10 % of the samples missing":
            return replace(STUDY, disturbances=Disturbances(dropouts=0.1))
    return replace(STUDY, truth=truth)


def faults(seeds):
    """What the diagnosis says of recordings with faults, and of sound ones."""
    of = problem(STUDY)
    print(f"\nfindings of the diagnosis, number of {seeds} seeds")
    for name in FAULTS:
        made, said = experiment(disturbed(name)), Counter()
        for run in range(seeds):
            recording = faulty(name, simulate(made, generator(run)).recording)
            findings = diagnose(recording, of, estimate(recording, of, history=False))
            said.update({finding.code for finding in findings} or {"nothing"})
        print(f"{name:>44}: " + ", ".join(f"{code} {count}" for code, count in said.most_common()))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, default=100, help="for the faults; the other parts take 8")
    options = parser.parse_args()
    wrong_starts(min(options.seeds, 8))
    gimbal_lock(min(options.seeds, 8))
    faults(options.seeds)


if __name__ == "__main__":
    main()
