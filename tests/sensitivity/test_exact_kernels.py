"""The compiled passes: the same numbers as plain NumPy, as plain Python, and on any number of threads."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import inercal
from inercal.foundation.geometry.rotations import elementary
from inercal.foundation.rigs.outputs import Output, table_outputs
from inercal.foundation.rigs.patterns import density, normal, uniform
from inercal.foundation.rigs.plans import grid
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.sensitivities import dense
from inercal.foundation.sensitivities.exact import analyse, closed_variance

PACKAGE = Path(inercal.__file__).parent
PARTS = ("variance", "bias", "first_variance", "interaction_variance", "shapley", "second_variance")
OUTPUTS = (
    *table_outputs(("ax", "ay", "az", "wx", "wy"), 9.8, 0.7),
    Output("askew", np.array([0.3, 1.0, -0.2]), np.array([0.5, -0.6, 0.1]), "1", 1.0),
)


def rigs():
    """Rigs with all that a chain can hold but offsets."""
    lopsided = density(lambda x: 1.0 + x, -0.3, 0.6)
    yield turntable("two_axis_turntable", uniform(np.radians(2.0 / 60.0)))
    yield turntable(
        "three_axis_turntable",
        lopsided,
        errors={"dbase_x": normal(0.2), "dphi_y2": uniform(1.0)},
        base=(0.3, 0.1, -0.2),
        mounting=elementary("x", 0.7),
    )


@pytest.mark.parametrize("chain", list(rigs()), ids=["two axes", "three axes"])
def test_compiled_and_plain_agree_to_rounding(chain):
    """`inercal.foundation.sensitivities.dense` is written apart, with matrices in place of components."""
    angles = np.random.default_rng(8).uniform(-np.pi, np.pi, (7, len(chain.joints)))
    found = analyse(chain, OUTPUTS, angles, shapley=True, second=True)
    plain_chain = dense.blocks(chain, angles, (1,))
    plain = dense.analyse(plain_chain, OUTPUTS, shapley=True, second=True)
    for part in PARTS:
        expected = getattr(plain, part)
        whole = np.abs(expected).reshape(len(OUTPUTS), -1).max(axis=1)
        floor = 1e-15 * whole.reshape(-1, *(1,) * (expected.ndim - 1))
        assert np.all(np.abs(getattr(found, part) - expected) <= 1e-13 * np.abs(expected) + floor), part
    some = chain.factors[::2]
    np.testing.assert_allclose(
        closed_variance(chain, OUTPUTS, angles, some),
        dense.closed_variance(plain_chain, OUTPUTS, some),
        rtol=1e-12,
    )


def test_order_of_positions_and_threads_do_not_change_a_digit():
    """A pass goes on from the last position where it can: on a grid, over a list in any order, in any chunks."""
    chain = next(rigs())
    angles = grid((20, 31)).angles
    one = analyse(chain, OUTPUTS, angles, second=True, threads=1)
    mixed = np.random.default_rng(2).permutation(len(angles))
    for again, order in (
        (analyse(chain, OUTPUTS, angles, second=True, threads=2), np.arange(len(angles))),
        (analyse(chain, OUTPUTS, angles, second=True, threads=5), np.arange(len(angles))),
        (analyse(chain, OUTPUTS, angles[mixed], second=True), mixed),
    ):
        for part in PARTS:
            if getattr(one, part) is not None:
                np.testing.assert_array_equal(getattr(again, part), getattr(one, part)[:, order])


PROGRAM = """
import numpy as np
from inercal.foundation.rigs.patterns import density
from inercal.foundation.rigs.outputs import table_outputs
from inercal.foundation.rigs.tables import turntable
from inercal.foundation.sensitivities import dense, kernels
from inercal.foundation.sensitivities.exact import analyse
chain = turntable("two_axis_turntable", density(lambda x: 1.0 + x, -0.3, 0.6), mounting=np.eye(3)[[1, 2, 0]])
outputs, angles = table_outputs(("ax", "wy"), 9.8, 0.7), np.array([[0.3, 1.1], [0.3, 1.2], [2.0, 1.2]])
"""


def python(program, **environment):
    """Run a program in a new process with this package; what it printed."""
    kept = {key: value for key, value in os.environ.items() if not key.startswith("NUMBA_")}
    run = subprocess.run(
        [sys.executable, "-c", PROGRAM + program],
        env=kept
        | {"PYTHONPATH": str(PACKAGE.parent)}
        | {key: str(value) for key, value in environment.items()},
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stderr
    return run.stdout.strip()


def test_the_passes_run_as_plain_python_too():
    program = """
assert not hasattr(kernels.analyse, "machine_code")
found = analyse(chain, outputs, angles, second=True)
plain = dense.analyse(dense.blocks(chain, angles, (1,)), outputs, second=True)
np.testing.assert_allclose(found.interaction_variance, plain.interaction_variance, rtol=1e-12)
np.testing.assert_allclose(found.second_variance, plain.second_variance, rtol=1e-12, atol=1e-25)
print("same")
"""
    assert python(program, INERCAL_KERNELS="python") == "same"
