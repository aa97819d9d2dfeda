"""The plan of the house: which module may import which, read from the sources.

Shared floors below, one room per system above them, thin faces on top. Imports for type checking alone do not
count; imports inside functions do, but for circles.
"""

import ast
import functools
import graphlib
import re
from pathlib import Path

import pytest

import inercal
from counts import HOUSES, SYSTEMS, constants, placed, room, shared_classes, totals, used_elsewhere

PACKAGE = Path(inercal.__file__).parent
ROOT = Path(__file__).parents[1]

#: lowest first; a module imports from its own floor and those below; houses lie on each other as their rooms do
FLOORS = [
    {"foundation", "faces", "bench"},  # houses themselves, which hold nothing but rooms
    *(set(line.split()) for line in HOUSES["foundation"]),
    {"examples"},
    {*SYSTEMS},
    {"systems"},
    *(set(line.split()) for line in HOUSES["faces"][:-1]),
    {"python", "laboratory"},  # `load` reads certificates
    {"fleet"},
    {"live"},
    {"workbench", "cli", "__main__"},
]
#: modules of a system that stand on the floor of a room above
LIFTED = {"figures": "report", "verbs": "python"}
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


@functools.cache
def imports(module, functions=True):
    """Names of all modules a module imports; ``from package import name`` names the submodule if there is one."""
    return frozenset(read_imports(module, functions))


def read_imports(module, functions):
    for node in walk(TREES[module], functions):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{module} imports relatively"
            for alias in node.names:
                name = f"{node.module}.{alias.name}"
                yield name if name in SOURCES else node.module


def lifted(module):
    """The part of a system that stands on the floor of a room above, as ``figures``; empty for any other."""
    if room(module) not in SYSTEMS:
        return ""
    return next((part for part in placed(module)[1] if part in LIFTED), "")


def is_record(module):
    """The record of what a system offers: its functions import from any floor, when somebody of that floor asks."""
    return room(module) in SYSTEMS and placed(module)[1] == ("system",)


def floor(module):
    """Level of a module; the package itself, which only defines words, is the ground."""
    if module == "inercal":
        return -1
    if is_record(module):
        return FLOOR_OF["systems"]
    return FLOOR_OF[LIFTED.get(lifted(module), room(module))]


MODULES = sorted(SOURCES)


def test_every_room_has_a_floor():
    assert {room(module) for module in MODULES} - {"inercal"} <= FLOOR_OF.keys()


def wrong_imports(module):
    """What a module imports against the plan."""
    for other in sorted(imports(module, functions=not is_record(module))):
        if other.split(".")[0] != "inercal":
            continue
        if other not in SOURCES:
            yield f"{module} imports {other}, which does not exist"
            continue
        if floor(other) > floor(module):
            yield f"{module} imports {other}, which is on a floor above"
        if is_record(other) and room(module) in SYSTEMS:
            yield f"{module} imports {other}: a record is for the rooms above"
        of_task = other.endswith(".task") and room(other) in SYSTEMS
        if of_task and room(module) not in ("cli", "python", "validate", room(other)):
            yield f"{module} imports {other}: only the faces and the validation run tasks"
        asks = room(module) in ("cli", "python") or lifted(module) in ("figures", "verbs")
        if lifted(other) == "figures" and not asks:
            yield f"{module} imports {other}: only the faces ask for figures"


def test_imports_come_from_below():
    assert [wrong for module in MODULES for wrong in wrong_imports(module)] == []


def house(module):
    """``foundation`` of ``inercal.foundation.records.read.text``."""
    return [*module.split("."), "inercal"][1]


def test_houses_stand_on_each_other():
    """What a system has on the floor of a face, and its record, go along with the faces."""
    order = [
        "inercal",
        "foundation",
        "examples",
        "systems",
        "faces",
        "laboratory",
        "bench",
        "cli",
        "__main__",
    ]
    known = {
        # a certificate is a result, too, and `load` asks the laboratory when it meets one
        ("inercal.faces.python.calibrations", "inercal.laboratory.certificate.reading"),
        # the jobs of a workbench are commands
        ("inercal.bench.workbench.child", "inercal.cli"),
        ("inercal.bench.workbench.jobs", "inercal.cli.stored_line"),
    }
    up = [
        f"{module} imports {other}"
        for module in MODULES
        for other in imports(module) & SOURCES.keys()
        if not (lifted(module) or is_record(module)) and (module, other) not in known
        if order.index(house(other)) > order.index(house(module))
    ]
    assert up == []


def test_one_system_does_not_know_another():
    crossed = [
        f"{module} imports {other}"
        for module in MODULES
        for other in imports(module)
        if len({room(module), room(other)} & {*SYSTEMS}) > 1
    ]
    assert crossed == []


def test_records_stand_on_their_own():
    """A record is data: units and errors, no numerics."""
    rooms = {
        room(other) for other in imports("inercal.foundation.records.record") if other.startswith("inercal")
    }
    assert rooms <= {"arrays", "units", "errors", "findings", "inputs", "records"}


def test_no_circles():
    """At module level, where a circle would fail; importing a module also runs the packages around it."""
    graph = {}
    for module in MODULES:
        needed = {other for other in imports(module, functions=False) if other in SOURCES}
        around = {each for other in needed for each in MODULES if other.startswith(each + ".")}
        own = {each for each in MODULES if module.startswith(each + ".")}
        graph[module] = (needed | around) - own - {module}
    graphlib.TopologicalSorter(graph).prepare()  # raises CycleError, naming the circle


#: rooms within a system, lowest first: a module imports from its own room and those before it
WITHIN = {
    "imu": (
        "limits identified recording rows turns settings simulate "
        "sections ferraris aided temperature task figures verbs system"
    ),
    "strapdown": "limits model settings simulate reading fit before result task figures verbs system",
    "turntable": (
        "limits settings judged model weights regression readings display sensitivity sensitivity_maps "
        "positions rate step_response step_test simulate task figures verbs system"
    ),
    "aoa": (
        "estimators limits alarm band layout disturbances motion settings angles reading fusion paper diagnosis "
        "reference result simulate design foresight estimation task runs figures verbs system"
    ),
    "selfcal": (
        "estimators limits platform disturbances settings stated simulate still_joints filters before diagnosis "
        "find_base monte_carlo reading result task several figures verbs system"
    ),
}


def all_imports(module):
    """Modules of the package that a module names in any import, for type checking and inside functions too."""
    for node in ast.walk(TREES[module]):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names if alias.name in SOURCES)
        elif isinstance(node, ast.ImportFrom):
            for alias in node.names:
                name = f"{node.module}.{alias.name}"
                yield from (each for each in [name if name in SOURCES else node.module] if each in SOURCES)


def test_no_circles_of_any_kind():
    """Also none through imports for type checking alone, or inside functions."""
    lazy = "inercal"  # its own names are resolved when asked for, as are those of the record of a system
    graph = {
        module: set(all_imports(module)) - {module}
        for module in MODULES
        if module != lazy and not is_record(module) and module != "inercal.systems.contract"
    }
    graphlib.TopologicalSorter(graph).prepare()


def test_no_package_has_a_module_of_the_name_of_what_it_defines():
    """Importing such a module would put it in the place of the function or class of that name."""
    taken = []
    for package in (module for module, path in SOURCES.items() if path.name == "__init__.py"):
        inside = {
            each.removeprefix(f"{package}.").split(".")[0]
            for each in MODULES
            if each.startswith(f"{package}.")
        }
        named = [
            {node.name} if isinstance(node, ast.FunctionDef | ast.ClassDef) else set(names_defined(node))
            for node in TREES[package].body
        ]
        own = set().union(*named, inercal.__all__ if package == "inercal" else ())
        taken += [f"{package}.{name}" for name in own & inside]
    assert taken == []


@pytest.mark.parametrize("system", WITHIN)
def test_rooms_within_a_system_stand_on_each_other(system):
    order = WITHIN[system].split()
    of = {module: placed(module)[1][0] for module in MODULES if room(module) == system and placed(module)[1]}
    assert set(of.values()) == set(order)
    up = [
        f"{module} imports {other}"
        for module, inside in of.items()
        for other in all_imports(module)
        if other in of and order.index(of[other]) > order.index(inside)
    ]
    assert up == []


def test_methods_of_an_imu_do_not_know_each_other():
    methods = {f"inercal.systems.imu.{method}" for method in ("aided", "sections", "temperature")}

    def method_of(module):
        return methods & {".".join(module.split(".")[:4])}

    crossed = [
        f"{module} imports {other}"
        for module in MODULES
        for other in all_imports(module)
        if len(method_of(module) | method_of(other)) > 1
    ]
    assert crossed == []


def test_the_package_itself_computes_nothing():
    """Public names are resolved when asked for: importing inercal imports nothing else."""
    assert imports("inercal", functions=False) <= {"typing"}


def test_modules_can_be_read_in_one_go():
    lines = {module: path.read_text(encoding="utf-8").count("\n") for module, path in SOURCES.items()}
    assert {module: count for module, count in lines.items() if count > 400} == {}


#: what `tests/counts.py` counts; lowered when an issue is done
CEILINGS = {
    "names used across folders": 1523,
    "class names shared": 5,
    "constants outside Limits": 452,
    "modules": 658,
}


def test_the_house_has_no_more_names_than_it_had():
    found = totals(TREES)
    assert found.keys() == CEILINGS.keys()
    assert {what: count for what, count in found.items() if count > CEILINGS[what]} == {}


def test_what_is_public_is_explained():
    def undocumented(node, name):
        if ast.get_docstring(node) is None:
            yield name
        if isinstance(node, ast.Module | ast.ClassDef):
            for child in node.body:
                public = isinstance(child, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
                if public and not child.name.startswith("_"):
                    yield from undocumented(child, f"{name}.{child.name}")

    assert [name for module in MODULES for name in undocumented(TREES[module], module)] == []


def test_docstrings_begin_with_their_subject():
    """A noun or a verb: no docstring, of a constant neither, opens with a question."""
    questions = [
        f"{module}, line {node.lineno}"
        for module, tree in TREES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant)
        if re.match(r"\s*(What|How|Whether|Where)\b", str(node.value.value))
    ]
    assert questions == []


def names_in(tree):
    """Names that code speaks of: variables, attributes, what is imported, words that may be looked up."""
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name) | ast.Attribute(attr=name) | ast.Constant(value=str(name)):
                yield name
            case ast.alias(name=name):
                yield name.split(".")[-1]


def test_what_is_defined_is_used():
    """By the program, its pages, the book or the benchmarks: what tests alone call belongs to the tests."""
    used = {name for tree in TREES.values() for name in names_in(tree)}
    for page in PACKAGE.rglob("*.html"):
        used |= set(re.findall(r"\w+", page.read_text(encoding="utf-8")))
    for folder in ("benchmarks", "docs"):
        for path in (ROOT / folder).rglob("*.py"):
            used |= set(names_in(ast.parse(path.read_text(encoding="utf-8"))))
    for page in (ROOT / "README.md", *(ROOT / "docs").rglob("*.md")):
        for block in re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S):
            used |= set(names_in(ast.parse(block)))
    unused = [
        f"{module}.{node.name}"
        for module, tree in TREES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.ClassDef)
        and node.name not in used
        and not is_called_from_outside(module, node)
    ]
    assert unused == []


def test_the_map_names_every_room():
    """The docstring of the package is where a newcomer begins."""
    said = set(re.findall(r"\w+", inercal.__doc__.split("Map, lower floors first")[1]))
    rooms = {room(module) for module in MODULES} - {"inercal"}
    assert {each for each in rooms if not each.startswith("_")} <= said


def test_what_is_referred_to_is_there():
    """`inercal.room.module.name` in a docstring, a comment or the book: moved code must not leave a dead reference."""
    defined = {module: set(names_defined(tree)) for module, tree in TREES.items()}

    def is_there(reference):
        parts = reference.split(".")
        module = max((m for m in SOURCES if f"{reference}.".startswith(f"{m}.")), key=len)
        return module == reference or set(parts[module.count(".") + 1 :]) <= defined[module]

    pages = [*SOURCES.values(), ROOT / "README.md", *(ROOT / "docs").rglob("*.md")]
    dead = [
        f"{page.name}: {reference}"
        for page in pages
        for reference in re.findall(r"`(inercal(?:\.\w+)+)", page.read_text(encoding="utf-8"))
        if not is_there(reference)
    ]
    assert dead == []


def names_defined(tree):
    """Names that a module defines or imports, those inside its classes among them."""
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name) | ast.Name(id=name, ctx=ast.Store()):
                yield name
            case ast.alias(name=name, asname=other):
                yield other or name


def is_called_from_outside(module, node):
    """Python's own names, checks that pydantic runs, what notebooks, dask and the web call, and the commands."""
    checked = any("_validator" in ast.unparse(each) for each in node.decorator_list)
    asked = any(ast.unparse(each).startswith("app.") for each in node.decorator_list)
    of_others = node.name in ("nullable_schema", "_repr_html_", "setup")
    return node.name.startswith("__") or checked or asked or of_others or room(module) == "cli"


def prints(node):
    """True for a call of ``print`` or of standard output."""
    match node:
        case ast.Call(func=ast.Name(id="print")):
            return True
        case ast.Call(func=ast.Attribute() as function):
            return "sys.stdout" in ast.unparse(function)
    return False


def offers():
    """What the records of systems offer by a function that imports it: name -> floor, the highest of any system."""
    highest = {}
    for module in filter(is_record, MODULES):
        needs = {
            node.name: [
                floor(each.module)
                for each in ast.walk(node)
                if isinstance(each, ast.ImportFrom) and each.module.startswith("inercal")
            ]
            for node in TREES[module].body
            if isinstance(node, ast.FunctionDef)
        }
        for node in ast.walk(TREES[module]):
            if isinstance(node, ast.keyword) and isinstance(node.value, ast.Name):
                levels = [*needs.get(node.value.id, ()), highest.get(node.arg, -1)]
                highest[node.arg] = max(levels)
    return highest


def read_of_a_system(tree):
    """Attributes of ``system``, of ``study.system``, of ``SYSTEMS[kind]``."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            match node.value:
                case (
                    ast.Name(id="system")
                    | ast.Attribute(attr="system")
                    | ast.Subscript(value=ast.Name(id="SYSTEMS") | ast.Attribute(attr="SYSTEMS"))
                ):
                    yield node.attr


def test_of_a_system_a_room_reads_what_is_on_its_floor():
    """A record is no back stair: studies read a study by it, validation its cases, faces and those above the rest."""
    offered = offers()
    assert offered["calibrate"] > offered["cases"] > offered["read_study"] > offered["foresight"]
    up = [
        f"{module} reads {name}"
        for module in MODULES
        for name in read_of_a_system(TREES[module])
        if offered.get(name, -1) > floor(module)
    ]
    assert up == []


def is_constant(node):
    """True for a text as it stands, or for the choice between two."""
    match node:
        case ast.IfExp(body=first, orelse=second):
            return is_constant(first) and is_constant(second)
    return isinstance(node, ast.Constant)


def test_no_module_is_imported_by_a_name_made_of_text():
    """An editor follows a system by its record, from the verb to the fit."""
    known = {
        "inercal",  # its public names
        "inercal.foundation.records.read",  # formats of files
    }
    made = [
        module
        for module, tree in TREES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and ast.unparse(node.func).split(".")[-1] in ("import_module", "__import__")
        if not is_constant(node.args[0])
    ]
    assert {*made} - known == set()


def test_kinds_of_study_are_named_by_their_systems():
    """A table of kinds outside their rooms would be one more place to visit with a new system."""
    kinds = set(SYSTEMS)
    known = {
        "inercal.cli.tree",  # the text of help
        "inercal.examples",  # their names and commands
        "inercal.foundation.results.shown",  # on a floor below the systems
        "inercal.faces.validate.case",  # names of examples
    }
    tables = [
        f"{module}, line {node.lineno}"
        for module, tree in TREES.items()
        if room(module) not in kinds and module not in known
        for node in ast.walk(tree)
        if isinstance(node, ast.Dict | ast.Tuple | ast.List | ast.Set | ast.Match | ast.Compare)
        if len({each.value for each in ast.walk(node) if isinstance(each, ast.Constant)} & kinds) > 1
    ]
    assert tables == []


def test_only_the_command_line_prints():
    modules = {module for module in MODULES if any(prints(node) for node in ast.walk(TREES[module]))}
    assert {module for module in modules if room(module) != "cli"} == set()


def test_numba_has_one_door():
    users = {module for module in MODULES for other in imports(module) if other.split(".")[0] == "numba"}
    assert users == {"inercal.foundation._jit"}


def test_randomness_is_always_handed_in():
    """No global generator, and none made without a seed."""
    allowed = {"Generator", "default_rng", "SeedSequence", "PCG64", "BitGenerator"}
    for module in MODULES:
        for node in ast.walk(TREES[module]):
            match node:
                case ast.Attribute(value=ast.Attribute(value=ast.Name(id="np" | "numpy"), attr="random")):
                    assert node.attr in allowed, f"{module} uses np.random.{node.attr}"
                case ast.Call(func=ast.Attribute(attr="default_rng") | ast.Name(id="default_rng")):
                    assert node.args, f"{module} makes a generator without a seed"


# The checks themselves.


def test_what_the_counts_count():
    """Names by ``from`` or as an attribute, of other folders alone and without those that each system has."""
    texts = {
        "inercal": "",
        "inercal.a": "",
        "inercal.a.one": "from math import pi\nclass Turn: ...\nclass Own: ...\nSIZE = -2.0 * pi\nON = True\nX = 'x'",
        "inercal.a.two": "from inercal.a.one import Own\n_STEP: float = 3\nsmall = 4",
        "inercal.b": "",
        "inercal.b.three": "from inercal.a import one, two as t\nclass Turn: ...\none.SIZE; t._STEP",
        "inercal.b.four": "def f():\n    from inercal.a.one import SIZE, Turn",
    }
    for system in SYSTEMS:
        texts[f"inercal.{system}"] = ""
        texts[f"inercal.{system}.limits"] = "class Limits: ...\nLEAST = 5"
        texts["inercal.b.three"] += f"\nfrom inercal.{system}.limits import Limits"
    trees = {module: ast.parse(text) for module, text in texts.items()}
    used = used_elsewhere(trees)
    assert used.keys() == {"inercal.a.one.SIZE", "inercal.a.one.Turn", "inercal.a.two._STEP"}
    assert used["inercal.a.one.SIZE"] == {"inercal.b.three", "inercal.b.four"}
    assert shared_classes(trees) == {"Turn": ["inercal.a.one", "inercal.b.three"]}
    assert constants(trees).keys() == {"inercal.a.one.SIZE", "inercal.a.two._STEP"}
    assert totals(trees)["modules"] == len(trees)


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
        assert imports("sample") == {"typing", "two", "three", "four", "five", "six"}
        assert imports("sample", functions=False) == {"typing", "two", "four", "five", "six"}
    finally:
        del TREES["sample"]
    assert len(MODULES) > 40
    assert floor("inercal.systems.imu.sections.figures") > floor("inercal.systems.imu.task")
    assert room("inercal.foundation.records.read.text") == "records"
