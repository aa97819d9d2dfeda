"""Protocols in the hand: poses and turns between, a swing, phones, loggers with clocks of every kind."""

from __future__ import annotations

import json

import numpy as np
import scipy.io

from .physics import DEG, G, Path, poses_path, unit
from .written import LATITUDE, Case, csv, lines

ALL = ("K0", "K1", "M", "D_F", "S", "T")
ARM = (0.02, -0.01, 0.03)
COMMAND = f"inercal calibrate imu log.csv {LATITUDE}"


def hand(rng, made, fs=100, **how):
    """Times and outputs of a unit that goes through poses in the hand."""
    return made.log(poses_path(rng, **how), fs, rng, ARM)


def short_rests(folder, rng):
    """Thirty poses of little more than a second."""
    made = unit(rng).given(acc_size=G, gyro_size=DEG)
    t, acc, gyro = hand(rng, made, poses=30, hold=1.3, turning=1.2, start=4)
    header = ["t [s]", *(f"acc_{i} [g]" for i in "xyz"), *(f"gyro_{i} [deg/s]" for i in "xyz")]
    csv(folder / "log.csv", header, [t, *acc.T, *gyro.T], form="{:.8g}")
    return Case((COMMAND,), made, ALL)


def swing(folder, rng):
    """Accelerometers alone, turned slowly through all directions without a rest."""
    made = unit(rng)
    path = Path()
    for _ in range(45):
        path.turn(rng.normal(size=3), rng.uniform(50, 120) * DEG, rng.uniform(3.5, 5), rng.normal(0, 0.2, 3))
    t, acc, _ = made.log(path, 50, rng, (0.01, 0, 0.01))
    csv(folder / "log.csv", ["time", "ax (m/s^2)", "ay (m/s^2)", "az (m/s^2)"], [t, *acc.T])
    return Case((COMMAND,), made, ("K0", "K1"))


def accelerometers_in_the_hand(folder, rng):
    """Accelerometers alone through thirty poses; a column of temperature."""
    made = unit(rng).given(acc_size=G)
    t, acc, _ = hand(rng, made, 50, poses=30)
    csv(folder / "log.csv", ["Time", "Ax", "Ay", "Az", "Temp"], [t, *acc.T, 24 + 0.002 * t], form="{:.7g}")
    return Case((COMMAND,), made, ("K0", "K1", "M"))


def mid_scale(folder, rng):
    """Unsigned 16-bit counts about mid-scale, the rate in a line above; no times."""
    made = unit(rng).counts(4096, 65.5, 32768, 32768)
    _t, acc, gyro = hand(rng, made, poses=30)
    header = ["acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z"]
    csv(folder / "log.csv", header, [*acc.T, *gyro.T], form="{:.0f}", above=["# sample rate: 100 Hz"])
    return Case((COMMAND,), made, ALL)


def rate_in_the_preamble(folder, rng):
    """Lines of a maker above the table, of which one says the rate; a counter for a time."""
    made = unit(rng).given(gyro_size=DEG)
    t, acc, gyro = hand(rng, made, 104, poses=26)
    above = [
        "// Start Time: Unknown",
        "// Update Rate: 104.0Hz",
        "// Filter Profile: human",
        "// Firmware: 4.6.0",
    ]
    header = ["PacketCounter", "Acc_X", "Acc_Y", "Acc_Z", "Gyr_X", "Gyr_Y", "Gyr_Z"]
    csv(
        folder / "log.txt",
        header,
        [np.arange(len(t)), *acc.T, *gyro.T],
        mark="\t",
        above=above,
        form="{:.7g}",
    )
    return Case((f"inercal calibrate imu log.txt {LATITUDE}",), made, ALL)


def gaps(folder, rng):
    """A log that lost rows six times, between and in its turns."""
    made = unit(rng)
    t, acc, gyro = hand(rng, made, poses=30)
    keep = np.ones(len(t), bool)
    for begin in rng.uniform(12, t[-1] - 5, 6):
        keep &= (t < begin) | (t > begin + rng.uniform(0.1, 0.6))
    header = ["t [s]", *(f"acc_{i} [m/s^2]" for i in "xyz"), *(f"gyro_{i} [rad/s]" for i in "xyz")]
    csv(folder / "log.csv", header, [t[keep], *acc[keep].T, *gyro[keep].T], form="{:.8g}")
    return Case((COMMAND,), made, ALL)


def counter_that_wraps(folder, rng):
    """Milliseconds in 16 bits, which fall to zero every 65.536 s; counts without a word of their range."""
    made = unit(rng).counts(8192, 32.8)
    t, acc, gyro = hand(rng, made, poses=28)
    ms = np.round(1000 * t + 31000) % 65536
    csv(folder / "log.csv", ["ms", "ax", "ay", "az", "gx", "gy", "gz"], [ms, *acc.T, *gyro.T], form="{:.0f}")
    return Case((COMMAND,), made, ALL)


def clock_set_back(folder, rng):
    """The logger started again half way: its clock begins anew."""
    made = unit(rng)
    t, acc, gyro = hand(rng, made, poses=40)
    stamps = np.where(t < 90, t, t - 89.5)
    header = ["t [s]", *(f"acc_{i} [m/s^2]" for i in "xyz"), *(f"gyro_{i} [rad/s]" for i in "xyz")]
    csv(folder / "log.csv", header, [stamps, *acc.T, *gyro.T], form="{:.8g}")
    return Case((COMMAND,), made, (), ("falls", "fell", "back", "earlier"), either=True)


def bursts(folder, rng):
    """Stamps of arrival: ten samples at once from a FIFO, all with nearly one stamp."""
    made = unit(rng).given(gyro_size=DEG)
    t, acc, gyro = hand(rng, made, poses=28)
    arrived = 0.1 * np.ceil((t + 1e-6) / 0.1) + 0.0004 * (np.arange(len(t)) % 10) + 0.002
    header = ["timestamp", "accX", "accY", "accZ", "gyroX (deg/s)", "gyroY (deg/s)", "gyroZ (deg/s)"]
    csv(folder / "log.csv", header, [arrived, *acc.T, *gyro.T], form="{:.8g}")
    return Case((COMMAND,), made, ALL)


def jitter(folder, rng):
    """A loop of about 95 Hz whose whole milliseconds are mostly 10 and sometimes 11 or 15."""
    made = unit(rng).counts(2048, 16.4)
    motion = poses_path(rng, poses=28)
    t, acc, gyro = made.log(motion, 1000, rng, ARM)
    made_at, at = [], 0.0
    while at < len(t) - 20:
        made_at.append(round(at))
        at += rng.choice([10, 11, 15], p=[0.7, 0.2, 0.1])
    k = np.array(made_at)
    header = ["millis", "ax", "ay", "az", "gx", "gy", "gz"]
    csv(folder / "log.csv", header, [k, *acc[k].T, *gyro[k].T], form="{:.0f}")
    return Case((COMMAND,), made, ALL)


def json_lines(folder, rng):
    """A line of JSON for each sample."""
    made = unit(rng)
    t, acc, gyro = hand(rng, made, 50, poses=28)

    def of(values):
        return {i: round(float(value), 5) for i, value in zip("xyz", values, strict=True)}

    rows = [
        json.dumps({"ts": 1767950000000 + round(1000 * s), "accelerometer": of(a), "gyroscope": of(w)})
        for s, a, w in zip(t, acc, gyro, strict=True)
    ]
    lines(folder / "log.jsonl", rows)
    return Case((f"inercal calibrate imu log.jsonl {LATITUDE} --answer gyro=rad/s",), made, ALL)


def arduino(folder, rng):
    """What a sketch prints to the serial monitor."""
    made = unit(rng).counts(16384, 131)
    t, acc, gyro = hand(rng, made, 50, poses=26, turning=2.4, most=120)
    rows = [
        f"t={1000 * s:.0f} aX = {a[0]:.0f} | aY = {a[1]:.0f} | aZ = {a[2]:.0f} | "
        f"gX = {w[0]:.0f} | gY = {w[1]:.0f} | gZ = {w[2]:.0f}"
        for s, a, w in zip(t, acc, gyro, strict=True)
    ]
    lines(folder / "log.txt", rows)
    return Case((f"inercal calibrate imu log.txt {LATITUDE}",), made, ALL)


def phone_in_two_files(folder, rng):
    """An app for phones: a file for each sensor, each with times of its own."""
    made = unit(rng)
    path = poses_path(rng, poses=28)
    t, acc, gyro = made.log(path, 400, rng, ARM)
    some, other = np.arange(0, len(t), 4), np.arange(1, len(t), 4)
    names = [f"Acceleration {i} (m/s^2)" for i in "xyz"]
    csv(folder / "Accelerometer.csv", ["Time (s)", *names], [t[some], *acc[some].T], form="{:.9e}")
    names = [f"Gyroscope {i} (rad/s)" for i in "xyz"]
    csv(folder / "Gyroscope.csv", ["Time (s)", *names], [t[other], *gyro[other].T], form="{:.9e}")
    return Case((f"inercal calibrate imu Accelerometer.csv Gyroscope.csv {LATITUDE}",), made, ALL)


def interleaved(folder, rng):
    """One file in which each line is of one sensor, told by its first word."""
    made = unit(rng)
    t, acc, gyro = made.log(poses_path(rng, poses=28), 200, rng, ARM)
    rows = ["# sensor, time [ns], x, y, z"]
    for k in range(0, len(t) - 1, 2):
        rows.append(f"ACC,{round(1e9 * t[k])}," + ",".join(f"{value:.6f}" for value in acc[k]))
        rows.append(f"GYRO,{round(1e9 * t[k + 1])}," + ",".join(f"{value:.7f}" for value in gyro[k + 1]))
    lines(folder / "log.csv", rows)
    return Case((f"{COMMAND} --answer gyro=rad/s",), made, ALL)


def flight_log(folder, rng):
    """A flight log as text: FMT lines, then IMU lines among others."""
    made = unit(rng)
    t, acc, gyro = hand(rng, made, 50, poses=28)
    rows = [
        "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns",
        "FMT, 160, 75, IMU, QBffffff, TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ",
        "FMT, 170, 20, BAT, Qf, TimeUS,Volt",
    ]
    for k, (s, a, w) in enumerate(zip(t, acc, gyro, strict=True)):
        stamp = 4_210_000 + round(1e6 * s)
        rows.append(f"IMU, {stamp}, 0, " + ", ".join(f"{value:.7g}" for value in (*w, *a)))
        if k % 25 == 0:
            rows.append(f"BAT, {stamp + 40}, {16.2 - 1e-4 * k:.3f}")
    lines(folder / "00000012.log", rows)
    return Case((f"inercal calibrate imu 00000012.log {LATITUDE}",), made, ALL)


def autopilot_table(folder, rng):
    """A topic of an autopilot as its tool writes it, in microseconds."""
    made = unit(rng)
    t, acc, gyro = hand(rng, made, 100, poses=28)
    header = [
        "timestamp",
        *(f"gyro_rad[{k}]" for k in range(3)),
        "gyro_integral_dt",
        "accelerometer_timestamp_relative",
    ]
    header += [*(f"accelerometer_m_s2[{k}]" for k in range(3)), "accelerometer_integral_dt"]
    stamp = 61_000_000 + np.round(1e6 * t)
    dt, none = np.full(len(t), 10000), np.zeros(len(t))
    whole = "{:.0f}"
    forms = [whole, "{:.7f}", "{:.7f}", "{:.7f}", whole, whole, "{:.6f}", "{:.6f}", "{:.6f}", whole]
    csv(folder / "sensor_combined_0.csv", header, [stamp, *gyro.T, dt, none, *acc.T, dt], form=forms)
    return Case((f"inercal calibrate imu sensor_combined_0.csv {LATITUDE}",), made, ALL)


def arrays_on_their_side(folder, rng):
    """A MAT file of 3 x N arrays and a scalar fs."""
    made = unit(rng).given(gyro_size=DEG)
    _, acc, gyro = hand(rng, made, 100, poses=28)
    scipy.io.savemat(folder / "rec.mat", {"acc": acc.T, "gyr_dps": gyro.T, "fs": 100.0})
    return Case((f"inercal calibrate imu rec.mat {LATITUDE}",), made, ALL)


def structure_of_matlab(folder, rng):
    """A MAT file with a structure of times and triads."""
    made = unit(rng)
    t, acc, gyro = hand(rng, made, 100, poses=26)
    scipy.io.savemat(folder / "rec.mat", {"imu": {"t": t[:, None], "accel": acc, "gyro": gyro}})
    return Case((f"inercal calibrate imu rec.mat {LATITUDE} --answer gyro=rad/s",), made, ALL)


def numpy_archive(folder, rng):
    """An NPZ of three arrays."""
    made = unit(rng).given(acc_size=G)
    t, acc, gyro = hand(rng, made, 100, poses=26)
    np.savez(folder / "rec.npz", time=t, accel=acc, gyro=gyro)
    return Case((f"inercal calibrate imu rec.npz {LATITUDE} --answer gyro=rad/s",), made, ALL)


def no_header(folder, rng):
    """Seven columns of numbers and no word; deg/s that only the turns tell."""
    made = unit(rng).given(gyro_size=DEG)
    t, acc, gyro = hand(rng, made, 100, poses=28)
    csv(folder / "log.txt", None, [t, *acc.T, *gyro.T], mark=" ", form="{:.7g}")
    return Case((f"inercal calibrate imu log.txt {LATITUDE}",), made, ALL)


def stamps_of_a_calendar(folder, rng):
    """Date and time in words, over midnight."""
    made = unit(rng)
    t, acc, gyro = hand(rng, made, 50, poses=28)
    stamps = [
        str(np.datetime64("2026-03-14T23:58:40.000") + np.timedelta64(round(1000 * s), "ms")) for s in t
    ]
    header = ["timestamp", *(f"acc_{i} [m/s^2]" for i in "xyz"), *(f"gyro_{i} [rad/s]" for i in "xyz")]
    csv(folder / "log.csv", header, [stamps, *acc.T, *gyro.T])
    return Case((COMMAND,), made, ALL)


def milli_units(folder, rng):
    """mg and mdeg/s, which no name says."""
    made = unit(rng).given(acc_size=G / 1000, gyro_size=DEG / 1000)
    t, acc, gyro = hand(rng, made, 104, poses=28)
    header = ["time[us]", "acc[x]", "acc[y]", "acc[z]", "gyro[x]", "gyro[y]", "gyro[z]"]
    csv(folder / "log.csv", header, [1e6 * t, *acc.T, *gyro.T], form="{:.2f}")
    return Case((COMMAND,), made, ALL)


def two_loggers(folder, rng):
    """Accelerometers and gyro on two loggers whose clocks differ by 0.35 s and 60 ppm."""
    made = unit(rng)
    t, acc, gyro = hand(rng, made, 100, poses=30)
    csv(folder / "acc.csv", ["t [s]", *(f"acc_{i} [m/s^2]" for i in "xyz")], [t, *acc.T], form="{:.8g}")
    other = (t + 0.35) * (1 + 60e-6)
    csv(
        folder / "gyro.csv", ["t [s]", *(f"gyro_{i} [rad/s]" for i in "xyz")], [other, *gyro.T], form="{:.8g}"
    )
    words = ("clock", "logger", "late", "lag", "shift")
    return Case(
        (f"inercal calibrate imu acc.csv gyro.csv {LATITUDE}",), made, ("K0", "K1", "M"), words, either=True
    )
