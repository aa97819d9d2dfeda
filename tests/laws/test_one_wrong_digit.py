"""One wrong digit in a stamp, in a file and in a stream of each command: all ends as without its row."""

import json

import pytest

import inercal as ic
from inercal.cli import run
from inercal.examples import FOLDER
from inercal.foundation.records.write import write_record

ROW = 200

#: example -> command, rows that are taken, and whether the row is used all the same, for its time is not needed
FILES = {
    "mpu6050": (["calibrate", "imu"], None, False), "ferraris-si": (["calibrate", "imu"], None, True),
    "tumble": (["calibrate", "turntable"], None, True), "thermal": (["temperature"], None, True),
    "lasergyro": (["allan"], 20_000, False), "selfcal": (["selfcal"], None, False), "sting": (["aoa"], 2000, False),
    "table": (["calibrate", "imu"], 12_000, False),
}  # fmt: skip


def lines_of(example, rows, folder):
    """Lines of the recording of an example, the titles first, and the words of its study."""
    (path,) = (each for each in FOLDER.glob(f"{example}.*") if each.suffix not in (".toml", ".txt"))
    record_map, study = FOLDER / f"{example}-map.toml", FOLDER / f"{example}.toml"
    write_record(ic.read(path, record_map if record_map.exists() else None), folder / "whole.csv")
    lines = (folder / "whole.csv").read_text().splitlines(keepends=True)
    return lines[: rows and rows + 1], (["--study", str(study)] if study.exists() else [])


def wrong(lines, row=ROW):
    """Lines in which the stamp of a row (from 1) has a 9 before it."""
    return [*lines[:row], "9" + lines[row].lstrip("-"), *lines[row + 1 :]]


def without(lines, row=ROW):
    return lines[:row] + lines[row + 1 :]


@pytest.mark.parametrize("example", list(FILES))
def test_in_a_file(example, tmp_path, capsys):
    command, rows, used = FILES[example]
    lines, study = lines_of(example, rows, tmp_path)
    assert lines[0].startswith("t [s],")
    found = []
    for each in (lines if used else without(lines), wrong(lines)):
        (tmp_path / "log.csv").write_text("".join(each))
        capsys.readouterr()
        code = run([*command, str(tmp_path / "log.csv"), *study, "--json", "--quiet"])
        found.append((code, json.loads(capsys.readouterr().out)))
    (code, sound), (other_code, other) = found
    assert (other_code, other["status"]["code"]) == (code, sound["status"]["code"])
    assert [each["where"] for each in other["findings"] if each["code"] == "outlying_time"] == [f"row {ROW}"]
    assert len(sound["parameters"]) == len(other["parameters"]) > 0
    for one, two in zip(sound["parameters"], other["parameters"], strict=True):
        assert abs(two["value"] - one["value"]) <= 1e-6 * one["u"], one["name"]


STREAMS = {
    "aoa": ("sting", 600),
    "selfcal": ("selfcal", 400),
    "apply": ("tumble", 400),
    "monitor": ("mpu6050", 600),
}


@pytest.fixture(scope="module")
def calibration(tmp_path_factory):
    """A calibration of what the tumble test has recorded."""
    folder = tmp_path_factory.mktemp("tumble")
    _, study = lines_of("tumble", None, folder)
    out = str(folder / "cal.json")
    assert run(["calibrate", "turntable", str(folder / "whole.csv"), *study, "--out", out, "--quiet"]) == 0
    return out


@pytest.mark.parametrize("command", list(STREAMS))
@pytest.mark.parametrize("row", [1, ROW, -1])
def test_in_a_stream(command, row, calibration, tmp_path, capsys):
    """That row's line, if it has one, is without a time."""
    example, rows = STREAMS[command]
    lines, study = lines_of(example, rows, tmp_path)
    row %= rows + 1
    log = str(tmp_path / "log.csv")
    words = {"apply": [calibration, log, "--stream"], "monitor": [log]}.get(
        command, [log, *study, "--stream"]
    )
    found = []
    for each in (without(lines, row), wrong(lines, row)):
        (tmp_path / "log.csv").write_text("".join(each))
        capsys.readouterr()
        assert run([command, *words]) == 0
        found.append(capsys.readouterr())
    sound, other = found
    assert [line for line in other.out.splitlines() if line[0] != ","] == sound.out.splitlines()
    assert other.err.count("outlying_time") == 1
    assert f"line {row + 1}" in other.err
