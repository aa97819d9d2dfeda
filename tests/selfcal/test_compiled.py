"""The compiled filters: the same as what their source says in plain Python."""

import json
import os
import subprocess
import sys

import numpy as np
import pytest

import inercal

RUN = """
import json, sys
import numpy as np
from paper_study import study
from inercal.systems.selfcal.before import bounds
from inercal.systems.selfcal.filters import error_state
from inercal.systems.selfcal.filters import gimbal
from inercal.systems.selfcal.filters import quaternion
from inercal.systems.selfcal.before.bounds import recorded_bounds
from inercal.systems.selfcal.before.considered import both
from inercal.systems.selfcal.filters.problem import problem
from inercal.systems.selfcal.filters.run import estimate
from inercal.systems.selfcal.platform.plan import PlatformPlan, Turn
from inercal.systems.selfcal.platform.states import ALL
from inercal.systems.selfcal.settings import Filter
from inercal.systems.selfcal.simulate import experiment, simulate

found = {}
for extended in (False, True):
    settings = study(plan=PlatformPlan((Turn("z", 0.05), Turn("x", 0.05))), filter=Filter(extended=extended))
    recording = simulate(experiment(settings), np.random.default_rng(4)).recording
    of = problem(settings)
    for kind in ("svd-qukf", "gimbal-ukf", "error-state"):
        got = estimate(recording, of, kind)
        u = np.sqrt(np.diag(got.covariance))
        found[f"{kind} {extended}"] = [*(got.coefficients / of.prior), *(u / of.prior), got.nis_mean]
    path = recorded_bounds(recording, of, got.history.attitude, got.coefficients, contributions=True)
    found[f"bounds {extended}"] = [*(path.u / of.prior)]
    names = [name for name in ALL if name not in of.states.names][:4]
    slopes, changes = both(recording, of, got.history.attitude, got.coefficients, names, ())
    changes /= of.prior[:, None]
    found[f"not fitted {extended}"] = [*changes.ravel() / np.abs(changes).max()]
    found[f"innovations {extended}"] = [*slopes.ravel() / np.abs(slopes).max()]
print(json.dumps(found))
"""


def ran(**environment):
    """What a new process finds on a short path with all recursive filters, the bounds, and what is not fitted."""
    package = os.path.dirname(os.path.dirname(inercal.__file__))
    studies = os.path.join(os.path.dirname(os.path.dirname(__file__)), "studies")
    paths = os.pathsep.join([package, studies])
    done = subprocess.run(
        [sys.executable, "-c", RUN],
        env=os.environ | {"PYTHONPATH": paths} | environment,
        capture_output=True,
        text=True,
        timeout=300,
    )
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


@pytest.mark.slow
def test_kernels_say_the_same_as_plain_python():
    """Without compiling: apart by rounding alone, 1e-9 of the prior."""
    plain = ran(INERCAL_KERNELS="python")
    for name, numbers in ran().items():
        np.testing.assert_allclose(numbers, plain[name], rtol=1e-6, atol=1e-9, err_msg=name)
