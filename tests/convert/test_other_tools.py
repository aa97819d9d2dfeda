"""Calibrations to and from other tools: the uncertainty goes along, what is lost is said, and files are used."""

import json
from dataclasses import replace

import numpy as np
import pytest
from instruments_drawn import assert_same_corrections, estimate_of, instrument

from inercal.faces.convert.convention import flat, in_si_outputs
from inercal.faces.convert.correct import imu_model
from inercal.faces.convert.other_tools import CONVENTIONS, from_tool, to_tool
from inercal.foundation.errors import InputError
from inercal.foundation.findings import Finding
from inercal.foundation.results.files import load, save


@pytest.mark.parametrize("name", CONVENTIONS)
def test_the_covariance_is_that_of_many_instruments_drawn(name):
    """Monte Carlo over the coefficients: the spread of each term, and of random sums of them, within 5 sigma."""
    rng = np.random.default_rng(11)
    estimate = estimate_of(instrument(11, sensitive=name != "imu_tk"), rng)
    converted = to_tool(estimate, name).estimate
    convention, n = CONVENTIONS[name], 2000

    def terms_at(x):
        model = imu_model(replace(estimate, values=x))
        names, values = flat(convention.terms(in_si_outputs(model) if convention.si else model))
        return dict(zip(names, values, strict=True))

    base = terms_at(estimate.values)
    assert [base[each] for each in converted.names] == converted.values.tolist()
    noise = rng.multivariate_normal(np.zeros(len(estimate.names)), estimate.correlation, n, method="eigh")
    drawn = estimate.values + noise * estimate.u
    sample = np.array([[found[each] for each in converted.names] for found in map(terms_at, drawn)])
    sample = (sample - converted.values) / converted.u  # terms of very different size
    correlation = converted.correlation
    for weights in np.vstack([np.eye(len(converted.names)), rng.standard_normal((40, len(converted.names)))]):
        expected = weights @ correlation @ weights
        assert np.mean((sample @ weights) ** 2) / expected == pytest.approx(1.0, abs=5 * np.sqrt(2 / n))


@pytest.mark.parametrize("name", CONVENTIONS)
def test_what_is_the_same_for_every_instrument_is_no_parameter_and_the_rest_has_a_u(name):
    rng = np.random.default_rng(12)
    converted = to_tool(estimate_of(instrument(12, sensitive=name != "imu_tk"), rng), name).estimate
    assert np.all(converted.u > 0)
    counts = {"imu_tk": 21, "imucal": 35, "kalibr": 45, "psins": 33}
    assert len(converted.names) == counts[name]
    assert all(unit for unit in converted.units)
    assert np.all(converted.dof == 20.0)


def test_degrees_of_freedom_are_the_fewest_of_what_a_term_is_made_of():
    estimate = estimate_of(instrument(13, sensitive=False), np.random.default_rng(13))
    gyro = np.array([name.startswith(("S", "T", "D")) for name in estimate.names])
    converted = to_tool(replace(estimate, dof=np.where(gyro, 7.0, 30.0)), "imu_tk").estimate
    assert {name[2]: dof for name, dof in zip(converted.names, converted.dof, strict=True)} == {
        "a": 30.0,
        "g": 7.0,
    }


def test_what_comes_from_elsewhere_goes_along_as_a_part_of_the_covariance():
    estimate = estimate_of(instrument(18, sensitive=False), np.random.default_rng(18))
    converted = to_tool(replace(estimate, common=estimate.covariance / 4), "imu_tk").estimate
    np.testing.assert_allclose(converted.common, converted.covariance / 4, rtol=1e-12)


def test_a_coefficient_for_which_there_is_no_place_is_named():
    estimate = estimate_of(instrument(14, sensitive=False), np.random.default_rng(14))
    p = len(estimate.names)
    covariance = np.zeros((p + 1, p + 1))
    covariance[:p, :p] = estimate.covariance
    ramp = replace(
        estimate,
        names=(*estimate.names, "D_R_x"),
        units=(*estimate.units, "count/s"),
        values=np.append(estimate.values, 0.01),
        covariance=covariance,
        dof=np.append(estimate.dof, 5.0),
    )
    found = to_tool(ramp, "imu_tk").estimate.findings
    assert Finding("not_held", "imu_tk has no place for D_R_x: left out") in found


def test_g_sensitivity_is_left_out_of_imu_tk_with_its_size():
    """What the largest G does at 9.80665 m/s^2, in the gyro's unit: more than that no rate is off."""
    model = instrument(16, sensitive=True)
    converted = to_tool(estimate_of(model, np.random.default_rng(16)), "imu_tk").estimate
    (text,) = (f.message for f in converted.findings if f.code == "not_held")
    assert "G_xx, G_xy" in text
    largest = np.max(np.abs(model.g_sensitivity)) * 9.80665
    assert f"(G is up to {largest:.2g} {model.units['gyro']} at 1 g)" in text


def test_outputs_in_g_are_converted_for_tools_that_know_only_si_units_and_counts_stay():
    model = replace(instrument(15), units={"acc": "g", "gyro": "count"})
    texts = to_tool(estimate_of(model, np.random.default_rng(15)), "kalibr").texts
    assert texts[""].startswith("# outputs: acc [m/s^2], gyro [count]\n")


@pytest.mark.parametrize("suffix", [".json", ".toml"])
@pytest.mark.parametrize("name", CONVENTIONS)
def test_a_calibration_that_came_from_a_tool_is_saved_loaded_and_used(tmp_path, name, suffix):
    model = instrument(16, sensitive=name != "imu_tk")
    texts = to_tool(estimate_of(model, np.random.default_rng(16)), name).texts
    paths = [tmp_path / f"cal{end}" for end in texts]
    for path, text in zip(paths, texts.values(), strict=True):
        path.write_text(text)
    estimate = from_tool(paths, name)
    assert np.isnan(estimate.covariance).all()
    assert "not_stated" in {finding.code for finding in estimate.findings}
    save(estimate, tmp_path / f"cal{suffix}")
    again = load(tmp_path / f"cal{suffix}")
    assert np.isnan(again.covariance).all()
    assert again.values.tolist() == estimate.values.tolist()
    if suffix == ".json":
        assert json.loads((tmp_path / "cal.json").read_text())["parameters"][0]["u"] is None
    assert_same_corrections(model, imu_model(again), 16)


def test_a_unit_that_is_given_and_stated_otherwise_is_an_error(tmp_path):
    texts = to_tool(estimate_of(instrument(17), np.random.default_rng(17)), "psins").texts
    (tmp_path / "cal.m").write_text(texts[""])
    with pytest.raises(InputError, match=r"^--acc-unit: found (mg|m/s\^2), but the file states"):
        from_tool([tmp_path / "cal.m"], "psins", {"acc": "mg"})


@pytest.mark.parametrize("name", ["imucal", "kalibr", "psins"])
def test_two_files_are_one_too_many(tmp_path, name):
    (tmp_path / "a").write_text("x")
    with pytest.raises(InputError, match=rf"^{name}: found 2 files, expected one"):
        from_tool([tmp_path / "a"] * 2, name)


def test_a_file_that_is_missing_or_no_text_is_said(tmp_path):
    with pytest.raises(InputError, match=r"no\.json: cannot be read"):
        from_tool([tmp_path / "no.json"], "imucal")
    (tmp_path / "bytes.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"bytes\.json: byte 0 is not UTF-8 text"):
        from_tool([tmp_path / "bytes.json"], "imucal")
