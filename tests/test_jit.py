"""Promises of the kernel decorator where numba compiles as kernels are called: never stale, never in the way, once.

Each test runs other processes, on a copy of the package where sources change, since a cache lives between
processes and not in one.
"""

import ast
import builtins
import importlib
import inspect
import os
import shutil
import subprocess
import sys
import textwrap
import typing
from pathlib import Path

import numpy as np
import pytest

import inercal
from entries import Sources
from inercal.foundation._jit import plain

PACKAGE = Path(inercal.__file__).parent
NOWHERE = "/dev/null/nowhere"  # below a file: nobody can make it, not even root


def python(program, *, path=PACKAGE.parent, **environment):
    """Run a program in a new process with ``path`` as its package folder; what it printed."""
    kept = {key: value for key, value in os.environ.items() if not key.startswith("NUMBA_")}
    kept["INERCAL_KERNELS"] = "numba"
    run = subprocess.run(
        [sys.executable, "-c", program],
        env=kept | {"PYTHONPATH": str(path)} | {key: str(value) for key, value in environment.items()},
        capture_output=True,
        text=True,
    )
    assert run.returncode == 0, run.stderr
    return run.stdout.strip()


USE_A_KERNEL = """
import numpy as np
from inercal.foundation import _jit
from inercal.foundation.geometry import kernels
assert kernels.normalize(np.array([2.0, 0.0, 0.0, 0.0])) == (1.0, 0.0, 0.0, 0.0)
print(_jit.cache_folder())
"""


@pytest.mark.slow
def test_a_changed_callee_changes_the_result_of_its_cached_caller(tmp_path):
    """numba's own cache would give the old number here: it hashes the caller's file alone."""
    package = tmp_path / "tiny"
    (package / "foundation").mkdir(parents=True)
    shutil.copy(PACKAGE / "foundation" / "_jit.py", package / "foundation")
    callee = "from tiny.foundation._jit import kernel\n\n@kernel\ndef inner(x):\n    return x + {}\n"
    (package / "callee.py").write_text(callee.format(1.0))
    (package / "caller.py").write_text(
        "from tiny.foundation._jit import kernel\nfrom tiny.callee import inner\n\n"
        "@kernel\ndef outer(x):\n    return 10.0 * inner(x)\n"
    )
    program = "from tiny.caller import outer; print(outer(1.0), sum(outer.stats.cache_misses.values()))"
    here = {"path": tmp_path, "XDG_CACHE_HOME": tmp_path / "cache"}
    assert python(program, **here) == "20.0 1"
    assert python(program, **here) == "20.0 0"
    (package / "callee.py").write_text(callee.format(2.0))
    assert python(program, **here) == "30.0 1"


@pytest.mark.slow
def test_a_second_process_compiles_nothing(tmp_path):
    """Of the whole package a copy, so that nobody's editing meanwhile starts a new cache."""
    shutil.copytree(PACKAGE, tmp_path / "inercal", ignore=shutil.ignore_patterns("__pycache__"))
    program = """
import numpy as np
from inercal.foundation.geometry import kernels
q, v = np.array([1.0, 0.0, 0.0, 0.0]), np.zeros(3)
kernels.multiply(q, q), kernels.normalize(q), kernels.rotate(q, v), kernels.exp(v), kernels.step(q, v, 0.1)
kernels.integrate(q, np.zeros((1, 3)), np.zeros(1), np.zeros((2, 4)))
kernels.log(q), kernels.right_jacobian(v)
every = [value for value in vars(kernels).values() if hasattr(value, "stats")]
assert len(every) == 8 and all(kernel.signatures for kernel in every)
print(sum(sum(kernel.stats.cache_misses.values()) for kernel in every))
"""
    here = {"path": tmp_path, "XDG_CACHE_HOME": tmp_path / "cache"}
    assert int(python(program, **here)) > 0
    assert int(python(program, **here)) == 0


@pytest.mark.skipif(os.name != "posix", reason="the unwritable place is a POSIX one")
def test_without_a_writable_home_the_cache_is_in_the_temporary_folder(tmp_path):
    folder = python(USE_A_KERNEL, HOME=NOWHERE, XDG_CACHE_HOME=NOWHERE, TMPDIR=tmp_path)
    assert Path(folder).parent == tmp_path / f"inercal-{os.getuid()}"
    assert list(Path(folder).rglob("*.nbi"))


@pytest.mark.skipif(os.name != "posix", reason="the unwritable place is a POSIX one")
@pytest.mark.parametrize("gettempdir", [f"lambda: {NOWHERE!r}", "lambda: open('/nowhere')"])
def test_where_nothing_can_be_written_kernels_work_without_a_cache(gettempdir):
    """A read-only machine, where ``gettempdir`` gives a folder of no use or raises FileNotFoundError."""
    program = f"import tempfile; tempfile.gettempdir = {gettempdir}" + USE_A_KERNEL
    assert python(program, HOME=NOWHERE, XDG_CACHE_HOME=NOWHERE, TMPDIR=NOWHERE) == "None"


def test_kernels_run_as_plain_python_too():
    """For debuggers and coverage, which do not see compiled bodies."""
    program = """
import sys
import numpy as np
from inercal.foundation.geometry import kernels, rotations
assert not hasattr(kernels.integrate, "machine_code") and "numba" not in sys.modules
rng = np.random.default_rng(4)
q0, omega = rotations.normalize(rng.normal(size=4)), rng.normal(size=(9, 3))
dt, out = np.full(9, 0.1), np.empty((10, 4))
omega[3] = 0.0
kernels.integrate(q0, omega, dt, out)
np.testing.assert_allclose(out[1:], rotations.step(out[:-1], omega, dt), atol=1e-15)
np.testing.assert_allclose(kernels.rotate(q0, omega[0]), rotations.rotate(q0, omega[0]), atol=1e-15)
print("same")
"""
    assert python(program, INERCAL_KERNELS="python") == "same"


def kernels():
    """All kernels of the package as plain Python, with the names of their decorators."""
    return {
        plain(getattr(importlib.import_module(module), name)): {each.id for each in node.decorator_list}
        for (module, name), node in Sources().kernels.items()
    }


def of_arrays(kind):
    """True for a type that is, or holds, an array."""
    if np.ndarray in (kind, typing.get_origin(kind)):
        return True
    fields = typing.get_args(kind)
    if isinstance(kind, type) and issubclass(kind, tuple) and hasattr(kind, "_fields"):
        fields = typing.get_type_hints(kind).values()
    return any(map(of_arrays, fields))


def test_kernels_that_count_no_references_are_handed_no_new_arrays():
    """An array that such a kernel returned would be freed twice, one that it got from another never."""
    every = kernels()
    uncounted = [each for each, decorators in every.items() if "allocating" not in decorators]
    assert len(uncounted) > 150
    for each in uncounted:
        assert not of_arrays(typing.get_type_hints(each)["return"]), each
        for call in calls(each):
            assert may_be_called(call, each.__globals__), f"{each} calls {ast.unparse(call)}"


def calls(function):
    """What a function calls."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(function)))
    return [node.func for node in ast.walk(tree) if isinstance(node, ast.Call)]


SCALARS = {"float64", "int64", "uint64"}
IN_PLACE = {"fill", "all"}


def may_be_called(call, names):
    """True if what is called makes no array: a kernel that returns none, a function of numbers, a tuple of numbers."""
    if isinstance(call, ast.Attribute):
        of = call.value.id if isinstance(call.value, ast.Name) else ""
        return of == "math" or (of == "np" and call.attr in SCALARS) or (of != "np" and call.attr in IN_PLACE)
    name = call.id if isinstance(call, ast.Name) else ""
    found = plain(names.get(name, getattr(builtins, name, None)))
    if inspect.isfunction(found) and found.__module__.startswith("inercal."):
        return not of_arrays(typing.get_type_hints(found)["return"])
    return found in {abs, min, max, len, range, int, float, bool, round, divmod} or (
        isinstance(found, type) and issubclass(found, tuple) and not of_arrays(found)
    )


@pytest.mark.campaign
def test_kernels_free_what_they_make():
    """After the shipped examples of a platform and of a tunnel no array that a kernel made is left."""
    program = """
import gc
from inercal.cli import main
from inercal.examples import FOLDER
from numba.core.runtime import rtsys
def run(*words):
    try:
        main([*words, "--quiet"])
    except SystemExit:
        pass
    gc.collect()
    stats = rtsys.get_allocation_stats()
    return stats.mi_alloc, stats.mi_alloc - stats.mi_free
for words in (
    ["selfcal", str(FOLDER / "selfcal.csv.gz"), "--study", str(FOLDER / "selfcal.toml")],
    ["aoa", str(FOLDER / "sting.csv.gz"), "--study", str(FOLDER / "sting.toml")],
):
    run(*words)
    made, kept = run(*words)
    again, still = run(*words)
    assert again > made and still == kept, (words, made, kept, again, still)
print("freed")
"""
    assert python(program, NUMBA_NRT_STATS=1).endswith("freed")
