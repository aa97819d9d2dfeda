"""Points from a trigger, and the table of a balance joined to them, by number or by time."""

import json
from dataclasses import replace

import numpy as np
import pytest
from sting_study import DEG, study
from test_aoa_points import angles, recording
from test_aoa_runs import STUDY

from inercal.cli import run
from inercal.foundation.errors import InputError, RecordError
from inercal.foundation.records.write import write_record
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.reading.recording import plain, triggered
from inercal.systems.aoa.result.points import clock_offset, join, points, read_balance
from inercal.systems.aoa.settings import PointPlan
from inercal.systems.aoa.simulate import simulate, to_record
from rows import for_each

T = np.arange(1000) / 100.0


def pulses(*begins, lasting=0.02, value=1.0):
    made = np.zeros(len(T))
    for begin in begins:
        made[(begin <= T) & (begin + lasting > T)] = value
    return made


def test_a_level_holds_over_its_point():
    level = pulses(1.0, 4.0, lasting=2.0)
    assert triggered(T, level, PointPlan("trigger")) == [(1.0, 100, 300), (2.0, 400, 600)]
    late = PointPlan("trigger", delay=0.5)
    assert triggered(T, level, late) == [(1.0, 150, 300), (2.0, 450, 600)]


def test_a_pulse_or_a_count_begins_a_point():
    plan = PointPlan("trigger", delay=0.25, length=1.0)
    assert triggered(T, pulses(1.0, 4.0), plan) == [(1.0, 125, 225), (2.0, 425, 525)]
    count = np.where(T < 2.0, np.nan, np.floor(T / 2.0) + 6.0)
    assert triggered(T, count, plan) == [
        (float(k), 25 + 200 * (k - 6), 125 + 200 * (k - 6)) for k in (7, 8, 9, 10)
    ]
    assert triggered(T, np.zeros(len(T)), plan) == []


def test_points_by_the_trigger():
    theta = 0.1 * np.floor(T / 3.0)
    of = study(points=PointPlan("trigger", delay=0.5, length=1.0))
    with_trigger = recording(T, trigger=pulses(0.5, 3.5, 6.5))
    found = points(with_trigger, angles(theta), of)
    assert [each.number for each in found] == [1.0, 2.0, 3.0]
    assert [each.theta for each in found] == pytest.approx([0.0, 0.1, 0.2])
    assert [each.begin for each in found] == pytest.approx([1.0, 4.0, 7.0])
    with pytest.raises(RecordError, match="trigger: missing, expected the column"):
        points(recording(T), angles(theta), of)


@pytest.fixture(scope="module")
def polar(tmp_path_factory):
    """A polar with numbers in its points, and a balance at 20 Hz whose clock is 7.3 s ahead; its force goes with
    theta."""
    folder = tmp_path_factory.mktemp("polar")
    motion = MotionPlan(
        "pitch-pause", sample_rate=200.0, first=0.0, last=15.0 * DEG, step=5.0 * DEG, pause=3.0, move=1.0
    )
    of = study(motion=motion)
    told = simulate(of, np.random.default_rng(3))
    write_record(to_record(told.recording, of), folder / "polar.csv")
    rng, t = np.random.default_rng(4), np.arange(0.0, 14.0, 0.05)
    force = 100.0 * np.interp(t, told.recording.t, told.theta) + 0.2 * rng.standard_normal(len(t))
    other = rng.standard_normal(len(t))
    rows = [f"{a:.4f},{b:.5f},{c:.5f}" for a, b, c in zip(t + 7.3, other, force, strict=True)]
    (folder / "balance.csv").write_text("\n".join(["t [s],drag [N],normal_force [N]", *rows]) + "\n")
    (folder / "numbers.csv").write_text("point,moment [N*m]\n1,0.5\n2,1.5\n4,3.5\n")
    (folder / "aoa.toml").write_text(STUDY.replace('"2 mg"', '"1e-4 g"'))
    return folder, told


def test_the_offset_of_the_clocks_is_that_of_the_largest_correlation(polar):
    folder, told = polar
    balance = read_balance(folder / "balance.csv")
    offset, u, rho, title = clock_offset(balance, told.recording, angles(told.theta))
    assert title == "normal_force [N]"
    assert rho > 0.99
    assert abs(offset - 7.3) < 3.0 * u
    assert u < 0.05


def test_means_of_the_balance_at_each_point(polar):
    folder, told = polar
    found = points(told.recording, angles(told.theta), study())
    joined = join(read_balance(folder / "balance.csv"), found, told.recording, angles(told.theta))
    force, u = joined.columns["normal_force [N]"], joined.columns["u_normal_force [N]"]
    expected = 100.0 * np.array([each.theta for each in found])
    # 0.2 N over some 60 rows, whose u is known to a factor of 2; 20 ms of the moves' ends at most
    assert np.abs(force - expected).max() < 0.3
    assert 0.005 < np.nanmin(u) < 0.1
    (clock,) = joined.findings
    assert clock.code == "other_clock"
    assert "+7.3" in clock.message


def test_by_the_number_of_the_point(polar):
    folder, told = polar
    found = points(told.recording, angles(told.theta), study())
    joined = join(read_balance(folder / "numbers.csv"), found, told.recording, angles(told.theta))
    np.testing.assert_array_equal(joined.columns["moment [N*m]"], [0.5, 1.5, np.nan, 3.5])
    (gap,) = joined.findings
    assert "1 of 4 points have no row" in gap.message


def test_the_command_writes_them_beside_the_points(polar, capsys):
    folder, _ = polar
    words = ["aoa", str(folder / "polar.csv"), "--study", str(folder / "aoa.toml"), "--points"]
    assert run([*words, "--join", str(folder / "balance.csv"), "--out", str(folder / "points.csv")]) in (0, 1)
    assert "joined by time; its clock is +7." in capsys.readouterr().err
    titles = (folder / "points.csv").read_text().splitlines()[0].split(",")
    assert titles[-4:] == ["drag [N]", "u_drag [N]", "normal_force [N]", "u_normal_force [N]"]
    assert run([*words, "--join", str(folder / "numbers.csv"), "--json"]) in (0, 1)
    told = json.loads(capsys.readouterr().out)["result"]["joined"]
    assert told["moment [N*m]"] == [0.5, 1.5, None, 3.5]


def test_join_needs_points(polar, capsys):
    folder, _ = polar
    words = ["aoa", str(folder / "polar.csv"), "--study", str(folder / "aoa.toml")]
    assert run([*words, "--join", str(folder / "numbers.csv")]) == 2
    assert "--join: found without --points" in capsys.readouterr().err


BAD = {
    "force [N]\n1": "found neither point nor trigger nor t",
    "point\n1": "found no column to join",
    "t [ms],force [N]\n1,2": r"found the column 't \[ms\]', expected t \[s\]",
    "point,force [N]\n1,much": r"row 1, force \[N\]: found 'much', expected a number",
    "point,force [N]\n1": "row 1: found 1 values, expected 2",
    "point,force [N]": "found no rows",
}


@for_each(("text", "words"), BAD.items())
def test_one_sentence_for_what_is_wrong(tmp_path, text, words):
    (tmp_path / "bad.csv").write_text(text + "\n")
    with pytest.raises(InputError, match=words) as error:
        read_balance(tmp_path / "bad.csv")
    assert "\n" not in str(error.value)


def test_a_balance_that_does_not_follow_the_angle_is_refused(polar):
    folder, told = polar
    balance = read_balance(folder / "balance.csv")
    noise = {"drag [N]": balance.columns["drag [N]"]}
    with pytest.raises(RecordError, match="found no column that follows theta"):
        clock_offset(replace(balance, columns=noise), told.recording, angles(told.theta))
    still = plain(told.recording.t, told.recording.acc, told.recording.gyro)
    with pytest.raises(RecordError, match="found no row of any point"):
        join(
            replace(balance, numbers={"point": np.full(len(balance.t), 77.0)}),
            points(told.recording, angles(told.theta), study()),
            still,
            angles(told.theta),
        )
