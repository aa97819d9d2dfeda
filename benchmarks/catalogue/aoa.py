"""Faults of a wind tunnel: cases of `independent/aoa.py`, of `aoa_cures.py` made without the program, and of the file.

The shift is that of the angle after 2 s, rms over the run, over u: the errors with the fault less those without, of
the same biases and constants.
"""

from __future__ import annotations

from dataclasses import replace
from functools import cache, partial

import numpy as np
from aoa_tunnels import STUDY, cases
from independent.aoa import CASES, DEG, G, Run, Tunnel, simulate

from inercal.foundation.errors import InputError
from inercal.foundation.geometry.earth import Site
from inercal.systems.aoa.reading.recording import plain
from inercal.systems.aoa.simulate import to_record
from inercal.systems.aoa.task import measure

from .fault import REFUSED, Fault, Outcome, late, said


def tunnel(kind: str, **more) -> Tunnel:
    """30 s at 500 Hz."""
    return Tunnel(kind, duration=30.0, fs=500.0, **more)


def measured(run: Run, study=STUDY):
    """Angle, its u, and the estimate."""
    done = measure(to_record(plain(run.t, run.acc, run.gyro), study), study)
    return done.angles.theta, done.angles.u, done.estimate


@cache
def without(kind: str, draw: int):
    """The run of a quiet tunnel and its angle."""
    run = simulate(tunnel(kind), 3000 + draw)
    return run, measured(run)


def outcome(run: Run, kind: str, draw: int, study=STUDY, change=None) -> Outcome:
    """A run beside the quiet one of the same draw; ``change`` takes the run as recorded."""
    quiet, (before, _, _) = without(kind, draw)
    try:
        theta, u, estimate = measured(change(run) if change else run, study)
    except InputError:
        return REFUSED
    if len(theta) != len(run.t):
        rows = np.searchsorted(run.t, change(run).t)
        run = Run(run.t[rows], run.acc[rows], run.gyro[rows], run.theta[rows])
        quiet = Run(quiet.t[rows], quiet.acc[rows], quiet.gyro[rows], quiet.theta[rows])
        before = before[rows]
    after = run.t > 2.0
    shift = late(*(each[after] for each in (theta, u, run.theta, before, quiet.theta)))
    return Outcome(estimate.status.value, shift, "theta", *said(estimate.findings))


def by_tunnel(name: str, kind: str, draw: int) -> Outcome:
    """What a tunnel adds."""
    return outcome(simulate(tunnel(kind, **CASES[name]), 3000 + draw), kind, draw)


def by_file(change, kind: str, draw: int, more=None, study=STUDY) -> Outcome:
    """What is recorded otherwise, or stated otherwise."""
    return outcome(simulate(tunnel(kind, **(more or {})), 3000 + draw), kind, draw, study, change)


def scaled(factor):
    """The gyro's output by a factor."""
    return lambda run: replace(run, gyro=factor * run.gyro)


def drifting(run):
    """A bias of a2 that drifts by 1 mg."""
    return replace(run, acc=run.acc + 1e-3 * G * np.outer(run.t / run.t[-1], [0.0, 1.0, 0.0]))


def squared(run):
    """A K2 of 100 ug/g^2 of all accelerometers."""
    return replace(run, acc=run.acc + 1e-4 / G * run.acc**2)


def swapped(run):
    """a1 and a2 in each other's column."""
    return replace(run, acc=run.acc[:, [1, 0, 2]])


def reversed_axis(run):
    """a2 with the other sign."""
    return replace(run, acc=run.acc * np.array([1.0, -1.0, 1.0]))


def clipped(run):
    """Accelerometers end at 0.95 g, which nobody states."""
    return replace(run, acc=np.clip(run.acc, -0.95 * G, 0.95 * G))


def jittered(run):
    """Stamps that jitter by 0.1 ms."""
    return replace(run, t=run.t + np.random.default_rng(5).uniform(-1e-4, 1e-4, len(run.t)))


def gap(run):
    """A second without rows."""
    kept = (run.t < 10.0) | (run.t >= 11.0)
    return Run(run.t[kept], run.acc[kept], run.gyro[kept], run.theta[kept])


def delayed(seconds):
    """Accelerometers that come late."""
    return lambda run: replace(run, acc=np.roll(run.acc, round(seconds * 500.0), axis=0))


def same(run):
    """As recorded."""
    return run


def study_of(**layout):
    """The study with another layout."""
    return replace(STUDY, layout=replace(STUDY.layout, **layout))


def turned(sensor: int, degrees: float):
    """The study with an axis that is not where it says."""
    return {"study": study_of(angle=STUDY.layout.angle + degrees * DEG * np.eye(3)[sensor])}


FAR = np.array([0.0, 0.0, 0.02])
SCALE, DRIFT = "a gyro whose scale is off", "a bias of a\\d that drifts"
TURN = "an axis of a\\d that is turned"


def faults() -> dict[str, Fault]:
    """All, by name."""
    found = {
        f"{name}, {kind}": Fault(partial(by_tunnel, name, kind)) for name, kind in cases() if name != "quiet"
    }
    vibration = {"local": (3.0 * G, 120.0, 240.0)}
    for kind in ("sine", "polar"):
        found |= {
            f"{name}, {kind}": Fault(partial(by_file, change, kind, **more), told)
            for name, change, told, more in (
                ("gyro scale by 1 %", scaled(1.01), SCALE, {}),
                ("gyro scale by 0.4 %", scaled(1.004), SCALE, {}),
                ("gyro scale by 0.2 %", scaled(1.002), SCALE, {}),
                ("bias of a2 drifts by 1 mg", drifting, DRIFT, {}),
                ("K2 of 100 ug/g^2 under 3 g of vibration", squared, "rectif", {"more": vibration}),
                ("axis of a2 by 0.3 deg", same, TURN, turned(1, 0.3)),
                ("axis of a2 by 0.1 deg", same, TURN, turned(1, 0.1)),
                ("axis of a2 by 0.05 deg", same, TURN, turned(1, 0.05)),
                ("axis of a1 by 0.3 deg", same, TURN, turned(0, 0.3)),
                ("axis of a1 by 0.1 deg", same, TURN, turned(0, 0.1)),
                ("place of a3 by 20 mm", same, "", {"study": study_of(r=STUDY.layout.r + FAR)}),
                ("places in millimetres", same, "", {"study": study_of(r=1000.0 * STUDY.layout.r)}),
                ("gravity wrong by 1000 ppm", same, "", {"study": replace(STUDY, site=Site(1.001 * G))}),
                ("gyro reversed", scaled(-1.0), "", {}),
                ("gyro in deg/s taken for rad/s", scaled(1.0 / DEG), "", {}),
                ("a1 and a2 exchanged", swapped, "", {}),
                ("a2 reversed", reversed_axis, "", {}),
                ("accelerometers clip at 0.95 g", clipped, "", {}),
                ("accelerometers late 4 ms", delayed(4e-3), "", {}),
                ("stamps jitter by 0.1 ms", jittered, "", {}),
                ("a second without rows", gap, "", {}),
            )
        }
    return found


def sound(draw: int) -> Outcome:
    """A run of a quiet tunnel, each motion in turn."""
    kind = ("sine", "polar", "rest")[draw % 3]
    run, (angle, u, estimate) = without(kind, 1000 + draw)
    after = run.t > 2.0
    shift = late(*(each[after] for each in (angle, u, run.theta, run.theta, run.theta)))
    return Outcome(estimate.status.value, shift, "theta", *said(estimate.findings))
