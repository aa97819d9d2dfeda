"""What people see of a calibration: the same numbers, in the units in which a study takes them."""

from dataclasses import replace

import numpy as np
import pytest

from inercal.faces.studies.turntable import turntable_study
from inercal.foundation.findings import Status
from inercal.foundation.instruments.by_angle import CHANNELS, channel_model
from inercal.foundation.results.budget import BudgetItem
from inercal.foundation.results.result import Estimate
from inercal.foundation.units import parse_unit
from inercal.systems.turntable.display import displayed, tolerances
from inercal.systems.turntable.positions.outcome import unit_of_term


def estimate(names, output, values):
    """An estimate of these terms, for outputs in that SI unit."""
    u = 0.1 * values
    return Estimate(
        command="calibrate turntable",
        names=names,
        units=tuple(unit_of_term(name, output) for name in names),
        values=values,
        covariance=np.diag(u**2),
        dof=np.full(len(names), np.inf),
        status=Status.OK,
        message="",
        budget=tuple(
            BudgetItem(source, "B", 1e-4, unit, {})
            for source, unit in (
                ("noise", output),
                ("deps_x", "rad"),
                ("gravity", "m/s^2"),
                ("K2", "1/(m/s^2)"),
            )
        ),
    )


@pytest.mark.parametrize(
    ("kind", "unit"), [("accelerometer", "m/s^2"), ("accelerometer", "g"), ("gyrowheel", "deg/h")]
)
def test_what_is_shown_may_be_typed_back_into_a_study(kind, unit):
    """Text of value and unit, read as a stated coefficient, is the value in SI again; drift is per unit g there."""
    names = tuple(s for channel in CHANNELS[kind] for s in channel_model(kind, channel).symbols)
    values = np.random.default_rng(5).uniform(1e-6, 2e-6, len(names))
    site = {"site": {"gravity_m_s2": 9.78, "latitude_rad": 0.0}}
    made = replace(estimate(names, parse_unit(unit).si, values), conditions=site)
    seen = displayed(made, parse_unit(unit))
    typed = {p.name: f"{p.value:.12f} {p.unit}".removesuffix(" 1") for p in seen.parameters.values()}
    study = {
        "site": {"latitude": "0 deg", "gravity": "9.78 m/s^2"},
        "rig": {"kind": "two_axis_turntable"},
        "instrument": {"kind": kind, "unit": unit, "coefficients": typed},
    }
    read = turntable_study(study, "study.toml").instrument.coefficients
    np.testing.assert_allclose([read[name] for name in names], values, rtol=1e-5)
    np.testing.assert_allclose(seen.u, 0.1 * seen.values)


@pytest.mark.parametrize("unit", ["m/s^2", "g"])
def test_an_accelerometer_is_shown_in_the_units_of_the_field(unit):
    """100 ug, 20 arcsec, 5 ug/g^2 and 3 ug/g^3, by g = 9.80665 m/s^2 and 1 rad = 206264.8 arcsec."""
    g = 9.80665
    si = np.array([100e-6 * g, 1.0002, 20.0 / 206264.806, 5e-6 / g, 3e-6 / g**2, 2e-6 / g])
    names = ("K0_x", "K1_x", "M_xy", "K2_x", "K3_x", "Kip_x")
    seen = displayed(estimate(names, "m/s^2", si), parse_unit(unit))
    assert seen.units == ("ug", "1", "arcsec", "ug/g^2", "ug/g^3", "ug/g^2")
    np.testing.assert_allclose(seen.values, [100.0, 1.0002, 20.0, 5.0, 3.0, 2.0], rtol=1e-8)
    assert [item.unit for item in seen.budget] == ["ug", "arcsec", "ug", "ug/g^2"]


def test_counts_stay_counts_and_other_units_of_acceleration_are_those_of_the_record():
    names, values = ("K0_x", "K1_x", "M_xy"), np.array([10.0, 3.0, 1e-4])
    seen = displayed(estimate(names, "count", values), parse_unit("count"))
    assert seen.units == ("count", "count/(m/s^2)", "arcsec")
    assert seen.values[:2].tolist() == [10.0, 3.0]
    assert displayed(estimate(names, "m/s^2", values), parse_unit("mg")).units[0] == "mg"


def test_the_tolerance_to_tighten_is_named_for_each_coefficient():
    """Of two errors the one with the larger share, and what halving that one would bring."""
    shares = {"DX_F": {"deps_x": 0.2, "dtheta_z": 0.8}, "DX_X": {}}
    halved = {"deps_x": {"DX_F": 0.95, "DX_X": 1.0}, "dtheta_z": {"DX_F": 0.63, "DX_X": 1.0}}
    made = estimate(("DX_F", "DX_X"), "rad/s", np.array([1.0, 2.0]))
    text = tolerances(replace(made, result={"tolerance_shares": shares, "halved": halved}))
    assert text.splitlines()[1].split() == ["DX_F", "dtheta_z", "80", "%", "0.63"]
    assert len(text.splitlines()) == 2
    assert tolerances(made) == ""
