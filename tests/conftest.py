"""What holds for all tests: none of them judges speed, and what takes long is marked so."""

import gc
import os
import signal
import sys
import time
import warnings
from collections import Counter
from pathlib import Path

import pytest
from hypothesis import settings

from inercal.foundation._jit import CHOICE, cache_folder, way

# As the commands do, before NumPy is imported: the matrices are small, and threads of two workers wait for each other.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

gc.set_threshold(50_000, 20, 20)  # as the commands do

# Compiled kernels, where they are those of these sources, and then nothing else: a call that they were not compiled for
# fails, here and in the processes that tests start. Otherwise numba compiles kernels as tests call them.
with warnings.catch_warnings(action="ignore"):  # that they are stale: the header of the report says so
    os.environ.setdefault(CHOICE, way().how)

LIMIT = 2.0
"""Processor time that a test may take without the mark `slow` or `campaign` [s], on a machine of `YARDSTICK`."""

YARDSTICK = 0.05
"""Processor time of `yardstick` where the marks were set [s]."""

WAITING = {"test_book.py", "test_cluster.py", "test_workbench_browser.py"}
"""Tests of what other processes do, that alone keep few processors busy."""

# A shell that starts the tests behind its back (&, nohup) has them ignore interrupts, and all programs they start, too.
signal.signal(signal.SIGINT, signal.default_int_handler)
if hasattr(signal, "SIGHUP"):
    signal.signal(signal.SIGHUP, signal.SIG_DFL)

settings.register_profile("untimed", deadline=None, max_examples=50)
settings.register_profile("thorough", deadline=None, max_examples=1000)
settings.load_profile("untimed")


def pytest_addoption(parser):
    parser.addoption("--slow-rule", choices=["fail", "list"], help=f"unmarked tests over {LIMIT:g} s")
    parser.addoption("--within", type=float, metavar="SECONDS", help="begin no test after that time")


def processor():
    """Processor time of this process and of those that it has waited for [s]."""
    return sum(os.times()[:4])


def yardstick():
    """Processor time of a fixed piece of work just now [s]: a slow or crowded machine is given more time."""
    began = time.process_time()
    sum(k * k for k in range(1_000_000))
    return time.process_time() - began


def compiled_since(moment):
    """True if any process has compiled a kernel since."""
    if way().how != "numba":
        return False
    folder = cache_folder()
    return folder is None or any(path.stat().st_mtime >= moment for path in folder.rglob("*"))


def timed(item, what):
    """Run one phase of a test; it fails if it takes too long, unless it had to compile or import first."""
    began, moment, modules = processor(), time.time(), len(sys.modules)
    outcome = yield
    marked = item.get_closest_marker("slow") or item.get_closest_marker("campaign")
    if item.config.getoption("slow_rule") and not marked:
        taken = processor() - began
        cold = len(sys.modules) > modules + 20 or compiled_since(moment) if taken > LIMIT else True
        if not cold and taken > LIMIT * max(1.0, yardstick() / YARDSTICK):
            found = f"{what} took {taken:.1f} s, expected at most {LIMIT:g} s or the mark slow"
            if item.config.getoption("slow_rule") == "fail":
                pytest.fail(found, pytrace=False)
            item.user_properties.append(("slow", f"{item.nodeid}: {found}"))
    return outcome


@pytest.hookimpl(wrapper=True)
def pytest_runtest_setup(item):
    return (yield from timed(item, "a fixture"))


@pytest.hookimpl(wrapper=True)
def pytest_runtest_call(item):
    return (yield from timed(item, "the test"))


@pytest.fixture(scope="module")
def undrawn():
    """Pictures are laid out but not written as SVG, which takes most of their time: for tests that look at none."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    def empty(canvas, file, **given):
        file.write('<svg xmlns="http://www.w3.org/2000/svg"></svg>')

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(FigureCanvasSVG, "print_svg", empty)
        yield


def pytest_report_header():
    """How kernels run."""
    how, _, why = way()
    return f"kernels: {how}" + (f", for {why}: `make kernels`" if why else "")


def pytest_collection_modifyitems(config, items):
    """What mostly waits for other processes comes first: at the end nothing would be left to run beside it."""
    if config.getoption("within") is None:
        items.sort(key=lambda item: item.path.name not in WAITING)


def pytest_collection_finish():
    """What tests are made of is no garbage: none of the collections that follow looks at it."""
    gc.collect()
    gc.freeze()


def pytest_configure(config):
    config.began, config.asked = time.monotonic(), 0
    config.pluginmanager.register(ProcessorTime(), "processor_time")


class ProcessorTime:
    """Processor time by room of the tests: a folder of `tests`, or a file that lies there [s].

    Processes that a test starts count once it has waited for them; fixtures count where they are first asked for, and
    collecting and importing apart.
    """

    def __init__(self):
        self.own, self.of_rooms = Counter(), Counter()

    @pytest.hookimpl(wrapper=True, tryfirst=True)
    def pytest_runtest_protocol(self, item):
        began = processor()
        done = yield
        room, *_ = item.path.relative_to(Path(__file__).parent).parts
        self.own[room] += processor() - began
        return done

    @pytest.hookimpl(tryfirst=True)
    def pytest_sessionfinish(self, session):
        # where workers run the tests, their time is theirs to tell
        self.own["collecting"] = processor() - self.own.total() if self.own else time.process_time()
        self.of_rooms.update(self.own)
        if hasattr(session.config, "workeroutput"):
            session.config.workeroutput["processor_time"] = dict(self.own)

    @pytest.hookimpl(optionalhook=True)
    def pytest_testnodedown(self, node):
        self.of_rooms.update(getattr(node, "workeroutput", {}).get("processor_time", {}))

    def pytest_terminal_summary(self, terminalreporter):
        """The table, where tests of more than one room ran."""
        if len(self.of_rooms) > 2:
            terminalreporter.section("processor time by room [s]")
            for room, taken in self.of_rooms.most_common():
                terminalreporter.write_line(f"{room:<28}{taken:9.1f}")
            minutes = self.of_rooms.total() / 60.0
            terminalreporter.write_line(f"{'in all':<28}{60.0 * minutes:9.1f}, {minutes:.1f} core-minutes")


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_protocol(item):
    """Pass over a test when the time is up, without a word for each."""
    within = item.config.getoption("within")
    return True if within is not None and time.monotonic() - item.config.began > within else None


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_node_collection_finished(node, ids):
    node.config.asked = len(ids)


def pytest_terminal_summary(terminalreporter, config):
    """What the rule of `slow` found, and how many tests the time was too short for."""
    reports = [report for reports in terminalreporter.stats.values() for report in reports]
    properties = [each for report in reports for each in getattr(report, "user_properties", ())]
    for line in sorted({text for name, text in properties if name == "slow"}):
        terminalreporter.write_line(line)
    ended = ("passed", "failed", "error", "skipped", "xfailed")
    ran = sum(len(terminalreporter.stats.get(how, ())) for how in ended)
    if config.getoption("within") is not None and ran < config.asked:
        terminalreporter.write_line(f"{config.asked - ran} of {config.asked} tests are left to `make test`")
