"""What else errs in a tunnel, by the program's own simulator: the angle without and with its cure, and the verdict.

    python benchmarks/aoa_cures.py --seeds 8 --first 2001

15 deg + 10 deg at 1 Hz and a slow sweep from -10 to 60 deg, 30 s at 500 Hz, biases drawn; rms error [deg], rms of error
over u, coverage of 95 % after 2 s, and how many runs end ``ok``, with what the others name.
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from aoa_tunnels import STUDY
from independent.aoa import DEG, G

from inercal.systems.aoa.disturbances import Disturbances, Shaking
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.settings import AoaSettings
from inercal.systems.aoa.simulate import simulate, to_record
from inercal.systems.aoa.task import measure

SINE = MotionPlan("sine", 30.0, 500.0, mean=15.0 * DEG, amplitude=10.0 * DEG, frequency=1.0)
SWEEP = MotionPlan("static", 30.0, 500.0, first=-10.0 * DEG, last=60.0 * DEG)
SHAKEN = Shaking(3.0 * G, 120.0, 240.0)


def stated_axis(of: AoaSettings) -> AoaSettings:
    """The axis of a2 stated as it is."""
    return replace(of, layout=replace(of.layout, angle=of.layout.angle + np.array([0.0, 0.3 * DEG, 0.0])))


def with_noise(**changes: float) -> Callable[[AoaSettings], AoaSettings]:
    """More stated under [noise]."""
    return lambda of: replace(of, noise=replace(of.noise, **changes))


def as_it_is(of: AoaSettings) -> AoaSettings:
    """No cure."""
    return of


@dataclass(frozen=True)
class Case:
    """What is wrong, in what motion, and its cure, in words and in the study."""

    name: str
    disturbances: Disturbances
    motion: MotionPlan
    cure: str
    cured: Callable[[AoaSettings], AoaSettings]


WALK = with_noise(accelerometer_walk=300e-6 * G)
K2 = with_noise(rectification=1e-4 / G)
AXIS = Disturbances(axis_errors=(0.0, 0.3 * DEG, 0.0))
DRIFT = Disturbances(bias_drift=(0.0, 1e-3 * G, 0.0))
CASES = (
    Case("axis of a2 by 0.3 deg, sine", AXIS, SINE, "stated", stated_axis),
    Case("axis of a2 by 0.3 deg, sweep", AXIS, SWEEP, "stated", stated_axis),
    Case("bias of a2 drifts by 1 mg, sine", DRIFT, SINE, "`accelerometer_walk`", WALK),
    Case("bias of a2 drifts by 1 mg, sweep", DRIFT, SWEEP, "`accelerometer_walk`", WALK),
    Case(
        "rectification of 100 ug/g^2 of 3 g, sine",
        Disturbances(local_vibration=SHAKEN, rectification=1e-4 / G),
        SINE,
        "`rectification`",
        K2,
    ),
    Case("stamps jitter by 0.1 ms, sine", Disturbances(stamp_jitter=1e-4), SINE, "none", as_it_is),
    Case("gyro at 100 Hz, sine", Disturbances(sample_rates={"gyro": 100.0}), SINE, "none", as_it_is),
    Case(
        "gyro scale by 1 %, sine", Disturbances(gyro_scale=1e-2), SINE, "`gyro_scale`",
        lambda of: replace(of, prior=replace(of.prior, gyro_scale=1e-2)),
    ),
)  # fmt: skip


def figures(case: Case, seeds: range, stated: AoaSettings) -> str:
    """Rms error, error over u, coverage, and the verdicts."""
    squares, verdicts = [], Counter[str]()
    for seed in seeds:
        true = replace(STUDY, motion=case.motion, disturbances=case.disturbances)
        made = simulate(true, np.random.default_rng(seed))
        record = to_record(replace(made.recording, reference=None), true)
        measured = measure(record, stated)
        late = made.recording.t > 2.0
        error, u = (measured.angles.theta - made.theta)[late], measured.angles.u[late]
        squares.append((np.mean(error**2), np.mean((error / u) ** 2), np.mean(abs(error) < 1.96 * u)))
        of = measured.estimate
        verdicts[" ".join([of.status.value, *sorted({each.code for each in of.findings if each.harm})])] += 1
    error, ratio, covered = np.mean(squares, axis=0)
    told = ", ".join(f"{count} {each}" for each, count in verdicts.most_common())
    return f"{np.sqrt(error) / DEG:.2g} / {np.sqrt(ratio):.2g} / {100.0 * covered:.0f} % | {told}"


def main() -> None:
    """Print the table of the book."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--seeds", type=int, default=8, help="how many")
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    options = parser.parse_args()
    seeds = range(options.first, options.first + options.seeds)
    print("| case | without | verdicts | cure | with | verdicts |\n|---|---|---|---|---|---|")
    for case in CASES:
        without = figures(case, seeds, STUDY)
        cured = "– | –" if case.cure == "none" else figures(case, seeds, case.cured(STUDY))
        print(f"| {case.name} | {without} | {case.cure} | {cured} |", flush=True)


if __name__ == "__main__":
    main()
