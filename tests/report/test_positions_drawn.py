"""Positions drawn: areas on the sphere are areas on the page, and every position is there."""

from itertools import pairwise

import numpy as np
import pytest

from inercal.faces.report.sphere import flat


def test_equal_areas_on_the_sphere_are_equal_on_the_disc():
    height = np.linspace(0.0, 1.0, 11)
    up = np.stack([np.sqrt(1.0 - height**2), np.zeros(11), height], axis=-1)
    radius2 = flat(up)[0] ** 2
    assert radius2[0] == 1.0
    assert all(a - b == pytest.approx(0.1) for a, b in pairwise(radius2))
    assert np.array_equal(flat(up)[0], flat(-up)[0] * -1.0)
