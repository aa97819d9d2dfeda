"""Linear least squares against the GUM, NIST's certified data sets, closed forms, NumPy and SciPy."""

import re

import numpy as np
import pytest
import scipy.linalg
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import stats

from inercal.faces.validate.foundation import LONGLEY, LONGLEY_CERTIFIED, NORRIS, NORRIS_CERTIFIED
from inercal.foundation.geometry.rotations import elementary
from inercal.foundation.inference.identifiability import identify, in_words
from inercal.foundation.inference.least_squares import least_squares, whiten
from rows import for_each


def design(rng, n, p):
    """A random design and its observations; the p terms have names."""
    return rng.standard_normal((n, p)), rng.standard_normal(n), [f"b{i}" for i in range(p)]


def random_covariance(rng, n):
    root = rng.standard_normal((n, n))
    return root @ root.T + 0.1 * np.eye(n)


# Closed forms and published numbers.


@settings(deadline=None)
@given(st.integers(3, 30), st.integers(0, 2**32 - 1))
def test_straight_line(n, seed):
    rng = np.random.default_rng(seed)
    x, y = rng.uniform(1.0, 2.0, n), rng.standard_normal(n)
    fit = least_squares(np.column_stack([np.ones(n), x]), y, ["intercept", "slope"])
    sxx = np.sum((x - x.mean()) ** 2)
    slope = np.sum((x - x.mean()) * y) / sxx
    np.testing.assert_allclose(fit.beta, [y.mean() - slope * x.mean(), slope], rtol=1e-8, atol=1e-8)
    C = np.array([[np.sum(x**2) / n, -x.mean()], [-x.mean(), 1.0]]) / sxx
    np.testing.assert_allclose(fit.unit_covariance, C, rtol=1e-8)
    assert fit.dof == n - 2


@settings(deadline=None)
@given(st.lists(st.tuples(st.floats(-1e3, 1e3), st.floats(1e-3, 1e3)), min_size=2, max_size=20))
def test_weighted_mean(readings):
    y, u = np.array(readings).T
    fit = least_squares(np.ones((len(y), 1)), y, ["mean"], u**2)
    weight = 1.0 / u**2
    mean = np.sum(weight * y) / np.sum(weight)
    assert fit.beta[0] == pytest.approx(mean, rel=1e-9, abs=1e-9)
    assert fit.unit_covariance[0, 0] == pytest.approx(1.0 / np.sum(weight), rel=1e-9)
    assert fit.chi2 == pytest.approx(np.sum(weight * (y - mean) ** 2), rel=1e-6, abs=1e-12)
    np.testing.assert_allclose(fit.residuals, y - mean, atol=1e-8)


def test_gum_h3_calibration_of_a_thermometer():
    """JCGM 100:2008, H.3: table H.6 and the results of H.3.3 and H.3.4."""
    t = [21.521, 22.012, 22.512, 23.003, 23.507, 23.999, 24.513, 25.002, 25.503, 26.010, 26.511]
    b = [-0.171, -0.169, -0.166, -0.159, -0.164, -0.165, -0.156, -0.157, -0.159, -0.161, -0.160]
    fit = least_squares(np.column_stack([np.ones(11), np.array(t) - 20.0]), np.array(b), ["y1", "y2"])
    covariance = fit.s2 * fit.unit_covariance
    u = np.sqrt(np.diag(covariance))
    np.testing.assert_array_less(np.abs(fit.beta - [-0.1712, 0.00218]), [5e-5, 5e-6])
    np.testing.assert_array_less(np.abs(u - [0.0029, 0.00067]), [5e-5, 5e-6])
    assert covariance[0, 1] / u.prod() == pytest.approx(-0.930, abs=5e-4)
    assert np.sqrt(fit.s2) == pytest.approx(0.0035, abs=5e-5)
    at_30 = np.array([1.0, 10.0])
    assert at_30 @ fit.beta == pytest.approx(-0.1494, abs=5e-5)
    assert np.sqrt(at_30 @ covariance @ at_30) == pytest.approx(0.0041, abs=5e-5)


@pytest.mark.parametrize(
    ("data", "certified"),
    [(NORRIS, NORRIS_CERTIFIED), (LONGLEY, LONGLEY_CERTIFIED)],
    ids=["Norris", "Longley"],
)
def test_certified_values_of_nist(data, certified):
    """NIST Statistical Reference Datasets, linear regression: 15 certified digits."""
    beta, sd, residual_sd = np.split(certified, [len(certified) // 2, len(certified) - 1])
    rows = np.array(data.split(), dtype=float).reshape(-1, len(beta))
    A = np.column_stack([np.ones(len(rows)), rows[:, 1:]])
    fit = least_squares(A, rows[:, 0], [f"B{i}" for i in range(len(beta))])
    np.testing.assert_allclose(fit.beta, beta, rtol=1e-9)
    np.testing.assert_allclose(np.sqrt(fit.s2 * np.diag(fit.unit_covariance)), sd, rtol=1e-9)
    assert np.sqrt(fit.s2) == pytest.approx(residual_sd[0], rel=1e-9)


def test_a_polynomial_of_degree_five():
    """NIST StRD Wampler1: y = 1 + x + ... + x^5 at x = 0 ... 20, so every coefficient is 1."""
    A = np.vander(np.arange(21.0), 6, increasing=True)
    np.testing.assert_allclose(least_squares(A, A.sum(axis=1), "abcdef").beta, 1.0, rtol=1e-9)


# Accuracy.


@settings(deadline=None)
@given(st.integers(2, 6), st.integers(0, 20), st.integers(0, 2**32 - 1))
def test_agrees_with_numpy_and_scipy(p, more, seed):
    A, y, names = design(np.random.default_rng(seed), 3 * p + more, p)
    fit = least_squares(A, y, names)
    for other in (np.linalg.lstsq(A, y, rcond=None)[0], scipy.linalg.lstsq(A, y)[0]):
        np.testing.assert_allclose(fit.beta, other, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(fit.unit_covariance, np.linalg.inv(A.T @ A), rtol=1e-6, atol=1e-9)
    # the normal equations: residuals are orthogonal to all columns
    np.testing.assert_allclose(A.T @ fit.residuals, 0.0, atol=1e-9 * np.linalg.norm(A) * np.linalg.norm(y))
    assert fit.chi2 == pytest.approx(fit.residuals @ fit.residuals, rel=1e-9, abs=1e-12)


@pytest.mark.parametrize("closeness", [1e-4, 1e-6, 1e-8, 1e-10, 1e-12])
def test_error_grows_with_the_condition_and_not_its_square(closeness):
    """Backward stability (Golub and Van Loan 5.3): error < some eps * condition where the data fit exactly."""
    rng = np.random.default_rng(3)
    one = rng.standard_normal(50)
    A = np.column_stack([one, one + closeness * rng.standard_normal(50)])
    fit = least_squares(A, A @ [1.0, 1.0], "ab")
    assert fit.identifiability.rank == 2
    assert fit.identifiability.condition == pytest.approx(2.0 / closeness, rel=0.5)
    np.testing.assert_allclose(fit.beta, 1.0, atol=50 * np.finfo(float).eps / closeness)


def test_as_many_rows_as_a_recording_has():
    """A hundred thousand rows: no matrix of rows by rows (80 GB) may be made on the way."""
    n = 100_000
    x = np.linspace(-1.0, 1.0, n)
    fit = least_squares(np.column_stack([np.ones(n), x]), 3.0 + 2.0 * x, "ab")
    np.testing.assert_allclose(fit.beta, [3.0, 2.0], rtol=1e-12)
    np.testing.assert_allclose(np.diag(fit.unit_covariance), [1.0 / n, 1.0 / np.sum(x**2)], rtol=1e-9)


# Generalised least squares.


@settings(deadline=None)
@given(st.integers(2, 5), st.integers(0, 2**32 - 1))
def test_generalised_equals_ordinary_after_the_transform(p, seed):
    rng = np.random.default_rng(seed)
    A, y, names = design(rng, 12, p)
    V = random_covariance(rng, 12)
    fit = least_squares(A, y, names, V)
    # a symmetric root of the inverse instead of the Cholesky factor: any whitening gives the same
    w, Q = np.linalg.eigh(V)
    root = Q / np.sqrt(w) @ Q.T
    plain = least_squares(root @ A, root @ y, names)
    np.testing.assert_allclose(fit.beta, plain.beta, rtol=1e-6, atol=1e-8)
    np.testing.assert_allclose(fit.unit_covariance, plain.unit_covariance, rtol=1e-6, atol=1e-8)
    assert fit.chi2 == pytest.approx(plain.chi2, rel=1e-6)
    # Aitken's closed form
    N = A.T @ np.linalg.solve(V, A)
    np.testing.assert_allclose(
        fit.beta, np.linalg.solve(N, A.T @ np.linalg.solve(V, y)), rtol=1e-5, atol=1e-7
    )
    np.testing.assert_allclose(fit.residuals, y - A @ fit.beta, atol=1e-12)  # in the unit of y


def test_variances_are_a_diagonal_covariance():
    rng = np.random.default_rng(4)
    A, y, names = design(rng, 10, 3)
    variances = rng.uniform(0.1, 10.0, 10)
    one, other = least_squares(A, y, names, variances), least_squares(A, y, names, np.diag(variances))
    np.testing.assert_allclose(one.beta, other.beta, rtol=1e-12)
    np.testing.assert_allclose(one.unit_covariance, other.unit_covariance, rtol=1e-12)


def test_whitened_noise_is_white():
    """Var(L^-1 e) = I: the sample covariance of 20 000 draws, each entry within 5 of its standard errors."""
    rng = np.random.default_rng(5)
    V = random_covariance(rng, 4)
    runs = 20_000
    white = whiten(rng.multivariate_normal(np.zeros(4), V, runs).T, V)
    np.testing.assert_allclose(white @ white.T / runs, np.eye(4), atol=5 * np.sqrt(2 / runs))


@for_each(
    "covariance",
    [
        np.array([1.0, 0.0, 1.0]),
        np.array([1.0, -1.0, 1.0]),
        np.array([1.0, np.nan, 1.0]),
        np.diag([1.0, 0.0, 1.0]),
        np.diag([1.0, -1.0, 1.0]),
        np.array([[1.0, 2.0, 0.0], [2.0, 1.0, 0.0], [0.0, 0.0, 1.0]]),
        np.full((3, 3), np.nan),
    ],
)
def test_a_covariance_that_is_none_is_refused(covariance):
    with pytest.raises(ValueError, match="not positive"):
        least_squares(np.ones((3, 1)), np.ones(3), ["mean"], covariance)


def test_shapes_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match=re.escape("expected y of (3,) and 2 names")):
        least_squares(np.ones((3, 2)), np.ones(4), ["a", "b"])
    with pytest.raises(ValueError, match="2 names"):
        least_squares(np.ones((3, 2)), np.ones(3), ["a"])
    with pytest.raises(ValueError, match="broadcast"):
        least_squares(np.ones((3, 2)), np.ones(3), ["a", "b"], np.ones(2))


# Invariance.

scales = st.lists(st.integers(-6, 6), min_size=4, max_size=4).map(lambda powers: 10.0 ** np.array(powers))


@settings(deadline=None)
@given(scales, st.integers(-20, 20), st.integers(0, 2**32 - 1))
def test_units_change_nothing_but_the_units(column, power, seed):
    """Another unit for each parameter, and another for the observations."""
    A, y, names = design(np.random.default_rng(seed), 15, 4)
    unit = 10.0**power
    fit, other = (
        least_squares(A, y, names),
        least_squares(unit * A / column, unit * y, names, unit**2 * np.ones(15)),
    )
    np.testing.assert_allclose(other.beta / column, fit.beta, rtol=1e-7, atol=1e-10)
    np.testing.assert_allclose(
        other.unit_covariance / np.outer(column, column), fit.unit_covariance, rtol=1e-7, atol=1e-10
    )
    assert other.identifiability.rank == 4
    assert other.identifiability.condition == pytest.approx(fit.identifiability.condition, rel=1e-7)
    assert other.chi2 == pytest.approx(fit.chi2, rel=1e-7)
    assert other.identifiability.weakest() == fit.identifiability.weakest()


@settings(deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_observations_turned_in_their_space(seed):
    rng = np.random.default_rng(seed)
    A, y, names = design(rng, 9, 3)
    Q = np.linalg.qr(rng.standard_normal((9, 9)))[0]
    fit, turned = least_squares(A, y, names), least_squares(Q @ A, Q @ y, names)
    np.testing.assert_allclose(turned.beta, fit.beta, rtol=1e-7, atol=1e-9)
    np.testing.assert_allclose(turned.unit_covariance, fit.unit_covariance, rtol=1e-7, atol=1e-9)
    assert turned.chi2 == pytest.approx(fit.chi2, rel=1e-9)


# Rank: a gyrowheel on a turntable.

QUADRATIC = ("DX_F", "DX_X", "DX_Y", "DX_Z", "DX_XX", "DX_YY", "DX_ZZ", "DX_XY", "DX_XZ", "DX_YZ")


def turntable(phi1, phi2, latitude):
    """Gravity reference [g] and earth rate [earth rates] on the axes of the instrument, (n, 3) each."""
    C = elementary("y", np.radians(phi1)) @ elementary("z", np.radians(phi2))
    rate = np.array([np.cos(latitude), 0.0, np.sin(latitude)])
    return np.array([0.0, 0.0, -1.0]) @ C, rate @ C


def quadratic(a):
    x, y, z = a.T
    return np.column_stack([np.ones(len(a)), x, y, z, x * x, y * y, z * z, x * y, x * z, y * z])


GRID = tuple(angles.ravel() for angles in np.meshgrid(np.arange(0, 360, 30), np.arange(0, 360, 30)))


def test_gravity_squared_is_constant_so_nine_of_ten_terms_are_known():
    a, _ = turntable(*GRID, 0.7)
    known = identify(quadratic(a), QUADRATIC)
    assert known.rank == 9
    assert known.condition == np.inf
    (null,) = known.null_vectors / known.scale  # in the parameters' own units
    expected = np.array([1, 0, 0, 0, -1, -1, -1, 0, 0, 0])  # 1 - ax^2 - ay^2 - az^2 = 0
    np.testing.assert_allclose(null / null[0], expected, atol=1e-12)
    words = in_words(known.null_vectors[0], QUADRATIC)
    assert set(re.findall(r"DX_\w+", words)) == {"DX_F", "DX_XX", "DX_YY", "DX_ZZ"}
    assert known.weakest() == words
    assert known.leading_term() == "DX_F"  # its column is the longest
    signs = {name: sign for sign, name in re.findall(r"([+-]) [\d.]+ (DX_\w+)", "+ 1 " + words)}
    assert {signs[name] for name in ("DX_XX", "DX_YY", "DX_ZZ")} == {"-"}


def test_dropping_one_square_folds_it_into_the_others():
    """DX_F' = DX_F + DX_ZZ, DX_XX' = DX_XX - DX_ZZ, DX_YY' = DX_YY - DX_ZZ."""
    a, _ = turntable(*GRID, 0.7)
    truth = dict(zip(QUADRATIC, np.random.default_rng(6).standard_normal(10), strict=True))
    y = quadratic(a) @ list(truth.values())
    names = [name for name in QUADRATIC if name != "DX_ZZ"]
    fit = least_squares(np.delete(quadratic(a), 6, axis=1), y, names)
    assert fit.identifiability.rank == 9
    folded = truth | {
        "DX_F": truth["DX_F"] + truth["DX_ZZ"],
        "DX_XX": truth["DX_XX"] - truth["DX_ZZ"],
        "DX_YY": truth["DX_YY"] - truth["DX_ZZ"],
    }
    np.testing.assert_allclose(fit.beta, [folded[name] for name in names], atol=1e-12)


EIGHTHS = 45 * np.arange(8)
TWENTY_FOUR = np.r_[EIGHTHS, EIGHTHS, np.full(8, 90)], np.r_[np.zeros(8), np.full(8, 90), EIGHTHS]
CUBE = tuple(90 * angles.ravel() for angles in np.meshgrid(np.arange(4), np.arange(4)))


@pytest.mark.parametrize(
    ("plan", "latitude_deg", "with_rate", "rank"),
    [
        (GRID, 39.1, True, 12),
        (GRID, 90.0, True, 9),  # at the pole earth rate is along gravity
        (TWENTY_FOUR, 39.1, True, 11),
        (TWENTY_FOUR, 39.1, False, 9),
        (CUBE, 39.1, True, 9),
        (CUBE, 39.1, False, 6),
    ],
    ids=["grid", "pole", "24 positions", "24 positions, rate known", "cube", "cube, rate known"],
)
def test_ranks_of_the_classic_plans(plan, latitude_deg, with_rate, rank):
    a, rate = turntable(*plan, np.radians(latitude_deg))
    nine = np.delete(quadratic(a), 6, axis=1)
    A = np.column_stack([rate, nine]) if with_rate else nine
    assert identify(A, [f"b{i}" for i in range(A.shape[1])]).rank == rank


@settings(deadline=None)
@given(st.integers(2, 5), st.integers(0, 2**32 - 1))
def test_a_deficient_problem_gets_its_shortest_solution(p, seed):
    """Shortest in the scaled parameters; NumPy's minimum-norm solution of the scaled problem is the oracle."""
    rng = np.random.default_rng(seed)
    A, y, names = design(rng, 12, p)
    A = np.column_stack([A, A @ rng.uniform(0.5, 2.0, p)]) * 10.0 ** rng.integers(-6, 6, p + 1)
    fit = least_squares(A, y, [*names, "sum"])
    assert fit.identifiability.rank == p
    assert fit.dof == 12 - p
    lengths = np.linalg.norm(A, axis=0)
    shortest = np.linalg.lstsq(A / lengths, y, rcond=1e-10)[0]
    np.testing.assert_allclose(fit.beta * lengths, shortest, rtol=1e-6, atol=1e-8)
    (null,) = fit.identifiability.null_vectors
    np.testing.assert_allclose(A @ (null / lengths), 0.0, atol=1e-12)
    assert fit.beta * lengths @ null == pytest.approx(0.0, abs=1e-9 * np.linalg.norm(shortest) + 1e-12)
    # what the data do say has the same value and variance as without the superfluous column
    seen = A[0] @ fit.beta
    reduced = least_squares(A[:, :p], y, names)
    assert seen == pytest.approx(A[0, :p] @ reduced.beta, rel=1e-6, abs=1e-8)
    assert A[0] @ fit.unit_covariance @ A[0] == pytest.approx(
        A[0, :p] @ reduced.unit_covariance @ A[0, :p], rel=1e-6
    )


def test_fewer_observations_than_terms():
    A = np.random.default_rng(7).standard_normal((2, 4))
    fit = least_squares(A, np.array([1.0, 2.0]), "abcd")
    assert (fit.identifiability.rank, fit.dof) == (2, 0)
    assert np.isnan(fit.s2)
    assert fit.identifiability.null_vectors.shape == (2, 4)
    np.testing.assert_allclose(A @ fit.beta, [1.0, 2.0], rtol=1e-12)


def test_a_term_that_nothing_excites():
    A = np.column_stack([np.ones(5), np.zeros(5)])
    known = least_squares(A, np.arange(5.0), ["K0", "K2"]).identifiability
    assert known.rank == 1
    assert (known.leading_term(), known.weakest()) == ("K2", "K2")


def test_words_of_a_combination():
    assert in_words(np.array([-0.1, 0.7, -0.6]), ["K0", "M_xy", "K1"]) == "M_xy - 0.86 K1"
    assert in_words(np.array([0.5, 0.5]), ["a", "b"], smallest=0.9) == "a + 1.00 b"


# Statistics.


def test_stated_covariance_holds_in_monte_carlo():
    """4000 tests with correlated noise: NEES and chi2 in their chi-square bands (risk 1e-4 each)."""
    rng = np.random.default_rng(8)
    A, _, names = design(rng, 10, 3)
    V, truth, runs = random_covariance(rng, 10), np.array([1.0, -2.0, 3.0]), 4000
    noise = rng.multivariate_normal(np.zeros(10), V, runs)
    fits = [least_squares(A, A @ truth + e, names, V) for e in noise]
    errors = np.array([fit.beta for fit in fits]) - truth
    C = fits[0].unit_covariance
    nees = np.einsum("ri,ij,rj->", errors, np.linalg.inv(C), errors)
    for total, dof in ((nees, 3 * runs), (sum(fit.chi2 for fit in fits), 7 * runs)):
        low, high = stats.chi2.ppf([5e-5, 1 - 5e-5], dof)
        assert low < total < high
    # the same with the noise known but for its size: Student's t at 7 degrees of freedom holds 95 %
    u = np.sqrt(np.outer([fit.s2 for fit in fits], np.diag(C)))
    held = np.sum(np.abs(errors) <= stats.t.ppf(0.975, 7) * u, axis=0)
    low, high = stats.binom.ppf([2e-5, 1 - 2e-5], runs, 0.95)
    assert np.all((low <= held) & (held <= high))
