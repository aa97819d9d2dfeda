"""Tasks that a spawned process can import."""

from __future__ import annotations

import signal
import time
from dataclasses import dataclass

import numpy as np

from inercal.foundation.computing.executors import Processes, Serial
from inercal.foundation.computing.runs import run
from inercal.foundation.errors import InputError


def line_fit(rng):
    """Fit a line to 12 noisy readings: errors, standard uncertainties and degrees of freedom."""
    A = np.column_stack([np.ones(12), np.linspace(-1, 1, 12)])
    residual = rng.standard_normal(12)
    x, ss, *_ = np.linalg.lstsq(A, residual, rcond=None)
    return {"errors": x, "u": np.sqrt(ss[0] / 10 * np.diag(np.linalg.inv(A.T @ A))), "dof": 10}


def slow(rng):
    """Draw after 20 ms."""
    time.sleep(0.02)
    return {"x": rng.standard_normal(3)}


def sometimes_endless(rng):
    """Sleep for a minute in all runs but the first of a campaign."""
    if rng.spawn(1)[0].bit_generator.seed_seq.spawn_key[0] > 0:
        time.sleep(60)
    return {"x": 0.0}


def unlucky(rng):
    """Fail about once in 40 runs, with an exception that cannot be unpickled."""
    x = rng.random()
    if x < 0.025:
        raise InputError("x", f"got {x}")
    return {"x": x}


def killed(rng):
    """End the process that runs it."""
    signal.raise_signal(signal.SIGKILL)


@dataclass(frozen=True)
class Noise:
    """A task with a parameter."""

    sigma: float

    def __call__(self, rng):
        return {"x": rng.normal(0.0, self.sigma)}


def main(task, folder, runs, workers):
    """Run one task in a folder, a run at a time, and say how far it is on standard output."""
    run(
        globals()[task],
        runs=int(runs),
        seed=11,
        chunk=1,
        folder=folder,
        executor=Processes(int(workers)) if int(workers) else Serial(),
        progress=lambda done, total: print(done, flush=True),
    )
