"""Errors of the rig that no state has, and that nobody states, are in u as far as the recording leaves them; records by
a simulator that shares no code."""

import numpy as np
import pytest
from independent import selfcal as platform
from independent.selfcal import THREE, TRUTH, Drive, Faults, G

import inercal as ic
from inercal.foundation.findings import Status

pytestmark = pytest.mark.slow

KINDS = '"k2", "levers", "harmonics", "scale_asymmetry", "g_sensitivity", "sag"'


def calibrated(folder, faults=Faults(), more="", seed=20261125):  # noqa: B008  (frozen)
    (folder / "study.toml").write_text(platform.study(more=more))
    made = platform.simulated(np.random.default_rng(seed), Drive(THREE, ramp=0.4), faults=faults)
    made.write(folder / "record.csv", ("temperature",))
    return ic.calibrate(ic.read(folder / "record.csv"), folder / "study.toml").estimate


def codes(estimate):
    return {each.code for each in estimate.findings}


@pytest.fixture(scope="module")
def sound(tmp_path_factory):
    """A rig without errors, by the default and by the paper's model."""
    folder = tmp_path_factory.mktemp("sound")
    return calibrated(folder), calibrated(folder, more='[model]\nstates = "paper"\n')


def test_values_of_a_sound_rig_stay_and_are_ok(sound):
    own, paper = sound
    assert {own.status, paper.status} == {Status.OK}
    assert np.abs((own.values[:18] - TRUTH) / own.u[:18]).max() < 3.5


def test_it_is_told_and_is_a_line_of_the_budget(sound):
    own, paper = sound
    (said,) = (each for each in own.findings if each.code == "considered")
    assert not said.harm
    (square,) = (item for item in said.items if item["error"].startswith("K2_"))
    assert (square["unit"], square["usual"]) == ("ug/g^2", pytest.approx(20.0))
    assert 0.0 < square["left"] < 20.0
    (line,) = (each for each in own.budget if each.source == "errors of the rig that are not fitted")
    by_filter = np.array([own.result["bounds"][name] for name in own.names])
    shares = np.array([line.share[name] for name in own.names])
    # the bound is what the filter knows by itself, within 1 %; site and base are exact but for nothing
    np.testing.assert_allclose(own.u * np.sqrt(1.0 - shares), by_filter, rtol=0.05)
    assert "considered" not in codes(paper)
    np.testing.assert_allclose(paper.u, [paper.result["bounds"][name] for name in paper.names], rtol=0.02)


def test_an_error_of_any_size_is_in_u(tmp_path):
    """K2 along all axes, too small to be named and large: within 3.5 u, while by the u of the filter alone it shifts a
    coefficient by more than that. A value that is named may not be used, yet its u is no untruth."""
    for size in (2e-6, 20e-6):
        found = calibrated(tmp_path, Faults(k2=size / G * np.array([1.0, -1.0, 1.0])))
        off = np.abs(found.values[:18] - TRUTH)
        assert (off / found.u[:18]).max() < 3.5
        assert (off / [found.result["bounds"][name] for name in found.names[:18]]).max() > 3.5
    assert found.status is not Status.OK


def test_u_is_at_most_that_of_a_fit_with_all_of_them(sound, tmp_path):
    """As a state, each is as large as its prior says; here as large as the recording leaves it."""
    all_of_them = f'[model]\nstates = ["rig", {KINDS}, "bias_walk"]\n'
    fitted = calibrated(tmp_path, more=all_of_them)
    assert "considered" not in codes(fitted)
    assert np.all(sound[0].u[:18] < fitted.u[:18])


def test_what_is_stated_is_no_longer_considered(tmp_path):
    stated = '[model]\nk2 = "0(1) ug/g^2"\nlevers = "0(1) mm"\n'
    found = calibrated(tmp_path, more=stated)
    (said,) = (each for each in found.findings if each.code == "considered")
    errors = " ".join(item["error"] for item in said.items)
    assert errors
    assert "K2" not in errors
    assert "r_zz" not in errors
