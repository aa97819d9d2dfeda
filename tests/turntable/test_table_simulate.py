"""Simulated tests: the model's readings, errors of the table by their scope, noise, times."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from turntable_studies import (
    ARCMIN,
    DEG_H,
    FULL_RANK,
    TUMBLE,
    WHEEL,
    WHEEL_X,
    references,
    study,
    table,
    wheel_output,
)

from inercal.foundation.rigs.chain import Scope
from inercal.systems.turntable.simulate import simulate_positions, truth


def column(record, name):
    return record[name].values


def test_without_errors_and_noise_the_readings_are_the_model_s():
    """Against the chain written out; outputs and angles in the units of the record."""
    record = simulate_positions(study(), np.random.default_rng(1))
    a, w = references(FULL_RANK.angles, {})
    for axis in "xy":
        expected = wheel_output(axis, WHEEL, a, w)
        assert_allclose(column(record, f"y_{axis}") * DEG_H, expected, rtol=1e-12)
        assert record[f"y_{axis}"].unit.symbol == "deg/h"
    assert_allclose(column(record, "phi1"), np.degrees(FULL_RANK.angles[:, 0]))
    assert list(column(record, "position")) == list(range(1, 37))
    assert record["phi2"].unit.symbol == "deg"


def test_terms_that_no_fit_asks_for_take_part_in_the_truth():
    """DX_ZZ on a table is a change of DX_F, DX_XX and DX_YY: a_z^2 = 1 - a_x^2 - a_y^2."""
    settings = study(coefficients=WHEEL | {"DX_ZZ": 5.0 * DEG_H})
    model, c = truth(settings)
    assert c[model.symbols.index("DX_ZZ")] == 5.0 * DEG_H
    moved = {s: WHEEL[s] + 5.0 * DEG_H * sign for s, sign in (("DX_F", 1), ("DX_XX", -1), ("DX_YY", -1))}
    one, other = (
        simulate_positions(s, np.random.default_rng(1)) for s in (settings, study(coefficients=WHEEL | moved))
    )
    assert_allclose(column(one, "y_x"), column(other, "y_x"), rtol=1e-12)


def test_only_channels_of_which_something_is_stated_are_recorded():
    assert "y_y" not in simulate_positions(study(coefficients=WHEEL_X), np.random.default_rng(1))


def test_samples_carry_the_noise_of_a_reading_times_the_root_of_their_number():
    """The mean over a dwell has the stated noise, whether samples are recorded or not."""
    quiet = study(TUMBLE, noise=0.1 * DEG_H, dwell=10.0)
    for settings in (quiet, replace(quiet, instrument=replace(quiet.instrument, sample_rate=5.0))):
        means = []
        for seed in range(40):
            record = simulate_positions(settings, np.random.default_rng([9, seed]))
            perfect = column(simulate_positions(study(TUMBLE), np.random.default_rng(0)), "y_x")
            y = column(record, "y_x").reshape(len(TUMBLE), -1)
            means.append(y.mean(axis=1) - perfect)
        n = 40 * len(TUMBLE)
        # relative standard error of a standard deviation: 1 / sqrt(2 n)
        assert np.std(means) == pytest.approx(0.1, rel=4.5 / np.sqrt(2 * n))


def test_times_are_the_middles_of_the_samples_one_dwell_after_the_other():
    record = simulate_positions(study(TUMBLE, dwell=10.0, sample_rate=2.0), np.random.default_rng(1))
    assert_allclose(record["y_x"].t, 0.25 + 0.5 * np.arange(24 * 20))
    assert_allclose(
        simulate_positions(study(TUMBLE, dwell=10.0), np.random.default_rng(1))["y_x"].t[:2], [5.0, 15.0]
    )


@pytest.mark.parametrize("scope", list(Scope))
def test_an_error_keeps_its_value_as_long_as_its_scope_says(scope):
    """The mounting error about z turns a_x into a_y: read back from the output by its derivative.

    All positions have phi2 = 0 and phi1 = 90 deg, where DX_Y = 1 reads a_y = -sin(dtheta_z).
    """
    chain = table(2.0 * ARCMIN).with_scope(scope)
    only = replace(chain, elements=tuple(e for e in chain.elements if getattr(e, "name", "") in KEPT))
    plan = replace(TUMBLE, angles=np.tile(np.radians([90.0, 0.0]), (24, 1)))
    settings = study(
        plan, only, coefficients={"DX_Y": 1.0, "k_x": 0.0}, unit="rad/s", dwell=5.0, sample_rate=2.0
    )
    error = -np.arcsin(column(simulate_positions(settings, np.random.default_rng(2)), "y_x").reshape(24, 10))
    assert np.abs(error).max() <= 2.0 * ARCMIN * (1 + 1e-9)
    within, between = np.ptp(error, axis=1), np.ptp(error.mean(axis=1))
    assert (within.max() > 0.1 * ARCMIN) == (scope is Scope.SAMPLE)
    assert (between > 0.1 * ARCMIN) == (scope in (Scope.SAMPLE, Scope.POSITION))  # of one angle


KEPT = ("phi1", "phi2", "dtheta_z")


def test_a_run_is_repeated_by_its_seed():
    settings = study(chain=table(), noise=0.01 * DEG_H)
    one, same, other = (
        column(simulate_positions(settings, np.random.default_rng(seed)), "y_x") for seed in (3, 3, 4)
    )
    assert np.array_equal(one, same)
    assert not np.array_equal(one, other)


def test_the_site_s_latitude_counts():
    """At the pole earth rate and gravity are parallel: k reads like a drift."""
    site = replace(study().site, latitude=np.pi / 2)
    a, w = references(FULL_RANK.angles, {}, np.pi / 2)
    record = simulate_positions(study(site=site), np.random.default_rng(1))
    assert_allclose(column(record, "y_x") * DEG_H, wheel_output("x", WHEEL, a, w), rtol=1e-12)
