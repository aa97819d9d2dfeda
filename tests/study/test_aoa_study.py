"""The study of an angle of attack: what its keys mean, what is taken where they are absent, what is refused."""

import json
import math
import tomllib
from pathlib import Path

import pytest
from jsonschema import Draft202012Validator
from new_studies import load_turntable_study
from sting_study import DEG, SCENARIOS, G, scenario
from sting_text import CONTRACT, WRITTEN, calibrated, same, study

from inercal.faces.studies.load import (
    files_of,
    load_aoa_study,
    load_imu_study,
    load_selfcal_study,
)
from inercal.faces.studies.schema import json_schema
from inercal.foundation.errors import StudyError
from inercal.systems.aoa.disturbances import (
    AngleShaking,
    Disturbances,
    Mains,
    Oscillation,
    Plunge,
    Shaking,
    VibrationLine,
)
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.settings import AoaSettings, Estimator, Methods, Prior, SensorCalibration, Zero
from rows import for_each

SCHEMA = json_schema()
VALIDATOR = Draft202012Validator(SCHEMA)


@pytest.fixture
def write(tmp_path):
    def write(text):
        file = tmp_path / "study.toml"
        file.write_text(text, encoding="utf-8")
        return file

    return write


def test_the_study_of_the_contract(write):
    file = write(CONTRACT)
    found = load_aoa_study(file)
    same(found.layout, scenario("base").layout)
    same(found.noise, scenario("base").noise)
    same(found.motion, scenario("base").motion)
    assert (found.site.gravity, found.site.latitude) == (9.80665, pytest.approx(40.0 * DEG))
    assert found.sensors.keys() == {"a1", "a2", "a3", "gyro"}
    same(found.calibration("gyro"), SensorCalibration(range=40.0 * DEG))
    assert found.timing.gyro_delay is None
    assert (found.timing.common_delay, found.timing.common_delay_u) == pytest.approx((0.5e-3, 0.1e-3))
    assert found.estimator == Estimator(19, prior=file.parent / "last.json")
    assert found.prior == Prior()
    assert found.disturbances == Disturbances()
    assert json.loads(json.dumps(found.given)) == tomllib.loads(CONTRACT)
    VALIDATOR.validate(tomllib.loads(CONTRACT))


def test_what_is_absent_is_usual():
    found = study(motion=None, timing=None, estimator=None)
    usual = AoaSettings(found.site, found.layout, found.noise)
    for name in ("prior", "timing", "estimator", "methods", "attitude", "zero", "motion", "disturbances"):
        assert getattr(found, name) == getattr(usual, name)


@for_each("name", SCENARIOS)
def test_the_reference_scenarios_can_be_written(name):
    found, expected = study(**WRITTEN[name]), scenario(name)
    same(found.motion, expected.motion)
    same(found.disturbances, expected.disturbances)
    same(found.layout, expected.layout)
    for sensor in expected.sensors:
        same(found.calibration(sensor), expected.calibration(sensor))
    VALIDATOR.validate(found.given)


def test_all_that_settings_hold_is_reached():
    """Every field of the parts, set to something else than the usual."""
    found = study(
        prior={
            "lever_common": "4 mm", "lever": "2 mm", "height": "1 cm", "gyro_scale": "0.2 %", "gyro_delay": "1 ms",
            "heave": {"frequency": "7 Hz", "damping": 0.2, "level": "0.02 g", "direction": "vertical"},
            "axial": {"level": "1 mg"},
        },
        timing={"gyro_delay": "-2 ms", "common_delay": "1 ms"},
        estimator={"states": 8, "smooth": True, "snap": "2e6 rad^2/s^7", "gate": 9, "kind": "paper"},
        methods={"static": "complementary", "centrifugal": "low-pass", "tangential": "none"},
        model={"roll": "2.0(1) deg", "yaw": "-1 deg"},
        flow={"upwash": "0.10(2) deg", "sidewash": "1 mrad"},
        zero={"start": "1 s", "end": "5 s", "angle": "0.50(1) deg"},
        disturbances={
            "roll": {"amplitude": "1 deg", "frequency": "8 Hz"}, "yaw": {"amplitude": "2 deg", "frequency": "3 Hz"},
            "gyro_scale": "0.1 %", "gyro_delay": "2 ms", "common_delay": "-1 ms", "bandwidth": "100 Hz",
            "spikes": "0.01 %", "spike": "1 g", "dropouts": "1 %", "clip": True,
            "lines": [
                {"frequency": "112 Hz", "level": "0.3 g"}, {"frequency": "47 Hz", "level": "1 mg", "axial": "2 mg"}
            ],
            "local_vibration": {"rms": "0.5 g", "low": "120 Hz", "high": "240 Hz"}, "mains": {"level": "50 mg"},
            "buffet": {"rms": "0.1 deg", "low": "5 Hz", "high": "60 Hz"},
            "plunge": {"level": "0.02 g", "frequency": "2 Hz"}, "axis_errors": ["0 deg", "0.3 deg", "-1 mrad"],
            "rectification": "500 ug/g^2", "bias_drift": ["0 mg", "1 mg", "0 mg"], "stamp_jitter": "0.1 ms",
            "sample_rates": {"gyro": "250 Hz", "a2": "500 Hz"},
        },
        motion={"kind": "static", "first": "0 deg", "last": "0 deg", "sample_rate": "1 kHz"},
        traceability={"instrument": "model 7"},
        conditions={"temperature": "23 degC"},
    )  # fmt: skip
    prior = found.prior
    assert (prior.lever_common, prior.lever, prior.height) == pytest.approx((4e-3, 2e-3, 1e-2))
    assert (prior.gyro_scale, prior.gyro_delay) == pytest.approx((2e-3, 1e-3))
    heave = prior.heave
    assert (heave.frequency, heave.damping, heave.level) == pytest.approx((7.0, 0.2, 0.02 * G))
    assert heave.vertical
    assert not prior.axial.vertical
    assert (prior.axial.frequency, prior.axial.level) == pytest.approx((12.0, 1e-3 * G))
    assert (found.timing.gyro_delay, found.timing.common_delay) == pytest.approx((-2e-3, 1e-3))
    assert found.timing.common_delay_u == 0.0
    assert found.estimator == Estimator(8, True, None, 2e6, 9.0, "paper")
    assert found.methods == Methods("complementary", "low-pass", "none")
    of = found.attitude
    assert (of.roll.value, of.roll.u, of.yaw.value) == pytest.approx((2 * DEG, 0.1 * DEG, -DEG))
    assert (of.upwash.u, of.sidewash.value) == pytest.approx((0.02 * DEG, 1e-3))
    same(found.zero, Zero(1.0, 5.0, 0.5 * DEG, 0.01 * DEG))
    expected = Disturbances(
        roll=Oscillation(DEG, 8.0), yaw=Oscillation(2 * DEG, 3.0), gyro_scale=1e-3, gyro_delay=2e-3,
        common_delay=-1e-3, bandwidth=100.0, spikes=1e-4, spike=G, dropouts=0.01, clip=True,
        lines=(VibrationLine(112.0, 0.3 * G), VibrationLine(47.0, 1e-3 * G, 2e-3 * G)), local_vibration=Shaking(0.5 * G,
        120.0, 240.0), mains=Mains(0.05 * G), buffet=AngleShaking(0.1 * DEG, 5.0, 60.0), plunge=Plunge(0.02 * G, 2.0),
        axis_errors=(0.0, 0.3 * DEG, -1e-3), rectification=500e-6 / G, bias_drift=(0.0, 1e-3 * G, 0.0),
        stamp_jitter=1e-4, sample_rates={"gyro": 250.0, "a2": 500.0},
    )  # fmt: skip
    same(found.disturbances, expected)
    assert found.traceability["instrument"] == "model 7"
    assert found.temperature.value == 23.0
    VALIDATOR.validate(found.given)


@pytest.mark.parametrize(
    ("table", "expected"),
    [
        (
            {"kind": "static", "first": "-5 deg", "last": "5 deg", "duration": "20 s", "sample_rate": "2 kHz"},
            MotionPlan("static", 20.0, 2000.0, first=-5 * DEG, last=5 * DEG),
        ),
        (
            {"kind": "two-tone", "amplitude": "1 deg", "frequency": "2 Hz", "second_amplitude": "3 deg",
             "second_frequency": "4 Hz"},
            MotionPlan("two-tone", amplitude=DEG, frequency=2.0, second_amplitude=3 * DEG, second_frequency=4.0),
        ),
        (
            {"kind": "pitch-pause", "first": "9 deg", "last": "0 deg", "step": "-3 deg", "move": "1 s", "pause": "2 s"},
            MotionPlan("pitch-pause", first=9 * DEG, step=-3 * DEG, move=1.0, pause=2.0),
        ),
    ],
)  # fmt: skip
def test_other_motions(table, expected):
    same(study(motion=table).motion, expected)


def test_a_motion_from_a_file_lies_beside_the_study(tmp_path):
    found = study(tmp_path / "s.toml", motion={"kind": "file", "file": "pitch.csv"}).motion
    assert (found.path, found.duration) == (tmp_path / "pitch.csv", math.inf)
    assert study(motion={"kind": "file", "file": "a", "duration": "5 s"}).motion.duration == 5.0


REFUSED = {
    "sensors.a1.r=-250 m": r"sensors.a1.r: found '-250 m', expected a position within 5 m of the pivot \(mm given as m",
    "sensors.a1.z=7 m": "sensors.a1.z: .*mm given as m",
    "sensors.a1.r=0.20(1) m": "sensors.a1.r: found '0.20.1. m' with an uncertainty",
    "sensors.a1.r=0.2": "sensors.a1.r: found '0.2' without a unit",
    "sensors.a1.axis=up": "sensors.a1.axis: found 'up', expected '.x'",
    "sensors.a1.scale=0": "sensors.a1.scale: found 0, expected a number other than 0",
    "sensors.a1.scale=1 g": "sensors.a1.scale: found '1 g', expected a number",
    "sensors.a1.scale=1 deg/s/V": "sensors.a1.scale: found '1 deg/s/V', expected .*0.5 g/V",
    "sensors.a1.scale=1.00(2)": "sensors.a1.scale: .*without an uncertainty",
    "sensors.gyro.scale=1 g/V": "sensors.gyro.scale: .*20 deg/s/V",
    "sensors.a1.bias=1 V": "sensors.a1.bias: found '1 V', which is of voltage, expected",
    "sensors.a1.bias=1(1) mg": "sensors.a1.bias: .*with an uncertainty",
    "sensors.a1.bias_slope=10 ug": "sensors.a1.bias_slope: found '10 ug', expected one per kelvin",
    "sensors.a1.bias_slope=10 deg/s/K": "sensors.a1.bias_slope: found '10 deg/s/K', expected one such as '10 ug/K'",
    "sensors.a1.range=0 g": "sensors.a1.range: .*a range above zero",
    "sensors.a1.rnage=2 g": "sensors.a1.rnage: unknown key, did you mean range?",
    "sensors.gyro.axis=+x": "sensors.gyro.axis: unknown key",
    "sensors.gyro_rol.bias=1 deg/s": "sensors.gyro_rol: unknown key, did you mean gyro_roll?",
    'sensors.a5={axis = "+x", r = "1 mm"}': "sensors: found a5 without a4, expected them numbered from 1",
    'sensors.a4={r = "1 mm"}': "sensors.a4: found neither axis nor angle",
    'sensors={a1 = {axis = "+x", r = "1 mm"}}': "sensors: found a1, expected two accelerometers or more",
    'sensors={gyro = {}}': "sensors: found no accelerometer, expected two",
    'sensors={a1 = {axis = "+x", r = "1 mm"}, a2 = {axis = "-x", r = "1 mm"}}': "sensors: .*axes are all parallel",
    "noise.gyro=0 deg/s": "noise.gyro: .*a standard deviation above zero",
    "noise.gyro=5": "noise.gyro: found '5' without a unit",
    "noise.accelerometer_bias=1 g": "noise.accelerometer_bias: found '1 g', .*deviation above zero, 0.3 g at most.*mg",
    "noise.accelerometer=1e-4 deg": "noise.accelerometer: found '1e-4 deg', which is of angle",
    "prior.lever=0 mm": "prior.lever: .*above zero",
    "prior.lever=3 m": "prior.lever: .*mm given as m",
    "prior.heave.damping=1": "prior.heave.damping: .*below 1",
    "prior.heave.direction=up": "prior.heave.direction",
    "prior.heav.damping=0.1": "prior.heav: unknown key, did you mean heave?",
    "motion.kind=wobble": "motion.kind: found 'wobble', expected 'static'",
    "motion.kind=chirp": "motion.low: missing, expected it with kind = 'chirp'",
    "motion.rms=1 deg": "motion.rms: found with kind = 'sine', expected it with pitch-pause or buffet only",
    "motion.frequency=0 Hz": "motion.frequency: .*a frequency above zero",
    "motion.duration=1e9 s": "motion: found 1e.12 samples, expected 2 to 2e.07",
    "motion.duration=1 ms": "motion: found 1 samples",
    'motion={kind = "sine", amplitude = "1 deg"}': "motion.frequency: missing, expected it with kind = 'sine'",
    'motion={kind = "buffet", rms = "1 deg", low = "9 Hz", high = "2 Hz"}': "motion.low: found 9 Hz with high 2 Hz",
    'motion={kind = "pitch-pause", first = "0 deg", last = "9 deg", step = "2 deg"}': "motion.step: found '2 deg', ex",
    'motion={kind = "pitch-pause", first = "0 deg", last = "9 deg", step = "-3 deg"}': "motion.step: found '-3 deg'",
    'motion={kind = "pitch-pause", first = "0 deg", last = "9 deg", step = "0 deg"}': "motion.step: found '0 deg'",
    "timing.gyro_delay=guess": "timing.gyro_delay: found 'guess', expected",
    "timing.gyro_delay=2(1) ms": "timing.gyro_delay: .*with an uncertainty",
    "timing.common_delay=2": "timing.common_delay: found '2' without a unit",
    "timing.common_delay=2 min": "timing.common_delay: .*from -1 s to 1 s",
    "estimator.states=12": "estimator.states: found 12, expected 8, 11, 15 or 19",
    "estimator.snap=1e7": 'estimator.snap: found .10000000.0. without a unit, .* such as "1e9 rad.2/s.7", or auto',
    "estimator.snap=0 rad^2/s^7": "estimator.snap: found '0 rad.2/s.7', expected",
    "estimator.gate=0.5": "estimator.gate: found 0.5",
    "estimator.gate=wide": "estimator.gate: found 'wide'",
    "estimator.smooth=yes": "estimator.smooth: found 'yes', expected true or false",
    "methods.static=best": "methods.static: found 'best', expected 'segmented'",
    "methods.static=gls": "methods.static: found 'gls', which is gone since 0.3.0, expected in its place the fusion",
    "model.roll=200 deg": "model.roll: .*from -180 deg to 180 deg",
    "flow.upwash=50 deg": "flow.upwash: .*from -45 deg to 45 deg",
    'zero={start = "0 s", end = "5 s", angle = "0 deg"}': "zero.angle: found '0 deg', expected it with its standard",
    'zero={start = "5 s", end = "5 s", angle = "0.0(1) deg"}': "zero.start: found 5 s, expected it before end",
    'disturbances.heights=["1 mm"]': "disturbances.heights: found 1, expected one for each of a1, a2, a3",
    'disturbances.heave={rms = "1 g", low = "9 Hz", high = "9 Hz"}': "disturbances.heave.low: found 9 Hz",
    'disturbances.axis_errors=["1 mrad"]': "disturbances.axis_errors: found 1, expected one for each of a1, a2, a3",
    'disturbances.lines=[{frequency = "9 Hz"}]': "disturbances.lines.0.level: missing",
    "disturbances.rectification=500 ug": "disturbances.rectification: found '500 ug', which is of acceleration",
    'disturbances.sample_rates={gyro = "300 Hz"}': "found 300 Hz, expected motion.sample_rate, 1000",
    'disturbances.sample_rates={gyro = "2 kHz"}': "sample_rates.gyro: found 2000 Hz, expected motion.sample_rate",
    'disturbances.sample_rates={a4 = "100 Hz"}': "sample_rates.a4: found no such sensor, expected one of a1",
    "disturbances.spikes=1": "disturbances.spikes: .*below 1",
    "disturbances.pivot=3 m": "disturbances.pivot: .*mm given as m",
    "site.gravity=9 m/s^2": "site.gravity: .*check the unit",
    "nois.gyro=1 deg/s": "nois: unknown key, did you mean noise?",
}  # fmt: skip


@for_each(("override", "words"), REFUSED.items())
def test_one_sentence_for_what_is_wrong(write, override, words):
    with pytest.raises(StudyError, match=words) as error:
        load_aoa_study(write(CONTRACT), [override])
    assert "\n" not in str(error.value)
    assert str(error.value).startswith(str(error.value.where))


@for_each(
    ("tables", "words"),
    [
        ({"noise": None}, "noise: missing, expected a value"),
        ({"sensors": None}, "sensors: missing"),
        ({"rig": None}, "rig: missing"),
        ({"site": {}}, "site: neither gravity nor latitude given"),
        ({"sensors": {"a1": {"axis": "+x", "angle": "1 deg", "r": "0 m"}}}, "found both axis and angle"),
        ({"sensors": {"a1": {"axis": "+x"}}}, "sensors.a1.r: missing"),
        (
            {"disturbances": {"clip": True}, "sensors": WRITTEN["large"]["sensors"]},
            "clip: found true, but no range",
        ),
    ],
)
def test_what_is_missing_or_too_much(tables, words):
    with pytest.raises(StudyError, match=words):
        study(**tables)


def test_set_of_an_angle_takes_the_place_of_the_axis(write):
    found = load_aoa_study(
        write(CONTRACT), ["sensors.a1.angle=80 deg", "estimator.states=8", "site.gravity=9.81 m/s^2"]
    )
    assert found.layout.angle[0] == pytest.approx(80 * DEG)
    assert found.estimator.states == 8
    assert found.site.gravity == 9.81


def test_set_of_a_calibration_takes_the_place_of_scale_and_bias_and_back(write, tmp_path):
    file = tmp_path / "a1.json"
    calibrated(file, K0_x=(0.0, "g"), K1_x=(2.0, "g/(m/s^2)"), K0_y=(0.0, "g"), K1_y=(4.0, "g/(m/s^2)"))
    stated = CONTRACT.replace('scale = "1"', 'scale = "1"\nbias = "3 mg"')
    by_file = [f"sensors.a1.calibration={file}", "sensors.a1.channel=y"]
    found = load_aoa_study(write(stated), by_file).calibration("a1")
    assert (found.scale, found.bias) == pytest.approx((0.25 / G, 0.0))
    back = load_aoa_study(write(stated), [*by_file, "sensors.a1.bias=1 g"]).calibration("a1")
    assert (back.scale, back.bias) == pytest.approx((1.0, G))


@pytest.mark.parametrize("status", ["ok", "inconsistent"])
def test_what_a_calibration_says_against_itself_goes_with_it(write, tmp_path, status):
    file = tmp_path / "a1.json"
    calibrated(file, K0_x=(0.0, "g"), K1_x=(2.0, "g/(m/s^2)"))
    data = json.loads(file.read_text())
    data["status"] = {"code": status, "message": "as it\nwas"}
    file.write_text(json.dumps(data))
    found = load_aoa_study(write(CONTRACT), [f"sensors.a1.calibration={file}"]).calibration("a1")
    assert found.caution == ("" if status == "ok" else "a1.json ended inconsistent: as it was")


def test_studies_of_other_commands_are_told_apart(write):
    for load in (load_imu_study, load_turntable_study, load_selfcal_study):
        with pytest.raises(StudyError, match=r"rig\.kind: found 'sting', a study for `inercal aoa`"):
            load(write(CONTRACT))
    with pytest.raises(
        StudyError, match="a study for `inercal calibrate imu`, expected one for `inercal aoa`"
    ):
        load_aoa_study(write('[site]\nlatitude = "1 deg"\n[imu]\n'))
    with pytest.raises(StudyError, match="a study for `inercal selfcal`, expected one for `inercal aoa`"):
        load_aoa_study(write('[rig]\nkind = "three_axis_gimbals"\n'))


def test_the_files_that_a_study_names():
    """Those of sensors, prior and motion, beside the study; what a command does not read can be left out."""
    given = {
        "sensors": {"a1": {"axis": "-z", "calibration": "cal/a1.json"}, "a2": {"axis": "+x"}},
        "estimator": {"prior": "last.json"},
        "motion": {"kind": "file", "file": "pitch.csv"},
        "traceability": {"calibration": "no file"},
    }
    of = Path("rig/aoa.toml")
    read, left = Path("rig/cal/a1.json"), {"motion": "last.json", "estimator": "pitch.csv"}
    assert files_of(of, given) == (of, read, Path("rig/last.json"), Path("rig/pitch.csv"))
    for table, other in left.items():
        assert files_of(of, given, unread=table) == (of, read, of.with_name(other))
