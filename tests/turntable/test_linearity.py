"""Bounds of non-linearity and hysteresis, against curves that a simulator of this file draws."""

import numpy as np
import pytest
from scipy import stats

from inercal.foundation.geometry.earth import Site
from inercal.foundation.inputs import Source
from inercal.foundation.records.column import Column
from inercal.foundation.records.record import Record
from inercal.foundation.results.result import COVERAGE
from inercal.foundation.rigs.plans import named
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.units import parse_unit
from inercal.systems.turntable.rate.calibration import calibrate_rates
from inercal.systems.turntable.rate.linearity import Deviations, largest
from inercal.systems.turntable.settings import Instrument, PositionDesign, RateTest, TurntableSettings

EARTH = 7.292115e-5
LATITUDE = np.radians(39.1)
UP = np.radians([-100.0, -60.0, -30.0, -10.0, -1.0, 1.0, 10.0, 30.0, 60.0, 100.0])
UP_AND_DOWN = np.concatenate([UP, UP[-2::-1]])
SIGMA = 10e-6
"""Noise of a reading, over full scale."""

CURVES = {
    "straight": lambda u, way: 0.0 * u,
    "kink": lambda u, way: np.abs(u),
    "cubic": lambda u, way: u**3 - 0.6 * u,
    "one rate": lambda u, way: np.where(np.abs(u - 0.3) < 1e-9, 1.0, 0.0),
    "two ways": lambda u, way: 0.5 * way,
}


def estimate_of(rate, deviation, noise, stated, rng):
    """A rate test about the vertical with readings a straight line, a deviation [of full scale] and noise."""
    full = np.abs(rate).max()
    y = rate + EARTH * np.sin(LATITUDE) + full * (deviation + noise * rng.standard_normal(len(rate)))
    source, t = Source("bench.csv", ""), np.arange(float(len(rate)))
    columns = {"rate": ("rad/s", rate), "phi1": ("rad", 0.0 * rate), "gyro_z": ("rad/s", y)}
    record = Record(
        {name: Column(name, parse_unit(unit), values, t, source) for name, (unit, values) in columns.items()},
        sources=(source,),
    )
    settings = TurntableSettings(
        site=Site(9.8, (), LATITUDE),
        rig="two_axis_turntable",
        chain=turntable("two_axis_turntable", None),
        plan=named("24-position"),
        design=PositionDesign(named("24-position")),
        instrument=Instrument(kind="gyro", noise=noise * full if stated else None),
        rate_test=RateTest("phi2"),
    )
    return calibrate_rates(record, settings).estimate


def truth(rate, deviation, way):
    """Largest residual of NumPy's straight line, and largest difference of the two ways."""
    rest = deviation - np.polyval(np.polyfit(rate, deviation, 1), rate)
    both = [
        deviation[(rate == each) & (way > 0)].mean() - deviation[(rate == each) & (way < 0)].mean()
        for each in np.unique(rate)
        if {1, -1} <= set(way[rate == each])
    ]
    return {"S_nl_z": np.abs(rest).max(), "S_hyst_z": np.abs(both).max() if both else 0.0}


@pytest.mark.slow
@pytest.mark.parametrize("runs", [6, pytest.param(250, marks=pytest.mark.campaign)])
def test_intervals_hold_whatever_the_curve_and_a_straight_gyro_looks_straight(runs):
    """2 x 5 x 2 cases of curve, size and noise: U covers, and says straight of what is straight."""
    rng = np.random.default_rng(20261122)
    held, tries, false, straight = {"S_nl_z": 0, "S_hyst_z": 0}, 0, 0, 0
    for curve, make in CURVES.items():
        for size in (0.0,) if curve == "straight" else (3.0 * SIGMA, 30.0 * SIGMA):
            for stated in (True, False):
                rate = UP_AND_DOWN
                way = np.sign(np.diff(rate, prepend=0.0)).astype(int)
                deviation = size * make(rate / rate.max(), way)
                true = truth(rate, deviation, way)
                for _ in range(runs):
                    estimate = estimate_of(rate, deviation, SIGMA, stated, rng)
                    tries += 1
                    for name, value in true.items():
                        found = estimate[name]
                        held[name] += abs(found.value - value) <= found.U
                        if value < 1e-12:
                            straight += 1
                            false += found.value - found.U > 0.0
    assert all(count >= stats.binom.ppf(1e-3, tries, COVERAGE) for count in held.values()), (held, tries)
    assert false <= stats.binom.ppf(0.999, straight, 1.0 - COVERAGE), (false, straight)


def test_a_curve_beyond_noise_is_seen():
    """A cubic of 30 standard deviations is significant, and close to its true size."""
    rng = np.random.default_rng(20261122)
    way = np.sign(np.diff(UP, prepend=0.0)).astype(int)
    deviation = 30.0 * SIGMA * CURVES["cubic"](UP / UP.max(), way)
    true = truth(UP, deviation, way)["S_nl_z"]
    for stated in (True, False):
        estimate = estimate_of(UP, deviation, SIGMA, stated, rng)
        found, (row,) = estimate["S_nl_z"], estimate.result["linearity"]
        assert found.value - found.U > 0.0
        assert abs(found.value - true) < 4.0 * SIGMA
        assert 0.0 < row["low"] <= true <= row["high"]
        assert row["observed"] >= found.value


def test_bounds_of_normal_deviations_are_those_of_their_quantiles():
    """One deviation has two sigma to either side; of m independent ones the largest stays below q in halfnorm(q)^m."""
    rng, m = np.random.default_rng(5), 10
    errors = rng.standard_normal((200_000, m))
    one = largest(Deviations("S_nl_z", np.array([-20.0]), np.eye(m)[:1]), errors, 1.0)
    assert (one.observed, one.value) == pytest.approx((20.0, 20.0), abs=0.02)
    assert (one.low, one.high) == pytest.approx((18.0, 22.0), abs=0.03)
    values = np.full(m, 0.5)
    values[3] = 2.0
    many = largest(Deviations("S_nl_z", values, np.eye(m)), errors, 2.0)
    q = stats.halfnorm.ppf(COVERAGE ** (1.0 / m))
    assert q > 2.0
    assert (many.low, many.high) == pytest.approx((0.0, 2.0), abs=0.02)
    assert largest(Deviations("S_nl_z", 2.0 * values, np.eye(m)), errors, 1.0).low == pytest.approx(
        4.0 - q, abs=0.03
    )
    np.testing.assert_allclose(one.gain, -np.eye(m)[0])
