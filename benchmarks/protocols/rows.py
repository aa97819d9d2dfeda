"""Protocols of rows: means of poses, tables of tilt, known inputs and outputs; noise and temperature beside."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from .physics import DEG, GRAVITY, SIDES, G, Path, side, unit
from .written import LATITUDE, Case, csv, means, xlsx

ACC = ("K0", "K1")


def poses(rng, count):
    """Attitudes spread over all directions."""
    return list(Rotation.random(count, random_state=rng))


def means_of_poses(folder, rng):
    """A row of means for each of 24 poses, their directions unknown."""
    made = unit(rng)
    acc, _, _, _ = means(made, poses(rng, 24), 50, 4, rng)
    csv(folder / "means.csv", ["pose", "ax", "ay", "az"], [np.arange(1, 25), *acc.T], form="{:.7g}")
    return Case((f"inercal calibrate imu means.csv {LATITUDE}",), made, (*ACC, "M"))


def means_with_scatter(folder, rng):
    """Means with their standard deviations and numbers of samples, in g."""
    made = unit(rng).given(acc_size=G)
    acc, sd, _, _ = means(made, poses(rng, 30), 100, 5, rng)
    header = [*(f"a{i}_mean [g]" for i in "xyz"), *(f"a{i}_std [g]" for i in "xyz"), "n"]
    csv(folder / "means.csv", header, [*acc.T, *sd.T, np.full(30, 500)], form="{:.7g}")
    return Case((f"inercal calibrate imu means.csv {LATITUDE}",), made, (*ACC, "M"))


def means_with_directions(folder, rng):
    """Means and the directions that a table gave to them."""
    made = unit(rng)
    attitudes = poses(rng, 20)
    acc, _, _, _ = means(made, attitudes, 50, 4, rng)
    off = Rotation.from_rotvec(rng.normal(0, 0.02 * DEG, (20, 3)))
    up = np.array([(o * a.inv()).apply([0, 0, 1.0]) for o, a in zip(off, attitudes, strict=True)])
    header = ["up_x", "up_y", "up_z", "acc_x [m/s^2]", "acc_y [m/s^2]", "acc_z [m/s^2]"]
    csv(folder / "means.csv", header, [*up.T, *acc.T], form="{:.8g}")
    return Case((f"inercal calibrate imu means.csv {LATITUDE}",), made, (*ACC, "M"))


def means_of_six_sides(folder, rng):
    """Six rows with the side that was up in words, both sensors."""
    made = unit(rng)
    acc, _, gyro, _ = means(made, [side(axis, sign, rng) for axis, sign in SIDES], 100, 10, rng)
    names = [f"{axis} {'up' if sign > 0 else 'down'}" for axis, sign in SIDES]
    header = ["position", *(f"acc_{i} [m/s^2]" for i in "xyz"), *(f"gyro_{i} [rad/s]" for i in "xyz")]
    csv(folder / "six.csv", header, [names, *acc.T, *gyro.T], form="{:.7g}")
    return Case((f"inercal calibrate imu six.csv {LATITUDE}",), made, (*ACC, "D_F"))


def workbook_of_means(folder, rng):
    """Means in a spreadsheet with a title above."""
    made = unit(rng)
    acc, _, _, _ = means(made, poses(rng, 26), 50, 4, rng)
    rows = [["Accelerometer poses, May 2026"], ["No.", "Ax [m/s²]", "Ay [m/s²]", "Az [m/s²]"]]
    rows += [[k + 1, *map(float, row)] for k, row in enumerate(acc)]
    xlsx(folder / "poses.xlsx", {"Poses": rows})
    return Case((f"inercal calibrate imu poses.xlsx {LATITUDE}",), made, (*ACC, "M"))


def tilt(folder, rng, angles, noise, cosine=False):
    """Angles, outputs in volts of one accelerometer, its bias [V], scale [V/(m/s^2)], and the error of its zero."""
    bias, scale = 2.5 + rng.normal(0, 0.02), 0.2 / G * (1 + rng.normal(0, 0.02))
    off = rng.normal(0, 0.4 * DEG)
    angle = np.asarray(angles) * DEG + rng.normal(0, 0.01 * DEG, len(angles)) + off
    force = GRAVITY * (np.cos(angle) if cosine else np.sin(angle))
    more = {"K0_?": (bias, "V"), "K1_?": (scale, "V/(m/s^2)")}
    return bias + scale * force + rng.normal(0, noise, len(angles)), more


def tilt_in_volts(folder, rng):
    """A tilt table: angle and output in volts, every 15 deg."""
    angles = np.arange(0, 360, 15)
    volts, more = tilt(folder, rng, angles, 5e-5)
    csv(folder / "tilt.csv", ["angle [deg]", "Vout [V]"], [angles, volts], form=["{:.0f}", "{:.5f}"])
    return Case((f"inercal calibrate imu tilt.csv {LATITUDE}",), None, ("K0", "K1"), more=more)


def tilt_of_four(folder, rng):
    """Four positions of one accelerometer on a dividing head, twice over, in millivolts."""
    angles = np.array([0, 90, 180, 270, 0, 90, 180, 270])
    volts, more = tilt(folder, rng, angles, 4e-5, cosine=True)
    header = ["Position (deg)", "Output (mV)"]
    csv(folder / "four.csv", header, [angles, 1000 * volts], form=["{:.0f}", "{:.2f}"])
    return Case((f"inercal calibrate imu four.csv {LATITUDE}",), None, ("K0", "K1"), more=more)


def known_rates_in_volts(folder, rng):
    """Rows of rate and output of an analogue gyro."""
    rate = np.array([-100, -80, -60, -40, -20, 0, 20, 40, 60, 80, 100.0])
    bias, scale = 1.65 + rng.normal(0, 0.01), 0.005 * (1 + rng.normal(0, 0.02))
    volts = bias + scale * rate + rng.normal(0, 2e-4, len(rate))
    csv(folder / "rates.csv", ["input rate [deg/s]", "output [V]"], [rate, volts], form=["{:.0f}", "{:.5f}"])
    more = {"D_F_?": (bias, "V"), "S_?": (scale / DEG, "V/(rad/s)")}
    return Case((f"inercal calibrate imu rates.csv {LATITUDE}",), None, ("D_F", "S"), more=more)


def centrifuge(folder, rng):
    """Rows of acceleration and output of an accelerometer in mA."""
    level = np.array([0, 1, 2, 4, 6, 8, 10, 12, 15, 18, 20.0])
    bias, scale, k2 = rng.normal(0, 0.004), 1.3 * (1 + rng.normal(0, 0.01)), 12e-6
    current = bias + scale * (level + k2 * level**2) + rng.normal(0, 5e-5, len(level))
    csv(folder / "centrifuge.csv", ["acceleration (g)", "output (mA)"], [level, current], form="{:.6g}")
    more = {
        "K0_?": (bias / 1000, "A"),
        "K1_?": (scale / 1000 / G, "A/(m/s^2)"),
        "K2_?": (k2 / G, "1/(m/s^2)"),
    }
    return Case((f"inercal calibrate imu centrifuge.csv {LATITUDE}",), None, ("K0", "K1"), more=more)


def truth_columns(folder, rng):
    """A simulator's record: what the sensors read, and what they should have read."""
    made = unit(rng)
    from .physics import poses_path

    path = poses_path(rng, poses=20)
    motion = path.sampled(50)
    force = motion.C.transpose(0, 2, 1) @ np.array([0, 0, GRAVITY])
    acc, _ = made.outputs(force, motion.rate, 50, rng)
    header = ["t [s]", *(f"acc_{i} [m/s^2]" for i in "xyz"), *(f"acc_{i}_true [m/s^2]" for i in "xyz")]
    csv(folder / "log.csv", header, [motion.t, *acc.T, *force.T])
    return Case((f"inercal calibrate imu log.csv {LATITUDE}",), made, (*ACC, "M"))


def noise_in_bursts(folder, rng):
    """A recording at rest with stamps of arrival in bursts: the noise hangs on the mean rate."""
    made = unit(rng).given(acc_walk=0.0, gyro_walk=0.0)
    t, _, gyro = made.log(Path(side("z", 1)).rest(400), 100, rng)
    arrived = 0.08 * np.ceil((t + 1e-6) / 0.08) + 0.0005 * (np.arange(len(t)) % 8)
    header = ["time [s]", *(f"gyro_{i} [rad/s]" for i in "xyz")]
    csv(folder / "still.csv", header, [arrived, *gyro.T], form="{:.9g}")
    more = {
        f"N_gyro_{i}": (made.S[k] * 0 + made.gyro_noise / math.sqrt(2), "rad/sqrt(s)")
        for k, i in enumerate("xyz")
    }
    return Case(("inercal allan still.csv",), None, ("N_gyro_x",), more=more)


def noise_with_gaps(folder, rng):
    """A recording at rest of which a second was lost three times."""
    made = unit(rng).given(acc_walk=0.0, gyro_walk=0.0)
    t, acc, _ = made.log(Path(side("z", 1)).rest(400), 100, rng)
    keep = np.ones(len(t), bool)
    for begin in (91.2, 200.7, 310.4):
        keep &= (t < begin) | (t > begin + 1)
    header = ["time [s]", *(f"acc_{i} [m/s^2]" for i in "xyz")]
    csv(folder / "still.csv", header, [t[keep], *acc[keep].T], form="{:.9g}")
    more = {f"N_acc_{i}": (made.acc_noise / math.sqrt(2), "(m/s^2)*sqrt(s)") for i in "xyz"}
    return Case(("inercal allan still.csv",), None, ("N_acc_x",), more=more)
