"""Records as recordings of a platform: SI, one clock, continuous angles; and what is said of records that are wrong."""

import gzip
import re
from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from paper_study import DEG, study

from inercal.foundation.errors import RecordError
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.foundation.inputs import Source
from inercal.foundation.records.checks import check
from inercal.foundation.records.column import Column
from inercal.foundation.records.read import read
from inercal.foundation.records.record import Record
from inercal.foundation.records.write import SUFFIXES, write_record
from inercal.foundation.units import parse_unit
from inercal.systems.selfcal.platform.plan import PlatformPlan, Rest, Turn, path
from inercal.systems.selfcal.platform.rig import Gimbals
from inercal.systems.selfcal.reading import recording_of
from inercal.systems.selfcal.simulate import experiment, simulate, to_record
from inercal.systems.selfcal.task import calibrate

# All three joints turn; 108 s.
PLAN = PlatformPlan(
    (Turn("z", 90 * DEG), Turn("x", 120 * DEG), Turn("y", 60 * DEG), Turn("x", -60 * DEG), Rest(10.0),
     Turn("z", -100 * DEG)),
    rate=5 * DEG,
)  # fmt: skip
STUDY = study(plan=PLAN)
SIMULATED = simulate(experiment(STUDY), np.random.default_rng(1)).recording
RECORD = to_record(SIMULATED)
ROWS = len(SIMULATED.t)


def changed(change, record=RECORD):
    """The record with its columns (a dictionary of copies, and the time) changed in place, or given back anew."""
    values = {name: column.values.copy() for name, column in record.columns.items()}
    t = record.columns["th_x"].t.copy()
    values, t = change(values, t) or (values, t)
    columns = {name: replace(record.columns[name], values=each, t=t) for name, each in values.items()}
    return Record(columns, record.findings, record.sources)


def scaled(prefix, factor):
    """A change of units that went wrong."""

    def change(values, t):
        for name in values:
            if name.startswith(prefix):
                values[name] *= factor

    return changed(change)


def exchanged(a, b):
    def change(values, t):
        values[a], values[b] = values[b], values[a]

    return changed(change)


def kept(rows):
    """The record of those rows alone."""
    return changed(lambda values, t: ({name: each[rows] for name, each in values.items()}, t[rows]))


def codes(recording):
    return [finding.code for finding in recording.findings]


def said(recording):
    return " ".join(finding.message for finding in recording.findings)


def test_a_simulated_record_is_the_recording_again():
    found = recording_of(RECORD, STUDY)
    assert_allclose(found.t, SIMULATED.t)
    assert_allclose(found.rate, SIMULATED.rate, rtol=1e-14)
    assert_allclose(found.th, SIMULATED.th, rtol=1e-14)
    assert_allclose(found.acc, SIMULATED.acc, rtol=1e-14)
    assert not found.measured
    assert found.findings == ()
    assert found.sources == RECORD.sources
    for each in (found.rate, found.th, found.acc, replace(found, acc=np.asfortranarray(found.acc)).acc):
        assert each.flags.c_contiguous  # as the kernels are compiled for


@pytest.mark.parametrize("suffix", [*SUFFIXES, ".csv.gz", ".mat"])
def test_the_same_from_a_file_of_any_format(suffix, tmp_path):
    """Dropouts stay missing; the last rate and the first accelerometers, which nobody needs, are not worth a word."""
    lossy = study(plan=PLAN, disturbances=replace(STUDY.disturbances, dropouts=0.05))
    recording = simulate(experiment(lossy), np.random.default_rng(2)).recording
    record, file = to_record(recording), tmp_path / f"r{suffix}"
    if suffix == ".mat":
        scipy_io = pytest.importorskip("scipy.io")
        columns = {name: column.values for name, column in record.columns.items()}
        scipy_io.savemat(file, {"t": recording.t, **columns})
        units = {"wc": "deg/h", "th": "deg", "acc": "m/s^2", "t": "s"}
        entries = (
            f'[columns.{name}]\nfrom = "{name}"\nunit = "{units[name.partition("_")[0]]}"\n'
            for name in ("t", *columns)
        )
        (tmp_path / "map.toml").write_text("".join(entries))
        again = recording_of(read(file, tmp_path / "map.toml"), lossy)
    elif suffix == ".csv.gz":
        write_record(record, tmp_path / "plain.csv")
        file.write_bytes(gzip.compress((tmp_path / "plain.csv").read_bytes()))
        again = recording_of(read(file), lossy)
    else:
        write_record(record, file)
        again = recording_of(read(file), lossy)
    assert np.isnan(again.th[1:]).any()
    for mine, theirs in zip(
        (again.t, again.rate, again.th, again.acc),
        (recording.t, recording.rate, recording.th, recording.acc),
        strict=True,
    ):
        assert_allclose(mine, theirs, rtol=1e-13, atol=1e-15)
    assert set(codes(again)) <= {"nan"}
    assert "wc" not in said(again)


def test_each_column_in_its_own_unit():
    units = {"wc_x": "rad/s", "th_y": "arcmin", "acc_z": "mg", "acc_x": "ug"}
    columns = dict(RECORD.columns)
    for name, symbol in units.items():
        unit = parse_unit(symbol)
        columns[name] = replace(columns[name], unit=unit, values=columns[name].si() / unit.factor)
    found = recording_of(Record(columns, (), RECORD.sources), STUDY)
    assert_allclose(found.rate, SIMULATED.rate, rtol=1e-13)
    assert_allclose(found.th, SIMULATED.th, rtol=1e-13)
    assert_allclose(found.acc, SIMULATED.acc, rtol=1e-13)


def of_gyros(increment=False):
    """The record with measured rates in the place of the commanded ones."""
    columns = {name: column for name, column in RECORD.columns.items() if not name.startswith("wc")}
    for k, axis in enumerate("xyz"):
        rate = np.append(SIMULATED.rate[:, k], np.nan)
        gained = np.append(np.nan, SIMULATED.rate[:, k])
        columns[f"gyro_{axis}"] = Column(
            f"gyro_{axis}", parse_unit("rad/s"), gained if increment else rate,
            columns["th_x"].t, Source("g", ""), increment=increment,
        )  # fmt: skip
    return Record(columns, (), RECORD.sources)


@pytest.mark.parametrize("increment", [False, True])
def test_measured_rates_in_place_of_commanded_ones(increment):
    """A rate holds from its row on; what was gained since the row before belongs to the interval before."""
    found = recording_of(of_gyros(increment), STUDY)
    assert found.measured
    assert_allclose(found.rate, SIMULATED.rate, rtol=1e-14)


def test_increments_from_a_file(tmp_path):
    """A map with kind = "increment": the reader divides by the interval and keeps that they were gained before."""
    dt = SIMULATED.dt[0]
    gained = np.vstack([np.full(3, np.nan), SIMULATED.rate * dt])
    table = np.column_stack([SIMULATED.t, gained, SIMULATED.th, SIMULATED.acc])
    np.savetxt(tmp_path / "r.csv", table, delimiter=",")
    names = ["t", *(f"{s}_{i}" for s in ("gyro", "th", "acc") for i in "xyz")]
    units = ["s", *["rad"] * 6, *["m/s^2"] * 3]
    entries = [
        f'[columns.{name}]\nfrom = {k}\nunit = "{unit}"\n'
        + ('kind = "increment"\n' if name[0] == "g" else "")
        for k, (name, unit) in enumerate(zip(names, units, strict=True))
    ]
    (tmp_path / "map.toml").write_text("".join(entries))
    found = recording_of(read(tmp_path / "r.csv", tmp_path / "map.toml"), STUDY)
    assert_allclose(found.rate, SIMULATED.rate, rtol=1e-12)
    assert "contradiction" not in codes(found)


def of_coarse_gyros(rate):
    """The record with measured rates (n - 1, 3), as a file of them is read: with the findings of single channels."""
    record = of_gyros()
    columns = {
        name: replace(column, values=np.append(rate[:, "xyz".index(name[-1])], np.nan))
        if name.startswith("gyro")
        else column
        for name, column in record.columns.items()
    }
    return Record(columns, check(columns), record.sources)


def test_a_quiet_gyro_at_constant_rates_is_not_saturated():
    """Steps of 1e-7 deg/s beside less noise: each turn is one reading, at an extreme, and the encoders agree."""
    step = 1e-7 * DEG
    record = of_coarse_gyros(np.round(SIMULATED.rate / step) * step)
    assert [each.harm for each in record.findings if each.code == "saturation"] == [
        ("gyro_x",), ("gyro_y",), ("gyro_z",)
    ]  # fmt: skip
    assert "saturation" not in codes(recording_of(record, STUDY))
    assert calibrate(record, STUDY).estimate.status is Status.OK


def test_a_clipped_gyro_is_saturated():
    """Of turns at 5 deg/s all above 4.9 deg/s is lost, and the encoders turn on."""
    record = of_coarse_gyros(np.clip(SIMULATED.rate, -4.9 * DEG, 4.9 * DEG))
    assert codes(recording_of(record, STUDY)).count("saturation") == 3
    assert calibrate(record, STUDY).estimate.status is Status.INCONSISTENT


def test_commands_win_over_gyros():
    both = {**of_gyros().columns, **RECORD.columns}
    assert not recording_of(Record(both, (), RECORD.sources), STUDY).measured


@pytest.mark.parametrize("low", [-180.0, -90.0, 0.0])
def test_jumps_by_a_full_turn_change_nothing(low, tmp_path):
    """Encoders that count within one turn, also where rows around the jump are missing."""
    turning = study(plan=path("best"))
    recording = simulate(experiment(turning), np.random.default_rng(3)).recording

    def wrap(values, t):
        for axis in "xyz":
            values[f"th_{axis}"] = np.remainder(values[f"th_{axis}"] - low, 360.0) + low
            values[f"th_{axis}"][430:470] = np.nan

    wrapped = changed(wrap, to_record(recording))
    write_record(wrapped, tmp_path / "w.csv")
    known = np.isfinite(wrapped["th_x"].values)
    for record in (wrapped, read(tmp_path / "w.csv")):
        found = recording_of(record, turning)
        assert codes(found).count("wrap_2pi") >= 1
        assert "contradiction" not in codes(found)
        turns = (found.th[known] - recording.th[known]) / (2.0 * np.pi)
        assert_allclose(turns, np.broadcast_to(np.rint(turns[0]), turns.shape), atol=1e-12)


UNITS = {
    "degrees as radians": (("th", 180 / np.pi), "0.0174.* degrees and radians look exchanged"),
    "radians as degrees": (("th", np.pi / 180), "57[.].* degrees and radians look exchanged"),
    "deg/h as deg/s": (("wc", 3600.0), "36.. times.* per hour"),
    "deg/s as deg/h": (("wc", 1 / 3600.0), "0.00027.* per hour"),
    "rad/s as deg/h": (("wc", np.pi / 180 / 3600), "deg/h and rad/s"),
    "mdeg/s as deg/s": (("wc", 1e3), "thousandths"),
    "something else": (("wc", 17.0), "units look exchanged"),
}


@pytest.mark.parametrize(("change", "words"), UNITS.values(), ids=UNITS)
def test_units_of_rates_and_angles_that_contradict_each_other(change, words):
    with pytest.raises(RecordError, match=words) as error:
        recording_of(scaled(*change), STUDY)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("factor", [1 / 9.80665, 9.80665, 1e3])
def test_accelerometers_in_another_unit(factor, tmp_path):
    """Said once, whether the reader has seen it or not."""
    wrong = scaled("acc", factor)
    assert codes(recording_of(wrong, STUDY)) == ["unit_suspect"]
    write_record(wrong, tmp_path / "g.csv")
    assert codes(recording_of(read(tmp_path / "g.csv"), STUDY)).count("unit_suspect") == 1


FAULTS = {
    "accelerometers exchanged": (exchanged("acc_x", "acc_y"), "channel_swap", "acc_x should be acc_y"),
    "an accelerometer reversed": (scaled("acc_z", -1.0), "sign_suspect", "acc_z should be -acc_z"),
    "an angle reversed": (scaled("th_z", -1.0), "sign_suspect", r"signs = \[1, 1, -1\]"),
    "rates all reversed": (scaled("wc", -1.0), "sign_suspect", ""),
    "angles exchanged": (exchanged("th_x", "th_z"), "channel_swap", "th_x looks like th_z, th_z looks like th_x"),
}  # fmt: skip


@pytest.mark.parametrize(("record", "code", "words"), FAULTS.values(), ids=FAULTS)
def test_axes_exchanged_or_reversed(record, code, words):
    found = recording_of(record, replace(STUDY, plan=None))
    assert codes(found) == [code]
    assert re.search(words, said(found))


@pytest.mark.parametrize("axes", [("x", "z", "y"), ("y", "x", "z"), ("z", "y", "x")])
def test_gimbals_of_another_order_than_the_study_says(axes):
    found = recording_of(RECORD, replace(STUDY, gimbals=Gimbals(axes)))
    assert codes(found) == ["channel_swap"]
    assert "gimbals = ['z', 'x', 'y'], signs = [1, 1, 1], not with those of the study" in said(found)


@pytest.mark.parametrize("signs", [(-1, 1, 1), (1, -1, 1), (1, 1, -1), (-1, -1, -1)])
def test_signs_other_than_the_study_says(signs):
    found = recording_of(RECORD, replace(STUDY, gimbals=Gimbals(signs=signs)))
    assert codes(found) == ["sign_suspect"]
    assert "signs = [1, 1, 1], not with those of the study" in said(found)


def test_rates_that_have_nothing_to_do_with_the_angles():
    def other(values, t):
        for axis in "xyz":
            values[f"wc_{axis}"][:-1] = np.roll(values[f"wc_{axis}"][:-1], 200)

    found = recording_of(changed(other), STUDY)
    assert "contradiction" in codes(found)
    assert "th: the angles do not follow the rates wc_x..z" in said(found)


def test_a_record_shorter_than_the_path():
    found = recording_of(kept(slice(0, 300)), STUDY)
    assert codes(found) == ["truncated"]
    assert f"ends after 59.8 s, the study's path takes {PLAN.duration:g} s" in said(found)


def test_angles_at_gimbal_lock_are_not_off_the_path():
    """There outer and platform angle are not unique: any of one sum (or difference) are the same attitude."""
    turns = PlatformPlan((Turn("y", 90 * DEG), Rest(30.0), Turn("z", 90 * DEG)))
    stated = study(plan=turns)
    record = to_record(simulate(experiment(stated), np.random.default_rng(3)).recording)
    away = np.abs(record["th_x"].si())
    assert np.nanmax(away) > 10 * DEG
    assert codes(recording_of(record, stated)) == []


def test_a_record_of_another_path():
    found = recording_of(RECORD, replace(STUDY, plan=replace(PLAN, moves=PLAN.moves[::-1])))
    assert codes(found) == ["contradiction"]
    assert "leaves the study's path" in said(found)
    assert codes(recording_of(RECORD, replace(STUDY, plan=None))) == []


def test_a_platform_at_rest():
    def still(values, t):
        for axis in "xyz":
            values[f"th_{axis}"] *= 1e-9
            values[f"wc_{axis}"] *= 1e-9
            values[f"acc_{axis}"][:] = 9.80 if axis == "y" else 0.0

    found = recording_of(changed(still), replace(STUDY, plan=None))
    assert codes(found) == ["at_prior"]
    assert "does not turn" in said(found)


def test_a_turn_is_held_where_no_rate_is_known():
    """Within a turn rates are those that were commanded, to 0.1 % of earth rate, which turns in p meanwhile."""

    def lost(values, t):
        values["wc_x"][100:117] = np.nan
        values["wc_y"][110] = np.nan

    found = recording_of(changed(lost), STUDY)
    assert_allclose(found.rate[100:117], SIMULATED.rate[100:117], atol=1e-3 * EARTH_RATE)
    assert_allclose(found.rate[:, 2], SIMULATED.rate[:, 2], rtol=1e-14)
    assert found.held == tuple(range(100, 117))
    assert codes(found) == ["nan"]
    assert "no rate in 17 rows, the platform is taken to turn on as before" in said(found)
    assert found.findings[0].where == "rows 101-117"


def test_a_turn_is_held_through_a_gap(tmp_path):
    rows = np.r_[0:150, 160:ROWS]
    write_record(kept(rows), tmp_path / "gap.csv")
    found = recording_of(read(tmp_path / "gap.csv"), STUDY)
    assert found.dt[149] == pytest.approx(11 * 0.2)
    # one rotation of what is commanded from row to row: their sum, but for what does not commute
    assert_allclose(found.rate[149], SIMULATED.rate[149:160].mean(axis=0), atol=0.02 * EARTH_RATE)
    assert np.abs(SIMULATED.rate[149] - found.rate[149]).max() > 0.05 * EARTH_RATE
    assert found.held == (149,)
    assert codes(found) == ["gap", "gap"]
    assert "turn on as before through 2.2 s" in said(found)


def test_the_first_complete_row_is_the_start():
    def late(values, t):
        values["th_x"][:3] = np.nan
        values["wc_z"][3] = np.nan

    found = recording_of(changed(late), STUDY)
    assert found.t[0] == pytest.approx(0.8)
    assert len(found.t) == ROWS - 4
    assert_allclose(found.th, SIMULATED.th[4:], rtol=1e-14)
    assert codes(found) == ["nan"]
    assert found.findings[0].where == "rows 1-4"


def test_rows_without_a_time_are_left_out():
    def timeless(values, t):
        t[50:52] = np.nan
        return values, t

    found = recording_of(changed(timeless), STUDY)
    assert len(found.t) == ROWS - 2
    assert found.dt[49] == pytest.approx(0.6)
    assert "2 rows without a time left out" in said(found)


@pytest.mark.parametrize(
    ("row", "by", "code"),
    [(10, 0.0, "duplicate_time"), (20, -0.1, "backward_time"), (20, -3.0, "backward_time")],
)
def test_a_row_that_is_not_later_is_left_out(row, by, code):
    def back(values, t):
        t[row] = t[row - 1] + by
        return values, t

    found = recording_of(changed(back), STUDY)
    assert len(found.t) == ROWS - 1
    (finding,) = [each for each in found.findings if each.code == code and each.where == f"row {row + 1}"]
    assert finding.message == "t: 1 row not later than those before left out"


def test_time_must_increase():
    def back(values, t):
        t[20:] -= 3.0
        return values, t

    with pytest.raises(
        RecordError, match=r"t: 1\d rows in a row from row 21 on are not later .* expected time to in"
    ):
        recording_of(changed(back), STUDY)


def without(*names):
    return Record({n: c for n, c in RECORD.columns.items() if n not in names}, (), RECORD.sources)


def nan(values, t):
    for axis in "xyz":
        values[f"acc_{axis}"][:] = np.nan


def one_angle(values, t):
    values["th_y"][1:] = np.nan


REFUSED = {
    "no accelerometers": (without("acc_x", "acc_y", "acc_z"), "found no acc_x, acc_y, acc_z among wc_x"),
    "one angle missing": (without("th_y"), "found no th_y among"),
    "a rate missing": (without("wc_y"), "no whole rate wc_x, wc_y, wc_z"),
    "accelerometers empty": (changed(nan), "acc_x, acc_y, acc_z hold no number"),
    "nine rows": (kept(slice(0, 9)), "found 9 rows .*expected 10 or more"),
    "angles but once": (changed(one_angle), "found one row with all angles"),
    "nothing": (Record({}, (), RECORD.sources), "among no columns"),
    "counts": (
        Record({**RECORD.columns, "th_x": replace(RECORD["th_x"], unit=parse_unit("count"))}, (), RECORD.sources),
        "th_x is in count, expected physical units",
    ),
    "two clocks": (
        Record({**RECORD.columns, "acc_x": replace(RECORD["acc_x"], t=SIMULATED.t + 0.1)}, (), RECORD.sources),
        "acc_x has another clock than wc_x",
    ),
}  # fmt: skip


@pytest.mark.parametrize(("record", "words"), REFUSED.values(), ids=REFUSED)
def test_one_sentence_for_a_record_that_cannot_be_used(record, words):
    with pytest.raises(RecordError, match=words) as error:
        recording_of(record, STUDY)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("seed", range(5))
def test_sound_records_say_nothing(seed):
    """Coefficients three times as large as the paper's, high noise, dropouts, any rig: no false alarm."""
    rng = np.random.default_rng(seed)
    axes = [("z", "x", "y"), ("x", "y", "z"), ("y", "z", "x"), ("z", "y", "x"), ("x", "z", "y")][seed]
    signs = tuple(int(sign) for sign in rng.choice([1, -1], 3))
    rig = study(
        plan=PLAN,
        noise="high",
        truth=3.0 * STUDY.truth * rng.choice([1.0, -1.0], 24),
        gimbals=Gimbals(axes, signs),
        base=replace(STUDY.base, heading=rng.uniform(-3, 3), tilt=(0.2, -0.1)),
        disturbances=replace(STUDY.disturbances, dropouts=0.1),
    )
    record = to_record(simulate(experiment(rig), rng).recording)
    assert recording_of(record, rig).findings == ()
