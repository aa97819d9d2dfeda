"""Files that lie: values kept elsewhere, names that hide values, sizes without end. Each is refused in one sentence."""

import os
import struct
import time

import h5py
import numpy as np
import pytest

from inercal.errors import InputError, RecordError
from inercal.records.guess import guess_map
from inercal.records.read import read
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


def test_an_archive_that_unpacks_without_end(tmp_path):
    """NPZ, text and raw binary, all of zeros."""
    import gzip
    import zipfile

    bomb = tmp_path / "a.npz"
    with zipfile.ZipFile(bomb, "w", zipfile.ZIP_DEFLATED) as archive:
        for name in ("t [s]", "acc_x [m/s^2]"):
            with archive.open(f"{name}.npy", "w") as member:
                head = f"{{'descr': '<f8', 'fortran_order': False, 'shape': ({20 << 20},), }}"
                head += " " * (118 - len(head) - 1) + "\n"
                member.write(b"\x93NUMPY\x01\x00" + struct.pack("<H", len(head)) + head.encode())
                member.write(bytes(1 << 20))
    assert "expected at most 256 MiB" in refusal(bomb)
    zeros = gzip.compress(bytes(1 << 20), 9)
    packed = put(tmp_path, "b.dat.gz", zeros * 290)
    described = put(tmp_path, "map.toml", '[file]\nbinary = "<f8"\nfields = ["acc_x"]\n' + MAP)
    assert "expected at most 256 MiB" in refusal(packed, described)
    lines = gzip.compress(b"#" * (1 << 20) + b"\n", 9)
    text = put(tmp_path, "c.csv.gz", gzip.compress(b"t [s],acc_x [g]\n0,1\n1,1\n") + lines * 290)
    assert "expected at most 256 MiB" in refusal(text)
