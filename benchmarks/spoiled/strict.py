"""Strict parsers, written apart from inercal: columns by name as the bytes have them, None for a file that is spoiled.

Text, NetCDF-3, MATLAB v5, raw binary and results are parsed here from their bytes; NPZ by NumPy, which checks the sums
of the archive. HDF5, Parquet, TDMS and bags have parsers in the libraries alone, of which the plainest calls are made.
"""

import csv
import gzip
import io
import json
import re
import struct
import tomllib
import zipfile
import zlib
from xml.etree import ElementTree

import numpy as np

from .whole import UNITS

NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?")


class SpoiledError(Exception):
    """The file is not one of the format."""


def must(condition):
    if not condition:
        raise SpoiledError


def named(columns):
    """The columns of channels by their bare names."""
    plain = {re.sub(r"\s*\[.*", "", name).split("/")[-1]: values for name, values in columns.items()}
    return {name: np.asarray(values, float).ravel() for name, values in plain.items() if name in UNITS}


def lines(data, delimiter=",", mark="."):
    text = data.decode("utf-8")
    must(text.endswith("\n") and "\r" not in text and "\0" not in text)
    first, *rows = csv.reader(text.splitlines(), delimiter=delimiter, strict=True)
    must(rows and all(len(row) == len(first) == 3 for row in rows))
    must(mark == "." or not any("." in field for row in rows for field in row))
    rows = [[field.strip().replace(mark, ".") for field in row] for row in rows]
    must(all(NUMBER.fullmatch(field) for row in rows for field in row))
    return named(dict(zip(first, np.array(rows, float).T, strict=True)))


def blanks(data):
    text = data.decode("ascii")
    must(text.endswith("\n") and not re.search(r"[^\x20-\x7e\n]", text))
    first, *rows = text.splitlines()
    names = re.findall(r"\S+ \[[^\[\]]*\]", first)
    rows = [row.split(" ") for row in rows]
    must(rows and len(names) == 3 and " ".join(names) == first and all(len(row) == 3 for row in rows))
    must(all(NUMBER.fullmatch(field) for row in rows for field in row))
    return named(dict(zip(names, np.array(rows, float).T, strict=True)))


def on_its_side(data):
    rows = [line.split(",") for line in data.decode("ascii").splitlines()]
    must(data.endswith(b"\n") and len({len(row) for row in rows}) == 1)
    must(all(NUMBER.fullmatch(field) for row in rows for field in row[1:]))
    must(len({row[0] for row in rows}) == len(rows))
    return {row[0]: np.array(row[1:], float) for row in rows if row[0] in UNITS}


def raw(data):
    must(len(data) % 24 == 0)
    return dict(zip(UNITS, np.frombuffer(data, "<f8").reshape(-1, 3).T, strict=True))


def npz(data):
    found = {}
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        must(archive.testzip() is None)
    with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
        for name in arrays:
            values = arrays[name]
            fields = values.dtype.names
            found |= {name: values} if fields is None else {field: values[field] for field in fields}
    return named({name: values for name, values in found.items() if values.dtype.kind in "fiu"})


def netcdf3(data):
    """The classic format: https://docs.unidata.ucar.edu/nug/current/file_format_specifications.html."""
    at = 4
    sizes = {1: 1, 2: 1, 3: 2, 4: 4, 5: 4, 6: 8}
    must(data[:3] == b"CDF" and data[3] in (1, 2))

    def word():
        nonlocal at
        at += 4
        return struct.unpack_from(">i", data, at - 4)[0]

    def take(count):
        nonlocal at
        must(count >= 0 and at + count <= len(data))
        at += count + -count % 4
        return data[at - count - -count % 4 : at - -count % 4]

    def listed(tag, one):
        kind, count = word(), word()
        must((kind, count) == (0, 0) or (kind == tag and 0 <= count < 1000))
        return [one() for _ in range(count)]

    def dimension():
        return take(word()).decode(), word()

    def attribute():
        name, kind, count = take(word()).decode(), word(), word()
        must(kind in sizes and 0 <= count < 1 << 20)
        return name, kind, take(count * sizes[kind])

    def variable():
        nonlocal at
        name, ids = take(word()).decode(), [word() for _ in range(min(max(word(), 0), 9))]
        own, kind, _ = listed(12, attribute), word(), word()
        at += 4 if data[3] == 1 else 8
        begin = struct.unpack_from(">i" if data[3] == 1 else ">q", data, at - (4 if data[3] == 1 else 8))[0]
        must(kind in sizes)
        return name, ids, own, kind, begin

    must(word() == 0)
    dimensions = listed(10, dimension)
    listed(12, attribute)
    found = {}
    for name, ids, own, kind, begin in listed(11, variable):
        must(all(0 <= each < len(dimensions) for each in ids))
        shape = [dimensions[each][1] for each in ids]
        packed = {"scale_factor", "add_offset", "_FillValue", "missing_value"} & {each[0] for each in own}
        must(all(size > 0 for size in shape) and begin >= 0 and not packed)
        count = int(np.prod(shape, dtype=object))
        must(begin + count * sizes[kind] <= len(data))
        if kind != 2 and len(shape) == 1:
            types = {1: ">i1", 3: ">i2", 4: ">i4", 5: ">f4", 6: ">f8"}
            found[name] = np.frombuffer(data, types[kind], count, begin)
    return named(found)


def mat5(data):
    """MATLAB v5: elements of a tag and data, whole numbers of 8 bytes; each compressed one has its checksum."""
    types = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
    must(len(data) > 128 and data[126:128] == b"IM" and data[124:126] == b"\0\1")
    found = {}

    def parts(body):
        at = 0
        while at < len(body):
            kind, size = struct.unpack_from("<II", body, at)
            if kind >> 16:
                kind, size, begin, step = kind & 0xFFFF, kind >> 16, at + 4, 8
                must(size <= 4)
            else:
                begin, step = at + 8, 8 + size + -size % 8
            must(begin + size <= len(body))
            yield kind, body[begin : begin + size]
            at += step

    at = 128
    while at < len(data):
        kind, size = struct.unpack_from("<II", data, at)
        body = data[at + 8 : at + 8 + size]
        must(kind in (14, 15) and len(body) == size)
        at += 8 + size
        if kind == 15:
            unpack = zlib.decompressobj()
            body = unpack.decompress(body)
            must(unpack.eof and not unpack.unused_data)
            kind, size = struct.unpack_from("<II", body)
            body = body[8:]
            must(kind == 14 and size == len(body))
        (_, flags), (_, shape), (_, name), *values = parts(body)
        if 6 <= flags[0] <= 15 and len(values) == 1 and values[0][0] in types:
            numbers = np.frombuffer(values[0][1], "<" + types[values[0][0]])
            must(np.frombuffer(shape, "<i4").prod() == numbers.size)
            found[name.decode()] = numbers
    return named(found)


def hdf5(data):
    import h5py

    found = {}
    with h5py.File(io.BytesIO(data), "r") as file:

        def visit(name, item):
            if isinstance(item, h5py.Dataset) and item.dtype.kind in "fiu":
                must(not item.external and not item.is_virtual and item.nbytes < 1 << 28)
                packed = {"scale_factor", "add_offset", "_FillValue", "missing_value"} & set(item.attrs)
                must(not packed)
                found[name] = item[()]

        file.visititems(visit)
    return named(found)


def parquet(data):
    from pyarrow import parquet

    whole = parquet.read_table(io.BytesIO(data), use_threads=False)
    return named({name: whole.column(name).to_numpy() for name in whole.column_names})


def tdms(data):
    from nptdms import TdmsFile

    file = TdmsFile.read(io.BytesIO(data))
    return named(
        {f"{each.group_name}/{each.name}": each[:] for group in file.groups() for each in group.channels()}
    )


def xlsx(data):
    """ZIP checks the sums of its members; the cells by another library."""
    import openpyxl

    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        must(archive.testzip() is None)
    first, *rows = openpyxl.load_workbook(io.BytesIO(data), data_only=True).active.values
    return named(dict(zip(first, np.array(rows, float).T, strict=True)))


def dataflash(data):
    """One message after the other, of two kinds: https://ardupilot.org/dev/docs/code-overview-adding-a-new-log-message.html."""
    must(data[:5] == b"\xa3\x95\x80\x80\x59")
    at, rows, wanted = 0, [], b"IMU\0" + b"Qdd".ljust(16, b"\0") + b"TimeUS,acc_x,gyro_x".ljust(64, b"\0")
    while at < len(data):
        must(data[at : at + 2] == b"\xa3\x95" and data[at + 2] in (128, 10))
        if data[at + 2] == 128:
            must(at == 0 or (data[at + 3 : at + 5] == b"\x0a\x1b" and data[at + 5 : at + 89] == wanted))
            at += 89
        else:
            rows.append(struct.unpack_from("<Qdd", data, at + 3))
            at += 27
    t, acc, gyro = np.array(rows).T
    return {"t": 1e-6 * t, "acc_x": acc, "gyro_x": gyro}


def ulog(data):
    """Header, one format, one subscription, data: https://docs.px4.io/main/en/dev_log/ulog_file_format.html."""
    must(data[:7] == b"ULog\x01\x12\x35")
    at, rows, kinds = 16, [], []
    while at < len(data):
        size, kind = struct.unpack_from("<Hc", data, at)
        body = data[at + 3 : at + 3 + size]
        must(len(body) == size)
        kinds.append(kind)
        if kind == b"F":
            must(body == b"imu:uint64_t timestamp;double acc_x;double gyro_x;")
        elif kind == b"A":
            must(body == b"\0\0\0imu")
        elif kind == b"D":
            must(size == 26 and body[:2] == b"\0\0")
            rows.append(struct.unpack_from("<Qdd", body, 2))
        else:
            must(kind == b"B" and not any(body))
        at += 3 + size
    must(b"".join(kinds).startswith(b"BFAD") and {*kinds[3:]} == {b"D"})
    t, acc, gyro = np.array(rows).T
    return {"t": 1e-6 * t, "acc_x": acc, "gyro_x": gyro}


def bag(path):
    from rosbags.highlevel import AnyReader
    from rosbags.typesys import Stores, get_typestore

    rows = []
    with AnyReader([path], default_typestore=get_typestore(Stores.LATEST)) as reader:
        for connection, _, message in reader.messages():
            held = reader.deserialize(message, connection.msgtype)
            stamp = held.header.stamp
            rows.append(
                [stamp.sec + 1e-9 * stamp.nanosec, held.linear_acceleration.x, held.angular_velocity.x]
            )
    return dict(zip(UNITS, np.array(rows).T, strict=True))


def result(data, toml):
    whole = tomllib.loads(data.decode()) if toml else json.loads(data)
    return {"values": np.array([each["value"] for each in whole["parameters"]], float)}


def certificate(data):
    *_, last = ElementTree.fromstring(data).iter("{https://ptb.de/si}valueXMLList")
    return {"values": np.array(last.text.split(), float)}


def columns(name, path):
    """The columns of a file of a format; None where it is spoiled, or the format has no strict parser."""
    data = path.read_bytes()
    try:
        match name:
            case "csv" | "csv.gz":
                return lines(gzip.decompress(data) if name == "csv.gz" else data)
            case "csv, decimal commas":
                return lines(data, ";", ",")
            case "csv, UTF-16":
                must(data.startswith(b"\xff\xfe"))
                return lines(data[2:].decode("utf-16-le").encode())
            case "xlsx":
                return xlsx(data)
            case "dataflash":
                return dataflash(data)
            case "ulog":
                return ulog(data)
            case "text, blanks":
                return blanks(data)
            case "text on its side":
                return on_its_side(data)
            case "raw binary":
                return raw(data)
            case "npz" | "npz, structured":
                return npz(data)
            case "nc, NetCDF-3":
                return netcdf3(data)
            case "mat v5" | "mat v7":
                return mat5(data)
            case "h5" | "h5, chunked" | "nc, NetCDF-4" | "mat v7.3":
                return hdf5(data)
            case "parquet":
                return parquet(data)
            case "tdms" | "tdms, DAQmx":
                return tdms(data)
            case "bag" | "db3" | "mcap":
                return bag(path)
            case "result, JSON" | "result, TOML":
                return result(data, name.endswith("TOML"))
            case "xml, certificate":
                return certificate(data)
    except Exception:
        return None
    return None
