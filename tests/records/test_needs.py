"""Only what the wanted result needs is asked for; Python asks as commands do."""

from pathlib import Path

import numpy as np
import pytest
from test_recognise import ACC, GYRO, T, written

import inercal as ic
from inercal.cli import run
from inercal.foundation.errors import MapError

SIDES = {
    "x_up": (0, 1),
    "x_down": (0, -1),
    "y_up": (1, 1),
    "y_down": (1, -1),
    "z_up": (2, 1),
    "z_down": (2, -1),
}
STILL = np.column_stack([T, 0.0123457 * GYRO])


@pytest.fixture
def sides(tmp_path, monkeypatch):
    """Six sides with a gyro at rest whose unit nothing tells."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(4)
    for name, (axis, sign) in SIDES.items():
        acc = 9.81 * sign * np.eye(3)[axis] + [0.05, -0.02, 0.1] + 0.01 * rng.standard_normal((300, 3))
        rows = np.column_stack([T[:300], acc, 0.01 * rng.standard_normal((300, 3))])
        written(tmp_path / f"{name}.csv", "time,ax,ay,az,gx,gy,gz\n", rows)
    return [f"{name}.csv" for name in SIDES]


@pytest.mark.slow
def test_sides_need_no_unit_of_the_gyro(sides, capsys):
    """Without a study and with one; an answer gives its biases, and turns are still asked for."""
    assert run(["calibrate", "imu", *sides, "--latitude", "48 deg", "--out", "plain.json"]) == 0
    said = capsys.readouterr()
    assert "gyro: left aside" in said.err
    assert "K1_x" in said.out
    assert "D_F_x" not in said.out
    assert run(["new", "imu", *sides, "--set", "site.latitude=48 deg"]) == 0
    assert run(["calibrate", "imu", *sides, "--study", "imu.toml", "--map", "imu-map.toml"]) == 0
    command = ["calibrate", "imu", *sides, "--latitude", "48 deg", "--answer", "gyro=deg/s"]
    assert run(command) == 0
    assert "D_F_x" in capsys.readouterr().out
    table = Path("sections.csv")
    table.write_text(table.read_text("utf-8").replace(",rest,+x", ",turn,+x", 1), "utf-8")
    assert run(["calibrate", "imu", *sides, "--study", "imu.toml", "--map", "imu-map.toml"]) == 2
    assert "Is the gyro in" in capsys.readouterr().err


def test_python_recognises_and_refuses_a_guess(tmp_path):
    path = written(tmp_path / "log.csv", "time,ax,ay,az,gx,gy,gz\n", np.column_stack([T, ACC, GYRO]))
    record = ic.read(path)
    np.testing.assert_allclose(record["gyro_y"].si(), GYRO[:, 1], rtol=1e-6, atol=1e-8)
    assert "certain" in record.taken["acc"]
    still = written(tmp_path / "still.csv", "time,gx,gy,gz\n", STILL)
    with pytest.raises(MapError, match="Is the gyro in rad/s or deg/s"):
        ic.read(still)
    assert ic.read(still, answers={"gyro": "deg/s"})["gyro_x"].unit.symbol == "deg/s"
