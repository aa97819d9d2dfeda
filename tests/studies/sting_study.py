"""The reference study of a sting: section 5 of the specification of inertial angle of attack, for tests."""

import math
from dataclasses import replace

import numpy as np

from inercal.foundation.geometry.earth import Site
from inercal.systems.aoa.disturbances import Disturbances, Shaking
from inercal.systems.aoa.layout import Layout
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.settings import AoaSettings, Estimator, Noise, SensorCalibration

G = 9.80665
DEG = math.pi / 180.0

NOISE = Noise(1e-4 * G, 1e-4 * G, 0.2 * DEG, 5.0 * DEG / 3600.0)
BASE = MotionPlan("sine", mean=30.0 * DEG, amplitude=10.0 * DEG, frequency=1.0)


def layout(r=(-0.25, 0.20, 0.25), z=(0.0, 0.0, 0.0)):
    """The paper's three axes: -z, +x, +z."""
    angle = np.array([0.5 * math.pi, 0.0, -0.5 * math.pi])
    return Layout(("a1", "a2", "a3"), angle, np.array(r, dtype=float), np.array(z, dtype=float))


def study(states=19, motion=BASE, smooth=False, r=(-0.25, 0.20, 0.25), **changes):
    """The reference study; ``changes`` of `AoaSettings`."""
    usual = AoaSettings(Site(G), layout(r), NOISE, estimator=Estimator(states, smooth), motion=motion)
    return replace(usual, **changes)


def scenario(name, states=19, **motion):
    """A scenario of the reference table by its name; ``motion`` changes of its plan."""
    motions = {
        "large": replace(BASE, amplitude=16.0 * DEG),
        "chirp": MotionPlan("chirp", mean=20.0 * DEG, amplitude=5.0 * DEG, low=0.1, high=5.0),
        "buffet": MotionPlan("buffet", mean=45.0 * DEG, rms=0.2 * DEG, low=2.0, high=15.0),
        "pitch-pause": MotionPlan(
            "pitch-pause",
            first=-10.0 * DEG,
            last=90.0 * DEG,
            step=10.0 * DEG,
            rms=0.05 * DEG,
            low=3.0,
            high=15.0,
        ),
    }
    changes = {
        "flexure": {
            "disturbances": Disturbances(
                pitch=Shaking(0.1 * DEG, 8.0, 10.0),
                heave=Shaking(0.03 * G, 8.0, 10.0),
                axial=Shaking(0.005 * G, 14.0, 16.0),
            )
        },
        "pivot": {"disturbances": Disturbances(pivot=3e-3)},
        "heights": {"disturbances": Disturbances(heights=(5e-3, -3e-3, 5e-3))},
        "clipping": {
            "disturbances": Disturbances(clip=True),
            "sensors": {
                **{name: SensorCalibration(range=0.95 * G) for name in ("a1", "a2", "a3")},
                "gyro": SensorCalibration(range=40.0 * DEG),
            },
        },
    }
    r = (-0.25, 0.50, 0.25) if name == "large" else (-0.25, 0.20, 0.25)
    return study(states, replace(motions.get(name, BASE), **motion), r=r, **changes.get(name, {}))


SCENARIOS = ("base", "large", "chirp", "buffet", "pitch-pause", "flexure", "pivot", "heights", "clipping")


def clipped(recording, settings):
    """The recording without the samples that are at a range, as reading it from a file leaves it."""
    limits = np.array([settings.calibration(name).range or np.inf for name in settings.layout.names])
    of_gyro = settings.calibration("gyro").range or np.inf
    acc = np.where(np.abs(recording.acc) < limits, recording.acc, np.nan)
    return replace(
        recording, acc=acc, gyro=np.where(np.abs(recording.gyro) < of_gyro, recording.gyro, np.nan)
    )
