"""`inercal design sections`: what it foretells is what calibrating gives, and what one more section gains."""

import json

import numpy as np
import pytest

from inercal.cli import run
from inercal.faces.python.verbs import design
from inercal.faces.studies.load import load_study
from inercal.foundation.errors import StudyError
from inercal.systems.imu.sections.design import design as judge
from inercal.systems.imu.sections.outcome import calibrate_from_sections
from inercal.systems.imu.sections.simulate import simulate_sections
from inercal.systems.listed import SYSTEMS

SITE = '[site]\nlatitude = "48 deg"\ngravity = "9.809(1) m/s^2"\n[imu]\nmethod = "sections"\nplacing = "0.3 deg"\n'
QUIET = '[simulation]\naccelerometer_wander = "0 ug"\ngyro_wander = "0 deg/h"\n'
HEAD = "section,kind,up,axis,rate,angle\n"
SIDES = "".join(f"{side},rest,{side},,,\n" for side in ("+x", "-x", "+y", "-y", "+z", "-z"))
TURNS = "".join(f"turn {axis},turn,+{axis},+{axis},,360.0(2) deg\n" for axis in "xyz")


def study_of(folder, table, keys=""):
    (folder / "sections.csv").write_text(table)
    path = folder / "imu.toml"
    path.write_text(SITE + keys + 'sections = "sections.csv"\n' + QUIET)
    return load_study(SYSTEMS["imu"], path, ())


def test_u_foretold_is_the_u_that_calibrating_a_simulated_recording_gives(tmp_path):
    """Noise is told by the recording itself, within some hundredths; scales are relative, as outputs are counts. Where
    tilts are drawn large, their square is in u(K1), too."""
    settings = study_of(tmp_path, HEAD + SIDES + TURNS)
    told = judge(settings, settings.method).foretold
    record, truth = simulate_sections(settings, settings.method, 0.84, np.random.default_rng(451))
    found = calibrate_from_sections([record], settings, settings.method).estimate
    of = truth.values()
    per = {"K0": "K1", "K1": "K1", "D_F": "S", "S": "S", "G": "S"}
    ratios = {}
    for name in found.names:
        head = name.rpartition("_")[0]
        size = of[f"{per[head]}_{name[len(head) + 1]}"] if head in per else 1.0
        ratios[name] = found[name].u / size / told.u[name]
    assert set(found.names) == set(told.u)
    assert min(ratios.values()) > 0.8
    assert max(ratio for name, ratio in ratios.items() if not name.startswith("K1")) < 1.2
    assert max(ratios.values()) < 1.8


def test_one_more_section_never_makes_anything_less_sure_and_gains_what_was_foretold(tmp_path):
    """Information adds up (but for moves, whose rests share an unknown heading: a hundredth). The section foretold, put
    into the table, gives the u that was said of it."""
    designed = judge(settings := study_of(tmp_path, HEAD + SIDES), settings.method)
    for one in designed.candidates:
        slack = 0.01 if "move" in one.section else 1e-9
        assert all(one.u[name] <= u * (1.0 + slack) for name, u in designed.foretold.u.items())
    best = designed.best_for("S_z")
    assert best is not None
    assert best.section.endswith("about z")
    (turn,) = [one for one in designed.candidates if one.section == "a turn of 360(1) deg about z"]
    more = study_of(tmp_path, HEAD + SIDES + "t,turn,+z,+z,,360(1) deg\n")
    after = judge(more, more.method).foretold
    for name, u in after.u.items():
        assert u == pytest.approx(turn.u[name], rel=1e-9)


def test_moves_of_a_hand_tell_the_gyro_and_the_move_foretold_is_the_move_in_the_table(tmp_path):
    rests = "section,kind\n" + "".join(f"rest {k},rest\n" for k in range(1, 13))
    without = judge(study := study_of(tmp_path, rests), study.method)
    assert all(name in without.foretold.by_prior for name in ("S_x", "S_y", "S_z"))
    moves = "".join(f"rest {k},rest\nmove {k},move\n" for k in range(1, 13))
    hand = judge(study := study_of(tmp_path, "section,kind\n" + moves), study.method)
    assert not {"S_x", "S_y", "S_z"} & set(hand.foretold.by_prior)
    one = judge(study := study_of(tmp_path, rests.replace("rest 2,", "m,move\nrest 2,")), study.method)
    (foretold,) = [each for each in without.candidates if each.section == "a move from rest 1 to rest 2"]
    for name, u in one.foretold.u.items():
        assert u == pytest.approx(foretold.u[name], rel=1e-9)


def test_too_few_sections_say_what_they_leave_open(tmp_path):
    designed = judge(study := study_of(tmp_path, HEAD + "a,rest,,,,\nb,rest,,,,\n"), study.method)
    assert "would leave" in designed.message
    assert "K0_x" in designed.message
    assert "open" in designed.tables()[0].text()
    with pytest.raises(StudyError, match="found no rest, rate or turn"):
        judge(study := study_of(tmp_path, "section,kind\ns,swing\n"), study.method)


def test_a_table_alone_is_a_study(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "sections.csv").write_text(HEAD + SIDES)
    assert run(["design", "sections", "sections.csv", "--json", "--report", "page.html"]) == 0
    result = json.loads(capsys.readouterr().out)["result"]
    assert {"predicted", "by_prior", "candidates", "open", "sections"} <= set(result)
    factors = [one["factor"] for one in result["candidates"]]
    assert factors == sorted(factors)
    assert "One section more" in (tmp_path / "page.html").read_text()
    (tmp_path / "imu.toml").write_text(
        '[site]\nlatitude = "45 deg"\n[imu]\nmethod = "sections"\nsections = "sections.csv"\n'
    )
    assert design("imu.toml").estimate.result["predicted"] == result["predicted"]
    assert run(["calibrate", "imu", "log.csv", "--study", "sections.csv"]) == 2
    assert "fill in site.latitude" in capsys.readouterr().err


def test_a_study_without_sections_is_judged_by_its_poses_in_the_hand(tmp_path):
    settings = study_of(tmp_path, HEAD + SIDES)
    designed = judge(settings, type(settings.method)())
    assert designed.count == settings.simulation.poses
    assert not {"S_x", "S_y", "S_z", "K0_x"} & set(designed.foretold.by_prior)
