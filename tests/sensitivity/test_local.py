"""Local sensitivity, against the exact analysis: where it serves, and where it does not."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from inercal.foundation.rigs.chain import Chain, Error, Joint, Scope
from inercal.foundation.rigs.outputs import table_outputs
from inercal.foundation.rigs.patterns import density, uniform
from inercal.foundation.rigs.plans import grid
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.sensitivities import exact, local

LAW = uniform(np.radians(2.0 / 60.0))
TABLE = turntable("two_axis_turntable", LAW)
OUTPUTS = table_outputs(("ax", "ay", "az", "wx", "wy"), 9.8, np.radians(40.0))


def gap(angles, outputs=OUTPUTS):
    """Largest difference (o, n) between local and exact first-order indices over the factors."""
    difference = local.analyse(TABLE, outputs, angles).first - exact.analyse(TABLE, outputs, angles).first
    return np.abs(difference).max(axis=-1)


def test_variances_are_squared_derivatives():
    """By central differences of the outputs, error 1e-8 of their size."""
    angles, step = grid((4, 6)).angles, 1e-4
    found = local.analyse(TABLE, OUTPUTS, angles)
    for o, output in enumerate(OUTPUTS):
        for k in range(len(TABLE.factors)):
            errors = step * np.eye(len(TABLE.factors))[k]
            ends = output.value(TABLE.attitude(angles, errors)) - output.value(
                TABLE.attitude(angles, -errors)
            )
            expected = ends / (2.0 * step) * LAW.std
            assert_allclose(
                np.sqrt(found.first_variance[o, :, k]), np.abs(expected), atol=1e-8 * LAW.std * output.scale
            )
    assert_allclose(found.first.sum(axis=-1), 1.0, rtol=1e-14)
    assert_array_equal(found.total, found.first)
    assert found.method == {"name": "local"}


def test_arc_minutes_act_linearly_away_from_singular_attitudes():
    """Zhao et al. call a local analysis unreliable; at ±2 arcmin the median gap to the exact one is 1e-7."""
    gaps = gap(grid((36, 36)).angles)
    assert 3e-8 < np.median(gaps) < 3e-7
    assert gaps.max() < 1e-4


@pytest.mark.parametrize(
    ("output", "at", "limit"),
    [
        # phi1 = 0: local share of dphi_y1 1/4, exact 0.8 / 54.4
        ("az", (1e-6, 0.3), 1.0 / 4.0 - 1.0 / 68.0),
        # phi1 = 90, phi2 = 0: 7 errors; local share of dphi_z2 1/3, exact 0.8 / 41.6
        ("ax", (0.5 * np.pi, 1e-6), 1.0 / 3.0 - 1.0 / 52.0),
        ("ay", (0.5 * np.pi, 0.5 * np.pi + 1e-6), 1.0 / 3.0 - 1.0 / 52.0),
    ],
)
def test_next_to_a_singular_attitude_it_misleads(output, at, limit):
    """There the derivatives are almost zero, but have well defined ratios.

    The output is g (X^2 + Y^2) / 2 with X and Y sums of m and n equal errors, kurtosis 9/5: each error has the
    variance 0.8 s^4 alone, and all 2 m^2 + 2 n^2 - 1.2 (m + n): 54.4 (m = n = 4), or 41.6 (4 and 3), times s^4.
    """
    found = gap([at], [each for each in OUTPUTS if each.name == output])
    assert found[0, 0] == pytest.approx(limit, rel=1e-4)


def test_at_a_singular_attitude_it_has_nothing_to_say():
    found = local.analyse(TABLE, OUTPUTS, [[0.0, 0.3], [np.pi, 0.3]])
    assert np.isnan(found.first[2]).all()
    assert np.isfinite(found.first[[0, 1, 3, 4]]).all()


def test_the_bias_is_that_of_mean_errors():
    """An error between 0 and 0.002 about x tilts gravity into -y by its mean, up to the square of the error."""
    law = density(lambda x: np.ones_like(x), 0.0, 0.002)
    chain = Chain((Joint("phi", "y"), Error("tilt", "x", law, Scope.RIG)))
    found = local.analyse(chain, OUTPUTS[:3], [[0.0]])
    truth = exact.analyse(chain, OUTPUTS[:3], [[0.0]])
    assert_allclose(found.bias[:, 0], [0.0, -9.8 * 0.001, 0.0], atol=1e-15)
    assert_allclose(found.bias, truth.bias, atol=9.8 * 0.002**2)
    assert_array_equal(local.analyse(TABLE, OUTPUTS, [[0.5, 0.3]]).bias, 0.0)


def test_offsets_have_no_share():
    table = turntable("two_axis_turntable", LAW, {"d_eta": uniform(1e-3)})
    found = local.analyse(table, OUTPUTS, [[0.4, 1.0]])
    assert_array_equal(found.first[..., table.factors.index("d_eta")], 0.0)
