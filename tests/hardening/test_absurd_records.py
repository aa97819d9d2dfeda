"""Records that can be read and make no sense: a verdict or one sentence, never a traceback, never NaN."""

import json
import math
from pathlib import Path

import numpy as np
import pytest
from new_studies import FILL

from inercal.cli import run

LOG = "t [s],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2],gyro_x [deg/s],gyro_y [deg/s],gyro_z [deg/s]"
MODEL = "t [s],a1 [g],a2 [g],a3 [g],gyro [deg/s],theta_ref [deg]"
PLATFORM = (
    "t [s],wc_x [deg/h],wc_y [deg/h],wc_z [deg/h],th_x [deg],th_y [deg],th_z [deg],"
    "acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2]"
)
ROWS = 70
RESTS = [[f"{begin} s", f"{begin + 1.0} s"] for begin in (0.0, 1.2, 2.4, 3.6, 4.8)]


def columns(name: str) -> np.ndarray:
    """A plausible record (n, 1 + columns): time at 10 Hz, noise of size 1; of a table its angles in steps of 30°."""
    rng = np.random.default_rng(5)
    noise = rng.standard_normal((ROWS, HEADS[name].count(",")))
    if name == "table.csv":
        noise[:, 0] = np.arange(ROWS) + 1.0
        noise[:, 1:3] = 30.0 * rng.integers(0, 12, (ROWS, 2))
    return np.column_stack([np.arange(ROWS) / 10.0, noise])


def scaled(factor):
    def spoil(x):
        with np.errstate(over="ignore"):
            x[:, 1:] = np.clip(x[:, 1:] * factor, -1.7e308, 1.7e308)
        return x

    return spoil


def timed(change):
    def spoil(x):
        x[:, 0] = change(x[:, 0])
        return x

    return spoil


def filled(value):
    def spoil(x):
        x[:, 1:] = value
        return x

    return spoil


def one(value):
    def spoil(x):
        x[ROWS // 2, 1:] = value
        return x

    return spoil


def cauchy(x):
    rng = np.random.default_rng(7)
    x[:, 1:] = rng.standard_cauchy(x[:, 1:].shape) * 10.0 ** rng.uniform(-100.0, 100.0, x[:, 1:].shape)
    return x


def alternating(x):
    x[:, 1:] = 1e3 * (-1.0) ** np.arange(ROWS)[:, None]
    return x


def holes(x):
    lost = np.random.default_rng(9).random(x.shape) < 0.5
    return np.where(lost & (np.arange(x.shape[1]) > 0), np.nan, x)


SPOILED = {
    "header": lambda x: x[:0],
    "one row": lambda x: x[:1],
    "two rows": lambda x: x[:2],
    "all missing": filled(np.nan),
    "zero": filled(0.0),
    "largest": filled(1.7e308),
    "1e29": scaled(1e29),
    "1e155": scaled(1e155),
    "1e-200": scaled(1e-200),
    "one of 1e160": one(1e160),
    "one of 1e29": one(1e29),
    "cauchy": cauchy,
    "alternating": alternating,
    "holes": holes,
    "backward": timed(lambda t: -t),
    "no time goes on": timed(lambda t: 0.0 * t),
    "no stamps": timed(lambda t: np.nan * t),
    "nanoseconds": timed(lambda t: 1e-9 * t),
    "1e-300 s": timed(lambda t: 1e-300 * t),
    "1e300 s": timed(lambda t: 1e300 * t),
    "days": timed(lambda t: 86400.0 * t),
    "1e15 s later": timed(lambda t: t + 1e15),
    "doubling": timed(lambda t: 1.5 ** np.arange(ROWS)),
    "jump": timed(lambda t: np.where(t > 6.0, t + 1e12, t)),
}  # fmt: skip

COMMANDS = {
    "log.csv": [
        "inspect log.csv", "allan log.csv", "apply cal.json log.csv --out NEW.csv", "monitor log.csv",
        "apply cal.json log.csv --stream", "calibrate imu log.csv --study imu.toml", "temperature log.csv",
        "new imu log.csv --out NEW.toml",
    ],
    "model.csv": ["aoa model.csv --study aoa.toml", "aoa model.csv --study aoa.toml --static improved",
                  "aoa model.csv --study aoa.toml --stream", "inspect model.csv"],
    "unit.csv": ["calibrate strapdown unit.csv --study strapdown.toml"],
    "table.csv": ["calibrate turntable table.csv --study turntable.toml"],
    "platform.csv": [f"selfcal platform.csv --study selfcal.toml --filter {kind}" for kind in ("error-state", "map")]
    + ["selfcal platform.csv --study selfcal.toml --stream"],
}  # fmt: skip
TABLE = "t [s],position [1],phi1 [deg],phi2 [deg],y_x [deg/h]"
HEADS = {"log.csv": LOG, "unit.csv": LOG, "model.csv": MODEL, "table.csv": TABLE, "platform.csv": PLATFORM}


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("absurd")
    for kind in ("imu", "strapdown", "turntable", "selfcal", "aoa"):
        more = ["--set", f"rests.list={RESTS}"] if kind == "strapdown" else []
        assert run(["new", kind, "--out", str(path / f"{kind}.toml"), "--quiet", *FILL, *more]) == 0
    names = [f"{name}_{axis}" for name in ("K1", "S") for axis in "xyz"]
    whole = {
        "command": "calibrate imu",
        "status": {"code": "ok", "message": ""},
        "parameters": [{"name": name, "value": 1.0, "u": 0.1, "unit": "1"} for name in names],
        "covariance": {"names": names, "matrix": np.eye(6).tolist()},
        "result": {"unit": {"acc": "m/s^2", "gyro": "deg/s"}},
    }
    (path / "cal.json").write_text(json.dumps(whole))
    return path


def no_number(text: str):
    raise AssertionError(f"{text} is not JSON")


def check(words: list[str], capsys) -> None:
    """Run a command; what it says and its exit code keep the contract."""
    streaming = "--stream" in words or words[0] == "monitor"
    code = run(words if streaming else [*words, "--json"])
    out, err = capsys.readouterr()
    assert "a fault of inercal's own" not in err, err
    assert "not enough memory" not in err, err
    if code == 2:
        last = err.splitlines()[-1]
        assert last.startswith("inercal: error: ")
        assert streaming or (out == "" and err.count("\n") == 1), err
        return
    assert code in (0, 1)
    if streaming:
        assert not {"nan", "inf", "-inf"} & set(out.replace("\n", ",").split(","))
        return
    data = json.loads(out, parse_constant=no_number)
    assert (data["status"]["code"] == "ok") == (code == 0)
    if code == 0 and words[0] in ("calibrate", "selfcal"):
        assert all(math.isfinite(p["value"]) and p["u"] > 0.0 for p in data["parameters"])


RARE = {
    "two rows",
    "zero",
    "1e155",
    "1e-200",
    "one of 1e160",
    "no stamps",
    "1e-300 s",
    "1e300 s",
    "days",
    "doubling",
}
"""Like another of them; campaigns have these too."""


@pytest.mark.slow
@pytest.mark.parametrize(
    "spoiled", [pytest.param(each, marks=pytest.mark.campaign) if each in RARE else each for each in SPOILED]
)
@pytest.mark.parametrize("name", COMMANDS)
@pytest.mark.parametrize("turn", [0, pytest.param(1, marks=pytest.mark.campaign)])
def test_a_verdict_or_one_sentence(name, spoiled, turn, folder, monkeypatch, capsys):
    """The commands on a file take turns: one of two beside this record, the other beside the next."""
    commands = COMMANDS[name][(turn + [*SPOILED].index(spoiled)) % 2 :: 2]
    if len(COMMANDS[name]) == 1:
        commands = COMMANDS[name] if turn == 0 else []
    monkeypatch.chdir(folder)
    monkeypatch.setenv("PYTHONWARNINGS", "error")
    rows = SPOILED[spoiled](columns(name))
    text = "".join(",".join("" if v != v else repr(v) for v in row) + "\n" for row in rows.tolist())
    Path(name).write_text(f"{HEADS[name]}\n{text}")
    for command in commands:
        for path in folder.glob("NEW*"):
            path.unlink()
        check(command.split(), capsys)
