"""The command line: a module for each command or family of them, loaded only when it is asked for."""

from __future__ import annotations

import gc
import os
import re
import signal
import sys
import time
import warnings
from types import FrameType

from inercal import __version__
from inercal.cli.lean import lean_scipy
from inercal.foundation.addresses import shown_address, without_secrets
from inercal.foundation.errors import InercalError

# The matrices here are small: threads of the linear algebra library cost more than they bring.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

_STARTED = time.perf_counter()

_ASKED: list[bool] = []  # not empty once the user has interrupted

_LONGEST = 900
"""Characters of an error line."""

_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200e\u200f\u2028-\u202e\u2066-\u2069]")
"""Control characters but tab and line feed, and marks that turn the direction of writing."""

_LINE: list[str] = []
"""Arguments of the command that runs."""

EXIT_BAD_VERDICT = 1
EXIT_BAD_INPUT = 2
EXIT_INTERRUPTED = 130


def process_age() -> float:
    """Seconds since this process began (where the system tells), or since this module was loaded."""
    try:
        with open("/proc/self/stat", encoding="ascii") as file:
            ticks = int(file.read().rpartition(")")[2].split()[19])
        return time.clock_gettime(time.CLOCK_BOOTTIME) - ticks / os.sysconf("SC_CLK_TCK")
    except (OSError, ValueError, AttributeError, IndexError):
        return time.perf_counter() - _STARTED


def main(arguments: list[str] | None = None) -> None:
    """Run a command and exit: 0 sound, 1 a bad verdict, 2 bad input or usage, 130 asked to end."""
    gc.set_threshold(50_000, 20, 20)  # loading and drawing make many objects that stay: a tenth of the time
    lean_scipy()
    # a pool begins each Python in the working folder, where modules among foreign files would be imported
    os.environ.setdefault("PYTHONSAFEPATH", "1")
    for signum in asking_to_end():
        if signal.getsignal(signum) is not signal.SIG_IGN:
            signal.signal(signum, _interrupt)
    code = run(arguments)
    if code == EXIT_INTERRUPTED and hasattr(signal, "pthread_sigmask"):
        # an interrupt within `exec` of a text, as in a dataclass being made, is sent once more by Python at its end
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    sys.exit(code)


def asking_to_end() -> list[signal.Signals]:
    """The signals by which a user, the system or a terminal that is closed ask a process to end."""
    return [signal.Signals[name] for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]


def _interrupt(signum: int, frame: FrameType | None) -> None:
    """Interrupt as Python does on Ctrl-C, and remember it."""
    _ASKED.append(True)
    raise KeyboardInterrupt


def run(arguments: list[str] | None = None) -> int:
    """Run a command line (the process's own if absent) and return its exit code."""
    if "PYTHONWARNINGS" not in os.environ and not sys.warnoptions:
        warnings.simplefilter("ignore")
    try:
        _settle_streams()
        if sys.stdout is None:
            raise InercalError("standard output: found it closed, expected it open")
        arguments = sys.argv[1:] if arguments is None else arguments
        if arguments == ["--version"]:  # what installers ask needs no commands
            print(__version__)
            return 0
        _LINE[:] = arguments
        from inercal.cli.tree import call  # here, so that an interrupt during loading is caught too

        code = call([f"./{word}" if _is_a_file(word) else word for word in arguments])
        sys.stdout.flush()
        return int(code or 0)
    except KeyboardInterrupt:
        _say("interrupted")
        return EXIT_INTERRUPTED
    except (BrokenPipeError, SystemExit):  # of a help text, whose reader has left
        abandon_output()
        return 0
    except InercalError as error:
        problem = str(error)
    except MemoryError:
        problem = "not enough memory for what was asked"
    except OSError as error:
        problem = f"{error.filename or 'standard output'}: {error.strerror or error}"
    except Exception as error:
        if _ASKED and isinstance(error, ImportError):  # what a library makes of it while loaded
            _say("interrupted")
            return EXIT_INTERRUPTED
        if os.environ.get("INERCAL_DEBUG"):
            raise
        problem = (
            f"unexpected {type(error).__name__} ({error}), a fault of inercal's own: please report it with "
            "the traceback that INERCAL_DEBUG=1 shows"
        )
    abandon_output()
    problem = " ".join(without_secrets(problem).split())
    if len(problem) > _LONGEST:  # the beginning says where, the end what was expected
        problem = f"{problem[: 2 * _LONGEST // 3]} ... {problem[-_LONGEST // 3 :]}"
    _say(f"error: {problem}")
    return EXIT_BAD_INPUT


def _settle_streams() -> None:
    """Let no text fail on its way out: what the terminal cannot spell is escaped, and nobody may be reading."""
    import logging

    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # it warns where its cache cannot be written
    if sys.stderr is None:
        sys.stderr = open(os.devnull, "w", encoding="utf-8")  # noqa: SIM115  (to the end)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="backslashreplace")


def _say(text: str) -> None:
    """One line on standard error, if there is one."""
    import contextlib

    with contextlib.suppress(OSError, ValueError):
        print(f"inercal: {printable(text)}", file=sys.stderr, flush=True)


def _is_a_file(word: str) -> bool:
    """True for the name of a file that looks like an option: ``-x.csv``, as a shell makes of ``*.csv``."""
    return re.fullmatch(r"-[^-=]+\.\w+", word) is not None and os.path.isfile(word)


def command_line() -> list[str]:
    """Arguments of the command that runs, as they were typed, but for secrets of addresses."""
    return [shown_address(argument) for argument in _LINE]


def printable(text: str) -> str:
    """The text with control characters written out: those of a foreign file must not command the terminal."""
    return _CONTROL.sub(lambda match: match[0].encode("unicode_escape").decode("ascii"), text)


def show(text: str) -> None:
    """Print a result; a reader that has left, as `head` does, has had what it wanted."""
    try:
        print(printable(text), flush=True)
    except BrokenPipeError:
        abandon_output()


def abandon_output() -> None:
    """Drop the rest of standard output's buffer, so that nothing is raised again on the way out."""
    try:
        if sys.stdout is not None:
            sys.stdout.flush()
    except (OSError, ValueError):
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
