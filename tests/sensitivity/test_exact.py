"""The exact analysis of chains of rotations: against many digits, brute force, leading orders and Monte Carlo."""

from itertools import combinations

import numpy as np
import pytest
from high_precision import KINDS, reference, relative
from hypothesis import given, settings
from hypothesis import strategies as st

from inercal.foundation.geometry.rotations import elementary
from inercal.foundation.rigs.chain import Chain, Error, Fixed, Joint, Scope, about
from inercal.foundation.rigs.outputs import Output, table_outputs
from inercal.foundation.rigs.patterns import normal, two_point, uniform
from inercal.foundation.rigs.plans import grid
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.sensitivities import averages
from inercal.foundation.sensitivities.exact import analyse, closed_variance

ARCSEC = np.pi / 180.0 / 3600.0
LATITUDE = np.radians(40.0)
GRAVITY = 9.8
OUTPUTS = table_outputs(("ax", "ay", "az", "wx", "wy"), GRAVITY, LATITUDE)
OF = {output.name: output for output in OUTPUTS}


def table(distribution, kind="two_axis_turntable", **more):
    return turntable(kind, distribution, **more)


def few(**widths):
    """A two-axis table with some wide errors only: (distribution, size) by name."""
    return table(None, errors={name: KINDS[kind](size) for name, (kind, size) in widths.items()})


WIDE = few(
    dphi_y1=("uniform", 0.6),
    dalpha_x1=("ramp", 0.8),
    deps_y=("normal", 0.3),
    dphi_z2=("triangular", 0.9),
    dalpha_x2=("two_point", 0.4),
    dtheta_z=("ramp", 0.5),
)
SOMEWHERE = np.array([[0.3, 1.1], [np.pi / 2, 0.0]])


# many digits


@pytest.mark.parametrize("size", [ARCSEC, 120.0 * ARCSEC, np.radians(5.0), np.radians(50.0)])
@pytest.mark.parametrize("kind", KINDS)
def test_agrees_with_sixty_digits_at_ordinary_and_singular_attitudes(kind, size):
    """Where the leading order of the variance vanishes too: az at phi1 = 0, ax at 90, 0, ay at 90, 90 deg."""
    chain = table(KINDS[kind](size))
    for name, phi1, phi2 in [
        ("ax", 0.3, 1.1),
        ("wy", 4.0, 2.5),
        ("az", 0.0, 0.7),
        ("ax", 90, 0),
        ("ay", 90, 90),
    ]:
        angles = np.radians([[phi1, phi2]]) if phi1 == 90 else np.array([[phi1, phi2]])
        found = analyse(chain, [OF[name]], angles)
        variance, bias, first, interaction = reference(chain, OF[name], angles[0])
        assert relative(found.variance, [variance]) < 1e-13
        assert abs(found.bias[0, 0] - bias) < 1e-13 * (abs(bias) + size**2 * OF[name].scale)
        # below 1e-20 V a part is a null, and so said
        assert relative(found.first_variance, first, 1e-20 * variance) < 1e-12
        assert relative(found.interaction_variance, interaction, 1e-20 * variance) < 1e-12


@pytest.mark.parametrize("size", [ARCSEC, np.radians(50.0)])
def test_agrees_with_sixty_digits_on_other_rigs(size):
    """Three axes, a tilted base with its own errors, an instrument mounted askew, an error about a skew axis."""
    rng = np.random.default_rng(20)
    skewed = about(rng.normal(size=3), Error("skew", "x", KINDS["ramp"](size), Scope.RIG))
    optional = dict.fromkeys(("dbase_x", "dbase_y", "dbase_z"), normal(size))
    rig = table(
        uniform(size),
        "three_axis_turntable",
        errors=optional,
        base=(0.3, 0.02, -0.4),
        mounting=elementary("y", 0.7) @ elementary("z", -1.9),
    )
    chain = Chain((*rig.elements, *skewed))
    output = Output("any", rng.normal(size=3), rng.normal(size=3), "1", 1.0)
    angles = rng.uniform(-np.pi, np.pi, (1, 3))
    found = analyse(chain, [output], angles)
    variance, bias, first, interaction = reference(chain, output, angles[0])
    assert relative(found.variance, [variance]) < 1e-13
    assert relative(found.bias, [bias]) < 1e-12
    assert relative(found.first_variance, first, 1e-20 * variance) < 1e-12
    assert relative(found.interaction_variance, interaction, 1e-20 * variance) < 1e-12


@pytest.mark.parametrize("size", [ARCSEC, np.radians(50.0)])
def test_an_error_that_cannot_act_has_no_part(size):
    """About the axis that is read out, or about the reference: also where these lie askew."""
    chain = table(uniform(size))
    everywhere = grid((5, 7)).angles
    found = analyse(chain, [OF["az"]], everywhere, second=True)
    last = chain.factors.index("dtheta_z")
    assert np.all(found.first[..., last] + found.total_minus_first[..., last] < 1e-20)
    assert np.all(found.second[..., last, :] < 1e-20)

    axis = np.array([0.3, -1.2, 0.7])
    first_about = about(axis, Error("first", "y", uniform(size), Scope.RIG))
    last_about = about(axis, Error("last", "z", KINDS["ramp"](size), Scope.RIG))
    askew = Chain((*first_about, *chain.elements, *last_about))
    outputs = [Output("in", axis, np.eye(3)[0], "1", 1.0), Output("out", np.eye(3)[0], axis, "1", 1.0)]
    found = analyse(askew, outputs, everywhere)
    assert np.all((found.first + found.total_minus_first)[0, :, 0] < 1e-20)
    assert np.all((found.first + found.total_minus_first)[1, :, -1] < 1e-20)


# leading order


def leading(phi1, phi2):
    """V_i / (g^2 var) of ax, ay, az to leading order; columns in the order of the chain (y1 x1 z1 ex ey z2 ...)."""
    c1, s1, c2, s2 = (f(angle) ** 2 for angle in (phi1, phi2) for f in (np.cos, np.sin))
    ax = {
        "dphi_y1": c1 * c2,
        "dphi_z2": s1 * s2,
        "dalpha_x1": c1 * s2,
        "dalpha_z1": s1 * s2,
        "dalpha_x2": 0.0,
    }
    ax |= {"dalpha_y2": c1, "deps_x": c1 * s2, "deps_y": c1 * c2, "dtheta_x": 0.0, "dtheta_y": c1}
    ax |= {"dtheta_z": s1 * s2}
    ay = {"dphi_y1": c1 * s2, "dphi_z2": s1 * c2, "dalpha_x1": c1 * c2, "dalpha_z1": s1 * c2, "dalpha_x2": c1}
    ay |= {"dalpha_y2": 0.0, "deps_x": c1 * c2, "deps_y": c1 * s2, "dtheta_x": c1, "dtheta_y": 0.0}
    ay |= {"dtheta_z": s1 * c2}
    az = dict.fromkeys(ax, 0.0) | {"dphi_y1": s1, "deps_y": s1, "dalpha_x2": s1 * s2, "dtheta_x": s1 * s2}
    az |= {"dalpha_y2": s1 * c2, "dtheta_y": s1 * c2}
    return ax, ay, az


def test_leading_order_of_gravity_on_the_two_axis_table():
    """First-order perturbation of [0 0 -g] R by hand, for equal small variances."""
    chain, unit = table(uniform(ARCSEC)), (GRAVITY * ARCSEC) ** 2 / 3.0
    for phi1, phi2 in np.random.default_rng(3).uniform(-np.pi, np.pi, (20, 2)):
        found = analyse(chain, OUTPUTS[:3], [[phi1, phi2]])
        for o, row in enumerate(leading(phi1, phi2)):
            expected = unit * np.array([row[name] for name in chain.factors])
            np.testing.assert_allclose(found.first_variance[o, 0], expected, rtol=1e-9, atol=1e-9 * unit)


def test_full_circle_means_of_the_paper_s_case():
    """±2 arcmin, 36 x 36 half-offset grid, and the closed forms of a grid without end where they hold on any grid."""
    chain = table(uniform(120.0 * ARCSEC))
    found = averages.mean(analyse(chain, OUTPUTS, grid((36, 36)).angles))
    of = {
        (output, factor): found.first[o, k]
        for o, output in enumerate(OF)
        for k, factor in enumerate(chain.factors)
    }
    for value, names in {
        0.09409: ("dphi_y1", "deps_y"),
        0.07267: ("dalpha_x1", "deps_x"),
        0.11099: ("dphi_z2", "dalpha_z1", "dtheta_z"),
        0.16676: ("dalpha_y2", "dtheta_y"),
        0.0: ("dalpha_x2", "dtheta_x"),
    }.items():
        for name in names:
            assert of["ax", name] == pytest.approx(value, abs=1.5e-5)
    for name in ("dphi_y1", "deps_y"):
        assert of["az", name] == pytest.approx(0.25, abs=2e-5)
    for name in ("dalpha_x2", "dalpha_y2", "dtheta_x", "dtheta_y"):
        assert of["az", name] == pytest.approx(0.125, abs=2e-5)


def test_earth_rate_shares_the_sensitivities_of_gravity_a_latitude_away():
    """wx at (phi1, phi2) is ax at (phi1 + L - 90 deg, phi2): both references lie in the plane phi1 turns in."""
    chain, angles = table(normal(0.2)), np.random.default_rng(5).uniform(-np.pi, np.pi, (30, 2))
    rate = analyse(chain, [OF["wx"], OF["wy"]], angles)
    gravity = analyse(chain, [OF["ax"], OF["ay"]], angles + np.array([LATITUDE - np.pi / 2.0, 0.0]))
    np.testing.assert_allclose(rate.first, gravity.first, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(rate.total_minus_first, gravity.total_minus_first, rtol=1e-9, atol=1e-12)


# the decomposition


def test_the_parts_are_those_of_the_decomposition_by_subsets():
    """V_i, VT_i, V_ij and Shapley effects from the closed variances of all 64 sets of six wide errors."""
    found = analyse(WIDE, OUTPUTS, SOMEWHERE, shapley=True, second=True)
    names = WIDE.factors
    k, everyone = len(names), frozenset(names)
    closed = {
        frozenset(some): closed_variance(WIDE, OUTPUTS, SOMEWHERE, some)
        for size in range(k + 1)
        for some in combinations(names, size)
    }
    part = {}
    for some, value in closed.items():
        smaller = [other for other in part if other < some]
        part[some] = value - sum((part[other] for other in smaller), np.zeros_like(value))
    tight = {"rtol": 1e-12, "atol": 1e-13 * found.variance.max()}
    np.testing.assert_allclose(closed[everyone], found.variance, rtol=1e-13)
    assert min(value.min() for value in part.values()) > -1e-14 * found.variance.max()
    for i, name in enumerate(names):
        np.testing.assert_allclose(found.first_variance[..., i], closed[frozenset([name])], **tight)
        total = found.variance - closed[everyone - {name}]
        np.testing.assert_allclose(
            found.first_variance[..., i] + found.interaction_variance[..., i], total, **tight
        )
        shapley = sum(value / len(some) for some, value in part.items() if name in some)
        np.testing.assert_allclose(found.shapley[..., i] * found.variance, shapley, **tight)
        for j, other in enumerate(names):
            pair = part[frozenset([name, other])] if other != name else 0.0
            np.testing.assert_allclose(found.second_variance[..., i, j], pair, **tight)


@pytest.mark.parametrize("k", [1, 2, 5, 8, 11])
def test_shapley_effects_lie_between_first_and_total_order_and_sum_to_one(k):
    names = table(uniform(1.0)).factors[:k]
    chain = few(**dict.fromkeys(names, ("uniform", 1.0)))
    found = analyse(chain, [OF["ax"], OF["wy"]], [[0.3, 1.1], [2.0, -0.4]], shapley=True)
    np.testing.assert_allclose(found.shapley.sum(axis=-1), 1.0, rtol=1e-13)
    assert np.all(found.shapley >= found.first * (1.0 - 1e-12))
    assert np.all(found.shapley <= found.total * (1.0 + 1e-12))


def test_sums_of_indices_keep_their_bounds():
    """sum S + sum S_ij <= 1 <= sum ST, and the second orders of a factor fit into its interactions."""
    found = analyse(table(uniform(0.5)), OUTPUTS, grid((6, 6)).angles, second=True)
    some = found.first.sum(axis=-1) + found.second.sum(axis=(-1, -2)) / 2.0
    assert np.all(some <= 1.0 + 1e-12)
    assert np.all(some > found.first.sum(axis=-1))
    assert np.all(found.total.sum(axis=-1) >= 1.0 - 1e-12)
    assert np.all(found.second.sum(axis=-1) <= found.total_minus_first * (1.0 + 1e-12))


# Monte Carlo


def test_monte_carlo_finds_the_same_parts():
    """Pick and freeze with wide errors, two of them asymmetric; limits of 5 standard errors of 110 means."""
    rng, runs = np.random.default_rng(11), 20_000
    angles = np.array([0.3, 1.1])
    found = analyse(WIDE, OUTPUTS, [angles])
    k = len(WIDE.factors)
    redrawn = WIDE.with_scope(Scope.POSITION)
    A, B = redrawn.draw(rng, runs), redrawn.draw(rng, runs)
    ideal = WIDE.attitude(angles)

    def errors(rows):
        attitude = WIDE.attitude(angles, rows)
        return np.array([output.value(attitude) - output.value(ideal) for output in OUTPUTS])

    def check(samples, exact):
        """Samples (outputs, runs) whose mean is to be the exact value."""
        error = samples.std(axis=1) / np.sqrt(runs)
        assert np.all(np.abs(samples.mean(axis=1) - exact) <= 5.0 * error)  # equal where nothing varies

    y_a, y_b = errors(A), errors(B)
    check(y_a, found.bias[:, 0])
    check((y_a - found.bias) ** 2, found.variance[:, 0])
    for i in range(k):
        mixed = A.copy()
        mixed[:, i] = B[:, i]
        y = errors(mixed)
        check((y_b - found.bias) * (y - y_a), found.first_variance[:, 0, i])
        check(0.5 * (y_a - y) ** 2, found.first_variance[:, 0, i] + found.interaction_variance[:, 0, i])


# symmetries


@settings(max_examples=15, deadline=None)
@given(st.lists(st.floats(-np.pi, np.pi), min_size=3, max_size=3), st.floats(-np.pi, np.pi))
def test_turning_base_and_reference_together_changes_nothing(turn, phi1):
    rotation = elementary("x", turn[0]) @ elementary("y", turn[1]) @ elementary("z", turn[2])
    angles = [[phi1, 0.4]]
    turned = Chain((Fixed(rotation), *WIDE.elements))
    output = OF["ax"]
    carried = Output("ax", output.reference @ rotation.T, output.axis, output.unit, output.scale)
    here, there = analyse(WIDE, [output], angles), analyse(turned, [carried], angles)
    np.testing.assert_allclose(there.variance, here.variance, rtol=1e-12)
    np.testing.assert_allclose(there.first_variance, here.first_variance, rtol=1e-9, atol=1e-13)
    np.testing.assert_allclose(there.interaction_variance, here.interaction_variance, rtol=1e-9, atol=1e-13)


@settings(max_examples=15, deadline=None)
@given(st.floats(-np.pi, np.pi), st.floats(-np.pi, np.pi), st.floats(0.01, 100.0))
def test_a_chain_read_backwards_exchanges_reference_and_axis(phi1, phi2, factor):
    """u R v = v R^T u: elements in reverse with their angles negated; and variances go with the square of u."""
    base = few(
        dphi_y1=("uniform", 0.6),
        deps_y=("normal", 0.3),
        dphi_z2=("triangular", 0.9),
        dtheta_x=("two_point", 1),
    )
    u, v = np.array([0.3, -1.0, 0.5]), np.array([1.0, 0.2, -0.7])
    here = analyse(base, [Output("y", factor * u, v, "1", 1.0)], [[phi1, phi2]], second=True)
    back = analyse(Chain(base.elements[::-1]), [Output("y", v, u, "1", 1.0)], [[-phi2, -phi1]], second=True)
    near = {"rtol": 1e-10, "atol": 1e-13 * factor**2}
    np.testing.assert_allclose(here.variance, factor**2 * back.variance, **near)
    np.testing.assert_allclose(here.bias, factor * back.bias, rtol=1e-10, atol=1e-13 * factor)
    np.testing.assert_allclose(here.first_variance, factor**2 * back.first_variance[..., ::-1], **near)
    np.testing.assert_allclose(
        here.interaction_variance, factor**2 * back.interaction_variance[..., ::-1], **near
    )
    np.testing.assert_allclose(
        here.second_variance, factor**2 * back.second_variance[..., ::-1, ::-1], **near
    )


# edges


def test_offsets_have_no_part_in_what_attitude_reads():
    chain = table(uniform(0.1), errors={"d_eta": uniform(0.01)})
    found, without = (
        analyse(chain, OUTPUTS, SOMEWHERE, shapley=True),
        analyse(table(uniform(0.1)), OUTPUTS, SOMEWHERE),
    )
    place = chain.factors.index("d_eta")
    for part in (found.first_variance, found.interaction_variance, found.shapley):
        np.testing.assert_array_equal(part[..., place], 0.0)
    np.testing.assert_array_equal(np.delete(found.first_variance, place, axis=-1), without.first_variance)
    np.testing.assert_array_equal(found.variance, without.variance)


def test_an_output_that_does_not_vary_has_no_indices():
    """The z axis under a table that errs about z alone, also a tilted one; two points, whose cosine is a constant."""
    chain = few(dtheta_z=("uniform", 0.1))
    found = analyse(chain, [OF["az"]], SOMEWHERE, shapley=True, second=True)
    np.testing.assert_array_equal(found.variance, 0.0)
    for index in (found.first, found.total, found.shapley, found.second):
        assert np.all(np.isnan(index))
    axis = np.array([0.3, -1.2, 0.7])
    askew = Chain((Joint("phi", "x"), *about(axis, Error("e", "y", uniform(0.5), Scope.RIG))))
    found = analyse(askew, [Output("along", np.array([0.1, 0.2, 0.3]), axis, "1", 1.0)], [[0.4], [1.4]])
    np.testing.assert_array_equal(found.variance, 0.0)
    assert np.all(np.isnan(found.total))
    level = Chain((Error("tip", "y", two_point(0.2), Scope.RIG),))
    found = analyse(level, [OF["az"]], np.zeros((1, 0)))
    assert found.variance[0, 0] == 0.0
    assert found.bias[0, 0] == pytest.approx(GRAVITY * (1.0 - np.cos(0.2)), rel=1e-14)


def test_a_rig_without_errors_or_positions_has_empty_results():
    chain = Chain((Joint("phi", "x"),))
    found = analyse(chain, OUTPUTS, np.zeros((4, 1)), shapley=True, second=True)
    assert found.first.shape == (5, 4, 0)
    np.testing.assert_array_equal(found.variance, 0.0)
    assert analyse(WIDE, OUTPUTS, np.zeros((0, 2)), shapley=True).shapley.shape == (5, 0, 6)


@pytest.mark.parametrize("angles", [[0.1, 0.2], [[0.1]], [[0.1, 0.2, 0.3]], [[np.nan, 0.0]]])
def test_angles_that_do_not_fit_are_refused(angles):
    with pytest.raises(ValueError, match="found an"):
        analyse(WIDE, OUTPUTS, angles)


def test_unknown_factors_and_no_threads_are_refused():
    with pytest.raises(KeyError, match="d_nothing"):
        closed_variance(WIDE, OUTPUTS, SOMEWHERE, ["d_nothing"])
    with pytest.raises(ValueError, match="0 threads"):
        analyse(WIDE, OUTPUTS, SOMEWHERE, threads=0)
