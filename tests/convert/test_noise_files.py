"""Noise for filters: a triad's numbers are those that the recording was made with."""

import json

import numpy as np
import pytest
import yaml

from inercal.cli import run

N = {"acc": 2e-3, "gyro": 1e-3}
K = {"acc": 1e-3, "gyro": 4e-4}
DT, ROWS = 0.02, 60_000


@pytest.fixture(scope="module")
def noise(tmp_path_factory):
    """The Allan deviation of white noise and a random walk in six channels at rest; each triad has one N and K."""
    folder = tmp_path_factory.mktemp("noise")
    rng = np.random.default_rng(20261127)
    columns = [np.arange(ROWS) * DT]
    for sensor in ("acc", "gyro"):
        white = rng.standard_normal((ROWS, 3)) * N[sensor] / np.sqrt(DT)
        walk = np.cumsum(rng.standard_normal((ROWS, 3)) * K[sensor] * np.sqrt(DT), axis=0)
        columns += list((white + walk).T)
    header = "t [s]," + ",".join(
        f"{s}_{axis} [{unit}]" for s, unit in (("acc", "m/s^2"), ("gyro", "rad/s")) for axis in "xyz"
    )
    np.savetxt(
        folder / "rest.csv", np.column_stack(columns), delimiter=",", header=header, comments="", fmt="%.9g"
    )
    run(["allan", str(folder / "rest.csv"), "--out", str(folder / "noise.json"), "--quiet"])
    return folder / "noise.json"


def written(noise, tool, tmp_path, capsys):
    out = tmp_path / f"{tool}.yaml"
    capsys.readouterr()
    run(["convert", str(noise), "--to", tool, "--out", str(out), "--json"])
    table = {row["name"]: row for row in json.loads(capsys.readouterr().out)["parameters"]}
    text = out.read_text()
    return yaml.safe_load(text.replace("%YAML:1.0", "")), table


def test_kalibr_and_openvins_have_the_densities(noise, tmp_path, capsys):
    """N and K within three u of the truth, and the same in both files."""
    kalibr, table = written(noise, "kalibr", tmp_path, capsys)
    openvins, _ = written(noise, "openvins", tmp_path, capsys)
    for sensor, name in (("acc", "accelerometer"), ("gyro", "gyroscope")):
        for symbol, truth, key in (("N", N, "noise_density"), ("K", K, "random_walk")):
            value = kalibr[f"{name}_{key}"]
            assert abs(value - truth[sensor]) < 3.0 * table[f"{symbol}_{sensor}"]["u"]
            assert table[f"{symbol}_{sensor}"]["u"] < 0.2 * value
            assert openvins["imu0"][f"{name}_{key}"] == value
    assert kalibr["update_rate"] == pytest.approx(1.0 / DT, rel=1e-9)


def test_vins_has_standard_deviations_of_samples(noise, tmp_path, capsys):
    """A step adds (noise dt)^2 to velocity and bias; that is the variance that N and K make in dt."""
    vins, table = written(noise, "vins", tmp_path, capsys)
    for key, symbol in (("acc_n", "N_acc"), ("gyr_n", "N_gyro"), ("acc_w", "K_acc"), ("gyr_w", "K_gyro")):
        density = table[symbol]["value"]
        assert (vins[key] * DT) ** 2 == pytest.approx(density**2 * DT, rel=1e-4)


def test_a_walk_that_was_not_seen_is_an_upper_limit_and_said(tmp_path, capsys):
    rng = np.random.default_rng(5)
    columns = np.column_stack([np.arange(20_000) * DT, rng.standard_normal((20_000, 6)) * 0.01])
    header = "t [s]," + ",".join(
        f"{s}_{axis} [{unit}]" for s, unit in (("acc", "g"), ("gyro", "deg/s")) for axis in "xyz"
    )
    np.savetxt(tmp_path / "rest.csv", columns, delimiter=",", header=header, comments="", fmt="%.9g")
    run(["allan", str(tmp_path / "rest.csv"), "--out", str(tmp_path / "noise.json"), "--quiet"])
    result = json.loads((tmp_path / "noise.json").read_text())["result"]["channels"]
    capsys.readouterr()
    run(["convert", str(tmp_path / "noise.json"), "--to", "kalibr", "--json"])
    said = json.loads(capsys.readouterr().out)
    assert "not_stated" in {finding["code"] for finding in said["findings"]}
    (text,) = said["result"]["texts"]
    limits = [result[f"gyro_{axis}"]["upper_limits"]["K"] for axis in "xyz"]  # rad/s: SI
    assert yaml.safe_load(text)["gyroscope_random_walk"] == pytest.approx(
        np.sqrt(np.mean(np.square(limits))), rel=1e-4
    )


@pytest.mark.parametrize(
    ("tool", "sentence"),
    [("imucal", "holds noise, which imucal has no file for, expected kalibr, openvins, vins")],
)
def test_another_tool_is_refused(noise, tool, sentence, capsys):
    assert run(["convert", str(noise), "--to", tool]) == 2
    assert sentence in capsys.readouterr().err
