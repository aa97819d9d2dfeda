"""What recordings by their names say of sections: files of sides, one log, labels, rows of means."""

from dataclasses import replace

import numpy as np
import pytest
from held_recordings import GRAVITY, Handling, held
from recordings import record_of, shipped

from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.units import parse_unit
from inercal.systems.imu.sections.cutting.cut import cut
from inercal.systems.imu.sections.cutting.means import Means, rows_of_means, sections_of_means
from inercal.systems.imu.sections.cutting.proposal import Proposal, RecordedTriads, stretches_of
from inercal.systems.imu.sections.cutting.table import (
    SectionRow,
    quantity_of,
    read_table,
    side_of,
    write_table,
)

K0, K1, D_F = np.array([570.0, -20.0, 640.0]), 1672.0, np.array([-560.0, 110.0, -73.0])
SIDES = {
    f"{word}{axis}.csv": sign * np.eye(3)[k]
    for k, axis in enumerate("XYZ")
    for word, sign in (("pos", 1.0), ("neg", -1.0))
}


def file_of(up, seed, hand=0.0, rate=(0.0, 0.0, 0.0)):
    """A file of one stay in counts; ``hand``: seconds of motion at its beginning."""
    rng = np.random.default_rng(seed)
    n = 1200
    t = np.arange(n) / 200.0
    force = GRAVITY * (np.asarray(up) + 0.02 * rng.normal(size=3)) + 0.04 * rng.normal(size=(n, 3))
    moving = t < hand
    force[moving] += 5.0 * np.sin(9.0 * t[moving])[:, None] * [1.0, 0.4, -0.7]
    gyro = D_F + 7505.0 * np.asarray(rate) + 12.0 * rng.normal(size=(n, 3)) + 3.0 * rng.normal(size=3)
    gyro[moving] += 4000.0 * np.cos(9.0 * t[moving])[:, None]
    return record_of(t, np.rint(K0 + K1 * force), np.rint(gyro))


def six(**changed):
    return {name: file_of(up, k) for k, (name, up) in enumerate(SIDES.items())} | changed


def test_six_files_by_their_names(tmp_path):
    """Each is one rest on its side, from their means come the constants; the table says the same."""
    found = Proposal.of(six(**{"posX.csv": file_of([1.0, 0.0, 0.0], 7, hand=2.0)}))
    assert found.questions == ()
    assert found.unused == {}
    assert {row.file: side_of(row.up) for row in found.rows} == {
        name: f"{'+' if name.startswith('pos') else '-'}{name[3].lower()}" for name in SIDES
    }
    first = found.rows[0]
    assert 1.9 < first.begin < 2.3  # the hand at the beginning is cut off
    assert all(row.begin is None for row in found.rows[1:])
    means = {one.name: one.acc for one in found.sections}
    for k, axis in enumerate("XYZ"):
        half = 0.5 * (means[f"pos{axis}"] - means[f"neg{axis}"])[k] / GRAVITY
        assert half == pytest.approx(K1, rel=0.03)
    assert all((one.acc_var > 0.0).all() and one.gyro is not None for one in found.sections)
    write_table(found.rows, tmp_path / "sections.csv")
    assert [row.section for row in read_table(tmp_path / "sections.csv")] == [
        row.section for row in found.rows
    ]


def test_a_side_taken_twice_is_asked_for_alone():
    found = Proposal.of(six(**{"negZ.csv": file_of([0.0, 0.0, 1.0], 8)}))
    (question,) = found.questions
    assert "posZ and negZ hold the same side, which looks like that of posZ" in question.headline


def test_a_file_that_never_rests_is_named_and_left_out():
    found = Proposal.of(six(**{"posY.csv": file_of([0.0, 1.0, 0.0], 9, hand=6.0)}))
    assert [one.name for one in found.sections] == ["posX", "negX", "negY", "posZ", "negZ"]
    (question,) = found.questions
    assert question.code == "not_at_rest"
    assert "posY is not held still" in question.headline


def test_a_rest_by_name_that_turns_is_named():
    found = Proposal.of(six(**{"negX.csv": file_of([-1.0, 0.0, 0.0], 10, rate=(0.5, 0.0, 0.0))}))
    (question,) = found.questions
    assert question.code == "not_at_rest"
    assert "The gyro turns in negX" in question.headline


def test_rates_and_turns_by_name():
    """A rate with its unit; a turn whose angle nobody stated is asked for."""
    how = Handling(2, rest=(2.0, 2.0), move=(6.0, 6.0), jolt=0.0, arm=0.0)
    t, acc, gyro, _ = held(20, how, [(0.0, 0.0, 2.0 * np.pi)])
    turn = record_of(t, acc, gyro, "m/s^2", "rad/s")
    steady = gyro * [1.0, 1.0, 0.0]
    steady[:, 2] = np.radians(30.0)
    spin = record_of(t, acc, steady + 1e-3 * np.sin(np.arange(len(t)))[:, None], "m/s^2", "rad/s")
    found = Proposal.of({"z_360.csv": turn, "z_30dps.csv": spin, "rot_z.csv": turn})
    kinds = [("z_360", "turn"), ("z_30dps", "rate"), ("rot_z", "turn")]
    assert [(row.section, row.kind) for row in found.rows] == kinds
    assert [one.name for one in found.sections] == ["z_360", "z_30dps"]
    assert found.sections[0].angle == pytest.approx(2.0 * np.pi)
    np.testing.assert_allclose(found.sections[0].gyro * found.sections[0].duration, [0, 0, 6.28], atol=0.25)
    assert found.sections[1].rate == pytest.approx(np.radians(30.0))
    assert found.unused == {"rot_z": "its angle is not stated"}
    assert [question.code for question in found.questions] == ["not_stated"]


def six_sides_and_three_turns(seed, counts=False):
    """One log: six sides, and about three of them a whole turn."""
    quarter, whole = 0.5 * np.pi, 2.0 * np.pi
    moves = [
        (0.0, 0.0, whole), (quarter, 0.0, 0.0), (0.0, whole, 0.0), (quarter, 0.0, 0.0), (quarter, 0.0, 0.0),
        (0.0, 0.0, quarter), (whole, 0.0, 0.0), (0.0, 0.0, np.pi),
    ]  # fmt: skip
    t, acc, gyro, truth = held(seed, Handling(9, rest=(3.0, 4.0), move=(3.0, 4.0)), moves)
    return (
        record_of(t, 1000 * acc, 1000 * gyro) if counts else record_of(t, acc, gyro, "m/s^2", "rad/s")
    ), truth


@pytest.mark.parametrize("seed", range(3))
def test_one_log_with_six_sides_and_three_turns(seed):
    record, truth = six_sides_and_three_turns(seed)
    found = Proposal.of({"log.csv": record})
    rests = [row for row in found.rows if row.kind == "rest"]
    turns = [row for row in found.rows if row.kind == "turn"]
    assert len(rests) == len(truth) == 9
    assert {side_of(row.up) for row in rests} == {"+x", "-x", "+y", "-y", "+z", "-z"}
    assert all("deg off" in row.why for row in rests)
    assert [side_of(row.axis)[1] for row in turns] == ["z", "y", "x"]
    assert len(found.sections) == 9


@pytest.mark.parametrize("counts", [False, True])
def test_a_turn_of_an_angle_that_nobody_states_is_a_move(counts):
    """By hand a whole turn ends some degrees off: taken as exact, its scale factor would be far too sure."""
    record, _ = six_sides_and_three_turns(1, counts)
    found = Proposal.of({"log.csv": record})
    turns = [row for row in found.rows if row.kind == "turn"]
    assert [row.angle for row in turns] == [None] * 3
    assert all(row.why.endswith("which angle?") for row in turns)
    assert found.questions == ()
    assert [(note.code, note.harm) for note in found.notes] == [("not_stated", ())]
    assert len(found.unused) == 3
    assert len(found.moves) == 8
    told = [
        replace(row, angle=quantity_of(2.0 * np.pi, 0.03, "deg")) if row.kind == "turn" else row
        for row in found.rows
    ]
    found = Proposal.by(told, {"log.csv": record})
    assert len(found.sections) == 12
    assert len(found.moves) == 5  # never both for one motion


def test_poses_in_the_hand_are_no_sides():
    t, acc, gyro, _ = held(21)
    found = Proposal.of({"log.csv": record_of(t, acc, gyro, "m/s^2", "rad/s")})
    assert len(found.sections) >= 50
    assert all(one.up is None for one in found.sections)


def test_plateaus_of_a_rate_are_one_question_for_each_size():
    """A table at ±20 and ±45 deg/s about z, from rest to rest."""
    rng = np.random.default_rng(12)
    levels = np.radians([0, 20, 0, -20, 0, 45, 0, -45, 0, 20, 0])
    rate = np.concatenate([np.full(800, level) for level in levels])
    rate = np.convolve(np.pad(rate, 25, mode="edge"), np.ones(51) / 51, "valid")
    gyro = np.stack([np.zeros_like(rate), np.zeros_like(rate), rate], axis=1) + 2e-3 * rng.normal(
        size=(len(rate), 3)
    )
    acc = np.array([0.0, 0.0, GRAVITY]) + 0.02 * rng.normal(size=gyro.shape)
    found = Proposal.of({"log.csv": record_of(np.arange(len(rate)) / 100.0, acc, gyro, "m/s^2", "rad/s")})
    plateaus = [row for row in found.rows if row.kind == "rate"]
    assert [side_of(row.axis) for row in plateaus] == ["+z", "-z", "+z", "-z", "+z"]
    assert [row.rate_group for row in plateaus] == [f"log.csv {k}" for k in (1, 1, 2, 2, 1)]
    assert "about 20 deg/s about +z: which rate?" in plateaus[0].why
    asked = [question.headline for question in found.questions if question.code == "not_stated"]
    assert asked == [
        "3 stretches of log.csv turn at about 20 deg/s.",
        "2 stretches of log.csv turn at about 45 deg/s.",
    ]
    assert sum(row.kind == "rest" for row in found.rows) == 6


def test_a_file_that_turns_all_the_time_is_no_rest():
    """`x_up_gyro` of a public set turns at 30 deg/s from its first to its last sample."""
    rng = np.random.default_rng(13)
    gyro = np.array([np.radians(30.0), 0.0, 0.0]) + 2e-3 * rng.normal(size=(3000, 3))
    acc = np.array([GRAVITY, 0.0, 0.0]) + 0.02 * rng.normal(size=(3000, 3))
    found = Proposal.of({"x_up_gyro.csv": record_of(np.arange(3000) / 100.0, acc, gyro, "m/s^2", "rad/s")})
    assert [row.kind for row in found.rows] == ["rate"]
    assert "about 30 deg/s about +x: which rate?" in found.rows[0].why


def test_a_log_that_never_rests_says_so():
    """A gimbal that never stops, in counts: no rest, and when it was calmest."""
    rng = np.random.default_rng(15)
    t = np.arange(20000) / 100.0
    angle, tilt = 1.3 * t, 0.6 * np.sin(0.37 * t)
    acc = GRAVITY * np.stack(
        [np.sin(angle) * np.cos(tilt), np.sin(tilt), np.cos(angle) * np.cos(tilt)], axis=1
    )
    gyro = np.stack([np.gradient(tilt, t), np.full_like(t, 1.3), np.zeros_like(t)], axis=1)
    acc, gyro = (
        100.0 * acc + 4.0 * rng.normal(size=acc.shape),
        1000.0 * gyro + 15.0 * rng.normal(size=gyro.shape),
    )
    found = Proposal.of({"spin.csv": record_of(t, np.round(acc), np.round(gyro))})
    assert [row for row in found.rows if row.kind == "rest"] == []
    assert "spin.csv is never held still for 0.65 s, calmest at" in found.questions[-1].headline


def test_the_labels_of_a_shipped_recording():
    """imucal's labels: six sides and three turns whose angle is asked for."""
    record, _ = shipped("ferraris")
    found = Proposal.of({"ferraris.csv": record})
    rests = [row for row in found.rows if row.kind == "rest"]
    assert sorted(side_of(row.up) for row in rests) == ["+x", "+y", "+z", "-x", "-y", "-z"]
    assert [row.section for row in found.rows if row.kind == "turn"] == ["x_rot", "y_rot", "z_rot"]
    assert len(found.sections) == 6
    (question,) = found.questions
    assert question.headline == "The angle of 3 turns of ferraris.csv is not known."


def test_rows_of_means_with_true_directions():
    """Directions of the size of g, in g or m/s², are directions; other sizes are the force itself."""
    ups = np.concatenate([np.eye(3), -np.eye(3)])
    acc = K0 + K1 * GRAVITY * ups
    for true, in_si in ((ups, False), (ups, True), (9.80665 * ups, True)):
        means = Means(acc, acc_u=np.full((6, 3), 2.0), true=true, in_si=in_si)
        found = Proposal.of({"means.csv": record_of(np.arange(6), acc)}, {"means.csv": means})
        assert [side_of(row.up) for row in found.rows] == ["+x", "+y", "+z", "-x", "-y", "-z"]
        assert found.sections[0].acc_var.tolist() == [4.0, 4.0, 4.0]
        assert found.questions == ()
    forces = Means(acc, true=ups * [[1.0], [2.0], [1.0], [1.0], [1.0], [1.0]], in_si=False)
    rows = rows_of_means("shaker.csv", forces)
    assert rows[1].up is None
    np.testing.assert_allclose(rows[1].force, [0.0, 2.0 * 9.80665, 0.0])
    np.testing.assert_allclose(sections_of_means(rows, forces)[1].force, [0.0, 2.0 * 9.80665, 0.0])


def test_rows_of_means_without_directions_or_times():
    rng = np.random.default_rng(14)
    ups = rng.normal(size=(12, 3))
    acc = K0 + K1 * GRAVITY * ups / np.linalg.norm(ups, axis=1, keepdims=True)
    acc[3] = np.nan
    found = Proposal.of({"rows.csv": record_of(np.arange(12), acc)})
    assert [one.name for one in found.sections] == [f"row {k}" for k in (1, 2, 3, *range(5, 13))]
    assert all(one.up is None for one in found.sections)


def test_rows_of_two_tables_are_told_apart():
    rng = np.random.default_rng(16)
    tables = {}
    for name in ("a.csv", "b.csv"):
        acc = K0 + K1 * GRAVITY * np.concatenate([np.eye(3), -np.eye(3)]) + rng.normal(size=(6, 3))
        tables[name] = record_of(np.arange(6), acc)
    found = Proposal.of(tables)
    assert len({row.section for row in found.rows}) == 12
    assert {one.name for one in found.sections} == {row.section for row in found.rows}


def test_a_reference_beside_the_unit_gives_the_force():
    """A row that names three channels: their mean over its stretch, in m/s²."""
    t = np.arange(1000) / 100.0
    rng = np.random.default_rng(17)
    true = np.stack([0.0 * t, np.where(t < 5.0, 0.5, -0.5), 1.0 + 0.0 * t], axis=1)
    record = record_of(t, GRAVITY * true + 0.01 * rng.normal(size=true.shape), acc_unit="m/s^2")
    column = record["acc_x"]
    beside = {
        f"a{k}": replace(column, name=f"a{k}", unit=parse_unit("g"), values=true[:, k - 1].copy())
        for k in (1, 2, 3)
    }
    both = RecordedTriads.of("log.csv", replace(record, columns={**record.columns, **beside}))
    row = SectionRow("shaken", "log.csv", 0.0, 4.9, force=("a1", "a2", "a3"))
    (section,) = cut(stretches_of([row], {"log.csv": both})).sections
    np.testing.assert_allclose(section.force, [0.0, 0.5 * 9.80665, 9.80665])
    with pytest.raises(RecordError, match="no column a4"):
        both.stretch(replace(row, force=("a1", "a2", "a4")))
    counts = RecordedTriads.of("log.csv", record_of(t, true))
    with pytest.raises(RecordError, match="expected three accelerations of one clock"):
        counts.stretch(replace(row, force=("acc_x", "acc_y", "acc_z")))


def test_bad_input_is_one_sentence():
    with pytest.raises(StudyError, match="row 2: found a direction of size 0"):
        rows_of_means("means.csv", Means(np.ones((2, 3)), true=np.array([[0.0, 0.0, 1.0], [0.0, 0.0, 0.0]])))
    record, _ = shipped("ferraris")
    bare = type(record)({"acc_x": record["acc_x"]}, (), record.sources)
    with pytest.raises(RecordError, match="neither three accelerometers nor three gyros"):
        Proposal.of({"x.csv": bare})
