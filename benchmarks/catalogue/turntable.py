"""Faults of a turntable test: those of `independent/turntable_faults.py`, and of the file."""

from __future__ import annotations

import sys
import tempfile
from dataclasses import replace
from functools import cache, partial
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "independent"))
import turntable_faults as of_table

import inercal as ic
from inercal.foundation.errors import InputError
from turntable import ARCSEC, Faults, recorded

from .fault import REFUSED, Fault, Outcome, compared

SHORT = dict(zip(of_table.TESTS, ("in order", "shuffled", "tumble"), strict=True))


def estimate(test: str, draw: int, what: Faults, change=None):
    """One calibration; ``change`` takes the written angles [rad] and the outputs, and gives both."""
    kind, angles, noise, _, arcsec = of_table.TESTS[test]
    number = list(of_table.TESTS).index(test)
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "study.toml").write_text(of_table.study(test))
        seed = [of_table.SEED, number, draw]
        if change is None:
            return of_table.calibrated(test, seed, what, folder).estimate
        y = recorded(np.random.default_rng(seed), kind, angles, noise, arcsec * ARCSEC, what)
        written, y = change(angles.copy(), y, noise)
        names = ["y_x [deg/h]", "y_y [deg/h]"] if kind == "gyrowheel" else [f"acc_{i} [m/s^2]" for i in "xyz"]
        head = ",".join(["position [1]", "phi1 [deg]", "phi2 [deg]", *names])
        rows = np.column_stack([np.arange(1, len(written) + 1), np.degrees(written), y])
        np.savetxt(folder / "record.csv", rows, delimiter=",", header=head, comments="", fmt="%.12g")
        return ic.calibrate(ic.read(folder / "record.csv"), folder / "study.toml").estimate


@cache
def without(test: str, draw: int):
    """The estimate of a sound test."""
    return estimate(test, draw, Faults())


def one(test: str, what: Faults, draw: int, change=None) -> Outcome:
    """A draw with the fault beside the same without."""
    try:
        return compared(estimate(test, draw, what, change), without(test, draw))
    except InputError:
        return REFUSED


def mistyped(angles, y, noise):
    """One angle of phi1 by 10 deg."""
    angles[7, 0] += np.radians(10.0)
    return angles, y


def rows_exchanged(angles, y, noise):
    """The readings of two positions in each other's row."""
    y[[5, 11]] = y[[11, 5]]
    return angles, y


def reversed_joint(angles, y, noise):
    """phi2 counted the other way."""
    return angles * np.array([1.0, -1.0]), y


def joints_exchanged(angles, y, noise):
    """phi1 and phi2 in each other's column."""
    return angles[:, ::-1], y


def outlier(angles, y, noise):
    """One reading 20 times its noise off."""
    y[9, 0] += 20.0 * noise
    return angles, y


MIRROR = "it is the mirror image, in which y of the instrument is reversed: K1_y or kY_y is negative"
SITE = "earth rate is what the study states"
CHANGES = {
    "one angle mistyped by 10 deg": mistyped,
    "two rows exchanged": rows_exchanged,
    "phi2 counted the other way": reversed_joint,
    "phi1 and phi2 exchanged": joints_exchanged,
    "one reading 20 times its noise off": outlier,
}


def faults() -> dict[str, Fault]:
    """All, by name."""
    found = {}
    for test, short in SHORT.items():
        kinds = of_table.OF_GYROS if of_table.TESTS[test][0] == "gyrowheel" else of_table.OF_FORCE
        for kind, sizes in kinds.items():
            words = next(words for begin, words in of_table.WORDS.items() if kind.startswith(begin))
            for size, what in sizes:
                found[f"{short}: {kind}, {size}"] = Fault(partial(one, test, what), words)
        for name, change in CHANGES.items():
            blind = MIRROR if change is reversed_joint else ""
            found[f"{short}: {name}"] = Fault(partial(one, test, Faults(), change=change), "", blind)
        wrong = replace(Faults(), latitude=np.radians(1.0))
        found[f"{short}: latitude wrong by 1 deg"] = Fault(partial(one, test, wrong), "latitude", SITE)
    return found


def sound(draw: int) -> Outcome:
    """A test without a fault, each kind in turn."""
    estimated = without(list(SHORT)[draw % 3], 1000 + draw)
    return compared(estimated, estimated)
