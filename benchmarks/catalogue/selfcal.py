"""Faults of a platform: those of `selfcal_faults.py`, and of the file."""

from __future__ import annotations

import tempfile
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
import selfcal_faults
from independent.selfcal import Faults, simulated, study

import inercal as ic
from inercal.foundation.errors import InputError

from .fault import REFUSED, Fault, Outcome, compared

#: begin of the fault's name -> words by which `stated_exact` says what one that hides would do
WORDS = {
    "K2": "ug/g.2 of K2", "harmonics": "harmonics", "1/f": "bias_walk|walk", "warming": "bias_walk|walk",
    "scale asymmetry": "ppm of S_asym", "gravity": "of gravity", "latitude": "of latitude", "sag": "of sag",
    "g-sensitivity": "deg/h/g of G", "levers": "mm of r_",
}  # fmt: skip
BLIND = {"gravity": "the scale of force is the gravity that is stated"}


def by_file(change, draw: int) -> Outcome:
    """A fault of what is recorded: ``change`` takes the record."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "study.toml").write_text(study())
        rng = np.random.default_rng([selfcal_faults.SEED, draw])
        change(simulated(rng, selfcal_faults.DRIVE)).write(folder / "record.csv")
        try:
            estimate = ic.calibrate(ic.read(folder / "record.csv"), folder / "study.toml").estimate
        except InputError:
            return REFUSED
    return of_18(estimate, draw)


def of_18(estimate, draw: int) -> Outcome:
    """The first 18 coefficients beside those without the fault."""
    sound = selfcal_faults.without_fault("", draw)
    names = [name for name in estimate.names if name in sound.names][:18]
    values = {name: estimate[name].value for name in names}
    return compared(estimate, sound, values or {}, {name: sound[name].value for name in sound.names[:18]})


def by_rig(kind: str, size: int, draw: int) -> Outcome:
    """A fault of the rig, its direction drawn anew."""
    rng = np.random.default_rng([selfcal_faults.SEED, list(selfcal_faults.ALL).index(kind), size, draw])
    return of_18(selfcal_faults.calibrated("", draw, selfcal_faults.ALL[kind][size][1](rng)), draw)


def swapped(record):
    """Accelerometers x and y in each other's column."""
    return replace(record, acc=record.acc[:, [1, 0, 2]])


def reversed_axis(record):
    """Accelerometer z with the other sign."""
    return replace(record, acc=record.acc * np.array([1.0, 1.0, -1.0]))


def joints_exchanged(record):
    """Encoders x and y in each other's column."""
    return replace(record, th=record.th[:, [1, 0, 2]])


def shifted(record):
    """Commands a row late."""
    return replace(record, rate=np.roll(record.rate, 1, axis=0))


def stuck(record):
    """Encoder z stands still for 8 s while it turns."""
    th = record.th.copy()
    th[200:240, 2] = th[200, 2]
    return replace(record, th=th)


def outlier(record):
    """One reading of an accelerometer 0.05 m/s^2 off."""
    acc = record.acc.copy()
    acc[1500, 0] += 0.05
    return replace(record, acc=acc)


def dropped(record):
    """Ten rows dropped and the stamps closed up."""
    kept = np.r_[0:1500, 1510 : len(record.t)]
    cut = {name: getattr(record, name)[kept] for name in ("rate", "th", "acc", "C_np", "temperature")}
    return replace(record, t=record.t[: len(kept)], **cut)


CHANGES = {
    "accelerometers x and y exchanged": swapped,
    "accelerometer z reversed": reversed_axis,
    "encoders x and y exchanged": joints_exchanged,
    "commands a row late": shifted,
    "encoder z stuck for 8 s": stuck,
    "one reading 0.05 m/s^2 off": outlier,
    "ten rows dropped, stamps closed up": dropped,
}


def faults() -> dict[str, Fault]:
    """All, by name."""
    found = {}
    for kind, sizes in selfcal_faults.ALONE.items():
        words = next((words for begin, words in WORDS.items() if kind.startswith(begin)), "")
        for k, (size, _) in enumerate(sizes):
            if kind != "none":
                found[f"{kind}, {size}"] = Fault(partial(by_rig, kind, k), words, BLIND.get(kind, ""))
    return found | {name: Fault(partial(by_file, change)) for name, change in CHANGES.items()}


def sound(draw: int) -> Outcome:
    """A record without a fault."""
    estimate = selfcal_faults.calibrated("", 1000 + draw, Faults())
    return compared(estimate, estimate)
