"""Bias and scale factor against temperature: the curve, its uncertainty, and what no curve takes away."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from inercal.cli import run
from inercal.foundation.errors import InputError, RecordError
from inercal.foundation.findings import Status
from inercal.foundation.inputs import Source
from inercal.foundation.records.column import Column
from inercal.foundation.records.record import Record
from inercal.foundation.results.files import load, save
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import parse_unit
from inercal.systems.imu.temperature.calibrations import fit_calibrations
from inercal.systems.imu.temperature.figures import pictures
from inercal.systems.imu.temperature.polynomial import fit_points, fit_sweep, order_of
from inercal.systems.imu.temperature.sweep import branches, fit_recording

TRUTH = np.array([1.0, -0.02, 3e-4, -2e-6])
SOURCE = Source("sweep.csv", "")


def sweep_of(samples=2000, turns=1.2) -> np.ndarray:
    """Temperatures that rise and fall [degC]."""
    return 25.0 + 45.0 * np.sin(2 * np.pi * turns * np.linspace(0, 1, samples) + 0.6)


def record_of(T, unit="degC", **channels) -> Record:
    t = np.arange(len(T), dtype=float)
    columns = {"temperature": Column("temperature", parse_unit(unit), T, t, SOURCE)}
    for name, values in channels.items():
        columns[name] = Column(name, parse_unit("deg/s"), values, t, SOURCE)
    return Record(columns, (), (SOURCE,))


def cubic(T, reference=25.0):
    return np.polynomial.polynomial.polyval(T - reference, TRUTH)


def test_a_cubic_without_noise_comes_back_about_any_reference():
    T = sweep_of()
    for reference in (25.0, 0.0, -10.0):
        found = fit_recording(record_of(T, gyro_x=cubic(T)), reference).estimate
        assert found.names[:4] == ("gyro_x", "gyro_x_T1", "gyro_x_T2", "gyro_x_T3")
        assert found.units[:4] == ("deg/s", "deg/s/K", "deg/s/K^2", "deg/s/K^3")
        shifted = np.polynomial.Polynomial(TRUTH)(np.polynomial.Polynomial([reference - 25.0, 1.0])).coef
        np.testing.assert_allclose(found.values[:4], shifted, rtol=1e-7)
        assert found.status is Status.OK


def test_kelvin_and_celsius_are_one_temperature():
    T = sweep_of()
    a = fit_recording(record_of(T, gyro_x=cubic(T))).estimate
    b = fit_recording(record_of(T + 273.15, "K", gyro_x=cubic(T))).estimate
    np.testing.assert_allclose(a.values, b.values, rtol=1e-6, atol=1e-9)


@pytest.mark.parametrize("wander", [0, pytest.param(30, marks=pytest.mark.campaign), 300])
def test_the_uncertainty_of_the_curve_holds_under_wandering_noise(wander):
    """300 sweeps with white noise and noise of a correlation of 0, 30 or 300 of 2000 samples. Stated intervals of 95 %
    cover the truth in 87 to 100 %: at least 0.95 less 4.5 standard deviations of the count (0.057) and less what a
    correlation that one sweep hardly shows may cost (0.023). The constant, which a slow wander shifts as a whole, may
    be covered always."""
    rng = np.random.default_rng(20261121)
    T = sweep_of()
    hits = np.zeros(4)
    for _ in range(300):
        noise = rng.normal(0.0, 0.02, len(T))
        if wander:
            a = np.exp(-1.0 / wander)
            drive = rng.normal(0.0, 0.05 * np.sqrt(1.0 - a**2), len(T))
            drive[0] = rng.normal(0.0, 0.05)
            noise += lfilter([1.0], [1.0, -a], drive)
        fit = fit_sweep(T, cubic(T) + noise, 25.0, np.empty((len(T), 0)))
        from scipy.stats import t as student

        half = student.ppf(0.975, fit.dof) * np.sqrt(np.diag(fit.covariance))
        hits += np.abs(fit.coefficients - TRUTH) < half
    assert np.all(hits / 300 > 0.87)


@pytest.mark.parametrize("order", [1, 2, 3, 5])
def test_the_data_tell_the_order(order):
    """Powers that change the output by ten times its noise and more are found, and no higher one (BIC: one in some 30
    sweeps has one more)."""
    rng = np.random.default_rng(order)
    T = sweep_of()
    true = np.polynomial.chebyshev.chebval((T - 25.0) / 45.0, 0.2 / np.arange(1, order + 2))
    found = [order_of(T, true + rng.normal(0.0, 0.02, len(T))) for _ in range(20)]
    assert found.count(order) >= 17
    assert min(found) == order


def test_an_order_that_is_left_out_is_in_u():
    """A fourth power that the data do not show: the data tell an order below it, and what it shifts stays within U."""
    rng = np.random.default_rng(20261127)
    T, hits, runs = sweep_of(), np.zeros(2), 60
    truth = np.array([1.0, -0.02, 3e-4, -2e-6, 2e-9])
    for _ in range(runs):
        y = np.polynomial.polynomial.polyval(T - 25.0, truth) + rng.normal(0.0, 0.02, len(T))
        estimate = fit_recording(record_of(T, gyro_x=y)).estimate
        hits += [
            abs(estimate[name].value - true) < estimate[name].U
            for name, true in (("gyro_x", 1.0), ("gyro_x_T1", -0.02))
        ]
    assert np.all(hits >= runs * 0.95 - 3.0 * np.sqrt(runs * 0.95 * 0.05))


@pytest.mark.parametrize(
    "sweep", [sweep_of(), np.linspace(5.0, 50.0, 2000)], ids=["there and back", "one way"]
)
@pytest.mark.parametrize("jumps", [True, False], ids=["jump", "bend"])
def test_a_jump_or_a_bend_is_named_with_its_temperature(sweep, jumps):
    rng = np.random.default_rng(12)
    shape = np.where(sweep > 31.0, 0.2 if jumps else 0.05 * (sweep - 31.0), 0.0)
    record = record_of(sweep, gyro_x=cubic(sweep) + shape + rng.normal(0.0, 0.02, len(sweep)))
    estimate = fit_recording(record).estimate
    (finding,) = [finding for finding in estimate.findings if finding.code == "temperature_kink"]
    assert ("jumps by" if jumps else "changes its slope by") in finding.headline
    assert float(finding.headline.split(" at ")[1].split()[0]) == pytest.approx(31.0, abs=0.5)
    assert estimate.status is Status.SUSPECT


@pytest.mark.parametrize("wander", [0, 30, 300])
@pytest.mark.parametrize(
    "sweep", [sweep_of(), np.linspace(-20.0, 60.0, 2000)], ids=["there and back", "one way"]
)
def test_noise_alone_makes_no_jump(sweep, wander):
    """None in 20 records, where a risk of 1 % for each makes one in 20 in 18 % of the time, and two in 2 %."""
    rng = np.random.default_rng(47)
    named = 0
    for _ in range(20):
        noise = rng.normal(0.0, 0.02, len(sweep))
        if wander:
            a = np.exp(-1.0 / wander)
            noise += lfilter([1.0], [1.0, -a], rng.normal(0.0, 0.05 * np.sqrt(1.0 - a**2), len(sweep)))
        findings = fit_recording(record_of(sweep, gyro_x=cubic(sweep) + noise)).estimate.findings
        named += any(finding.code == "temperature_kink" for finding in findings)
    assert named <= 1


def test_a_difference_between_branches_is_measured_and_said():
    T = sweep_of()
    rng = np.random.default_rng(5)
    step = 0.4 * branches(T)
    found = fit_recording(record_of(T, gyro_x=cubic(T) + step + rng.normal(0, 0.01, len(T)))).estimate
    assert abs(found["gyro_x_hyst"].value - 0.4) < 5 * found["gyro_x_hyst"].u + 0.02
    (finding,) = found.findings
    assert finding.code == "hysteresis"
    assert found.result["curves"][0]["largest_hysteresis"] == pytest.approx(0.4, rel=0.1)
    quiet = fit_recording(record_of(T, gyro_x=cubic(T) + rng.normal(0, 0.01, len(T)))).estimate
    assert quiet.findings == ()
    assert abs(quiet["gyro_x_hyst"].value) < 5 * quiet["gyro_x_hyst"].u


@pytest.mark.parametrize("wander", [0, pytest.param(30, marks=pytest.mark.campaign), 300])
def test_noise_alone_is_no_hysteresis(wander):
    """Flat outputs of six channels with white noise, or wander beside it: in 20 records a finding in one at most, where
    each may have one by chance at a risk of 1 % (two of 20 and more: 1.7 % of the time)."""
    rng = np.random.default_rng(20261121)
    T = sweep_of()
    said = 0
    for _ in range(20):
        noise = rng.normal(0.0, 0.02, (6, len(T)))
        if wander:
            a = np.exp(-1.0 / wander)
            noise += lfilter(
                [1.0], [1.0, -a], rng.normal(0.0, 0.05 * np.sqrt(1.0 - a**2), noise.shape), axis=1
            )
        names = [f"{sensor}_{axis}" for sensor in ("gyro", "acc") for axis in "xyz"]
        found = fit_recording(record_of(T, **dict(zip(names, noise, strict=True)))).estimate
        said += any(finding.code == "hysteresis" for finding in found.findings)
    assert said <= 1


def test_one_way_only_has_no_hysteresis():
    T = np.linspace(-20.0, 60.0, 1000)
    found = fit_recording(record_of(T, gyro_x=cubic(T))).estimate
    assert "gyro_x_hyst" not in found.names


def test_a_reference_outside_the_range_is_said():
    T = np.linspace(40.0, 60.0, 1000)
    (finding,) = fit_recording(record_of(T, gyro_x=cubic(T))).estimate.findings
    assert finding.code == "outside_range"


def test_missing_values_are_left_out():
    T = sweep_of()
    y = cubic(T)
    y[100:110] = np.nan
    gap = T.copy()
    gap[500:505] = np.nan
    found = fit_recording(record_of(gap, gyro_x=y)).estimate
    np.testing.assert_allclose(found.values[:4], TRUTH, rtol=1e-6)


def test_a_dead_channel_has_no_curve():
    T = sweep_of()
    found = fit_recording(record_of(T, gyro_x=np.full(len(T), 0.25), gyro_y=cubic(T))).estimate
    assert {name.partition("_T")[0].removesuffix("_hyst") for name in found.names} == {"gyro_y"}
    with pytest.raises(RecordError, match="gyro_x: never changing, expected a live sensor"):
        fit_recording(record_of(T, gyro_x=np.full(len(T), 0.25)))


def test_a_steady_temperature_is_unobservable_and_a_missing_one_an_error():
    T = 25.0 + 0.01 * np.arange(200)
    found = fit_recording(record_of(T, gyro_x=np.zeros(200)))
    assert found.estimate.status is Status.UNOBSERVABLE
    assert pictures(found) == []
    record = record_of(T, gyro_x=np.zeros(200))
    with pytest.raises(RecordError, match="no column temperature"):
        fit_recording(Record({"gyro_x": record["gyro_x"]}, (), (SOURCE,)))
    with pytest.raises(RecordError, match=r"expected acc_x\.\., gyro_x\.\. to fit"):
        fit_recording(record_of(T))
    with pytest.raises(RecordError, match="found 3 temperatures, expected at least 128"):
        fit_recording(record_of(T[:3], gyro_x=np.zeros(3)))


# From calibrations at several temperatures.


def calibration(temperature, values, u=0.01, common=0.0) -> Estimate:
    p = len(values)
    shared = np.full((p, p), common**2)
    return Estimate(
        "calibrate imu", ("K1_x", "K0_x")[:p], ("count/(m/s^2)", "count")[:p], np.asarray(values, dtype=float),
        np.eye(p) * u**2 + shared, np.full(p, 50.0), Status.OK, "", common=shared,
        conditions={"temperature": {"value": float(temperature), "u": 0.0, "unit": "degC"}},
    )  # fmt: skip


def files(count):
    return [Source(f"c{k}.json", "") for k in range(count)]


def test_scale_factors_at_several_temperatures_give_their_cubic():
    T = np.array([-20.0, 0.0, 20.0, 40.0, 60.0, 70.0])
    found = fit_calibrations([calibration(x, [cubic(x)]) for x in T], files(6)).estimate
    np.testing.assert_allclose(found.values, TRUTH, rtol=1e-8)
    assert found.names == ("K1_x", "K1_x_T1", "K1_x_T2", "K1_x_T3")


def test_the_covariance_is_that_of_weighted_least_squares_and_gravity_stays_common():
    T = np.array([-20.0, 0.0, 20.0, 40.0, 60.0, 70.0])
    nothing = np.empty((6, 0))
    fit = fit_points(T, cubic(T), np.full(6, 0.04), 0.25, 25.0, nothing, 4)
    A = (T - 25.0)[:, None] ** np.arange(4)
    own = 0.04 * np.linalg.inv(A.T @ A)
    own[0, 0] += 0.25
    np.testing.assert_allclose(fit.covariance, own, rtol=1e-6)
    found = fit_calibrations([calibration(x, [cubic(x)], 0.2, 0.5) for x in T], files(6)).estimate
    np.testing.assert_allclose(found.covariance, own, rtol=1e-6)


@pytest.mark.parametrize("jump", [0.0, 0.3])
def test_a_jump_between_calibrations_is_named_by_what_it_shifts(jump):
    """Twelve calibrations up to 60 degC, u 0.01, an output that jumps by 30 u at 30 degC: a cubic goes through it as
    far as it can, and is off. Of calibrations that do not jump nothing is said."""
    rng, T = np.random.default_rng(20261127), np.linspace(0.0, 60.0, 12)
    y = 1.0 + 0.01 * T + jump * (T > 30.0) + 0.01 * rng.standard_normal(12)
    found = fit_calibrations(
        [calibration(x, [value]) for x, value in zip(T, y, strict=True)], files(12)
    ).estimate
    said = [finding for finding in found.findings if finding.code.startswith("by_")]
    assert (found.status is Status.SUSPECT) == bool(said) == bool(jump)
    assert all(finding.harm and "step" in finding.headline for finding in said)


def test_a_coefficient_that_stays_is_explained_as_a_whole():
    found = fit_calibrations([calibration(x, [1.0]) for x in (0.0, 20.0, 40.0, 60.0)], files(4)).estimate
    assert found.result["curves"][0]["r2"] == 1.0
    assert found["K1_x_T1"].value == pytest.approx(0.0, abs=1e-15)


def test_scatter_beyond_the_stated_uncertainty_widens_it():
    T = np.linspace(-20.0, 70.0, 12)
    rng = np.random.default_rng(8)
    y = cubic(T) + rng.normal(0.0, 0.1, 12)
    found = fit_calibrations(
        [calibration(x, [v], 0.01) for x, v in zip(T, y, strict=True)], files(12)
    ).estimate
    exact = fit_calibrations([calibration(x, [cubic(x)], 0.01) for x in T], files(12)).estimate
    assert found["K1_x"].u > 5 * exact["K1_x"].u
    assert np.all(np.abs(found.values - TRUTH) < 5 * found.u)


def test_a_known_common_error_that_dominates_has_the_factor_of_a_known_one():
    """Scatter of five values about four coefficients has one degree of freedom, k = 14; gravity is not of it."""
    T = np.array([-20.0, 0.0, 20.0, 40.0, 60.0])
    y = cubic(T) + np.array([0.03, -0.05, 0.02, 0.05, -0.04])
    found = fit_calibrations(
        [calibration(x, [v], 0.01, 1.0) for x, v in zip(T, y, strict=True)], files(5)
    ).estimate
    assert found["K1_x_T1"].k == pytest.approx(13.97, abs=0.01)
    assert pytest.approx(2.0, rel=0.01) == found["K1_x"].U


def test_few_temperatures_carry_a_polynomial_of_lower_degree():
    T = np.array([0.0, 20.0, 40.0])
    found = fit_calibrations([calibration(x, [1.0 + 0.1 * x]) for x in T], files(3)).estimate
    assert found.names == ("K1_x", "K1_x_T1")
    assert found["K1_x_T1"].value == pytest.approx(0.1)
    assert [finding.code for finding in found.findings] == ["few_degrees_of_freedom"]


def test_what_a_neglected_power_does_is_in_u():
    """Four temperatures carry a parabola; the truth has a third power, large beside the scatter or not. Intervals of
    400 series hold constant, slope and curvature at T0 in at least 95 %, less 4.5 standard deviations of the count."""
    rng = np.random.default_rng(20261121)
    T = np.array([-10.0, 10.0, 35.0, 60.0])
    for third in (0.0, 3e-6, 1e-5):
        truth = np.array([1.0, -0.02, 3e-4, third])
        hits = np.zeros(3)
        for _ in range(400):
            y = np.polynomial.polynomial.polyval(T - 25.0, truth) + rng.normal(0.0, 0.05, 4)
            found = fit_calibrations(
                [calibration(x, [v], 0.05) for x, v in zip(T, y, strict=True)], files(4)
            ).estimate
            hits += np.abs(found.values - truth[:3]) <= found.k * found.u
        assert np.all(hits / 400 > 0.95 - 4.5 * np.sqrt(0.95 * 0.05 / 400))
    assert "higher ones are not" in found.findings[0].message


def test_an_order_can_be_asked_for():
    T = sweep_of()
    names = fit_recording(record_of(T, gyro_x=cubic(T)), order=5).estimate.names
    assert names[:6] == ("gyro_x", *(f"gyro_x_T{power}" for power in range(1, 6)))
    with pytest.raises(InputError, match="order: found 6, expected 1 to 5"):
        fit_recording(record_of(T, gyro_x=cubic(T)), order=6)
    temperatures = np.linspace(-20.0, 60.0, 9)
    estimates = [calibration(at, np.array([cubic(at), 1.0])) for at in temperatures]
    model = fit_calibrations(estimates, files(9), order=4)
    assert model.curves[0].polynomial.terms == 5
    with pytest.raises(InputError, match="order: found 4, expected 1 to 3 for 5 temperatures"):
        fit_calibrations(estimates[:5], files(5), order=4)


def test_hysteresis_between_calibrations_on_the_way_up_and_down():
    up = np.array([-20.0, 0.0, 20.0, 40.0, 60.0])
    T = np.concatenate([up, up[::-1][1:]])
    y = [cubic(x) + (0.2 if k < 5 else -0.2) for k, x in enumerate(T)]
    found = fit_calibrations([calibration(x, [v]) for x, v in zip(T, y, strict=True)], files(9)).estimate
    assert found["K1_x_hyst"].value == pytest.approx(0.4, abs=1e-9)
    assert any(finding.code == "hysteresis" for finding in found.findings)


def test_what_cannot_be_a_series_of_calibrations_is_refused():
    three = [calibration(x, [1.0]) for x in (0.0, 20.0, 40.0)]
    with pytest.raises(InputError, match="expected at least 3"):
        fit_calibrations(three[:2], files(2))
    with pytest.raises(InputError, match=r"c1\.json: conditions\.temperature: missing"):
        fit_calibrations([three[0], replace(three[1], conditions={}), three[2]], files(3))
    with pytest.raises(InputError, match=r"c2\.json: found the status inconsistent, expected ok"):
        fit_calibrations([*three[:2], replace(three[2], status=Status.INCONSISTENT)], files(3))
    with pytest.raises(InputError, match="other coefficients"):
        fit_calibrations([*three[:2], calibration(40.0, [1.0, 2.0])], files(3))
    twice = [Source("a.json", "1"), Source("b.json", "2"), Source("copy.json", "1")]
    with pytest.raises(InputError, match=r"copy\.json: holds the same as a file before it"):
        fit_calibrations(three, twice)
    for u in (0.0, np.nan):
        with pytest.raises(InputError, match=r"c1\.json: K1_x: states no standard uncertainty above zero"):
            fit_calibrations([three[0], calibration(20.0, [1.0], u), three[2]], files(3))
    still = fit_calibrations([calibration(20.0 + x, [1.0]) for x in (0, 1, 2)], files(3)).estimate
    assert still.status is Status.UNOBSERVABLE


# The command.


def test_the_command_on_calibrations_and_its_files(tmp_path, capsys):
    names = []
    for k, x in enumerate((-20.0, 0.0, 20.0, 40.0, 60.0)):
        save(calibration(x, [cubic(x)]), tmp_path / f"c{k}.json")
        names.append(str(tmp_path / f"c{k}.json"))
    out, page = tmp_path / "t.json", tmp_path / "t.html"
    assert (
        run(["temperature", *names, "--at", "0 degC", "--out", str(out), "--report", str(page), "--json"])
        == 0
    )
    data = json.loads(capsys.readouterr().out)
    assert data["command"] == "temperature"
    assert data["result"]["reference_degC"] == 0.0
    assert load(out)["K1_x"].value == pytest.approx(cubic(0.0))
    assert "against temperature" in page.read_text("utf-8")
    assert run(["temperature", names[0], names[1]]) == 2
    assert "expected at least 3" in capsys.readouterr().err
    assert run(["temperature", *names, "--map", str(out)]) == 2
    assert "--map" in capsys.readouterr().err
    assert run(["temperature", *names, "--at", "5 kg"]) == 2
    assert capsys.readouterr().err.count("\n") == 1
