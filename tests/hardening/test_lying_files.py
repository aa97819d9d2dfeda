"""Files that lie: values kept elsewhere, names that hide values, sizes without end. Each is refused in one sentence."""

import gzip
import os
import signal
import struct
import subprocess
import sys
import threading
import time
import zipfile
from contextlib import suppress
from pathlib import Path

import h5py
import numpy as np
import pytest

from inercal.foundation.errors import InputError, RecordError
from inercal.foundation.records.read import child, limits, read
from inercal.foundation.records.read.child import in_child
from inercal.foundation.records.recognise.map_text import guess_map
from rows import for_each

T = np.arange(300) / 100
MAP = '[columns]\nacc_x = { from = "acc_x", unit = "m/s^2" }\n[time]\nrate = "100 Hz"\n'


def refusal(path, record_map=None):
    """The sentence that refuses a file."""
    with pytest.raises(InputError) as caught:
        read(path, record_map)
    text = str(caught.value)
    assert "\n" not in text
    assert len(text) < 600
    return text


def put(folder, name, content):
    path = folder / name
    path.write_bytes(content.encode() if isinstance(content, str) else content)
    return path


def external(file, folder):
    (folder / "secret.bin").write_bytes(np.arange(300.0).tobytes())
    file.create_dataset("acc_x", (300,), "f8", external=[(str(folder / "secret.bin"), 0, 2400)])


def pipe(file, folder):
    os.mkfifo(folder / "secret.bin")
    file.create_dataset("acc_x", (300,), "f8", external=[(str(folder / "secret.bin"), 0, 2400)])


def virtual(file, folder):
    """The source is missing, and two thirds of the rows would be its fill value."""
    layout = h5py.VirtualLayout((300,), "f8")
    layout[:200] = h5py.VirtualSource(folder / "gone.h5", "x", (200,))
    file.create_virtual_dataset("acc_x", layout, fillvalue=9.8)


@pytest.mark.skipif(os.name == "nt", reason="named pipes")
@for_each("suffix", [".h5", ".nc", ".mat"])
@for_each("keep", [external, pipe, virtual])
def test_values_kept_outside_of_the_file(suffix, keep, tmp_path):
    folder = tmp_path / f"{suffix[1:]}-{keep.__name__}"
    folder.mkdir()
    path = folder / f"a{suffix}"
    with h5py.File(path, "w") as file:
        file["t"] = T
        file["t"].attrs["units"] = "s"
        keep(file, folder)
        file["acc_x"].attrs["units"] = "m/s^2"
        file["gyro_x"] = T
        file["gyro_x"].attrs["units"] = "deg/s"
    mapped = put(folder, "map.toml", MAP)
    began = time.monotonic()
    for record_map in (mapped,) if suffix == ".mat" else (None, mapped):
        assert "'/acc_x' keeps its values elsewhere" in refusal(path, record_map)
    with pytest.raises(RecordError, match="keeps its values elsewhere"):
        guess_map(path)
    other = put(folder, "other.toml", MAP.replace("acc", "gyro").replace("m/s^2", "deg/s"))
    assert (read(path, other)["gyro_x"].values == T).all()  # the others are in the file
    assert time.monotonic() - began < 60


def test_a_cell_of_strings_kept_outside_of_the_file(tmp_path):
    path = tmp_path / "a.mat"
    (tmp_path / "secret.bin").write_bytes(b"s\0e\0c\0" * 2)
    with h5py.File(path, "w", userblock_size=512) as file:
        file["acc_x"] = T[None, :6]
        file["acc_x"].attrs["MATLAB_class"] = np.bytes_("double")
        text = file.create_dataset("#refs#/a", (6, 1), "u2", external=[(str(tmp_path / "secret.bin"), 0, 12)])
        file.create_dataset("part", data=np.array([[text.ref] * 6], dtype=h5py.ref_dtype))
        file["part"].attrs["MATLAB_class"] = np.bytes_("cell")
    data = bytearray(path.read_bytes())
    data[:10] = b"MATLAB 7.3"
    path.write_bytes(data)
    mapped = put(tmp_path, "map.toml", MAP + '[columns.label]\nfrom = "part"\n')
    assert "'/#refs#/a' keeps its values elsewhere" in refusal(path, mapped)


@for_each("name", ["data", "_shape", "version_byte", "variables", "_attributes"])
@for_each("of_file", [False, True])
def test_an_attribute_that_hides_the_values_of_netcdf(name, of_file, tmp_path):
    """SciPy keeps attributes of a file beside its own: one called `data` replaced the values."""
    from scipy.io import netcdf_file

    path = tmp_path / f"{name}-{of_file}.nc"
    with netcdf_file(path, "w") as root:
        root.createDimension("t", 300)
        for each, unit in (("t", "s"), ("acc_x", "m/s^2")):
            variable = root.createVariable(each, "d", ("t",))
            variable[:] = T + 9.0
            variable.units = unit
        setattr(root if of_file else root.variables["acc_x"], "~" * len(name), np.arange(300.0))
    sound = path.read_bytes()
    assert (read(path)["acc_x"].values == T + 9.0).all()
    path.write_bytes(sound.replace(b"~" * len(name), name.encode()))
    refusal(path)
    if name == "data":
        assert f"has an attribute called {name}" in refusal(path)


@for_each("suffix", [".h5", ".nc"])
def test_a_small_file_that_says_it_is_huge(suffix, tmp_path):
    path = tmp_path / f"a{suffix}"
    with h5py.File(path, "w") as file:
        for name, unit in (("t", "s"), ("acc_x", "m/s^2")):
            file.create_dataset(name, (2**27,), "f8", chunks=(2**20,), compression="gzip").attrs["units"] = (
                unit
            )
    assert path.stat().st_size < 10_000
    assert "expected at most 256 MiB and 100 for each byte" in refusal(path)


def test_an_archive_that_unpacks_without_end(tmp_path, monkeypatch):
    """NPZ, text and raw binary, all of zeros; the latter under smaller limits."""
    bomb = tmp_path / "a.npz"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in ("t [s]", "acc_x [m/s^2]"):
            with archive.open(f"{name}.npy", "w") as member:
                head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({20 << 20},), }}"
                head += " " * (118 - len(head) - 1) + "\n"
                member.write(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode())
                member.write(bytes(1 << 20))
    assert "expected at most 256 MiB" in refusal(bomb)
    monkeypatch.setattr(limits, "_MIB", 1 << 12)
    zeros = gzip.compress(bytes(1 << 20), 9)
    packed = put(tmp_path, "b.dat.gz", zeros * 3)
    described = put(tmp_path, "map.toml", '[file]\nbinary = "<f8"\nfields = ["acc_x"]\n' + MAP)
    assert "expected at most 256 MiB" in refusal(packed, described)
    lines = gzip.compress(b"#" * (1 << 20) + b"\n", 9)
    text = put(tmp_path, "c.csv.gz", gzip.compress(b"t [s],acc_x [g]\n0,1\n1,1\n") + lines * 3)
    assert "expected at most 256 MiB" in refusal(text)


def bag(path, levels):
    """A ROS 1 bag whose messages hold two messages that hold two messages, and so on."""
    from rosbags.rosbag1 import Writer
    from rosbags.typesys import Stores, get_types_from_msg, get_typestore

    head = "float64 v\nT1 a\nT1 b\n"
    parts = [f"MSG: x/T{k}\nT{k + 1} a\nT{k + 1} b\n" for k in range(1, levels)]
    text = f"{'=' * 80}\n".join([head, *parts, f"MSG: x/T{levels}\nfloat64 w\n"])
    store = get_typestore(Stores.EMPTY)
    store.register(get_types_from_msg(text, "x/msg/Root"))
    with Writer(path) as writer:
        digest = store.generate_msgdef("x/msg/Root")[1]
        connection = writer.add_connection("/x", "x/msg/Root", msgdef=text, md5sum=digest)
        for k in range(20):
            writer.write(connection, 10**9 + k * 10**7, struct.pack("<d", 9.8) + bytes(8 * 2**levels))


def test_definitions_within_each_other(tmp_path):
    """Only the types along the fields that are asked for are looked at; a guess lists those of few levels."""
    bag(tmp_path / "few.bag", 3)
    mapped = put(tmp_path, "map.toml", MAP.replace('"acc_x"', '"/x/v"'))
    assert (read(tmp_path / "few.bag", mapped)["acc_x"].values == 9.8).all()
    deep = put(tmp_path, "deep.toml", MAP.replace('"acc_x"', '"/x/a.b.a.w"'))
    assert (read(tmp_path / "few.bag", deep)["acc_x"].values == 0).all()
    data = (tmp_path / "few.bag").read_bytes()
    bag(tmp_path / "many.bag", 9)
    many = (tmp_path / "many.bag").read_bytes()
    assert len(data) < len(many)
    from inercal.foundation.records.read.bags import _fields, _Topic

    names = {f"T{k}": ((), (("a", (2, f"T{k + 1}")), ("b", (2, f"T{k + 1}")))) for k in range(100)}
    topic = _Topic("T0", (), 1, names)
    assert topic.content(".".join("ab" * 40)) is None
    assert list(_fields(names, "T0")) == []


NUMBERS = "".join(f"{k / 100:.2f};{'0,5' if k else '0,25'};7\n" for k in range(400)).replace(".", ",")


@for_each(
    "content, code, where",
    [
        ("t [s],acc_x [m/s^2]\n0,9.80665\n1,9.80665\n2,9.8", "truncated", "line 4"),
        ("t [s],gyro_x [count]\n0,32600\n1,32601\n2,326", "truncated", "line 4"),
        (
            "t [s],acc_x [m/s^2]\n" + "".join(f"{k},9.80{k}\n" for k in range(8)) + "8,9.8",
            "truncated",
            "line 10",
        ),
        ("t [s];acc_x [g];acc_y [g]\n" + NUMBERS + "4,00;1.000;7\n4,01;0,5;7\n", "bad_row", "line 402"),
        ("t [s];acc_x [g];acc_y [g]\n" + NUMBERS + "4,00;\u0661;7\n4,01;0,5;7\n", "bad_row", "line 402"),
        ("t [s];acc_x [g];acc_y [g]\n" + NUMBERS + "4,00;1.000,5;7\n4,01;0,5;7\n", "bad_row", "line 402"),
    ],
)
def test_numbers_in_text_that_may_be_others(content, code, where, tmp_path):
    record = read(put(tmp_path, "a.csv", content))
    found = [(finding.code, finding.where) for finding in record.findings]
    assert (code, where) in found
    if code == "bad_row":
        assert np.isnan(record["acc_x"].values[400])


@for_each(
    "content",
    [
        "t [s],acc_x [m/s^2]\n0,9.80665\n1,9.80665\n2,9.8\n",
        "t [s],acc_x [m/s^2]\n" + "\n".join(f"{k},9.80{k}" for k in range(9)),
        "t [s],acc_x [m/s^2],note\n" + "\n".join(f"{k},9.80{k},{k}" for k in range(9)),
        "t [s],acc_x [m/s^2]\n" + "\n".join(f"{k},{9.8 + k:.3e}" for k in range(9)),
    ],
)
def test_last_numbers_that_are_whole(content, tmp_path):
    """With a line end, or as many places as all before, or in a column that is not read."""
    assert not read(put(tmp_path, "a.csv", content)).findings


@for_each("zeros", [10, 5000])
def test_whole_numbers_of_many_digits(zeros, tmp_path):
    rows = "".join(f"{k},{'0' * zeros}{2**53 + 1}\n" for k in range(4))
    record = read(put(tmp_path, f"{zeros}.csv", f"t [s],gyro_x [count]\n{rows}"))
    assert (record["gyro_x"].values == 2.0**53).all()
    assert "resolution" in [finding.code for finding in record.findings]
    nines = "9" * zeros
    record = read(
        put(tmp_path, f"{zeros}n.csv", f"t [s],acc_x [g]\n0,1\n1,{nines if zeros > 30 else '1e99'}\n2,1\n")
    )
    assert np.isnan(record["acc_x"].values[1])


@pytest.mark.slow
@for_each(
    "header",
    [
        "t [s],acc_x [m/s^2]," + "x" + " " * 300_000 + "y",
        "t [s],acc_x [m/s^2]," + "[" * 300_000,
        "t [s] acc_x [m/s^2] " + "a [" * 100_000,
        "t [s],acc_x [" + "m" * 60_000 + "]",
        "t [s],acc_x [" + " " * 60_000 + "m]",
        "t [s] acc_x [m/s^2] " + "a [" * 20_000,
        "t [s],acc_x [m/s^2]," + "([" * 30_000,
        ",".join(f"column {k}" for k in range(4_000)),
    ],
)
def test_long_headers(header, tmp_path):
    """One of 300 kB took over a minute."""
    delimiter = "," if "," in header else " "
    width = len(header.split(delimiter))
    path = put(tmp_path, "a.csv", header + "\n" + (delimiter.join(["1"] * width) + "\n") * 3)
    began = time.process_time()
    for call in (read, guess_map):
        with suppress(InputError):
            call(path)
    assert time.process_time() - began < 10


def test_carriage_returns_alone_end_lines(tmp_path):
    """As files of old Macintosh programs have them."""
    rows = "".join(f"{k},{k}.5\n" for k in range(200_000))
    text = f"t [s],acc_x [g]\n{rows}"
    values = read(put(tmp_path, "a.csv", text.replace("\n", "\r")))["acc_x"].values
    assert (values == np.arange(200_000) + 0.5).all()


# The child itself.


def crash(_):
    os.kill(os.getpid(), signal.SIGSEGV)


def spin(_):
    while True:
        pass


def sleep(_):
    time.sleep(100)


def swell(_):
    return np.ones(1 << 28)


def leave(_):
    os._exit(3)


def fail(_):
    raise ZeroDivisionError("of no kind")


def refuse(_):
    raise RecordError("a.mat", "is none")


def count(tell):
    for done in (1, 2, 3):
        tell(done)
    return {"values": np.arange(1e5), "empty": np.empty(0), "name": "x", "few": np.eye(3)[:, 1]}


def started(monkeypatch, forked):
    if forked and not hasattr(os, "fork"):
        pytest.skip("no forks")
    monkeypatch.setattr(child, "_may_fork", lambda: forked)
    return forked


@pytest.mark.skipif(os.name == "nt", reason="signals as on POSIX")
@pytest.mark.parametrize("forked", [True, pytest.param(False, marks=pytest.mark.slow)])
def test_ends_of_a_child(forked, tmp_path, monkeypatch):
    started(monkeypatch, forked)
    monkeypatch.setenv(
        "PYTHONPATH", os.pathsep.join([str(Path(__file__).parent), os.environ.get("PYTHONPATH", "")])
    )
    path = put(tmp_path, "a.mat", "x")
    ends = [(crash, "crashed its reader (SIGSEGV)"), (leave, "crashed its reader (exit code 3)")]
    if forked:  # the limits of a new Python are as they are
        monkeypatch.setattr(limits, "seconds", lambda size: 1)
        monkeypatch.setattr(child, "_PATIENCE", 3)
        ends += [(spin, "was given up after 1 s of processor time"), (sleep, "was given up after")]
    for work, words in ends:
        with pytest.raises(RecordError) as caught:
            in_child(work, path)
        assert words in str(caught.value)
        assert "\n" not in str(caught.value)
    with pytest.raises(ZeroDivisionError):
        in_child(fail, path)
    with pytest.raises(RecordError, match=r"a\.mat: is none"):
        in_child(refuse, path)
    told = []
    found = in_child(count, path, told.append)
    assert told == [1, 2, 3]
    assert (found["values"] == np.arange(1e5)).all()
    found["values"][0] = 7.0  # it is the parent's own
    assert found["name"] == "x"
    assert found["empty"].size == 0
    assert found["few"].tolist() == [0, 1, 0]


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="limits of memory as on Linux")
def test_memory_of_a_child(tmp_path, monkeypatch):
    monkeypatch.setattr(limits, "memory", lambda size: 1 << 28)
    with pytest.raises(MemoryError):
        in_child(swell, put(tmp_path, "a.mat", "x"))


@pytest.mark.parametrize("daemon", [False, True])
def test_beside_other_threads_nothing_is_forked(daemon):
    """A lock that another thread holds would never be free in a fork; a progress bar holds none that is asked for."""
    wait = threading.Event()
    other = threading.Thread(target=wait.wait, daemon=daemon)
    other.start()
    try:
        assert child._may_fork() == daemon
    finally:
        wait.set()
        other.join()


@pytest.mark.slow
def test_a_new_python_reads_the_same(tmp_path, monkeypatch):
    """Where forking is not safe."""
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        for name, unit in (("t", "s"), ("acc_x", "m/s^2")):
            file[name] = T
            file[name].attrs["units"] = unit
    wanted = read(path)
    monkeypatch.setattr(child, "_may_fork", lambda: False)
    again = read(path)
    assert (again["acc_x"].values == wanted["acc_x"].values).all()
    assert again.findings == wanted.findings
    with pytest.raises(RecordError, match="cannot be read as an HDF5 file"):
        read(put(tmp_path, "b.h5", "no such"))


def test_a_new_python_imports_nothing_beside_a_recording(tmp_path, monkeypatch):
    """A module of Python among foreign files lies in the working folder of whoever looks at them."""
    put(tmp_path, "pickle.py", f"open({str(tmp_path / 'ran')!r}, 'w')\n")
    monkeypatch.chdir(tmp_path)
    monkeypatch.delenv("PYTHONPATH", raising=False)
    started(monkeypatch, forked=False)
    assert in_child(callable, put(tmp_path, "a.mat", "x")) is True
    assert not (tmp_path / "ran").exists()


_POOL = """
from inercal import cli
from inercal.foundation.computing.executors import Processes

def run(arguments):
    print(sorted(found for _, found in Processes(1).map(len, [range(2), range(3)])))
    return 0

if __name__ == "__main__":
    cli.run = run
    cli.main()
"""
"""A program that begins as a command does, and makes a pool."""


def test_a_pool_imports_nothing_beside_a_recording(tmp_path):
    """As a pool of a command does, begun in a folder of foreign files."""
    (tmp_path / "foreign").mkdir()
    for name in ("multiprocessing", "pickle", "signal"):
        put(tmp_path / "foreign", f"{name}.py", f"open({str(tmp_path / 'ran')!r}, 'w')\n")
    environment = {name: text for name, text in os.environ.items() if not name.startswith("PYTHON")}
    command = [sys.executable, str(put(tmp_path, "pool.py", _POOL))]
    done = subprocess.run(
        command,
        cwd=tmp_path / "foreign",
        env=environment,
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert done.stdout == "[2, 3]\n", done.stderr
    assert not (tmp_path / "ran").exists()


def test_eight_bytes_less_in_a_mat_file(tmp_path):
    """Deleted near the end, they crashed the process."""
    from scipy.io import savemat

    whole = tmp_path / "whole.mat"
    savemat(whole, {"acc_x": T, "s": {"x": T, "y": "text"}})
    data = whole.read_bytes()
    mapped = put(tmp_path, "map.toml", MAP)
    for begin in range(len(data) - 200, len(data) - 8, 16):
        path = put(tmp_path, "cut.mat", data[:begin] + data[begin + 8 :])
        with suppress(InputError):
            read(path, mapped)


def test_the_page_of_the_contract_has_the_limits():
    page = (Path(__file__).parents[2] / "docs/reference/reading.md").read_text("utf-8")
    mib = 1 << 20
    assert (limits.unpacked(0), limits.unpacked(7)) == (256 * mib, 256 * mib + 700)
    assert limits.memory(0) == 512 * mib + 4 * limits.unpacked(0)
    assert (limits.seconds(0), limits.seconds(mib)) == (8, 12)
    assert (2 * mib, 65_536, 200) == (limits.LINE, limits.HEADER, limits.TITLE)
    assert (limits.NESTING, limits.FIELDS, child._PATIENCE) == (16, 10_000, 10)
    for words in ("256 MiB + 100 size", "512 MiB + four times", "8 s + 4 s for each MiB; ten times", "65 536", "2 MiB",
                  "200 characters", "| 16;", "| 10 000 |", "900 characters", "1 MiB, 50 levels"):  # fmt: skip
        assert words in page
