"""How many names, classes and constants the house has, and how many of them are everybody's business.

    python tests/counts.py

prints them by room. `test_architecture.py` holds ceilings on the totals, which are lowered as the house gets simpler.
"""

from __future__ import annotations

import ast
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping

SYSTEMS = ("imu", "strapdown", "turntable", "selfcal", "aoa")

#: folders of the package that hold rooms, lowest first, and their rooms, lowest first; those on one line share a floor
HOUSES = {
    "foundation": (
        "addresses arrays errors inputs",
        "findings units",
        "_jit _files _toml keys",
        "geometry",
        "instruments",
        "records",
        "rigs",
        "computing",
        "inference",
        "results",
        "noise",
        "sensitivities",
        "designs",
    ),
    "systems": (" ".join(SYSTEMS),),
    "faces": ("convert", "studies", "report", "stream", "validate", "python"),
    "laboratory": ("fleet",),
    "bench": ("live", "workbench"),
}

Trees = Mapping[str, ast.Module]


def placed(module: str) -> tuple[str, tuple[str, ...]]:
    """Room of a module, and its place there: ``records`` and ``read, text`` of
    ``inercal.foundation.records.read.text``.

    What lies in a house, but in none of its rooms, is in a room of the name of the house.
    """
    _, *parts = module.split(".")
    rooms = " ".join(HOUSES.get(parts[0], ())).split() if parts else []
    if len(parts) > 1 and parts[1] in rooms:
        parts = parts[1:]
    return (parts[0], tuple(parts[1:])) if parts else ("inercal", ())


def room(module: str) -> str:
    """``records`` of ``inercal.foundation.records.read.text``; ``inercal`` of the package itself."""
    return placed(module)[0]


def folder(module: str, trees: Trees) -> str:
    """The package that a module lies in, itself where it is one."""
    inside = any(other.startswith(f"{module}.") for other in trees)
    return module if inside else module.rpartition(".")[0]


def used_elsewhere(trees: Trees) -> dict[str, set[str]]:
    """Names (``module.name``) that another folder uses, by ``from`` or as an attribute of the module, with those that
    use them. Names that each system has in a module of the same name are the systems' contract and do not count."""
    folders = {module: folder(module, trees) for module in trees}
    contract = _contract(trees)
    found: dict[str, set[str]] = defaultdict(set)
    for module, tree in trees.items():
        for other, name in _uses(tree, trees):
            own = (other.rpartition(".")[2], name)
            if folders[other] != folders[module] and not (room(other) in SYSTEMS and own in contract):
                found[f"{other}.{name}"].add(module)
    return found


def _uses(tree: ast.Module, trees: Trees) -> Iterator[tuple[str, str]]:
    """Module and name of all that a module takes from others."""
    called: dict[str, set[str]] = defaultdict(set)  # the modules that a local name may be
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module in trees:
            for alias in node.names:
                whole = f"{node.module}.{alias.name}"
                if whole in trees:
                    called[alias.asname or alias.name].add(whole)
                else:
                    yield str(node.module), alias.name
        elif isinstance(node, ast.Import):
            for alias in node.names:
                if alias.name in trees and alias.asname:
                    called[alias.asname].add(alias.name)
    for node in ast.walk(tree):
        match node:
            case ast.Attribute(value=ast.Name(id=local), attr=name) if local in called:
                for module in called[local]:
                    if f"{module}.{name}" not in trees and name in defined(trees[module]):
                        yield module, name


def defined(tree: ast.Module, imported: bool = True) -> set[str]:
    """Names that a module defines, or imports, outside functions and classes."""
    found: set[str] = set()
    for node in tree.body:
        match node:
            case ast.FunctionDef(name=name) | ast.AsyncFunctionDef(name=name) | ast.ClassDef(name=name):
                found.add(name)
            case ast.Assign(targets=targets):
                found |= {each.id for each in targets if isinstance(each, ast.Name)}
            case ast.AnnAssign(target=ast.Name(id=name)):
                found.add(name)
            case ast.ImportFrom(names=names) if imported:
                found |= {each.asname or each.name for each in names}
    return found


def _contract(trees: Trees) -> set[tuple[str, str]]:
    """Last part of the module and name of what each system defines."""
    by_system = {
        system: {
            (module.rpartition(".")[2], name)
            for module, tree in trees.items()
            if room(module) == system
            for name in defined(tree, imported=False)
        }
        for system in SYSTEMS
    }
    return set.intersection(*by_system.values())


def shared_classes(trees: Trees) -> dict[str, list[str]]:
    """Names of classes that several modules define, with the modules; those of the systems' contract do not count."""
    found: dict[str, list[str]] = defaultdict(list)
    contract = _contract(trees)
    for module, tree in trees.items():
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and (module.rpartition(".")[2], node.name) not in contract:
                found[node.name].append(module)
    return {name: modules for name, modules in found.items() if len(modules) > 1}


def constants(trees: Trees) -> dict[str, str]:
    """Numbers with a name of capitals that stand in a module of their own (``module.name``), outside `Limits`."""
    found = {}
    for module, tree in trees.items():
        if module.rpartition(".")[2] == "limits":
            continue
        for node in tree.body:
            match node:
                case ast.Assign(targets=[ast.Name(id=name)], value=value):
                    pass
                case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value):
                    pass
                case _:
                    continue
            if name.isupper() and _is_number(value):
                found[f"{module}.{name}"] = ast.unparse(value)
    return found


def _is_number(value: ast.expr) -> bool:
    """True for numbers, and what arithmetic makes of them."""
    match value:
        case ast.Constant(value=number):
            return isinstance(number, int | float) and not isinstance(number, bool)
        case ast.UnaryOp(operand=operand):
            return _is_number(operand)
        case ast.BinOp(left=left, right=right):
            return _is_number(left) and _is_number(right)
        case ast.Attribute(value=ast.Name(id="math" | "np")) | ast.Name():
            return ast.unparse(value).rpartition(".")[2] in ("pi", "e", "inf")
        case ast.Call(func=ast.Attribute(value=ast.Name(id="math" | "np")), args=args):
            return bool(args) and all(map(_is_number, args))
    return False


def counts(trees: Trees) -> dict[str, Counter[str]]:
    """What is counted, by room; a class name counts once in each room that has it, but for the total (`totals`)."""
    shared = shared_classes(trees)
    return {
        "names used across folders": Counter(
            map(room, (each.rpartition(".")[0] for each in used_elsewhere(trees)))
        ),
        "class names shared": Counter(each for modules in shared.values() for each in {*map(room, modules)}),
        "constants outside Limits": Counter(room(each.rpartition(".")[0]) for each in constants(trees)),
        "modules": Counter(map(room, trees)),
    }


def totals(trees: Trees) -> dict[str, int]:
    """What is counted, of the whole house."""
    return {what: by_room.total() for what, by_room in counts(trees).items()} | {
        "class names shared": len(shared_classes(trees))
    }


def main() -> None:
    """Print the table."""
    from test_architecture import TREES

    by_room, whole = counts(TREES), totals(TREES)
    rooms = sorted({*by_room["modules"]})
    print(f"{'room':<14}" + "".join(f"{what:>28}" for what in by_room))
    for each in rooms:
        print(f"{each:<14}" + "".join(f"{of[each]:>28}" for of in by_room.values()))
    print(f"{'in all':<14}" + "".join(f"{whole[what]:>28}" for what in by_room))


if __name__ == "__main__":
    main()
