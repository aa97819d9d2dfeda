"""Ways in which loggers write lines, written before the rules that read them, in two halves: see test_line_variants."""

import datetime
import json

import numpy as np
from scipy.spatial.transform import Rotation

G = 9.80665
HZ = 50.0
SEED = 20261127


def turned(rows=1500):
    """Accelerometers [m/s^2], gyro [rad/s] (n, 3) and times [s] of a unit turned slowly about all axes."""
    rng = np.random.default_rng(3)
    t = np.arange(rows) / HZ
    rate = np.stack(
        [np.sin(t * f + p) for f, p in zip((0.7, 0.5, 0.9), (0.3, 2.0, 4.0), strict=True)], axis=1
    )
    attitude, acc = Rotation.identity(), np.empty((rows, 3))
    for k in range(rows):
        acc[k] = attitude.inv().apply([0.0, 0.0, G])
        attitude = attitude * Rotation.from_rotvec(rate[k] / HZ)
    return acc + 0.02 * rng.standard_normal((rows, 3)), rate + 0.002 * rng.standard_normal((rows, 3)), t


ACC, GYRO, T = turned()


def rows(line, begin=datetime.datetime(2026, 5, 4, 10, 20, 30)):
    """The lines of all rows by a function of time, moment, accelerometers and gyro."""
    made = []
    for t, acc, gyro in zip(T, ACC, GYRO, strict=True):
        when = begin + datetime.timedelta(microseconds=round(1e6 * t))
        made.append(line(t, when, [f"{x:.5f}" for x in acc], [f"{x:.6f}" for x in gyro]))
    return "\n".join(made) + "\n"


def stamped(form, mark=",", cut=3, **begin):
    """Rows behind a stamp by a form of `strftime`, its fraction ``cut`` to so many digits."""

    def line(t, when, acc, gyro):
        text = when.strftime(form.replace("%f", f"{when.microsecond:06d}"[:cut]))
        return mark.join([text, *acc, *gyro])

    head = mark.join(["time", "ax", "ay", "az", "gx", "gy", "gz"]) + "\n"
    return head + rows(line, **begin)


def plain(form):
    """Rows by a form of `format`: t, a0 to a2, g0 to g2."""
    return rows(
        lambda t, when, acc, gyro: form.format(
            t=f"{t:.2f}", ms=f"{1000 * t:.0f}", a0=acc[0], a1=acc[1], a2=acc[2], g0=gyro[0], g1=gyro[1],
            g2=gyro[2], hour=when.strftime("%H:%M:%S.%f")[:-3],
        )
    )  # fmt: skip


def objects(shape):
    return rows(
        lambda t, when, acc, gyro: json.dumps(
            shape(t, when, [float(x) for x in acc], [float(x) for x in gyro])
        )
    )


NAMES = "ax", "ay", "az", "gx", "gy", "gz"


def triad(values):
    return dict(zip("xyz", values, strict=True))


def clock(form, head="time"):
    """Rows behind a number of the time."""
    names = f"{head},ax,ay,az,gx,gy,gz\n"
    return names + rows(lambda t, when, acc, gyro: ",".join([form(round(HZ * t)), *acc, *gyro]))


late = {"begin": datetime.datetime(2026, 5, 4, 23, 59, 50)}
noon = {"begin": datetime.datetime(2026, 5, 4, 11, 59, 50)}
after = {"begin": datetime.datetime(2026, 5, 25, 13, 20, 30)}
AXES = "x: {a0}\ny: {a1}\nz: {a2}\n"

#: name -> text, and whether the file has times
VARIANTS = {
    # stamps
    "iso T": (stamped("%Y-%m-%dT%H:%M:%S.%f"), True),
    "iso blank": (stamped("%Y-%m-%d %H:%M:%S.%f"), True),
    "iso zone": (stamped("%Y-%m-%dT%H:%M:%S.%fZ"), True),
    "iso offset": (stamped("%Y-%m-%dT%H:%M:%S.%f+02:00"), True),
    "iso comma": (stamped("%Y-%m-%d %H:%M:%S,%f", ";"), True),
    "iso micro": (stamped("%Y-%m-%d %H:%M:%S.%f", cut=6), True),
    "iso underscore": (stamped("%Y-%m-%d_%H:%M:%S.%f"), True),
    "slashes year first": (stamped("%Y/%m/%d %H:%M:%S.%f"), True),
    "points day first": (stamped("%d.%m.%Y %H:%M:%S.%f"), True),
    "day first by 25": (stamped("%d/%m/%Y %H:%M:%S.%f", **after), True),
    "month first by 25": (stamped("%m/%d/%Y %H:%M:%S.%f", **after), True),
    "either order": (stamped("%d/%m/%Y %H:%M:%S.%f"), True),
    "month first PM": (stamped("%m/%d/%Y %I:%M:%S.%f %p", **noon), True),
    "month by name": (stamped("%d-%b-%Y %H:%M:%S.%f"), True),
    "time of day": (stamped("%H:%M:%S.%f"), True),
    "time of day in brackets": (stamped("[%H:%M:%S.%f]"), True),
    "time of day colon": (stamped("%H:%M:%S:%f"), True),
    "time of day AM": (stamped("%I:%M:%S.%f %p", **noon), True),
    "over midnight": (stamped("%H:%M:%S.%f", **late), True),
    "dated over midnight": (stamped("%Y-%m-%d %H:%M:%S.%f", **late), True),
    "two columns": (stamped("%Y-%m-%d,%H:%M:%S.%f").replace("time,", "date,time,"), True),
    "two columns day first": (stamped("%d.%m.%Y;%H:%M:%S.%f", ";").replace("time;", "Datum;Uhrzeit;"), True),
    "two columns over midnight": (stamped("%m/%d/%Y,%H:%M:%S.%f", **late).replace("time,", "date,time,"), True),
    "quoted": (stamped('"%Y-%m-%d %H:%M:%S.%f"'), True),
    "tabs": (stamped("%Y-%m-%d %H:%M:%S.%f", "\t"), True),
    # counters
    "wrap 32": (clock(lambda k: str((2**32 - 5_000_000 + 20_000 * k) % 2**32), "micros"), True),
    "wrap 16": (clock(lambda k: str((60_000 + 20 * k) % 2**16), "time_ms"), True),
    "wrap 24": (clock(lambda k: str((2**24 - 5_000 + 20 * k) % 2**24), "time (ms)"), True),
    "s and ns": (clock(lambda k: f"{1_780_000_000 + k // 50},{k % 50 * 20_000_000}", "sec,nsec"), True),
    "s and us": (clock(lambda k: f"{1_780_000_000 + k // 50},{k % 50 * 20_000}", "tv_sec,tv_usec"), True),
    # words before numbers
    "words blank": (plain("ax {a0} ay {a1} az {a2} gx {g0} gy {g1} gz {g2}"), False),
    "words equal": (plain("ax={a0}, ay={a1}, az={a2}, gx={g0}, gy={g1}, gz={g2}"), False),
    "words colon with t": (plain("t:{t} ax:{a0} ay:{a1} az:{a2} gx:{g0} gy:{g1} gz:{g2}"), True),
    "words brackets": (plain("acc [{a0} {a1} {a2}] gyro [{g0} {g1} {g2}]"), False),
    "words bar": (plain("Acc: {a0}, {a1}, {a2} | Gyro: {g0}, {g1}, {g2}"), False),
    "words with units": (plain("Accel X: {a0} Y: {a1} Z: {a2} m/s^2, Gyro X: {g0} Y: {g1} Z: {g2} rad/s"), False),
    "words two lines": (plain("Accel X={a0} Y={a1} Z={a2}\nGyro X={g0} Y={g1} Z={g2}"), False),
    "words three lines": (plain("Time: {t} s\nacc = ({a0}, {a1}, {a2})\ngyr = ({g0}, {g1}, {g2})"), True),
    "words after a stamp": (plain("[{hour}] ax={a0} ay={a1} az={a2} gx={g0} gy={g1} gz={g2}"), True),
    "arrow": (plain("{hour} -> {a0},{a1},{a2},{g0},{g1},{g2}"), True),
    "arrow with tabs": (plain("{hour} -> {a0}\t{a1}\t{a2}\t{g0}\t{g1}\t{g2}"), True),
    "stamp above": (plain("{hour}\n{a0} {a1} {a2} {g0} {g1} {g2}"), True),
    # objects and documents
    "json flat": (
        objects(lambda t, w, a, g: dict(zip(["t", *NAMES], (t, *a, *g), strict=True))),
        True,
    ),
    "json nested": (
        objects(lambda t, w, a, g: {"time": t, "acc": triad(a), "gyro": triad(g)}),
        True,
    ),
    "json lists": (objects(lambda t, w, a, g: {"timestamp": t, "accel": a, "gyro": g}), True),
    "json iso": (objects(lambda t, w, a, g: {"time": w.isoformat() + "Z", "acc": a, "gyro": g}), True),
    "documents": (
        plain(
            "header:\n  stamp: {t}\nangular_velocity:\n  x: {g0}\n  y: {g1}\n  z: {g2}\n"
            "linear_acceleration:\n  x: {a0}\n  y: {a1}\n  z: {a2}\n---"
        ),
        True,
    ),
    # messages
    "message with names": (
        "#IMU,time,ax,ay,az,gx,gy,gz\n#GPS,time,lat,lon,alt\n"
        + plain("IMU,{t},{a0},{a1},{a2},{g0},{g1},{g2}\nGPS,{t},48.1,11.5,519.0"),
        True,
    ),
    "dollar and checksum": ("$IMU,t,ax,ay,az,gx,gy,gz\n" + plain("$IMU,{t},{a0},{a1},{a2},{g0},{g1},{g2}*3F"), True),
    "word before all": (plain("IMU {a0} {a1} {a2} {g0} {g1} {g2}"), False),
    # without names
    "bare with times": (plain("{t},{a0},{a1},{a2},{g0},{g1},{g2}"), True),
    "bare gyro first": (plain("{t} {g0} {g1} {g2} {a0} {a1} {a2}"), True),
    "bare with milliseconds": (plain("{ms}\t{a0}\t{a1}\t{a2}\t{g0}\t{g1}\t{g2}"), True),
    "bare without times": (plain("{a0} {a1} {a2} {g0} {g1} {g2}"), False),
    "bare with a status": (plain("{t},1,{a0},{a1},{a2},{g0},{g1},{g2}"), True),
    "lvm": (
        "LabVIEW Measurement\t\nX_Columns\tOne\n***End_of_Header***\t\n\t\n"
        + "X_Value\tax\tay\taz\tgx\tgy\tgz\tComment\n"
        + plain("{t}\t{a0}\t{a1}\t{a2}\t{g0}\t{g1}\t{g2}\t"),
        True,
    ),
}  # fmt: skip

_ORDER = np.random.default_rng(SEED).permutation(sorted(VARIANTS))
FIRST_HALF = tuple(_ORDER[: len(_ORDER) // 2])
"""Those that were looked at while the rules were written."""
SECOND_HALF = tuple(_ORDER[len(_ORDER) // 2 :])
