"""A base of unknown heading is found by earth rate, in every frame and from every heading."""

import math
from dataclasses import replace

import numpy as np
import pytest
from paper_study import study

from inercal.selfcal.filtered import problem
from inercal.selfcal.filtering import estimate
from inercal.selfcal.heading import with_heading
from inercal.selfcal.rig import Base, Gimbals
from inercal.selfcal.simulate import experiment, simulate


@pytest.mark.parametrize("degrees", [-170.0, -75.0, 20.0, 137.0])
def test_any_heading_is_found(degrees):
    """To a few arcminutes from 9 min of turning, within 5 of its own standard deviations; coefficients too."""
    settings = study("best", base=Base(heading=math.radians(degrees)))
    made = experiment(settings)
    recording = simulate(made, np.random.default_rng(20261121)).recording
    told = with_heading(recording, replace(settings, base=Base()))
    found = estimate(recording, problem(told))
    u = np.sqrt(np.diag(found.covariance))
    miss = math.remainder(told.base.heading - math.radians(degrees), 2 * math.pi)
    assert u[22] < math.radians(0.1)
    assert abs(miss + found.coefficients[22]) < 5 * u[22]
    assert np.abs((found.coefficients - made.truth)[:18] / u[:18]).max() < 5.0


@pytest.mark.parametrize("seed", [3, 6])
def test_coefficients_are_those_of_a_known_heading(seed):
    """What was not known at first costs nothing in the end: earth rate tells the heading to a minute of arc."""
    settings = study("best", base=Base(heading=math.radians(137.0)))
    extended = replace(settings, filter=replace(settings.filter, extended=True))
    recording = simulate(experiment(settings), np.random.default_rng(seed)).recording
    told = with_heading(recording, replace(settings, base=Base()))
    wide = settings.prior.copy()
    wide[22] = math.radians(1.0)
    known = estimate(recording, problem(replace(extended, prior=wide)))
    found = estimate(recording, problem(told))
    u = np.sqrt(np.diag(known.covariance))
    assert np.abs((found.coefficients - known.coefficients)[:22] / u[:22]).max() < 0.3


@pytest.mark.parametrize(("frame", "axes"), [("enu", ("y", "x", "z")), ("ned", ("x", "y", "z"))])
def test_in_other_frames(frame, axes):
    """The heading counts from north to east whatever the axes of the platform are called."""
    settings = study("best", base=Base(frame=frame, heading=1.0), gimbals=Gimbals(axes))
    recording = simulate(experiment(settings), np.random.default_rng(20261121)).recording
    told = with_heading(recording, replace(settings, base=Base(frame=frame)))
    assert told.base.heading == pytest.approx(1.0, abs=math.radians(0.3))
