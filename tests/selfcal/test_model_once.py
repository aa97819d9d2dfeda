"""The model of the platform is written once: what its kernels must not do, for a state to be a row of its table."""

import ast
import typing
from importlib import import_module
from pathlib import Path

import numpy as np

import inercal.systems.selfcal
from inercal.foundation._jit import plain

FOLDER = Path(inercal.systems.selfcal.__file__).parent
KERNELS = ("kernel", "merged", "inlined", "allocating")


def compiled():
    """Module, name of the decorator, and tree of each compiled function of the room."""
    for path in sorted(FOLDER.rglob("*.py")):
        module = ".".join(("inercal", "systems", "selfcal", *path.relative_to(FOLDER).with_suffix("").parts))
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            for decorator in getattr(node, "decorator_list", ()):
                if isinstance(node, ast.FunctionDef) and getattr(decorator, "id", "") in KERNELS:
                    yield module, decorator.id, node


def test_the_full_vector_has_one_length():
    """No kernel asks for the length of the coefficients, or takes a slice of them: a layout says what is active."""
    wrong = [
        f"{module}.{node.name}, line {each.lineno}"
        for module, _, node in compiled()
        for each in ast.walk(node)
        if ast.unparse(each) == "len(c)"
        or (
            isinstance(each, ast.Subscript)
            and ast.unparse(each.value) == "c"
            and isinstance(each.slice, ast.Slice)
        )
    ]
    assert wrong == []


def test_no_kernel_assigns_to_a_slice():
    """numba takes twice as long to compile it as a loop or ``fill``."""
    wrong = [
        f"{module}.{node.name}, line {each.lineno}"
        for module, _, node in compiled()
        for each in ast.walk(node)
        if isinstance(each, ast.Assign)
        for target in each.targets
        for part in ast.walk(target)
        if isinstance(part, ast.Slice)
    ]
    assert wrong == []


def holds_array(hint):
    """True for an array, and for a tuple that holds one."""
    parts = tuple(typing.get_type_hints(hint).values()) if hasattr(hint, "_fields") else typing.get_args(hint)
    origin = typing.get_origin(hint) or hint
    return origin is np.ndarray or (
        isinstance(origin, type) and issubclass(origin, tuple) and any(map(holds_array, parts))
    )


def test_no_kernel_returns_an_array():
    """Alone or in a tuple: where no references are counted its memory would be freed too soon."""
    wrong = []
    for module, decorator, node in compiled():
        function = getattr(import_module(module), node.name)
        hints = typing.get_type_hints(plain(function))
        if decorator != "allocating" and holds_array(hints["return"]):
            wrong.append(f"{module}.{node.name}")
    assert wrong == []
