"""One absurd run by its number: drawn, done, and held against the laws, in any thread of any process."""

from __future__ import annotations

import ctypes
import importlib
import threading
import time
import traceback
import warnings
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from unittest.mock import patch

import numpy as np

SEED = 20261121

LONGEST = 30.0
"""Time of the processor [s] that a run may take, kernels loaded."""

ROOMS = ("selfcal", "drift", "aoa")

WHOLE = 10
"""Every so many runs go the whole way of the command, the others without its search for named faults."""

_ALONE = threading.Lock()
"""Held by the run at work: what it leaves out and that warnings are errors holds for its whole process."""


class TooLongError(Exception):
    """A run that did not end in time."""

    def __str__(self) -> str:
        return f"no end within {LONGEST:g} s"


def generator(room, number, seed=SEED):
    """The random stream of one run."""
    return np.random.default_rng([seed, ROOMS.index(room), number])


def load(room):
    """Load, or compile, the kernels of a room."""
    importlib.import_module(f"absurd.{room}").load()


@contextmanager
def limited(seconds):
    """Raise `TooLongError` in the body once this thread has computed for so long [s]."""
    thread, ended, lock = threading.get_ident(), threading.Event(), threading.Lock()
    clock = time.pthread_getcpuclockid(thread)
    until = time.clock_gettime(clock) + seconds
    sent = threading.Event()

    def watch():
        while not ended.wait(min(1.0, seconds)):
            with lock:
                if not ended.is_set() and time.clock_gettime(clock) > until:
                    sent.set()
                    ctypes.pythonapi.PyThreadState_SetAsyncExc(
                        ctypes.c_ulong(thread), ctypes.py_object(TooLongError)
                    )
                    return

    threading.Thread(target=watch, daemon=True).start()
    came = False
    try:
        yield
    except TooLongError:
        came = True
        raise
    finally:
        with lock:
            ended.set()
        # Not taken back: Python would look for it at every step, and never get on where lines are traced. It comes
        # within a step or two, unless the body has met it and kept it for itself.
        with suppress(TooLongError):
            for _ in range(100 if sent.is_set() and not came else 0):
                time.sleep(1e-3)


def one(room, number, seed=SEED):
    """One run; what it raises beyond a refusal, warnings too, is a law that it broke."""
    from absurd.outcome import Run

    of = importlib.import_module(f"absurd.{room}")
    try:
        with _ALONE, limited(LONGEST), warnings.catch_warnings(), ExitStack() as without:
            warnings.simplefilter("error")
            for search, found in of.SEARCH.items() if number % WHOLE else ():
                without.enter_context(patch(search, found))
            return of.run(generator(room, number, seed))
    except Exception as error:
        where = traceback.extract_tb(error.__traceback__)
        place = next((each for each in reversed(where) if "inercal" in each.filename), where[-1])
        text = f"{type(error).__name__}: {error} ({Path(place.filename).name}:{place.lineno})"
        return Run({}, outcome="failed", wrong=[text.replace("\n", " ")[:300]])


@dataclass(frozen=True)
class Absurd:
    """The runs of a room and seed, by their numbers."""

    room: str
    seed: int = SEED

    def __call__(self, number):
        """The outcome of a run, the laws that it broke, and its time of the processor [s]."""
        began = time.thread_time()
        done = one(self.room, number, self.seed)
        return [done.outcome, list(done.wrong), time.thread_time() - began]

    def prepare(self):
        """Load all kernels."""
        load(self.room)
