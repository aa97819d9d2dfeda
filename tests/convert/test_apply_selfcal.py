"""The result of a self-calibration in use: a platform that is told corrected commands goes where it should."""

import io
import json
import sys
from dataclasses import replace

import numpy as np
import pytest
from paper_study import NOISE, TRUTH, study

from inercal.cli import run
from inercal.faces.convert.correction import apply_to
from inercal.faces.convert.platform import not_applied, platform_model
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Status
from inercal.foundation.inputs import Source
from inercal.foundation.records.column import Column
from inercal.foundation.records.read import read
from inercal.foundation.records.record import Record
from inercal.foundation.records.write import write_record
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import parse_unit
from inercal.systems.selfcal.platform.coefficients import names, to_linear, units
from inercal.systems.selfcal.simulate import experiment, simulate

QUIET = replace(NOISE["low"], angle_random_walk=0.0, accelerometer=0.0, encoder=0.0)
#: also gyro scale errors of 30, -20, 50 ppm
EXTENDED = np.concatenate([TRUTH[:18], np.array([30.0, -20.0, 50.0]) * 1e-6, np.zeros(3)])


def estimate(values, status=Status.OK, **changes):
    """An estimate of `inercal selfcal` with these coefficients, product form."""
    p = len(values)
    whole = Estimate(
        "selfcal", names(p), units(names(p)), np.asarray(values), 1e-18 * np.eye(p), np.full(p, 100.0),
        status, "as drawn",
    )  # fmt: skip
    return replace(whole, **changes)


def record(**sensors):
    """A record with one clock of sensors (n, 3), each with its unit."""
    source, t = Source("drawn", ""), 0.2 * np.arange(len(next(iter(sensors.values()))[0]))
    columns = {}
    for sensor, (values, unit) in sensors.items():
        for k, axis in enumerate("xyz"):
            name = f"{sensor}_{axis}"
            column = np.ascontiguousarray(values[:, k])
            columns[name] = Column(name, parse_unit(unit), column, t, source)
    return Record(columns, (), (source,))


def turned(truth, rate):
    """Attitudes and outputs of a noiseless platform with that truth, commanded ``rate`` (n, 3)."""
    whole = experiment(study(noise="low", truth=truth))
    told = replace(
        whole, noise=QUIET, fine=np.repeat(rate[:, None, :], whole.fine.shape[1], axis=1)
    )  # fmt: skip
    return simulate(told, np.random.default_rng(1))


def apart(q, other):
    """Largest angle [rad] between attitudes (n, 4)."""
    return float(2.0 * np.arccos(np.clip(np.abs(np.sum(q * other, axis=1)), 0.0, 1.0)).max())


@pytest.mark.parametrize("truth", [TRUTH, EXTENDED])
def test_a_platform_told_corrected_commands_follows_the_nominal_path(truth):
    """Its errors undone, it turns as one without errors; the first order of the formula leaves more than 0.1 arcsec."""
    nominal = experiment(study()).motion.rate
    ideal = turned(np.zeros(24), nominal)
    model = platform_model(estimate(truth))
    told = apply_to(record(wc=(nominal, "rad/s")), model).triad("wc").values
    assert apart(turned(truth, told).attitude, ideal.attitude) < 1e-7  # arccos near 1: sqrt of rounding
    np.testing.assert_allclose(turned(truth, told).angles, ideal.angles, atol=1e-11)
    errors = model.platform.indicate(nominal) - nominal
    first_order = turned(truth, nominal - errors).angles - ideal.angles
    uncorrected = turned(truth, nominal).angles - ideal.angles
    arcsec = np.radians(1.0 / 3600.0)
    assert 0.01 * arcsec < np.abs(first_order).max() < arcsec
    assert np.abs(uncorrected).max() > 50.0 * arcsec


def test_corrected_accelerometers_are_the_specific_force():
    """Outputs of a platform with errors, corrected, are those of one without at the same attitudes."""
    simulated = turned(TRUTH, experiment(study()).motion.rate)
    site = study().site
    q0, q1, q2, q3 = simulated.attitude.T
    f = site.gravity * np.stack(
        [2 * (q1 * q2 + q0 * q3), q0**2 - q1**2 + q2**2 - q3**2, 2 * (q2 * q3 - q0 * q1)], axis=1
    )
    found = apply_to(record(acc=(simulated.recording.acc, "m/s^2")), platform_model(estimate(TRUTH)))
    np.testing.assert_allclose(found.triad("acc").values[1:], f[1:], atol=1e-11)
    assert np.isnan(found.triad("acc").values[0]).all()


@pytest.mark.parametrize(
    ("sensor", "unit"), [("wc", "deg/h"), ("gyro", "deg/s"), ("acc", "mg"), ("acc", "m/s^2")]
)
def test_inverted_is_the_way_back_in_the_units_of_the_record(sensor, unit):
    rng = np.random.default_rng(2)
    samples = rng.standard_normal((50, 3))
    model = platform_model(estimate(EXTENDED))
    there = apply_to(record(**{sensor: (samples, unit)}), model)
    back = apply_to(there, model, invert=True)
    assert there[f"{sensor}_x"].unit.symbol == unit
    assert np.abs(there.triad(sensor).values - samples).max() > 1e-7
    np.testing.assert_allclose(back.triad(sensor).values, samples, rtol=0, atol=1e-13)


def test_measured_rates_are_corrected_the_other_way_than_commands():
    """A gyro reads w where the platform turns at w + M w + kg0: by hand for one sample."""
    w = np.array([[0.01, -0.02, 0.03]])
    kg0, ds, do, kg1 = EXTENDED[:3], EXTENDED[6:9], EXTENDED[9:12], EXTENDED[18:21]
    by_hand = [
        w[0, 0] * (1 + kg1[0]) + ds[0] * w[0, 1] - do[0] * w[0, 2] + kg0[0],
        w[0, 1] * (1 + kg1[1]) - do[1] * w[0, 0] + ds[1] * w[0, 2] + kg0[1],
        w[0, 2] * (1 + kg1[2]) + ds[2] * w[0, 0] - do[2] * w[0, 1] + kg0[2],
    ]
    model = platform_model(estimate(EXTENDED))
    both = apply_to(record(gyro=(w, "rad/s"), wc=(np.array([by_hand]), "rad/s")), model)
    np.testing.assert_allclose(both.triad("gyro").values[0], by_hand, rtol=1e-14)
    np.testing.assert_allclose(both.triad("wc").values[0], w[0], rtol=1e-13)


def test_the_bracket_is_that_of_the_filters():
    """`platform_model` and the linear form of the filters read the same at the same specific force."""
    f = np.array([3.0, -9.0, 2.0])
    c = to_linear(TRUTH[:18])
    read_ = c[12:15] + (1 + c[15:18]) * f + [0.0, -c[4] * f[0], c[3] * f[0] - c[5] * f[1]]
    np.testing.assert_allclose(platform_model(estimate(TRUTH)).accelerometer.indicate(f), read_, rtol=1e-15)


@pytest.mark.parametrize(
    ("bad", "words"),
    [
        (estimate(np.append(TRUTH[:17], np.nan)), "expected the coefficients of a platform"),
        (estimate(TRUTH[:12], command="selfcal"), "found kg0_x, .* expected the coefficients of a platform"),
        (estimate(np.append(TRUTH[:17], -1.0)), "cannot be inverted"),
    ],
)
def test_a_result_that_cannot_be_used_is_named(bad, words):
    with pytest.raises(InputError, match=rf"^cal\.json: .*{words}"):
        platform_model(bad, "cal.json")


def test_what_is_not_applied_is_said():
    assert not_applied(estimate(TRUTH[:18])) == ()
    (finding,) = not_applied(estimate(EXTENDED), "cal.json")
    assert (finding.code, finding.where) == ("not_held", "cal.json")


# The command.


@pytest.fixture
def folder(tmp_path, monkeypatch):
    """A calibration and a record of the paper's path with missing values, here."""
    from inercal.foundation.results.files import save
    from inercal.systems.selfcal.simulate import to_record

    monkeypatch.chdir(tmp_path)
    save(estimate(TRUTH[:18]), tmp_path / "cal.json")
    save(estimate(TRUTH[:18], Status.INCONSISTENT), tmp_path / "doubtful.json")
    simulated = simulate(experiment(study()), np.random.default_rng(3))
    write_record(to_record(simulated.recording), tmp_path / "log.csv")
    return tmp_path


@pytest.mark.parametrize("more", [[], ["--invert"]])
def test_the_command_corrects_commands_and_accelerometers_and_a_stream_gives_the_same_bytes(
    more, folder, capsys, monkeypatch
):
    assert run(["apply", "cal.json", "log.csv", "--out", "x.csv", *more]) == 0
    assert "2701 rows" in capsys.readouterr().out
    before, after = read(folder / "log.csv"), read(folder / "x.csv")
    assert list(after.columns) == list(before.columns)
    assert after["wc_x"].unit.symbol == "deg/h"
    np.testing.assert_array_equal(after["th_x"].values, before["th_x"].values)
    shift = (after["wc_x"].si() - before["wc_x"].si())[0] * (-1.0 if more else 1.0)
    w = before.triad("wc").values[0] * before["wc_x"].unit.factor
    assert shift == pytest.approx(-(TRUTH[0] + TRUTH[6] * w[1] - TRUTH[9] * w[2]), rel=2e-3)
    data = (folder / "log.csv").read_bytes()
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(data)))
    assert run(["apply", "cal.json", "--stream", "--quiet", *more]) == 0
    assert capsys.readouterr().out == (folder / "x.csv").read_text()


def test_a_doubtful_calibration_is_applied_and_said_and_a_record_without_its_channels_refused(folder, capsys):
    assert run(["apply", "doubtful.json", "log.csv", "--out", "x.csv", "--json"]) == 0
    captured = capsys.readouterr()
    assert "bad_verdict" in [each["code"] for each in json.loads(captured.out)["findings"]]
    (folder / "t.csv").write_text("t [s],th_x [deg],th_y [deg],th_z [deg]\n" + "0,1,1,1\n1,1,1,1\n2,1,1,1\n")
    (folder / "count.csv").write_text("t [s],acc_x [count],acc_y [count],acc_z [count]\n0,1,1,1\n1,1,1,1\n")
    for name, words in (
        ("t.csv", "expected wc_x to z"),
        ("count.csv", "acc is in count, expected a unit of acc"),
    ):
        assert run(["apply", "cal.json", name, "--out", "y.csv"]) == 2
        captured = capsys.readouterr()
        assert captured.out == ""
        assert words in captured.err
        assert captured.err.count("\n") == 1
