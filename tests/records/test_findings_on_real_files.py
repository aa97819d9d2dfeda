"""Real recordings, as they are and with one flaw put in: that flaw is said, with its place, and nothing else."""

import gzip
import shutil
import zlib
from dataclasses import dataclass

import numpy as np
import pytest
from scipy.io import loadmat, savemat

from inercal.examples import EXAMPLES, FOLDER
from inercal.foundation.records.read import read, read_runs

XSENS_MAP = (FOLDER / "xsens-map.toml").read_text("utf-8")

THERMAL_MAP = "".join(
    f'[columns.{name}]\nfrom = "{origin}"\nunit = "{unit}"\n'
    for name, origin, unit in [
        ("t", "timestamp", "ns"),
        *((f"gyro_{axis}", f"imu.gyro.{axis}", "rad/s") for axis in "xyz"),
        *((f"acc_{axis}", f"imu.acc.{axis}", "m/s^2") for axis in "xyz"),
        ("temperature", "imu.temperature", "degC"),
    ]
)


@dataclass
class Text:
    """A compressed text file of the package: ``first`` is the number of its first line of data."""

    name: str
    map: str
    first: int
    delimiter: str | None

    def lines(self):
        with gzip.open(FOLDER / self.name, "rt", encoding="utf-8") as file:
            return file.read().splitlines()

    def read(self, folder, lines, record_map=None):
        with gzip.open(folder / self.name, "wt", encoding="utf-8", compresslevel=1) as file:
            file.write("\n".join(lines) + "\n")
        return self.mapped(folder, record_map)

    def mapped(self, folder, record_map=None):
        (folder / "map.toml").write_text(self.map if record_map is None else record_map, "utf-8")
        return read(folder / self.name, folder / "map.toml")


MPU = Text("mpu6050.csv.gz", (FOLDER / "mpu6050-map.toml").read_text("utf-8"), 6, ",")
LASER = Text("lasergyro.txt.gz", (FOLDER / "lasergyro-map.toml").read_text("utf-8"), 15, None)
THERMAL = Text("thermal.csv.gz", THERMAL_MAP, 2, "\t")
TEXTS = [MPU, LASER, THERMAL]

#: what is true of the MPU-6050 recording: turned by hand past its range of 250 deg/s, and knocked
OF_MPU = {
    ("outlier", "acc_x", "rows 6588, 7196"),
    ("outlier", "acc_y", "rows 6783, 7386"),
    ("saturation", "gyro_x", "rows 6663-6672"),
    ("saturation", "gyro_z", "rows 8767-8772"),
}


def said(record):
    return {
        (f.code, f.message.partition(":")[0] if ":" in f.message else "", f.where) for f in record.findings
    }


def with_field(recording, lines, row, column, value):
    """A line with another text in a column; rows from 1."""
    index = recording.first + row - 2
    fields = lines[index].split(recording.delimiter)
    fields[column] = value(fields[column])
    lines[index] = (recording.delimiter or " ").join(fields)
    return lines


#: what is true of the others: sections of a labelled session in another order than taken, and single knocks
OF_FERRARIS = {
    ("backward_time", "t", "rows 1062, 3395, 4243 and 2 more"),
    ("gap", "t", "rows 2089-2090, 4976-4977, 7994-7995"),
    ("outlier", "acc_y", "row 5053"),
    ("outlier", "acc_z", "row 5053"),
    ("outlier", "gyro_x", "row 5052"),
    ("outlier", "gyro_y", "row 5053"),
}
#: by the contract of these records: rates act to the next row, and accelerometers are not used at the start
OF_SELFCAL = {
    ("nan", f"{sensor}_{axis}", where)
    for sensor, where in (("wc", "line 2702"), ("acc", "line 2"))
    for axis in "xyz"
}
TRUE_OF = {
    "mpu6050": OF_MPU,
    "ferraris": OF_FERRARIS,
    "ferraris-si": {("outlier", "acc_y", "row 7685")},
    "selfcal": OF_SELFCAL,
}


@pytest.mark.parametrize("example", EXAMPLES.values(), ids=EXAMPLES)
def test_recordings_as_they_are(example):
    record_map = FOLDER / example.map if example.map else None
    records = read_runs([FOLDER / name for name in example.records], record_map)
    assert all(said(record) == TRUE_OF.get(example.name, set()) for record in records)


def test_stamps_as_they_are(tmp_path):
    shutil.copy(FOLDER / THERMAL.name, tmp_path)
    assert said(THERMAL.mapped(tmp_path)) == set()


@pytest.mark.parametrize("recording", TEXTS, ids=["mpu", "laser", "thermal"])
class TestAnyText:
    """Flaws that every text file may have, in the column of a gyro axis."""

    ROW = 5000

    def gyro(self, recording):
        return {MPU.name: 3, LASER.name: 0, THERMAL.name: 1}[recording.name]

    def expect(self, recording, record, *flaw):
        assert said(record) == (OF_MPU if recording is MPU else set()) | {flaw}

    def test_an_empty_value(self, recording, tmp_path):
        lines = with_field(recording, recording.lines(), self.ROW, self.gyro(recording), lambda _: "nan")
        name = "gyro_x"
        line = f"line {self.ROW + recording.first - 1}"
        self.expect(recording, recording.read(tmp_path, lines), "nan", name, line)

    @pytest.mark.parametrize("junk", ["12.5abc", "0x1F", "--"])
    def test_a_value_that_is_no_number(self, recording, junk, tmp_path):
        lines = with_field(recording, recording.lines(), self.ROW, self.gyro(recording), lambda _: junk)
        line = f"line {self.ROW + recording.first - 1}"
        self.expect(recording, recording.read(tmp_path, lines), "bad_row", "", line)

    def test_a_row_with_a_field_too_few(self, recording, tmp_path):
        lines = recording.lines()
        index = recording.first + self.ROW - 2
        fields = lines[index].split(recording.delimiter)
        lines[index] = (recording.delimiter or " ").join(fields[:-1])
        self.expect(recording, recording.read(tmp_path, lines), "bad_row", "", f"line {index + 1}")

    def test_a_file_that_ends_within_a_row(self, recording, tmp_path):
        lines = recording.lines()
        lines[-1] = (recording.delimiter or " ").join(lines[-1].split(recording.delimiter)[:-2])
        with gzip.open(tmp_path / recording.name, "wt", encoding="utf-8", compresslevel=1) as file:
            file.write("\n".join(lines))
        self.expect(recording, recording.mapped(tmp_path), "truncated", "", f"line {len(lines)}")

    def test_a_compressed_file_that_ends_too_soon(self, recording, tmp_path):
        data = (FOLDER / recording.name).read_bytes()[:-2000]
        (tmp_path / recording.name).write_bytes(data)
        line = zlib.decompressobj(31).decompress(data).count(b"\n") + 1
        found = said(recording.mapped(tmp_path))
        assert ("truncated", "", f"line {line}") in found
        assert {code for code, *_ in found} <= {
            "truncated",
            *(code for code, *_ in OF_MPU if recording is MPU),
        }

    def test_a_spike(self, recording, tmp_path):
        lines = with_field(recording, recording.lines(), self.ROW, self.gyro(recording), lambda old: "25000")
        self.expect(recording, recording.read(tmp_path, lines), "outlier", "gyro_x", f"row {self.ROW}")


class TestStamps:
    """Flaws of the time, in the recording with stamps of its own (nanoseconds, 0.5 ms apart)."""

    def stamped(self, tmp_path, change):
        lines = THERMAL.lines()
        t = np.array([int(line.split("\t", 1)[0]) for line in lines[1:]])
        rest = [line.split("\t", 1)[1] for line in lines[1:]]
        t, kept = change(t)
        return THERMAL.read(tmp_path, [lines[0], *(f"{a}\t{rest[k]}" for a, k in zip(t, kept, strict=True))])

    def test_lost_rows_are_a_gap(self, tmp_path):
        def lose(t):
            kept = np.r_[:3000, 3040 : len(t)]
            return t[kept], kept

        assert said(self.stamped(tmp_path, lose)) == {("gap", "t", "rows 3000-3001")}

    @pytest.mark.parametrize("count", [1, 3])
    def test_a_repeated_stamp_is_no_gap_besides(self, count, tmp_path):
        def repeat(t):
            t[3000 : 3000 + count] = t[2999]
            return t, range(len(t))

        where = "row 3001" if count == 1 else "rows 3001-3003"
        assert said(self.stamped(tmp_path, repeat)) == {("duplicate_time", "t", where)}

    def test_a_row_written_twice(self, tmp_path):
        def repeat(t):
            kept = np.r_[:3000, 2999, 3000 : len(t)]
            return t[kept], kept

        assert said(self.stamped(tmp_path, repeat)) == {("duplicate_time", "t", "row 3001")}

    @pytest.mark.parametrize("off", [-200_000_000, 200_000_000])
    def test_a_wrong_stamp_is_set_aside(self, off, tmp_path):
        def wrong(t):
            t[3000] += off
            return t, range(len(t))

        assert said(self.stamped(tmp_path, wrong)) == {("outlying_time", "t", "row 3001")}

    def test_a_clock_set_back(self, tmp_path):
        def back(t):
            t[3000:] -= 3_000_000_000
            return t, range(len(t))

        assert said(self.stamped(tmp_path, back)) == {("backward_time", "t", "row 3001")}

    def test_a_change_of_rate(self, tmp_path):
        def half(t):
            kept = np.r_[:4200, 4200 : len(t) : 2]
            return t[kept], kept

        ((code, subject, where),) = said(self.stamped(tmp_path, half))
        assert (code, subject) == ("rate_change", "t")
        first, last = map(int, where.removeprefix("rows ").split("-"))
        assert first <= 4201 <= last
        assert last - first < 500

    def test_rows_in_the_wrong_order(self, tmp_path):
        def swap(t):
            kept = np.arange(len(t))
            kept[[3000, 3001]] = [3001, 3000]
            return t[kept], kept

        assert said(self.stamped(tmp_path, swap)) == {("backward_time", "t", "row 3002")}


@pytest.mark.parametrize(
    ("recording", "old", "new", "looks"),
    [
        (THERMAL, '"m/s^2"', '"g"', "looks like m/s^2"),
        (THERMAL, '"ns"', '"ms"', "taken for s"),
        (LASER, "1.222540875e-3", "1.25e-4", "m/s^2 looks like g"),
    ],
    ids=["gravity", "stamps", "scale"],
)
def test_a_wrong_unit(recording, old, new, looks, tmp_path):
    shutil.copy(FOLDER / recording.name, tmp_path)
    assert old in recording.map
    record = recording.mapped(tmp_path, recording.map.replace(old, new))
    assert [finding.code for finding in record.findings] == ["unit_suspect"]
    assert looks in record.findings[0].message


class TestMat:
    """The recording of two MAT files, one array each: time and three axes of counts."""

    @pytest.fixture
    def flawed(self, tmp_path):
        def flawed(name, change):
            for file in ("xsens_acc.mat", "xsens_gyro.mat"):
                arrays = {key: array for key, array in loadmat(FOLDER / file).items() if key[0] != "_"}
                ((key, table),) = arrays.items()
                savemat(tmp_path / file, {key: change(table.copy()) if file == name else table})
            (tmp_path / "map.toml").write_text(XSENS_MAP, "utf-8")
            return said(
                read([tmp_path / "xsens_acc.mat", tmp_path / "xsens_gyro.mat"], tmp_path / "map.toml")
            )

        return flawed

    def test_as_it_is(self, flawed):
        assert flawed("", None) == set()

    def test_lost_rows(self, flawed):
        lost = flawed("xsens_acc.mat", lambda table: np.delete(table, np.s_[20_000:20_050], axis=0))
        assert lost == {("gap", "t of xsens_acc.mat", "rows 20000-20001")}

    def test_missing_values(self, flawed):
        def lose(table):
            table[[999, 4999], 2] = np.nan
            return table

        assert flawed("xsens_gyro.mat", lose) == {("nan", "gyro_y", "xsens_gyro.mat, rows 1000, 5000")}

    def test_a_range_too_small(self, flawed):
        """Turns by hand, cut off at 80 % of the largest rate."""
        whole = loadmat(FOLDER / "xsens_gyro.mat")
        (table,) = (array for key, array in whole.items() if key[0] != "_")
        middle = np.median(table[:, 1])
        limit = middle + 0.8 * (table[:, 1].max() - middle)
        beyond = np.flatnonzero(table[:, 1] >= limit) + 1

        def clip(table):
            table[:, 1] = np.minimum(table[:, 1], limit)
            return table

        ((code, name, where),) = flawed("xsens_gyro.mat", clip)
        assert (code, name) == ("saturation", "gyro_x")
        first = int(where.removeprefix("rows ").split("-")[0])
        assert first in beyond

    def test_a_wrong_bit(self, flawed):
        def flip(table):
            table[2999, 1] += 2**14
            return table

        assert flawed("xsens_acc.mat", flip) == {("outlier", "acc_x", "row 3000")}

    def test_a_change_of_rate(self, flawed):
        """From row 25001 on pairs of rows are averaged."""

        def slow(table):
            return np.vstack(
                [table[:25_000], table[25_000 : len(table) // 2 * 2].reshape(-1, 2, 4).mean(axis=1)]
            )

        found = flawed("xsens_gyro.mat", slow)
        assert [(code, subject) for code, subject, _ in found] == [("rate_change", "t of xsens_gyro.mat")]
