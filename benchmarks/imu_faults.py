"""Faults of recordings in the hand, size by size: shift in u, verdict, and the name that the fault is given.

    python benchmarks/imu_faults.py --draws 50
    python benchmarks/imu_faults.py --sound 500

Recordings come from benchmarks/independent/imu.py, which shares no code with inercal. Two calibrations of a unit, with
the fault and without, of the same noise: the shift is their largest difference among the coefficients over u of the
one with the fault, rms over the draws. The results are kept in docs/uncertainty/imu-faults.md, by hand.
"""

import argparse
import functools
import os
from collections import Counter
from dataclasses import dataclass, replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from campaigns.places import add_options, answers, in_words
from independent import imu

from inercal.foundation.errors import InputError
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import Site
from inercal.foundation.records.record import record_of
from inercal.foundation.units import parse_unit
from inercal.systems.imu.settings import ImuSettings
from inercal.systems.imu.task import calibrate

SEED = 20261122
SITE = Site(imu.G, (), imu.LATITUDE)
CODES = (
    "restless_start",
    "outlying_turn",
    "outlying_pose",
    "unmodelled_k2",
    "excess_scatter",
    "bias_drift",
    "skipped_turn",
)
GOOD = {"acc_noise": 2e-5, "gyro_noise": 1e-6}

#: name -> (fault, K2 [1/(m/s^2)], noise, square poses)
CASES = {
    "sound": (imu.Faults(), 0.0, {}, False),
    **{
        f"hand at the start, {1e3 * f:g} mm/s^2": (imu.Faults(20.0, f, 0.4 * f), 0.0, {}, False)
        for f in (0.005, 0.01, 0.05, 0.2)
    },
    **{
        f"one turn off by {1e3 * a:g} mrad": (imu.Faults(turn=a), 0.0, {}, False)
        for a in (0.005, 0.01, 0.0176, 0.05, 0.2)
    },
    **{
        f"one pose off by {1e3 * a:g} mm/s^2": (imu.Faults(pose=a), 0.0, {}, False)
        for a in (0.002, 0.005, 0.02, 0.05, 0.5)
    },
    **{
        f"K2 of {k:g} ug/g^2": (imu.Faults(), k * 1e-6 / 9.80665, {}, False)
        for k in (30.0, 100.0, 200.0, 300.0, 1000.0)
    },
    **{
        f"K2 of {k:g} ug/g^2, good unit, 19 square poses": (imu.Faults(), k * 1e-6 / 9.80665, GOOD, True)
        for k in (3.0, 10.0, 30.0)
    },
    **{f"gyro clips at {c:g} rad/s": (imu.Faults(clip=c), 0.0, {}, False) for c in (3.0, 2.0)},
    **{f"clock off by {1e6 * c:g} ppm": (imu.Faults(clock=c), 0.0, {}, False) for c in (5e-5, 3e-3)},
    "accelerometers 50 mm beside the point turned about": (imu.Faults(arm=0.05), 0.0, {}, False),
    "gyro 20 ms late": (imu.Faults(delay=0.02), 0.0, {}, False),
}


@functools.cache
def sound(seed, square, good):
    """The estimate of a draw without a fault."""
    return estimate(seed, imu.Faults(), 0.0, GOOD if good else {}, square, ImuSettings(SITE))


def estimate(seed, fault, k2, noise, square, settings):
    """The estimate of a draw, or None where it is refused."""
    rng = np.random.default_rng([SEED, seed])
    made = replace(imu.unit(rng, **noise), k2=np.full(3, k2))
    ups = imu.square_ups(rng, 19) if square else imu.random_ups(rng, 24)
    t, acc, gyro = imu.record(rng, made, ups, fault)
    units = {"acc": parse_unit("m/s^2"), "gyro": parse_unit("rad/s")}
    columns = [
        (f"{sensor}_{axis}", units[sensor], values[:, i])
        for sensor, values in (("acc", acc), ("gyro", gyro))
        for i, axis in enumerate("xyz")
    ]
    try:
        return calibrate(record_of(columns, t), settings).estimate
    except InputError:
        return None


def row(name, draws, settings):
    """A row of the table."""
    fault, k2, noise, square = CASES[name]
    shifts, passed, verdicts, named = [], [], Counter(), Counter()
    for seed in range(draws):
        off = estimate(seed, fault, k2, noise, square, settings)
        without = sound(seed, square, bool(noise))
        if off is None:
            verdicts["refused"] += 1
            continue
        verdicts[off.status.value] += 1
        named.update({f.code for f in off.findings if f.harm or f.code != "unmodelled_k2"} & set(CODES))
        common = [each for each in off.names if each in without.names]
        shifts.append(
            max(abs(off[each].value - without[each].value) / (0.5 * off[each].U) for each in common)
        )
        if off.status is Status.OK:
            passed.append(shifts[-1])
    size = f"{np.sqrt(np.mean(np.square(shifts))):.1f}" if shifts else "-"
    counts = ", ".join(f"{word} {count}" for word, count in verdicts.most_common())
    codes = ", ".join(f"{code} {count}" for code, count in named.most_common())
    far = sum(shift > 2.0 for shift in passed)
    return f"| {name} | {size} | {counts} | {far} | {codes} |"


@dataclass(frozen=True)
class Rows:
    """Rows of the table by their numbers."""

    draws: int

    def __call__(self, number):
        """One of them."""
        return row([*CASES][number], self.draws, ImuSettings(SITE))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--draws", type=int, default=50)
    parser.add_argument(
        "--sound", type=int, default=0, help="count the verdicts of so many sound recordings only"
    )
    add_options(parser)
    options = parser.parse_args()
    settings = ImuSettings(SITE)
    if options.sound:
        ended: Counter[str] = Counter()
        for seed in range(options.sound):
            done = estimate(1000 + seed, imu.Faults(), 0.0, {}, False, settings)
            codes = {finding.code for finding in done.findings if finding.harm}
            ended[" ".join([done.status.value, *sorted(codes)])] += 1
        print(", ".join(f"{word} {count}" for word, count in ended.most_common()))
        return
    print("| fault | shift [u] | verdicts | ok with more than 2 u | names |\n| --- | --- | --- | --- | --- |")
    from imu_faults import Rows  # by this name, which workers know too

    about = {"imu_faults": [*CASES], "draws": options.draws}
    for line in answers(Rows(options.draws), len(CASES), options, about, 1):
        print(line)


if __name__ == "__main__":
    in_words(main)
