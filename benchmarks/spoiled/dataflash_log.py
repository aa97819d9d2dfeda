"""Dataflash logs of ArduPilot, written as its source says: messages FMT, UNIT, MULT and FMTU, then data."""

import struct

SIZES = {
    "Q": "Q",
    "B": "B",
    "f": "f",
    "c": "h",
    "e": "i",
    "L": "i",
    "n": "4s",
    "N": "16s",
    "Z": "64s",
    "H": "H",
    "b": "b",
    "d": "d",
}


def message(number, characters, *values):
    layout = "<" + "".join(SIZES[character] for character in characters)
    return b"\xa3\x95" + bytes([number]) + struct.pack(layout, *values)


def declared(number, name, characters, fields):
    length = 3 + struct.calcsize("<" + "".join(SIZES[character] for character in characters))
    return b"\xa3\x95\x80" + struct.pack(
        "<BB4s16s64s", number, length, name.encode(), characters.encode(), fields.encode()
    )


def log(rows, instances=2, units=True):
    """The messages of a log: IMU of ``instances`` sensors, a barometer with a scaled temperature, a text."""
    parts = [
        declared(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"),
        declared(177, "UNIT", "QbZ", "TimeUS,Id,Label"),
        declared(178, "MULT", "Qbd", "TimeUS,Id,Mult"),
        declared(176, "FMTU", "QBNN", "TimeUS,FmtType,UnitIds,MultIds"),
        declared(10, "IMU", "QBffffff", "TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ"),
        declared(11, "BARO", "Qce", "TimeUS,Temp,Alt"),
        declared(12, "MSG", "QZ", "TimeUS,Message"),
    ]
    if units:
        parts += [
            message(177, "QbZ", 0, ord(letter), label)
            for letter, label in (
                ("s", b"s"),
                ("E", b"rad/s"),
                ("o", b"m/s/s"),
                ("O", b"degC"),
                ("m", b"m"),
                ("#", b"instance"),
            )
        ]
        parts += [message(178, "Qbd", 0, ord("F"), 1e-6), message(178, "Qbd", 0, ord("0"), 1.0)]
        parts += [message(178, "Qbd", 0, ord("B"), 1e-2)]
        parts += [message(176, "QBNN", 0, 10, b"s#EEEooo", b"F-000000")]
        parts += [message(176, "QBNN", 0, 11, b"sOm", b"FBB")]
    for k, (gyro, acc) in enumerate(rows):
        stamp = 1_000_000 + 2500 * k
        parts += [
            message(10, "QBffffff", stamp, i, *(v + i for v in (*gyro, *acc))) for i in range(instances)
        ]
        if k % 10 == 0:
            parts += [message(11, "Qce", stamp, 2512, 1234), message(12, "QZ", stamp, b"hello")]
    return parts
