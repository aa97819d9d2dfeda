"""Sentences of receivers, JSON as one document, logs with scales, files on their side, clocks of several kinds.

What was recognised is read again by the map, to the same values.
"""

import gzip
import json

import numpy as np
import pytest
from line_variants import ACC, GYRO, T

import inercal as ic
from inercal.foundation.errors import RecordError
from inercal.foundation.records.maps import read_map
from inercal.foundation.records.read import read
from inercal.foundation.records.recognise.map_text import guess_map
from rows import for_each

COUNTS = np.round(np.hstack([1000 * ACC, 2000 * GYRO]))


def again(paths, folder, **how):
    """What a map of these files reads."""
    place = folder / "map.toml"
    place.write_text(guess_map(paths, **how), encoding="utf-8")
    read_map(place).refuse_guess()
    return read(paths, place)


def check(record, size=1.0):
    for sensor, truth in (("acc", ACC), ("gyro", GYRO)):
        for k, axis in enumerate("xyz"):
            np.testing.assert_allclose(record[f"{sensor}_{axis}"].si(), truth[:, k] * size, atol=2e-5)


@for_each("word", ["RAWIMUA", "RAWIMUSA", "RAWIMUXA", "RAWIMUSXA"])
def test_sentences_of_novatel(tmp_path_factory, word):
    """The axes go z, -y, x; the second is reversed by the map."""
    folder = tmp_path_factory.mktemp("a")
    lines = []
    for t, row in zip(T, COUNTS.astype(int), strict=True):
        ax, ay, az, gx, gy, gz = row
        info = "00,5," if "X" in word else ""
        mark = "%" if "S" in word else "#"
        data = f"{info}2260,{172800 + t:.3f},00000077,{az},{-ay},{ax},{gz},{-gy},{gx}"
        lines.append(
            f"{mark}{word},COM1,0,81.5,FINESTEERING,2260,{172800 + t:.3f},02000020,3fd1,16809;{data}*d8bf93fa"
        )
    path = folder / "log.asc"
    path.write_text("\n".join(lines) + "\n")
    record = again(path, folder)
    for name, column in zip(("acc_x", "acc_y", "acc_z", "gyro_x", "gyro_y", "gyro_z"), COUNTS.T, strict=True):
        np.testing.assert_array_equal(record[name].values, column)
        np.testing.assert_allclose(record[name].t - record[name].t[0], T, atol=1e-6)


def objects():
    return [
        {"t": t, "acc": dict(zip("xyz", a, strict=True)), "gyro": dict(zip("xyz", g, strict=True))}
        for t, a, g in zip(T.tolist(), ACC.tolist(), GYRO.tolist(), strict=True)
    ]


def columns():
    return {
        "time": T.tolist(),
        **{f"a{axis}": ACC[:, k].tolist() for k, axis in enumerate("xyz")},
        **{f"g{axis}": GYRO[:, k].tolist() for k, axis in enumerate("xyz")},
    }


@for_each(
    ("name", "text"),
    [
        ("one-line.json", json.dumps(objects())),
        ("pretty.json", json.dumps(objects(), indent=2)),
        ("columns.json", json.dumps(columns())),
        ("nested.json", json.dumps({"device": "x", "data": columns()}, indent=1)),
        ("samples.json", json.dumps({"meta": {"fs": 50}, "samples": objects()})),
        ("one-line.txt", json.dumps(objects())),
        ("columns.log", json.dumps(columns(), indent=1)),
        ("lines.json", "\n".join(json.dumps(row) for row in objects())),
    ],
)
def test_json_as_one_document(tmp_path_factory, name, text):
    folder = tmp_path_factory.mktemp("a")
    path = folder / name
    path.write_text(text + "\n")
    record = again(path, folder)
    check(record)
    np.testing.assert_allclose(record["acc_x"].t, T, atol=1e-9)


@for_each("text", ['[{"a": 1}, {"a":', '{"a": 1}', "[]", "[[1,2],[3]]", '{"x": "y"', "[" * 5000])
def test_json_that_holds_no_rows_is_refused(tmp_path_factory, text):
    path = tmp_path_factory.mktemp("a") / "log.json"
    path.write_text(text)
    with pytest.raises(RecordError):
        guess_map(path)


GCSV = (
    "GYROFLOW IMU LOG\nversion,1.3\nid,custom_logger\norientation,YxZ\nnote,test\nfwversion,FIRMWARE\n"
    "timestamp,1644159993\nvendor,x\nvideofilename,a.mp4\ntscale,0.001\ngscale,0.0005\nascale,0.0001\nt,gx,gy,gz,ax,ay,az\n"
)


def test_a_log_of_gyroflow_has_the_scales_it_states(tmp_path):
    rows = np.column_stack([1000 * T, GYRO / 0.0005, ACC / 9.80665 / 0.0001]).round().astype(int)
    path = tmp_path / "log.gcsv"
    path.write_text(GCSV + "\n".join(",".join(map(str, row)) for row in rows) + "\n")
    record = again(path, tmp_path)
    for sensor, truth in (("acc", ACC), ("gyro", GYRO)):
        for k, axis in enumerate("xyz"):
            np.testing.assert_allclose(record[f"{sensor}_{axis}"].si(), truth[:, k], atol=1e-3)
    np.testing.assert_allclose(record["acc_x"].t, T, atol=1e-3)


@for_each("named", [True, False])
def test_a_text_on_its_side(tmp_path_factory, named):
    folder = tmp_path_factory.mktemp("a")
    path = folder / "wide.csv"
    names = ["time", *(f"{s}{axis}" for s in "ag" for axis in "xyz")]
    lines = [
        ",".join([*([name] if named else []), *(f"{value:.9g}" for value in row)])
        for name, row in zip(names, [T, *ACC.T, *GYRO.T], strict=True)
    ]
    path.write_text("\n".join(lines) + "\n")
    check(again(path, folder))


def test_files_with_stamps_of_different_kinds(tmp_path):
    """One in words, one a counter that falls to zero: each is read as it says, with one map."""
    acc, gyro = tmp_path / "acc.csv", tmp_path / "gyro.csv"
    moments = np.datetime64("2026-05-04T10:20:30.000") + np.round(1000 * T).astype("timedelta64[ms]")
    lines = [",".join([str(m), *(f"{x:.6f}" for x in row)]) for m, row in zip(moments, ACC, strict=True)]
    acc.write_text("time,ax,ay,az\n" + "\n".join(lines) + "\n")
    ticks = (60_000 + 20 * np.arange(len(T))) % 2**16
    lines = [",".join([str(k), *(f"{x:.7f}" for x in row)]) for k, row in zip(ticks, GYRO, strict=True)]
    gyro.write_text("time_ms,gx,gy,gz\n" + "\n".join(lines) + "\n")
    record = again([acc, gyro], tmp_path, answers={"gyro": "rad/s"})
    for sensor, truth in (("acc", ACC), ("gyro", GYRO)):
        np.testing.assert_allclose(record.triad(sensor).t - record.triad(sensor).t[0], T, atol=1e-6)
        np.testing.assert_allclose(record.triad(sensor).values, truth, atol=1e-5)


def test_a_scalar_of_a_mat_file_is_its_rate(tmp_path):
    import scipy.io

    scipy.io.savemat(tmp_path / "log.mat", {"Fs": 50.0, "acc": ACC, "gyr": np.radians(np.degrees(GYRO))})
    record = again(tmp_path / "log.mat", tmp_path)
    np.testing.assert_allclose(record["acc_x"].t, T, atol=1e-9)
    assert record.rate_u == pytest.approx(0.01)


def test_packed_text_and_python_read_the_same(tmp_path):
    head = "time,ax,ay,az,gx,gy,gz\n"
    body = "\n".join(",".join(f"{x:.8g}" for x in row) for row in np.column_stack([T, ACC, GYRO]))
    with gzip.open(tmp_path / "log.csv.gz", "wt") as file:
        file.write(head + body + "\n")
    check(ic.read(tmp_path / "log.csv.gz"))
