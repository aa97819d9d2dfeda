"""What errors of a study would do to the angle: said by their size, and judged by it."""

from dataclasses import replace

import numpy as np
import pytest
from sting_study import NOISE, G, scenario, study

from inercal.systems.aoa.diagnosis.effect import effect, of_flexure
from inercal.systems.aoa.diagnosis.examination import diagnose
from inercal.systems.aoa.disturbances import Disturbances, Shaking
from inercal.systems.aoa.fusion.filter_result import estimate
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.motion import MotionPlan
from inercal.systems.aoa.settings import Prior
from inercal.systems.aoa.simulate import simulate


def flexure_said(settings):
    """The findings on flexure of a simulated recording, and the error of its angle over u."""
    made = simulate(settings, np.random.default_rng(1))
    of = problem(settings)
    found = estimate(made.recording, of)
    late = made.recording.t > 2.0
    ratio = np.sqrt(np.mean(np.square((found.theta - made.theta)[late] / found.u[late])))
    return of_flexure(made.recording, of, found, settings), ratio


def shaking(rms, level):
    """A study of a model whose sting shakes it by ``rms`` at 8 to 10 Hz, and that allows for ``level`` [g]."""
    prior = Prior()
    prior = replace(
        prior, heave=replace(prior.heave, level=level * G), axial=replace(prior.axial, level=level * G)
    )
    shaken = Disturbances(heave=Shaking(rms * G, 2.0, 10.0)) if rms else Disturbances()
    return study(motion=replace(scenario("base").motion, duration=8.0), prior=prior, disturbances=shaken)


def test_flexure_that_the_prior_allows_for_is_not_said():
    assert flexure_said(shaking(0.0, 0.01))[0] == []
    assert flexure_said(shaking(0.004, 0.01))[0] == []


def test_more_flexure_is_said_with_what_it_does_and_harms_only_where_that_is_more_than_u():
    """As much as is allowed: u has it. Fifty times as much as is allowed: the angle is off by far more than u."""
    (usual,), near = flexure_said(shaking(0.01, 0.01))
    assert usual.code == "flexure"
    assert near < 1.4
    assert usual.harm == ()
    (beyond,), far = flexure_said(shaking(0.01, 2e-4))
    assert far > 1.4
    assert beyond.harm
    assert "[prior.heave]" in beyond.message


def test_noise_harms_by_what_it_does_to_the_angle():
    """Three times the stated noise in a calm run is hardly seen in an angle that rests on biases; forty times is. What
    is said is of a row of the sensors, where a row of the recording stands for several."""
    calm = study(motion=MotionPlan("static", duration=8.0, first=0.5, last=0.5))
    for times, harms in ((3.0, False), (40.0, True)):
        louder = replace(calm, noise=replace(NOISE, accelerometer=times * NOISE.accelerometer))
        recording = simulate(louder, np.random.default_rng(2)).recording
        (said,) = [each for each in diagnose(recording, calm) if each.code == "excess_scatter"]
        assert bool(said.harm) == harms
        assert f'"{times * 1e-4:.1g} g"' in said.message.replace("0.00031", "0.0003")
        (fewer,) = [each for each in diagnose(recording, calm, every=4) if each.code == "excess_scatter"]
        assert "the 0.0002 g that" in fewer.message


def test_what_u_lacks_is_the_shift_and_the_growth_of_u():
    settings = study(motion=replace(scenario("base").motion, duration=6.0))
    made = simulate(settings, np.random.default_rng(3))
    plain = estimate(made.recording, problem(settings))
    off = replace(plain, theta=plain.theta + 3.0 * plain.u, u=np.hypot(plain.u, 4.0 * plain.u))
    told = effect(plain, off, made.recording.t)
    assert told.lack == pytest.approx(5.0)
    assert told.ratio == pytest.approx(3.0, rel=0.05)
    assert told.harm
    assert effect(plain, replace(plain, theta=np.full_like(plain.theta, np.nan)), made.recording.t) is None
