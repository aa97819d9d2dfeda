"""Faults in the hand: those of `imu_faults.py`, and of the file."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path

import imu_faults
import numpy as np
from independent import imu

from inercal.foundation.errors import InputError
from inercal.foundation.records.read import read
from inercal.systems.imu.settings import ImuSettings
from inercal.systems.imu.task import calibrate

from .fault import REFUSED, Fault, Outcome, compared

SETTINGS = ImuSettings(imu_faults.SITE)


def by_rig(name: str, draw: int) -> Outcome:
    """A fault of a unit or of how it is held."""
    fault, k2, noise, square = imu_faults.CASES[name]
    off = imu_faults.estimate(draw, fault, k2, noise, square, SETTINGS)
    return REFUSED if off is None else compared(off, imu_faults.sound(draw, square, bool(noise)))


def by_file(change, draw: int, settings=SETTINGS) -> Outcome:
    """A fault of what is recorded: ``change`` takes time, accelerometers and gyro, and a generator."""
    rng = np.random.default_rng([imu_faults.SEED, draw])
    made = imu.unit(rng)
    t, acc, gyro = change(*imu.record(rng, made, imu.random_ups(rng, 24), imu.Faults()), rng)
    with tempfile.TemporaryDirectory() as name:
        path = Path(name) / "record.csv"
        head = ",".join(
            ["t [s]", *(f"acc_{i} [m/s^2]" for i in "xyz"), *(f"gyro_{i} [rad/s]" for i in "xyz")]
        )
        np.savetxt(
            path, np.column_stack([t, acc, gyro]), delimiter=",", header=head, comments="", fmt="%.10g"
        )
        recorded = read(path)
    try:
        estimate = calibrate(recorded, settings).estimate
    except InputError:
        return REFUSED
    return compared(estimate, imu_faults.sound(draw, False, False))


def ramp(size, which):
    """A drift of biases from begin to end, none in the middle, of accelerometers (0) or gyros (1)."""
    return _added(size, which, lambda t: t / t[-1] - 0.5)


def warming(size, which, over=30.0):
    """A bias that dies away over 30 s, as a unit warms up, less its mean, of accelerometers (0) or gyros (1)."""
    return _added(size, which, _dying(over))


def _added(size, which, course):
    """Biases that take a course (n,) of time, its sign other on y."""

    def change(t, acc, gyro, rng):
        drift = size * course(t)[:, None] * np.array([1.0, -1.0, 1.0])
        return (t, acc + drift, gyro) if which == 0 else (t, acc, gyro + drift)

    return change


def growing(size, which):
    """Scale factors that change evenly from begin to end, of accelerometers (0) or gyros (1)."""
    return _scaled(size, which, lambda t: t / t[-1] - 0.5)


def settling(size, which, over=30.0):
    """Scale factors whose error dies away over 30 s, less its mean, of accelerometers (0) or gyros (1)."""
    return _scaled(size, which, _dying(over))


def _dying(over):
    """A course (n,) of time that dies away, less its mean."""

    def course(t):
        left = np.exp(-t / over)
        return left - left.mean()

    return course


def _scaled(size, which, course):
    """Scale factors that take a course (n,) of time, its sign other on y."""

    def change(t, acc, gyro, rng):
        factor = 1.0 + size * course(t)[:, None] * np.array([1.0, -1.0, 1.0])
        return (t, acc * factor, gyro) if which == 0 else (t, acc, gyro * factor)

    return change


def missing(share):
    """Rows left out at random, stamps kept."""

    def change(t, acc, gyro, rng):
        kept = rng.random(len(t)) >= share
        return t[kept], acc[kept], gyro[kept]

    return change


def exchanged(t, acc, gyro, rng):
    """Gyro y and z in each other's column."""
    return t, acc, gyro[:, [0, 2, 1]]


def standing(t, acc, gyro, rng):
    """Accelerometer y stands still in the middle third."""
    acc = acc.copy()
    third = len(t) // 3
    acc[third : 2 * third, 1] = acc[third, 1]
    return t, acc, gyro


def spikes(t, acc, gyro, rng):
    """20 single samples of 20 m/s^2 too much."""
    acc = acc.copy()
    acc[rng.integers(0, len(t), 20), rng.integers(0, 3, 20)] += 20.0
    return t, acc, gyro


def clipped(t, acc, gyro, rng):
    """Accelerometers end at 9 m/s^2."""
    return t, np.clip(acc, -9.0, 9.0), gyro


def jittered(t, acc, gyro, rng):
    """Stamps off by 2 ms."""
    return t + rng.uniform(-2e-3, 2e-3, len(t)), acc, gyro


CLOCK, GRAVITY = "time is what the record says", "the scale of force is the gravity that is stated"
OF_FILES = {
    "gyros drift by 1 mrad/s": ramp(1e-3, 1),
    "gyros drift by 10 mrad/s": ramp(1e-2, 1),
    "accelerometers drift by 5 mm/s^2": ramp(5e-3, 0),
    "accelerometers drift by 50 mm/s^2": ramp(5e-2, 0),
    "gyros warm up by 1 mrad/s": warming(1e-3, 1),
    "gyros warm up by 10 mrad/s": warming(1e-2, 1),
    "accelerometers warm up by 5 mm/s^2": warming(5e-3, 0),
    "accelerometers warm up by 20 mm/s^2": warming(2e-2, 0),
    "accelerometers warm up by 50 mm/s^2": warming(5e-2, 0),
    "scales of accelerometers drift by 500 ppm": growing(5e-4, 0),
    "scales of accelerometers drift by 2000 ppm": growing(2e-3, 0),
    "scales of gyros drift by 2000 ppm": growing(2e-3, 1),
    "scales of gyros drift by 5000 ppm": growing(5e-3, 1),
    "scales of accelerometers settle by 500 ppm": settling(5e-4, 0),
    "scales of accelerometers settle by 2000 ppm": settling(2e-3, 0),
    "scales of gyros settle by 2000 ppm": settling(2e-3, 1),
    "scales of gyros settle by 5000 ppm": settling(5e-3, 1),
    "scales of gyros settle by 10000 ppm": settling(1e-2, 1),
    "1 % of rows lost": missing(0.01),
    "10 % of rows lost": missing(0.1),
    "stamps jitter by 2 ms": jittered,
    "accelerometer y stands still for a third": standing,
    "20 samples of 20 m/s^2 too much": spikes,
    "accelerometers clip at 9 m/s^2": clipped,
    "gyro y and z exchanged": exchanged,
}


def faults() -> dict[str, Fault]:
    """All, by name."""
    found = {name: Fault(partial(by_rig, name)) for name in imu_faults.CASES if name != "sound"}
    for name in found:
        if name.startswith("clock"):
            found[name] = replace(found[name], told="clock|sample rate|time stamps", blind=CLOCK)
    for name, change in OF_FILES.items():
        told = "the scale factors of the gyro change" if name.startswith("scales of gyros") else ""
        found[name] = Fault(partial(by_file, change), told)
    for ppm in (50, 1000):
        site = replace(imu_faults.SITE, gravity=imu.G * (1.0 + 1e-6 * ppm))
        wrong = partial(by_file, lambda t, acc, gyro, rng: (t, acc, gyro), settings=ImuSettings(site))
        found[f"gravity wrong by {ppm} ppm"] = Fault(wrong, "gravity is taken as exactly", GRAVITY)
    return found


def sound(draw: int) -> Outcome:
    """A recording without a fault."""
    estimate = imu_faults.sound(1000 + draw, False, False)
    return compared(estimate, estimate)
