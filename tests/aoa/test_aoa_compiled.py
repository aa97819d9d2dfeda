"""The compiled fusion: the same as what its source says in plain Python."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

import inercal

RUN = """
import json
from dataclasses import replace
import numpy as np
from sting_study import BASE, DEG, study
from inercal.systems.aoa.fusion import loop
from inercal.systems.aoa.fusion import smoother
from inercal.systems.aoa.fusion.filter_result import estimate
from inercal.systems.aoa.fusion.problem import problem
from inercal.systems.aoa.disturbances import Disturbances, Oscillation
from inercal.systems.aoa.settings import Timing
from inercal.systems.aoa.simulate import simulate

found = {}
for states in (8, 19):
    for spatial in (False, True):
        settings = study(
            states,
            motion=replace(BASE, duration=0.1),
            timing=Timing(None),
            disturbances=Disturbances(yaw=Oscillation(DEG, 8.0), spikes=0.01),
        )
        recording = simulate(settings, np.random.default_rng(4)).recording
        for smoothed in (False, True):
            got = estimate(recording, problem(settings, spatial), smoothed)
            found[f"{states} {spatial} {smoothed}"] = [*got.theta, *got.u, *got.rate, *got.rate_u, got.nis_mean]
print(json.dumps(found))
"""


def ran(**environment):
    """What a new process finds on a tenth of a second with the filter and the smoother."""
    package = os.path.dirname(os.path.dirname(inercal.__file__))
    studies = os.path.join(os.path.dirname(os.path.dirname(__file__)), "studies")
    done = subprocess.run(
        [sys.executable, "-c", RUN],
        env=os.environ | {"PYTHONPATH": os.pathsep.join([package, studies])} | environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
def test_kernels_say_the_same_as_plain_python():
    """Without compiling: apart by rounding alone."""
    plain = ran(INERCAL_KERNELS="python")
    for name, numbers in ran().items():
        np.testing.assert_allclose(numbers, plain[name], rtol=1e-6, atol=1e-10, err_msg=name)
