"""Rates commanded to the joints in the place of those of the platform, and raw counts with a nominal scale."""

import numpy as np
import pytest
from paper_study import study

from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.records.maps import read_map
from inercal.foundation.records.read import read
from inercal.foundation.records.write import write_record
from inercal.systems.selfcal.platform.plan import PlatformPlan, Rest, Turn
from inercal.systems.selfcal.reading import recording_of
from inercal.systems.selfcal.simulate import experiment, simulate, to_record
from inercal.systems.selfcal.task import calibrate

D = np.pi / 180.0
PLAN = PlatformPlan(
    (Turn("x", -90 * D), Turn("y", 40 * D), Turn("z", -150 * D), Rest(5.0), Turn("x", -60 * D)), 3.0 * D,
    start=(0.1, 0.0, -0.2),
)  # fmt: skip
STUDY = study(plan=PLAN)


@pytest.fixture(scope="module")
def log(tmp_path_factory):
    """Columns of a simulated file, by name, as text."""
    path = tmp_path_factory.mktemp("log") / "platform.csv"
    made = simulate(experiment(STUDY), np.random.default_rng(20261124))
    write_record(to_record(made.recording), path)
    head, *rows = path.read_text().splitlines()
    columns = zip(*(row.split(",") for row in rows), strict=True)
    return dict(zip(head.split(","), columns, strict=True))


def written(path, columns):
    rows = zip(*columns.values(), strict=True)
    path.write_text("\n".join([",".join(columns), *(",".join(row) for row in rows)]) + "\n")
    return path


def by_joints(log, change=lambda k, rate: rate, more=None):
    """The same with the joints' rates from the plan, each held until the next row."""
    rates = np.diff(PLAN.angles(), axis=0) / PLAN.step / D
    own = {
        f"th_rate_{axis} [deg/s]": [*(repr(float(change(k, rates[k, i]))) for k in range(len(rates))), ""]
        for i, axis in enumerate("xyz")
    }
    return {name: column for name, column in log.items() if not name.startswith("wc")} | own | (more or {})


def test_they_are_those_of_the_platform_that_the_drive_makes_of_them(log, tmp_path):
    told = recording_of(read(written(tmp_path / "wc.csv", log)), STUDY)
    found = recording_of(read(written(tmp_path / "joints.csv", by_joints(log))), STUDY)
    assert found.rate == pytest.approx(told.rate, abs=1e-12)
    assert not found.measured
    assert [each.code for each in found.findings] == [each.code for each in told.findings]


def test_accelerations_are_what_rates_gain_until_the_next_row(log, tmp_path):
    """A rate at the begin of each row, and its acceleration: with 0.2 s half of it counts."""
    shift = 0.5  # deg/s^2
    more = {f"th_acc_{axis} [deg/s^2]": [repr(shift)] * len(log["t [s]"]) for axis in "xyz"}
    columns = by_joints(log, lambda _, rate: rate - 0.5 * shift * PLAN.step, more)
    found = recording_of(read(written(tmp_path / "joints.csv", columns)), STUDY)
    told = recording_of(read(written(tmp_path / "wc.csv", log)), STUDY)
    assert found.rate == pytest.approx(told.rate, abs=1e-12)


def test_a_rate_that_is_missing_is_a_gap_of_one_row(log, tmp_path):
    columns = by_joints(log)
    columns["th_rate_x [deg/s]"][100] = ""
    found = recording_of(read(written(tmp_path / "joints.csv", columns)), STUDY)
    told = recording_of(read(written(tmp_path / "wc.csv", log)), STUDY)
    assert found.held == (100,)
    assert np.delete(found.rate, 100, axis=0) == pytest.approx(np.delete(told.rate, 100, axis=0), abs=2e-5)


def test_without_a_plan_nobody_knows_where_they_began(log, tmp_path):
    record = read(written(tmp_path / "joints.csv", by_joints(log)))
    with pytest.raises(StudyError, match=r"plan: missing, expected the angles from which the joints"):
        recording_of(record, study(plan=None))
    columns = {name: column for name, column in by_joints(log).items() if "th_rate_y" not in name}
    with pytest.raises(RecordError, match="or th_rate_x"):
        recording_of(read(written(tmp_path / "less.csv", columns)), STUDY)


MAP = """
[columns]
t = {{ from = "t [s]", unit = "s" }}
{}
"""
SCALES = {"wc": ("deg/h", 5e-4), "gyro": ("deg/h", 5e-4), "th": ("arcsec", 0.1), "acc": ("ug", 2.0)}


@pytest.mark.parametrize("rate", ["wc", "gyro"])
def test_raw_counts_by_their_nominal_scale(log, tmp_path, rate):
    """Gyros, resolvers and accelerometers as integers: the same coefficients, but for what rounding does."""
    whole = calibrate(read(written(tmp_path / "wc.csv", log)), STUDY).estimate
    per = {"deg/h": D / 3600.0, "arcsec": D / 3600.0, "ug": 9.80665e-6}
    record = read(tmp_path / "wc.csv")
    columns, lines = {"t [s]": log["t [s]"]}, []
    for name in ("wc", "th", "acc"):
        unit, size = SCALES[name]
        for axis in "xyz":
            numbers = record[f"{name}_{axis}"].si() / per[unit] / size
            label = f"{name}_{axis}"
            columns[label] = ["" if np.isnan(x) else str(round(x)) for x in numbers]
            own = label.replace("wc", rate)
            lines.append(f'{own} = {{ from = "{label}", unit = "{unit}", scale = {size} }}')
    (tmp_path / "map.toml").write_text(MAP.format("\n".join(lines)))
    counted = read(written(tmp_path / "counts.csv", columns), read_map(tmp_path / "map.toml"))
    found = calibrate(counted, STUDY).estimate
    assert found.names == whole.names
    assert np.abs((found.values - whole.values) / whole.u).max() < 0.5
    assert found.u == pytest.approx(whole.u, rel=0.01)
