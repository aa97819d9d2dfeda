"""Coverage where a drift of the biases is fitted: tests by an independent simulator, calibrated by the product.

python benchmarks/independent/turntable_drift.py --runs 2000
"""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import numpy as np

import inercal as ic
from turntable import ACCELEROMETERS, ARCSEC, Faults, recorded, tumble

SEED = 20261124
UG = 9.8e-6
NOISE = 10.0 * UG
FAULTS = {
    "linear": lambda rng: Faults(ramp=rng.normal(0.0, 100.0 * UG)),
    "exponential": lambda rng: Faults(warm_up=rng.normal(0.0, 300.0 * UG), tau=rng.uniform(0.1, 0.3)),
    "random_walk": lambda rng: Faults(walk=50.0 * UG),
}
STUDY = """
[site]
latitude = "45.00 deg"
gravity = "9.8 m/s^2"
[rig]
kind = "two_axis_turntable"
[rig.errors]
default = {{ uniform = "5 arcsec" }}
[instrument]
kind = "accelerometer"
unit = "m/s^2"
bias_drift = "{kind}"
terms = ["K0_x", "K1_x", "M_xy", "M_xz", "K0_y", "K1_y", "M_yx", "M_yz", "K0_z", "K1_z", "M_zx", "M_zy"]
"""


def truth() -> dict[str, float]:
    """The true coefficients by name."""
    made = {}
    for k, i in enumerate("xyz"):
        made |= {f"K0_{i}": ACCELEROMETERS["K0"][k], f"K1_{i}": ACCELEROMETERS["K1"][k]}
        made |= {f"M_{i}{j}": ACCELEROMETERS["M"][k, n] for n, j in enumerate("xyz") if j != i}
    return made


def one(rng: np.random.Generator, kind: str, folder: Path, samples: int = 1, told: str = "") -> ic.Result:
    """One test with such a drift, calibrated with ``told`` (the same if empty)."""
    # twice the tumble, so that each attitude is there early and late
    angles = np.concatenate([tumble(), tumble()])
    y = recorded(rng, "accelerometer", angles, NOISE, 5.0 * ARCSEC, FAULTS[kind](rng), samples, NOISE)
    t = 600.0 * (np.arange(len(y)) + 0.5) / samples
    place = np.repeat(np.column_stack([np.arange(1, len(angles) + 1), np.degrees(angles)]), samples, axis=0)
    head = "t [s],position [1],phi1 [deg],phi2 [deg],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2]"
    np.savetxt(
        folder / "record.csv",
        np.column_stack([t, place, y]),
        delimiter=",",
        header=head,
        comments="",
        fmt="%.12g",
    )
    (folder / "study.toml").write_text(STUDY.format(kind=told or kind))
    return ic.calibrate(ic.read(folder / "record.csv"), folder / "study.toml")


def campaign(kind: str, runs: int, samples: int = 1) -> dict[str, float]:
    """Share of intervals (95 %) that hold the truth, rms of error over u, and share of tests that end ok."""
    inside, ratios, ok = [], [], []
    with tempfile.TemporaryDirectory() as folder:
        for run in range(runs):
            rng = np.random.default_rng([SEED, sorted(FAULTS).index(kind), run])
            estimate = one(rng, kind, Path(folder), samples).estimate
            true = truth()
            for name, each in estimate.parameters.items():
                low, high = each.interval(0.95)
                inside.append(low <= true[name] <= high)
                ratios.append((each.value - true[name]) / each.u)
            ok.append(estimate.status.value == "ok")
    return {
        "covered": float(np.mean(inside)),
        "rms": float(np.sqrt(np.mean(np.square(ratios)))),
        "ok": float(np.mean(ok)),
    }


def main() -> None:
    """Print a line for each kind of drift, from rows and from samples."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawTextHelpFormatter)
    parser.add_argument("--runs", type=int, default=100)
    given = parser.parse_args()
    for kind in FAULTS:
        for samples in (1, 10):
            print(kind, samples, campaign(kind, given.runs, samples), flush=True)


if __name__ == "__main__":
    main()
