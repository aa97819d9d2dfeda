"""Rigs of one and two axes: joints that are fixed, without encoders, by a simulator that shares no code."""

import io
from dataclasses import replace

import numpy as np
import pytest
from independent.selfcal import ARCSEC, NOMINAL, PPM, PRIOR, Drive, Faults, study
from independent.selfcal_driven import Place, driven
from scipy.stats import chi2

import inercal as ic
from inercal.cli.options import ResultOutput
from inercal.faces.stream.estimators import selfcal as prepared
from inercal.faces.stream.lines import Lines
from inercal.faces.stream.run import run
from inercal.foundation.errors import RecordError, StudyError
from inercal.foundation.geometry.rotations import conjugate, rotate, to_matrix
from inercal.systems.selfcal.filters.problem import encoders_at, problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.platform.coefficients import EXTENDED, to_linear
from inercal.systems.selfcal.platform.rig import JOINTS
from inercal.systems.selfcal.platform.states import ALL, RIG
from inercal.systems.selfcal.reading import recording_of
from inercal.systems.selfcal.still_joints import told_apart, without_fixed

TWO = (("x", 90), ("z", 180), ("x", 90), ("z", -90), ("x", 90), ("z", 180), ("x", -180))
ONE = (("z", 360), ("z", -360))
AT = np.radians([0.0, 20.0, 0.0])
FIXED = {
    "two axes": 'fixed = { y = "20 deg" }',
    "one axis": 'fixed = { x = "0 deg", y = "20 deg" }',
}
TURNS = {"two axes": TWO, "one axis": ONE}
WITHOUT = {"two axes": ("th_y", "temperature"), "one axis": ("th_x", "th_y", "temperature")}


def of_study(folder, rig, more=""):
    path = folder / "study.toml"
    path.write_text(study(more=more).replace('heading = "0 deg"', f'heading = "0 deg"\n{FIXED[rig]}'))
    return path


def drawn(rng):
    """Coefficients, and errors of a rig, by the priors of `rig`; delays of some 0.5 ms."""

    def three(size):
        return size * rng.standard_normal(3)

    faults = Faults(
        base=three(60 * ARCSEC), gamma=three(20 * ARCSEC), gyro_scale=three(100 * PPM),
        non_orthogonality=20 * ARCSEC * rng.standard_normal(2),
        delay_encoder=0.5e-3 * rng.standard_normal(), delay_accelerometer=0.5e-3 * rng.standard_normal(),
    )  # fmt: skip
    return PRIOR * rng.standard_normal(18), faults


@pytest.mark.parametrize("rig", FIXED)
def test_uncertainties_hold_without_an_encoder_on_a_fixed_joint(rig, tmp_path):
    """NEES of the coefficients and delays over 20 draws, within limits that 1 in 10000 leaves."""
    asked, rng, total = of_study(tmp_path, rig), np.random.default_rng(20261124), 0.0
    drive, file = Drive(TURNS[rig]), tmp_path / "record.csv"
    for _ in range(20):
        truth, faults = drawn(rng)
        driven(rng, drive, truth, NOMINAL, faults, Place(begin=tuple(AT))).write(file, WITHOUT[rig])
        settings = ic.study(asked).settings
        recording = recording_of(ic.read(file), settings)
        of = problem(without_fixed(settings)[0])
        found = estimate(recording, of, history=False)
        true = dict(
            zip(EXTENDED, to_linear(np.concatenate([truth, faults.gyro_scale, faults.base])), strict=True)
        )
        true |= {"tau_enc": faults.delay_encoder, "tau_a": faults.delay_accelerometer}
        told = [k for k, name in enumerate(of.names) if name in true and not name.startswith("beta")]
        error = found.coefficients[told] - [true[of.names[k]] for k in told]
        total += error @ np.linalg.solve(found.covariance[np.ix_(told, told)], error)
    low, high = chi2.ppf([5e-5, 1 - 5e-5], 20 * 23)
    assert low < total < high


@pytest.mark.parametrize("still", [(0,), (1,), (2,), (0, 1), (0, 2), (1, 2)])
def test_what_is_left_out_is_a_combination_of_what_is_kept(still, tmp_path):
    """Columns of beta, gamma and the joints in the encoders' attitude over many angles of those that turn: those kept
    are independent, those left out within their span."""
    settings = ic.study(of_study(tmp_path, "two axes")).settings
    settings = replace(settings, model=replace(settings.model, states=RIG))
    rng = np.random.default_rng(3)
    th = rng.uniform(-1.2, 1.2, (60, 3))
    fixed = np.array([0.3, 0.5, -0.4])
    th[:, still] = fixed[list(still)]
    kept, said = told_apart(settings, still, th[0])
    names = [name for name in ALL if name.startswith(("beta", "gamma", "nonorth", "zero"))]
    of = problem(settings)
    c = np.zeros(len(of.names))
    columns = []
    for angles in th:
        q, slope = encoders_at(of, angles, c, np.zeros(3))
        slope = slope.copy()
        at = of.names.index("beta_x")
        slope[:, at : at + 3] = to_matrix(conjugate(q))
        columns.append(slope[:, [of.names.index(name) for name in names]])
    whole = np.vstack(columns)
    own = whole[:, [name in kept.states.names for name in names]]
    assert np.linalg.matrix_rank(own, tol=1e-9) == own.shape[1] == np.linalg.matrix_rank(whole, tol=1e-9)
    assert said[0].code == "at_prior"
    assert all(name in said[0].message for name in set(names) - set(kept.states.names))
    assert np.all(rotate(conjugate(q), np.eye(3)) == pytest.approx(to_matrix(conjugate(q)).T))


def test_what_is_left_out_widens_the_prior_of_what_it_cannot_be_told_from(tmp_path):
    settings = ic.study(of_study(tmp_path, "one axis")).settings
    kept, _ = without_fixed(settings)
    of = dict(zip(problem(kept).names, problem(kept).prior / ARCSEC, strict=True))
    assert "gamma_y" not in of
    # beta takes gamma_y, zero_y and both non-orthogonalities, 20 arcsec each
    assert of["beta_x"] == pytest.approx(np.sqrt(60.0**2 + 4 * 20.0**2))
    assert of["gamma_x"] == pytest.approx(20.0)


SIMULATED = """
[plan]
turns = [["x", "90 deg"], ["z", "180 deg"], ["x", "90 deg"], ["z", "-90 deg"], ["x", "90 deg"]]
[truth]
kg0 = ["0.08 deg/h", "-0.06 deg/h", "0.10 deg/h"]
do = ["-75 arcsec", "50 arcsec", "-100 arcsec"]
eta = ["60 arcsec", "-90 arcsec", "120 arcsec"]
ka0 = ["100 ug", "-150 ug", "200 ug"]
kg1 = ["20 ppm", "-10 ppm", "30 ppm"]
[disturbances]
gamma = ["5 arcsec", "-3 arcsec", "8 arcsec"]
k2 = "5 ug/g^2"
sag = ["1 arcsec/g", "-2 arcsec/g", "3 arcsec/g"]
g_sensitivity = ["0.05 deg/h/g", "0 deg/h/g", "0 deg/h/g", "0 deg/h/g", "0 deg/h/g", "0 deg/h/g", "0 deg/h/g",
 "0 deg/h/g", "0 deg/h/g"]
delay_accelerometer = "0.5 ms"
base_sway = { amplitude = "1 arcsec", frequency = "0.3 Hz" }
"""


def test_a_simulated_rig_of_two_axes_is_found_again(tmp_path):
    asked = of_study(
        tmp_path, "two axes", f'[model]\nstates = ["rig", "k2", "sag", "g_sensitivity"]\n{SIMULATED}'
    )
    text = asked.read_text().replace('encoder = "2.0', 'base_sway = "1 arcsec"\nencoder = "2.0')
    asked.write_text(text)
    record = ic.simulate(asked, np.random.default_rng(20261125))
    assert {"gyro_x", "th_x", "th_z"} <= record.columns.keys()
    assert not {"wc_x", "th_y"} & record.columns.keys()
    found = ic.calibrate(record, asked).estimate
    settings = ic.study(asked).settings
    true = dict(zip(ALL, settings.true_values, strict=True))
    off = (found.values - [true[name] for name in found.names]) / found.u
    assert np.abs(off).max() < 4.5
    assert found.status.value == "ok", found.message


def test_map_and_the_error_state_filter_agree_on_two_axes(tmp_path):
    rng = np.random.default_rng(8)
    truth, faults = drawn(rng)
    file = tmp_path / "record.csv"
    driven(rng, Drive(TWO), truth, NOMINAL, faults, Place(begin=tuple(AT))).write(file, WITHOUT["two axes"])
    asked = of_study(tmp_path, "two axes")
    runs = [
        ic.calibrate(ic.read(file), ic.study(asked, filter={"kind": kind})) for kind in ("error-state", "map")
    ]
    first, second = (run.estimate for run in runs)
    assert np.abs((first.values - second.values) / second.u).max() < 0.3
    assert first.u == pytest.approx(second.u, rel=0.02)


def test_a_fixed_joint_that_has_a_column_counts_as_it_is_read(tmp_path):
    rng = np.random.default_rng(9)
    truth, faults = drawn(rng)
    file, bare = tmp_path / "record.csv", tmp_path / "bare.csv"
    made = driven(rng, Drive(TWO), truth, NOMINAL, faults, Place(begin=tuple(AT)))
    made.write(file, ("temperature",))
    made.write(bare, WITHOUT["two axes"])
    asked = of_study(tmp_path, "two axes")
    read, unread = (ic.calibrate(ic.read(each), asked).evidence for each in (file, bare))
    assert (read.recording.fixed, unread.recording.fixed) == ((), (1,))
    u = [np.sqrt(np.diag(each.filtered.covariance)) for each in (read, unread)]
    assert np.all(u[0] > 0.999 * u[1])  # an encoder tells less than a joint that cannot turn


def test_a_stream_leaves_out_what_a_fixed_joint_hides(tmp_path, capsys):
    rng = np.random.default_rng(10)
    truth, faults = drawn(rng)
    file = tmp_path / "record.csv"
    driven(rng, Drive(TWO), truth, NOMINAL, faults, Place(begin=tuple(AT))).write(file, WITHOUT["two axes"])
    asked = of_study(tmp_path, "two axes")
    output = ResultOutput()
    make = prepared(ic.study(asked).settings, 0.0, output.say, output.say_finding)
    assert "at_prior: nonorth_xy, nonorth_yz: th_y stands still" in capsys.readouterr().err
    lines = Lines(io.BytesIO(file.read_bytes()), "record", None, lambda _: None)
    out = list[str]()
    run(make(lines), lines, out.append)
    titles, last = out[0].split(","), [float(cell) for cell in out[-1].split(",")]
    row = {title.split(" ")[0]: value for title, value in zip(titles, last, strict=True)}
    found = ic.calibrate(ic.read(file), asked).estimate
    assert {name for name in row if f"u_{name}" in row} == set(found.names)
    off = [abs(row[name] - found[name].value) / found[name].u for name in found.names[:3]]
    assert max(off) < 0.1
    # of a stream u is by noise and prior, as the bound along the path
    assert row["u_kg0_x"] == pytest.approx(found.result["bounds"]["kg0_x"], rel=0.05)


def test_what_is_missing_or_fixed_wrongly_is_refused(tmp_path):
    rng = np.random.default_rng(11)
    file = tmp_path / "record.csv"
    driven(rng, Drive((("z", 20.0),))).write(file, WITHOUT["two axes"])
    plain = tmp_path / "plain.toml"
    plain.write_text(study())
    with pytest.raises(
        RecordError, match=r"found no th_y among .*a joint that does not turn is stated by rig\.fixed"
    ):
        ic.calibrate(ic.read(file), plain)
    turning = of_study(tmp_path, "two axes", '[plan]\nturns = [["y", "90 deg"]]\n')
    with pytest.raises(
        StudyError, match=r"plan: found a turn of th_y, expected none of a joint of rig\.fixed"
    ):
        ic.study(turning)
    elsewhere = of_study(
        tmp_path, "two axes", '[plan]\nturns = [["x", "90 deg"]]\nstart = ["0 deg", "0 deg", "0 deg"]\n'
    )
    with pytest.raises(
        StudyError, match=r"plan\.start: found 0 deg for th_y, expected 20 deg as of rig\.fixed"
    ):
        ic.study(elsewhere)
    with pytest.raises(StudyError, match=r"rig\.fixed: found all joints, expected one that turns"):
        ic.study(plain, rig={"fixed": {name[-1]: "0 deg" for name in JOINTS}})
