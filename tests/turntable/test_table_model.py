"""What an instrument on a table reads, and how it changes with the table's errors and the references."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose
from turntable_studies import (
    CHAIN,
    DEG_H,
    FULL_RANK,
    GRAVITY,
    LATITUDE,
    WHEEL,
    references,
    study,
    table,
    usual_terms,
    wheel_output,
)

from inercal.foundation.errors import StudyError
from inercal.foundation.geometry.earth import EARTH_RATE, Site
from inercal.foundation.instruments.by_angle import CHANNELS
from inercal.systems.turntable.model import channels_of, table_model

KINDS = tuple(CHANNELS)


def model_of(kind, left_out=(), **more):
    unit = "m/s^2" if kind == "accelerometer" else "rad/s"
    settings = study(chain=table(), kind=kind, unit=unit, coefficients={}, **more)
    return table_model(settings, CHANNELS[kind], left_out)


def drawn(model, seed=3):
    """Linear coefficients, each of the size that moves the output alike."""
    a, w = model.inputs(FULL_RANK.angles)
    size = np.concatenate([np.abs(ch.regressors(a, w)).max(axis=0) for ch in model.channels])
    return np.random.default_rng(seed).normal(size=len(size)) / size


def at_zero(kind, coefficients, unit="rad/s"):
    """Outputs with both angles at zero: z up, x north, y west."""
    settings = study(kind=kind, unit=unit, coefficients=coefficients)
    model = table_model(settings, CHANNELS[kind])
    none = np.zeros(len(model.symbols))
    for k, symbol in enumerate(model.symbols):
        none[k] = coefficients.get(symbol, 0.0)
    return dict(zip(CHANNELS[kind], model.outputs(np.zeros((1, 2)), none)[0], strict=True))


def test_an_accelerometer_at_rest_reads_gravity_upwards():
    """Specific force: + the site's gravity on the axis that points up, nothing on the others."""
    read = at_zero("accelerometer", {f"K1_{i}": 1.0 for i in "xyz"}, "m/s^2")
    assert_allclose([read[f"acc_{i}"] for i in "xyz"], [0.0, 0.0, GRAVITY], atol=1e-14)


def test_a_gyro_at_rest_reads_earth_rate_north_and_up():
    read = at_zero("gyro", {f"S_{i}": 1.0 for i in "xyz"})
    expected = [EARTH_RATE * np.cos(LATITUDE), 0.0, EARTH_RATE * np.sin(LATITUDE)]
    assert_allclose([read[f"gyro_{i}"] for i in "xyz"], expected, atol=1e-19)


def test_the_drift_terms_of_a_gyrowheel_take_gravity_with_a_minus_sign():
    """a = [0 0 -1] R in units of the site's gravity: DX_Z enters with -1 when z points up, DX_ZZ with +1."""
    assert at_zero("gyrowheel", {"DX_Z": 2.0})["y_x"] == pytest.approx(-2.0)
    assert at_zero("gyrowheel", {"DX_XX": 2.0, "DX_F": 3.0})["y_x"] == pytest.approx(3.0)


def test_outputs_with_errors_follow_the_chain_written_out():
    """Against the chain written out by components, at large errors too: nothing is linearised."""
    rng = np.random.default_rng(8)
    settings = study(chain=table())
    model = table_model(settings, CHANNELS["gyrowheel"])
    c = np.array([WHEEL[symbol] for symbol in model.symbols])
    names = [name for _, name in CHAIN if isinstance(name, str)]
    assert tuple(names) == model.chain.factors
    errors = rng.normal(scale=0.3, size=(len(FULL_RANK), len(names)))
    a, w = references(FULL_RANK.angles, dict(zip(names, errors.T, strict=True)))
    expected = np.stack([wheel_output(axis, WHEEL, a, w) for axis in "xy"], axis=-1)
    assert_allclose(model.outputs(FULL_RANK.angles, c, errors), expected, atol=1e-13 * np.abs(expected).max())
    nominal = model.rows(FULL_RANK.angles) @ c
    assert_allclose(model.outputs(FULL_RANK.angles, c), nominal, rtol=1e-12, atol=1e-18)


@pytest.mark.parametrize("stated", [False, True])
@pytest.mark.parametrize("kind", KINDS)
def test_by_errors_is_the_derivative_of_the_outputs_with_respect_to_the_table_s_errors(kind, stated):
    """Central differences of the outputs with finite errors; stated terms (earth rate's) move with the rest."""
    left_out = ("k_x", "k_y", "k_z", "kY_y", "S_x", "T_xy", "T_xz", "K0_x", "Kip_y") if stated else ()
    model = model_of(kind, left_out)
    c, angles, h = drawn(model), FULL_RANK.angles, 1e-5
    found = model.by_errors(angles, c)
    for k in range(len(model.chain.errors)):
        step = h * np.eye(len(model.chain.errors))[k]
        rise = (model.outputs(angles, c, step) - model.outputs(angles, c, -step)) / (2 * h)
        assert_allclose(found[..., k], rise, atol=1e-8 * np.abs(found).max())


@pytest.mark.parametrize("kind", KINDS)
def test_by_references_is_the_change_for_another_gravity_and_earth_rate(kind):
    model = model_of(kind)
    c, angles, rng = drawn(model), FULL_RANK.angles, np.random.default_rng(4)
    a_n = 1e-6 * np.linalg.norm(model.a_n) * rng.normal(size=3)
    w_n = 1e-6 * EARTH_RATE * rng.normal(size=3)
    moved = [
        replace(model, a_n=model.a_n + sign * a_n, w_n=model.w_n + sign * w_n).outputs(angles, c)
        for sign in (1.0, -1.0)
    ]
    change = model.by_references(angles, c, a_n, w_n)
    assert_allclose(change, (moved[0] - moved[1]) / 2.0, atol=1e-9 * np.abs(change).max())


def test_what_is_not_estimated_is_taken_as_stated():
    """The same outputs, whichever terms are called known; a gain of which nothing is said is 1."""
    settings = study()
    whole = table_model(settings, CHANNELS["gyrowheel"])
    part = table_model(settings, CHANNELS["gyrowheel"], ("k_x", "k_y", "k_z", "DY_XX"))
    outputs = [
        model.outputs(FULL_RANK.angles, np.array([WHEEL[symbol] for symbol in model.symbols]))
        for model in (whole, part)
    ]
    assert len(part.symbols) == len(whole.symbols) - 4
    assert_allclose(outputs[0], outputs[1], atol=1e-18)
    silent = table_model(study(coefficients={}), ("y_x",), ("k_x", "k_y", "k_z"))
    w = silent.inputs(FULL_RANK.angles)[1]
    assert_allclose(silent.outputs(FULL_RANK.angles, np.zeros(9))[:, 0], w[:, 0], atol=1e-20)
    counts = table_model(study(coefficients={}, unit="count"), ("y_x",), ("k_x", "k_y", "k_z"))
    assert not counts.outputs(FULL_RANK.angles, np.zeros(9)).any()


@pytest.mark.parametrize("kind", KINDS)
def test_the_usual_terms_are_taken_where_nothing_is_said(kind):
    assert list(model_of(kind).symbols) == usual_terms(kind)


def test_channels_are_those_of_which_something_is_stated():
    assert channels_of(study()) == ("y_x", "y_y")
    assert channels_of(study(coefficients={"DY_F": 50.0 * DEG_H})) == ("y_y",)
    assert channels_of(study(coefficients={})) == ("y_x", "y_y")


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"site": Site(GRAVITY)}, "no latitude"),
        ({"terms": ("DX_F",)}, "none of them belongs to y_y"),
        ({"kind": "gyro", "terms": ("D_F_x", "T_xy")}, "S_x is missing"),
    ],
)
def test_a_study_that_cannot_be_modelled_is_refused(changed, says):
    settings = study(coefficients={}, **changed)
    with pytest.raises(StudyError, match=says):
        table_model(settings, CHANNELS[settings.instrument.kind])
