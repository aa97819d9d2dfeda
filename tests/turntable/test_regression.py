"""The fit: rank by plan, exact recovery, generalised least squares, and its covariance against Monte Carlo."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose
from turntable_studies import (
    ARCMIN,
    DEG_H,
    FULL_RANK,
    LATITUDE,
    TUMBLE,
    WHEEL,
    WHEEL_X,
    references,
    study,
    table,
    wheel_output,
)

from inercal.foundation.geometry.earth import Site
from inercal.foundation.instruments.by_angle import CHANNELS
from inercal.foundation.rigs.chain import Scope
from inercal.foundation.rigs.patterns import uniform
from inercal.foundation.rigs.plans import grid, listed, named
from inercal.systems.turntable.model import table_model
from inercal.systems.turntable.regression import fit, identify_channels
from inercal.systems.turntable.weights import weights

K_X = ("k_x", "k_y", "k_z")
K_ALL = (*K_X, "kY_x", "kY_y", "kY_z")
DRIFT_X = tuple(s for s in WHEEL_X if s.startswith("DX"))
NOISE = 0.01 * DEG_H


def model_of(plan, channels=("y_x",), left_out=(), chain=None, **more):
    return table_model(study(plan, chain, **more), channels, left_out)


def true_c(model, coefficients=WHEEL):
    return np.array([coefficients.get(symbol, 0.0) for symbol in model.symbols])


# what a plan can tell


def rank(plan, terms, latitude=LATITUDE):
    model = model_of(plan, terms=terms, site=Site(9.8, (), latitude))
    return identify_channels(model, plan.angles)[0]


@pytest.mark.parametrize(
    ("plan", "terms", "latitude", "expected"),
    [
        (FULL_RANK, (*DRIFT_X, "DX_ZZ"), LATITUDE, 9),  # a.a is constant on any table
        (FULL_RANK, (*K_X, *DRIFT_X), LATITUDE, 12),
        (FULL_RANK, (*K_X, *DRIFT_X, "DX_ZZ"), LATITUDE, 12),
        (FULL_RANK, (*K_X, *DRIFT_X), np.pi / 2, 9),  # w parallel to a: k reads like DX_X, DX_Y, DX_Z
        (FULL_RANK, (*K_X, *DRIFT_X), 0.0, 12),
        (TUMBLE, (*K_X, *DRIFT_X), LATITUDE, 11),
        (TUMBLE, DRIFT_X, LATITUDE, 9),
        (named("16-cube"), DRIFT_X, LATITUDE, 6),
        (named("16-cube"), (*K_X, *DRIFT_X), LATITUDE, 9),
    ],
)
def test_the_rank_of_the_classic_plans(plan, terms, latitude, expected):
    assert rank(plan, terms, latitude).identifiability.rank == expected


def test_a_square_of_gravity_too_many_is_named_with_what_it_is_mixed_with():
    """1 - a_x^2 - a_y^2 - a_z^2 = 0."""
    found = rank(FULL_RANK, (*DRIFT_X, "DX_ZZ"))
    assert len(found.words) == 1
    terms = set(found.words[0].replace("+", " ").replace("- 1.00", " ").split())
    assert terms - {"1.00"} == {"DX_F", "DX_XX", "DX_YY", "DX_ZZ"}
    assert found.words[0].count("1.00") == 3


def test_at_the_pole_each_torquer_term_is_mixed_with_its_gravity_term():
    """w = -we a there."""
    words = rank(FULL_RANK, (*K_X, *DRIFT_X), np.pi / 2).words
    pairs = {frozenset(w.replace("+ 1.00", "").replace("- 1.00", "").split()) for w in words}
    assert pairs == {frozenset(pair) for pair in (("k_x", "DX_X"), ("k_y", "DX_Y"), ("k_z", "DX_Z"))}


@pytest.mark.parametrize("plan", [TUMBLE, named("16-cube"), named("12-position")], ids=lambda p: p.name)
def test_no_reading_changes_along_a_null_vector(plan):
    """And along any other direction some reading does."""
    found = rank(plan, (*K_X, *DRIFT_X)).identifiability
    rows = model_of(plan).rows(plan.angles)[:, 0]
    scaled = rows / found.scale
    assert np.abs(scaled @ found.null_vectors.T).max() < 1e-13
    assert np.abs(scaled @ found.directions[: found.rank].T).max(axis=0).min() > 1e-3


# recovery


@pytest.mark.parametrize(
    ("kind", "unit"), [("gyrowheel", "rad/s"), ("gyro", "rad/s"), ("accelerometer", "m/s^2")]
)
@given(seed=st.integers(0, 2**31), positions=st.integers(16, 40), noise=st.sampled_from([0.0, None]))
@settings(max_examples=8, deadline=None)
def test_perfect_readings_give_the_coefficients_back(kind, unit, seed, positions, noise):
    """Random positions, random coefficients of every term, nothing else: recovered to rounding."""
    rng = np.random.default_rng(seed)
    plan = listed(rng.uniform(-np.pi, np.pi, (positions, 2)))
    model = table_model(study(plan, kind=kind, unit=unit, coefficients={}), CHANNELS[kind])
    rows = model.rows(plan.angles)
    size = np.abs(rows).max(axis=(0, 1))
    c = rng.normal(size=len(size)) / size
    found = fit(model, plan.angles, model.outputs(plan.angles, c), [noise] * len(CHANNELS[kind]))
    condition = max(each.identifiability.condition for each in identify_channels(model, plan.angles))
    assert_allclose(found.c * size, c * size, atol=1e-13 * condition * np.sqrt(positions))


def test_stated_earth_rate_is_subtracted():
    """Nine drift terms of the tumble, which does not tell the torquer terms."""
    model = model_of(TUMBLE, left_out=K_X)
    a, w = references(TUMBLE.angles, {})
    y = wheel_output("x", WHEEL, a, w)[:, None]
    assert_allclose(fit(model, TUMBLE.angles, y, [0.0]).c, true_c(model), rtol=1e-11, atol=1e-19)


# weights


def test_the_fit_is_generalised_least_squares():
    """Coefficients and covariance by the textbook formula, the covariance of all readings assembled by hand."""
    chain = table()
    model = model_of(FULL_RANK, ("y_x", "y_y"), chain=chain)
    n, p = len(FULL_RANK), len(model.symbols)
    c, rng = true_c(model), np.random.default_rng(6)
    y = model.outputs(FULL_RANK.angles, c, chain.draw(rng, n)) + rng.normal(0.0, NOISE, (n, 2))
    found = fit(model, FULL_RANK.angles, y, [NOISE, 2.0 * NOISE])
    J = model.by_errors(FULL_RANK.angles, found.c) * (2.0 * ARCMIN / np.sqrt(3.0))
    S = np.diag(np.tile([NOISE**2, 4.0 * NOISE**2], n))
    for k, error in enumerate(chain.errors):
        each = np.outer(J[..., k].ravel(), J[..., k].ravel())
        same = np.kron(np.eye(n), np.ones((2, 2)))
        S += each if error.scope.constant else each * same
    X = model.rows(FULL_RANK.angles).reshape(-1, p)
    weight = np.linalg.inv(S / NOISE**2) / NOISE**2
    covariance = np.linalg.inv(X.T @ weight @ X)
    size = np.sqrt(np.diag(covariance))
    assert np.abs((found.covariance - covariance) / np.outer(size, size)).max() < 1e-6
    direct = covariance @ X.T @ weight @ y.ravel()
    assert np.abs((found.c - direct) / size).max() < 1e-3  # the weights are of the last round but one
    r = y.ravel() - X @ found.c
    assert found.chi2 == pytest.approx(r @ weight @ r, rel=1e-3)
    assert_allclose(np.einsum("pnc,nc->p", found.gain, y), found.c, rtol=1e-9)
    assert found.dof == 2 * n - p


def test_the_fit_is_unbiased_whatever_the_table():
    """gain A = 1: with any weights, perfect readings give the coefficients."""
    model = model_of(FULL_RANK, ("y_x", "y_y"), chain=table())
    c = true_c(model)
    found = fit(model, FULL_RANK.angles, model.outputs(FULL_RANK.angles, c), [NOISE, NOISE])
    product = np.einsum("pnc,ncq->pq", found.gain, model.rows(FULL_RANK.angles))
    size = np.sqrt(np.diag(found.covariance))
    assert np.abs((product - np.eye(len(c))) * size / size[:, None]).max() < 1e-9


def test_errors_of_the_table_alone_may_move_both_channels_alike():
    """Axis Y reads twice axis X and there is no noise: the covariance of a position has no inverse."""
    same = WHEEL_X | {s.replace("DX", "DY").replace("k_", "kY_"): 2.0 * v for s, v in WHEEL_X.items()}
    chain = table()
    model = model_of(FULL_RANK, ("y_x", "y_y"), chain=chain, coefficients=same)
    c = true_c(model, same)
    y = model.outputs(FULL_RANK.angles, c, chain.draw(np.random.default_rng(1), 36))
    for noise in (0.0, None):
        found = fit(model, FULL_RANK.angles, y, [noise, noise])
        u = np.sqrt(np.diag(found.covariance))
        assert np.abs((found.c - c) / u).max() < 5.0
        assert_allclose(u[12:], 2.0 * u[:12], rtol=1e-3)


# errors of the table, against Monte Carlo of the whole chain


RUNS = 100_000


def monte_carlo(gain, plan, chain, axis="x", runs=RUNS, chunk=4000):
    """Covariance of the coefficients, and variance of the readings, when the table is drawn anew in each run."""
    rng = np.random.default_rng(20261121)
    a, w = references(plan.angles, {})
    perfect = wheel_output(axis, WHEEL, a, w)
    shifts, square = [], np.zeros(len(plan))
    for _ in range(runs // chunk):
        errors = {
            error.name: error.distribution.sample(rng, (chunk, 1 if error.scope.constant else len(plan)))
            for error in chain.errors
        }
        moved = wheel_output(axis, WHEEL, *references(plan.angles, errors)) - perfect
        square += np.square(moved).sum(axis=0)
        shifts.append(moved @ gain.T)
    return np.cov(np.concatenate(shifts).T), square / runs


@pytest.mark.slow
@pytest.mark.parametrize(("plan", "left_out"), [(TUMBLE, K_X), (FULL_RANK, ())], ids=["tumble", "grid"])
def test_the_covariance_of_the_table_is_that_of_a_monte_carlo(plan, left_out):
    """Jacobian covariance G S G^T against 1e5 draws of all errors, by scope, of the full chain: within 1 %.

    A variance from N draws has a relative standard error of sqrt((kurtosis - 1) / N), at most that of a normal
    variable, 0.45 %: each within four of them, all together (strongly correlated) within 1 %.
    """
    chain = table()
    model = model_of(plan, left_out=left_out, chain=chain)
    c = true_c(model)
    done = fit(model, plan.angles, model.outputs(plan.angles, c), [NOISE], start=c)
    of_table = weights(model, plan.angles, c, np.zeros(1))
    S = np.diag(of_table.within[:, 0, 0]) + of_table.common[:, 0] @ of_table.common[:, 0].T
    gain = done.gain[..., 0]
    linear = gain @ S @ gain.T
    drawn, variance = monte_carlo(gain, plan, chain)
    ratio = np.diag(drawn) / np.diag(linear)
    assert np.abs(ratio - 1.0).max() < 4.0 * np.sqrt(2.0 / RUNS)
    assert abs(np.sqrt(np.mean(ratio)) - 1.0) < 0.01
    size = np.sqrt(np.diag(linear))
    assert np.abs((drawn - linear) / np.outer(size, size)).max() < 5.0 * np.sqrt(2.0 / RUNS)
    assert np.mean(variance) == pytest.approx(np.trace(S) / len(plan), rel=0.01)
    # the whole covariance of the fit is that and the noise
    assert_allclose(
        done.covariance, linear + NOISE**2 * gain @ gain.T, rtol=1e-6, atol=1e-9 * size.max() ** 2
    )


def test_two_arcmin_act_like_four_hundredths_of_a_degree_per_hour():
    """Typical coefficients; all eleven errors, root of the mean variance of a reading."""
    coefficients = {s: v for s, v in WHEEL_X.items() if s[0] == "D"} | {"k_x": 0.0}
    model = model_of(TUMBLE, left_out=K_X, chain=table(), coefficients=coefficients)
    S = weights(model, TUMBLE.angles, true_c(model), np.zeros(1))
    variance = S.within[:, 0, 0] + np.square(S.common[:, 0]).sum(axis=1)
    assert 0.035 < np.sqrt(variance.mean()) / DEG_H < 0.045


def test_what_stays_constant_does_not_average_out():
    """Taking the plan four times halves u where all errors are redrawn, and hardly helps where none is."""
    four = listed(np.tile(FULL_RANK.angles, (4, 1)))
    u = {}
    for scope in (Scope.POSITION, Scope.RIG):
        for plan in (FULL_RANK, four):
            model = model_of(plan, chain=table().with_scope(scope))
            c = true_c(model)
            done = fit(model, plan.angles, model.outputs(plan.angles, c), [1e-4 * NOISE], start=c)
            u[scope, len(plan)] = np.sqrt(np.diag(done.covariance))
    assert_allclose(u[Scope.POSITION, 144], u[Scope.POSITION, 36] / 2.0, rtol=1e-6)
    drift = [model.symbols.index(s) for s in ("DX_X", "DX_Y", "DX_Z")]
    assert np.all(u[Scope.RIG, 144][drift] > 0.99 * u[Scope.RIG, 36][drift])


def test_errors_drawn_at_every_sample_average_over_the_dwell():
    """100 samples behind each reading: a tenth of the standard deviation, by the square root of the number."""
    model = model_of(FULL_RANK, chain=table().with_scope(Scope.SAMPLE))
    once = model_of(FULL_RANK, chain=table().with_scope(Scope.POSITION))
    c = true_c(model)
    y = model.outputs(FULL_RANK.angles, c)
    samples = np.full(36, 100)
    averaged = fit(model, FULL_RANK.angles, y, [0.1 * NOISE], samples=samples)
    position = fit(once, FULL_RANK.angles, y, [NOISE], samples=samples)
    assert_allclose(averaged.covariance, position.covariance / 100.0, rtol=1e-6)


# the table's own errors, and the noise


@pytest.mark.parametrize(
    ("factor", "plan", "left_out"),
    [
        ("deps_x", FULL_RANK, ()),
        ("deps_y", FULL_RANK, ()),
        ("deps_x", TUMBLE, K_ALL),
        ("deps_y", TUMBLE, K_ALL),
        ("dtheta_x", TUMBLE, K_ALL),
        ("dtheta_y", TUMBLE, K_ALL),
        ("dtheta_z", TUMBLE, K_ALL),
    ],
)
def test_a_constant_error_of_the_table_is_estimated_where_the_readings_tell_it(factor, plan, left_out):
    """20 arcmin, small noise. Perpendicularity shows in the residuals; mounting only against a stated earth rate."""
    chain = table(0.05 * ARCMIN, errors={factor: uniform(20.0 * ARCMIN)})
    k = chain.factors.index(factor)
    model = model_of(plan, ("y_x", "y_y"), left_out, chain)
    c, rng = true_c(model), np.random.default_rng(20261121)
    errors = chain.draw(rng, len(plan))
    errors[:, k] = 15.0 * ARCMIN
    noise = 0.001 * DEG_H
    y = model.outputs(plan.angles, c, errors) + rng.normal(0.0, noise, (len(plan), 2))
    found = fit(model, plan.angles, y, [noise, noise])
    at = list(found.constant).index(k)
    assert found.table_u[at] < 0.05 * chain.std[k]
    assert abs(found.table[at] - 15.0 * ARCMIN) < 3.0 * found.table_u[at]


def test_the_mounting_cannot_be_told_from_the_coefficients():
    """A turned instrument is another set of the same terms: the prior stays what it was."""
    chain = table()
    model = model_of(FULL_RANK, ("y_x", "y_y"), chain=chain)
    y = model.outputs(FULL_RANK.angles, true_c(model), chain.draw(np.random.default_rng(1), 36))
    found = fit(model, FULL_RANK.angles, y, [NOISE, NOISE])
    told = dict(zip([chain.factors[k] for k in found.constant], found.table_u / chain.std[0], strict=True))
    for axis in "xyz":
        assert told[f"dtheta_{axis}"] == pytest.approx(1.0, abs=1e-9)
    assert told["deps_x"] < 0.999
    assert told["deps_y"] < 0.999


@pytest.mark.parametrize("half_width", [0.0, 2.0 * ARCMIN])
@pytest.mark.parametrize("tests", [100, pytest.param(400, marks=pytest.mark.campaign)])
def test_the_noise_is_estimated_from_what_the_table_leaves_unexplained(half_width, tests):
    """Mean of the variance over many tests: unbiased, its scatter that of the degrees of freedom it reports."""
    chain, sigma = table(half_width), 0.06 * DEG_H
    model = model_of(FULL_RANK, chain=chain)
    c = true_c(model)
    variances, dof = [], []
    for seed in range(tests):
        rng = np.random.default_rng([31, seed])
        y = model.outputs(FULL_RANK.angles, c, chain.draw(rng, 36)) + rng.normal(0.0, sigma, (36, 1))
        found = fit(model, FULL_RANK.angles, y, [None])
        variances.append(found.noise[0] ** 2 / sigma**2)
        dof.append(found.noise_dof[0])
    expected = np.sqrt(2.0 / np.mean(dof))
    assert np.mean(variances) == pytest.approx(1.0, abs=4.5 * expected / np.sqrt(tests))
    assert np.std(variances) == pytest.approx(expected, rel=4.5 / np.sqrt(2 * tests) + 0.1)
    if half_width == 0.0:
        assert_allclose(dof, 24.0, rtol=1e-6)
    else:
        assert np.mean(dof) < 24.0


def restricted(rows, y, weight, sigma):
    """Minus twice the logarithm of the restricted likelihood, from matrices written out in full."""
    n, c, p = rows.shape
    X, r = rows.reshape(n * c, p), y.reshape(n * c)
    V = np.zeros((n * c, n * c))
    for k in range(n):
        V[k * c : k * c + c, k * c : k * c + c] = weight.within[k] + np.diag(sigma**2)
    common = weight.common.reshape(n * c, -1)
    V += common @ common.T
    X = X / np.linalg.norm(X, axis=0)
    inverse = np.linalg.inv(V / V[0, 0]) / V[0, 0]
    M = X.T @ inverse @ X
    rest = r - X @ np.linalg.solve(M, X.T @ inverse @ r)
    logarithm = np.linalg.slogdet(V / V[0, 0])[1] + n * c * np.log(V[0, 0]) + np.linalg.slogdet(M)[1]
    return logarithm + rest @ inverse @ rest


@pytest.mark.parametrize("sizes", [(0.1, 0.05), (0.02, 0.2)])
def test_the_noise_that_is_not_stated_is_the_most_likely_one(sizes):
    """Of both channels together, outside the space of the terms (Patterson and Thompson 1971)."""
    chain, rng = table(), np.random.default_rng(3)
    model = table_model(study(FULL_RANK, chain), ("y_x", "y_y"))
    c = np.concatenate([channel.linear([WHEEL[s] for s in channel.symbols]) for channel in model.channels])
    angles = FULL_RANK.angles
    y = model.outputs(angles, c, chain.draw(rng, 36)) + rng.normal(0.0, np.array(sizes) * DEG_H, (36, 2))
    found = fit(model, angles, y, [None, None])
    rows, weight = model.rows(angles), weights(model, angles, found.c, np.zeros(2))
    best = restricted(rows, y, weight, found.noise)
    for k in range(2):
        for step in (-0.02, 0.02):
            other = found.noise * np.exp(np.where(np.arange(2) == k, step, 0.0))
            assert restricted(rows, y, weight, other) > best
    # near the truth, as its degrees of freedom have it: five standard deviations of the logarithm
    apart = np.abs(np.log(found.noise / (np.array(sizes) * DEG_H)))
    assert np.all(apart < 5.0 / np.sqrt(2.0 * found.noise_dof))
    assert np.all(found.noise_dof < 36.0)


def test_a_table_that_explains_more_than_the_scatter_leaves_no_noise():
    model = model_of(FULL_RANK, chain=table(60.0 * ARCMIN))
    rng = np.random.default_rng(3)
    y = model.outputs(FULL_RANK.angles, true_c(model)) + rng.normal(0.0, NOISE, (36, 1))
    assert fit(model, FULL_RANK.angles, y, [None]).noise[0] < 1e-3 * NOISE


def test_full_circles_make_no_difference():
    """Angles with any number of turns added: the same fit."""
    model = model_of(FULL_RANK, chain=table())
    y = model.outputs(FULL_RANK.angles, true_c(model))
    turned = FULL_RANK.angles + 2.0 * np.pi * np.random.default_rng(1).integers(-3, 4, (36, 2))
    one, other = (fit(model, angles, y, [NOISE]) for angles in (FULL_RANK.angles, turned))
    size = np.sqrt(np.diag(one.covariance))
    assert np.abs((one.c - other.c) / size).max() < 1e-8
    assert np.abs((one.covariance - other.covariance) / np.outer(size, size)).max() < 1e-8


def test_a_finer_grid_is_better_by_the_root_of_its_positions():
    """Errors redrawn at each position only: u falls like 1/sqrt(n) for plans alike."""
    u = []
    for counts in ((6, 6), (12, 12)):
        plan = grid(counts)
        model = model_of(plan)
        y = model.outputs(plan.angles, true_c(model))
        u.append(np.sqrt(np.diag(fit(model, plan.angles, y, [NOISE]).covariance)))
    assert_allclose(u[1], u[0] / 2.0, rtol=1e-9)
