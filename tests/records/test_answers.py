"""A map with a guess does not run until it is answered; what needs no map is recognised, and said."""

import json
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from test_recognise import ACC, GYRO, T, written

from inercal.cli import run
from inercal.foundation.errors import InputError, MapError
from inercal.foundation.records.maps import answers_of, read_map
from inercal.foundation.records.read import read
from inercal.foundation.records.recognise.map_text import guess_map, recognised
from rows import for_each

STILL = np.column_stack([T, 0.0123457 * GYRO])
SEEN = np.column_stack([T, ACC, GYRO])


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def still(folder):
    return written(folder / "still.csv", "time,gx,gy,gz\n", STILL)


@pytest.mark.slow
@for_each("command", [["allan"], ["temperature"], ["calibrate", "imu", "--latitude=48 deg"]])
def test_a_guess_is_refused_with_its_question_and_the_answer(tmp_path_factory, monkeypatch, capsys, command):
    """In one sentence, with a map or without one; what it names is an answer that is taken."""
    folder = tmp_path_factory.mktemp("a")
    monkeypatch.chdir(folder)
    still(folder)
    assert run(["new", "imu", "still.csv"]) == 0
    for more in ([], ["--map", "imu-map.toml"]):
        capsys.readouterr()
        assert run([*command, "still.csv", *more]) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert "Is the gyro in rad/s or deg/s?" in said
        assert '--answer "gyro=rad/s"' in said


@pytest.mark.slow
def test_an_answer_makes_a_guess_certain(folder, capsys):
    """By `new`, beside the map or without one: the same numbers; and inspect shows a guess as such."""
    still(folder)
    values = {}
    for unit in ("rad/s", "deg/s"):
        assert run(["new", "imu", "still.csv", "--answer", f"gyro={unit}", "--out", f"{unit[0]}.toml"]) == 0
        (folder / "sections.csv").unlink(missing_ok=True)
        assert run(["allan", "still.csv", "--map", f"{unit[0]}-map.toml", "--out", "by-map.json"]) != 2
        assert run(["allan", "still.csv", "--answer", f"gyro={unit}", "--out", "plain.json"]) != 2
        plain, by_map = (json.loads(Path(name).read_text("utf-8")) for name in ("plain.json", "by-map.json"))
        assert plain["parameters"] == by_map["parameters"]
        assert "certain" in plain["provenance"]["taken"]["gyro"]
        values[unit] = plain["parameters"][0]["value"]
    assert values["deg/s"] == pytest.approx(values["rad/s"] * np.pi / 180, rel=1e-6)
    capsys.readouterr()
    assert run(["inspect", "still.csv"]) == 0
    assert "in rad/s, guess:" in capsys.readouterr().err


def test_answers_leave_sensors_aside_and_name_what_is_there(tmp_path):
    path = written(tmp_path / "log.csv", "time,ax,ay,az,gx,gy,gz\n", SEEN)
    kept = tomllib.loads(guess_map(path, answers={"gyro": "none"}))["columns"]
    assert list(kept) == ["t", "acc_x", "acc_y", "acc_z"]
    with pytest.raises(InputError, match=r"--answer: found 'giro', expected one of acc, .*gyro, .*rate"):
        guess_map(path, answers={"giro": "deg/s"})
    with pytest.raises(InputError, match=r"gyro_x: found .g. .acceleration., expected a unit of rate"):
        guess_map(path, answers={"gyro": "g"})
    with pytest.raises(InputError, match="expected NAME=VALUE such as gyro=deg/s"):
        answers_of(["deg/s"])
    bare = written(tmp_path / "bare.csv", "ax,ay,az\n", ACC)
    assert recognised([bare], {"rate": "50 Hz"}).rate == 50.0


def test_an_edited_line_answers_too(tmp_path):
    still(tmp_path)
    text = guess_map(tmp_path / "still.csv")
    place = tmp_path / "map.toml"
    place.write_text(text)
    with pytest.raises(MapError, match="Is the gyro in"):
        read_map(place).refuse_guess()
    place.write_text(text.replace('grade = "guess"\n', "").replace("rad/s", "deg/s"))
    read_map(place).refuse_guess()
    assert read(tmp_path / "still.csv", place)["gyro_x"].unit.symbol == "deg/s"


def test_what_is_recognised_needs_no_map_and_no_study(folder, capsys):
    """The lines say what was taken for what; the same with the map that new writes."""
    written(folder / "log.csv", "time,ax,ay,az,gx,gy,gz\n", SEEN)
    assert run(["inspect", "log.csv"]) == 0
    said = capsys.readouterr().err
    assert 'acc: columns "ax", "ay", "az" in m/s^2, certain: ' in said
    assert 'gyro: columns "gx", "gy", "gz" in rad/s, certain: ' in said
    assert run(["new", "imu", "log.csv", "--set", "site.latitude=48 deg"]) == 0
    assert run(["calibrate", "imu", "log.csv", "--latitude", "48 deg", "--out", "plain.json"]) != 2
    assert (
        run(
            [
                "calibrate",
                "imu",
                "log.csv",
                "--map",
                "imu-map.toml",
                "--study",
                "imu.toml",
                "--out",
                "long.json",
            ]
        )
        != 2
    )
    plain, by_hand = (json.loads(Path(name).read_text("utf-8")) for name in ("plain.json", "long.json"))
    assert plain["status"] == by_hand["status"]
    assert plain["parameters"] == by_hand["parameters"]


def test_without_a_study_the_latitude_is_asked_for(folder, capsys):
    written(folder / "log.csv", "time,ax,ay,az,gx,gy,gz\n", SEEN)
    assert run(["calibrate", "imu", "log.csv"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert '--latitude: missing, expected it where there is no --study, such as "48 deg"' in said


@pytest.mark.slow
def test_a_result_without_a_map_is_run_again(folder, capsys):
    written(folder / "log.csv", "time,ax,ay,az,gx,gy,gz\n", SEEN)
    assert run(["store", "init", "--store", "kept"]) == 0
    command = [
        "allan",
        "log.csv",
        "--answer",
        "gyro=rad/s",
        "--keep",
        "--store",
        "kept",
        "--instrument",
        "A, B, 1",
    ]
    assert run([*command, "--out", "a.json"]) != 2
    capsys.readouterr()
    assert run(["results", "--store", "kept", "--json"]) == 0
    identity = re.search(r'"id": "(\w+)"', capsys.readouterr().out)[1]
    assert run(["rerun", identity, "--store", "kept"]) == 0, capsys.readouterr().err
