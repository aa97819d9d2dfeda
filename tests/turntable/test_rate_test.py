"""Rate tests: what a gyro on a turning table senses, and the terms a fit finds in that."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from scipy.integrate import quad
from scipy.spatial.transform import Rotation

from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import EARTH_RATE, Site
from inercal.foundation.inputs import Source
from inercal.foundation.records.column import Column
from inercal.foundation.records.record import Record
from inercal.foundation.rigs.chain import Scope
from inercal.foundation.rigs.outputs import rate_reference
from inercal.foundation.rigs.patterns import normal, uniform
from inercal.foundation.rigs.plans import named
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.units import parse_unit
from inercal.systems.turntable.figures import pictures
from inercal.systems.turntable.rate.fit import approaches, levels
from inercal.systems.turntable.rate.stays import RateDwells, arc, gyro_input, sensed
from inercal.systems.turntable.settings import (
    Instrument,
    JointAngles,
    PositionDesign,
    RateTest,
    TurntableSettings,
)
from inercal.systems.turntable.task import calibrate, simulate

DEG = np.pi / 180.0
DEG_H = DEG / 3600.0
LATITUDE = 39.1 * DEG
UP = (-100, -60, -30, -10, -1, 1, 10, 30, 60, 100)
UP_AND_DOWN = (*UP, *UP[-2::-1])
OBLIQUE = Rotation.from_euler("xyz", [35.0, -40.0, 15.0], degrees=True).as_matrix()
ARCMIN_2 = 2.0 / 60.0 * DEG


def study(rates=UP_AND_DOWN, errors=None, mounting=None, instrument=None, scopes=None, **test):
    """A study of a gyro along the inner axis, in deg/s; without table errors unless given."""
    rates = tuple(rate * DEG for rate in rates)
    made = {"kind": "gyro", "unit": parse_unit("deg/s"), "coefficients": {"S_z": 1.0}, "dwell": 60.0}
    return TurntableSettings(
        site=Site(9.8, (), LATITUDE),
        rig="two_axis_turntable",
        chain=turntable("two_axis_turntable", errors, scopes=scopes, mounting=mounting),
        plan=named("24-position"),
        design=PositionDesign(named("24-position")),
        instrument=Instrument(**(made | (instrument or {}))),
        rate_test=RateTest("phi2", rates=rates, **test),
    )


def run(settings, seed=1):
    return calibrate(simulate(settings, np.random.default_rng(seed)), settings)


def record(**columns):
    """A record of (values, unit) columns."""
    source, n = Source("bench.csv", ""), len(next(iter(columns.values()))[0])
    t = np.arange(float(n))
    return Record(
        {
            name: Column(name, parse_unit(unit), np.array(values, float), t, source)
            for name, (values, unit) in columns.items()
        },
        sources=(source,),
    )


def without(found, *names):
    """The record less some columns."""
    return replace(
        found, columns={name: column for name, column in found.columns.items() if name not in names}
    )


# what the gyro senses


def by_integration(rate, phi1, start, duration, axis):
    """Mean rate about an oblique gyro's axis, by quadrature over time with SciPy's rotations."""
    w_n = EARTH_RATE * np.array([np.cos(LATITUDE), 0.0, np.sin(LATITUDE)])

    def now(t):
        C = (
            Rotation.from_rotvec([0.0, phi1, 0.0])
            * Rotation.from_rotvec([0.0, 0.0, start + rate * t])
            * Rotation.from_matrix(OBLIQUE)
        )
        return C.inv().apply(w_n)[axis]

    earth = quad(now, 0.0, duration, epsabs=0.0, epsrel=1e-12, limit=200)[0] / duration
    return earth + rate * OBLIQUE[2, axis]


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize(
    ("rate", "start"), [(7.3, 20.0), (-1.1, 200.0), (0.0, 75.0), (6.0, 10.0), (0.013, 0.0)]
)
def test_the_mean_input_over_an_arc_is_that_of_numerical_integration(axis, rate, start):
    chain = turntable("two_axis_turntable", None, mounting=OBLIQUE)
    phi1, duration = 0.7, 60.0
    turn = arc(np.array([start * DEG]), np.array([rate * DEG * duration]))
    mean = sensed(
        chain, "phi2", rate_reference(LATITUDE), np.array([rate * DEG]), np.array([[phi1, 99.0]]), turn
    )
    expected = by_integration(rate * DEG, phi1, start * DEG, duration, axis)
    assert mean[0, axis] == pytest.approx(expected, abs=1e-13 * EARTH_RATE + 1e-14 * abs(expected), rel=1e-11)


def test_whole_turns_leave_only_the_earth_rate_along_the_turning_axis():
    settings = study((6.0, 12.0, -6.0), mounting=OBLIQUE)  # one, two and one turns in 60 s
    n = 3
    angles = np.tile([0.7, 0.0], (n, 1))
    rate = np.array(settings.rate_test.rates)
    w_n = rate_reference(LATITUDE)
    found = sensed(settings.chain, "phi2", w_n, rate, angles, arc(np.zeros(n) + 0.4, rate * 60.0))
    e_n = Rotation.from_rotvec([0.0, 0.7, 0.0]).apply([0.0, 0.0, 1.0])
    np.testing.assert_allclose(found, np.outer(rate + w_n @ e_n, OBLIQUE[2]), atol=1e-12 * EARTH_RATE)


def test_errors_before_the_turning_joint_leave_its_gain_alone():
    """The axis carries them along; only what turns with the joint can be oblique to it."""
    chain = turntable("two_axis_turntable", uniform(ARCMIN_2))
    angles, turn = np.array([[0.3, 0.0]]), np.array([[1.0, 0.0, 0.0]])
    for k, name in enumerate(chain.factors):
        errors = np.zeros((1, len(chain.errors)))
        errors[0, k] = 0.1
        gain = sensed(chain, "phi2", np.zeros(3), np.ones(1), angles, turn, errors)[0, 2]
        tilts = name in ("dalpha_x2", "dalpha_y2", "dtheta_x", "dtheta_y")
        assert gain == pytest.approx(np.cos(0.1) if tilts else 1.0, abs=1e-15)


@pytest.mark.parametrize("mounting", [None, OBLIQUE])
def test_mean_and_spread_of_the_input_are_those_of_drawn_tables(mounting):
    """Monte Carlo: first and second order of the misalignment, earth rate included."""
    settings = study((100.0,), normal(1.0 * DEG), mounting, rate_u=1e-3)
    rate, angles, turn = np.array([100.0 * DEG]), np.array([[0.4, 0.0]]), np.array([[1.0, 0.0, 0.0]])
    dwells = RateDwells(rate, angles, turn, ("gyro_z",), parse_unit("rad/s"), np.zeros((1, 1)), np.array([1]))
    given = gyro_input(dwells, settings, 2)
    rng, n = np.random.default_rng(20261121), 100_000
    drawn = settings.chain.draw(rng, 1, runs=n)[:, 0]
    of_rate = rate * (1.0 + 1e-3 * rng.standard_normal(n))
    many = np.ones((n, 1))
    x = sensed(settings.chain, "phi2", rate_reference(LATITUDE), of_rate, many * angles, many * turn, drawn)[
        :, 2
    ]
    spread = np.sqrt(sum(np.square(effect.shift).sum() for effect in given.effects))
    assert x.mean() == pytest.approx(given.x[0], abs=5.0 * x.std() / np.sqrt(n) + 2e-6 * rate[0])
    # 5 sigma of a sample standard deviation (kurtosis below 10) and the third order of 1 deg
    assert x.std() == pytest.approx(spread, rel=5.0 * np.sqrt(9.0 / 4.0 / n) + 1e-3)


# what the fit finds


TRUTH = {"S_z": 1.0004, "D_F_z": 3.0 * DEG_H, "S_asym_z": 42e-6}


def test_terms_are_recovered_to_rounding_without_noise():
    found = run(study(instrument={"coefficients": TRUTH})).estimate
    assert found.status is Status.OK
    assert found.names == ("D_F_z", "S_z", "S_asym_z", "S_nl_z", "S_hyst_z")
    assert found.units == ("rad/s", "1", "1", "1", "1")
    assert found["S_z"].value == pytest.approx(TRUTH["S_z"], abs=1e-12)
    assert found["D_F_z"].value == pytest.approx(TRUTH["D_F_z"], abs=1e-12)
    assert found["S_asym_z"].value == pytest.approx(TRUTH["S_asym_z"], abs=1e-12)
    assert found["S_hyst_z"].value == pytest.approx(0.0, abs=1e-12)


def test_asymmetry_is_the_difference_of_the_slopes_on_either_side_over_their_mean():
    """By two straight lines, one through the readings of each sign."""
    made = run(study(instrument={"coefficients": TRUTH}))
    x, y = made.inputs[0].x, made.readings.y[:, 0]
    plus, minus = (np.polyfit(x[side], y[side], 1)[0] for side in (x > 0, x < 0))
    assert made.estimate["S_asym_z"].value == pytest.approx(
        (plus - minus) / (0.5 * (plus + minus)), abs=1e-12
    )
    assert made.estimate["S_z"].value == pytest.approx(0.5 * (plus + minus), abs=1e-12)


def test_a_cubic_is_recovered_or_shows_as_non_linearity():
    s3 = 2e-5
    settings = study(UP, instrument={"coefficients": TRUTH | {"S3_z": s3}})
    cubic = run(replace(settings, rate_test=replace(settings.rate_test, order=3))).estimate
    assert cubic["S3_z"].value == pytest.approx(s3, rel=1e-9)
    assert cubic["S2_z"].value == pytest.approx(0.0, abs=1e-12)
    assert cubic["S_z"].value == pytest.approx(TRUTH["S_z"], rel=1e-11)
    made = run(settings)
    # over the full scale (the largest rate), and by NumPy's straight line
    x, y = made.inputs[0].x, made.readings.y[:, 0]
    rest = y - np.polyval(np.polyfit(x, y, 1), x)
    scale = made.estimate["S_z"].value * 100.0 * DEG
    assert made.estimate["S_nl_z"].value == pytest.approx(np.abs(rest).max() / scale, rel=1e-6)
    rows = made.estimate.result["rates"]
    np.testing.assert_allclose(
        [row["residual_ppm_of_full_scale"] for row in rows], 1e6 * rest / scale, atol=1e-4
    )


def test_hysteresis_is_the_difference_of_up_and_down():
    made = run(study(instrument={"coefficients": TRUTH | {"S_hyst_z": 25e-6}}, full_scale=200.0 * DEG))
    assert made.estimate["S_hyst_z"].value == pytest.approx(25e-6, rel=1e-3)
    ways = [row["reached_from"] for row in made.estimate.result["rates"]]
    assert ways == ["above"] + ["below"] * (len(UP) - 1) + ["above"] * (len(UP) - 1)
    assert "S_hyst_z" not in run(study(UP)).estimate.names


def test_hysteresis_does_not_pass_for_curvature():
    """The ends of a run up and down are reached one way each; a cubic would take their offset for its own."""
    bent = {"S_z": 1.001, "S_asym_z": 2e-4, "S3_z": 1e-5, "S_hyst_z": 50e-6}
    found = run(study(instrument={"coefficients": bent}, order=3)).estimate
    for name in ("S_asym_z", "S3_z", "S_z"):
        assert found[name].value == pytest.approx(bent[name], rel=1e-6)


def test_the_residuals_of_a_rate_test_are_drawn():
    found = run(study(instrument={"coefficients": {"S_z": 1.0}, "noise": 1e-6}))
    drawn = pictures(found)
    assert drawn[0].title == "Residual of each rate"
    assert all(picture.svg.startswith("<svg") for picture in drawn)
    assert pictures(run(study((10,)))) == []


def test_the_way_a_rate_was_reached_follows_from_the_order():
    assert approaches(np.array([0.0, 5.0, 5.0002, -3.0, 0.0, 0.0])).tolist() == [0, 1, 1, -1, 1, 1]
    same = levels(np.array([10.0, -10.0, 10.004, 20.0]))
    assert [part.tolist() for part in same] == [[1], [0, 2], [3]]


# earth rate


def test_ignored_earth_rate_becomes_bias_in_a_symmetric_test_and_scale_factor_in_a_one_sided_one():
    """About an upright axis earth rate adds w = we sin L to every rate: a straight line takes it as bias, a line
    through zero as w sum(rate)/sum(rate^2) of scale factor: 377 ppm at 1, 2, ... 10 deg/s. Corrected, none is left.
    """
    w = EARTH_RATE * np.sin(LATITUDE)
    both = run(study())
    rate, y = both.readings.rate, both.readings.y[:, 0]
    np.testing.assert_allclose(np.polyfit(rate, y, 1), [1.0, w], atol=1e-12)
    assert both.estimate["D_F_z"].value == pytest.approx(0.0, abs=1e-13)
    one = run(study(range(1, 11)))
    rate, y, x = one.readings.rate, one.readings.y[:, 0], one.inputs[0].x
    through_zero = rate @ y / (rate @ rate)
    assert through_zero - 1.0 == pytest.approx(w * rate.sum() / (rate @ rate), rel=1e-9)
    assert 1e6 * (through_zero - 1.0) == pytest.approx(376.4, abs=0.1)
    assert x @ y / (x @ x) == pytest.approx(1.0, abs=1e-12)
    assert one.estimate["S_z"].value == pytest.approx(1.0, abs=1e-12)


def test_earth_rate_alone_leaves_400_ppm_of_the_scale_factor_and_a_rate_test_a_few():
    """Twelve positions of a still table, 0.01 deg/h of noise: the earth is too slow to tell the scale factor."""
    noise = 0.01 * DEG_H
    told = {"unit": parse_unit("deg/h"), "noise": noise, "coefficients": {"S_x": 1.0}, "earth_rate": "fitted"}
    still = study(errors=uniform(1e-9), instrument=told | {"terms": ("D_F_x", "S_x", "T_xy", "T_xz")})
    still = replace(still, plan=named("12-position"), rate_test=None)
    found = run(still).estimate
    C_nb = still.chain.attitude(still.plan.angles)
    rows = np.column_stack([np.ones(12), rate_reference(LATITUDE) @ C_nb])
    closed = noise * np.sqrt(np.linalg.inv(rows.T @ rows)[1, 1])
    assert found["S_x"].u == pytest.approx(closed, rel=1e-6)
    assert found["S_x"].u == pytest.approx(390e-6, abs=10e-6)
    turning = run(study(UP, uniform(ARCMIN_2), instrument={"noise": noise}, rate_u=1e-6)).estimate
    assert turning["S_z"].u < 3e-6


def test_part_turns_matter_to_an_oblique_gyro():
    """At 7 deg/s for 20 s the table turns by 140 deg: the part of earth rate across the axis does not average out."""
    told = {"dwell": 20.0, "coefficients": {"S_x": 1.0, "S_y": 1.0, "S_z": 1.0}}
    settings = study((-9, -5, -2, 0, 2, 5, 7), mounting=OBLIQUE, instrument=told, at=JointAngles(0.7, 1.0))
    test = simulate(settings, np.random.default_rng(1))
    right = calibrate(test, settings).estimate
    blind = calibrate(without(test, "phi2"), settings).estimate
    for axis in "xyz":
        assert right[f"S_{axis}"].value == pytest.approx(1.0, abs=1e-11)
        assert right[f"D_F_{axis}"].value == pytest.approx(0.0, abs=1e-13)
    assert max(abs(blind[f"S_{axis}"].value - 1.0) for axis in "xyz") > 20e-6
    (said,) = blind.findings
    assert said.code == "whole_turns"
    assert "up to" in said.message
    assert right.result["plan"]["turns"] == "from the angles"


def test_an_aligned_gyro_needs_no_angle_of_the_turning_axis():
    settings = study()
    test = simulate(settings, np.random.default_rng(1))
    found = calibrate(without(test, "phi2", "position"), settings).estimate
    assert found["S_z"].value == pytest.approx(1.0, abs=1e-12)
    assert not found.findings


def test_samples_of_one_stay_carry_their_own_angles():
    """A stay recorded sample by sample gives the input that its mean over the arc has."""
    rates, duration, samples = np.array([-5.0, -2.0, 3.0, 7.0]) * DEG, 20.0, 400
    t = duration * (np.arange(samples) + 0.5) / samples
    w_n = rate_reference(LATITUDE)
    chain = turntable("two_axis_turntable", None, mounting=OBLIQUE)
    phi = (1.0 + rates[:, None] * t).ravel()
    rate = np.repeat(rates, samples)
    y = (w_n @ chain.attitude(np.column_stack([np.full(len(phi), 0.7), phi])))[:, 2] + rate * OBLIQUE[2, 2]
    found = record(
        position=(np.repeat(np.arange(4), samples), "1"),
        rate=(rate, "rad/s"),
        phi1=(np.full(len(phi), 0.7), "rad"),
        phi2=(np.angle(np.exp(1j * phi)), "rad"),
        gyro_z=(y, "rad/s"),
    )
    made = calibrate(found, study((), mounting=OBLIQUE))
    assert made.estimate["S_z"].value == pytest.approx(1.0, abs=1e-12)
    expected = [by_integration(each, 0.7, 1.0, duration, 2) for each in rates]
    np.testing.assert_allclose(made.inputs[0].x, expected, atol=1e-5 * EARTH_RATE)


# uncertainty


@pytest.mark.slow
@pytest.mark.parametrize("runs", [50, pytest.param(150, marks=pytest.mark.campaign)])
def test_intervals_cover_as_they_say(runs):
    """Tests with noise, table errors by scope and an uncertain table rate; noise stated or not by turns."""
    level, noise = 0.95, 2.0 * DEG_H
    truth = {"S_z": 1.0, "D_F_z": 5.0 * DEG_H, "S_asym_z": 20e-6}
    # coarse enough that misalignment of second order takes part
    told = {"coefficients": truth, "noise": noise}
    settings = study(UP_AND_DOWN, normal(10.0 / 60.0 * DEG), instrument=told, rate_u=4e-6)
    rng = np.random.default_rng(20261121)
    hits = dict.fromkeys(truth, 0)
    for k in range(runs):
        test = simulate(settings, rng)
        known = settings if k % 2 else replace(settings, instrument=replace(settings.instrument, noise=None))
        found = calibrate(test, known).estimate
        for name, value in truth.items():
            low, high = found[name].interval(level)
            hits[name] += low <= value <= high
    # all three within their limits with a probability of 0.999
    low, high = (stats.binom.ppf(q, runs, level) for q in (0.001 / 6, 1.0 - 0.001 / 6))
    assert all(low <= count <= high for count in hits.values()), (hits, low, high)


@pytest.mark.slow
@pytest.mark.parametrize("runs", [50, pytest.param(150, marks=pytest.mark.campaign)])
def test_a_bias_is_covered_where_the_table_scatters_more_than_the_noise(runs):
    """Noise that is not stated hides behind table errors of 30 arcmin: its few degrees of freedom must count.

    Of 50 runs all may be covered: these find intervals that are too short alone."""
    level, bias = 0.95, 5.0 * DEG_H
    told = {"coefficients": {"S_z": 1.0, "D_F_z": bias}, "noise": 2.0 * DEG_H}
    settings = study(UP_AND_DOWN, normal(30.0 / 60.0 * DEG), instrument=told)
    unstated = replace(settings, instrument=replace(settings.instrument, noise=None))
    rng = np.random.default_rng(20261121)
    hits = 0
    for _ in range(runs):
        low, high = calibrate(simulate(settings, rng), unstated).estimate["D_F_z"].interval(level)
        hits += low <= bias <= high
    low, high = (stats.binom.ppf(q, runs, level) for q in (0.0005, 0.9995))
    assert low <= hits <= high, (hits, low, high)


def test_the_rate_of_the_table_is_uncertain_in_common():
    """It enters the scale factor in full, and no other term; gyros tested together share it."""
    told = {"coefficients": {"S_x": 1.0, "S_z": 1.0}, "noise": 0.1 * DEG_H}
    settings = study(mounting=OBLIQUE, instrument=told, rate_u=50e-6)
    found = run(settings).estimate
    line = next(item for item in found.budget if item.source == "rate of the table")
    assert (line.type, line.u, line.unit) == ("B", 50e-6, "1")
    assert line.share["S_z"] > 0.99
    assert line.share["D_F_z"] < 1e-2
    assert line.share["S_asym_z"] < 1e-4
    assert found["S_z"].u == pytest.approx(50e-6, rel=1e-2)
    assert found.correlation[found.names.index("S_x"), found.names.index("S_z")] > 0.99


def test_table_errors_have_shares_that_sum_to_one_and_halving_them_helps_by_their_order():
    """First order where the gyro is oblique, second order where it is aligned."""

    def u(size, mounting):
        told = {"noise": 1e-6 * DEG_H}
        scopes = dict.fromkeys(turntable("two_axis_turntable", uniform(1.0)).factors, Scope.RIG)
        made = run(study(UP, uniform(size), mounting, told, scopes)).estimate
        for shares in made.result["tolerance_shares"].values():
            assert sum(shares.values()) == pytest.approx(1.0)
        return made["S_z"].u

    assert u(1e-2, OBLIQUE) / u(5e-3, OBLIQUE) == pytest.approx(2.0, rel=1e-2)
    assert u(1e-2, None) / u(5e-3, None) == pytest.approx(4.0, rel=1e-2)


def test_excess_scatter_is_said_and_no_verdict():
    made = run(study(instrument={"coefficients": TRUTH | {"S3_z": 1e-4}, "noise": 0.1 * DEG_H}))
    assert made.estimate.status is Status.OK
    assert [finding.code for finding in made.estimate.findings] == ["excess_scatter"]


# units


def test_counts_and_degrees_tell_the_same():
    per_count = 0.004 * DEG  # rad/s
    told = {"coefficients": TRUTH, "noise": 0.5 * DEG_H}
    settings = study(errors=uniform(ARCMIN_2), instrument=told)
    test = simulate(settings, np.random.default_rng(3))
    physical = calibrate(test, settings)
    column = test["gyro_z"]
    counts = replace(column, unit=parse_unit("count"), values=column.values * DEG / per_count)
    counted = replace(test, columns={**test.columns, "gyro_z": counts})
    own = replace(settings.instrument, unit=parse_unit("count"), noise=0.5 * DEG_H / per_count)
    raw = calibrate(counted, replace(settings, instrument=own))
    assert raw.estimate.units[:3] == ("count", "count/(rad/s)", "1")
    scale = np.array([per_count, per_count, 1.0, 1.0, 1.0])
    np.testing.assert_allclose(raw.estimate.values * scale, physical.estimate.values, rtol=1e-7, atol=1e-15)
    np.testing.assert_allclose(raw.estimate.u * scale, physical.estimate.u, rtol=1e-6)
    assert physical.shown.units[:2] == ("deg/s", "1")
    assert physical.shown["D_F_z"].value == pytest.approx(physical.estimate["D_F_z"].value / DEG)
    with pytest.raises(StudyError, match=r"instrument.unit: .*counts?, expected the same kind of unit"):
        calibrate(counted, settings)


# verdicts


@pytest.mark.parametrize(
    ("rates", "words"),
    [
        ((10,), "identify 1 of 2 terms"),
        ((10, 10, 10), "S_z"),
        ((10, -10), "and no stated noise, expected one stay more"),
    ],
)
def test_too_few_rates_are_unobservable(rates, words):
    found = run(study(rates)).estimate
    assert found.status is Status.UNOBSERVABLE
    assert words in found.message
    assert not found.names
    assert found.result["rates"] == []


def test_a_polynomial_of_too_high_an_order_is_unobservable():
    found = run(study((-10, 0, 10), order=3)).estimate
    assert found.status is Status.UNOBSERVABLE
    assert found.result["rank"] == 3
    (words,) = found.result["null_vectors"]
    assert "S3_z" in words


@pytest.mark.parametrize("rates", [(10, 20, 30, 40), (-10, 10, -10, 10)])
def test_asymmetry_is_left_out_where_the_rates_do_not_show_it(rates):
    found = run(study(rates)).estimate
    assert found.status is Status.OK
    assert "S_asym_z" not in found.names
    assert [finding.code for finding in found.findings] == ["weak_term"]
    assert found["S_z"].value == pytest.approx(1.0, abs=1e-12)


def test_rates_close_together_are_ill_conditioned():
    found = run(study((100, 100.5, 101))).estimate
    assert found.status is Status.ILL_CONDITIONED
    assert "spread them wider" in found.message


def test_an_output_that_does_not_follow_is_inconsistent():
    settings = study(UP)
    noise = np.random.default_rng(20261121).normal(0.0, 1.0, len(UP))
    test = record(rate=(UP, "deg/s"), phi1=(np.zeros(len(UP)), "deg"), gyro_z=(noise, "deg/s"))
    found = calibrate(test, settings).estimate
    assert found.status is Status.INCONSISTENT
    assert "gyro_z does not follow the rate" in found.message


def test_gyros_across_the_axis_are_left_out():
    told = {"coefficients": {"S_x": 1.0, "S_z": 1.0}}
    test = simulate(study(instrument=told), np.random.default_rng(1))
    found = calibrate(test, study()).estimate
    assert not any(name.endswith("_x") for name in found.names)
    assert found.findings[0].message.startswith(
        "gyro_x lies across the turning axis phi2 and is left out: with S_x"
    )
    only = run(study(instrument={"coefficients": {"S_x": 1.0}})).estimate
    assert only.status is Status.UNOBSERVABLE


def test_bad_studies_and_records_get_one_sentence():
    with pytest.raises(StudyError, match=r'instrument.kind: found "gyrowheel", expected "gyro"'):
        run(study(instrument={"kind": "gyrowheel", "coefficients": {}}))
    with pytest.raises(StudyError, match=r"rate_test.rates: missing"):
        run(study(()))
    with pytest.raises(StudyError, match="S_nl is not stated but follows"):
        run(study(instrument={"coefficients": {"S_z": 1.0, "S_nl_z": 1e-5}}))
    good = {"rate": ([1, 2, 3], "deg/s"), "phi1": ([0, 0, 0], "deg"), "gyro_z": ([1, 2, 3], "deg/s")}
    settings = study(())
    with pytest.raises(RecordError, match="expected one of gyro_x"):
        calibrate(record(**{k: v for k, v in good.items() if k != "gyro_z"}), settings)
    with pytest.raises(RecordError, match="no column phi1"):
        calibrate(record(**{k: v for k, v in good.items() if k != "phi1"}), settings)
    with pytest.raises(RecordError, match="row 2 has no number"):
        calibrate(record(**good | {"gyro_z": ([1, np.nan, 3], "deg/s")}), settings)
    with pytest.raises(RecordError, match="row 3 has no number for a rate, an angle, an output or its stay"):
        calibrate(record(**good | {"position": ([1, 1, np.nan], "1")}), settings)
    moving = good | {"phi1": ([0, 0, 9], "deg"), "position": ([1, 2, 2], "1")}
    with pytest.raises(RecordError, match="expected only phi2 to turn"):
        calibrate(record(**moving), settings)
