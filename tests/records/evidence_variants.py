"""Tables of few rows, of one axis, of several devices and of odd centres, written before the rules that read them.

Each variant is the text of a file and what is in it: the column of each channel, and whether a question is asked.
Halves are parted by a seed; the second was looked at once, at the end: see test_evidence_variants.
"""

import numpy as np
from line_variants import ACC, GYRO, SEED, T

RNG = np.random.default_rng(5)


def text(head, *columns, mark=","):
    """A table under its heading."""
    lines = [
        mark.join(x if isinstance(x, str) else f"{x:.7g}" for x in row) for row in zip(*columns, strict=True)
    ]
    return "\n".join([head, *lines]) + "\n"


ANGLE = np.arange(0.0, 360.0, 30.0)
SINE = 2.5 + 1.2 * np.sin(np.radians(ANGLE)) + 0.001 * RNG.standard_normal(12)
COSINE = 2.5 + 1.2 * np.cos(np.radians(ANGLE)) + 0.001 * RNG.standard_normal(12)
RATE = np.array([-100.0, -50, -20, -10, 0, 10, 20, 50, 100])
VOLTS = 2.5 + 0.01 * RATE + 1e-3 * RNG.standard_normal(9)
FEW = [0, 3, 5, 8]
CLOCK = np.arange(500) / 100.0
NOISE = 0.01 * RNG.standard_normal(500)
QUATERNION = RNG.standard_normal((len(T), 4)).cumsum(axis=0) + 5.0
QUATERNION /= np.linalg.norm(QUATERNION, axis=1)[:, None]
UP = ACC / np.linalg.norm(ACC, axis=1)[:, None]
FIELD = 48.0 * UP[:, [1, 2, 0]] + [12.0, -7.0, 20.0] + 0.4 * RNG.standard_normal((len(T), 3))
WARM = 20.0 + 0.001 * np.arange(len(T))
POSES = RNG.standard_normal((40, 3))
POSES /= np.linalg.norm(POSES, axis=1)[:, None]
SHIFTED = 9.80665 * POSES + [5.0, 0.1, -0.3] + 0.004 * RNG.standard_normal((40, 3))
MIDSCALE = np.round(32768 + 6580 * POSES + 25 * RNG.standard_normal((40, 3)))
MAGNETIC = np.round(2000 + 600 * POSES[:, [2, 0, 1]] + 20 * RNG.standard_normal((40, 3)))
STILL = np.round(25000 + 30 * RNG.standard_normal((40, 3)))


def triads(head, *values):
    return text("t," + head, T, *(column for each in values for column in each.T))


def names(*stems):
    return ",".join(f"{stem}{axis}" for stem in stems for axis in "xyz")


def xyz(sensor, first):
    """The channels of a triad whose columns are named alike, with x, y, z for * and X, Y, Z for ^."""
    return {f"{sensor}_{axis}": first.replace("*", axis).replace("^", axis.upper()) for axis in "xyz"}


SIDES = [
    "+x,.99,.01,.02",
    "-x,-1.01,.02,.01",
    "+y,0,1,.02",
    "-y,.01,-1,0",
    "+z,.01,0,1.01",
    "-z,.02,.01,-.98",
]
TABLE = {"on_table": True}
NOTHING: dict[str, str] = {}

#: name -> text of the file, how it is recognised, the column of each channel there, and whether something is asked
VARIANTS = {
    # known input, output
    "rate, V": (
        text("rate [deg/s],output [V]", RATE, VOLTS),
        TABLE,
        {"rate": "rate [deg/s]", "gyro_z": "output [V]"},
        False,
    ),
    "rate, counts": (
        text("Angular rate (deg/s),Output (LSB)", RATE, np.round(1000 * VOLTS)),
        TABLE,
        {"rate": "Angular rate (deg/s)", "gyro_z": "Output (LSB)"},
        False,
    ),
    "rate, gyro": (
        text("rate [deg/s],gyro_z [V]", RATE, VOLTS),
        TABLE,
        {"rate": "rate [deg/s]", "gyro_z": "gyro_z [V]"},
        False,
    ),
    "units without brackets": (
        text("Table rate dps;Gyro output mV", RATE, 1000 * VOLTS, mark=";"),
        TABLE,
        {"rate": "Table rate dps", "gyro_z": "Gyro output mV"},
        False,
    ),
    "output without a unit": (
        text("omega_deg_s,u_out", RATE, VOLTS),
        TABLE,
        {"rate": "omega_deg_s", "gyro_z": "u_out"},
        False,
    ),
    "German rate": (
        text("Drehrate [°/s];Spannung [V]", RATE, VOLTS, mark=";"),
        TABLE,
        {"rate": "Drehrate [°/s]", "gyro_z": "Spannung [V]"},
        False,
    ),
    "four rates": (
        text("rate [deg/s],output [V]", RATE[FEW], VOLTS[FEW]),
        TABLE,
        {"rate": "rate [deg/s]", "gyro_z": "output [V]"},
        False,
    ),
    "output first": (
        text("Voltage (V),Rate (deg/s)", VOLTS, RATE),
        TABLE,
        {"rate": "Rate (deg/s)", "gyro_z": "Voltage (V)"},
        False,
    ),
    "rate and temperature": (
        text("rate [deg/s],output [V],temperature [degC]", RATE, VOLTS, 20 + 0 * RATE),
        TABLE,
        {"rate": "rate [deg/s]", "gyro_z": "output [V]", "temperature": "temperature [degC]"},
        False,
    ),
    "rate of both": (
        text("reference rate [deg/s],measured rate [deg/s]", RATE, RATE + 0.1),
        TABLE,
        {"rate": "reference rate [deg/s]", "gyro_z": "measured rate [deg/s]"},
        False,
    ),
    "angle, V": (
        text("angle [deg],output [V]", ANGLE, SINE),
        TABLE,
        {"phi1": "angle [deg]", "acc_x": "output [V]"},
        False,
    ),
    "angle by name": (
        text("tilt_deg,volts", ANGLE, SINE),
        TABLE,
        {"phi1": "tilt_deg", "acc_x": "volts"},
        False,
    ),
    "German angle": (
        text("Winkel [°];Ausgang [V]", ANGLE, SINE, mark=";"),
        TABLE,
        {"phi1": "Winkel [°]", "acc_x": "Ausgang [V]"},
        False,
    ),
    "angle, accelerometer": (
        text("phi1 [deg],acc_x [V]", ANGLE, SINE),
        TABLE,
        {"phi1": "phi1 [deg]", "acc_x": "acc_x [V]"},
        False,
    ),
    "angle last": (
        text("Vout (V)\tTilt (deg)", SINE, ANGLE, mark="\t"),
        TABLE,
        {"phi1": "Tilt (deg)", "acc_x": "Vout (V)"},
        False,
    ),
    "upright at zero": (
        text("inclination (deg),reading (mV)", ANGLE, 1000 * COSINE),
        TABLE,
        {"phi1": "inclination (deg)", "acc_z": "reading (mV)"},
        False,
    ),
    "four angles": (
        text("angle [deg],output [V]", ANGLE[::3], SINE[::3]),
        TABLE,
        {"phi1": "angle [deg]", "acc_x": "output [V]"},
        False,
    ),
    "angle, two outputs": (
        text("tilt (deg),V1 (V),V2 (V)", ANGLE, SINE, COSINE),
        TABLE,
        {"phi1": "tilt (deg)", "acc_x": "V1 (V)", "acc_z": "V2 (V)"},
        False,
    ),
    "acceleration, V": (text("acceleration [g],output [V]", RATE / 100, VOLTS), TABLE, NOTHING, False),
    "applied g": (text("applied_g,Vout", RATE / 100, VOLTS), TABLE, NOTHING, False),
    "rate, V to new imu": (text("rate [deg/s],output [V]", RATE, VOLTS), {}, NOTHING, False),
    # one axis or two beside a time
    "gyro z": (
        text("time [s],gyro_z [deg/s]", CLOCK, NOISE),
        {},
        {"t": "time [s]", "gyro_z": "gyro_z [deg/s]"},
        False,
    ),
    "gyro Z in words": (
        text("t,Gyro Z (deg/s)", CLOCK, NOISE),
        {},
        {"t": "t", "gyro_z": "Gyro Z (deg/s)"},
        False,
    ),
    "acceleration": (
        text("Time (s),Acceleration (m/s^2)", CLOCK, 9.8 + NOISE),
        {},
        {"t": "Time (s)", "a1": "Acceleration (m/s^2)"},
        False,
    ),
    "gyro": (text("time,gyro [deg/s]", CLOCK, NOISE), {}, {"t": "time", "gyro": "gyro [deg/s]"}, False),
    "omega": (text("t_s,omega_rad_s", CLOCK, NOISE), {}, {"t": "t_s", "gyro": "omega_rad_s"}, False),
    "two axes": (
        text("time (s),ax (g),ay (g)", CLOCK, NOISE, 1 + NOISE),
        {},
        {"t": "time (s)", "acc_x": "ax (g)", "acc_y": "ay (g)"},
        False,
    ),
    "gz without a unit": (text("time,gz", CLOCK, NOISE), {}, {"t": "time", "gyro_z": "gz"}, True),
    "norm alone": (text("time (s),acceleration norm (m/s^2)", CLOCK, 9.8 + NOISE), {}, NOTHING, False),
    # few rows
    "four rows": (
        text("ax,ay,az", [0, 0, 1, 0.02], [1, -1, 0.01, 0], [0.01, 0, 0.02, 1]),
        {},
        xyz("acc", "a*"),
        False,
    ),
    "six named sides": (
        "side,aX,aY,aZ\n" + "\n".join(SIDES) + "\n",
        {},
        xyz("acc", "a^") | {"label": "side"},
        False,
    ),
    "six sides in words": (
        "side;aX;aY;aZ\n" + "\n".join(SIDES).replace(",", ";") + "\n",
        {},
        xyz("acc", "a^") | {"label": "side"},
        False,
    ),
    "six numbered rows": (
        "Position,Ax (g),Ay (g),Az (g)\n"
        + "\n".join(f"{k},{side.split(',', 1)[1]}" for k, side in enumerate(SIDES))
        + "\n",
        {},
        xyz("acc", "A* (g)") | {"position": "Position"},
        False,
    ),
    # columns of one stem, counted
    "time and triad": (
        text("gyro0,gyro1,gyro2,gyro3,acc0,acc1,acc2", T, *GYRO.T, *ACC.T),
        {},
        {"t": "gyro0", "gyro_x": "gyro1", "gyro_z": "gyro3", "acc_x": "acc0", "acc_z": "acc2"},
        False,
    ),
    "attitude and triad": (
        text("t,d[0],d[1],d[2],d[3],a0,a1,a2", T, *QUATERNION.T, *ACC.T),
        {},
        {"t": "t", "acc_x": "a0", "acc_y": "a1", "acc_z": "a2"},
        False,
    ),
    "from 0": (
        text("t,acc0,acc1,acc2", T, *ACC.T),
        {},
        {"t": "t", "acc_x": "acc0", "acc_y": "acc1", "acc_z": "acc2"},
        False,
    ),
    "from 1": (
        text("t,acc1,acc2,acc3", T, *ACC.T),
        {},
        {"t": "t", "acc_x": "acc1", "acc_y": "acc2", "acc_z": "acc3"},
        False,
    ),
    "attitude named as a gyro": (
        text("t,w0,w1,w2,w3,acc_0,acc_1,acc_2", T, *QUATERNION.T, *ACC.T),
        {},
        {"t": "t", "acc_x": "acc_0", "acc_z": "acc_2"},
        False,
    ),
    "in brackets with units": (
        text("t,a[0] (g),a[1] (g),a[2] (g)", T, *ACC.T / 9.80665),
        {},
        {"t": "t", "acc_x": "a[0] (g)", "acc_z": "a[2] (g)"},
        False,
    ),
    # truth beside readings
    "clean and corrupted": (
        triads(names("acc_clean_", "acc_corrupted_"), 9.80665 * UP, ACC),
        {},
        {"t": "t"} | xyz("acc", "acc_corrupted_*"),
        False,
    ),
    "gt": (triads(names("gt_a", "a"), 9.80665 * UP, ACC), {}, {"t": "t"} | xyz("acc", "a*"), False),
    "ideal and sim": (
        triads(names("ideal_acc_", "sim_acc_"), 9.80665 * UP, ACC),
        {},
        {"t": "t"} | xyz("acc", "sim_acc_*"),
        False,
    ),
    "nominal and noisy": (
        triads(names("nominal_acc_", "noisy_acc_"), 9.80665 * UP, ACC),
        {},
        {"t": "t"} | xyz("acc", "noisy_acc_*"),
        False,
    ),
    # several of a kind
    "two devices": (
        triads(names("imu1_acc_", "imu1_gyro_", "imu2_acc_", "imu2_gyro_"), ACC, GYRO, ACC, GYRO),
        {},
        {"t": "t"} | xyz("acc", "imu1_acc_*") | xyz("gyro", "imu1_gyro_*"),
        True,
    ),
    "two devices by place": (
        triads(names("left_a", "right_a"), ACC, ACC),
        {},
        {"t": "t"} | xyz("acc", "left_a*"),
        True,
    ),
    "raw and filtered": (
        triads(names("acc_raw_", "gyro_raw_", "acc_filt_", "gyro_filt_"), ACC, GYRO, ACC, GYRO),
        {},
        {"t": "t"} | xyz("acc", "acc_raw_*") | xyz("gyro", "gyro_raw_*"),
        False,
    ),
    "two ranges": (
        triads(names("Accel_LN_", "Accel_WR_", "Gyro_"), ACC, ACC, GYRO),
        {},
        {"t": "t"} | xyz("acc", "Accel_LN_*") | xyz("gyro", "Gyro_*"),
        False,
    ),
    "pair of the second": (
        triads(names("a_acc_", "b_acc_", "b_gyro_"), ACC[::-1], ACC, GYRO),
        {},
        {"t": "t"} | xyz("acc", "b_acc_*") | xyz("gyro", "b_gyro_*"),
        False,
    ),
    "magnetometer": (triads(names("acc_", "mag_"), ACC, FIELD), {}, {"t": "t"} | xyz("acc", "acc_*"), False),
    "air and chip": (
        text("t,air temperature (degC),imu temperature (degC)," + names("a"), T, WARM - 9, WARM, *ACC.T),
        {},
        {"t": "t", "temperature": "imu temperature (degC)"} | xyz("acc", "a*"),
        False,
    ),
    "ambient": (
        text("t,temp,ambient_temp," + names("a"), T, WARM, WARM - 9, *ACC.T),
        {},
        {"t": "t", "temperature": "temp"} | xyz("acc", "a*"),
        False,
    ),
    "two thermometers": (
        text("t,temp_a (degC),temp_b (degC)," + names("a"), T, WARM, WARM + 3, *ACC.T),
        {},
        {"t": "t", "temperature": "temp_a (degC)"} | xyz("acc", "a*"),
        True,
    ),
    # spheres, and triads without a word
    "bias of half a g": (text("ax,ay,az", *SHIFTED.T), {}, xyz("acc", "a*"), False),
    "unsigned counts": (text("ax,ay,az", *MIDSCALE.T), {}, xyz("acc", "a*"), False),
    "unsigned beside a magnetometer": (
        text("a,b,c,d,e,f,g,h,i", *STILL.T, *MIDSCALE.T, *MAGNETIC.T).split("\n", 1)[1],
        {},
        {"acc_x": 3, "acc_y": 4, "acc_z": 5},
        True,
    ),
    "unsigned without names": (
        text("a,b,c", *MIDSCALE.T).split("\n", 1)[1],
        {},
        {"acc_x": 0, "acc_y": 1, "acc_z": 2},
        True,
    ),
    "t beside w": (
        triads(names("t", "w", "m"), ACC, GYRO, 0 * ACC),
        {},
        {"t": "t"} | xyz("acc", "t*") | xyz("gyro", "w*"),
        False,
    ),
    "B beside gyro": (triads(names("B", "gyro_"), ACC, GYRO), {}, {"t": "t"} | xyz("gyro", "gyro_*"), True),
    "s beside gyro": (
        triads(names("s", "gyro_"), ACC, GYRO),
        {},
        {"t": "t"} | xyz("acc", "s*") | xyz("gyro", "gyro_*"),
        False,
    ),
}

_ORDER = np.random.default_rng(SEED).permutation(sorted(VARIANTS))
FIRST_HALF = tuple(_ORDER[: len(_ORDER) // 2])
"""Those that were looked at while the rules were written."""
SECOND_HALF = tuple(_ORDER[len(_ORDER) // 2 :])
