"""Gross faults: each is named where the physics shows it, none is found in sound recordings of any motion."""

from dataclasses import replace

import numpy as np
import pytest
from sting_study import BASE, DEG, SCENARIOS, G, clipped, scenario, study

from inercal.foundation.findings import Status
from inercal.systems.aoa.diagnosis.examination import diagnose, implausible
from inercal.systems.aoa.diagnosis.gross import gross_faults
from inercal.systems.aoa.disturbances import Disturbances, Oscillation
from inercal.systems.aoa.fusion.filter_result import estimate
from inercal.systems.aoa.fusion.filter_result import of_fusion as of_filter
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.result.verdict import of_fusion
from inercal.systems.aoa.settings import Timing
from inercal.systems.aoa.simulate import simulate

SHORT = study(motion=replace(BASE, duration=1.6))
REST = study(motion=MotionPlan("static", duration=1.6, first=10.0 * DEG, last=10.0 * DEG))
SWEEP = study(motion=MotionPlan("static", duration=7.0, first=-10.0 * DEG, last=30.0 * DEG))


def recorded(settings, seed):
    """A recording as reading leaves it."""
    return clipped(simulate(settings, np.random.default_rng([41, seed])).recording, settings)


def said(recording, settings):
    return [(finding.code, finding.message) for finding in implausible(recording, settings)]


SOUND = {
    **{name: scenario(name, duration=7.0) for name in SCENARIOS},
    "rest": REST,
    "sweep": SWEEP,
    "two-tone": study(
        motion=MotionPlan(
            "two-tone",
            duration=7.0,
            amplitude=5 * DEG,
            frequency=0.7,
            second_amplitude=DEG,
            second_frequency=6.0,
        )
    ),
    "micro": study(motion=replace(BASE, duration=7.0, amplitude=0.01 * DEG)),
    "spikes": study(
        motion=replace(BASE, duration=7.0), disturbances=Disturbances(spikes=1e-3, dropouts=1e-2)
    ),
    "gyros": study(motion=replace(BASE, duration=7.0), disturbances=Disturbances(yaw=Oscillation(DEG, 8.0))),
    "slow logger at rest": study(
        motion=MotionPlan("static", duration=65.0, first=5.0 * DEG, last=5.0 * DEG, sample_rate=100.0)
    ),
    "half a turn": study(motion=MotionPlan("static", duration=12.0, first=0.0, last=180.0 * DEG)),
    "slow logger": study(motion=replace(BASE, duration=40.0, sample_rate=100.0)),
}


@pytest.mark.parametrize("name", SOUND)
def test_sound_recordings_say_nothing(name):
    recording = recorded(SOUND[name], 0)
    assert implausible(recording, SOUND[name]) == []
    assert diagnose(recording, SOUND[name]) == []


def times(which, factor):
    def change(recording, settings):
        if which == "gyro":
            return replace(recording, gyro=factor * recording.gyro), settings
        if which == "r":
            return recording, replace(settings, layout=replace(settings.layout, r=factor * settings.layout.r))
        factors = np.ones(3)
        factors[which] = factor
        return replace(recording, acc=factors * recording.acc), settings

    return change


def order(*columns):
    return lambda recording, settings: (replace(recording, acc=recording.acc[:, columns]), settings)


GROSS = {
    "gyro -": (times("gyro", -1.0), "sign_suspect", "gyro looks reversed"),
    "gyro deg/s as rad/s": (times("gyro", 1.0 / DEG), "unit_suspect", "gyro looks to be in deg/s, taken for rad/s"),
    "gyro rad/s as deg/s": (times("gyro", DEG), "unit_suspect", "gyro looks to be in rad/s, taken for deg/s"),
    "a1 -": (times(0, -1.0), "sign_suspect", "a1 looks reversed"),
    "a2 -": (times(1, -1.0), "sign_suspect", "a2 looks reversed"),
    "a3 -": (times(2, -1.0), "sign_suspect", "a3 looks reversed"),
    "a1 a2": (order(1, 0, 2), "channel_swap", "a1 and a2 look exchanged"),
    "a2 a3": (order(0, 2, 1), "channel_swap", "a2 and a3 look exchanged"),
    "a1 a3": (order(2, 1, 0), "channel_swap", "a1 and a3 look exchanged"),
    "cycle": (order(1, 2, 0), "channel_swap", "a3 looks like a1, a1 looks like a2, a2 looks like a3"),
    "g as m/s^2": (times(slice(None), 1.0 / G), "unit_suspect", "a1, a2, a3 look to be in g, taken for m/s^2"),
    "m/s^2 as g": (times(slice(None), G), "unit_suspect", "a1, a2, a3 look to be in m/s^2, taken for g"),
    "mg as g": (times(slice(None), 1e3), "unit_suspect", "a1, a2, a3 look to be in mg, taken for g"),
    "a2 mg as g": (times(1, 1e3), "unit_suspect", "a2 looks to be in mg, taken for g"),
    "r in mm": (times("r", 1e3), "unit_suspect", "the positions r of the accelerometers look to be in mm"),
    "r in km": (times("r", 1e-3), "unit_suspect", "the positions r of the accelerometers look to be in m, taken"),
    "r -": (times("r", -1.0), "sign_suspect", "the positions r of all accelerometers look reversed"),
}  # fmt: skip


@pytest.mark.parametrize("name", GROSS)
def test_gross_faults_are_named(name):
    change, code, text = GROSS[name]
    ((found, message),) = said(*change(recorded(SHORT, 0), SHORT))
    assert found == code
    assert message.startswith(text)
    assert "equally possible" not in message


@pytest.mark.slow
@pytest.mark.parametrize(
    "motion", [pytest.param("pitch-pause", marks=pytest.mark.campaign), "flexure", "buffet"]
)
def test_gross_faults_in_other_motions(motion):
    settings = scenario(motion, duration=2.5)
    recording = recorded(settings, 3)
    for name in ("gyro -", "r in mm"):
        change, code, text = GROSS[name]
        ((found, message),) = said(*change(recording, settings))
        assert found == code
        assert message.startswith(text)


def test_at_rest_only_accelerometers_across_show():
    # at rest nothing tells the gyro's sign, the positions, or the sign of an accelerometer along the model; arms of
    # 250 m no tunnel has room for
    recording = recorded(REST, 0)
    ((found, message),) = said(*GROSS["r in mm"][0](recording, REST))
    assert found == "unit_suspect"
    assert "250 m from the pivot" in message
    for name in ("gyro -", "a2 -", "r -"):
        assert said(*GROSS[name][0](recording, REST)) == []
    for name in ("a1 -", "a3 -", "a2 a3", "m/s^2 as g"):
        change, code, text = GROSS[name]
        ((found, message),) = said(*change(recording, REST))
        assert found == code
        assert message.startswith(text)


@pytest.mark.slow
def test_small_errors_are_no_gross_ones():
    # an axis off by a few mrad, and slow drifts, are not taken for a gyro that tells of something else
    settings = study(motion=replace(BASE, duration=4.0))
    recording = recorded(settings, 0)
    off = replace(
        settings, layout=replace(settings.layout, angle=settings.layout.angle + np.array([4e-3, 0, 0]))
    )
    assert said(recording, off) == []
    drift = np.linspace(0.0, 1e-3 * G, len(recording.t))[:, None]
    assert said(replace(recording, acc=recording.acc + drift), settings) == []
    walk = np.cumsum(np.random.default_rng(2).standard_normal(len(recording.t))) * 4e-5
    assert said(replace(recording, gyro=recording.gyro + walk), settings) == []


@pytest.mark.parametrize("name", ["a1 a3", "a2 -"])
def test_a_gross_fault_is_no_good_verdict(name):
    """Resonators take up much of the contradiction, and the angle is wrong by tens of degrees."""
    recording, settings = GROSS[name][0](recorded(SHORT, 0), SHORT)
    found = estimate(recording, problem(settings))
    status, message = of_fusion(recording, found, of_filter(found, 19), implausible(recording, settings))
    assert status is Status.INCONSISTENT
    assert GROSS[name][2] in message


def test_a_late_gyro_is_no_good_verdict():
    """2 ms that are stated as none cost 0.2 deg rms, which flexure takes up: NIS alone stays below its limit."""
    late = Disturbances(gyro_delay=2e-3)
    settings = study(motion=replace(BASE, duration=12.0), disturbances=late, timing=Timing(0.0))
    recording = recorded(settings, 0)
    found = estimate(recording, problem(settings))
    status, message = of_fusion(recording, found, of_filter(found, 19), implausible(recording, settings))
    assert status is Status.INCONSISTENT
    assert "write gyro_delay" in message


def test_centimetres_taken_for_metres():
    recording, settings = times("r", 100.0)(recorded(SHORT, 0), SHORT)
    ((code, message),) = said(recording, settings)
    assert code == "unit_suspect"
    assert "look to be in cm, taken for m" in message


def test_a_model_on_its_back():
    # a1 and a3 exchanged turn theta to 180 deg - theta; at rest nothing else tells
    recording, settings = GROSS["a1 a3"][0](recorded(REST, 0), REST)
    ((code, message),) = said(recording, settings)
    assert code == "not_stated"
    assert message.startswith("theta is about 170 deg, the model on its back")


def test_two_faults_at_once():
    recording, settings = times("gyro", -1.0)(*times(1, 1.0 / G)(recorded(SHORT, 0), SHORT))
    found = said(recording, settings)
    assert {code for code, _ in found} == {"sign_suspect", "unit_suspect"}
    assert any("a2 looks to be in g" in text for _, text in found)
    assert any("gyro looks reversed" in text for _, text in found)


@pytest.mark.parametrize("delay", [pytest.param(2e-3, marks=pytest.mark.campaign), -4e-3, 20e-3])
def test_a_gyro_that_is_late(delay):
    late = Disturbances(gyro_delay=delay)
    settings = study(motion=replace(BASE, duration=12.0), disturbances=late, timing=Timing(0.0))
    recording = recorded(settings, 0)
    ((code, message),) = said(recording, settings)
    assert code == "command_shift"
    assert f'write gyro_delay = "{1e3 * delay:.2g} ms"' in message
    for known in (delay, None):  # stated, or estimated as by default
        assert said(recording, replace(settings, timing=Timing(known))) == []


def test_a_gyro_that_is_later_than_is_estimated():
    """40 ms, eight of the prior's standard deviations: named, with the number to write."""
    settings = study(motion=replace(BASE, duration=12.0), disturbances=Disturbances(gyro_delay=40e-3))
    ((code, message),) = said(recorded(settings, 0), settings)
    assert code == "command_shift"
    assert 'write gyro_delay = "40 ms" under [timing]' in message


def test_a_gyro_of_another_axis():
    recording = recorded(SHORT, 0)
    other = 0.3 * np.sin(2.0 * np.pi * 3.3 * recording.t) + 0.2 * DEG * np.random.default_rng(
        5
    ).standard_normal(len(recording.t))
    ((code, message),) = said(replace(recording, gyro=other), SHORT)
    assert code == "channel_swap"
    assert message.startswith("gyro does not tell of the pitch")


def test_roll_and_yaw_gyros():
    settings = study(
        motion=replace(BASE, duration=2.0),
        disturbances=Disturbances(yaw=Oscillation(3.0 * DEG, 5.0), roll=Oscillation(5.0 * DEG, 1.3)),
    )
    recording = recorded(settings, 0)
    assert said(recording, settings) == []
    exchanged = replace(recording, turns=recording.turns[:, ::-1].copy())
    assert said(exchanged, settings)[0][0] == "channel_swap"
    in_degrees = replace(recording, turns=recording.turns / DEG)
    assert said(in_degrees, settings)[0][0] == "unit_suspect"


def test_each_fault_taken_out_twice_is_none_or_known():
    # taking out a reversal or an exchange twice leaves the recording as it was
    recording = recorded(SHORT, 0)
    case = recording, SHORT
    for fault in gross_faults(case):
        if fault.code == "sign_suspect" or "exchanged" in fault.name:
            again, settings = fault.without(fault.without(case, np.empty(0)), np.empty(0))
            np.testing.assert_array_equal(again.acc, recording.acc)
            np.testing.assert_array_equal(again.gyro, recording.gyro)
            np.testing.assert_array_equal(settings.layout.r, SHORT.layout.r)
