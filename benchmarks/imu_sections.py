"""An IMU by sections: the recording that ships by its moves, and a unit that never rests.

    python benchmarks/imu_sections.py

Processor time of each, the scale factors of the gyro, and the accelerometers of a simulated swing beside the truth.
"""

import time

import numpy as np
from dialects.motion import truth

from inercal.examples import FOLDER
from inercal.foundation.geometry.earth import GravityInput, Site
from inercal.foundation.records.read import read
from inercal.systems.imu.sections.priors import Priors, Size
from inercal.systems.imu.sections.swing import swing_calibration
from inercal.systems.imu.sections.swing_gyro import gravity_turns, swing_gyro
from inercal.systems.imu.settings import ImuSettings
from inercal.systems.imu.task import calibrate

SITE = Site(9.81744, (GravityInput("gravity", 2e-5, "m/s^2", 1.0),))


def timed(work):
    """What a function gives, and its processor time [s], the second time."""
    work()
    clock = time.process_time()
    return work(), time.process_time() - clock


def by_moves():
    """The shipped recording by the poses and moves that are found in it."""
    record = read([FOLDER / "xsens_acc.mat", FOLDER / "xsens_gyro.mat"], FOLDER / "xsens-map.toml")
    settings = ImuSettings(SITE, 50.0, time_base_u=2e-5)
    found, seconds = timed(lambda: calibrate(record, settings).estimate)
    print(f"xsens: {seconds:.2f} s; {found.message}")
    for name in ("S_x", "S_y", "S_z"):
        print(f"  {name} {found[name].value:.6g} ± {found[name].u:.2g}")


def by_swing():
    """A unit that never rests, of noise as motion.py has it: K1 beside 1, S beside 1."""
    true = truth("swing", 100.0, 120.0, np.random.default_rng(20261127))
    priors = Priors(Site(9.80665), acc_scale=Size(1.0, 0.05), gyro_scale=Size(1.0, 0.05))
    found, of_swing = timed(lambda: swing_calibration(true.acc, priors, "swing", 100.0, true.gyro))
    print(
        f"swing: {of_swing:.2f} s; K1 less 1 in u:",
        ((found.x[3:6] - 1.0) / found.u[3:6]).round(2),
        "u:",
        found.u[3:6],
    )
    turns, of_turns = timed(lambda: gravity_turns(true.acc, true.gyro, true.t))
    gyro = None if turns is None else swing_gyro(turns)
    if gyro is not None:
        print(f"  gyro: {of_turns:.2f} s; S {gyro.x[3:6].round(4)}, u {gyro.u[3:6].round(4)}")


if __name__ == "__main__":
    by_moves()
    by_swing()
