"""Protocols at the bench: sides, turns, and rates of a table, a file each or all in one log."""

from __future__ import annotations

import numpy as np

from .physics import DEG, SIDES, G, Path, side, sides_path, unit
from .written import LATITUDE, Case, csv, xlsx

ACC = ("K0", "K1")
BOTH = ("K0", "K1", "D_F", "S")
GYRO = ("D_F", "S")


def six_files_in_g(folder, rng):
    """Six files named by the side that is up; no unit anywhere."""
    made = unit(rng).given(acc_size=G, acc_step=1e-4)
    for axis, sign in SIDES:
        t, acc, _ = made.log(Path(side(axis, sign, rng)).rest(8), 100, rng)
        csv(folder / f"{axis}_{'up' if sign > 0 else 'down'}.csv", ["time", "ax", "ay", "az"], [t, *acc.T])
    return Case((f"inercal calibrate imu *.csv {LATITUDE}",), made, ACC)


def six_files_in_counts(folder, rng):
    """Raw counts of both sensors, times in ms."""
    made = unit(rng).counts(16384, 131)
    for axis, sign in SIDES:
        t, acc, gyro = made.log(Path(side(axis, sign, rng)).rest(6), 100, rng)
        name = f"{'pos' if sign > 0 else 'neg'}{axis.upper()}.csv"
        header = ["millis", "AcX", "AcY", "AcZ", "GyX", "GyY", "GyZ"]
        csv(folder / name, header, [1000 * t, *acc.T, *gyro.T], form="{:.0f}")
    return Case((f"inercal calibrate imu *.csv {LATITUDE}",), made, (*ACC, "D_F"))


def six_files_two_thermometers(folder, rng):
    """A thermometer of the sensor and one of the room beside it."""
    made = unit(rng)
    for axis, sign in SIDES:
        t, acc, gyro = made.log(Path(side(axis, sign, rng)).rest(6), 50, rng)
        warm = 31.5 + 0.02 * t + rng.normal(0, 0.05, len(t))
        room = 22.4 + rng.normal(0, 0.1, len(t))
        header = ["t [s]", *(f"acc_{i} [m/s^2]" for i in "xyz"), *(f"gyro_{i} [rad/s]" for i in "xyz")]
        header += ["T_imu [degC]", "T_ambient [degC]"]
        csv(folder / f"{'+' if sign > 0 else '-'}{axis}.csv", header, [t, *acc.T, *gyro.T, warm, room])
    return Case((f"inercal calibrate imu *.csv {LATITUDE}",), made, (*ACC, "D_F"))


def german_spreadsheet(folder, rng):
    """Semicolons, decimal commas, German heads and names of files."""
    made = unit(rng)
    for axis, sign in SIDES:
        t, acc, _ = made.log(Path(side(axis, sign, rng)).rest(7), 50, rng)
        header = ["Zeit [s]", *(f"Beschleunigung {i.upper()} [m/s²]" for i in "xyz")]
        name = f"{axis}_{'oben' if sign > 0 else 'unten'}.csv"
        csv(
            folder / name,
            header,
            [t, *acc.T],
            mark=";",
            comma=True,
            above=["Messung vom 3.5.2026;Prüfer: Huber"],
        )
    return Case((f"inercal calibrate imu *.csv {LATITUDE}",), made, ACC)


def workbook_of_six_sheets(folder, rng):
    """An XLSX workbook, a sheet for each side."""
    made = unit(rng).given(acc_size=G)
    sheets = {}
    for axis, sign in SIDES:
        t, acc, _ = made.log(Path(side(axis, sign, rng)).rest(5), 25, rng)
        rows = [["Time (s)", "Acc X (g)", "Acc Y (g)", "Acc Z (g)"], *np.column_stack([t, acc]).tolist()]
        sheets[f"{axis.upper()} {'up' if sign > 0 else 'down'}"] = rows
    xlsx(folder / "six sides.xlsx", sheets)
    return Case((f'inercal calibrate imu "six sides.xlsx" {LATITUDE}',), made, ACC)


def labelled_log(folder, rng):
    """One log whose last column says which side is up; between the sides it is empty."""
    made = unit(rng).given(acc_size=G, gyro_size=DEG)
    path = sides_path(rng)
    t, acc, gyro = made.log(path, 100, rng)
    label = np.full(len(t), "", dtype=object)
    for (axis, sign), (begin, end) in zip(SIDES, path.sampled(100).rests, strict=True):
        label[(t > begin + 0.4) & (t < end - 0.4)] = f"{axis}_{'up' if sign > 0 else 'down'}"
    header = ["t [s]", *(f"acc_{i} [g]" for i in "xyz"), *(f"gyro_{i} [deg/s]" for i in "xyz"), "label"]
    csv(folder / "run.csv", header, [t, *acc.T, *gyro.T, label], form="{:.8g}")
    return Case((f"inercal calibrate imu run.csv {LATITUDE}",), made, (*ACC, "D_F"))


def labels_of_signs(folder, rng):
    """A column `position` that says +X, -X, ..; accelerometers alone."""
    made = unit(rng)
    path = sides_path(rng, hold=4)
    t, acc, _ = made.log(path, 50, rng)
    label = np.full(len(t), "move", dtype=object)
    for (axis, sign), (begin, end) in zip(SIDES, path.sampled(50).rests, strict=True):
        label[(t > begin + 0.3) & (t < end - 0.3)] = ("+" if sign > 0 else "-") + axis.upper()
    csv(folder / "sides.csv", ["time_s", "accX", "accY", "accZ", "orientation"], [t, *acc.T, label])
    return Case((f"inercal calibrate imu sides.csv {LATITUDE}",), made, ACC)


def sides_in_one_log(folder, rng):
    """Six sides twice in one log, nothing said."""
    made = unit(rng)
    t, acc, _ = made.log(sides_path(rng, hold=5, order=SIDES + SIDES[::-1]), 100, rng)
    csv(folder / "log.csv", ["time", "ax", "ay", "az"], [t, *acc.T])
    return Case((f"inercal calibrate imu log.csv {LATITUDE}",), made, ACC)


def sides_and_turns_by_files(folder, rng):
    """Six rests and three whole turns, a file each, named in the manner of Ferraris."""
    made = unit(rng).given(gyro_size=DEG)
    header = ["n_samples", "acc_x", "acc_y", "acc_z", "gyr_x", "gyr_y", "gyr_z"]

    def save(name, path):
        t, acc, gyro = made.log(path, 204.8, rng)
        csv(folder / name, header, [np.arange(len(t)), *acc.T, *gyro.T])

    for axis, sign in SIDES:
        save(f"{axis}_{'p' if sign > 0 else 'a'}.csv", Path(side(axis, sign, rng)).rest(5))
    for axis in "xyz":
        about = "xyz".index(axis)
        path = Path(side(axis, 1, rng)).rest(2).turn(np.eye(3)[about], 2 * np.pi, 5).rest(2)
        save(f"{axis}_rot.csv", path)
    command = f'inercal calibrate imu *.csv {LATITUDE} --answer "rate=204.8 Hz" --answer gyro=deg/s'
    return Case((command,), made, BOTH)


def turns_there_and_back(folder, rng):
    """One log of six sides; on each positive one a whole turn about the vertical and back."""
    made = unit(rng).given(acc_size=G, gyro_size=DEG)
    path = Path(side("x", 1, rng)).rest(4)
    for k, (axis, sign) in enumerate(SIDES):
        if k:
            path.to(side(axis, sign, rng, heading=rng.uniform(0, 6)), 2.5, rng.normal(0, 0.02, 3)).rest(4)
        if sign > 0:
            about = path.attitude.inv().apply([0, 0, 1.0])
            path.turn(about, 2 * np.pi, 6).rest(3).turn(about, -2 * np.pi, 6).rest(3)
    t, acc, gyro = made.log(path, 100, rng)
    header = ["Time[s]", "AccX[g]", "AccY[g]", "AccZ[g]", "GyroX[dps]", "GyroY[dps]", "GyroZ[dps]"]
    csv(folder / "bench.csv", header, [t, *acc.T, *gyro.T])
    return Case((f"inercal calibrate imu bench.csv {LATITUDE}",), made, BOTH)


def turn_by_files_gyro_alone(folder, rng):
    """A gyro triad by itself: a file for each whole turn, there and back."""
    made = unit(rng).given(gyro_size=DEG)
    for axis in "xyz":
        for angle in (360, -360):
            path = Path(side(axis, 1, rng, 0.1 * DEG)).rest(3)
            path.turn(np.eye(3)["xyz".index(axis)], angle * DEG, 8).rest(3)
            t, _, gyro = made.log(path, 100, rng)
            header = ["t [s]", *(f"gyro_{i} [deg/s]" for i in "xyz")]
            csv(folder / f"{axis}_{angle:+d}deg.csv", header, [t, *gyro.T])
    return Case((f"inercal calibrate imu *.csv {LATITUDE}",), made, GYRO)


def single_gyro_turned(folder, rng):
    """One gyro channel, half a dozen turns by +A and -A, a file each."""
    made = unit(rng).given(gyro_size=DEG)
    for k, angle in enumerate((360, -360, 720, -720)):
        path = Path(side("z", 1)).rest(4).turn([0, 0, 1], angle * DEG, 12).rest(4)
        t, _, gyro = made.log(path, 100, rng)
        csv(folder / f"z_{angle:+d}deg_{k}.csv", ["time [s]", "gyro_z [deg/s]"], [t, gyro[:, 2]])
    return Case((f"inercal calibrate imu *.csv {LATITUDE}",), made, ("S_z", "D_F_z"))


def single_gyro_on_a_rate_table(folder, rng):
    """One gyro channel at typed rates, a file each."""
    made = unit(rng).given(gyro_size=DEG)
    for rate in (0, 20, -20, 50, -50, 100, -100):
        path = Path(side("z", 1))
        path = path.spin([0, 0, 1], rate * DEG, 14.4)
        t, _, gyro = made.log(path, 50, rng)
        csv(folder / f"z_{rate:+d}dps.csv", ["time [s]", "gyro_z [deg/s]"], [t, gyro[:, 2]])
    return Case((f"inercal calibrate imu *.csv {LATITUDE}",), made, ("S_z", "D_F_z"))


def rate_table_of_six_sides(folder, rng):
    """A rate table: about each side up and down a rate both ways, a file each."""
    made = unit(rng)
    for axis, sign in SIDES:
        attitude = side(axis, sign, rng)
        about = attitude.inv().apply([0, 0, 1.0])
        name = f"{axis.upper()}_{'up' if sign > 0 else 'down'}"
        for rate in (36, -36):
            t, acc, gyro = made.log(Path(attitude).spin(about, rate * sign * DEG, 20), 50, rng)
            header = ["t [s]", *(f"acc_{i} [m/s^2]" for i in "xyz"), *(f"gyro_{i} [rad/s]" for i in "xyz")]
            csv(folder / f"{name}_{rate:+d}dps.csv", header, [t, *acc.T, *gyro.T])
        t, acc, gyro = made.log(Path(attitude).rest(6), 50, rng)
        csv(folder / f"{name}.csv", header, [t, *acc.T, *gyro.T])
    return Case((f"inercal calibrate imu *.csv {LATITUDE}",), made, BOTH)


def rate_table_commanded(folder, rng):
    """One log of a rate table with the rate that it was told in a column, of a gyro about z."""
    made = unit(rng).given(gyro_size=DEG)
    path, told = Path(side("z", 1)), []
    for rate in (0, 30, -30, 60, -60, 90, -90, 0):
        path.spin([0, 0, 1], rate * DEG, 12)
        told += [rate] * 600
    t, _, gyro = made.log(path, 50, rng)
    csv(folder / "steps.csv", ["t [s]", "rate_cmd [deg/s]", "gyro_z [deg/s]"], [t, told, gyro[:, 2]])
    return Case((f"inercal calibrate imu steps.csv {LATITUDE}",), made, ("S_z", "D_F_z"))


def folder_of_poses(folder, rng):
    """A folder with a file for each of 24 poses in directions that nobody knows."""
    made = unit(rng)
    from scipy.spatial.transform import Rotation

    for k, attitude in enumerate(Rotation.random(24, random_state=rng)):
        t, acc, gyro = made.log(Path(attitude).rest(4), 50, rng)
        header = ["t", "ax", "ay", "az", "gx", "gy", "gz"]
        csv(folder / "poses" / f"pose_{k + 1:02d}.csv", header, [t, *acc.T, *gyro.T])
    return Case((f"inercal calibrate imu poses/*.csv {LATITUDE} --answer gyro=rad/s",), made, ACC)


def units_in_a_row(folder, rng):
    """Six files with a row of units below the names, in mg, tabs between."""
    made = unit(rng).given(acc_size=G / 1000)
    for axis, sign in SIDES:
        t, acc, _ = made.log(Path(side(axis, sign, rng)).rest(6), 50, rng)
        head = "\t".join(["Time", "X", "Y", "Z"])
        name = f"acc {axis}{'+' if sign > 0 else '-'}.txt"
        csv(
            folder / name, ["s", "mg", "mg", "mg"], [t, *acc.T], mark="\t", above=["Accelerometer test", head]
        )
    return Case((f"inercal calibrate imu *.txt {LATITUDE}",), made, ACC)
