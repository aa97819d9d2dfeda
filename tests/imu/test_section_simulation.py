"""`inercal simulate imu` of sections: what it writes is calibrated by the same study, and U holds the truth."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import binom

from inercal.cli import run
from inercal.faces.studies.load import load_study
from inercal.foundation.errors import StudyError
from inercal.systems.imu.sections.course import Pace, course, sampled
from inercal.systems.imu.sections.cutting.table import of_tables
from inercal.systems.imu.sections.outcome import calibrate_from_sections
from inercal.systems.imu.sections.simulate import simulate_sections
from inercal.systems.listed import SYSTEMS

SITE = '[site]\nlatitude = "48 deg"\ngravity = "9.809(1) m/s^2"\n[imu]\nmethod = "sections"\n'
SIDES = "".join(f"{side},rest,{side},,,\n" for side in ("+x", "-x", "+y", "-y", "+z", "-z"))
HEAD = "section,kind,up,axis,rate,angle\n"
TURNS = "".join(f"turn {axis},turn,+{axis},+{axis},,-360.0(2) deg\n" for axis in "xyz")
RATES = "".join(
    f"{name},rate,+z,+z,{rate},\n" for name, rate in (("fast", "60.00(3) deg/s"), ("slow", "-20 deg/s"))
)
HAND = "section,kind\n" + "".join(f"rest {k},rest\nmove {k},move\n" for k in range(1, 16)) + "rest 16,rest\n"
QUIET = '[simulation]\naccelerometer_wander = "0 ug"\ngyro_wander = "0 deg/h"\n'


def study_of(folder, table, keys='placing = "0.3 deg"\n', simulation=QUIET):
    (folder / "sections.csv").write_text(table)
    path = folder / "imu.toml"
    path.write_text(SITE + keys + 'sections = "sections.csv"\n' + simulation)
    return load_study(SYSTEMS["imu"], path, ())


def covered(settings, runs):
    """Coefficients whose U holds the truth, and all, of some runs; K2 stays by its prior and is left aside."""
    inside = []
    for k in range(runs):
        record, truth = simulate_sections(
            settings, settings.method, settings.site.latitude, np.random.default_rng([45, k])
        )
        found = calibrate_from_sections([record], settings, settings.method).estimate
        M = truth.accelerometer.misalignment
        true = truth.values() | {
            f"M_{i}{j}": M["xyz".index(i), "xyz".index(j)] for i, j in ("yx", "zx", "zy")
        }
        used = [name for name in found.names if not name.startswith("K2")]
        assert used
        inside += [abs(found[name].value - true[name]) < found[name].U for name in used]
    return sum(inside), len(inside)


@pytest.mark.parametrize(
    ("table", "keys"),
    [
        pytest.param(HEAD + SIDES + TURNS + RATES, 'placing = "0.3 deg"\n', id="sides, turns and rates"),
        pytest.param(
            HEAD + SIDES + TURNS, 'placing = "0.3 deg"\nlevel = "0.05 deg"\n', id="on a level table"
        ),
        pytest.param(HAND, "", id="moves of a hand"),
    ],
)
def test_calibrate_of_what_was_simulated_covers_the_truth(tmp_path, table, keys):
    """95 % are to be covered. Coefficients of a run depend on each other: they count as a third as many."""
    inside, count = covered(study_of(tmp_path, table, keys), 6)
    assert inside >= 3 * binom.ppf(1e-4, count // 3, 0.95)


def test_rows_of_means_hold_the_same_as_the_samples(tmp_path):
    settings = study_of(tmp_path, HEAD + SIDES)
    rows = replace(settings, simulation=replace(settings.simulation, means=True))
    log, means = (
        simulate_sections(one, one.method, one.site.latitude, np.random.default_rng(3))[0]
        for one in (settings, rows)
    )
    labels = np.array(log.labels)
    for k, name in enumerate(("+x", "-x", "+y", "-y", "+z", "-z")):
        np.testing.assert_allclose(means["acc_y"].values[k], log["acc_y"].values[labels == name].mean())
    inside, count = covered(rows, 4)
    assert inside >= 3 * binom.ppf(1e-4, count // 3, 0.95)


def test_rotations_are_finite_and_their_rates_integrate_to_them():
    """A turn by the stated angle about the stated axis, and a rate over whole turns, whatever the sampling."""
    rows = of_tables(
        [
            {"section": "turn", "kind": "turn", "up": "+z", "axis": "+x", "angle": "-450 deg"},
            {"section": "rate", "kind": "rate", "up": "+y", "axis": "+y", "rate": "-50 deg/s"},
        ]
    )
    pieces = course(rows, Pace(3.0, 4.0, 0.1), None)
    of_turn = [(piece, w) for piece, _, w, _ in sampled(pieces, 100.0) if piece.name == "turn"]
    turned = sum(w.sum(axis=0) for _, w in of_turn) / 100.0
    np.testing.assert_allclose(np.degrees(turned), [-450.0, 0.0, 0.0], atol=1e-4)
    (rate,) = [piece for piece in pieces if piece.name == "rate"]
    np.testing.assert_allclose(np.degrees(rate.step / rate.length), [0.0, -50.0, 0.0], atol=1e-9)
    assert np.degrees(np.linalg.norm(rate.step)) % 360.0 == pytest.approx(0.0, abs=1e-6)
    assert rate.length >= 3.0


def test_a_lever_arm_adds_to_the_accelerometers_where_the_unit_turns_and_changes_no_coefficient(tmp_path):
    settings = study_of(tmp_path, HEAD + SIDES + TURNS + RATES)
    moved = replace(settings, disturbances=replace(settings.disturbances, lever_arm=0.2))
    logs = [
        simulate_sections(one, one.method, one.site.latitude, np.random.default_rng(4))[0]
        for one in (settings, moved)
    ]
    labels = np.array(logs[0].labels)
    K1 = [calibrate_from_sections([log], settings, settings.method).estimate["K1_x"] for log in logs]
    assert abs(K1[0].value - K1[1].value) < 0.05 * K1[0].u + abs(K1[0].u - K1[1].u)
    spread = [
        log["acc_x"].values[labels == "fast"].mean() - log["acc_x"].values[labels == "+z"].mean()
        for log in logs
    ]
    assert abs(spread[0] - spread[1]) > 1.0


def test_labels_are_the_stretches_of_rows_without_times_and_times_beside_them_must_agree(
    tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    study_of(tmp_path, HEAD.replace("kind", "file,kind") + SIDES.replace(",rest", ",sides.csv,rest"))
    assert run(["simulate", "imu", "imu.toml", "--seed", "2", "--out", "log.csv", "--quiet"]) == 0
    assert run(["calibrate", "imu", "log.csv", "--study", "imu.toml", "--quiet"]) == 0
    rows = (tmp_path / "sections.csv").read_text().splitlines()
    times = [rows[0] + ",begin,end", *(f"{row},{100 + k} s,{101 + k} s" for k, row in enumerate(rows[1:]))]
    (tmp_path / "sections.csv").write_text("\n".join(times).replace("sides.csv", "log.csv") + "\n")
    capsys.readouterr()
    assert run(["calibrate", "imu", "log.csv", "--study", "imu.toml"]) == 2
    assert (
        "found the label +x from 0.00 s to 2.99 s of log.csv, outside its begin and end"
        in capsys.readouterr().err
    )


def test_counts_of_a_gyro_that_never_turned_about_an_axis_name_the_turn_to_add(tmp_path):
    """Nothing tells the unit of counts. A gyro that never turned at all is left with its biases; the accelerometers
    have their numbers in any case."""
    settings = study_of(tmp_path, HEAD + SIDES + RATES)
    record, _ = simulate_sections(settings, settings.method, 0.8, np.random.default_rng(4))
    found = calibrate_from_sections([record], settings, settings.method).estimate
    assert (
        found.message
        == "the sections leave S_x, S_y open: add a rate, or a turn by a known angle, about x, y"
    )
    settings = study_of(tmp_path, HEAD + SIDES)
    inside, count = covered(settings, 2)
    assert (inside > 0.8 * count, count) == (True, 2 * 15)


@pytest.mark.parametrize(
    ("row", "words"),
    [
        ("t,turn,+z,+z,,", "section t, angle: found none"),
        ("r,rate,+z,+z,,", "section r, rate: found none"),
    ],
)
def test_what_cannot_be_simulated_is_refused_by_name(tmp_path, row, words):
    settings = study_of(tmp_path, HEAD + row + "\n")
    with pytest.raises(StudyError, match=words):
        simulate_sections(settings, settings.method, 0.8, np.random.default_rng(1))


def test_means_are_of_rests(tmp_path):
    settings = study_of(tmp_path, HEAD + SIDES + TURNS, simulation="[simulation]\nmeans = true\n")
    with pytest.raises(StudyError, match="section turn x: found the kind turn, expected rests for means"):
        simulate_sections(settings, settings.method, 0.8, np.random.default_rng(1))


def test_rests_found_in_a_log_end_where_the_gyro_begins_to_turn(tmp_path):
    """A smooth motion shows in the gyro before it does in the accelerometers: cut by these, a rest took in 1e-3 rad of
    it, the moves lost as much at both ends (scale factors 1e-3 low), and means of the gyro scattered."""
    settings = study_of(
        tmp_path, HAND, simulation=QUIET + 'gyro_noise = "0.3 deg/sqrt(h)"\nturning = "2 s"\n'
    )
    record, truth = simulate_sections(settings, settings.method, 0.84, np.random.default_rng(9))
    bare = replace(record, labels=())
    unsaid = replace(settings, method=type(settings.method)())
    found = calibrate_from_sections([bare], unsaid, unsaid.method).estimate
    assert found.result["sections"]
    for axis in "xyz":
        S, D_F = found[f"S_{axis}"], found[f"D_F_{axis}"]
        assert abs(S.value / truth.values()[f"S_{axis}"] - 1.0) < 5e-4
        assert D_F.u / S.value < 5e-5
