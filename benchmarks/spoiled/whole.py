"""A whole file of every format that is read: 60 rows of t, acc_x and gyro_x, as inercal and others write them."""

import gzip
import io
import struct
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

from . import dataflash_log, ulog_file

T = np.arange(60) / 100
RNG = np.random.default_rng(20261122)
VALUES = {"acc_x": 9.8 + RNG.standard_normal(60).round(4), "gyro_x": RNG.standard_normal(60).round(4)}
UNITS = {"t": "s", "acc_x": "m/s^2", "gyro_x": "deg/s"}
HEADER = ",".join(f"{name} [{unit}]" for name, unit in UNITS.items())

MAP = """[columns]
t = { from = "t", unit = "s" }
acc_x = { from = "acc_x", unit = "m/s^2" }
gyro_x = { from = "gyro_x", unit = "deg/s" }
"""
BY_NUMBER = MAP.replace('"t"', "0").replace('"acc_x"', "1").replace('"gyro_x"', "2")
BINARY = '[file]\nbinary = "<f8"\nfields = ["t", "acc_x", "gyro_x"]\n' + MAP
ON_ITS_SIDE = "[file]\ntranspose = true\n" + MAP
DAQ = MAP.replace('"t"', '"DAQ/t"').replace('"acc_x"', '"DAQ/acc_x"').replace('"gyro_x"', '"DAQ/gyro_x"')


def table():
    """(60, 3)."""
    return np.column_stack([T, *VALUES.values()])


def text(delimiter=",", mark="."):
    """Lines under a canonical header."""
    rows = "".join(delimiter.join(repr(x).replace(".", mark) for x in row) + "\n" for row in table().tolist())
    return (HEADER.replace(",", delimiter) + "\n" + rows).encode()


@cache
def written(suffix):
    """The record as inercal writes it."""
    from inercal.foundation.records.read import read
    from inercal.foundation.records.write import write_record

    with tempfile.TemporaryDirectory() as folder:
        source, path = Path(folder, "a.csv"), Path(folder, f"b{suffix}")
        source.write_bytes(text())
        write_record(read(source), path)
        return path.read_bytes()


def hdf5(**how):
    """HDF5 as others write it: a group, filters, a newer version of the format."""
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w", **how) as file:
        group = file.create_group("imu")
        for name, values in {"t": T, **VALUES}.items():
            made = group.create_dataset(name, data=values, chunks=(16,), compression="gzip", fletcher32=True)
            made.attrs["units"] = UNITS[name]
    return buffer.getvalue()


def netcdf4():
    """NetCDF-4, as xarray writes it."""
    import h5netcdf

    buffer = io.BytesIO()
    with h5netcdf.File(buffer, "w") as file:
        file.dimensions = {"t": 60}
        for name, values in {"t": T, **VALUES}.items():
            file.create_variable(name, ("t",), float, data=values).attrs["units"] = UNITS[name]
    return buffer.getvalue()


def mat5(compressed):
    """MATLAB v5, with a structure and text beside."""
    from scipy.io import savemat

    buffer = io.BytesIO()
    columns = {"t": T, **VALUES}
    savemat(buffer, {**columns, "s": {"x": T, "y": "text"}, "c": "word"}, do_compression=compressed)
    return buffer.getvalue()


def mat73():
    """MATLAB v7.3: HDF5 behind 512 bytes of MATLAB's own."""
    import h5py

    buffer = io.BytesIO()
    with h5py.File(buffer, "w", userblock_size=512) as file:
        for name, values in {"t": T, **VALUES}.items():
            file[name] = values[None]
            file[name].attrs["MATLAB_class"] = np.bytes_("double")
    return b"MATLAB 7.3 MAT-file".ljust(512) + buffer.getvalue()[512:]


def npz():
    """A structured array, compressed."""
    buffer = io.BytesIO()
    rows = np.zeros(60, [(name, "<f8") for name in UNITS])
    for name, values in {"t": T, **VALUES}.items():
        rows[name] = values
    np.savez_compressed(buffer, log=rows, labels=np.array(["a", "b"]))
    return buffer.getvalue()


def tdms():
    """A waveform of LabVIEW."""
    from nptdms import ChannelObject, TdmsWriter

    buffer = io.BytesIO()
    with TdmsWriter(buffer) as file:
        for _ in range(2):
            file.write_segment(
                [
                    ChannelObject(
                        "IMU", name, values[:30], {"wf_increment": 0.01, "unit_string": UNITS[name]}
                    )
                    for name, values in VALUES.items()
                ]
            )
    return buffer.getvalue()


def daqmx():
    """Raw counts of DAQmx: three channels of 32 bits, interleaved, each with a linear scale."""

    def word(value):
        data = value.encode()
        return struct.pack("<I", len(data)) + data

    own = "NI_Scale[1]_"
    scale = [
        word("NI_Number_Of_Scales") + struct.pack("<II", 7, 2),
        word(f"{own}Scale_Type") + struct.pack("<I", 0x20) + word("Linear"),
        word(f"{own}Linear_Slope") + struct.pack("<Id", 10, 1e-4),
        word(f"{own}Linear_Y_Intercept") + struct.pack("<Id", 10, 0.0),
        word(f"{own}Linear_Input_Source") + struct.pack("<II", 7, 0),
    ]
    objects = [
        ("/", None),
        ("/'DAQ'", None),
        *((f"/'DAQ'/'{name}'", place) for place, name in enumerate(UNITS)),
    ]
    meta = struct.pack("<I", len(objects))
    for path, place in objects:
        meta += word(path)
        if place is None:
            meta += struct.pack("<I", 0xFFFFFFFF)
        else:
            meta += struct.pack("<IIIQI", 0x1269, 0xFFFFFFFF, 1, 60, 1)
            meta += struct.pack("<IIIII", 5, 0, 4 * place, 0, 0) + struct.pack("<II", 1, 12)
        meta += struct.pack("<I", 0 if place is None else len(scale)) + b"".join(
            [] if place is None else scale
        )
    counts = (1e4 * table()).round().astype("<i4").tobytes()
    lead = b"TDSm" + struct.pack("<IIQQ", 0x2 | 0x4 | 0x8 | 0x80, 4713, len(meta) + len(counts), len(meta))
    return lead + meta + counts


def xlsx():
    """A sheet as Excel has it."""
    import openpyxl

    book = openpyxl.Workbook()
    for row in [HEADER.split(","), *table().tolist()]:
        book.active.append(row)
    buffer = io.BytesIO()
    book.save(buffer)
    return buffer.getvalue()


def stamped():
    """Rows with stamps in microseconds."""
    return [(round(1e6 * t), *row) for t, *row in table().tolist()]


def dataflash():
    """A log of ArduPilot with one message of data."""
    parts = [
        dataflash_log.declared(128, "FMT", "BBnNZ", "Type,Length,Name,Format,Columns"),
        dataflash_log.declared(10, "IMU", "Qdd", "TimeUS,acc_x,gyro_x"),
    ]
    return b"".join([*parts, *(dataflash_log.message(10, "Qdd", *row) for row in stamped())])


def ulog():
    """A file of PX4 with one topic."""
    fields = (("uint64_t", "timestamp"), ("double", "acc_x"), ("double", "gyro_x"))
    return ulog_file.log([("imu", 0, fields, stamped())])


def bag(kind):
    """ROS 1, or ROS 2 in a database or MCAP: 60 messages of sensor_msgs/Imu."""
    from rosbags import rosbag1, rosbag2
    from rosbags.typesys import Stores, get_typestore

    with tempfile.TemporaryDirectory() as folder:
        if kind == "bag":
            path = Path(folder, "run.bag")
            file, store = rosbag1.Writer(path), get_typestore(Stores.ROS1_NOETIC)
        else:
            plugin = {"db3": rosbag2.StoragePlugin.SQLITE3, "mcap": rosbag2.StoragePlugin.MCAP}[kind]
            path = Path(folder, "run", f"run.{kind}")
            file = rosbag2.Writer(path.parent, version=9, storage_plugin=plugin)
            store = get_typestore(Stores.ROS2_HUMBLE)
        types = store.types
        serialize = store.serialize_ros1 if kind == "bag" else store.serialize_cdr
        with file:
            connection = file.add_connection("/imu", "sensor_msgs/msg/Imu", typestore=store)
            for k, (t, acc, gyro) in enumerate(table().tolist()):
                stamp = types["builtin_interfaces/msg/Time"](1, round(1e9 * t))
                first = (k,) if kind == "bag" else ()
                vector = types["geometry_msgs/msg/Vector3"]
                message = types["sensor_msgs/msg/Imu"](
                    types["std_msgs/msg/Header"](*first, stamp, "imu"),
                    types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0),
                    np.zeros(9), vector(gyro, 0.0, 0.0), np.zeros(9), vector(acc, 0.0, 0.0), np.zeros(9),
                )  # fmt: skip
                file.write(connection, 10**9 + round(1e9 * t), serialize(message, "sensor_msgs/msg/Imu"))
        return path.read_bytes()


def estimate():
    """A result with a covariance."""
    from inercal.foundation.findings import Status
    from inercal.foundation.results.basis import Basis
    from inercal.foundation.results.result import Estimate

    none = Estimate.without(Basis("test"), Status.OK, "sound")
    from dataclasses import replace

    values = np.array([1.5, -2.25e-5])
    return replace(
        none, names=("a", "b"), units=("m/s^2", "1"), values=values, covariance=np.diag(values**2),
        dof=np.array([10.0, np.inf]), result={"bounds": {"a": 0.1}, "list": [1, 2, None]},
    )  # fmt: skip


def result(suffix):
    """A result as a file."""
    from inercal.foundation.results.files import save

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, f"a{suffix}")
        save(estimate(), path)
        return path.read_bytes()


def certificate():
    """A certificate of that result, as a file."""
    from datetime import date

    from inercal.laboratory.certificate.lab import LabFile
    from inercal.laboratory.certificate.written import certificate as written_certificate

    place = {"name": "Acme", "street": "Long Street 1", "city": "Berlin", "country": "DE"}
    lab = LabFile.model_validate(
        {
            "persons": [{"name": "A. Smith"}],
            "equipment": {},
            "specification": {},
            "laboratory": place,
            "customer": place,
            "order": {"begin": "2026-01-30", "end": "2026-01-31"},
            "item": {"model": "G", "serial": "7"},
            "conditions": {"temperature": "23(1) degC"},
            "statements": {"traceability": "By the network."},
        }
    )
    return written_certificate([estimate()], lab, "C-1", date(2026, 2, 1))


def checkpoint():
    """The state of a stream."""
    from inercal.faces.stream.checkpoint import save

    with tempfile.TemporaryDirectory() as folder:
        save(Path(folder, "a"), "test", "same", {"x": VALUES["acc_x"], "n": 3})
        return Path(folder, "a").read_bytes()


YAML = """cam0:
  T_i_b:
  - [1.0, 0.0, 0.0, 0.0]
  - [0.0, 1.0, 0.0, 0.0]
  gyroscopes: # of an IMU
    M: [[1.0, 0.01, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    name: 'imu'
"""

FORMATS = {
    "csv": (".csv", text, None),
    "csv, decimal commas": (".csv", lambda: text(";", ","), None),
    "csv.gz": (".csv.gz", lambda: gzip.compress(text(), mtime=0), None),
    "text, blanks": (".txt", lambda: text(" "), None),
    "csv, UTF-16": (".csv", lambda: text().decode().encode("utf-16"), None),
    "text on its side": (
        ".txt",
        lambda: "".join(
            f"{name}," + ",".join(map(repr, row)) + "\n"
            for name, row in zip(UNITS, table().T.tolist(), strict=True)
        ).encode(),
        ON_ITS_SIDE,
    ),
    "raw binary": (".bin", lambda: table().astype("<f8").tobytes(), BINARY),
    "npz": (".npz", lambda: written(".npz"), None),
    "npz, structured": (".npz", npz, MAP),
    "h5": (".h5", lambda: written(".h5"), None),
    "h5, chunked": (".h5", lambda: hdf5(libver="latest"), None),
    "nc, NetCDF-3": (".nc", lambda: written(".nc"), None),
    "nc, NetCDF-4": (".nc", netcdf4, None),
    "mat v5": (".mat", lambda: mat5(False), MAP),
    "mat v7": (".mat", lambda: mat5(True), MAP),
    "mat v7.3": (".mat", mat73, MAP),
    "parquet": (".parquet", lambda: written(".parquet"), None),
    "tdms": (".tdms", tdms, None),
    "tdms, DAQmx": (".tdms", daqmx, DAQ),
    "xlsx": (".xlsx", xlsx, None),
    "dataflash": (".bin", dataflash, MAP.replace('from = "t", unit = "s"', 'from = "TimeUS", unit = "us"')),
    "ulog": (".ulg", ulog, MAP.replace('from = "t", unit = "s"', 'from = "imu/timestamp", unit = "us"')),
    "bag": (".bag", lambda: bag("bag"), None),
    "db3": (".db3", lambda: bag("db3"), None),
    "mcap": (".mcap", lambda: bag("mcap"), None),
    "result, JSON": (".json", lambda: result(".json"), None),
    "result, TOML": (".toml", lambda: result(".toml"), None),
    "checkpoint": (".state", checkpoint, None),
    "map, TOML": (".map", lambda: (BINARY + '[time]\nrate = "100 Hz"\n').encode(), None),
    "yaml": (".yaml", lambda: YAML.encode(), None),
    "xml, certificate": (".xml", certificate, None),
}
"""Name of a format: ending, maker of a whole file, map to read it by."""


@cache
def content(name):
    """The bytes of a whole file."""
    return FORMATS[name][1]()
