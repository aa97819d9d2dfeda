"""Records of a simulator that shares no code with the product: it knows the same physics, and u is true on them."""

import ast
import math
from pathlib import Path

import numpy as np
import pytest
from independent import selfcal as platform
from independent.selfcal import BEST, LOW, NOMINAL, THREE, TRUTH, Drive, Faults, Noise
from numpy.testing import assert_allclose
from scipy.stats import chi2

from inercal.faces.studies.load import load_selfcal_study
from inercal.foundation.findings import Status
from inercal.foundation.records.read import read
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.platform.coefficients import product_slope, to_product
from inercal.systems.selfcal.reading import recording_of
from inercal.systems.selfcal.simulate import experiment, simulate
from inercal.systems.selfcal.task import calibrate

SILENT = Noise(1e-30, 1e-30, 1e-30)


def recorded(folder, seed, drive, noise, faults=Faults(), more=""):  # noqa: B008  (frozen)
    """The recording and the study of one record, by way of its files."""
    (folder / "study.toml").write_text(platform.study(noise, more))
    platform.simulated(np.random.default_rng(seed), drive, noise=noise, faults=faults).write(
        folder / "record.csv"
    )
    settings = load_selfcal_study(folder / "study.toml")
    return recording_of(read([folder / "record.csv"]), settings), settings


def nees(found):
    """Squared error of the 18 coefficients over their covariance."""
    slope = product_slope(found.coefficients)[:18, :18]
    miss = to_product(found.coefficients)[:18] - TRUTH
    return float(miss @ np.linalg.solve(slope @ found.covariance[:18, :18] @ slope.T, miss))


def test_it_imports_nothing_but_numpy():
    tree = ast.parse(Path(platform.__file__).read_text(encoding="utf-8"))
    names = {
        name
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for name in ([node.module] if isinstance(node, ast.ImportFrom) else [a.name for a in node.names])
    }
    assert names == {"__future__", "dataclasses", "numpy"}


def test_both_simulators_turn_alike(tmp_path):
    """Without noise, rates held from row to row: angles and forces are the same but for rounding."""
    made = platform.simulated(np.random.default_rng(1), Drive(BEST, fine=1), noise=SILENT)
    more = f"""[plan]
turns = [{", ".join(f'["{joint}", "{angle} deg"]' for joint, angle in BEST)}]
rate = "1 deg/s"
step = "0.2 s"
[truth]
kg0 = ["0.08 deg/h", "-0.06 deg/h", "0.10 deg/h"]
eta = ["60 arcsec", "-90 arcsec", "120 arcsec"]
ds = ["60 arcsec", "-45 arcsec", "90 arcsec"]
do = ["-75 arcsec", "50 arcsec", "-100 arcsec"]
ka0 = ["100 ug", "-150 ug", "200 ug"]
ka1 = ["500 ppm", "-300 ppm", "800 ppm"]
"""
    (tmp_path / "study.toml").write_text(platform.study(SILENT, more))
    theirs = simulate(
        experiment(load_selfcal_study(tmp_path / "study.toml")), np.random.default_rng(1)
    ).recording
    assert_allclose(made.th, theirs.th, atol=1e-11)
    assert_allclose(made.acc[1:], theirs.acc[1:], atol=1e-10)
    assert_allclose(made.rate[:-1], theirs.rate, atol=1e-15)


@pytest.mark.parametrize(
    ("drive", "noise"),
    [
        (Drive(THREE, ramp=0.4), NOMINAL),
        (Drive(THREE, ramp=0.4), LOW),
        (Drive(BEST, ramp=0.4, rest=10.0, measured=True), LOW),
    ],
    ids=["nominal", "low", "measured, low"],
)
def test_without_faults_errors_are_what_u_says(drive, noise, tmp_path):
    """The mean of NEES over its 18 degrees of freedom lies within 99.9 % of chance in 6 runs."""
    found = []
    for seed in range(6):
        recording, settings = recorded(tmp_path, [20261122, seed], drive, noise)
        found.append(nees(estimate(recording, problem(settings), history=False)))
    low, high = chi2.ppf([0.0005, 0.9995], 18 * len(found)) / (18 * len(found))
    assert low < np.mean(found) / 18 < high


@pytest.mark.parametrize("measured", [False, True])
@pytest.mark.parametrize("ramp", [0.1, 0.3])
def test_an_ordinary_ramp_is_nothing_to_be_said(ramp, measured, tmp_path):
    """Rows every 0.2 s."""
    platform.simulated(np.random.default_rng(1), Drive(THREE, ramp=ramp, measured=measured)).write(
        tmp_path / "record.csv"
    )
    (tmp_path / "study.toml").write_text(platform.study())
    found = calibrate(read([tmp_path / "record.csv"]), load_selfcal_study(tmp_path / "study.toml")).estimate
    assert found.status is Status.OK
    assert {finding.code for finding in found.findings} <= {"stated_exact", "at_prior", "considered"}
    assert not any(finding.harm for finding in found.findings)


def test_faults_do_what_their_words_say():
    """Each alone, without noise, against the same record without it."""

    def off(faults, drive=Drive(THREE, ramp=0.4)):  # noqa: B008  (frozen)
        sound, made = (
            platform.simulated(np.random.default_rng(2), drive, noise=SILENT, faults=each)
            for each in (Faults(), faults)
        )
        return sound, made.th - sound.th, made.acc - sound.acc

    _, th, acc = off(Faults(zero=np.array([1e-5, 2e-5, 3e-5])))
    assert_allclose(th, np.broadcast_to([1e-5, 2e-5, 3e-5], th.shape), atol=1e-13)
    assert not acc.any()

    sound, th, acc = off(Faults(k2=np.array([1e-6, 0.0, 0.0])))
    assert_allclose(
        acc[:, 0], 1e-6 * ((sound.acc[:, 0] - TRUTH[12]) / (1 + TRUTH[15])) ** 2 * (1 + TRUTH[15]), atol=1e-15
    )
    assert not th.any()

    # a gamma about Y_p at zero angles is a zero of th_z, with the other sign
    _, th, _ = off(Faults(gamma=np.array([0.0, 1e-5, 0.0])))
    assert_allclose(th[:, 2], -1e-5, atol=1e-13)

    # late by 10 ms in a turn at 1 deg/s
    _, th, _ = off(Faults(delay_encoder=0.01))
    assert th[200, 0] == pytest.approx(math.radians(0.01), rel=1e-3)

    # a steady turn w about Z_p has the force w^2 r toward the axis
    _, _, acc = off(Faults(levers=np.diag([0.05, 0.0, 0.0])))
    assert acc[200, 0] == pytest.approx(-(math.radians(90.0 / 90.0) ** 2) * 0.05 * (1 + TRUTH[15]), rel=0.01)

    # of the sum of processes an octave apart: the floor of the Allan deviation
    drawn = platform.flicker(np.random.default_rng(3), 1.0, 0.2, 2**16, 8)
    for octave in (4, 8):
        means = drawn.reshape(2 ** (16 - octave), 2**octave, 8).mean(axis=1)
        assert np.sqrt(0.5 * np.mean(np.diff(means, axis=0) ** 2)) == pytest.approx(1.0, rel=0.1)


@pytest.mark.slow
def test_a_careful_rig_with_1_f_noise_is_calibrated(tmp_path):
    """Geometry of some seconds of arc, K2, delays of 0.2 ms, levers of 3 cm, and 1/f noise of 1 ug, which is no process
    of first order: of 18 coefficients none is beyond 4.5 u, as chance has it in 1 of 8000 such tests. Without
    biases that walk among the states it is told that some noise is not what is stated."""
    rng = np.random.default_rng(20261123)
    rig = Faults(
        gamma=5 * platform.ARCSEC * rng.standard_normal(3),
        zero=5 * platform.ARCSEC * rng.choice([-1.0, 1.0], 3),
        non_orthogonality=3 * platform.ARCSEC * rng.standard_normal(2),
        k2=3e-6 / platform.G * rng.standard_normal(3),
        delay_encoder=2e-4,
        delay_accelerometer=2e-4,
        flicker=platform.UG,
        levers=rng.uniform(-0.03, 0.03, (3, 3)),
    )
    drive = Drive(THREE, ramp=0.4)
    platform.simulated(np.random.default_rng([20261123, 0]), drive, faults=rig).write(tmp_path / "record.csv")
    found = {}
    for states in ('["rig", "k2", "levers"]', '["rig", "k2", "levers", "bias_walk"]'):
        (tmp_path / "study.toml").write_text(platform.study(more=f"[model]\nstates = {states}\n"))
        settings = load_selfcal_study(tmp_path / "study.toml")
        found[states] = calibrate(read([tmp_path / "record.csv"]), settings).estimate
    constant, walking = found.values()
    assert (constant.status, walking.status) == (Status.SUSPECT, Status.OK)
    assert np.abs((walking.values[:18] - TRUTH) / walking.u[:18]).max() < 4.5


def test_sag_drift_by_force_and_by_temperature_are_found(tmp_path):
    """Each within 4.5 u of what it is, and the coefficients at the temperature that the study states; the model without
    them is beyond 10 u."""
    rig = Faults(
        sag=2 * platform.ARCSEC,
        g_sensitivity=0.05 * platform.DEG_H,
        warming=3.0,
        bias_by_k=np.array([20.0, -10.0, 15.0]) * platform.UG,
        gyro_by_k=np.array([0.02, 0.01, -0.02]) * platform.DEG_H,
        scale_by_k=np.array([5.0, 10.0, -5.0]) * platform.PPM,
    )
    more = '[conditions]\ntemperature = "25 degC"\n[model]\nstates = '
    drive = Drive(THREE, ramp=0.4)
    recording, settings = recorded(
        tmp_path, 20261124, drive, NOMINAL, rig, more + '["extended", "sag", "g_sensitivity", "temperature"]'
    )
    found = estimate(recording, problem(settings), history=False)
    values, u = (
        dict(zip(found.names, to_product(found.coefficients), strict=True)),
        np.sqrt(np.diag(found.covariance)),
    )
    true = dict(zip(platform.NAMES, TRUTH, strict=True)) | {
        "sag_x": 0.0,
        "sag_y": rig.sag / platform.G,
        "sag_z": 0.0,
    }
    for i in "xyz":
        true |= {f"G_{i}{j}": rig.g_sensitivity / platform.G if i == j else 0.0 for j in "xyz"}
    for kind, each in (("ka0", rig.bias_by_k), ("kg0", rig.gyro_by_k), ("ka1", rig.scale_by_k)):
        true |= {f"{kind}_{i}_T1": value for i, value in zip("xyz", each, strict=True)}
    off = {
        name: (values[name] - true.get(name, 0.0)) / each for name, each in zip(found.names, u, strict=True)
    }
    assert max(map(abs, off.values())) < 4.5
    assert len(true) == 18 + 3 + 9 + 9
    _, paper = recorded(tmp_path, 20261124, drive, NOMINAL, rig, more + '"extended"')
    plain = estimate(recording, problem(paper), history=False)
    assert np.abs((plain.coefficients[:18] - found.coefficients[:18]) / u[:18]).max() > 10.0
