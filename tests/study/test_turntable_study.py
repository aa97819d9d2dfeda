"""The study of a turntable: what its keys mean, and what is taken where they are absent."""

import json
import math
import re
import tomllib
from pathlib import Path

import numpy as np
import pytest
from new_studies import load_turntable_study
from numpy.testing import assert_allclose

from inercal.faces.studies.load import files_of, load_imu_study
from inercal.faces.studies.turntable import turntable_study
from inercal.foundation.errors import StudyError
from inercal.foundation.geometry.earth import gravity
from inercal.foundation.rigs.chain import Scope
from inercal.foundation.rigs.plans import grid, named
from inercal.foundation.rigs.tables import slots
from inercal.foundation.units import STANDARD_GRAVITY
from inercal.systems.turntable.settings import JointAngles
from rows import for_each

ARCMIN = math.radians(1.0 / 60.0)
DEG_PER_H = math.radians(1.0) / 3600.0
SITE = {"latitude": "39.1 deg", "gravity": "9.7 m/s^2"}
RIG = {"kind": "two_axis_turntable"}

# The study of the interface description, to the letter.
CONTRACT = """
# turntable
[site]
latitude = "39.1 deg"
height = "0 m"
gravity = "9.8 m/s^2"            # from latitude and height if absent
[rig]
kind = "two_axis_turntable"
[rig.errors]                     # one default, overrides by factor name; scope: sample | position | run | rig, also allowed in the default; if absent as in terms.md
default = { uniform = "2 arcmin" }
deps_x = { normal = "1 arcmin", scope = "rig" }
[positions]
grid = { phi1 = 36, phi2 = 36, offset = "half" }    # full circle, k + 1/2 steps (the default; "none" starts at 0); or plan = "24-position"; or list = [["0 deg", "45 deg"]]
[analysis]
outputs = ["ax", "ay", "az", "wx", "wy"]
method = "exact"                 # or "sampled" with sampling = "random" | "sobol", samples = 1024, seed = 1
[instrument]                     # for simulate / calibrate: model and (for simulate) true coefficients
kind = "gyrowheel"
noise = "0.01 deg/h"
dwell = "60 s"
"""  # noqa: E501


def study(**tables):
    """A study of these tables, on a two-axis table unless they say otherwise."""
    return turntable_study({"site": SITE, "rig": RIG} | tables, "study.toml")


def with_errors(**errors):
    return study(rig={**RIG, "errors": errors}).chain


def coefficients(kind="gyrowheel", **values):
    """Coefficients of an instrument as they are stored."""
    return study(instrument={"kind": kind, "coefficients": values}).instrument


@pytest.fixture
def write(tmp_path):
    def write(text):
        path = tmp_path / "study.toml"
        path.write_text(text, encoding="utf-8")
        return path

    return write


def test_the_study_of_the_contract(write):
    found = load_turntable_study(write(CONTRACT))
    assert found.site.gravity == 9.8
    assert found.site.latitude == pytest.approx(math.radians(39.1))
    assert found.rig == "two_axis_turntable"
    assert len(found.chain.factors) == 11
    by_name = {error.name: error for error in found.chain.errors}
    assert by_name["dphi_y1"].distribution.std == pytest.approx(2 * ARCMIN / math.sqrt(3.0))
    assert by_name["deps_x"].distribution.std == pytest.approx(ARCMIN)
    assert by_name["deps_x"].scope is Scope.RIG
    assert_allclose(found.plan.angles, grid((36, 36)).angles)
    assert found.analysis.outputs == ("ax", "ay", "az", "wx", "wy")
    assert found.analysis.method == "exact"
    assert found.instrument.noise == pytest.approx(0.01 * DEG_PER_H)
    assert found.instrument.dwell == 60.0
    assert json.loads(json.dumps(found.given)) == tomllib.loads(CONTRACT)


@pytest.mark.parametrize(
    "positions",
    [
        'plan = "24-position"',
        'list = [["0 deg", "45 deg"]]',
        'grid = { phi1 = 36, phi2 = 36, offset = "none" }',
    ],
)
def test_the_other_ways_of_the_contract_to_give_positions(write, positions):
    found = load_turntable_study(write(re.sub("(?m)^grid = .*", positions, CONTRACT)))
    expected = {
        "p": named("24-position").angles,
        "l": [[0.0, math.pi / 4]],
        "g": grid((36, 36), False).angles,
    }
    assert_allclose(found.plan.angles, expected[positions[0]])


def test_positions_in_a_file_beside_the_study(write, tmp_path):
    """Angles in any unit and any order of columns; columns of other names are not looked at."""
    text = re.sub("(?m)^grid = .*", 'file = "sub/p.csv"', CONTRACT)
    (tmp_path / "sub").mkdir()
    (tmp_path / "sub/p.csv").write_text("phi2 [deg],note,phi1 [rad]\n45,1,0.5\n-10,2,3\n")
    found = load_turntable_study(write(text))
    assert_allclose(found.plan.angles, [[0.5, math.pi / 4], [3.0, math.radians(-10.0)]])
    assert found.plan.name == "p.csv"
    path = tmp_path / "study.toml"
    assert files_of(path, found.given) == (path, tmp_path / "sub/p.csv")
    assert files_of(path, load_turntable_study(write(CONTRACT)).given) == (path,)


@for_each(
    ("content", "message"),
    [
        (
            None,
            "positions.file: 'p.csv': no such file beside the study, expected a CSV with the header phi1 [deg],",
        ),
        ("phi1 [deg]\n1\n", "positions.file: 'p.csv': found phi1, expected phi1, phi2"),
        ("phi1 [deg],phi2 [deg],phi3 [deg]\n1,2,3\n", "found phi1, phi2, phi3, expected phi1, phi2"),
        ("phi1,phi2\n1,2\n", "p.csv: line 1: found 'phi1' without a unit"),
        ("1,2\n3,4\n", "(its header should be phi1 [deg],phi2 [deg])"),
        ("phi1 [deg],phi2 [m]\n1,2\n", 'phi2: found "m" (length), expected a unit of angle'),
        ("phi1 [count],phi2 [deg]\n1,2\n", "phi1 is in count, expected physical units"),
        ("phi1 [deg],phi2 [deg]\n1,2\n3,\n", "found no angle in row 2, expected one for each axis"),
        ("phi1 [deg],phi2 [deg]\n", "found a header and no row after it"),
        ("phi1 [deg],phi2 [deg]\n5,0\n95,0\n", "found position 2 (95 deg, 0 deg) beyond rig.limits"),
    ],
)
def test_a_bad_file_of_positions_is_said_with_its_key(write, tmp_path, content, message):
    if content is not None:
        (tmp_path / "p.csv").write_text(content)
    text = re.sub("(?m)^grid = .*", 'file = "p.csv"\n[rig.limits]\nphi1 = ["0 deg", "90 deg"]', CONTRACT)
    with pytest.raises(StudyError, match=re.escape(message)) as caught:
        load_turntable_study(write(text))
    assert "study.toml: positions.file" in str(caught.value)
    assert "\n" not in str(caught.value)


@for_each("start", ["grid = { phi1 = 5, phi2 = 5 }", 'plan = "6-position"', 'list = [["1 deg", "2 deg"]]'])
@for_each(
    ("override", "positions"),
    [
        ('positions.plan="24-position"', 24),
        ("positions.grid={ phi1 = 3, phi2 = 4 }", 12),
        ("positions.list=[['0 deg', '45 deg']]", 1),
        ("positions.file=p.csv", 2),
    ],
)
def test_a_way_to_give_positions_that_is_set_takes_the_place_of_the_other(
    write, tmp_path, monkeypatch, start, override, positions
):
    # a file that is set is one of the working folder
    (tmp_path / "here").mkdir(exist_ok=True)
    monkeypatch.chdir(tmp_path / "here")
    (tmp_path / "here" / "p.csv").write_text("phi1 [deg],phi2 [deg]\n1,2\n3,4\n")
    path = write(re.sub("(?m)^grid = .*", start, CONTRACT))
    assert len(load_turntable_study(path, [override]).plan) == positions


def test_a_distribution_that_is_set_takes_the_place_of_the_other(write):
    path = write(CONTRACT)  # deps_x is normal, the default uniform
    chain = load_turntable_study(
        path, ["rig.errors.deps_x.uniform=3 arcmin", "rig.errors.default.normal=4 arcmin"]
    ).chain
    std = dict(zip(chain.factors, chain.std, strict=True))
    assert std["deps_x"] == pytest.approx(3 * ARCMIN / math.sqrt(3.0))
    assert std["deps_y"] == pytest.approx(4 * ARCMIN)
    assert next(e.scope for e in chain.errors if e.name == "deps_x") is Scope.RIG  # as the file has it


def test_two_ways_in_one_file_are_still_refused_where_another_key_is_set(write):
    text = CONTRACT.replace("[analysis]", 'plan = "24-position"\n[analysis]')
    with pytest.raises(StudyError, match="positions: found grid and plan, expected one of them"):
        load_turntable_study(write(text), ["analysis.seed=3"])


def test_the_sampled_analysis_of_the_contract(write):
    found = load_turntable_study(
        write(CONTRACT),
        ["analysis.method=sampled", "analysis.sampling=random", "analysis.samples=1000", "analysis.seed=7"],
    ).analysis
    assert (found.method, found.sampling, found.samples, found.seed) == ("sampled", "random", 1000, 7)


def test_what_is_absent():
    found = study()
    assert found.chain.errors == ()  # a calibration may do without; an analysis says that it cannot
    assert_allclose(found.plan.angles, grid((36, 36)).angles)
    assert found.analysis.outputs == ("ax", "ay", "az", "wx", "wy")
    assert_allclose(found.design.candidates.angles, grid((36, 36), half_step=False).angles)
    assert set(found.design.compare) == {"6-position", "8-position", "12-position", "24-position", "16-cube"}
    assert (found.rate_test, found.temperature, found.instrument.noise) == (None, None, None)
    assert found.instrument.unit.symbol == "rad/s"
    assert study(instrument={"kind": "accelerometer"}).instrument.unit.symbol == "m/s^2"
    # people who state the noise in a unit want their outputs in it
    assert study(instrument={"noise": "0.01 deg/h"}).instrument.unit.symbol == "deg/h"
    assert study(instrument={"noise": "0.01 deg/sqrt(h)"}).instrument.unit.symbol == "rad/s"


def test_gravity_follows_from_latitude_and_height():
    site = study(site={"latitude": "39.1 deg", "height": "500(1) m"}).site
    assert site.gravity == float(gravity(math.radians(39.1), 500.0))


# Errors.


def test_each_distribution_has_its_variance():
    """Uniform h^2/3, triangular h^2/6, two points h^2, normal s^2."""
    chain = with_errors(
        deps_x={"uniform": "3 arcmin"},
        deps_y={"triangular": "3 arcmin"},
        dphi_y1={"two_point": "3 arcmin"},
        dphi_z2={"normal": "3 arcmin"},
        d_eta={"uniform": "30 um"},
    )
    std = dict(zip(chain.factors, chain.std, strict=True))
    shares = {"deps_x": 3.0, "deps_y": 6.0, "dphi_y1": 1.0, "dphi_z2": 1.0}
    for name, share in shares.items():
        assert std[name] == pytest.approx(3 * ARCMIN / math.sqrt(share))
    assert std["d_eta"] == pytest.approx(30e-6 / math.sqrt(3.0))


def test_scopes_are_those_of_the_table_unless_stated():
    usual = {slot.name: slot.scope for slot in slots("two_axis_turntable")}
    plain = with_errors(default={"uniform": "2 arcmin"})
    assert {error.name: error.scope for error in plain.errors} == {
        name: scope for name, scope in usual.items() if name in plain.factors
    }
    stated = with_errors(
        default={"uniform": "2 arcmin", "scope": "run"},
        deps_x={"scope": "sample"},
        deps_y={"normal": "1 arcmin"},
    )
    scopes = {error.name: error.scope for error in stated.errors}
    assert scopes.pop("deps_x") is Scope.SAMPLE
    assert set(scopes.values()) == {Scope.RUN}


def test_a_scope_alone_keeps_the_distribution_of_the_default():
    chain = with_errors(default={"triangular": "2 arcmin"}, deps_x={"scope": "position"})
    assert len(set(chain.std.tolist())) == 1
    assert chain.errors[chain.factors.index("deps_x")].scope is Scope.POSITION


def test_an_error_is_left_out_by_its_name_and_an_optional_one_comes_by_its_name():
    default = {"uniform": "2 arcmin"}
    everything = with_errors(default=default).factors
    assert with_errors(default=default, deps_x="none").factors == tuple(
        name for name in everything if name != "deps_x"
    )
    assert "dbase_x" not in everything
    assert "dbase_x" in with_errors(default=default, dbase_x={"scope": "rig"}).factors
    assert with_errors(deps_x={"normal": "1 arcmin"}).factors == ("deps_x",)
    given = study(rig={**RIG, "errors": {"default": default, "deps_x": "none"}}).given
    assert given["rig"]["errors"] == {"default": default, "deps_x": "none"}


def test_the_base_turns_everything():
    """A base turned by 90 deg about up has its outer axis to the south: y of the table is -x of n."""
    chain = study(rig={**RIG, "base": {"azimuth": "90 deg"}}).chain
    assert_allclose(chain.attitude([0.0, 0.0])[:, 1], [-1.0, 0.0, 0.0], atol=1e-15)
    assert_allclose(study(rig={**RIG, "base": {}}).chain.attitude([0.0, 0.0]), np.eye(3))


def test_a_table_of_three_axes():
    found = study(
        rig={"kind": "three_axis_turntable", "errors": {"default": {"normal": "1 arcmin"}}},
        positions={"list": [["10 deg", "20 deg", "30 deg"]]},
    )
    assert found.chain.joints == ("phi1", "phi2", "phi3")
    assert_allclose(found.plan.angles, np.radians([[10.0, 20.0, 30.0]]))
    assert found.design.compare == ()
    usual = study(rig={"kind": "three_axis_turntable"})
    assert usual.plan.angles.shape == (1728, 3)


# Positions.


def test_limits_keep_what_the_axes_reach_in_angles_they_can_be_told():
    found = study(rig={**RIG, "limits": {"phi1": ["-90 deg", "90 deg"]}})
    phi1 = np.degrees(found.plan.angles[:, 0])
    assert len(phi1) == 648
    assert phi1.min() == pytest.approx(-85.0)
    assert phi1.max() == pytest.approx(85.0)
    assert np.degrees(found.design.candidates.angles[:, 0]).min() == pytest.approx(-90.0)
    assert found.design.compare == ()  # each needs angles beyond
    assert found.limits == {"phi1": pytest.approx((-math.pi / 2, math.pi / 2))}


def test_whole_turns_lead_back_within_limits():
    found = study(
        rig={**RIG, "limits": {"phi1": ["-95 deg", "5 deg"]}},
        positions={"list": [["270 deg", "10 deg"], ["-20 deg", "20 deg"]]},
    )
    assert_allclose(np.degrees(found.plan.angles), [[-90.0, 10.0], [-20.0, 20.0]])


# Coefficients.


def test_a_drift_per_g_is_that_per_site_gravity_after_conversion():
    """D g_unit^-n a^n with a in m/s^2 must be the same drift as D' (a / g_site)^n."""
    found = coefficients(DX_F="50 deg/h", DX_X="60 deg/h/g", DX_XX="2 deg/h/g^2", DX_XZ="3(1) deg/h/g²")
    ratio = 9.7 / STANDARD_GRAVITY
    assert found.coefficients == {
        "DX_F": pytest.approx(50 * DEG_PER_H),
        "DX_X": pytest.approx(60 * DEG_PER_H * ratio),
        "DX_XX": pytest.approx(2 * DEG_PER_H * ratio**2),
        "DX_XZ": pytest.approx(3 * DEG_PER_H * ratio**2),
    }
    assert found.coefficients_u == {"DX_XZ": pytest.approx(DEG_PER_H * ratio**2)}


def test_a_drift_in_the_unit_of_the_output_is_per_site_gravity():
    found = coefficients(DX_X="60 deg/h", DX_XX="2(1) deg/h", DX_YY="1.94e-5 rad/s/(m/s^2)^2")
    assert found.coefficients["DX_X"] == pytest.approx(60 * DEG_PER_H)
    assert found.coefficients["DX_XX"] == pytest.approx(2 * DEG_PER_H)
    assert found.coefficients["DX_YY"] == pytest.approx(1.94e-5 * 9.7**2)


def test_a_response_to_rate_is_a_number_or_output_per_rate():
    assert coefficients(k_x="1.00(2)", k_y=0.5).coefficients == {"k_x": 1.0, "k_y": 0.5}
    assert coefficients(k_x="1.00(2)").coefficients_u == {"k_x": pytest.approx(0.02)}
    assert coefficients(k_x="2 deg/h/(deg/h)").coefficients["k_x"] == pytest.approx(2.0)
    in_volt = study(
        instrument={"unit": "mV", "noise": "2 uV", "coefficients": {"k_x": "3 mV/(deg/s)", "DX_F": "7 mV"}}
    ).instrument
    assert in_volt.coefficients["k_x"] == pytest.approx(3e-3 / math.radians(1.0))
    assert in_volt.coefficients["DX_F"] == pytest.approx(7e-3)
    assert in_volt.noise == pytest.approx(2e-6)


def test_terms_of_accelerometers_and_gyros_in_the_units_of_the_field():
    g = STANDARD_GRAVITY
    acc = coefficients(
        "accelerometer", K0_x="100 ug", K1_x="1.0002", M_xy="20 arcsec", K2_x="5 ug/g^2", K3_x="3 ug/g^3",
        Kip_x="4e-6 1/g", Kio_x="2 ppm/(m/s^2)",
    ).coefficients  # fmt: skip
    assert acc == {
        "K0_x": pytest.approx(100e-6 * g),
        "K1_x": 1.0002,
        "M_xy": pytest.approx(20 * ARCMIN / 60),
        "K2_x": pytest.approx(5e-6 / g),
        "K3_x": pytest.approx(3e-6 / g**2),
        "Kip_x": pytest.approx(4e-6 / g),
        "Kio_x": pytest.approx(2e-6),
    }
    gyro = coefficients("gyro", D_F_x="5 deg/h", S_x="1.01", T_xy="1 mrad", G_xz="2 deg/h/g").coefficients
    assert gyro["G_xz"] == pytest.approx(2 * DEG_PER_H / g)
    assert (gyro["S_x"], gyro["T_xy"]) == (1.01, 1e-3)
    counts = study(
        instrument={"kind": "accelerometer", "unit": "count", "coefficients": {"K1_z": "1000 count/g"}}
    )
    assert counts.instrument.coefficients["K1_z"] == pytest.approx(1000.0 / g)


def test_a_random_walk_is_averaged_over_the_dwell():
    """The mean of white noise of density N over T has the standard deviation N / sqrt(T)."""
    found = study(instrument={"noise": "0.003 deg/sqrt(h)", "dwell": "15 min"}).instrument
    assert found.noise == pytest.approx(0.006 * DEG_PER_H)
    found = study(
        instrument={"kind": "accelerometer", "noise": "10 ug/sqrt(Hz)", "dwell": "100 s"}
    ).instrument
    assert found.noise == pytest.approx(1e-6 * STANDARD_GRAVITY)


# The other tables.


def test_design_and_rate_test():
    found = study(
        rig={**RIG, "errors": {"default": {"uniform": "2 arcmin"}}},
        design={
            "positions": 12,
            "criterion": "I",
            "table_errors": False,
            "candidates": {"phi1": 8, "phi2": 4},
            "compare": ["24-position"],
            "sensitivity": {"factors": ["dtheta_x", "dalpha_x2"], "outputs": ["ax", "ay"], "below": 0.1},
            "seed": 3,
        },
        rate_test={
            "joint": "phi1",
            "full_scale": "100 deg/s",
            "order": 3,
            "rates": ["-10 deg/s", "10 deg/s"],
            "rate_uncertainty": "20 ppm",
            "at": {"phi2": "90 deg"},
        },
    )
    design = found.design
    assert (design.positions, design.criterion, design.table_errors, design.seed) == (12, "I", False, 3)
    assert_allclose(design.candidates.angles, grid((8, 4)).angles)
    assert design.compare == ("24-position",)
    assert design.constraint.factors == ("dtheta_x", "dalpha_x2")
    assert (design.constraint.outputs, design.constraint.below) == (("ax", "ay"), 0.1)
    assert found.rate_test.joint == "phi1"
    assert found.rate_test.full_scale == pytest.approx(math.radians(100.0))
    assert_allclose(np.degrees(found.rate_test.rates), [-10.0, 10.0])
    assert (found.rate_test.order, found.rate_test.rate_u) == (3, pytest.approx(2e-5))
    assert found.rate_test.at == JointAngles(phi2=pytest.approx(math.pi / 2))


def test_terms_of_a_rate_test():
    found = coefficients("gyro", S_asym_x="50 ppm", S2_x="5 ppm/(deg/s)", S3_z="1e-9/(deg/s)^2").coefficients
    degree = math.radians(1.0)
    assert found == {
        "S_asym_x": pytest.approx(5e-5),
        "S2_x": pytest.approx(5e-6 / degree),
        "S3_z": pytest.approx(1e-9 / degree**2),
    }


def test_a_study_is_for_its_own_commands(write, tmp_path):
    with pytest.raises(StudyError, match="a study for `inercal calibrate turntable`, expected one for"):
        load_imu_study(write(CONTRACT))
    other = tmp_path / "other.toml"
    other.write_text('[site]\nlatitude = "1 deg"\n[imu]\nmethod = "multiposition"\n')
    with pytest.raises(StudyError, match="a study for `inercal calibrate imu`, expected one of a turntable"):
        load_turntable_study(other)
    other.write_text(Path(tmp_path / "study.toml").read_text().replace("two_axis_turntable", "sting"))
    with pytest.raises(StudyError, match="a study for `inercal aoa`, expected one of a turntable"):
        load_turntable_study(other)
