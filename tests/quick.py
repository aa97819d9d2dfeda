"""The tests that a change asks for, nearest rooms first: what `make quick` runs.

    python tests/quick.py [SECONDS]

What differs from the merge base with main is a change; so is what is not committed yet. On main with nothing changed,
the last commit is the change. A test file is asked for if it changed or imports, directly or through others, what
changed; the fewer imports lie between, and the fewer modules it imports itself, the sooner it runs. The tests of the
house and the laws always run first.
"""

from __future__ import annotations

import ast
import functools
import re
import subprocess
import sys
from collections import deque
from pathlib import Path

from test_architecture import PACKAGE, SOURCES, TREES

ROOT = Path(__file__).parents[1]
SECONDS = 27.0
"""Tests that have not begun after this time are left to `make test` [s]."""

FILES = 60
"""The nearest test files that are read at all: reading them all would take half of the time."""

ALWAYS = ("tests/test_architecture.py", "tests/laws")
PAGES = "tests/docs/test_pages.py"
APART = "docs/how-to/repeat-and-compare.md"
OF_PAGES = ("tests/docs/test_claims.py", "tests/docs/test_readme.py")


def git(*words: str) -> list[str]:
    """Lines that git prints; none where it fails."""
    done = subprocess.run(["git", *words], cwd=ROOT, capture_output=True, text=True, check=False)
    return done.stdout.splitlines()


def changed_files() -> list[str]:
    """Paths from the root that differ from the merge base with main, or from the commit before."""
    bases = [git("merge-base", "HEAD", main) for main in ("main", "origin/main")]
    base = next((found[0] for found in bases if found), "HEAD")
    new = git("ls-files", "--others", "--exclude-standard")
    return git("diff", "--name-only", base) + new or git("diff", "--name-only", "HEAD~1")


def helpers() -> dict[str, Path]:
    """Modules that tests share, and those of the benchmarks, by the names under which tests import them."""
    own = {path.stem: path for path in sorted((ROOT / "tests").rglob("*.py"))}
    folder = ROOT / "benchmarks"
    others = {
        ".".join(path.relative_to(folder).with_suffix("").parts).removesuffix(".__init__"): path
        for path in sorted(folder.rglob("*.py"))
    }
    return {name: path for name, path in (others | own).items() if name != "conftest"}


def imported(tree: ast.Module, modules: dict[str, Path]) -> set[str]:
    """Those of the modules that a module names: in any import, or in a text such as `inercal.cli.package:new_imu`."""
    found = set()
    for node in ast.walk(tree):
        match node:
            case ast.Import():
                found |= {alias.name for alias in node.names}
            case ast.ImportFrom(module=str(package)):
                names = {f"{package}.{alias.name}" for alias in node.names}
                found |= names & modules.keys() or {package}
            case ast.Constant(value=str(text)) if text.startswith("inercal."):
                found.add(text.split(":")[0])
    return found & modules.keys()


@functools.cache
def graph() -> tuple[dict[str, Path], dict[str, set[str]]]:
    """Files of the modules of the package, the benchmarks and the tests; and what each imports."""
    others = helpers()
    modules = SOURCES | others
    parsed = TREES | {name: ast.parse(path.read_text(encoding="utf-8")) for name, path in others.items()}
    return modules, {name: imported(tree, modules) - {name} for name, tree in parsed.items()}


def distances(begin: set[str], uses: dict[str, set[str]]) -> dict[str, int]:
    """How many imports lie between a module and the nearest of those it begins with; none if it uses none of them."""
    users: dict[str, set[str]] = {name: set() for name in uses}
    for name, used in uses.items():
        for each in used:
            users[each].add(name)
    found, queue = dict.fromkeys(sorted(begin), 0), deque(sorted(begin))
    while queue:
        name = queue.popleft()
        for user in sorted(users[name] - found.keys()):
            found[user] = found[name] + 1
            queue.append(user)
    return found


def touched(files: list[str], modules: dict[str, Path]) -> set[str]:
    """Modules whose file is changed; for what lies among the sources and is no module, the package it lies in."""
    by_path = {path: name for name, path in modules.items()}
    found = set()
    for file in files:
        path = ROOT / file
        if path.suffix != ".py" and PACKAGE in path.parents:
            path = next(
                folder / "__init__.py" for folder in path.parents if (folder / "__init__.py").exists()
            )
        found |= {by_path[path]} if path in by_path else set()
    return found


def pages(files: list[str]) -> list[str]:
    """The tests of changed pages: what they run, and what they claim."""
    changed = [
        file for file in files if re.fullmatch(r"README\.md|docs/.*\.md", file) and (ROOT / file).exists()
    ]
    runs = [
        file
        for file in changed
        if file != APART and re.search(r"^```(python|console)$", (ROOT / file).read_text("utf-8"), re.M)
    ]
    return [f"{PAGES}::test_a_page_runs_and_prints_what_it_shows[{file}]" for file in runs] + (
        list(OF_PAGES) if changed else []
    )


def selected(files: list[str]) -> list[str]:
    """Test files, and tests of pages, that the changed files ask for: in the order in which they run."""
    modules, uses = graph()
    found = distances(touched(files, modules), uses)
    tests = {name: modules[name].relative_to(ROOT).as_posix() for name in found if name.startswith("test_")}
    near = sorted(tests, key=lambda name: (found[name], len(uses[name]), tests[name]))
    return [
        *ALWAYS,
        *pages(files),
        *[tests[name] for name in near if not tests[name].startswith(ALWAYS)][:FILES],
    ]


def main() -> int:
    """Run them."""
    seconds = sys.argv[1] if len(sys.argv) > 1 else SECONDS
    choice = ["-m", "not slow and not campaign", f"--within={seconds}", "--slow-rule=fail"]
    spread = ["-n", "2", "--dist", "loadfile", "--no-loadscope-reorder"]
    words = [sys.executable, "-m", "pytest", "-q", *choice, *spread, *selected(changed_files())]
    return subprocess.run(words, cwd=ROOT, check=False).returncode


if __name__ == "__main__":
    sys.exit(main())
