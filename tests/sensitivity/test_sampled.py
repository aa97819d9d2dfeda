"""Sampled indices, against closed forms of known functions and the exact indices of a two-axis table."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from inercal.foundation.rigs.chain import Chain, Error, Joint, Scope
from inercal.foundation.rigs.outputs import table_outputs
from inercal.foundation.rigs.patterns import normal, uniform
from inercal.foundation.rigs.plans import grid
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.sensitivities import averages, exact, sampled
from inercal.foundation.sensitivities.sampled import estimate, evaluate

LAW = uniform(np.radians(2.0 / 60.0))
TABLE = turntable("two_axis_turntable", LAW)
OUTPUTS = table_outputs(("ax", "ay", "az", "wx", "wy"), 9.8, np.radians(45.0))

ISHIGAMI = dict.fromkeys(("x1", "x2", "x3"), uniform(np.pi))
ONE = uniform(1.0)
G_A = np.array([0.0, 1.0, 4.5, 9.0, 99.0])
"""Coefficients a of the G function: from an important variable to one of no weight."""


def ishigami(x):
    return np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])


def ishigami_indices():
    """First and total order (Ishigami and Homma 1990), a = 7 and b = 0.1."""
    a, b, pi4 = 7.0, 0.1, np.pi**4
    v1, v2 = 0.5 * (1.0 + b * pi4 / 5.0) ** 2, a**2 / 8.0
    v13 = b**2 * pi4**2 * (1.0 / 18.0 - 1.0 / 50.0)
    return np.array([v1, v2, 0.0]) / (v1 + v2 + v13), np.array([v1 + v13, v2, v13]) / (v1 + v2 + v13)


def g_function(x):
    """Sobol's G of errors uniform on ±1: product of (4 |u - 1/2| + a) / (1 + a), u = (x + 1) / 2."""
    return np.prod((2.0 * np.abs(x) + G_A) / (1.0 + G_A), axis=1)


def g_indices():
    parts = 1.0 / (3.0 * np.square(1.0 + G_A))
    whole = np.prod(1.0 + parts) - 1.0
    return parts / whole, parts * np.prod(1.0 + parts) / (1.0 + parts) / whole


CASES = [
    (ishigami, ISHIGAMI, ishigami_indices()),
    (g_function, {f"x{i}": ONE for i in range(5)}, g_indices()),
]


@pytest.mark.parametrize("sampling", ["random", "sobol"])
@pytest.mark.parametrize(("function", "laws", "known"), CASES, ids=["ishigami", "g"])
def test_known_functions(function, laws, known, sampling):
    """Within five of its own standard uncertainties (plus rounding, for what cannot scatter)."""
    found = sampled.analyse_function(function, laws, 4096, np.random.default_rng(11), sampling)
    for indices, u, closed in zip(
        (found.first, found.total), (found.u_first, found.u_total), known, strict=True
    ):
        assert_array_equal(np.abs(indices[0, 0] - closed) <= 5.0 * u[0, 0] + 1e-12, True)
        assert u.max() < 0.06


@pytest.mark.parametrize(("function", "laws", "known"), CASES, ids=["ishigami", "g"])
def test_sobol_points_converge_faster_than_random_rows(function, laws, known):
    """Root mean square error of first and total order over 10 repeats of 1024 rows."""

    def rms(sampling):
        rng = np.random.default_rng(12)
        runs = [sampled.analyse_function(function, laws, 1024, rng, sampling) for _ in range(10)]
        return np.sqrt(np.mean([np.square([r.first[0, 0], r.total[0, 0]] - np.array(known)) for r in runs]))

    assert rms("sobol") < 0.5 * rms("random")


def test_bootstrap_covers_the_truth_as_often_as_it_says():
    """Within 1.96 u in 95 % of 200 runs on random rows: between 87 % and all, five standard deviations."""
    rng, known = np.random.default_rng(13), ishigami_indices()
    runs = [sampled.analyse_function(ishigami, ISHIGAMI, 500, rng, "random") for _ in range(200)]
    first = [np.abs(run.first - known[0]) < 1.96 * run.u_first for run in runs]
    total = [np.abs(run.total - known[1]) < 1.96 * run.u_total for run in runs]
    for inside in (np.mean(first, axis=0), np.mean(total, axis=0)):
        assert inside.min() > 0.87


def test_rows_of_sobol_points_are_rounded_up():
    method = sampled.analyse_function(ishigami, ISHIGAMI, 1000, np.random.default_rng(1)).method
    assert (method["samples"], method["asked"]) == (1024, 1000)
    found = sampled.analyse_function(ishigami, ISHIGAMI, 1024, np.random.default_rng(1))
    assert found.method["samples"] == 1024
    plain = sampled.analyse_function(ishigami, ISHIGAMI, 1000, np.random.default_rng(1), "random")
    assert plain.method == {
        "name": "sampled",
        "sampling": "random",
        "samples": 1000,
        "asked": 1000,
        "resamples": sampled.RESAMPLES,
    }


@pytest.mark.slow
def test_the_procedure_of_zhao_et_al():
    """N = 1000 random rows fresh at each position: noise of a few hundredths, unbiased, 1e-5 on null factors.

    The deviations in units of their uncertainties have unit size (they are correlated within a position, so
    the limit is loose); the shares of null factors are of second order, (2 arcmin)^2 times noise.
    """
    angles = grid((6, 8)).angles
    found = sampled.analyse(TABLE, OUTPUTS, angles, 1000, np.random.default_rng(14), "random")
    truth = exact.analyse(TABLE, OUTPUTS, angles)
    null = truth.first < 1e-6
    for estimated, true, u in (
        (found.first, truth.first, found.u_first),
        (found.total, truth.total, found.u_total),
    ):
        error = estimated - true
        assert 0.8 < np.sqrt(np.mean(np.square(error[~null] / u[~null]))) < 1.25
        assert 0.005 < np.sqrt(np.mean(np.square(error[~null]))) < 0.03
        assert np.abs(error[null]).max() < 5e-4
    assert 1e-6 < np.sqrt(np.mean(np.square(found.first[null]))) < 1e-4
    # variance of a sum of uniforms scatters by less than sqrt(2 / 2N)
    assert_allclose(found.variance, truth.variance, rtol=5.0 * np.sqrt(1.0 / 1000.0))
    assert (found.interaction_variance < 0.0).any()  # estimates of what is almost nothing
    assert found.factors == TABLE.factors
    assert found.units == ("m/s^2", "m/s^2", "m/s^2", "rad/s", "rad/s")


def test_interactions_rule_only_beyond_the_noise_of_sampling():
    """At N = 1000 the sums of S scatter by hundredths: 96 sound sums go unflagged, and singular attitudes do not."""
    sound = grid((4, 8)).angles
    found = sampled.analyse(TABLE, OUTPUTS[:3], sound, 1000, np.random.default_rng(19), "random")
    assert (found.first.sum(axis=2) < 0.99).sum() > 20  # what their own noise would have said
    assert averages.flagged(exact.analyse(TABLE, OUTPUTS[:3], sound)) == ()
    assert averages.flagged(found) == ()
    for sampling in ("random", "sobol"):
        at = sampled.analyse(TABLE, OUTPUTS[2:3], [[0.0, 0.3]], 1000, np.random.default_rng(20), sampling)
        (flag,) = averages.flagged(at)
        (true,) = averages.flagged(exact.analyse(TABLE, OUTPUTS[2:3], [[0.0, 0.3]]))
        assert true.u == 0.0
        assert flag.sum_first == pytest.approx(true.sum_first, abs=5.0 * flag.u)
        assert 0.0 < flag.u < 0.3


@pytest.mark.slow
def test_averages_scatter_as_they_say():
    """40 repeats of 6 positions: each average spreads by its own u, within five times the 1/sqrt(2 n) of a spread."""
    angles, rng = grid((2, 3)).angles, np.random.default_rng(21)
    runs = [sampled.analyse(TABLE, OUTPUTS[:3], angles, 200, rng, "random") for _ in range(40)]
    loose = 5.0 / np.sqrt(2.0 * len(runs))
    for average in (averages.mean, averages.weighted, averages.aggregate):
        each = [average(run) for run in runs]
        for name in ("first", "total"):
            values = np.array([getattr(one, name) for one in each])
            u = np.sqrt(np.mean([np.square(getattr(one, f"u_{name}")) for one in each], axis=0))
            acting = values.mean(axis=0) > 0.01
            assert_allclose(values.std(axis=0, ddof=1)[acting], u[acting], rtol=loose)
    assert averages.mean(exact.analyse(TABLE, OUTPUTS[:3], angles)).u_first is None


def test_outputs_are_centred_first():
    """At phi1 = 0 gravity along z only shrinks: bias over standard deviation is 4 / sqrt(13.6), 1.08.

    az = g (X^2 + Y^2) / 2 with X, Y sums of four equal errors: mean 4 s^2 g, variance 13.6 s^4 g^2. Each of the
    eight errors has a share of 0.8 / 54.4 alone.
    """
    found = sampled.analyse(TABLE, OUTPUTS[2:3], [[0.0, 0.3]], 1 << 14, np.random.default_rng(15))
    assert found.bias[0, 0] / np.sqrt(found.variance[0, 0]) == pytest.approx(4.0 / np.sqrt(13.6), rel=0.01)
    truth = exact.analyse(TABLE, OUTPUTS[2:3], [[0.0, 0.3]])
    assert_array_equal(np.abs(found.first - truth.first) <= 5.0 * found.u_first, True)
    assert_array_equal(np.abs(found.total - truth.total) <= 5.0 * found.u_total, True)
    assert found.first[0, 0, 0] == pytest.approx(0.8 / 54.4, abs=5.0 * found.u_first[0, 0, 0])


def test_large_errors_of_a_chain():
    """Errors of tens of degrees, where interactions carry a good part of the variance."""
    table = turntable("two_axis_turntable", uniform(np.radians(30.0)))
    angles = np.array([[0.4, 1.0], [2.0, -0.6]])
    found = sampled.analyse(table, OUTPUTS, angles, 1 << 12, np.random.default_rng(16))
    truth = exact.analyse(table, OUTPUTS, angles)
    assert truth.total_minus_first.max() > 0.05
    for estimated, true, u in (
        (found.first, truth.first, found.u_first),
        (found.total, truth.total, found.u_total),
    ):
        assert_array_equal(np.abs(estimated - true) <= 5.0 * u, True)
    assert_allclose(found.variance, truth.variance, rtol=0.05)
    assert_allclose(found.bias, truth.bias, atol=5.0 * np.sqrt(truth.variance.max() / (1 << 13)))


def test_a_chain_is_a_function_of_its_errors():
    at = np.array([0.4, 1.0])
    chain = sampled.analyse(TABLE, OUTPUTS, at, 256, np.random.default_rng(17))
    laws = {error.name: error.distribution for error in TABLE.errors}

    def function(errors):
        C = TABLE.attitude(at, errors)
        return np.stack([output.value(C) for output in OUTPUTS], axis=-1)

    names = [output.name for output in OUTPUTS]
    (rng,) = np.random.default_rng(17).spawn(1)  # the stream of the first position
    other = sampled.analyse_function(function, laws, 256, rng, outputs=names)
    for name in ("variance", "bias", "first_variance", "interaction_variance", "u_first", "u_total"):
        assert_allclose(getattr(chain, name), getattr(other, name), rtol=1e-9, atol=1e-14)


def test_correlated_errors_are_made_of_independent_ones():
    """y = e1 + e2 of correlation r: by Cholesky the first independent variable has (1 + r) / 2, the second the rest."""
    r = 0.6
    L = np.linalg.cholesky(np.array([[1.0, r], [r, 1.0]]))
    laws = dict.fromkeys(("first", "rest of second"), normal(1.0))
    found = sampled.analyse_function(lambda x: (x @ L.T).sum(axis=1), laws, 4096, np.random.default_rng(18))
    assert found.variance[0, 0] == pytest.approx(2.0 + 2.0 * r, rel=0.01)
    assert_allclose(found.first[0, 0], [0.5 * (1.0 + r), 0.5 * (1.0 - r)], atol=0.01)
    assert_allclose(found.total[0, 0], [0.5 * (1.0 + r), 0.5 * (1.0 - r)], atol=0.01)


def test_one_variable_at_two_places_of_a_chain():
    """Two turns about the same axis by one error are one turn by its double, which the exact analysis covers."""
    law = uniform(0.2)
    wobble = Error("wobble", "x", law, Scope.POSITION)
    twice = Chain(
        (Joint("phi", "y"), Error("a", "y", law, Scope.RIG), wobble, Error("b", "y", law, Scope.RIG))
    )
    between = Chain((Joint("phi", "y"), Error("a", "y", law.scaled(2.0), Scope.RIG)))
    ax = OUTPUTS[:1]

    def both(errors):
        a, none = errors[:, 0], np.zeros(len(errors))
        return ax[0].value(twice.attitude([0.5], np.stack([a, none, a], axis=-1)))

    found = sampled.analyse_function(both, {"a": law}, 1024, np.random.default_rng(19))
    truth = exact.analyse(between, ax, [[0.5]])
    assert found.variance[0, 0] == pytest.approx(truth.variance[0, 0], rel=0.01)
    assert found.bias[0, 0] == pytest.approx(truth.bias[0, 0], rel=0.02)
    assert found.total[0, 0, 0] == pytest.approx(1.0, abs=0.01)


def test_an_offset_has_no_share():
    table = turntable("two_axis_turntable", LAW, {"d_eta": uniform(1e-3)})
    found = sampled.analyse(table, OUTPUTS, [[0.4, 1.0]], 64, np.random.default_rng(20))
    k = table.factors.index("d_eta")
    assert not found.first_variance[..., k].any()
    assert not found.interaction_variance[..., k].any()


def test_an_output_without_variance_has_no_indices():
    """Errors about the vertical do not move gravity; what rounding leaves is no variance."""
    chain = Chain((Joint("phi", "z"), Error("turn", "z", uniform(0.3), Scope.RIG)))
    found = sampled.analyse(chain, OUTPUTS[:3], [[0.4]], 256, np.random.default_rng(21))
    assert_array_equal(found.variance, 0.0)
    assert np.isnan(found.first).all()
    constant = sampled.analyse_function(
        lambda x: np.full(len(x), 0.1), {"x": ONE}, 100, np.random.default_rng(22), "random"
    )
    assert np.isnan(constant.total).all()


def test_positions_are_reported_and_draws_repeat():
    told = []
    angles = grid((4, 4)).angles
    first, second = (
        sampled.analyse(
            TABLE,
            OUTPUTS[:1],
            angles,
            16,
            np.random.default_rng(23),
            progress=lambda done, total: told.append((done, total)),
        )
        for _ in range(2)
    )
    assert told == [(i, 16) for i in range(17)] * 2
    assert_array_equal(first.total, second.total)
    # fresh rows at each position: the same position twice has its own noise each time
    found = sampled.analyse(TABLE, OUTPUTS[:1], angles[[0, 0]], 16, np.random.default_rng(24))
    assert found.variance[0, 0] != found.variance[0, 1]


@pytest.mark.parametrize(
    ("function", "samples", "message"),
    [
        (ishigami, 1, "found 1 samples, expected 2 or more"),
        (lambda x: 0.0, 16, r"outputs of shape \(\), expected \(16, outputs\)"),
        (lambda x: x[:5, 0], 16, r"outputs of shape \(5,\)"),
        (lambda x: x[:, :2], 16, "found 2 outputs, expected 1: y"),
        (lambda x: np.where(x[:, 0] > 0.0, np.nan, 1.0), 16, "not finite"),
    ],
)
def test_bad_functions_are_refused(function, samples, message):
    with pytest.raises(ValueError, match=message):
        sampled.analyse_function(function, ISHIGAMI, samples, np.random.default_rng(25))


def test_columns_are_exchanged_one_at_a_time():
    """For a sum, f_AB differs from f_A by the change of its column alone."""
    A, B = np.random.default_rng(26).random((2, 8, 3))
    f_A, f_B, f_AB = evaluate(lambda x: x.sum(axis=1), A, B)
    assert (f_A.shape, f_B.shape, f_AB.shape) == ((8, 1), (8, 1), (3, 8, 1))
    assert_allclose(f_AB[..., 0] - f_A[:, 0], (B - A).T, atol=1e-15)


def test_an_estimate_does_not_depend_on_the_mean():
    """Centred: adding a million changes nothing but rounding."""
    rng = np.random.default_rng(27)
    values = evaluate(ishigami, *(rng.uniform(-np.pi, np.pi, (2, 500, 3))))
    plain = estimate(*values, 2, np.random.default_rng(1))
    moved = estimate(*(each + 1e6 for each in values), 2, np.random.default_rng(1))
    assert_allclose(moved.first_variance, plain.first_variance, atol=1e-6)
    assert_allclose(moved.interaction_variance, plain.interaction_variance, atol=1e-6)
