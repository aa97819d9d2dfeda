"""A platform calibrated row by row: to the digits of the whole file, whatever the rows are like, killed or not."""

import io
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from paper_study import TRUTH, study
from streams_that_break import lines_out

from inercal.faces.stream.lines import Lines
from inercal.faces.stream.run import Saving, run
from inercal.faces.stream.selfcal import Selfcal
from inercal.foundation.errors import InputError, RecordError, StudyError
from inercal.foundation.records.maps import read_map
from inercal.foundation.records.read import read
from inercal.foundation.records.write import write_record
from inercal.systems.selfcal.disturbances import Disturbances
from inercal.systems.selfcal.filters.filter_result import product_form
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.platform.coefficients import KA1, names
from inercal.systems.selfcal.platform.plan import PlatformPlan, Rest, Turn
from inercal.systems.selfcal.reading import recording_of
from inercal.systems.selfcal.result.columns import history_record
from inercal.systems.selfcal.settings import Filter, Gating
from inercal.systems.selfcal.simulate import experiment, simulate, to_record

DEG = np.pi / 180.0
RECURSIVE = ("error-state", "svd-qukf", "gimbal-ukf")

#: through more than half a turn, so that encoders wrap, and away from gimbal lock
SHORT = PlatformPlan(
    (Turn("z", 210 * DEG), Turn("y", 20 * DEG), Rest(4.0), Turn("x", -30 * DEG)), rate=5.0 * DEG
)


def recorded(tmp_path, seed=1, plan=SHORT, change=lambda rows: rows, **disturbances):
    """Header and rows of a simulated file, fields as text."""
    settings = study(plan=plan, disturbances=Disturbances(**disturbances))
    record = to_record(simulate(experiment(settings), np.random.default_rng(seed)).recording)
    write_record(record, tmp_path / "log.csv")
    header, *rows = (tmp_path / "log.csv").read_text().splitlines()
    fields = change([dict(zip(header.split(","), row.split(","), strict=True)) for row in rows])
    return "\n".join([header, *(",".join(row.values()) for row in fields)]) + "\n"


def live(text, settings, every=0.0, saving=None, kill=None, said=None):
    """Lines out for such a file."""
    lines = Lines(io.BytesIO(text.encode()), "log", None, lambda finding: None)
    estimator = Selfcal(lines, problem(settings), every, lambda f: None if said is None else said.append(f))
    return lines_out(estimator, lines, saving, kill)


def of_file(text, settings, tmp_path):
    """The history that a whole file gives, as lines."""
    (tmp_path / "whole.csv").write_text(text)
    recording = recording_of(read(tmp_path / "whole.csv"), settings)
    told = problem(settings)
    write_record(history_record(estimate(recording, told), recording, told.world), tmp_path / "history.csv")
    return (tmp_path / "history.csv").read_text().splitlines()


def flawed(rows):
    """Rows that wait for their angles, lose some, lack rates, have no time, wrap, and are not there."""
    for row in rows:
        row["th_z [deg]"] = repr((float(row["th_z [deg]"] or "nan") + 180.0) % 360.0 - 180.0).replace(
            "nan", ""
        )
    rows[0]["th_y [deg]"] = ""
    rows[1]["wc_x [deg/h]"] = ""
    rows[60]["wc_z [deg/h]"] = ""
    rows[80]["t [s]"] = ""
    rows[90]["acc_y [m/s^2]"] = ""
    rows[95]["th_x [deg]"] = ""
    return rows[:150] + rows[158:]


@pytest.mark.parametrize("kind", RECURSIVE)
def test_lines_are_the_history_of_the_whole_file_to_the_last_digit(kind, tmp_path):
    settings = study(plan=None, filter=Filter(kind))
    text = recorded(tmp_path, dropouts=0.05, change=flawed)
    assert live(text, settings) == of_file(text, settings, tmp_path)


@pytest.mark.parametrize(
    "filter_",
    [Filter("svd-qukf", extended=True), Filter(gating=Gating("channel")), Filter("gimbal-ukf", factor="svd")],
)
def test_so_they_are_with_other_states_gating_and_factors(filter_, tmp_path):
    settings = study(plan=None, filter=filter_)
    text = recorded(tmp_path, 2)
    assert live(text, settings) == of_file(text, settings, tmp_path)


def test_rows_are_gone_through_again_where_a_file_takes_a_second_pass(tmp_path):
    """Of 281 rows the last pass is at 256: a tenth of u from the two of a file, which are of all rows. Killed and
    resumed, the same digits."""
    settings = study(plan=None, filter=Filter(extended=True))
    text, saving = recorded(tmp_path, 2), Saving(tmp_path / "state", 7)
    lines = live(text, settings)
    assert lines != of_file(text, settings, tmp_path)
    (tmp_path / "record.csv").write_text(text)
    found = estimate(recording_of(read(tmp_path / "record.csv"), settings), problem(settings))
    last = np.array([float(each) for each in lines[-1].split(",")])
    values, u = last[11:-2:2], last[12:-2:2]
    assert_allclose(values / u, product_form(found)[0] / u, atol=0.1)
    given = [each for kill in (60, 130, 200, None) for each in live(text, settings, saving=saving, kill=kill)]
    assert list(dict.fromkeys(given)) == lines


def across(rows):
    """Rows that lack the end of the first turn, encoders silent behind it; rates that lack the beginning of another."""
    for k, row in enumerate(rows):
        if 216 <= k < 222:
            row["th_x [deg]"] = ""
        if 250 <= k < 256:
            row["wc_x [deg/h]"] = ""
    return rows[:204] + rows[216:]


@pytest.mark.parametrize("kind", RECURSIVE)
def test_a_turn_that_ended_in_a_gap_is_found_out_as_in_a_file(kind, tmp_path):
    settings, said = study(plan=None, filter=Filter(kind)), []
    text = recorded(tmp_path, 6, change=across)
    assert live(text, settings, said=said) == of_file(text, settings, tmp_path)
    anew = [finding for finding in said if "attitude is taken anew" in finding.message]
    assert [finding.code for finding in anew] == ["gap"] * len(anew)
    assert anew[0].where == "t = 44.4 s"


def test_killed_in_doubt_and_resumed(tmp_path):
    settings, saving = study(plan=None), Saving(tmp_path / "state", 1)
    text = recorded(tmp_path, 6, change=across)
    given = []
    for kill in (207, 241, None):
        given += live(text, settings, saving=saving, kill=kill)
    assert list(dict.fromkeys(given)) == live(text, settings)


@pytest.mark.parametrize("rows", [slice(0, 0), slice(100, 120)])
def test_increments_in_the_place_of_rates(rows, tmp_path):
    """Gained since the row before: over a gap the last interval's is known, and held backward."""
    settings = study(plan=None)
    record = to_record(simulate(experiment(study(plan=SHORT)), np.random.default_rng(7)).recording)
    names = [f"wc_{axis}" for axis in "xyz"]
    gained = {name: np.append(np.nan, record[name].si()[:-1]) * 0.2 for name in names}
    columns = [record["th_x"].t, *gained.values()]
    columns += [record[f"{name}_{axis}"].si() for name in ("th", "acc") for axis in "xyz"]
    table = np.delete(np.column_stack(columns), np.arange(len(columns[0]))[rows], axis=0)
    text = "\n".join(",".join("" if x != x else repr(float(x)) for x in row) for row in table) + "\n"
    titles = ["t", *names, *(f"{name}_{axis}" for name in ("th", "acc") for axis in "xyz")]
    units = ["s", *["rad"] * 6, *["m/s^2"] * 3]
    entries = [
        f'[columns.{name}]\nfrom = {k}\nunit = "{unit}"\n'
        + ('kind = "increment"\n' if name[0] == "w" else "")
        for k, (name, unit) in enumerate(zip(titles, units, strict=True))
    ]
    (tmp_path / "map.toml").write_text('[time]\nrate = "5 Hz"\n' + "".join(entries))
    (tmp_path / "whole.csv").write_text(text)
    recording = recording_of(read(tmp_path / "whole.csv", tmp_path / "map.toml"), settings)
    found = estimate(recording, problem(settings))
    assert len(recording.held) == (rows.stop > 0)
    assert found.restarts == ()
    assert found.nis_mean == pytest.approx(6.0, abs=5.0 * np.sqrt(12.0 / len(found.nis)))
    lines = Lines(io.BytesIO(text.encode()), "log", read_map(tmp_path / "map.toml"), lambda finding: None)
    out = []
    run(Selfcal(lines, problem(settings)), lines, out.append)
    told = problem(settings)
    write_record(history_record(found, recording, told.world), tmp_path / "history.csv")
    whole = (tmp_path / "history.csv").read_text().splitlines()
    assert out[0] == whole[0]
    numbers = [np.genfromtxt(each[1:], delimiter=",") for each in (out, whole)]
    assert_allclose(
        numbers[0], numbers[1], rtol=1e-6, atol=1e-12
    )  # increments become rates by other roundings


def test_measured_rates_in_the_place_of_commanded_ones(tmp_path):
    settings = study(plan=None)
    text = recorded(tmp_path, 3).replace("wc_", "gyro_")
    assert live(text, settings) == of_file(text, settings, tmp_path)


@pytest.mark.parametrize("kind", RECURSIVE)
def test_killed_anywhere_and_resumed(kind, tmp_path):
    """Before the start, at its first row, in the midst and near the end: every line is one of the whole run."""
    settings = study(plan=None, filter=Filter(kind))
    text = recorded(tmp_path, 4, change=flawed)
    whole = live(text, settings)
    saving = Saving(tmp_path / "state", 7)
    given = []
    for kill in (1, 3, 20, 100, 155, None):
        given += live(text, settings, saving=saving, kill=kill)
    assert set(given) == set(whole)
    assert list(dict.fromkeys(given)) == whole


def test_a_state_of_another_study_is_not_gone_on_with(tmp_path):
    text = recorded(tmp_path)
    saving = Saving(tmp_path / "state", 50)
    live(text, study(plan=None), saving=saving)
    with pytest.raises(InputError, match="other settings"):
        live(text, study("paper", "low", plan=None), saving=saving)


def test_coefficients_come_to_the_truth_and_their_uncertainty_holds_it(tmp_path):
    """At the end of the paper's path the last line is within 4.5 u of the truth, u far below the prior."""
    settings = study()
    out = live(recorded(tmp_path, 5, plan=settings.plan), settings, every=60.0)
    last = dict(zip(out[0].split(","), map(float, out[-1].split(",")), strict=True))
    names = [title for title in last if f"u_{title}" in last]
    assert len(names) == 18
    values = np.array([last[name] for name in names])
    u = np.array([last[f"u_{name}"] for name in names])
    assert np.abs((values - TRUTH[:18]) / u).max() < 4.5
    # dsz and doy are what this path cannot tell
    told = [k for k, name in enumerate(names) if name.split(" ")[0] not in ("ds_z", "do_y")]
    assert (u / settings.prior[:18])[told].max() < 0.05
    assert abs(last["nis_mean [1]"] - 6.0) < 5.0 * np.sqrt(12.0 / 2700.0)
    # a line a minute: 0 to 540 s
    assert [float(line.split(",")[0]) for line in out[1:]] == pytest.approx(60.0 * np.arange(10))


def test_it_waits_for_the_first_whole_row(tmp_path):
    text = recorded(tmp_path, change=flawed)
    out = live(text, study(plan=None))
    assert float(out[1].split(",")[0]) == pytest.approx(0.4)
    first = dict(zip(out[0].split(","), out[1].split(","), strict=True))
    assert first["nis [1]"] == first["nis_mean [1]"] == ""
    assert float(first["kg0_x [rad/s]"]) == 0.0
    assert float(first["u_ka1_z [1]"]) == pytest.approx(1500e-6, rel=1e-12)
    for axis in "xyz":
        assert float(first[f"u_attitude_{axis} [rad]"]) == pytest.approx(2.0 / 3600.0 * DEG, rel=1e-3)


def test_a_row_that_is_not_later_is_left_out_and_time_that_stays_behind_refused(tmp_path):
    settings = study(plan=None)
    clean = recorded(tmp_path)
    rows = clean.splitlines(keepends=True)
    twice = "".join([*rows[:100], rows[99], *rows[100:]])
    assert live(twice, settings) == live(clean, settings)
    with pytest.raises(
        RecordError, match=r"10 rows in a row are not later than 19\.6 s, .* expected time to increase"
    ):
        live("".join([*rows[:100], *rows[1:]]), settings)


def test_gaps_are_said_the_first_five_of_them(tmp_path):
    def gaps(rows):
        return [row for k, row in enumerate(rows) if k % 20 or k == 0]

    said = []
    live(recorded(tmp_path, change=gaps), study(plan=None), said=said)
    assert [finding.code for finding in said] == ["gap"] * 5
    assert said[0].message.startswith("0.4 s without rows")
    assert said[-1].message.endswith("further gaps are not said")


@pytest.mark.parametrize("killed", [False, True])
def test_innovations_that_contradict_the_model_are_said_once(killed, tmp_path):
    """A platform that acts a row later than its log says: also after a restart it is said no second time."""
    said = []
    settings, saving = study(plan=None), Saving(tmp_path / "state", 10)
    text = recorded(tmp_path, command_delay=0.2)
    if killed:
        live(text, settings, saving=saving, kill=250, said=said)
    live(text, settings, saving=saving, said=said)
    assert [finding.code for finding in said] == ["excess_scatter"]
    assert "expected 6" in said[0].message


def test_sound_innovations_are_not_said(tmp_path):
    """Ten runs of other noise, judged after each of their rows: none is 5 sigma above, not even for a moment."""
    said = []
    for seed in range(100, 110):
        live(recorded(tmp_path, seed), study(plan=None), every=10.0, said=said)
    assert said == []


def test_gimbal_lock_is_said_where_the_model_does_not_hold(tmp_path):
    plan = PlatformPlan((Turn("y", 95 * DEG),), rate=5.0 * DEG)
    said = {}
    for kind in ("gimbal-ukf", "error-state"):
        said[kind] = []
        live(recorded(tmp_path, plan=plan), study(plan=None, filter=Filter(kind)), said=said[kind])
    assert "gimbal_lock" in [finding.code for finding in said["gimbal-ukf"]]
    assert said["error-state"] == []


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ("t [s],th_x [deg],th_y [deg],th_z [deg]", "no column wc_x"),
        ("t [s],wc_x [deg/h],wc_y [deg/h],wc_z [deg/h],th_x [deg],th_y [deg],th_z [deg]", "no column acc_x"),
        (
            "t [s],wc_x [deg/h],wc_y [deg/h],wc_z [deg/h],th_x [deg],th_y [deg],th_z [deg],acc_x [count],"
            "acc_y [count],acc_z [count]",
            "acc_x is in count, expected physical units",
        ),
    ],
)
def test_columns_that_do_not_do_are_one_sentence(header, words):
    row = ",".join("0" * len(header.split(",")))
    with pytest.raises(RecordError, match=words):
        live(f"{header}\n{row}\n{row}\n", study(plan=None))


def test_an_estimator_of_whole_recordings_is_refused(tmp_path):
    with pytest.raises(StudyError, match=r"filter\.kind: found map, which works on whole recordings"):
        live(recorded(tmp_path), study(filter=Filter("map")))


def test_settings_that_decide_the_digits_are_in_the_fingerprint(tmp_path):
    """Each of them changed changes what is compared with a saved state."""
    lines = Lines(io.BytesIO(recorded(tmp_path).encode()), "log", None, lambda finding: None)
    base = study(plan=None)
    others = [
        study("paper", "high", plan=None),
        replace(base, prior=2.0 * base.prior),
        replace(base, filter=Filter("svd-qukf")),
        replace(base, filter=Filter(gating=Gating("two"))),
        replace(base, base=replace(base.base, heading=0.1)),
    ]
    from inercal.faces.stream.checkpoint import fingerprint

    marks = {fingerprint(Selfcal(lines, problem(each)).settings) for each in (base, *others)}
    assert len(marks) == 1 + len(others)


def test_an_accelerometer_without_a_scale_is_said(tmp_path):
    """ka1 = -1: eta of that accelerometer is no number in the line, which has been announced."""
    said, settings = [], study(plan=None)

    def silent(rows):
        return [row | {"acc_x [m/s^2]": "", "acc_y [m/s^2]": "", "acc_z [m/s^2]": ""} for row in rows[:3]]

    lines = Lines(io.BytesIO(recorded(tmp_path, change=silent).encode()), "log", None, lambda finding: None)
    estimator, told = Selfcal(lines, problem(settings), 0.0, said.append), []
    step = estimator.step

    def without_scale(state, sample):
        if state.system.begun:
            state.system.filter.coefficients[KA1.start + 1] = -1.0
        state, out = step(state, sample)
        told.extend(dict(zip(estimator.columns, line, strict=True)) for line in out)
        return state, out

    estimator.step = without_scale
    lines_out(estimator, lines)
    assert len(told) == 3
    lost = {
        name for name in names(18) if any(np.isnan(told[-1][k]) for k in told[-1] if k.split()[0] == name)
    }
    assert lost == {"eta_oy"}
    assert [finding.code for finding in said] == ["filter_fails"]


# until the goals are met


def until(text, goal, every=0.0, saving=None):
    """Lines out, and what is said, of a stream that ends where a goal is met."""
    lines, said, out = Lines(io.BytesIO(text.encode()), "log", None, lambda _: None), [], []
    estimator = Selfcal(lines, problem(study(plan=SHORT)), every, goal=goal)
    run(estimator, lines, out.append, saving, said.append)
    return out, said


def test_it_ends_at_the_first_row_that_meets_the_goals(tmp_path):
    """The lines are those of the history up to it, whatever their interval; resumed it gives none twice."""
    text = recorded(tmp_path)
    title, *whole = of_file(text, study(plan=SHORT), tmp_path)
    at = [title.split(",").index(f"u_ka0_{axis} [m/s^2]") for axis in "xz"]
    u = np.array([[float(line.split(",")[k]) for k in at] for line in whole])
    goal = {"ka0_x": u[70, 0] * 1.001, "ka0_z": u[80, 1] * 1.001}
    first = int(np.argmax((u <= list(goal.values())).all(axis=1)))
    assert 0 < first < len(whole) - 1
    out, said = until(text, goal)
    assert out == [title, *whole[: first + 1]]
    assert said == [f"all 2 goals are met at t = {float(whole[first].split(',')[0]):.10g} s"]
    rare, _ = until(text, goal, every=1e4)
    assert rare == [title, whole[0], whole[first]]
    saving = Saving(tmp_path / "saved", 10)
    until(text, goal, saving=saving)
    assert until(text, goal, saving=saving)[0] == [title]


def test_it_does_not_end_where_the_rows_contradict_the_model(tmp_path):
    def scattered(rows):
        for k, row in enumerate(rows):
            row["th_z [deg]"] = repr(float(row["th_z [deg]"]) + 0.05 * (-1) ** k)
        return rows

    text = recorded(tmp_path, change=scattered)
    out, said = until(text, {"ka0_x": 0.0004})
    assert len(out) > 60
    assert said == []
