"""Threshold, dead zone and hysteresis by small steps, against responses written out here."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats
from turntable_studies import codes_of, study

from inercal.faces.convert.models import model_of
from inercal.foundation.errors import InputError, StudyError
from inercal.foundation.findings import Status
from inercal.foundation.records.record import record_of
from inercal.foundation.rigs.chain import Scope
from inercal.foundation.rigs.patterns import normal
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.units import parse_unit
from inercal.systems.turntable.figures import page, pictures
from inercal.systems.turntable.settings import Disturbances, RateTest, StepTest
from inercal.systems.turntable.simulate import sequence
from inercal.systems.turntable.step_response import respond, senses
from inercal.systems.turntable.task import calibrate, simulate

UG, ARCSEC, G = 9.80665e-6, np.radians(1.0 / 3600.0), 9.8
K0, K1 = 3e-3, 0.1  # output at no input, and per m/s^2


def tilts(largest, step, cycles=2):
    """Tilts up from level, down through it and back."""
    n = round(largest / step)
    once = [*range(n), *range(n, -n, -1), *range(-n, 0)]
    return step * np.array([*once * cycles, 0], dtype=float)


def outputs(x, width, lag, middle, hysteresis, ramp=0.0):
    """Readings without noise: no response within the dead zone, ``lag`` behind it outside."""
    y, sense, last = np.empty(len(x)), 0.0, x[0]
    for k, now in enumerate(x):
        sense, last = (np.sign(now - last) if abs(now - last) > 1e-9 else sense), now
        off = now - middle
        if abs(off) < 0.5 * width:
            shown = middle
        else:
            shown = now - np.sign(off) * lag
        y[k] = K0 + K1 * (shown + 0.5 * sense * hysteresis) + ramp * k / len(x)
    return y


def fitted(x, y, noise=None):
    return respond("x", x, senses(x), 60.0 * np.arange(len(x)), y, noise, 1e-15)


def settings(sizes=None, noise=None, unit="V", **more):
    chain = turntable(
        "two_axis_turntable", None, {name: normal(size) for name, size in (sizes or {}).items()}
    )
    made = study(
        chain=chain, kind="accelerometer", unit=unit, coefficients={"K0_x": K0, "K1_x": K1}, noise=noise
    )
    return replace(made, step_test=StepTest(), **more)


def record(angles, y, channel="acc_x", unit="V"):
    degrees = parse_unit("deg")
    columns = [("position", parse_unit("1"), np.arange(1.0, len(y) + 1.0))]
    columns += [("phi1", degrees, np.degrees(angles)), ("phi2", degrees, np.zeros(len(y)))]
    return record_of([*columns, (channel, parse_unit(unit), y)], 60.0 * np.arange(len(y)))


def test_without_noise_an_edge_lies_anywhere_between_two_steps():
    """By hand: the level within and the line outside fix the middle; both edges share what is free of the width."""
    step, middle, width = 10.0, 2.0, 47.0
    x = tilts(100.0, step) * UG
    found = fitted(x, outputs(x, width * UG, 0.0, middle * UG, 0.0))
    # the steps at -20 and 20 are within, those at -30 and 30 are not: 22 < width / 2 < 28
    assert found.middle / UG == pytest.approx(middle, abs=1e-3)
    # half of the weight is even between these, half goes with 1 / width
    log = np.log(56.0 / 44.0)
    mean = 0.5 * (50.0 + 12.0 / log)
    square = 0.5 * (50.0**2 + 12.0**2 / 12.0 + 0.5 * (56.0**2 - 44.0**2) / log)
    assert found.values[2] / UG == pytest.approx(mean, abs=0.1)
    assert found.covariance[2, 2] / UG**2 == pytest.approx(square - mean**2, rel=0.03)
    assert found.values[3] / UG == pytest.approx(0.5 * mean, abs=0.05)
    np.testing.assert_allclose(found.values[[0, 1]], [K0, K1], rtol=1e-6)


def test_backlash_has_twice_its_half_width_as_threshold():
    """The output follows at width / 2 behind: half of what K1 promises is there at twice that."""
    x = tilts(150.0, 5.0) * UG
    found = fitted(x, outputs(x, 40.0 * UG, 20.0 * UG, 1.0 * UG, 3.0 * UG))
    np.testing.assert_allclose(found.values[2:] / UG, [42.0, 40.0, 3.0], atol=2.5)
    assert found.values[3] / UG == pytest.approx(40.0, abs=0.05)
    assert found.values[4] / UG == pytest.approx(3.0, abs=0.05)


def test_a_steady_drift_is_no_hysteresis():
    x = tilts(100.0, 10.0) * UG
    found = fitted(x, outputs(x, 0.0, 0.0, 0.0, 0.0, ramp=K1 * 50.0 * UG))
    assert found.values[4] / UG == pytest.approx(0.0, abs=0.02)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("width", "lag", "noise"),
    [
        (0.0, 0.0, 4.0),
        (60.0, 0.5, 8.0),
        *(pytest.param(*each, marks=pytest.mark.campaign) for each in ((40.0, 0.0, 4.0), (30.0, 0.25, 2.0))),
    ],
)
def test_intervals_cover_as_they_say(width, lag, noise):
    """40 instruments each, with middle, level and noise drawn; of the true values at least those of 95 % at 1e-3."""
    rng, runs = np.random.default_rng(20261122), 40
    inside, named = np.zeros(5), 0
    for run in range(runs):
        x = (tilts(120.0, 10.0) + rng.uniform(-5.0, 5.0)) * UG
        y = outputs(x, width * UG, lag * width * UG, rng.uniform(-20.0, 20.0) * UG, 5.0 * UG)
        y = y + K1 * noise * UG * rng.standard_normal(len(x))
        found = fitted(x, y, K1 * noise * UG if run % 2 else None)
        u = np.sqrt(np.diag(found.covariance))
        true = np.array([K0, K1, width * UG, max(0.5, 2.0 * lag) * width * UG, 5.0 * UG])
        inside += np.abs(found.values - true) < 2.0 * u
        named += found.values[2] > 3.0 * u[2]
    assert np.all(inside >= stats.binom.ppf(1e-3, runs, 0.95)), inside
    assert named == 0 if width == 0.0 else named > 0.5 * runs


def test_a_simulated_test_gives_back_what_was_put_in():
    """The dead zone and hysteresis of [disturbances], on a table that errs, with samples."""
    sizes = {"dphi_y1": 0.2 * ARCSEC, "dtheta_y": 10.0 * ARCSEC}
    of = settings(sizes, noise=K1 * 3.0 * UG)
    of = replace(
        of, disturbances=Disturbances(dead_zone=K1 * 20.0 * UG, hysteresis=K1 * 6.0 * UG, ramp=K1 * 20.0 * UG)
    )
    of = replace(of, instrument=replace(of.instrument, sample_rate=0.1))
    made = simulate(of, np.random.default_rng(1))
    calibrated = calibrate(made, of)
    found = calibrated.estimate
    assert found.status is Status.OK, found.message
    assert found.names == ("K0_x", "K1_x", "K_dz_x", "K_th_x", "K_hyst_x")
    for name, value in (("K_dz_x", 40.0), ("K_th_x", 20.0), ("K_hyst_x", 6.0)):
        assert abs(found[name].value / UG - value) < found[name].U / UG < 12.0
        assert found[name].unit == "m/s^2"
    assert {"dead_zone", "hysteresis"} <= {each.code for each in found.findings}
    assert calibrated.shown["K_dz_x"].unit == "ug"
    # the level is that of table and mounting: K1 g tilt
    mounting = next(each for each in found.budget if each.source == "dtheta_y")
    assert np.sqrt(mounting.share["K0_x"]) * found["K0_x"].u == pytest.approx(
        K1 * G * 10.0 * ARCSEC, rel=1e-3
    )
    assert pictures(calibrated)[0].title == "Response to small steps"
    assert "K_th_x" in page(calibrated)


def test_a_sound_accelerometer_has_none_and_nothing_is_named():
    angles = tilts(60.0, 2.0) * ARCSEC
    noise = K1 * 3.0 * UG * np.random.default_rng(2).standard_normal(len(angles))
    found = calibrate(record(angles, K0 + K1 * G * np.sin(angles) + noise), settings()).estimate
    assert found.status is Status.OK
    assert not codes_of(found)
    assert found["K_dz_x"].value < found["K_dz_x"].U


def test_what_a_test_does_not_tell_is_said():
    angles = tilts(60.0, 2.0) * ARCSEC
    x = G * np.sin(angles)
    rng = np.random.default_rng(3)
    noise = K1 * 2.0 * UG * rng.standard_normal(len(x))

    def verdict(y, of=None, at=angles, channel="acc_x"):
        return calibrate(record(at, y, channel), of or settings()).estimate

    wide = verdict(outputs(x, 560.0 * UG, 0.0, 0.0, 0.0) + noise)
    assert wide.status is Status.ILL_CONDITIONED
    assert "reaches as far as the steps" in wide.message
    deaf = verdict(K0 + noise)
    assert deaf.status is not Status.OK
    coarse = verdict(K1 * 40.0 * UG * np.round((K0 + K1 * x) / (K1 * 40.0 * UG)))
    assert coarse.status is Status.ILL_CONDITIONED
    assert "cannot be told from its resolution" in coarse.message
    drifting = verdict(K0 + K1 * x + noise + K1 * 12.0 * UG * np.linspace(-1.0, 1.0, len(x)) ** 2)
    assert drifting.status is Status.SUSPECT
    assert "trend" in codes_of(drifting)
    loud = verdict(K0 + K1 * x + noise, settings(noise=K1 * 0.5 * UG))
    assert loud.status is Status.INCONSISTENT
    upright = verdict(K0 + K1 * G * np.cos(angles) + noise, channel="acc_z")
    assert upright.status is Status.UNOBSERVABLE
    assert "no accelerometer of the record is tilted about level" in upright.message
    few = verdict((K0 + K1 * x + noise)[:8], at=angles[:8])
    assert few.message == "found 8 steps, expected at least 10, at as many angles"


def test_it_is_not_a_calibration_to_apply():
    of = settings(noise=K1 * 3.0 * UG)
    with pytest.raises(InputError, match="is of small steps about level"):
        model_of(calibrate(simulate(of, np.random.default_rng(1)), of).estimate)


def test_studies_that_do_not_fit_are_refused():
    with pytest.raises(StudyError, match=r'found "gyro", expected "accelerometer"'):
        simulate(replace(settings(), instrument=study(kind="gyro").instrument), np.random.default_rng(1))
    with pytest.raises(StudyError, match="found beside rate_test"):
        simulate(settings(rate_test=RateTest()), np.random.default_rng(1))


def test_steps_go_up_down_and_back():
    steps = sequence(StepTest(largest=2.0, step=1.0, cycles=2))
    np.testing.assert_array_equal(steps, [0, 1, 2, 1, 0, -1, -2, -1, 0, 1, 2, 1, 0, -1, -2, -1, 0])


def test_errors_of_the_table_at_the_steps_count_at_the_edges():
    """u of the width is at least root 2 of what a step is uncertain by; a noise that is stated grows by it."""
    angles = tilts(60.0, 2.0) * ARCSEC
    y = outputs(G * np.sin(angles), 40.0 * UG, 0.0, 0.0, 0.0)
    y = y + K1 * 5.0 * UG * np.random.default_rng(4).standard_normal(len(y))
    of = settings({"dphi_y1": 1.0 * ARCSEC}, noise=K1 * 0.5 * UG)
    assert of.chain.errors[of.chain.factors.index("dphi_y1")].scope is Scope.POSITION
    found = calibrate(record(angles, y), of).estimate
    assert found.status is Status.OK, found.message
    assert found["K_dz_x"].u > np.sqrt(2.0) * G * ARCSEC
