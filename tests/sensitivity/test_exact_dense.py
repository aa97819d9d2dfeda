"""The exact analysis of larger matrices: offsets, and outputs quadratic in the references."""

import numpy as np
import pytest
from high_precision import KINDS

from inercal.foundation.geometry.rotations import elementary
from inercal.foundation.rigs.chain import Chain, Error, Fixed, Joint, Scope
from inercal.foundation.rigs.outputs import Output, gravity_reference, rate_reference
from inercal.foundation.rigs.patterns import density, normal, two_point, uniform
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.sensitivities import dense

ANGLES = np.array([[0.3, 1.1], [np.pi / 2, 0.0], [2.0, -0.4]])


def wide(**more):
    errors = {
        "dphi_y1": uniform(0.6),
        "dalpha_x1": KINDS["ramp"](0.8),
        "deps_y": normal(0.3),
        "dphi_z2": KINDS["triangular"](0.9),
        "dtheta_z": two_point(0.5),
    }
    return turntable("two_axis_turntable", None, errors=errors | more).with_scope(Scope.POSITION)


def check(samples, exact):
    """Samples (runs, n) whose means are to be the exact values, within 5 standard errors."""
    error = samples.std(axis=0) / np.sqrt(len(samples))
    assert np.all(np.abs(samples.mean(axis=0) - exact) <= 5.0 * error)


def check_by_monte_carlo(chain, angles, value, found, rng, runs=20_000):
    """Pick and freeze: ``value`` of errors (runs, k) at the positions, (runs, n)."""
    (k,) = np.shape(chain.factors)
    ideal = value(np.zeros((1, k)))
    A, B = (chain.draw(rng, runs) for _ in range(2))
    y_a, y_b = value(A) - ideal, value(B) - ideal
    check(y_a, found.bias[0])
    check((y_a - found.bias[0]) ** 2, found.variance[0])
    for i in range(k):
        mixed = A.copy()
        mixed[:, i] = B[:, i]
        y = value(mixed) - ideal
        check((y_b - found.bias[0]) * (y - y_a), found.first_variance[0, :, i])
        check(0.5 * (y_a - y) ** 2, (found.first_variance + found.interaction_variance)[0, :, i])


def test_a_point_on_a_rig_with_offsets():
    """Height of a point 0.4 m out on an arm, with an axis that misses the other one by an uncertain amount."""
    chain = wide(d_eta=density(lambda x: 1.0 + 10.0 * x, 0.0, 0.1))
    chain = Chain((*chain.elements, Fixed(elementary("x", 0.3), np.array([0.4, 0.0, -0.1]))))
    assert any(error.is_offset for error in chain.errors)
    output = Output("height", np.array([0.0, 0.0, 1.0, 0.0]), np.array([0.2, 0.1, 0.0, 1.0]), "m", 1.0)
    found = dense.analyse(dense.homogeneous(chain, ANGLES), [output], shapley=True)
    np.testing.assert_allclose(found.shapley.sum(axis=-1), 1.0, rtol=1e-13)

    def value(errors):
        return chain.pose(ANGLES, errors[:, None, :])[..., 2, :] @ output.axis

    check_by_monte_carlo(chain, ANGLES, value, found, np.random.default_rng(31))


def test_an_offset_alone_moves_by_its_own_variance():
    """An arm that turns in a plane: sin^2 of its angle times the variance of its length; nothing else."""
    chain = Chain((Joint("phi", "y"), Error("d", "x", uniform(1e-3), Scope.RIG, is_offset=True)))
    angles = np.linspace(-3.0, 3.0, 7)[:, None]
    output = Output("height", np.array([0.0, 0.0, 1.0, 0.0]), np.array([0.0, 0.0, 0.0, 1.0]), "m", 1.0)
    found = dense.analyse(dense.homogeneous(chain, angles), [output])
    expected = 1e-6 / 3.0 * np.sin(angles[:, 0]) ** 2
    np.testing.assert_allclose(found.first_variance[0, :, 0], expected, rtol=1e-13)
    np.testing.assert_allclose(found.variance[0], expected, rtol=1e-13)
    np.testing.assert_array_equal(found.interaction_variance, 0.0)


def test_a_gyro_with_all_its_terms():
    """Scale factor on earth rate, drift, and all that is linear and quadratic in gravity, in one output."""
    chain = wide()
    rng = np.random.default_rng(7)
    w, a = rate_reference(0.7), gravity_reference()
    k, D, Q = 1e4 * rng.normal(size=3), rng.normal(size=3), rng.normal(size=(3, 3))
    bias = 3.0
    reference, axis = np.concatenate([[1.0], w, a, np.kron(a, a)]), np.concatenate([[bias], k, D, Q.ravel()])
    output = Output("drift", reference, axis, "deg/h", 1.0)
    chain_of_blocks = dense.blocks(chain, ANGLES, (0, 1, 1, 2))
    found = dense.analyse(chain_of_blocks, [output], shapley=True, second=True)

    def value(errors):
        R = chain.attitude(ANGLES, errors[:, None, :])
        rate, gravity = w @ R, a @ R
        return bias + rate @ k + gravity @ D + np.einsum("...i,ij,...j", gravity, Q, gravity)

    check_by_monte_carlo(chain, ANGLES, value, found, np.random.default_rng(32))
    total = found.first_variance + found.interaction_variance
    for i, name in enumerate(chain.factors):
        others = dense.closed_variance(chain_of_blocks, [output], [n for n in chain.factors if n != name])
        np.testing.assert_allclose(total[..., i], found.variance - others, rtol=1e-11)
        for j, other in enumerate(chain.factors):
            pair = dense.closed_variance(chain_of_blocks, [output], [name, other])
            pair = (pair - found.first_variance[..., i] - found.first_variance[..., j]) * (i != j)
            np.testing.assert_allclose(
                found.second_variance[..., i, j], pair, rtol=1e-10, atol=1e-13 * found.variance.max()
            )


@pytest.mark.parametrize("size", [1e-5, 0.5])
def test_a_square_of_one_sine_in_closed_form(size):
    """ax^2 under one error about y: (sin(phi + d))^2 = (1 - cos 2(phi + d))/2, whose variance is known."""
    chain = Chain((Joint("phi", "y"), Error("d", "y", uniform(size), Scope.RIG)))
    phi = np.array([0.0, 0.4, np.pi / 2])
    up = np.array([0.0, 0.0, 1.0])
    output = Output("square", np.kron(up, up), np.kron(np.eye(3)[0], np.eye(3)[0]), "1", 1.0)
    found = dense.analyse(dense.blocks(chain, phi[:, None], (2,)), [output])
    import mpmath as mp

    with mp.workdps(60):
        h = mp.mpf(size)
        mean, second = mp.sin(2 * h) / (2 * h), (1 + mp.sin(4 * h) / (4 * h)) / 2  # of cos 2d, and its square
        of_cos, of_sin = second - mean**2, 1 - second
        for n, angle in enumerate(phi):
            c, s = mp.cos(2 * mp.mpf(angle)), mp.sin(2 * mp.mpf(angle))
            assert abs(found.variance[0, n] / ((c**2 * of_cos + s**2 * of_sin) / 4) - 1) < 1e-12
            assert abs(found.bias[0, n] / (c * (1 - mean) / 2) - 1) < 1e-12
    np.testing.assert_array_equal(found.interaction_variance, 0.0)


def test_the_length_of_a_reference_is_no_output():
    """a . a is the same on any rig: no variance at all, and so no indices."""
    chain, a = wide(), gravity_reference()
    output = Output("length", np.kron(a, a), np.eye(3).ravel(), "1", 1.0)
    found = dense.analyse(dense.blocks(chain, ANGLES, (2,)), [output])
    np.testing.assert_array_equal(found.variance, 0.0)
    assert np.all(np.isnan(found.first))
    assert np.all(np.abs(found.bias) < 1e-15)


def test_an_output_of_another_size_is_refused():
    output = Output("ax", gravity_reference(), np.eye(3)[0], "m/s^2", 9.8)
    with pytest.raises(ValueError, match=r"expected \(9,\) of both"):
        dense.analyse(dense.blocks(wide(), ANGLES, (2,)), [output])
