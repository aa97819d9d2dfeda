"""HDF5 and what is HDF5 inside: plain files, NetCDF-4, and MAT v7.3 as MATLAB writes it; and classic NetCDF."""

import h5netcdf
import h5py
import numpy as np
import pytest
from scipy.io import netcdf_file, savemat

from inercal.foundation.errors import MapError, RecordError
from inercal.foundation.records.read import canonical_units, read
from inercal.foundation.records.recognise.map_text import guess_map

RNG = np.random.default_rng(21)
N = 120
T = np.arange(N) / 200
ACC = np.array([0.1, -0.2, 9.8]) + 0.01 * RNG.standard_normal((N, 3))
GYRO = RNG.standard_normal((N // 2, 3))


def self_describing(path):
    """Accelerometers at 200 Hz and gyros at 100 Hz, each on a dimension scale of its own."""
    with h5py.File(path, "w") as file:
        for sensor, unit, values, t in (("acc", "m/s^2", ACC, T), ("gyro", "deg/s", GYRO, T[::2])):
            scale = file.create_dataset(f"imu/t_{sensor}", data=t)
            scale.make_scale()
            scale.attrs["units"] = "s"
            for axis, column in zip("xyz", values.T, strict=True):
                data = file.create_dataset(f"imu/{sensor}_{axis}", data=column, chunks=(50,), compression=1)
                data.attrs["units"] = unit
                data.dims[0].attach_scale(scale)
        file["frame_number"] = np.arange(7)
    return path


def mapped(path, text):
    path.write_text(text)
    return path


def entries(sensor, array, unit, table="columns", first=0):
    return "".join(
        f'[{table}.{sensor}_{axis}]\nfrom = ["{array}", {index}]\nunit = "{unit}"\n'
        for index, axis in enumerate("xyz", first)
    )


def test_dimension_scales_are_the_clocks(tmp_path):
    path = self_describing(tmp_path / "run.h5")
    record = read(path)
    np.testing.assert_array_equal(record.triad("acc").values, ACC)
    np.testing.assert_array_equal(record["acc_z"].t, T)
    np.testing.assert_array_equal(record.triad("gyro").values, GYRO)
    np.testing.assert_array_equal(record["gyro_x"].t, T[::2])
    assert record.findings == ()
    assert len(record.sources) == 1
    assert {unit.symbol for unit in canonical_units([path]).values()} == {"m/s^2", "deg/s", "s"}


def test_the_map_guessed_for_two_clocks_reads_the_same_record(tmp_path):
    path = self_describing(tmp_path / "run.hdf5")
    record_map = mapped(tmp_path / "map.toml", guess_map(path))
    assert record_map.read_text().count('path = "run.hdf5"') == 2
    record, told = read(path, record_map), read(path)
    assert set(record.columns) == set(told.columns)
    for name, column in told.columns.items():
        np.testing.assert_array_equal(record[name].values, column.values)
        np.testing.assert_array_equal(record[name].t, column.t)
        assert record[name].unit == column.unit


def test_columns_of_several_lengths_without_clocks_need_a_part_each(tmp_path):
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file["acc"], file["gyro"], file["time"], file["time2"] = ACC, GYRO, T, T[::2]
    t = '[columns.t]\nfrom = "time"\nunit = "s"\n'
    acc, gyro = entries("acc", "acc", "m/s^2"), entries("gyro", "gyro", "deg/s")
    with pytest.raises(
        RecordError, match=r"found 120 rows of t, .* 60 rows of gyro_x, .* a \[file.NAME\] for each"
    ):
        read(path, mapped(tmp_path / "map.toml", t + acc + gyro))
    with pytest.raises(RecordError, match=r"120 rows of acc_x, .*60 rows of gyro_x"):
        read(path, mapped(tmp_path / "map.toml", acc + gyro + '[time]\nrate = "200 Hz"\n'))
    parts = "".join(
        f'[file.{name}]\npath = "run.h5"\n[file.{name}.columns.t]\nfrom = "{time}"\nunit = "s"\n'
        + entries(name, name, unit, f"file.{name}.columns")
        for name, time, unit in (("acc", "time", "m/s^2"), ("gyro", "time2", "deg/s"))
    )
    for files in (path, []):
        record = read(files, mapped(tmp_path / "map.toml", parts))
        np.testing.assert_array_equal(record["acc_x"].t, T)
        np.testing.assert_array_equal(record["gyro_z"].t, T[::2])
        np.testing.assert_array_equal(record.triad("gyro").values, GYRO)


def test_a_mapped_time_or_a_stated_rate_wins_over_the_clock_of_the_file(tmp_path):
    path = self_describing(tmp_path / "run.h5")
    acc = '[columns.acc_x]\nfrom = "imu/acc_x"\nunit = "m/s^2"\n'
    np.testing.assert_array_equal(read(path, mapped(tmp_path / "m.toml", acc))["acc_x"].t, T)
    record = read(path, mapped(tmp_path / "m.toml", acc + '[time]\nrate = "50 Hz"\n'))
    np.testing.assert_array_equal(record["acc_x"].t, np.arange(N) / 50)
    gyro = '[columns.gyro_x]\nfrom = "gyro_x"\nunit = "deg/s"\n'  # the end of the path is enough
    record = read(path, mapped(tmp_path / "m.toml", acc + gyro))
    assert (len(record["acc_x"].t), len(record["gyro_x"].t)) == (N, N // 2)
    with pytest.raises(RecordError, match=r"found columns of 60 and 120 rows, .* one rate is stated for all"):
        read(path, mapped(tmp_path / "m.toml", acc + gyro + '[time]\nrate = "50 Hz"\n'))
    own = '[columns.t]\nfrom = "imu/t_acc"\nunit = "ms"\n'
    record = read(path, mapped(tmp_path / "m.toml", own + acc + gyro))
    np.testing.assert_array_equal(record["acc_x"].t, T * 1e-3)
    np.testing.assert_array_equal(record["gyro_x"].t, T[::2])


def test_fields_of_compounds_labels_and_integers(tmp_path):
    table = np.zeros(5, dtype=[("stamp", "<i8"), ("ax", "<i2")])
    table["stamp"] = 10**6 * np.arange(5) + 2**60
    table["ax"] = [1, -2, 3, -4, 5]
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file["log/imu"] = table
        file["part"] = ["up", "up", "down", "größer", ""]
        file["part2"] = np.array([b"a", b"a", b"b", b"b", b"c"])
    text = (
        '[columns.t]\nfrom = "log/imu/stamp"\nunit = "ns"\n[columns.acc_x]\nfrom = "/log/imu/ax"\nunit = "count"\n'
        '[columns.label]\nfrom = "{}"\n'
    )
    record = read(path, mapped(tmp_path / "m.toml", text.format("part")))
    assert record.labels == ("up", "up", "down", "größer", "")
    np.testing.assert_allclose(np.diff(record["acc_x"].t), 1e-3, atol=3e-7)  # float64 at 1e9 s
    np.testing.assert_array_equal(record["acc_x"].values, table["ax"])
    assert read(path, mapped(tmp_path / "m.toml", text.format("part2"))).labels == ("a", "a", "b", "b", "c")
    with pytest.raises(RecordError, match="part holds text, expected numbers for acc_x"):
        read(path, mapped(tmp_path / "m.toml", text.replace("/log/imu/ax", "part").format("part")))
    with pytest.raises(MapError, match=r"found no 'nowhere' in .*the arrays log/imu/stamp \(5 x 1\)"):
        read(path, mapped(tmp_path / "m.toml", text.replace("/log/imu/ax", "nowhere").format("part")))


def test_what_is_no_number_is_nan_and_said(tmp_path):
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file["t"], file["acc_x"] = [0.0, 0.1, 0.2, 0.3], [1.0, np.inf, np.nan, 1.0]
        file["t"].attrs["unit"], file["acc_x"].attrs["unit"] = "s", np.bytes_("g")
    record = read(path)
    assert [(finding.code, finding.where) for finding in record.findings] == [("nan", "rows 2-3")]
    np.testing.assert_array_equal(record["acc_x"].values, [1.0, np.nan, np.nan, 1.0])
    with h5py.File(path, "a") as file:
        del file["acc_x"].attrs["unit"]
    with pytest.raises(RecordError, match="found 'acc_x' without a unit"):
        read(path)


def test_damaged_files_end_in_one_sentence(tmp_path):
    whole = self_describing(tmp_path / "run.h5").read_bytes()
    path = tmp_path / "cut.h5"
    for content in (b"", whole[:7], whole[:600], whole[: len(whole) // 2], b"junk" * 300):
        path.write_bytes(content)
        with pytest.raises(RecordError, match="cannot be read as an HDF5 file") as caught:
            read(path)
        assert "\n" not in str(caught.value)


def packed(create):
    """Accelerometers as CF packs them: integers with scale, offset and fill value, units with exponents."""
    counts = np.round(ACC[:, 0] / 1e-3).astype("i2")
    counts[4] = -32768
    t = create("time", T, ("time",))
    t.units = "seconds since 2024-05-01 00:00:00"
    acc = create("acc_x", counts, ("time",))
    acc.units, acc.scale_factor, acc.add_offset, acc._FillValue = "m s-2", 1e-3, 0.5, np.int16(-32768)
    temperature = create("temperature", 20.0 + T, ("time",))
    temperature.units = "degree_Celsius"
    return counts


def holds_packed(path, counts):
    record = read(path)
    np.testing.assert_allclose(np.delete(record["acc_x"].values, 4), np.delete(counts * 1e-3 + 0.5, 4))
    assert np.isnan(record["acc_x"].values[4])
    np.testing.assert_allclose(np.delete(record["acc_x"].si(), 4), np.delete(counts * 1e-3 + 0.5, 4))
    np.testing.assert_array_equal(record["acc_x"].t, T)
    assert record["temperature"].unit.symbol == "degC"
    return True


def test_classic_netcdf(tmp_path):
    path = tmp_path / "run.nc"
    with netcdf_file(path, "w") as file:
        file.createDimension("time", N)

        def create(name, values, dimensions):
            variable = file.createVariable(name, values.dtype, dimensions)
            variable[:] = values
            return variable

        counts = packed(create)
        del create
    assert holds_packed(path, counts)
    path.write_bytes(path.read_bytes()[:300])
    with pytest.raises(RecordError, match="cannot be read as a NetCDF file"):
        read(path)


class Attributes:
    """Attributes of an h5netcdf variable, set like those of SciPy's."""

    def __init__(self, variable):
        object.__setattr__(self, "attrs", variable.attrs)

    def __setattr__(self, key, value):
        self.attrs[key] = value


def test_a_channel_without_any_number_is_kept_beside_its_clock(tmp_path):
    """As an empty column of a text file is beside its stamps."""
    path = tmp_path / "run.nc"
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"time": N}
        time = file.create_variable("time", ("time",), data=T)
        time.attrs["units"] = "s"
        acc = file.create_variable("acc_x", ("time",), data=np.full(N, np.nan))
        acc.attrs["units"] = "g"
    text = '[columns.acc_x]\nfrom = "acc_x"\nunit = "g"\n'
    for record in (read(path), read(path, mapped(tmp_path / "m.toml", text))):
        assert np.isnan(record["acc_x"].values).all()
        np.testing.assert_array_equal(record["acc_x"].t, T)
        assert [f.message for f in record.findings] == [f"acc_x: {N} missing values"]


def test_netcdf_4(tmp_path):
    path = tmp_path / "run.nc"
    with h5netcdf.File(path, "w") as file:
        file.dimensions = {"time": N, "other": 3}

        def create(name, values, dimensions):
            return Attributes(file.create_variable(name, dimensions, data=values))

        counts = packed(create)
        file.create_variable("matrix", ("other", "other"), data=np.eye(3))
    assert holds_packed(path, counts)


def as_matlab(path, write):
    """A MAT v7.3 file: a user block of 512 bytes with MATLAB's header, then HDF5."""
    with h5py.File(path, "w", userblock_size=512) as file:
        write(file)
    header = (
        b"MATLAB 7.3 MAT-file, Platform: GLNXA64, Created on: Mon May 06 10:00:00 2024 HDF5 schema 1.00 ."
    )
    with path.open("r+b") as file:
        file.write(header.ljust(116) + bytes(8) + b"\x00\x02IM")
    return path


def variable(group, name, value):
    """A variable as MATLAB stores it: transposed, two-dimensional, with its class."""
    if isinstance(value, dict):
        group.create_group(name).attrs["MATLAB_class"] = np.bytes_("struct")
        for key, member in value.items():
            variable(group[name], key, member)
        return
    if isinstance(value, list):
        cells = [
            variable(group.file.require_group("#refs#"), f"{name}{k}", text) for k, text in enumerate(value)
        ]
        data = group.create_dataset(name, data=np.array([[cell.ref for cell in cells]], dtype=h5py.ref_dtype))
        data.attrs["MATLAB_class"] = np.bytes_("cell")
        return
    if isinstance(value, str):
        stored, kind = np.array([[ord(letter)] for letter in value], dtype="u2"), "char"
    else:
        stored, kind = np.atleast_2d(value).T, "double"
    data = group.create_dataset(name, data=stored)
    data.attrs["MATLAB_class"] = np.bytes_(kind)
    return data


def test_the_same_map_reads_v7_and_v7_3(tmp_path):
    """Matrices, rows, columns and structures; strings in cells are labels."""
    labels = ["up"] * (N // 2) + ["down"] * (N // 2)
    content = {"imu": {"acc": ACC, "time": T[:, None]}, "row": T[None, :], "temp": 20.0 + T[:, None]}
    text = (
        '[columns.t]\nfrom = "{}"\nunit = "s"\n[columns.temperature]\nfrom = "temp"\nunit = "degC"\n'
        '[columns.label]\nfrom = "part"\n' + entries("acc", "imu/acc", "m/s^2").replace("{", "{{")
    )
    v7 = tmp_path / "v7.mat"
    savemat(v7, {**content, "part": np.array(labels, dtype=object)[:, None], "note": "hand held"})

    def write(file):
        for name, value in {**content, "part": labels, "note": "hand held"}.items():
            variable(file, name, value)

    v73 = as_matlab(tmp_path / "v73.mat", write)
    for path in (v7, v73):
        for time in ("imu/time", "row"):
            record = read(path, mapped(tmp_path / "m.toml", text.format(time)))
            np.testing.assert_array_equal(record.triad("acc").values, ACC)
            np.testing.assert_array_equal(record["acc_x"].t, T)
            np.testing.assert_array_equal(record["temperature"].values, 20.0 + T)
            assert record.labels == tuple(labels)
    with pytest.raises(RecordError, match="a MAT file names no units, expected a column map"):
        read(v73)
    assert canonical_units([v73]) is None


def test_the_only_matrix_of_a_v7_3_file_needs_no_name(tmp_path):
    path = as_matlab(
        tmp_path / "a.mat",
        lambda file: variable(file, "data", np.column_stack([T, ACC])) and variable(file, "g", 9.8),
    )
    record_map = mapped(tmp_path / "guess.toml", guess_map(path))
    record = read(path, record_map)
    np.testing.assert_array_equal(record.triad("acc").values, ACC)
    np.testing.assert_array_equal(record["acc_x"].t, T)


@pytest.mark.parametrize("chunks", [None, (7, 2), (50_000, 4)])
def test_a_large_matrix_is_read_by_blocks(tmp_path, chunks):
    """Packed by the CF conventions, with a fill value, in one piece or in chunks: the numbers that were stored."""
    rng = np.random.default_rng(4)
    n = 70_001
    table = np.column_stack([np.arange(n), rng.integers(-30_000, 30_000, (n, 3))]).astype(np.int32)
    table[n // 2, 1] = -99_999
    path = tmp_path / "a.h5"
    with h5py.File(path, "w") as file:
        made = file.create_dataset("data", data=table, chunks=chunks, compression="gzip" if chunks else None)
        made.attrs["_FillValue"], made.attrs["scale_factor"] = np.int32(-99_999), 0.125
    text = '[columns.t]\nfrom = ["data", 0]\nunit = "ms"\n'
    for k, axis in enumerate("xyz", start=1):
        text += f'[columns.acc_{axis}]\nfrom = ["data", {k}]\nunit = "m/s^2"\n'
    record = read(path, mapped(tmp_path / "map.toml", text))
    wanted = np.where(table == -99_999, np.nan, 0.125 * table)
    np.testing.assert_allclose(record["acc_x"].t, 1e-3 * wanted[:, 0], rtol=1e-15)
    for k, axis in enumerate("xyz", start=1):
        np.testing.assert_array_equal(record[f"acc_{axis}"].values, wanted[:, k])
