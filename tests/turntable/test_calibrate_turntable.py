"""A calibration from record to estimate: verdicts in words, units, what is stated, and what is uncertain."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from turntable_studies import (
    ARCMIN,
    DEG_H,
    FULL_RANK,
    LATITUDE,
    TUMBLE,
    WHEEL,
    WHEEL_X,
    codes_of,
    study,
    table,
    usual_terms,
)

from inercal.foundation.errors import CalibrationError, StudyError
from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import GravityInput, Site
from inercal.foundation.records.column import Column
from inercal.foundation.results.files import from_json, to_json
from inercal.foundation.rigs.chain import Scope
from inercal.foundation.rigs.plans import grid, listed, named
from inercal.foundation.units import parse_unit
from inercal.systems.turntable.simulate import simulate_positions
from inercal.systems.turntable.task import calibrate

NOISE = 0.01 * DEG_H
ACCELEROMETERS = {f"K1_{i}": 1.0 for i in "xyz"} | {
    "K0_x": 1e-3,
    "M_xy": 2e-4,
    "M_zx": -3e-4,
    "K2_x": 2e-6,
    "K3_y": 1e-7,
    "Kip_z": 3e-6,
}
GYROS = {"D_F_x": 1e-4, "S_x": 1.01, "T_xy": 0.02, "G_xx": 1e-7} | {
    "D_F_y": -2e-4,
    "S_y": 0.98,
    "S_z": 1.02,
    "G_zy": 2e-7,
}


def run(settings, seed=1, told=None):
    """A simulated record of one study, calibrated by another or by itself."""
    return calibrate(simulate_positions(settings, np.random.default_rng(seed)), told or settings)


def values_of(estimate):
    return dict(zip(estimate.names, estimate.values, strict=True))


# perfect tests


@pytest.mark.parametrize(
    ("kind", "unit", "coefficients", "plan"),
    [
        ("gyrowheel", "deg/h", WHEEL, FULL_RANK),
        ("gyro", "deg/s", GYROS, FULL_RANK),
        ("accelerometer", "m/s^2", ACCELEROMETERS, grid((7, 8))),
    ],
)
@pytest.mark.parametrize("noise", [0.0, None])
def test_a_perfect_test_gives_the_coefficients_back(kind, unit, coefficients, plan, noise):
    """No noise, no errors: each to 1e-9 of the largest effect that such a term can have."""
    done = run(study(plan, kind=kind, unit=unit, coefficients=coefficients, noise=noise))
    estimate = done.estimate
    assert estimate.status is Status.OK
    assert list(estimate.names) == usual_terms(kind)
    rows = np.abs(done.fitting.model.rows(done.readings.angles)).max(axis=(0, 1))
    for k, name in enumerate(estimate.names):
        off = (estimate.values[k] - coefficients.get(name, 0.0)) * rows[k]
        assert abs(off) < 1e-9 * np.abs(done.readings.y).max()


def test_the_default_fits_earth_rate_where_the_plan_allows_it():
    fitted = run(study(FULL_RANK, noise=NOISE)).estimate
    assert fitted.result["earth_rate"] == "fitted"
    assert fitted.result["rank"] == fitted.result["terms"] == 12
    assert fitted.result["null_vectors"] == []
    assert not codes_of(fitted)


def test_the_default_falls_back_to_stated_earth_rate_and_says_so():
    """The tumble identifies 11 of 12; with earth rate subtracted all nine drift terms are right."""
    done = run(study(TUMBLE, noise=0.0)).estimate
    assert done.status is Status.OK
    assert done.result["earth_rate"] == "stated"
    assert done.result["rank"] == done.result["terms"] == 9
    assert codes_of(done) == ["stated_earth_rate"]
    for symbol in ("k_x", "k_y", "k_z", "kY_x", "kY_y", "kY_z"):
        assert f"{symbol} = {WHEEL.get(symbol, 0.0):.6g}" in done.findings[0].message
    assert all(name.startswith("D") for name in done.names)
    for name, value in values_of(done).items():
        assert value == pytest.approx(WHEEL[name], rel=1e-9)


def test_earth_rate_is_not_blamed_for_what_it_does_not_cause():
    """The cube tells the torquer terms, but no products of two components of gravity, stated earth rate or not."""
    for choice, rank in ((None, "9 of 12"), ("stated", "6 of 9")):
        estimate = run(study(named("16-cube"), noise=NOISE, earth_rate=choice)).estimate
        assert not codes_of(estimate)
        assert rank in estimate.message
        assert set(estimate.result["null_vectors"]) == {f"D{a}_{p}" for a in "XY" for p in ("XY", "XZ", "YZ")}


def test_earth_rate_may_be_taken_as_stated_where_it_could_be_fitted():
    done = run(study(FULL_RANK, noise=NOISE, earth_rate="stated")).estimate
    assert done.result["earth_rate"] == "stated"
    assert len(done.names) == 18
    assert not codes_of(done)


def test_terms_that_are_not_asked_for_are_taken_as_stated():
    """Only three drift terms of axis X are fitted, everything else is known: they are right."""
    asked = ("DX_F", "DX_X", "DX_Y")
    done = run(study(TUMBLE, coefficients=WHEEL_X, noise=0.0, terms=asked)).estimate
    assert done.names == asked
    assert_allclose(done.values, [WHEEL[name] for name in asked], rtol=1e-9)
    assert done.result["earth_rate"] == "stated"


def test_a_term_no_table_tells_changes_others_where_it_is_left_out():
    """DX_F' = DX_F + DX_ZZ, DX_XX' = DX_XX - DX_ZZ, DX_YY' = DX_YY - DX_ZZ; stated, it leaves them as they are."""
    real = study(FULL_RANK, coefficients=WHEEL_X | {"DX_ZZ": 4.0 * DEG_H}, noise=0.0)
    silent = values_of(run(real, told=study(coefficients=WHEEL_X, noise=0.0)).estimate)
    stated = values_of(run(real).estimate)
    for name in WHEEL_X:
        change = {"DX_F": 1, "DX_XX": -1, "DX_YY": -1}.get(name, 0) * 4.0 * DEG_H
        size = 50.0 * DEG_H if name[0] == "D" else 1.0
        assert silent[name] - WHEEL_X[name] == pytest.approx(change, abs=1e-9 * size)
        assert stated[name] - WHEEL_X[name] == pytest.approx(0.0, abs=1e-9 * size)


# verdicts


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        (study(TUMBLE, noise=NOISE, earth_rate="fitted"), "identify 11 of 12 terms"),
        (
            study(named("16-cube"), noise=NOISE),
            "identify 9 of 12 terms: the readings do not change along DX_",
        ),
        (study(FULL_RANK, noise=NOISE, terms=(*WHEEL, "DX_ZZ")), "identify 12 of 13 terms"),
        (
            study(FULL_RANK, kind="accelerometer", unit="m/s^2", coefficients=ACCELEROMETERS, noise=1e-5),
            "K3_z - 0.75 K1_z",  # on this grid a_z is 0 or +-sqrt(3/4) g: a cube is 3/4 of the input
        ),
    ],
)
def test_a_plan_that_leaves_a_term_unidentified_ends_unobservable(settings, says):
    """With the null vector in words, and without any value."""
    estimate = run(settings).estimate
    assert estimate.status is Status.UNOBSERVABLE
    assert says in estimate.message
    assert estimate.names == ()
    assert estimate.result["rank"] < estimate.result["terms"]
    assert all(words in estimate.message for words in estimate.result["null_vectors"])
    assert from_json(to_json(estimate)).status is Status.UNOBSERVABLE
    with pytest.raises(CalibrationError):
        estimate.raise_for_status()


def test_the_null_vector_of_the_tumble_names_its_terms():
    words = run(study(TUMBLE, noise=NOISE, earth_rate="fitted")).estimate.result["null_vectors"]
    assert len(words) == 2  # one of each axis
    for axis, k in (("X", "k"), ("Y", "kY")):
        of_axis = [text for text in words if f"D{axis}_" in text]
        assert len(of_axis) == 1
        assert f"{k}_x" in of_axis[0]


@pytest.mark.parametrize(("noise", "fewest"), [(NOISE, 12), (None, 13)])
def test_as_many_positions_as_terms_are_needed_and_one_more_for_the_noise(noise, fewest):
    for n in (fewest - 1, fewest):
        plan = listed(np.random.default_rng(5).uniform(-np.pi, np.pi, (n, 2)))
        told = study(plan, noise=noise, earth_rate="fitted")
        estimate = run(study(plan, noise=NOISE), told=told).estimate
        assert (estimate.status is Status.UNOBSERVABLE) == (n < fewest)
    assert np.all(np.isfinite(estimate.k))


def test_thirteen_are_asked_for_in_words_where_the_noise_is_not_stated():
    plan = listed(np.random.default_rng(5).uniform(-np.pi, np.pi, (12, 2)))
    estimate = run(study(plan, noise=NOISE), told=study(plan, noise=None, earth_rate="fitted")).estimate
    assert "found 12 positions for 12 terms, expected at least 13" in estimate.message


def test_noise_that_is_understated_by_five_is_inconsistent():
    real = study(FULL_RANK, noise=5.0 * NOISE)
    told = study(FULL_RANK, noise=NOISE)
    assert run(real).estimate.status is Status.OK
    estimate = run(real, told=told).estimate
    assert estimate.status is Status.INCONSISTENT
    ratio = float(estimate.message.split(" by ")[1].split()[0])
    assert ratio == pytest.approx(5.0, rel=4.5 / np.sqrt(2 * 48))


def test_a_table_worse_than_stated_is_inconsistent():
    real = study(FULL_RANK, table(20.0 * ARCMIN), noise=NOISE)
    assert run(real, told=study(FULL_RANK, table(), noise=NOISE)).estimate.status is Status.INCONSISTENT


def test_noise_that_is_not_stated_cannot_be_contradicted():
    """Its estimate is the true one within its uncertainty, and that is what the result is uncertain by."""
    real = study(FULL_RANK, noise=5.0 * NOISE)
    estimate = run(real, told=study(FULL_RANK, noise=None)).estimate
    assert estimate.status is Status.OK
    known = run(real).estimate
    assert_allclose(estimate.values, known.values, rtol=1e-6, atol=1e-6 * NOISE)
    for channel, part in zip(estimate.result["noise"], (slice(0, 12), slice(12, 24)), strict=True):
        ratio = channel["noise"] / (5.0 * NOISE)
        assert ratio == pytest.approx(1.0, abs=4.5 / np.sqrt(2 * 24))
        assert_allclose(estimate.u[part], known.u[part] * ratio, rtol=1e-6)
        assert channel["from"] == "residuals"
    assert_allclose(estimate.dof, 24.0, rtol=1e-6)
    assert np.isinf(known.dof).all()


def test_positions_close_together_are_ill_conditioned():
    """All within 8 deg of one attitude: the rank is full, but terms can hardly be told apart."""
    plan = listed(np.radians(40.0) + np.random.default_rng(1).uniform(-0.14, 0.14, (40, 2)))
    estimate = run(study(plan, coefficients=WHEEL_X, noise=1e-6 * NOISE, earth_rate="stated")).estimate
    assert estimate.status is Status.ILL_CONDITIONED
    assert estimate.statistics["condition"] > 100.0
    assert "only weakly" in estimate.message


# records


def test_samples_and_rows_give_the_same_estimate():
    settings = study(FULL_RANK, noise=0.0, dwell=4.0)
    rows, sampled = (
        run(replace(settings, instrument=replace(settings.instrument, sample_rate=rate))).estimate
        for rate in (None, 5.0)
    )
    scale = np.where([name[0] == "D" for name in rows.names], DEG_H, 1.0)
    assert_allclose(rows.values / scale, sampled.values / scale, atol=1e-9)


@pytest.mark.parametrize("rate", [None, 5.0])
def test_errors_of_each_sample_average_over_the_dwell_where_the_record_shows_it(rate):
    """With one row each they count as a whole. 600 coefficients in units of u: rms 1 within 4.5 sigma."""
    settings = study(
        FULL_RANK,
        table(scopes=dict.fromkeys(table().factors, Scope.SAMPLE)),
        noise=NOISE,
        dwell=10.0,
        sample_rate=rate,
    )
    ratios = []
    for seed in range(25):
        estimate = run(settings, seed).estimate
        error = estimate.values - np.array([WHEEL[name] for name in estimate.names])
        ratios.append(error / estimate.u)
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, abs=4.5 * np.sqrt(2.0 / (2 * 600)))
    of_table = sum(item.share.get("DX_X", 0.0) for item in estimate.budget if not item.source.startswith("n"))
    assert (of_table > 0.5) == (rate is None)


def rewritten(record, unit):
    """The record with its outputs in another unit."""
    to = parse_unit(unit)
    columns = dict(record.columns)
    for name in ("y_x", "y_y"):
        old = columns[name]
        columns[name] = Column(name, to, old.values * old.unit.factor / to.factor, old.t, old.source)
    return replace(record, columns=columns)


def test_the_unit_of_the_record_does_not_matter():
    """deg/h or rad/s: the same result in SI, and each shown in the unit of its record."""
    settings = study(FULL_RANK, table(), noise=NOISE)
    record = simulate_positions(settings, np.random.default_rng(1))
    one, other = (calibrate(r, settings) for r in (record, rewritten(record, "rad/s")))
    size = one.estimate.u
    assert np.abs((one.estimate.values - other.estimate.values) / size).max() < 1e-9
    assert one.estimate.units == other.estimate.units
    assert one.estimate.units[one.estimate.names.index("DX_F")] == "rad/s"
    assert one.estimate.units[0] == "1"
    assert one.shown["DX_F"].unit == "deg/h"
    assert one.shown["DX_F"].value == pytest.approx(one.estimate["DX_F"].value / DEG_H)
    assert one.shown["DX_F"].u == pytest.approx(one.estimate["DX_F"].u / DEG_H)
    assert one.shown["k_x"].value == one.estimate["k_x"].value
    assert other.shown["DX_F"].unit == "rad/s"


def test_counts_are_calibrated_in_counts():
    """k is then in counts per rate, drift in counts."""
    scale = 1000.0 / DEG_H
    counts = {name: value * scale for name, value in WHEEL.items()}
    done = run(study(FULL_RANK, unit="count", coefficients=counts, noise=0.0))
    assert done.estimate.status is Status.OK
    for name, value in values_of(done.estimate).items():
        assert value == pytest.approx(counts[name], rel=1e-9)
    assert done.estimate["k_x"].unit == "count/(rad/s)"
    assert done.estimate["DX_XY"].unit == "count"
    assert done.shown["k_x"].value == done.estimate["k_x"].value


def test_counts_need_a_stated_k_where_the_plan_does_not_tell_it():
    counts = {"DX_F": 100.0, "DY_F": 100.0}
    with pytest.raises(StudyError, match="none of k_x, k_y, k_z, kY_x, kY_y, kY_z is stated"):
        run(study(TUMBLE, unit="count", coefficients=counts, noise=1.0))
    done = run(study(TUMBLE, unit="count", coefficients=counts | {"k_x": 1e6}, noise=1.0))
    assert done.estimate.status is Status.OK


def test_values_stated_for_one_kind_of_unit_are_refused_for_another():
    record = simulate_positions(
        study(FULL_RANK, unit="count", coefficients={"DX_F": 100.0}), np.random.default_rng(1)
    )
    with pytest.raises(StudyError, match="stated for outputs in deg/h"):
        calibrate(record, study(FULL_RANK, noise=NOISE))


def test_one_channel_alone_is_calibrated():
    one = run(study(FULL_RANK, coefficients=WHEEL_X, noise=NOISE)).estimate
    assert one.names == tuple(usual_terms("gyrowheel")[:12])
    assert one.statistics["dof"] == 24.0
    assert_allclose(one.values, [WHEEL[name] for name in one.names], atol=5.0 * one.u.max())


def test_without_errors_of_the_table_channels_do_not_see_each_other():
    both = run(study(FULL_RANK, noise=NOISE)).estimate
    assert np.abs(both.correlation[:12, 12:]).max() < 1e-12


def test_with_errors_of_the_table_they_do():
    both = run(study(FULL_RANK, table(), noise=NOISE)).estimate
    assert np.abs(both.correlation[:12, 12:]).max() > 0.1


# what is uncertain


def from_source(estimate, source):
    """Standard deviations (p,) that a source causes, by the budget."""
    shares = {item.source: item.share for item in estimate.budget}[source]
    return estimate.u * np.sqrt([shares.get(name, 0.0) for name in estimate.names])


@pytest.mark.parametrize("earth_rate", ["fitted", "stated"])
def test_the_latitude_moves_the_estimate_as_the_budget_says(earth_rate):
    """Against a calibration at a latitude that differs by its uncertainty, with the same weights."""
    step = np.radians(0.05)
    settings = study(FULL_RANK, noise=NOISE, earth_rate=earth_rate)
    record = simulate_positions(settings, np.random.default_rng(1))

    def at(latitude):
        return calibrate(record, replace(settings, site=Site(9.8, (), latitude, step))).estimate

    base = at(LATITUDE)
    change = at(LATITUDE + step).values - base.values
    assert np.abs(change / base.u).max() > 0.1
    off = (np.abs(change) - from_source(base, "latitude")) / base.u
    assert np.abs(off).max() < 5e-3


def test_gravity_moves_accelerometers_as_the_budget_says():
    step = 1e-3
    settings = study(
        grid((7, 8)), kind="accelerometer", unit="m/s^2", coefficients=ACCELEROMETERS, noise=1e-4
    )
    record = simulate_positions(settings, np.random.default_rng(1))

    def under(gravity):
        site = Site(gravity, (GravityInput("gravity", step, "m/s^2", 1.0),), LATITUDE)
        return calibrate(record, replace(settings, site=site)).estimate

    base = under(9.8)
    change = under(9.8 + step).values - base.values
    off = (np.abs(change) - from_source(base, "gravity")) / base.u
    assert np.abs(off).max() < 5e-3
    at = list(base.names).index("K1_x")
    assert change[at] == pytest.approx(-base.values[at] * step / 9.8, rel=1e-3)


def test_gravity_does_not_matter_to_a_gyrowheel():
    """Its drift is per gravity of the site."""
    site = Site(9.8, (GravityInput("gravity", 1e-2, "m/s^2", 1.0),), LATITUDE)
    estimate = run(study(FULL_RANK, site=site, noise=NOISE)).estimate
    assert "gravity" not in [item.source for item in estimate.budget]


@pytest.mark.parametrize("symbol", ["k_x", "k_z", "kY_y"])
def test_a_stated_term_moves_the_estimate_as_the_budget_says(symbol):
    step = 1e-3
    settings = study(TUMBLE, noise=NOISE)
    record = simulate_positions(settings, np.random.default_rng(1))

    def told(coefficients, **more):
        return calibrate(record, study(TUMBLE, noise=NOISE, coefficients=coefficients, **more)).estimate

    base = told(WHEEL, coefficients_u={symbol: step})
    change = told(WHEEL | {symbol: WHEEL[symbol] + step}, coefficients_u={symbol: step}).values - base.values
    off = (np.abs(change) - from_source(base, f"stated {symbol}")) / base.u
    assert np.abs(off).max() < 1e-4
    # what is not known exactly cannot make the others better known
    assert np.all(base.u >= told(WHEEL).u * (1.0 - 1e-9))


def test_earth_rate_that_is_stated_is_misdirected_by_the_table_too():
    """Only earth rate reads (k_x = 1000), and the table is off: its errors must show in the uncertainty."""
    only = {"k_x": 1000.0, "DX_F": 50.0 * DEG_H}
    settings = study(TUMBLE, table(), coefficients=only, noise=NOISE)
    ratios = []
    for seed in range(40):
        estimate = run(settings, seed).estimate
        ratios.append((estimate.values - [only.get(name, 0.0) for name in estimate.names]) / estimate.u)
        assert estimate.status is Status.OK
    # mean square of 40 x 9 correlated ratios; half of them would be independent
    assert np.mean(np.square(ratios)) == pytest.approx(1.0, abs=4.5 * np.sqrt(2.0 / 180))


def test_the_result_survives_a_file():
    estimate = run(study(FULL_RANK, table(), noise=None), told=None).estimate
    back = from_json(to_json(estimate))
    assert back.names == estimate.names
    assert np.array_equal(back.covariance, estimate.covariance)


def test_the_plan_is_named_only_where_the_record_took_it():
    real = study(TUMBLE, noise=NOISE)
    assert run(real).estimate.result["plan"]["name"] == "24-position"
    assert run(real, told=study(FULL_RANK, noise=NOISE)).estimate.result["plan"]["name"] == "of the record"


def test_accelerometers_whose_noise_is_not_stated_are_known_as_well_as_those_whose_is():
    """Each axis alone could not tell a noise far below what the table does to it; the three together can.

    The table turns gravity and leaves its size: uncertainties with the noise estimated are those with it stated,
    within what 27 degrees of freedom tell of a standard deviation (five times 14 %).
    """
    noise, chain = 1e-5, table()
    settings = study(
        grid((7, 8)), chain, kind="accelerometer", unit="m/s^2", coefficients=ACCELEROMETERS, noise=noise
    )
    unstated = replace(settings, instrument=replace(settings.instrument, noise=None))
    rng = np.random.default_rng(20261121)
    for _ in range(3):
        record = simulate_positions(settings, rng)
        known, found = (calibrate(record, each).estimate for each in (settings, unstated))
        assert found.status is Status.OK
        assert np.all(found.u < 1.7 * known.u)
        assert np.all(found.u > 0.4 * known.u)


def test_errors_whose_squares_matter_are_fitted_to_second_order():
    """The cosine of a degree takes 1.5e-4 of gravity, fifteen times this noise; of two arcmin it takes nothing. Of ten
    degrees the cube bends readings too."""
    for size, second, codes in (
        (600.0 * ARCMIN, True, ["large_errors"]),
        (60.0 * ARCMIN, True, []),
        (2.0 * ARCMIN, False, []),
    ):
        settings = study(
            grid((7, 8)),
            table(size),
            kind="accelerometer",
            unit="m/s^2",
            coefficients=ACCELEROMETERS,
            noise=1e-4,
        )
        estimate = run(settings).estimate
        assert estimate.result["second_order"] is second
        assert codes_of(estimate) == codes


@pytest.mark.parametrize(("noise", "second"), [(None, True), (NOISE, False)])
def test_squares_of_errors_that_stay_are_fitted_where_there_is_no_noise_above_them(noise, second):
    """Errors that stay are found with the terms, as well as the noise allows: without any only their squares are left,
    (1e-3)^2 of earth rate, which no u of first order holds. Noise of 0.01 deg/h is 700 times that."""
    settings = study(FULL_RANK, table().with_scope(Scope.RIG), noise=noise, earth_rate="stated")
    made = simulate_positions(
        replace(settings, instrument=replace(settings.instrument, noise=noise or 0.0)),
        np.random.default_rng(2),
    )
    estimate = calibrate(made, settings).estimate
    assert estimate.result["second_order"] is second
    assert estimate.status is Status.OK
    assert np.all(np.abs(estimate.values - [WHEEL[name] for name in estimate.names]) < 4.0 * estimate.u)


def test_errors_that_stay_are_called_too_large_where_their_cubes_matter_against_u():
    """Without noise, cubes of a degree shift terms by a fifth of u, and values are several u off."""
    settings = study(FULL_RANK, table(60.0 * ARCMIN).with_scope(Scope.RIG), noise=None, earth_rate="stated")
    made = simulate_positions(
        replace(settings, instrument=replace(settings.instrument, noise=0.0)), np.random.default_rng(2)
    )
    assert "large_errors" in codes_of(calibrate(made, settings).estimate)


def test_a_relative_term_without_its_gain_is_refused():
    """K2 of an output in volts is nothing without K1."""
    settings = study(
        grid((7, 8)),
        kind="accelerometer",
        unit="V",
        coefficients={"K1_x": 0.1},
        noise=1e-4,
        terms=("K0_x", "K1_x"),
    )
    record = simulate_positions(settings, np.random.default_rng(1))
    told = replace(settings, instrument=replace(settings.instrument, coefficients={"K2_x": 1e-5}))
    with pytest.raises(StudyError, match="K2_x relate to K1_x, expected a value of K1_x too"):
        calibrate(record, told)


def test_a_reading_that_does_not_belong_is_named():
    record = simulate_positions(study(FULL_RANK, noise=NOISE), np.random.default_rng(1))
    y = record["y_x"].values.copy()
    y[6] += 100.0 * NOISE / DEG_H
    wrong = replace(record, columns=record.columns | {"y_x": replace(record["y_x"], values=y)})
    found = calibrate(wrong, study(FULL_RANK, noise=NOISE)).estimate
    assert found.status is Status.INCONSISTENT
    assert "most at position 7 of y_x" in found.message
