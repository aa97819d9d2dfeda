"""An encoder that repeats one reading while its joint rests: commands do not tell, its missing noise does."""

from dataclasses import replace

import numpy as np
from paper_study import ARCSEC, study

from inercal.systems.selfcal.diagnosis.examination import diagnose
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.simulate import experiment, simulate


def named(th_of):
    stated = study("best")
    made = simulate(experiment(stated), np.random.default_rng(4)).recording
    made = replace(made, th=th_of(made.th.copy()))
    of = problem(stated)
    return diagnose(made, of, estimate(made, of, history=False))


def test_a_reading_that_is_repeated_at_rest_is_named():
    """The platform drifts by coefficients that are not known yet: tens of arc seconds in 40 s."""

    def stuck(th):
        th[500:700, 0] = th[500, 0]
        return th

    (found,) = named(stuck)
    assert found.code == "stuck_encoder"
    assert found.message == "th_x repeats one reading in 200 rows"
    assert found.where == "rows 502-700"


def test_a_coarse_encoder_is_not_stuck():
    """Steps of 5 arcsec beside noise of 2 arcsec repeat readings too; they are scatter, evenly."""
    found = named(lambda th: np.round(th / (5 * ARCSEC)) * (5 * ARCSEC))
    assert all(finding.code != "stuck_encoder" for finding in found)
