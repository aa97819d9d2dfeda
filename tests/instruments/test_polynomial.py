"""Outputs as polynomials of specific force and rate: the equations of the three kinds, and their derivatives."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from inercal.foundation.instruments.by_angle import CHANNELS, EXTRA, channel_model
from inercal.foundation.instruments.terms import TERMS
from rows import for_each

EVERY = [(kind, channel) for kind, channels in CHANNELS.items() for channel in channels]


def draws(seed=5, n=7):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, 3)), rng.normal(size=(n, 3))


def values_of(model, rng):
    """Values of the terms, the leading one near 1."""
    values = rng.normal(size=len(model.symbols))
    if model.leading:
        values[model.symbols.index(model.leading)] = 1.2
    return values


@for_each(("kind", "channel"), EVERY)
def test_every_term_is_in_the_term_table(kind, channel):
    model = channel_model(kind, channel)
    assert set(model.symbols) <= set(TERMS)
    assert len(set(model.symbols)) == len(model.symbols) == len(model.monomials)


def test_a_gyrowheel_follows_its_equation():
    """y = k.w + D_F + D.a + products of a, per axis."""
    (a, w), rng = draws(), np.random.default_rng(1)
    for axis, k, D in (("x", "k", "DX"), ("y", "kY", "DY")):
        model = channel_model("gyrowheel", f"y_{axis}")
        c = dict(zip(model.symbols, values_of(model, rng), strict=True))
        expected = c[f"{D}_F"] + sum(c[f"{k}_{i}"] * w[:, j] for j, i in enumerate("xyz"))
        expected = expected + sum(c[f"{D}_{i}"] * a[:, j] for j, i in enumerate("XYZ"))
        expected = expected + sum(
            c[f"{D}_{'XYZ'[i]}{'XYZ'[j]}"] * a[:, i] * a[:, j] for i in range(3) for j in range(i, 3)
        )
        assert_allclose(model.regressors(a, w) @ np.array(list(c.values())), expected, rtol=1e-13)


@pytest.mark.parametrize("axis", "xyz")
def test_a_gyro_follows_its_equation(axis):
    """y = D_F + S (w_i + T_ij w_j + T_ik w_k) + G f + squares of f: misalignments times the scale factor, G not."""
    (f, w), model = draws(), channel_model("gyro", f"gyro_{axis}")
    values = values_of(model, np.random.default_rng(2))
    c = dict(zip(model.symbols, values, strict=True))
    i = "xyz".index(axis)
    turned = w[:, i] + sum(c[f"T_{axis}{j}"] * w[:, "xyz".index(j)] for j in "xyz" if j != axis)
    expected = c[f"D_F_{axis}"] + c[f"S_{axis}"] * turned
    expected = expected + sum(c[f"G_{axis}{j}"] * f[:, "xyz".index(j)] for j in "xyz")
    for j, k in ("xx", "yy", "zz", "xy", "xz", "yz"):
        expected = expected + c[f"G_{axis}{j}{k}"] * f[:, "xyz".index(j)] * f[:, "xyz".index(k)]
    assert_allclose(model.regressors(f, w) @ model.linear(values), expected, rtol=1e-12)


@pytest.mark.parametrize(("i", "p", "o"), [(0, 1, 2), (1, 2, 0), (2, 0, 1)])
def test_an_accelerometer_follows_its_equation(i, p, o):
    """i, p, o in cyclic order; all but bias and scale factor are relative to the scale factor."""
    (f, w), n = draws(), "xyz"
    model = channel_model("accelerometer", f"acc_{n[i]}")
    values = values_of(model, np.random.default_rng(3))
    c = {name.rpartition("_")[0]: v for name, v in zip(model.symbols, values, strict=True) if name[0] == "K"}
    M = {j: values[model.symbols.index(f"M_{n[i]}{n[j]}")] for j in (p, o)}
    x, y, z = f[:, i], f[:, p], f[:, o]
    inside = x + M[p] * y + M[o] * z + c["K2"] * x**2 + c["K3"] * x**3 + c["Koq"] * x * np.abs(x)
    inside = inside + c["Kip"] * x * y + c["Kio"] * x * z + c["Kpo"] * y * z
    inside = inside + c["Kpp"] * y**2 + c["Koo"] * z**2
    assert_allclose(model.regressors(f, w) @ model.linear(values), c["K0"] + c["K1"] * inside, rtol=1e-12)


@for_each(("kind", "channel"), EVERY)
def test_slopes_are_the_derivatives_of_the_regressors(kind, channel):
    """Against central differences, also where a component is negative (a|a| has a kink in its derivative at 0)."""
    model, (a, w), h = channel_model(kind, channel), draws(), 1e-6
    inputs, found = np.hstack([a, w]), model.slopes(a, w)
    for k in range(6):
        up, down = inputs.copy(), inputs.copy()
        up[:, k] += h
        down[:, k] -= h
        rise = model.regressors(up[:, :3], up[:, 3:]) - model.regressors(down[:, :3], down[:, 3:])
        assert_allclose(found[..., k], rise / (2 * h), atol=1e-8)


@for_each(("kind", "channel"), EVERY)
def test_terms_and_linear_coefficients_are_inverse_to_each_other(kind, channel):
    model = channel_model(kind, channel)
    values = values_of(model, np.random.default_rng(4))
    c = model.linear(values)
    back, slope = model.terms(c)
    assert_allclose(back, values, rtol=1e-14)
    h = 1e-7
    for j in range(len(c)):
        step = h * np.eye(len(c))[j]
        assert_allclose(
            slope[:, j], (model.terms(c + step)[0] - model.terms(c - step)[0]) / (2 * h), atol=1e-7
        )


@given(st.sets(st.sampled_from(channel_model("accelerometer", "acc_y").symbols)))
@settings(max_examples=20, deadline=None)
def test_terms_that_are_left_out_are_gone_and_the_others_unchanged(gone):
    model, (a, w) = channel_model("accelerometer", "acc_y"), draws()
    kept = model.without(gone)
    where = [j for j, symbol in enumerate(model.symbols) if symbol not in gone]
    assert kept.symbols == tuple(model.symbols[j] for j in where)
    assert np.array_equal(kept.regressors(a, w), model.regressors(a, w)[:, where])
    assert np.array_equal(kept.slopes(a, w), model.slopes(a, w)[:, where])


def test_a_channel_it_has_not_is_refused():
    with pytest.raises(KeyError, match="y_z"):
        channel_model("gyrowheel", "y_z")


def test_extra_terms_exist():
    known = {s for kind, channel in EVERY for s in channel_model(kind, channel).symbols}
    assert set(EXTRA) <= known
