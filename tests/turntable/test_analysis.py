"""The sensitivity task: what a study asks for comes out, as JSON, as a table and as maps."""

import json
import math

import numpy as np
import pytest
import xarray
from numpy.testing import assert_allclose

from inercal.faces.studies.turntable import turntable_study
from inercal.foundation.errors import StudyError
from inercal.foundation.results.files import plain_objects
from inercal.systems.turntable.sensitivity import analyse, result, table
from inercal.systems.turntable.sensitivity_maps import write_maps

FACTORS = [
    "dphi_y1", "dalpha_x1", "dalpha_z1", "deps_x", "deps_y", "dphi_z2",
    "dalpha_x2", "dalpha_y2", "dtheta_x", "dtheta_y", "dtheta_z",
]  # fmt: skip


def settings(**tables):
    """The paper's table, 2 arcmin each."""
    whole = {
        "site": {"latitude": "39.1 deg", "gravity": "9.8 m/s^2"},
        "rig": {"kind": "two_axis_turntable", "errors": {"default": {"uniform": "2 arcmin"}}},
    }
    return turntable_study(whole | tables, "study.toml")


@pytest.fixture(scope="module")
def paper():
    return analyse(settings(), maps=True)


@pytest.fixture(scope="module")
def at_zero():
    """Positions with singular attitudes: outer angles 0 and 180 deg, where az is of second order."""
    return analyse(settings(positions={"grid": {"phi1": 4, "phi2": 4, "offset": "none"}}), maps=True)


def test_means_over_the_full_circle_are_those_of_the_leading_order(paper):
    """The closed means over the 36 x 36 half-offset grid: 1/4 and 1/8 on az, .09409 and .16676 on ax."""
    found = result(paper)
    mean = np.array(found["mean"]["first"])
    of = {name: k for k, name in enumerate(found["factors"])}
    az, ax = found["outputs"].index("az"), found["outputs"].index("ax")
    assert_allclose(mean[az, [of["dphi_y1"], of["deps_y"]]], 0.25, atol=1e-5)
    assert_allclose(mean[az, [of["dtheta_x"], of["dalpha_y2"]]], 0.125, atol=1e-5)
    assert_allclose(mean[ax, [of["dphi_y1"], of["deps_y"]]], 0.09409, atol=1e-5)
    assert_allclose(mean[ax, [of["dalpha_y2"], of["dtheta_y"]]], 0.16676, atol=1e-5)


def test_the_result_has_the_keys_and_shapes_of_the_contract(paper):
    found = json.loads(json.dumps(plain_objects(result(paper)), allow_nan=False))
    assert found["factors"] == FACTORS
    assert found["outputs"] == ["ax", "ay", "az", "wx", "wy"]
    assert list(found["positions"]) == ["phi1", "phi2"]
    assert_allclose(found["positions"]["phi1"][:37], [math.radians(5.0)] * 36 + [math.radians(15.0)])
    for average in ("mean", "weighted"):
        for part in ("first", "total", "total_minus_first", "shapley"):
            assert np.shape(found[average][part]) == (5, 11)
    assert found["aggregate"]["outputs"] == found["outputs"]
    assert np.shape(found["aggregate"]["total"]) == (11,)
    assert found["flagged"] == []
    assert found["method"] == {"name": "exact"}


def test_shapley_effects_are_shares_that_sum_to_one_and_lie_between_first_and_total(at_zero):
    found = result(at_zero)
    for average in ("mean", "weighted"):
        shares = found[average]
        assert_allclose(np.sum(shares["shapley"], axis=1), 1.0, rtol=1e-12)
        assert (shares["shapley"] >= shares["first"] - 1e-15).all()
        assert (shares["shapley"] <= shares["total"] + 1e-15).all()


def test_the_aggregate_weighs_each_output_by_its_variance_over_its_reference(paper):
    """Sum over outputs of V_i / scale^2 over that of V / scale^2, with g and earth rate as scales."""
    indices = paper.indices
    scale = np.array([9.8] * 3 + [7.292115e-5] * 2)
    parts = np.einsum("onk,o->k", indices.first_variance, scale**-2)
    whole = np.einsum("on,o->", indices.variance, scale**-2)
    assert_allclose(result(paper)["aggregate"]["first"], parts / whole, rtol=1e-12)


def test_singular_attitudes_are_flagged_with_their_angles(at_zero):
    """At phi1 = 0 and 180 deg az has no first-order part; ax and ay are singular with the axis upright."""
    flags = result(at_zero)["flagged"]
    az = {
        (round(math.degrees(f["phi1"])), round(math.degrees(f["phi2"]))) for f in flags if f["output"] == "az"
    }
    assert az == {(phi1, phi2) for phi1 in (0, 180) for phi2 in (0, 90, 180, 270)}
    assert all(f["sum_first"] < 0.99 for f in flags)
    assert "interactions rule at" in at_zero.message


def test_the_table_ranks_by_total_order(paper):
    rows = table(paper).splitlines()
    assert rows[0].split()[:2] == ["S", "ST"]
    names = [row.split()[0] for row in rows[1:12]]
    assert sorted(names) == sorted(FACTORS)
    assert set(names[:2]) == {"dphi_y1", "deps_y"}
    totals = [float(row.split()[2]) for row in rows[1:12]]
    assert totals == sorted(totals, reverse=True)


def test_without_errors_there_is_nothing_to_analyse():
    with pytest.raises(StudyError, match=r"rig.errors: found no errors of the table, expected some such as"):
        analyse(settings(rig={"kind": "two_axis_turntable"}))


def test_a_sobol_sequence_is_rounded_up_and_says_so():
    few = {"positions": {"list": [["10 deg", "20 deg"]]}}
    found = analyse(settings(analysis={"method": "sampled", "samples": 1000}, **few))
    assert found.note == "1000 samples rounded up to 1024, a power of two, for Sobol points"
    assert found.indices.method["samples"] == 1024
    plain = analyse(settings(analysis={"method": "sampled", "samples": 1000, "sampling": "random"}, **few))
    assert plain.note == ""
    assert (plain.indices.method["samples"], plain.indices.method["seed"]) == (1000, 1)
    assert "shapley" not in result(plain)["mean"]


def test_the_seed_decides_and_the_sampled_indices_are_near_the_exact_ones():
    """Within 5 standard uncertainties of the estimates themselves."""
    few = {"positions": {"list": [["30 deg", "20 deg"], ["130 deg", "70 deg"]]}}
    how = {"method": "sampled", "samples": 512, "seed": 4}
    a, b = (analyse(settings(analysis=how, **few)) for _ in range(2))
    assert_allclose(a.indices.first, b.indices.first, rtol=0, atol=0)
    exact = analyse(settings(**few)).indices
    assert (np.abs(a.indices.first - exact.first) <= 5 * a.indices.u_first + 1e-6).all()
    told = []
    analyse(settings(analysis=how, **few), progress=lambda done, total: told.append((done, total)))
    assert told == [(0, 2), (1, 2), (2, 2)]


def test_the_local_method_has_no_interactions():
    found = result(analyse(settings(analysis={"method": "local"})))
    assert np.all(found["mean"]["total_minus_first"] == 0.0)


@pytest.mark.parametrize("suffix", [".nc", ".npz"])
def test_maps_hold_every_index_with_its_axes(at_zero, tmp_path, suffix):
    path = tmp_path / f"maps{suffix}"
    write_maps(at_zero, path)
    indices = at_zero.indices
    maps = dict(np.load(path)) if suffix == ".npz" else xarray.open_dataset(path, engine="scipy")
    assert list(np.asarray(maps["factor"])) == FACTORS
    assert list(np.asarray(maps["output"])) == ["ax", "ay", "az", "wx", "wy"]
    assert list(np.asarray(maps["unit"])) == ["m/s^2"] * 3 + ["rad/s"] * 2
    for name in ("first", "total", "total_minus_first", "shapley", "variance", "bias", "second"):
        assert_allclose(np.asarray(maps[name]), getattr(indices, name), rtol=0, atol=0, err_msg=name)
    assert_allclose(np.asarray(maps["phi2"]), indices.angles[:, 1], rtol=0, atol=0)


def test_netcdf_is_labelled(at_zero, tmp_path):
    """One looks a value up by its names, and everything says its unit."""
    write_maps(at_zero, tmp_path / "m.nc")
    with xarray.open_dataset(tmp_path / "m.nc", engine="scipy") as maps:
        assert maps["first"].dims == ("output", "position", "factor")
        assert maps["second"].dims == ("output", "position", "factor", "other_factor")
        assert set(maps["first"].coords) >= {"output", "factor", "phi1", "phi2"}
        assert maps["phi1"].attrs["units"] == "rad"
        assert maps["first"].attrs["units"] == "1"
        assert all(maps[name].attrs["long_name"] for name in maps.variables)
        value = maps["second"].sel(output="az", factor="dphi_y1", other_factor="dtheta_x")[0]
        assert (
            float(value) == at_zero.indices.second[2, 0, FACTORS.index("dphi_y1"), FACTORS.index("dtheta_x")]
        )
        assert json.loads(maps.attrs["method"]) == {"name": "exact"}


def test_what_was_not_computed_is_not_in_the_file(tmp_path):
    one = settings(analysis={"method": "local"}, positions={"list": [["10 deg", "20 deg"]]})
    write_maps(analyse(one), tmp_path / "m.npz")
    assert {"shapley", "second", "u_first"}.isdisjoint(np.load(tmp_path / "m.npz"))
    write_maps(analyse(one), tmp_path / "m.nc")
    with xarray.open_dataset(tmp_path / "m.nc", engine="scipy") as maps:
        assert {"shapley", "second", "other_factor"}.isdisjoint(maps.variables)


def test_errors_that_move_nothing_lead_nothing():
    """An offset of the axes leaves every attitude alone."""
    rig = {"kind": "two_axis_turntable", "errors": {"d_eta": {"normal": "10 um"}}}
    assert analyse(settings(rig=rig)).message.endswith("these errors do not move these outputs there")
