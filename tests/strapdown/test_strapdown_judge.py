"""A unit that is judged: what changes over a record is named by its size; priors and starts are honest."""

from dataclasses import replace

import numpy as np
import pytest
import strapdown_faults as faults
from grades import NAV
from independent import strapdown

from inercal.foundation.findings import Status
from inercal.foundation.geometry.earth import EARTH_RATE
from inercal.foundation.inference.evidence import of_normal_equations
from inercal.foundation.records.record import record_of
from inercal.foundation.units import parse_unit
from inercal.systems.strapdown.fit.start import start_u
from inercal.systems.strapdown.task import calibrate

DPH = strapdown.DEG_PER_H
CELLS = ("by_order", "by_place", "by_reading", "by_history")


def estimated(seed=0, change=lambda acc, gyro: (acc, gyro), unit=lambda made: made, settings=faults.SETTINGS):
    rng = np.random.default_rng([faults.SEED, seed])
    made = unit(strapdown.unit(rng))
    t, acc, gyro = strapdown.record(rng, made, faults.TEST, strapdown.Faults())
    acc, gyro = change(acc, gyro)
    units = {"acc": parse_unit("m/s^2"), "gyro": parse_unit("rad/s")}
    columns = [
        (f"{sensor}_{axis}", units[sensor], values[:, i])
        for sensor, values in (("acc", acc), ("gyro", gyro))
        for i, axis in enumerate("xyz")
    ]
    return calibrate(record_of(columns, t), settings).estimate, made.truth()


def test_evidence_of_normal_equations_is_that_of_their_rows():
    """Score, shift and chance are those of least squares with and without the columns that are asked."""
    rng = np.random.default_rng(3)
    J, X = rng.standard_normal((200, 5)), rng.standard_normal((200, 3))
    y = rng.standard_normal(200) + X @ [0.3, -0.2, 0.1]
    x = np.linalg.lstsq(J, y)[0]
    both = np.hstack([J, X])
    left = y - J @ x
    of_fit, columns = of_normal_equations(both.T @ both, both.T @ left, np.eye(5), left @ left, 195.0, 0.0)
    asked = of_fit.ask(columns)
    whole = np.linalg.lstsq(both, y)[0]
    assert of_fit.explained(asked) == pytest.approx(left @ left - np.sum((y - both @ whole) ** 2))
    np.testing.assert_allclose(of_fit.shift(asked), x - whole[:5], atol=1e-12)
    assert of_fit.dof == pytest.approx(195.0)
    assert of_fit.squares == pytest.approx(left @ left)


@pytest.mark.slow
def test_a_gyro_that_loses_scale_late_in_the_record_is_named():
    def change(acc, gyro):
        late = (np.arange(len(gyro)) > 0.6 * len(gyro))[:, None]
        return acc, gyro * (1.0 + 2e-3 * late)

    estimate, _ = estimated(change=change)
    assert estimate.status is not Status.OK
    (finding,) = (one for one in estimate.findings if one.code in CELLS)
    assert finding.code == "by_order"
    assert "step" in finding.headline
    assert finding.harm


@pytest.mark.slow
@pytest.mark.parametrize("seed", [1])
def test_a_sound_unit_with_biases_of_ten_degrees_per_hour_is_met(seed):
    """North by gyros of such biases is off by some 40 deg, and the start says so."""
    prior = replace(faults.SETTINGS.prior, gyro_bias=10.0 * DPH)
    estimate, truth = estimated(
        seed,
        unit=lambda made: replace(made, D=np.random.default_rng(seed).normal(0.0, 10.0 * DPH, 3)),
        settings=replace(faults.SETTINGS, prior=prior),
    )
    assert estimate.status is Status.OK
    assert estimate.statistics["chi2"] < 1.15 * estimate.statistics["dof"]
    assert max(abs(estimate[name].value - truth[name]) / estimate[name].u for name in estimate.names) < 4.0


@pytest.mark.slow
def test_one_noise_that_is_stated_too_large_makes_no_fault_of_the_others():
    """With a stand that is still to a third of what is stated residuals are far below the noise, those of gyros are
    not: by the pooled size four of nine sound units were named."""
    settings = replace(
        faults.SETTINGS, rests=replace(faults.SETTINGS.rests, velocity=3.0 * faults.TEST.vibration)
    )
    estimate, _ = estimated(3, settings=settings)
    assert estimate.statistics["chi2"] < 0.6 * estimate.statistics["dof"]
    assert not [finding.code for finding in estimate.findings if finding.code in CELLS]
    assert estimate.status is Status.OK


def test_the_heading_by_earth_rate_is_as_uncertain_as_biases_make_it():
    """Rms error of a heading by the east part of the rate at rest, of biases drawn from the prior."""
    rng = np.random.default_rng(4)
    level = EARTH_RATE * np.cos(NAV.latitude)
    biases = rng.normal(0.0, 0.2 * level, (20_000, 2))
    error = np.arctan2(biases[:, 0], level + biases[:, 1])
    u = start_u(replace(NAV, prior=replace(NAV.prior, gyro_bias=0.2 * level)))[2]
    assert np.sqrt(np.mean(error**2)) == pytest.approx(u, rel=0.12)
