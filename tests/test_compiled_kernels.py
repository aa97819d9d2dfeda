"""Compiled kernels: what is compiled is what Python calls, a stale module is never used, and every digit is numba's."""

import json
import os
import re
import shutil
import subprocess
import sys
import threading
import time
import typing

import numpy as np
import pytest

import build
import entries
from inercal.examples import FOLDER
from inercal.foundation import _jit
from inercal.foundation.noise import kernels as noise
from inercal.systems.selfcal.filters import batch

TABLE = json.loads((entries.SOURCE.parent / "kernels" / "signatures.json").read_text(encoding="utf-8"))

compiled_alone = pytest.mark.skipif(
    _jit.way().how != "compiled", reason="kernels are not compiled: `make kernels`"
)


@pytest.fixture(scope="module")
def sources():
    return entries.Sources()


def function(name):
    """A kernel as plain Python."""
    module, name = name.rsplit(".", 1)
    return _jit.plain(getattr(__import__(module, fromlist=[name]), name))


def test_the_table_has_what_python_calls(sources):
    assert list(TABLE) == [".".join(name) for name in sources.entries]
    assert all(TABLE.values())


@compiled_alone
def test_the_module_has_what_the_table_has():
    assert set(_jit.way().module.ALL) == set(TABLE)


def test_signatures_have_an_argument_for_each_of_the_kernel(sources):
    """And what they return are numbers: an array would need somebody who frees it."""
    for name, signatures in TABLE.items():
        hints = typing.get_type_hints(function(name))
        returned = hints.pop("return")
        assert np.ndarray not in (returned, typing.get_origin(returned)), name
        for signature in signatures:
            while "(" in signature:  # from the inside, each tuple to one letter
                signature = re.sub(r"\([^()]*\)", "t", signature)
            assert len(re.findall(r"[dqwQB?]\d[FA]?R?|[fibt]", signature)) == len(hints), name


def test_machine_code_rests_on_constants_of_other_modules_too(sources):
    files = set(sources.rests_on())
    kernels = {sources.paths[module] for module, _ in sources.entries}
    assert {path.relative_to(entries.SOURCE / "inercal").as_posix() for path in kernels} <= files
    options = "foundation/_jit.py"
    assert {options, "systems/selfcal/limits.py", "systems/selfcal/platform/layout.py"} <= files
    assert len(files) < 80


# -- in other processes: what is used


def python(program, path=entries.SOURCE, **environment):
    """What a program prints, and what it says on standard error."""
    kept = {key: value for key, value in os.environ.items() if key != _jit.CHOICE}
    done = subprocess.run(
        [sys.executable, "-c", program],
        env=kept | {"PYTHONPATH": str(path)} | environment,
        capture_output=True,
        text=True,
        timeout=900,  # numba may compile first, on a busy machine
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip(), done.stderr


KERNEL = """
from inercal.foundation._jit import kernel
@kernel
def twice(x):
    return 2.0 * x
"""
CODE = """
import hashlib
class Unfit(TypeError): ...
def twice(x):
    if not isinstance(x, float): raise Unfit
    return "compiled"
ALL, FILES, SOURCES = {"inercal.room.twice": twice}, "room.py\\n", "@"
BUILD_FILES, BUILD = "signatures.json", hashlib.sha256(b"[]\\0").hexdigest()
"""


@pytest.fixture
def tiny(tmp_path):
    """A checkout of a package with a kernel, and a module that stands for its machine code."""
    tmp_path = tmp_path / "src"
    (tmp_path / "inercal" / "foundation").mkdir(parents=True)
    for folder in ("", "foundation"):
        (tmp_path / "inercal" / folder / "__init__.py").touch()
    shutil.copy(_jit.__file__, tmp_path / "inercal" / "foundation")
    (tmp_path / "inercal" / "room.py").write_text(KERNEL)
    digest = entries.digest(tmp_path / "inercal", ["room.py"])
    (tmp_path / "inercal" / "_kernels.py").write_text(CODE.replace("@", digest))
    (tmp_path.parent / "kernels").mkdir()
    (tmp_path.parent / "kernels" / "signatures.json").write_text("[]")
    return tmp_path


PRINT = "from inercal.room import twice; print(twice(3.0), twice({}))"


def test_machine_code_is_used_while_its_sources_are_the_same(tiny):
    assert python(PRINT.format("4.0"), tiny) == ("compiled compiled", "")


def test_stale_machine_code_is_never_used_and_said_once(tiny):
    (tiny / "inercal" / "room.py").write_text(KERNEL.replace("2.0", "5.0") + KERNEL.replace("twice", "again"))
    found, said = python("import sys; sys.modules['numba'] = None\n" + PRINT.format("4.0"), tiny)
    assert found == "15.0 20.0"
    assert said.count("kernels have changed since they were compiled") == 1
    assert "make kernels" in said


def test_machine_code_of_another_table_of_what_python_calls_is_stale_too(tiny):
    """The sources of kernels may be the same where Python begins to call one more: it would run as plain Python."""
    table = tiny.parent / "kernels" / "signatures.json"
    table.write_text('[""]')
    assert "kernels have changed since" in python("from inercal.room import twice", tiny)[1]
    table.unlink()  # a wheel has none
    assert python(PRINT.format("4.0"), tiny) == ("compiled compiled", "")


@pytest.mark.parametrize(
    ("no_numba", "how_long"),
    [
        ("", "takes 5 to 40 s, once"),
        ("import sys; sys.modules['numba'] = None\n", "minutes in place of a second"),
    ],
)
def test_without_machine_code_a_command_says_how_long_it_takes_and_what_helps(tiny, no_numba, how_long):
    (tiny / "inercal" / "_kernels.py").unlink()
    program = no_numba + "from inercal.foundation._jit import compiling\nwith compiling('work', print): pass"
    said = python(program, tiny, XDG_CACHE_HOME=str(tiny / "cache"))[0]
    assert said.startswith("kernels are not compiled: ")
    assert how_long in said
    assert "`make kernels`" in said
    if not no_numba:  # kept by the first
        assert python(program, tiny, XDG_CACHE_HOME=str(tiny / "cache"))[0] == ""


def test_the_processes_that_compile_find_what_an_isolated_build_installed(tmp_path, monkeypatch):
    (tmp_path / "of_pip.py").touch()
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    command = [sys.executable, "-c", "import of_pip, entries, inercal; print(inercal.__file__)"]
    done = subprocess.run(command, env=build.environment(), capture_output=True, text=True, check=True)
    assert done.stdout.startswith(str(entries.SOURCE))


def test_arguments_of_other_types_are_computed_all_the_same_with_a_warning_or_refused(tiny):
    found, said = python(PRINT.format("4"), tiny)
    assert found == "compiled 8.0"
    assert "inercal.room.twice is not compiled for arguments of the types i" in said
    with pytest.raises(AssertionError, match="not compiled for arguments of the types i"):
        python(PRINT.format("4"), tiny, INERCAL_KERNELS="compiled")


REFUSED = f"""
import importlib.util
real = importlib.util.find_spec
importlib.util.find_spec = lambda name, *more: None if name == "numba" else real(name, *more)
from inercal.cli import run
print(run(["selfcal", {str(FOLDER / "selfcal.csv.gz")!r}, "--study", {str(FOLDER / "selfcal.toml")!r}]))
"""


@pytest.mark.parametrize(
    ("asked", "expected"),
    [
        ("fast", "found 'fast', expected one of compiled, numba, python"),
        ("numba", "found numba, which is not installed: it is the extra `jit`"),
    ],
)
def test_a_way_that_is_not_there_is_refused_in_a_sentence(asked, expected):
    found, said = python(REFUSED, INERCAL_KERNELS=asked)
    assert found == "2"
    assert said.strip() == f"inercal: error: INERCAL_KERNELS: {expected}"


# -- the caller in C


@compiled_alone
@pytest.mark.parametrize(
    "arguments",
    [
        (np.ones(9), 2.0),
        (np.ones(9, np.float32), 2),
        (np.ones(18)[::2], 2),
        (np.ones(9, ">f8"), 2),
        (np.ones((3, 3)), 2),
        (np.ones(9),),
        (np.ones(9), 2, 3),
        (None, 2),
        ([1.0, 2.0, 3.0], 1),
        (np.frombuffer(bytes(73), np.uint8)[1:].view(np.float64), 2),
    ],
    ids=str,
)
def test_the_caller_refuses_what_the_code_was_not_compiled_for(arguments):
    """Read as something else, the memory would give wrong numbers, or end the process."""
    module = _jit.way().module
    with pytest.raises(module.Unfit):
        module.ALL["inercal.foundation.noise.kernels.mean_square"](*arguments)


@compiled_alone
def test_no_kernel_writes_into_an_array_that_cannot_be_written():
    diagonal, module = np.zeros(2), _jit.way().module
    inverse_diagonal = module.ALL["inercal.systems.selfcal.filters.batch.inverse_diagonal"]
    inverse_diagonal(np.array([[2.0, 2.0]], order="F"), diagonal)
    assert [*diagonal] == [0.25, 0.25]
    diagonal.flags.writeable = False
    with pytest.raises(module.Unfit):
        inverse_diagonal(np.array([[1.0, 1.0]], order="F"), diagonal)


@compiled_alone
def test_a_division_by_zero_is_the_error_of_python():
    with pytest.raises(ZeroDivisionError, match="inverse_diagonal"):
        batch.inverse_diagonal(np.zeros((1, 2), order="F"), np.zeros(2))


@compiled_alone
def test_while_a_kernel_runs_other_threads_go_on():
    sums, spans = np.ones(3_000_000), []

    def several():
        for _ in range(200):
            began = time.perf_counter()
            noise.mean_square(sums, 1)
            spans.append((began, time.perf_counter()))

    thread, moments = threading.Thread(target=several), []
    thread.start()
    while thread.is_alive():
        time.sleep(1e-4)
        moments.append(time.perf_counter())
    thread.join()
    assert max(sum(began < moment < ended for moment in moments) for began, ended in spans) >= 3


@compiled_alone
def test_what_kernels_hold_is_let_go():
    """References to arrays are as many after thousands of calls as before, of calls that are refused too."""
    sums = np.cumsum(np.ones(50))
    before = sys.getrefcount(sums)
    module = _jit.way().module
    for _ in range(2000):
        noise.mean_square(sums, 3)
        with pytest.raises(module.Unfit):
            module.ALL["inercal.foundation.noise.kernels.mean_square"](sums, 2.0)
    assert sys.getrefcount(sums) == before


# -- the same digits

COMMANDS = {
    "allan": "allan {0}/lasergyro.txt.gz --map {0}/lasergyro-map.toml",
    "selfcal": "selfcal {0}/selfcal.csv.gz --study {0}/selfcal.toml --compare",
    "aoa": "aoa {0}/sting.csv.gz --study {0}/sting.toml --compare",
    "smoothed": "aoa {0}/sting.csv.gz --study {0}/sting.toml --set estimator.smooth=true",
    "strapdown": "calibrate strapdown {0}/strapdown.bin.gz --map {0}/strapdown-map.toml --study {0}/strapdown.toml",
    "tumble": "calibrate turntable {0}/tumble.csv.gz --study {0}/tumble.toml",
    "imu": "calibrate imu {0}/xsens_acc.mat {0}/xsens_gyro.mat --map {0}/xsens-map.toml --study {0}/xsens.toml",
    "design": "design selfcal {0}/selfcal.toml",
}
TOLD = ("provenance", "timing_s", "traceability")


def numbers(command, how):
    """The result of a command in a process whose kernels run so."""
    words = [*command.format(FOLDER).split(), "--json", "--quiet"]
    program = f"import sys; from inercal.cli import run; sys.exit(run({words!r}) > 1)"
    found = json.loads(python(program, INERCAL_KERNELS=how)[0])
    return {key: value for key, value in found.items() if key not in TOLD}


@compiled_alone
@pytest.mark.slow
def test_the_noise_has_the_digits_of_numba():
    assert numbers(COMMANDS["allan"], "compiled") == numbers(COMMANDS["allan"], "numba")


@compiled_alone
@pytest.mark.campaign
@pytest.mark.parametrize("name", [name for name in COMMANDS if name != "allan"])
def test_every_number_of_the_examples_has_the_digits_of_numba(name):
    assert numbers(COMMANDS[name], "compiled") == numbers(COMMANDS[name], "numba")
