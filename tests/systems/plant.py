"""Faults planted in the program, one at a time: does the contract of systems find each?

``python tests/systems/plant.py`` runs the contract once for each fault, on the system that it is planted in, and
says which were found; it ends with 1 where one was not. As a plugin of pytest it plants the fault that PLANTED names.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np


def swap(owner, name, make):
    """Put what is made of an attribute in its place."""
    setattr(owner, name, make(getattr(owner, name)))


def digit(times=1.0 + 1e-15):
    from inercal.faces.stream import selfcal

    swap(selfcal, "rows", lambda rows: lambda *given: rows(*given) * times)


def picture():
    from inercal.systems.strapdown import figures

    def page(calibration, was=figures.page):
        assert calibration.estimate.status.value != "unobservable"
        return was(calibration)

    figures.page = page


def interval():
    from inercal.faces.stream.shell import LineInterval

    LineInterval.at = lambda self, t, every: self


def span():
    from inercal.foundation.records.record import Record

    swap(Record, "between", lambda between: lambda self, begin, end: between(self, begin, None))


def seed():
    from inercal.systems.aoa import verbs

    swap(verbs, "simulate", lambda simulate: lambda study, rng: simulate(study, np.random.default_rng()))


def source():
    from inercal.systems.strapdown.result import outcome

    def without_last(combine):
        def combined(names, sources):
            whole = combine(names, sources)
            return whole._replace(budget=whole.budget[:-1])

        return combined

    swap(outcome, "combine", without_last)


def unit():
    from inercal.foundation.results import result

    def wrong(shown):
        return lambda command, units: [(text, 1.01 * size) for text, size in shown(command, units)]

    swap(result, "units_shown", wrong)


def run_lost():
    from inercal.faces.python import study

    def first_again(calibrations):
        def made(*given):
            found = calibrations(*given)
            return [found[0] for _ in found]

        return made

    swap(study, "calibrations", first_again)


def traceback():
    from inercal.foundation.errors import RecordError
    from inercal.systems.turntable import task

    def calibrate(record, settings, progress, was=task.calibrate):
        try:
            return was(record, settings, progress)
        except RecordError as error:
            raise KeyError("theta") from error

    task.calibrate = calibrate


def said_again():
    from inercal.faces.stream.shell import SystemOnStream

    SystemOnStream.within = lambda self, state: state.system


#: what it is in words: the system in which it is planted, and how
FAULTS = {
    "a stream differs from the file in a digit": ("selfcal", digit),
    "a page fails at a status": ("strapdown", picture),
    "the interval of the lines is ignored": ("imu", interval),
    "the end of the part of a recording is ignored": ("turntable", span),
    "the seed is ignored": ("aoa", seed),
    "a source of uncertainty is missing in the budget": ("strapdown", source),
    "a value is not in the unit that it names": ("selfcal", unit),
    "the second of repeat runs is left out": ("turntable", run_lost),
    "a recording that cannot be used ends in a traceback": ("turntable", traceback),
    "a stream that goes on says its alarms again": ("selfcal", said_again),
}


def pytest_configure():
    """Plant the fault of the environment."""
    FAULTS[os.environ["PLANTED"]][1]()


def is_found(name):
    """True where the contract finds a fault."""
    here = Path(__file__).parent
    command = [
        sys.executable,
        "-m",
        "pytest",
        "-q",
        "-x",
        "-p",
        "plant",
        "-p",
        "no:cacheprovider",
        "-k",
        FAULTS[name][0],
    ]
    done = subprocess.run(
        [*command, str(here)],
        env={
            **os.environ,
            "PLANTED": name,
            "PYTHONPATH": os.pathsep.join([str(here), os.environ.get("PYTHONPATH", "")]),
        },
        capture_output=True,
        text=True,
        check=False,
    )
    failed = [line for line in done.stdout.splitlines() if line.startswith(("FAILED", "ERROR"))]
    print(f"{'found ' if done.returncode == 1 else 'MISSED'}  {name}: {'; '.join(failed)[:110]}", flush=True)
    return done.returncode == 1


if __name__ == "__main__":
    chosen = [name for name in FAULTS if not sys.argv[1:] or any(word in name for word in sys.argv[1:])]
    found = [is_found(name) for name in chosen]
    sys.exit(not all(found))
