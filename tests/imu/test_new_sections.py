"""`inercal new imu` proposes sections that `inercal calibrate imu` takes as they are."""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from held_recordings import Handling, held
from turned_units import SIDES, Bench, Unit

from inercal.cli import run
from inercal.systems.imu.sections.cutting.log import with_sides
from inercal.systems.imu.sections.cutting.table import (
    SectionRow,
    quantity_of,
    read_table,
    side_of,
    write_table,
)

SITE = ["--set", "site.latitude=48 deg", "--quiet"]
HEAD = "t [s],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2]"


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def written(path, head, *columns):
    rows = np.column_stack(columns)
    path.write_text(head + "\n" + "".join(",".join(f"{v:.6f}" for v in row) + "\n" for row in rows))


def six_files(folder, head, scale=1.0, **other):
    """A file for each side, named after it, and the unit."""
    unit = Unit(np.random.default_rng(6), gravity=9.80880)
    for side, up in SIDES.items():
        up = SIDES[other.get(side[1] + ("up" if side[0] == "+" else "down"), side)] if other else up
        acc = Bench(unit, acc_noise=0.0, placing=1e-3).rest(up).acc + unit.rng.normal(0, 0.01, (600, 3))
        written(
            folder / f"{side[1]}_{'up' if side[0] == '+' else 'down'}.csv",
            head,
            0.01 * np.arange(600),
            scale * acc,
        )
    return unit


def csvs(folder):
    return sorted(path.name for path in folder.glob("*.csv"))


def calibrated(files, *more):
    code = run(["calibrate", "imu", *files, *more, "--study", "imu.toml", "--quiet", "--out", "out.json"])
    return code, json.loads(open("out.json", encoding="utf-8").read())


def method():
    return tomllib.loads(open("imu.toml", encoding="utf-8").read())["imu"]["method"]


def test_six_files_by_name_take_two_commands(folder):
    """`new imu *.csv`, then `calibrate imu *.csv`: the table beside the study is no recording."""
    unit = six_files(folder, HEAD)
    assert run(["new", "imu", *csvs(folder), *SITE]) == 0
    assert {row.file: side_of(row.up) for row in read_table("sections.csv")} == {
        f"{side[1]}_{'up' if side[0] == '+' else 'down'}.csv": side for side in SIDES
    }
    assert {row.why for row in read_table("sections.csv")} == {"name"}
    assert "sections.csv" in csvs(folder)
    more = ["--map", "imu-map.toml"] if (folder / "imu-map.toml").exists() else []
    code, result = calibrated(csvs(folder), *more)
    assert code == 0
    assert "sections.csv" in {source["path"].split("/")[-1] for source in result["inputs"]}
    for axis in "xyz":
        for name in (f"K0_{axis}", f"K1_{axis}"):
            found = next(p for p in result["parameters"] if p["name"] == name)
            assert abs(found["value"] - unit.truth[name]) < 4.0 * found["u"]


def test_files_of_bare_columns_get_a_map_and_the_same_sections(folder):
    six_files(folder, "time,ax,ay,az")
    assert run(["new", "imu", *csvs(folder), *SITE]) == 0
    assert (folder / "imu-map.toml").exists()
    assert method() == "sections"
    assert len(read_table("sections.csv")) == 6
    code, _ = calibrated(csvs(folder), "--map", "imu-map.toml")
    assert code == 0


def test_a_side_taken_twice_is_asked(folder, capsys):
    """What the data contradict is printed with what to do."""
    six_files(folder, HEAD, zup="-z")
    capsys.readouterr()
    assert run(["new", "imu", *csvs(folder), *SITE[:2]]) == 0
    out = capsys.readouterr()
    assert "z_down" in out.out + out.err


def log_of_sides_and_turns(folder):
    quarter, whole = 0.5 * np.pi, 2.0 * np.pi
    moves = [
        (0.0, 0.0, whole), (quarter, 0.0, 0.0), (0.0, whole, 0.0), (quarter, 0.0, 0.0), (quarter, 0.0, 0.0),
        (0.0, 0.0, quarter), (whole, 0.0, 0.0), (0.0, 0.0, np.pi),
    ]  # fmt: skip
    t, acc, gyro, _ = held(1, Handling(9, rest=(3.0, 4.0), move=(3.0, 4.0)), moves)
    head = HEAD + ",gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s]"
    written(folder / "log.csv", head, t, acc, gyro)


def answered(turn):
    """A turn with its angle, a whole turn within 2 deg, the sign as found."""
    sign = -1.0 if "detected, -" in turn.why else 1.0
    return replace(turn, angle=quantity_of(2.0 * np.pi * sign, np.radians(2.0), "deg"))


def test_one_log_of_six_rests_and_three_turns(folder):
    """Right numbers: K1 and S as simulated, within 4 u; S to 1 % once the angle of the turns is written down."""
    log_of_sides_and_turns(folder)
    assert run(["new", "imu", "log.csv", *SITE]) == 0
    assert method() == "sections"
    rows = read_table("sections.csv")
    for most in (0.1, 0.01):
        code, result = calibrated(["log.csv"])
        assert code == 0
        values = {p["name"]: p for p in result["parameters"]}
        for axis in "xyz":
            for name, truth in ((f"K1_{axis}", 1.01), (f"S_{axis}", 1.0)):
                assert abs(values[name]["value"] - truth) < 4.0 * values[name]["u"], name
                assert values[name]["u"] < most
        write_table([answered(row) if row.kind == "turn" else row for row in rows], "sections.csv")


def test_rows_of_means_are_sections(folder):
    unit = Unit(np.random.default_rng(5), gravity=9.80880)
    rows = [Bench(unit).rest(up).acc for up in SIDES.values()]
    written(folder / "means.csv", HEAD.partition(",")[2], np.array(rows))
    assert run(["new", "imu", "means.csv", *SITE]) == 0
    assert method() == "sections"
    assert len(read_table("sections.csv")) == 6
    code, _ = calibrated(["means.csv"], "--map", "imu-map.toml")
    assert code == 0


def test_other_protocols_begin_as_before(folder):
    """Poses in the hand and labels of a turn keep their methods, a stated method is kept, and no table is written."""
    t, acc, gyro, _ = held(21)
    head = HEAD + ",gyro_x [rad/s],gyro_y [rad/s],gyro_z [rad/s]"
    written(folder / "hand.csv", head, t, acc, gyro)
    log_of_sides_and_turns(folder)
    lines = (folder / "log.csv").read_text().splitlines()
    (folder / "labelled.csv").write_text(
        "\n".join(
            [
                f"{lines[0]},label",
                *(f"{line},{('x_p', 'x_rot')[k > 500]}" for k, line in enumerate(lines[1:])),
            ]
        )
    )
    for files, keys, expected in (
        (["hand.csv"], [], "multiposition"),
        (["labelled.csv"], [], "ferraris"),
        (["log.csv"], ["--set", "imu.method=multiposition"], "multiposition"),
    ):
        assert run(["new", "imu", *files, *SITE, *keys]) == 0
        assert method() == expected
        assert not (folder / "sections.csv").exists()
        for path in folder.glob("*.toml"):
            path.unlink()


def test_nothing_is_written_where_a_table_is_there(folder, capsys):
    six_files(folder, HEAD)
    files = csvs(folder)
    (folder / "sections.csv").write_text("mine\n")
    assert run(["new", "imu", *files, *SITE]) == 2
    assert "sections.csv: exists already" in capsys.readouterr().err
    assert not (folder / "imu.toml").exists()
    assert (folder / "sections.csv").read_text() == "mine\n"


PUBLISHED = """\
x_true (g),x_mean (g),x_std,y_true (g),y_mean (g),y_std,z_true (g),z_mean (g),z_std
0,0.100221283,0.00211150601,0,0.0604301312,0.00466911018,1,0.773104147,0.00412562024
0,0.0815410364,0.00320344386,0,0.0393982537,0.00207248996,-1,-1.27257495,0.00416839762
0,0.0986019436,0.0024753762,1,1.04469521,0.00453715167,0,-0.254673405,0.00481991049
0,0.0873405732,0.00216174451,-1,-0.95591161,0.0039568802,0,-0.247088708,0.00563292816
1,1.09251864,0.0055073251,0,0.038673612,0.0020656836,0,-0.257947641,0.00410856375
-1,-0.906858138,0.00571426386,0,0.048609455,0.00495654184,0,-0.239294681,0.00482510125
"""


def test_columns_of_true_directions_are_known_and_no_output(folder):
    """The six rows that a public table publishes. Half differences by the local gravity are 1.00064, 1.00125, 1.02381;
    rows of 1.8 mg do not tell them better than 14e-4."""
    (folder / "means.csv").write_text(PUBLISHED)
    assert run(["new", "imu", "means.csv", "--set", 'site.gravity="9.7973(5) m/s^2"']) == 0
    assert [side_of(row.up) for row in read_table("sections.csv")] == ["+z", "-z", "+y", "-y", "+x", "-x"]
    code, result = calibrated(["means.csv"], "--map", "imu-map.toml")
    assert code == 0
    values = {p["name"]: p for p in result["parameters"]}
    for axis, half in zip("xyz", (1.00064, 1.00125, 1.02381), strict=True):
        K1 = values[f"K1_{axis}"]
        assert K1["value"] * 9.80665 == pytest.approx(half, abs=1e-4)
        assert 5e-4 < K1["u"] * 9.80665 < 2e-3


def test_true_forces_of_any_size_are_forces(folder):
    """A shaker beside a reference: sizes of 0.3 to 2 g, stated in m/s^2, give scale factors that gravity does not."""
    unit = Unit(np.random.default_rng(9), misalignment=0.0, k2=0.0)
    rng = np.random.default_rng(10)
    forces = rng.normal(0.0, 8.0, (14, 3))
    rows = np.hstack([unit.accelerometers(forces) + rng.normal(0.0, 1e-3, forces.shape), forces])
    head = ",".join([*(f"acc_{a} [m/s^2]" for a in "xyz"), *(f"acc_{a}_true [m/s^2]" for a in "xyz")])
    written(folder / "shaker.csv", head, rows)
    assert run(["new", "imu", "shaker.csv", *SITE]) == 0
    table = read_table("sections.csv")
    np.testing.assert_allclose([row.force for row in table], forces, rtol=1e-6)
    code, result = calibrated(["shaker.csv"], "--map", "imu-map.toml")
    assert code == 0
    for p in result["parameters"]:
        if p["name"].startswith(("K0", "K1")):
            assert abs(p["value"] - unit.truth[p["name"]]) < 4.0 * p["u"]
            assert p["u"] < 2e-3


def test_labels_of_sides_are_sections(folder):
    """Six labelled sides need no turns; the method ferraris would miss them."""
    unit = Unit(np.random.default_rng(6), gravity=9.80880)
    rests = [Bench(unit).rest(up).acc for up in SIDES.values()]
    rng = np.random.default_rng(7)
    rows, labels = [], []
    for name, mean in zip(SIDES, rests, strict=True):
        rows += [*(mean + rng.normal(0, 0.01, (300, 3)))]
        labels += [name] * 300
    lines = [
        f"{0.01 * k:.2f},{','.join(f'{x:.6f}' for x in row)},{label}"
        for k, (row, label) in enumerate(zip(rows, labels, strict=True))
    ]
    (folder / "sides.csv").write_text(
        "\n".join(["t [s],acc_x [m/s^2],acc_y [m/s^2],acc_z [m/s^2],label", *lines])
    )
    assert run(["new", "imu", "sides.csv", *SITE]) == 0
    assert method() == "sections"
    assert [row.why for row in read_table("sections.csv")] == ["label"] * 6


def test_a_case_that_is_turned_in_place_is_set_up_once():
    """Rests in a row with one vertical share their placing; the same side after another is placed anew."""
    x, y, z = np.eye(3)
    ways = np.array([z, z, z + 0.01 * y, -z, x, x, -x, y, -y, z])
    rests = [SectionRow(f"rest {k}", "log.csv") for k in range(len(ways))]
    setups = [row.setup for row in with_sides(rests, 9.8 * ways)]
    assert setups == ["log.csv 1", "log.csv 1", "", "", "log.csv 4", "log.csv 4", "", "", "", ""]


def test_a_file_whose_name_begins_with_a_minus_is_a_file(folder):
    """A shell makes `-x.csv` of `*.csv`: an option it is only where no such file lies there."""
    unit = Unit(np.random.default_rng(8), gravity=9.80880)
    rng = np.random.default_rng(9)
    files = []
    for up in SIDES.values():
        files.append(f"{'+-'[int(np.sum(up) < 0)]}{'xyz'[int(np.argmax(np.abs(up)))]}.csv")
        rows = Bench(unit).rest(up).acc + rng.normal(0, 0.01, (300, 3))
        written(folder / files[-1], HEAD, 0.01 * np.arange(300), rows)
    assert run(["calibrate", "imu", *files, "--latitude", "48 deg", "--quiet", "--out", "out.json"]) == 0
    assert json.loads((folder / "out.json").read_text())["status"]["code"] == "ok"
