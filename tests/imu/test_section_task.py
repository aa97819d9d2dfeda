"""`inercal calibrate imu` by sections: rows of means, files by name, what is refused."""

import json

import numpy as np
import pytest
from turned_units import SIDES, Bench, Unit

from inercal.cli import run

SIX = """schema = 1
[site]
latitude = "48 deg"
[imu]
method = "sections"
"""


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def of_cli(*arguments):
    """Exit code and result of a calibration."""
    code = run(["calibrate", "imu", *arguments, "--study", "imu.toml", "--quiet", "--out", "out.json"])
    return code, lambda: json.loads(open("out.json", encoding="utf-8").read())


def means(names=SIDES, seed=5):
    """The text of a table of means [m/s^2], a row for each side, and the unit."""
    unit = Unit(np.random.default_rng(seed), gravity=9.80880)
    rows = [Bench(unit).rest(SIDES[side]).acc for side in names]
    lines = [
        "acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2]",
        *(",".join(f"{v:.9f}" for v in row) for row in rows),
    ]
    return "\n".join(lines) + "\n", unit


def tables(names=SIDES):
    return "".join(f'[[imu.section]]\nsection = "{side}"\nup = "{side}"\n' for side in names)


def test_rows_of_means_with_directions_give_coefficients(folder):
    text, unit = means()
    (folder / "means.csv").write_text(text)
    (folder / "imu.toml").write_text(SIX + 'placing = "0.3 deg"\n' + tables())
    code, result = of_cli("means.csv")
    assert code == 0
    found = result()
    values = {p["name"]: p for p in found["parameters"]}
    for axis in "xyz":
        K1 = values[f"K1_{axis}"]
        assert abs(K1["value"] - unit.truth[f"K1_{axis}"]) < 4 * K1["u"] + 1e-4
        assert abs(values[f"K0_{axis}"]["value"] - unit.truth[f"K0_{axis}"]) < 4 * values[f"K0_{axis}"]["u"]
    assert [row["section"] for row in found["result"]["sections"]] == list(SIDES)
    assert {"by_prior"} <= {finding["code"] for finding in found["findings"]}


def test_a_table_beside_the_study_says_the_same_as_its_tables(folder):
    text, _ = means()
    (folder / "means.csv").write_text(text)
    (folder / "imu.toml").write_text(SIX + tables())
    _, stated = of_cli("means.csv")
    first = stated()["parameters"]
    (folder / "sections.csv").write_text("section,up\n" + "".join(f"{side},{side}\n" for side in SIDES))
    (folder / "imu.toml").write_text(SIX + 'sections = "sections.csv"\n')
    code, read = of_cli("means.csv")
    assert code == 0
    assert read()["parameters"] == first


def test_exchanged_sides_are_inconsistent(folder):
    text, _ = means()
    (folder / "means.csv").write_text(text)
    (folder / "imu.toml").write_text(SIX + tables(["-x", "+x", *list(SIDES)[2:]]))
    code, result = of_cli("means.csv")
    assert code != 0
    assert result()["status"]["code"] == "inconsistent"


def test_too_few_rests_name_the_one_to_add(folder):
    text, _ = means(["+x", "-x", "+y", "-y"])
    (folder / "means.csv").write_text(text)
    (folder / "imu.toml").write_text(SIX)
    code, result = of_cli("means.csv")
    assert code != 0
    assert result()["status"]["code"] == "unobservable"
    assert "leave K0_z open: add a rest with" in result()["status"]["message"]
    assert "z up" in result()["status"]["message"]


def test_rows_and_sections_that_differ_in_number_are_refused(folder, capsys):
    text, _ = means()
    (folder / "means.csv").write_text(text)
    (folder / "imu.toml").write_text(SIX + tables(list(SIDES)[:5]))
    assert of_cli("means.csv")[0] == 2
    assert "found 6 rows of means, but 5 sections" in capsys.readouterr().err
    (folder / "imu.toml").write_text(SIX + 'sections = "sections.csv"\n' + tables())
    assert of_cli("means.csv")[0] == 2
    assert "expected one of the two" in capsys.readouterr().err


def test_files_by_name_are_sections(folder):
    """Six files of a stay each, their names saying which side is up."""
    unit = Unit(np.random.default_rng(6), gravity=9.80880)
    for side, up in SIDES.items():
        y = Bench(unit, acc_noise=0.0, placing=1e-3).rest(up).acc + unit.rng.normal(0, 0.01, (600, 3))
        lines = [f"{0.01 * k:.2f},{v[0]:.6f},{v[1]:.6f},{v[2]:.6f}" for k, v in enumerate(y)]
        name = f"{side[1]}_{'up' if side[0] == '+' else 'down'}.csv"
        (folder / name).write_text(
            "t [s],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2]\n" + "\n".join(lines) + "\n"
        )
    (folder / "imu.toml").write_text(SIX)
    files = sorted(path.name for path in folder.glob("*_*.csv"))
    code, result = of_cli(*files)
    assert code == 0
    value = {p["name"]: p for p in result()["parameters"]}["K1_z"]
    assert abs(value["value"] - unit.truth["K1_z"]) < 4 * value["u"]
    assert value["u"] < 3e-3


def test_samples_without_times_are_refused(folder, capsys):
    rows = np.random.default_rng(1).normal([0, 0, 9.8], 0.01, (500, 3))
    lines = [
        "acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2]",
        *(",".join(f"{v:.5f}" for v in row) for row in rows),
    ]
    (folder / "log.csv").write_text("\n".join(lines) + "\n")
    (folder / "imu.toml").write_text(SIX)
    assert of_cli("log.csv")[0] == 2
    assert "found 500 rows, most of them like the one before" in capsys.readouterr().err
