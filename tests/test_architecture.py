"""The plan of the house: which module may import which, read from the sources.

Shared floors below, one room per system above them, thin faces on top. Imports for type checking alone do not
count; imports inside functions do, but for circles.
"""

import ast
import graphlib
from pathlib import Path

import pytest

import inercal

PACKAGE = Path(inercal.__file__).parent

#: lowest first; a module imports from its own floor and those below
FLOORS = [
    {"errors"},
    {"units"},
    {"_jit", "_files", "_toml"},
    {"geometry"},
    {"instruments"},
    {"records"},
    {"rigs"},
    {"estimate"},
    {"noise"},
    {"sensitivity"},
    {"design"},
    {"imu", "turntable", "selfcal", "aoa"},
    {"convert"},
    {"study"},
    {"report"},
    {"stream"},
    {"validate"},
    {"examples"},
    {"cli", "__main__"},
]
SYSTEMS = {"imu", "turntable", "selfcal", "aoa"}
FLOOR_OF = {room: level for level, floor in enumerate(FLOORS) for room in floor}
SOURCES = {
    ".".join(("inercal", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__"): path
    for path in sorted(PACKAGE.rglob("*.py"))
}
TREES = {module: ast.parse(path.read_text(encoding="utf-8")) for module, path in SOURCES.items()}


def for_type_checking(node):
    """True for ``if TYPE_CHECKING:``."""
    return isinstance(node, ast.If) and ast.unparse(node.test).removeprefix("typing.") == "TYPE_CHECKING"


def walk(node, functions):
    """All nodes but those for type checking; without those inside functions unless wanted."""
    for child in ast.iter_child_nodes(node):
        inner = isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.Lambda)
        if for_type_checking(child):
            yield from (each for other in child.orelse for each in (other, *walk(other, functions)))
        elif functions or not inner:
            yield child
            yield from walk(child, functions)


def imports(module, functions=True):
    """Names of all modules a module imports; ``from package import name`` names the submodule if there is one."""
    for node in walk(TREES[module], functions):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module} imports relatively"
            for alias in node.names:
                name = f"{node.module}.{alias.name}"
                yield name if name in SOURCES else node.module


def room(module):
    """``records`` of ``inercal.records.read.text``; empty for the package itself."""
    return [*module.split("."), ""][1]


def is_figures(module):
    """Figures of a system: drawn on top of the report, so a face."""
    return room(module) in SYSTEMS and module.endswith(".figures")


def floor(module):
    """Level of a module; the package itself, which only defines words, is the ground."""
    if module == "inercal":
        return -1
    return FLOOR_OF["report"] if is_figures(module) else FLOOR_OF[room(module)]


MODULES = sorted(SOURCES)


def test_every_room_has_a_floor():
    assert {room(module) for module in MODULES} - {""} <= FLOOR_OF.keys()


@pytest.mark.parametrize("module", MODULES)
def test_imports_come_from_below(module):
    for other in set(imports(module)):
        if other.split(".")[0] != "inercal":
            continue
        assert other in SOURCES, f"{module} imports {other}, which does not exist"
        assert floor(other) <= floor(module), f"{module} imports {other}, which is on a floor above"
        both = {room(module), room(other)}
        assert len(both & SYSTEMS) < 2, f"{module} imports {other}: one system knows another"
        if other.endswith(".task") and room(other) in SYSTEMS:
            assert room(module) in ("cli", room(other)), (
                f"{module} imports {other}: only the command line runs tasks"
            )
        if is_figures(other):
            assert room(module) == "cli", f"{module} imports {other}: only the command line asks for figures"


def test_records_stand_on_their_own():
    """A record is data: units and errors, no numerics."""
    rooms = {room(other) for other in imports("inercal.records.record") if other.startswith("inercal")}
    assert rooms <= {"units", "errors", "records"}


def test_no_circles():
    """At module level, where a circle would fail; importing a module also runs the packages around it."""
    graph = {}
    for module in MODULES:
        needed = {other for other in imports(module, functions=False) if other in SOURCES}
        around = {each for other in needed for each in MODULES if other.startswith(each + ".")}
        own = {each for each in MODULES if module.startswith(each + ".")}
        graph[module] = (needed | around) - own - {module}
    graphlib.TopologicalSorter(graph).prepare()  # raises CycleError, naming the circle


def test_the_package_itself_computes_nothing():
    """Public names are resolved when asked for: importing inercal imports nothing else."""
    assert set(imports("inercal", functions=False)) <= {"typing"}


@pytest.mark.parametrize("module", MODULES)
def test_modules_can_be_read_in_one_go(module):
    lines = SOURCES[module].read_text(encoding="utf-8").count("\n")
    assert lines <= 400, f"{module} has {lines} lines"


@pytest.mark.parametrize("module", MODULES)
def test_what_is_public_is_explained(module):
    def undocumented(node, name):
        if ast.get_docstring(node) is None:
            yield name
        if isinstance(node, ast.Module | ast.ClassDef):
            for child in node.body:
                public = isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
                if public and not child.name.startswith("_"):
                    yield from undocumented(child, f"{name}.{child.name}")

    assert list(undocumented(TREES[module], module)) == []


@pytest.mark.parametrize("module", MODULES)
def test_only_the_command_line_prints(module):
    if room(module) == "cli":
        return
    calls = [node for node in ast.walk(TREES[module]) if isinstance(node, ast.Call)]
    assert "print" not in {call.func.id for call in calls if isinstance(call.func, ast.Name)}
    assert not any("sys.stdout" in ast.unparse(call.func) for call in calls)


@pytest.mark.parametrize("module", MODULES)
def test_numba_has_one_door(module):
    numba = {other for other in imports(module) if other.split(".")[0] == "numba"}
    assert not numba or module == "inercal._jit"


@pytest.mark.parametrize("module", MODULES)
def test_randomness_is_always_handed_in(module):
    """No global generator, and none made without a seed."""
    for node in ast.walk(TREES[module]):
        if isinstance(node, ast.Attribute) and ast.unparse(node).startswith(("np.random.", "numpy.random.")):
            name = node.attr
            assert name in {"Generator", "default_rng", "SeedSequence", "PCG64", "BitGenerator"}, name
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("default_rng"):
            assert node.args, f"{module} makes a generator without a seed"


# The checks themselves.


def test_the_reading_of_imports():
    """What counts as an import and what does not."""
    code = """
from typing import TYPE_CHECKING
if TYPE_CHECKING:
    from inercal.cli import one
else:
    import two
def f():
    import three
class C:
    import four
try:
    import five
except ImportError:
    import six
"""
    TREES["sample"] = ast.parse(code)
    try:
        assert set(imports("sample")) == {"typing", "two", "three", "four", "five", "six"}
        assert set(imports("sample", functions=False)) == {"typing", "two", "four", "five", "six"}
    finally:
        del TREES["sample"]
    assert len(MODULES) > 40
    assert floor("inercal.imu.figures") > floor("inercal.imu.task")
    assert room("inercal.records.read.text") == "records"
