"""What users do wrong with sides, rates and turns: each is named with its file and axis, and a sound set with none."""

import dataclasses

import numpy as np
import pytest

from inercal.systems.imu.sections.cutting.checks import contradictions
from inercal.systems.imu.sections.section import Section

GAIN, BIAS = 1670.0, np.array([570.0, -20.0, 640.0])  # counts
GYRO_GAIN, GYRO_BIAS = 131.0 * 180.0 / np.pi, np.array([-560.0, 110.0, -73.0])
SIDES = {
    f"{axis}_{word}": s * np.eye(3)[k]
    for k, axis in enumerate("xyz")
    for word, s in (("up", 1.0), ("down", -1.0))
}


def six_sides(seed=1, tilt=0.03):
    """Six rests on sides, each off by a few degrees."""
    rng = np.random.default_rng(seed)
    rests = {}
    for name, up in SIDES.items():
        force = up + tilt * rng.normal(size=3)
        acc = BIAS + GAIN * 9.81 * force / np.linalg.norm(force)
        rests[name] = Section(
            "rest", name, f"{name}.csv", acc=acc, gyro=GYRO_BIAS + rng.normal(size=3), up=up
        )
    return rests


def rates(seed=2):
    """Rates of ±30 deg/s about each axis, and a turn."""
    rng = np.random.default_rng(seed)
    made = {}
    for k, axis in enumerate("xyz"):
        for rate in (0.5, -0.5):
            w = rate * np.eye(3)[k] + 0.01 * rng.normal(size=3)
            name = f"{axis} {rate:+g}"
            made[name] = Section(
                "rate", name, f"{name}.csv", gyro=GYRO_BIAS + GYRO_GAIN * w, axis=np.eye(3)[k], rate=rate
            )
    spin = GYRO_BIAS + GYRO_GAIN * np.array([0.0, 0.0, 1.0])
    made["turn"] = Section(
        "turn", "turn", "turn.csv", gyro=spin, axis=np.eye(3)[2], angle=2.0 * np.pi, duration=2.0 * np.pi
    )
    return made


def said(sections, scale=None):
    return [(finding.code, finding.line) for finding in contradictions(list(sections.values()), scale)]


def changed(sections, name, **fields):
    return {**sections, name: dataclasses.replace(sections[name], **fields)}


@pytest.mark.parametrize("seed", range(20))
def test_nothing_is_said_of_sound_sections(seed):
    assert said({**six_sides(seed, tilt=0.08), **rates(seed)}, GYRO_GAIN) == []
    assert said({**six_sides(seed), **rates(seed)}) == []


@pytest.mark.parametrize("axis", "xyz")
def test_plus_and_minus_exchanged_names_both_files_and_the_axis(axis):
    sides = six_sides()
    up, down = f"{axis}_up", f"{axis}_down"
    wrong = changed(changed(sides, up, acc=sides[down].acc), down, acc=sides[up].acc)
    found = said(wrong)
    assert [code for code, _ in found] == ["sign_suspect"] * 2
    assert f"{up} stands on -{axis}, not on +{axis}" in found[0][1]
    assert f"{down}.csv" in found[1][1]


def test_two_axes_exchanged_names_their_four_files():
    sides = six_sides()
    wrong = {name: dataclasses.replace(one, acc=one.acc[[1, 0, 2]]) for name, one in sides.items()}
    found = said(wrong)
    assert [code for code, _ in found] == ["channel_swap"] * 4
    assert "x_up stands on +y, not on +x" in found[0][1]


@pytest.mark.parametrize("missing", SIDES)
def test_a_side_taken_twice_is_named_alone(missing):
    """The others are sound, though the middle of their range is not where it was."""
    sides = six_sides()
    other = missing.replace("up", "DOWN").replace("down", "up").replace("DOWN", "down")
    found = said(changed(sides, missing, acc=sides[other].acc + 5.0))
    assert len(found) == 1
    assert f"hold the same side, which looks like that of {other}" in found[0][1]
    assert f"Record the side of {missing} again" in found[0][1]


def test_all_sides_opposed_is_one_question():
    wrong = {name: dataclasses.replace(one, acc=2.0 * BIAS - one.acc) for name, one in six_sides().items()}
    (found,) = said(wrong)
    assert found[0] == "sign_suspect"
    assert "gravity, down" in found[1]


def test_a_file_in_another_unit_is_named():
    sides = six_sides()
    wrong = {name: dataclasses.replace(one, acc=one.acc - BIAS) for name, one in sides.items()}
    (found,) = said(changed(wrong, "y_up", acc=wrong["y_up"].acc / 9.81))
    assert found[0] == "unit_suspect"
    assert "y_up reads 0.1" in found[1]


def test_a_tilted_rest_is_named_with_its_angle():
    sides = six_sides()
    leaned = np.array([np.sin(0.5), 0.0, np.cos(0.5)])
    (found,) = said(changed(sides, "z_up", acc=BIAS + GAIN * 9.81 * leaned))
    assert found[0] == "poor_section"
    assert "deg off +z" in found[1]


def test_a_rate_of_the_wrong_sign_is_named():
    everything = {**six_sides(), **rates()}
    (found,) = said(changed(everything, "y -0.5", rate=0.5))
    assert found[0] == "sign_suspect"
    assert "y -0.5 turns the other way than its rate says, about y" in found[1]


def test_all_rates_of_the_wrong_sign_are_one_question():
    everything = {
        name: dataclasses.replace(one, rate=-one.rate, angle=-one.angle) for name, one in rates().items()
    }
    (found,) = said(everything)
    assert "right-hand rule" in found[1]


@pytest.mark.parametrize("scale", [None, GYRO_GAIN])
def test_a_rate_or_angle_that_the_gyro_contradicts_is_named(scale):
    everything = {**six_sides(), **rates()}
    (found,) = said(changed(everything, "x +0.5", rate=1.0), scale)
    assert found[0] == "rate_suspect"
    assert "stated as 57.2958 deg/s, and the gyro reads about 28" in found[1]
    (found,) = said(changed(everything, "turn", angle=4.0 * np.pi), scale)
    assert "stated as 720 deg, and the gyro reads about 3" in found[1]


def test_a_rate_about_another_axis_is_named():
    (found,) = said(changed({**six_sides(), **rates()}, "x +0.5", axis=np.eye(3)[1]))
    assert found[0] == "channel_swap"
    assert "turns about x, not about y" in found[1]


def test_a_gyro_of_another_range_is_one_question():
    """All rates at half of what is stated: no rate is wrong."""
    everything = {**six_sides(), **rates()}
    halved = {
        name: dataclasses.replace(one, rate=2.0 * one.rate, angle=2.0 * one.angle)
        for name, one in everything.items()
    }
    (found,) = said(halved, GYRO_GAIN)
    assert found[0] == "unit_suspect"
    assert "another range" in found[1]
