"""Where a calibration on a turntable has no terms to give it says why, instead of giving some."""

from dataclasses import replace

import numpy as np
import pytest
from turntable_studies import ARCMIN, DEG_H, study, table

from inercal.foundation.findings import Status
from inercal.foundation.instruments.by_angle import channel_model
from inercal.foundation.rigs.patterns import uniform
from inercal.foundation.rigs.plans import grid, listed
from inercal.foundation.rigs.tables import turntable
from inercal.systems.turntable.model import table_model
from inercal.systems.turntable.positions.planning import design
from inercal.systems.turntable.regression import fit
from inercal.systems.turntable.settings import PositionDesign
from inercal.systems.turntable.task import calibrate, simulate

NOISE = 0.01 * DEG_H


def test_terms_relative_to_an_output_of_zero_are_unknown():
    """Misalignments are over the scale factor: a gyro whose output stays 0 has none, and nothing is divided."""
    settings = study(kind="gyro", unit="deg/s", coefficients={"S_x": 1.0, "S_y": 1.0, "S_z": 1.0}, noise=1e-9)
    made = simulate(settings, np.random.default_rng(1))
    columns = {
        name: replace(each, values=np.zeros_like(each.values)) if name.startswith("gyro") else each
        for name, each in made.columns.items()
    }
    found = calibrate(replace(made, columns=columns), settings).estimate
    assert found.status is Status.UNOBSERVABLE
    assert "relative to a scale factor that is found as 0" in found.message
    assert not len(found.names)


def test_the_slope_of_a_relative_term_goes_to_infinity_as_the_scale_factor_goes_to_zero():
    """m = c / S: dm/dc = 1/S and dm/dS = -c / S^2."""
    model = channel_model("accelerometer", "acc_x").without(["K2_x", "K3_x"])
    c = np.full(len(model.symbols), 1e-3)
    lead = model.symbols.index(model.leading)
    relative = np.array([symbol in model.relative for symbol in model.symbols])
    for scale in (1.0, -1e-3, 1e-100):
        c[lead] = scale
        values, slope = model.terms(c)
        np.testing.assert_allclose(values[relative], 1e-3 / scale, rtol=1e-14)
        np.testing.assert_allclose(np.diag(slope)[relative], 1.0 / scale, rtol=1e-14)
        np.testing.assert_allclose(slope[relative, lead], -1e-3 / scale**2, rtol=1e-14)
    c[lead] = 0.0
    with np.errstate(divide="ignore", invalid="ignore"):
        assert np.isinf(np.diag(model.terms(c)[1])[relative]).all()


def test_weights_that_sink_with_the_terms_do_not_settle():
    """Errors of the table are multiplied by the terms. A term that only the rounding of sin 180 deg excites, by 1e-32,
    comes out as 1e32 times the readings; with it their weights sink, and each round finds a larger one."""
    angles = np.radians([[a, b] for a in (0.0, 180.0) for b in (0.0, 120.0, 240.0)])
    posed = study(listed(angles), table(3000.0 * ARCMIN), terms=("DX_F", "DY_XX"))
    wanted = {"y_x": ("DX_F",), "y_y": ("DY_XX",)}
    left_out = [
        s for name, kept in wanted.items() for s in channel_model("gyrowheel", name).symbols if s not in kept
    ]
    model = table_model(posed, ("y_x", "y_y"), left_out)
    assert 0.0 < np.abs(model.rows(angles)[:, 1, 1]).max() < 1e-30
    y = np.random.default_rng(4).normal(size=(6, 2))
    with pytest.raises(np.linalg.LinAlgError, match="do not settle"):
        fit(model, angles, y, [NOISE, NOISE])


def test_noise_that_drowns_in_one_error_of_the_table_stops_no_design():
    """One error that moves both outputs at once leaves them a covariance of rank one but for the noise, which is taken
    for a millionth of it at least; where the error does not act, that is all there is."""
    wobbling = turntable("two_axis_turntable", None, {"dphi_y1": uniform(2.0 * ARCMIN)})
    posed = study(chain=wobbling, noise=1e-13 * DEG_H, terms=("DX_F", "DY_F"))
    made = design(replace(posed, design=PositionDesign(grid((6, 6)), positions=4)))
    assert made.compare[0].figures.rank == made.compare[0].terms == 1
    assert np.all(made.compare[0].figures.u < 1e-6 * DEG_H)
