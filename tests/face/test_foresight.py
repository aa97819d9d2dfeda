"""Plans before the test: u against the searches', levers against keys of a study, verticals against the models'."""

from dataclasses import replace

import numpy as np
import pytest

import inercal as ic
from inercal.examples import FOLDER
from inercal.faces.python.study import foresight, read_study, verticals
from inercal.foundation.errors import InercalError
from inercal.foundation.geometry.rotations import to_matrix
from inercal.foundation.rigs.plans import Plan, named
from inercal.systems.selfcal.before.bounds import bounds
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.platform.kinematics import attitude
from inercal.systems.selfcal.platform.plan import motion
from inercal.systems.strapdown.before.bounds import Pieces
from inercal.systems.strapdown.before.bounds import bounds as turn_bounds
from inercal.systems.turntable.model import channels_of
from inercal.systems.turntable.positions.fit import choose_terms
from inercal.systems.turntable.positions.foresight import foresight as system_foresight
from inercal.systems.turntable.positions.planning import design
from inercal.systems.turntable.positions.tolerance_design import trial

TURNS = '\n[plan]\nturns = [["y", "90 deg"], ["z", "-90 deg"], ["x", "90 deg"], ["y", "180 deg"]]\n'
FILES = {
    "turntable": "gyro.toml",
    "selfcal": "selfcal.toml",
    "strapdown": "strapdown.toml",
    "aoa": "sting.toml",
}


@pytest.fixture(scope="module")
def studies(tmp_path_factory):
    """A study of each kind, read with what is set beside it."""
    folder = tmp_path_factory.mktemp("plans")
    for name in FILES.values():
        text = (FOLDER / name).read_text()
        (folder / name).write_text(text + (TURNS if name == "strapdown.toml" else ""))
    return lambda kind, *sets: read_study(kind, folder / FILES[kind], sets)


@pytest.mark.parametrize("kind", FILES)
def test_a_lever_does_what_its_key_in_the_study_does(studies, kind):
    whole = foresight(studies(kind))
    one = np.ones(len(whole.levers))
    for k, lever in enumerate(whole.levers[:6]):
        halved = foresight(studies(kind, lever.setting(0.5)))
        factors = one.copy()
        factors[k] = 0.5
        np.testing.assert_allclose(whole.u(factors), halved.u(one), rtol=1e-3)  # four digits are written


def test_a_plan_there_and_back_hides_fewer_faults_by_order_and_history(studies):
    """Each position twice, the second time in the reverse order: a drift is no longer like a term. Readings of the same
    size tell no more about curves."""
    settings = studies("turntable").settings
    angles = np.asarray(named("24-position").angles)
    once, twice = (
        system_foresight(replace(settings, plan=Plan("own", some))).blind
        for some in (angles, np.concatenate([angles, angles[::-1]]))
    )
    assert twice["order"] < once["order"]
    assert twice["history"] <= once["history"]
    assert all(0.0 <= share <= 1.0 for share in (*once.values(), *twice.values()))


def test_uncertainties_of_positions_are_those_of_their_design(studies):
    settings = studies("turntable").settings
    asked = replace(settings.design, candidates=named("24-position"), compare=("24-position",))
    judged = design(replace(settings, plan=named("12-position"), design=asked)).compare
    expected = next(each for each in judged if each.plan.name == "24-position").figures
    found = foresight(studies("turntable"))
    u = found.u(np.ones(len(found.levers)))
    np.testing.assert_allclose(u, [*expected.u, expected.rms_prediction], rtol=1e-9)


def test_shares_of_a_path_are_those_of_the_covariance_split_by_source(studies):
    """Joseph's form splits the covariance along the path; here it comes from its change with the noise."""
    settings, found = studies("selfcal").settings, foresight(studies("selfcal"))
    along = bounds(motion(settings.plan, settings.world), problem(settings), contributions=True)
    expected = [along.shares[source] for source in ("angle random walk", "accelerometer", "encoder")]
    np.testing.assert_allclose(found.shares(np.ones(3)), expected, atol=1e-3)


def test_shares_of_positions_are_those_of_the_gain(studies):
    settings, found = studies("turntable").settings, foresight(studies("turntable"))
    used = choose_terms(settings, channels_of(settings), settings.plan.angles)[0]
    test = trial(settings.plan, settings, used, dict.fromkeys(found.names, 1.0))
    noise, inputs, errors = test.parts(np.ones(len(settings.chain.errors)))
    whole = noise + inputs.sum(axis=1) + errors.sum(axis=1)
    expected = np.vstack([noise, errors.T]) / whole
    np.testing.assert_allclose(found.shares(np.ones(len(found.levers))), expected, atol=1e-4)


def test_the_vertical_of_a_platform_is_that_of_the_kinematics(studies):
    settings, shown = studies("selfcal").settings, verticals(studies("selfcal"))
    world = settings.world
    vertical = world.up / np.linalg.norm(world.up)
    at = settings.plan.angles()[np.cumsum([0, *map(settings.plan.steps, settings.plan.moves)])]
    expected = [to_matrix(np.array(attitude(angles, world.axes, world.signs))).T @ vertical for angles in at]
    np.testing.assert_allclose(shown, expected, atol=1e-12)


def test_the_vertical_of_a_table_and_of_turns_is_that_of_their_models(studies):
    settings = studies("turntable").settings
    C = settings.chain.attitude(settings.plan.angles)
    np.testing.assert_allclose(verticals(studies("turntable")), C[:, 2, :], atol=1e-12)
    settings = studies("strapdown").settings
    along = turn_bounds(Pieces(settings), settings.plan)
    np.testing.assert_allclose(verticals(studies("strapdown")), along.up, atol=1e-9)


def test_a_model_in_motion_has_no_stops(studies):
    assert verticals(studies("aoa")).shape == (0, 3)


def test_a_plan_that_cannot_be_judged_is_refused_in_a_sentence(studies, tmp_path):
    with pytest.raises(InercalError, match="do not identify"):
        foresight(studies("turntable", "positions.plan=6-position"))
    with pytest.raises(InercalError, match="kind imu"):
        foresight(ic.study("imu", latitude="45 deg"))
    for kind, before, after, words in (
        ("strapdown", "[rests]", "[rests]", "turns"),
        ("turntable", 'plan = "24-position"', "grid = { phi1 = 36, phi2 = 36 }", "1296 positions"),
        ("turntable", 'noise = "0.01 deg/h"', "", "instrument.noise"),
    ):
        path = tmp_path / f"{kind}.toml"
        path.write_text((FOLDER / FILES[kind]).read_text().replace(before, after))
        with pytest.raises(InercalError, match=words):
            foresight(read_study(kind, path))
