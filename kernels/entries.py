"""Which kernels Python calls, and what source files their machine code rests on: read from the source, nothing is run.

A kernel is a function at the top of a module under a decorator of the `DOOR`. An *entry* is a kernel
that is named outside kernels, other than as `plain(kernel)`: called there, or handed on.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterator
from pathlib import Path

SOURCE = Path(__file__).parents[1] / "src"
DOOR = "inercal.foundation._jit"
DECORATORS = {"kernel", "allocating", "inlined", "merged"}

Name = tuple[str, str]
"""Module, and name at its top."""


class Sources:
    """All modules of the package, parsed: `kernels` and `entries` by (module, name)."""

    def __init__(self, source: Path = SOURCE) -> None:
        self.source = source
        self.paths = {_module(path.relative_to(source)): path for path in sorted(source.rglob("*.py"))}
        self.trees = {name: ast.parse(path.read_bytes()) for name, path in self.paths.items()}
        self.kernels: dict[Name, ast.FunctionDef] = {
            (module, node.name): node
            for module, tree in self.trees.items()
            for node in tree.body
            if isinstance(node, ast.FunctionDef) and any(map(_compiles, node.decorator_list))
        }
        self._tops = {module: _tops(tree) for module, tree in self.trees.items()}
        self._imports = {module: self._imported(tree) for module, tree in self.trees.items()}
        self.entries = sorted({name for module in self.trees for name in self._asked(module)})

    def rests_on(self) -> list[str]:
        """Paths in the package of the files that hold what entries reach by name: kernels, types, constants; and of the
        door."""
        queue = [
            (module, node) for (module, name), node in self.kernels.items() if (module, name) in self.entries
        ]
        found = {DOOR, *(module for module, _ in queue)}  # the door says with which options
        seen: set[Name] = set(self.entries)
        while queue:
            module, node = queue.pop()
            for target in self._named(module, node):
                if target not in seen and target[0] != DOOR:
                    seen.add(target)
                    found.add(target[0])
                    queue += [(target[0], top) for top in self._tops[target[0]].get(target[1], ())]
        package = self.source / "inercal"
        return sorted(self.paths[module].relative_to(package).as_posix() for module in found)

    def _imported(self, tree: ast.Module) -> dict[str, Name]:
        """What each name that a module imports from the package stands for; a module is (module, "")."""
        found: dict[str, Name] = {}
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and node.module in self.trees:
                for alias in node.names:
                    whole = f"{node.module}.{alias.name}"
                    named = (whole, "") if whole in self.trees else (node.module, alias.name)
                    found[alias.asname or alias.name] = named
        return found

    def _named(self, module: str, node: ast.AST) -> Iterator[Name]:
        """Names at the top of any module that a piece of a module uses."""
        imports, tops = self._imports[module], self._tops[module]
        local = _bound(node)
        for each in ast.walk(node):
            if isinstance(each, ast.Name):
                if each.id in local:
                    continue
                if each.id in imports and imports[each.id][1]:
                    yield imports[each.id]
                elif each.id in tops:
                    yield module, each.id
            elif isinstance(each, ast.Attribute) and isinstance(each.value, ast.Name):
                of, name = imports.get(each.value.id, ("", "-"))
                if not name:
                    yield of, each.attr

    def _asked(self, module: str) -> Iterator[Name]:
        """Kernels that a module names outside kernels."""
        kernels = {id(node) for node in self.kernels.values()}
        queue: list[ast.AST] = [self.trees[module]]
        while queue:
            node = queue.pop()
            if id(node) in kernels or (isinstance(node, ast.Call) and _name(node.func) == "plain"):
                continue
            if isinstance(node, ast.Name | ast.Attribute) and isinstance(node.ctx, ast.Load):
                yield from (name for name in self._named(module, node) if name in self.kernels)
            queue += ast.iter_child_nodes(node)


def digest(folder: Path, files: list[str]) -> str:
    """SHA-256 over files of a folder, as `inercal.foundation._jit` takes it when kernels are first asked for."""
    found = hashlib.sha256()
    for file in files:
        found.update((folder / file).read_bytes() + b"\0")
    return found.hexdigest()


def _module(path: Path) -> str:
    """Name of the module of a file."""
    return ".".join(path.with_suffix("").parts).removesuffix(".__init__")


def _bound(node: ast.AST) -> set[str]:
    """Arguments and variables of a function."""
    if not isinstance(node, ast.FunctionDef):
        return set()
    stored = {
        each.id for each in ast.walk(node) if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Store)
    }
    return stored | {each.arg for each in ast.walk(node) if isinstance(each, ast.arg)}


def _name(node: ast.AST) -> str:
    return node.id if isinstance(node, ast.Name) else ""


def _compiles(decorator: ast.expr) -> bool:
    return _name(decorator) in DECORATORS


def _tops(tree: ast.Module) -> dict[str, list[ast.stmt]]:
    """Statements at the top of a module that bind each name."""
    found: dict[str, list[ast.stmt]] = {}
    for node in tree.body:
        if isinstance(node, ast.Import | ast.ImportFrom):
            continue
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names = {node.name}
        else:
            names = {
                each.id
                for each in ast.walk(node)
                if isinstance(each, ast.Name) and isinstance(each.ctx, ast.Store)
            }
        for name in names:
            found.setdefault(name, []).append(node)
    return found
