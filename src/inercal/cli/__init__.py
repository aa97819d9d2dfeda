"""The command line: one module per verb, each loaded only when it is asked for."""

from __future__ import annotations

import contextlib
import os
import sys
import time
import warnings

# The matrices here are small: threads of the linear algebra library cost more than they bring.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from cyclopts import App, CycloptsError, Parameter

from inercal import __version__
from inercal.errors import InercalError

_STARTED = time.perf_counter()

EXIT_BAD_VERDICT = 1
EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130


#: verb, kind -> where it is, what it does, an example that runs
_COMMANDS = {
    ("new", "imu"): (
        "inercal.cli.new:new_imu",
        "Write a commented study for `inercal calibrate imu`.\n\nGiven a recording, also a column map guessed from "
        "it. The study goes to --out (imu.toml if absent), the map beside it (imu-map.toml). Nothing that exists "
        "is overwritten.",
        "inercal new imu log.csv --out imu.toml",
    ),
    ("inspect", ""): (
        "inercal.cli.inspect:inspect",
        "Look at a recording before it is used.\n\nChannels, units, rates, and everything suspicious about it; "
        "--report writes a page with pictures. Findings do not change the exit code.",
        "inercal inspect log.csv --report log.html",
    ),
    ("calibrate", "imu"): (
        "inercal.cli.calibrate:calibrate_imu",
        "Calibrate an IMU that was held still in many poses by hand.\n\nGives bias, scale factor and misalignment "
        "of the accelerometers, and of the gyro if there is one, with uncertainties. --out saves them (.json or "
        ".toml), --report writes a page to hand over. Exit code 1: done, but the verdict is not ok.",
        "inercal calibrate imu log.csv --study imu.toml --report cal.html",
    ),
    ("apply", ""): (
        "inercal.cli.apply:apply",
        "Correct a recording with a calibration.\n\nWrites specific force [m/s^2] and rate [rad/s] to --out (.csv). "
        "With --invert the recording holds true values and the outputs of the instrument are written.",
        "inercal apply cal.json log.csv --out corrected.csv",
    ),
    ("schema", ""): (
        "inercal.cli.schema:schema",
        "Print one JSON Schema that covers every kind of study file, for editors and checkers.",
        "inercal schema --out inercal.schema.json",
    ),
    ("examples", ""): (
        "inercal.cli.examples:examples",
        "List the recordings that ship with inercal, or copy one.\n\nA copy comes with its study and map, in the "
        "folder --out (named after the example if absent).",
        "inercal examples xsens --out xsens",
    ),
}

_GROUPS = {
    "new": "Write a commented study, and a map guessed from a recording.",
    "calibrate": "Calibrate an instrument from a recording.",
}


def _app() -> App:
    """The tree of commands; the module of each is loaded only when it is asked for."""
    app = App(
        name="inercal",
        help="Calibrate inertial instruments, and say how sure one can be of every number.",
        help_epilogue="Example: inercal examples xsens",
        version=__version__,
        default_parameter=Parameter(negative=(), show_default=False),
        help_format="plaintext",
        help_formatter="plain",
        exit_on_error=False,
        print_error=False,
        result_action="return_value",
        suppress_keyboard_interrupt=False,
    )
    groups: dict[str, App] = {}
    for (verb, kind), (where, text, example) in _COMMANDS.items():
        epilogue = f"Example: {example}"
        if not kind:
            app.command(where, name=verb, help=text, help_epilogue=epilogue)
            continue
        if verb not in groups:
            groups[verb] = App(name=verb, help=_GROUPS[verb], help_epilogue=epilogue)
            app.command(groups[verb])
        groups[verb].command(where, name=kind, help=text, help_epilogue=epilogue)
    return app


def process_age() -> float:
    """Seconds since this process began (where the system tells), or since this module was loaded."""
    try:
        with open("/proc/self/stat", encoding="ascii") as file:
            ticks = int(file.read().rpartition(")")[2].split()[19])
        return time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, AttributeError, IndexError):
        return time.perf_counter() - _STARTED


def main(arguments: list[str] | None = None) -> None:
    """Run a command and exit: 0 sound, 1 a bad verdict, 2 bad input or usage, 130 interrupted."""
    sys.exit(run(arguments))


def run(arguments: list[str] | None = None) -> int:
    """Run a command line (the process's own if absent) and return its exit code."""
    if "PYTHONWARNINGS" not in os.environ and not sys.warnoptions:
        warnings.simplefilter("ignore")
    try:
        code = _app()(sys.argv[1:] if arguments is None else arguments)
        sys.stdout.flush()
        return int(code or 0)
    except KeyboardInterrupt:
        _say("interrupted")
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        problem = "standard output was closed before everything was written, expected a reader to the end"
    except (InercalError, CycloptsError) as error:
        problem = str(error)
    except MemoryError:
        problem = "not enough memory for this recording"
    except OSError as error:
        problem = f"{error.filename or 'standard output'}: {error.strerror or error}"
    except Exception as error:
        if os.environ.get("INERCAL_DEBUG"):
            raise
        problem = (
            f"unexpected {type(error).__name__} ({error}), a fault of inercal's own: please report it with "
            "the traceback that INERCAL_DEBUG=1 shows"
        )
    _abandon_output()
    _say(f"error: {' '.join(problem.split())}")
    return EXIT_BAD_INPUT


def _say(text: str) -> None:
    """One line on standard error, if there is one."""
    with contextlib.suppress(OSError, ValueError):
        print(f"inercal: {text}", file=sys.stderr, flush=True)


def _abandon_output() -> None:
    """Drop what is left in standard output's buffer, so that nothing is raised again on the way out."""
    try:
        sys.stdout.flush()
    except (OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
