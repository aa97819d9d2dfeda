"""Tables as chains, against products of elementary rotations written out by hand."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from inercal.foundation.geometry.rotations import elementary
from inercal.foundation.rigs.chain import Scope
from inercal.foundation.rigs.patterns import normal, uniform
from inercal.foundation.rigs.tables import TABLES, slots, turntable

LAW = uniform(np.radians(2.0 / 60.0))
TWO = (
    *("dphi_y1", "dalpha_x1", "dalpha_z1", "deps_x", "deps_y"),
    *("dphi_z2", "dalpha_x2", "dalpha_y2", "dtheta_x", "dtheta_y", "dtheta_z"),
)


def product(text, values):
    """``"y:phi1 x:deps_x"``: elementary rotations in this order, with plain matrices."""
    C = np.eye(3)
    for part in text.split():
        axis, name = part.split(":")
        c, s = np.cos(values[name]), np.sin(values[name])
        C = (
            C
            @ {
                "x": np.array([[1, 0, 0], [0, c, -s], [0, s, c]]),
                "y": np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]]),
                "z": np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]),
            }[axis]
        )
    return C


def drawn(chain, seed):
    """Large angles and errors, so that a wrong order would show."""
    rng = np.random.default_rng(seed)
    angles, errors = rng.uniform(-3.0, 3.0, len(chain.joints)), rng.uniform(-1.0, 1.0, len(chain.factors))
    values = dict(zip((*chain.joints, *chain.factors), (*angles, *errors), strict=True))
    return angles, errors, values


def test_the_two_axis_table_of_zhao_et_al():
    chain = turntable("two_axis_turntable", LAW)
    assert chain.joints == ("phi1", "phi2")
    assert chain.factors == TWO
    angles, errors, values = drawn(chain, 1)
    expected = product(
        "y:phi1 y:dphi_y1 x:dalpha_x1 z:dalpha_z1 x:deps_x y:deps_y"
        " z:phi2 z:dphi_z2 x:dalpha_x2 y:dalpha_y2 x:dtheta_x y:dtheta_y z:dtheta_z",
        values,
    )
    assert_allclose(chain.attitude(angles, errors), expected, atol=1e-14)
    assert_allclose(chain.attitude(angles), product("y:phi1 z:phi2", values), atol=1e-14)


def test_the_three_axis_table():
    """Each axis has positioning and two wobbles, each pair of axes two fixed errors across the next axis."""
    chain = turntable("three_axis_turntable", LAW)
    assert chain.joints == ("phi1", "phi2", "phi3")
    angles, errors, values = drawn(chain, 2)
    expected = product(
        "z:phi1 z:dphi_z1 x:dalpha_x1 y:dalpha_y1 x:deps_x1 z:deps_z1"
        " y:phi2 y:dphi_y2 x:dalpha_x2 z:dalpha_z2 z:deps_z2 y:deps_y2"
        " x:phi3 x:dphi_x3 y:dalpha_y3 z:dalpha_z3 x:dtheta_x y:dtheta_y z:dtheta_z",
        values,
    )
    assert_allclose(chain.attitude(angles, errors), expected, atol=1e-14)
    assert_allclose(chain.attitude(angles), product("z:phi1 y:phi2 x:phi3", values), atol=1e-14)


def test_a_tilted_base_and_a_nominal_mounting():
    """Known attitudes at either end of the chain; gravity on the tilted base reads as the tilts say."""
    mounting = elementary("x", 0.4)
    base = (0.3, 0.02, -0.01)
    chain = turntable("two_axis_turntable", LAW, base=base, mounting=mounting)
    plain = turntable("two_axis_turntable", LAW)
    angles, errors, values = drawn(plain, 3)
    tilt = product("z:az x:n y:w", {"az": 0.3, "n": 0.02, "w": -0.01})
    assert_allclose(chain.attitude(angles), tilt @ plain.attitude(angles) @ mounting, atol=1e-14)
    own = errors * [name.startswith("dtheta") for name in TWO]
    expected = tilt @ plain.attitude(angles) @ mounting @ product("x:dtheta_x y:dtheta_y z:dtheta_z", values)
    assert_allclose(chain.attitude(angles, own), expected, atol=1e-14)
    down = np.array([0.0, 0.0, -1.0]) @ tilt
    assert_allclose(down[:2], [np.cos(0.02) * np.sin(-0.01), -np.sin(0.02)], atol=1e-15)


def test_errors_of_the_base_come_first():
    given = dict.fromkeys(("dbase_x", "dbase_y", "dbase_z"), normal(1e-4))
    chain = turntable("two_axis_turntable", LAW, given)
    assert chain.factors == ("dbase_z", "dbase_x", "dbase_y", *TWO)
    angles, errors, values = drawn(chain, 4)
    errors[3:] = 0.0
    expected = product("z:dbase_z x:dbase_x y:dbase_y y:phi1 z:phi2", values)
    assert_allclose(chain.attitude(angles, errors), expected, atol=1e-14)


def test_the_intersection_offset_moves_the_load_only():
    chain = turntable("two_axis_turntable", LAW, {"d_eta": uniform(1e-3)})
    plain = turntable("two_axis_turntable", LAW)
    errors = np.zeros(12)
    errors[chain.factors.index("d_eta")] = 1e-3
    angles = np.array([0.7, 1.9])
    pose = chain.pose(angles, errors)
    assert_allclose(pose[:3, :3], plain.attitude(angles), atol=1e-15)
    assert_allclose(pose[:3, 3], 1e-3 * elementary("y", 0.7)[:, 0], atol=1e-18)


def test_wobble_is_redrawn_and_mounting_is_not():
    """The usual scopes: positioning and wobble each position, mounting and axes constant."""
    for kind in TABLES:
        for slot in slots(kind):
            moves = slot.name.startswith(("dphi", "dalpha"))
            assert slot.scope.constant != moves, slot.name
            assert slot.what
    chain = turntable("two_axis_turntable", LAW, scopes={"dalpha_x1": Scope.RUN})
    assert chain.errors[1].scope is Scope.RUN


def test_errors_by_name_and_none_else():
    chain = turntable("two_axis_turntable", None, {"deps_x": normal(1e-5), "dphi_z2": LAW})
    assert chain.factors == ("deps_x", "dphi_z2")
    assert_array_equal(chain.std, [normal(1e-5).std, LAW.std])


@pytest.mark.parametrize("wrong", [{"errors": {"dphi_q": LAW}}, {"scopes": {"dphi_q": Scope.RUN}}])
def test_an_unknown_factor_is_refused(wrong):
    with pytest.raises(KeyError, match="dphi_q"):
        turntable("two_axis_turntable", LAW, **wrong)
    with pytest.raises(KeyError, match="dphi_y2"):
        turntable("two_axis_turntable", LAW, {"dphi_y2": LAW})
    with pytest.raises(KeyError, match="merry_go_round"):
        turntable("merry_go_round", LAW)
