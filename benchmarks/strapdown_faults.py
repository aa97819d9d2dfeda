"""Faults of a unit turned by hand, one by one: shift in u, verdict, and the name that the fault is given.

    python benchmarks/strapdown_faults.py --draws 20
    python benchmarks/strapdown_faults.py --sound 100

Recordings come from benchmarks/independent/strapdown.py, which shares no code with inercal. The shift is the largest
error of a coefficient over its u, rms over the draws. Of all errors: their rms over u, the part within 1.96 u, and the
mean squared error over the covariance. The results are kept in
docs/uncertainty/strapdown-faults.md, by hand.
"""

import argparse
import os
from collections import Counter
from dataclasses import dataclass, replace

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np
from campaigns.places import add_options, answers, in_words
from independent import strapdown

from inercal.foundation.findings import CODES, Harm, Status
from inercal.foundation.geometry.earth import Site
from inercal.foundation.records.record import record_of
from inercal.foundation.units import parse_unit
from inercal.systems.strapdown.settings import TURN_NOISE, Noise, Prior, Rests, StrapdownSettings
from inercal.systems.strapdown.task import calibrate

SEED = 20261123
TEST, DPH = strapdown.Test(), strapdown.DEG_PER_H
SETTINGS = StrapdownSettings(
    Site(strapdown.G, (), strapdown.LATITUDE),
    Noise(TEST.angle_walk, TEST.velocity_walk),
    rests=Rests(velocity=TEST.vibration),
    prior=Prior(30 * DPH, 1e-3, 1e-3, 5e-2, 1e-3, 1e-3, 1e-5, 0.05, 5e-3, 5e-4, 50 * DPH / 9.8),
)
WALKS = {"gyros": {"walk_gyro": 0.1 * DPH}, "accelerometers": {"walk_acc": 3.0 * strapdown.UG}}
STILL = {"noise": replace(SETTINGS.noise, estimate=TURN_NOISE)}
#: name -> (fault, change of the unit, change of the study)
CASES = {
    "none": ({}, {}, {}),
    **{
        f"drift of a gyro by force, {size:g} deg/h/g": ({}, {"g": np.full((3, 3), size * DPH / 9.8)}, {})
        for size in (1.0, 10.0)
    },
    **{
        f"asymmetry of {1e6 * size:g} ppm": ({}, {"asymmetry": np.full(3, size)}, {}) for size in (2e-5, 2e-4)
    },
    "accelerometers 20 mm apart, not fitted": ({}, {}, {"terms": ("k2", "delay")}),
    "accelerometers 4 ms late, not fitted": ({}, {"late": 4e-3}, {"terms": ("k2", "size")}),
    "K2 of 50 ug/g^2, not fitted": ({}, {}, {"terms": ("size", "delay")}),
    **{f"gyros drift by {size:g} deg/h": ({"ramp_gyro": size * DPH}, {}, {}) for size in (1.0, 10.0)},
    **{
        f"accelerometers drift by {1e6 * size:g} ug": ({"ramp_acc": size * 9.8}, {}, {})
        for size in (5e-5, 5e-4)
    },
    "both drift, by 10 deg/h and 500 ug": ({"ramp_gyro": 10.0 * DPH, "ramp_acc": 5e-4 * 9.8}, {}, {}),
    **{f"biases of {sensor} walk": (walk, {}, {}) for sensor, walk in WALKS.items()},
    **{f"biases of {sensor} walk, stated as 0": (walk, {}, STILL) for sensor, walk in WALKS.items()},
    "no walk, stated as 0": ({}, {}, STILL),
    **{f"latitude wrong by {size:g} deg": ({}, {}, {"wrong": np.radians(size)}) for size in (1.0, 10.0)},
    **{f"sway of {1e3 * size:g} mm/s at rest": ({"sway": size}, {}, {}) for size in (5e-4, 5e-3)},
    "a knock of 5 mm/s in a rest": ({"knock": 5e-3}, {}, {}),
    **{f"{count} samples lost in a turn": ({"lost": count}, {}, {}) for count in (1, 5)},
    **{f"gyro clips at {rate} rad/s": ({"clip": rate}, {}, {}) for rate in (1.0, 1.2)},
    **{f"gyros filtered, {1e3 * time:g} ms": ({"low_pass": time}, {}, {}) for time in (5e-3, 5e-2)},
    "gyros with 100 ppm of the square of 1 rad/s": ({"square": 1e-4}, {}, {}),
    "clock off by 50 ppm": ({"clock": 5e-5}, {}, {}),
}


def estimated(seed, fault, changes, study):
    """The estimate of a draw, and its errors over u by symbol."""
    rng = np.random.default_rng([SEED, seed])
    made = replace(strapdown.unit(rng), **changes)
    t, acc, gyro = strapdown.record(rng, made, TEST, strapdown.Faults(**fault))
    units = {"acc": parse_unit("m/s^2"), "gyro": parse_unit("rad/s")}
    columns = [
        (f"{sensor}_{axis}", units[sensor], values[:, i])
        for sensor, values in (("acc", acc), ("gyro", gyro))
        for i, axis in enumerate("xyz")
    ]
    study = dict(study)
    site = replace(SETTINGS.site, latitude=strapdown.LATITUDE + study.pop("wrong", 0.0))
    estimate = calibrate(record_of(columns, t), replace(SETTINGS, site=site, **study)).estimate
    truth = made.truth()
    truth["tau_a"] -= strapdown.lag(
        fault.get("low_pass", 0.0), TEST
    )  # gyros that lag are accelerometers that lead
    return estimate, {
        name: (estimate[name].value - truth[name]) / estimate[name].u for name in estimate.names
    }


def row(name, draws, first=0):
    """A row of the table."""
    shifts, passed, verdicts, named, all_errors, nees = [], [], Counter(), Counter(), [], []
    for seed in range(first, first + draws):
        estimate, errors = estimated(seed, *CASES[name])
        verdicts[estimate.status.value] += 1
        named.update(each.code for each in estimate.findings if CODES[each.code].harm is not Harm.NEVER)
        if errors:
            z = np.array(list(errors.values()))
            off = z * [estimate[each].u for each in errors]
            nees.append(off @ np.linalg.solve(estimate.covariance, off))
            all_errors.append(z)
            shifts.append(float(np.abs(z).max()))
            if estimate.status is Status.OK:
                passed.append(shifts[-1])
    size = f"{np.sqrt(np.mean(np.square(shifts))):.1f}" if shifts else "-"
    counts = ", ".join(f"{word} {count}" for word, count in verdicts.most_common())
    codes = ", ".join(f"`{code}` {count}" for code, count in named.most_common())
    z = np.concatenate(all_errors) if all_errors else np.zeros(0)
    whole = (
        f"{np.sqrt(np.mean(z**2)):.2f}, {np.mean(np.abs(z) < 1.96):.1%}, {np.mean(nees):.1f}"
        if len(z)
        else "-"
    )
    return f"| {name} | {size} | {counts} | {sum(each > 4.0 for each in passed)} | {codes} | {whole} |"


@dataclass(frozen=True)
class Rows:
    """Rows of the table by their numbers among the ``names`` of faults."""

    draws: int
    names: tuple[str, ...]

    def __call__(self, number):
        """One of them."""
        return row(self.names[number], self.draws)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--draws", type=int, default=20)
    parser.add_argument("--sound", type=int, default=0, help="only so many sound recordings")
    parser.add_argument("--only", default="", help="only faults whose name has this in it")
    add_options(parser)
    options = parser.parse_args()
    print(
        "| fault | largest error [u] | verdicts | ok with more than 4 u | names | all errors |\n"
        "| --- | --- | --- | --- | --- | --- |"
    )
    if options.sound:
        print(row("none", options.sound, 1000))
        return
    from strapdown_faults import Rows  # by this name, which workers know too

    names = tuple(each for each in CASES if options.only in each)
    about = {"strapdown_faults": [*names], "draws": options.draws}
    for line in answers(Rows(options.draws, names), len(names), options, about, 1):
        print(line, flush=True)


if __name__ == "__main__":
    in_words(main)
