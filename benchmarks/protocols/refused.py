"""Protocols with something wrong, or that only their owner can decide: the right outcome names it."""

from __future__ import annotations

import numpy as np

from .physics import DEG, SIDES, G, Path, poses_path, side, unit
from .written import LATITUDE, Case, csv, means

COMMAND = f"inercal calibrate imu *.csv {LATITUDE}"


def six(folder, rng, made, name_of, attitude_of):
    """Six files of accelerometers."""
    for axis, sign in SIDES:
        t, acc, _ = made.log(Path(attitude_of(axis, sign)).rest(6), 50, rng)
        csv(folder / name_of(axis, sign), ["t [s]", *(f"acc_{i} [m/s^2]" for i in "xyz")], [t, *acc.T])


def word(axis, sign):
    """The usual name of a file."""
    return f"{axis}_{'up' if sign > 0 else 'down'}.csv"


def side_taken_twice(folder, rng):
    """The file of -y holds +y once more."""
    made = unit(rng)
    six(folder, rng, made, word, lambda axis, sign: side(axis, 1 if axis == "y" else sign, rng))
    return Case((COMMAND,), made, (), ("y_down", "y_up"))


def exchanged_files(folder, rng):
    """The files of +x and -x have each other's names."""
    made = unit(rng)
    six(
        folder,
        rng,
        made,
        lambda axis, sign: word(axis, -sign if axis == "x" else sign),
        lambda a, s: side(a, s, rng),
    )
    return Case((COMMAND,), made, (), ("x_up", "x_down"))


def outputs_of_gravity(folder, rng):
    """An output that shows gravity, down: all six names are opposed."""
    made = unit(rng)
    six(folder, rng, made, word, lambda axis, sign: side(axis, -sign, rng))
    return Case((COMMAND,), made, (), ("gravity", "down", "opposite", "opposed"))


def two_units_in_one_file(folder, rng):
    """Two whole units in one file: only the owner knows which is meant."""
    path = poses_path(rng, poses=24)
    columns, header = [], ["t [s]"]
    for k in (1, 2):
        t, acc, gyro = unit(rng).log(path, 50, rng)
        columns += [*acc.T, *gyro.T]
        header += [*(f"imu{k}_acc_{i} [m/s^2]" for i in "xyz"), *(f"imu{k}_gyro_{i} [rad/s]" for i in "xyz")]
    csv(folder / "log.csv", header, [t, *columns])
    return Case((COMMAND,), None, (), ("imu1", "imu2"))


def magnetometer_alone(folder, rng):
    """A file without any inertial sensor."""
    path = poses_path(rng, poses=20)
    motion = path.sampled(20)
    field = motion.C.transpose(0, 2, 1) @ np.array([21.0, 0.0, -43.0]) + rng.normal(
        0, 0.3, (len(motion.t), 3)
    )
    csv(folder / "log.csv", ["time", "mx [uT]", "my [uT]", "mz [uT]"], [motion.t, *field.T])
    return Case((COMMAND,), None, (), ("no accelerometer", "no sensor", "magnetometer", "neither"))


def trajectory(folder, rng):
    """Positions and a quaternion: no sensor."""
    t = np.arange(0, 60, 0.05)
    motion = poses_path(rng, poses=12).sampled(20)
    from scipy.spatial.transform import Rotation

    q = Rotation.from_matrix(motion.C[: len(t)]).as_quat()
    place = np.cumsum(rng.normal(0, 0.02, (len(q), 3)), axis=0)
    csv(folder / "log.csv", ["t", "x", "y", "z", "qx", "qy", "qz", "qw"], [t[: len(q)], *place.T, *q.T])
    return Case((COMMAND,), None, (), ("no accelerometer", "no sensor", "nothing", "neither"))


def gyro_without_a_unit(folder, rng):
    """A gyro at rest on six sides whose unit nothing tells, times in the file."""
    made = unit(rng)
    for axis, sign in SIDES:
        t, _, gyro = made.log(Path(side(axis, sign, rng)).rest(6), 50, rng)
        csv(folder / word(axis, sign), ["t", "gx", "gy", "gz"], [t, *gyro.T])
    return Case((COMMAND,), None, (), ("gyro=", "unit"))


def clipped_turns(folder, rng):
    """Turns faster than the range of the gyro, which stops at 125 deg/s."""
    made = unit(rng).given(gyro_size=DEG, acc_size=G)
    t, acc, gyro = made.log(poses_path(rng, poses=26, turning=1.2, least=90), 100, rng, (0.02, 0, 0.01))
    gyro = np.clip(gyro, -125, 125)
    header = ["t [s]", *(f"acc_{i} [g]" for i in "xyz"), *(f"gyro_{i} [deg/s]" for i in "xyz")]
    csv(folder / "log.csv", header, [t, *acc.T, *gyro.T], form="{:.8g}")
    return Case((COMMAND,), made, ("K0", "K1", "M"), ("clip", "saturat", "range"), either=True)


def too_few_poses(folder, rng):
    """Five rows of means cannot fix nine coefficients."""
    from scipy.spatial.transform import Rotation

    made = unit(rng)
    acc, _, _, _ = means(made, list(Rotation.random(5, random_state=rng)), 50, 4, rng)
    csv(folder / "means.csv", ["pose", "ax", "ay", "az"], [np.arange(1, 6), *acc.T], form="{:.7g}")
    return Case(
        (f"inercal calibrate imu means.csv {LATITUDE}",),
        made,
        (),
        ("few", "more", "unobservable", "add"),
        True,
    )


def wrong_rate(folder, rng):
    """A preamble that says 100 Hz of a log that was made at 93.5 Hz; no times."""
    made = unit(rng).given(gyro_size=DEG)
    _, acc, gyro = made.log(poses_path(rng, poses=28), 93.5, rng, (0.02, 0, 0.01))
    header = [*(f"acc_{i} [m/s^2]" for i in "xyz"), *(f"gyro_{i} [deg/s]" for i in "xyz")]
    csv(folder / "log.csv", header, [*acc.T, *gyro.T], form="{:.7g}", above=["# Fs = 100 Hz"])
    return Case((COMMAND,), made, ("K0", "K1", "M"), ("rate", "stamps", "clock", "Hz"), either=True)
